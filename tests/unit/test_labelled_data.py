"""Labelled datasets: parts by label, units of members, what is missing, and files that do not hold what is declared."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beamsim.labelled import Item, LargeArray, Layout, Variable
from beamsim.store.results import read_items, write_items

pytestmark = pytest.mark.quick

NAMES = ("a/b", ".", "CON", "größe", "", "tip velocity")
LAYOUT = Layout(
    "motions",
    "Motions of places.",
    {
        "time": Variable(("time",), "s", "time"),
        "place": Variable(("place",), "1", "name of the place", str),
        "stop": Variable(("stop",), "1", "name of the stop", str),
        "motion": Variable(("place", "time"), "{way}", "motion along {direction}"),
        "met": Variable(("place", "time"), "1", "whether it met something", bool, flags=("free", "met")),
        "count": Variable(("place",), "1", "how often", int, optional=True),
        "push": Variable(("stop", "time"), "N", "push of a stop"),
        "base": Variable(("time",), "{base}/s", "speed of the base", optional=True),
        "scale": Variable((), "1", "of the drawing", optional=True),
    },
)


def values(places=NAMES, samples=4):
    shape = len(places), samples
    return {
        "time": np.arange(float(samples)), "place": places, "motion": np.arange(float(np.prod(shape))).reshape(shape),
        "met": np.arange(np.prod(shape)).reshape(shape) % 3 == 0,
    }  # fmt: skip


def words(places=NAMES):
    ways = (("m", "z"), ("rad", "ry"))
    return {"place": [dict(zip(("way", "direction"), ways[k % 2], strict=True)) for k in range(len(places))]}


def test_a_part_has_the_values_and_the_unit_of_its_label():
    made = LAYOUT.dataset(values(), words())
    assert made.labels("place") == list(NAMES)
    for k, name in enumerate(NAMES):
        part = made["motion"].sel(place=name)
        assert (part.dims, part.unit) == (("time",), ("m", "rad")[k % 2])
        np.testing.assert_array_equal(part.values, values()["motion"][k])
        assert made["motion"].sel(place=name, time=2.0).item() == values()["motion"][k, 2]
        np.testing.assert_array_equal(made.sel(place=name)["motion"].values, part.values)
        assert made.sel(place=name)["motion"].unit == part.unit
        np.testing.assert_array_equal(made.by_label("motion")[name], part.values)
    assert made["motion"].unit == "see units_of_each"
    assert made["motion"].meaning == "motion along z | motion along ry"
    np.testing.assert_array_equal(made.sel(place="CON")["time"].values, made["time"].values)
    assert LAYOUT.dataset({**values(), "scale": 2.0}, words()).sel(place="CON")["scale"].item() == 2.0


def test_rows_of_a_table_are_found_by_what_they_belong_to():
    """Rows in any order, a name without rows, values along another dimension too; what is not along rows stays."""
    layout = Layout(
        "parts",
        "Places of parts.",
        {
            "part": Variable(("part",), "1", "name of the part", str),
            "row": Variable(("row",), "1", "number of the row", int),
            "row_part": Variable(("row",), "1", "number of the part", int, names="parts/part"),
            "position": Variable(("row",), "m", "position"),
            "time": Variable(("time",), "s", "time"),
            "motion": Variable(("time", "row"), "m", "motion"),
        },
    )
    row, owner = np.arange(5), np.array([2, 0, 2, 0, 0])
    known = {"part": ["a/b", "", "größe"], "row": row, "row_part": owner, "time": np.array([0.0, 1.0])}
    groups = layout.dataset({**known, "position": 0.1 * row, "motion": np.array([row, -row])}).groups("row_part")
    assert list(groups) == ["a/b", "", "größe"]
    for name, rows in (("a/b", [1, 3, 4]), ("", []), ("größe", [0, 2])):
        np.testing.assert_array_equal(groups[name]["position"], 0.1 * np.array(rows))
        np.testing.assert_array_equal(groups[name]["motion"], [rows, -np.array(rows)])
        assert (groups[name].labels("row"), groups[name].labels("time")) == (rows, [0.0, 1.0])


def test_a_wrong_name_is_refused_with_those_there_are():
    made = LAYOUT.dataset(values(), words())
    with pytest.raises(KeyError, match=r"no place 'tip' in motion; there are a/b, \., CON, größe"):
        made["motion"].sel(place="tip")
    with pytest.raises(KeyError, match="motion is along place, time, not probe"):
        made["motion"].sel(probe="tip")
    with pytest.raises(KeyError, match="motions has no force; it has time, place, motion, met"):
        made["force"]


def test_a_dimension_without_names_is_left_out_with_what_is_along_it():
    made = LAYOUT.dataset(values((), 3), words(()))
    assert list(made) == ["time"]
    assert made.labels("place") == []
    assert made.by_label("motion") == {}
    assert list(LAYOUT.dataset({"time": np.zeros(0), "base": np.zeros(0)}, base="m")) == ["time", "base"]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"motion": np.zeros((6, 5))}, r"motion is along place, time, not of the shape \(6, 5\)"),
        ({"push": np.zeros(4), "stop": ["s"]}, r"push is along stop, time, not of the shape \(4,\)"),
        ({"height": 1.0}, "motions has no height"),
    ],
)
def test_what_is_not_as_declared_is_refused(changed, message):
    with pytest.raises(TypeError, match=message):
        LAYOUT.dataset(values() | changed, words())


def test_what_is_declared_and_not_given_is_refused():
    given = values()
    del given["motion"]
    with pytest.raises(TypeError, match="motions lacks motion"):
        LAYOUT.dataset(given, words())


def from_file(items, path):
    import h5py

    write_items({"/": Item()} | items, path)
    with h5py.File(path) as file:
        return read_items(file)


def same(one, other):
    assert list(one) == list(other)
    for name, array in one.items():
        of = other[name]
        assert (array.dims, array.unit, array.meaning) == (of.dims, of.unit, of.meaning), name
        assert array.values.dtype == of.values.dtype, name
        np.testing.assert_array_equal(array.values, of.values, err_msg=name)


@pytest.mark.parametrize("places", [NAMES, NAMES[:1], ()])
def test_a_dataset_comes_back_from_a_file(places, tmp_path):
    made = LAYOUT.dataset(values(places) | {"count": np.arange(len(places))}, words(places))
    same(LAYOUT.read(from_file(made.read(), tmp_path / "case.h5")), made)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("motion", None, "/motions/motion is missing"),
        ("motion", {"axes": ("/motions/time", "/motions/place")}, "/motions/motion is along time, place, not place"),
        ("motion", {"array": np.zeros((6, 4), dtype=int)}, "/motions/motion holds int64, not float"),
        ("met", {"array": np.zeros((6, 4))}, "/motions/met holds float64, not bool"),
        ("place", {"array": np.arange(6)}, "/motions/place holds int64, not str"),
        ("count", {"scale": True}, "/motions/count is along count, not place"),
    ],
)
def test_a_file_that_holds_something_else_is_refused(name, change, message):
    items = LAYOUT.dataset(values() | {"count": np.arange(6)}, words()).read()
    path = f"/motions/{name}"
    items = {key: item for key, item in items.items() if change is not None or key != path}
    if change is not None:
        items[path] = replace(items[path], **change)
    with pytest.raises((KeyError, ValueError), match=message):
        LAYOUT.read(items)


READ = []


class Counted(LargeArray):
    """An array that notes what is read of it."""

    def part(self, index):
        READ.append(index)
        return Counted((self.shape[1],), self.dtype)

    def __array__(self, dtype=None, copy=None):
        return np.zeros(self.shape)


def test_a_part_is_read_alone_and_once():
    made = LAYOUT.dataset(values(), words())
    made.items_by_path["/motions/motion"].array = Counted((6, 4), np.dtype(float))
    for _ in range(3):
        assert made["motion"].sel(place="CON").values.shape == (4,)
    assert [(2, slice(None))] == READ


def test_xarray_has_the_same():
    pytest.importorskip("xarray")
    made = LAYOUT.dataset(values(), words())
    other = made.to_xarray()
    assert set(other.coords) == {"time", "place"}
    np.testing.assert_array_equal(other.motion.sel(place="größe"), made["motion"].sel(place="größe"))
    assert other.met.attrs["long_name"] == "whether it met something"


COUNTS = Layout(
    "counts",
    "A table of counts.",
    {
        "number": Variable(("number",), "1", "number of the row", int),
        "length": Variable(("number",), "{unit}", "a length"),
        "hits": Variable(("number",), "1", "how many hits", int, optional=True),
        "word": Variable(("number",), "", "a word", str, optional=True),
    },
)


@pytest.mark.parametrize("selected", [slice(1, 3), np.array([False, True, True])])
def test_selected_rows_keep_their_units_and_what_is_not_known(selected):
    rows = [SimpleNamespace(length=float(k), hits=hits, word="a") for k, hits in enumerate((1, None, 3))]
    part = COUNTS.table(rows, [{"unit": "m"}, {"unit": "rad"}, {"unit": "s"}]).isel(number=selected)
    assert (part["number"].values.tolist(), part["length"].values.tolist()) == ([2, 3], [1.0, 2.0])
    assert (part["hits"].absent, part["hits"].values[1]) == ({0}, 3)
    assert [part["length"].sel(number=number).unit for number in (2, 3)] == ["rad", "s"]


def test_a_table_takes_its_columns_from_the_attributes_of_its_rows():
    rows = [SimpleNamespace(length=1.5, hits=None, word="a"), SimpleNamespace(length=None, hits=7, word="b")]
    made = COUNTS.table(rows, [{"unit": "m"}, {"unit": "rad"}])
    assert made["number"].values.tolist() == [1, 2]
    np.testing.assert_array_equal(made["length"].values, [1.5, np.nan])
    assert (made["hits"].values.dtype.kind, made["hits"].absent) == ("i", {0})
    assert made["hits"].values[1] == 7
    assert made["length"].sel(number=2).unit == "rad"
    given = COUNTS.table(rows, [{"unit": "m"}] * 2, number=np.array([4, 9]), word=["c", None])
    assert given["number"].values.tolist() == [4, 9]
    assert (given["word"].values.tolist(), given["word"].absent) == (["c", ""], {1})
    nobody = COUNTS.table([SimpleNamespace(length=1.0, hits=None, word=None)], [{"unit": "m"}])
    assert list(nobody) == ["number", "length"]


def test_a_table_without_rows_has_nobody_to_say_its_unit():
    made = COUNTS.table([], [])
    assert (made["length"].values.size, made["length"].unit) == (0, "1")
    with pytest.raises(KeyError, match="unit"):  # which is not said of rows
        COUNTS.table([SimpleNamespace(length=1.0, hits=None, word=None)])
