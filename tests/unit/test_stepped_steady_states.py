"""Steady states: against linear theory, against long transients, and a motion that is known to be chaotic."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from beamsim.analyses.sweep.analysis import sweep, sweep_system
from beamsim.analyses.sweep.stepped import frequencies_of
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import Motion, simulate
from beamsim.inputs.signal import Signal
from beamsim.orbits.steady import CycleStepper, largest_exponent, settle
from beamsim.outcomes import COMPLETE
from beamsim.responses.gapping import contact_levels, transfer
from beamsim.scenario import load_scenario
from beamsim.system.equations import Forcing

CHAIN = {
    "title": "Two masses and a stop",
    "chain": {
        "masses": [1, 1],
        "springs": [1, 1, 1],
        "dashpots": [0.05, 0.05, 0.05],
        "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 20, "gap": 0.3}],
    },
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 2}, "level": "0.1 N", "frequency": "0.2 Hz"},
    "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
}


def stepped(**settings):
    return load_scenario({**CHAIN, "sweep": {"kind": "stepped", "from": 0.1, "to": 0.4, "points": 13, **settings}})


def test_without_contact_the_steady_state_is_that_of_linear_theory():
    scenario = stepped(levels=["0.004 N"], steady_to=1e-10)
    result = sweep(scenario)
    curve = result.curves["up_0"]
    q = transfer(sweep_system(scenario), curve.frequency_hz)
    expected = np.abs(q @ np.array([p.shape for p in sweep_system(scenario).probes]).T) * 0.004
    for k, name in enumerate(("first", "second")):
        np.testing.assert_allclose(curve.channel("displacement", name).peak, expected[:, k], rtol=1e-8)
        np.testing.assert_allclose(curve.channel("displacement", name).rms, expected[:, k] / np.sqrt(2), rtol=1e-8)
        order = list(curve.orders).index(1.0)
        np.testing.assert_allclose(
            np.abs(curve.channel("displacement", name).harmonics[order]), expected[:, k], rtol=1e-8
        )
    assert set(curve.tables["steady_states"]["kind"].values) == {"periodic"}
    assert set(curve.tables["steady_states"]["period_cycles"].values) == {1}
    assert np.all(curve["contact_share"].sel(snubber="stop").values == 0)
    assert result.outcome == COMPLETE


def test_with_contact_the_steady_state_is_the_end_of_a_long_transient():
    scenario = stepped(levels=["0.4 N"], steady_to=1e-9, direction="both", points=5)
    curve = sweep(scenario).curves["up_0"]
    system = sweep_system(scenario)
    assert np.any(curve["contact_share"].sel(snubber="stop").values > 0)
    checked = 0
    for k in np.flatnonzero(
        (curve.tables["steady_states"]["period_cycles"].values == 1)
        & (curve["contact_share"].sel(snubber="stop").values > 0)
    ):
        f = curve.frequency_hz[k]
        signal = Signal.harmonic(0.4, 2 * np.pi * f)
        flow = ExactFlow(system.dynamics, Forcing(system.forcing.load, (signal,)), 400 / f)
        trajectory = simulate(flow, system.initial_state)
        times = np.linspace(390, 400, 80_001) / f
        w = trajectory.states_at(times)[:, :2] @ system.probes[0].shape
        if np.abs(w[:72_000] - w[8_000:80_000]).max() > 1e-6 * np.abs(w).max():
            continue  # another attractor
        assert curve.channel("displacement", "first").maximum[k] == pytest.approx(w.max(), rel=1e-5)
        assert curve.channel("displacement", "first").minimum[k] == pytest.approx(w.min(), rel=1e-5)
        checked += 1
    assert checked > 0


def bouncing(make_system, frequency, amplitude, gap):
    """A mass on a spring between free flight and a stiff stop."""
    system = make_system([1.0], [0.02], shape=[[1.0]], stiffness=[30.0], gap=[gap])
    forcing = Forcing(np.ones((1, 1)), (Signal.harmonic(amplitude, 2 * np.pi * frequency),))
    flow = ExactFlow(system, forcing, 1.0 / frequency)
    return CycleStepper(flow, 1.0 / frequency), Motion(np.array([0.1, 0.0]), flow.state_index(np.zeros(1, dtype=int)))


def test_exponent_of_a_linear_motion_is_its_decay(make_system):
    stepper, motion = bouncing(make_system, 0.3, 0.1, 1e3)
    settle(stepper, motion, tolerance=1e-8, longest_period=1, most_cycles=400)
    found = largest_exponent(stepper, motion, 200)
    assert found.value == pytest.approx(-0.01, rel=0.02)
    assert found.kind == "not settled"
    assert stepper.cycles > 500


def test_chaos_is_told_from_a_period(make_system):
    kinds = {}
    for frequency in np.linspace(0.35, 0.6, 9):
        stepper, motion = bouncing(make_system, float(frequency), 1.0, 0.0)
        settled = settle(stepper, motion, tolerance=1e-8, longest_period=6, most_cycles=1200)
        if settled.period:
            kinds.setdefault("periodic", []).append(frequency)
            again = stepper.march_cycles(motion, settled.period)
            assert np.abs(again[-1] - settled.section[-1]).max() < 1e-5
        else:
            found = largest_exponent(stepper, motion, 200)
            kinds.setdefault(found.kind, []).append(frequency)
    assert kinds["periodic"]


K2 = 99.0  # of the stop, over that of the spring
BILINEAR = 2.0 / (1.0 + 1.0 / np.sqrt(1.0 + K2))  # rad/s: half a cycle with the stop, half without


def impacts(damping, n, **settings):
    """A mass of 1 rad/s that touches a stop in its middle, driven n times as fast as it swings between them."""
    f = n * BILINEAR / (2 * np.pi)
    stop = {"name": "stop", "mass": 1, "side": "above", "stiffness": K2, "gap": 0}
    return load_scenario(
        {
            "chain": {"masses": [1], "springs": [1, 0], "dashpots": [2 * damping, 0], "snubbers": [stop]},
            "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N", "frequency": "1 Hz"},
            "sweep": {"kind": "stepped", "from": f, "to": 1.01 * f, "points": 2, **settings},
        }
    )


@pytest.mark.parametrize("n", [3, 9])
def test_subharmonics_of_an_impact_oscillator_have_the_period_of_its_swing(n):
    """One impact in n cycles where the forcing is n times the bilinear frequency (Shaw and Holmes 1983)."""
    steady = sweep(impacts(0.02, n))["steady_states"]
    assert steady["kind"].values.tolist() == ["periodic"] * 2
    assert steady["period_cycles"].values.tolist() == [n] * 2


@pytest.mark.parametrize(("damping", "n", "more"), [(0.02, 9, {"longest_period": 8}), (0.005, 9, {})])
def test_a_motion_that_comes_to_repeat_is_not_called_quasi_periodic(damping, n, more):
    """Of a longer period than is looked for, or one whose transient outlasts the cycles that are allowed."""
    assert set(sweep(impacts(damping, n, **more))["steady_states"]["kind"].values) == {"not settled"}


@pytest.mark.parametrize("frequency", [0.31, 0.4771, 0.7, 1.57])
def test_two_frequencies_without_damping_are_quasi_periodic(make_system, frequency):
    system = make_system([1.0], [0.0], shape=[[1.0]], stiffness=[30.0], gap=[1e3])
    flow = ExactFlow(system, Forcing(np.ones((1, 1)), (Signal.harmonic(0.5, 2 * np.pi * frequency),)), 1 / frequency)
    stepper, motion = (
        CycleStepper(flow, 1 / frequency),
        Motion(np.array([1.0, 0.3]), flow.state_index(np.zeros(1, int))),
    )
    assert largest_exponent(stepper, motion, 400).kind == "quasi-periodic"


def test_frequencies():
    assert frequencies_of(stepped(points=4).sweep) == pytest.approx([0.1, 0.2, 0.3, 0.4])
    logarithmic = frequencies_of(stepped(points=3, spacing="logarithmic").sweep)
    assert logarithmic == pytest.approx([0.1, 0.2, 0.4])


def linear_orbit(system, frequency, level, closed):
    """State at t = 0 of the linear steady motion with some contacts closed for good, static part included."""
    w = 2 * np.pi * frequency
    amplitude = level * transfer(system, np.array([frequency]), closed)[0]  # of Im[amplitude e^{i w t}]
    q, v = amplitude.imag, (1j * w * amplitude).imag
    return np.concatenate([q + system.static_equilibrium, v])


@pytest.mark.parametrize("gap", [0.3, -0.1])
def test_contact_levels_separate_linear_motions_from_others(gap):
    """On the linear orbit just below the level there is no event, just above there is."""
    chain = {**CHAIN["chain"], "snubbers": [{**CHAIN["chain"]["snubbers"][0], "gap": gap}]}
    system = sweep_system(
        load_scenario({**CHAIN, "chain": chain, "sweep": {"kind": "stepped", "from": 0.1, "to": 0.4}})
    )
    levels = contact_levels(system, np.array([0.2]))["stop"]
    closed = np.array([gap < 0])
    level = float(levels.loss[0] if gap < 0 else levels.onset[0])
    assert np.isnan(levels.onset[0] if gap < 0 else levels.loss[0])
    if gap < 0:
        assert levels.preload_needed[0] * level == pytest.approx(system.snubbers[0].preload, rel=1e-9)
    for factor, changes in ((0.9999, False), (1.0001, True)):
        signal = Signal.harmonic(factor * level, 2 * np.pi * 0.2)
        flow = ExactFlow(system.dynamics, Forcing(system.forcing.load, (signal,)), 50.0)
        trajectory = simulate(flow, linear_orbit(system, 0.2, factor * level, closed))
        assert bool(trajectory.event_time.size > 0) is changes


def test_stress_and_gap_of_a_sweep_are_those_of_the_run():
    """Limits on stress and gap: a stepped sweep's margins at one frequency against a long run there."""
    from pathlib import Path

    import beamsim
    from beamsim.analyses.sweep.analysis import sweep

    path = Path(__file__).parents[2] / "configs/one_sided_65hz.yaml"
    limits = {"bending_stress": "1 MPa", "gap": "0.1 mm"}
    stepped = {"kind": "stepped", "from": "65 Hz", "to": "65.001 Hz", "points": 2, "direction": "up"}
    common = {"reduction": {"modes": 6}, "limits": limits}
    found = sweep(beamsim.load_scenario(path, {**common, "sweep": stepped})).summary["margins"]
    run = beamsim.load_scenario(path, {**common, "run.duration": 6.0, "run.spectrum": {"last": 0.4, "window": "hann"}})
    tail = beamsim.run(run)
    late = tail["histories"]["time"].values > 5.5
    assert found["gap"]["value"] == pytest.approx(
        tail["histories"]["displacement"].sel(probe="tip").values[late].max(), rel=1e-4
    )
    assert 0.3 < found["bending_stress"]["value"] / tail.summary["largest_bending_stress_pa"] < 1.0
    assert found["gap"]["exceeded"]
    assert found["bending_stress"]["exceeded"]


def test_a_motion_that_never_repeats_is_followed_in_bounded_memory():
    """A quasi-periodic motion, by the golden section of a turn a cycle: what was long ago is not kept."""
    turn = np.exp(2j * np.pi * 0.5 * (np.sqrt(5.0) - 1.0))
    motion = SimpleNamespace(y=np.array([1.0, 0.0]))
    contacts = SimpleNamespace(internal_states=0)
    flow = SimpleNamespace(system=SimpleNamespace(size=1, contacts=contacts))

    def march_cycles(motion, cycles):
        turned = (motion.y[0] + 1j * motion.y[1]) * turn ** np.arange(1, cycles + 1)
        states = np.stack([turned.real, turned.imag], axis=1)
        motion.y = states[-1]
        return states

    stepper = SimpleNamespace(flow=flow, omega=1.0, march_cycles=march_cycles)
    tracemalloc.start()
    settled = settle(stepper, motion, tolerance=1e-9, longest_period=4, most_cycles=8000)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (settled.period, settled.cycles, settled.section.shape) == (0, 8000, (256, 2))
    assert peak < 300_000  # bytes; all cycles would need 900,000
