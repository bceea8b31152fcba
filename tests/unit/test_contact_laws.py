"""Contact laws as phases: the types take a law that the package does not ship, and laws agree with their parts."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import (
    DEPTH,
    ContactLaw,
    Guard,
    LawRow,
    LawSpring,
    Phase,
    piecewise_linear,
)
from beamsim.flow.exact import ExactFlow
from beamsim.flow.passage import Frequency, PeriodicForcing
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

K, KM, TAU, GAP = 20.0, 35.0, 0.15, 0.1
LOAD, OMEGA = np.array([1.0, 0.6]), 1.3


def zener():
    """Spring K beside a Maxwell branch (KM, TAU) that never pulls: contact ends by the force, the pad recovers."""
    stretch = LawRow(1.0, internal=(-1.0,))
    # released: N = K delta + KM (delta - p) = 0 sets the pad's own compression u: p' = (u - p)/TAU, u = KM p/(K + KM)
    recovery = (LawRow(internal=((KM / (K + KM) - 1.0) / TAU,)),)
    released = Phase(
        "released", (Guard(1, LawRow(-(K + KM), internal=(KM,))),), touching=False, rates=recovery,
        springs=(LawSpring(K * KM / (K + KM), LawRow(internal=(1.0,))),), losses=(KM * TAU,),
    )  # fmt: skip
    touching = Phase(
        "touching", (Guard(0, LawRow(K + KM, internal=(-KM,))),), touching=True,
        springs=(LawSpring(K, DEPTH), LawSpring(KM, stretch)), rates=(LawRow(1.0 / TAU, internal=(-1.0 / TAU,)),),
        losses=(KM * TAU,),
    )  # fmt: skip
    return ContactLaw((released, touching), internal_states=1)


@pytest.fixture
def system():
    contacts = Contacts(np.array([[1.0, 0.4]]), np.array([-1.0]), np.array([GAP]), np.array([False]), (zener(),))
    return PiecewiseLinearSystem(np.array([1.0, 9.0]), np.diag([0.05, 0.1]), contacts, np.zeros(2))


def by_hand(system, duration, start):
    """Position of the pad and the force in plain formulas, restarted at every event."""
    shape = system.contacts.shape[0]

    def force(y):
        return K * (y[:2] @ shape - GAP) + KM * (y[:2] @ shape - GAP - y[4])

    def rhs(t, y, touching):
        push = force(y) if touching else 0.0
        surface = y[:2] @ shape - GAP if touching else KM * y[4] / (K + KM)
        a = LOAD * np.sin(OMEGA * t) - system.stiffness * y[:2] - system.damping @ y[2:4] - push * shape
        return np.concatenate([y[2:4], a, [(surface - y[4]) / TAU]])

    def changes(t, y, touching):
        return force(y) if touching else -force(y)

    changes.terminal, changes.direction = True, -1.0
    t, y, touching, events = 0.0, start, False, []
    while t < duration:
        run = solve_ivp(rhs, (t, duration), y, "DOP853", args=(touching,), events=changes, rtol=1e-12, atol=1e-13)
        t, y = run.t[-1], run.y[:, -1]
        if run.status == 1:
            events.append(t)
            touching = not touching
    return y, events


def test_a_zener_element_that_never_pulls(system):
    """A law of three lines, marched without a change elsewhere, against an integration by hand."""
    start = np.array([0.05, 0.0, 0.3, -0.1, 0.02])
    expected, events = by_hand(system, 15.0, start)
    flow = ExactFlow(system, Forcing(LOAD[None], (Signal.harmonic(1.0, OMEGA),)), 15.0)
    trajectory = simulate(flow, start)
    assert trajectory.event_time.size == len(events) >= 6
    np.testing.assert_allclose(trajectory.event_time, events, atol=1e-8)
    np.testing.assert_allclose(trajectory.final_y, expected, atol=1e-8)


def test_derivatives_across_a_zener_element(system):
    """The transition matrix and the derivative by the frequency against differences of the motion."""
    flow = VariationalFlow(system, PeriodicForcing.harmonic(LOAD), OMEGA)
    start = np.array([0.05, 0.0, 0.3, -0.1, 0.02])
    passage = flow.carry(start, 9.0, (Frequency(),))
    assert passage.event_time.size >= 4
    h = 1e-6
    for k in range(5):
        step = h * np.eye(5)[k]
        slope = (flow.carry(start + step, 9.0).end - flow.carry(start - step, 9.0).end) / (2 * h)
        np.testing.assert_allclose(passage.transition[:, k], slope, atol=1e-6)
    ends = [VariationalFlow(system, PeriodicForcing.harmonic(LOAD), OMEGA + x).carry(start, 9.0).end for x in (h, -h)]
    np.testing.assert_allclose(passage.parameters[:, 0], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def test_energy_is_lost_where_a_law_says_so(system):
    """Energy stored at the start is what is stored and lost later, without loads."""
    from beamsim.analyses.run.energy import energy_history

    flow = ExactFlow(system, Forcing(np.zeros((0, 2)), ()), 8.0)
    trajectory = simulate(flow, np.array([0.9, 0.2, 0.3, -0.1, 0.0]))
    assert trajectory.event_time.size >= 2
    balance = energy_history(trajectory, np.linspace(0, 8, 400))
    history, error = balance.history, balance.error
    assert history.dissipated[-1] > 0.05
    assert error < 1e-10


def test_a_piecewise_linear_law_is_the_sum_of_its_parts():
    law = piecewise_linear([-0.5, 0.2, 0.9], [4.0, 1.0, 3.0, 2.5], 1)
    one = Contacts(np.ones((1, 1)), np.array([-1.0]), np.zeros(1), np.array([False]), (law,))
    parts = one.one_sided_parts()
    assert one.one_sided
    assert parts.count == 3
    x = np.linspace(-1.5, 1.5, 301)[:, None]
    nothing = np.zeros((301, 0))
    phases = np.searchsorted([-0.5, 0.2, 0.9], x)
    delta = -parts.gap - parts.sign * x
    for scaled in (1.0, 0.3):
        own = one.scaled(scaled)
        pushes = parts.scaled(scaled).forces((delta > 0).astype(int), delta, 0 * delta, nothing)
        together = -pushes @ parts.sign
        np.testing.assert_allclose(own.forces(phases, x, 0 * x, nothing)[:, 0], together, atol=1e-13)
        energy = own.stored_energy(phases, x, nothing)
        slope = np.diff(energy) / np.diff(x[:, 0])
        np.testing.assert_allclose(slope, 0.5 * (together[1:] + together[:-1]), atol=0.02)


def test_phases_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="names a phase"):
        ContactLaw((Phase("alone", (Guard(1, DEPTH),), touching=True),))
    twice = (Guard(1, DEPTH), Guard(1, LawRow(rate=1.0)))
    with pytest.raises(ValueError, match="name the same phase"):
        ContactLaw((Phase("a", twice, touching=True), Phase("b", (), touching=False)))
    with pytest.raises(ValueError, match="not a sum"):
        Contacts(np.ones((1, 1)), np.ones(1), np.zeros(1), np.array([False]), (zener(),)).one_sided_parts()
