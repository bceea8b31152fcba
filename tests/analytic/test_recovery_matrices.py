"""Rows of a recovery matrix against what else knows them."""

import numpy as np
import pytest
import yaml
from shipped import config_path

import beamsim
from beamsim.errors import ScenarioError
from beamsim.matrix_files import read_op4, write_matrices
from beamsim.scenario import load_scenario

PANEL = config_path("imported_panel")


def scenario(folder, rows=None, outputs=(), names=None, matrix=None):
    """The imported panel, undamped, with a matrix of recovery for the names of its rows."""
    case = yaml.safe_load(PANEL.read_text())
    body = case["bodies"]["panel"]
    for key in ("mass", "stiffness"):
        body[key]["file"] = str(PANEL.parent / body[key]["file"])
    body["dofs"] = str(PANEL.parent / body["dofs"])
    body["damping"] = {"kind": "modal", "ratio": 0.0}
    if rows is not None:
        write_matrices(folder / "recovery.op4", {"oee": np.array(list(rows.values())) if matrix is None else matrix})
        body["recovery"] = {"file": "recovery.op4", "name": "OEE", "rows": names or list(rows)}
    case["run"] = {
        "duration": 0.2, "sample_rate": 5000, "convergence": "off", "start": "rest",
        "outputs": [{"kind": "recovered", **output} for output in outputs]
        + [{"name": "reaction", "kind": "reaction_force", "support": "node 15", "body": "panel"}],
    }  # fmt: skip
    case["reduction"] = {"modes": "all"}
    (folder / "case.yaml").write_text(yaml.safe_dump(case))
    return load_scenario(folder / "case.yaml")


@pytest.fixture(scope="module")
def matrices():
    return {each.name: each.values.toarray() for each in read_op4(PANEL.parents[1] / "matrices" / "strip.op4")}


@pytest.fixture(scope="module")
def dofs():
    table = PANEL.parents[1] / "matrices" / "strip_dofs.csv"
    return [tuple(line.split(",")[:2]) for line in table.read_text().split()[1:]]


def test_motion_elsewhere_and_the_reaction_of_the_base(tmp_path, matrices, dofs):
    """A row of ones is the motion of its node; rows of K and M at the base add up to its reaction."""
    tip, base = dofs.index(("14", "z")), dofs.index(("15", "z"))
    unit = np.zeros(len(dofs))
    unit[tip] = 1.0
    rows = {"tip": unit, "elastic": matrices["kxx"][base], "inertia": matrices["mxx"][base]}
    outputs = [
        {"name": "moved", "row": "tip", "unit": "m"},
        {"name": "speed", "row": "tip", "motion": "velocity", "unit": "m/s"},
        {"name": "shaken", "row": "tip", "motion": "acceleration", "unit": "m/s^2"},
        {"name": "elastic", "row": "elastic", "unit": "N"},
        {"name": "inertia", "row": "inertia", "motion": "acceleration", "unit": "N"},
    ]
    result = beamsim.run(scenario(tmp_path, rows, outputs))
    assert result.summary["contacts"]["corner"] > 2
    values = {name: np.asarray(output.values) for name, output in result["histories"].by_label("output_value").items()}
    corner = result["histories"].sel(probe="corner")
    of_corner = {"moved": "displacement", "speed": "velocity", "shaken": "absolute_acceleration"}
    expected = {name: corner[quantity].values for name, quantity in of_corner.items()}
    for name, known in (expected | {"reaction": values["elastic"] + values["inertia"]}).items():
        assert np.abs(values[name] - known).max() <= 1e-8 * np.abs(known).max(), name
    assert result["histories"]["output_unit"].sel(output="elastic").item() == "N"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"outputs": [{"name": "a", "row": "tipp"}]},
            r"run.outputs\[0\].row = tipp is an unknown row .* did you mean tip\?",
        ),
        (
            {"names": ["tip", "root"]},
            "recovery has 1 rows and 27 columns, but 2 rows are named and there are 27",
        ),
        ({"names": ["tip", "tip"]}, "names tip twice"),
        ({"matrix": np.ones((1, 7))}, "recovery has 1 rows and 7 columns, but 1 rows are named and there are 27"),
    ],
)
def test_mistakes_are_located(tmp_path, dofs, change, message):
    given = {"rows": {"tip": np.ones(len(dofs))}, "outputs": [{"name": "a", "row": "tip"}], **change}
    with pytest.raises(ScenarioError, match=message):
        beamsim.run(scenario(tmp_path, **given))


def test_a_body_without_a_recovery_matrix(tmp_path):
    with pytest.raises(ScenarioError, match=r"outputs\[0\] needs a recovery matrix, which panel lacks; give recovery"):
        scenario(tmp_path, outputs=[{"name": "a", "row": "tip"}])
