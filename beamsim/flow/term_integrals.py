r"""Integrals of products of outputs of motions without powers of time, by products of matrices.

With the terms :math:`u_i = \zeta_i e^{\lambda_i \tau}` of a contact state the integrand is a quadratic form of the
terms (:mod:`beamsim.flow.quadratic_forms`), and so is its antiderivative: the factor of :math:`u_i u_j` is divided by
:math:`\lambda_i + \lambda_j`. An integral is the difference of two values of one form, at any time on any segment.
Pairs whose rate is nearly zero against their exponents (a load with itself, weakly damped motions) or against the time
would cancel; their integrals are taken one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

SLOW = 1e-3  # a rate over the exponents and over one over the time, below which a pair is taken by itself
AT_ONCE = 8192  # times of one product of matrices, which stay in the processor's cache


@dataclass(frozen=True)
class IntegratedForm:
    """Integrals of Q quadratic forms of T terms from the start of a segment on.

    Rows and columns of ``form`` are those of the terms' real parts, then of their imaginary parts.
    """

    exponent: Complexes  # (T,)
    form: Floats  # (Q, 2 T, 2 T) the antiderivative
    first: Ints  # (P,) first term of each pair that is taken by itself
    second: Ints  # (P,)
    conjugate: Ints  # (P,) 1 where the second term is conjugate
    rate: Complexes  # (P,) 1/s
    factor: Complexes  # (P, Q)

    @classmethod
    def of(cls, exponent: Complexes, plus_minus: Complexes, longest: float) -> IntegratedForm:
        """Of forms (2, Q, T, T) as `beamsim.flow.quadratic_forms.forms` makes them, and the terms' exponents (T,).

        ``longest`` is about the longest time that integrals are asked for, s.
        """
        count, outputs = exponent.size, plus_minus.shape[1]
        rates = exponent[:, None] + np.array([exponent, exponent.conj()])[:, None]
        slow = _slow(rates, exponent, longest)
        both = plus_minus * _upper(count)
        alone = np.nonzero(slow & both.any(axis=1))
        fast = np.divide(1.0, rates, out=np.zeros_like(rates), where=~slow)
        a, b = both * fast[:, None]
        form = np.empty((outputs, 2 * count, 2 * count))
        form[:, :count, :count], form[:, count:, count:] = a.real + b.real, b.real - a.real
        form[:, :count, count:], form[:, count:, :count] = b.imag - a.imag, -a.imag - b.imag
        conjugate, first, second = alone
        factor = both[conjugate, :, first, second]
        return cls(exponent, form, first, second, conjugate, rates[alone], factor)

    def __call__(self, amplitude: Complexes, segment: Ints, tau: Floats) -> Floats:
        """(nt, Q) integrals at times tau after the starts of segments, whose terms begin with amplitudes (S, T)."""
        start = self._value(amplitude)
        partner = np.where(self.conjugate == 1, amplitude[:, self.second].conj(), amplitude[:, self.second])
        alone = amplitude[:, self.first] * partner
        steady = self.rate == 0.0
        growth = (alone[:, steady] @ self.factor[steady]).real
        moving = np.flatnonzero(~steady)
        out = np.empty((tau.size, self.factor.shape[1]))
        for part in _ranges(tau.size):
            at, s = tau[part], segment[part]
            terms = amplitude[s] * np.exp(at[:, None] * self.exponent)
            out[part] = self._value(terms) - start[s] + at[:, None] * growth[s]
            for p in moving:
                grown = alone[s, p] * np.expm1(self.rate[p] * at) / self.rate[p]
                out[part] += (grown[:, None] * self.factor[p]).real
        return out

    def _value(self, terms: Complexes) -> Floats:
        """(nt, Q) the antiderivative at terms (nt, T)."""
        x = np.concatenate([terms.real, terms.imag], axis=1)
        return np.asarray(np.einsum("qni,ni->nq", x @ self.form, x))


def products_on_segments(
    exponent: Complexes, amplitude: Complexes, length: Floats, left: Complexes, right: Complexes
) -> Floats:
    """(S,) integrals over whole segments of the sum of products of K outputs each.

    What few terms make of one factor (loads, of the power that they bring) costs in proportion to their number.

    Parameters
    ----------
    exponent : (T,) of the terms of a contact state.
    amplitude : (S, T) where the segments begin.
    length : (S,) s.
    left, right : (T, K) coefficients of the factors.
    """
    terms = np.flatnonzero(left.any(axis=1))
    count, all_terms = terms.size, exponent.size
    some = left[terms]
    both = np.concatenate([some.real, some.imag]) @ np.concatenate([right.real, right.imag]).T
    one, two = both[:count, :all_terms], both[count:, all_terms:]
    across, back = both[:count, all_terms:], both[count:, :all_terms]
    factor = np.empty((count, all_terms), dtype=complex)
    steps = np.concatenate([amplitude, amplitude * np.exp(length[:, None] * exponent)])  # begins, then ends
    values, grown, longest = np.zeros(steps.shape[0]), np.zeros(length.size), float(length.max())
    for conjugate in (False, True):
        partner, other = (steps.conj(), exponent.conj()) if conjugate else (steps, exponent)
        factor.real = one + two if conjugate else one - two
        factor.imag = back - across if conjugate else across + back
        rate = exponent[terms, None] + other
        i, j = _slow(rate, exponent, longest, terms).nonzero()
        if i.size:
            slow = rate[i, j]
            steady = slow == 0.0
            over = np.expm1(length[:, None] * slow) / np.where(steady, 1.0, slow)
            over[:, steady] = length[:, None]
            grown += ((amplitude[:, terms[i]] * partner[: length.size, j] * over) @ factor[i, j]).real
            rate[i, j], factor[i, j] = 1.0, 0.0
        factor /= rate
        values += np.einsum("st,st->s", steps[:, terms] @ factor, partner).real
    return np.asarray(0.5 * (values[length.size :] - values[: length.size] + grown))


def summed_products(exponent: Complexes, amplitude: Complexes, length: Floats) -> Floats:
    """(2 T, 2 T) sums over segments of the integrals of products of the terms' real parts, then imaginary parts.

    Parameters
    ----------
    exponent : (T,) of the terms of a contact state.
    amplitude : (S, T) where the segments begin.
    length : (S,) s.
    """
    begin, end = amplitude, amplitude * np.exp(length[:, None] * exponent)
    before, after = np.concatenate([-begin, end]), np.concatenate([begin, end])
    sums = []
    for conjugate in (False, True):
        other, first, last = (v.conj() if conjugate else v for v in (exponent, begin, after))
        rate = exponent[:, None] + other
        slow = _slow(rate, exponent, float(length.max()))
        rate[slow] = 1.0
        both = before.T @ last
        both /= rate
        for i, j in zip(*np.nonzero(slow), strict=True):
            steady = exponent[i] + other[j]
            grown = length if steady == 0.0 else np.expm1(steady * length) / steady
            both[i, j] = (begin[:, i] * first[:, j]) @ grown
        sums.append(both)
    plus, minus = sums  # of u_i u_j and of u_i conj(u_j)
    count = exponent.size
    out = np.empty((2 * count, 2 * count))
    out[:count, :count], out[count:, count:] = minus.real + plus.real, minus.real - plus.real
    out[:count, count:], out[count:, :count] = plus.imag - minus.imag, plus.imag + minus.imag
    out *= 0.5
    return out


def summed_integrals(
    exponent: Complexes, begin: Complexes, end: Complexes, omega: Floats, turned: Complexes, turned_at_end: Complexes,
    length: Floats,
) -> Complexes:  # fmt: skip
    r"""(T, W) sums over segments of :math:`\int u_i(\tau) e^{-i \omega (t_g + \tau)} d\tau` from 0 to their lengths.

    Parameters
    ----------
    exponent : (T,) of the terms u, which are ``begin`` (S, T) and ``end`` (S, T) where segments begin and end.
    omega : (W,) rad/s.
    turned, turned_at_end : (S, W) :math:`e^{-i \omega t}` where the segments begin and end.
    length : (S,) s.
    """
    rate, longest = exponent[:, None] - 1j * omega, float(length.max())
    slow = np.abs(rate) * longest <= SLOW * (1.0 + longest * (np.abs(exponent)[:, None] + omega))
    sums = end.T @ turned_at_end - begin.T @ turned
    sums /= np.where(slow, 1.0, rate)
    for i, w in zip(*np.nonzero(slow), strict=True):
        grown = length if rate[i, w] == 0.0 else np.expm1(rate[i, w] * length) / rate[i, w]
        sums[i, w] = (begin[:, i] * turned[:, w]) @ grown
    return np.asarray(sums)


@lru_cache(maxsize=8)
def _upper(count: int) -> Floats:
    """(T, T) 1 for pairs of which the first comes not after the second, else 0."""
    return np.triu(np.ones((count, count)))


def _slow(rate: Complexes, exponent: Complexes, longest: float, first: Ints | slice = slice(None)) -> Bools:
    """(..., T, T) rates too small for the antiderivative of a pair within a time, s; ``first``: terms of its rows."""
    size = np.abs(exponent)
    return np.asarray(np.abs(rate) * longest <= SLOW * (1.0 + longest * (size[first, None] + size)))


def _ranges(count: int) -> Iterator[slice]:
    for first in range(0, count, AT_ONCE):
        check_stop()
        yield slice(first, first + AT_ONCE)
