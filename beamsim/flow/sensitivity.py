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
from typing import NamedTuple

import numpy as np
from scipy.special import binom

from beamsim.flow.contact_state import GROWTH, ContactState, LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.held import held_contacts
from beamsim.flow.march import Log
from beamsim.flow.moments import exponential_moments
from beamsim.flow.passage import ContactDirection, StructureDirection, moved_system
from beamsim.typing import Complexes, Floats, Ints

DIFFERENCE = 1e-5  # relative step of the differences
ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none
EventKey = tuple[Ints, int, int]  # (m,) phases of the contacts before it, the contact, and its new phase


class Event(NamedTuple):
    """What happens where a contact changes its phase, as factors of the state, the inputs and their slopes."""

    guard: Floats  # (V,)
    reset: Floats  # (N, V) the state after the event


class FlowOutputs:
    """Factors (k, V) of the state (N), the inputs (F) and their slopes (F) in a flow's linear outputs, each made once.

    They are the same under all loads that differ in their signals alone.
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

    def inputs(self, t: float) -> Floats:
        """(2 F,) change of the inputs and of their slopes at a time."""
        sources = self.flow.sources
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
            FlowOutputs(flow.with_system(moved_system(flow.system, direction, amount)))
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
    """
    N, contacts = flow.size, flow.system.contacts
    times = np.append(log.time, log.time[-1] + log.length[-1])
    inputs = flow.inputs_at(times, 2)  # and their time derivatives
    given = flow.sources.amplitudes_at(log.time, log.piece)
    phases = [flow.states[number].phases for number in log.state]
    S, event = np.eye(N, N + len(changes)), 0
    dt = np.zeros(S.shape[1])
    if contacts.jointly_acting:
        v, whole = np.append(log.y[0], inputs[0, 0]), _with_inputs(S, changes, times[0])
        S = _factors_derivative(outputs.begun(phases[0]), [each.begun(phases[0]) for each in changes], v, whole)
    for g, number in enumerate(log.state):
        state, tau = flow.states[number], float(log.length[g])
        known = np.vstack([given[g], np.zeros((S.shape[1], given.shape[1]))])
        zeta = state.amplitudes(known, np.vstack([log.y[g], S.T]))
        both = (state.terms_after(zeta, np.array([tau])) @ state.term_vector).real
        y, S = both[0], both[1:].T
        if changes:
            load = [_load(state, outputs.rates(phases[g]), each, zeta[0], times[g]) for each in changes]
            S[:, N:] += _response(state, flow.sources.exponent, np.array(load), tau).T
        if g + 1 == log.time.size or log.state[g + 1] == number:
            continue
        key = phases[g], int(log.event_contact[event]), int(log.event_phase[event])
        event += 1
        of, by = outputs.event(key), [each.event(key) for each in changes]
        v, whole = np.append(y, inputs[g + 1, 0]), _with_inputs(S, changes, times[g + 1])
        rates = outputs.rates(phases[g]), outputs.rates(phases[g + 1])
        moving = np.append(rates[0] @ v, inputs[g + 1, 1])
        # what follows at the same instant, since a phase does not last, moves with the event before
        if g == 0 or tau > 0.0:
            pace = float(of.guard @ moving)  # zero of a contact that begins at rest
            change = _factors_derivative(of.guard, [each.guard for each in by], v, whole)
            dt = -change / pace if pace else np.zeros_like(change)
        S = _factors_derivative(of.reset, [each.reset for each in by], v, whole)
        S += np.multiply.outer(_jump(of.reset, rates, v, moving), dt)
    last, v = phases[-1], np.append(end, inputs[-1, 0])
    slope = outputs.rates(last) @ v
    if not contacts.kept(last)[0].size:
        return MotionDerivative(end, slope, S)
    kept, moving = outputs.kept(last), np.append(slope, inputs[-1, 1])
    S = _factors_derivative(kept, [each.kept(last) for each in changes], v, _with_inputs(S, changes, times[-1]))
    return MotionDerivative(kept @ v, kept @ moving, S)


def _with_inputs(S: Floats, changes: Sequence[Change], t: float) -> Floats:
    """(V, N + P) change of the state, where it has S (N, N + P), and of the inputs and their slopes at a time."""
    N = S.shape[0]
    moved = [change.inputs(t) for change in changes]
    if not moved:
        return S
    return np.vstack([S, np.hstack([np.zeros((moved[0].size, N)), np.transpose(moved)])])


def _factors_derivative(of: Floats, by: Sequence[Floats], v: Floats, whole: Floats) -> Floats:
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


def _load(state: ContactState, rates: Floats, change: Change, zeta: Complexes, t: float) -> Complexes:
    """(B + 2 F, N) the load that a change is over a segment.

    Parameters
    ----------
    state : the contact state, of B basis functions.
    rates : (N, V) of the state in it.
    change : of a parameter.
    zeta : (F + Z,) amplitudes where the segment begins.
    t : s, when it begins.

    Returns
    -------
    Factors of the state's basis functions, of the sources, and of these times the time since the segment began.
    """
    (N, V), B = rates.shape, state.exponent.size
    F = (V - N) // 2
    own, sources = change.rates(state.phases), change.flow.sources
    load = np.zeros((B + 2 * F, N), dtype=complex)
    if own.any():
        np.add.at(load, state.term_basis, (zeta[state.term_source, None] * state.term_vector) @ own[:, :N].T)
        load[B : B + F] = (zeta[:F] * (own[:, N : N + F] + sources.exponent * own[:, N + F :])).T
    turned = np.exp(t * sources.exponent)
    rising = turned * sources.amplitude[0] * change.exponent
    steady = turned * change.amplitude + rising * t
    direct, slope = rates[:, N : N + F] + sources.exponent * rates[:, N + F :], rates[:, N + F :]
    load[B : B + F] += (steady * direct + rising * slope).T
    load[B + F :] = (rising * direct).T
    return load


def _response(state: ContactState, nu: Complexes, load: Complexes, tau: float) -> Floats:
    """(P, N) the responses at the end of a segment to loads.

    Parameters
    ----------
    state : the contact state.
    nu : (F,) exponents of the sources, 1/s.
    load : (P, B + 2 F, N) see `_load`.
    tau : s, length of the segment.
    """
    F, free = nu.size, state.term_source >= nu.size
    acts = load.any(axis=(0, 2))
    mu = np.concatenate([state.exponent, nu, nu])[acts]
    power = np.concatenate([state.power, np.zeros(F, dtype=np.int64), np.ones(F, dtype=np.int64)])[acts]
    load, basis = 0.5 * load[:, acts], state.term_basis[free]
    pushes = np.concatenate([load, load.conj()], axis=1) @ state.projector.T  # real loads
    integral = convolutions(state.exponent, state.power, np.append(mu, mu.conj()), np.tile(power, 2), tau)
    grown = np.einsum("pcq,qc->pq", pushes[:, :, state.term_source[free] - F], integral[basis])
    return np.asarray((grown @ state.term_vector[free]).real)


def convolutions(a: Complexes, q: Ints, b: Complexes, p: Ints, tau: float) -> Complexes:
    r"""Integrals :math:`\int_0^\tau (\tau - s)^q e^{a (\tau - s)} s^p e^{b s} ds` for all pairs.

    With x = (b - a) tau they are :math:`\tau^{p + q + 1} e^{a \tau} \int_0^1 (1 - s)^q s^p e^{x s} ds`; where
    Re x > 0 the two factors are exchanged.

    Parameters
    ----------
    a, q : (A,) exponents, 1/s, and powers.
    b, p : (B,) the same of the other factors.
    tau : s.

    Returns
    -------
    (A, B).
    """
    x = tau * (b - a[:, None])
    swapped = x.real > 0.0
    moments = exponential_moments(np.where(swapped, -x, x), int(q.max(initial=0) + p.max(initial=0)))
    q, p = np.broadcast_arrays(q[:, None], p)
    falling, rising = np.where(swapped, p, q), np.where(swapped, q, p)
    total = np.zeros_like(x)
    for k in range(int(falling.max(initial=0)) + 1):  # of the powers of 1 - s
        moment = np.take_along_axis(moments, np.where(k <= falling, rising + k, 0)[:, :, None], axis=2)[:, :, 0]
        total += (-1.0) ** k * binom(falling, k) * moment
    turned = tau * np.where(swapped, b, a[:, None])
    return np.asarray(tau ** (p + q + 1) * np.exp(np.where(turned.real < GROWTH, turned, 0.0)) * total)
