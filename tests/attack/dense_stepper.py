"""Motion by matrix exponentials on a dense grid: the independent integration that the random systems are compared with.

A contact state is a linear system y' = A y + B u(t). Its step is exact for the state, by a Taylor series of the matrix
exponential doubled up to the step asked for, and the inputs enter by their derivatives at its start, of order 0 to 15.
Contacts are sought as sign changes between steps of a tenth of the shortest period; where a watched function falls and
rises again within a step, the step is halved until its minimum is known. So nothing here is certified, and nothing is
shared with the march of the package: neither basis functions, bounds, sources nor the start.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import matrix_balance

ORDERS = 16  # derivatives of the inputs that a step takes: w dt = 2 pi / 10 leaves 0.63^16 / 16! = 3e-17
LEVELS = 48  # halvings of the longest step for which there may be tables; shorter steps are Taylor series
STEPS_A_PERIOD = 10.0
MOST_EVENTS = 4000
TAYLOR = 18  # terms of the matrix exponential of a step of half the inverse of the largest rate
LONG = 8  # doublings from which on tables are made in extended precision: each doubles what is lost of slow motions
EPS = 2.220446049250313e-16


@dataclass(frozen=True)
class Linear:
    """One contact state: y' = A y + B u, u = (1, inputs), and what is looked at in it."""

    A: np.ndarray  # (N, N)
    B: np.ndarray  # (N, U)
    guards: np.ndarray  # (G, N + U) over y and u, positive while the state lasts
    contact: np.ndarray  # (G,) whose guard it is
    following: np.ndarray  # (G,) phase of that contact after the event
    reset: np.ndarray  # (G,) entry of y that starts anew, -1: none
    resets: np.ndarray  # (G, N + U) with this value
    watches: np.ndarray  # (W, N + U) quantities whose maxima are sought


class Inputs(NamedTuple):
    """Inputs in closed form: base (acceleration, velocity, displacement), one force, or forces and their rates."""

    kind: int  # 0 sines, 1 step, 2 half sine, 3 piecewise polynomials, 4 linear sweep
    numbers: np.ndarray
    omega: np.ndarray  # (n,) sines
    amplitude: np.ndarray  # (C, n)
    phase: np.ndarray  # (C, n)
    knots: np.ndarray  # (P + 1,)
    polynomial: np.ndarray  # (C, D, P) in powers of the time since the knot, the highest first
    breaks: np.ndarray = np.zeros(0)  # where a derivative jumps

    @property
    def count(self):
        return self.amplitude.shape[0]

    def at(self, t):
        """(1 + C,) one and the inputs at a time."""
        u = np.empty(self.count + 1)
        _inputs(self, t, u)
        return u


class State(NamedTuple):
    """A contact state with its step tables; rows are stored as columns, over which loops are fast."""

    longest: float  # s, the step of level 0; each level halves it
    usual: int  # level of a tenth of the shortest period
    first: int  # after an event
    finest: int  # that steps between events may have
    tables: np.ndarray  # (levels from the usual one on, N + Z, N) change of y by y and the series of the inputs
    A: np.ndarray  # (N, N)
    B: np.ndarray  # (U, N)
    looks: np.ndarray  # (N + U, 4 R) guards, their rates, watches and their rates, R of each
    guards: int
    watches: int


class Point(NamedTuple):
    """A state with what leads on from it and what is looked at in it."""

    x: np.ndarray  # (N + Z,) state, and the series of the inputs for a step that begins here
    whole: np.ndarray  # (N + U,) state and inputs
    look: np.ndarray  # (4 R,)


class Step(NamedTuple):
    """The ends of a step, and two points between them."""

    start: Point
    end: Point
    low: Point
    middle: Point


class Walk(NamedTuple):
    """What the march fills: outputs at the stops, and the largest values so far."""

    y: np.ndarray  # (N,) state, the start first
    stops: np.ndarray  # (nt,) s
    best: np.ndarray  # (W,)
    out_y: np.ndarray  # (nt, N)
    out_best: np.ndarray  # (nt, W)


@njit(cache=True)
def _inputs(inputs, t, u):
    kind, numbers, channels = inputs.kind, inputs.numbers, inputs.amplitude.shape[0]
    u[:] = 0.0
    u[0] = 1.0
    if kind == 0:
        for c in range(channels):
            for i in range(inputs.omega.size):
                u[c + 1] += inputs.amplitude[c, i] * np.sin(inputs.omega[i] * t + inputs.phase[c, i])
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
                    u[2] = 2.0 * level / w * np.sin(0.5 * w * tau) ** 2
                    u[3] = level / w * (tau - np.sin(w * tau) / w)
                else:
                    u[2] = 2.0 * level / w
                    u[3] = level / w * length + u[2] * (tau - length)
    elif kind == 3:
        p = min(max(np.searchsorted(inputs.knots, t, side="right") - 1, 0), inputs.knots.size - 2)
        tau = t - inputs.knots[p]
        for c in range(channels):
            value = 0.0
            for d in range(inputs.polynomial.shape[1]):
                value = value * tau + inputs.polynomial[c, d, p]
            u[c + 1] = value
    else:
        u[1] = numbers[0] * np.sin(2.0 * np.pi * (numbers[1] * t + 0.5 * numbers[2] * t * t) + numbers[3])


@njit(cache=True)
def _entry(channels, c):
    """Where a channel stands in the series of the inputs, and by which power of the unit it is divided there.

    The series are 1, then displacement, velocity and acceleration of the base with its derivatives, or each force with
    its derivatives: the next entry is the next derivative.
    """
    if channels == 3:
        return 3 - c, c
    half = max(channels // 2, 1)
    return (1 + ORDERS * c, 0) if c < half else (2 + ORDERS * (c - half), -1)


@njit(cache=True)
def _series(inputs, t, dt, unit, u, z):
    """(Z,) series of the inputs at t, those of the piece that holds t + dt / 2, times powers of a unit of time."""
    kind, numbers, channels = inputs.kind, inputs.numbers, inputs.amplitude.shape[0]
    z[:] = 0.0
    z[0], first = 1.0, 1
    if channels == 3:
        _inputs(inputs, t, u)
        z[1], z[2], first = u[3] / unit**2, u[2] / unit, 3
    w = z[first:]
    if kind == 0:
        for c in range((channels + 1) // 2 if channels != 3 else 1):
            for i in range(inputs.omega.size):
                angle = inputs.omega[i] * t + inputs.phase[c, i]
                level, rate = inputs.amplitude[c, i], inputs.omega[i] * unit
                if level != 0.0:
                    _add_sine(level * np.sin(angle), level * np.cos(angle), rate, w[ORDERS * c : ORDERS * (c + 1)])
    elif kind == 1:
        if t - numbers[1] + 0.5 * dt >= 0.0:
            w[0] = numbers[0]
    elif kind == 2:
        level, rate, tau = numbers[0], np.pi / numbers[2], t - numbers[1]
        if 0.0 <= tau + 0.5 * dt < numbers[2]:
            _add_sine(level * np.sin(rate * tau), level * np.cos(rate * tau), rate * unit, w)
    elif kind == 3:
        p = min(max(np.searchsorted(inputs.knots, t + 0.5 * dt, side="right") - 1, 0), inputs.knots.size - 2)
        tau, factor = t - inputs.knots[p], 1.0
        degree = inputs.polynomial.shape[1] - 1
        for k in range(degree + 1):
            value = 0.0
            for d in range(degree + 1 - k):  # the coefficient of tau^(degree - d), derived k times
                share = inputs.polynomial[0, d, p]
                for i in range(k):
                    share *= degree - d - i
                value = value * tau + share
            w[k] = value * factor
            factor *= unit
    else:
        angle = 2.0 * np.pi * (numbers[1] * t + 0.5 * numbers[2] * t * t) + numbers[3]
        once = 2.0 * np.pi * (numbers[1] + numbers[2] * t) * unit
        twice = 2.0 * np.pi * numbers[2] * unit * unit
        sine, cosine = numbers[0] * np.sin(angle), numbers[0] * np.cos(angle)
        sine_before = cosine_before = 0.0
        for k in range(ORDERS):
            w[k] = sine
            following = once * cosine + k * twice * cosine_before
            cosine_after = -once * sine - k * twice * sine_before
            sine_before, cosine_before = sine, cosine
            sine, cosine = following, cosine_after


@njit(cache=True)
def _add_sine(sine, cosine, rate, w):
    for k in range(ORDERS):
        w[k] += sine
        sine, cosine = rate * cosine, -rate * sine


@njit(cache=True)
def _look(state, inputs, t, point):
    """Complete a point at a time from its state."""
    N = len(state.A)
    point.x[:N] = point.whole[:N]
    _inputs(inputs, t, point.whole[N:])
    np.dot(point.whole, state.looks, point.look)


@njit(cache=True)
def _advance(state, inputs, level, t, dt, end, start, point):
    """Make ``point`` what follows from ``start`` in a step of a level, by its table or a Taylor series of degree ten.

    ``end`` : s, t + dt, or the stop that this is but for round-off, where the inputs may jump.
    """
    N = len(state.A)
    y, u, z = point.whole[:N], point.whole[N:], start.x[N:]
    if level < state.usual + len(state.tables):
        _series(inputs, t, dt, state.longest, u, z)
        np.dot(start.x, state.tables[level - state.usual], y)
        y += start.x[:N]
    elif dt > 0.0:
        _series(inputs, t, dt, dt, u, z)
        term, following, factorial = start.x[:N].copy(), np.empty(N), 1.0  # k-th derivative of y times dt^k / k!
        y[:] = term
        for k in range(10):
            np.dot(term, state.A, following)
            if k == 0:
                following += state.B[0]
            for c in range(u.size - 1):
                entry, power = _entry(u.size - 1, c)
                if z[entry + k] != 0.0:
                    following += state.B[c + 1] * (z[entry + k] * dt**power / factorial)
            factorial *= k + 1.0
            term[:] = following * (dt / (k + 1.0))
            y += term
    else:
        y[:] = start.x[:N]
    _look(state, inputs, end, point)


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
def _copy(point, out):
    out.x[:] = point.x
    out.whole[:] = point.whole
    out.look[:] = point.look


@njit(cache=True)
def _crossed(state, point):
    """Whether a guard is below zero by more than round-off."""
    N = len(state.A)
    for j in range(state.guards):
        if point.look[j] < 0.0:
            size = abs(state.looks[N, j])
            for k in range(N):
                size += abs(state.looks[k, j] * point.whole[k])
            if point.look[j] < -64.0 * EPS * size:
                return True
    return False


@njit(cache=True)
def _dips(state, start, end, dt):
    """Whether a guard falls and rises again within a step, and its minimum is not known by its ends."""
    rates = start.look.size // 4
    for j in range(state.guards):
        g0, s0, g1, s1 = start.look[j], start.look[rates + j], end.look[j], end.look[rates + j]
        if s0 < 0.0 and s1 > 0.0 and g0 > 0.0 and _least_of_cubic(g0, s0, g1, s1, dt) < 0.3 * min(g0, g1):
            return True
    return False


@njit(cache=True)
def _halve(state, inputs, level, t, dt, step):
    """Halve a step towards the first crossing, or towards a minimum until it is known.

    Returns the start and length of the part between ``step.low`` and ``step.end``, and whether it is the last part.
    """
    last = True
    tabulated = state.usual + state.tables.shape[0] - 1
    deepest = level + 9 if level > tabulated else min(max(state.finest, level + 9), tabulated)
    _copy(step.start, step.low)
    while level < deepest:
        level += 1
        dt *= 0.5
        _advance(state, inputs, level, t, dt, t + dt, step.low, step.middle)
        if _crossed(state, step.middle) or _dips(state, step.low, step.middle, dt):  # the first half holds it
            _copy(step.middle, step.end)
            last = False
        else:
            t += dt
            _copy(step.middle, step.low)
    return t, dt, last


@njit(cache=True)
def _locate(state, inputs, t, dt, step):
    """Take the end of a step to the first guard that falls through zero; returns its time and which it is."""
    rates, event, when = step.end.look.size // 4, -1, 2.0 * dt
    for j in range(state.guards):
        if step.end.look[j] < 0.0:
            root = _root_of_cubic(
                step.low.look[j], step.low.look[rates + j], step.end.look[j], step.end.look[rates + j], dt
            )
            if root < when:
                when, event = root, j
    for _ in range(8):  # the cubic is a first guess: Newton's method on the motion itself
        _advance(state, inputs, LEVELS, t, when, t + when, step.low, step.end)
        value, slope = step.end.look[event], step.end.look[rates + event]
        if not (slope < 0.0 and 0.0 <= when - value / slope <= dt):
            return t + when, event
        when -= value / slope
        if abs(value) < EPS * dt * abs(slope):
            break
    _advance(state, inputs, LEVELS, t, when, t + when, step.low, step.end)
    return t + when, event


@njit(cache=True)
def _peaks(state, inputs, level, t, end, step, best):
    """Raise the largest values so far by those of a step, which is halved towards a maximum that may be larger."""
    R = step.start.look.size // 4
    tabulated = state.usual + state.tables.shape[0] - 1
    for j in range(state.watches):
        q, r = 2 * R + j, 3 * R + j
        q0, r0, q1, r1 = step.start.look[q], step.start.look[r], step.end.look[q], step.end.look[r]
        best[j] = max(best[j], q0, q1)
        if not (r0 > 0.0 and r1 < 0.0):
            continue
        a, b = t, end
        top = -_least_of_cubic(-q0, -r0, -q1, -r1, b - a)
        doubt = 0.05 * (b - a) * (abs(r0) + abs(r1))  # of the cubic
        if max(q0, q1, top) + doubt > best[j] and level <= tabulated:
            _copy(step.start, step.low)
            for finer in range(level + 1, min(level + 8, tabulated) + 1):
                half = state.longest * 2.0**-finer
                if a + half >= b:
                    continue
                _advance(state, inputs, finer, a, half, a + half, step.low, step.middle)
                if step.middle.look[r] < 0.0:
                    q1, r1, b = step.middle.look[q], step.middle.look[r], a + half
                else:
                    q0, r0, a = step.middle.look[q], step.middle.look[r], a + half
                    _copy(step.middle, step.low)
            top = max(q0, q1, -_least_of_cubic(-q0, -r0, -q1, -r1, b - a))
        best[j] = max(best[j], top)


@njit(cache=True)
def _point(state):
    """An empty one for a contact state; its first numbers are those of a state."""
    return Point(np.empty(state.tables.shape[1]), np.empty(len(state.looks)), np.empty(state.looks.shape[1]))


@njit(cache=True)
def march(state, inputs, walk, t, done, most_steps):
    """March to an event or the last stop; returns the time, stops done, steps, and the guard that ended it or -1."""
    step = Step(_point(state), _point(state), _point(state), _point(state))
    level, longest, steps = state.first, state.longest, 0
    N = walk.y.size
    step.start.whole[:N] = walk.y
    _look(state, inputs, t, step.start)
    while done < walk.stops.size and steps < most_steps:
        steps += 1
        left = walk.stops[done] - t
        used = level
        while used < state.finest and longest * 2.0**-used > left * (1.0 + 1e-13):
            used += 1
        dt = longest * 2.0**-used
        if dt > left * (1.0 + 1e-13):
            used, dt = LEVELS, left
        lands = dt >= left * (1.0 - 1e-13)
        end = walk.stops[done] if lands else t + dt
        _advance(state, inputs, used, t, dt, end, step.start, step.end)
        event = -1
        if _crossed(state, step.end) or (used < LEVELS and _dips(state, step.start, step.end, dt)):
            low, part, last = _halve(state, inputs, used, t, dt, step)
            if not last:
                lands, end = False, low + part
            if _crossed(state, step.end):
                lands = False
                end, event = _locate(state, inputs, low, part, step)
        _peaks(state, inputs, used, t, end, step, walk.best)
        t = end
        _copy(step.end, step.start)
        walk.y[:] = step.end.whole[:N]
        if event >= 0:
            return t, done, steps, event
        level = max(level - 1, state.usual)
        if lands:
            walk.out_y[done] = walk.y
            walk.out_best[done] = walk.best
            done += 1
            if state.first > state.usual:
                level = min(state.usual + 3, state.first)
    return t, done, steps, -1


def _halvings(ratio):
    """How often to halve until a ratio is at most one."""
    return max(int(np.ceil(np.log2(max(ratio, 1.0)))), 0)


def _generator(linear, channels, longest):
    """(N, N + Z) rates of y by y and the series of the inputs, (Z, Z) of the series, which ``_entry`` orders."""
    N, size = len(linear.A), 1 + (ORDERS + 2 if channels == 3 else ORDERS * ((channels + 1) // 2))
    rates = np.zeros((N, N + size), dtype=np.longdouble)
    rates[:, :N], rates[:, N] = linear.A, linear.B[:, 0]
    for c in range(channels):
        entry, power = _entry(channels, c)
        rates[:, N + entry] = linear.B[:, c + 1] * longest**power
    following = [0.0 if k == 0 or (channels != 3 and k % ORDERS == 0) else 1.0 / longest for k in range(size - 1)]
    return rates, np.diag(following, 1)


def _looks(linear, channels):
    """(N + U, 4 R) rows of guards and watches, each followed by the rows of their rates, as columns."""
    N, U = linear.B.shape
    rates = np.zeros((N + U, N + U))
    rates[:N, :N], rates[:N, N:] = linear.A, linear.B
    if channels == 3:  # displacement, velocity and acceleration follow each other
        rates[N + 3, N + 2] = rates[N + 2, N + 1] = 1.0
    else:
        half = channels // 2
        rates[np.arange(half) + N + 1, np.arange(half) + N + 1 + half] = 1.0
    R = max(len(linear.guards), len(linear.watches))
    columns = np.zeros((N + U, 4, R))
    for k, rows in ((0, linear.guards), (2, linear.watches)):
        columns[:, k, : len(rows)], columns[:, k + 1, : len(rows)] = rows.T, (rows @ rates).T
    return columns.reshape(N + U, 4 * R)


def _times(first, second, shift):
    """Upper rows of the product of block triangular matrices, the second with rows and a shift."""
    N = len(first)
    product = first[:, :N] @ second
    product[:, N:] += first[:, N:] @ shift
    return product


def tabulate(linear, channels, longest, stiffest=0.0):
    """Step tables of a contact state.

    Parameters
    ----------
    channels : C, of the inputs.
    longest : s, step of level 0.
    stiffest : rad/s, in any contact state: after an event steps grow from a fraction of its period.
    """
    A, N = linear.A.astype(float), len(linear.A)
    values = np.linalg.eigvals(A)
    fastest, largest = max(np.abs(values.imag).max(initial=0.0), 1e-300), np.abs(values).max()
    usual = min(_halvings(longest * STEPS_A_PERIOD * fastest / (2 * np.pi)), LEVELS - 20)
    finest = min(max(_halvings(longest * largest / 0.05), usual + 9), LEVELS - 10)
    first = min(max(_halvings(longest * max(largest, stiffest) * 2), usual), finest)
    balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    short = min(max(_halvings(longest * np.linalg.norm(balanced, 1) / 0.5), usual), LEVELS - 1)
    kind = np.longdouble if short - usual > LONG else float
    rates, shift = (part.astype(kind) * (longest * 2.0**-short) for part in _generator(linear, channels, longest))
    whole = np.append(scale, np.ones(len(shift)))
    rates *= whole / scale[:, None]  # by powers of two
    powers, shifts = [rates], [shift.astype(float)]
    for k in range(2, TAYLOR):
        powers.append(_times(powers[-1], rates, shift) / k)
        shifts.append(shifts[-1] @ shifts[0] / k)
    end = min(max(short, finest + 9), LEVELS - 1) + 1
    tables = np.empty((end - usual, rates.shape[1], N))
    total, shift = sum(reversed(powers)), sum(reversed(shifts))
    for level in range(short, usual - 1, -1):
        tables[level - usual] = total.T
        total, shift = 2 * total + _times(total, total, shift), 2 * shift + shift @ shift
    shares = 2.0 ** -np.outer(np.arange(1, end - short), np.arange(1, TAYLOR))
    tables[short + 1 - usual :] = np.tensordot(shares, np.array([power.T for power in powers], dtype=float), 1)
    tables *= scale / whole[:, None]
    return State(
        longest,
        usual,
        first,
        finest,
        tables,
        np.ascontiguousarray(A.T),
        np.ascontiguousarray(linear.B.T, dtype=float),
        _looks(linear, channels),
        len(linear.guards),
        len(linear.watches),
    )


def shortly(linear, inputs, longest, y):
    """(N + U,) state and inputs a little after t = 0, in one contact state."""
    state = tabulate(linear, inputs.count, longest)
    start, point, dt = _point(state), _point(state), longest * 2.0**-state.finest
    start.x[: len(y)] = y
    _advance(state, inputs, state.finest, 0.0, dt, dt, start, point)
    return point.whole


@dataclass(frozen=True)
class Motion:
    """The motion up to ``reached``, where the last stop or the work ended it."""

    time: np.ndarray  # (nt,)
    y: np.ndarray  # (nt, N)
    phases: np.ndarray  # (nt, m)
    event_time: np.ndarray
    event_contact: np.ndarray
    event_phase: np.ndarray
    largest: np.ndarray  # (nt, W) of the watched quantities until then


def integrate(build, inputs, longest, start, phases, stops, most_steps, stiffest):
    """March from a start through the stops, tabulating contact states as they are visited.

    Parameters
    ----------
    build : phases -> `Linear`.
    longest : s, longest step.
    stops : (nt,) increasing times that are landed on; breaks of the inputs among them.
    stiffest : rad/s, the largest frequency of any state.
    """
    phases, states, walk, events = list(phases), {}, None, []
    out_phase = np.empty((stops.size, len(phases)), dtype=np.int64)
    t, done = 0.0, 0
    while True:
        key = tuple(phases)
        if key not in states:
            linear = build(key)
            states[key] = linear, tabulate(linear, inputs.count, longest, stiffest)
        linear, state = states[key]
        if walk is None:
            N, W = len(linear.A), len(linear.watches)
            best, outputs = np.full(W, -np.inf), (np.empty((stops.size, N)), np.empty((stops.size, W)))
            walk = Walk(np.array(start, dtype=float), stops, best, *outputs)
        before = done
        t, done, steps, guard = march(state, inputs, walk, t, done, most_steps)
        out_phase[before:done] = key
        most_steps -= steps
        if guard < 0 or len(events) == MOST_EVENTS:
            break
        entry, contact = linear.reset[guard], linear.contact[guard]
        if entry >= 0:
            walk.y[entry] = linear.resets[guard] @ np.append(walk.y, inputs.at(t))
        phases[contact] = int(linear.following[guard])
        events.append((t, contact, phases[contact]))
    times, contacts, following = zip(*events, strict=True) if events else ((), (), ())
    whole = np.array(contacts, dtype=np.int64), np.array(following, dtype=np.int64)
    return Motion(stops[:done], walk.out_y[:done], out_phase[:done], np.array(times), *whole, walk.out_best[:done])
