"""What a mass does at stops with memory, against small steps with clipped springs: openings, forces, contacts."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import Scenario
from tests.helpers.stops import CrushableStop, FoamStop, LatchingStop, RelaxingStop, mass_at_a_stop

MASS, SPRING = 1.0, 100.0  # kg, N/m
METHODS = [{}, {"method": "reference", "integrator": "DOP853", "rtol": 1e-10, "impacts": None}]
TABLE = [[0.0, 0.0], [1e-3, 20.0], [4e-3, 110.0]]
LOWER = [[0.0, 0.0], [1e-3, 5.0], [2e-3, 30.0]]
SHORT = [[0.0, 0.0], [0.5e-3, 4.0]]  # ends long before the loading curve does
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
    summary, impacts = found.summary, found.impacts
    pull = expected.pull if "latch" in name else 0.0
    assert summary["peak_force_n"]["s"] == pytest.approx(max(expected.push, pull), rel=4e-4)
    assert summary["largest_pull_n"]["s"] == pytest.approx(pull, rel=4e-4)
    assert summary["largest_gap_m"]["s"] == pytest.approx(expected.gap, rel=4e-4, abs=1e-7)
    assert summary["contacts"]["s"] == len(expected.closings)  # not the one that was pressed before t = 0
    np.testing.assert_allclose(found.events.time[found.events.closing], expected.closings, atol=2e-4)
    np.testing.assert_allclose(found.events.time[~found.events.closing], expected.openings, atol=2e-4)
    pressed = gap < 0.0
    speeds = ([np.nan] if pressed else []) + expected.approach
    np.testing.assert_allclose(impacts.approach_speed, speeds, rtol=4e-3, atol=1e-4)
    if pressed:
        assert impacts.cut[0]
        assert np.isnan(impacts.restitution[0])
    largest = max(expected.push, expected.pull)
    np.testing.assert_allclose(found.snubbers["s"].force, expected.force[::4], atol=0.02 * largest)


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


@pytest.mark.parametrize("method", METHODS, ids=["exact", "reference"])
@pytest.mark.parametrize("speed", [0.1, 0.0, -0.001])
@pytest.mark.parametrize("law", LAWS)
def test_what_is_pressed_at_the_start_is_not_made_there(law, speed, method):
    """By a gap of less than zero, here at a point of the tables, or by a preload; moving in, out or neither."""
    pressed = case(LAWS[law], -1e-3, speed, run={**method, "duration": 1e-3})
    preload = case(LAWS[law], None, run={**method, "duration": 0.05, "start": "static_equilibrium"}, excitation={
        "kind": "harmonic", "applied_to": "base", "level": 0.5, "frequency": 20.0,
    })  # fmt: skip
    preload = preload.model_copy(update={
        "chain": preload.chain.model_copy(update={"snubbers": (
            preload.chain.snubbers[0].model_copy(update={"gap": None, "preload": 15.0}),)})})  # fmt: skip
    for scenario in (pressed, preload):
        result = beamsim.run(scenario)
        assert result.summary["contacts"]["s"] == 0
        assert not result.events.time.size
        assert result.summary["contact_share"]["s"] == 1.0
        assert result.summary["largest_gap_m"]["s"] == 0.0
        if "method" not in method:
            assert result.impacts.cut.tolist() == [True]
            assert np.isnan(result.impacts.approach_speed[0])
            assert np.isnan(result.impacts.snubbers["s"].highest_approach_speed_m_s)


@pytest.mark.parametrize("law", LAWS)
def test_a_gap_that_is_just_closed_is_made_where_the_mass_moves_in(law):
    result = beamsim.run(case(LAWS[law], 0.0, 0.1, run={"duration": 1e-3}))
    assert (result.events.time.tolist(), result.events.closing.tolist()) == ([0.0], [True])
    assert result.impacts.approach_speed == pytest.approx([0.1], rel=1e-12)
    away = beamsim.run(case(LAWS[law], 0.0, -0.1, run={"duration": 1e-3}))
    assert away.summary["contacts"]["s"] == away.events.time.size == 0
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
    assert curve.contacts["s"].sum() == 0
    assert np.all(curve.impacts["s"].per_cycle == 0.0)
    assert np.all(curve.contact_share["s"] == 1.0)
