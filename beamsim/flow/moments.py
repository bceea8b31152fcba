r"""Integrals of polynomials times exponentials, from which every integral of a motion follows.

On a segment every output is a sum of terms :math:`\tau^p e^{\lambda \tau}`, and so are products of outputs and outputs
times :math:`e^{-i \omega \tau}`. Their integrals over a time are moments :math:`\int_0^1 s^q e^{x s} ds`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from beamsim.flow.kernels import fill_moments
from beamsim.outcomes import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

VALUES_AT_ONCE = 100_000  # of terms or outputs at a block of times, which bounds the memory


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
    """(n,) times of which those that differ by no more than a resolution from the next lower one are made equal, s."""
    order = np.argsort(tau, kind="stable")
    ordered = tau[order]
    first = np.append(True, np.diff(ordered) > resolution)
    out = np.empty_like(tau)
    out[order] = ordered[first][np.cumsum(first) - 1]
    return out


@dataclass(frozen=True)
class SegmentOutputs:
    r"""K outputs on S segments of a contact state, real parts of sums of :math:`c_b \tau^{p_b} e^{\lambda_b \tau}`."""

    exponent: Complexes  # (B,) 1/s
    power: Ints  # (B,)
    coefficient: Complexes  # (S, B, K)

    def combined(self, amplitude: Complexes) -> SegmentOutputs:
        """Of outputs for a unit of each of S amplitudes those on segments that begin with amplitudes (n, S)."""
        units, functions, outputs = self.coefficient.shape
        coefficient = amplitude @ self.coefficient.reshape(units, functions * outputs)
        return SegmentOutputs(self.exponent, self.power, coefficient.reshape(amplitude.shape[0], functions, outputs))

    def acting(self) -> SegmentOutputs:
        """Without the functions that are in no output."""
        return self._some(np.asarray(self.coefficient.any(axis=(0, 2))))

    def with_conjugates(self) -> SegmentOutputs:
        """The sums of 2 B functions that are real, half of each and of its conjugate."""
        exponent = np.concatenate([self.exponent, self.exponent.conj()])
        coefficient = np.concatenate([0.5 * self.coefficient, 0.5 * self.coefficient.conj()], axis=1)
        return SegmentOutputs(exponent, np.tile(self.power, 2), coefficient)

    def product_integrals(self, other: SegmentOutputs, tau: Floats, weight: Floats) -> Floats:
        """Integrals of sums of products of outputs over the first part of each segment.

        Parameters
        ----------
        other : the right factors, sums of the same functions.
        tau : (S,) s, from the starts of the segments on.
        weight : (K, Q) of the products in the sums.

        Returns
        -------
        (S, Q) integrals.
        """
        acting = np.asarray(self.coefficient.any(axis=(0, 2)) | other.coefficient.any(axis=(0, 2)))
        left, right = self._some(acting), other._some(acting).with_conjugates()  # what rests may grow without bound
        times, which = np.unique(tau, return_inverse=True)
        moments = _pair_moments(left, right, times)[which]
        products = (left.coefficient.swapaxes(1, 2) @ moments) * right.coefficient.swapaxes(1, 2)
        return np.asarray(products.real.sum(axis=2) @ weight)

    def function_products(self, length: Floats) -> Complexes:
        """(B, 2 B) sums over segments of lengths (S,) of integrals of products of the functions of one output.

        They are multiplied with those that `with_conjugates` gives.
        """
        both = self.with_conjugates()
        out = np.zeros((self.power.size, both.power.size), dtype=complex)
        for block in blocks(length.size, out.size):
            times, which = np.unique(length[block], return_inverse=True)
            left, right = self.coefficient[block, :, 0], both.coefficient[block, :, 0]
            out += np.einsum("nb,nbd,nd->bd", left, _pair_moments(self, both, times)[which], right)
        return out

    def product_forms(self, other: SegmentOutputs, tau: float, weight: Floats) -> Complexes:
        r"""Integrals over one time of sums of products of outputs that are linear in amplitudes :math:`\zeta_s`.

        Parameters
        ----------
        other : the right factors, sums of the same functions. S stands for the amplitudes: the outputs are those for a
            unit of each.
        tau : s.
        weight : (K, Q) of the products in the sums.

        Returns
        -------
        (Q, S, 2 S) forms f, with which a sum is the real part of :math:`\zeta_r f_{rs} (\zeta, \bar \zeta)_s`.
        """
        right, amplitudes = other.with_conjugates(), self.coefficient.shape[0]
        half = right.coefficient.copy()
        half[:, self.power.size :] = 0.0  # those of the amplitudes; the rest belongs to their conjugates
        units = np.concatenate([half, right.coefficient - half])
        of_left = _pair_moments(self, right, np.array([tau]))[0] @ units
        return np.stack([
            (self.coefficient * w).reshape(amplitudes, -1) @ of_left.reshape(2 * amplitudes, -1).T for w in weight.T
        ])  # fmt: skip

    def fourier_sums(self, length: Floats, omega: Floats, turned: Complexes) -> Complexes:
        r"""Sums over the segments of the integrals of each function times :math:`e^{-i \omega (t_s + \tau)}`.

        Parameters
        ----------
        length : (S,) s; equal ones share their moments.
        omega : (W,) rad/s.
        turned : (S, W) :math:`e^{-i \omega t_s}` where the segments begin.

        Returns
        -------
        (B, K, W) sums.
        """
        count, functions, outputs = self.coefficient.shape
        rate = self.exponent[:, None] - 1j * omega
        size = np.abs(self.exponent)[:, None] + omega
        by_ends = _distant(rate, size, length) & (self.power == 0)[:, None]
        at_end = self.coefficient * np.exp(np.multiply.outer(length, self.exponent))[:, :, None]
        turned_at_end = turned * np.exp(np.multiply.outer(length, -1j * omega))
        grown = at_end.reshape(count, -1).T @ turned_at_end - self.coefficient.reshape(count, -1).T @ turned
        out = grown.reshape(functions, outputs, omega.size)
        out *= np.divide(1.0, rate, out=np.zeros_like(rate), where=by_ends)[:, None]
        times, which = np.unique(length, return_inverse=True)
        alone = np.argwhere(~by_ends)
        for part in blocks(alone.shape[0], count * outputs):
            b, w = alone[part].T
            integral = _integrals(rate[b, w], self.power[b], times)[which] * turned[:, w]
            out[b, :, w] = np.einsum("spk,sp->pk", self.coefficient[:, b], integral)
        return np.asarray(out)

    def _some(self, functions: Bools) -> SegmentOutputs:
        if functions.all():
            return self
        return SegmentOutputs(self.exponent[functions], self.power[functions], self.coefficient[:, functions])


def exponential_products(
    exponent: Complexes, factors: tuple[Complexes, Complexes, Floats], amplitude: Complexes, of: Ints, tau: Floats
) -> Floats:
    """Integrals from 0 to tau of sums of products of outputs, each a sum of T exponentials.

    Parameters
    ----------
    exponent : (T,) 1/s.
    factors : coefficients (T, K) of the left and the right outputs, and weights (K, Q) of their products in the sums;
        the fewer exponentials are in left factors, the less is computed.
    amplitude : (S, T) of the exponentials on S segments, which coefficients multiply.
    of : (n,) which of the segments.
    tau : (n,) s.

    Returns
    -------
    (n, Q) integrals.
    """
    left, right, weight = factors
    acting = np.flatnonzero(left.any(axis=1))
    powers = np.zeros(exponent.size, dtype=np.int64)
    one = SegmentOutputs(exponent[acting], powers[acting], left[None, acting])
    both = SegmentOutputs(exponent, powers, right[None]).with_conjugates()
    forms = np.stack([(left[acting] * w) @ both.coefficient[0].T for w in weight.T])
    rate, power, by_ends = _pairs(one, both, tau)
    grown, mixed = np.split(forms * np.divide(1.0, rate, out=np.zeros_like(rate), where=by_ends), 2, axis=2)
    alike, apart = mixed + grown, mixed - grown
    of_parts = np.block([[alike.real, apart.imag], [-alike.imag, apart.real]])  # of real and imaginary parts

    def at(amplitude: Complexes) -> Floats:
        one, other = (np.hstack([x.real, x.imag]) for x in (amplitude[:, acting], amplitude))
        return np.stack([((one @ form) * other).sum(axis=1) for form in of_parts], axis=1)

    out, (row, column) = -at(amplitude)[of], np.nonzero(~by_ends)
    whole = np.concatenate([amplitude, amplitude.conj()], axis=1)
    for part in blocks(tau.size, 4 * exponent.size + 2 * row.size):
        out[part] += at(amplitude[of[part]] * np.exp(np.multiply.outer(tau[part], exponent)))
        alone = amplitude[of[part]][:, acting[row]] * whole[of[part]][:, column]
        alone *= _integrals(rate[row, column], power[row, column], tau[part])
        out[part] += (alone @ forms[:, row, column].T).real
    return out


def _pair_moments(left: SegmentOutputs, right: SegmentOutputs, times: Floats) -> Complexes:
    """(n, B, 2 B) integrals over times (n,) of the products of all functions.

    Most are differences of exponentials at both ends; those whose exponents nearly cancel and those with powers of time
    are moments.
    """
    rate, power, by_ends = _pairs(left, right, times)
    inverse = np.divide(1.0, rate, out=np.zeros_like(rate), where=by_ends)
    end, other = (np.exp(np.multiply.outer(times, x.exponent)) for x in (left, right))
    out = (end[:, :, None] * other[:, None, :] - 1.0) * inverse
    out[:, ~by_ends] = _integrals(rate[~by_ends], power[~by_ends], times)
    return np.asarray(out)


def _pairs(left: SegmentOutputs, right: SegmentOutputs, times: Floats) -> tuple[Complexes, Ints, Bools]:
    """(B, 2 B) rates and powers of the products of all functions; which of their integrals follow from both ends."""
    rate, power = np.add.outer(left.exponent, right.exponent), np.add.outer(left.power, right.power)
    size = np.add.outer(np.abs(left.exponent), np.abs(right.exponent))
    return rate, power, (power == 0) & _distant(rate, size, times)


def _integrals(rate: Complexes, power: Ints, times: Floats) -> Complexes:
    """(n, P) integrals over times (n,) of ``tau^power e^{rate tau}``, for P rates (1/s) and powers."""
    rates, number = np.unique(rate, return_inverse=True)
    moments = exponential_moments(np.multiply.outer(times, rates), int(power.max(initial=0)))
    powers = times[:, None] ** np.arange(1, moments.shape[2] + 1)
    moments *= powers[:, None]
    return np.asarray(moments[:, number, power])


def _distant(rate: Complexes, size: Floats, times: Floats) -> Bools:
    """Whether antiderivatives of exponentials keep their digits; size: sum of those that make up the rate, 1/s."""
    longest = float(times.max(initial=0.0))
    # 1e-3: a rate over the exponents that cancel in it, below which integrals come from moments
    return np.asarray(np.abs(rate) * longest > 1e-3 * (1.0 + longest * size))


def blocks(count: int, width: int) -> Iterator[slice]:
    """Ranges of rows of a table of a width, which bound the memory."""
    rows = max(1, VALUES_AT_ONCE // max(width, 1))
    for first in range(0, count, rows):
        check_stop()
        yield slice(first, first + rows)
