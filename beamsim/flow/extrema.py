r"""Extremes of a motion: in closed form, or of polynomials on pieces of time.

On a segment of length H an output is a sum of terms :math:`\mathrm{Re}\, c\, u^p e^{\lambda H u}`, with the time u on
the segment over its length. An interval of length h is looked at by the values and slopes at its ends. The sizes of the
terms bound the fourth derivative, and so how far the output leaves the cubic through them:

.. math:: h^4 \max|f''''| / 384, \quad \text{and its slope that of the cubic:}\quad \sqrt 3\, h^3 \max|f''''| / 216

(Hermite interpolation; the kernels of its error by Peano). Terms that turn too far on the interval to be part of the
cubic are bounded by their sizes. Intervals on which no value can exceed the largest one known are left out, the others
divided: a whole segment at once into parts on which no term turns far, whose exponentials all outputs share; a part
about the top of its cubic where the true one is certain to be near it, else into equal parts. The smallest value is the
largest one of the negative.

Half the sum of the squares of outputs, such as an energy, is searched in the same way: the bounds on the outputs bound
it and its derivatives.

On a step an output is interpolated through Chebyshev points, ``sum_k c_k T_k(u)`` with ``t = mid + half u``. In powers
of u it is a sum of terms as those of closed-form motions, and the search of :mod:`beamsim.flow.extrema` takes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.contact_state import GROWTH
from beamsim.flow.extrema_kernels import TOLERANCE, Known, Sums, search, variation
from beamsim.flow.kernels import EPS
from beamsim.outcomes import check_stop
from beamsim.typing import Complexes, Floats, Ints

PARTS_AT_ONCE = 256  # which bounds the memory


@dataclass(frozen=True)
class Waves:
    """K outputs on n parts of segments, as sums of T terms ``Re amplitude table t^power exp(exponent t)``.

    The time t is that since the segment began, or since its middle where parts begin before. There are Z amplitudes and
    B functions of time.
    """

    exponent: Complexes  # (B,) 1/s
    power: Ints  # (B,)
    basis: Ints  # (T,) function of each term
    source: Ints  # (T,) amplitude of each term
    table: Complexes  # (T, K) coefficients of the outputs, or (n, T, K)
    amplitudes: Callable[[Ints], tuple[Complexes, Floats]]  # (m, Z) on some of the n parts, and their round-off
    time: Floats  # (n,) s, of the segments
    length: Floats  # (n,) s, of the segments
    begin: Floats  # (n,) of the parts, as a share of the segments
    end: Floats  # (n,)
    window: Ints  # (n,) numbers of the windows that the parts belong to

    def sums(self, rows: Ints) -> Sums:
        """The outputs on some parts, in times that are shares of the segments."""
        rate = self.exponent * self.length[rows, None]
        rate = np.where(rate.real < GROWTH, rate, 0.0)  # what rests may grow beyond all numbers
        scale = (self.length[rows, None] ** self.power)[:, self.basis]
        amplitude, noise = (x[:, self.source] * scale for x in self.amplitudes(rows))
        table = self.table[rows] if self.table.ndim == 3 else self.table[None]
        table = np.stack([table.real, table.imag, np.abs(table)], axis=1)
        place = np.stack([self.begin[rows], self.end[rows], self.time[rows], self.length[rows]])
        return Sums(rate, self.power, self.basis, amplitude, noise, table, place, self.window[rows])

    def at(self, rows: Ints, u: Floats) -> Floats:
        """(m,) the only output on some parts, at one time (m,) each, a share of the segment."""
        sums = self.sums(rows)
        functions = np.exp(sums.rate * u[:, None]) * u[:, None] ** sums.power
        terms = functions[:, sums.basis] * sums.amplitude
        return np.asarray((terms.real * sums.table[:, 0, :, 0] - terms.imag * sums.table[:, 1, :, 0]).sum(axis=1))

    def at_ends(self) -> Floats:
        """(n, 2) the only output where the parts begin and end, limits from within."""
        rows = np.arange(self.time.size)
        return np.stack([self.at(rows, self.begin), self.at(rows, self.end)], axis=1)

    def variations(self) -> tuple[Floats, Floats]:
        """(n, K) bounds on the total variation of the outputs on the parts, and their values (2, n, K) at the ends."""
        found = [variation(sums) for _, sums in self.batches()]
        return np.concatenate([bound for bound, _ in found]), np.concatenate([value for _, value in found], axis=1)

    def batches(self) -> Iterator[tuple[Ints, Sums]]:
        """The parts, some after the other: their numbers (m,), and the outputs on them."""
        for first in range(0, self.time.size, PARTS_AT_ONCE):
            check_stop()
            rows = np.arange(first, min(first + PARTS_AT_ONCE, self.time.size))
            yield rows, self.sums(rows)


@dataclass(frozen=True)
class Extrema:
    """Extreme values of K outputs in W windows and their times, s."""

    evaluations: int  # of an output at one time
    low: Floats  # (W, K)
    when_low: Floats
    high: Floats
    when_high: Floats

    def some(self, outputs: Ints) -> Extrema:
        """Those of some of the outputs."""
        return Extrema(self.evaluations, *(x[..., outputs] for x in self.extremes))

    def window(self, number: int) -> Extrema:
        """Those of one window (K,)."""
        return Extrema(self.evaluations, *(x[number] for x in self.extremes))

    def beside(self, other: Extrema) -> Extrema:
        """These outputs and then the others."""
        pairs = zip(self.extremes, other.extremes, strict=True)
        return Extrema(self.evaluations + other.evaluations, *(np.concatenate(x, axis=-1) for x in pairs))

    @property
    def extremes(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Lowest values, their times, highest values, their times."""
        return self.low, self.when_low, self.high, self.when_high


@dataclass
class Search:
    """The largest and smallest values of K outputs that are known in W windows.

    They are values that are reached, and no other is beyond them by more than `TOLERANCE` of their size; of sums of
    squares of that of their largest value. Of rivals this holds of the largest magnitude of all.
    """

    known: Known
    evaluations: int = 0

    @classmethod
    def of(cls, outputs: int, windows: int = 1, squares: Ints | None = None, rivals: Ints | None = None) -> Search:
        """A search in which nothing is known.

        Parameters
        ----------
        outputs : number of the outputs of `Waves`.
        windows : number W.
        squares : (K,) first of each group of consecutive outputs, where half the sums of their squares are asked for.
        rivals : those of the K of which only the largest magnitude of all is asked for.

        Returns
        -------
        Search
            Of the K groups; without groups K is the number of outputs.
        """
        first = np.append(np.arange(outputs) if squares is None else squares, outputs)
        shape, least = (2, windows, first.size - 1), np.finfo(float).min
        rank = np.arange(2 * shape[2]).reshape(2, -1)
        if rivals is not None:
            rank[:, rivals] = rank[0, rivals[:1]]
        best = np.full((windows, rank.size), least)
        return cls(Known(np.full(shape, least), np.full(shape, np.nan), first, squares is not None, rank, best))

    def add(self, waves: Sequence[Waves]) -> None:
        """Look at parts of a motion together: the outputs on the parts."""
        if not self.known.rank.size:
            return
        for wave in waves:
            for _, sums in wave.batches():
                self.evaluations += search(sums, self.known, -1.0)[1]

    def extrema(self) -> Extrema:
        """What is known; infinite in windows of which nothing is."""
        high, low = np.where(np.isnan(self.known.when), -np.inf, self.known.value)
        when_high, when_low = self.known.when
        return Extrema(self.evaluations, -low, when_low, high, when_high)


def turning_points(waves: Sequence[Waves]) -> tuple[Ints, Ints, Floats, Floats]:
    """All maxima and minima of one output inside parts of segments.

    Those that are left out differ from what is beside them by less than `TOLERANCE` of the largest value.

    Returns
    -------
    wave, row : (m,) numbers of the waves and of their parts, in no order.
    time : (m,) s.
    value : (m,)
    """
    largest = Search.of(1)
    largest.add(waves)
    known, found = largest.known, [(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), *np.zeros((2, 0)))]
    resolution = TOLERANCE * float(np.abs(known.value).max())
    for number, wave in enumerate(waves):
        for rows, sums in wave.batches():
            turns, _ = search(sums, known, resolution)
            row, u = rows[turns[:, 0].astype(np.int64)], turns[:, 1]
            found.append((np.full_like(row, number), row, wave.time[row] + u * wave.length[row], wave.at(row, u)))
    wave_of, row, time, value = (np.concatenate(part) for part in zip(*found, strict=True))
    return wave_of, row, time, value


NODES = 16  # degree of the polynomials, above that of any integrator's dense output (12)
_POINTS = chebyshev.chebpts2(NODES + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, NODES))
_POWERS = np.array([np.pad(chebyshev.cheb2poly(row), (0, NODES - k)) for k, row in enumerate(np.eye(NODES + 1))])


def polynomials(values: Floats, start: Floats, length: Floats) -> Waves:
    """Outputs on S steps, from their values (S, NODES + 1, k) at the Chebyshev points, the earliest first.

    Parameters
    ----------
    values : (S, NODES + 1, k) in the units of the outputs.
    start, length : (S,) of the steps, s.

    Returns
    -------
    Waves
        A piece a step.
    """
    steps = values.shape[0]
    coefficient = _COEFFICIENTS @ values
    round_off = NODES * EPS * np.abs(values).max(axis=1, keepdims=True)
    coefficient = np.where(np.abs(coefficient) > round_off, coefficient, 0.0)
    number, half = np.arange(NODES + 1), 0.5 * length
    table = (_POWERS.T @ coefficient) * half[:, None, None] ** -number[:, None]
    return Waves(
        np.zeros(NODES + 1, dtype=complex), number, number, np.zeros_like(number), table.astype(complex),
        lambda rows: (np.ones((rows.size, 1), dtype=complex), np.zeros((rows.size, 1))), start + half, half,
        -np.ones(steps), np.ones(steps),
        np.zeros(steps, dtype=np.int64),
    )  # fmt: skip
