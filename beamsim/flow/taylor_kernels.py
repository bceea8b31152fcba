"""Compiled Taylor series of structures with cubic springs: motion, variational equations, contacts.

.. math:: \\ddot q + C \\dot q + \\Omega^2 q = f_0 + f(t) - \\sum_c \\psi_c\\, \\gamma_c\\, (\\psi_c^T q + g_c d(t))^3 +
\\text{closed contacts}

(:math:`g_c = 1` for a spring or contact on the ground, which feels the base's displacement d, else 0)

is polynomial, so that the Taylor coefficients of q and of every derivative of q follow from recursions (products of
series are Cauchy sums). Steps are as long as the last coefficients allow at round-off (À. Jorba and M. Zou,
*Experimental Mathematics* 14, 2005). Between the ends of a step the series itself is the dense output, on which
contacts are located.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel

ORDER = 26
LOOKS = 24  # times in a step at which the gaps are evaluated
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
def _penetration_coefficient(s, j, q, d, k):  # type: ignore[no-untyped-def]
    """Taylor coefficient k of contact j's penetration."""
    value = -s.gap[j] if k == 0 else 0.0
    value -= s.sign[j] * s.ground[j] * d[k]
    for i in range(s.omega2.size):
        value -= s.sign[j] * s.shape[j, i] * q[k, i]
    return value


@kernel
def _series(s, closed, t, q, v, x, x2, x3, d):  # type: ignore[no-untyped-def]
    """Taylor coefficients (ORDER + 1, n) of q and v from their values in row 0; of the cubic springs' stretch; of d."""
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
                delta = _penetration_coefficient(s, j, q, d, k)
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
def _varied(s, closed, t, q, v, x2, x3, d, p, dq, dv, dx, dd):  # type: ignore[no-untyped-def]
    """The same of a derivative of the motion; p is the parameter's number, -1 for a derivative by the start."""
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
                    push += s.d_stiffness[p, j] * _penetration_coefficient(s, j, q, d, k)
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
def _penetration(s, j, q, d, h):  # type: ignore[no-untyped-def]
    """Penetration of contact j and its first two derivatives at h into a step."""
    value = 0.0
    rate = 0.0
    bend = 0.0
    for k in range(ORDER, -1, -1):
        bend = bend * h + 2.0 * rate
        rate = rate * h + value
        value = value * h + _penetration_coefficient(s, j, q, d, k)
    return value, rate, bend


@kernel
def _first_event(s, closed, toggled, q, d, h):  # type: ignore[no-untyped-def]
    """First (time, contact) within (0, h) at which a contact changes, (h, -1) without one."""
    best = h
    which = -1
    for j in range(s.sign.size):
        side = -1.0 if closed[j] else 1.0
        before = 0.0
        # just after an event of this contact the gap is zero to round-off: the first look lies inside the step
        g0, r0, _b0 = _penetration(s, j, q, d, 0.0)
        g0 *= -side
        r0 *= -side
        g_before, r_before = g0, r0
        if j == toggled:
            g_before = 0.0
        for look in range(1, LOOKS + 1):
            tau = best * look / LOOKS
            g, r, _b = _penetration(s, j, q, d, tau)
            g *= -side
            r *= -side
            lower, upper = before, tau
            hit = g < 0.0
            if not hit and r_before < 0.0 and r > 0.0:
                # the gap has a minimum in between
                a, c, ra, rc = before, tau, r_before, r
                low = g
                where = tau
                for _ in range(60):
                    mid = 0.5 * (a + c)
                    if rc != ra:
                        guess = c - rc * (c - a) / (rc - ra)
                        if a < guess < c and _ % 3 != 2:
                            mid = guess
                    gm, rm, _bm = _penetration(s, j, q, d, mid)
                    gm *= -side
                    rm *= -side
                    low = gm
                    where = mid
                    if gm < 0.0 or c - a < 1e-15 * h:
                        break
                    if rm < 0.0:
                        a, ra = mid, rm
                    else:
                        c, rc = mid, rm
                if low < 0.0:
                    hit = True
                    upper = where
            if hit and j == toggled and lower == 0.0 and r0 <= 0.0 and look == 1:
                # it turns back at once (grazing): the contact changes back at the event itself
                best = 0.0
                which = j
                break
            if hit:
                if lower == 0.0 and g_before <= 0.0 and j == toggled:
                    # find a time within the step at which the gap is open, to bracket the next root
                    inner = upper
                    for _ in range(60):
                        inner *= 0.5
                        gi, _ri, _bi = _penetration(s, j, q, d, inner)
                        if -side * gi > 0.0:
                            lower = inner
                            break
                root = upper
                for _ in range(80):
                    gr, rr, _br = _penetration(s, j, q, d, root)
                    gr *= -side
                    rr *= -side
                    if gr < 0.0:
                        upper = root
                    else:
                        lower = root
                    step = -gr / rr if rr != 0.0 else 0.0
                    new = root + step
                    if not lower < new < upper:
                        new = 0.5 * (lower + upper)
                    if abs(new - root) <= 1e-16 * h or new == root:
                        root = new
                        break
                    root = new
                if root < best:
                    best = root
                    which = j
                break
            before = tau
            g_before, r_before = g, r
    return best, which


@kernel
def _length(q, v, scale):  # type: ignore[no-untyped-def]
    """Step at which the last two terms are below the round-off of the motion."""
    n = q.shape[1]
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
def carry_smooth(  # type: ignore[no-untyped-def]
    s, t, t_end, toggled, closed, y, sens, parameters, longest, log_time, log_length, log_closed, log_y, ev_time,
    ev_contact, ev_closing, slope,
):  # fmt: skip
    """Carry y (2n,), the contacts' state ``closed`` and ``sens`` (2n, columns), all in place, from t to t_end.

    The last ``parameters`` columns are derivatives by parameters; ``toggled`` is the contact whose event lies at the
    start (-1: none). Returns (status, t, toggled, steps, events); FULL when the log is full.
    """
    n = s.omega2.size
    nc = s.cubic.size
    m = s.sign.size
    columns = sens.shape[1]
    q = np.zeros((ORDER + 1, n))
    v = np.zeros((ORDER + 1, n))
    dq = np.zeros((ORDER + 1, n))
    dv = np.zeros((ORDER + 1, n))
    x = np.zeros((nc, ORDER + 1))
    x2 = np.zeros((nc, ORDER + 1))
    x3 = np.zeros((nc, ORDER + 1))
    dx = np.zeros((nc, ORDER + 1))
    d = np.zeros(ORDER + 1)
    dd = np.zeros(ORDER + 1)
    out = np.zeros(2 * n)
    scale = 0.0
    for i in range(n):
        scale = max(scale, math.sqrt(abs(s.omega2[i])))
    steps = 0
    events = 0
    stalled = 0
    while t < t_end:
        if steps == log_time.size or events == ev_time.size:
            return FULL, t, toggled, steps, events
        for i in range(n):
            q[0, i] = y[i]
            v[0, i] = y[n + i]
        _series(s, closed, t, q, v, x, x2, x3, d)
        h = min(_length(q, v, scale), longest, t_end - t)
        ends = h == t_end - t
        which = -1
        if m > 0:
            h, which = _first_event(s, closed, toggled, q, d, h)
        log_time[steps] = t
        log_length[steps] = h
        for i in range(2 * n):
            log_y[steps, i] = y[i]
        for j in range(m):
            log_closed[steps, j] = closed[j]
        steps += 1
        _add_up(q, h, y[:n])
        _add_up(v, h, y[n:])
        for k in range(columns):
            for i in range(n):
                dq[0, i] = sens[i, k]
                dv[0, i] = sens[n + i, k]
            p = k - (columns - parameters)
            _varied(s, closed, t, q, v, x2, x3, d, p if p >= 0 else -1, dq, dv, dx, dd)
            _add_up(dq, h, out[:n])
            _add_up(dv, h, out[n:])
            for i in range(2 * n):
                sens[i, k] = out[i]
        for i in range(n):
            total = 0.0
            for k in range(ORDER, 0, -1):
                total = total * h + k * v[k, i]
            slope[i] = y[n + i]
            slope[n + i] = total
        toggled = which
        if which >= 0:
            t = t + h
            stalled = stalled + 1 if h == 0.0 else 0
            if stalled > 4:
                return STUCK, t, toggled, steps, events
            j = which
            ev_time[events] = t
            ev_contact[events] = j
            ev_closing[events] = not closed[j]
            events += 1
            _, rate, _ = _penetration(s, j, q, d, h)
            jump = s.dashpot[j] * rate
            if jump != 0.0:
                factor = (1.0 if not closed[j] else -1.0) * s.dashpot[j] * s.sign[j]
                for k in range(columns):
                    change = 0.0
                    for i in range(n):
                        change -= s.sign[j] * s.shape[j, i] * sens[i, k]
                    p = k - (columns - parameters)
                    if p >= 0:
                        _varied_base_series(s, t - h, p, dd)
                        moved = 0.0
                        for i in range(ORDER, -1, -1):
                            moved = moved * h + dd[i]
                        change -= s.d_gap[p, j] + s.sign[j] * s.ground[j] * moved
                    for i in range(n):
                        sens[n + i, k] += s.shape[j, i] * factor * change
            closed[j] = not closed[j]
        else:
            t = t_end if ends else t + h
    return DONE, t, toggled, steps, events


@kernel
def sample_smooth(s, log_time, log_closed, log_y, times, out):  # type: ignore[no-untyped-def]
    """(nt, 2n) states at increasing times from a log of steps."""
    n = s.omega2.size
    nc = s.cubic.size
    q = np.zeros((ORDER + 1, n))
    v = np.zeros((ORDER + 1, n))
    x = np.zeros((nc, ORDER + 1))
    x2 = np.zeros((nc, ORDER + 1))
    x3 = np.zeros((nc, ORDER + 1))
    d = np.zeros(ORDER + 1)
    g = 0
    current = -1
    for i in range(times.size):
        while g < log_time.size - 1 and log_time[g + 1] <= times[i]:
            g += 1
        if g != current:
            for k in range(n):
                q[0, k], v[0, k] = log_y[g, k], log_y[g, n + k]
            _series(s, log_closed[g], log_time[g], q, v, x, x2, x3, d)
            current = g
        h = times[i] - log_time[g]
        _add_up(q, h, out[i, :n])
        _add_up(v, h, out[i, n:])
