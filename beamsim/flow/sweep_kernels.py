"""Compiled parts of the march that a swept sine adds: forced responses by window, and the record of every cycle.

On a window the inputs are :math:`\\mathrm{Re}[e^{i\\omega\\tau} \\sum_p c_p \\tau^p]`. In the eigenvectors of a contact
state the response that belongs to them is a polynomial times the same exponential,

.. math:: w' = (\\Lambda - i\\omega) w + \\beta(\\tau), \\qquad
          w_p = (i\\omega - \\Lambda)^{-1} (\\beta_p - (p + 1) w_{p+1}),

or, where :math:`i\\omega` is so close to an eigenvalue that this would cancel, the power series of the solution that
starts from zero. What remains, free motion and dead loads, comes from the tables of
:mod:`beamsim.flow.contact_state`. A *group* is an exponent with a polynomial; ``s`` is the time on a segment
over its length.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.integral_kernels import moments
from beamsim.flow.kernels import EPS, _coefficients, _exp
from beamsim.flow.lane_kernels import LANES, fill_lanes, integrate_lanes, make_lanes, sum_lanes
from beamsim.flow.peak_kernels import make_peaks, search_peaks, size

MOST_POWERS = 48  # of a forced response's polynomial
WELL_CONDITIONED = 30.0  # sum of a recursion's terms over the first, below which it needs no power series
ONE = np.ones(1, dtype=np.complex128)  # a polynomial
PRUNED = 1e-13  # a group whose share of an output is smaller is left out of integrals and searches


class Forced(NamedTuple):
    """Eigenvectors of S contact states, E each, in upper triangular blocks, and what the L channels do to them."""

    count: Any  # (S,)
    eigenvalue: Any  # (S, E)
    coupling: Any  # (S, E, E) strictly upper
    block_start: Any  # (S, E) first index of the block
    block_end: Any  # (S, E) one past its last index
    spread: Any  # (S, E) size of the block's part off its eigenvalue
    right: Any  # (S, E, N)
    gain: Any  # (S, L, E)
    gain_slope: Any  # (S, L, E) on the channel's time derivative


class OutputTables(NamedTuple):
    """Rows of the watched functions (see `kernels.Tables`) and of the outputs, per state."""

    watch_row: Any  # (S, w, N)
    watch_channel: Any  # (S, w, L)
    watch_slope: Any  # (S, w, L)
    watch_size: Any  # (S, w, 3) lengths of the rows' parts: displacements, velocities, internal states
    output: Any  # (S, T, K) bare part, by term
    output_row: Any  # (S, K, N)
    output_channel: Any  # (S, K, L)
    output_slope: Any  # (S, K, L)
    basis_group: Any  # (S, B) group of each basis function
    group_count: Any  # (S,)
    group_exponent: Any  # (S, G)


class Windows(NamedTuple):
    """The input's windows, coefficients about their middles."""

    start: Any  # (W,)
    length: Any  # (W,)
    omega: Any  # (W,)
    cycle: Any  # (W,)
    fraction: Any  # (W,)
    degree: Any  # (W,)
    channel: Any  # (L, W, D + 1)
    deviation: Any  # (W, D + 1)
    order: Any  # (R,) of the tracked harmonics


class Cycles(NamedTuple):
    """Record of C cycles."""

    high: Any  # (C, K)
    low: Any  # (C, K)
    square: Any  # (C, K) integral of the square
    harmonic: Any  # (C, K, R) integral of output * exp(-i order phase) d phase; of order 0, over time
    closed_time: Any  # (C, m)
    closings: Any  # (C, m)
    scale: Any  # (K,) range of the outputs over the last cycle
    imbalance: Any  # (C,) dissipated energy and change of the stored one, less the work in, J
    energy: Any  # (C,) largest kinetic and strain energy of the structure, J


class PowerBalance(NamedTuple):
    """Gradient of the energy and form of the powers, per state; see :mod:`beamsim.flow.power_balance`."""

    gradient: Any  # (S, N, Z)
    form: Any  # (S, Z, Z) upper triangle
    stiffness: Any  # (n,) of the structure, 1/s^2


class Swept(NamedTuple):
    """What the march takes for a swept sine, where it takes None for piecewise sources alone."""

    forced: Forced
    outputs: OutputTables
    windows: Windows
    cycles: Cycles
    power: PowerBalance


class ForcedPart(NamedTuple):
    """The forced response on one segment, in polynomials of the time since its start, and work arrays."""

    channel: Any  # (L, D + 1)
    beta: Any  # (D + 1, E)
    w: Any  # (MOST_POWERS, E)
    state: Any  # (MOST_POWERS, N)
    sum: Any  # (N,)
    free: Any  # (N,) state at the start without the forced response
    watch: Any  # (w, MOST_POWERS) of the watched functions
    watch_size: Any  # (w, MOST_POWERS)
    output: Any  # (K, MOST_POWERS) of the outputs
    rate: Any  # (N,) of the state where the segment ends
    slope: Any  # (N,) of the forced polynomials there
    balance: Any  # (Z,) state, channels, their rates, and 1
    work: Any  # see `_Work`


@kernel
def _shift(c, degree, by):  # type: ignore[no-untyped-def]
    """Coefficients of a polynomial about another point, in place."""
    for i in range(degree):
        for p in range(degree - 1, i - 1, -1):
            c[p] += by * c[p + 1]


@kernel
def _forced_response(forced, windows, s, k, x, H, c, beta, w, U):  # type: ignore[no-untyped-def]
    """Channels c (L, D + 1) and forced state U (Q, N) about the point ``x`` after the start of window k.

    Returns the number of powers Q in use. H is the longest time for which the series has to hold.
    """
    L = c.shape[0]
    N = U.shape[1]
    D = windows.degree[k]
    omega = windows.omega[k]
    sigma = x - 0.5 * windows.length[k]
    turn = complex(math.cos(omega * sigma), math.sin(omega * sigma))
    for a in range(L):
        for p in range(D + 1):
            c[a, p] = windows.channel[a, k, p] * turn
        _shift(c[a], D, sigma)
    E = forced.count[s]
    nu = complex(0.0, omega)
    for p in range(D + 1):
        for e in range(E):
            beta[p, e] = 0.0
        for a in range(L):
            slope = nu * c[a, p]
            if p < D:
                slope += (p + 1) * c[a, p + 1]
            for e in range(E):
                beta[p, e] += forced.gain[s, a, e] * c[a, p] + forced.gain_slope[s, a, e] * slope
    most = U.shape[0]
    used = D + 1
    for q in range(most):
        for i in range(N):
            U[q, i] = 0.0
    first = E
    while first > 0:
        last = first
        first = forced.block_start[s, last - 1]
        width = last - first
        distance = np.inf
        for e in range(first, last):
            distance = min(distance, size(nu - forced.eigenvalue[s, e]))
        spread = forced.spread[s, first]
        near = distance * H < 1.0 + spread * H
        if near and width == 1 and distance > 0.0:
            total = size(beta[0, first])
            start = total
            factor = 1.0
            for p in range(1, D + 1):
                factor *= p / distance
                total += size(beta[p, first]) * factor
            near = total > WELL_CONDITIONED * start
        if near:
            powers = most
            largest = 0.0
            for e in range(first, last):
                w[0, e] = 0.0
            scale = 1.0
            for q in range(most - 1):
                scale *= H
                biggest = 0.0
                for e in range(first, last):
                    v = (forced.eigenvalue[s, e] - nu) * w[q, e]
                    for d in range(e + 1, last):
                        v += forced.coupling[s, e, d] * w[q, d]
                    if q <= D:
                        v += beta[q, e]
                    v /= q + 1
                    w[q + 1, e] = v
                    biggest = max(biggest, size(v) * scale)
                largest = max(largest, biggest)
                if q >= D and biggest <= 1e-18 * largest:
                    powers = q + 1
                    break
            used = max(used, powers)
        else:
            powers = D + 1
            for p in range(D, -1, -1):
                for e in range(last - 1, first - 1, -1):
                    v = beta[p, e]
                    if p < D:
                        v -= (p + 1) * w[p + 1, e]
                    for d in range(e + 1, last):
                        v += forced.coupling[s, e, d] * w[p, d]
                    w[p, e] = v / (nu - forced.eigenvalue[s, e])
        for e in range(first, last):
            for q in range(powers):
                v = w[q, e]
                if v != 0.0:
                    for i in range(N):
                        U[q, i] += forced.right[s, e, i] * v
    return used


@kernel
def _forced_rows(row, channel, slope, count, U, used, c, D, omega, out):  # type: ignore[no-untyped-def]
    """Coefficients (count, Q) of the forced part of linear outputs."""
    N = U.shape[1]
    L = c.shape[0]
    nu = complex(0.0, omega)
    for j in range(count):
        for q in range(used):
            total = 0.0 + 0.0j
            for i in range(N):
                total += row[j, i] * U[q, i]
            out[j, q] = total
        for a in range(L):
            if channel[j, a] != 0.0 or slope[j, a] != 0.0:
                for p in range(D + 1):
                    rate = nu * c[a, p]
                    if p < D:
                        rate += (p + 1) * c[a, p + 1]
                    out[j, p] += channel[j, a] * c[a, p] + slope[j, a] * rate


@kernel
def make_response(swept, tables, N):  # type: ignore[no-untyped-def]
    """Work arrays of the forced response, empty where nothing is swept."""
    if swept is None:
        return None
    L, _, DM = swept.windows.channel.shape
    E, K, rows = swept.forced.eigenvalue.shape[1], swept.outputs.output.shape[2], tables.watch.shape[2]
    return ForcedPart(
        np.zeros((L, DM), dtype=np.complex128),
        np.zeros((DM, E), dtype=np.complex128),
        np.zeros((MOST_POWERS, E), dtype=np.complex128),
        np.zeros((MOST_POWERS, N), dtype=np.complex128),
        np.zeros(N, dtype=np.complex128),
        np.zeros(N),
        np.zeros((rows, MOST_POWERS), dtype=np.complex128),
        np.zeros((rows, MOST_POWERS)),
        np.zeros((K, MOST_POWERS), dtype=np.complex128),
        np.zeros(N),
        np.zeros(N, dtype=np.complex128),
        np.zeros(N + 2 * L + 1),
        _make_work(swept.outputs, K, tables.exponent.shape[1], DM),
    )


@kernel
def respond(swept, response, s, k, x, H, y):  # type: ignore[no-untyped-def]
    """Forced response on a segment of length H that starts with state y, ``x`` after the start of window k.

    Returns the number of powers in use.
    """
    used = _forced_response(
        swept.forced, swept.windows, s, k, x, H, response.channel, response.beta, response.w, response.state
    )
    for i in range(y.size):
        response.free[i] = y[i] - response.state[0, i].real
    return used


@kernel
def watch_response(tables, swept, response, s, k, used, H, least):  # type: ignore[no-untyped-def]
    """The forced part of the watched functions, and its round-off, added to ``least``."""
    outputs, U = swept.outputs, response.state
    _forced_rows(
        outputs.watch_row[s], outputs.watch_channel[s], outputs.watch_slope[s], tables.watch.shape[2], U, used,
        response.channel, swept.windows.degree[k], swept.windows.omega[k], response.watch,
    )  # fmt: skip
    N = U.shape[1]
    n = (N - tables.states.sum()) // 2
    for q in range(used):
        position = 0.0
        speed = 0.0
        inside = 0.0
        for i in range(n):
            position += U[q, i].real ** 2 + U[q, i].imag ** 2
            speed += U[q, n + i].real ** 2 + U[q, n + i].imag ** 2
        for i in range(2 * n, N):
            inside += U[q, i].real ** 2 + U[q, i].imag ** 2
        a = 4.0 * EPS * H**q
        for j in range(least.size):
            response.watch_size[j, q] = size(response.watch[j, q])
            least[j] += a * max(
                math.sqrt(position) * outputs.watch_size[s, j, 0],
                math.sqrt(speed) * outputs.watch_size[s, j, 1],
                math.sqrt(inside) * outputs.watch_size[s, j, 2],
            )


@kernel
def add_watched(response, used, omega, tau, reach, count, out):  # type: ignore[no-untyped-def]
    """Add the forced part ``Re[e^{i omega tau} sum_q watch_q tau^q]`` to the result of `kernels._evaluate`."""
    cw, aw = response.watch, response.watch_size
    angle = omega * tau
    er, ei = math.cos(angle), math.sin(angle)
    for j in range(count):
        v = 0.0 + 0.0j
        d = 0.0 + 0.0j
        a0 = 0.0
        a1 = 0.0
        a2 = 0.0
        near = 0.0
        for q in range(used - 1, -1, -1):
            d = d * tau + v
            v = v * tau + cw[j, q]
            a2 = a2 * reach + 2.0 * a1
            a1 = a1 * reach + a0
            a0 = a0 * reach + aw[j, q]
            near = near * tau + aw[j, q]
        out[0, j] += v.real * er - v.imag * ei
        sr = d.real - omega * v.imag
        si = d.imag + omega * v.real
        out[1, j] += sr * er - si * ei
        out[2, j] += omega * omega * a0 + 2.0 * omega * a1 + a2
        out[3, j] += EPS * (8.0 + abs(angle)) * near


@kernel
def add_forced(poly, used, omega, tau, first, out):  # type: ignore[no-untyped-def]
    """Add ``Re[e^{i omega tau} sum_q poly[j, q] tau^q]`` to ``out[first + j]``."""
    turn = complex(math.cos(omega * tau), math.sin(omega * tau))
    for j in range(poly.shape[0]):
        v = 0.0 + 0.0j
        for q in range(used - 1, -1, -1):
            v = v * tau + poly[j, q]
        out[first + j] += v.real * turn.real - v.imag * turn.imag


@kernel
def add_forced_state(response, used, omega, tau, y):  # type: ignore[no-untyped-def]
    """Add the forced response at tau to the state; the loop over its entries is the inner one."""
    turn = complex(math.cos(omega * tau), math.sin(omega * tau))
    U, v = response.state, response.sum
    v[:] = 0.0
    for q in range(used - 1, -1, -1):
        for i in range(y.size):
            v[i] = v[i] * tau + U[q, i]
    for i in range(y.size):
        y[i] += v[i].real * turn.real - v[i].imag * turn.imag


@kernel
def balance_segment(tables, swept, response, s, k, tau, zeta, basis, used, start, y):  # type: ignore[no-untyped-def]
    """Add to its cycle how far a segment, from ``start`` to y after tau, is from the balance of energies.

    The rate of imbalance where it ends counts for all of it. The solution is a sum of terms that must meet the
    ``start``: what is missing there counts with the structure's energy.
    """
    power, cycles = swept.power, swept.cycles
    cycle, omega, D = swept.windows.cycle[k], swept.windows.omega[k], swept.windows.degree[k]
    N, n, L = y.size, power.stiffness.size, response.channel.shape[0]
    rate, z, missing = response.rate, response.balance, response.free
    rate[:] = 0.0
    for q in range(tables.n_terms[s]):
        b = tables.term_basis[s, q]
        amplitude = zeta[tables.term_source[s, q]]
        if amplitude == 0.0:
            continue
        slope = tables.exponent[s, b] * basis[b]
        if tables.power[s, b] > 0:
            slope += tables.power[s, b] * basis[b] / tau
        slope *= amplitude
        first = amplitude if tables.power[s, b] == 0 else 0.0j
        for i in range(N):
            v = tables.term_vector[s, q, i]
            rate[i] += v.real * slope.real - v.imag * slope.imag
            missing[i] -= v.real * first.real - v.imag * first.imag
    turn = complex(math.cos(omega * tau), math.sin(omega * tau))
    U, value, slopes = response.state, response.sum, response.slope
    value[:] = 0.0
    slopes[:] = 0.0
    for q in range(used - 1, -1, -1):
        for i in range(N):
            slopes[i] = slopes[i] * tau + value[i]
            value[i] = value[i] * tau + U[q, i]
    nu = complex(0.0, omega)
    for i in range(N):
        z[i] = y[i]
        rate[i] += ((slopes[i] + nu * value[i]) * turn).real
    for a in range(L):
        v = 0.0j
        d = 0.0j
        for p in range(D, -1, -1):
            d = d * tau + v
            v = v * tau + response.channel[a, p]
        z[N + a] = (v * turn).real
        z[N + L + a] = ((d + nu * v) * turn).real
    z[N + 2 * L] = 1.0
    imbalance = 0.0
    for i in range(N):
        gradient = 0.0
        for j in range(z.size):
            gradient += power.gradient[s, i, j] * z[j]
        imbalance += gradient * rate[i]
    for i in range(z.size):
        row = 0.0
        for j in range(i, z.size):
            row += power.form[s, i, j] * z[j]
        imbalance += z[i] * row
    energy = 0.0
    jump = 0.0
    for i in range(n):
        energy += 0.5 * (power.stiffness[i] * y[i] ** 2 + y[n + i] ** 2)
        jump += power.stiffness[i] * start[i] * missing[i] + start[n + i] * missing[n + i]
    cycles.imbalance[cycle] += imbalance * tau - jump
    if not energy <= cycles.energy[cycle]:
        cycles.energy[cycle] = energy


@kernel
def output_response(swept, response, s, k, used):  # type: ignore[no-untyped-def]
    """The forced part of the outputs."""
    outputs = swept.outputs
    _forced_rows(
        outputs.output_row[s], outputs.output_channel[s], outputs.output_slope[s], response.output.shape[0],
        response.state, used, response.channel, swept.windows.degree[k], swept.windows.omega[k], response.output,
    )  # fmt: skip


@kernel
def end_window(windows, cycles, k):  # type: ignore[no-untyped-def]
    """The outputs' range over the cycle that ends with window k, if one does."""
    cycle = windows.cycle[k]
    if k + 1 < windows.cycle.size and windows.cycle[k + 1] != cycle:
        for j in range(cycles.scale.size):
            extent = cycles.high[cycle, j] - cycles.low[cycle, j]
            if extent > 0.0:
                cycles.scale[j] = extent


# --- the record of a segment ------------------------------------------------------------------------------------------


class _Work(NamedTuple):
    poly: Any  # (K, P, G)
    degree: Any  # (G,)
    exponent: Any  # (G,) times the segment's length
    end: Any  # (G,) exp of it
    live: Any  # (G,)
    moment: Any  # (2 P + D,)
    projector: Any  # (D + 1,)
    phase: Any  # (D + 1,)
    sums: Any  # (P,)
    gamma: Any  # (B, K)
    lanes: Any  # see `beamsim.flow.lane_kernels.Lanes`
    length: Any  # (K, G, 5) sums over p of |poly| times 1, p, p (p - 1), ... p (p - 1) (p - 2) (p - 3)
    peaks: Any  # see `beamsim.flow.peak_kernels.Peaks`


@kernel
def _make_work(outputs, K, B, DM):  # type: ignore[no-untyped-def]
    G = outputs.group_exponent.shape[1] + 1
    P = MOST_POWERS
    return _Work(
        np.zeros((K, P, G), dtype=np.complex128),
        np.zeros(G, dtype=np.int64),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.complex128),
        np.zeros(G, dtype=np.bool_),
        np.zeros(2 * P + DM + 4, dtype=np.complex128),
        np.zeros(DM + 3, dtype=np.complex128),
        np.zeros(DM + 3, dtype=np.complex128),
        np.zeros(P, dtype=np.complex128),
        np.zeros((B, K), dtype=np.complex128),
        make_lanes(G, K),
        np.zeros((K, G, 5)),
        make_peaks(G, P, K),
    )


@kernel
def keep_segment(tables, swept, response, s, k, x, T, zeta, used):  # type: ignore[no-untyped-def]
    """Add a segment of length T, ``x`` after the start of window k, to the record of its cycle."""
    outputs, windows, cycles, work = swept.outputs, swept.windows, swept.cycles, response.work
    cycle, omega = windows.cycle[k], windows.omega[k]
    for j in range(tables.touching.shape[1]):
        if tables.touching[s, j]:
            cycles.closed_time[cycle, j] += T
    K = work.poly.shape[0]
    if K == 0:
        return
    _coefficients(tables, s, outputs.output, zeta, K, work.gamma)
    output_response(swept, response, s, k, used)
    groups = outputs.group_count[s]
    nb = tables.n_basis[s]
    for g in range(groups + 1):
        work.degree[g] = 0
    for b in range(nb):
        g = outputs.basis_group[s, b]
        work.degree[g] = max(work.degree[g], tables.power[s, b])
    # the forced polynomial, cut where it no longer matters
    top = used - 1
    while top > 0:
        matters = False
        for j in range(K):
            if size(response.output[j, top]) * T**top > 0.1 * PRUNED * cycles.scale[j]:
                matters = True
                break
        if matters:
            break
        top -= 1
    work.degree[groups] = top
    for j in range(K):
        for g in range(groups + 1):
            for p in range(work.degree[g] + 1):
                work.poly[j, p, g] = 0.0
        for b in range(nb):
            p = tables.power[s, b]
            work.poly[j, p, outputs.basis_group[s, b]] += work.gamma[b, j] * T**p
        factor = 1.0
        for p in range(top + 1):
            work.poly[j, p, groups] = response.output[j, p] * factor
            factor *= T
    for g in range(groups + 1):
        lam = complex(0.0, omega) if g == groups else outputs.group_exponent[s, g]
        work.exponent[g] = lam * T
        work.end[g] = _exp(lam.real, lam.imag, T)
        live = False
        for j in range(K):
            length = work.length[j, g]
            for q in range(5):
                length[q] = 0.0
            for p in range(work.degree[g] + 1):
                a = work.poly[j, p, g]
                part = size(a)
                for q in range(5):
                    length[q] += part
                    part *= p - q
            if length[0] > PRUNED * cycles.scale[j]:
                live = True
        work.live[g] = live
    search_peaks(work, groups + 1, K, cycles.scale, cycles.high[cycle], cycles.low[cycle])
    count = fill_lanes(work, groups + 1, K)
    _add_squares(work, groups + 1, K, count, T, cycles, cycle)
    if windows.order.size > 0:
        _add_harmonics(work, windows, groups + 1, K, count, k, x, T, omega, cycles, cycle)


@kernel
def _add_squares(work, G, K, count, T, cycles, cycle):  # type: ignore[no-untyped-def]
    """Integral of the square of every output: sum of products of pairs of groups, in closed form.

    The first ``count`` pairs of lanes are the groups without powers of time.
    """
    moment, lanes = work.moment, work.lanes
    for block in range((2 * count + LANES - 1) // LANES):
        row, last = lanes.block[block], min(LANES, 2 * count - block * LANES)
        for c in range(count):
            g = lanes.group[c]
            integrate_lanes(row, last, ONE, 0, work.exponent[g], work.end[g], complex(0.5 * T, 0.0), moment)
            for j in range(K):
                total = sum_lanes(row, lanes.amplitude[block, j])
                cycles.square[cycle, j] += (work.poly[j, 0, g] * total).real
    for g in range(G):
        if not work.live[g]:
            continue
        dg = work.degree[g]
        for h in range(g, G):
            if not work.live[h]:
                continue
            dh = work.degree[h]
            if dg == 0 and dh == 0:
                continue
            twice = 0.5 * T if g == h else T
            for conjugate in range(2):
                if conjugate == 0:
                    moments(work.exponent[g] + work.exponent[h], work.end[g] * work.end[h], dg + dh, moment)
                else:
                    moments(
                        work.exponent[g] + np.conj(work.exponent[h]),
                        work.end[g] * np.conj(work.end[h]),
                        dg + dh,
                        moment,
                    )
                for j in range(K):
                    total = 0.0
                    for p in range(dg + 1):
                        a = work.poly[j, p, g]
                        if a == 0.0:
                            continue
                        inner = 0.0 + 0.0j
                        for q in range(dh + 1):
                            b = work.poly[j, q, h]
                            if conjugate == 1:
                                b = np.conj(b)
                            inner += b * moment[p + q]
                        total += (a * inner).real
                    cycles.square[cycle, j] += twice * total


@kernel
def _add_harmonics(work, windows, G, K, count, k, x, T, omega, cycles, cycle):  # type: ignore[no-untyped-def]
    """Integral over the phase of ``output * exp(-i order phase)``, a tracking filter in closed form; for order 0 the
    integral of the output over time. The first ``count`` pairs of lanes are the groups without powers of time."""
    moment, projector, phase, lanes = work.moment, work.projector, work.phase, work.lanes
    D = windows.deviation.shape[1] - 1
    sigma = x - 0.5 * windows.length[k]
    for r in range(windows.order.size):
        order = windows.order[r]
        # exp(-i order delta(sigma)) about the window's middle, times the phase's rate, about the segment's start
        phase[0] = 1.0
        for p in range(1, D + 1):
            total = 0.0 + 0.0j
            for q in range(1, p + 1):
                total += q * windows.deviation[k, q] * phase[p - q]
            phase[p] = total * complex(0.0, -order) / p
        for p in range(D + 1):
            if order == 0.0:  # the mean, over time like the mean square
                projector[p] = phase[p]
                continue
            total = omega * phase[p]
            for q in range(p + 1):
                if q < D:
                    total += (q + 1) * windows.deviation[k, q + 1] * phase[p - q]
            projector[p] = total
        _shift(projector, D, sigma)
        factor = 1.0
        for p in range(D + 1):
            projector[p] *= factor
            factor *= T
        top = D
        while top > 0 and size(projector[top]) < 1e-14 * size(projector[0]):
            top -= 1
        angle = -order * omega * T
        down = complex(0.0, angle)
        end = complex(math.cos(angle), math.sin(angle))
        turns = order * windows.cycle[k]
        angle = -2.0 * math.pi * (turns - math.floor(turns) + order * windows.fraction[k]) - order * omega * sigma
        front = complex(math.cos(angle), math.sin(angle)) * (0.5 * T)
        for block in range((2 * count + LANES - 1) // LANES):
            row, last = lanes.block[block], min(LANES, 2 * count - block * LANES)
            integrate_lanes(row, last, projector, top, down, end, front, moment)
            for j in range(K):
                cycles.harmonic[cycle, j, r] += sum_lanes(row, lanes.amplitude[block, j])
        for g in range(G):
            if not work.live[g] or work.degree[g] == 0:
                continue
            dg = work.degree[g]
            for conjugate in range(2):
                if conjugate == 0:
                    moments(work.exponent[g] + down, work.end[g] * end, dg + top, moment)
                else:
                    moments(np.conj(work.exponent[g]) + down, np.conj(work.end[g]) * end, dg + top, moment)
                for p in range(dg + 1):
                    total = 0.0 + 0.0j
                    for q in range(top + 1):
                        total += projector[q] * moment[p + q]
                    work.sums[p] = total * front
                for j in range(K):
                    total = 0.0 + 0.0j
                    for p in range(dg + 1):
                        a = work.poly[j, p, g]
                        total += (np.conj(a) if conjugate == 1 else a) * work.sums[p]
                    cycles.harmonic[cycle, j, r] += total
