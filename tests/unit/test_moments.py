"""Moments of exponentials against quadrature, which knows nothing of recursions, and against closed forms."""

import numpy as np
import pytest

from beamsim.flow.moments import exponential_moments

DIRECTIONS = np.exp(2j * np.pi * np.arange(12) / 12)


def quadrature(x, top, size=False):
    """Of ``s^q e^{x s}``, or of its size."""
    point, gauss = np.polynomial.legendre.leggauss(30)
    panels = 10
    s = ((np.arange(panels)[:, None] + 0.5 * (1.0 + point)) / panels).ravel()
    powers = s[:, None] ** np.arange(top + 1)
    values = np.exp(np.multiply.outer(x.real if size else x, s))
    return (values * np.tile(0.5 / panels * gauss, panels)) @ powers


@pytest.mark.parametrize("top", [0, 1, 3, 8, 24, 45])
def test_moments_against_quadrature(top):
    sizes = np.array([1e-12, 1e-5, 0.01, 0.3, 0.99, 1.0, 1.01, 2.0, 3.5, 8.0, 15.0, 24.0, 44.0, 46.0, 90.0])
    x = np.append(np.multiply.outer(sizes, DIRECTIONS), np.zeros((1, 12)), axis=0)
    moments = exponential_moments(x, top)
    assert moments.shape == (16, 12, top + 1)
    error = np.abs(moments - quadrature(x, top)) / quadrature(x, top, size=True)
    assert error.max() < 3e-14


def test_moments_of_no_exponent_and_of_long_decay():
    np.testing.assert_allclose(exponential_moments(np.zeros(2), 4), [1.0 / np.arange(1, 6)] * 2, rtol=1e-15)
    factorial = np.array([1.0, 1.0, 2.0, 6.0, 24.0, 120.0])
    x = 1e4 * DIRECTIONS[4:9]
    expected = factorial / (-x[:, None]) ** np.arange(1, 7)
    np.testing.assert_allclose(exponential_moments(x, 5), expected, rtol=1e-14)
    assert exponential_moments(np.zeros((0, 3)), 2).shape == (0, 3, 3)


def test_moments_of_one_exponent():
    assert exponential_moments(np.array(2.0), 1) == pytest.approx([(np.e**2 - 1) / 2, (np.e**2 + 1) / 4], rel=1e-15)
