"""The derivatives of a motion by its start and by parameters: state transition and saltation matrices.

Along a motion :math:`y' = A y + B u` with the events :math:`g(y, u) = 0`, after which :math:`y^+ = R(y, u)`, the
sensitivity :math:`S = \\partial y/\\partial(y_0, p)` follows

.. math:: S' = A S + \\partial_p A\\, y + \\partial_p B\\, u + B\\, \\partial_p u, \\qquad
          S^+ = R' (S^- + f^-\\, \\partial t_e) + \\partial_p R - f^+\\, \\partial t_e, \\qquad
          \\partial t_e = -(\\nabla g\\, S^- + \\partial_p g) / \\dot g^-

(R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7). A parameter
enters as a load: a sum of polynomials times exponentials, as the motion is one, whose response over a segment is an
integral in closed form, the convolution of both. A, B, g and R are the flow's own linear outputs; their derivatives by
the contacts' numbers are central differences of them, in which these are linear or quadratic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import binom

from beamsim.flow.contact_state import GROWTH, ContactState, LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.held import held_contacts
from beamsim.flow.march import Log
from beamsim.flow.moments import blocks, exponential_moments
from beamsim.flow.passage import ContactDirection, StructureDirection, moved_system
from beamsim.flow.state_tables import visited_states
from beamsim.typing import Complexes, Floats, Ints

DIFFERENCE = 1e-5  # relative step of the differences
ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none
EventKey = tuple[Ints, int, int]  # (m,) phases of the contacts before it, the contact, and its new phase


class Event(NamedTuple):
    """What happens where a contact changes its phase, as factors of the state, the inputs and their slopes."""

    guard: Floats  # (V,)
    reset: Floats  # (N, V) the state after the event


class FlowOutputs:
    """Factors (k, V) of the state (N), the inputs (F) and their slopes (F) in a flow's linear outputs.

    They are the same under all loads that differ in their signals alone. Rates and events are made once.
    """

    def __init__(self, flow: ExactFlow) -> None:
        self.flow = flow
        self._rates: dict[bytes, Floats] = {}
        self._events: dict[tuple[bytes, int, int], Event] = {}

    def rates(self, phases: Ints) -> Floats:
        """(N, V) the time derivative of the state."""
        key = phases.tobytes()
        if key not in self._rates:
            self._rates[key] = _factors(self.flow.rates(phases))
        return self._rates[key]

    def event(self, key: EventKey) -> Event:
        """What happens at an event."""
        before, contact, after = key
        known = before.tobytes(), contact, after
        if known not in self._events:
            self._events[known] = self._event(before, contact, after)
        return self._events[known]

    def _event(self, before: Ints, contact: int, after: int) -> Event:
        flow, contacts = self.flow, self.flow.system.contacts
        watched = contacts.watched(before)
        guard = watched.guard_of(contact, after)
        functions, state = flow.watched(watched, before), _state(flow)
        if watched.reset[guard] >= 0:
            count = int(contacts.states[contact])
            fresh = functions.some(int(watched.reset[guard]) + np.arange(count))
            _write(flow, state, int(contacts.first[contact]) + np.arange(count), fresh)
        return Event(_factors(functions)[guard], _factors(state))

    def begun(self, phases: Ints) -> Floats:
        """(N, V) the state with which a motion in given phases starts, from one near it.

        What is held rests, and internal states that are penetrations are these.
        """
        flow, held, begun = self.flow, held_contacts(self.flow.system, phases), _state(self.flow)
        if held is not None:
            n = flow.system.size
            begun.row[n : 2 * n, n : 2 * n] -= held.across @ held.across.T
        contact, _ = flow.system.contacts.kept(phases)
        _write(flow, begun, flow.system.contacts.first[contact], flow.penetrations[0].some(contact))
        return _factors(begun)

    def kept(self, phases: Ints) -> Floats:
        """(N, V) the state from which `ExactFlow.begin` finds the phases again in which a motion ends."""
        flow, contacts = self.flow, self.flow.system.contacts
        contact, kept = contacts.kept(phases)
        end = _state(flow)
        if contact.size:
            written = flow.penetrations[0].some(contact)
            written.direct[:, 0] -= kept[:, 0]
            if kept[:, 1].any():
                share = kept[:, 1:] * (contact[:, None] == contacts.pressed)
                written += flow.pressing_forces(phases).combined(-share)
            _write(flow, end, contacts.first[contact], written)
        return _factors(end)


def _factors(output: LinearOutput) -> Floats:
    return np.hstack([output.row, output.direct, output.direct_slope])


def _state(flow: ExactFlow) -> LinearOutput:
    output = flow.empty_output(flow.size)
    output.row[:] = np.eye(flow.size)
    return output


def _write(flow: ExactFlow, state: LinearOutput, internal: Ints, written: LinearOutput) -> None:
    """Replace internal states by outputs."""
    place = 2 * flow.system.size + internal
    state.row[place], state.direct[place], state.direct_slope[place] = written.row, written.direct, written.direct_slope


class Change:
    """What a parameter changes: by default nothing."""

    def __init__(self, flow: ExactFlow) -> None:
        self.flow = flow
        self.amplitude, self.exponent = np.zeros(
            (2, flow.sources.count), dtype=complex
        )  # (F,) of the inputs, from t = 0
        self._none = np.zeros((flow.size, flow.size + 2 * flow.sources.count))

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        return self._none

    def event(self, key: EventKey) -> Event:
        """Change of an event."""
        return Event(self._none[0], self._none)

    def begun(self, phases: Ints) -> Floats:
        """(N, V) change of `FlowOutputs.begun`."""
        return self._none

    def kept(self, phases: Ints) -> Floats:
        """(N, V) change of `FlowOutputs.kept`."""
        return self._none

    def inputs(self, times: Floats) -> Floats:
        """(nt, 2 F) change of the inputs and of their slopes."""
        sources, t = self.flow.sources, times[:, None]
        turned = np.exp(t * sources.exponent)
        rising = sources.amplitude[0] * self.exponent
        value = (self.amplitude + rising * t) * turned
        return np.hstack([value.real, (sources.exponent * value + rising * turned).real])


class SourceRates(Change):
    """The inputs change: derivatives of their amplitudes (F,) about t = 0, and of their exponents (F,)."""

    def __init__(self, flow: ExactFlow, amplitude: Complexes, exponent: Complexes) -> None:
        super().__init__(flow)
        self.amplitude[1:], self.exponent[1:] = amplitude, exponent


class OutputRates(Change):
    """The contacts' numbers change along a direction: central differences of the outputs of two flows."""

    def __init__(self, flow: ExactFlow, direction: ContactDirection) -> None:
        super().__init__(flow)
        contacts = flow.system.contacts
        pairs = (
            (direction.stiffness, contacts.arrays.force[:, :, 0]), (direction.dashpot, contacts.arrays.force[:, :, 1]),
            (direction.gap, contacts.gap), (direction.shape, contacts.shape),
            (np.array([direction.along is not None], dtype=float), np.ones(1)),
        )  # fmt: skip
        sizes = ((float(np.abs(rate).max(initial=0.0)), float(np.abs(value).max(initial=0.0))) for rate, value in pairs)
        relative = max((rate / value if value else 1.0 for rate, value in sizes if rate), default=1.0)
        self._step = DIFFERENCE / relative
        self._sides = [
            FlowOutputs(replace(flow, system=moved_system(flow.system, direction, amount)))
            for amount in (self._step, -self._step)
        ]  # fmt: skip

    def _difference(self, output: Callable[[FlowOutputs], Floats]) -> Floats:
        return (output(self._sides[0]) - output(self._sides[1])) / (2.0 * self._step)

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        return self._difference(lambda side: side.rates(phases))

    def event(self, key: EventKey) -> Event:
        """Change of an event."""
        return Event(*(self._difference(lambda side, k=k: side.event(key)[k]) for k in (0, 1)))  # type: ignore[misc]

    def begun(self, phases: Ints) -> Floats:
        """(N, V) change of `FlowOutputs.begun`."""
        return self._difference(lambda side: side.begun(phases))

    def kept(self, phases: Ints) -> Floats:
        """(N, V) change of `FlowOutputs.kept`."""
        return self._difference(lambda side: side.kept(phases))


class StructureRates(Change):
    """The structure's matrices and loads change: ``a' = f' - M' a`` for accelerations."""

    def __init__(self, flow: ExactFlow, direction: StructureDirection) -> None:
        super().__init__(flow)
        self._direction = direction

    def _forces(self, phases: Ints) -> Floats:
        """(n, V) change of the generalised forces less that of the inertia's."""
        n, d = self.flow.system.size, self._direction
        change = -d.mass @ _factors(self.flow.rates(phases))[n : 2 * n]
        change[:, :n] -= d.stiffness
        change[:, n : 2 * n] -= d.damping
        change[:, self.flow.size] += d.load
        return change

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        n, held, change = self.flow.system.size, held_contacts(self.flow.system, phases), self._forces(phases)
        out = self._none.copy()
        out[n : 2 * n] = change if held is None else held.free(change.T).T
        return out

    def event(self, key: EventKey) -> Event:
        """Change of an event: of the reactions in its guard."""
        (before, contact, after), system = key, self.flow.system
        held = held_contacts(system, before)
        if held is None or contact not in held.contact:
            return super().event(key)
        watched = system.contacts.watched(before)
        share = held.share[int(np.flatnonzero(held.contact == contact)[0])]
        guard = watched.joint[watched.guard_of(contact, after), 2] * (share @ self._forces(before))
        return Event(np.asarray(guard), self._none)


class MotionDerivative(NamedTuple):
    """The end of a motion with its derivatives."""

    end: Floats  # (N,)
    slope: Floats  # (N,) time derivative
    by: Floats  # (N, N + P) by the start, and by the parameters at fixed times


def sensitivity(
    flow: ExactFlow, outputs: FlowOutputs, log: Log, end: Floats, changes: Sequence[Change]
) -> MotionDerivative:
    """The derivatives of a motion's end by its start and by P parameters.

    Parameters
    ----------
    flow : under the loads of the motion, which are exponentials from t = 0 on, all its contact states kept.
    outputs : of this flow.
    log : the motion's segments and events.
    end : (N,) its last state.
    changes : (P,) what each parameter changes.

    Returns
    -------
    The end, its time derivative, and its derivatives.
    """
    N, passed = flow.size, _along(flow, outputs, log, changes)
    phases = [flow.states[number].phases for number in log.state]
    first, start = phases[0], log.time[:1]
    begun, v = [each.begun(first) for each in changes], np.append(log.y[0], flow.inputs_at(start)[0, 0])
    S = _above(np.eye(N, N + len(changes)), [each.inputs(start)[0] for each in changes])
    S = _derivative(outputs.begun(first), begun, v, S)
    dt, event = np.zeros(S.shape[1]), 0
    for g, number in enumerate(log.state):
        S = flow.states[number].transition(float(log.length[g])) @ S
        S[:, N:] += passed.response[g].T
        if g + 1 == log.time.size or log.state[g + 1] == number:
            continue
        key = phases[g], int(log.event_contact[event]), int(log.event_phase[event])
        event += 1
        of, by = outputs.event(key), [each.event(key) for each in changes]
        v, whole = passed.v[g], _above(S, passed.moved[:, g])
        rates = outputs.rates(phases[g]), outputs.rates(phases[g + 1])
        # what follows at the same instant, since a phase does not last, moves with the event before
        if g == 0 or log.length[g] > 0.0:
            pace = float(of.guard @ passed.moving[g])  # zero of a contact that begins at rest
            change = _derivative(of.guard, [each.guard for each in by], v, whole)
            dt = -change / pace if pace else np.zeros_like(change)
        S = _derivative(of.reset, [each.reset for each in by], v, whole)
        S += np.multiply.outer(_jump(of.reset, rates, v, passed.moving[g]), dt)
    last, v, moving = phases[-1], passed.v[-1].copy(), passed.moving[-1].copy()
    v[:N] = end
    moving[:N] = outputs.rates(last) @ v
    kept = outputs.kept(last)
    S = _derivative(kept, [each.kept(last) for each in changes], v, _above(S, passed.moved[:, -1]))
    return MotionDerivative(kept @ v, kept @ moving, S)


class _Along(NamedTuple):
    """What the G segments of a motion add to its derivatives, and where they end."""

    v: Floats  # (G, V) state, inputs and their slopes at the ends, before events
    moving: Floats  # (G, V) time derivatives
    moved: Floats  # (P, G, 2 F) change of the inputs and their slopes by the parameters
    response: Floats  # (G, P, N) of the state to what the parameters change along the segment


def _along(flow: ExactFlow, outputs: FlowOutputs, log: Log, changes: Sequence[Change]) -> _Along:
    N, ends, given = flow.size, log.time + log.length, flow.sources.amplitudes_at(log.time, log.piece)
    inputs = flow.inputs_at(ends, 2)
    v, moving = (np.hstack([np.empty((ends.size, N)), inputs[:, order]]) for order in (0, 1))
    moved = np.array([change.inputs(ends) for change in changes]).reshape(-1, *inputs[:, 0].shape)
    response = np.empty((ends.size, len(changes), N))
    for number in visited_states(log.state):
        state, some = flow.states[number], np.flatnonzero(log.state == number)
        rates, zeta = outputs.rates(state.phases), state.amplitudes(given[some], log.y[some])
        v[some, :N] = (state.terms_after(zeta, log.length[some]) @ state.term_vector).real
        moving[some, :N] = v[some] @ rates.T
        for p, change in enumerate(changes):
            for part in blocks(some.size, 4 * state.exponent.size * (state.exponent.size + flow.sources.count)):
                load = _load(state, rates, change, zeta[part], log.time[some[part]])
                response[some[part], p] = _response(state, flow.sources.exponent, load, log.length[some[part]])
    return _Along(v, moving, moved, response)


def _above(S: Floats, moved: Sequence[Floats] | Floats) -> Floats:
    """(V, N + P) change of the state, S (N, N + P), above that of the inputs and their slopes by P parameters."""
    N, P = S.shape[0], len(moved)
    if not P:
        return S
    out = np.zeros((N + moved[0].size, N + P))
    out[:N], out[N:, N:] = S, np.transpose(moved)
    return out


def _derivative(of: Floats, by: Sequence[Floats], v: Floats, whole: Floats) -> Floats:
    """Change of ``of @ v``.

    Parameters
    ----------
    of : (..., V) factors.
    by : (P,) what each parameter changes of them.
    v : (V,) the state, the inputs and their slopes.
    whole : (V, N + P) change of these by the start and by the parameters.

    Returns
    -------
    (..., N + P).
    """
    out = np.asarray(of[..., : whole.shape[0]] @ whole)
    for column, moved in enumerate(by, whole.shape[1] - len(by)):
        out[..., column] += moved @ v
    return out


def _jump(reset: Floats, rates: tuple[Floats, Floats], v: Floats, moving: Floats) -> Floats:
    """(N,) rate of the state after an event, if it came later, less that of the motion which goes on from it.

    Parameters
    ----------
    reset : (N, V) the state after the event.
    rates : (N, V) of the state, before and after it.
    v, moving : (V,) the state, the inputs and their slopes before it, and the time derivatives of these.
    """
    N = reset.shape[0]
    after = np.append(reset @ v, v[N:])
    change = reset @ moving - rates[1] @ after
    size = np.abs(rates[1][:, :N]) @ np.abs(after[:N])
    size += np.abs(reset[:, :N]) @ (np.abs(rates[0][:, :N]) @ np.abs(v[:N]))
    return np.where(np.abs(change) > ROUND_OFF * size, change, 0.0)


def _load(state: ContactState, rates: Floats, change: Change, zeta: Complexes, times: Floats) -> Complexes:
    """(G, B + 2 F, N) the loads that a change is over segments of one contact state.

    Parameters
    ----------
    state : of B basis functions.
    rates : (N, V) of the state.
    change : of a parameter.
    zeta : (G, F + Z) amplitudes where the segments begin.
    times : (G,) s, when they begin.

    Returns
    -------
    Factors of the basis functions, of the sources, and of these times the time since the segment began.
    """
    (N, V), B, sources, own = rates.shape, state.exponent.size, change.flow.sources, change.rates(state.phases)
    F, slope = (V - N) // 2, rates[:, (V + N) // 2 :]
    load = np.zeros((times.size, B + 2 * F, N), dtype=complex)
    if own.any():
        driven = np.zeros((state.amplitude_count, B, N), dtype=complex)
        np.add.at(driven, (state.term_source, state.term_basis), state.term_vector @ own[:, :N].T)
        load[:, :B] = np.tensordot(zeta, driven, 1)
        load[:, B : B + F] = zeta[:, :F, None] * (own[:, N : N + F] + sources.exponent * own[:, N + F :]).T
    turned = np.exp(np.multiply.outer(times, sources.exponent))
    rising = turned * sources.amplitude[0] * change.exponent
    steady = turned * change.amplitude + rising * times[:, None]
    direct = rates[:, N : N + F] + sources.exponent * slope
    load[:, B : B + F] += steady[:, :, None] * direct.T + rising[:, :, None] * slope.T
    load[:, B + F :] = rising[:, :, None] * direct.T
    return load


def _response(state: ContactState, nu: Complexes, load: Complexes, tau: Floats) -> Floats:
    """(G, N) the responses at the ends of segments to loads.

    Parameters
    ----------
    state : the contact state.
    nu : (F,) exponents of the sources, 1/s.
    load : (G, B + 2 F, N) see `_load`.
    tau : (G,) s, lengths of the segments.
    """
    F, free, acts = nu.size, state.term_source >= nu.size, load.any(axis=(0, 2))
    mu = np.concatenate([state.exponent, nu, nu])[acts]
    power = np.concatenate([state.power, np.zeros(F, dtype=np.int64), np.ones(F, dtype=np.int64)])[acts]
    real = np.concatenate([0.5 * load[:, acts], 0.5 * load[:, acts].conj()], axis=1)
    pushes = (real @ state.projector.T)[:, :, state.term_source[free] - F]
    integral = convolutions(state.exponent, state.power, np.append(mu, mu.conj()), np.tile(power, 2), tau)
    grown = np.einsum("gcq,gqc->gq", pushes, integral[:, state.term_basis[free]])
    return np.asarray((grown @ state.term_vector[free]).real)


def convolutions(a: Complexes, q: Ints, b: Complexes, p: Ints, tau: Floats) -> Complexes:
    r"""Integrals :math:`\int_0^\tau (\tau - s)^q e^{a (\tau - s)} s^p e^{b s} ds` for all pairs.

    With x = (b - a) tau they are :math:`\tau^{p + q + 1} e^{a \tau} \int_0^1 (1 - s)^q s^p e^{x s} ds`; where
    Re x > 0 the two factors are exchanged.

    Parameters
    ----------
    a, q : (A,) exponents, 1/s, and powers.
    b, p : (B,) the same of the other factors.
    tau : (G,) s.

    Returns
    -------
    (G, A, B).
    """
    swapped = (b - a[:, None]).real > 0.0
    x = np.multiply.outer(tau, np.where(swapped, a[:, None] - b, b - a[:, None]))
    falling, rising = np.where(swapped, p, q[:, None]), np.where(swapped, q[:, None], p)
    total, moments = np.zeros_like(x), exponential_moments(x, int(q.max(initial=0) + p.max(initial=0)))
    row, column = np.arange(a.size)[:, None], np.arange(b.size)
    for k in range(int(falling.max(initial=0)) + 1):  # of the powers of 1 - s
        chosen = np.where(k <= falling, rising + k, 0)
        total += (-1.0) ** k * binom(falling, k) * moments[:, row, column, chosen]
    turned = np.multiply.outer(tau, np.where(swapped, b, a[:, None]))
    total *= np.exp(np.where(turned.real < GROWTH, turned, 0.0))
    return np.asarray(total * tau[:, None, None] ** (q[:, None] + p + 1))
