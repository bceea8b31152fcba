"""``beamsim run --against reference``: the same case by the reference integrator."""

import json
from pathlib import Path

import pytest

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.trust.reference import RTOL, against, tolerance_of
from tests.helpers.commands import invoke

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
    "run": {"duration": 2.5, "sample_rate": 200.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return beamsim.run(Scenario.model_validate(CASE))


def test_it_agrees_to_its_tolerance(result):
    assert result.work.events > 8
    values = against(result, 1e-11).summary["against"]
    assert values["agrees_until_s"] == pytest.approx(2.5)
    assert values["largest_state_difference"] < 1e-8
    assert values["largest_time_difference_s"] < 1e-8
    assert values["method"] == "reference (DOP853, rtol 1e-11)"
    for places in values["figures"].values():
        for figure in places.values():
            assert figure["stepped"] == pytest.approx(figure["exact"], rel=1e-7, abs=1e-12)


def test_a_wrong_motion_is_seen(result):
    """The twin: the integration of another case differs."""
    from dataclasses import replace

    other = result.scenario.model_copy(update={"gravity": 0.5})
    values = against(replace(result, scenario=other), 1e-6).summary["against"]
    assert values["largest_state_difference"] > 1e-2 or values["agrees_until_s"] < 1.0


def test_a_run_that_is_integrated_itself_is_compared_with_another_method():
    cubic = {"name": "cubic", "mass": 1, "kind": "cubic", "stiffness": 4000.0}
    case = {**CASE, "chain": {**CASE["chain"], "springs_to_ground": [cubic], "snubbers": []}}
    values = against(beamsim.run(Scenario.model_validate(case)), 1e-9).summary["against"]
    assert values["method"].startswith("reference (LSODA")
    assert 1e-13 < values["largest_state_difference"] < 1e-6


def test_the_command_prints_one_table_and_json(tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text((CONFIGS / "one_sided_65hz.yaml").read_text())
    sets = ("run.duration=0.005 s", "run.spectrum.last=0.002 s", "run.convergence=off", "reduction.modes=3")
    short = [x for override in sets for x in ("--set", override)] + ["--no-plots", "-o", str(tmp_path / "a.h5")]
    done = invoke("run", case, *short, "--against", "reference:1e-7", "-v")
    assert done.exit_code == 0, done.output
    assert "reference (DOP853, rtol 1e-07)" in done.stdout
    assert "processor time" in done.stdout
    done = invoke("run", case, *short, "--against", "reference", "--json")
    values = json.loads(done.stdout)["against"]
    assert values["figures"]["peak_displacement"]["tip"]["exact"] > 0
    kept = beamsim.open_result(tmp_path / "a.h5")
    assert kept.against.method == "reference (DOP853, rtol 1e-08)"
    assert kept.against.figures[0].figure == "peak displacement"


@pytest.mark.parametrize("text", ["newmark:5e-5", "reference:x", "reference:-1", "reference:nan", "reference:2", ""])
def test_what_is_no_reference(text):
    with pytest.raises(ScenarioError, match="reference:1e-10"):
        tolerance_of(text)
    assert (tolerance_of("reference"), tolerance_of("Reference:1e-9")) == (RTOL, 1e-9)


def test_friction_under_the_force_of_a_snubber_has_no_reference():
    case = beamsim.load_scenario(CONFIGS / "rubbing_stop.yaml", {"run.duration": "10 ms"})
    with pytest.raises(ScenarioError, match="--against"):
        against(beamsim.run(case))


def test_a_comparison_that_is_stopped_leaves_the_run(result):
    left = 20

    def stop():
        nonlocal left
        left -= 1
        return left <= 0

    part = against(result, 1e-11, stop)
    assert left <= 0
    assert part.against is None
    assert part.outcome.interrupted
    assert part.status == part.summary["status"] == "interrupted during the comparison with the reference integrator"
    assert part.probes is result.probes
    assert result.complete
