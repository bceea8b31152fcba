"""Compiled Taylor series of structures with cubic springs: motion, variational equations, contacts.

.. math:: \\ddot q + C \\dot q + \\Omega^2 q = f_0 + f(t) - \\sum_c \\psi_c\\, \\gamma_c\\, (\\psi_c^T q + g_c d(t))^3 +
\\text{closed contacts}

(:math:`g_c = 1` for a spring or contact on the ground, which feels the base's displacement d, else 0)

is polynomial, so that the Taylor coefficients of q and of every derivative of q follow from recursions (products of
series are Cauchy sums). Steps are as long as the last coefficients allow at round-off (À. Jorba and M. Zou,
*Experimental Mathematics* 14, 2005). Between the ends of a step the series itself is the dense output. A penetration is
a polynomial there, so that contacts are found by the search of all flows (:mod:`beamsim.flow.event_kernels`).

n is the number of coordinates, nc that of cubic springs, m of contacts, H of harmonics, P of parameters.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.event_kernels import NO_STEP, Guards, first_event, make_search
from beamsim.flow.kernels import EPS

ORDER = 26
MOST_LOOKS = 1000  # of the search in a step, which is cut there
MOST_STALLED = 4  # events in a row without time between them
DONE, FULL, STUCK = 0, 1, 2


class SmoothSystem(NamedTuple):
    """Arrays of the structure, its cubic springs, contacts and periodic loads."""

    omega2: Any  # (n,)
    damping: Any  # (n, n)
    damped: Any  # whether it is not zero
    load: Any  # (n,) constant
    cubic_shape: Any  # (nc, n)
    cubic: Any  # (nc,) N/m^3
    cubic_ground: Any  # (nc,) 1 where the base's displacement is felt
    shape: Any  # (m, n)
    sign: Any  # (m,)
    stiffness: Any  # (m,)
    dashpot: Any  # (m,)
    gap: Any  # (m,)
    ground: Any  # (m,) 1 where the base's displacement is felt
    frequency: Any  # (H,) rad/s
    force: Any  # (H, n) complex
    base: Any  # (H,) complex, displacement of the base
    d_force: Any  # (P, H, n) derivative by each parameter
    d_base: Any  # (P, H)
    d_frequency: Any  # (P, H) derivative of the frequencies by each parameter
    d_cubic: Any  # (P, nc)
    d_stiffness: Any  # (P, m)
    d_gap: Any  # (P, m)
    longest: Any  # s, of a step


class Series(NamedTuple):
    """Taylor coefficients of a motion in a step, or of a derivative of it; x2, x3 are those of the motion."""

    q: Any  # (ORDER + 1, n)
    v: Any  # (ORDER + 1, n)
    x: Any  # (nc, ORDER + 1) stretch of the cubic springs
    x2: Any  # (nc, ORDER + 1) its square
    x3: Any  # (nc, ORDER + 1) its cube
    d: Any  # (ORDER + 1,) displacement of the base


class SmoothMotion(NamedTuple):
    """What is carried on, in place."""

    y: Any  # (2n,)
    closed: Any  # (m,)
    by: Any  # (2n, columns) derivatives by the start, then by P parameters
    slope: Any  # (2n,) time derivative of y


class Steps(NamedTuple):
    """Room for a log of K steps and events."""

    time: Any  # (K,) s
    length: Any  # (K,) s
    closed: Any  # (K, m)
    y: Any  # (K, 2n) at the start
    event_time: Any  # (K,) s
    event_contact: Any  # (K,)
    event_closing: Any  # (K,)


@kernel
def make_series(s):  # type: ignore[no-untyped-def]
    """Room for the series of a system."""
    n, nc, terms = s.omega2.size, s.cubic.size, ORDER + 1
    return Series(
        np.zeros((terms, n)), np.zeros((terms, n)), np.zeros((nc, terms)), np.zeros((nc, terms)), np.zeros((nc, terms)),
        np.zeros(terms),
    )  # fmt: skip


@kernel
def _turned(angle: float) -> complex:
    """``e^{i angle}``."""
    return complex(math.cos(angle), math.sin(angle))


@kernel
def _base_series(s, t, d):  # type: ignore[no-untyped-def]
    """Taylor coefficients (ORDER + 1,) of the base's displacement."""
    d[:] = 0.0
    for h in range(s.frequency.size):
        term = s.base[h] * _turned(s.frequency[h] * t)
        for k in range(ORDER + 1):
            d[k] += term.real
            term *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _varied_base_series(s, t, p, dd):  # type: ignore[no-untyped-def]
    """The same of its derivative by a parameter (zero by the start, p = -1)."""
    dd[:] = 0.0
    if p < 0:
        return
    for h in range(s.frequency.size):
        term = _turned(s.frequency[h] * t)
        before = complex(0.0, 0.0)
        for k in range(ORDER + 1):
            timed = complex(0.0, s.d_frequency[p, h]) * (t * term + before)
            dd[k] += (s.d_base[p, h] * term + timed * s.base[h]).real
            before = term
            term *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _penetration_coefficient(s, j, series, k):  # type: ignore[no-untyped-def]
    """Taylor coefficient k of contact j's penetration."""
    q, d = series.q, series.d
    value = -s.gap[j] if k == 0 else 0.0
    value -= s.sign[j] * s.ground[j] * d[k]
    for i in range(s.omega2.size):
        value -= s.sign[j] * s.shape[j, i] * q[k, i]
    return value


@kernel
def series_at(s, closed, t, y, series):  # type: ignore[no-untyped-def]
    """Fill in the series of a motion.

    Parameters
    ----------
    s : SmoothSystem.
    closed : (m,) which contacts are.
    t : s.
    y : (2n,) state.
    series : Series, written.
    """
    q, v, x, x2, x3, d = series
    for i in range(s.omega2.size):
        q[0, i], v[0, i] = y[i], y[s.omega2.size + i]
    _base_series(s, t, d)
    n = s.omega2.size
    nc = s.cubic.size
    m = s.sign.size
    H = s.frequency.size
    phase = np.empty(H, dtype=np.complex128)
    for h in range(H):
        phase[h] = _turned(s.frequency[h] * t)
    for k in range(ORDER):
        for c in range(nc):
            total = s.cubic_ground[c] * d[k]
            for i in range(n):
                total += s.cubic_shape[c, i] * q[k, i]
            x[c, k] = total
            total = 0.0
            for a in range(k + 1):
                total += x[c, a] * x[c, k - a]
            x2[c, k] = total
            total = 0.0
            for a in range(k + 1):
                total += x[c, a] * x2[c, k - a]
            x3[c, k] = total
        for i in range(n):
            a = -s.omega2[i] * q[k, i]
            if k == 0:
                a += s.load[i]
            if s.damped:
                for j in range(n):
                    a -= s.damping[i, j] * v[k, j]
            for h in range(H):
                a += (s.force[h, i] * phase[h]).real
            for c in range(nc):
                a -= s.cubic_shape[c, i] * s.cubic[c] * x3[c, k]
            v[k + 1, i] = a
        for j in range(m):
            if closed[j]:
                delta = _penetration_coefficient(s, j, series, k)
                rate = -s.sign[j] * s.ground[j] * (k + 1) * d[k + 1]
                for i in range(n):
                    rate -= s.sign[j] * s.shape[j, i] * v[k, i]
                push = s.sign[j] * (s.stiffness[j] * delta + s.dashpot[j] * rate)
                for i in range(n):
                    v[k + 1, i] += push * s.shape[j, i]
        for i in range(n):
            v[k + 1, i] /= k + 1
            q[k + 1, i] = v[k, i] / (k + 1)
        for h in range(H):
            phase[h] *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _varied(s, closed, t, series, p, varied):  # type: ignore[no-untyped-def]
    """The same of a derivative, from its values in row 0; p is the parameter's number, -1 for one by the start."""
    x2, x3 = series.x2, series.x3
    dq, dv, dx, dd = varied.q, varied.v, varied.x, varied.d
    _varied_base_series(s, t, p, dd)
    n = s.omega2.size
    nc = s.cubic.size
    m = s.sign.size
    H = s.frequency.size
    phase = np.empty(H, dtype=np.complex128)
    before = np.zeros(H, dtype=np.complex128)
    for h in range(H):
        phase[h] = _turned(s.frequency[h] * t)
    for k in range(ORDER):
        for c in range(nc):
            total = s.cubic_ground[c] * dd[k]
            for i in range(n):
                total += s.cubic_shape[c, i] * dq[k, i]
            dx[c, k] = total
        for i in range(n):
            a = -s.omega2[i] * dq[k, i]
            if s.damped:
                for j in range(n):
                    a -= s.damping[i, j] * dv[k, j]
            dv[k + 1, i] = a
        for c in range(nc):
            total = 0.0
            for a in range(k + 1):
                total += x2[c, a] * dx[c, k - a]
            push = 3.0 * s.cubic[c] * total
            if p >= 0:
                push += s.d_cubic[p, c] * x3[c, k]
            for i in range(n):
                dv[k + 1, i] -= s.cubic_shape[c, i] * push
        for j in range(m):
            if closed[j]:
                delta = -s.sign[j] * s.ground[j] * dd[k]
                rate = -s.sign[j] * s.ground[j] * (k + 1) * dd[k + 1]
                for i in range(n):
                    delta -= s.sign[j] * s.shape[j, i] * dq[k, i]
                    rate -= s.sign[j] * s.shape[j, i] * dv[k, i]
                push = s.stiffness[j] * delta + s.dashpot[j] * rate
                if p >= 0:
                    push += s.d_stiffness[p, j] * _penetration_coefficient(s, j, series, k)
                    if k == 0:
                        push -= s.stiffness[j] * s.d_gap[p, j]
                for i in range(n):
                    dv[k + 1, i] += s.sign[j] * push * s.shape[j, i]
        if p >= 0:
            for h in range(H):
                # d/dp (f e^{i w t}) = (df + i dw t f) e^{i w t}; t e^{i w t} has the coefficients t e_k + e_{k-1}
                timed = complex(0.0, s.d_frequency[p, h]) * (t * phase[h] + before[h])
                for i in range(n):
                    dv[k + 1, i] += (s.d_force[p, h, i] * phase[h] + timed * s.force[h, i]).real
        for i in range(n):
            dv[k + 1, i] /= k + 1
            dq[k + 1, i] = dv[k, i] / (k + 1)
        for h in range(H):
            before[h] = phase[h]
            phase[h] *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _fill_guards(s, closed, series, H, guards):  # type: ignore[no-untyped-def]
    """The penetration of closed contacts, the gap of open ones, as polynomials on a step of length H."""
    for j in range(guards.count):
        side = 1.0 if closed[j] else -1.0
        guards.least[j] = 0.0
        for k in range(guards.basis):
            value = side * _penetration_coefficient(s, j, series, k)
            guards.coefficient[k, j], guards.size[k, j] = value, abs(value)
            parts = abs(s.ground[j] * series.d[k]) + (abs(s.gap[j]) if k == 0 else 0.0)
            for i in range(s.omega2.size):
                parts += abs(s.shape[j, i] * series.q[k, i])
            guards.least[j] += 4.0 * EPS * parts * H**k


@kernel
def _length(s, series):  # type: ignore[no-untyped-def]
    """Step at which the last two terms are below the round-off of the motion."""
    q, v, n = series.q, series.v, s.omega2.size
    scale = 0.0
    for i in range(n):
        scale = max(scale, math.sqrt(abs(s.omega2[i])))
    first = 0.0
    for i in range(n):
        first = max(first, abs(q[0, i]) * scale, abs(v[0, i]))
    if first == 0.0:
        first = 1e-300
    h = np.inf
    for k in (ORDER - 1, ORDER):
        size = 0.0
        for i in range(n):
            size = max(size, abs(q[k, i]) * scale, abs(v[k, i]))
        if size > 0.0:
            h = min(h, (1e-17 * first / size) ** (1.0 / k))
    return h


@kernel
def _add_up(c, h, out):  # type: ignore[no-untyped-def]
    n = out.size
    for i in range(n):
        total = c[ORDER, i]
        for k in range(ORDER - 1, -1, -1):
            total = total * h + c[k, i]
        out[i] = total


@kernel
def _add_up_both(series, h, out):  # type: ignore[no-untyped-def]
    """(2n,) coordinates and rates at h into a step."""
    n = series.q.shape[1]
    _add_up(series.q, h, out[:n])
    _add_up(series.v, h, out[n:])


@kernel
def _vary(s, motion, t, h, series, varied):  # type: ignore[no-untyped-def]
    """Carry the derivatives of a motion over a step, and fill in its slope at the end."""
    n, by, P = s.omega2.size, motion.by, s.d_force.shape[0]
    out = np.empty(2 * n)
    for k in range(by.shape[1]):
        for i in range(n):
            varied.q[0, i], varied.v[0, i] = by[i, k], by[n + i, k]
        _varied(s, motion.closed, t, series, max(k - (by.shape[1] - P), -1), varied)
        _add_up_both(varied, h, out)
        for i in range(2 * n):
            by[i, k] = out[i]
    for i in range(n):
        total = 0.0
        for k in range(ORDER, 0, -1):
            total = total * h + k * series.v[k, i]
        motion.slope[i], motion.slope[n + i] = motion.y[n + i], total


@kernel
def _cross(s, motion, t, j, rate, dd):  # type: ignore[no-untyped-def]
    """Take the derivatives across an event of contact j at time t, whose dashpot makes the acceleration jump there.

    ``rate`` is that of the penetration; ``dd`` (ORDER + 1,) is for work.
    """
    n, by, P = s.omega2.size, motion.by, s.d_force.shape[0]
    factor = (-1.0 if motion.closed[j] else 1.0) * s.dashpot[j] * s.sign[j]
    if factor * rate == 0.0:
        return
    for k in range(by.shape[1]):
        change = 0.0
        for i in range(n):
            change -= s.sign[j] * s.shape[j, i] * by[i, k]
        p = k - (by.shape[1] - P)
        if p >= 0:
            _varied_base_series(s, t, p, dd)
            change -= s.d_gap[p, j] + s.sign[j] * s.ground[j] * dd[0]
        for i in range(n):
            by[n + i, k] += s.shape[j, i] * factor * change


@kernel
def carry_smooth(s, t, t_end, begins, motion, log):  # type: ignore[no-untyped-def]
    """Carry a motion from t to t_end and log its steps and events.

    Parameters
    ----------
    s : SmoothSystem.
    t, t_end : s.
    begins : the contact whose event lies at t, or `ONWARDS`, or `BEGINNING` of the motion.
    motion : SmoothMotion, updated in place.
    log : Steps, filled from the start.

    Returns
    -------
    status : DONE; FULL when the log is full: called again it goes on; STUCK when events follow without time.
    t, begins : where it came.
    steps, events : how many are logged.
    """
    m, y, closed = s.sign.size, motion.y, motion.closed
    series, varied, dd = make_series(s), make_series(s), np.zeros(ORDER + 1)
    powers, exponents = np.arange(ORDER + 1), np.zeros(ORDER + 1, dtype=np.complex128)
    coefficient, size = np.zeros((ORDER + 1, m), dtype=np.complex128), np.zeros((ORDER + 1, m))
    guards = Guards(ORDER + 1, m, exponents, powers, coefficient, size, np.zeros(m))
    search = make_search(m)
    steps, events, stalled = 0, 0, 0
    while t < t_end:
        if steps == log.time.size or events == log.event_time.size:
            return FULL, t, begins, steps, events
        series_at(s, closed, t, y, series)
        h = min(_length(s, series), s.longest, t_end - t)
        ends, hit = h == t_end - t, -1
        if m > 0:
            _fill_guards(s, closed, series, h, guards)
            longest = h
            h, hit, _ = first_event(guards, search, longest, begins, MOST_LOOKS)
            ends = ends and h == longest
            if hit == NO_STEP:
                return STUCK, t, begins, steps, events
        log.time[steps], log.length[steps] = t, h
        for i in range(y.size):
            log.y[steps, i] = y[i]
        for j in range(m):
            log.closed[steps, j] = closed[j]
        steps += 1
        _add_up_both(series, h, y)
        _vary(s, motion, t, h, series, varied)
        begins = hit
        if hit < 0:
            t = t_end if ends else t + h
            continue
        t += h
        stalled = stalled + 1 if h == 0.0 else 0
        if stalled > MOST_STALLED:
            return STUCK, t, begins, steps, events
        log.event_time[events], log.event_contact[events], log.event_closing[events] = t, hit, not closed[hit]
        events += 1
        rate = 0.0
        for k in range(ORDER, 0, -1):
            rate = rate * h + k * coefficient[k, hit].real
        _cross(s, motion, t, hit, rate, dd)
        closed[hit] = not closed[hit]
    return DONE, t, begins, steps, events


@kernel
def sample_smooth(s, log_time, log_closed, log_y, times, out):  # type: ignore[no-untyped-def]
    """States within a log of steps.

    Parameters
    ----------
    s : SmoothSystem.
    log_time, log_closed, log_y : (K,), (K, m), (K, 2n) of the steps.
    times : (nt,) s, increasing.
    out : (nt, 2n) receives the states.
    """
    series = make_series(s)
    g = 0
    current = -1
    for i in range(times.size):
        while g < log_time.size - 1 and log_time[g + 1] <= times[i]:
            g += 1
        if g != current:
            series_at(s, log_closed[g], log_time[g], log_y[g], series)
            current = g
        _add_up_both(series, times[i] - log_time[g], out[i])
