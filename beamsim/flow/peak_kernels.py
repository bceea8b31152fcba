"""Compiled search for the highest and lowest values of outputs on a segment of a swept sine.

An output is a sum of groups, polynomials times exponentials in s, the time on the segment over its length. Its slope
and curvature are such sums as well; the coefficients of all of them stand side by side, so that one loop without
branches adds a group to all outputs at a point.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import allocating, inner
from beamsim.flow.kernels import EPS, _exp

FINEST = 1e-10  # of an output's range: peaks are found to this
EXACT = 0.01  # of that, what the cube of the last step may change
GRID = 0.05  # share of its range by which an output may miss the chord or the cubic between two points
SLOPE = math.sqrt(3.0) / 216.0  # error of the slope of an interpolating cubic, over the fourth derivative and h^3
MOST_POINTS = 300  # of the grid on a segment
EQUAL = 16  # steps of that grid, before its width is chosen anew
LANES = 4  # rows of coefficients are filled up to a multiple of this


class Peaks(NamedTuple):
    """Work arrays; W is 3 K or a little more, with value, slope and curvature of output j from 3 j on."""

    real: Any  # (G, P, W) coefficients of the polynomials
    imag: Any  # (G, P, W)
    sum_real: Any  # (W,)
    sum_imag: Any  # (W,)
    turned: Any  # (G,) exponentials at the point that is looked at
    ratio: Any  # (G,) of two such, a step of the grid apart
    grid: Any  # (points, W)
    times: Any  # (points,)
    block: Any  # (points,) block of equal steps to which the interval after a point belongs
    bound: Any  # (blocks, K, 2) on the second and the fourth derivative from a block's start to 1
    round_off: Any  # (K,)
    single: Any  # (3,)
    stack: Any  # (80, 8)


@allocating
def make_peaks(G, P, K):  # type: ignore[no-untyped-def]
    """Work arrays for K outputs of G groups with P powers."""
    W = (3 * K + LANES - 1) // LANES * LANES
    return Peaks(
        np.zeros((G, P, W)),
        np.zeros((G, P, W)),
        np.zeros(W),
        np.zeros(W),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.complex128),
        np.zeros((MOST_POINTS, W)),
        np.zeros(MOST_POINTS),
        np.zeros(MOST_POINTS, dtype=np.int64),
        np.zeros((MOST_POINTS, K, 2)),
        np.zeros(K),
        np.zeros(3),
        np.zeros((80, 8)),
    )


@inner
def size(z):  # type: ignore[no-untyped-def]
    """Of a complex number; a tenth of the cost of abs, which avoids overflow."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


@inner
def _fill(work, G, K):  # type: ignore[no-untyped-def]
    """Coefficients of all outputs, their slopes and curvatures."""
    peaks = work.peaks
    for g in range(G):
        if not work.live[g]:
            continue
        lam, dg = work.exponent[g], work.degree[g]
        square = lam * lam
        for p in range(dg + 1):
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
                peaks.real[g, p, i], peaks.imag[g, p, i] = a.real, a.imag
                peaks.real[g, p, i + 1], peaks.imag[g, p, i + 1] = slope.real, slope.imag
                peaks.real[g, p, i + 2], peaks.imag[g, p, i + 2] = curve.real, curve.imag


@inner
def _turn(work, G, s, out):  # type: ignore[no-untyped-def]
    """Exponentials of the groups at s."""
    for g in range(G):
        if work.live[g]:
            lam = work.exponent[g]
            out[g] = _exp(lam.real, lam.imag, s)


@inner
def _add(real, imag, e, out):  # type: ignore[no-untyped-def]
    """Add ``Re[(real + i imag) e]``."""
    er, ei = e.real, e.imag
    for i in range(out.size):
        out[i] += real[i] * er - imag[i] * ei


@inner
def _raise(real, imag, s, sum_real, sum_imag):  # type: ignore[no-untyped-def]
    """One step of Horner's rule."""
    for i in range(sum_real.size):
        sum_real[i] = sum_real[i] * s + real[i]
        sum_imag[i] = sum_imag[i] * s + imag[i]


@inner
def _values(work, G, s, out):  # type: ignore[no-untyped-def]
    """Value, slope and curvature of all outputs at s, where the groups have turned that far."""
    peaks = work.peaks
    for i in range(out.size):
        out[i] = 0.0
    for g in range(G):
        if not work.live[g]:
            continue
        real, imag, dg = peaks.real[g], peaks.imag[g], work.degree[g]
        if dg == 0:
            _add(real[0], imag[0], peaks.turned[g], out)
            continue
        for i in range(out.size):
            peaks.sum_real[i] = real[dg, i]
            peaks.sum_imag[i] = imag[dg, i]
        for p in range(dg - 1, -1, -1):
            _raise(real[p], imag[p], s, peaks.sum_real, peaks.sum_imag)
        _add(peaks.sum_real, peaks.sum_imag, peaks.turned[g], out)


@inner
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
        real, imag = peaks.real[g], peaks.imag[g]
        r0, r1, r2 = real[dg, i], real[dg, i + 1], real[dg, i + 2]
        i0, i1, i2 = imag[dg, i], imag[dg, i + 1], imag[dg, i + 2]
        for p in range(dg - 1, -1, -1):
            r0, r1, r2 = r0 * s + real[p, i], r1 * s + real[p, i + 1], r2 * s + real[p, i + 2]
            i0, i1, i2 = i0 * s + imag[p, i], i1 * s + imag[p, i + 1], i2 * s + imag[p, i + 2]
        v0 += r0 * e.real - i0 * e.imag
        v1 += r1 * e.real - i1 * e.imag
        v2 += r2 * e.real - i2 * e.imag
    out[0], out[1], out[2] = v0, v1, v2


@inner
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


@inner
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


@inner
def search_peaks(work, G, K, scale, high, low):  # type: ignore[no-untyped-def]
    """Raise the highest and lower the lowest values so far (K,) to those of the segment; ``scale`` are the ranges.

    Between two points bounds limit how far an output can rise above the chord, or above the cubic that has its values
    and slopes there; only where both allow more than the highest value so far is the interval looked into, first
    beside the highest point.
    """
    peaks = work.peaks
    grid, times = peaks.grid, peaks.times
    _fill(work, G, K)
    last, blocks = 0, 0
    times[0] = 0.0
    for g in range(G):
        peaks.turned[g] = 1.0
    _values(work, G, 0.0, grid[0])
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
        for i in range(1, steps + 1):
            peaks.block[last] = blocks
            last += 1
            times[last] = s + i * h if s + i * h < 1.0 - 1e-9 else 1.0
            for g in range(G):
                peaks.turned[g] *= peaks.ratio[g]
            _values(work, G, times[last], grid[last])
        blocks += 1
    _round_off(work, G, peaks.round_off)
    for j in range(K):
        slack = FINEST * scale[j] + 4.0 * peaks.round_off[j]
        high[j] = _highest(work, G, j, 1.0, last, slack, high[j])
        low[j] = -_highest(work, G, j, -1.0, last, slack, -low[j])


@inner
def _highest(work, G, j, sign, last, slack, best):  # type: ignore[no-untyped-def]
    """Largest value of ``sign * output j`` on the segment, at least ``best``, from the grid of `search_peaks`."""
    peaks = work.peaks
    grid, times = peaks.grid, peaks.times
    at, c = 0, 3 * j
    for i in range(last + 1):
        if sign * grid[i, c] > sign * grid[at, c]:
            at = i
    best = max(best, sign * grid[at, c])
    for n in range(last + 2):
        i = at - 1 + n if n < 2 else n - 2
        if 0 <= i < last and (n < 2 or i < at - 1 or i > at):
            bounds, h = peaks.bound[peaks.block[i], j], times[i + 1] - times[i]
            if max(sign * grid[i, c], sign * grid[i + 1, c]) + 0.125 * bounds[0] * h * h > best + slack:
                start, end = grid[i, c : c + 3], grid[i + 1, c : c + 3]
                if _may_exceed(best + slack, sign, start, end, bounds, h):
                    best = _climb(work, G, j, sign, times[i], times[i + 1], start, end, bounds, slack, best)
    return best


@inner
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


@inner
def _cubic(sign, at_left, at_right, h):  # type: ignore[no-untyped-def]
    """Of the cubic with the values and slopes of two points, in u = t / h: slopes at the ends, factors of u^2, u^3."""
    rise = sign * (at_right[0] - at_left[0])
    da, db = sign * at_left[1] * h, sign * at_right[1] * h
    return da, db, 3.0 * rise - 2.0 * da - db, da + db - 2.0 * rise


@inner
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


@inner
def _newton(work, G, j, sign, u, v, t, third, slack, best):  # type: ignore[no-untyped-def]
    """The same where the curvature is negative from u to v, the slope positive at u and negative at v; t is a guess.

    ``third`` bounds the third derivative. Where it allows that, the parabola at a point gives the maximum.
    """
    single = work.peaks.single
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


@inner
def _climb(work, G, j, sign, left, right, at_left, at_right, bounds, slack, best):  # type: ignore[no-untyped-def]
    """Largest value of ``sign * output j`` between two points, at least ``best``, to within ``slack``.

    An interval is cut where the cubic through its ends is highest, until it holds nothing higher or its curvature is
    negative throughout: then it has a single maximum.
    """
    single, stack = work.peaks.single, work.peaks.stack
    stack[0, 0] = left
    stack[0, 1] = right
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
                best = _newton(work, G, j, sign, a, b, t, third, slack, best)
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
