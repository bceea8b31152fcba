"""Stops that yield: closed form, integration by hand, energy, limits, preload and scenarios."""

import numpy as np
import pytest
from balance import energy_history
from scipy.integrate import solve_ivp

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.sliders import LOADING, hardening_law
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

SHAPE, STIFFNESS, DAMPING = np.array([1.0, 0.4]), np.array([1.0, 9.0]), np.array([0.05, 0.1])
LOAD, OMEGA, GAP = np.array([2.0, 1.2]), 1.3, 0.05
START = np.array([0.03, 0.0, 0.3, -0.1])
STOPS = [(20.0, 1.0, 5.0, 0.0), (20.0, 0.6, 2.0, 0.3), (60.0, 1.5, 50.0, 0.0), (20.0, 0.4, 1e-3, 0.0)]


def system_of(law, gap=GAP):
    contacts = Contacts(SHAPE[None], np.array([-1.0]), np.array([gap]), np.array([False]), (law,))
    return PiecewiseLinearSystem(STIFFNESS, np.diag(DAMPING), contacts, np.zeros(2))


def moved(law, duration=20.0):
    flow = ExactFlow(system_of(law), Forcing(LOAD[None], (Signal.harmonic(1.0, OMEGA),)), duration)
    return simulate(flow, np.append(START, np.zeros(law.internal_states)))


def by_hand(stiffness, yield_force, hardening, dashpot, duration):
    """Final (q, q'), instants at which contact begins or ends, and the final position of the slider."""
    k_s, limit = stiffness - hardening, yield_force * (1 - hardening / stiffness)
    mode, touching = 0, False

    def along(y):
        return SHAPE @ y[:2] - GAP, SHAPE @ y[2:4]

    def spring(y):
        delta, _ = along(y)
        return hardening * delta + (mode * limit if mode else k_s * (delta - y[4]))

    def rhs(t, y):
        push = spring(y) + dashpot * along(y)[1] if touching else 0.0
        a = LOAD * np.sin(OMEGA * t) - STIFFNESS * y[:2] - DAMPING * y[2:4] - push * SHAPE
        return np.concatenate([y[2:4], a, [0.0]])

    def guards():
        if not touching:
            return [(lambda t, y: k_s / stiffness * y[4] - along(y)[0], "meets")]
        ends = [(lambda t, y: spring(y), "parts")]
        if mode:
            return [*ends, (lambda t, y: mode * along(y)[1], "turns")]
        return [*ends, *((lambda t, y, s=s: limit - s * k_s * (along(y)[0] - y[4]), s) for s in (1, -1))]

    t, y, contacts = 0.0, np.append(START, 0.0), []
    while t < duration:
        watched = guards()
        for function, _ in watched:
            function.terminal, function.direction = True, -1.0
        run = solve_ivp(
            rhs, (t, duration), y, "DOP853", rtol=1e-10, atol=1e-12, max_step=0.1, events=[f for f, _ in watched]
        )
        t, y = run.t[-1], run.y[:, -1]
        if run.status != 1:
            break
        (what,) = [what for (_, what), times in zip(watched, run.t_events, strict=True) if times.size]
        if what in ("parts", "turns") and mode:
            y[4], mode = along(y)[0] - mode * limit / k_s, 0
        if what in ("meets", "parts"):
            touching = not touching
            contacts.append(t)
        elif what in (1, -1):
            mode = what
    return y, np.array(contacts)


@pytest.mark.parametrize("numbers", STOPS)
def test_against_integration_by_hand(numbers):
    trajectory = moved(hardening_law(*numbers), 15.0)
    expected, contacts = by_hand(*numbers, 15.0)
    assert contacts.size >= 4
    assert np.sum(trajectory.event_phase == LOADING) >= 2
    np.testing.assert_allclose(trajectory.event_time[trajectory.touch_changes != 0], contacts, atol=1e-7)
    np.testing.assert_allclose(trajectory.final_y[:4], expected[:4], atol=1e-7)


def test_one_blow():
    """A mass meets the stop with speed v and nothing else acts: crush, time and return speed from the energy."""
    mass_speed, k, limit, k_h = 1.0, 100.0, 4.0, 20.0
    contacts = Contacts(np.ones((1, 1)), np.array([-1.0]), np.zeros(1), np.array([False]),
                        (hardening_law(k, limit, k_h),))  # fmt: skip
    system = PiecewiseLinearSystem(np.zeros(1), np.zeros((1, 1)), contacts, np.zeros(1))
    trajectory = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 3.0), np.array([0.0, mass_speed, 0.0]))
    first = limit / k  # work up to a depth d: limit first / 2 + limit (d - first) + k_h (d - first)^2 / 2
    further = (-limit + np.sqrt(limit**2 + 2 * k_h * (0.5 * mass_speed**2 - 0.5 * limit * first))) / k_h
    depth, force = first + further, limit + k_h * further
    assert force < 2 * limit * (1 - k_h / k)  # unloading stays elastic
    returned = force / np.sqrt(k)
    assert trajectory.final_y[1] == pytest.approx(-returned, rel=1e-12)
    crush = depth - force / k
    assert 0.8 * trajectory.final_y[2] == pytest.approx(crush, rel=1e-12)
    # times of the three phases: to yield, to the turning point, back
    w, w_h = np.sqrt(k), np.sqrt(k_h)
    to_yield = np.arcsin(first * w / mass_speed) / w
    speed = mass_speed * np.cos(w * to_yield)
    turn = to_yield + np.arctan2(speed * w_h, limit) / w_h
    np.testing.assert_allclose(trajectory.event_time[1:], [to_yield, turn, turn + 0.5 * np.pi / w], rtol=1e-12)
    lost = 0.5 * (mass_speed**2 - returned**2)
    history = energy_history(trajectory, np.array([0.0, 3.0])).history
    stored = 0.5 * 0.8 * k_h * trajectory.final_y[2] ** 2  # locked in between the spring and the slider
    assert history.dissipated[-1] + stored == pytest.approx(lost, rel=1e-12)


def test_limits():
    """A yield force that is never reached, and a hardening stiffness next to the elastic one, are a linear stop."""
    linear = moved(kelvin_voigt(20.0)).final_y
    np.testing.assert_allclose(moved(hardening_law(20.0, 1e3, 5.0)).final_y[:4], linear, atol=1e-13)
    for near in (1e-3, 1e-6):
        end = moved(hardening_law(20.0, 1.0, 20.0 * (1 - near))).final_y[:4]
        assert 0.0 < np.abs(end - linear).max() < 20.0 * near


# -- scenarios -------------------------------------------------------------------------------------------------------


def chain(stop, **sections):
    return load_scenario({
        "chain": {"masses": [1.0], "springs": [50.0], "damping": {"kind": "modal", "ratio": 0.02}},
        "snubbers": [{"name": "pad", "at": {"mass": 1}, "side": "above", "stiffness": "1 kN/m", **stop}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "1.5 g", "frequency": "1.4 Hz"},
        "run": {"duration": 4.0, "sample_rate": "1 kHz", "start": "rest"},
        **sections,
    })  # fmt: skip


YIELDS = {"hardening": {"yield_force": "20 N", "stiffness": "200 N/m"}}


def test_a_run_says_how_far_it_is_crushed():
    scenario = chain({**YIELDS, "gap": "20 mm"})
    result = beamsim.run(scenario)
    crush = result["histories"]["snubber_residual_crush"].sel(snubber="pad").item()
    stepped = beamsim.run(chain({**YIELDS, "gap": "20 mm"}, run={"duration": 4.0, "sample_rate": "1 kHz",
                                                               "start": "rest", "method": "reference"}))  # fmt: skip
    assert result.summary["energy_error"] < 1e-10
    assert crush == pytest.approx(20.0 * 0.8 / 200.0, rel=1e-12)  # the most: unloading yields back
    assert result.summary["residual_crush_m"] == {"pad": crush}
    force, deflection = (
        result["histories"]["snubber_force"].sel(snubber="pad").values,
        result["histories"]["snubber_penetration"].sel(snubber="pad").values,
    )
    assert force.min() >= -1e-12
    assert force[deflection < 0.0].max() <= 1e-12  # on its way out the face is behind where it was
    (probe,) = result["histories"].labels("probe")
    np.testing.assert_allclose(
        stepped["histories"]["displacement"].sel(probe=probe).values,
        result["histories"]["displacement"].sel(probe=probe).values,
        atol=1e-6,
    )
    assert "snubber_residual_crush" not in stepped["histories"]


def test_preload_beyond_the_yield_force():
    """The gap follows from the first loading; the motion begins there with the slider that it leaves."""
    scenario = chain({**YIELDS, "preload": "30 N"}, run={"duration": 0.1, "sample_rate": "1 kHz",
                     "start": "static_equilibrium"})  # fmt: skip
    system = build_system(scenario)
    delta = 20.0 / 1000.0 + 10.0 / 200.0
    position = -30.0 / 50.0  # where the spring pushes with as much
    assert system.snubbers[0].gap == pytest.approx(position - delta, rel=1e-12)
    assert system.initial_state[-1] == pytest.approx(delta - 16.0 / 800.0, rel=1e-12)
    assert system.snubbers[0].preload == pytest.approx(30.0, rel=1e-12)


def test_a_continuation_goes_on_where_the_stop_begins_to_yield():
    """A slider that rests and one that is set anew have the same sign in the determinant that tells forth from back."""
    case = load_scenario(
        {
            "chain": {"masses": [1], "springs": [1000], "damping": {"kind": "modal", "ratio": 0.05}},
            "snubbers": [{"name": "stop", "at": {"mass": 1}, "side": "above", "gap": 1e-3, "stiffness": 5e3,
                          "hardening": {"yield_force": 5.0, "stiffness": 1e3}}],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": 3.0, "frequency": 3.0},
            "sweep": {"kind": "continuation", "from": 4.7, "to": 5.0, "side_branches": "none"},
        }
    )  # fmt: skip
    (branch, *_) = beamsim.continuation(case).branches
    assert branch["frequency_hz"].values[-1] == pytest.approx(5.0)
    assert np.all(np.diff(branch["frequency_hz"].values) > 0.0)
