"""Tables of branches: the points of each, and values that some branches lack."""

import numpy as np
import pytest

from beamsim.labelled import Layout, Variable
from beamsim.results.branch import numbered_points, of_multipliers, of_states, rows_by_owner

OWNERS = Layout(
    "owners",
    "Rows.",
    {
        "owner": Variable(("owner",), "1", "number of the owner, from 0", int),
        "level": Variable(("owner",), "N", "level"),
        "x": Variable(("owner",), "m", "place of the owner"),
        "kind": Variable((), "", "what all are", str),
    },
)
ROWS = Layout(
    "rows",
    "Points.",
    {
        "point": Variable(("point",), "1", "number of the point", int),
        "owner": Variable(("point",), "1", "number of the owner, from 0", int, names="owners/owner"),
        "point_number": Variable(("point",), "1", "number of the point of its owner, from 1", int),
        "x": Variable(("point",), "m", "place"),
        "probe": Variable(("probe",), "1", "name", str),
        "y": Variable(("probe", "point"), "m", "peak"),
    },
)


@pytest.mark.parametrize("sizes", [(3, 0, 2), (4,), (0, 1)])
def test_each_owner_has_its_rows_and_what_its_own_row_says(sizes):
    count, x = len(sizes), np.arange(sum(sizes)) ** 2.0
    owners = OWNERS.dataset(
        {"owner": np.arange(count), "level": 10.0 * np.arange(count), "x": np.zeros(count), "kind": "all"}
    )
    rows = ROWS.dataset({**numbered_points(sizes, "owner"), "x": x, "probe": ["a", "b/c"], "y": np.array([x, -x])})
    found = rows_by_owner(owners, rows, "owner")
    assert [of["x"].values.tolist() for of in found] == [part.tolist() for part in np.split(x, np.cumsum(sizes)[:-1])]
    for k, (of, size) in enumerate(zip(found, sizes, strict=True)):
        assert (of["level"].item(), of["level"].unit, of["kind"].item()) == (10.0 * k, "N", "all")
        assert of["point_number"].values.tolist() == list(range(1, size + 1))
        np.testing.assert_array_equal(of["y"].sel(probe="b/c").values, -of["x"].values)
        assert of["x"].dims == ("point",)  # that of the rows, not the owner's place


def test_a_branch_with_fewer_multipliers_has_no_others():
    values = of_multipliers([np.array([[1 + 1j, 2.0]]), np.array([[3.0], [4.0]])])
    np.testing.assert_array_equal(values["floquet_multipliers_real"], [[1, 2], [3, np.nan], [4, np.nan]])
    np.testing.assert_array_equal(values["floquet_multipliers_imag"], [[1, 0], [0, np.nan], [0, np.nan]])
    assert values["multiplier"].tolist() == [1, 2]


def test_states_are_coordinates_velocities_and_internal_states():
    states = np.arange(10.0).reshape(2, 5)
    values = of_states(states, 2)
    np.testing.assert_array_equal(values["coordinates"], states[:, :2])
    np.testing.assert_array_equal(values["coordinate_velocities"], states[:, 2:4])
    np.testing.assert_array_equal(values["internal_states"], states[:, 4:])
    assert "internal_states" not in of_states(states[:, :4], 2)
