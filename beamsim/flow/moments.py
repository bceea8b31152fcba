r"""Integrals of polynomials times exponentials, from which every integral of a motion follows.

On a segment every output is a sum of terms :math:`\tau^p e^{\lambda \tau}`, and so are products of outputs and outputs
times :math:`e^{-i \omega \tau}`. Their integrals over a time are moments :math:`\int_0^1 s^q e^{x s} ds`.
"""

from __future__ import annotations

import numpy as np

from beamsim.typing import Complexes, Floats, Ints

LEAST = 1.0  # size of an exponent from which (e^x - 1) / x keeps its digits


def exponential_moments(x: Complexes, top: int) -> Complexes:
    r"""Moments :math:`m_q(x) = \int_0^1 s^q e^{x s} ds`.

    Integration by parts gives :math:`x m_q = e^x - q m_{q-1}`. Errors shrink in the upward direction while
    :math:`q \le |x|`, and in the downward direction beyond, which begins from the series
    :math:`m_q = e^x \sum_k (-x)^k q! / (q + 1 + k)!`; see W. Gautschi, SIAM Review 9 (1967) 24.

    Parameters
    ----------
    x : (...) exponents.
    top : highest power.

    Returns
    -------
    (..., top + 1) moments, each as exact as round-off of :math:`\int_0^1 s^q |e^{x s}| ds`.
    """
    every = np.asarray(x, dtype=complex).ravel()
    order = np.argsort(np.abs(every), kind="stable")
    sorted_x = every[order]
    end, size = np.exp(sorted_x), np.abs(sorted_x)
    # of the exponents in order, the first for which the moment of each power follows from the one below
    first = np.searchsorted(size, np.maximum(np.arange(top + 1.0), LEAST))
    found = np.empty((top + 1, every.size), dtype=complex)
    found[0, first[0] :] = (end[first[0] :] - 1.0) / sorted_x[first[0] :]
    for q in range(1, top + 1):
        above = slice(first[q], None)
        found[q, above] = (end[above] - q * found[q - 1, above]) / sorted_x[above]
    below = slice(0, first[top])
    found[top, below] = end[below] * _series(sorted_x[below], top)
    for q in range(top - 1, -1, -1):
        below = slice(0, first[q])
        found[q, below] = (end[below] - sorted_x[below] * found[q + 1, below]) / (q + 1)
    out = np.empty((every.size, top + 1), dtype=complex)
    out[order] = found.T
    return out.reshape(*np.shape(x), top + 1)


def _series(x: Complexes, q: int) -> Complexes:
    """(n,) sums over k of ``(-x)^k q! / (q + 1 + k)!`` for exponents no larger than q, or than 1."""
    total = np.full(x.size, 1.0 / (q + 1), dtype=complex)
    term, k = total.copy(), 0
    while np.any(np.abs(term) > np.finfo(float).eps * 0.1 * np.abs(total)):
        k += 1
        term *= -x / (q + 1 + k)
        total += term
    return total


def weighted_moments(
    exponent: Complexes, power: Ints, length: Floats, weight_exponent: Complexes, polynomial: Complexes
) -> Complexes:
    r"""Integrals :math:`\int_0^L \tau^p e^{\lambda \tau} e^{\nu \tau} P(\tau) d\tau` of basis functions times weights.

    Parameters
    ----------
    exponent, power : (B,) of the basis functions; 1/s.
    length : (n,) L, s.
    weight_exponent : (n,) :math:`\nu`, 1/s.
    polynomial : (n, D) coefficients of P, the lowest first.

    Returns
    -------
    (n, B) integrals.
    """
    order = np.arange(polynomial.shape[1])
    scaled = polynomial * length[:, None] ** order
    rates, number = np.unique(exponent, return_inverse=True)
    highest = np.zeros(rates.size, dtype=np.int64)
    np.maximum.at(highest, number, power)
    out = np.empty((length.size, exponent.size), dtype=complex)
    for top in np.unique(highest):  # those that need few moments together
        alike = np.flatnonzero(highest == top)
        place = np.cumsum(highest == top) - 1
        x = (rates[alike] + weight_exponent[:, None]) * length[:, None]
        moments = exponential_moments(x, int(top) + order[-1])
        for p in range(top + 1):
            of = np.flatnonzero((highest[number] == top) & (power == p))
            here = moments[:, place[number[of]], p : p + order.size]
            out[:, of] = length[:, None] ** (p + 1) * np.einsum("nq,nbq->nb", scaled, here)
    return out
