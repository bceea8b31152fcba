r"""The exact flow of a structure under periodic loads, with its derivatives: what shooting and continuation ask of it.

:meth:`VariationalFlow.carry` maps a state over a time and returns the exact derivatives by the initial state, the
duration and any parameters. The motion is that of
:class:`beamsim.flow.exact.ExactFlow` under the loads
:math:`f(t) = A\,\mathrm{Re} \sum_h f_h (\omega/\omega_0)^{r_h} e^{i k_h \omega t}` and, for contacts on the
ground, a base displacement of the same form.

Along a motion :math:`y' = A y + B u` with the events :math:`g(y, u) = 0`, after which :math:`y^+ = R(y, u)`, the
sensitivity :math:`S = \partial y/\partial(y_0, p)` follows

.. math:: S' = A S + \partial_p A\, y + \partial_p B\, u + B\, \partial_p u, \qquad
          S^+ = R' (S^- + f^-\, \partial t_e) + \partial_p R - f^+\, \partial t_e, \qquad
          \partial t_e = -(\nabla g\, S^- + \partial_p g) / \dot g^-

(R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7). A parameter
enters as a load: a sum of polynomials times exponentials, as the motion is one, whose response over a segment is an
integral in closed form, the convolution of both. A, B, g and R are the flow's own linear outputs; their derivatives by
the contacts' numbers are central differences of them, in which these are linear or quadratic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from beamsim.flow.contact_state import LinearOutput, held_contacts
from beamsim.flow.exact import LONGEST_WINDOW_RADIANS, ExactFlow
from beamsim.flow.periodic_flow import (
    ContactDirection,
    Frequency,
    Level,
    Parameter,
    Passage,
    PeriodicFlow,
    StructureDirection,
    WorkExceeded,
    check_finite,
    moved_system,
)
from beamsim.flow.sensitivity_kernels import Factors, differentiate
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log, March, Motion
from beamsim.outcomes import COMPLETE
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Complexes, Floats, Ints

EventKey = tuple[Ints, int, int] | None  # (m,) phases before it, the contact, and its new phase; None: nothing happens


class FlowOutputs:
    """Factors (k, V) of the state (N), the inputs (F) and their slopes (F) in a flow's linear outputs.

    They are the same under all loads that differ in their signals alone. Each is made once. Where the state changes at
    once, its factors (N) are above those of the event's guard.
    """

    def __init__(self, flow: ExactFlow) -> None:
        self.flow = flow
        self._made: dict[tuple[object, ...], Floats] = {}

    def _once(self, key: tuple[object, ...], make: Callable[[], Floats]) -> Floats:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def rates(self, phases: Ints) -> Floats:
        """(N, V) the time derivative of the state."""
        return self._once(("rates", phases.tobytes()), lambda: _factors(self.flow.rates(phases)))

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) what happens at an event."""
        if key is None:
            return self._once((), lambda: _changed(_state(self.flow)))
        before, contact, after = key
        return self._once((before.tobytes(), contact, after), lambda: self._event(before, contact, after))

    def begun(self, phases: Ints) -> Floats:
        """(N + 1, V) the state with which a motion in given phases starts, from one near it.

        What is held rests, and internal states that are penetrations are these.
        """
        return self._once(("begun", phases.tobytes()), lambda: _changed(self._begun(phases)))

    def kept(self, phases: Ints) -> Floats:
        """(N + 1, V) the state from which `ExactFlow.begin` finds the phases again in which a motion ends."""
        return self._once(("kept", phases.tobytes()), lambda: _changed(self._kept(phases)))

    def _event(self, before: Ints, contact: int, after: int) -> Floats:
        flow, contacts = self.flow, self.flow.system.contacts
        watched = contacts.watched(before)
        guard = watched.guard_of(contact, after)
        functions, state = flow.watched(watched, before), _state(flow)
        if watched.reset[guard] >= 0:
            count = int(contacts.states[contact])
            fresh = functions.some(int(watched.reset[guard]) + np.arange(count))
            _write(flow, state, int(contacts.first[contact]) + np.arange(count), fresh)
        return _changed(state, functions.some(slice(guard, guard + 1)))

    def _begun(self, phases: Ints) -> LinearOutput:
        flow, held, begun = self.flow, held_contacts(self.flow.system, phases), _state(self.flow)
        if held is not None:
            n = flow.system.size
            begun.row[n : 2 * n, n : 2 * n] -= held.across @ held.across.T
        contact, _ = flow.system.contacts.kept(phases)
        _write(flow, begun, flow.system.contacts.first[contact], flow.penetrations[0].some(contact))
        return begun

    def _kept(self, phases: Ints) -> LinearOutput:
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
        return end


def _factors(output: LinearOutput) -> Floats:
    return np.hstack([output.row, output.direct, output.direct_slope])


def _changed(state: LinearOutput, guard: LinearOutput | None = None) -> Floats:
    """(N + 1, V) factors of a changed state and of a guard, which is zero where there is none."""
    factors = _factors(state)
    return np.vstack([factors, np.zeros_like(factors[:1]) if guard is None else _factors(guard)])


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
        self._none = np.zeros((flow.size + 1, flow.size + 2 * flow.sources.count))

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        return self._none[:-1]

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) change of `FlowOutputs.event`."""
        return self._none

    def begun(self, phases: Ints) -> Floats:
        """(N + 1, V) change of `FlowOutputs.begun`."""
        return self._none

    def kept(self, phases: Ints) -> Floats:
        """(N + 1, V) change of `FlowOutputs.kept`."""
        return self._none


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
        # 1e-5: relative step of the differences
        self._step = 1e-5 / relative
        self._sides = [
            FlowOutputs(replace(flow, system=moved_system(flow.system, direction, amount)))
            for amount in (self._step, -self._step)
        ]  # fmt: skip

    def _difference(self, output: Callable[[FlowOutputs], Floats]) -> Floats:
        return (output(self._sides[0]) - output(self._sides[1])) / (2.0 * self._step)

    def rates(self, phases: Ints) -> Floats:
        """(N, V) change of the state's rate."""
        return self._difference(lambda side: side.rates(phases))

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) change of `FlowOutputs.event`."""
        return self._difference(lambda side: side.event(key))

    def begun(self, phases: Ints) -> Floats:
        """(N + 1, V) change of `FlowOutputs.begun`."""
        return self._difference(lambda side: side.begun(phases))

    def kept(self, phases: Ints) -> Floats:
        """(N + 1, V) change of `FlowOutputs.kept`."""
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
        out = self._none[:-1].copy()
        out[n : 2 * n] = change if held is None else held.free(change.T).T
        return out

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) change of `FlowOutputs.event`: of the reactions in the guard."""
        change, system = self._none.copy(), self.flow.system
        if key is None:
            return change
        before, contact, after = key
        held = held_contacts(system, before)
        if held is not None and contact in held.contact:
            watched = system.contacts.watched(before)
            share = held.share[int(np.flatnonzero(held.contact == contact)[0])]
            change[-1] = watched.joint[watched.guard_of(contact, after), 2] * (share @ self._forces(before))
        return change


class MotionDerivative(NamedTuple):
    """The end of a motion with its derivatives."""

    end: Floats  # (N,)
    slope: Floats  # (N,) time derivative
    by: Floats  # (N, N + P) by the start, and by the parameters at fixed times


def sensitivity(flow: ExactFlow, outputs: FlowOutputs, log: Log, changes: Sequence[Change]) -> MotionDerivative:
    """The derivatives of a motion's end by its start and by P parameters.

    Parameters
    ----------
    flow : under the loads of the motion, which are exponentials from t = 0 on, all its contact states kept.
    outputs : of this flow.
    log : the motion's segments and events.
    changes : (P,) what each parameter changes.

    Returns
    -------
    The end, its time derivative, and its derivatives.
    """
    N, phases = flow.size, [flow.states[number].phases for number in log.state]
    events, steps = zip(log.event_contact.tolist(), log.event_phase.tolist(), strict=True), np.diff(log.state)
    keys = [(phases[g], *next(events)) if step else None for g, step in enumerate(steps)]
    every: tuple[FlowOutputs | Change, ...] = (outputs, *changes)
    factors = Factors(
        np.array([[each.rates(of) for of in phases] for each in every]),
        np.array([[each.begun(phases[0]), *map(each.event, keys), each.kept(phases[-1])] for each in every]),
        np.array([each.amplitude for each in changes], dtype=complex).reshape(-1, flow.sources.count),
        np.array([each.exponent for each in changes], dtype=complex).reshape(-1, flow.sources.count),
    )
    by, end, slope = np.empty((N, N + len(changes))), np.empty(N), np.empty(N)
    differentiate(flow.tables(), flow.inputs(), log, factors, by, end, slope)
    return MotionDerivative(end, slope, by)


@dataclass
class VariationalFlow(PeriodicFlow):
    """The flow in closed form; flows that come from it share the contact states' modes."""

    differentiates = (Frequency, Level, ContactDirection, StructureDirection)

    exact: ExactFlow = field(init=False, repr=False)

    def _prepare(self) -> None:
        window = LONGEST_WINDOW_RADIANS / self.omega  # for structures without a stiffness: others have their own
        longest = np.inf if self.system.stiffness.any() else window
        self.exact = ExactFlow(self.system, self.loads.signals(self.omega, self.level), longest)
        self._outputs = FlowOutputs(self.exact)

    def under(self, omega: float | None = None, level: float | None = None) -> VariationalFlow:
        """The flow of the same structure at another frequency and level, which shares the contact states' modes."""
        flow = super().under(omega, level)
        if (flow.omega, flow.level) == (self.omega, self.level):
            return self
        flow.exact = self.exact.under(self.loads.signals(flow.omega, flow.level))
        return flow

    def with_system(self, system: PiecewiseLinearSystem) -> VariationalFlow:
        """The flow of another structure, or of other contacts with as many phases, under the same loads."""
        flow = copy(self)
        flow.system, flow.exact = system, replace(self.exact, system=system)
        flow._outputs = FlowOutputs(flow.exact)
        return flow

    def carry(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> Passage:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start, duration, parameters, t : see `PeriodicFlow.carry`.

        Returns
        -------
        Passage
            The motion with the derivatives of its end.

        Raises
        ------
        WorkExceeded
            Where it takes more events or evaluations than allowed (chattering).
        NotFinite
            Where the motion leaves the range of floating-point numbers.
        TypeError
            Where there is no derivative by a parameter of this kind.
        """
        self._carried[0] += 1
        exact = self.exact
        phases = exact.begin(start, t).phases
        begun = self._outputs.begun(phases)[: self.size] @ np.append(start, exact.inputs_at(np.array([t]))[0, 0])
        motion = Motion(begun, exact.state_index(phases), time=t)
        march = March(max_events=65_536, max_evaluations=20_000_000)
        log = march.on(exact, motion, t + duration)
        check_finite(motion.y)
        if not march.outcome.complete:
            raise WorkExceeded(march.outcome.message)
        found = sensitivity(exact, self._outputs, log, [self._change(p) for p in parameters])
        of_segment = np.array([exact.states[k].phases for k in log.state], dtype=np.int64)
        return Passage(
            start, found.end, found.by[:, : self.size], found.by[:, self.size :], found.slope, duration, log.time,
            log.length, of_segment.reshape(log.state.size, -1), log.y, log.event_time, log.event_contact,
            log.event_phase,
        )  # fmt: skip

    def _change(self, parameter: Parameter) -> Change:
        """What a parameter changes."""
        if isinstance(parameter, ContactDirection):
            return OutputRates(self.exact, parameter)
        if isinstance(parameter, StructureDirection):
            return StructureRates(self.exact, parameter)
        if not isinstance(parameter, Frequency | Level):
            raise TypeError(f"no derivative by {type(parameter).__name__}")
        amplitude, exponent = self.loads.rates_of_signals(self.omega, self.level, parameter)
        count = self.exact.sources.count - 1  # without the base where no contact feels it
        return SourceRates(self.exact, amplitude[:count], exponent[:count])

    def motion(self, passage: Passage) -> Trajectory:
        """The motion of a passage, of which every output is known in closed form."""
        return motion_on(self.exact, passage)

    @property
    def fastest(self) -> float:
        """rad/s, largest rate of any motion in the contact states so far, and of the loads."""
        return max(self.exact.largest_exponent, float(np.abs(self.loads.multiple * self.omega).max(initial=0.0)))

    def contact_forces(self, phases: Ints, y: Floats, times: Floats) -> Floats:
        """See `PeriodicFlow.contact_forces`; forces of contacts that hold or rub are included.

        Parameters
        ----------
        phases : (nt, m).
        y : (nt, N) states.
        times : (nt,) s.

        Returns
        -------
        (nt, m) array
            N.
        """
        return self.exact.outputs_of_states(times, y, phases, self.exact.contact_forces)

    def states_at(self, passage: Passage, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a passage."""
        return self.motion(passage).states_at(times)


def motion_on(exact: ExactFlow, passage: Passage) -> Trajectory:
    """The motion of a passage on a flow of the same system under the same loads, whose outputs are asked for."""
    for phases in passage.phases:
        exact.state_index(phases)
    number = {phases.tobytes(): k for k, phases in enumerate(exact.visited)}
    state = np.array([number[phases.tobytes()] for phases in passage.phases], dtype=np.int64)
    log = Log(
        passage.time, passage.length, state, np.zeros_like(state), passage.y, passage.event_time,
        passage.event_contact, passage.event_phase,
    )  # fmt: skip
    end = float(passage.time[0] + passage.duration)
    return Trajectory(exact, end, *log, passage.end, 0, COMPLETE)
