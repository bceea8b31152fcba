"""``beamsim run --against reference``: the same case by the reference integrator."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sampling import first_apart
from shipped import PATHS, asked, config_path, one_of_each_sort, shipped

import beamsim
from beamsim.errors import ScenarioError
from beamsim.outcomes import ExitCode, exit_code
from beamsim.scenario import Scenario
from beamsim.scenario.run import Reduction, SpectrumSettings
from beamsim.system.build import build_system
from beamsim.trust.reference import RTOL, compare_with_reference, tolerance_of
from tests.helpers.commands import invoke

RUNS = one_of_each_sort([path for path in PATHS if "run" in asked(path) and shipped(path).study is None])
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


def figures_of(compared):
    """Name, place and values of everything that is compared."""
    return [(name, place, of) for name, places in compared["values"].items() for place, of in places.items()]


def test_it_agrees_to_its_tolerance(result):
    assert result.summary["solver_events"] > 8
    values = compare_with_reference(result, 1e-11).summary["against"]
    assert values["agrees_until_s"] == pytest.approx(2.5)
    assert values["largest_state_difference"] < 1e-8
    assert values["largest_time_difference_s"] < 1e-8
    assert values["method"] == "reference (DOP853, rtol 1e-11)"
    for places in values["values"].values():
        for figure in places.values():
            assert figure["stepped"] == pytest.approx(figure["exact"], rel=1e-7, abs=1e-12)


def test_accelerations_of_stiff_modes_follow_the_tolerance():
    """The absolute tolerance stayed at 1e-12, by which that of a mode of 1600 Hz was wrong by 1e-5 at any tolerance."""
    light = {"masses": [1.0, 0.7, 0.01], "springs": [50.0, 30.0, 1e6, 0.0], "dashpots": [0.3, 0.1, 2.0, 0.0]}
    case = {**CASE, "chain": {**CASE["chain"], **light}, "probes": [{"name": "light", "mass": 3}]}
    case["run"] = {"duration": 0.05, "sample_rate": 200.0, "convergence": "off", "spectrum": {"frequencies": [50.0]}}
    compared = compare_with_reference(beamsim.run(Scenario.model_validate(case)), 1e-11).summary["against"]
    (peak,) = compared["values"]["peak_acceleration"].values()
    assert peak["stepped"] == pytest.approx(peak["exact"], rel=1e-7)


def test_a_wrong_motion_is_seen(result):
    """The twin: the integration of another case differs, and the run is not reliable."""
    assert compare_with_reference(result, 1e-6).complete
    softer = {**CASE, "chain": {**CASE["chain"], "springs": [45.0, 30.0, 0.0]}}
    wrong = compare_with_reference(replace(result, scenario=Scenario.model_validate(softer)), 1e-6)
    assert wrong.summary["against"]["largest_state_difference"] > 0.02
    assert exit_code(wrong.outcome) == ExitCode.NOT_CONVERGED
    assert wrong.summary["status"] == wrong.status
    assert "displacements differ by" in wrong.status


def test_contacts_that_only_one_of_the_two_has_are_named(result):
    """Of other contacts the time is said, and what tells a sensitive motion from an error."""
    other = result.scenario.model_copy(update={"gravity": 0.5})
    compared = compare_with_reference(replace(result, scenario=other), 1e-6)
    until = compared.summary["against"]["agrees_until_s"]
    assert until < 1.0
    assert any(f"from {until:.4g} s on" in warning for warning in compared.warnings)
    assert not any("different contacts" in warning for warning in compare_with_reference(result, 1e-6).warnings)


def test_a_run_that_is_integrated_itself_is_compared_with_another_method():
    cubic = {"name": "cubic", "mass": 1, "kind": "cubic", "stiffness": 4000.0}
    case = {**CASE, "chain": {**CASE["chain"], "springs_to_ground": [cubic], "snubbers": []}}
    values = compare_with_reference(beamsim.run(Scenario.model_validate(case)), 1e-9).summary["against"]
    assert values["method"].startswith("reference (LSODA")
    assert 1e-13 < values["largest_state_difference"] < 1e-6


def test_the_command_prints_one_table_and_json(tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text((config_path("one_sided_65hz")).read_text())
    sets = ("run.duration=0.005 s", "run.spectrum.last=0.002 s", "run.convergence=off", "reduction.modes=3")
    short = [x for override in sets for x in ("--set", override)] + ["--no-plots", "-o", str(tmp_path / "a.h5")]
    done = invoke("run", case, *short, "--against", "reference:1e-7", "-v")
    assert done.exit_code == 0, done.output
    assert "reference (DOP853, rtol 1e-07)" in done.stdout
    assert "processor time" in done.stdout
    done = invoke("run", case, *short, "--against", "reference", "--json")
    values = json.loads(done.stdout)["against"]
    assert values["values"]["peak_displacement"]["tip"]["exact"] > 0
    kept = beamsim.load(tmp_path / "a.h5").summary["against"]
    assert kept["method"] == "reference (DOP853, rtol 1e-08)"
    assert {"peak_displacement", "contacts"} < kept["values"].keys()


@pytest.mark.parametrize("text", ["newmark:5e-5", "reference:x", "reference:-1", "reference:nan", "reference:2", ""])
def test_what_is_no_reference(text):
    with pytest.raises(ScenarioError, match="reference:1e-10"):
        tolerance_of(text)
    assert (tolerance_of("reference"), tolerance_of("Reference:1e-9")) == (RTOL, 1e-9)


STOP = {"name": "a", "mass": 1, "side": "below", "stiffness": 900.0, "gap": 0.01}
PRESSING = {**STOP, "gap": -0.01}
DASHPOT = {"kind": "viscous", "coefficient": 8.0}
RELAXING = {"maxwell": [{"stiffness": 500.0, "relaxation_time": 0.05}, {"stiffness": 200.0, "relaxation_time": 0.3}]}
TABLE = {
    **{name: value for name, value in STOP.items() if name != "stiffness"},
    "force_deflection": {"points": [[0.0, 0.0], [0.01, 3.0], [0.02, 10.0], [0.03, 30.0]]},
}
HARDENING = {"hardening": {"yield_force": 3.0, "stiffness": 100.0}}
RUBBING = {"name": "f", "at": {"mass": 2}, "normal_force": 2.0, "coefficient": {"static": 0.4, "sliding": 0.3}}
PRESSED = {**RUBBING, "normal_force": {"snubber": "a"}}
BETWEEN = {**{k: v for k, v in RUBBING.items() if k != "at"}, "between": [{"mass": 1}, {"mass": 2}]}
SPRING = {"stiffness": 300.0}


def grounded(**spring):
    return {"springs_to_ground": [{"name": "s", "mass": 2, **spring}]}


LAWS = {
    "spring on the ground": ([{**STOP, "damping": DASHPOT, "mounted_on": "ground"}], [], {}),
    "no tension": ([{**STOP, "damping": DASHPOT, "law": "no_tension"}], [], {}),
    "preload": ([{k: v for k, v in STOP.items() if k != "gap"} | {"preload": 0.4}], [], {}),
    "both sides": ([{**STOP, "side": "both", "gap": 0.02}], [], {}),
    "cable": ([{"name": "c", "between": [1, 2], "resists": "separation", "stiffness": 300.0, "gap": 0.01}], [], {}),
    "table": ([TABLE], [], {}),
    "Maxwell branches": ([{**STOP, **RELAXING}], [], {}),
    "table and Maxwell branches": ([{**TABLE, **RELAXING}], [], {}),
    "hardening": ([{**STOP, **HARDENING}], [], {}),
    "friction behind a spring": ([], [{**RUBBING, **SPRING, "start": 0.3}], {}),
    "friction": ([], [RUBBING], {}),
    "two frictions": ([], [RUBBING, {**RUBBING, "name": "g", "at": {"mass": 1}, "normal_force": 1.0}], {}),
    "friction between masses": ([], [BETWEEN], {}),
    "friction under a stop": ([PRESSING], [PRESSED], {}),
    "friction with a spring under a stop": ([PRESSING], [{**PRESSED, **SPRING}], {}),
    "friction under a dashpot": ([{**PRESSING, "damping": DASHPOT, "law": "no_tension"}], [PRESSED], {}),
    "friction under Maxwell branches": ([{**PRESSING, **RELAXING}], [{**PRESSED, **SPRING}], {}),
    "friction under hardening": ([{**PRESSING, **HARDENING}], [{**PRESSED, **SPRING}], {}),
    "piecewise-linear spring": ([], [], grounded(kind="piecewise_linear", breakpoints=[0.03], stiffnesses=[5.0, 90.0])),
    "relaxing spring": ([], [], grounded(kind="linear", stiffness=50.0, **RELAXING)),
    "cubic spring and stop": ([{**STOP, "damping": DASHPOT, "law": "no_tension"}], [],
                              grounded(kind="cubic", stiffness=4000.0)),
}  # fmt: skip
"""Snubbers, friction and springs of two masses on a shaken base."""
APART = ("no tension", "table and Maxwell branches", "hardening", "friction", "friction under a dashpot")


@first_apart("law", 5, sorted(LAWS, key=lambda law: law not in APART))
def test_every_law_has_a_reference(law):
    """Friction without a spring broke away once and never again; that under a stop was refused."""
    snubbers, friction, springs = LAWS[law]
    chain = {name: CASE["chain"][name] for name in ("masses", "springs", "dashpots")}
    case = {**CASE, "chain": {**chain, "snubbers": snubbers, **springs}, "friction": friction}
    # as many samples as the peaks do not need
    case["run"] = {"duration": 4.03, "sample_rate": 11.0, "convergence": "off", "spectrum": {"frequencies": [1.0]}}
    result = beamsim.run(Scenario.model_validate(case))
    assert result.complete
    compared = compare_with_reference(result, 1e-11).summary["against"]
    assert compared["agrees_until_s"] == 4.03
    assert compared["largest_state_difference"] < 2e-9
    assert compared["largest_time_difference_s"] < 1e-9
    for figure, place, of in figures_of(compared):
        assert of["stepped"] == pytest.approx(of["exact"], rel=2e-9, abs=1e-12), (figure, place)
    assert {"peak_displacement", "peak_acceleration"} <= compared["values"].keys()
    assert bool(friction) == ("peak_friction_force" in compared["values"])


def test_filtered_accelerations_are_compared_with_filtered_ones(result):
    """The reference was not filtered."""
    case = {**CASE, "run": {**CASE["run"], "low_pass": 3.0}}
    filtered = figures_of(compare_with_reference(beamsim.run(Scenario.model_validate(case)), 1e-9).summary["against"])
    plain = figures_of(compare_with_reference(result, 1e-9).summary["against"])
    for (figure, _, a), (_, _, b) in zip(filtered, plain, strict=True):
        assert a["stepped"] == pytest.approx(a["exact"], rel=1e-4)
        assert (abs(a["exact"] / b["exact"] - 1) > 0.05) == (figure == "peak_acceleration")


def test_runs_and_references_that_end_early_are_not_compared(result, monkeypatch):
    """Peaks of a part of a motion were compared with those of the whole."""
    short = {**CASE, "run": {**CASE["run"], "max_events": 4}}
    ended = compare_with_reference(beamsim.run(Scenario.model_validate(short)), 1e-7)
    assert "against" not in ended.summary
    assert any("no comparison" in warning and "event" in warning for warning in ended.warnings)
    monkeypatch.setattr("scipy.integrate.DOP853.step", lambda self: "the step became too small")
    ended = compare_with_reference(result, 1e-7)
    assert "against" not in ended.summary
    assert any("no comparison" in warning and "too small" in warning for warning in ended.warnings)
    assert ended.outcome == result.outcome


@first_apart("path", 1, sorted(RUNS, key=lambda path: path.stem != "rubbing_stop"), ids=lambda path: path.stem)
def test_every_shipped_run_agrees_with_the_reference(path):
    """Until a contact was made and lost, over 12 to 200 periods of the fastest mode.

    Of structures with many modes with two, so that more contacts come in so many periods.
    """
    scenario = shipped(path)
    if scenario.has_mesh or scenario.reduction is not None or build_system(scenario).dynamics.stiffness.size > 6:
        scenario = scenario.model_copy(update={"reduction": Reduction(modes=2)})
    excitation = scenario.excitation
    if excitation.kind == "random":  # the lines of the whole run
        excitation = excitation.model_copy(update={"period": scenario.run.duration})
    fastest = np.sqrt(build_system(scenario).dynamics.stiffness.max())

    def run(periods):
        longest = periods * 2 * np.pi / fastest if fastest else np.inf  # where one is held by more than its stop
        short = scenario.run.model_copy(
            update={
                "duration": min(longest, scenario.run.duration), "convergence": "off",
                "spectrum": SpectrumSettings(), "srs": None, "fatigue": None, "impacts": None,
            }
        )  # fmt: skip
        return beamsim.run(scenario.model_copy(update={"run": short, "excitation": excitation}))

    result = first = run(12)
    for periods in (25, 50, 100, 200):
        result = result if result.summary["solver_events"] >= 2 else run(periods)
    result = result if result.summary["solver_events"] else first
    compared = compare_with_reference(result, 1e-11).summary["against"]  # its own error grows where speeds decide
    assert compared["agrees_until_s"] == result.scenario.run.duration
    assert compared["largest_state_difference"] < 1e-8
    for figure, place, of in figures_of(compared):
        assert of["stepped"] == pytest.approx(of["exact"], rel=1e-5, abs=1e-12), (figure, place)


def test_a_comparison_that_is_stopped_leaves_the_run(result):
    left = 20

    def stop():
        nonlocal left
        left -= 1
        return left <= 0

    part = compare_with_reference(result, 1e-11, stop)
    assert left <= 0
    assert "against" not in part.summary
    assert part.outcome.interrupted
    assert part.status == part.summary["status"] == "interrupted during the comparison with the reference integrator"
    assert part["histories"] is result["histories"]
    assert result.complete
