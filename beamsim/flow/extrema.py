r"""Largest and smallest values of outputs of a motion in closed form, certified.

On a segment of length H an output is a sum of terms :math:`\mathrm{Re}\, c\, \varphi(u)`, with
:math:`\varphi = u^p e^{\lambda H u}` and the time u on the segment over its length. The sizes of the terms bound every
derivative of the sum between two points, and so how far it leaves what is known there:

- the straight line through its values by :math:`h^2 \max|f''| / 8`, or twice the size of the terms;
- the cubic through its values and slopes by :math:`h^4 \max|f''''| / 384`, and the slope of this cubic by
  :math:`\sqrt 3\, h^3 \max|f''''| / 216`.

Straight lines, by products of matrices over all segments and outputs of a contact state, rule out most pairs of a
segment and an output. What is left is divided, and bounded by cubics, until no interval is left that may hold more than
the largest value known. Where the second derivative is negative throughout, Newton's method finds the only maximum. The
smallest value is the largest one of the negative.

Half the sum of the squares of outputs, such as an energy, is searched in the same way: the bounds on the outputs bound
it and its derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.cubic import Cubic
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

TOLERANCE = 1e-10  # relative distance below which two peaks of an output count as equal
PARTS = 8  # of an interval
MOST_PARTS = 128  # ... of a few intervals, which save divisions and cost little more
PARTS_TOGETHER = 512  # of all of them
FARTHEST = 3.0  # rad, that a term may turn on an interval to be part of the cubic
SLOPE = math.sqrt(3.0) / 216.0
STEPS = 60  # of Newton's method, which takes five
CONVERGED = 1e-12  # of an interval, a step of Newton's method
VALUES_AT_ONCE = 2_000_000  # of outputs or terms, at the points of some intervals
AT_ONCE = 128  # intervals, up to which all are divided together
FEW = 16  # intervals of an output that are divided together before a peak of it is known
FEWEST_ALIKE = 64  # fewest segments of equal lengths for which it pays that their outputs are one function
GROWTH = 690.0  # logarithm of a function's growth on a segment; where it is larger, the amplitude is zero
EPS = float(np.finfo(float).eps)
_Arrays = TypeVar("_Arrays", "_Pairs", "_Sums", "_Intervals")


@dataclass(frozen=True)
class Waves:
    """Outputs on parts of n segments, as sums of T terms: an amplitude times a function ``t^power exp(exponent t)``.

    The time t is that since the segment began, or since its middle where parts begin before. There are Z amplitudes and
    B functions.
    """

    exponent: Complexes  # (B,) of all segments, or (n, B), 1/s
    power: Ints  # (B,)
    basis: Ints  # (T,) function of each term
    source: Ints  # (T,) amplitude of each term
    table: Complexes  # (T, k) coefficients of the outputs, or (n, T, k)
    output: Ints  # (k,) their numbers among all outputs, increasing
    amplitudes: Callable[[Ints], Complexes]  # (m, Z) of some of the n parts
    time: Floats  # (n,) s, of the segments
    length: Floats  # (n,) s, of the segments
    begin: Floats  # (n,) of the parts, as a share of the segments
    end: Floats  # (n,)
    window: Ints  # (n,) numbers of the windows that the parts belong to

    def functions(self, rows: Ints) -> tuple[Complexes, Floats, Floats]:
        """Of some segments (m, B) exponents times lengths; the growth of the functions; and their largest sizes, by
        which they are divided, so that none is larger than 1."""
        length = self.length[rows]
        rate = (self.exponent[rows] if self.exponent.ndim == 2 else self.exponent) * length[:, None]
        rate = np.where(rate.real < GROWTH, rate, 0.0)
        growth = np.maximum(rate.real, 0.0)
        size = np.exp(growth)
        return rate, growth, size * length[:, None] ** self.power if self.power.any() else size


@dataclass(frozen=True)
class Extrema:
    """Extreme values of K outputs in W windows and their times, s."""

    low: Floats  # (W, K)
    when_low: Floats
    high: Floats
    when_high: Floats
    evaluations: int  # of an output at one time


def derivative_bound(order: int, angle: Floats, power: Ints, share: Floats) -> Any:
    """Largest derivative of ``u^p exp(rate u)`` in units of a step, over the largest size there.

    Parameters
    ----------
    order : of the derivative.
    angle : (..., B) size of the rates times the step.
    power : (B,) p.
    share : (...) the step over the largest u.
    """
    bound = angle**order
    falling, chosen = power.astype(float), 1.0
    for i in range(1, min(order, int(power.max(initial=0))) + 1):
        chosen *= (order - i + 1) / i
        bound = bound + chosen * falling * share[..., None] ** i * angle ** (order - i)
        falling = falling * np.maximum(power - i, 0)
    return bound


def powers(begin: Any, factor: Any, parts: int) -> Any:
    """(n, parts + 1, B) of ``begin`` (n, B) times the powers of a factor (n, B)."""
    out = np.empty((begin.shape[0], parts + 1, begin.shape[1]), dtype=np.result_type(begin, factor))
    out[:, 0] = begin
    known = 1
    while known <= parts:
        more = min(known, parts + 1 - known)
        np.multiply(out[:, :more], factor[:, None], out=out[:, known : known + more])
        known += more
        if known <= parts:
            factor = factor * factor
    return out


@dataclass(frozen=True)
class _Pairs:
    """Parts of segments and outputs on them that may exceed what was known."""

    row: Ints  # (n,) of the waves
    key: Ints  # (n,) of sign, window and output, see `Search`
    bound: Floats  # (n,) no value is larger

    @classmethod
    def of(cls, waves: Waves, found: Search) -> _Pairs:
        """Those that straight lines leave; the largest value at a point becomes known."""
        found.reach_zero(waves)
        pairs = [cls(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))]
        for rows, place, values, over in _lines(waves) if waves.table.size else ():
            values, upper, lower = found.bounds(values, over)
            for sign, (value, bound) in enumerate(((values, upper), (-values, -lower))):
                key = found.key(sign, waves.window[rows, None], waves.output if found.squares is None else found.every)
                found.reach_block(key, value, waves.time[rows, None] + place * waves.length[rows, None])
                row, column = np.nonzero(bound > found.limit(key))
                pairs.append(cls(rows[row], key[row, column], bound[row, column]))
        return _joined(pairs)

    def some(self, which: Bools | slice) -> _Pairs:
        """Some of them."""
        return _Pairs(self.row[which], self.key[which], self.bound[which])


def _lines(waves: Waves) -> Iterator[tuple[Ints, Floats, Floats, Floats]]:
    """Some rows (m,) of the waves after the other; ends (m, points) of equal parts, as shares of the segments; outputs
    (m, points, k) there; and how far these may leave the straight lines between (m, points - 1, k)."""
    fastest = float(np.abs(waves.exponent).max(initial=0.0)) * float(waves.length.max(initial=0.0))
    parts = max(1, math.ceil(min(fastest / FARTHEST, PARTS)))
    *groups, others = _alike(waves)
    factors, sizes = _real_factors(waves.table), np.abs(waves.table)
    at_once = max(1, VALUES_AT_ONCE // ((parts + 1) * max(waves.table.shape[-2:])))
    for rows in _blocks(others, at_once):
        place, basis, bent = _basis(waves, rows, parts)
        begun = waves.amplitudes(rows)[:, None, waves.source]
        terms, aside = begun * basis[:, :, waves.basis], np.abs(begun) * bent[:, :, waves.basis]
        if waves.table.ndim == 2:  # one product of two matrices is faster than one for each segment
            yield rows, place, _product(_real(terms), factors), _product(aside, sizes)
        else:
            yield rows, place, _real(terms) @ factors[rows], aside @ sizes[rows]
    for group in groups:
        place, basis, bent = _basis(waves, group[:1], parts)
        of_source = waves.source == np.arange(waves.source.max() + 1)[:, None]
        outputs = of_source @ (basis[0, :, waves.basis].swapaxes(0, 1)[:, :, None] * waves.table)
        over = of_source @ (bent[0, :, waves.basis].swapaxes(0, 1)[:, :, None] * sizes)
        outputs, over = _real_factors(outputs).swapaxes(0, 1), over.swapaxes(0, 1)
        at_once = max(1, VALUES_AT_ONCE // max(outputs[0].size, outputs.shape[0]))
        for rows in _blocks(group, at_once):
            begun = waves.amplitudes(rows)
            value = _product(_real(begun), outputs.reshape(outputs.shape[0], -1)).reshape(rows.size, parts + 1, -1)
            aside = (np.abs(begun) @ over.reshape(over.shape[0], -1)).reshape(rows.size, parts, -1)
            yield rows, np.broadcast_to(place, (rows.size, parts + 1)), value, aside


def _blocks(rows: Ints, at_once: int) -> Iterator[Ints]:
    for first in range(0, rows.size, at_once):
        check_stop()
        yield rows[first : first + at_once]


def _alike(waves: Waves) -> Iterator[Ints]:
    """Rows of whole segments that are equally long, in groups of some, and then all other rows.

    On segments of one group, as random and sampled inputs have them, outputs are the same function of the amplitudes.
    Lengths are equal if they differ by no more than the round-off of the times.
    """
    whole = np.flatnonzero((waves.begin == 0.0) & (waves.end == 1.0)) if waves.table.ndim == 2 else np.zeros(0, int)
    order = whole[np.argsort(waves.length[whole], kind="stable")]
    apart = np.diff(waves.length[order]) > 4.0 * EPS * waves.time.max(initial=0.0)
    single = np.ones(waves.time.size, dtype=bool)
    for group in np.split(order, np.flatnonzero(apart) + 1):
        if group.size >= FEWEST_ALIKE:
            single[group] = False
            yield np.sort(group)
    yield np.flatnonzero(single)


def _basis(waves: Waves, rows: Ints, parts: int) -> tuple[Floats, Complexes, Floats]:
    """Ends (m, points) of equal parts, the functions there (m, points, B), and how far these may leave the straight
    lines between (m, points - 1, B)."""
    rate, growth, largest = waves.functions(rows)
    begin = waves.begin[rows, None]
    step = (waves.end[rows, None] - begin) / parts
    place, turn = begin + step * np.arange(parts + 1), rate * step
    basis = powers(largest * np.exp(rate * begin - growth), np.exp(turn), parts)
    bent = np.abs(basis)
    bent = np.maximum(bent[:, :-1], bent[:, 1:])
    far = np.maximum(np.abs(place[:, 1:]), np.abs(place[:, :-1]))
    if waves.power.any():
        basis, bent = basis * place[:, :, None] ** waves.power, bent * far[:, :, None] ** waves.power
    share = step / np.where(far > 0.0, far, 1.0)
    curved = derivative_bound(2, np.abs(turn)[:, None], waves.power, share) / 8.0
    return place, basis, bent * np.minimum(curved, 2.0)


def _product(x: Floats, table: Floats) -> Floats:
    """(..., k) of x (..., T) with a table (T, k)."""
    return np.asarray((x.reshape(-1, x.shape[-1]) @ table).reshape(*x.shape[:-1], -1))


def _real_factors(table: Complexes) -> Floats:
    """(..., 2 T, k) what real and imaginary parts of terms in turn give of the real parts of outputs (..., T, k)."""
    parts = np.stack([table.real, -table.imag], axis=-2)
    return parts.reshape(*table.shape[:-2], -1, table.shape[-1])


def _sums(waves: Sequence[Waves], possible: Sequence[_Pairs], found: Search) -> Iterator[tuple[_Sums, _Intervals]]:
    """What is searched of the pairs that are left, some at a time; what is known rises between."""
    waiting: list[tuple[Waves, _Pairs]] = []
    room = VALUES_AT_ONCE
    for part, pairs in zip(waves, possible, strict=True):
        above = pairs.some(pairs.bound > found.limit(pairs.key))
        of_pair, first = part.power.size * (1 if found.squares is None else part.table.shape[-1]), 0
        while first < above.row.size:
            last = first + max(1, room // of_pair)
            waiting.append((part, above.some(slice(first, last))))
            room -= waiting[-1][1].row.size * of_pair
            first = last
            if room < of_pair:
                yield _Sums.of(waiting, found)
                waiting, room = [], VALUES_AT_ONCE
    if waiting:
        yield _Sums.of(waiting, found)


@dataclass(frozen=True)
class _Intervals:
    """Parts of segments on which a function may be larger than any value known."""

    function: Ints  # (n,)
    begin: Floats  # (n,) share of the segment
    length: Floats  # (n,) as such a share
    bound: Floats  # (n,) no value on the interval is larger, round-off apart

    def some(self, which: Bools | Ints | slice) -> _Intervals:
        """Some of the intervals."""
        return _Intervals(self.function[which], self.begin[which], self.length[which], self.bound[which])


@dataclass(frozen=True)
class _Sums:
    """F functions on some of G segments: P sums of up to B terms, each of which is a function, or of which several are
    squared for one. Shorter sums are filled up with zeros."""

    rate: Complexes  # (G, B) exponents times the lengths
    power: Ints  # (G, B)
    growth: Floats  # (G, B) of the functions, see `Waves`
    time: Floats  # (G,) when segments begin, s
    length: Floats  # (G,) s
    segment: Ints  # (F,)
    key: Ints  # (F,) see `Search`
    sign: Floats  # (F,) of the squares
    first: Ints | None  # (F + 1,) first sum of each function, where sums are squared
    coefficient: Complexes  # (P, B)

    @classmethod
    def of(cls, waiting: Sequence[tuple[Waves, _Pairs]], found: Search) -> tuple[_Sums, _Intervals]:
        """Those of pairs, on whole parts of segments."""
        longest = max(waves.power.size for waves, _ in waiting)
        parts, begun = [], 0
        for waves, pairs in waiting:
            parts.append(cls._of_waves(waves, pairs, found, longest))
            parts[-1][0].segment[:] += begun
            begun += parts[-1][0].time.size
        sums, intervals = zip(*parts, strict=True)
        count = None if found.squares is None else [np.diff(each.first) for each in sums]
        whole = _joined(intervals)
        first = None if count is None else np.cumsum(np.append(0, np.concatenate(count)))
        return replace(_joined(sums), first=first), replace(whole, function=np.arange(whole.bound.size))

    @classmethod
    def _of_waves(cls, waves: Waves, pairs: _Pairs, found: Search, longest: int) -> tuple[_Sums, _Intervals]:
        """The same of one contact state."""
        rows, at = np.unique(pairs.row, return_inverse=True)
        rate, growth, largest = waves.functions(rows)
        begun = waves.amplitudes(rows)[:, waves.source] * largest[:, waves.basis]
        sign, output = found.sign(pairs.key), pairs.key % found.every.size
        if found.squares is None:
            first, owner, column, factor = None, at, np.searchsorted(waves.output, output), sign[:, None]
        else:
            count = np.diff(np.append(found.squares, waves.table.shape[-1]))[output]
            first = np.append(0, np.cumsum(count))
            owner, factor = np.repeat(at, count), np.ones(1)
            column = np.repeat(found.squares[output] - first[:-1], count) + np.arange(owner.size)
        table = waves.table[:, column].T if waves.table.ndim == 2 else waves.table[rows[owner], :, column]
        coefficient = np.zeros((owner.size, longest), dtype=complex)
        np.add.at(coefficient.T, waves.basis, (begun[owner] * (factor * table)).T)
        pad = ((0, 0), (0, longest - waves.power.size))
        begin, length = waves.begin[pairs.row], (waves.end - waves.begin)[pairs.row]
        sums = cls(
            np.pad(rate, pad), np.pad(np.broadcast_to(waves.power, rate.shape), pad), np.pad(growth, pad),
            waves.time[rows], waves.length[rows], at, pairs.key, sign, first, coefficient,
        )  # fmt: skip
        return sums, _Intervals(at, begin, length, pairs.bound)

    @cached_property
    def factors(self) -> Floats:
        """(P, 2 B) of the real and imaginary parts of the terms."""
        return np.conj(self.coefficient).view(float)

    @cached_property
    def sizes(self) -> Floats:
        """(P, B) of the coefficients."""
        return np.abs(self.coefficient)

    def sums_of(self, functions: Ints) -> _Members:
        """The sums of some functions."""
        if self.first is None:
            return _Members(functions, np.arange(functions.size), None, self.sign[functions, None])
        count = self.first[functions + 1] - self.first[functions]
        begin = np.cumsum(count) - count
        owner = np.repeat(np.arange(functions.size), count)
        number = self.first[functions][owner] + np.arange(owner.size) - begin[owner]
        return _Members(number, owner, begin, self.sign[functions, None])


@dataclass(frozen=True)
class _Members:
    """The sums of n functions, N of them."""

    number: Ints  # (N,) of the sums
    owner: Ints  # (N,) which of the functions
    begin: Ints | None  # (n,) where the sums of each begin, where they are squared
    sign: Floats  # (n, 1) of the squares

    def added(self, x: Floats) -> Floats:
        """(n, ...) sums over the members of each function."""
        return x if self.begin is None else np.add.reduceat(x, self.begin, axis=0)

    def value(self, x: Floats) -> Floats:
        """(n, ...) functions, from the sums x (N, ...)."""
        return x if self.begin is None else 0.5 * self.sign * self.added(x * x)

    def slope(self, x: Floats, dx: Floats) -> Floats:
        """Their first derivatives."""
        return dx if self.begin is None else self.sign * self.added(x * dx)

    def curve(self, x: Floats, dx: Floats, ddx: Floats) -> Floats:
        """Their second derivatives."""
        return ddx if self.begin is None else self.sign * self.added(dx * dx + x * ddx)

    def fourth(self, bound: Callable[[int], Floats]) -> Floats:
        """Bounds on their fourth derivatives, from those on the derivatives of an order of the sums (Leibniz)."""
        if self.begin is None:
            return bound(4)
        N = [self.length(bound(order)) for order in range(5)]
        return N[0] * N[4] + 4.0 * N[1] * N[3] + 3.0 * N[2] ** 2

    def length(self, x: Floats) -> Floats:
        """(n, ...) Euclidean lengths of the sums of each function, or sizes."""
        return x if self.begin is None else np.sqrt(self.added(x * x))

    def beside(self, bound: Floats, aside: Floats) -> Floats:
        """Bounds on functions from those on a part of the sums, and the length of the rest, which is not zero."""
        if self.begin is None:
            return bound + aside
        root, rest = np.sqrt(np.maximum(self.sign * bound, 0.0)), math.sqrt(0.5) * aside
        return np.where(self.sign > 0.0, (root + rest) ** 2, -(np.maximum(root - rest, 0.0) ** 2))

    def noise(self, x: Floats, noise: Floats) -> Floats:
        """Round-off of functions, from bounds on the sums, and their round-off."""
        return noise if self.begin is None else self.length(noise) * (self.length(x) + 0.5 * self.length(noise))


@dataclass
class Search:
    """The largest values of K outputs, and of their negatives, that are known in W windows.

    They are values that are reached, and no other is beyond them by more than `TOLERANCE` of their size; of sums of
    squares of that of their largest value. ``key`` is the sign (0, 1), then the window, then the output, in one number.
    """

    value: Floats  # (2 W K,)
    when: Floats  # (2 W K,) s
    shared: Ints  # (2 W K,) number of the limit that an output shares with others
    top: Floats  # by such a number, the largest value
    peak: Floats  # ... above which it has to be; a point near a maximum may be none, and is searched around
    every: Ints  # (K,)
    windows: int
    squares: Ints | None
    evaluations: int = 0

    @classmethod
    def of(cls, outputs: int, windows: int = 1, share: Ints | None = None, squares: Ints | None = None) -> Search:
        """A search in which nothing is known.

        Parameters
        ----------
        outputs : number K.
        windows : number W.
        share : (K,) of outputs with equal numbers only the largest and the smallest value of all is sought: the others
            keep what was met on the way.
        squares : (K,) first of each group of consecutive outputs, where half the sums of their squares are asked for;
            `Waves` hold all of them.
        """
        count = outputs if squares is None else squares.size
        share = np.arange(count) if share is None else share
        limits = int(share.max(initial=-1)) + 1
        shared = (limits * np.arange(2 * windows)[:, None] + share).ravel()
        lowest = np.full(2 * windows * limits, -np.inf)
        return cls(
            np.full(shared.size, -np.inf), np.full(shared.size, np.nan), shared, lowest, lowest.copy(),
            np.arange(count), windows, squares,
        )  # fmt: skip

    def add(self, waves: Sequence[Waves]) -> None:
        """Look at parts of a motion together; windows do not decrease in any of them.

        Raises
        ------
        Stopped
            Where a stop is requested.
        """
        possible = [_Pairs.of(part, self) for part in waves]
        for sums, intervals in _sums(waves, possible, self):
            self._search(sums, intervals)

    def extrema(self) -> Extrema:
        """What is known; infinite in windows of which nothing is."""
        high, low = self.value.reshape(2, self.windows, -1)
        when_high, when_low = self.when.reshape(2, self.windows, -1)
        return Extrema(-low, when_low, high, when_high, self.evaluations)

    def key(self, sign: int, window: Ints, output: Ints) -> Ints:
        """Of outputs in windows, of their negatives where ``sign`` is 1."""
        return np.asarray((sign * self.windows + window) * self.every.size + output)

    def sign(self, key: Ints) -> Floats:
        """1, or -1 where the negative is meant."""
        return np.where(key < self.value.size // 2, 1.0, -1.0)

    def limit(self, key: Ints) -> Floats:
        """What a value would have to exceed."""
        return np.asarray(np.maximum(self.top, self.peak)[self.shared[key]])

    def bounds(self, values: Floats, over: Floats) -> tuple[Floats, Floats, Floats]:
        """Functions (n, points, K), no value of which exceeds (n, K) between the points, and none is below (n, K).

        Parameters
        ----------
        values, over : (n, points, k) outputs, and (n, points - 1, k) how far they may leave straight lines.
        """
        if self.squares is None:
            upper = (np.maximum(values[:, :-1], values[:, 1:]) + over).max(axis=1)
            return values, upper, (np.minimum(values[:, :-1], values[:, 1:]) - over).min(axis=1)

        added = partial(np.add.reduceat, indices=self.squares, axis=2)

        squares, aside = 0.5 * added(values**2), np.sqrt(0.5 * added(over**2))
        along = np.diff(values, axis=1)
        slope, square = added(values[:, :-1] * along), added(along**2)
        share = np.clip(-slope / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
        least = np.sqrt(np.maximum(squares[:, :-1] + share * (slope + 0.5 * share * square), 0.0))
        most = np.sqrt(np.maximum(squares[:, :-1], squares[:, 1:])) + aside
        return squares, (most**2).max(axis=1), (np.maximum(least - aside, 0.0) ** 2).min(axis=1)

    def reach(self, key: Ints, value: Floats, time: Floats) -> None:
        """Values at times are reached."""
        self.evaluations += value.size
        better = (value > self.value[key]).nonzero()[0]
        if better.size:
            key, value, time = key[better], value[better], time[better]
            best = np.lexsort((-time, value))  # the last of a key stays: its largest, the earliest of these
            self.value[key[best]], self.when[key[best]] = value[best], time[best]
            np.maximum.at(self.top, self.shared[key], value)

    def reach_block(self, key: Ints, value: Floats, time: Floats) -> None:
        """Values (n, points, k) at times (n, points), of keys (n, k) that come in runs of equal ones."""
        self.evaluations += value.shape[0] * (value.shape[1] - 1) * value.shape[2]
        most = value.max(axis=1)
        run = np.flatnonzero(np.append(True, key[1:, :1] != key[:-1, :1]))
        best = np.maximum.reduceat(most, run, axis=0)
        owner = np.cumsum(np.append(0, key[1:, 0] != key[:-1, 0]))
        row, column = np.nonzero((most == best[owner]) & (most > self.value[key]))
        point = value[row, :, column].argmax(axis=1)
        self.reach(key[row, column], most[row, column], time[row, point])

    def reach_zero(self, waves: Waves) -> None:
        """Outputs that the waves leave out are zero."""
        rest = np.setdiff1d(self.every, waves.output) if self.squares is None else self.every[:0]
        window, first = np.unique(waves.window, return_index=True)
        begin = waves.time[first] + waves.begin[first] * waves.length[first]
        for sign in (0, 1) if rest.size else ():
            key = self.key(sign, window[:, None], rest)
            self.reach(key.ravel(), np.zeros(key.size), np.repeat(begin, rest.size))

    def _search(self, sums: _Sums, intervals: _Intervals) -> None:
        """Raise what is known to the largest values of functions on intervals."""
        at_once = max(1, VALUES_AT_ONCE // (10 * PARTS * max(1, sums.power.shape[1])))
        waiting = [intervals]
        while waiting:  # the latest first, so that large values become known early
            check_stop()
            block = waiting.pop()
            block = block.some(block.bound > self.limit(sums.key[block.function]))
            if block.function.size > AT_ONCE:
                first = self._first(sums, block, at_once)
                waiting.append(block.some(~first))
                block = block.some(first)
            if block.function.size:
                waiting.append(self._divide(sums, block))

    def _first(self, sums: _Sums, of: _Intervals, most: int) -> Bools:
        """(n,) the intervals to go on with: of each limit those with the largest bounds, and few without a peak."""
        limit = self.shared[sums.key[of.function]]
        by_limit = np.lexsort((-of.bound, limit))
        begins = np.flatnonzero(np.append(True, limit[by_limit[1:]] != limit[by_limit[:-1]]))
        rank = np.empty(limit.size, dtype=np.int64)
        rank[by_limit] = np.arange(limit.size) - np.repeat(begins, np.diff(np.append(begins, limit.size)))
        first = np.zeros(limit.size, dtype=bool)
        first[np.argsort(rank, kind="stable")[:most]] = True
        if np.isinf(self.peak[limit]).any():
            first &= rank < FEW
        return first

    def _divide(self, sums: _Sums, of: _Intervals) -> _Intervals:
        """The parts of intervals that may still hold a larger value."""
        parts = min(MOST_PARTS, max(PARTS, PARTS_TOGETHER // of.function.size))
        members, grid, at = sums.sums_of(of.function), *_Grid.of(sums, of, parts)
        at = at[members.owner]
        factors, sizes = sums.factors[members.number], sums.sizes[members.number]

        def times(table: Floats, with_: Floats = factors) -> Floats:
            """(N, points) of the sums."""
            return np.asarray(np.matmul(table[at], with_[:, :, None])[:, :, 0])

        near = [times(_real(grid.near(order))) for order in (0, 1)]
        error = members.fourth(lambda order: times(grid.bound(order) * ~grid.too_far, sizes))
        value, slope = members.value(near[0]), members.slope(*near)
        cubic = Cubic(value[:, :-1], value[:, 1:], slope[:, :-1], slope[:, 1:])
        top, place = cubic.top()
        bound, rules_out = top + error / 384.0, cubic.climbs(SLOPE * error)
        if grid.too_far.any():
            rest = times(grid.bound(0) * grid.too_far, sizes)
            bound = members.beside(bound, members.length(rest))
            rules_out &= members.length(rest) == 0.0
            whole = [x + times(_real(grid.far(order))) for order, x in enumerate(near)]
            value, slope = members.value(whole[0]), members.slope(*whole)
        length = of.length / parts
        begin = of.begin[:, None] + length[:, None] * np.arange(parts + 1)
        self.evaluations += value.size - value.shape[0]
        row, best = np.arange(of.function.size), value.argmax(axis=1)
        self._reach(sums, of, value[row, best], begin[row, best])
        noise = members.noise(times(grid.bound(0).max(axis=1, keepdims=True), sizes), times(grid.noise, sizes))
        bound = np.minimum(bound - noise, of.bound[:, None])
        row, part = np.nonzero((bound > self.limit(sums.key[of.function])[:, None]) & ~rules_out)
        left = _Intervals(of.function[row], begin[row, part], length[row], bound[row, part])
        if not row.size:
            return left
        bend = self._bend(sums, left, grid, at if members.begin is None else at[members.begin], row, part)
        peak = (bend < 0.0) & (slope[row, part] > 0.0) & (slope[row, part + 1] < 0.0)
        if peak.any():
            self._climb(sums, left.some(peak), place[row, part][peak])
        return left.some((bend >= 0.0) & (left.length > EPS * (np.abs(left.begin) + left.length)))

    def _bend(self, sums: _Sums, left: _Intervals, grid: _Grid, at: Ints, row: Ints, part: Ints) -> Floats:
        """(n,) largest second derivative on parts of intervals, ``at`` the rows of the grid."""
        members = sums.sums_of(left.function)
        which, part, number = at[row][members.owner], part[members.owner], members.number
        coefficient, sizes = sums.coefficient[number], sums.sizes[number]

        def curve(point: Ints) -> Floats:
            terms = (coefficient * of_order[which, point] for of_order in grid.derivatives)
            return members.curve(*(x.real.sum(axis=1, keepdims=True) for x in terms))

        fourth = members.fourth(lambda order: (sizes * grid.bound(order)[which, part]).sum(axis=1, keepdims=True))
        return np.asarray((np.maximum(curve(part), curve(part + 1)) + fourth / 8.0)[:, 0])

    def _reach(self, sums: _Sums, of: _Intervals, value: Floats, at: Floats) -> None:
        """Values (n,) of functions on intervals, at shares (n,) of their segments."""
        segment = sums.segment[of.function]
        self.reach(sums.key[of.function], value, sums.time[segment] + at * sums.length[segment])

    def _climb(self, sums: _Sums, of: _Intervals, place: Floats) -> None:
        """Maxima of functions that are concave on intervals and rise where these begin, fall where they end."""
        low, high = of.begin, of.begin + of.length
        at = low + place * of.length
        for _ in range(STEPS):
            at = np.where((at > low) & (at < high), at, 0.5 * (low + high))
            members = sums.sums_of(of.function)
            segment = sums.segment[of.function][members.owner]
            u, rate = at[members.owner, None], sums.rate[segment]
            turned, one = np.exp(rate * u - sums.growth[segment]), np.ones(())
            terms = _derivatives(turned, rate, u, one, sums.power[segment])
            x = [(sums.coefficient[members.number] * d).real.sum(axis=1)[:, None] for d in terms]
            value, slope, curve = (f[:, 0] for f in (members.value(x[0]), members.slope(*x[:2]), members.curve(*x)))
            self._reach(sums, of, value, at)
            low, high = np.where(slope > 0.0, at, low), np.where(slope > 0.0, high, at)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = -slope / curve
            key, converged = sums.key[of.function], np.abs(step) <= CONVERGED * of.length
            self._peaks(key[converged], value[converged])
            above = value + np.abs(slope) * (high - low) > self.limit(key)  # no value is above a tangent
            going = (above & ~converged).nonzero()[0]
            if not going.size:
                break
            of, low, high, at = of.some(going), low[going], high[going], at[going] + step[going]

    def _peaks(self, key: Ints, value: Floats) -> None:
        """Values where the slope is zero; others that exceed them by less than the tolerance do not count."""
        shared = self.shared[key]
        scale = np.abs(value) if self.squares is None else self.top[shared % (self.top.size // 2)]
        np.maximum.at(self.peak, shared, value + TOLERANCE * scale)


@dataclass(frozen=True)
class _Grid:
    """Terms at the ends of the parts of U different intervals; the length of a part is the unit of time."""

    derivatives: tuple[Complexes, Complexes, Complexes]  # (U, points, B) of orders 0 to 2
    angle: Floats  # (U, 1, B) size of the exponents
    power: Ints  # (U, 1, B)
    share: Floats  # (U, parts) of a part in the time since the segment began
    size: Floats  # (U, parts, B) largest size of the terms
    noise: Floats  # (U, 1, B) round-off, on all parts
    too_far: Bools  # (U, 1, B) terms that turn too far on a part to be bounded by a cubic

    @classmethod
    def of(cls, sums: _Sums, intervals: _Intervals, parts: int) -> tuple[_Grid, Ints]:
        """For some intervals, and which one (n,) each of them is."""
        segment = sums.segment[intervals.function]
        first, at = _different(segment, intervals.begin, intervals.length)
        segment, begin, step = segment[first], intervals.begin[first, None], intervals.length[first, None] / parts
        rate, power = sums.rate[segment], sums.power[segment]
        turn, place = rate * step, begin + step * np.arange(parts + 1)
        turned = powers(np.exp(rate * begin - sums.growth[segment]), np.exp(turn), parts)
        derivatives = _derivatives(turned, turn[:, None], place[:, :, None], step[:, :, None], power[:, None])
        size, angle = np.abs(turned), np.abs(turn)[:, None]
        furthest = np.maximum(np.abs(place[:, 1:]), np.abs(place[:, :-1]))
        size = np.maximum(size[:, :-1], size[:, 1:]) * furthest[:, :, None] ** power[:, None]
        share = step / furthest
        noise = 4.0 * EPS * size.max(axis=1) * (8.0 + power + np.abs(rate) * furthest.max(axis=1, keepdims=True))
        return cls(derivatives, angle, power[:, None], share, size, noise[:, None], angle > FARTHEST), at

    def bound(self, order: int) -> Floats:
        """(U, parts, B) on the derivatives of an order of all terms."""
        return np.asarray(self.size * derivative_bound(order, self.angle, self.power, self.share))

    def near(self, order: int) -> Complexes:
        """(U, points, B) terms that do not turn too far, or derivatives."""
        of_order = self.derivatives[order]
        return np.where(self.too_far, 0.0, of_order) if self.too_far.any() else of_order

    def far(self, order: int) -> Complexes:
        """(U, points, B) the others."""
        return np.where(self.too_far, self.derivatives[order], 0.0)


def _derivatives(
    turned: Complexes, rate: Complexes, place: Floats, step: Any, power: Ints
) -> tuple[Complexes, Complexes, Complexes]:
    """``place^power turned`` and its first two derivatives by the time in units of ``step``, ``turned`` having the
    derivative ``rate turned``."""
    if not power.any():
        return turned, rate * turned, rate * (rate * turned)
    zero, one, two = (turned * place ** np.maximum(power - k, 0) for k in range(3))
    one, two = step * power * one, step * step * (power * (power - 1)) * two
    return zero, rate * zero + one, rate * (rate * zero + 2.0 * one) + two


def _joined(parts: Sequence[_Arrays]) -> _Arrays:
    """Data classes of arrays, one after the other."""
    names = [f.name for f in fields(parts[0]) if getattr(parts[0], f.name) is not None]
    return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _different(*keys: Floats | Ints) -> tuple[Ints, Ints]:
    """Where each of the different tuples of keys (n,) comes first, and which of them each is."""
    order = np.lexsort(keys)
    new = np.ones(order.size, dtype=bool)
    new[1:] = np.logical_or.reduce([key[order[1:]] != key[order[:-1]] for key in keys])
    at = np.empty(order.size, dtype=np.int64)
    at[order] = np.cumsum(new) - 1
    return order[new], at


def _real(z: Complexes) -> Floats:
    """(U, points, 2 B) real and imaginary parts of terms (U, points, B)."""
    return np.ascontiguousarray(z).view(float)
