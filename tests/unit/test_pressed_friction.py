"""Dry friction under the force of a snubber: integration by hand, energy, limits and scenarios."""

from dataclasses import replace

import numpy as np
import pytest
from balance import energy_history, energy_of_segments
from scipy.integrate import solve_ivp

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import no_tension
from beamsim.contacts.sliders import friction_law, pressed_friction_law, rigid_friction_law
from beamsim.errors import MethodError
from beamsim.flow.exact import ExactFlow, exact_flow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

SHAPE = np.array([[-1.0, 0.2], [0.3, 1.0]])  # of the stop and of the motion along the face
SPRINGS, DAMPERS = np.array([1.0, 3.0]), np.array([0.02, 0.05])
LOAD, OMEGA = np.array([0.6, 0.5]), np.array([1.3, 2.1])
STATIC, SLIDING, STOP, GAP = 0.4, 0.3, 50.0, -0.05


def system_of(law, stop=None, shape=SHAPE, gap=GAP, pressed=True):
    contacts = Contacts(
        shape, np.array([1.0, -1.0]), np.array([gap, 0.0]), np.zeros(2, dtype=bool), (stop or kelvin_voigt(STOP), law),
        pressed_by=np.array([-1, 0]) if pressed else None,
    )  # fmt: skip
    return PiecewiseLinearSystem(SPRINGS, np.diag(DAMPERS), contacts, np.zeros(2))


def motion(system, duration, load=LOAD, start=(0.0, 0.0, 0.0, 0.0)):
    forcing = Forcing(np.diag(load), (Signal.harmonic(1.0, OMEGA[0]), Signal.harmonic(1.0, OMEGA[1])))
    flow = ExactFlow(system, forcing, duration)
    y = np.append(start, system.contacts.relaxed_states(-system.contacts.gap - system.contacts.sign * (
        system.contacts.shape @ np.array(start[:2]))))  # fmt: skip
    return simulate(flow, y, max_events=2000)


def by_hand(tangential, dashpot, duration):
    """Final (q, q'), times of changes, energy lost by friction: plain formulas, and a general integrator.

    The contact is closed while it pushes, with a spring of stiffness ``tangential`` sliding ends where the slider s
    stands still, without one where the face does.
    """
    closed, mode, t, changes = True, 0, 0.0, []
    face, along = -SHAPE[0], SHAPE[1]  # penetration and tangential motion for a unit of each coordinate
    y = np.zeros(7)  # q, q', compression of the released stop, slider, loss

    def normal(y):
        return STOP * (face @ y[:2] - GAP) + dashpot * face @ y[2:4] if closed else 0.0

    def free_acceleration(t, y):
        return LOAD * np.sin(OMEGA * t) - SPRINGS * y[:2] - DAMPERS * y[2:4] - face * normal(y)

    def holding(t, y):
        return along @ free_acceleration(t, y) / (along @ along)

    def slider_rate(y):
        turning = 0.0 if tangential is None else mode * SLIDING * STOP * (face @ y[2:4]) / tangential * closed
        return along @ y[2:4] - turning

    def rub(t, y):
        if not closed:
            return 0.0
        if mode:
            return mode * SLIDING * normal(y)
        return holding(t, y) if tangential is None else tangential * (along @ y[:2] - y[5])

    def rhs(t, y):
        a = free_acceleration(t, y) - along * rub(t, y)
        relaxing = 0.0 if closed or dashpot == 0.0 else -STOP / dashpot * y[4]
        moved = slider_rate(y) if mode else 0.0 if closed else along @ y[2:4]
        lost = rub(t, y) * moved + (dashpot * (face @ y[2:4]) ** 2 if closed else dashpot * relaxing**2)
        return np.concatenate([y[2:4], a, [relaxing, moved, lost]])

    while t < duration:
        watched = []
        if closed:
            watched.append(("opens", lambda t, y: normal(y)))
            if mode == 0:
                watched += [(s, lambda t, y, s=s: STATIC * normal(y) - s * rub(t, y)) for s in (1, -1)]
            else:
                watched.append((0, lambda t, y, sign=mode: sign * slider_rate(y)))
        else:
            watched.append(("closes", lambda t, y: y[4] - (face @ y[:2] - GAP)))
        for _, function in watched:
            function.terminal, function.direction = True, -1.0
        run = solve_ivp(
            rhs, (t, duration), y, "DOP853", events=[f for _, f in watched], rtol=1e-10, atol=1e-12, max_step=0.1
        )
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status != 1:
            break
        what = watched[next(i for i, e in enumerate(run.t_events) if e.size)][0]
        changes.append(t)
        if what == "opens":
            closed, mode, y[4] = False, 0, face @ y[:2] - GAP if dashpot else 0.0
        elif what == "closes":
            closed = True
            if tangential is None:
                mode = int(np.sign(along @ y[2:4]))
            else:  # at first the limit grows with the force, and the spring's force with the motion
                y[5] = along @ y[:2]
                steep = tangential * abs(along @ y[2:4]) > STATIC * STOP * (face @ y[2:4])
                mode = int(np.sign(along @ y[2:4])) if steep else 0
        elif what == 0:
            y[5], mode = along @ y[:2] - (mode * SLIDING * normal(y) / (tangential or np.inf)), 0
        else:
            if tangential is not None:
                y[-1] += (STATIC**2 - SLIDING**2) * normal(y) ** 2 / (2 * tangential)
                y[5] = along @ y[:2] - what * SLIDING * normal(y) / tangential
            mode = what
    return y[:4], np.array(changes), y[-1]


@pytest.mark.parametrize(("tangential", "dashpot", "duration"), [(None, 0.0, 8.0), (None, 0.5, 8.0), (20.0, 0.0, 12.0)])
def test_against_integration_by_hand(tangential, dashpot, duration):
    """Opening, sticking and sliding in both directions, and the energy that friction and the stop's dashpot lose."""
    end, changes, lost = by_hand(tangential, dashpot, duration)
    system = system_of(pressed_friction_law(tangential, STATIC, SLIDING), no_tension(STOP, dashpot))
    trajectory = motion(system, duration)
    of_flow = trajectory.event_time[np.append(True, np.diff(trajectory.event_time) > 1e-9)]
    turns = [t for t, j, k in zip(trajectory.event_time, trajectory.event_contact, trajectory.event_phase, strict=True)
             if j == 1 and k >= 3]  # of the motion of a free face, which the other code does not watch  # fmt: skip
    of_flow = of_flow[~np.isin(of_flow, turns)]
    assert {0, 1, 2, 3} <= set(trajectory.phases[:, 1].tolist())
    np.testing.assert_allclose(of_flow, changes, atol=1e-7)
    np.testing.assert_allclose(trajectory.final_y[:4], end, atol=1e-7)
    times = np.linspace(0.0, duration, 400)
    balance = energy_history(trajectory, times)
    assert balance.error < 1e-12
    assert energy_of_segments(trajectory).error < 1e-12
    assert np.all(np.diff(balance.history.dissipated) >= 0.0)
    viscous = trajectory.product_integrals(times, *[lambda phases: _rates(trajectory.flow)] * 2, DAMPERS[:, None])
    assert balance.history.dissipated[-1] - viscous[-1, 0] == pytest.approx(lost, rel=1e-6)


def _rates(flow):
    return flow.equations.rows(2, velocities=np.eye(2))


@pytest.mark.parametrize("stop", [kelvin_voigt(STOP, 0.5), no_tension(STOP, 0.5)], ids=["may pull", "no tension"])
def test_a_slider_cannot_follow_the_force_of_a_dashpot(stop):
    """From Python, too: the motion would loop without end in zero time. Twins: no dashpot, and no spring."""
    with pytest.raises(MethodError, match=r"contact 2 is friction with a tangential spring, and contact 1, .* dashpot"):
        system_of(pressed_friction_law(20.0, STATIC, SLIDING), stop)
    system_of(pressed_friction_law(20.0, STATIC, SLIDING), kelvin_voigt(STOP))
    system_of(pressed_friction_law(None, STATIC, SLIDING), stop)


@pytest.mark.parametrize("tangential", [None, 20.0])
def test_constant_pressing_force(tangential):
    """A stop that a motion along the face does not compress presses with a constant force."""
    shape, force = np.eye(2) * [-1.0, 1.0], 0.8
    limits = STATIC * force, SLIDING * force
    constant = rigid_friction_law(*limits) if tangential is None else friction_law(tangential, *limits)
    compressed = -force / STOP  # where the first coordinate is zero: there the load below balances the stop
    load, balancing = np.array([0.0, 1.1]), np.array([force, 0.0])

    def moved(law, pressed):
        system = system_of(law, shape=shape, gap=compressed, pressed=pressed)
        return motion(replace(system, constant_load=balancing), 40.0, load)

    pressed, given = moved(pressed_friction_law(tangential, STATIC, SLIDING), True), moved(constant, False)
    assert pressed.event_time.size == given.event_time.size > 15
    np.testing.assert_allclose(pressed.event_time, given.event_time, atol=1e-12)
    np.testing.assert_allclose(pressed.final_y[:4], given.final_y[:4], atol=1e-12)


# -- scenarios -------------------------------------------------------------------------------------------------------

PAD = {"name": "pad", "at": {"mass": 1}, "normal_force": {"snubber": "guide"}, "wear_rate": 1e-15,
       "coefficient": {"static": 0.3, "sliding": 0.2}}  # fmt: skip
GUIDE = {"name": "guide", "at": {"mass": 3}, "side": "above", "gap": 2e-4, "stiffness": 5e4}


def scenario(pad=None, guide=None, **others):
    return load_scenario(
        {
            "chain": {"masses": [2, 2, 1], "springs": [2000, 5000, 8000], "damping": {"kind": "modal", "ratio": 0.01}},
            "snubbers": [{**GUIDE, **(guide or {})}],
            "friction": [{**PAD, **(pad or {})}],
            "excitation": {"kind": "harmonic", "applied_to": "base", "level": 20.0, "frequency": 6.0},
            "run": {"duration": 1.3, "sample_rate": 2000.0, "start": "rest", "convergence": "off"},
            **others,
        }
    )


MAXWELL = {"maxwell": [{"stiffness": 2e4, "relaxation_time": 0.003}]}
TABLE = {"stiffness": None, "force_deflection": {"points": [[0, 0], [0.002, 100], [0.01, 900]]}}


@pytest.mark.parametrize(
    ("pad", "guide"),
    [
        ({}, {}),
        ({}, {"damping": {"kind": "viscous", "coefficient": 40.0}, "law": "no_tension"}),
        ({"stiffness": 2e5}, MAXWELL),
        ({"stiffness": 2e5}, {"hardening": {"yield_force": 150.0, "stiffness": 1e4}}),
        ({}, TABLE),
    ],
    ids=["spring", "dashpot", "maxwell", "hardening", "table"],
)
def test_laws_of_the_snubber(pad, guide):
    """The force stays within its limits, the energy balances, and the figures of sliding are those of the histories."""
    result = beamsim.run(scenario(pad, guide))
    pad_history = result["histories"].sel(friction="pad")
    normal = result["histories"]["snubber_force"].sel(snubber="guide").values
    assert result.summary["energy_error"] < 1e-12
    scale, time = normal.max(), result["histories"]["time"].values
    assert np.all(np.abs(pad_history["friction_force"].values) <= 0.3 * normal + 1e-6 * scale)
    assert np.all(pad_history["friction_force"].values[normal == 0.0] == 0.0)
    slides = ~pad_history["friction_stuck"].values & (normal > 0.0)
    assert pad_history["friction_sliding_share"].item() == pytest.approx(np.mean(slides), abs=0.01)
    assert pad_history["friction_slides"].item() >= 5
    if not pad:  # the slider is the face: the integral of force times speed
        assert pad_history["friction_dissipated_energy"].item() == pytest.approx(
            0.2 * pad_history["friction_wear_power"].item() * 1.3, rel=1e-9
        )
        speed = np.abs(
            np.gradient(
                pad_history["friction_displacement"].values,
                time,
            )
        )
        assert pad_history["friction_wear_power"].item() == pytest.approx(
            np.trapezoid(normal * speed, time) / 1.3, rel=0.02
        )
        assert pad_history["friction_sliding_distance"].item() == pytest.approx(
            np.trapezoid(slides * speed, time), rel=0.05
        )
    assert pad_history["friction_worn_volume"].item() == pytest.approx(
        1e-15 * pad_history["friction_wear_power"].item() * 1.3
    )


def test_nothing_sticks_that_would_have_to_hold_more_than_it_can():
    """Short pieces of an input have large coefficients of the powers of time, which are no measure of round-off."""
    psd = [{"frequency": f, "density": 5.0} for f in (1.0, 20.0)]
    case = scenario(
        {"normal_force": 5.0}, excitation={"kind": "random", "applied_to": "base", "psd": psd, "seed": 1},
        run={"duration": 2.0, "sample_rate": 2000.0, "start": "rest", "convergence": "off"},
    )  # fmt: skip
    system = build_system(case)
    flow = exact_flow(system, 2.0)
    motion = simulate(flow, system.initial_state)
    assert motion.event_time.size > 20
    for time, state, y in zip(*(x[motion.length > 0.0] for x in (motion.time, motion.state, motion.y)), strict=True):
        phases = motion.flow.visited_phases[state]
        z = np.append(y, flow.inputs_at(np.array([time]))[0, 0])
        assert (flow.at(phases).events.rows @ z).min() > -1e-9
