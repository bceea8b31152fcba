"""Block-diagonal form against the matrix exponential, coincident and defective eigenvalues included."""

import numpy as np
import pytest
from scipy.linalg import expm

from beamsim.flow.invariant_blocks import block_diagonalise, second_order_blocks


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


def test_a_wrong_block_is_noticed():
    """The comparison above can fail: leaving the coupling of a Jordan block out is seen."""
    simple, blocks = block_diagonalise(similar(np.diag([-1.0, -1.5, -2.0]), 1))
    assert not np.allclose(exponential(simple, blocks, 1.0), expm(similar(JORDAN, 1)), rtol=1e-3)


@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.9, 1 - 1e-4, 1 - 1e-12, 1.0, 1 + 1e-9, 1.01, 30.0, 1e6])
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


def test_undamped_eigenvalues_have_no_real_part():
    (_, _, lam), blocks = second_order_blocks(np.eye(2), np.array([1.0, 1e10]), np.zeros(2))
    assert not blocks
    assert np.all(lam.real == 0.0)
