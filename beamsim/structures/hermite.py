r"""Cubic Hermite Euler–Bernoulli element in nondimensional form.

Lengths are divided by the beam length L. An element of nondimensional length *h* has the degrees of freedom
(w1, L w1', w2, L w2'); all four are in metres, which keeps the matrices well scaled
(H. Hazim, thesis, 2010, section 1.2.2). The unit of stiffness is E I / L^3, that of mass rho S L.

The stiffness is stored as a factor B with K = B^T B. The curvature is linear along an element,
kappa = kappa_0 + kappa_1 (2 xi - 1), and its energy is h (kappa_0^2 + kappa_1^2 / 3) / 2, which gives two
rows per element. Frequencies computed from the singular values of B keep their accuracy, while those from the
eigenvalues of K lose accuracy with the fourth power of the number of elements.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from beamsim.typing import Floats

# Coefficients of xi^0 .. xi^3; columns 2 and 4 are multiplied by h later.
_CUBIC = np.array(
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [-3.0, -2.0, 3.0, -1.0],
        [2.0, 1.0, -2.0, 1.0],
    ]
)


def _per_dof(h: ArrayLike) -> Floats:
    """(..., 4) factors 1, h, 1, h of the four degrees of freedom."""
    h = np.asarray(h, dtype=float)
    one = np.ones_like(h)
    return np.stack([one, h, one, h], axis=-1)


def shape_functions(xi: ArrayLike, h: ArrayLike, derivative: int = 0) -> Floats:
    """Values of the four shape functions, or of their derivative with respect to x / L.

    Parameters
    ----------
    xi : (...,) position within the element, 0 to 1.
    h : (...,) nondimensional element length, broadcast against xi.
    derivative : order of the derivative; zero is returned above 3.

    Returns
    -------
    (..., 4) array.
    """
    xi, h = np.broadcast_arrays(np.asarray(xi, dtype=float), np.asarray(h, dtype=float))
    powers = np.zeros((*xi.shape, 4))
    for p in range(derivative, 4):
        factor = float(math.prod(range(p - derivative + 1, p + 1)))
        powers[..., p] = factor * xi ** (p - derivative)
    return np.asarray(powers @ _CUBIC * _per_dof(h) / h[..., None] ** derivative)


def double_integral(xi: ArrayLike, h: ArrayLike) -> Floats:
    """(..., 4) values of h^2 * int_0^xi (xi - s) N_i(s) ds: moments at xi of the loads N_i to its left."""
    xi, h = np.broadcast_arrays(np.asarray(xi, dtype=float), np.asarray(h, dtype=float))
    powers = np.stack([xi ** (p + 2) / ((p + 1) * (p + 2)) for p in range(4)], axis=-1)
    return np.asarray(powers @ _CUBIC * _per_dof(h) * h[..., None] ** 2)


def element_rows(h: ArrayLike, derivative: int, points: int) -> Floats:
    """Rows B of an element with B^T B the integral of the square of a derivative, by Gauss quadrature.

    Parameters
    ----------
    h : (...,) nondimensional element lengths.
    derivative : order of the derivative with respect to x / L: 0 for the mass, in rho S L.
    points : of the quadrature; 4 are exact for deflections.

    Returns
    -------
    (..., points, 4) array.
    """
    place, weight = np.polynomial.legendre.leggauss(points)
    h = np.asarray(h, dtype=float)[..., None]
    return np.asarray(shape_functions((place + 1) / 2, h, derivative) * np.sqrt(h * weight / 2)[..., None])


def curvature_rows(h: ArrayLike) -> Floats:
    """(..., 2, 4) rows B with element stiffness B^T B, in E I / L^3, whose sums over rigid motions are exact zeros."""
    h = np.asarray(h, dtype=float)
    mean = np.array([0.0, -1.0, 0.0, 1.0])
    slope = np.array([6.0, 3.0, -6.0, 3.0]) / np.sqrt(3.0)
    d = _per_dof(h) / h[..., None] ** 1.5
    return np.stack([mean * d, slope * d], axis=-2)
