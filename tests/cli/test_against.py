"""``beamsim run --against``: the same case by a time stepper that shares nothing with the exact flow."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import beamsim
from beamsim.analyses.run.against import Stepper, against
from beamsim.cli.app import app
from beamsim.errors import ScenarioError
from beamsim.flow.time_stepping import newmark
from beamsim.flow.time_stepping_kernels import march_in_steps
from beamsim.scenario import Scenario

CONFIGS = Path(__file__).parents[2] / "configs"
CASE = {
    "chain": {
        "masses": [1.0, 0.7],
        "springs": [50.0, 30.0, 0.0],
        "dashpots": [0.3, 0.1, 0.0],
        "snubbers": [
            {"name": "a", "mass": 1, "side": "below", "stiffness": 900.0, "gap": 0.01, "mounted_on": "ground"},
            {
                "name": "b", "mass": 2, "side": "above", "stiffness": 400.0, "gap": 0.02, "law": "no_tension",
                "damping": {"kind": "viscous", "coefficient": 8.0},
            },
        ],
        "springs_to_ground": [
            {"name": "bent", "mass": 2, "kind": "piecewise_linear", "breakpoints": [0.03], "stiffnesses": [5.0, 90.0]}
        ],
    },
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 2.0, "frequency": 1.0},
    "probes": [{"name": "one", "mass": 1}, {"name": "two", "mass": 2}],
    "run": {"duration": 4.0, "sample_rate": 200.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return beamsim.run(Scenario.model_validate(CASE))


def compared(result, method):
    values = against(result, Stepper.parse(method)).summary["against"]
    assert result.work.events > 8
    return values


@pytest.mark.slow
def test_newmark_converges_to_the_exact_motion(result):
    """Faster than with the step; where contacts fall within a step disturbs the second order."""
    coarse, fine = (compared(result, f"newmark:{step}") for step in (2e-3, 1.25e-4))
    assert fine["agrees_until_s"] == pytest.approx(4.0)
    assert fine["largest_state_difference"] < 1e-3
    assert coarse["largest_state_difference"] > 25 * fine["largest_state_difference"]
    assert len(march_in_steps.signatures) == 1  # the steps that compile and those that count are of one kind


def test_dop853_agrees_to_its_tolerance(result):
    values = compared(result, "dop853:1e-11")
    assert values["agrees_until_s"] == pytest.approx(4.0)
    assert values["largest_state_difference"] < 1e-6
    assert values["largest_time_difference_s"] < 1e-6
    for places in values["figures"].values():
        for figure in places.values():
            assert figure["stepped"] == pytest.approx(figure["exact"], rel=2e-3, abs=1e-12)


def test_hht_damps(result):
    """Little here: the motion is that of Newmark's method."""
    values = compared(result, "hht:2.5e-4")
    assert values["largest_state_difference"] < 3e-3
    assert "alpha -0.05" in values["method"]


def test_a_wrong_motion_is_seen(result):
    """The twin: a stepper with another stiffness differs."""
    from dataclasses import replace

    other = result.scenario.model_copy(update={"gravity": 0.5})
    values = against(replace(result, scenario=other), Stepper.parse("newmark:5e-4")).summary["against"]
    assert values["largest_state_difference"] > 1e-2 or values["agrees_until_s"] < 1.0


def test_cubic_springs():
    """Newmark with its Newton iterations against the run's own integration."""
    cubic = {"name": "cubic", "mass": 1, "kind": "cubic", "stiffness": 4000.0}
    case = {**CASE, "chain": {**CASE["chain"], "springs_to_ground": [cubic], "snubbers": []}}
    values = against(beamsim.run(Scenario.model_validate(case)), Stepper.parse("newmark:5e-4")).summary["against"]
    assert 1e-9 < values["largest_state_difference"] < 1e-3


def test_energy_of_a_free_undamped_motion_is_kept_by_newmark():
    """Average acceleration conserves the energy of a linear system exactly."""
    from beamsim.contacts.contacts import Contacts
    from beamsim.contacts.equilibrium import CubicSprings
    from beamsim.system.equations import Forcing, PiecewiseLinearSystem

    none = Contacts(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([4.0, 90.0]), np.zeros((2, 2)), none, np.zeros(2))
    cubic = CubicSprings(np.zeros((0, 2)), np.zeros(0))
    start = np.array([0.3, 0.1, -1.0, 2.0])
    motion = newmark(system, Forcing(np.zeros((0, 2)), ()), cubic, None, start, 50.0, 0.05, np.eye(2))
    energy = np.sum(motion.velocity**2, axis=1) + motion.displacement**2 @ system.stiffness
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


def test_the_command_prints_one_table_and_json(tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text((CONFIGS / "one_sided_65hz.yaml").read_text())
    short = [
        "--set",
        "run.duration=0.05 s",
        "--set",
        "run.spectrum.last=0.02 s",
        "--no-plots",
        "-o",
        str(tmp_path / "a.h5"),
    ]
    done = CliRunner().invoke(app, ["run", str(case), *short, "--against", "newmark:5e-5"])
    assert done.exit_code == 0, done.output
    assert "newmark, step 5e-05 s" in done.stdout
    assert "processor time" in done.stdout
    done = CliRunner().invoke(app, ["run", str(case), *short, "--against", "hht:5e-5", "--json"])
    values = json.loads(done.stdout)["against"]
    assert values["figures"]["peak_displacement"]["tip"]["exact"] > 0
    kept = beamsim.open_result(tmp_path / "a.h5")
    assert kept.against.method.startswith("hht")
    assert kept.against.figures[0].figure == "peak displacement"


@pytest.mark.parametrize("text", ["euler", "newmark:x", "newmark:-1", "newmark:nan", ""])
def test_what_is_no_time_stepper(text):
    with pytest.raises(ScenarioError, match="newmark:5e-5"):
        Stepper.parse(text)
    assert Stepper.parse("newmark:5e-5s") == Stepper("newmark", 5e-5)


def test_too_many_steps(result):
    with pytest.raises(ScenarioError, match="use a step of at least"):
        against(result, Stepper.parse("newmark:1e-9"))


@pytest.mark.parametrize(("method", "asked"), [("newmark:1e-5", 4), ("dop853", 100)])
def test_a_comparison_that_is_stopped_leaves_the_run(result, method, asked):
    """Newmark's 400,000 steps ask before every thousand; DOP853 asks at each evaluation."""
    left = asked

    def stop():
        nonlocal left
        left -= 1
        return left <= 0

    part = against(result, Stepper.parse(method), stop)
    assert left == 0
    assert part.against is None
    assert part.outcome.interrupted
    assert part.status == part.summary["status"] == "interrupted during the comparison with a time stepper"
    assert part.probes is result.probes
    assert result.complete


def test_steps_in_several_calls_are_those_of_one(result, monkeypatch):
    whole = against(result, Stepper.parse("newmark:1e-3")).summary["against"]
    monkeypatch.setattr("beamsim.flow.time_stepping.STEPS_OF_A_CALL", 7)
    parts = against(result, Stepper.parse("newmark:1e-3")).summary["against"]
    for values in (whole, parts):
        del values["processor_time_s"]
    assert whole == parts
