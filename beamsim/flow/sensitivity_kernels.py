"""The compiled pass along a motion that gives its derivatives; see :mod:`beamsim.flow.variational`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel, summing
from beamsim.flow.kernels import _exp, _fill_basis, _fill_sources, _moments, _shift, _state_at

AT_ZERO = 1e-9  # of the terms of a guard, that counts as zero at an event
ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none


class Factors(NamedTuple):
    """Factors of the state (N), the inputs (F) and their slopes (F), V in all, along a motion of G segments.

    The first of each array is that of the flow; the others are what each of P parameters changes.
    """

    rates: Any  # (1 + P, K, N, V) the state's time derivative in K contact states
    event_map: Any  # (1 + P, E, N + 1, V) state and guard of E sorts of events between segments; ends have no guard
    state: Any  # (G,) of the segments, among those of `rates`
    event: Any  # (G + 1,) between them, among those of `after`
    amplitude: Any  # (P, pieces, F) changes of the inputs' amplitudes about the starts of their pieces
    exponent: Any  # (P, F) changes of their exponents, 1/s
    begin: Any  # (P, pieces) changes of the starts, s
    order: Any  # (4, F) derivatives of inputs of unit amplitude where their power is that of no time


class Instant(NamedTuple):
    """State and inputs of a motion at one time, with their derivatives."""

    v: Any  # (V,) the state, the inputs and their slopes
    rate: Any  # (V,) their time derivatives
    second_rate: Any  # (V,) those of these
    input_change: Any  # (P, 2 F) changes of the inputs and of their slopes by the parameters


class Segment(NamedTuple):
    """A segment of the motion."""

    number: Any
    state: Any  # contact state
    piece: Any  # of the inputs
    time: Any  # s, when it begins
    length: Any  # s
    zeta: Any  # (F + Z,) amplitudes at its beginning
    basis: Any  # (B,) basis functions at its end


class StoredDerivatives(NamedTuple):
    """Derivatives stored along a motion."""

    dt: Any  # (G + 1, C) s, change of the time of each event
    guard_rate: Any  # (2, G + 1) rate of its guard before it, and the rate of that
    event: Any  # (M,) number of the event at each of some instants, in order
    after_event: Any  # (M,) 1 after it, 0 before it, in order
    instant: Any  # Instant of arrays with M rows, but for `turning`
    S: Any  # (M, N, C) change of the state at a fixed time


@kernel
def _fill_inputs(inputs, factors, piece, t, work, instant):
    """Fill the inputs, their slopes and their changes into an Instant.

    Parameters
    ----------
    inputs, factors : Inputs, Factors.
    piece : of the inputs.
    t : s.
    work : (2, F) room.
    instant : Instant, written but for the state.
    """
    F = inputs.exponent.size
    N = instant.v.size - 2 * F
    value, change = work
    _shift(inputs, inputs.amplitude, piece, t, value)
    for f in range(F):
        instant.v[N + f] = (value[f] * factors.order[0, f]).real
        instant.v[N + F + f] = instant.rate[N + f] = (value[f] * factors.order[1, f]).real
        instant.rate[N + F + f] = instant.second_rate[N + f] = (value[f] * factors.order[2, f]).real
        instant.second_rate[N + F + f] = (value[f] * factors.order[3, f]).real
    for p in range(factors.exponent.shape[0]):
        _shift(inputs, factors.amplitude[p], piece, t, change)
        for f in range(F):
            rising = value[f] * factors.exponent[p, f]
            steady = change[f] + rising * (t - inputs.start[piece])
            instant.input_change[p, f] = (steady * factors.order[0, f]).real
            instant.input_change[p, F + f] = (steady * factors.order[1, f]).real + (
                rising.real if inputs.power[f] == 0 else 0.0
            )


@summing
def _differentiate(event_map, m, instant, S, out):
    """Changes of outputs that are linear in the state and inputs of an Instant.

    Parameters
    ----------
    event_map : (1 + P, E, k, V) factors, and what the parameters change of them.
    m : number of the sort of event.
    instant : Instant.
    S : (N, C) change of the state, in the last P columns by the parameters.
    out : (k, C); written.
    """
    N, columns = S.shape
    first = columns - instant.input_change.shape[0]
    for i in range(out.shape[0]):
        for j in range(columns):
            out[i, j] = 0.0
        for k in range(N):
            factor = event_map[0, m, i, k]
            if factor != 0.0:
                for j in range(columns):
                    out[i, j] += factor * S[k, j]
        for p in range(columns - first):
            for k in range(instant.v.size):
                out[i, first + p] += event_map[1 + p, m, i, k] * instant.v[k]
            for k in range(instant.input_change.shape[1]):
                out[i, first + p] += event_map[0, m, i, N + k] * instant.input_change[p, k]


@kernel
def _transit(tables, segment, first, S):
    """Propagate the change of a state over a segment, in place.

    Parameters
    ----------
    tables, segment : Tables, Segment.
    first : number of the first free amplitude.
    S : (N, C).
    """
    s, N, Z = segment.state, S.shape[0], tables.n_free[segment.state]
    right = np.zeros((N, 2 * Z))  # of the real and the imaginary parts of the free amplitudes
    for q in range(tables.n_terms[s]):
        z = tables.term_source[s, q] - first
        if z >= 0:
            for k in range(N):
                value = tables.term_vector[s, q, k] * segment.basis[tables.term_basis[s, q]]
                right[k, z] += value.real
                right[k, Z + z] -= value.imag
    left = np.concatenate((tables.projector[s, :Z].real, tables.projector[s, :Z].imag))
    S[:] = np.dot(right, np.dot(left, S))


@kernel
def _fill_load(tables, inputs, factors, segment, p, steady, load):
    """The equivalent load on a segment of a parameter's change.

    Parameters
    ----------
    tables, inputs, factors, segment : Tables, Inputs, Factors, Segment.
    p : number of the parameter.
    steady : (F,) room for work.
    load : (B + 2 F, N) factors of the basis functions, of the sources, and of these times the time since the segment
        began; written.

    Returns
    -------
    bool
        Whether there is any.
    """
    s, zeta, F, N = segment.state, segment.zeta, inputs.exponent.size, load.shape[1]
    rates, own = factors.rates[0, factors.state[segment.number]], factors.rates[1 + p, factors.state[segment.number]]
    B, some = load.shape[0] - 2 * F, False
    load[:] = 0.0
    for i in range(N):
        acts = False
        for k in range(N):
            acts = acts or own[i, k] != 0.0
        if acts:
            some = True
            for q in range(tables.n_terms[s]):
                total = 0.0j
                for k in range(N):
                    total += own[i, k] * tables.term_vector[s, q, k]
                load[tables.term_basis[s, q], i] += total * zeta[tables.term_source[s, q]]
    _shift(inputs, factors.amplitude[p], segment.piece, segment.time, steady)
    for f in range(F):
        nu, power = inputs.exponent[f], inputs.power[f]
        rising = zeta[f] * factors.exponent[p, f]
        change = steady[f] + rising * (segment.time - inputs.start[segment.piece])
        for i in range(N):
            direct, slope = rates[i, N + f] + nu * rates[i, N + F + f], rates[i, N + F + f]
            load[B + f, i] += change * direct + (power + 1) * rising * slope
            load[B + f, i] += zeta[f] * (own[i, N + f] + nu * own[i, N + F + f])
            load[B + F + f, i] = rising * direct
            if power > 0:
                load[B + f - 1, i] += power * (change * slope + zeta[f] * own[i, N + F + f])
            some = some or load[B + f, i] != 0.0 or load[B + F + f, i] != 0.0
    return some


@kernel
def _convolution(a, q, b, p, tau, moments):
    r"""The integral :math:`\int_0^\tau (\tau - s)^q e^{a (\tau - s)} s^p e^{b s} ds`.

    With x = (b - a) tau it is :math:`\tau^{p + q + 1} e^{a \tau} \int_0^1 (1 - s)^q s^p e^{x s} ds`; where
    Re x > 0 the two factors are exchanged.

    Parameters
    ----------
    a, q : exponent, 1/s, and power.
    b, p : the same of the other factor.
    tau : s.
    moments : room for p + q + 1.

    Returns
    -------
    complex
    """
    if b.real > a.real:
        a, b, q, p = b, a, p, q
    _moments((b - a) * tau, p + q, moments)
    total, factor = 0.0j, 1.0
    for k in range(q + 1):
        total += factor * moments[p + k]
        factor *= (k - q) / (k + 1.0)
    return total * tau ** (p + q + 1) * _exp(a.real, a.imag, tau)


@kernel
def _respond(tables, inputs, segment, load, moments, S):
    """Add the responses at the end of a segment to loads.

    Parameters
    ----------
    tables, inputs, segment : Tables, Inputs, Segment.
    load : (P, B + 2 F, N) see `_fill_load`.
    moments : room for work.
    S : (N, P) written to.
    """
    s, tau, F, (P, rows, N) = segment.state, segment.length, inputs.exponent.size, load.shape
    B = rows - 2 * F
    for c in range(rows):
        acts = False
        for p in range(P):
            for k in range(N):
                acts = acts or load[p, c, k] != 0.0
        if not acts:
            continue
        b = tables.exponent[s, c] if c < B else inputs.exponent[(c - B) % F]
        power = tables.power[s, c] if c < B else inputs.power[(c - B) % F] + (c - B) // F
        for q in range(tables.n_terms[s]):
            z, of = tables.term_source[s, q] - F, tables.term_basis[s, q]
            if z < 0:
                continue
            a, own = tables.exponent[s, of], tables.power[s, of]
            pushed = 0.5 * _convolution(a, own, b, power, tau, moments)
            pulled = 0.5 * _convolution(a, own, b.conjugate(), power, tau, moments)
            for p in range(P):
                push, pull = 0.0j, 0.0j
                for k in range(N):
                    push += tables.projector[s, z, k] * load[p, c, k]
                    pull += tables.projector[s, z, k] * load[p, c, k].conjugate()
                total = push * pushed + pull * pulled
                for k in range(N):
                    S[k, p] += (total * tables.term_vector[s, q, k]).real


@kernel
def _fill_jump(factors, m, before, after, out):
    """Jump of the state's rate at an event: derivative of the state after it by the event's time, less the rate after
    it.

    Parameters
    ----------
    factors, before : Factors, and the Instant before the event.
    m : number of the segment that begins with it.
    after : Instant after it.
    out : (N,) written.
    """
    N, reset, rates_before, rates = (
        out.size,
        factors.event_map[0, factors.event[m]],
        factors.rates[0, factors.state[m - 1]],
        factors.rates[0, factors.state[m]],
    )
    for i in range(N):
        change, size = 0.0, 0.0
        for k in range(before.v.size):
            change += reset[i, k] * before.rate[k] - rates[i, k] * after.v[k]
        for k in range(N):
            size += abs(rates[i, k] * after.v[k])
            if reset[i, k] != 0.0:
                for j in range(N):
                    size += abs(reset[i, k] * rates_before[k, j] * before.v[j])
        out[i] = change if abs(change) > ROUND_OFF * size else 0.0


@kernel
def _keep(stored, row, m, after_event, instant, S):
    """Store an Instant and the changes of the state then, if requested.

    Parameters
    ----------
    stored : StoredDerivatives.
    row : first that is not written yet.
    m, after_event : number of the event, and whether it is after it.
    instant : the Instant.
    S : (N, C).

    Returns
    -------
    int
        The next row.
    """
    while row < stored.event.size and stored.event[row] == m and stored.after_event[row] == after_event:
        stored.instant.v[row] = instant.v
        stored.instant.rate[row] = instant.rate
        stored.instant.input_change[row] = instant.input_change
        stored.S[row] = S
        row += 1
    return row


@kernel
def _make_instant(V, P, F):
    """Room for an Instant."""
    return Instant(np.empty(V), np.empty(V), np.empty(V), np.empty((P, 2 * F)))


@kernel
def _cross(factors, log, m, before, after, work, S, stored):
    """Propagate the changes of a state over the event between two segments, or over the start of a piece of the inputs.

    Parameters
    ----------
    factors, log : Factors, and the motion's G segments.
    m : number of the event, from 0 at the beginning to G at the end.
    before, after : Instant before it, and after it.
    work : (N + 1, C) and (N,) room.
    S : (N, C) changes at a fixed time; written.
    stored : Kept, written.
    """
    (N, columns), G, (change, jump), event, pace = (
        S.shape,
        log.time.size,
        work,
        factors.event[m],
        stored.guard_rate[:, m],
    )
    _differentiate(factors.event_map, event, before, S, change)
    pace[:], guard, size, first = 0.0, 0.0, 0.0, columns - factors.exponent.shape[0]
    for k in range(before.v.size):
        factor = factors.event_map[0, event, N, k]
        guard += factor * before.v[k]
        size += abs(factor * before.v[k])
        pace[0] += factor * before.rate[k]
        pace[1] += factor * before.second_rate[k]
    # an event after a zero-length phase has the same time derivative as the event before;
    # if another guard crosses zero at that time, it has its own
    alone = m < 2 or m == G or log.length[m - 1] > 0.0 or (pace[0] < 0.0 and abs(guard) <= AT_ZERO * size)
    begins, dt, moves = 0 < m < G and log.piece[m] != log.piece[m - 1] and pace[0] == 0.0, stored.dt[m], False
    for j in range(columns):
        dt[j] = stored.dt[max(m - 1, 0), j]
        if alone:
            dt[j] = -change[N, j] / pace[0] if pace[0] != 0.0 else 0.0  # zero of a contact that begins at rest
        if begins and j >= first:
            dt[j] = factors.begin[j - first, log.piece[m]]
        moves = moves or dt[j] != 0.0
    if moves:
        _fill_jump(factors, m, before, after, jump)
    for i in range(N):
        for j in range(columns):
            S[i, j] = change[i, j] + jump[i] * dt[j] if moves else change[i, j]


@kernel
def differentiate(tables, inputs, log, factors, S, end, stored):
    """The derivatives along a motion.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs.
    log : the motion's G segments (see `beamsim.flow.transient.Log`).
    factors : Factors.
    S : (N, C) changes of its start; the last P of them those by the parameters. Written: those of its end.
    end : (2, N) the last state and its time derivative; written.
    stored : Kept; written.
    """
    (N, columns), F, G, B = S.shape, inputs.exponent.size, log.time.size, tables.exponent.shape[1]
    P, V, Z = factors.exponent.shape[0], N + 2 * F, tables.projector.shape[1]
    # each is written before it is read; zeros would take longer to compile
    now, then = _make_instant(V, P, F), _make_instant(V, P, F)
    zeta, basis, rest = np.empty(F + Z, np.complex128), np.empty(B, np.complex128), np.empty(N)
    load, moments = np.empty((P, B + 2 * F, N), np.complex128), np.empty(2 * (B + F) + 2, np.complex128)
    inner, work = np.empty((2, F), np.complex128), (np.empty((N + 1, columns)), np.empty(N))
    t, row = log.time[0], 0
    now.v[:N] = log.y[0]
    for m in range(G + 1):
        before, after = max(m - 1, 0), min(m, G - 1)
        if m > 0:
            segment = Segment(
                m - 1, log.state[m - 1], log.piece[m - 1], log.time[m - 1], log.length[m - 1], zeta, basis
            )
            s = segment.state
            _fill_sources(tables, s, inputs, segment.piece, segment.time, log.y[m - 1], rest, zeta)
            _fill_basis(tables.exponent[s], tables.power[s], tables.n_basis[s], segment.length, basis)
            _state_at(tables, s, zeta, basis, now.v[:N])
            _transit(tables, segment, F, S)
            some = False
            for p in range(P):
                some = _fill_load(tables, inputs, factors, segment, p, inner[0], load[p]) or some
            if some:
                _respond(tables, inputs, segment, load, moments, S[:, columns - P :])
            t = segment.time + segment.length
        _fill_inputs(inputs, factors, log.piece[before], t, inner, now)
        now.rate[:N] = np.dot(factors.rates[0, factors.state[before]], now.v)
        now.second_rate[:N] = np.dot(factors.rates[0, factors.state[before]], now.rate)
        row = _keep(stored, row, m, 0, now, S)
        _fill_inputs(inputs, factors, log.piece[after], t, inner, then)
        then.v[:N] = np.dot(factors.event_map[0, factors.event[m]], now.v)[:N]
        then.rate[:N] = np.dot(factors.rates[0, factors.state[after]], then.v)
        _cross(factors, log, m, now, then, work, S, stored)
        row = _keep(stored, row, m, 1, then, S)
    end[0] = then.v[:N]
    end[1] = np.dot(factors.event_map[0, factors.event[G]], now.rate)[:N]
