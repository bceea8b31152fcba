r"""Integrals of polynomials times exponentials, from which every integral of a motion follows.

On a segment every output is a sum of terms :math:`\tau^p e^{\lambda \tau}`, and so are products of outputs and outputs
times :math:`e^{-i \omega \tau}`. Their integrals over a time are moments :math:`\int_0^1 s^q e^{x s} ds`.
"""

from __future__ import annotations

import numpy as np

from beamsim.typing import Complexes, Floats, Ints


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
    from beamsim.flow.moment_kernels import fill_moments

    every = np.ascontiguousarray(x, dtype=complex).ravel()
    out = np.empty((every.size, top + 1), dtype=complex)
    fill_moments(every, out)
    return out.reshape(*np.shape(x), top + 1)


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
    from beamsim.flow.moment_kernels import fill_weighted

    rates, number = np.unique(exponent, return_inverse=True)
    highest = np.zeros(rates.size, dtype=np.int64)
    np.maximum.at(highest, number, power)
    out = np.empty((length.size, exponent.size), dtype=complex)
    given = (np.ascontiguousarray(part) for part in (length, weight_exponent, polynomial))
    fill_weighted(rates, highest, number, power, *given, out)
    return out
