r"""Extremes of sums of squares of outputs, such as energies, over a motion in closed form.

Between the ends of an interval of length h outputs x leave the straight line through their values by no more than
:math:`e = h^2 \max|\ddot x| / 8`, or twice the size of their terms; the terms of the motion bound both. With
:math:`E = |x|^2 / 2`, :math:`\sqrt E` is therefore at most its larger value at the ends plus :math:`|e| / \sqrt 2`, and
at least its smallest value along the line less that. Intervals that may hold a larger or a smaller value than is known
are divided until none is left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import ContactState, OutputOf
from beamsim.flow.stopping import check_stop
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Bools, Complexes, Floats, Ints

TOLERANCE = 1e-9  # of the largest value
DIVISIONS = 8  # of an interval
VALUES_AT_ONCE = 2_000_000  # of terms at points
MOST_INTERVALS = 3_000_000  # that are divided


@dataclass
class SquareSumExtremes:
    """The extremes (k,) so far, which are reached, with their times, s."""

    low: Floats
    when_low: Floats
    high: Floats
    when_high: Floats
    excess: Floats  # (k,) by which a larger value cannot be ruled out; at most `TOLERANCE` of it where all is searched
    intervals: int = 0  # that were divided

    def take(self, times: Floats, values: Floats) -> None:
        """Values (nt, k) that are reached at times (nt,)."""
        for sign, value, when in ((1.0, self.high, self.when_high), (-1.0, self.low, self.when_low)):
            at = (sign * values).argmax(axis=0)
            reached = values[at, np.arange(values.shape[1])]
            better = sign * reached > sign * value
            value[better], when[better] = reached[better], times[at[better]]

    def possible(self, lower: Floats, upper: Floats) -> Bools:
        """(n,) whether intervals with bounds (n, k) may hold an extreme."""
        margin = TOLERANCE * self.high
        return np.asarray(np.any((upper > self.high + margin) | (lower < self.low - margin), axis=1))


def square_sum_extremes(
    trajectory: Trajectory, output_of: OutputOf, sizes: Sequence[int], times: Floats
) -> SquareSumExtremes:
    """Extremes of ``sum(x**2) / 2`` over groups of consecutive outputs.

    Parameters
    ----------
    sizes : number of outputs in each of k groups.
    times : increasing, s, of the samples from which the search starts.
    """
    first = np.cumsum([0, *sizes[:-1]])
    k = len(sizes)
    found = SquareSumExtremes(np.full(k, np.inf), np.zeros(k), np.full(k, -np.inf), np.zeros(k), np.zeros(k))
    found.take(times, 0.5 * np.add.reduceat(trajectory.sample(times, output_of) ** 2, first, axis=1))
    for part in trajectory.parts():
        searches = [
            _Undecided(part, part.flow.states[number], np.flatnonzero(part.state == number), output_of, first, found)
            for number in np.unique(part.state)
        ]
        while any(search.segment.size for search in searches):
            if found.intervals > MOST_INTERVALS:
                for search in searches:
                    search.give_up()
                break
            for search in searches:
                search.divide()
    return found


class _Undecided:
    """The intervals of one contact state that may hold an extreme."""

    def __init__(
        self, motion: Trajectory, state: ContactState, segments: Ints, output_of: OutputOf,
        first: Ints, found: SquareSumExtremes,
    ) -> None:  # fmt: skip
        self.motion, self.state, self.first, self.found = motion, state, first, found
        self.segment, self.begin, self.length = segments, np.zeros(segments.size), motion.length[segments]
        table = state.coefficients(output_of(state.phases), motion.flow.sources)
        self.parts = np.stack([table.real, -table.imag], axis=1).reshape(-1, table.shape[1])
        self.size = np.abs(table)
        self.exponent, self.power = state.exponent[state.term_basis], state.power[state.term_basis]
        self.upper = np.full((segments.size, first.size), np.inf)

    def divide(self) -> None:
        """Keep the parts of the intervals that may hold an extreme."""
        kept: list[tuple[Ints, Floats, Floats, Floats, Floats]] = []
        for block in self._blocks():
            check_stop()
            kept.append(self._divided(block))
        self.found.intervals += self.segment.size
        if not kept:
            return
        segment, begin, length, lower, upper = (np.concatenate(column) for column in zip(*kept, strict=True))
        still = self.found.possible(lower, upper)
        self.segment, self.begin, self.length, self.upper = segment[still], begin[still], length[still], upper[still]

    def give_up(self) -> None:
        """Note what the intervals that are left may hold."""
        if self.segment.size:
            self.found.excess = np.maximum(self.found.excess, self.upper.max(axis=0) - self.found.high)

    def _blocks(self) -> Iterator[slice]:
        rows = max(1, VALUES_AT_ONCE // ((DIVISIONS + 1) * max(self.parts.shape)))
        for start in range(0, self.segment.size, rows):
            yield slice(start, start + rows)

    def _divided(self, block: slice) -> tuple[Ints, Floats, Floats, Floats, Floats]:
        """Segment, begin, length and bounds (n, k) of the parts of some intervals that may hold an extreme."""
        segments, at = np.unique(self.segment[block], return_inverse=True)
        amplitude = self.motion.amplitudes(self.state, segments)[at]
        step = self.length[block] / DIVISIONS
        tau = self.begin[block, None] + step[:, None] * np.arange(DIVISIONS + 1)
        with np.errstate(over="ignore", invalid="ignore"):
            terms = amplitude[:, None] * tau[:, :, None] ** self.power * np.exp(tau[:, :, None] * self.exponent)
        x = (terms.view(float).reshape(-1, self.parts.shape[0]) @ self.parts).reshape(*tau.shape, -1)
        value = self._sums(x**2)
        time = self.motion.time[self.segment[block], None] + tau
        self.found.take(time.ravel(), value.reshape(-1, self.first.size))
        aside = np.sqrt(self._sums((self._bends(amplitude, tau, step) @ self.size) ** 2))
        along = np.diff(x, axis=1)
        slope, square = 2.0 * self._sums(x[:, :-1] * along), 2.0 * self._sums(along**2)
        share = np.clip(-slope / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        least = np.maximum(value[:, :-1] + share * slope + 0.5 * share**2 * square, 0.0)
        lower = np.maximum(np.sqrt(least) - aside, 0.0) ** 2
        upper = (np.sqrt(np.maximum(value[:, :-1], value[:, 1:])) + aside) ** 2
        k = self.first.size
        lower, upper = lower.reshape(-1, k), upper.reshape(-1, k)
        kept = self.found.possible(lower, upper)
        row = np.repeat(np.arange(step.size), DIVISIONS)[kept]
        return self.segment[block][row], tau[:, :-1].ravel()[kept], step[row], lower[kept], upper[kept]

    def _sums(self, squares: Floats) -> Floats:
        """(..., k) half the sums over each group of (..., outputs)."""
        return np.asarray(0.5 * np.add.reduceat(squares, self.first, axis=-1))

    def _bends(self, amplitude: Complexes, tau: Floats, step: Floats) -> Floats:
        """(n, divisions, T) how far each term may leave the straight line between times tau (n, divisions + 1)."""
        end, p, rate = tau[:, 1:, None], self.power, np.abs(self.exponent)
        grown = np.exp(np.maximum(tau[:, :-1, None] * self.exponent.real, end * self.exponent.real))
        once, twice = p * end ** np.maximum(p - 1, 0), p * (p - 1) * end ** np.maximum(p - 2, 0)
        curvature = rate**2 * end**p + 2.0 * rate * once + twice
        beside = np.minimum(step[:, None, None] ** 2 / 8.0 * curvature, 2.0 * end**p)
        return np.asarray(np.abs(amplitude)[:, None] * grown * beside)
