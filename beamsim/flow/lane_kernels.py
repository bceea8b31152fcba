"""Compiled integrals of many exponentials at once.

Where a sum of exponentials is integrated against one function, the same recursion serves every exponential. They stand
side by side in *lanes*, so that the processor takes several in one instruction. Numbers of a block of lanes lie in one
array, at distances that the compiler knows: it need not ask whether they overlap.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel, summing
from beamsim.flow.integral_kernels import SMALL, UPWARD, moments

LANES = 16  # of a block
EXPONENT, EXPONENTIAL, HERE, INVERSE, MOMENT, INTEGRAL = 0, 2 * LANES, 4 * LANES, 6 * LANES, 8 * LANES, 10 * LANES
CANCELLING = 0.5  # an exponent without powers is small where e^x - 1 loses more than a digit
BLOCK = 12 * LANES  # numbers of a block: real parts of the above, each followed by the imaginary parts


class Lanes(NamedTuple):
    """Exponentials ``a_l exp(x_l s)`` of K outputs: every one, then its conjugate; the last block may not be full."""

    block: Any  # (blocks, BLOCK)
    amplitude: Any  # (blocks, K, 2 LANES) real parts of a_l, then imaginary parts
    group: Any  # (G,) groups that are in the lanes, in order


@kernel
def make_lanes(G, K):  # type: ignore[no-untyped-def]
    """Work arrays for G groups and K outputs."""
    blocks = 2 * G // LANES + 1
    return Lanes(np.zeros((blocks, BLOCK)), np.zeros((blocks, K, 2 * LANES)), np.zeros(G, dtype=np.int64))


@kernel
def fill_lanes(work, G, K):  # type: ignore[no-untyped-def]
    """Take up the live groups that have no powers of time; returns their number."""
    lanes, count = work.lanes, 0
    for g in range(G):
        if not work.live[g] or work.degree[g] > 0:
            continue
        lanes.group[count] = g
        block, i = 2 * count // LANES, 2 * count % LANES
        row, amplitude = lanes.block[block], lanes.amplitude[block]
        x, e = work.exponent[g], work.end[g]
        row[EXPONENT + i], row[EXPONENT + LANES + i] = x.real, x.imag
        row[EXPONENTIAL + i], row[EXPONENTIAL + LANES + i] = e.real, e.imag
        row[EXPONENT + i + 1], row[EXPONENT + LANES + i + 1] = x.real, -x.imag
        row[EXPONENTIAL + i + 1], row[EXPONENTIAL + LANES + i + 1] = e.real, -e.imag
        for j in range(K):
            a = work.poly[j, 0, g]
            amplitude[j, i], amplitude[j, LANES + i] = a.real, a.imag
            amplitude[j, i + 1], amplitude[j, LANES + i + 1] = a.real, -a.imag
        count += 1
    if 2 * count % LANES > 0:
        amplitude = lanes.amplitude[2 * count // LANES]
        for j in range(K):
            for i in range(2 * count % LANES, LANES):
                amplitude[j, i], amplitude[j, LANES + i] = 0.0, 0.0
    return count


@kernel
def integrate_lanes(row, last, factor, top, shift, end, front, moment):  # type: ignore[no-untyped-def]
    """``front int_0^1 factor(s) exp((x_l + shift) s) ds`` of a block's first lanes.

    ``factor`` holds the coefficients of a polynomial of degree ``top``, ``end`` is exp(shift); ``moment`` (top + 1,) is
    for work. See `moments`, of which this is the upward recursion; that takes the others.
    """
    small = SMALL if top > 0 else CANCELLING
    sr, si = shift.real, shift.imag
    br, bi = end.real, end.imag
    fr, fi = factor[0].real, factor[0].imag
    for i in range(last):
        xr, xi = row[EXPONENT + i] + sr, row[EXPONENT + LANES + i] + si
        er, ei = row[EXPONENTIAL + i], row[EXPONENTIAL + LANES + i]
        er, ei = er * br - ei * bi, er * bi + ei * br
        inverse = 1.0 / (xr * xr + xi * xi)
        ir, ii = xr * inverse, -xi * inverse
        mr, mi = (er - 1.0) * ir - ei * ii, (er - 1.0) * ii + ei * ir
        row[HERE + i], row[HERE + LANES + i] = er, ei
        row[INVERSE + i], row[INVERSE + LANES + i] = ir, ii
        row[MOMENT + i], row[MOMENT + LANES + i] = mr, mi
        row[INTEGRAL + i], row[INTEGRAL + LANES + i] = fr * mr - fi * mi, fr * mi + fi * mr
    for q in range(1, min(top, UPWARD) + 1):
        fr, fi = factor[q].real, factor[q].imag
        power = float(q)
        for i in range(last):
            ar = row[HERE + i] - power * row[MOMENT + i]
            ai = row[HERE + LANES + i] - power * row[MOMENT + LANES + i]
            ir, ii = row[INVERSE + i], row[INVERSE + LANES + i]
            mr, mi = ar * ir - ai * ii, ar * ii + ai * ir
            row[MOMENT + i], row[MOMENT + LANES + i] = mr, mi
            row[INTEGRAL + i] += fr * mr - fi * mi
            row[INTEGRAL + LANES + i] += fr * mi + fi * mr
    for i in range(last):
        x = complex(row[EXPONENT + i] + sr, row[EXPONENT + LANES + i] + si)
        if abs(x.real) + abs(x.imag) < small or top > UPWARD:
            moments(x, complex(row[HERE + i], row[HERE + LANES + i]), top, moment)
            total = 0.0 + 0.0j
            for q in range(top + 1):
                total += factor[q] * moment[q]
            row[INTEGRAL + i], row[INTEGRAL + LANES + i] = total.real, total.imag
    fr, fi = front.real, front.imag
    for i in range(last):
        tr, ti = row[INTEGRAL + i], row[INTEGRAL + LANES + i]
        row[INTEGRAL + i], row[INTEGRAL + LANES + i] = tr * fr - ti * fi, tr * fi + ti * fr


@summing
def sum_lanes(row, amplitude):  # type: ignore[no-untyped-def]
    """Sum of the integrals of a block's lanes times an output's amplitudes (2 LANES,), which are 0 in lanes not in use.

    In an order that suits the processor.
    """
    real, imag = 0.0, 0.0
    for i in range(LANES):
        ar, ai = amplitude[i], amplitude[LANES + i]
        tr, ti = row[INTEGRAL + i], row[INTEGRAL + LANES + i]
        real += ar * tr - ai * ti
        imag += ar * ti + ai * tr
    return complex(real, imag)
