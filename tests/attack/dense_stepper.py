"""Motion by matrix exponentials on a dense grid: the independent integration that the random systems are compared with.

A contact state is a linear system y' = A y + B u(t). Its step is exact for the state, by a Taylor series of the matrix
exponential doubled up to the step asked for, and the inputs enter by their derivatives at its start, of order 0 to 15.
Contacts are sought as sign changes between steps of a tenth of the shortest period; where a watched function falls and
rises again within a step, the step is halved until its minimum is known. So nothing here is certified, and nothing is
shared with the march of the package: neither basis functions, bounds, sources nor the start.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

ORDERS = 16  # derivatives of the inputs that a step takes: w dt = 2 pi / 10 leaves 0.63^16 / 16! = 3e-17
LEVELS = 48  # halvings of the longest step for which there are tables
STEPS_A_PERIOD = 10.0
MOST_EVENTS = 4000
TAYLOR = 18  # terms of the matrix exponential of the shortest step
LONG = 20  # doublings from which on tables are made in extended precision: each doubles what is lost of slow motions
EPS = 2.220446049250313e-16
DONE, NEED, STEPS, EVENTS = 0, 1, 2, 3


@dataclass(frozen=True)
class Linear:
    """One contact state: y' = A y + B u, u = (1, inputs), and what is looked at in it."""

    A: np.ndarray  # (N, N)
    B: np.ndarray  # (N, U)
    guard_y: np.ndarray  # (G, N) positive while the state lasts
    guard_u: np.ndarray  # (G, U)
    contact: np.ndarray  # (G,) whose guard it is
    following: np.ndarray  # (G,) phase of that contact after the event
    reset: np.ndarray  # (G,) entry of y that starts anew, -1: none
    reset_y: np.ndarray  # (G, N) with this value
    reset_u: np.ndarray  # (G, U)
    watch_y: np.ndarray  # (W, N) quantities whose maxima are sought
    watch_u: np.ndarray  # (W, U)


@dataclass(frozen=True)
class Inputs:
    """Inputs in closed form: base (acceleration, velocity, displacement) or one force."""

    kind: int  # 0 sines, 1 step, 2 half sine, 3 piecewise polynomials, 4 linear sweep
    numbers: np.ndarray
    omega: np.ndarray  # (n,) sines
    amplitude: np.ndarray  # (C, n)
    phase: np.ndarray  # (C, n)
    knots: np.ndarray  # (P + 1,)
    polynomial: np.ndarray  # (C, D, P) in powers of the time since the knot, the highest first
    breaks: tuple[float, ...] = ()  # where a derivative jumps

    @property
    def count(self):
        return self.amplitude.shape[0]

    @property
    def packed(self):
        """What compiled functions take of them."""
        return self.kind, self.numbers, self.omega, self.amplitude, self.phase, self.knots, self.polynomial


def rate_of_inputs(count):
    """(U, U) matrix D with d/dt (1, inputs) = D (1, inputs) where that is linear: d' = v, v' = a; others unused.

    Two or more forces are followed by their rates.
    """
    D = np.zeros((count + 1, count + 1))
    if count == 3:
        D[3, 2] = D[2, 1] = 1.0
    elif count % 2 == 0:
        half = count // 2
        D[np.arange(1, half + 1), np.arange(half + 1, count + 1)] = 1.0
    return D


@njit(cache=True)
def _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, t, u):
    u[0] = 1.0
    channels = amplitude.shape[0]
    for c in range(channels):
        u[c + 1] = 0.0
    if kind == 0:
        for c in range(channels):
            for i in range(omega.size):
                u[c + 1] += amplitude[c, i] * np.sin(omega[i] * t + phase[c, i])
    elif kind == 1:
        level, tau = numbers[0], t - numbers[1]
        if tau >= 0.0:
            u[1] = level
            if channels == 3:
                u[2], u[3] = level * tau, 0.5 * level * tau * tau
    elif kind == 2:
        level, start, length = numbers[0], numbers[1], numbers[2]
        tau, w = t - start, np.pi / numbers[2]
        if tau >= 0.0:
            if tau < length:
                u[1] = level * np.sin(w * tau)
            if channels == 3:
                if tau < length:
                    u[2] = level / w * (1.0 - np.cos(w * tau))
                    u[3] = level / w * (tau - np.sin(w * tau) / w)
                else:
                    u[2] = 2.0 * level / w
                    u[3] = level / w * length + u[2] * (tau - length)
    elif kind == 3:
        p = min(max(np.searchsorted(knots, t, side="right") - 1, 0), knots.size - 2)
        tau = t - knots[p]
        for c in range(channels):
            value = 0.0
            for d in range(polynomial.shape[1]):
                value = value * tau + polynomial[c, d, p]
            u[c + 1] = value
    else:
        u[1] = numbers[0] * np.sin(2.0 * np.pi * (numbers[1] * t + 0.5 * numbers[2] * t * t) + numbers[3])


@njit(cache=True)
def _derivatives(inputs, t, dt, unit, w):
    """(C, ORDERS) derivatives of the inputs at t, those of the piece that holds t + dt / 2, times powers of a unit."""
    kind, numbers, omega, amplitude, phase, knots, polynomial = inputs
    channels = amplitude.shape[0]
    w[:] = 0.0
    if kind == 0:
        for c in range(channels):
            for i in range(omega.size):
                angle = omega[i] * t + phase[c, i]
                sine, cosine = amplitude[c, i] * np.sin(angle), amplitude[c, i] * np.cos(angle)
                _add_sine(sine, cosine, omega[i] * unit, w[c])
    elif kind == 1:
        level, tau = numbers[0], t - numbers[1]
        if tau + 0.5 * dt >= 0.0:
            w[0, 0] = level
            if channels == 3:
                w[1, 0], w[1, 1] = level * tau, level * unit
                w[2, 0], w[2, 1], w[2, 2] = 0.5 * level * tau * tau, level * tau * unit, level * unit * unit
    elif kind == 2:
        level, length, rate = numbers[0], numbers[2], np.pi / numbers[2]
        tau = t - numbers[1]
        if 0.0 <= tau + 0.5 * dt < length:
            sine, cosine = level * np.sin(rate * tau), level * np.cos(rate * tau)
            _add_sine(sine, cosine, rate * unit, w[0])
            if channels == 3:
                _add_sine(-cosine / rate, sine / rate, rate * unit, w[1])
                _add_sine(-sine / rate**2, -cosine / rate**2, rate * unit, w[2])
                w[1, 0] = 2.0 * level / rate * np.sin(0.5 * rate * tau) ** 2
                w[2, 0] += level / rate * tau
                w[2, 1] = w[1, 0] * unit
        elif tau + 0.5 * dt >= length and channels == 3:
            w[1, 0] = 2.0 * level / rate
            w[2, 0], w[2, 1] = level / rate * length + w[1, 0] * (tau - length), w[1, 0] * unit
    elif kind == 3:
        p = min(max(np.searchsorted(knots, t + 0.5 * dt, side="right") - 1, 0), knots.size - 2)
        tau = t - knots[p]
        degree = polynomial.shape[1] - 1
        for c in range(channels):
            factor = 1.0
            for k in range(degree + 1):
                value = 0.0
                for d in range(degree + 1 - k):  # the coefficient of tau^(degree - d), derived k times
                    share = polynomial[c, d, p]
                    for i in range(k):
                        share *= degree - d - i
                    value = value * tau + share
                w[c, k] = value * factor
                factor *= unit
    else:
        angle = 2.0 * np.pi * (numbers[1] * t + 0.5 * numbers[2] * t * t) + numbers[3]
        first = 2.0 * np.pi * (numbers[1] + numbers[2] * t) * unit
        second = 2.0 * np.pi * numbers[2] * unit * unit
        sine, cosine = numbers[0] * np.sin(angle), numbers[0] * np.cos(angle)
        sine_before = cosine_before = 0.0
        for k in range(ORDERS):
            w[0, k] = sine
            following = first * cosine + k * second * cosine_before
            cosine_after = -first * sine - k * second * sine_before
            sine_before, cosine_before = sine, cosine
            sine, cosine = following, cosine_after


@njit(cache=True)
def _add_sine(sine, cosine, rate, w):
    for k in range(ORDERS):
        w[k] += sine
        sine, cosine = rate * cosine, -rate * sine


@njit(cache=True)
def _step(F, inputs, s, level, longest, t, y, w, out):
    """State after longest / 2^level."""
    N, channels = y.size, w.shape[0]
    if channels > 0:
        _derivatives(inputs, t, longest * 2.0**-level, longest, w)
    table = F[s, level]
    for i in range(N):
        total = table[i, N]
        for k in range(N):
            total += table[i, k] * y[k]
        q = N + 1
        for c in range(channels):
            for k in range(ORDERS):
                total += table[i, q] * w[c, k]
                q += 1
        out[i] = y[i] + total


@njit(cache=True)
def _short_step(A, B, inputs, s, t, r, y, w, out):
    """State after a step r so short that a Taylor series of degree ten is exact."""
    N, channels = y.size, w.shape[0]
    for i in range(N):
        out[i] = y[i]
    if r <= 0.0:
        return
    if channels > 0:
        _derivatives(inputs, t, r, r, w)
    term = y.copy()  # k-th derivative of y times r^k / k!
    following = np.empty(N)
    factorial = 1.0
    for k in range(10):
        for i in range(N):
            total = B[s, i, 0] if k == 0 else 0.0
            for j in range(N):
                total += A[s, i, j] * term[j]
            for c in range(channels):
                total += B[s, i, c + 1] * w[c, k] / factorial
            following[i] = total * r / (k + 1.0)
        factorial *= k + 1.0
        for i in range(N):
            term[i] = following[i]
            out[i] += term[i]


@njit(cache=True)
def _look(rows_y, rows_u, count, y, u, value):
    for g in range(count):
        total = 0.0
        for k in range(y.size):
            total += rows_y[g, k] * y[k]
        for k in range(u.size):
            total += rows_u[g, k] * u[k]
        value[g] = total


@njit(cache=True)
def _least_of_cubic(g0, s0, g1, s1, dt):
    """Smallest value of the cubic with these ends on the step, where it falls first and rises last."""
    a = 2.0 * (g0 - g1) + dt * (s0 + s1)
    b = 3.0 * (g1 - g0) - dt * (2.0 * s0 + s1)
    c = dt * s0
    if abs(a) <= 1e-14 * (abs(b) + abs(c)):
        x = -c / (2.0 * b) if b != 0.0 else 0.5
    else:
        x = (-b + np.sqrt(max(b * b - 3.0 * a * c, 0.0))) / (3.0 * a)
    x = min(max(x, 0.0), 1.0)
    return g0 + x * (c + x * (b + x * a))


@njit(cache=True)
def _root_of_cubic(g0, s0, g1, s1, dt):
    """First time at which the cubic with these ends falls through zero; g1 < 0."""
    a = 2.0 * (g0 - g1) + dt * (s0 + s1)
    b = 3.0 * (g1 - g0) - dt * (2.0 * s0 + s1)
    c = dt * s0
    low, high, x = 0.0, 1.0, 1.0
    if g0 > 0.0:
        x = g0 / (g0 - g1)
    for _ in range(80):
        value = g0 + x * (c + x * (b + x * a))
        slope = c + x * (2.0 * b + 3.0 * a * x)
        if value < 0.0:
            high = x
        else:
            low = x
        new = x - value / slope if slope < 0.0 else -1.0
        if not (low < new < high):
            new = 0.5 * (low + high)
        if abs(new - x) < 1e-15:
            break
        x = new
    return x * dt


@njit(cache=True)
def march(
    F,
    A,
    B,
    guards,
    contact,
    following,
    reset,
    reset_y,
    reset_u,
    guard_y,
    guard_u,
    rate_y,
    rate_u,
    roughness,
    watch_y,
    watch_u,
    watch_rate_y,
    watch_rate_u,
    watched,
    usual,
    finest,
    bottom,
    first_level,
    index,
    radix,
    inputs,
    longest,
    t,
    y,
    state,
    phases,
    fresh,
    stops,
    n_stop,
    out_y,
    out_phase,
    out_best,
    most_steps,
    most_events,
    ev_time,
    ev_contact,
    ev_phase,
    n_ev,
    best,
):
    """March to the last stop; returns (code, t, state, stops done, events, steps). y and phases change in place."""
    N, U = y.size, B.shape[2]
    G, W = guard_y.shape[1], watch_y.shape[1]
    u, v = np.empty(U), np.empty(U)
    w = np.empty((U - 1, ORDERS))
    g0, s0, g1, s1, gm, sm = np.empty(G), np.empty(G), np.empty(G), np.empty(G), np.empty(G), np.empty(G)
    q0, r0, q1, r1 = np.empty(W), np.empty(W), np.empty(W), np.empty(W)
    ya, yb, ym = np.empty(N), np.empty(N), np.empty(N)
    kind, numbers, omega, amplitude, phase, knots, polynomial = inputs
    steps = 0
    level = first_level[state] if fresh else usual[state]
    while n_stop < stops.size:
        n, m = guards[state], watched[state]
        gy, gu, ry, ru = guard_y[state], guard_u[state], rate_y[state], rate_u[state]
        _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, t, u)
        _look(gy, gu, n, y, u, g0)
        _look(ry, ru, n, y, u, s0)
        _look(watch_y[state], watch_u[state], m, y, u, q0)
        _look(watch_rate_y[state], watch_rate_u[state], m, y, u, r0)
        for j in range(m):
            best[j] = max(best[j], q0[j])
        event = -1
        while event < 0 and n_stop < stops.size:
            if steps >= most_steps:
                return STEPS, t, state, n_stop, n_ev, steps
            steps += 1
            left = stops[n_stop] - t
            used = level
            while used < finest[state] and longest * 2.0**-used > left * (1.0 + 1e-13):
                used += 1
            dt = longest * 2.0**-used
            if dt > left * (1.0 + 1e-13):
                dt = left
                _short_step(A, B, inputs, state, t, dt, y, w, yb)
                used = LEVELS
            else:
                _step(F, inputs, state, used, longest, t, y, w, yb)
            lands = dt >= left * (1.0 - 1e-13)
            tb = stops[n_stop] if lands else t + dt
            _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, tb, v)
            _look(gy, gu, n, yb, v, g1)
            _look(ry, ru, n, yb, v, s1)
            crosses = dips = False
            for j in range(n):
                size = 0.0
                for k in range(N):
                    size += abs(roughness[state, j, k] * yb[k])
                tolerance = 64.0 * EPS * (size + abs(gu[j, 0]))
                if g1[j] < -tolerance:
                    crosses = True
                elif s0[j] < 0.0 and s1[j] > 0.0 and g0[j] > 0.0 and used < LEVELS:
                    least = _least_of_cubic(g0[j], s0[j], g1[j], s1[j], dt)
                    dips = dips or least < 0.3 * min(g0[j], g1[j])
            if crosses or dips:
                # halve towards the first crossing, or towards the minimum until it is known
                ta, ka, half = t, used, dt
                for k in range(N):
                    ya[k] = y[k]
                ga, sa = g0.copy(), s0.copy()
                deepest = used + 9 if used == LEVELS else min(max(finest[state], used + 9), bottom[state])
                while ka < deepest:
                    ka += 1
                    half *= 0.5
                    if used == LEVELS:
                        _short_step(A, B, inputs, state, ta, half, ya, w, ym)
                    else:
                        _step(F, inputs, state, ka, longest, ta, ya, w, ym)
                    _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, ta + half, v)
                    _look(gy, gu, n, ym, v, gm)
                    _look(ry, ru, n, ym, v, sm)
                    below = falls = False
                    for j in range(n):
                        size = 0.0
                        for k in range(N):
                            size += abs(roughness[state, j, k] * ym[k])
                        below = below or gm[j] < -64.0 * EPS * (size + abs(gu[j, 0]))
                        if sa[j] < 0.0 and sm[j] > 0.0 and ga[j] > 0.0:
                            falls = falls or _least_of_cubic(ga[j], sa[j], gm[j], sm[j], half) < 0.3 * min(ga[j], gm[j])
                    if below or falls:  # the first half holds it
                        crosses = crosses or below
                        for k in range(N):
                            yb[k] = ym[k]
                        for j in range(n):
                            g1[j], s1[j] = gm[j], sm[j]
                    else:
                        ta += half
                        for k in range(N):
                            ya[k] = ym[k]
                        for j in range(n):
                            ga[j], sa[j] = gm[j], sm[j]
                if crosses:
                    when = 2.0 * half
                    for j in range(n):
                        if g1[j] < 0.0:
                            root = _root_of_cubic(ga[j], sa[j], g1[j], s1[j], half)
                            if root < when:
                                when, event = root, j
                    if event >= 0:
                        for _ in range(8):  # the cubic is a first guess: Newton's method on the motion itself
                            _short_step(A, B, inputs, state, ta, when, ya, w, yb)
                            _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, ta + when, v)
                            _look(gy, gu, n, yb, v, gm)
                            _look(ry, ru, n, yb, v, sm)
                            if not (sm[event] < 0.0 and 0.0 <= when - gm[event] / sm[event] <= half):
                                break
                            when -= gm[event] / sm[event]
                            if abs(gm[event]) < EPS * half * abs(sm[event]):
                                break
                        _short_step(A, B, inputs, state, ta, when, ya, w, yb)
                        tb = ta + when
                        lands = False
                else:  # nothing happened: take the step as it was
                    _step(F, inputs, state, used, longest, t, y, w, yb)
            _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, tb, u)
            _look(watch_y[state], watch_u[state], m, yb, u, q1)
            _look(watch_rate_y[state], watch_rate_u[state], m, yb, u, r1)
            for j in range(m):
                top = max(q0[j], q1[j])
                if r0[j] > 0.0 and r1[j] < 0.0:
                    top = max(top, -_least_of_cubic(-q0[j], -r0[j], -q1[j], -r1[j], tb - t))
                doubt = 0.05 * (tb - t) * (abs(r0[j]) + abs(r1[j]))  # of the cubic
                if top + doubt > best[j] and r0[j] > 0.0 and r1[j] < 0.0 and used < LEVELS:
                    ta, ka = t, used
                    for k in range(N):
                        ya[k] = y[k]
                    qa, ra, qb, rb, tc = q0[j], r0[j], q1[j], r1[j], tb
                    while ka < min(used + 8, bottom[state]):
                        ka += 1
                        half = longest * 2.0**-ka
                        if ta + half >= tc:
                            continue
                        _step(F, inputs, state, ka, longest, ta, ya, w, ym)
                        _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, ta + half, v)
                        value = slope = 0.0
                        for k in range(N):
                            value += watch_y[state, j, k] * ym[k]
                            slope += watch_rate_y[state, j, k] * ym[k]
                        for k in range(U):
                            value += watch_u[state, j, k] * v[k]
                            slope += watch_rate_u[state, j, k] * v[k]
                        if slope < 0.0:
                            qb, rb, tc = value, slope, ta + half
                        else:
                            qa, ra, ta = value, slope, ta + half
                            for k in range(N):
                                ya[k] = ym[k]
                    top = max(max(qa, qb), -_least_of_cubic(-qa, -ra, -qb, -rb, tc - ta))
                best[j] = max(best[j], top)
                q0[j], r0[j] = q1[j], r1[j]
            t = tb
            for k in range(N):
                y[k] = yb[k]
            if event < 0:
                _look(gy, gu, n, y, u, g0)
                _look(ry, ru, n, y, u, s0)
                if level > usual[state]:
                    level -= 1
                if lands:
                    for k in range(N):
                        out_y[n_stop, k] = y[k]
                    for k in range(phases.size):
                        out_phase[n_stop, k] = phases[k]
                    for k in range(W):
                        out_best[n_stop, k] = best[k]
                    n_stop += 1
                    _inputs(kind, numbers, omega, amplitude, phase, knots, polynomial, t, u)
                    _look(ry, ru, n, y, u, s0)
                    level = min(usual[state] + 3, first_level[state]) if first_level[state] > usual[state] else level
        if event >= 0:
            if n_ev >= most_events:
                return EVENTS, t, state, n_stop, n_ev, steps
            j = contact[state, event]
            entry = reset[state, event]
            if entry >= 0:
                value = 0.0
                for k in range(N):
                    value += reset_y[state, event, k] * y[k]
                for k in range(U):
                    value += reset_u[state, event, k] * u[k]
                y[entry] = value
            phases[j] = following[state, event]
            ev_time[n_ev], ev_contact[n_ev], ev_phase[n_ev] = t, j, phases[j]
            n_ev += 1
            code = 0
            for k in range(phases.size):
                code += radix[k] * phases[k]
            if index[code] < 0:
                return NEED, t, state, n_stop, n_ev, steps
            state = index[code]
            level = first_level[state]
    return DONE, t, state, n_stop, n_ev, steps


def _product(first, second):
    """Product of two block triangular matrices, each by its upper rows (N, Q) and what takes derivatives to others.

    The lower rows of the whole matrices are those of the inputs' derivatives, which are the same for every input, and a
    row of zeros for what is constant.
    """
    N = first[0].shape[0]
    upper = first[0][:, :N] @ second[0]
    for a in range(N + 1, upper.shape[1], ORDERS):
        upper[:, a : a + ORDERS] += first[0][:, a : a + ORDERS] @ second[1]
    return upper, first[1] @ second[1]


def _halvings(ratio):
    """How often to halve until a ratio is at most one."""
    return max(int(np.ceil(np.log2(max(ratio, 1.0)))), 0)


@dataclass
class Tables:
    """Step tables of the contact states visited so far."""

    count: int  # N
    inputs: Inputs
    longest: float  # s
    phases: tuple[int, ...]  # number of phases of each contact
    stiffest: float = 0.0  # rad/s, in any contact state: after an event steps grow from a fraction of its period
    arrays: dict = field(default_factory=dict)
    used: int = 0

    def __post_init__(self):
        self.radix = np.cumprod([1, *self.phases])[:-1].astype(np.int64) if self.phases else np.zeros(0, np.int64)
        self.index = np.full(int(np.prod(self.phases, dtype=np.int64)), -1, dtype=np.int64)

    def add(self, phases, linear):
        """Tabulate a contact state."""
        N, U = self.count, self.inputs.count + 1
        Q = N + 1 + (U - 1) * ORDERS
        eigenvalues = np.linalg.eigvals(linear.A.astype(float))
        fastest = max(np.abs(eigenvalues.imag).max(initial=0.0), 1e-300)
        period = 2 * np.pi / fastest
        usual = min(_halvings(self.longest * STEPS_A_PERIOD / period), LEVELS - 20)
        rate = np.linalg.norm(linear.A, 1)
        finest = min(max(_halvings(self.longest * np.abs(eigenvalues).max() / 0.05), usual + 9), LEVELS - 10)
        first = min(max(_halvings(self.longest * max(np.abs(eigenvalues).max(), self.stiffest) * 2), usual), finest)
        start = min(max(_halvings(self.longest * rate / 0.5), finest + 9), LEVELS - 1)
        kind = np.longdouble if start > LONG else float
        rates, shift = np.zeros((N, Q), dtype=kind), np.zeros((ORDERS, ORDERS), dtype=kind)
        rates[:, :N], rates[:, N], rates[:, N + 1 :: ORDERS] = linear.A, linear.B[:, 0], linear.B[:, 1:]
        shift[np.arange(ORDERS - 1), np.arange(1, ORDERS)] = 1.0 / self.longest
        step = rates * (self.longest * 2.0**-start), shift * (self.longest * 2.0**-start)
        power, total = step, step
        for k in range(2, TAYLOR):
            power = tuple(part / k for part in _product(power, step))
            total = total[0] + power[0], total[1] + power[1]
        F = np.full((LEVELS, N, Q), np.nan)  # shorter steps are Taylor series
        for level in range(start, -1, -1):
            F[level] = total[0]
            if level > 0:
                with np.errstate(over="ignore", invalid="ignore"):
                    square = _product(total, total)
                    total = 2 * total[0] + square[0], 2 * total[1] + square[1]
        D = rate_of_inputs(self.inputs.count)
        G = linear.guard_y.shape[0]
        rows = {
            "F": F,
            "A": linear.A,
            "B": linear.B,
            "guards": G,
            "contact": linear.contact,
            "following": linear.following,
            "reset": linear.reset,
            "reset_y": linear.reset_y,
            "reset_u": linear.reset_u,
            "guard_y": linear.guard_y,
            "guard_u": linear.guard_u,
            "rate_y": linear.guard_y @ linear.A,
            "rate_u": linear.guard_y @ linear.B + linear.guard_u @ D,
            "roughness": linear.guard_y,
            "watch_y": linear.watch_y,
            "watch_u": linear.watch_u,
            "watch_rate_y": linear.watch_y @ linear.A,
            "watch_rate_u": linear.watch_y @ linear.B + linear.watch_u @ D,
            "watched": linear.watch_y.shape[0],
            "usual": usual,
            "finest": finest,
            "bottom": start,
            "first_level": first,
        }
        for name, row in rows.items():
            row = np.asarray(row)
            old = self.arrays.get(name)
            if (
                old is None
                or old.shape[0] <= self.used
                or any(a < b for a, b in zip(old.shape[1:], row.shape, strict=True))
            ):
                shape = tuple(
                    max(a, b) for a, b in zip((0,) * row.ndim if old is None else old.shape[1:], row.shape, strict=True)
                )
                room = 4 if old is None else max(old.shape[0], 2 * self.used if old.shape[0] <= self.used else 0)
                new = np.zeros((room, *shape), dtype=np.int64 if row.dtype.kind in "iu" else float)
                if old is not None:
                    new[tuple(slice(0, d) for d in old.shape)] = old
                self.arrays[name] = old = new
            old[(self.used, *(slice(0, d) for d in row.shape))] = row
        self.index[int(self.radix @ np.array(phases, dtype=np.int64)) if self.phases else 0] = self.used
        self.used += 1
        return self.used - 1


@dataclass(frozen=True)
class Motion:
    """The motion up to ``end``, or up to the stop before it where the work was limited."""

    time: np.ndarray  # (nt,)
    y: np.ndarray  # (nt, N)
    phases: np.ndarray  # (nt, m)
    event_time: np.ndarray
    event_contact: np.ndarray
    event_phase: np.ndarray
    largest: np.ndarray  # (nt, W) of the watched quantities until then
    steps: int
    reached: float  # s, where the work or the last stop ended it


ORDER = (
    "F",
    "A",
    "B",
    "guards",
    "contact",
    "following",
    "reset",
    "reset_y",
    "reset_u",
    "guard_y",
    "guard_u",
    "rate_y",
    "rate_u",
    "roughness",
    "watch_y",
    "watch_u",
    "watch_rate_y",
    "watch_rate_u",
    "watched",
    "usual",
    "finest",
    "bottom",
    "first_level",
)


def integrate(build, count, phase_counts, inputs, longest, start, phases, stops, watches, most_steps, stiffest):
    """March from a start through the stops, building contact states as they are visited.

    Parameters
    ----------
    build : phases -> `Linear`.
    count : N. ``phase_counts`` : number of phases of each contact.
    longest : s, longest step. ``stops`` : (nt,) increasing times that are landed on; breaks of the inputs among them.
    watches : number of quantities whose maxima are sought. ``stiffest`` : rad/s, the largest frequency of any state.
    """
    tables = Tables(count, inputs, longest, tuple(phase_counts), stiffest)
    phases = np.array(phases, dtype=np.int64)
    y = np.array(start, dtype=float)
    packed = inputs.packed
    out_y, out_phase = np.empty((stops.size, count)), np.empty((stops.size, phases.size), dtype=np.int64)
    out_best = np.empty((stops.size, watches))
    ev_time, ev_contact, ev_phase = (
        np.empty(MOST_EVENTS),
        np.empty(MOST_EVENTS, np.int64),
        np.empty(MOST_EVENTS, np.int64),
    )
    best = np.full(watches, -np.inf)
    t, done, events, steps = 0.0, 0, 0, 0
    state = tables.add(tuple(phases), build(tuple(phases)))
    while True:
        code, t, state, done, events, more = march(
            *(tables.arrays[name] for name in ORDER),
            tables.index,
            tables.radix,
            packed,
            longest,
            t,
            y,
            state,
            phases,
            True,
            stops,
            done,
            out_y,
            out_phase,
            out_best,
            most_steps - steps,
            MOST_EVENTS,
            ev_time,
            ev_contact,
            ev_phase,
            events,
            best,
        )
        steps += more
        if code != NEED:
            break
        state = tables.add(tuple(phases), build(tuple(phases)))
    return Motion(
        stops[:done],
        out_y[:done],
        out_phase[:done],
        ev_time[:events],
        ev_contact[:events],
        ev_phase[:events],
        out_best[:done],
        steps,
        t,
    )
