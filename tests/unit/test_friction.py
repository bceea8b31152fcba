"""Dry friction behind a tangential spring: closed forms and scenarios; random contacts are in the attack."""

import numpy as np
import pytest
from balance import energy_history
from shipped import config_path

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.sliders import friction_law
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def system_of(laws, shape, stiffness, damping, ground=None):
    count = len(laws)
    contacts = Contacts(
        np.array(shape, dtype=float), -np.ones(count), np.zeros(count),
        np.zeros(count, dtype=bool) if ground is None else np.array(ground), tuple(laws),
    )  # fmt: skip
    n = len(stiffness)
    return PiecewiseLinearSystem(np.array(stiffness), np.diag(damping).astype(float), contacts, np.zeros(n))


def free(n):
    return Forcing(np.zeros((0, n)), ())


# -- closed forms ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [5.0, 50.0, 5e6])
def test_decay_of_one_mass(stiffness):
    """From one turning point A to the next B: k (A^2 - B^2) / 2 = F (A + B - 2 F / kt), which is 2 F / k for a stiff
    tangential spring: the amplitude falls by 4 F / k a cycle."""
    force = 0.04
    system = system_of([friction_law(stiffness, force, force)], [[1.0]], [1.0], [0.0])
    start = 1.0
    trajectory = simulate(ExactFlow(system, free(1), 30.0), np.array([start, 0.0, start - force / stiffness]))
    stops = trajectory.event_time[trajectory.event_phase == 0]
    turns = np.abs(trajectory.states_at(stops)[:, 0])
    expected, amplitude = [], start
    while len(expected) < turns.size:
        before = amplitude
        # B^2 / 2 + F B = A^2 / 2 - F A + 2 F^2 / kt
        amplitude = -force + np.sqrt(force**2 + before**2 - 2 * force * before + 4 * force**2 / stiffness)
        expected.append(amplitude)
    assert turns.size >= 6
    np.testing.assert_allclose(turns, expected, atol=1e-12 if stiffness < 1e3 else 1e-9)
    if stiffness > 1e3:
        np.testing.assert_allclose(turns[2::2] - turns[:-2:2], -4 * force, rtol=1e-6)


def test_loss_of_a_loop():
    """In a steady cycle of amplitude X a contact loses 4 F (X - F / kt)."""
    force, tangential = 0.3, 20.0
    system = system_of([friction_law(tangential, force, force)], [[1.0]], [1.0], [0.2])
    period, cycles = 2 * np.pi / 1.7, 40
    flow = ExactFlow(system, Forcing(np.ones((1, 1)), (Signal.harmonic(2.0, 1.7),)), cycles * period)
    trajectory = simulate(flow, np.zeros(3))
    times = np.linspace((cycles - 1) * period, cycles * period, 20001)
    states = trajectory.states_at(times)
    dissipated = energy_history(trajectory, times).history.dissipated
    viscous = 0.2 * np.trapezoid(states[:, 1] ** 2, times)
    amplitude = 0.5 * (states[:, 0].max() - states[:, 0].min())
    lost = dissipated[-1] - dissipated[0] - viscous
    assert lost == pytest.approx(4 * force * (amplitude - force / tangential), rel=1e-6)


# -- scenarios -------------------------------------------------------------------------------------------------------

PAD = {"name": "pad", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 300.0, "stiffness": 2e5}
BOTH = {"static": 0.3, "sliding": 0.2}


def scenario(friction, **others):
    return load_scenario(
        {
            "chain": {"masses": [2, 2], "springs": [1000, 5000]},
            "friction": friction,
            "excitation": {"kind": "step", "applied_to": {"mass": 2}, "level": 150.0, "duration": 0.2},
            "run": {"duration": 1.0, "sample_rate": 500.0, "start": "rest"},
            **others,
        }
    )


def test_figures_of_a_pad():
    pad = {**PAD, "coefficient": BOTH, "wear_rate": "1e-6 mm^3/(N m)"}
    result = beamsim.run(scenario([pad]))
    history = result["histories"].sel(friction="pad")
    assert result.summary["energy_error"] < 1e-10
    assert history["friction_slides"].item() >= 2
    slider = history["friction_displacement"].values[:] - history["friction_force"].values[:] / 2e5
    snaps = history["friction_slides"].item() * 30.0 / 2e5
    assert history["friction_sliding_distance"].item() == pytest.approx(np.abs(np.diff(slider)).sum(), rel=1e-3)
    slides, distance = (history[f"friction_{name}"].item() for name in ("slides", "sliding_distance"))
    lost = 60.0 * (distance - snaps) + slides * (90.0**2 - 60.0**2) / (2 * 2e5)
    assert history["friction_dissipated_energy"].item() == pytest.approx(lost, rel=1e-9)
    assert history["friction_dissipated_energy"].item() == pytest.approx(
        result["histories"]["energy_dissipated"].values[-1], rel=1e-9
    )
    assert history["friction_wear_power"].item() == pytest.approx(
        300.0 * history["friction_sliding_distance"].item(), rel=1e-12
    )
    assert history["friction_worn_volume"].item() == pytest.approx(
        1e-15 * 300.0 * history["friction_sliding_distance"].item(), rel=1e-12
    )
    assert result.summary["peak_friction_force_n"]["pad"] == pytest.approx(90.0, rel=1e-9)
    assert np.abs(history["friction_force"].values[~history["friction_stuck"].values[:]]) == pytest.approx(60.0)
    assert "springs" not in result.summary
    assert not result["histories"].labels("spring")


@pytest.mark.parametrize(("start", "force"), [("unstressed", 0.0), (45.0, 45.0), (-45.0, -45.0)])
def test_the_start_says_which_equilibrium(start, force):
    """Under a dead load the pad rests where its force at the start leaves it, and nothing moves."""
    others = {
        "constant_forces": [{"mass": 2, "force": 20.0}], "excitation": {"kind": "none"},
        "run": {"duration": 0.2, "sample_rate": 500.0, "start": "static_equilibrium"},
    }  # fmt: skip
    result = beamsim.run(scenario([{**PAD, "coefficient": BOTH, "start": start}], **others))
    np.testing.assert_allclose(
        result["histories"]["friction_displacement"].sel(friction="pad").values[:], (20.0 - force) / 1000.0, rtol=1e-9
    )
    np.testing.assert_allclose(result["histories"]["friction_force"].sel(friction="pad").values[:], force, atol=1e-7)
    assert result.summary["friction"]["pad"]["start_force_n"] == force


@pytest.mark.parametrize("begin", [0.6, 0.731])
def test_sliding_and_wear_before_and_after_a_time_are_those_of_the_run(begin):
    case = config_path("rubbing_stop")
    parts = {"whole": {}, "before": {"run.duration": begin}, "after": {"run.from": begin}}
    cases = {name: {"run.convergence": "off", **changes} for name, changes in parts.items()}
    runs = {name: beamsim.run(beamsim.load_scenario(case, changes)) for name, changes in cases.items()}
    of = {name: run["histories"].sel(friction="latch") for name, run in runs.items()}
    for name in ("sliding_distance", "dissipated_energy", "worn_volume"):
        whole, before, after = (of[part][f"friction_{name}"].item() for part in parts)
        assert before > 0.0
        assert after > 0.0
        assert before + after == pytest.approx(whole, rel=1e-9)
    whole, before, after = (of[part]["friction_sliding_share"].item() for part in parts)
    assert before * begin + after * (1.5 - begin) == pytest.approx(1.5 * whole, rel=1e-9)
    power, volume = (of["after"][f"friction_{name}"].item() for name in ("wear_power", "worn_volume"))
    assert power * (1.5 - begin) == pytest.approx(volume / 1e-15, rel=1e-9)
