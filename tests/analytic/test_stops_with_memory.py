"""What a mass does at stops with memory, against small steps with clipped springs: openings, forces, contacts."""

from itertools import product

import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.scenario import Scenario
from tests.helpers.stops import CrushableStop, FoamStop, LatchingStop, RelaxingStop, mass_at_a_stop

MASS, SPRING = 1.0, 100.0  # kg, N/m
METHODS = [{}, {"method": "reference", "integrator": "DOP853", "rtol": 1e-10, "impacts": None}]
TABLE = [[0.0, 0.0], [1e-3, 20.0], [4e-3, 110.0]]
LOWER = [[0.0, 0.0], [1e-3, 5.0], [2e-3, 30.0]]
SHORT = [[0.0, 0.0], [0.5e-3, 4.0]]  # ends long before the loading curve does
LONGER = [[0.0, 0.0], [1e-3, 5.0], [6e-3, 140.0]]
SOFTENING = [[0.0, 0.0], [2e-3, 60.0], [10e-3, 70.0]]
SLACK = [[0.0, 0.0], [1e-3, 0.0], [3e-3, 60.0]]  # without a force at first
CRUSHED = {"stiffness": 1e4, "hardening": {"yield_force": 10.0, "stiffness": 100.0}}
FOAM = {"force_deflection": TABLE, "unloading": {"stiffness": 1e5}}
LOOP = {"force_deflection": TABLE, "unloading": {"stiffness": 1e5, "force_deflection": LOWER}}
BRANCH = [{"stiffness": 5e3, "relaxation_time": 0.02}]


def case(law, gap, speed=0.0, push=None, **rest):
    """A mass whose positive motion presses a stop; ``push`` is a force and when it begins."""
    stop = {"name": "s", "mass": 1, "side": "above", "gap": gap, **law}
    loads = {}
    if push is not None:
        loads = {"excitation": {"kind": "step", "applied_to": {"mass": 1}, "level": push[0], "time": push[1]}}
    run = {"duration": 0.4, "sample_rate": 5000.0, "start": {"velocity": [speed]}, "convergence": "off", "impacts": {}}
    chain = {"masses": [MASS], "springs": [SPRING], "snubbers": [stop]}
    return Scenario.model_validate({"chain": chain, "run": run | rest.pop("run", {}), **loads, **rest})


def stepped(stop, gap, speed=0.0, push=None, touches=None):
    force, begin = push or (0.0, 0.0)
    return mass_at_a_stop(
        stop, mass=MASS, spring=SPRING, gap=gap, position=0.0, speed=speed, duration=0.4, steps=8_000,
        load=lambda t: force if t >= begin else 0.0, touches=gap < 0.0 if touches is None else touches,
    )  # fmt: skip


MOTIONS = {
    "crushed": (CRUSHED, lambda: CrushableStop(1e4, 10.0, 100.0), 5e-3, 0.4, None),
    "crushed and pressed": (CRUSHED, lambda: CrushableStop(1e4, 10.0, 100.0), -2e-3, 0.3, None),
    "crushed and pressed within its elastic range": (
        CRUSHED, lambda: CrushableStop(1e4, 10.0, 100.0), -0.5e-3, 0.02, None),
    "foam": (FOAM, lambda: FoamStop(TABLE, 1e5), 1e-3, 0.3, None),
    "foam, pressed": (FOAM, lambda: FoamStop(TABLE, 1e5, pressed=1.5e-3), -1.5e-3, 0.1, None),
    "foam, pressed to a point of its table": (FOAM, lambda: FoamStop(TABLE, 1e5, pressed=1e-3), -1e-3, 0.1, None),
    "loop": (LOOP, lambda: FoamStop(TABLE, 1e5, LOWER), 0.5e-3, 0.4, None),
    "loop, pressed": (LOOP, lambda: FoamStop(TABLE, 1e5, LOWER, pressed=2.5e-3), -2.5e-3, 0.2, (30.0, 0.1)),
    "loop whose lower curve ends early": (
        {"force_deflection": TABLE, "unloading": {"stiffness": 1e5, "force_deflection": SHORT}},
        lambda: FoamStop(TABLE, 1e5, SHORT), 0.0, 0.3, (60.0, 0.2)),
    "loop that softens beyond its lower curve": (
        {"force_deflection": SOFTENING, "unloading": {"stiffness": 2e5, "force_deflection": LOWER}},
        lambda: FoamStop(SOFTENING, 2e5, LOWER), 1e-3, 0.6, None),
    "loop of a straight line": (
        {"stiffness": 2e4, "unloading": {"stiffness": 1e5, "force_deflection": LOWER}},
        lambda: FoamStop([[0.0, 0.0], [1.0, 2e4]], 1e5, LOWER), 0.5e-3, 0.6, None),
    "loop whose lower curve ends after the table": (
        {"force_deflection": TABLE, "unloading": {"stiffness": 1e5, "force_deflection": LONGER}},
        lambda: FoamStop(TABLE, 1e5, LONGER), 0.5e-3, 1.5, None),
    "latch": ({"stiffness": 1e4, "latch": True}, lambda: LatchingStop(1e4), 0.1e-3, 0.0316, (-100.0, 0.05)),
    "latch, pressed": ({"stiffness": 1e4, "latch": True}, lambda: LatchingStop(1e4, held=True), -1e-3, -0.5, None),
    "pad that relaxes": (
        {"force_deflection": TABLE, "maxwell": BRANCH}, lambda: RelaxingStop(TABLE, 5e3, 0.02), 0.5e-3, 0.3, None),
    "pad that relaxes, pressed": (
        {"force_deflection": TABLE, "maxwell": BRANCH}, lambda: RelaxingStop(TABLE, 5e3, 0.02, 1.5e-3), -1.5e-3, -0.3,
        (50.0, 0.1)),
    "foam with slack, pressed without a force": (
        {"force_deflection": SLACK, "unloading": {"stiffness": 1e5}},
        lambda: FoamStop(SLACK, 1e5, pressed=0.4e-3), -0.4e-3, 0.2, None),
    "pad with slack that relaxes, pressed without a force": (
        {"force_deflection": SLACK, "maxwell": BRANCH}, lambda: RelaxingStop(SLACK, 5e3, 0.02, 0.4e-3), -0.4e-3, 0.2,
        None),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
def test_openings_forces_and_contacts_are_those_of_small_steps(name):
    law, stop, gap, speed, push = MOTIONS[name]
    found = beamsim.run(case(law, gap, speed, push))
    expected = stepped(stop(), gap, speed, push)
    summary, impacts = found.summary, found["impacts"]
    pull = expected.pull if "latch" in name else 0.0
    assert summary["peak_force_n"]["s"] == pytest.approx(max(expected.push, pull), rel=4e-4)
    assert summary["largest_pull_n"]["s"] == pytest.approx(pull, rel=4e-4)
    assert summary["largest_gap_m"]["s"] == pytest.approx(expected.gap, rel=4e-4, abs=1e-7)
    assert summary["contacts"]["s"] == len(expected.closings)  # not the one that was pressed before t = 0
    np.testing.assert_allclose(
        found["events"]["time"].values[found["events"]["closing"].values], expected.closings, atol=2e-4
    )
    np.testing.assert_allclose(
        found["events"]["time"].values[~found["events"]["closing"].values], expected.openings, atol=2e-4
    )
    pressed = gap < 0.0
    speeds = ([np.nan] if pressed else []) + expected.approach
    np.testing.assert_allclose(impacts["approach_speed"].values, speeds, rtol=4e-3, atol=1e-4)
    if pressed:
        assert impacts["incomplete"].values[0]
        assert np.isnan(impacts["restitution"].values[0])
    largest = max(expected.push, expected.pull)
    np.testing.assert_allclose(
        found["histories"]["snubber_force"].sel(snubber="s").values, expected.force[::4], atol=0.02 * largest
    )


@pytest.mark.parametrize("name", ["crushed", "loop", "latch", "pad that relaxes, pressed"])
def test_time_stepping_finds_the_same(name):
    law, _, gap, speed, push = MOTIONS[name]
    exact, reference = (beamsim.run(case(law, gap, speed, push, run=method)).summary for method in METHODS)
    for key in ("peak_force_n", "largest_gap_m", "largest_pull_n"):
        assert reference[key]["s"] == pytest.approx(exact[key]["s"], rel=1e-6, abs=1e-9)
    assert reference["contacts"] == exact["contacts"]


LAWS = {
    "spring": {"stiffness": 1e4},
    "table": {"force_deflection": TABLE},
    "crushed": CRUSHED,
    "foam": FOAM,
    "loop": LOOP,
    "latch": {"stiffness": 1e4, "latch": True},
    "relaxing": {"stiffness": 1e4, "maxwell": BRANCH},
    "damped": {"stiffness": 1e4, "damping": {"kind": "viscous", "coefficient": 5.0}},
    "never pulls": {
        "stiffness": 1e4, "law": "no_tension", "damping": {"kind": "viscous", "coefficient": 5.0}},
    "table that never pulls": {
        "force_deflection": TABLE, "law": "no_tension", "damping": {"kind": "viscous", "coefficient": 5.0}},
}  # fmt: skip


@first_apart(
    ("speed", "method", "law"), len(LAWS),
    [*product([0.1, 0.0, -0.001], METHODS[:1], LAWS), *product([-0.001], METHODS[1:], LAWS)],
)  # fmt: skip
def test_what_is_pressed_at_the_start_is_not_made_there(law, speed, method):
    """By a gap of less than zero, here at a point of the tables, or by a preload; moving in, out or neither."""
    cases = [case(LAWS[law], -1e-3, speed, run={**method, "duration": 1e-3})]
    if speed > 0.0 or "method" in method:  # once: with a preload the mass begins at rest
        cases.append(preloaded(law, method))
    for scenario in cases:
        result = beamsim.run(scenario)
        assert result.summary["contacts"]["s"] == 0
        assert not result["events"]["time"].values.size
        assert result.summary["contact_share"]["s"] == 1.0
        assert result.summary["largest_gap_m"]["s"] == 0.0
        if "method" not in method:
            assert result["impacts"]["incomplete"].values.tolist() == [True]
            assert np.isnan(result["impacts"]["approach_speed"].values[0])
            assert np.isnan(result.summary["impacts"]["s"]["highest_approach_speed_m_s"])


def preloaded(law, method):
    """A mass at rest on a stop under 15 N, which the base shakes too little to open it."""
    preload = case(LAWS[law], None, run={**method, "duration": 0.05, "start": "static_equilibrium"}, excitation={
        "kind": "harmonic", "applied_to": "base", "level": 0.5, "frequency": 20.0,
    })  # fmt: skip
    return preload.model_copy(update={
        "chain": preload.chain.model_copy(update={"snubbers": (
            preload.chain.snubbers[0].model_copy(update={"gap": None, "preload": 15.0}),)})})  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
def test_a_gap_that_is_just_closed_is_made_where_the_mass_moves_in(law):
    result = beamsim.run(case(LAWS[law], 0.0, 0.1, run={"duration": 1e-3}))
    assert (result["events"]["time"].values.tolist(), result["events"]["closing"].values.tolist()) == ([0.0], [True])
    assert result["impacts"]["approach_speed"].values == pytest.approx([0.1], rel=1e-12)
    away = beamsim.run(case(LAWS[law], 0.0, -0.1, run={"duration": 1e-3}))
    assert away.summary["contacts"]["s"] == away["events"]["time"].values.size == 0
    assert away.summary["contact_share"]["s"] == 0.0


@pytest.mark.parametrize("law", ["foam", "loop", "crushed", "relaxing"])
def test_the_first_cycle_of_a_swept_sine_counts_no_contact_that_was_pressed_before(law):
    """A pad under 20 N that is shaken too little to open."""
    stop = {"name": "s", "mass": 1, "side": "above", "preload": 20.0, **LAWS[law]}
    sine = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 10.0}
    scenario = Scenario.model_validate({
        "chain": {"masses": [MASS], "springs": [SPRING], "snubbers": [stop]}, "excitation": sine,
        "sweep": {"kind": "swept_sine", "from": 5.0, "to": 8.0, "rate": "60 oct/min", "impacts": True},
    })  # fmt: skip
    (curve,) = beamsim.sweep(scenario).curves.values()
    assert curve["contacts"].sel(snubber="s").values.sum() == 0
    assert np.all(curve["impact_number"].values == 0.0)
    assert np.all(curve["contact_share"].sel(snubber="s").values == 1.0)


# --- a latch, in every analysis ---------------------------------------------------------------------------------------

LATCHED = {"stiffness": 1e4, "latch": True}
PULLED = 194.88695392719103  # N, of the mass that a step of -100 N tears at, see below


def pulled(**rest):
    """A mass that latches and is then pulled away from the stop by a step of 100 N."""
    return case(LATCHED, 0.1e-3, 0.0316, (-100.0, 0.05), run={"duration": 0.5, **rest.pop("run", {})}, **rest)


def closed_form():
    """Largest pull: the motion about the balance of both springs under the step, from where that finds the mass."""
    free, held, gap, begin = np.sqrt(SPRING / MASS), np.sqrt((SPRING + 1e4) / MASS), 0.1e-3, 0.05
    time = np.arcsin(gap * free / 0.0316) / free
    speed, rest = 0.0316 * np.cos(free * time), 1e4 * gap / (SPRING + 1e4)
    later = held * (begin - time)
    x = rest + (gap - rest) * np.cos(later) + speed / held * np.sin(later)
    v = -(gap - rest) * held * np.sin(later) + speed * np.cos(later)
    lower = rest - 100.0 / (SPRING + 1e4)
    return 1e4 * (gap - (lower - np.hypot(x - lower, v / held)))


def test_the_pull_of_a_latch_counts_in_a_run_its_limits_impacts_and_derivatives():
    assert closed_form() == pytest.approx(PULLED, rel=1e-9)
    scenario = pulled(
        limits={"peak_force": 50.0, "gap": 1e-3},
        run={"sensitivities": [{"path": "chain.snubbers.s.stiffness", "tolerance": 0.05}]},
    )
    result = beamsim.run(scenario)
    summary = result.summary
    assert summary["peak_force_n"]["s"] == pytest.approx(PULLED, rel=1e-12)
    assert summary["margins"]["peak_force"]["verdict"] == "exceeded"
    assert summary["margins"]["gap"]["value"] == pytest.approx(0.1e-3, rel=1e-12)  # before it was latched
    assert summary["peak_times_s"]["peak_force_n"]["s"] == pytest.approx(0.08126, abs=1e-5)
    assert summary["impacts"]["s"]["peak_force_n"] == pytest.approx(PULLED, rel=1e-9)
    stiffer, softer = (
        beamsim.run(pulled().model_copy(update={"chain": scenario.chain.model_copy(update={"snubbers": (
            scenario.chain.snubbers[0].model_copy(update={"stiffness": 1e4 + change}),)})}))
        for change in (1.0, -1.0)
    )  # fmt: skip
    by_stiffness = 0.5 * (stiffer.summary["peak_force_n"]["s"] - softer.summary["peak_force_n"]["s"])
    found = result.summary["sensitivities"]["snubbers/s/peak_force"]["chain.snubbers.s.stiffness"]["derivative"]
    assert found == pytest.approx(by_stiffness, rel=1e-5)


def test_the_pull_of_a_latch_counts_in_studies():
    vary = {"kind": "grid", "parameters": [{"path": "chain.snubbers.s.gap", "values": [0.1e-3, 0.2e-3]}]}
    result = beamsim.design_study(pulled(limits={"peak_force": 50.0}, vary=vary))
    assert result.responses["snubbers/s/peak_force"].values[0] == pytest.approx(PULLED, rel=1e-12)
    assert result.summary["margins"]["peak_force"]["verdict"] == "exceeded"


def test_the_pull_of_a_latch_counts_in_a_swept_sine():
    """Held at rest by a preload, shaken in both directions; the run of the same sine has the same peak."""
    stop = {"name": "s", "mass": 1, "side": "above", "preload": 5.0, **LATCHED}
    plain = {"chain": {"masses": [MASS], "springs": [SPRING], "dashpots": [2.0], "snubbers": [stop]},
             "limits": {"peak_force": 6.0, "gap": 1e-4}}  # fmt: skip
    sine = {"from": 3.0, "to": 4.0, "rate": "5 oct/min"}
    sweep = {"kind": "swept_sine", **sine}
    base = {"kind": "harmonic", "applied_to": "base", "level": 9.0, "frequency": 3.0}
    swept = beamsim.sweep(Scenario.model_validate({**plain, "excitation": base, "sweep": sweep}))
    (curve,) = swept.curves.values()
    drive = {"kind": "swept_sine", "applied_to": "base", "level": 9.0, **sine}
    run = {"duration": 12.0 * np.log2(4.0 / 3.0), "sample_rate": 500.0, "convergence": "off"}
    of_run = beamsim.run(Scenario.model_validate({**plain, "excitation": drive, "run": run})).summary
    assert curve.channel("force", "s").peak.max() == pytest.approx(of_run["peak_force_n"]["s"], rel=1e-9)
    assert swept.summary["margins"]["peak_force"]["verdict"] == "exceeded"
    assert curve["contacts"].sel(snubber="s").values.sum() == of_run["contacts"]["s"] == 0
    assert curve["peak_gap"].sel(snubber="s").values.max() == of_run["largest_gap_m"]["s"] == 0.0


def test_the_moment_of_a_latch_counts_in_both_directions():
    """A hinged bar is pushed into its stop, which holds it, and is then pulled."""
    bar = {"kind": "beam", "length": 1.0, "bending_stiffness": 1e6, "mass_per_length": 3.0, "elements": 2,
           "supports": {"left": "free", "right": "free"}}  # fmt: skip
    stop = {"name": "end", "angle": 0.0, "side": "above", "stiffness": 100.0, "latch": True}
    hinge = {"name": "root", "kind": "hinge", "between": [{"body": "bar", "position": 0.0}, "base"], "stops": [stop]}
    push = {"kind": "harmonic", "applied_to": {"body": "bar", "position": 1.0}, "level": 10.0, "frequency": 0.9}
    result = beamsim.run(Scenario.model_validate({
        "bodies": {"bar": bar}, "joints": [hinge], "excitation": push, "limits": {"peak_moment": 1.0},
        "run": {"duration": 1.5, "sample_rate": 500.0, "start": "rest", "convergence": "off"},
    }))  # fmt: skip
    moments, summary = result["histories"]["snubber_force"].sel(snubber="root.end").values, result.summary
    pushes, pulls = moments.max(), -moments.min()
    assert pulls > 1.2 * pushes > 0.0
    assert summary["peak_moment_n_m"]["root.end"] == pytest.approx(pulls, rel=1e-3)
    assert summary["margins"]["peak_moment"]["value"] == pytest.approx(pulls, rel=1e-3)
    assert summary["largest_pulling_moment_n_m"]["root.end"] == pytest.approx(pulls, rel=1e-3)


def test_a_lower_curve_is_checked_where_it_keeps_its_distance():
    """5 N below the table at its last point, and beyond: the table ends far from there. Crossing curves are refused."""
    lower = [[0.0, 0.0], [1.5e-3, 20.0], [2e-3, 95.0]]
    table = [[0.0, 0.0], [2e-3, 100.0], [10e-3, 140.0]]
    law = {"force_deflection": table, "unloading": {"stiffness": 4e5, "force_deflection": lower}}
    result = beamsim.run(case(law, 0.0, 0.7, run={"duration": 0.05, "sample_rate": 50e3}))
    elastic = 5.0 / 4e5  # m, from curve to curve, with the slopes of both below 2 % of it
    back = (np.diff(result["histories"]["snubber_penetration"].sel(snubber="s").values, prepend=-1.0) < 0.0) & (
        result["histories"]["snubber_penetration"].sel(snubber="s").values > 2e-3
    )
    back &= (
        result["histories"]["snubber_penetration"].sel(snubber="s").values
        < result["histories"]["snubber_penetration"].sel(snubber="s").values.max() - 1.02 * elastic
    )
    expected = np.interp(result["histories"]["snubber_penetration"].sel(snubber="s").values, *np.array(table).T) - 5.0
    np.testing.assert_allclose(
        result["histories"]["snubber_force"].sel(snubber="s").values[back], expected[back], rtol=1e-9
    )
    assert back.sum() > 20
    above = {**law, "unloading": {"stiffness": 4e5, "force_deflection": [[0.0, 0.0], [1e-3, 49.0], [2e-3, 101.0]]}}
    with pytest.raises(beamsim.ScenarioError, match=r"above the loading curve at 0\.002"):
        beamsim.run(case(above, 0.0, 0.3))


# --- gaps in sweeps and along branches --------------------------------------------------------------------------------

SHAKEN = {"masses": [MASS], "springs": [4e3], "dashpots": [6.0]}


def test_the_gap_of_a_crushed_stop_in_a_swept_sine_is_that_of_its_run():
    stop = {"name": "s", "mass": 1, "side": "above", "gap": 1e-3, **CRUSHED}
    plain = {"chain": SHAKEN | {"snubbers": [stop]}, "limits": {"gap": 1.0}}
    sine = {"from": 8.0, "to": 9.0, "rate": "10 oct/min"}
    base = {"kind": "harmonic", "applied_to": "base", "level": 9.0, "frequency": 8.0}
    sweep = {"kind": "swept_sine", **sine}
    (curve,) = beamsim.sweep(Scenario.model_validate({**plain, "excitation": base, "sweep": sweep})).curves.values()
    drive = {"kind": "swept_sine", "applied_to": "base", "level": 9.0, **sine}
    run = {"duration": 6.0 * np.log2(9.0 / 8.0), "sample_rate": 500.0, "convergence": "off"}
    of_run = beamsim.run(Scenario.model_validate({**plain, "excitation": drive, "run": run}))
    crush = of_run["histories"]["snubber_residual_crush"].sel(snubber="s").item()
    assert crush > 0.1e-3
    assert curve["peak_gap"].sel(snubber="s").values.max() == pytest.approx(
        of_run.summary["largest_gap_m"]["s"], rel=1e-9
    )
    lowest = curve["min_displacement"].values.min()
    assert curve["peak_gap"].sel(snubber="s").values.max() > 1e-3 - lowest + 0.1e-3


def test_the_gap_of_a_crushed_stop_along_a_branch_has_its_crush():
    """Which stays as it is along a branch of elastic motions."""
    stop = {"name": "s", "mass": 1, "side": "above", "gap": 1e-3,
            "stiffness": 1e4, "hardening": {"yield_force": 40.0, "stiffness": 1e3}}  # fmt: skip
    result = beamsim.continuation(Scenario.model_validate({
        "chain": SHAKEN | {"snubbers": [stop]}, "limits": {"gap": 0.02},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 4.0, "frequency": 9.0},
        "sweep": {"kind": "continuation", "from": 9.5, "to": 9.6, "side_branches": "none"},
    }))  # fmt: skip
    points = result.branches[0]
    gap, lowest = points["peak_gap"].sel(snubber="s").values, points["min_displacement"].values[0]
    crush = gap - (1e-3 - lowest)
    assert crush[0] > 1e-5
    np.testing.assert_allclose(crush, crush[0], rtol=1e-6)
