r"""Largest and smallest values, and all turning points, of outputs of a motion in closed form: one certified search.

On a segment of length H an output is a sum of terms :math:`\mathrm{Re}\, c\, u^p e^{\lambda H u}`, with the time u on
the segment over its length. An interval of length h is looked at by the values and slopes at its ends. The sizes of the
terms bound the fourth derivative, and so how far the output leaves the cubic through them:

.. math:: h^4 \max|f''''| / 384, \quad \text{and its slope that of the cubic:}\quad \sqrt 3\, h^3 \max|f''''| / 216

(Hermite interpolation; the kernels of its error by Peano). Terms that turn too far on the interval to be part of the
cubic are bounded by their sizes. Intervals on which no value can exceed the largest one known are left out, the others
divided: about the top of the cubic where the true one is certain to be near it, else in equal parts. The smallest value
is the largest one of the negative.

Half the sum of the squares of outputs, such as an energy, is searched in the same way: the bounds on the outputs bound
it and its derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import GROWTH
from beamsim.flow.cubic import Cubic
from beamsim.flow.stopping import check_stop
from beamsim.typing import Bools, Complexes, Floats, Ints

TOLERANCE = 1e-10  # relative distance below which two peaks of an output count as equal
PARTS = 4  # of an interval
NEAR = 1.0 / 32.0  # of an interval, from the top of the cubic to the ends of the parts about it
FARTHEST = 3.0  # rad, that a term may turn on an interval to be part of the cubic
VALUE, SLOPE = 1.0 / 384.0, math.sqrt(3.0) / 216.0  # errors of a cubic and of its slope, over the fourth derivative
AT_ONCE = 400_000
EPS = float(np.finfo(float).eps)


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

    def rates(self, rows: Ints) -> Complexes:
        """(m, B) exponents times the lengths of some segments; 0 where what rests would grow beyond all numbers."""
        rate = self.exponent * self.length[rows, None]
        return np.where(rate.real < GROWTH, rate, 0.0)

    def coefficients(self, rows: Ints) -> tuple[Complexes, Floats]:
        """(m, T) amplitudes of the terms on some segments, for times as shares of these, and their round-off."""
        scale = self.length[rows, None] ** self.power if self.power.any() else np.ones((1, self.power.size))
        amplitude, noise = self.amplitudes(rows)
        return amplitude[:, self.source] * scale[:, self.basis], noise[:, self.source] * scale[:, self.basis]

    def sums(self, rows: Ints, different: Ints, interval: Ints) -> _Sums:
        """All outputs on some parts, of which those named are different in length, and which of them each is like."""
        rate, table = self.rates(rows[different]), self.table if self.table.ndim == 2 else self.table[rows]
        power = np.broadcast_to(self.power, rate.shape)
        return _Sums(rate, power, interval, self.basis, *self.coefficients(rows), table, np.abs(table))

    def at_ends(self) -> Floats:
        """(n, 2) the only output where the parts begin and end, limits from within."""
        rows = np.arange(self.time.size)
        sums = self.sums(rows, rows, rows)
        return np.stack([sums.at(rows, self.begin), sums.at(rows, self.end)], axis=1)

    def one_each(self, rows: Ints, columns: Ints) -> tuple[Complexes, Floats]:
        """(m, B, c) coefficients of the functions in some outputs (m, c) on each of some parts, and their round-off."""
        if self.table.ndim == 2:
            table = self.table.T[columns].transpose(0, 2, 1)
        else:
            table = np.take_along_axis(self.table[rows], columns[:, None], axis=2)
        shape, (amplitude, noise) = (self.power.size, rows.size, columns.shape[1]), self.coefficients(rows)
        out, round_off = np.zeros(shape, dtype=complex), np.zeros(shape)
        np.add.at(out, self.basis, (amplitude[:, :, None] * table).swapaxes(0, 1))
        np.add.at(round_off, self.basis, (noise[:, :, None] * np.abs(table)).swapaxes(0, 1))
        return out.swapaxes(0, 1), round_off.swapaxes(0, 1)

    def blocks(self, values: int) -> Iterator[Ints]:
        """Some of the parts after the other, of which each takes so many values."""
        at_once = max(1, AT_ONCE // values)
        for first in range(0, self.time.size, at_once):
            check_stop()
            yield np.arange(first, min(first + at_once, self.time.size))


@dataclass(frozen=True)
class Extrema:
    """Extreme values of K outputs in W windows and their times, s."""

    low: Floats  # (W, K)
    when_low: Floats
    high: Floats
    when_high: Floats
    evaluations: int  # of an output at one time


class _Sums(NamedTuple):
    """Outputs on n intervals, as sums of T terms of the functions ``u^power exp(rate u)`` of U of them that differ."""

    rate: Complexes  # (U, B)
    power: Ints  # (U, B)
    interval: Ints | slice  # (n,) of these
    basis: Ints  # (T,) function of each term
    amplitude: Complexes  # (n, T), or (1, 1)
    noise: Floats  # of the amplitudes
    table: Complexes  # (T, k), or (n, T, k)
    sizes: Floats  # that the noise is multiplied by

    def of(self, functions: Complexes) -> Floats:
        """(n, points, k) from functions (U, points, B)."""
        terms = functions[self.interval].take(self.basis, axis=2) * self.amplitude[:, None]
        factors = np.stack([self.table.real, -self.table.imag], axis=-2)
        return _product(terms.view(float), factors.reshape(*self.table.shape[:-2], -1, self.table.shape[-1]))

    def bound(self, sizes: Floats) -> Floats:
        """(n, points, k) the most that they are, from sizes of the functions (U, points, B)."""
        return _product(
            sizes[self.interval].take(self.basis, axis=2) * np.abs(self.amplitude)[:, None], np.abs(self.table)
        )

    def on_parts(self, u: Floats) -> tuple[Complexes, Floats, Floats, Floats, Floats]:
        """What the functions are on parts with ends u (U, parts + 1).

        Returns
        -------
        exponentials, raised : (U, parts + 1, B) whose products are the values of the functions at the ends.
        size : (U, parts, B) the most that they are on each part.
        turn : (U, parts, B) how far they turn there, rad.
        share : (U, parts, 1) each part over its end that is farthest from zero.
        """
        rate, step = self.rate[:, None], np.diff(u)[:, :, None]
        far_end = np.maximum(np.abs(u[:, 1:]), np.abs(u[:, :-1]))
        size = np.exp(rate.real * u[:, :, None])
        size = np.maximum(size[:, 1:], size[:, :-1]) * _raised(far_end, self.power)
        share = step / np.where(far_end > 0.0, far_end, 1.0)[:, :, None]
        return np.exp(rate * u[:, :, None]), _raised(u, self.power), size, np.abs(rate) * step, share

    def chords(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """(n, 2, k) values at both ends of parts (U, 2), (n, k) how far they may be from the chords, and round-off.

        A term leaves its chord by less than an eighth of its largest curvature, and by less than twice its size.
        """
        exponentials, raised, size, turn, share = self.on_parts(u)
        curve = derivative_bound(2, turn, self.power[:, None], share)
        beyond = self.bound(size * np.minimum(0.125 * curve, 2.0))
        return self.of(exponentials * raised), beyond[:, 0], self.round_off(size, u)[:, 0]

    def round_off(self, size: Floats, u: Floats) -> Floats:
        """(n, 1, k) that of the functions, of sizes (U, parts, B) on parts with ends u, and of the amplitudes."""
        most = size.max(axis=1, keepdims=True)
        cancelling = 8.0 + self.power[:, None] + np.abs(self.rate * np.abs(u).max(axis=1, keepdims=True))[:, None]
        of_amplitudes = most[self.interval].take(self.basis, axis=2) * self.noise[:, None]
        return self.bound(4.0 * EPS * cancelling * most) + _product(of_amplitudes, self.sizes)

    def at(self, row: Ints, u: Floats) -> Floats:
        """(m,) those of some rows (m,), of one output each, at one time u (m,) each."""
        which = np.arange(self.rate.shape[0])[self.interval][row]
        functions = np.exp(self.rate[which] * u[:, None]) * _raised(u[:, None], self.power[which])[:, 0]
        table = self.table[:, 0] if self.table.ndim == 2 else self.table[row, :, 0]
        amplitude = np.broadcast_to(self.amplitude, (self.amplitude.shape[0], table.shape[-1]))
        return np.asarray((functions[:, self.basis] * amplitude[row % amplitude.shape[0]] * table).real.sum(axis=1))


def _raised(u: Floats, power: Ints) -> Floats:
    """(n, points, T) times u (n, points) to powers (n, T); (1, 1, 1) where all powers are zero."""
    if not power.any():
        return np.ones((1, 1, 1))
    powers = u[:, :, None] ** np.arange(power.max(initial=0) + 1)
    which = np.broadcast_to(power[:, None], (*u.shape, power.shape[1]))
    return np.take_along_axis(powers, which, axis=2)


def _product(x: Floats, table: Floats) -> Floats:
    """(n, points, k) of x (n, points, T) with a table (T, k), or (n, T, k)."""
    if table.ndim == 3:
        return np.asarray(x @ table)
    return np.asarray((x.reshape(-1, x.shape[-1]) @ table).reshape(*x.shape[:-1], -1))


class _Squares(NamedTuple):
    """Half the sums of squares of consecutive outputs, in groups that begin with those of numbers ``first`` (j,)."""

    first: Ints

    def added(self, x: Floats) -> Floats:
        """(..., j) sums over the outputs (..., k) of each group."""
        return np.asarray(np.add.reduceat(x, self.first, axis=-1))

    def length(self, x: Floats) -> Floats:
        """(..., j) Euclidean lengths."""
        return np.sqrt(self.added(x * x))

    def chords(self, ends: Floats, beyond: Floats, noise: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Half the sums of squares at both ends (n, 2, j), bounds on them (n, j) from below and above, and round-off.

        Parameters
        ----------
        ends, beyond, noise : of the outputs, see `_Sums.chords`.
        """
        length, beyond, noise = self.length(ends), self.length(beyond), self.length(noise)
        apart = self.length(ends[:, 1] - ends[:, 0])
        # the chord in the space of the outputs comes no nearer to zero than this
        low = np.maximum(0.5 * (length.sum(axis=1) - apart) - beyond, 0.0)
        high = length.max(axis=1) + beyond
        return 0.5 * length**2, 0.5 * low**2, 0.5 * high**2, noise * (high + 0.5 * noise)


class _Look(NamedTuple):
    """What the ends of the parts of n intervals tell about j functions; derivatives are in units of the parts."""

    u: Floats  # (n, parts + 1)
    whole: Floats  # (n, parts + 1, j)
    value: Floats  # (n, parts + 1, j) of the terms that do not turn too far on a part
    begins: Floats  # (n, parts, j) their slopes where parts begin
    ends: Floats  # (n, parts, j) ... and end
    fourth: Floats  # (n, parts, j) bound on the fourth derivative
    aside: Floats  # (n, parts, j) bound on the other terms, or the length of them where they are squared
    noise: Floats  # (n, 1, j) round-off

    @classmethod
    def at(cls, sums: _Sums, u: Floats, squares: _Squares | None) -> _Look:
        """At times u (U, parts + 1), as shares of the segments."""
        rate, power, step = sums.rate[:, None], sums.power[:, None], np.diff(u)[:, :, None]
        exponentials, raised, size, turn, share = sums.on_parts(u)
        terms = exponentials * raised
        rise = rate * terms
        if power.any():
            rise = rise + power * _raised(u, np.maximum(sums.power - 1, 0)) * exponentials
        noise, whole, aside = sums.round_off(size, u), sums.of(terms), np.zeros((1, 1, 1))
        far = turn.max(axis=1, keepdims=True) > FARTHEST
        if far.any():
            aside = sums.bound(far * size)
            terms, rise, size = (np.where(far, 0.0, x) for x in (terms, rise, size))
        value, slope, u, step = (
            sums.of(terms) if far.any() else whole,
            sums.of(rise),
            u[sums.interval],
            step[sums.interval],
        )

        def bound(order: int) -> Floats:
            """On the derivatives of an order."""
            return sums.bound(size * derivative_bound(order, turn, power, share))

        if squares is None:
            fourth = bound(4)
        else:
            N = [squares.length(bound(order)) for order in range(5)]
            fourth = N[0] * N[4] + 4.0 * N[1] * N[3] + 3.0 * N[2] ** 2
            slope, noise = squares.added(value * slope), squares.length(noise)
            aside = squares.length(aside) if far.any() else aside
            value, whole = 0.5 * squares.added(value**2), 0.5 * squares.added(whole**2)
            noise = noise * ((N[0] + aside).max(axis=1, keepdims=True) + 0.5 * noise)
        return cls(u, whole, value, slope[:, :-1] * step, slope[:, 1:] * step, fourth, aside, noise)


def derivative_bound(order: int, angle: Floats, power: Ints, share: Floats) -> Floats:
    """Largest derivative of ``u^p exp(rate u)`` in units of a step, over the largest size there (Leibniz).

    Parameters
    ----------
    order : of the derivative.
    angle : (n, parts, T) size of the rates times the step.
    power : (n, 1, T) p.
    share : (n, parts, 1) the step over the largest u.

    Returns
    -------
    (n, parts, T).
    """
    rising = [np.ones(()), *np.cumprod(np.broadcast_to(angle, (order, *angle.shape)), axis=0)]
    bound = rising[order]
    falling, chosen = power.astype(float), 1.0
    for i in range(1, min(order, int(power.max(initial=0))) + 1):
        chosen *= (order - i + 1) / i
        bound = bound + chosen * falling * share**i * rising[order - i]
        falling = falling * np.maximum(power - i, 0)
    return np.asarray(bound)


@dataclass(frozen=True)
class _Intervals:
    """Parts of segments on which a function may be larger than any value known."""

    wave: Ints  # (n,)
    row: Ints  # (n,) of its parts
    key: Ints  # (n,) of the function, see `Search`
    begin: Floats  # (n,) share of the segment
    length: Floats  # (n,) as such a share
    bound: Floats  # (n,) no value on the interval is larger, round-off apart
    reached: Floats  # (n,) the larger value at its ends
    top: Floats  # (n,) where it is largest, as a share of the interval; nan where that is not certain

    def some(self, which: Bools | Ints | slice) -> _Intervals:
        """Some of the intervals."""
        return _Intervals(*(getattr(self, f.name)[which] for f in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[_Intervals]) -> _Intervals:
        """All of them, one after the other."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def divided(self) -> Floats:
        """(n, PARTS + 1) ends of their parts."""
        middle = np.clip(np.nan_to_num(self.top), 2.0 * NEAR, 1.0 - 2.0 * NEAR)[:, None]
        about = np.hstack([0.0 * middle, middle - NEAR, middle, middle + NEAR, 0.0 * middle + 1.0])
        place = np.where(np.isnan(self.top)[:, None], np.linspace(0.0, 1.0, PARTS + 1), about)
        return np.asarray(self.begin[:, None] + self.length[:, None] * place)


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
    windows: int  # W
    outputs: int  # K
    squares: _Squares | None
    turns: list[tuple[Ints, Ints, Floats, Floats]] | None = None  # see `turning_points`, where all are sought
    evaluations: int = 0

    @classmethod
    def of(cls, outputs: int, windows: int = 1, share: Ints | None = None, squares: Ints | None = None) -> Search:
        """A search in which nothing is known.

        Parameters
        ----------
        outputs : number of the outputs of `Waves`.
        windows : number W.
        share : (K,) of outputs with equal numbers only the largest and the smallest value of all is sought: the others
            keep what was met on the way.
        squares : (K,) first of each group of consecutive outputs, where half the sums of their squares are asked for.
        """
        count = outputs if squares is None else squares.size
        share = np.arange(count) if share is None else share
        limits = int(share.max(initial=-1)) + 1
        shared = (limits * np.arange(2 * windows)[:, None] + share).ravel()
        return cls(
            np.full(shared.size, -np.inf), np.full(shared.size, np.nan), shared,
            np.full(2 * windows * limits, np.finfo(float).min), windows, count,
            None if squares is None else _Squares(squares),
        )  # fmt: skip

    def add(self, waves: Sequence[Waves]) -> None:
        """Look at parts of a motion together.

        Raises
        ------
        Stopped
            Where a stop is requested.
        """
        if not self.outputs:
            return
        found = [piece for number, wave in enumerate(waves) for piece in self._first_look(number, wave)]
        if not found:
            return
        intervals = _Intervals.joined(found)
        order = np.lexsort((-intervals.bound, self.shared[intervals.key]))
        first = np.diff(self.shared[intervals.key[order]], prepend=-1) != 0
        self._refine(waves, intervals.some(order[first]))  # the most promising alone, so that large values become known
        self._refine(waves, intervals.some(np.sort(order[~first])))

    def extrema(self) -> Extrema:
        """What is known; infinite in windows of which nothing is."""
        high, low = self.value.reshape(2, self.windows, self.outputs)
        when_high, when_low = self.when.reshape(2, self.windows, self.outputs)
        return Extrema(-low, when_low, high, when_high, self.evaluations)

    def _sign(self, key: Ints) -> Floats:
        """1, or -1 where the negative is meant."""
        return np.where(key < self.value.size // 2, 1.0, -1.0)

    def _limit(self, key: Ints, reached: Floats) -> Floats:
        """What values have to exceed on intervals on which one is reached: where that is the largest, any better one
        counts."""
        shared, half = self.shared[key], self.top.size // 2
        top = self.top[shared]
        scale = np.abs(top if self.squares is None else self.top[shared % half])
        return np.asarray(top + np.where(reached == top, 4.0 * EPS, TOLERANCE) * scale)

    def _keys(self, wave: Waves, rows: Ints, windows: int) -> Ints:
        """(n, K) of all outputs on some parts; with W in place of no windows those of their negatives."""
        return np.asarray(self.outputs * (windows + wave.window[rows, None]) + np.arange(self.outputs))

    def _reach(self, keys: Ints, values: Floats, times: Floats) -> Floats:
        """Values (n, points, j) of functions (n, j) at times (n, points) are reached; of equal ones the first counts.

        Returns
        -------
        (n, j) the largest of them.
        """
        best = values.argmax(axis=1)
        most = np.take_along_axis(values, best[:, None], axis=1)[:, 0]
        key, value, time = keys.ravel(), most.ravel(), np.take_along_axis(times, best, axis=1).ravel()
        before = self.value[key]
        np.fmax.at(self.value, key, value)
        better = np.flatnonzero((value > before) & (value == self.value[key]))[::-1]
        self.when[key[better]] = time[better]
        np.fmax.at(self.top, self.shared[key], value)
        return most

    def _first_look(self, number: int, wave: Waves) -> Iterator[_Intervals]:
        """At all outputs on all parts of segments that their chords do not rule out."""
        turn = float(np.abs(wave.exponent).max(initial=0.0)) * float(wave.length.max(initial=0.0))
        parts = int(min(max(math.ceil(turn / FARTHEST), 1), PARTS))
        for rows in wave.blocks((parts + 1) * max(2 * wave.power.size, wave.table.shape[-1])):
            rows = rows if self.turns is not None else rows[self._beyond_chords(wave, rows)]
            if not rows.size:
                continue
            different, interval = _different(wave.length[rows], wave.begin[rows], wave.end[rows])
            begin, end = wave.begin[rows[different], None], wave.end[rows[different], None]
            sums = wave.sums(rows, different, interval)
            look = _Look.at(sums, begin + (end - begin) * np.linspace(0.0, 1.0, parts + 1), self.squares)
            time = wave.time[rows, None] + wave.length[rows, None] * look.u
            for windows in (0, self.windows):
                yield self._left(sums, look, self._keys(wave, rows, windows), time, np.full(rows.size, number), rows)

    def _beyond_chords(self, wave: Waves, rows: Ints) -> Bools:
        """(n,) on which of some parts an output may be larger than what is known; what it is at their ends becomes
        known."""
        different, interval = _different(wave.length[rows], wave.begin[rows], wave.end[rows])
        u = np.stack([wave.begin[rows], wave.end[rows]], axis=1)
        ends, beyond, noise = wave.sums(rows, different, interval).chords(u[different])
        low, high = ends.min(axis=1) - beyond, ends.max(axis=1) + beyond
        if self.squares is not None:
            ends, low, high, noise = self.squares.chords(ends, beyond, noise)
        self.evaluations += ends.size
        time, left = wave.time[rows, None] + wave.length[rows, None] * u, np.zeros(rows.size, dtype=bool)
        for windows, sign, bound in ((0, 1.0, high), (self.windows, -1.0, -low)):
            keys = self._keys(wave, rows, windows)
            reached = self._reach(keys, sign * ends, time)
            left |= (bound - noise > self._limit(keys, reached)).any(axis=1)
        return left

    def _refine(self, waves: Sequence[Waves], intervals: _Intervals) -> None:
        """Divide intervals until none may hold more than what is known."""
        most = max(1, AT_ONCE // ((PARTS + 1) * max(8, 2 * max(wave.power.size for wave in waves))))
        waiting = [intervals]
        while waiting:  # the latest first, which bounds the memory
            check_stop()
            block = waiting.pop()
            if self.turns is None:
                block = block.some(block.bound > self._limit(block.key, block.reached))
            if block.key.size > most:
                waiting.append(block.some(slice(most, None)))
                block = block.some(slice(most))
            if block.key.size:
                sums, u, time, length = self._gathered(waves, block)
                look = _Look.at(sums, u, None if self.squares is None else _Squares(np.zeros(1, dtype=np.int64)))
                time = time[:, None] + length[:, None] * look.u
                waiting.append(self._left(sums, look, block.key[:, None], time, block.wave, block.row))

    def _gathered(self, waves: Sequence[Waves], of: _Intervals) -> tuple[_Sums, Floats, Floats, Floats]:
        """The function of each interval alone; ends of the parts of the intervals that differ (U, PARTS + 1); and begin
        and length of the segment of each, s."""
        output, functions = of.key % self.outputs, max(wave.power.size for wave in waves)
        columns = output[:, None]
        if self.squares is not None:
            ends = np.append(self.squares.first[1:], waves[0].table.shape[-1])
            columns = self.squares.first[output, None] + np.arange((ends - self.squares.first)[output].max())
        table = np.zeros((of.key.size, functions, columns.shape[1]), dtype=complex)
        noise = np.zeros(table.shape)
        time, length = np.empty((2, of.key.size))
        different, interval = _different(of.wave, of.row, of.begin, of.length, np.nan_to_num(of.top))
        rate, power = (
            np.zeros((different.size, functions), dtype=complex),
            np.zeros((different.size, functions), dtype=int),
        )
        for number in np.unique(of.wave):
            at, wave = np.flatnonzero(of.wave == number), waves[number]
            own, some = slice(0, wave.power.size), np.flatnonzero(of.wave[different] == number)
            time[at], length[at] = wave.time[of.row[at]], wave.length[of.row[at]]
            rate[some, own], power[some, own] = wave.rates(of.row[different[some]]), wave.power
            table[at, own], noise[at, own] = wave.one_each(
                of.row[at], np.minimum(columns[at], wave.table.shape[-1] - 1)
            )
        if self.squares is not None:
            table *= (columns < ends[output, None])[:, None]
        one = np.ones((1, 1))
        sums = _Sums(rate, power, interval, np.arange(functions), one.astype(complex), one, table, noise)
        return sums, of.some(different).divided(), time, length

    def _left(self, sums: _Sums, look: _Look, key: Ints, time: Floats, wave: Ints, rows: Ints) -> _Intervals:
        """Parts that may hold more than what is known; what is reached at their ends becomes known.

        Parameters
        ----------
        key : (n, j) of the functions.
        time : (n, parts + 1) s, of the ends of the parts.
        wave, rows : (n,) to which the intervals belong.
        """
        self.evaluations += look.whole[:, 1:].size
        sign = self._sign(key[:, :1])[:, None]  # (n, 1, 1)
        whole, value, begins, ends = (sign * x for x in (look.whole, look.value, look.begins, look.ends))
        self._reach(key, whole, time)
        left, right = value[:, :-1], value[:, 1:]
        hull = np.maximum(np.maximum(left, left + begins / 3.0), np.maximum(right, right - ends / 3.0))  # of the cubics
        hull = self._beside(hull + VALUE * look.fourth, look.aside, sign) - look.noise
        reached = np.maximum(whole[:, :-1], whole[:, 1:])
        limit = self._limit(key[:, None], reached) if self.turns is None else np.full((1, 1, 1), -np.inf)
        row, part, column = np.nonzero(hull > limit)
        left, right, begins, ends, fourth, aside, noise, limit, reached = (
            np.broadcast_to(x, hull.shape)[row, part, column]
            for x in (left, right, begins, ends, look.fourth, look.aside, look.noise, limit, reached)
        )
        cubic = Cubic(left, right, begins, ends)
        top, place = cubic.top()
        bound = self._beside(top + VALUE * fourth, aside, sign[row, 0, 0]) - noise
        begin, length = look.u[row, part], np.diff(look.u)[row, part]
        certain = (place > 0.0) & (aside == 0.0) & (SLOPE * fourth < 0.5 * NEAR * -cubic.curvature_at(place))
        keep = (bound > limit) & ~((aside == 0.0) & cubic.climbs(SLOPE * fourth))
        keep &= length > EPS * (np.abs(begin) + length)
        if self.turns is not None:
            size = np.abs(self.value[np.isfinite(self.value)]).max()
            known = VALUE * fourth + aside <= TOLERANCE * size + noise
            turns = np.flatnonzero(known & ((place > 0.0) | ((begins > 0.0) & (ends <= 0.0))))
            share = np.where(place > 0.0, place, 1.0)[turns]
            of, part_of = row[turns], part[turns]
            at = time[of, part_of] + share * (time[of, part_of + 1] - time[of, part_of])
            self.turns.append((wave[of], rows[of], at, sums.at(of, begin[turns] + share * length[turns])))
            keep &= ~known
        where = np.where(certain, place, np.nan)
        found = _Intervals(wave[row], rows[row], key[row, column], begin, length, bound, reached, where)
        return found.some(keep)

    def _beside(self, bound: Floats, aside: Floats, sign: Floats) -> Floats:
        """Bounds on functions of a sign from those on a part of the terms, and on the others."""
        if self.squares is None or not aside.any():
            return np.asarray(bound + aside)
        root, rest = np.sqrt(np.maximum(sign * bound, 0.0)), math.sqrt(0.5) * aside
        return np.where(sign > 0.0, (root + rest) ** 2, -(np.maximum(root - rest, 0.0) ** 2))


def _different(*keys: Floats | Ints) -> tuple[Ints, Ints]:
    """Where each of the different tuples of keys (n,) comes first, and which of them each is."""
    order = np.lexsort(keys)
    new = np.ones(order.size, dtype=bool)
    new[1:] = np.logical_or.reduce([key[order[1:]] != key[order[:-1]] for key in keys])
    at = np.empty(order.size, dtype=np.int64)
    at[order] = np.cumsum(new) - 1
    return order[new], at


def turning_points(waves: Sequence[Waves]) -> tuple[Ints, Ints, Floats, Floats]:
    """All maxima and minima of one output inside parts of segments.

    Those that are left out differ from what is beside them by less than `TOLERANCE` of the largest value.

    Returns
    -------
    wave, row : (m,) numbers of the waves and of their parts, in no order.
    time : (m,) s.
    value : (m,)

    Raises
    ------
    Stopped
        Where a stop is requested.
    """
    turns: list[tuple[Ints, Ints, Floats, Floats]] = []
    replace(Search.of(1), turns=turns).add(waves)
    wave, row, time, value = zip(*turns, strict=True)
    return np.concatenate(wave), np.concatenate(row), np.concatenate(time), np.concatenate(value)
