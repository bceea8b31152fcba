"""The derivatives of a motion by its start and by parameters: state transition and saltation matrices.

Along a motion :math:`y' = A y + B u` with the events :math:`g(y, u) = 0`, after which :math:`y^+ = R(y, u)`, the
sensitivity :math:`S = \\partial y/\\partial(y_0, p)` follows

.. math:: S' = A S + \\partial_p A\\, y + \\partial_p B\\, u + B\\, \\partial_p u, \\qquad
          S^+ = R' (S^- + f^-\\, \\partial t_e) + \\partial_p R - f^+\\, \\partial t_e, \\qquad
          \\partial t_e = -(\\nabla g\\, S^- + \\partial_p g) / \\dot g^-

(R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7). A parameter
enters as a load: a sum of polynomials times exponentials, as the motion is one, whose response over a segment is an
integral in closed form. A, B, g and R are the flow's own linear outputs; their derivatives by the contacts' numbers are
central differences of them, in which these are linear or quadratic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.held import held_contacts
from beamsim.flow.march import Log
from beamsim.flow.passage import ContactDirection, StructureDirection, moved_system
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.sensitivity_kernels import Crossings, Parameters

DIFFERENCE = 1e-5  # relative step of the differences


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
        self._ends: dict[bytes, tuple[Floats, Floats]] = {}
        self._several: dict[tuple[tuple[bytes, int, int], ...], tuple[Floats, Floats]] = {}  # of the last motion

    @property
    def size(self) -> tuple[int, int]:
        """N and V."""
        return self.flow.size, self.flow.size + 2 * self.flow.sources.count

    def rates(self, phases: Ints) -> Floats:
        """(N, V) the time derivative of the state."""
        key = phases.tobytes()
        if key not in self._rates:
            self._rates[key] = _factors(self.flow.rates(phases))
        return self._rates[key]

    def event(self, before: Ints, contact: int, after: int) -> Event:
        """The event that takes a contact to another phase.

        Parameters
        ----------
        before : (m,) phases of the contacts.
        contact, after : number of it, and its new phase.
        """
        key = before.tobytes(), contact, after
        if key not in self._events:
            self._events[key] = self._event(before, contact, after)
        return self._events[key]

    def events(self, keys: Sequence[tuple[Ints, int, int]]) -> tuple[Floats, Floats]:
        """(K, V) guards and (K, N, V) resets of K events."""
        key = tuple((before.tobytes(), contact, after) for before, contact, after in keys)
        if key not in self._several:
            found, (N, V) = [self.event(*each) for each in keys], self.size
            guard, reset = (np.array([event[k] for event in found]) for k in (0, 1))
            self._several = {key: (guard.reshape(-1, V), reset.reshape(-1, N, V))}
        return self._several[key]

    def _event(self, before: Ints, contact: int, after: int) -> Event:
        flow, contacts = self.flow, self.flow.system.contacts
        watched = contacts.watched(before)
        leads = (watched.contact[: watched.guards] == contact) & (watched.following == after)
        guard = int(np.flatnonzero(leads)[0])
        functions, state = flow.watched(watched, before), _state(flow)
        if watched.reset[guard] >= 0:
            count = int(contacts.states[contact])
            fresh = functions.some(int(watched.reset[guard]) + np.arange(count))
            _write(flow, state, int(contacts.first[contact]) + np.arange(count), fresh)
        return Event(_factors(functions)[guard], _factors(state))

    def ends(self, phases: Ints) -> tuple[Floats, Floats]:
        """(N, V) the state with which a motion in given phases starts, from one near it, and that from which
        `ExactFlow.begin` finds the phases again.

        At the start what is held rests, and internal states that are penetrations are these.
        """
        key = phases.tobytes()
        if key not in self._ends:
            self._ends[key] = self._begun(phases), self._kept(phases)
        return self._ends[key]

    def _begun(self, phases: Ints) -> Floats:
        flow, held, begun = self.flow, held_contacts(self.flow.system, phases), _state(self.flow)
        if held is not None:
            n = flow.system.size
            begun.row[n : 2 * n, n : 2 * n] -= held.across @ held.across.T
        contact, _ = flow.system.contacts.kept(phases)
        _write(flow, begun, flow.system.contacts.first[contact], flow.penetrations[0].some(contact))
        return _factors(begun)

    def _kept(self, phases: Ints) -> Floats:
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


@dataclass(frozen=True)
class SourceRates:
    """What a parameter changes of the inputs: derivatives of their amplitudes about t = 0, and of their exponents."""

    amplitude: Complexes  # (F,)
    exponent: Complexes  # (F,)


class OutputRates:
    """What a parameter changes of a flow's outputs: central differences of those of two flows, each made once."""

    def __init__(self, flows: tuple[ExactFlow, ExactFlow], step: float) -> None:
        self._sides = FlowOutputs(flows[0]), FlowOutputs(flows[1])
        self._step = 2.0 * step

    def _difference(self, output: Callable[[FlowOutputs], Floats]) -> Floats:
        return (output(self._sides[0]) - output(self._sides[1])) / self._step

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        return self._difference(lambda side: side.rates(phases))

    def guard(self, before: Ints, contact: int, after: int) -> Floats:
        """(V,) change of an event's guard."""
        return self._difference(lambda side: side.event(before, contact, after).guard)

    def reset(self, before: Ints, contact: int, after: int) -> Floats:
        """(N, V) change of the state after an event."""
        return self._difference(lambda side: side.event(before, contact, after).reset)

    def ends(self, phases: Ints) -> tuple[Floats, Floats]:
        """(N, V) changes of `FlowOutputs.ends`."""
        return self._difference(lambda side: side.ends(phases)[0]), self._difference(lambda side: side.ends(phases)[1])


class StructureRates:
    """As `OutputRates` where the structure's matrices and loads change: ``a' = f' - M' a`` for accelerations."""

    def __init__(self, flow: ExactFlow, direction: StructureDirection) -> None:
        self._flow, self._direction = flow, direction

    def _forces(self, phases: Ints) -> Floats:
        """(n, V) change of the generalised forces less that of the inertia's."""
        n, d = self._flow.system.size, self._direction
        change = -d.mass @ _factors(self._flow.rates(phases))[n : 2 * n]
        change[:, :n] -= d.stiffness
        change[:, n : 2 * n] -= d.damping
        change[:, self._flow.size] += d.load
        return change

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        n, held, change = self._flow.system.size, held_contacts(self._flow.system, phases), self._forces(phases)
        out = np.zeros((self._flow.size, change.shape[1]))
        out[n : 2 * n] = change if held is None else held.free(change.T).T
        return out

    def guard(self, before: Ints, contact: int, after: int) -> Floats:
        """(V,) change of an event's guard: of the reactions in it."""
        change, held = self._forces(before), held_contacts(self._flow.system, before)
        if held is None or contact not in held.contact:
            return np.zeros(change.shape[1])
        watched = self._flow.system.contacts.watched(before)
        leads = (watched.contact[: watched.guards] == contact) & (watched.following == after)
        share = held.share[int(np.flatnonzero(held.contact == contact)[0])]
        return np.asarray(watched.joint[int(np.flatnonzero(leads)[0]), 2] * (share @ change))

    def reset(self, before: Ints, contact: int, after: int) -> Floats:
        """(N, V) change of the state after an event: none."""
        return np.zeros((self._flow.size, self._flow.size + 2 * self._flow.sources.count))

    def ends(self, phases: Ints) -> tuple[Floats, Floats]:
        """(N, V) changes of `FlowOutputs.ends`: none."""
        none = self.reset(phases, 0, 0)
        return none, none


Change = SourceRates | OutputRates | StructureRates


def by_contacts(flow: ExactFlow, direction: ContactDirection) -> OutputRates:
    """The change of a flow with its contacts' numbers along a direction."""
    contacts = flow.system.contacts
    pairs = (
        (direction.stiffness, contacts.arrays.force[:, :, 0]), (direction.dashpot, contacts.arrays.force[:, :, 1]),
        (direction.gap, contacts.gap), (direction.shape, contacts.shape),
        (np.array([direction.along is not None], dtype=float), np.ones(1)),
    )  # fmt: skip
    sizes = ((float(np.abs(rate).max(initial=0.0)), float(np.abs(value).max(initial=0.0))) for rate, value in pairs)
    relative = max((rate / value if value else 1.0 for rate, value in sizes if rate), default=1.0)
    step = DIFFERENCE / relative
    flows = (flow.with_system(moved_system(flow.system, direction, amount)) for amount in (step, -step))
    return OutputRates((next(flows), next(flows)), step)


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
    from beamsim.flow.sensitivity_kernels import Exponentials, carry_sensitivity

    N, sources = flow.size, flow.sources
    phases = [state.phases for state in flow.states]
    S, ends = np.eye(N, N + len(changes)), np.empty((2, 2 * sources.count))
    first, last = phases[log.state[0]], phases[log.state[-1]]
    contacts = flow.system.contacts
    if contacts.jointly_acting:
        t = float(log.time[0])
        begun = outputs.ends(first)[0], [_change_of_end(change, first, 0) for change in changes]
        S[:] = _direct(flow, changes, begun, t, log.y[0], S)
    carry_sensitivity(
        flow.tables(), log, Exponentials(sources.amplitude[0], sources.exponent),
        np.array([outputs.rates(each) for each in phases]), _crossings(outputs, phases, log, changes),
        _parameters(phases, changes, N, sources.count), S, ends,
    )  # fmt: skip
    v = np.concatenate([end, ends[0]])
    slope = outputs.rates(last) @ v
    if not contacts.kept(last)[0].size:
        return MotionDerivative(end, slope, S)
    kept = outputs.ends(last)[1]
    ended = kept, [_change_of_end(change, last, 1) for change in changes]
    by = _direct(flow, changes, ended, float(log.time[-1] + log.length[-1]), end, S)
    return MotionDerivative(kept @ v, kept @ np.concatenate([slope, ends[1]]), by)


def _parameters(phases: Sequence[Ints], changes: Sequence[Change], N: int, F: int) -> Parameters:
    """What each parameter changes, as the kernel takes it."""
    from beamsim.flow.sensitivity_kernels import Parameters

    amplitude, exponent = np.zeros((2, len(changes), F), dtype=complex)
    inner = any(not isinstance(change, SourceRates) for change in changes)
    rates = np.zeros((len(changes) if inner else 0, len(phases), N, N + 2 * F))
    for k, change in enumerate(changes):
        if isinstance(change, SourceRates):
            amplitude[k], exponent[k] = change.amplitude, change.exponent
        else:
            rates[k] = [change.rates(each) for each in phases]
    return Parameters(amplitude, exponent, rates)


def _crossings(outputs: FlowOutputs, phases: Sequence[Ints], log: Log, changes: Sequence[Change]) -> Crossings:
    """The events of a motion, as the kernel takes them."""
    from beamsim.flow.sensitivity_kernels import Crossings

    at = np.flatnonzero(log.state[1:] != log.state[:-1])
    number: dict[tuple[int, int, int], int] = {}
    events = zip(log.state[at].tolist(), log.event_contact.tolist(), log.event_phase.tolist(), strict=False)
    kind = np.array([number.setdefault(event, len(number)) for event in events], dtype=np.int64)
    keys = [(phases[state], contact, after) for state, contact, after in number]
    N, V = outputs.size
    inner = any(not isinstance(change, SourceRates) for change in changes)
    by_guard = np.zeros((len(changes) if inner else 0, len(keys), V))
    by_reset = np.zeros((by_guard.shape[0], len(keys), N, V))
    for k, change in enumerate(changes):
        if not isinstance(change, SourceRates):
            for number_of, key in enumerate(keys):
                by_guard[k, number_of], by_reset[k, number_of] = change.guard(*key), change.reset(*key)
    return Crossings(kind, *outputs.events(keys), by_guard, by_reset)


def _change_of_end(change: Change, phases: Ints, which: int) -> Floats | None:
    """(N, V) change of the factors of one of `FlowOutputs.ends`."""
    return None if isinstance(change, SourceRates) else change.ends(phases)[which]


def _direct(
    flow: ExactFlow,
    changes: Sequence[Change],
    factors: tuple[Floats, list[Floats | None]],
    t: float,
    y: Floats,
    S: Floats,
) -> Floats:
    """(N, N + P) change of what has the factors (N, V), and these a change by some parameters, where y (N,) has S."""
    N, (of, by) = y.size, factors
    out = of[:, :N] @ S
    v = np.concatenate([y, flow.inputs_at(np.array([t]))[0, 0]])
    for k, (change, moved) in enumerate(zip(changes, by, strict=True)):
        if isinstance(change, SourceRates):
            out[:, N + k] += of[:, N:] @ _moved_inputs(flow, change, t)
        elif moved is not None:
            out[:, N + k] += moved @ v
    return np.asarray(out)


def _moved_inputs(flow: ExactFlow, change: SourceRates, t: float) -> Floats:
    """(2 F,) change of the inputs and of their slopes at a time."""
    sources = flow.sources
    turned = np.exp(t * sources.exponent)
    rising = sources.amplitude[0] * change.exponent
    value = (change.amplitude + rising * t) * turned
    return np.hstack([value.real, (sources.exponent * value + rising * turned).real])
