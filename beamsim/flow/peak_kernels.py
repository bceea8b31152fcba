"""Compiled search for the highest and lowest values of outputs on the segments of a motion, window by window.

An output is a sum of groups, polynomials times exponentials in s, the time on the segment over its length. Its slope
and curvature are such sums as well. The points of a grid stand side by side, so that one loop without branches adds a
term of a group to an output at all of them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import EPS, _coefficients, _exp, _fill_sources

FINEST = 1e-10  # of an output's range: peaks are found to this
EXACT = 0.01  # of that, what the cube of the last step may change
GRID = 0.05  # share of its range by which an output may miss the chord or the cubic between two points
SLOPE = math.sqrt(3.0) / 216.0  # error of the slope of an interpolating cubic, over the fourth derivative and h^3
MOST_POINTS = 300  # of the grid on a segment
EQUAL = 16  # steps of that grid, before its width is chosen anew
PRUNED = 1e-13  # of an output's range: a group with a smaller share is left out


class Groups(NamedTuple):
    """The different exponents of the basis functions of S contact states, G each at most."""

    count: Any  # (S,)
    exponent: Any  # (S, G)
    of_basis: Any  # (S, B) group of each basis function


class Segments(NamedTuple):
    """Logged segments, and the numbers of the windows that they belong to, which do not decrease."""

    time: Any  # (n,) s
    length: Any  # (n,) s
    state: Any  # (n,)
    piece: Any  # (n,)
    y: Any  # (n, N)
    window: Any  # (n,)


class Functions(NamedTuple):
    """K outputs on a segment: sums of polynomials times exponentials of s, the time over the segment's length."""

    poly: Any  # (K, P, G) coefficients
    degree: Any  # (G,)
    exponent: Any  # (G,) times the segment's length
    end: Any  # (G,) exp of it
    live: Any  # (G,)
    length: Any  # (K, G, 5) sums over p of |poly| times 1, p, p (p - 1), ... p (p - 1) (p - 2) (p - 3)
    peaks: Any  # see `Peaks`


class Peaks(NamedTuple):
    """Work arrays for K outputs; value, slope and curvature of output j are the rows 3 j to 3 j + 2.

    A column is a power of s times a group's exponential. The points of a grid stand side by side, as many as there are
    equal steps, so that a column is added to a row at all of them at once.
    """

    column: Any  # (G,) first column of each live group
    real: Any  # (3 K, columns) coefficients
    imag: Any  # (3 K, columns)
    turned: Any  # (G,) exponentials at the start of a block of equal steps
    ratio: Any  # (G,) of two such, a step of the grid apart
    wave: Any  # (columns, 2 EQUAL) real parts of the columns at the points of a block, then imaginary parts
    grid: Any  # (3 K, points)
    times: Any  # (points,)
    block: Any  # (points,) block of equal steps to which the interval after a point belongs
    bound: Any  # (blocks, K, 2) on the second and the fourth derivative from a block's start to 1
    round_off: Any  # (K,)
    ends: Any  # (2, 3) value, slope and curvature at both ends of an interval of the grid
    single: Any  # (3,)
    stack: Any  # (80, 8)


@kernel
def make_peaks(G, P, K):  # type: ignore[no-untyped-def]
    """Work arrays for K outputs of G groups with P powers."""
    return Peaks(
        np.zeros(G, dtype=np.int64),
        np.zeros((3 * K, G * P)),
        np.zeros((3 * K, G * P)),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.complex128),
        np.zeros((G * P, 2 * EQUAL)),
        np.zeros((3 * K, MOST_POINTS + EQUAL)),
        np.zeros(MOST_POINTS + EQUAL),
        np.zeros(MOST_POINTS + EQUAL, dtype=np.int64),
        np.zeros((MOST_POINTS, K, 2)),
        np.zeros(K),
        np.zeros((2, 3)),
        np.zeros(3),
        np.zeros((80, 8)),
    )


@kernel
def extremes_of_windows(tables, inputs, table, groups, segments, high, low):  # type: ignore[no-untyped-def]
    """Raise ``high`` and lower ``low`` (W, K) to the extremes of outputs in windows, limits at events included.

    ``table`` (S, T, K) are their coefficients by term.
    """
    B, K, G, P = tables.exponent.shape[1], table.shape[2], groups.exponent.shape[1], tables.power.max() + 1
    zeta = np.zeros(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma = np.zeros((B, K), dtype=np.complex128)
    scale = np.zeros(K)
    work = Functions(
        np.zeros((K, P, G), dtype=np.complex128),
        np.zeros(G, dtype=np.int64),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.bool_),
        np.zeros((K, G, 5)),
        make_peaks(G, P, K),
    )
    for n in range(segments.time.size):
        s, w = segments.state[n], segments.window[n]
        if segments.length[n] > 0.0:
            _fill_sources(tables, s, inputs, segments.piece[n], segments.time[n], segments.y[n], rest, zeta)
            _coefficients(tables, s, table, zeta, K, gamma)
            _fill_functions(work, tables, groups, s, gamma, segments.length[n], scale)
            search_peaks(work, groups.count[s], K, scale, high[w], low[w])
        if n + 1 < segments.time.size and segments.window[n + 1] != w:
            for j in range(K):
                if high[w, j] > low[w, j]:
                    scale[j] = high[w, j] - low[w, j]


@kernel
def _fill_functions(work, tables, groups, s, gamma, T, scale):  # type: ignore[no-untyped-def]
    """The segment of length T in state s whose outputs have the coefficients gamma (B, K)."""
    K = gamma.shape[1]
    for g in range(groups.count[s]):
        work.degree[g] = 0
    for b in range(tables.n_basis[s]):
        g = groups.of_basis[s, b]
        work.degree[g] = max(work.degree[g], tables.power[s, b])
    for g in range(groups.count[s]):
        for j in range(K):
            for p in range(work.degree[g] + 1):
                work.poly[j, p, g] = 0.0
    for b in range(tables.n_basis[s]):
        g, p = groups.of_basis[s, b], tables.power[s, b]
        for j in range(K):
            work.poly[j, p, g] += gamma[b, j] * T**p
    for g in range(groups.count[s]):
        lam = groups.exponent[s, g]
        work.exponent[g] = lam * T
        work.end[g] = _exp(lam.real, lam.imag, T)
        live = False
        for j in range(K):
            length = work.length[j, g]
            for q in range(5):
                length[q] = 0.0
            for p in range(work.degree[g] + 1):
                part = size(work.poly[j, p, g])
                for q in range(5):
                    length[q] += part
                    part *= p - q
            live = live or length[0] > PRUNED * scale[j]
        work.live[g] = live


@kernel
def size(z):  # type: ignore[no-untyped-def]
    """Of a complex number; a tenth of the cost of abs, which avoids overflow."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


@kernel
def _fill(work, G, K):  # type: ignore[no-untyped-def]
    """Coefficients of all outputs, their slopes and curvatures; returns the number of columns."""
    peaks = work.peaks
    first = 0
    for g in range(G):
        if not work.live[g]:
            continue
        peaks.column[g] = first
        lam, dg = work.exponent[g], work.degree[g]
        square = lam * lam
        for p in range(dg + 1):
            q = first + p
            for j in range(K):
                a = work.poly[j, p, g]
                slope, curve = lam * a, square * a
                if p < dg:
                    b = (p + 1.0) * work.poly[j, p + 1, g]
                    slope += b
                    curve += 2.0 * (lam * b)
                if p + 2 <= dg:
                    curve += ((p + 1.0) * (p + 2.0)) * work.poly[j, p + 2, g]
                i = 3 * j
                peaks.real[i, q], peaks.imag[i, q] = a.real, a.imag
                peaks.real[i + 1, q], peaks.imag[i + 1, q] = slope.real, slope.imag
                peaks.real[i + 2, q], peaks.imag[i + 2, q] = curve.real, curve.imag
        first += dg + 1
    return first


@kernel
def _turn(work, G, s, out):  # type: ignore[no-untyped-def]
    """Exponentials of the groups at s."""
    for g in range(G):
        if work.live[g]:
            lam = work.exponent[g]
            out[g] = _exp(lam.real, lam.imag, s)


@kernel
def _values(work, G, K, columns, first):  # type: ignore[no-untyped-def]
    """Rows of the grid at the points of a block, which begins at index ``first``."""
    peaks = work.peaks
    wave = peaks.wave
    s = peaks.times[first : first + EQUAL]
    for g in range(G):
        if not work.live[g]:
            continue
        q = peaks.column[g]
        row, e, ratio = wave[q], peaks.turned[g], peaks.ratio[g]
        for i in range(EQUAL):  # exponentials follow from those before
            e = e * ratio
            row[i], row[EQUAL + i] = e.real, e.imag
        for p in range(1, work.degree[g] + 1):
            before, row = wave[q + p - 1], wave[q + p]
            for i in range(EQUAL):
                row[i], row[EQUAL + i] = before[i] * s[i], before[EQUAL + i] * s[i]
    for c in range(3 * K):
        out = peaks.grid[c, first : first + EQUAL]
        for i in range(EQUAL):
            out[i] = 0.0
        for q in range(columns):
            real, imag, row = peaks.real[c, q], peaks.imag[c, q], wave[q]
            for i in range(EQUAL):
                out[i] += real * row[i] - imag * row[EQUAL + i]


@kernel
def _value(work, G, j, s, out):  # type: ignore[no-untyped-def]
    """Value, slope and curvature of one output at any s."""
    peaks = work.peaks
    v0, v1, v2 = 0.0, 0.0, 0.0
    i = 3 * j
    for g in range(G):
        if not work.live[g]:
            continue
        lam, dg = work.exponent[g], work.degree[g]
        e = _exp(lam.real, lam.imag, s)
        real, imag, first = peaks.real, peaks.imag, peaks.column[g]
        q = first + dg
        r0, r1, r2 = real[i, q], real[i + 1, q], real[i + 2, q]
        i0, i1, i2 = imag[i, q], imag[i + 1, q], imag[i + 2, q]
        for q in range(first + dg - 1, first - 1, -1):
            r0, r1, r2 = r0 * s + real[i, q], r1 * s + real[i + 1, q], r2 * s + real[i + 2, q]
            i0, i1, i2 = i0 * s + imag[i, q], i1 * s + imag[i + 1, q], i2 * s + imag[i + 2, q]
        v0 += r0 * e.real - i0 * e.imag
        v1 += r1 * e.real - i1 * e.imag
        v2 += r2 * e.real - i2 * e.imag
    out[0], out[1], out[2] = v0, v1, v2


@kernel
def _bounds(work, G, K, out):  # type: ignore[no-untyped-def]
    """Bounds on the second and the fourth derivative from where the groups have turned to until 1."""
    for j in range(K):
        out[j, 0] = 0.0
        out[j, 1] = 0.0
    for g in range(G):
        if not work.live[g]:
            continue
        lam = work.exponent[g]
        e = work.end[g] if lam.real > 0.0 else work.peaks.turned[g]
        level, r = size(e), size(lam)
        if work.degree[g] == 0:
            second = level * r * r
            fourth = second * r * r
            for j in range(K):
                out[j, 0] += second * work.length[j, g, 0]
                out[j, 1] += fourth * work.length[j, g, 0]
            continue
        for j in range(K):
            a0, a1 = work.length[j, g, 0], work.length[j, g, 1]
            a2, a3, a4 = work.length[j, g, 2], work.length[j, g, 3], work.length[j, g, 4]
            out[j, 0] += level * (a2 + r * (2.0 * a1 + r * a0))
            out[j, 1] += level * (a4 + r * (4.0 * a3 + r * (6.0 * a2 + r * (4.0 * a1 + r * a0))))


@kernel
def _round_off(work, G, out):  # type: ignore[no-untyped-def]
    """That of the outputs (K,) anywhere on the segment."""
    for j in range(out.size):
        out[j] = 0.0
    for g in range(G):
        if work.live[g]:
            lam = work.exponent[g]
            level = EPS * (size(work.end[g]) if lam.real > 0.0 else 1.0) * (8.0 + size(lam))
            for j in range(out.size):
                out[j] += work.length[j, g, 0] * level


@kernel
def search_peaks(work, G, K, scale, high, low):  # type: ignore[no-untyped-def]
    """Raise the highest and lower the lowest values so far (K,) to those of the segment; ``scale`` are the ranges.

    Between two points bounds limit how far an output can rise above the chord, or above the cubic that has its values
    and slopes there; only where both allow more than the highest value so far is the interval looked into, first
    beside the highest point.
    """
    peaks = work.peaks
    grid, times = peaks.grid, peaks.times
    columns = _fill(work, G, K)
    last, blocks = 0, 0
    times[0] = 0.0
    for i in range(3 * K):
        grid[i, 0] = 0.0
    for g in range(G):
        peaks.turned[g] = 1.0
        if work.live[g]:
            for i in range(3 * K):
                grid[i, 0] += peaks.real[i, peaks.column[g]]
    for j in range(K):
        spread = 0.0
        for g in range(G):
            if work.live[g]:
                spread = max(spread, work.length[j, g, 0])
        if spread > scale[j]:
            scale[j] = spread
    while times[last] < 1.0:
        s = times[last]
        h = 1.0 - s
        if blocks > 0:
            _turn(work, G, s, peaks.turned)
        bound = peaks.bound[blocks]
        _bounds(work, G, K, bound)
        for j in range(K):
            if bound[j, 0] > 0.0:
                allowed = GRID * scale[j]
                step = max(math.sqrt(8.0 * allowed / bound[j, 0]), math.sqrt(math.sqrt(384.0 * allowed / bound[j, 1])))
                h = min(h, max(step, 1.0 / (MOST_POINTS - EQUAL - 4)))
        # a few equal steps, over which exponentials follow from those before
        steps = min(EQUAL, max(1, math.ceil((1.0 - s) / h - 1e-9)))
        if s + steps * h > 1.0:
            h = (1.0 - s) / steps
        _turn(work, G, h, peaks.ratio)
        for i in range(1, EQUAL + 1):  # what lies behind 1 is not looked at
            times[last + i] = s + i * h if s + i * h < 1.0 - 1e-9 else 1.0
            peaks.block[last + i - 1] = blocks
        _values(work, G, K, columns, last + 1)
        last += steps
        blocks += 1
    _round_off(work, G, peaks.round_off)
    for j in range(K):
        slack = FINEST * scale[j] + 4.0 * peaks.round_off[j]
        high[j] = _highest(work, G, j, 1.0, last, slack, high[j])
        low[j] = -_highest(work, G, j, -1.0, last, slack, -low[j])


@kernel
def _highest(work, G, j, sign, last, slack, best):  # type: ignore[no-untyped-def]
    """Largest value of ``sign * output j`` on the segment, at least ``best``, from the grid of `search_peaks`."""
    peaks = work.peaks
    times, values = peaks.times, peaks.grid[3 * j]
    at = 0
    for i in range(last + 1):
        if sign * values[i] > sign * values[at]:
            at = i
    best = max(best, sign * values[at])
    for n in range(last + 2):
        i = at - 1 + n if n < 2 else n - 2
        if 0 <= i < last and (n < 2 or i < at - 1 or i > at):
            bounds, h = peaks.bound[peaks.block[i], j], times[i + 1] - times[i]
            if max(sign * values[i], sign * values[i + 1]) + 0.125 * bounds[0] * h * h > best + slack:
                start, end = peaks.ends[0], peaks.ends[1]
                for q in range(3):
                    start[q], end[q] = peaks.grid[3 * j + q, i], peaks.grid[3 * j + q, i + 1]
                if _may_exceed(best + slack, sign, start, end, bounds, h):
                    best = _climb(work, G, j, sign, (times[i], times[i + 1], start, end), bounds, slack, best)
    return best


@kernel
def _may_exceed(limit, sign, at_left, at_right, bounds, h):  # type: ignore[no-untyped-def]
    """Whether ``sign`` times an output may be above a limit between two points with a distance h.

    The first two are value, slope and curvature, ``bounds`` those on the second and the fourth derivative. The chord is
    missed by at most ``bounds[0] h^2 / 8``, the cubic with the same values and slopes by ``bounds[1] h^4 / 384``, and
    its slope by ``sqrt(3) bounds[1] h^3 / 216``: where that does not reach zero, an end is highest.
    """
    fa, fb = sign * at_left[0], sign * at_right[0]
    top = max(fa, fb)
    if top > limit:
        return True
    d = abs(fb - fa)
    bend = 0.5 * bounds[0] * h * h
    if d >= bend or 0.5 * (fa + fb) + 0.25 * bend + 0.25 * d * d / bend <= limit:
        return False
    da, db, c, e = _cubic(sign, at_left, at_right, h)
    fourth = bounds[1] * h**4
    steepest, flattest = max(da, db), min(da, db)
    if 0.0 < -c * e < 3.0 * e * e:  # where the cubic's slope is extreme
        extreme = da - c * c / (3.0 * e)
        steepest, flattest = max(steepest, extreme), min(flattest, extreme)
    if flattest > SLOPE * fourth or steepest < -SLOPE * fourth:
        return False
    u = _top(da, c, e)
    return max(top, fa + u * (da + u * (c + u * e))) + fourth / 384.0 > limit


@kernel
def _cubic(sign, at_left, at_right, h):  # type: ignore[no-untyped-def]
    """Of the cubic with the values and slopes of two points, in u = t / h: slopes at the ends, factors of u^2, u^3."""
    rise = sign * (at_right[0] - at_left[0])
    da, db = sign * at_left[1] * h, sign * at_right[1] * h
    return da, db, 3.0 * rise - 2.0 * da - db, da + db - 2.0 * rise


@kernel
def _top(da, c, e):  # type: ignore[no-untyped-def]
    """Where within (0, 1) a cubic with slope da + 2 c u + 3 e u^2 has its maximum; 0 if it has none there."""
    square = c * c - 3.0 * e * da
    u = 0.0
    if square > 0.0:  # the root of the slope where the curvature is negative
        root = math.sqrt(square)
        if c <= 0.0:
            u = da / (root - c)
        elif e != 0.0:
            u = -(c + root) / (3.0 * e)
    return u if u < 1.0 and u > 0.0 else 0.0


@kernel
def _newton(work, G, j, sign, places, third, slack, best):  # type: ignore[no-untyped-def]
    """The same where the curvature is negative from u to v, the slope positive at u and negative at v.

    ``places`` are u, v and a guess.

    ``third`` bounds the third derivative. Where it allows that, the parabola at a point gives the maximum.
    """
    single, (u, v, t) = work.peaks.single, places
    for _ in range(60):
        if not (u < t < v):
            t = 0.5 * (u + v)
            if not (u < t < v):
                break
        _value(work, G, j, t, single)
        d, curve = sign * single[1], sign * single[2]
        best = max(best, sign * single[0])
        # at a slope d the maximum is no higher above than this
        if d * d <= -curve * slack:
            break
        if d > 0.0:
            u = t
        else:
            v = t
        step = -d / curve
        if u < t + step < v and 2.0 * third * abs(step) < -curve and third * abs(step) ** 3 <= EXACT * slack:
            best = max(best, sign * single[0] + 0.5 * d * step)
            break
        t += step
    return best


@kernel
def _climb(work, G, j, sign, interval, bounds, slack, best):  # type: ignore[no-untyped-def]
    """Largest value of ``sign * output j`` between two points, at least ``best``, to within ``slack``; ``interval`` are
    both places, and value, slope and curvature there.

    An interval is cut where the cubic through its ends is highest, until it holds nothing higher or its curvature is
    negative throughout: then it has a single maximum.
    """
    single, stack = work.peaks.single, work.peaks.stack
    stack[0, 0], stack[0, 1], at_left, at_right = interval
    for q in range(3):
        stack[0, 2 + q] = at_left[q]
        stack[0, 5 + q] = at_right[q]
    depth = 1
    while depth > 0:
        depth -= 1
        a, b = stack[depth, 0], stack[depth, 1]
        start, end = stack[depth, 2:5], stack[depth, 5:8]
        h = b - a
        if not _may_exceed(best + slack, sign, start, end, bounds, h):
            continue
        da, _, c, e = _cubic(sign, start, end, h)
        t = a + h * _top(da, c, e)
        if max(sign * start[2], sign * end[2]) + 0.125 * bounds[1] * h * h < 0.0:
            if sign * start[1] > 0.0 and sign * end[1] < 0.0:
                third = abs(end[2] - start[2]) / h + bounds[1] * h
                best = _newton(work, G, j, sign, (a, b, t), third, slack, best)
            continue
        if not (a + 0.05 * h < t < b - 0.05 * h):
            t = 0.5 * (a + b)
        if depth + 2 > stack.shape[0] or not (a < t < b):
            continue
        _value(work, G, j, t, single)
        best = max(best, sign * single[0])
        for q in range(3):
            stack[depth + 1, 5 + q] = end[q]
            stack[depth + 1, 2 + q] = single[q]
            stack[depth, 5 + q] = single[q]
        stack[depth + 1, 0], stack[depth + 1, 1] = t, b
        stack[depth, 1] = t
        depth += 2
    return best
