"""The short way to an undamped contact state's tables against the general one."""

import numpy as np
import pytest

from beamsim.flow.contact_state import build_state
from beamsim.flow.sources import compile_sources
from beamsim.flow.undamped_state import undamped_state

OMEGA = np.array([1.0, 6.3, 17.5])
SHAPE = np.array([[1.4, -1.3, 1.1], [0.5, 1.2, 0.3]])


@pytest.mark.parametrize("phases", [[0, 0], [1, 0], [1, 1]])
def test_tables_are_the_general_ones(make_system, no_forcing, phases):
    system = make_system(
        OMEGA, np.zeros(3), shape=SHAPE, stiffness=[40.0, 90.0], gap=[0.1, -0.05], sign=[1.0, -1.0],
        constant_load=[0.3, -0.2, 0.1]
    )  # fmt: skip
    phases = np.array(phases)
    short = undamped_state(system, phases, 60.0)
    general = build_state(system, no_forcing(3), compile_sources(()), -1, phases, 60.0)
    np.testing.assert_allclose(short.exponent, general.exponent, rtol=1e-14)
    for name in ("power", "term_basis", "term_source", "basis_of_source", "basis_below_source", "phases"):
        np.testing.assert_array_equal(getattr(short, name), getattr(general, name))
    assert short.horizon == general.horizon

    def flow(state, y, t):
        amplitude = state.projector @ (y - state.term_vector[0].real)
        free = state.term_vector[1:].T * np.exp(state.exponent[state.term_basis[1:]] * t)
        return (state.term_vector[0] + free @ amplitude).real

    y = np.array([0.2, -0.1, 0.3, 1.0, -2.0, 0.5])
    np.testing.assert_allclose(flow(short, y, 0.0), y, atol=1e-14)
    np.testing.assert_allclose(flow(short, y, 1.7), flow(general, y, 1.7), atol=1e-13)


@pytest.mark.parametrize(
    ("omega", "damping", "dashpot"), [([0.0, 6.3, 17.5], 0.0, 0.0), (OMEGA, 0.1, 0.0), (OMEGA, 0.0, 2.0)]
)
def test_it_declines_what_it_cannot_do(make_system, omega, damping, dashpot):
    """Rigid-body modes, damping, dashpots."""
    system = make_system(omega, np.full(3, damping), shape=SHAPE, stiffness=40.0, dashpot=dashpot)
    assert undamped_state(system, np.array([1, 0]), 60.0) is None


def test_low_frequencies_do_not_take_the_round_off_of_high_ones(make_system, no_forcing):
    """Continuation in a contact's numbers needs motions that are smooth in them to its tolerance of 1e-11."""
    omega, shape, k = np.geomspace(1.0, 1e4, 15), np.random.default_rng(1).normal(size=15), 3.0
    system = make_system(omega, 1e-3 * np.ones(15), shape=shape[None], stiffness=k, gap=0.0, sign=1.0)
    state = build_state(system, no_forcing(15), compile_sources(()), -1, np.array([1]), 60.0)
    # the largest eigenvalue of the compliance (Sherman and Morrison) has all digits
    compliance = np.diag(omega**-2) - np.outer(shape / omega**2, shape / omega**2) * k / (1 + k * shape**2 @ omega**-2)
    expected = np.linalg.eigvalsh(compliance)[-1] ** -0.5
    assert np.abs(state.simple[2]).min() == pytest.approx(expected, rel=1e-13)
