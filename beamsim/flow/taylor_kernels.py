"""Compiled Taylor series of structures with cubic springs: motion, variational equations, contacts.

.. math:: \\ddot q + C \\dot q + \\Omega^2 q = f_0 + f(t) - \\sum_c \\psi_c \\gamma_c (\\psi_c^T q + g_c^T d(t))^3 +
\\text{closed contacts}

(:math:`g_c` is not 0 for a spring or contact on the ground, which follows the base's displacements d)

is polynomial, so that the Taylor coefficients of q and of every derivative of q follow from recursions (products of
series are Cauchy sums). The motion and its derivatives are C columns of one array and obey the same recursion: first
the motion, then what it is by P parameters, then by the start. Steps are as long as the last coefficients allow at
round-off (À. Jorba and M. Zou, *Experimental Mathematics* 14, 2005). Between the ends of a step the series is the
dense output. A penetration is a polynomial there, so that contacts are found by the search of all flows
(:mod:`beamsim.flow.kernels`).

n is the number of coordinates, nc that of cubic springs, m of contacts, H of harmonics, P of parameters.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.kernels import EPS, NO_STEP, Guards, SearchWork, _first_event

ORDER = 26
MOST_LOOKS = 1000  # of the search in a step, which is cut there
MOST_STALLED = 4  # events in a row without time between them
DONE, FULL, STUCK = 0, 1, 2


class SmoothSystem(NamedTuple):
    """Arrays of the structure, its cubic springs, contacts and periodic loads.

    Those with 1 + P rows hold the number itself first, then its derivative by each parameter. The load of a harmonic is
    ``Re((force + t rising) e^{i frequency t})``, where what rises is the derivative by its frequency.
    """

    omega2: Any  # (n,)
    damping: Any  # (D,) entries of the damping matrix that are not zero
    damping_entries: Any  # (2, D) their rows and columns
    load: Any  # (n,) constant
    cubic_shape: Any  # (nc, n)
    cubic: Any  # (1 + P, nc) N/m^3
    cubic_ground: Any  # (nc, K) base influence
    shape: Any  # (m, n)
    sign: Any  # (m,)
    stiffness: Any  # (1 + P, m)
    dashpot: Any  # (m,)
    gap: Any  # (1 + P, m)
    ground: Any  # (m, K) base influence
    frequency: Any  # (H,) rad/s
    force: Any  # (1 + P, H, n) complex
    force_slope: Any  # (1 + P, H, n)
    base: Any  # (1 + P, H, K) complex, displacements of the base
    base_slope: Any  # (1 + P, H, K)
    longest: Any  # s, of a step


class Series(NamedTuple):
    """Taylor coefficients of a motion and its derivatives in a step."""

    q: Any  # (ORDER + 1, n, C)
    v: Any  # (ORDER + 1, n, C)
    x: Any  # (ORDER + 1, nc, C) extension of the cubic springs
    x2: Any  # (ORDER + 1, nc) square of that of the motion
    x3: Any  # (ORDER + 1, nc, C) its cube
    d: Any  # (ORDER + 1, K, C) displacements of the base


class SmoothMotion(NamedTuple):
    """What a step changes in place."""

    y: Any  # (2n, C) state and its derivatives
    closed: Any  # (m,)
    slope: Any  # (2n,) time derivative of the state


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
def make_series(s, columns):
    """Room for the series of a system, with C columns."""
    n, nc, terms = s.omega2.size, s.cubic.shape[1], ORDER + 1
    return Series(
        np.zeros((terms, n, columns)), np.zeros((terms, n, columns)), np.zeros((terms, nc, columns)),
        np.zeros((terms, nc)), np.zeros((terms, nc, columns)),
        np.zeros((terms, s.base.shape[2], columns)),
    )  # fmt: skip


@kernel
def _turned(angle: float) -> complex:
    """``e^{i angle}``."""
    return complex(math.cos(angle), math.sin(angle))


@kernel
def _fill_base(s, t, d):
    """Taylor coefficients (ORDER + 1, K, C) of the base's displacements; ``t e^{i w t}`` has ``t e_k + e_{k-1}``.

    Parameters
    ----------
    s : SmoothSystem.
    t : s, where the step begins.
    d : (ORDER + 1, K, C) of the displacements, m, and their derivatives by parameters; written.
    """
    d[:] = 0.0
    for h in range(s.frequency.size):
        term, before = _turned(s.frequency[h] * t), complex(0.0, 0.0)
        for k in range(ORDER + 1):
            for p in range(min(s.base.shape[0], d.shape[2])):
                for b in range(d.shape[1]):
                    d[k, b, p] += (s.base[p, h, b] * term + s.base_slope[p, h, b] * (t * term + before)).real
            before = term
            term *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _penetration_coefficient(s, j, series, k, p):
    """Taylor coefficient k of contact j's penetration in column p.

    Parameters
    ----------
    s : SmoothSystem.
    j : the contact.
    series : Series, known up to order k.
    k, p : order and column.

    Returns
    -------
    float
        m/s^k.
    """
    value = -s.gap[p, j] if k == 0 and p < s.gap.shape[0] else 0.0
    for b in range(s.ground.shape[1]):
        value -= s.sign[j] * s.ground[j, b] * series.d[k, b, p]
    for i in range(s.omega2.size):
        value -= s.sign[j] * s.shape[j, i] * series.q[k, i, p]
    return value


@kernel
def _add_cubic(s, series, k):
    """Take the pull of the cubic springs from the rates of order k + 1, and fill in their series of order k.

    Parameters
    ----------
    s : SmoothSystem.
    series : Series, known up to order k; written.
    k : order.
    """
    q, v, x, x2, x3, d = series
    n, C = s.omega2.size, d.shape[2]
    for c in range(x2.shape[1]):
        for p in range(C):
            x[k, c, p] = 0.0
            x3[k, c, p] = 0.0
            for b in range(s.cubic_ground.shape[1]):
                x[k, c, p] += s.cubic_ground[c, b] * d[k, b, p]
        for i in range(n):
            for p in range(C):
                x[k, c, p] += s.cubic_shape[c, i] * q[k, i, p]
        x2[k, c] = 0.0
        for a in range(k + 1):
            x2[k, c] += x[a, c, 0] * x[k - a, c, 0]
        for a in range(k + 1):
            for p in range(C):
                x3[k, c, p] += 3.0 * x2[a, c] * x[k - a, c, p]
        x3[k, c, 0] /= 3.0
        for p in range(C):
            pull = s.cubic[0, c] * x3[k, c, p]
            if 0 < p < s.cubic.shape[0]:
                pull += s.cubic[p, c] * x3[k, c, 0]
            for i in range(n):
                v[k + 1, i, p] -= s.cubic_shape[c, i] * pull


@kernel
def _add_contact(s, j, series, k):
    """Add the push of a closed contact to the rates of order k + 1.

    Parameters
    ----------
    s : SmoothSystem.
    j : the contact.
    series : Series, known up to order k; its rates are written.
    k : order.
    """
    n, v, d = s.omega2.size, series.v, series.d
    for p in range(d.shape[2]):
        delta = _penetration_coefficient(s, j, series, k, p)
        rate = 0.0
        for b in range(s.ground.shape[1]):
            rate -= s.sign[j] * s.ground[j, b] * (k + 1) * d[k + 1, b, p]
        for i in range(n):
            rate -= s.sign[j] * s.shape[j, i] * v[k, i, p]
        push = s.stiffness[0, j] * delta + s.dashpot[j] * rate
        if 0 < p < s.stiffness.shape[0]:
            push += s.stiffness[p, j] * _penetration_coefficient(s, j, series, k, 0)
        for i in range(n):
            v[k + 1, i, p] += s.sign[j] * push * s.shape[j, i]


@kernel
def series_at(s, closed, t, y, series):
    """Fill in the series of a motion and its derivatives.

    Parameters
    ----------
    s : SmoothSystem.
    closed : (m,) which contacts are.
    t : s.
    y : (2n, C) state and its derivatives.
    series : Series, written.
    """
    q, v = series.q, series.v
    n, H, C = s.omega2.size, s.frequency.size, y.shape[1]
    q[0], v[0] = y[:n], y[n:]
    _fill_base(s, t, series.d)
    phase, before = np.empty(H, dtype=np.complex128), np.zeros(H, dtype=np.complex128)
    for h in range(H):
        phase[h] = _turned(s.frequency[h] * t)
    for k in range(ORDER):
        for i in range(n):
            for p in range(C):
                v[k + 1, i, p] = -s.omega2[i] * q[k, i, p]
            if k == 0:
                v[1, i, 0] += s.load[i]
            for h in range(H):
                for p in range(min(s.force.shape[0], C)):
                    timed = s.force_slope[p, h, i] * (t * phase[h] + before[h])
                    v[k + 1, i, p] += (s.force[p, h, i] * phase[h] + timed).real
        for e in range(s.damping.size):
            i, j = s.damping_entries[:, e]
            for p in range(C):
                v[k + 1, i, p] -= s.damping[e] * v[k, j, p]
        _add_cubic(s, series, k)
        for j in range(s.sign.size):
            if closed[j]:
                _add_contact(s, j, series, k)
        share = 1.0 / (k + 1)
        for i in range(n):
            for p in range(C):
                v[k + 1, i, p] *= share
                q[k + 1, i, p] = v[k, i, p] * share
        for h in range(H):
            before[h] = phase[h]
            phase[h] *= complex(0.0, s.frequency[h] / (k + 1))


@kernel
def _fill_guards(s, closed, series, H, guards):
    """The penetration of closed contacts, the gap of open ones, as polynomials on a step of length H.

    Parameters
    ----------
    s : SmoothSystem.
    closed : (m,) which contacts are.
    series : Series of the step.
    H : s.
    guards : Guards of the m contacts; written.
    """
    for j in range(guards.count):
        side = 1.0 if closed[j] else -1.0
        guards.noise_floor[j] = 0.0
        for k in range(guards.basis):
            value = side * _penetration_coefficient(s, j, series, k, 0)
            guards.coefficient[k, j], guards.size[k, j] = value, abs(value)
            parts = abs(s.gap[0, j]) if k == 0 else 0.0
            for b in range(s.ground.shape[1]):
                parts += abs(s.ground[j, b] * series.d[k, b, 0])
            for i in range(s.omega2.size):
                parts += abs(s.shape[j, i] * series.q[k, i, 0])
            guards.noise_floor[j] += 4.0 * EPS * parts * H**k


@kernel
def _length(s, series):
    """Step at which the last two terms are below the round-off of the motion."""
    q, v, n = series.q, series.v, s.omega2.size
    scale, first = math.sqrt(np.abs(s.omega2).max()), 0.0
    for i in range(n):
        first = max(first, abs(q[0, i, 0]) * scale, abs(v[0, i, 0]))
    if first == 0.0:
        first = 1e-300
    h = np.inf
    for k in (ORDER - 1, ORDER):
        size = 0.0
        for i in range(n):
            size = max(size, abs(q[k, i, 0]) * scale, abs(v[k, i, 0]))
        if size > 0.0:
            h = min(h, (1e-17 * first / size) ** (1.0 / k))
    return h


@kernel
def _add_up(series, h, y, slope):
    """State and its derivatives (2n, C), and the time derivative of the state (2n,), at h into a step.

    Parameters
    ----------
    series : Series of the step.
    h : s, from where it begins.
    y : (2n, C) written.
    slope : (2n,) written.
    """
    n, C = series.q.shape[1:]
    y[:n], y[n:], slope[:] = series.q[ORDER], series.v[ORDER], 0.0
    for k in range(ORDER - 1, -1, -1):
        for i in range(n):
            slope[n + i] = slope[n + i] * h + (k + 1) * series.v[k + 1, i, 0]
            for p in range(C):
                y[i, p] = y[i, p] * h + series.q[k, i, p]
                y[n + i, p] = y[n + i, p] * h + series.v[k, i, p]
    slope[:n] = y[n:, 0]


@kernel
def _cross(s, motion, series, h, j):
    """Take the derivatives across an event of contact j, whose dashpot makes the acceleration jump there.

    It lies at h into the step.

    Parameters
    ----------
    s : SmoothSystem.
    motion : SmoothMotion at the event, whose derivatives are written.
    series : Series of the step that ends there.
    h : s, length of that step.
    j : the contact.
    """
    n, y = s.omega2.size, motion.y
    factor = (-1.0 if motion.closed[j] else 1.0) * s.dashpot[j] * s.sign[j]
    rate = 0.0
    for k in range(ORDER, 0, -1):
        rate = rate * h + k * _penetration_coefficient(s, j, series, k, 0)
    if factor * rate == 0.0:
        return
    for p in range(1, y.shape[1]):
        change = 0.0
        for k in range(ORDER, -1, -1):
            change = change * h + _penetration_coefficient(s, j, series, k, p)
        for i in range(n):
            y[n + i, p] += s.shape[j, i] * factor * change


@kernel
def carry_smooth(s, t, t_end, start_contact, motion, log):
    """Carry a motion from t to t_end and log its steps and events.

    Parameters
    ----------
    s : SmoothSystem.
    t, t_end : s.
    start_contact : the contact whose event lies at t, or `ONWARDS`, or `BEGINNING` of the motion.
    motion : SmoothMotion, updated in place.
    log : Steps, filled from the start.

    Returns
    -------
    status : DONE; FULL when the log is full: called again it goes on; STUCK when events follow without time.
    t, start_contact : where it came.
    steps, events : how many are logged.
    """
    m, y, closed, series = s.sign.size, motion.y, motion.closed, make_series(s, motion.y.shape[1])
    powers, exponents = np.arange(ORDER + 1), np.zeros(ORDER + 1, dtype=np.complex128)
    coefficient, size = np.zeros((ORDER + 1, m), dtype=np.complex128), np.zeros((ORDER + 1, m))
    guards = Guards(ORDER + 1, m, 0, exponents, powers, coefficient, size, np.zeros(m))
    search = SearchWork(np.empty((4, m)), np.empty(m), np.empty(m))
    steps, events, stalled = 0, 0, 0
    while t < t_end:
        if steps == log.time.size or events == log.event_time.size:
            return FULL, t, start_contact, steps, events
        series_at(s, closed, t, y, series)
        h = min(_length(s, series), s.longest, t_end - t)
        ends, hit = h == t_end - t, -1
        if m > 0:
            _fill_guards(s, closed, series, h, guards)
            longest = h
            h, hit, _ = _first_event(guards, search, longest, start_contact, MOST_LOOKS)
            ends = ends and h == longest
            if hit == NO_STEP:
                return STUCK, t, start_contact, steps, events
        log.time[steps], log.length[steps] = t, h
        log.y[steps], log.closed[steps] = y[:, 0], closed
        steps += 1
        _add_up(series, h, y, motion.slope)
        start_contact = hit
        if hit < 0:
            t = t_end if ends else t + h
            continue
        t += h
        stalled = stalled + 1 if h == 0.0 else 0
        if stalled > MOST_STALLED:
            return STUCK, t, start_contact, steps, events
        log.event_time[events], log.event_contact[events], log.event_closing[events] = t, hit, not closed[hit]
        events += 1
        _cross(s, motion, series, h, hit)
        closed[hit] = not closed[hit]
    return DONE, t, start_contact, steps, events


@kernel
def sample_smooth(s, log_time, log_closed, log_y, times, out):
    """States within a log of steps.

    Parameters
    ----------
    s : SmoothSystem.
    log_time, log_closed, log_y : (K,), (K, m), (K, 2n) of the steps.
    times : (nt,) s, increasing.
    out : (nt, 2n) receives the states.
    """
    series, y, slope = make_series(s, 1), np.empty((out.shape[1], 1)), np.empty(out.shape[1])
    g = 0
    current = -1
    for i in range(times.size):
        while g < log_time.size - 1 and log_time[g + 1] <= times[i]:
            g += 1
        if g != current:
            series_at(s, log_closed[g], log_time[g], log_y[g].reshape(-1, 1), series)
            current = g
        _add_up(series, times[i] - log_time[g], y, slope)
        out[i] = y[:, 0]
