"""The compiled march from event to event.

Positions are a time and a piece of the sources.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from beamsim.flow.compiled import kernel
from beamsim.flow.event_kernels import NO_STEP, Guards, first_event, make_search
from beamsim.flow.kernels import (
    EPS,
    _fill_basis,
    _fill_sources,
    _reset,
    _state_at,
)

DONE, NEED_STATE, BUDGET, FULL, STUCK = 0, 1, 2, 3, 4


class Position(NamedTuple):
    """Where a motion is."""

    time: Any  # s
    piece: Any  # of the sources
    state: Any  # contact state
    guard: Any  # whose event is here, or ONWARDS, or BEGINNING of the motion
    waits: Any  # whether the state after that event was not built


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
    coefficient, least = guards.coefficient, guards.least
    for j in range(guards.count):
        least[j] = 0.0
        for b in range(guards.basis):
            coefficient[b, j] = 0.0
    for q in range(tables.n_terms[s]):
        b, z = tables.term_basis[s, q], zeta[tables.term_source[s, q]]
        a = 4.0 * EPS * abs(z) * H ** tables.power[s, b]  # a power of time counts with what it reaches on this segment
        for j in range(guards.count):
            coefficient[b, j] += tables.watch[s, q, j] * z
            least[j] += a * tables.roughness[s, q, j]
    for b in range(guards.basis):
        for j in range(guards.count):
            guards.size[b, j] = abs(coefficient[b, j])


@kernel
def march(tables, inputs, position, end, y, log, most_evaluations):
    """Carry a motion on from event to event.

    Parameters
    ----------
    tables, inputs : Tables of the contact states, Inputs.
    position : Position of the motion.
    end : s.
    y : (N,) state, updated in place.
    log : takes segments and events (see `beamsim.flow.march.Log`), unless its size is zero.
    most_evaluations : of the guards.

    Returns
    -------
    status : DONE at the end; NEED_STATE when the state that follows the guard's event is not built (the event is not
        logged yet, the segment is); FULL when the log is full; BUDGET when ``most_evaluations`` were used: called again
        it goes on; STUCK when a step has no length. A segment that takes that many evaluations alone is split.
    time, piece, state, guard : where the motion is.
    segments, events, evaluations : how many.
    """
    t, piece, state, guard, waits = position
    B, most = tables.exponent.shape[1], tables.guard_contact.shape[1]
    # each is written before it is read; zeros would take longer to compile
    zeta = np.empty(inputs.exponent.size + tables.projector.shape[1], dtype=np.complex128)
    rest = np.empty(tables.projector.shape[2])
    gamma = np.empty((B, most), dtype=np.complex128)
    size = np.empty((B, most))
    least = np.empty(most)
    basis = np.empty(B, dtype=np.complex128)
    search = make_search(most)
    pieces = inputs.start.size
    logging = log.time.size > 0
    n_seg = 0
    n_ev = 0
    n_eval = 0
    while True:
        if not waits:
            if t >= end:
                break
            while piece + 1 < pieces and inputs.start[piece + 1] <= t:
                piece += 1
            stop = end
            if piece + 1 < pieces and inputs.start[piece + 1] < stop:
                stop = inputs.start[piece + 1]
            if logging and (n_seg == log.time.size or n_ev == log.event_time.size):
                return FULL, t, piece, state, guard, n_seg, n_ev, n_eval
            if n_eval > most_evaluations:
                return BUDGET, t, piece, state, guard, n_seg, n_ev, n_eval
            H = stop - t
            whole = tables.horizon[state] >= H
            if not whole:
                H = tables.horizon[state]
            _fill_sources(tables, state, inputs, piece, t, y, rest, zeta)
            nb = tables.n_basis[state]
            exponent = tables.exponent[state]
            power = tables.power[state]
            if logging:
                log.time[n_seg] = t
                log.state[n_seg] = state
                log.piece[n_seg] = piece
                for k in range(y.size):
                    log.y[n_seg, k] = y[k]

            tau, hit = H, -1
            if tables.n_guards[state] > 0:
                guards = Guards(nb, tables.n_guards[state], exponent, power, gamma, size, least)
                _fill_guards(tables, state, zeta, H, guards)
                tau, hit, looks = first_event(guards, search, H, guard, most_evaluations)
                n_eval += looks
                if hit == NO_STEP:
                    return STUCK, t, piece, state, guard, n_seg, n_ev, n_eval
                whole = whole and tau >= H
            _fill_basis(exponent, power, nb, tau, basis)
            _state_at(tables, state, zeta, basis, y)
            if logging:
                log.length[n_seg] = tau
            n_seg += 1
            guard = hit
            if hit < 0 and whole:
                t = stop
                continue
            t += tau
            if hit < 0:
                continue
            _reset(tables, state, hit, zeta, basis, y)
        following = tables.follower[state, guard]
        if following < 0:
            return NEED_STATE, t, piece, state, guard, n_seg, n_ev, n_eval
        waits = False
        contact = tables.guard_contact[state, guard]
        if logging:
            log.event_time[n_ev] = t
            log.event_contact[n_ev] = contact
            log.event_phase[n_ev] = tables.phase[following, contact]
        n_ev += 1
        state = following
    return DONE, t, piece, state, guard, n_seg, n_ev, n_eval
