r"""Compiled kernels of the exact flow: motion on a segment, search for its first event, march from one to the next,
moments of exponentials.

Arrays in, arrays out; nothing is allocated per segment. Symbols: ``tau`` is the time since the start of a
segment, ``gamma[b]`` a complex coefficient of the basis function :math:`\tau^{p_b} e^{\lambda_b \tau}`, so
that an event function is :math:`g(\tau) = \mathrm{Re} \sum_b \gamma_b \tau^{p_b} e^{\lambda_b\tau}`.

Guards are functions :math:`g(\tau) = \mathrm{Re} \sum_b \gamma_b \tau^{p_b} e^{\lambda_b \tau}` that are positive while
the contacts stay in their phases. From value, slope and a bound on the curvature follows a step over which no guard can
reach zero; many of them lead to the first zero, or to the end of the segment.

Numbers are known to round-off, so that zero is a question of tolerances. There are three:

- The *noise* of a guard is the round-off of its terms at tau, or, where they cancel, that of the parts they are made of
  (`Guards.noise_floor`). Within it a guard counts as zero: it has an event only where it is below zero by more.
- The *floor* of a guard is how far it may be below zero where the segment starts, until it rises. After an event all
  guards are positive or at zero, and what is below is round-off of the change of coordinates: at most `AT_EVENT` of
  the terms, or `AT_ONCE` of the segment. At the beginning of a motion, whose phases the first derivatives have
  decided, it is `AT_START` times the noise.
- A guard that is zero from the start of its segment and then falls (a contact at rest when an input begins) is detected
  late, by an amount set by its noise. If its initial slope explains the value, the event is at tau, else at the start.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel, summing

EPS = 2.220446049250313e-16
LEAST = 1.0  # smallest size of x for which (e^x - 1) / x keeps its digits


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
    event_function: Any  # (S, T, w) of the state's guards, then of the internal states after the events that reset them
    roundoff_scale: (
        Any  # (S, T, g) size of each term's parts before they cancel, which sets the round-off of the guards
    )
    horizon: Any  # (S,)
    phase: Any  # (S, m) of the contacts
    n_guards: Any  # (S,)
    n_joining: Any  # (S,) see `Guards.joining_count`
    guard_contact: Any  # (S, g) contact of each guard
    reset: Any  # (S, g) column of `watch` with the contact's internal states after the event, -1 where they go on
    successor: Any  # (S, g) state after a guard's event, -1 if it is not in memory
    first: Any  # (m,) of a contact's internal states in the state vector
    states: Any  # (m,) number of a contact's internal states


class Inputs(NamedTuple):
    """Sources on pieces (see :mod:`beamsim.inputs.signal`)."""

    start: Any  # (P,)
    amplitude: Any  # (P, F)
    exponent: Any  # (F,)
    power: Any  # (F,)
    group_last: Any  # (F,)


@kernel
def _exp(re: float, im: float, tau: float) -> complex:
    """e^{lambda tau}.

    Parameters
    ----------
    re, im : parts of lambda, 1/s.
    tau : s.

    Returns
    -------
    complex
    """
    size = 1.0 if re == 0.0 else math.exp(re * tau)
    if im == 0.0:
        return complex(size, 0.0)
    angle = im * tau
    return complex(size * math.cos(angle), size * math.sin(angle))


@kernel
def _shift(inputs, amplitude, piece, t, out):
    """Amplitudes of the inputs, or changes of them, about another time than the start of their piece.

    Parameters
    ----------
    inputs : Inputs.
    amplitude : (P, F) about the starts of the pieces.
    piece : of the inputs.
    t : s.
    out : (F,) or more; the first F are written.
    """
    shift = t - inputs.start[piece]
    for f in range(inputs.exponent.size):
        total = amplitude[piece, f]
        factor = 1.0
        for q in range(f + 1, inputs.group_last[f] + 1):
            step = q - f
            factor = factor * shift * (inputs.power[f] + step) / step
            total += factor * amplitude[piece, q]
        nu = inputs.exponent[f]
        if shift != 0.0 and nu != 0.0:
            total *= _exp(nu.real, nu.imag, shift)
        out[f] = total


@kernel
def _fill_sources(tables, s, inputs, piece, t, y, work, zeta):
    """Amplitudes of all sources at the start (time t, state y) of a segment in state s; ``work`` (N,) is for work.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs.
    s : number of the state.
    piece : of the inputs.
    t : s.
    y : (N,) state.
    work : (N,) room for work.
    zeta : (F + Z,) of the inputs, then of the free motions; written.
    """
    F = inputs.exponent.size
    _shift(inputs, inputs.amplitude, piece, t, zeta)
    for k in range(y.size):
        work[k] = y[k]
    for q in range(tables.n_terms[s]):
        source = tables.term_source[s, q]
        if source < F and tables.power[s, tables.term_basis[s, q]] == 0:
            z = zeta[source]
            for k in range(y.size):
                v = tables.term_vector[s, q, k]
                work[k] -= v.real * z.real - v.imag * z.imag
    _project(tables.projector[s], tables.n_free[s], work, zeta[F:])


@summing
def _project(projector, count, y, amplitude):
    """Amplitudes of ``count`` free motions in a state y; sums in an order that suits the processor.

    Parameters
    ----------
    projector : (Z, N).
    count : of free motions.
    y : (N,) state.
    amplitude : (Z,) the first ``count`` are written.
    """
    for i in range(count):
        real = 0.0
        imag = 0.0
        for k in range(y.size):
            real += projector[i, k].real * y[k]
            imag += projector[i, k].imag * y[k]
        amplitude[i] = complex(real, imag)


@kernel
def _fill_basis(exponent, power, nb, tau, value):
    """Basis functions at tau.

    Parameters
    ----------
    exponent, power : (B,) of the functions, 1/s.
    nb : how many of them.
    tau : s, since the start of the segment.
    value : (B,) complex; the first ``nb`` are written.
    """
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
def _state_at(tables, s, zeta, basis, y):
    """The state from the amplitudes of sources and the values of basis functions.

    Parameters
    ----------
    tables : Tables.
    s : number of the contact state.
    zeta : (F + Z,) amplitudes, see `_fill_sources`.
    basis : (B,) values, see `_fill_basis`.
    y : (N,) written.
    """
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
def _reset(tables, s, guard, zeta, basis, y):
    """Write the internal states after a guard's event into y; ``basis`` is evaluated at the event.

    Parameters
    ----------
    tables, s, zeta, basis : as for `_state_at`.
    guard : of state s.
    y : (N,) state, written where the event resets it.
    """
    column = tables.reset[s, guard]
    if column < 0:
        return
    contact = tables.guard_contact[s, guard]
    for i in range(tables.states[contact]):
        total = 0.0
        for q in range(tables.n_terms[s]):
            w = tables.event_function[s, q, column + i]
            total += (w * zeta[tables.term_source[s, q]] * basis[tables.term_basis[s, q]]).real
        y[tables.first[contact] + i] = total


AT_EVENT, AT_ONCE, AT_START = 1e-9, 1e-10, 1e3  # floors, see above
BELOW = 10.0  # noises below zero, from which the lowest of several guards comes first
TAYLOR = 8  # order of the derivative that is bounded where bounds on the curvature allow short steps only
PATIENCE = 20  # steps on a segment, of which the last is such a longer one
ONWARDS, BEGINNING = -1, -2  # how a segment starts that does not start with the event of a guard
NO_EVENT, NO_STEP = -1, -2


class Guards(NamedTuple):
    """The first g guards of some tables, with the first B of their basis functions, on a segment."""

    basis: Any  # B
    count: Any  # g
    joining_count: Any  # how many, the first ones, act before any other: contacts that join others at rest
    exponent: Any  # (B,) 1/s
    power: Any  # (B,)
    coefficient: Any  # (B, g)
    size: Any  # (B, g) of the coefficients
    noise_floor: Any  # (g,) round-off that cancelling parts of the coefficients leave


class SearchWork(NamedTuple):
    """Work arrays of a search for the first event."""

    values: Any  # (4, g) value, slope, bound on the curvature, round-off
    floors: Any  # (g,)
    slopes: Any  # (g,) at the start of the segment, of what has not risen since; else -inf


@kernel
def _first_event(guards, work, H, start_guard, max_evaluations):
    """The first event on [0, H].

    Parameters
    ----------
    guards, work : what is searched, and room for it.
    H : s, length of the segment.
    start_guard : the guard whose event is at its start, `ONWARDS` without one, or `BEGINNING` of the motion.
    max_evaluations : evaluations of the guards.

    Returns
    -------
    tau : s, time of the event, H without one, or how far the search came with ``max_evaluations`` evaluations.
    hit : the guard; `NO_EVENT` up to tau, or `NO_STEP` where a step has no length.
    evaluations : of the guards.
    """
    out, floors, slopes = work.values, work.floors, work.slopes
    for j in range(guards.count):
        floors[j] = 0.0
    tau, evaluations = 0.0, 0
    while tau < H and evaluations <= max_evaluations:
        reach = _evaluate(guards, tau, H, out)
        evaluations += 1
        if tau == 0.0 and start_guard != ONWARDS:
            _fill_floors(guards, out, H, start_guard, floors)
        step, hit = _next_step(guards, out, floors, tau, reach, evaluations % PATIENCE == 0)
        if start_guard < 0:
            step *= _follow_zeros(guards, out, tau, slopes, floors)
        if hit >= 0:
            if start_guard < 0 and slopes[hit] * tau > -0.5 * _noise(guards, out, hit):
                return 0.0, hit, evaluations
            return _crossing(out, hit, tau), hit, evaluations
        if tau + step == tau:
            return tau, NO_STEP, evaluations
        tau += step
    return min(tau, H), NO_EVENT, evaluations


@kernel
def _noise(guards, out, j):
    """Round-off of a guard, below which it counts as zero.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) as `_evaluate` fills it.
    j : the guard.

    Returns
    -------
    float
        In units of the guard.
    """
    return max(out[3, j], guards.noise_floor[j])


@kernel
def _evaluate(guards, tau, H, out):
    """Value, slope, bound on the curvature over [tau, reach] and round-off of the guards into ``out``; returns reach.

    The bound is the triangle inequality on every term's second derivative, with decaying exponentials taken at tau.

    Parameters
    ----------
    guards : Guards.
    tau : s, since the start of the segment.
    H : s, length of the segment.
    out : (4, g) value, slope, bound on the curvature, round-off; written.

    Returns
    -------
    reach : s, as far as the bound holds.
    """
    values, slopes, bounds, noises = out[0], out[1], out[2], out[3]
    count, gamma, size = guards.count, guards.coefficient, guards.size
    for j in range(count):
        values[j], slopes[j], bounds[j], noises[j] = 0.0, 0.0, 0.0, 0.0
    first_value, first_slope, first_bound, first_noise = 0.0, 0.0, 0.0, 0.0
    reach = H  # a high power is bounded by its value at the far end: later evaluations reach to twice tau at most
    for b in range(guards.basis):
        if tau > 0.0 and guards.power[b] > 2:
            reach = min(H, max(2.0 * tau, H / 64.0))
    for b in range(guards.basis):
        lam, p = guards.exponent[b], guards.power[b]
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
        g, a = gamma[b, 0], size[b, 0]
        first_value += g.real * vr - g.imag * vi
        first_slope += g.real * sr - g.imag * si
        first_bound += a * bound
        first_noise += a * noise
        for j in range(1, count):
            g, a = gamma[b, j], size[b, j]
            values[j] += g.real * vr - g.imag * vi
            slopes[j] += g.real * sr - g.imag * si
            bounds[j] += a * bound
            noises[j] += a * noise
    values[0], slopes[0], bounds[0], noises[0] = first_value, first_slope, first_bound, first_noise
    return reach


@kernel
def _safe_step(g, slope, bound):
    """Longest step over which ``g + slope h - bound h^2 / 2`` stays positive.

    Parameters
    ----------
    g, slope : value, positive, and slope here.
    bound : on the size of the curvature from here on.

    Returns
    -------
    float
        s, infinite where it stays positive.
    """
    if bound <= 0.0:
        return np.inf if slope >= 0.0 else -g / slope
    root = math.sqrt(slope * slope + 2.0 * bound * g)
    if slope < 0.0:
        return 2.0 * g / (root - slope)
    if root == 0.0:  # underflow: the motion has decayed
        return math.sqrt(2.0 * g / bound)
    return (slope + root) / bound


@kernel
def _next_step(guards, out, floors, tau, reach, try_taylor_bound):
    """(step, hit): a step over which no guard can reach zero; the guard at zero already (`NO_EVENT`: none).

    Twice its tolerance is added to every guard: a contact that stays at zero to round-off is ignored, and steps have a
    smallest length. If an event has put several guards below zero, the lowest comes first; joining contacts precede all
    others. With ``try_taylor_bound`` the bound uses higher derivatives of the guards whose curvature limits the step.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at tau, as `_evaluate` fills it.
    floors : (g,) floors.
    tau, reach : s, where the step begins, and as far as the bounds hold.
    try_taylor_bound : whether to look for a longer step.

    Returns
    -------
    step : s.
    hit : the guard, or `NO_EVENT`.
    """
    step, hit, put_below = reach - tau, NO_EVENT, False
    for j in range(guards.count):
        if j == guards.joining_count and put_below:
            break
        tolerance = max(_noise(guards, out, j), floors[j])
        lifted = out[0, j] + 2.0 * tolerance
        if lifted < tolerance:
            low = lifted < -BELOW * tolerance
            if hit < 0 or (low and out[0, j] < out[0, hit]):
                hit, put_below = j, low
        elif hit < 0:
            h = _safe_step(lifted, out[1, j], out[2, j])
            if try_taylor_bound and h < step:
                h = max(h, _taylor_step(guards, j, tau, reach, lifted))
            step = min(step, h)
    return step, hit


@kernel
def _fill_floors(guards, out, H, start_guard, floors):
    """Floors of the guards that are below zero at the start of a segment, after an event or at the beginning.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at the start, as `_evaluate` fills it.
    H : s, length of the segment.
    start_guard : the guard whose event is there, or `BEGINNING` of the motion.
    floors : (g,) in units of the guards; written.
    """
    for j in range(guards.count):
        if out[0, j] >= 0.0:
            continue
        if start_guard >= 0:
            scale = 0.0
            for b in range(guards.basis):
                scale += guards.size[b, j] * H ** guards.power[b]
            floors[j] = min(-2.0 * out[0, j], max(AT_EVENT * scale, AT_ONCE * H * out[1, j]))
        elif out[1, j] > 0.0:
            floors[j] = min(-2.0 * out[0, j], AT_START * _noise(guards, out, j))


@kernel
def _follow_zeros(guards, out, tau, slopes, floors):
    """Update slopes and floors: the floor of a guard is removed once the guard is positive.

    While a guard that starts at zero rises, only half of the first step is taken, so that it is evaluated above zero
    before it can return.

    Parameters
    ----------
    guards : Guards.
    out : (4, g) at tau, as `_evaluate` fills it.
    tau : s.
    slopes, floors : (g,) of `SearchWork`; written.

    Returns
    -------
    share : of a step that is to be taken.
    """
    share = 1.0
    for j in range(guards.count):
        if out[0, j] > _noise(guards, out, j):
            slopes[j] = -np.inf
            floors[j] = 0.0
        elif tau == 0.0:
            slopes[j] = out[1, j]
            if out[1, j] > 0.0:
                share = 0.5
    return share


@kernel
def _crossing(out, guard, tau):
    """Time of the zero next to tau, by one Newton step where the curvature allows it.

    Parameters
    ----------
    out : (4, g) at tau, as `_evaluate` fills it.
    guard : the guard.
    tau : s.

    Returns
    -------
    tau : s, of the zero.
    """
    g, slope, bound = out[0, guard], out[1, guard], out[2, guard]
    if slope < 0.0 and -g * bound <= 0.1 * slope * slope:
        return max(0.0, tau - g / slope)
    return tau


@kernel
def _taylor_step(guards, j, tau, reach, value):
    """Step from value > 0 over which guard j stays positive.

    Where terms cancel, a guard and its first derivatives are small; the bound on its curvature is not. So the
    derivatives up to the seventh are evaluated, with their round-off, and the eighth is bounded.

    Parameters
    ----------
    guards : Guards.
    j : the guard.
    tau, reach : s, where the step begins, and as far as it may go.
    value : of the guard at tau, lifted.

    Returns
    -------
    step : s.
    """
    derivative, noise = np.empty(TAYLOR), np.empty(TAYLOR)
    for k in range(TAYLOR):
        derivative[k], noise[k] = 0.0, 0.0
    bound = 0.0
    for b in range(guards.basis):
        a = guards.size[b, j]
        if a == 0.0:
            continue
        lam, p = guards.exponent[b], guards.power[b]
        r = abs(lam)
        g = guards.coefficient[b, j] * _exp(lam.real, lam.imag, tau)
        level = a * math.exp(lam.real * tau)
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
            level = a * math.exp(lam.real * reach)
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


DONE, NEED_STATE, BUDGET, FULL, STUCK = 0, 1, 2, 3, 4


class Position(NamedTuple):
    """Position of a motion: its time, contact state and the event there."""

    time: Any  # s
    piece: Any  # of the sources
    state: Any  # contact state
    guard: Any  # whose event is here, or ONWARDS, or BEGINNING of the motion
    awaits_state: Any  # whether the state after that event was not built


@kernel
def _fill_guards(tables, s, zeta, H, guards):
    """The guards of state s on a segment of length H, from the amplitudes of its sources.

    Parameters
    ----------
    tables : Tables.
    s : number of the contact state.
    zeta : (F + Z,) amplitudes at the start of the segment.
    H : s.
    guards : Guards, whose coefficients are written.
    """
    coefficient, noise_floor = guards.coefficient, guards.noise_floor
    for j in range(guards.count):
        noise_floor[j] = 0.0
        for b in range(guards.basis):
            coefficient[b, j] = 0.0
    for q in range(tables.n_terms[s]):
        b, z = tables.term_basis[s, q], zeta[tables.term_source[s, q]]
        a = 4.0 * EPS * abs(z) * H ** tables.power[s, b]  # a power of time counts with what it reaches on this segment
        for j in range(guards.count):
            coefficient[b, j] += tables.event_function[s, q, j] * z
            noise_floor[j] += a * tables.roundoff_scale[s, q, j]
    for b in range(guards.basis):
        for j in range(guards.count):
            guards.size[b, j] = abs(coefficient[b, j])


@kernel
def _piece_at(inputs, piece, t, end):
    """The piece of the inputs at a time, and when it ends.

    Parameters
    ----------
    inputs : Inputs.
    piece : one that has begun by then.
    t, end : s; the end is that of the motion.

    Returns
    -------
    piece, stop : its number, and its end, s, or that of the motion.
    """
    last = inputs.start.size - 1
    while piece < last and inputs.start[piece + 1] <= t:
        piece += 1
    return piece, min(end, inputs.start[piece + 1]) if piece < last else end


@kernel
def _log_segment(log, number, t, state, piece, y):
    """Write the start of a segment into the log.

    Parameters
    ----------
    log : as for `march`.
    number : of the segment in it.
    t, state, piece : time, s, contact state, and piece of the inputs.
    y : (N,) state.
    """
    log.time[number], log.state[number], log.piece[number] = t, state, piece
    for k in range(y.size):
        log.y[number, k] = y[k]


@kernel
def _log_event(tables, log, number, t, state, guard):
    """Write an event into the log.

    Parameters
    ----------
    tables, log : as for `march`.
    number : of the event in the log.
    t : s.
    state, guard : contact state before it, and the guard.
    """
    contact = tables.guard_contact[state, guard]
    log.event_time[number], log.event_contact[number] = t, contact
    log.event_before[number] = tables.phase[state, contact]
    log.event_phase[number] = tables.phase[tables.successor[state, guard], contact]


@kernel
def march(tables, inputs, position, end, y, log, max_evaluations):
    """Compute a motion from event to event until its end, or until the host has to act.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs.
    position : Position of the motion.
    end : s.
    y : (N,) state, updated in place.
    log : takes segments and events (see `beamsim.flow.transient.Log`).
    max_evaluations : of the guards.

    Returns
    -------
    status : DONE at the end; NEED_STATE when the state that follows the guard's event is not built (the event is not
        logged yet, the segment is); FULL when the log is full; BUDGET when ``max_evaluations`` were used: called again
        it goes on; STUCK when a step has no length. A segment that takes that many evaluations alone is split.
    time, piece, state, guard : where the motion is.
    segments, events, evaluations : how many.
    """
    t, piece, state, guard, waits = position
    B, most = tables.exponent.shape[1], tables.guard_contact.shape[1]
    # each is written before it is read; zeros would take longer to compile
    zeta = np.empty(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma, size, noise_floor = np.empty((B, most), dtype=np.complex128), np.empty((B, most)), np.empty(most)
    basis = np.empty(B, dtype=np.complex128)
    search = SearchWork(np.empty((4, most)), np.empty(most), np.empty(most))
    status, n_seg, n_ev, n_eval = DONE, 0, 0, 0
    while waits or t < end:
        if not waits:
            piece, stop = _piece_at(inputs, piece, t, end)
            if n_seg == log.time.size or n_ev == log.event_time.size:
                status = FULL
                break
            if n_eval > max_evaluations:
                status = BUDGET
                break
            H = min(stop - t, tables.horizon[state])
            whole = stop - t <= H
            _fill_sources(tables, state, inputs, piece, t, y, rest, zeta)
            _log_segment(log, n_seg, t, state, piece, y)
            nb, exponent, power = tables.n_basis[state], tables.exponent[state], tables.power[state]
            tau, hit = H, NO_EVENT
            if tables.n_guards[state] > 0:
                guards = Guards(
                    nb, tables.n_guards[state], tables.n_joining[state], exponent, power, gamma, size, noise_floor
                )
                _fill_guards(tables, state, zeta, H, guards)
                tau, hit, looks = _first_event(guards, search, H, guard, max_evaluations)
                n_eval += looks
                if hit == NO_STEP:
                    status = STUCK
                    break
            _fill_basis(exponent, power, nb, tau, basis)
            _state_at(tables, state, zeta, basis, y)
            log.length[n_seg] = tau
            n_seg += 1
            guard = hit
            if hit < 0:
                t = stop if whole and tau >= H else t + tau
                continue
            t += tau
            _reset(tables, state, hit, zeta, basis, y)
        following = tables.successor[state, guard]
        waits = following < 0
        if waits:
            status = NEED_STATE
            break
        _log_event(tables, log, n_ev, t, state, guard)
        n_ev += 1
        state = following
    return status, t, piece, state, guard, n_seg, n_ev, n_eval


@kernel
def _moments(x, highest, out):
    """``int_0^1 s^q e^{x s} ds`` for q = 0 ... top: upward while q is no larger than x, then downward from a series.

    Parameters
    ----------
    x : exponent, complex.
    highest : highest q.
    out : (top + 1,) complex; written.
    """
    size = math.sqrt(x.real * x.real + x.imag * x.imag)
    grown = math.exp(x.real)
    end = complex(grown * math.cos(x.imag), grown * math.sin(x.imag))
    known = -1
    if size >= LEAST:
        inverse = 1.0 / x
        out[0] = (end - 1.0) * inverse
        known = min(highest, int(size))
        for q in range(1, known + 1):
            out[q] = (end - q * out[q - 1]) * inverse
    if known == highest:
        return
    total = complex(1.0 / (highest + 1), 0.0)
    term, k = total, 0
    while abs(term.real) + abs(term.imag) > 2e-17 * (abs(total.real) + abs(total.imag)):
        k += 1
        term *= -x / (highest + 1 + k)
        total += term
    out[highest] = end * total
    for q in range(highest - 1, known, -1):
        out[q] = (end - x * out[q + 1]) / (q + 1)


@kernel
def fill_moments(x, out):
    """Moments (n, top + 1) of exponents (n,)."""
    for i in range(x.size):
        _moments(x[i], out.shape[1] - 1, out[i])


@summing
def spread_to_grid(position, value, polynomials, grid):
    """Spread values over the points of a periodic grid next to them.

    Parameters
    ----------
    position : (n,) in steps of the grid.
    value : (n, k).
    polynomials : (w, d) coefficients, the highest first, of the weights of w points around, by where the position is
        between two points: from -1 to 1.
    grid : (points, k) added to.
    """
    width, points = polynomials.shape[0], grid.shape[0]
    for i in range(position.size):
        first = math.ceil(position[i] - 0.5 * width)
        place = 2.0 * (first - position[i]) + width - 1.0
        point = first % points
        for j in range(width):
            weight = 0.0
            for d in range(polynomials.shape[1]):
                weight = weight * place + polynomials[j, d]
            for c in range(value.shape[1]):
                grid[point, c] += weight * value[i, c]
            point += 1
            if point == points:
                point = 0
