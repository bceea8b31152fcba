r"""Integrals of polynomials times exponentials, from which every integral of a motion follows.

On a segment every output is the real part of a sum of terms :math:`c_t \tau^{p_t} e^{\lambda_t \tau}`. Products of
outputs and outputs times :math:`e^{-i \omega \tau}` are sums of the same kind. Most of their integrals follow from
the values of exponentials at both ends; those whose exponents nearly cancel and those with powers of time are moments
:math:`\int_0^1 s^q e^{x s} ds`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from beamsim.flow.kernels import fill_moments
from beamsim.outcomes import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

CANCELLED = 1e-3  # relative size of a sum of exponents below which integrals are computed from moments

VALUES_AT_ONCE, MANY_VALUES = 100_000, 2_000_000  # in a block of times or frequencies, which bounds the memory


def exponential_moments(x: Complexes, highest: int) -> Complexes:
    r"""Moments :math:`m_q(x) = \int_0^1 s^q e^{x s} ds`.

    Integration by parts gives :math:`x m_q = e^x - q m_{q-1}`. Errors shrink in the upward direction while
    :math:`q \le |x|`, and in the downward direction beyond, which begins from the series
    :math:`m_q = e^x \sum_k (-x)^k q! / (q + 1 + k)!`; see W. Gautschi, SIAM Review 9 (1967) 24.

    Parameters
    ----------
    x : (...) exponents.
    highest : highest power.

    Returns
    -------
    (..., top + 1) moments, each as exact as round-off of :math:`\int_0^1 s^q |e^{x s}| ds`.
    """
    every = np.ascontiguousarray(x, dtype=complex).ravel()
    out = np.empty((every.size, highest + 1), dtype=complex)
    fill_moments(every, out)
    return out.reshape(*np.shape(x), highest + 1)


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
    rates, number = np.unique(exponent, return_inverse=True)
    highest, degrees = int(power.max(initial=0)), np.arange(polynomial.shape[1])
    out = np.empty((length.size, exponent.size), dtype=complex)
    for part in blocks(length.size, (rates.size + exponent.size) * (highest + degrees.size)):
        L = length[part, None]
        moments = exponential_moments((rates + weight_exponent[part, None]) * L, highest + degrees[-1])
        moments *= L[:, :, None] ** np.arange(1, moments.shape[2] + 1)
        of_powers = moments[:, number[:, None], power[:, None] + degrees]
        out[part] = np.einsum("nbd,nd->nb", of_powers, polynomial[part])
    return out


def equal_times(tau: Floats, resolution: float) -> Floats:
    """(n,) times, s; those that differ from the next lower one by no more than the resolution are set equal to it."""
    order = np.argsort(tau, kind="stable")
    ordered = tau[order]
    first = np.append(True, np.diff(ordered) > resolution)
    out = np.empty_like(tau)
    out[order] = ordered[first][np.cumsum(first) - 1]
    return out


def products_of_exponentials(
    exponent: Complexes, factors: tuple[Complexes, Complexes, Floats], amplitude: Complexes, segment: Ints, tau: Floats
) -> Floats:
    """Integrals from 0 to tau of sums of products of outputs, each a sum of T exponentials.

    Parameters
    ----------
    exponent : (T,) 1/s.
    factors : coefficients (T, K) of the left and the right outputs, and weights (K, Q) of their products in the sums;
        the fewer exponentials are in left factors, the less is computed.
    amplitude : (S, T) of the exponentials on S segments, which coefficients multiply.
    segment : (n,) which of the segments.
    tau : (n,) s.

    Returns
    -------
    (n, Q) integrals.
    """
    left, right, weight = factors
    acting = np.flatnonzero(left.any(axis=1))
    both, none = 0.5 * np.concatenate([right, right.conj()]), np.zeros(exponent.size, dtype=np.int64)
    rate, power, inverse = _pairs(exponent, none, acting, tau)
    forms = np.stack([(left[acting] * w) @ both.T for w in weight.T])
    by_ends = forms * inverse
    out, (row, column) = -sums_of_products(amplitude, acting, by_ends)[segment], np.nonzero(inverse == 0.0)
    whole = np.hstack([amplitude, amplitude.conj()])
    for part in blocks(tau.size, 4 * exponent.size + 2 * row.size):
        at_end = amplitude[segment[part]] * np.exp(np.multiply.outer(tau[part], exponent))
        out[part] += sums_of_products(at_end, acting, by_ends)
        alone = amplitude[segment[part]][:, acting[row]] * whole[segment[part]][:, column]
        alone *= _integrals(rate[row, column], power[row, column], tau[part])
        out[part] += (alone @ forms[:, row, column].T).real
    return out


def sums_of_products(amplitude: Complexes, first_factor: Ints, factors: Complexes) -> Floats:
    """Real parts of sums of products of amplitudes with each other and with their conjugates.

    Parameters
    ----------
    amplitude : (n, F).
    first_factor : (A,) which of them are the first one of a product.
    factors : (Q, A, 2 F) of the products with all and with their conjugates, in each of Q sums.

    Returns
    -------
    (n, Q).
    """
    grown, mixed = np.split(factors, 2, axis=2)
    alike, apart = mixed + grown, mixed - grown
    forms = np.block([[alike.real, apart.imag], [-alike.imag, apart.real]])  # of real and imaginary parts
    one, other = (np.hstack([x.real, x.imag]) for x in (amplitude[:, first_factor], amplitude))
    out = np.empty((amplitude.shape[0], forms.shape[0]))
    for column, form in zip(out.T, forms, strict=True):
        some = form.any(axis=1)  # inputs alone do work
        column[:] = ((one[:, some] @ form[some]) * other).sum(axis=1)
    return out


def summed_products(exponent: Complexes, amplitude: Complexes, tau: Floats) -> Complexes:
    """Sums over segments of the integrals from 0 to tau of all products of two exponentials.

    Parameters
    ----------
    exponent : (T,) 1/s.
    amplitude : (S, T) of the exponentials on S segments.
    tau : (S,) s.

    Returns
    -------
    (T, 2 T) products with the exponentials and with their conjugates.
    """
    every, none = np.arange(exponent.size), np.zeros(exponent.size, dtype=np.int64)
    rate, power, inverse = _pairs(exponent, none, every, tau)
    end, whole = amplitude * np.exp(np.multiply.outer(tau, exponent)), np.hstack([amplitude, amplitude.conj()])
    out = (end.T @ np.hstack([end, end.conj()]) - amplitude.T @ whole) * inverse
    row, column = np.nonzero(inverse == 0.0)
    moments = _integrals(rate[row, column], power[row, column], tau)
    out[row, column] = (amplitude[:, row] * whole[:, column] * moments).sum(axis=0)
    return np.asarray(out)


def moments_by_time(
    exponent: Complexes, power: Ints, rows: Ints, tau: Floats
) -> Iterator[tuple[list[Ints], Complexes]]:
    """Integrals from 0 to tau of products of two functions, which may have powers of time.

    Where all of the first ones are real, those with conjugates are conjugates, and left out.

    Parameters
    ----------
    exponent, power : (B,) of the functions, 1/s.
    rows : (R,) which of them are the first one of a product.
    tau : (n,) s; equal ones share them.

    Yields
    ------
    Numbers of the entries of each of some times, and of each time integrals (R, B) or (R, 2 B) of the products with the
    functions and their conjugates.
    """
    columns = (2 if exponent[rows].imag.any() else 1) * exponent.size
    rate, degree, inverse = _pairs(exponent, power, rows, tau)
    rate, degree, inverse = rate[:, :columns], degree[:, :columns], inverse[:, :columns]
    row, column = np.nonzero(inverse == 0.0)
    order = np.argsort(tau, kind="stable")
    times, first = np.unique(tau[order], return_index=True)
    entries = np.split(order, first[1:])
    for part in blocks(times.size, 2 * rate.size, MANY_VALUES):
        end = np.exp(np.multiply.outer(times[part], exponent))
        out = (end[:, rows, None] * np.hstack([end, end.conj()])[:, None, :columns] - 1.0) * inverse
        out[:, row, column] = _integrals(rate[row, column], degree[row, column], times[part])
        yield entries[part], out


def fourier_sums(
    exponent: Complexes, power: Ints, amplitude: Complexes, length: Floats, omega: Floats, elapsed: Floats
) -> Complexes:
    r"""Sums over segments of the integrals of terms times :math:`e^{-i \omega (t_s + \tau)}`.

    Parameters
    ----------
    exponent, power : (T,) of the terms, 1/s.
    amplitude : (S, T) of the terms on S segments.
    length : (S,) s; equal ones share their moments.
    omega : (W,) rad/s.
    elapsed : (S,) :math:`t_s`, s.

    Returns
    -------
    (T, W) sums.
    """
    rate, turned = exponent[:, None] - 1j * omega, np.exp(np.multiply.outer(elapsed, -1j * omega))
    by_ends = _distant(rate, np.abs(exponent)[:, None] + omega, length) & (power == 0)[:, None]
    at_end = amplitude * np.exp(np.multiply.outer(length, exponent))
    out = at_end.T @ (turned * np.exp(np.multiply.outer(length, -1j * omega))) - amplitude.T @ turned
    out *= np.divide(1.0, rate, out=np.zeros_like(rate), where=by_ends)
    row, column = np.nonzero(~by_ends)
    for part in blocks(row.size, 2 * length.size):
        t, w = row[part], column[part]
        out[t, w] = (amplitude[:, t] * turned[:, w] * _integrals(rate[t, w], power[t], length)).sum(axis=0)
    return np.asarray(out)


def _pairs(exponent: Complexes, power: Ints, rows: Ints, times: Floats) -> tuple[Complexes, Ints, Complexes]:
    """(R, 2 T) rates and powers of the products of terms ``rows`` with all terms and their conjugates.

    Third: the reciprocal rates where integrals follow from the values at both ends, else 0.
    """
    rate = exponent[rows, None] + np.concatenate([exponent, exponent.conj()])
    size, degree = np.abs(exponent), power[rows, None] + np.tile(power, 2)
    by_ends = (degree == 0) & _distant(rate, size[rows, None] + np.tile(size, 2), times)
    return rate, degree, np.divide(1.0, rate, out=np.zeros_like(rate), where=by_ends)


def _distant(rate: Complexes, size: Floats, times: Floats) -> Bools:
    """Whether antiderivatives of exponentials keep their digits; ``size``: sum of the summands' sizes of the rate,
    1/s."""
    longest = float(times.max(initial=0.0))
    return np.asarray(np.abs(rate) * longest > CANCELLED * (1.0 + longest * size))


def _integrals(rate: Complexes, power: Ints, times: Floats) -> Complexes:
    """(n, P) integrals over times (n,) of ``tau^power e^{rate tau}``, for P rates (1/s) and powers."""
    rates, number = np.unique(rate, return_inverse=True)
    each, at = np.unique(times, return_inverse=True)
    moments = exponential_moments(np.multiply.outer(each, rates), int(power.max(initial=0)))
    moments *= (each[:, None] ** np.arange(1, moments.shape[2] + 1))[:, None]
    return np.asarray(moments[at[:, None], number, power])


def blocks(count: int, width: int, values: int = VALUES_AT_ONCE) -> Iterator[slice]:
    """Ranges of rows of a table, each with at most ``values`` entries, which bounds the memory."""
    rows = max(1, values // max(width, 1))
    for first in range(0, count, rows):
        check_stop()
        yield slice(first, first + rows)
