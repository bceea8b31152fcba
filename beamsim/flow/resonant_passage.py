"""Passages of a forced motion at, or very near, the resonance of a mode that nothing damps.

The particular solution ``(i k w - lambda)^-1`` that :mod:`beamsim.flow.orbit_kernels` uses has no bound there, and
takes as many digits from the motion as the frequencies agree in. Here the motion comes from the transient flow, which
writes the response as a power series in time; the transition matrix, which knows nothing of the load, is the same
product as ever, and derivatives by parameters are central differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.contact_state import ContactState
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.variational import Parameter, Passage, VariationalFlow

NEAR = 1e-4  # |i k w - lambda| over w below which more than four digits would be lost
DIFFERENCE = 1e-6  # relative step of the differences
FIRST_LOG = 256


def is_resonant(states: Sequence[ContactState], multiple: Ints, omega: float) -> bool:
    """Whether a harmonic of the load is that close to an eigenvalue of one of the contact states."""
    target = 1j * multiple * omega
    return any(bool(np.any(np.abs(state.exponent[:, None] - target) < NEAR * np.abs(target))) for state in states)


def transition(state: ContactState, inputs: int, length: float) -> Floats:
    """(N, N) transition matrix of a contact state over a time, ``inputs`` being its sources that are no free ones."""
    free = np.flatnonzero(state.term_source >= inputs)
    basis = state.term_basis[free]
    factor = length ** state.power[basis] * np.exp(state.exponent[basis] * length)
    columns = state.term_vector[free].T * factor
    return np.asarray((columns @ state.projector[state.term_source[free] - inputs]).real)


def carry_by_series(
    flow: VariationalFlow, exact: ExactFlow, start: Floats, duration: float, parameters: Sequence[Parameter], t: float
) -> Passage:
    """As :meth:`beamsim.flow.variational.VariationalFlow.carry`, for the same loads in ``exact``."""
    passage = _motion(flow, exact, start, duration, t)
    matrix = _by_start(flow, exact, passage, t)
    columns = [_by_parameter(flow, p, start, duration, t) for p in parameters]
    by = np.array(columns).T if columns else np.zeros((start.size, 0))
    return replace(passage, transition=matrix, parameters=by)


def _motion(flow: VariationalFlow, exact: ExactFlow, start: Floats, duration: float, t: float) -> Passage:
    """The passage without its derivatives."""
    from beamsim.flow import kernels
    from beamsim.flow.variational import LARGEST_LOG, MOST_EVALUATIONS, Passage, WorkExceeded

    n, m = flow.system.size, flow.system.contacts.count
    N, room = 2 * n, FIRST_LOG
    first = flow.number_in(exact, flow.starting_state(start, t))
    while True:
        y, face = start[:N].copy(), start[N:].copy()
        seg = (
            np.empty(room), np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64), np.empty((room, N)),
            np.empty((room, m)),
        )  # fmt: skip
        ev = (np.empty(room + 1), np.empty(room + 1, np.int64), np.empty(room + 1, np.bool_))
        code, _, last, n_seg, n_ev, _, contact = kernels.advance(
            exact.tables(), exact.inputs(), t, t + duration, first, -1, y, face, *seg, *ev, MOST_EVALUATIONS
        )
        if code == kernels.DONE:
            break
        if code == kernels.NEED_STATE:
            following = exact.states[last].closed.copy()
            following[contact] = ~following[contact]
            flow.number_in(exact, following)
            exact.follow(last, contact)
        elif code == kernels.FULL and room < LARGEST_LOG:
            room *= 4
        else:
            raise WorkExceeded(f"no end after {n_ev} contact events in {duration:.6g} s")
    closed = exact.states[last].closed
    end = np.append(y, np.where(closed | ~exact.has_face, 0.0, face))
    slope = np.concatenate([y[n:], _acceleration(flow, y, closed, t + duration), -exact.inputs().face_rate * end[N:]])
    nothing = np.zeros((N + m, 0))
    return Passage(
        start, end, nothing, nothing, slope, duration, seg[0][:n_seg], seg[1][:n_seg], seg[2][:n_seg], seg[4][:n_seg],
        seg[5][:n_seg], ev[0][:n_ev], ev[1][:n_ev], ev[2][:n_ev], np.inf,
    )  # fmt: skip


def _acceleration(flow: VariationalFlow, y: Floats, closed: Bools, t: float) -> Floats:
    s, c, n = flow.system, flow.system.contacts, flow.system.size
    delta, rate = _penetration(flow, y, t)
    phase = np.exp(1j * flow.loads.multiple * flow.omega * t)
    load = s.constant_load + (flow.loads.at(flow.omega, flow.level)[0] * phase[:, None]).sum(axis=0).real
    push = (c.sign * closed * (c.stiffness * delta + c.dashpot * rate)) @ c.shape
    return np.asarray(load + push - s.stiffness * y[:n] - s.damping @ y[n:])


def _penetration(flow: VariationalFlow, y: Floats, t: float) -> tuple[Floats, Floats]:
    c, n = flow.system.contacts, flow.system.size
    d, v = flow.base_motion(t)
    delta = -c.gap - c.sign * (c.shape @ y[:n] + np.where(c.on_ground, d, 0.0))
    return delta, -c.sign * (c.shape @ y[n:] + np.where(c.on_ground, v, 0.0))


def _by_start(flow: VariationalFlow, exact: ExactFlow, passage: Passage, t: float) -> Floats:
    """The transition matrix: the product over segments and events, faces included."""
    c, n = flow.system.contacts, flow.system.size
    N, m, inputs = 2 * n, c.count, exact.sources.count + c.count
    S = np.diag(flow.free.astype(float))
    rows = np.hstack([-c.sign[:, None] * c.shape, np.zeros((m, n))])  # penetrations by the state
    decay = exact.inputs().face_rate
    event = 0
    for g, (begin, length, index) in enumerate(zip(passage.time, passage.length, passage.state, strict=True)):
        state = exact.states[index]
        S[:N] = transition(state, inputs, length) @ S[:N]
        S[N:] *= np.where(exact.has_face & ~state.closed, np.exp(-decay * length), 0.0)[:, None]
        if g + 1 == passage.time.size or passage.state[g + 1] == index:
            continue
        j, closing = passage.event_contact[event], passage.event_closing[event]
        event += 1
        if exact.has_face[j] and not closing:  # the face leaves with the penetration
            S[N + j] = rows[j] @ S[:N]
            continue
        face = passage.face[g, j] * np.exp(-decay[j] * length) if exact.has_face[j] else 0.0
        gdot = _penetration(flow, passage.y[g + 1], begin + length)[1][j] + decay[j] * face
        if c.dashpot[j] and gdot:
            # the jump of the force is c gdot: it cancels the rate in the saltation matrix
            change = rows[j] @ S[:N] - (S[N + j] if exact.has_face[j] else 0.0)
            S[n:N] += (1.0 if closing else -1.0) * c.dashpot[j] * c.sign[j] * np.outer(c.shape[j], change)
    return S


def _by_parameter(flow: VariationalFlow, p: Parameter, start: Floats, duration: float, t: float) -> Floats:
    """A central difference of two passages."""
    from beamsim.flow.variational import Frequency, Level, VariationalFlow

    if not isinstance(p, Frequency | Level):
        return flow.by_difference(start, duration, p, t)
    frequency = isinstance(p, Frequency)
    h = DIFFERENCE * (flow.omega if frequency else max(abs(flow.level), 1e-9))
    ends = []
    for step in (h, -h):
        omega, level = (flow.omega + step, flow.level) if frequency else (flow.omega, flow.level + step)
        other = VariationalFlow(flow.system, flow.forcing, omega, level)
        ends.append(_motion(other, other.by_series(), start, duration, t).end)
    return np.asarray((ends[0] - ends[1]) / (2 * h))
