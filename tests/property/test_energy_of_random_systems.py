"""Random structures of every awkward kind: the energy balance closes and the work stays bounded."""

import numpy as np
from balance import energy_history
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def random_case(make_contacts, seed):
    """Rigid-body modes, coincident frequencies, critical and coupled damping, resonance, every snubber law."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 10), rng.integers(1, 5)
    omega = np.sort(10 ** rng.uniform(0, rng.choice([1, 3]), n))
    omega[: min(rng.choice([0, 0, 1, 2]), n - 1)] = 0.0
    if rng.random() < 0.2 and n > 4:
        omega[-1] = omega[-2]
    slow = omega[omega > 0].min()
    damping = np.diag(2 * rng.choice([0, 0.01, 0.1, 1.0, 1 + 1e-8]) * omega)
    if rng.random() < 0.3:
        B = rng.normal(size=(n, n)) * np.sqrt(omega.max()) * 0.05
        damping = damping + B @ B.T
    stiffness = 10 ** rng.uniform(-1, 2, m) * slow**2
    contacts = make_contacts(
        shape=rng.normal(size=(m, n)),
        sign=rng.choice([-1.0, 1.0], m),
        stiffness=stiffness,
        dashpot=rng.choice([0, 0.02, 0.5, 3.0], m) * np.sqrt(stiffness) * rng.choice([0, 1]),
        gap=rng.choice([0, 0.1, -0.1, 0.5], m),
        on_ground=rng.random(m) < 0.3,
        no_tension=rng.random(m) < 0.4,
    )
    load = rng.normal(size=n) * slow**2 * 0.1 * rng.choice([0, 1])
    system = PiecewiseLinearSystem(omega**2, damping, contacts, load)
    drive, duration = slow * rng.choice([1.0, 0.5, 2.3, 1.0000001]), 20 * 2 * np.pi / slow
    tones = np.array([drive, 1.7 * drive])
    amplitude = slow**2 * np.array([1.0, rng.choice([0.0, 0.5])])
    signal = Signal.harmonic(amplitude, tones)
    displacement = Signal.harmonic(-amplitude / tones**2, tones)
    if rng.random() < 0.3:
        signal = Signal.polynomial_pieces(
            [0, duration / 9, duration / 5], [[0, slow**3], [2 * slow**2, -(slow**3)], [0, 0]]
        )
        displacement = signal.antiderivative().antiderivative()
    start = rng.normal(size=2 * n) * rng.choice([0, 1])
    start[n:] *= slow
    return ExactFlow(system, Forcing(rng.normal(size=(1, n)), (signal,), displacement), duration), start


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1_000_000))
def test_energy_balance(make_contacts, seed):
    flow, start = random_case(make_contacts, seed)
    trajectory = simulate(flow, start, max_events=20_000, max_evaluations=10_000_000)
    # undamped and resonant: many events are real
    assert trajectory.outcome.complete or trajectory.outcome.code == "event_limit"
    fastest_cycles = np.sqrt(flow.system.stiffness.max()) * trajectory.end / (2 * np.pi)
    assert trajectory.evaluations < 400 * (trajectory.event_time.size + 20 + fastest_cycles)
    error = energy_history(trajectory, np.linspace(0, trajectory.end, 200)).error
    assert error < 1e-8


def test_a_rigid_body_mode_left_free_beside_coupled_damping(make_contacts):
    """Two rigid-body modes, one of them held by a damped snubber: the other keeps its exact double zero."""
    contacts = make_contacts([[1.0, 0.5, 0.3, -0.2]], 4.0, 0.8)
    system = PiecewiseLinearSystem(
        np.array([0.0, 0.0, 4.0, 90.0]), np.diag([0.0, 0.0, 0.1, 0.3]), contacts, np.zeros(4)
    )
    flow = ExactFlow(system, Forcing(np.zeros((0, 4)), ()), 40.0)
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.5, -1.0, 0.0, 0.0])  # along the motion that the contact doesn't feel
    trajectory = simulate(flow, start)
    state = flow.states[flow.state_index(np.array([1]))]
    assert np.sum(np.abs(state.exponent) < 1e-20) >= 2
    np.testing.assert_allclose(trajectory.final_y[:2], 40.0 * start[4:6], rtol=1e-12)
