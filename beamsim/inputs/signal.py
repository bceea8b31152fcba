"""Signals whose pieces are polynomials times exponentials, the inputs that the closed-form flow accepts.

Between two breakpoints a signal is

.. math:: s(t) = \\mathrm{Re} \\sum_i e^{\\nu_i \\sigma} \\sum_p c_{i,p}\\, \\sigma^p, \\qquad \\sigma = t - t_k,

which covers harmonics (:math:`\\nu = i\\omega`), multi-tone signals, steps, half-sine pulses, and sampled
signals interpolated by polynomials (:math:`\\nu = 0`). The class is closed under differentiation and
integration, so the base displacement follows exactly from a base acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamsim.typing import Complexes, Floats, Ints

MOST_PIECES = 4_000_000  # of a signal that is made as a whole


@dataclass(frozen=True)
class Signal:
    """A piecewise exponential polynomial on [start[0], infinity).

    Parameters
    ----------
    start : (P,) increasing times at which a piece begins, s; the last piece never ends.
    exponent : (E,) complex exponents shared by all pieces, 1/s.
    coefficient : (P, E, D) complex coefficients, in powers of the time since the start of the piece.
    """

    start: Floats
    exponent: Complexes
    coefficient: Complexes

    @classmethod
    def harmonic(cls, amplitude: ArrayLike, omega: ArrayLike, phase: ArrayLike = 0.0) -> Signal:
        """``sum_k amplitude_k * sin(omega_k t + phase_k)``.

        Parameters
        ----------
        amplitude, omega, phase : (k,) or single numbers; rad/s and rad.

        Returns
        -------
        Signal
            Of one piece with k exponents.
        """
        amplitude, omega, phase = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(x, dtype=float)) for x in (amplitude, omega, phase))
        )
        coefficient = -1j * amplitude * np.exp(1j * phase)
        return cls(np.zeros(1), 1j * omega, coefficient[None, :, None])

    @classmethod
    def polynomial_pieces(cls, start: ArrayLike, coefficient: ArrayLike) -> Signal:
        """Real polynomials, ``coefficient[k, p]`` multiplying ``(t - start[k])**p``."""
        c = np.asarray(coefficient, dtype=complex)
        return cls(np.asarray(start, dtype=float), np.zeros(1, dtype=complex), c[:, None, :])

    def __call__(self, t: ArrayLike) -> Floats:
        """Values at times t (any shape); the first piece also applies before its start."""
        t = np.asarray(t, dtype=float)
        k = np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, None)
        return self.within(k, t - self.start[k])

    def __mul__(self, factor: float) -> Signal:
        return Signal(self.start, self.exponent, self.coefficient * factor)

    __rmul__ = __mul__

    def derivative(self) -> Signal:
        """The exact time derivative within each piece (jumps between pieces are not represented)."""
        c = self.coefficient
        d = c * self.exponent[None, :, None]
        d[:, :, :-1] += c[:, :, 1:] * np.arange(1, c.shape[2])
        return Signal(self.start, self.exponent, d)

    def antiderivative(self, initial: float = 0.0) -> Signal:
        """The exact integral from ``start[0]``, continuous across pieces, plus ``initial``."""
        exponent = self.exponent
        zero = np.flatnonzero(exponent == 0)
        c = self.coefficient
        if zero.size == 0:
            exponent = np.append(exponent, 0.0)
            c = np.concatenate([c, np.zeros((c.shape[0], 1, c.shape[2]))], axis=1)
        constant = int(zero[0]) if zero.size else exponent.size - 1
        c = np.concatenate([c, np.zeros((*c.shape[:2], 1))], axis=2)
        degree = c.shape[2] - 1
        out = np.zeros_like(c)
        for i, nu in enumerate(exponent):
            if nu == 0:
                out[:, i, 1:] = c[:, i, :-1] / np.arange(1, degree + 1)
            else:
                for p in range(degree, -1, -1):
                    above = out[:, i, p + 1] * (p + 1) if p < degree else 0.0
                    out[:, i, p] = (c[:, i, p] - above) / nu
        length = np.diff(self.start)
        grown = Signal(self.start, exponent, out).within(np.arange(length.size), length)  # without the constants
        first = out[:, :, 0].sum(axis=1).real
        # each piece starts at the value at which the previous one ends
        out[:, constant, 0] += initial + np.concatenate([[0.0], np.cumsum(grown - first[:-1])]) - first
        return Signal(self.start, exponent, out)

    def within(self, piece: Ints, sigma: Floats) -> Floats:
        """Value of each piece at time ``sigma`` since its start (arrays of the same shape)."""
        value = np.zeros(sigma.shape)
        for i, nu in enumerate(self.exponent):
            polynomial = np.zeros(sigma.shape, dtype=complex)
            for p in range(self.coefficient.shape[2] - 1, -1, -1):
                polynomial = polynomial * sigma + self.coefficient[piece, i, p]
            value = value + (polynomial * np.exp(nu * sigma)).real
        return value
