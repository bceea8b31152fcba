r"""The basis functions :math:`\tau^p e^{\lambda \tau}` of a contact state: derivatives and bounds."""

from __future__ import annotations

from math import comb

import numpy as np

from beamsim.typing import Complexes, Floats, Ints


def as_real(zeta: Complexes) -> Floats:
    """(n, 2 Z) real and imaginary parts in turn."""
    return np.ascontiguousarray(zeta).view(float)


def basis_derivatives(exponent: Complexes, power: Ints, tau: float, orders: int) -> Complexes:
    r"""Derivatives of :math:`\tau^p e^{\lambda \tau}`, from order 0 on (Leibniz).

    Parameters
    ----------
    exponent, power : (B,) 1/s, and p.
    tau : s.
    orders : how many, the value itself included.

    Returns
    -------
    derivatives : (orders, B).
    """
    if tau == 0.0:  # what is left is the term in which the power is differentiated away
        factorial = np.cumprod(np.maximum(np.arange(orders), 1.0))
        rest = np.arange(orders)[:, None] - power
        scale = factorial[:, None] / factorial[np.maximum(rest, 0)]
        return np.asarray(np.where(rest >= 0, scale * exponent ** np.maximum(rest, 0), 0.0))
    out = np.zeros((orders, exponent.size), dtype=complex)
    falling = np.ones(exponent.size)  # p! / (p - i)!
    for i in range(min(orders, int(power.max(initial=0)) + 1)):  # the i-th derivative of the power
        chosen = np.array([comb(order, i) for order in range(i, orders)], dtype=float)
        lowered = tau ** np.maximum(power - i, 0)
        out[i:] += chosen[:, None] * falling * lowered * exponent ** np.arange(orders - i)[:, None]
        falling = falling * np.maximum(power - i, 0)
    return np.asarray(out * np.exp(exponent * tau))


def largest_curvature(exponent: Complexes, power: Ints, H: float) -> Floats:
    """Bound on the second derivative of every basis function on [0, H].

    Parameters
    ----------
    exponent, power : (B,) 1/s, and p.
    H : s.

    Returns
    -------
    bound : (B,).
    """
    size, p = np.abs(exponent), power
    level = np.exp(np.maximum(exponent.real, 0.0) * H)
    rest = np.where(p > 1, p * (p - 1.0) * H ** np.maximum(p - 2, 0), 0.0)
    return np.asarray((size**2 * H**p + 2.0 * p * size * H ** np.maximum(p - 1, 0) + rest) * level)
