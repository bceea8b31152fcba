"""Block-diagonal form against the matrix exponential, coincident and defective eigenvalues included."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from scipy.linalg import expm

from beamsim.flow.contact_state import ContactState
from beamsim.flow.exact import exact_flow
from beamsim.flow.invariant_blocks import block_diagonalise, second_order_blocks
from beamsim.inputs.signal import compile_sources
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.equations import Equations, StateEquations

pytestmark = pytest.mark.quick


def exponential(simple, blocks, tau):
    X, Xi, lam = simple
    total = (X * np.exp(lam * tau)) @ Xi
    for b in blocks:
        total = total + b.weight * (b.right @ expm(b.matrix * tau) @ b.left)
    return total.real


def similar(T, seed):
    S = np.random.default_rng(seed).normal(size=T.shape) + 3 * np.eye(T.shape[0])
    return S @ T @ np.linalg.inv(S)


JORDAN = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -2.0]])
PAIR = np.array([[0.0, 1.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 0.0]])
TRIPLE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    "A",
    [np.diag([-1.0, -2.0, -5.0]), JORDAN, PAIR, TRIPLE, np.diag([1.0, 1.0, 1.0]), np.zeros((2, 2))],
    ids=["distinct", "jordan", "double pair", "triple zero", "multiple", "zero"],
)
@pytest.mark.parametrize("perturbation", [0.0, 1e-14, 1e-9, 1e-6, 1e-3])
def test_exponential(A, perturbation):
    noise = np.random.default_rng(3).normal(size=A.shape)
    A = similar(A + perturbation * noise, 1)
    simple, blocks = block_diagonalise(A)
    for tau in (0.1, 1.0, 3.0):
        exact = expm(A * tau)
        np.testing.assert_allclose(exponential(simple, blocks, tau), exact, atol=1e-9 * np.abs(exact).max())


def test_coordinates_of_other_sizes_get_blocks_of_their_own():
    """Fast and slow motions in coordinates of 1 and 1e-8: one block of all of them would hold for 1e-7 s alone."""
    scale = np.array([1.0, 1e-8, 1.0, 1e-8, 1.0])
    A = similar(np.diag([-1.08e7, -2.0e6, -470.0, -218.3, -82.0]), 2) * scale[:, None] / scale
    simple, blocks = block_diagonalise(A, 0.1)
    assert (simple.eigenvalue.size, blocks) == (5, [])
    for tau in (1e-8, 1e-6, 1e-3):
        exact = expm(A / scale[:, None] * scale * tau)
        ours = exponential(simple, blocks, tau) / scale[:, None] * scale
        np.testing.assert_allclose(ours, exact, atol=1e-8 * np.abs(exact).max())


def test_round_off_in_a_matrix_does_not_spoil_blocks():
    """A rigid-body mode that a pad feels by round-off alone: balancing makes that as large as the rest."""
    A = np.zeros((7, 7))
    A[:3, 3:6] = np.diag([1.8775, 1.8775, 541.9104])
    A[4, 1], A[5, 2] = -1.0488, -541.9104
    A[3:, 6] = 6.8256e-19, -1.494e-2, -1.6477e-2, -128.79
    A[6, :3] = 5.3592e-13, -6702.3, -25.61
    simple, blocks = block_diagonalise(A, 0.118)
    for tau in (1e-3, 1e-2, 0.1):
        np.testing.assert_allclose(exponential(simple, blocks, tau), expm(A * tau), rtol=0, atol=2e-11)


def test_a_wrong_block_is_noticed():
    """The comparison above can fail: leaving the coupling of a Jordan block out is seen."""
    simple, blocks = block_diagonalise(similar(np.diag([-1.0, -1.5, -2.0]), 1))
    assert not np.allclose(exponential(simple, blocks, 1.0), expm(similar(JORDAN, 1)), rtol=1e-3)


@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.9, 1 - 1e-4, 1 - 1e-12, 1.0, 1 + 1e-9, 1.01, 30.0, 1e6, -0.01, -1.01])
@pytest.mark.parametrize("omega", [0.0, 1.0, 1e5])
def test_second_order_mode(ratio, omega):
    d = 2 * ratio * (omega if omega > 0 else 1.0)
    simple, blocks = second_order_blocks(np.eye(1), np.array([omega**2]), np.array([d]))
    A = np.array([[0.0, 1.0], [-(omega**2), -d]])
    for tau in (0.3, 5.0):
        tau = tau / max(omega, 1.0)
        scale = np.diag([max(omega, 1.0), 1.0])
        exact = scale @ expm(A * tau) @ np.linalg.inv(scale)
        found = scale @ exponential(simple, blocks, tau) @ np.linalg.inv(scale)
        np.testing.assert_allclose(found, exact, atol=1e-11)


@pytest.mark.parametrize("damping", [2e5, -2e5])
def test_the_eigenvalues_of_a_dashpot_of_either_sign(damping):
    simple, _ = second_order_blocks(np.eye(1), np.array([400.0]), np.array([damping]))
    small, large = sorted(simple.eigenvalue, key=abs)
    assert large + small == pytest.approx(-damping, rel=1e-15)
    assert large * small == pytest.approx(400.0, rel=1e-15)


def test_undamped_eigenvalues_have_no_real_part():
    (_, _, lam), blocks = second_order_blocks(np.eye(2), np.array([1.0, 1e10]), np.zeros(2))
    assert not blocks
    assert np.all(lam.real == 0.0)


def closed_form_exponents(masses, springs, stiffness, dashpot, guesses):
    """Roots of the characteristic polynomial of two masses, the second on a stop, by Newton's method in 60 digits."""
    getcontext().prec = 60
    m1, m2, k1, k2, k, c = map(Decimal, (*masses, *springs, stiffness, dashpot))
    coefficients = [m1 * m2, m1 * c, m1 * (k2 + k) + m2 * (k1 + k2), c * (k1 + k2), (k1 + k2) * (k2 + k) - k2 * k2]

    def times(a, b):
        return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]

    found = []
    for guess in guesses:
        x = Decimal(guess.real), Decimal(guess.imag)
        for _ in range(12):
            value, slope = (coefficients[0], Decimal(0)), (Decimal(0), Decimal(0))
            for a in coefficients[1:]:
                slope = tuple(p + q for p, q in zip(times(slope, x), value, strict=True))
                value = tuple(p + q for p, q in zip(times(value, x), (a, Decimal(0)), strict=True))
            size = slope[0] ** 2 + slope[1] ** 2
            step = times(value, (slope[0] / size, -slope[1] / size))
            x = x[0] - step[0], x[1] - step[1]
        found.append(complex(*map(float, x)))
    return np.array(found)


OVERDAMPED = {
    "masses": [0.2, 0.3],
    "springs": [80.0, 30.0],
    "snubbers": [
        {
            "name": "stop",
            "mass": 2,
            "side": "below",
            "stiffness": 4.6e8,
            "gap": -1e-6,
            "damping": {"kind": "viscous", "coefficient": 1e8},
        }
    ],
}


def free_exponents(case, phases):
    """Exponents of the free motions of a scenario with its contacts in given phases."""
    flow = exact_flow(build_system(load_scenario(case)), 1.0)
    state = flow.states[flow.state_index(np.array(phases))]
    return state.exponent[np.unique(state.term_basis[state.term_source >= flow.sources.power.size])]


def test_a_heavily_overdamped_stop_does_not_spoil_the_slow_motions():
    """Eigenvalues of the whole matrix have errors that -c / m makes in the others, here 1e-7 of the slowest."""
    case = {
        "chain": OVERDAMPED,
        "run": {"duration": 1.0, "start": "rest"},
    }
    found = free_exponents(case, [1])
    assert found.size == 3
    exact = closed_form_exponents((0.2, 0.3), (80.0, 30.0), 4.6e8, 1e8, found)
    np.testing.assert_allclose(found, exact, rtol=1e-13)


def test_low_frequencies_do_not_take_the_round_off_of_high_ones(make_system, no_forcing):
    """Continuation in a contact's numbers needs motions that are smooth in them to its tolerance of 1e-11."""
    omega, shape, k = np.geomspace(1.0, 1e4, 15), np.random.default_rng(1).normal(size=15), 3.0
    system = make_system(omega, 1e-3 * np.ones(15), shape=shape[None], stiffness=k, gap=0.0, sign=1.0)
    closed = StateEquations(Equations(system), np.array([1]))
    modes = ContactState.of(closed, compile_sources(()), 60.0).modes
    # the largest eigenvalue of the compliance (Sherman and Morrison) has all digits
    compliance = np.diag(omega**-2) - np.outer(shape / omega**2, shape / omega**2) * k / (1 + k * shape**2 @ omega**-2)
    expected = np.linalg.eigvalsh(compliance)[-1] ** -0.5
    assert np.abs(modes.simple.eigenvalue).min() == pytest.approx(expected, rel=1e-13)
