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
of u it is a sum of terms as those of closed-form motions, and the same search takes it.

`search_extrema` and the types come first, then the compiled search.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from beamsim.flow.compiled import kernel, summing
from beamsim.flow.contact_state import GROWTH
from beamsim.flow.kernels import EPS, _exp
from beamsim.typing import Bools, Floats, Ints, not_none

TOLERANCE = 1e-10  # relative difference below which two peaks of an output count as equal
PARTS = 4  # of an interval
NEAREST, NEAR = 1e-4, 0.1  # shares of an interval: distance of the cubic's maximum from the ends of the part about it
FARTHEST = 3.0  # rad, largest turn on a part of functions that the cubics include
VALUE, SLOPE = 1.0 / 384.0, math.sqrt(3.0) / 216.0  # errors of a cubic and of its slope, over the fourth derivative
PARTS_AT_ONCE = 256  # parts of segments in a batch; bounds the memory
LATEST = 8  # parts of the last batch with which those of the next are compared
SIMILAR = 1e-8  # relative difference of the sums of amplitudes above which two parts are not compared
REACH_ROUND_OFF = 1e-12  # of the sums of matrix products, relative to the sizes of their terms


class Sums(NamedTuple):
    """K outputs on n parts of segments: sums of T terms of B functions of the time u, a share of the segment.

    Before `in_shares` the time is in s, rates are (B,), 1/s, and the table is complex.
    """

    rate: Any  # (n, B) of the functions u^power exp(rate u)
    power: Any  # (B,)
    basis: Any  # (T,) function of each term
    amplitude: Any  # (n, T)
    noise: Any  # (n, T) round-off of the amplitudes
    table: Any  # (n, 3, T, K), or n = 1: real and imaginary parts and sizes of the coefficients of the outputs
    span: Any  # (4, n) begin and end of the parts, shares of the segments; begin and length of the segments, s
    window: Any  # (n,) number of the window of each part


class KnownExtremes(NamedTuple):
    """Largest values found so far of J functions of the outputs in W windows, and of their negatives."""

    value: Any  # (2, W, J)
    time: Any  # (2, W, J) s
    first: Any  # (J + 1,) of the outputs of each function
    squared: Any  # whether the functions are half the sums of the squares of their outputs
    rank: Any  # (2, J) group of functions of which only the largest value counts
    largest_of_rank: Any  # (W, groups) largest value of each group


class Extrema(NamedTuple):
    """Extreme values of K outputs in W windows and their times, s."""

    low: Floats  # (W, K)
    when_low: Floats
    high: Floats
    when_high: Floats
    evaluations: int  # of an output at one time


def search_extrema(
    batches: Iterable[Sums], outputs: int, windows: int = 1, squares: Ints | None = None,
    competitors: Ints | None = None,
) -> Extrema:  # fmt: skip
    """The largest and smallest values of outputs in windows.

    The values are reached, and exact to `TOLERANCE` of their size (sums of squares: of the largest value). Of the
    competitors only the largest magnitude of all is exact. A part that repeats a searched one, as each period of a
    steady motion does, is skipped; the tolerance is then twice as large.

    Parameters
    ----------
    batches : the outputs on all parts of a motion, in seconds.
    outputs : number of them.
    windows : number W.
    squares : (K,) first output of each group of consecutive ones, if half the sums of their squares are searched.
    competitors : numbers of the outputs of which only the largest magnitude of all is searched.

    Returns
    -------
    Extrema
        Of the K groups; without groups K is the number of outputs. Infinite in windows without motion.
    """
    known, evaluations = nothing_known(outputs, windows, squares, competitors), 0
    latest: tuple[Any, Sums | None] = None, None  # table of a contact state, and its parts that were searched last
    for sums in batches if known.rank.size else ():
        scaled = in_shares(sums)
        bound = initial_bounds(scaled, known)
        repeated = np.zeros(sums.window.size, dtype=bool)
        if sums.table is latest[0] and not known.squared:
            repeated = repeats(scaled, not_none(latest[1]), known)
            bound[:, repeated] = -np.inf
        evaluations += search(scaled, bound, known, -1.0)[1]
        if not repeated[-LATEST:].any():
            latest = sums.table, scaled
    high, low = np.where(np.isnan(known.time), -np.inf, known.value)
    when_high, when_low = known.time
    return Extrema(-low, when_low, high, when_high, evaluations)


def nothing_known(
    outputs: int, windows: int = 1, squares: Ints | None = None, competitors: Ints | None = None
) -> KnownExtremes:
    """Initial state of a search, without values; see `search_extrema` for the parameters."""
    first = np.append(np.arange(outputs) if squares is None else squares, outputs)
    shape, least = (2, windows, first.size - 1), np.finfo(float).min
    rank = np.arange(2 * shape[2]).reshape(2, -1)
    if competitors is not None:
        rank[:, competitors] = rank[0, competitors[:1]]
    best = np.full((windows, rank.size), least)
    return KnownExtremes(np.full(shape, least), np.full(shape, np.nan), first, squares is not None, rank, best)


def in_shares(sums: Sums) -> Sums:
    """Sums of functions of time in s, with complex coefficients (T, K) or (n, T, K), as the kernels take them.

    The time is counted from where `Sums.span` has the segment begin, in their lengths.
    """
    length, table = sums.span[3, :, None], sums.table if sums.table.ndim == 3 else sums.table[None]
    rate = sums.rate * length
    scale = (length**sums.power)[:, sums.basis]
    return sums._replace(
        rate=np.where(rate.real < GROWTH, rate, 0.0),  # faster growth has no amplitude
        amplitude=sums.amplitude * scale, noise=sums.noise * scale,
        table=np.stack([table.real, table.imag, np.abs(table)], axis=1),
    )  # fmt: skip


def initial_bounds(sums: Sums, incumbents: KnownExtremes) -> Floats:
    """(2, n, J) bounds on J functions of the outputs on parts, and on their negatives, from the initial values.

    A term changes by at most its largest slope times the length, and by at most twice its size. Matrix products
    give these bounds for all parts at once; a part whose bound is below the incumbent is not searched.

    Parameters
    ----------
    sums : as `in_shares` gives them.
    incumbents : which functions are searched.
    """
    (begin, end), rate, power = sums.span[:2, :, None], sums.rate, sums.power
    farthest = np.maximum(np.abs(begin), np.abs(end))
    with np.errstate(over="ignore", invalid="ignore"):  # of motions that grow without bound
        most = np.exp(np.maximum(rate.real * begin, rate.real * end)) * farthest**power
        spreads = most * (np.minimum((np.abs(rate) + power / farthest) * (end - begin), 2.0) + REACH_ROUND_OFF)
        terms = sums.amplitude * (np.exp(rate * begin) * begin**power)[:, sums.basis]
        sizes = np.abs(sums.amplitude) * spreads[:, sums.basis]
        real, imag, size = sums.table.swapaxes(0, 1)
        re, im, sizes = (x.reshape(real.shape[0], -1, real.shape[1]) for x in (terms.real, terms.imag, sizes))
        value, spread = ((re @ real - im @ imag).reshape(begin.size, -1), (sizes @ size).reshape(begin.size, -1))
        high, low = value + spread, spread - value
        if not incumbents.squared:
            return np.stack([high, low])
        squares = np.maximum(high, low) ** 2, -(np.maximum(np.maximum(-high, -low), 0.0) ** 2)
        return 0.5 * np.add.reduceat(squares, incumbents.first[:-1], axis=2)


def repeats(sums: Sums, previous: Sums, incumbents: KnownExtremes) -> Bools:
    """(n,) whether the outputs on parts equal those on one of the previously searched parts within `TOLERANCE`.

    On parts of nearly equal length the difference of a term follows from those of its amplitude and its exponent.

    Parameters
    ----------
    sums, previous : parts of one contact state, as `in_shares` gives them.
    incumbents : the largest values, to which the tolerance refers.
    """
    end, order = slice(-LATEST, None), np.arange(1.0, sums.basis.size + 1.0)
    key, keys = sums.amplitude @ order, previous.amplitude[end] @ order
    gap = np.abs(key[:, None] - keys)
    nearest, equal = gap.argmin(axis=1), np.zeros(key.size, dtype=bool)
    close = (previous.span[:2, end][:, nearest] == sums.span[:2]).all(axis=0)
    close &= (previous.window[end][nearest] == sums.window) & (gap.min(axis=1) <= SIMILAR * np.abs(key))
    if close.any():
        nearest, rate, amplitude = nearest[close], sums.rate[close], sums.amplitude[close]
        with np.errstate(over="ignore", invalid="ignore"):  # of motions that grow without bound
            most = np.exp(np.maximum(rate.real, 0.0))
            shift = np.abs(rate - previous.rate[end][nearest]) * most
            change = np.abs(amplitude - previous.amplitude[end][nearest]) * most[:, sums.basis]
            bound = (change + np.abs(amplitude) * shift[:, sums.basis]) @ sums.table[0, 2]
            size = np.abs(incumbents.largest_of_rank[:, incumbents.rank]).max(axis=1)[sums.window[close]]
            equal[close] = (bound <= TOLERANCE * size).all(axis=1)
    return equal


def values_in_shares(sums: Sums, rows: Ints, u: Floats) -> Floats:
    """(m,) a single output on some parts, each at one time u (m,), a share of the segment."""
    functions = np.exp(sums.rate[rows] * u[:, None]) * u[:, None] ** sums.power
    terms, table = functions[:, sums.basis] * sums.amplitude[rows], sums.table[rows if sums.table.shape[0] > 1 else 0]
    return np.asarray((terms.real * table[..., 0, :, 0] - terms.imag * table[..., 1, :, 0]).sum(axis=1))


NODES = 16  # degree of the polynomials, above that of any integrator's dense output (12)
_POINTS = chebyshev.chebpts2(NODES + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_POINTS, NODES))
_POWERS = np.array([np.pad(chebyshev.cheb2poly(row), (0, NODES - k)) for k, row in enumerate(np.eye(NODES + 1))])


def polynomials(values: Floats, start: Floats, length: Floats, window: Ints | None = None) -> Iterator[Sums]:
    """Outputs on S steps, from their values (S, NODES + 1, k) at the Chebyshev points, the earliest first.

    Parameters
    ----------
    values : (S, NODES + 1, k) in the units of the outputs.
    start, length : (S,) of the steps, s.
    window : (S,) numbers of the windows that the steps belong to; one by default.

    Yields
    ------
    Sums
        In seconds since the middle of each step.
    """
    coefficient = _COEFFICIENTS @ values
    round_off = NODES * EPS * np.abs(values).max(axis=1, keepdims=True)
    coefficient = np.where(np.abs(coefficient) > round_off, coefficient, 0.0)
    number, half = np.arange(NODES + 1), 0.5 * length
    table = (_POWERS.T @ coefficient) * half[:, None, None] ** -number[:, None]
    span, window = (
        np.stack([-np.ones(half.size), np.ones(half.size), start + half, half]),
        np.zeros(half.size, dtype=np.int64) if window is None else window,
    )
    for first in range(0, half.size, PARTS_AT_ONCE):
        rows = slice(first, first + PARTS_AT_ONCE)
        ones = np.ones((span[0, rows].size, NODES + 1), dtype=complex)
        yield Sums(
            np.zeros(NODES + 1, dtype=complex), number, number, ones, np.zeros(ones.shape), table[rows].astype(complex),
            span[:, rows], window[rows],
        )  # fmt: skip


class IntervalEnds(NamedTuple):
    """Values at the ends of P parts of an interval, and bounds between them.

    The entry of a function of several outputs is that of the first of these.
    """

    u: Any  # (P + 1,)
    wave: Any  # (P + 1, 4, B) real and imaginary parts of the functions of time there, and of their slopes
    derivative_bound: Any  # (5, B) bounds on their derivatives of the orders 0 to 4 on the interval
    in_cubic: Any  # (B,) 1, or 0 where they turn too far on a part to be in the cubics
    value: Any  # (P + 1, 3, K) as a whole; of what is in the cubics, the value and the slope
    bound: Any  # (9, K) on the derivatives of the orders 0 to 4 of what is in the cubics, on what is not, on round-off,
    # and on the largest and smallest value


FOURTH, REMAINDER, ROUND_OFF, HIGHEST = 4, 5, 6, 7  # of these bounds


@kernel
def search(sums, bounds, incumbents, resolution):
    """Update the incumbents by the largest values on the parts.

    Parameters
    ----------
    sums, incumbents : the outputs, and the largest values found so far; updated.
    bounds : (2, n, J) bounds on the functions on the parts and on their negatives; infinite to search every part.
    resolution : smallest difference of neighbouring turning points, if all are searched; negative if only the largest
        values are.

    Returns
    -------
    The turning points (m, 2), each the number of its part and its time as a share of the segment; and the number of
    values that were computed.
    """
    B, K = sums.rate.shape[1], sums.table.shape[3]
    output, noise, by_output = np.empty((3, K, B)), np.empty(K), np.empty((2, B, K))
    ends, inside = _make_ends(1, B, K), _make_ends(PARTS, B, K)
    queue, turns = np.empty((64, 6)), np.empty((64, 2))
    used, evaluations = np.empty(2, dtype=np.int64), 0  # rows of these
    used[0] = used[1] = 0
    todo, single = np.empty(incumbents.first.size - 1, dtype=np.int64), np.empty(1, dtype=np.int64)
    for i in range(sums.window.size):
        ends.u[0], ends.u[1], window = sums.span[0, i], sums.span[1, i], sums.window[i]
        count = _fill_todo(incumbents, bounds, window, i, todo)
        if count == 0:
            continue
        _fill_waves(sums, i, 0.0, ends)
        _fill_outputs(
            sums, i, incumbents.first[todo[0]], incumbents.first[todo[count - 1] + 1], ends, by_output, output, noise
        )
        _evaluate_functions(incumbents, sums, i, todo[:count], output, noise, ends)
        evaluations += 2 * count
        pieces, divided = inside, False
        for j in todo[:count]:
            seen, single[0] = False, j
            for sign in range(2):
                best, scale = _incumbent(incumbents, sign, window, j)
                if ends.bound[HIGHEST + sign, incumbents.first[j]] <= _limit(best, scale, best, resolution):
                    continue
                if not divided:
                    pieces, divided = _equal_parts(sums, i, ends), True
                if not seen:
                    _evaluate_functions(incumbents, sums, i, single, output, noise, pieces)
                    evaluations, seen = evaluations + pieces.u.size, True
                key = (sign, window, j, i)
                queue, turns = (
                    _with_room(queue, used[0] + pieces.u.size),
                    _with_room(turns, used[1] + pieces.u.size),
                )
                _subdivide(incumbents, key, pieces, resolution, queue, turns, used)
                while used[0] > 0:
                    used[0] -= 1
                    row = queue[used[0]]
                    best, scale = _incumbent(incumbents, sign, window, j)
                    if row[2] <= _limit(best, scale, row[3], resolution):
                        continue
                    _divide(row, inside.u)
                    _fill_waves(sums, i, row[4], inside)
                    _evaluate_functions(incumbents, sums, i, single, output, noise, inside)
                    evaluations += PARTS - 1
                    queue, turns = _with_room(queue, used[0] + PARTS), _with_room(turns, used[1] + PARTS)
                    _subdivide(incumbents, key, inside, resolution, queue, turns, used)
    return turns[: used[1]], evaluations


@kernel
def _fill_todo(incumbents, bounds, window, i, todo):
    """Write the functions that may exceed their incumbents on a part, and return their number."""
    count = 0
    for j in range(todo.size):
        below = True
        for sign in range(2):
            best, _ = _incumbent(incumbents, sign, window, j)
            below = below and bounds[sign, i, j] <= best and not math.isnan(incumbents.time[sign, window, j])
        if not below:
            todo[count] = j
            count += 1
    return count


@kernel
def variation(sums):
    """Bounds (n, K) on the total variation of the outputs on the parts, and their values (2, n, K) at the ends.

    That of an output is the variation of its cubics, the integral of the error of their slopes, and that of the slopes
    of the functions that turn too far to be in the cubics.
    """
    n, B, K = sums.window.size, sums.rate.shape[1], sums.table.shape[3]
    output, noise, by_output = np.empty((3, K, B)), np.empty(K), np.empty((2, B, K))
    ends, first, slopes = _make_ends(1, B, K), np.arange(K + 1), np.empty(B)
    bound, value = np.zeros((n, K)), np.empty((2, n, K))
    for i in range(n):
        ends.u[0], ends.u[1] = sums.span[0, i], sums.span[1, i]
        _fill_waves(sums, i, 0.0, ends)
        _fill_outputs(sums, i, 0, K, ends, by_output, output, noise)
        parts = _equal_parts(sums, i, ends)
        _evaluate_outputs(first, first[:K], output, noise, parts)
        for b in range(B):
            slopes[b] = (1.0 - parts.in_cubic[b]) * _integral_of_slope(sums, i, b, parts)
        for k in range(K):
            value[0, i, k], value[1, i, k] = parts.value[0, 0, k], parts.value[parts.u.size - 1, 0, k]
            for b in range(B):
                bound[i, k] += output[2, k, b] * slopes[b]
            for p in range(parts.u.size - 1):
                h, left, right = parts.u[p + 1] - parts.u[p], parts.value[p], parts.value[p + 1]
                bound[i, k] += _cubic_variation(left[1, k], right[1, k], left[2, k] * h, right[2, k] * h)
                bound[i, k] += SLOPE * parts.bound[FOURTH, k] * h * h * h * h
    return bound, value


@kernel
def _integral_of_slope(sums, i, b, ends):
    """Bound on the integral of the magnitude of the slope of a function of time over an interval."""
    rate, begin, end = sums.rate[i, b], ends.u[0], ends.u[ends.u.size - 1]
    if sums.power[b] > 0 or abs(rate.real) * (end - begin) < 1e-6:
        return ends.derivative_bound[1, b] * (end - begin)
    size = math.sqrt(rate.real * rate.real + rate.imag * rate.imag)
    return size * (math.exp(rate.real * end) - math.exp(rate.real * begin)) / rate.real


@kernel
def _cubic_variation(left, right, first, last):
    """Total variation of a cubic between 0 and 1, from its values and slopes there."""
    rise = right - left
    c, e = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
    discriminant, total, previous = c * c - 3.0 * e * first, 0.0, left
    if discriminant > 0.0:
        q = -(c + math.copysign(math.sqrt(discriminant), c))
        t1, t2 = first / q if q != 0.0 else 0.0, q / (3.0 * e) if e != 0.0 else 0.0
        for t in (min(t1, t2), max(t1, t2)):
            if 0.0 < t < 1.0:
                value = left + t * (first + t * (c + t * e))
                total, previous = total + abs(value - previous), value
    return total + abs(right - previous)


@kernel
def _make_ends(parts, B, K):
    """Uninitialised `IntervalEnds` of P parts, B functions and K outputs."""
    return IntervalEnds(
        np.empty(parts + 1), np.empty((parts + 1, 4, B)), np.empty((5, B)), np.empty(B), np.empty((parts + 1, 3, K)),
        np.empty((9, K)),
    )  # fmt: skip


@kernel
def _with_room(rows, count):
    """An array with at least ``count`` rows, enlarged if necessary."""
    if count <= rows.shape[0]:
        return rows
    out = np.empty((2 * count, rows.shape[1]))
    for i in range(rows.shape[0]):  # a slice would take seconds more to compile
        for j in range(rows.shape[1]):
            out[i, j] = rows[i, j]
    return out


@kernel
def _equal_parts(sums, i, ends):
    """Ends of equal parts of an interval, at most 64, so short that the cubics include all functions."""
    parts, square = 1, 0.0
    for b in range(sums.power.size):
        square = max(square, sums.rate[i, b].real ** 2 + sums.rate[i, b].imag ** 2)
    turn = math.sqrt(square) * (ends.u[1] - ends.u[0])
    while parts < 64 and FARTHEST * parts < turn:
        parts *= 2
    if parts == 1:
        return ends
    pieces = _make_ends(parts, ends.in_cubic.size, ends.bound.shape[1])
    for p in range(parts + 1):
        pieces.u[p] = ends.u[1] if p == parts else ends.u[0] + (ends.u[1] - ends.u[0]) * p / parts
    _fill_waves(sums, i, 0.0, pieces)
    return pieces


@summing
def _fill_outputs(sums, i, first, last, ends, by_output, output, noise):
    """Fill in the coefficients of outputs ``first`` to ``last`` on a part, and their round-off.

    (3, K, B): real and imaginary parts and sizes of the functions' coefficients; (K,) round-off.
    """
    n, B = i if sums.table.shape[0] > 1 else 0, output.shape[2]
    farthest, round_off = max(abs(ends.u[0]), abs(ends.u[1])), np.empty(B)
    for b in range(B):
        for k in range(first, last):
            by_output[0, b, k] = by_output[1, b, k] = 0.0
    for k in range(first, last):
        noise[k] = 0.0
    for t in range(sums.basis.size):
        b = sums.basis[t]
        real, imag, rounded = (
            sums.amplitude[i, t].real,
            sums.amplitude[i, t].imag,
            sums.noise[i, t] * ends.derivative_bound[0, b],
        )
        for k in range(first, last):
            by_output[0, b, k] += sums.table[n, 0, t, k] * real - sums.table[n, 1, t, k] * imag
            by_output[1, b, k] += sums.table[n, 0, t, k] * imag + sums.table[n, 1, t, k] * real
            noise[k] += sums.table[n, 2, t, k] * rounded
    for b in range(B):
        rate = math.sqrt(sums.rate[i, b].real ** 2 + sums.rate[i, b].imag ** 2)
        round_off[b] = 4.0 * EPS * (8.0 + sums.power[b] + rate * farthest) * ends.derivative_bound[0, b]
    for k in range(first, last):
        for b in range(B):
            output[0, k, b], output[1, k, b] = by_output[0, b, k], by_output[1, b, k]
        for b in range(B):
            output[2, k, b] = math.sqrt(output[0, k, b] ** 2 + output[1, k, b] ** 2)
            noise[k] += round_off[b] * output[2, k, b]


@kernel
def _fill_waves(sums, i, maximum, ends):
    """The functions of time at the ends of the parts of an interval, and bounds between these.

    The parts are placed about the maximum at ``maximum``, or equal if that is 0 (a flag would be compiled twice).
    From a function f to u f derivatives change to ``u f^(k) + k f^(k - 1)``.
    """
    u, wave, bounds, last = ends.u, ends.wave, ends.derivative_bound, ends.u.size - 1
    step, farthest = 0.0, max(abs(u[0]), abs(u[last]))
    for p in range(last):
        step = max(step, u[p + 1] - u[p])
    for b in range(sums.power.size):
        rate, power, times = sums.rate[i, b], sums.power[b], 1
        size = math.sqrt(rate.real * rate.real + rate.imag * rate.imag)
        base = b - 1  # the function that is multiplied by the time
        if b == 0 or rate != sums.rate[i, base] or power != sums.power[base] + 1:
            base, times = b, power
            e = _exp(rate.real, rate.imag, u[0])
            wave[0, 0, b], wave[0, 1, b] = e.real, e.imag
            filled, doublings = 1, 0
            while filled <= last:  # double the number, with the growth of the function over these
                e = e * e if doublings % 3 > 0 else _exp(rate.real, rate.imag, u[filled] - u[0])
                for p in range(filled, min(2 * filled, last + 1)):
                    if maximum > 0.0:
                        e = _exp(rate.real, rate.imag, u[p] - u[p - filled])
                    x, y = wave[p - filled, 0, b], wave[p - filled, 1, b]
                    wave[p, 0, b], wave[p, 1, b] = x * e.real - y * e.imag, x * e.imag + y * e.real
                filled, doublings = 2 * filled, doublings + 1
            for p in range(last + 1):
                x, y = wave[p, 0, b], wave[p, 1, b]
                wave[p, 2, b], wave[p, 3, b] = x * rate.real - y * rate.imag, x * rate.imag + y * rate.real
            bound = math.exp(max(rate.real * u[0], rate.real * u[last]))
            for order in range(5):
                bounds[order, b] = bound
                bound *= size
        for _ in range(times):
            for p in range(last + 1):
                for q in range(2):
                    wave[p, 2 + q, b] = u[p] * wave[p, 2 + q, base] + wave[p, q, base]
                    wave[p, q, b] = u[p] * wave[p, q, base]
            for order in range(4, 0, -1):
                bounds[order, b] = farthest * bounds[order, base] + order * bounds[order - 1, base]
            bounds[0, b] = farthest * bounds[0, base]
        ends.in_cubic[b] = 1.0 if size * step <= FARTHEST else 0.0


@kernel
def _evaluate_functions(incumbents, sums, i, functions, output, noise, ends):
    """Evaluate functions of outputs at the ends of the parts of an interval and bound them in between.

    The incumbents are updated; of equal values the first counts.
    """
    value, bound, window = ends.value, ends.bound, sums.window[i]
    _evaluate_outputs(incumbents.first, functions, output, noise, ends)
    for j in functions:
        k = incumbents.first[j]
        if incumbents.squared:
            _add_squares(ends, k, incumbents.first[j + 1])
        high, low = -math.inf, math.inf  # of the hulls of the cubics
        for p in range(ends.u.size - 1):
            h = ends.u[p + 1] - ends.u[p]
            left, right = value[p, 1, k], value[p + 1, 1, k]
            c_left, c_right = left + value[p, 2, k] * h / 3.0, right - value[p + 1, 2, k] * h / 3.0
            error = VALUE * bound[FOURTH, k] * h * h * h * h
            high = max(high, max(max(left, right), max(c_left, c_right)) + error)
            low = min(low, min(min(left, right), min(c_left, c_right)) - error)
        bound[HIGHEST, k] = _add_remainder(high, bound[REMAINDER, k], 1.0, incumbents.squared) - bound[ROUND_OFF, k]
        bound[HIGHEST + 1, k] = (
            _add_remainder(-low, bound[REMAINDER, k], -1.0, incumbents.squared) - bound[ROUND_OFF, k]
        )
        for p in range(ends.u.size):
            for sign in range(2):
                end_value = value[p, 0, k] if sign == 0 else -value[p, 0, k]
                if end_value > incumbents.value[sign, window, j]:
                    incumbents.value[sign, window, j] = end_value
                    incumbents.largest_of_rank[window, incumbents.rank[sign, j]] = max(
                        incumbents.largest_of_rank[window, incumbents.rank[sign, j]], end_value
                    )
                    incumbents.time[sign, window, j] = sums.span[2, i] + sums.span[3, i] * ends.u[p]


@summing
def _evaluate_outputs(first, functions, output, noise, ends):
    """Evaluate the outputs of some functions, with bounds on derivatives, on the remainder outside the cubics, and on
    round-off."""
    for k in range(first[functions[0]], first[functions[functions.size - 1] + 1]):
        for p in range(ends.u.size):
            total, value, slope = 0.0, 0.0, 0.0
            for b in range(ends.in_cubic.size):
                real, imag = output[0, k, b], output[1, k, b]
                term = real * ends.wave[p, 0, b] - imag * ends.wave[p, 1, b]
                total += term
                value += ends.in_cubic[b] * term
                slope += ends.in_cubic[b] * (real * ends.wave[p, 2, b] - imag * ends.wave[p, 3, b])
            ends.value[p, 0, k], ends.value[p, 1, k], ends.value[p, 2, k] = total, value, slope
        n0, n1, n2, n3, n4, outside = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for b in range(ends.in_cubic.size):
            size, inside = output[2, k, b], output[2, k, b] * ends.in_cubic[b]
            n0 += inside * ends.derivative_bound[0, b]
            n1 += inside * ends.derivative_bound[1, b]
            n2 += inside * ends.derivative_bound[2, b]
            n3 += inside * ends.derivative_bound[3, b]
            n4 += inside * ends.derivative_bound[4, b]
            outside += (size - inside) * ends.derivative_bound[0, b]
        ends.bound[0, k], ends.bound[1, k], ends.bound[2, k], ends.bound[3, k] = n0, n1, n2, n3
        ends.bound[FOURTH, k], ends.bound[REMAINDER, k], ends.bound[ROUND_OFF, k] = n4, outside, noise[k]


@kernel
def _add_squares(ends, first, last):
    """Replace outputs ``first`` to ``last`` by half the sum of their squares, stored at the first."""
    value, bound = ends.value, ends.bound
    for p in range(ends.u.size):
        full, inside, slope = 0.0, 0.0, 0.0
        for k in range(first, last):
            full += 0.5 * value[p, 0, k] ** 2
            inside += 0.5 * value[p, 1, k] ** 2
            slope += value[p, 1, k] * value[p, 2, k]
        value[p, 0, first], value[p, 1, first], value[p, 2, first] = full, inside, slope
    for q in range(HIGHEST):  # lengths
        total = 0.0
        for k in range(first, last):
            total += bound[q, k] ** 2
        bound[q, first] = math.sqrt(total)
    n0, n1, n2, n3, n4 = bound[0, first], bound[1, first], bound[2, first], bound[3, first], bound[4, first]
    bound[FOURTH, first] = n0 * n4 + 4.0 * n1 * n3 + 3.0 * n2**2  # by Leibniz and Schwarz
    bound[ROUND_OFF, first] *= n0 + bound[REMAINDER, first] + 0.5 * bound[ROUND_OFF, first]


@kernel
def _incumbent(incumbents, sign, window, j):
    """The largest value in the group of a function, and the size of the values in it."""
    of_window = incumbents.largest_of_rank[window]
    return of_window[incumbents.rank[sign, j]], of_window[incumbents.rank[0 if incumbents.squared else sign, j]]


@kernel
def _limit(incumbent, scale, end_value, resolution):
    """Threshold that a function has to exceed within an interval, given its value at the ends.

    If only the largest values are searched this is the incumbent plus the tolerance; if all turning points are, the
    value at the ends plus the resolution. ``scale`` is the size of the values.
    """
    if resolution >= 0.0:
        return -math.inf
    return incumbent + (4.0 * EPS if end_value == incumbent else TOLERANCE) * abs(scale)


@kernel
def _divide(interval, u):
    """Ends of the parts of an interval: about the place of its top, if that is certain, else equal ones."""
    begin, length = interval[0], interval[1] - interval[0]
    if interval[4] > 0.0:
        margin = interval[5]
        middle = min(max(interval[4], 2.0 * margin), 1.0 - 2.0 * margin)
        u[1], u[2], u[3] = (
            begin + length * (middle - margin),
            begin + length * middle,
            begin + length * (middle + margin),
        )
    else:
        u[1], u[2], u[3] = begin + 0.25 * length, begin + 0.5 * length, begin + 0.75 * length
    u[0], u[4] = begin, interval[1]


@kernel
def _subdivide(incumbents, key, ends, resolution, queue, turning_points, counts):
    """Append the parts that may exceed the incumbent to the queue, the first part last.

    Parameters
    ----------
    incumbents, ends, resolution : see `search`.
    key : sign, window, function, part.
    queue : rows of begin, end, bound, value at the ends, time of the maximum (0 if not certain), and its uncertainty.
    turning_points : see `search`.
    counts : (2,) rows in use of these two.
    """
    sign = 1.0 if key[0] == 0 else -1.0
    value, k = ends.value, incumbents.first[key[2]]
    best, scale = _incumbent(incumbents, key[0], key[1], key[2])
    fourth, outside, noise = ends.bound[FOURTH, k], ends.bound[REMAINDER, k], ends.bound[ROUND_OFF, k]
    for p in range(ends.u.size - 2, -1, -1):
        begin, h = ends.u[p], ends.u[p + 1] - ends.u[p]
        left, right = sign * value[p, 1, k], sign * value[p + 1, 1, k]
        first, last = sign * value[p, 2, k] * h, sign * value[p + 1, 2, k] * h
        error = fourth * h * h * h * h
        end_value = max(sign * value[p, 0, k], sign * value[p + 1, 0, k])
        limit = _limit(best, scale, end_value, resolution)
        highest, peak, curvature, flattest, steepest = _cubic(left, right, first, last)
        bound = _add_remainder(highest + VALUE * error, outside, sign, incumbents.squared) - noise
        climbs = flattest > SLOPE * error or steepest < -SLOPE * error
        if not bound > limit or (outside == 0.0 and climbs) or h <= EPS * (abs(begin) + h):
            continue
        if resolution >= 0.0 and VALUE * error + outside <= resolution + noise:
            if peak > 0.0 or (first > 0.0 and last <= 0.0):
                turning_points[counts[1], 0] = key[3]
                turning_points[counts[1], 1] = begin + h * (peak if peak > 0.0 else 1.0)
                counts[1] += 1
            continue
        row = queue[counts[0]]
        row[0], row[1], row[2], row[3], row[4], row[5] = begin, ends.u[p + 1], bound, end_value, 0.0, 0.0
        if outside == 0.0 and 2.0 * SLOPE * error < -NEAR * curvature:  # else the top may be elsewhere
            row[4], row[5] = peak, max(NEAREST, -2.0 * SLOPE * error / curvature)
        counts[0] += 1


@kernel
def _add_remainder(bound, remainder, sign, squared):
    """Bound on a function from the bounds on its cubic and on the remainder."""
    if not squared:
        return bound + remainder
    root, extra = math.sqrt(max(sign * bound, 0.0)), math.sqrt(0.5) * remainder
    return (root + extra) ** 2 if sign > 0.0 else -(max(root - extra, 0.0) ** 2)


@kernel
def _cubic(left, right, first, last):
    """A cubic from its values and slopes at 0 and 1.

    Returns
    -------
    Its largest value, the place of its maximum inside (0 if it has none) and the curvature there; its smallest and
    largest slope.
    """
    rise = right - left
    c, e = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
    discriminant, peak = c * c - 3.0 * e * first, 0.0
    if discriminant > 0.0:
        peak = first / (math.sqrt(discriminant) - c) if c <= 0.0 else -(c + math.sqrt(discriminant)) / (3.0 * e)
    if not 0.0 < peak < 1.0:
        peak = 0.0
    highest = max(max(left, right), left + peak * (first + peak * (c + peak * e)))
    flattest, steepest = min(first, last), max(first, last)
    if 0.0 < -c * e < 3.0 * e * e:  # where the slope is extreme
        extreme = first - c * c / (3.0 * e)
        flattest, steepest = min(flattest, extreme), max(steepest, extreme)
    return highest, peak, 2.0 * c + 6.0 * peak * e, flattest, steepest
