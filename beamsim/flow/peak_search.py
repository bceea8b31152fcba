r"""Largest values of sums of exponentials on many segments at once.

On an interval of length h a sum :math:`f = \mathrm{Re} \sum_b c_b e^{\lambda_b s}` leaves the cubic with its values
and slopes at the ends by no more than :math:`h^4 \max|f''''| / 384`, and its slope leaves that of the cubic by no more
than :math:`\sqrt 3\, h^3 \max|f''''| / 216`. Terms that turn too far for this on the interval are bounded by their
sizes, or by their values at the ends if they decay without turning. Intervals that may hold more than the largest value
known are divided until none is left. Where the second derivative is negative throughout, Newton's method finds the only
maximum.

Outputs on the same interval share its exponentials, and their values are products with their coefficients.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.cubic import Cubic
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

TOLERANCE = 1e-10  # relative distance below which two peaks of an output count as equal
FARTHEST = 3.0  # rad, that a term may turn on an interval to be part of the cubic
SLOPE = math.sqrt(3.0) / 216.0
PARTS = 8  # of an interval
MOST_PARTS = 128  # ... of a few intervals, which save divisions and cost little more
PARTS_TOGETHER = 512  # of all of them
STEPS = 60  # of Newton's method, which takes five
CONVERGED = 1e-12  # of an interval, a step of Newton's method
VALUES_AT_ONCE = 2_000_000
AT_ONCE = 128  # intervals, up to which all are divided together
FEW = 16  # intervals of an output that are divided together before a peak of it is known
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Sums:
    """P outputs on some of G segments, sums of up to B exponentials each; shorter ones are filled up with zeros."""

    exponent: Complexes  # (G, B) 1/s
    time: Floats  # (G,) when segments begin, s
    segment: Ints  # (P,)
    output: Ints  # (P,)
    coefficient: Complexes  # (P, B) where segments begin

    @cached_property
    def factors(self) -> Floats:
        """(P, 2 B) of the real and imaginary parts of the exponentials."""
        return np.conj(self.coefficient).view(float)

    @cached_property
    def sizes(self) -> Floats:
        """(P, B) of the coefficients."""
        return np.abs(self.coefficient)


@dataclass(frozen=True)
class Intervals:
    """Parts of segments on which a sum may be larger than any value known."""

    sum: Ints  # (n,) among the sums
    begin: Floats  # (n,) from where the segment begins, s
    length: Floats  # (n,) s
    bound: Floats  # (n,) no value on the interval is larger, round-off apart

    def some(self, which: Bools | Ints | slice) -> Intervals:
        """Some of the intervals."""
        return Intervals(self.sum[which], self.begin[which], self.length[which], self.bound[which])


def search(sums: Sums, intervals: Intervals, highest: Floats, when: Floats) -> int:
    """Raise ``highest`` (k,) to the largest values of outputs on intervals, and ``when`` (k,) with it.

    A peak to within round-off, and no other is higher by more than `TOLERANCE`, relatively. Returns at how many points
    sums were evaluated.
    """
    at_once = max(1, VALUES_AT_ONCE // (10 * PARTS * max(1, sums.exponent.shape[1])))
    found = _Found(sums, highest, when, np.full(highest.size, -np.inf))
    waiting = [intervals]
    while waiting:  # the latest first, so that large values become known early
        check_stop()
        block = waiting.pop()
        block = block.some(block.bound > found.limit(block))
        if block.sum.size > AT_ONCE:
            first = found.first(block, at_once)
            waiting.append(block.some(~first))
            block = block.some(first)
        if block.sum.size:
            waiting.append(found.divide(block))
    return found.evaluations


def powers(begin: Any, factor: Any, parts: int = PARTS) -> Any:
    """(n, parts + 1, T) of ``begin`` (n, T) times the powers of a factor (n, T), at the ends of parts of intervals."""
    out = np.empty((begin.shape[0], parts + 1, begin.shape[1]), dtype=begin.dtype)
    out[:, 0] = begin
    known = 1
    while known <= parts:
        more = min(known, parts + 1 - known)
        np.multiply(out[:, :more], factor[:, None], out=out[:, known : known + more])
        known, factor = known + more, factor * factor
    return out


@dataclass
class _Found:
    """The largest values known, and what they took."""

    sums: Sums
    highest: Floats
    when: Floats
    peak: Floats  # (k,) highest where the slope is zero; a point near it may be no peak, and is searched around
    evaluations: int = 0

    def limit(self, of: Intervals) -> Floats:
        """(n,) what sums on intervals would have to exceed."""
        output = self.sums.output[of.sum]
        peak = self.peak[output]
        return np.asarray(np.fmax(self.highest[output], (1.0 + np.copysign(TOLERANCE, peak)) * peak))

    def first(self, of: Intervals, most: int) -> Bools:
        """(n,) the intervals to go on with: of each output those with the largest bounds, and few without a peak."""
        output = self.sums.output[of.sum]
        by_output = np.lexsort((-of.bound, output))
        count = np.bincount(output)
        rank = np.empty(output.size, dtype=np.int64)
        rank[by_output] = np.arange(output.size) - np.repeat(np.cumsum(count) - count, count)
        first = np.zeros(output.size, dtype=bool)
        first[np.argsort(rank, kind="stable")[:most]] = True
        if np.isinf(self.peak[output]).any():
            first &= rank < FEW
        return first

    def divide(self, of: Intervals) -> Intervals:
        """The parts of intervals that may still hold a larger value."""
        parts = min(MOST_PARTS, max(PARTS, PARTS_TOGETHER // of.sum.size))
        grid, at = _Grid.of(self.sums, of, parts)
        factors, sizes = self.sums.factors[of.sum], self.sums.sizes[of.sum]
        value, slope = _products(grid.values, at, factors), _products(grid.slopes, at, factors)
        error = _products(grid.fourth, at, sizes)
        cubic = Cubic(value[:, :-1], value[:, 1:], slope[:, :-1], slope[:, 1:])
        top, place = cubic.top()
        bound, rules_out = top + error / 384.0, cubic.climbs(SLOPE * error)
        if grid.far is not None:
            turns, decays = (_products(part, at, factors) for part in (grid.far.turns, grid.far.decays))
            aside = _products(grid.far.aside, at, sizes)
            bound += aside + 0.5 * (decays[:, :-1] + decays[:, 1:])
            rules_out &= aside == 0.0
            value = value + turns + decays
        step = of.length / parts
        begin = of.begin[:, None] + step[:, None] * np.arange(parts + 1)
        self.evaluations += value.size - value.shape[0]
        row, best = np.arange(of.sum.size), value.argmax(axis=1)
        self._reach(of, value[row, best], begin[row, best])
        bound = np.minimum(bound - _products(grid.noise, at, sizes), of.bound[:, None])
        row, part = np.nonzero((bound > self.limit(of)[:, None]) & ~rules_out)
        left = Intervals(of.sum[row], begin[row, part], step[row], bound[row, part])
        if not row.size:
            return left
        which, turn = at[row], grid.step_turn[at[row]]
        bend = np.maximum(*(self._curvature(left.sum, grid.terms[which, part + k], turn) for k in (0, 1)))
        bend += (grid.whole_fourth[which, part] * sizes[row]).sum(axis=1) / 8.0
        if grid.far is not None:
            slope = slope + _products(grid.far.slopes, at, factors)
        peak = (bend < 0.0) & (slope[row, part] > 0.0) & (slope[row, part + 1] < 0.0)
        if peak.any():
            self._climb(left.some(peak), place[row, part][peak])
        return left.some((bend >= 0.0) & (left.length > EPS * (left.begin + left.length)))

    def _curvature(self, sums: Ints, terms: Complexes, turn: Complexes) -> Floats:
        """(n,) of sums with some terms, in units of the time in which these turn."""
        return np.asarray((self.sums.coefficient[sums] * terms * turn**2).real.sum(axis=1))

    def _reach(self, of: Intervals, value: Floats, at: Floats) -> None:
        """Values (n,) of sums on intervals, at times (n,) from where their segments begin."""
        self.evaluations += value.size
        output = self.sums.output[of.sum]
        better = (value > self.highest[output]).nonzero()[0]
        if better.size:
            time = self.sums.time[self.sums.segment[of.sum[better]]] + at[better]
            best = np.lexsort((-time, value[better]))  # the last of an output stays: its largest, the earliest of these
            self.highest[output[better[best]]] = value[better[best]]
            self.when[output[better[best]]] = time[best]

    def _climb(self, of: Intervals, place: Floats) -> None:
        """Maxima of sums that are concave on intervals and rise where these begin, fall where they end."""
        segment = self.sums.segment[of.sum]
        coefficient, exponent = self.sums.coefficient[of.sum], self.sums.exponent[segment]
        derivatives = exponent[:, None] ** np.arange(3)[:, None]
        low, high = of.begin, of.begin + of.length
        at = low + place * of.length
        for _ in range(STEPS):
            at = np.where((at > low) & (at < high), at, 0.5 * (low + high))
            terms = coefficient * np.exp(exponent * at[:, None])
            value, slope, curve = (terms[:, None] * derivatives).real.sum(axis=2).T
            self._reach(of, value, at)
            low, high = np.where(slope > 0.0, at, low), np.where(slope > 0.0, high, at)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = -slope / curve
            output, converged = self.sums.output[of.sum], np.abs(step) <= CONVERGED * of.length
            np.maximum.at(self.peak, output[converged], value[converged])
            above = value + np.abs(slope) * (high - low) > self.highest[output]  # no value is above a tangent
            going = (above & ~converged).nonzero()[0]
            if not going.size:
                break
            if going.size < at.size:
                of, coefficient, exponent = of.some(going), coefficient[going], exponent[going]
                derivatives = derivatives[going]
            low, high, at = low[going], high[going], at[going] + step[going]


@dataclass(frozen=True)
class _Far:
    """Terms that turn too far on a part of an interval, which are zero in `_Grid.values` and the like."""

    turns: Floats  # (U, points, 2 B)
    decays: Floats  # (U, points, 2 B) without turning
    slopes: Floats  # (U, points, 2 B) of both
    aside: Floats  # (U, parts, B) the most by which a part leaves zero, or the mean of the ends if it decays


@dataclass(frozen=True)
class _Grid:
    """Terms at the ends of the parts of U different intervals; the length of a part is the unit of time."""

    terms: Complexes  # (U, points, B)
    step_turn: Complexes  # (U, B) exponents
    values: Floats  # (U, points, 2 B) real and imaginary parts
    slopes: Floats  # (U, points, 2 B)
    fourth: Floats  # (U, parts, B) largest size of the fourth derivative
    whole_fourth: Floats  # the same with the terms that turn far
    noise: Floats  # (U, 1, B) round-off, on all parts
    far: _Far | None

    @classmethod
    def of(cls, sums: Sums, intervals: Intervals, parts: int) -> tuple[_Grid, Ints]:
        """For some intervals, and which one (n,) each of them is."""
        segment = sums.segment[intervals.sum]
        first, at = _different(segment, intervals.begin, intervals.length)
        segment, begin, step = segment[first], intervals.begin[first], intervals.length[first] / parts
        exponent = sums.exponent[segment]
        left, turn = np.exp(exponent * begin[:, None]), exponent * step[:, None]
        terms = powers(left, np.exp(turn), parts)
        slopes = terms * turn[:, None]
        size = np.sqrt(terms.real**2 + terms.imag**2)
        size = np.maximum(size[:, :-1], size[:, 1:])
        angle = np.abs(turn)
        fourth = whole = size * angle[:, None] ** 4
        end = begin + intervals.length[first]
        noise = 4.0 * EPS * size.max(axis=1) * (8.0 + np.abs(exponent) * end[:, None])
        values, far, too_far = terms, None, (angle > FARTHEST)[:, None]
        if too_far.any():
            straight = too_far & (exponent.imag == 0.0)[:, None]
            turns, decays = np.where(too_far & ~straight, terms, 0.0), np.where(straight, terms, 0.0)
            aside = np.where(straight, 0.5 * np.abs(np.diff(terms, axis=1)), np.where(too_far, size, 0.0))
            far = _Far(_real(turns), _real(decays), _real(np.where(too_far, slopes, 0.0)), aside)
            values, slopes, fourth = (np.where(too_far, 0.0, part) for part in (terms, slopes, whole))
        return cls(terms, turn, _real(values), _real(slopes), fourth, whole, noise[:, None], far), at


def _different(*keys: Floats | Ints) -> tuple[Ints, Ints]:
    """Where each of the different tuples of keys (n,) comes first, and which of them each is."""
    if keys[0].size == 1:
        return (only := np.zeros(1, dtype=np.int64)), only
    order = np.lexsort(keys)
    new = np.ones(order.size, dtype=bool)
    new[1:] = np.logical_or.reduce([key[order[1:]] != key[order[:-1]] for key in keys])
    at = np.empty(order.size, dtype=np.int64)
    at[order] = np.cumsum(new) - 1
    return order[new], at


def _real(z: Complexes) -> Floats:
    """(U, points, 2 B) real and imaginary parts of terms (U, points, B)."""
    return z.view(float)


def _products(table: Floats, at: Ints, factors: Floats) -> Floats:
    """(n, points) of rows ``at`` (n,) of a table (U, points, X) with factors (n, X)."""
    return np.asarray(np.matmul(table[at], factors[:, :, None])[:, :, 0])
