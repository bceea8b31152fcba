"""Compiled kernels of the exact flow: the motion on a segment, the search for events, extremes.

The march that joins the segments is in :mod:`beamsim.flow.march_kernels`.

Arrays in, arrays out; nothing is allocated per segment. Symbols: ``tau`` is the time since the start of a
segment, ``gamma[b]`` a complex coefficient of the basis function :math:`\\tau^{p_b} e^{\\lambda_b \\tau}`, so
that a watched quantity is :math:`g(\\tau) = \\mathrm{Re} \\sum_b \\gamma_b \\tau^{p_b} e^{\\lambda_b\\tau}`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel, summing

EPS = 2.220446049250313e-16
BELOW = 10.0  # tolerances, that a function lies below zero by more than round-off
TAYLOR = 8  # order of the derivative that is bounded where bounds on the curvature allow short steps only
CLOSE, PATIENCE = 1e6, 8  # a function within so many round-offs is close to zero; steps there before TAYLOR
ROUGHER = 1e3  # round-off of the coordinates of a start, in that of a segment
AT_ONCE = 1e-10  # share of a segment: a function below zero for so short a time after an event is so by round-off


class Tables(NamedTuple):
    """Padded tables of S contact states (see :mod:`beamsim.flow.contact_state`)."""

    n_basis: Any  # (S,)
    exponent: Any  # (S, B)
    power: Any  # (S, B)
    n_free: Any  # (S,)
    projector: Any  # (S, Z, N)
    n_terms: Any  # (S,)
    term_basis: Any  # (S, T)
    term_source: Any  # (S, T)
    term_vector: Any  # (S, T, N)
    watch: Any  # (S, T, w) of the state's guards, then of the internal states after the events that reset them
    roughness: Any  # (S, T, g) size of each term's parts before they cancel, which sets the round-off of the guards
    horizon: Any  # (S,)
    phase: Any  # (S, m) of the contacts
    touching: Any  # (S, m)
    n_guards: Any  # (S,)
    guard_contact: Any  # (S, g) contact of each guard
    reset: Any  # (S, g) column of `watch` with the contact's internal states after the event, -1 where they go on
    follower: Any  # (S, g) state after a guard's event, -1 where it is not built yet
    first: Any  # (m,) of a contact's internal states among all of them
    states: Any  # (m,) number of a contact's internal states


class Inputs(NamedTuple):
    """Sources on pieces (see :mod:`beamsim.flow.sources`)."""

    start: Any  # (P,)
    amplitude: Any  # (P, F)
    exponent: Any  # (F,)
    power: Any  # (F,)
    group_last: Any  # (F,)


@kernel
def _exp(re: float, im: float, tau: float) -> complex:
    size = 1.0 if re == 0.0 else math.exp(re * tau)
    if im == 0.0:
        return complex(size, 0.0)
    angle = im * tau
    return complex(size * math.cos(angle), size * math.sin(angle))


@kernel
def _fill_sources(tables, s, inputs, piece, t, y, rest, zeta):  # type: ignore[no-untyped-def]
    """Amplitudes of all sources at the start (time t, state y) of a segment in state s; ``rest`` (N,) is for work."""
    F = inputs.exponent.size
    shift = t - inputs.start[piece]
    for f in range(F):
        total = inputs.amplitude[piece, f]
        factor = 1.0
        for q in range(f + 1, inputs.group_last[f] + 1):
            step = q - f
            factor = factor * shift * (inputs.power[f] + step) / step
            total += factor * inputs.amplitude[piece, q]
        nu = inputs.exponent[f]
        if shift != 0.0 and nu != 0.0:
            total *= _exp(nu.real, nu.imag, shift)
        zeta[f] = total
    for k in range(y.size):
        rest[k] = y[k]
    for q in range(tables.n_terms[s]):
        source = tables.term_source[s, q]
        if source < F and tables.power[s, tables.term_basis[s, q]] == 0:
            z = zeta[source]
            for k in range(y.size):
                v = tables.term_vector[s, q, k]
                rest[k] -= v.real * z.real - v.imag * z.imag
    _project(tables.projector[s], tables.n_free[s], rest, zeta[F:])


@summing
def _project(projector, count, y, amplitude):  # type: ignore[no-untyped-def]
    """Amplitudes of ``count`` free motions in a state y; sums in an order that suits the processor."""
    for i in range(count):
        real = 0.0
        imag = 0.0
        for k in range(y.size):
            real += projector[i, k].real * y[k]
            imag += projector[i, k].imag * y[k]
        amplitude[i] = complex(real, imag)


@kernel
def _fill_basis(exponent, power, nb, tau, value):  # type: ignore[no-untyped-def]
    """Basis functions at tau."""
    for b in range(nb):
        lam = exponent[b]
        if b > 0 and lam == exponent[b - 1] and power[b] == power[b - 1] + 1:
            value[b] = value[b - 1] * tau
        else:
            v = _exp(lam.real, lam.imag, tau)
            for _ in range(power[b]):
                v *= tau
            value[b] = v


@kernel
def _evaluate(exponent, power, nb, count, gamma, size, tau, H, out):  # type: ignore[no-untyped-def]
    """Value, slope, bound on the curvature over [tau, reach] and round-off level of the first functions; returns reach.

    ``gamma`` and ``size``, which holds |gamma|, are (B, functions), ``out`` is (4, functions); the bound is the
    triangle inequality on every term's second derivative, with decaying exponentials taken at tau.
    """
    values, slopes, bounds, noises = out[0], out[1], out[2], out[3]
    for j in range(count):
        values[j] = 0.0
        slopes[j] = 0.0
        bounds[j] = 0.0
        noises[j] = 0.0
    first_value, first_slope, first_bound, first_noise = 0.0, 0.0, 0.0, 0.0
    reach = H
    for b in range(nb):
        if power[b] > 2:
            # a high power is bounded by its value at the far end: look no further than twice the present time
            reach = min(H, max(2.0 * tau, H / 64.0))
            break
    for b in range(nb):
        lam = exponent[b]
        p = power[b]
        e = _exp(lam.real, lam.imag, tau)
        r2 = lam.real * lam.real + lam.imag * lam.imag
        r = math.sqrt(r2)
        level = 1.0 if lam.real == 0.0 else math.exp(lam.real * (tau if lam.real < 0.0 else reach))
        if p == 0:
            value = e
            slope = lam * e
            bound = r2 * level
            noise = EPS * (8.0 + r * tau) * level
        else:
            tp = tau ** (p - 1)
            value = e * (tp * tau)
            slope = lam * value + e * (p * tp)
            rp = reach ** max(p - 2, 0)
            if p == 1:
                bound = (r2 * reach + 2.0 * r) * level
            else:
                bound = (r2 * reach * reach + 2.0 * p * r * reach + p * (p - 1.0)) * rp * level
            noise = EPS * (8.0 + p + r * tau) * level * tp * tau
        vr, vi, sr, si = value.real, value.imag, slope.real, slope.imag
        g = gamma[b, 0]
        a = size[b, 0]
        first_value += g.real * vr - g.imag * vi
        first_slope += g.real * sr - g.imag * si
        first_bound += a * bound
        first_noise += a * noise
        for j in range(1, count):
            g = gamma[b, j]
            a = size[b, j]
            values[j] += g.real * vr - g.imag * vi
            slopes[j] += g.real * sr - g.imag * si
            bounds[j] += a * bound
            noises[j] += a * noise
    values[0], slopes[0], bounds[0], noises[0] = first_value, first_slope, first_bound, first_noise
    return reach


@kernel
def _safe_step(g, slope, bound):  # type: ignore[no-untyped-def]
    """Longest step from g > 0 over which g + slope h - bound h^2 / 2 stays positive."""
    if bound <= 0.0:
        return np.inf if slope >= 0.0 else -g / slope
    root = math.sqrt(slope * slope + 2.0 * bound * g)
    if slope < 0.0:
        return 2.0 * g / (root - slope)
    if root == 0.0:  # the product is too small for a number: what is left of a motion that has decayed
        return math.sqrt(2.0 * g / bound)
    return (slope + root) / bound


@kernel
def _taylor_step(exponent, power, nb, gamma, size, j, tau, reach, value):  # type: ignore[no-untyped-def]
    """Step from value > 0 over which function j stays positive.

    Where terms cancel, a function and its first derivatives are small; the bound on its curvature is not. So the
    derivatives up to the seventh are evaluated, with their round-off, and the eighth is bounded.
    """
    derivative, noise = np.zeros(TAYLOR), np.zeros(TAYLOR)
    bound = 0.0
    for b in range(nb):
        if size[b, j] == 0.0:
            continue
        lam, p = exponent[b], power[b]
        r = abs(lam)
        g = gamma[b, j] * _exp(lam.real, lam.imag, tau)
        level = size[b, j] * math.exp(lam.real * tau)
        doubt = EPS * (8.0 + p + r * tau) * level
        for k in range(TAYLOR):
            total, rough = 0.0j, 0.0
            factor = 1.0  # binomial coefficient times p! / (p - i)!
            for i in range(min(k, p) + 1):
                part = factor * tau ** (p - i)
                total += part * lam ** (k - i)
                rough += part * r ** (k - i)
                factor *= (k - i) * (p - i) / (i + 1.0)
            derivative[k] += (g * total).real
            noise[k] += doubt * rough
        if lam.real > 0.0:
            level = size[b, j] * math.exp(lam.real * reach)
        factor = 1.0
        for i in range(min(TAYLOR, p) + 1):
            bound += level * factor * reach ** (p - i) * r ** (TAYLOR - i)
            factor *= (TAYLOR - i) * (p - i) / (i + 1.0)
    step = reach - tau
    while True:
        fall, factor = 0.0, 1.0
        for k in range(1, TAYLOR):
            factor *= step / k
            fall += (max(-derivative[k], 0.0) + noise[k]) * factor
        if fall + bound * factor * step / TAYLOR < value or step < 1e-300:
            return step
        step *= 0.5


@kernel
def _is_close(out, least, floors):  # type: ignore[no-untyped-def]
    """Whether some function is zero within a multiple of its round-off."""
    close = False
    for j in range(least.size):
        close = close or out[0, j] < CLOSE * max(out[3, j], least[j], floors[j])
    return close


@kernel
def _long_step(exponent, power, nb, gamma, size, out, least, floors, tau, reach):  # type: ignore[no-untyped-def]
    """As `_next_step` where no function is at zero, by higher derivatives for those whose curvature stops it early."""
    step = reach - tau
    for j in range(least.size):
        lifted = out[0, j] + 2.0 * max(out[3, j], least[j], floors[j])
        h = _safe_step(lifted, out[1, j], out[2, j])
        if h < step:
            step = min(step, max(h, _taylor_step(exponent, power, nb, gamma, size, j, tau, reach, lifted)))
    return step


@kernel
def _coefficients(tables, s, table, zeta, count, gamma):  # type: ignore[no-untyped-def]
    """Coefficients (B, count) of the basis functions in functions tabulated per term."""
    for b in range(tables.n_basis[s]):
        for j in range(count):
            gamma[b, j] = 0.0
    for q in range(tables.n_terms[s]):
        b = tables.term_basis[s, q]
        z = zeta[tables.term_source[s, q]]
        for j in range(count):
            gamma[b, j] += table[s, q, j] * z


@kernel
def _combine(tables, s, table, zeta, count, gamma, size):  # type: ignore[no-untyped-def]
    """As `_coefficients`, and the magnitudes into ``size``."""
    _coefficients(tables, s, table, zeta, count, gamma)
    for b in range(tables.n_basis[s]):
        for j in range(count):
            size[b, j] = abs(gamma[b, j])


@kernel
def _state_at(tables, s, zeta, basis, y):  # type: ignore[no-untyped-def]
    N = y.size
    for k in range(N):
        y[k] = 0.0
    for q in range(tables.n_terms[s]):
        a = zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]
        if a != 0.0:
            for k in range(N):
                v = tables.term_vector[s, q, k]
                y[k] += v.real * a.real - v.imag * a.imag


@kernel
def _fill_least(tables, s, zeta, H, least):  # type: ignore[no-untyped-def]
    """Round-off that cancelling terms leave in the watched functions on a segment of length H."""
    for j in range(least.size):
        least[j] = 0.0
    for q in range(tables.n_terms[s]):
        # a power of time counts with what it reaches on this segment
        a = 4.0 * EPS * abs(zeta[tables.term_source[s, q]]) * H ** tables.power[s, tables.term_basis[s, q]]
        for j in range(least.size):
            least[j] += a * tables.roughness[s, q, j]


@kernel
def _fill_floors(out, size, power, nb, H, floors):  # type: ignore[no-untyped-def]
    """What each watched function may be below zero where a segment begins with an event.

    All were watched up to there: a negative value is round-off of the change of coordinates, for the contact of the
    event and for any other with an event at the same instant (two stops that touch one point from both sides).
    """
    for j in range(floors.size):
        floors[j] = 0.0
        if out[0, j] < 0.0:
            scale = 0.0
            for b in range(nb):
                scale += size[b, j] * H ** power[b]
            floors[j] = min(-2.0 * out[0, j], max(1e-9 * scale, AT_ONCE * H * out[1, j]))


@kernel
def _next_step(out, least, floors, longest):  # type: ignore[no-untyped-def]
    """(step, hit): a step over which no watched function can reach zero; the function at zero already (-1: none).

    ``out`` is that of `_evaluate`. A function is lifted by twice its round-off: a contact that stays at zero
    to round-off is ignored, and every step has a smallest length. ``floors`` are those of `_fill_floors`, or zero. Of
    functions that an event has put below zero the lowest comes first.
    """
    step, hit = longest, -1
    for j in range(least.size):
        tolerance = max(out[3, j], least[j], floors[j])
        lifted = out[0, j] + 2.0 * tolerance
        if lifted < tolerance:
            if hit < 0 or (lifted < -BELOW * tolerance and out[0, j] < out[0, hit]):
                hit = j
        elif hit < 0:
            h = _safe_step(lifted, out[1, j], out[2, j])
            if h < step:
                step = h
    return step, hit


@kernel
def _fill_floors_at_start(out, least, floors):  # type: ignore[no-untyped-def]
    """The same where the motion begins, of functions that rise from zero.

    Their derivatives have decided that they are not negative; round-off of the coordinates is some times `least`.
    """
    for j in range(floors.size):
        if out[0, j] < 0.0 and out[1, j] > 0.0:
            floors[j] = min(-2.0 * out[0, j], ROUGHER * max(out[3, j], least[j]))


@kernel
def _follow_zeros(out, least, tau, slopes, floors):  # type: ignore[no-untyped-def]
    """Slope, at the start of a segment, of each function that has not risen from zero since; -inf for the others.

    Returns the share of a step to take: half of the first one where a function rises, so that it is seen above zero
    before it may come back. What has risen has no floor any more.
    """
    share = 1.0
    for j in range(least.size):
        if out[0, j] > max(out[3, j], least[j]):
            slopes[j] = -np.inf
            floors[j] = 0.0
        elif tau == 0.0:
            slopes[j] = out[1, j]
            if out[1, j] > 0.0:
                share = 0.5
    return share


@kernel
def _leaves_at_once(out, least, tau, slopes, hit):  # type: ignore[no-untyped-def]
    """Whether a function below zero at tau has been so since the segment began; ``slopes`` by `_follow_zeros`.

    What rests at zero until an input begins leaves it with a power of time, and falls below its round-off late. Where
    the slope at the start takes it there, the zero is that of a straight line.
    """
    return slopes[hit] * tau > -0.5 * max(out[3, hit], least[hit])


@kernel
def _crossing(out, hit, tau):  # type: ignore[no-untyped-def]
    """Time of the zero next to tau, by one Newton step where the curvature allows it."""
    g, slope, bound = out[0, hit], out[1, hit], out[2, hit]
    if slope < 0.0 and -g * bound <= 0.1 * slope * slope:
        return max(0.0, tau - g / slope)
    return tau


@kernel
def _first_internal(tables, contact, size):  # type: ignore[no-untyped-def]
    """Index of the first internal state of a contact in a state vector of a given size."""
    first = size + tables.first[contact]
    for number in tables.states:
        first -= number
    return first


@kernel
def _parts(table):  # type: ignore[no-untyped-def]
    """Real and imaginary parts of a table; loops compile in a fraction of the time that array functions take."""
    real, imag = np.empty(table.shape), np.empty(table.shape)
    for s in range(table.shape[0]):
        for q in range(table.shape[1]):
            for j in range(table.shape[2]):
                real[s, q, j] = table[s, q, j].real
                imag[s, q, j] = table[s, q, j].imag
    return real, imag


@kernel
def _reset(tables, s, guard, zeta, basis, y):  # type: ignore[no-untyped-def]
    """Write the internal states after a guard's event into y; ``basis`` is evaluated at the event."""
    column = tables.reset[s, guard]
    if column < 0:
        return
    contact = tables.guard_contact[s, guard]
    first = _first_internal(tables, contact, y.size)
    for i in range(tables.states[contact]):
        total = 0.0
        for q in range(tables.n_terms[s]):
            w = tables.watch[s, q, column + i]
            total += (w * zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]).real
        y[first + i] = total


@kernel
def _rows(tables, s, real, imag, zeta, rows_real, rows_imag):  # type: ignore[no-untyped-def]
    """Coefficients (B, k) of the basis functions, from a table in two parts; the loop over outputs is the inner one."""
    k = real.shape[2]
    for b in range(tables.n_basis[s]):
        for j in range(k):
            rows_real[b, j] = 0.0
            rows_imag[b, j] = 0.0
    for q in range(tables.n_terms[s]):
        b = tables.term_basis[s, q]
        z = zeta[tables.term_source[s, q]]
        if z != 0.0:
            for j in range(k):
                rows_real[b, j] += real[s, q, j] * z.real - imag[s, q, j] * z.imag
                rows_imag[b, j] += real[s, q, j] * z.imag + imag[s, q, j] * z.real


@kernel
def _outputs(rows_real, rows_imag, basis, nb, out):  # type: ignore[no-untyped-def]
    """Real part of every function, from `_rows`."""
    for j in range(out.size):
        out[j] = 0.0
    for b in range(nb):
        re, im = basis[b].real, basis[b].imag
        if im == 0.0:
            for j in range(out.size):
                out[j] += rows_real[b, j] * re
        else:
            for j in range(out.size):
                out[j] += rows_real[b, j] * re - rows_imag[b, j] * im


@kernel
def _bounds(exponent, power, nb, H, largest, bend):  # type: ignore[no-untyped-def]
    """Largest size of every basis function, and of its second derivative, on [0, H]."""
    for b in range(nb):
        lam = exponent[b]
        p = power[b]
        level = math.exp(lam.real * H) if lam.real > 0.0 else 1.0
        r2 = lam.real * lam.real + lam.imag * lam.imag
        if p == 0:
            largest[b] = level
            bend[b] = r2 * level
        elif p == 1:
            largest[b] = H * level
            bend[b] = (r2 * H + 2.0 * math.sqrt(r2)) * level
        else:
            size = H ** (p - 2)
            largest[b] = size * H * H * level
            bend[b] = (r2 * H * H + 2.0 * p * math.sqrt(r2) * H + p * (p - 1.0)) * size * level


@kernel
def _clear_ahead(exponent, power, nb, gamma, size, least, H, largest, bend):  # type: ignore[no-untyped-def]
    """Whether functions with high powers of time stay positive on [0, H], by value, slope and curvature at its start.

    `_evaluate` looks ahead of such functions no further than twice the present time; most pieces of a random or sampled
    input need no look beyond this one. ``largest`` and ``bend`` (B,) are work arrays.
    """
    high = False
    for b in range(nb):
        high = high or power[b] > 2
    if not high:
        return False
    _bounds(exponent, power, nb, H, largest, bend)
    for j in range(least.size):
        value, slope, bound, total = 0.0, 0.0, 0.0, 0.0
        for b in range(nb):
            g = gamma[b, j]
            if power[b] == 0:
                value += g.real
                slope += exponent[b].real * g.real - exponent[b].imag * g.imag
                total += size[b, j]
            elif power[b] == 1:
                slope += g.real
            bound += size[b, j] * bend[b]
        if value <= 2.0 * max(least[j], 8.0 * EPS * total) or _safe_step(value, slope, bound) < H:
            return False
    return True
