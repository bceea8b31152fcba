"""Modes of a contact state from a neighbour's, without an eigenvalue problem."""

from dataclasses import replace

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import no_tension
from beamsim.flow.contact_state import ContactState
from beamsim.flow.exact import ExactFlow
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem, StateEquations

N, M = 40, 6


def beam_like(law=kelvin_voigt, *, stiffness=4e3, dashpot=1.0, ratio=0.01, seed=0, load=0.0) -> PiecewiseLinearSystem:
    """Frequencies that grow with the square of their number, and contacts at places of a pinned beam."""
    rng = np.random.default_rng(seed)
    omega = 20.0 * np.arange(1, N + 1) ** 2.0
    shape = 3.0 * np.sin(np.pi * rng.uniform(0.05, 0.95, (M, 1)) * np.arange(1, N + 1))
    contacts = Contacts(shape, np.where(np.arange(M) % 2, -1.0, 1.0), np.full(M, 1e-3), np.zeros(M, dtype=bool),
                        tuple(law(stiffness * (j + 1), dashpot) for j in range(M)))  # fmt: skip
    return PiecewiseLinearSystem(omega**2, np.diag(2 * ratio * omega), contacts, load * shape.sum(axis=0))


def flow_of(system, duration=0.3) -> ExactFlow:
    """Shaken at the first natural frequency."""
    return ExactFlow(system, Forcing(np.ones((1, N)), (Signal.harmonic(40.0, 20.0),)), duration)


def at(flow, phases):
    return StateEquations(flow.equations, phases)


def propagator(known, system, time):
    """The free response over a time, in the norm of the energy."""
    modes, n = known.modes.simple, system.size
    scale = np.concatenate([np.sqrt(system.stiffness), np.ones(n + modes.right.shape[0] - 2 * n)])
    weight = np.where(modes.eigenvalue.imag > 0, 2.0, 1.0) * np.exp(modes.eigenvalue * time)
    return scale[:, None] * ((modes.right * weight) @ modes.left).real / scale


@pytest.mark.parametrize("law", [kelvin_voigt, no_tension])
@pytest.mark.parametrize("seed", range(4))
def test_long_chains_of_states_stay_as_exact_as_fresh_ones(law, seed):
    """60 random changes of contacts, one after the other."""
    system, rng = beam_like(law, seed=seed, load=2.0), np.random.default_rng(seed)
    flow, phases = flow_of(system), np.zeros(M, dtype=np.int64)
    state = ContactState.of(at(flow, phases.copy()), flow.sources, flow.longest_window)
    for _ in range(60):
        phases[rng.integers(M)] ^= 1
        state = ContactState.of(at(flow, phases.copy()), flow.sources, flow.longest_window, state)
    fresh = ContactState.of(at(flow, phases.copy()), flow.sources, flow.longest_window)
    for time in (0.0, 1e-4, 3e-3):
        assert np.abs(propagator(state, system, time) - propagator(fresh, system, time)).max() < 2e-11
    one, other = (each.term_vector[0] for each in (state, fresh))
    np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(other).max())
    assert np.abs(propagator(state, system, 0.0) - np.eye(propagator(state, system, 0.0).shape[0])).max() < 2e-12


def test_coupled_contacts_at_one_place():
    """Two stops that touch one point from both sides, and one at a node of half of the modes."""
    system = beam_like()
    shape = system.contacts.shape.copy()
    shape[1], shape[2] = shape[0], 3.0 * np.sin(np.pi * 0.5 * np.arange(1, N + 1))
    shape[2, 1::2] = 0.0
    system = replace(system, contacts=replace(system.contacts, shape=shape))
    flow = flow_of(system)
    state = ContactState.of(at(flow, np.zeros(M, dtype=np.int64)), flow.sources, flow.longest_window)
    for phases in ([1, 0, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0], [1, 1, 1, 0, 0, 0], [0, 1, 1, 0, 0, 0]):
        state = ContactState.of(at(flow, np.array(phases)), flow.sources, flow.longest_window, state)
        fresh = ContactState.of(at(flow, np.array(phases)), flow.sources, flow.longest_window)
        assert np.abs(propagator(state, system, 1e-3) - propagator(fresh, system, 1e-3)).max() < 1e-11
