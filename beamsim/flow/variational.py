r"""The exact flow of a structure under periodic loads, with its derivatives: the interface for shooting and
continuation.

:meth:`VariationalFlow.flow_map` maps a state over a time and returns the exact derivatives by the initial state, the
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

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from beamsim.contacts.laws import CONSTANT, NORMAL_FORCE, PENETRATION
from beamsim.flow.exact import LONGEST_WINDOW_RADIANS, ExactFlow
from beamsim.flow.periodic_flow import (
    ContactDirection,
    FlowMap,
    Frequency,
    Level,
    Parameter,
    PeriodicFlow,
    WorkExceeded,
    check_finite,
    shift_system,
)
from beamsim.flow.sensitivity_kernels import Factors, Instant, StoredDerivatives, differentiate
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log, March, Motion
from beamsim.system.equations import PiecewiseLinearSystem, RowsOf
from beamsim.typing import Complexes, Floats, Ints

STEP = 1e-5  # relative, of the differences

Number = TypeVar("Number", np.float64, np.complex128)
EventKey = tuple[Ints, int, int] | None  # (m,) phases before it, the contact, and its new phase; None: nothing happens


class FlowOutputs:
    """Factors (k, V) of the state (N), the inputs (F) and their slopes (F) in a flow's linear outputs.

    They do not depend on the loads' signals, and each is computed once. At an event the N rows of the changed state
    come first, then the row of the guard.

    Parameters
    ----------
    flow : under its loads.
    rotation : (n, n) orthogonal matrix from the flow's coordinates to those of the outputs; the identity by default.
    target : the flow whose coordinates these are. The coordinates are rotated with each phase so that the stuck
        directions
        coincide with those of the target: then no derivative moves a stuck contact.
    """

    def __init__(self, flow: ExactFlow, rotation: Floats | None = None, target: ExactFlow | None = None) -> None:
        self.flow, self.rotation, self.target = flow, rotation, target
        self._made: dict[tuple[object, ...], Floats] = {}
        self._turns: dict[bytes, Floats] = {}

    def _once(self, key: tuple[object, ...], compute: Callable[[], Floats], *phases: Ints | None) -> Floats:
        if key not in self._made:
            self._made[key] = self._rotate(compute(), *phases)
        return self._made[key]

    def _turn_in(self, phases: Ints) -> Floats:
        """(n, n) rotation in given phases, including the smallest rotation that makes the stuck directions coincide."""
        assert self.rotation is not None
        stuck, target = (each.at(phases).stuck_directions for each in (self.flow, self.target or self.flow))
        if not stuck.shape[1] or not target.shape[1]:
            return self.rotation
        if (key := phases.tobytes()) not in self._turns:
            rotated, eye = self.rotation @ stuck, np.eye(self.rotation.shape[0])
            onto, onto_target = rotated @ rotated.T, target @ target.T
            left, _, right = np.linalg.svd(onto_target @ onto + (eye - onto_target) @ (eye - onto))
            self._turns[key] = left @ right @ self.rotation
        return self._turns[key]

    def _rotate(
        self,
        factors: Floats,
        state_phases: Ints | None = None,
        result_phases: Ints | None = None,
        *,
        states: bool = True,
    ) -> Floats:
        """Factors (k, V) in the rotated coordinates; if the outputs begin with states, these are rotated as well.

        Parameters
        ----------
        factors : in the coordinates of the flow.
        state_phases, result_phases : phases that rotate the state the factors act on, and the state they give; None if
            no contact sticks.
        states : whether the outputs begin with states.
        """
        if self.rotation is not None:
            n = self.rotation.shape[0]
            before, after = (
                self.rotation if phases is None else self._turn_in(phases) for phases in (state_phases, result_phases)
            )
            for rows in (slice(0, n), slice(n, 2 * n)):
                factors[:, rows] = factors[:, rows] @ before.T
                if states:
                    factors[rows] = after @ factors[rows]
        return factors

    def outputs(self, output_of: RowsOf, phases: Ints) -> Floats:
        """(k, V) outputs of the flow in given phases."""
        return self._rotate(output_of(phases).copy(), phases, states=False)

    def state(self, initial: Floats) -> Floats:
        """(N,) a state, from its first entries at least."""
        state = np.pad(initial, (0, self.flow.size - initial.size))
        return np.asarray(self._rotate(state[None, :], states=False)[0])

    def rates(self, phases: Ints) -> Floats:
        """(N, V) the time derivative of the state."""
        return self._once(("rates", phases.tobytes()), lambda: self.flow.at(phases).rates.copy(), phases, phases)

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) the state after an event, and the guard."""
        if key is None:
            return self._once((), lambda: _change_factors(self.flow.equations.state))
        before, contact, after = key
        result = self.flow.system.contacts.phases_after(before, contact, after)
        compute = partial(self._event, before, contact, after)
        return self._once((before.tobytes(), contact, after), compute, before, result)

    def state_at_start(self, phases: Ints) -> Floats:
        """(N + 1, V) the state with which a motion in given phases starts, from one near it.

        Stuck directions are at rest, and internal states that equal penetrations take their values.
        """
        return self._once(
            ("begun", phases.tobytes()), lambda: _change_factors(self._state_at_start(phases)), None, phases
        )

    def state_at_end(self, phases: Ints) -> Floats:
        """(N + 1, V) the state at the end of a motion, from which `ExactFlow.begin` recovers the final phases."""
        return self._once(("kept", phases.tobytes()), lambda: _change_factors(self._state_at_end(phases)), phases)

    def _event(self, phases: Ints, contact: int, phase: int) -> Floats:
        state = self.flow.at(phases)
        event = state.events.of_change(contact, phase)
        return _change_factors(state.state_after(event), state.events.guards[event])

    def _state_at_start(self, phases: Ints) -> Floats:
        state, equations, contacts = self.flow.at(phases), self.flow.equations, self.flow.system.contacts
        start, n = equations.state.copy(), self.flow.system.size
        start[equations.velocities, equations.velocities] -= state.stuck_directions @ state.stuck_directions.T
        contact, _ = contacts.states_to_rewrite(phases)
        start[2 * n + contacts.first_state[contact]] = equations.penetration[contact]
        return start

    def _state_at_end(self, phases: Ints) -> Floats:
        law, contacts, end = self.flow.at(phases).law, self.flow.system.contacts, self.flow.equations.state.copy()
        contact, (constant, pressing) = (
            contacts.states_to_rewrite(phases)[0],
            contacts.states_to_rewrite(phases)[1].T[:, :, None],
        )
        values = law[contact, PENETRATION] - constant * law[contact, CONSTANT] - pressing * law[contact, NORMAL_FORCE]
        end[2 * self.flow.system.size + contacts.first_state[contact]] = values
        return end


def _change_factors(state: Floats, guard: Floats | None = None) -> Floats:
    """(N + 1, V) factors of a changed state and of a guard, which is zero where there is none."""
    return np.vstack([state, np.zeros_like(state[0]) if guard is None else guard])


class ParameterChange(ABC):
    """Derivatives by one parameter of a flow's linear outputs, each computed once, and of its inputs."""

    amplitude: Complexes  # (pieces, F) of the inputs about the starts of their pieces
    exponent: Complexes  # (F,) 1/s
    begin: Floats  # (pieces,) of the starts, s

    def __init__(self) -> None:
        self._made: dict[tuple[object, ...], Floats] = {}

    @abstractmethod
    def of(self, output: Callable[[FlowOutputs], NDArray[Number]]) -> NDArray[Number]:
        """The derivative of an output."""

    def _once(self, key: tuple[object, ...], output: Callable[[FlowOutputs], Floats]) -> Floats:
        if key not in self._made:
            self._made[key] = self.of(output)
        return self._made[key]

    def rates(self, phases: Ints) -> Floats:
        """(N, V) of `FlowOutputs.rates`."""
        return self._once(("rates", phases.tobytes()), lambda side: side.rates(phases))

    def event(self, key: EventKey) -> Floats:
        """(N + 1, V) of `FlowOutputs.event`."""
        return self._once(() if key is None else (key[0].tobytes(), *key[1:]), lambda side: side.event(key))

    def state_at_start(self, phases: Ints) -> Floats:
        """(N + 1, V) of `FlowOutputs.state_at_start`."""
        return self._once(("begun", phases.tobytes()), lambda side: side.state_at_start(phases))

    def state_at_end(self, phases: Ints) -> Floats:
        """(N + 1, V) of `FlowOutputs.state_at_end`."""
        return self._once(("kept", phases.tobytes()), lambda side: side.state_at_end(phases))


class SourceRates(ParameterChange):
    """Derivatives by a parameter of the inputs: of their amplitudes (F,) about t = 0 and exponents (F,)."""

    def __init__(self, outputs: FlowOutputs, amplitude: Complexes, exponent: Complexes) -> None:
        super().__init__()
        sources, self._outputs = outputs.flow.sources, outputs
        self.amplitude, self.begin = np.zeros_like(sources.amplitude), np.zeros_like(sources.start)
        self.exponent = np.append(0j, exponent)
        self.amplitude[0, 1:] = amplitude

    def of(self, output: Callable[[FlowOutputs], NDArray[Number]]) -> NDArray[Number]:
        """The derivative of an output: none."""
        return np.zeros_like(output(self._outputs))


class Differences(ParameterChange):
    """Derivatives by a parameter as finite differences of flows at neighbouring values.

    Parameters
    ----------
    flow : at the parameter's value.
    sides : outputs of flows at neighbouring values, with as many contacts, phases, sources and pieces.
    weight : weights of the sides in the derivative.
    """

    def __init__(self, flow: ExactFlow, sides: Sequence[FlowOutputs], weight: Sequence[float]) -> None:
        super().__init__()
        self._sides, self._weight, start = sides, weight, flow.sources.start
        pieces = np.arange(start.size)
        self.amplitude = self.of(lambda side: side.flow.sources.amplitudes_at(start, pieces))  # (pieces, F)
        self.exponent = self.of(lambda side: side.flow.sources.exponent)
        self.begin = self.of(lambda side: side.flow.sources.start)

    def of(self, output: Callable[[FlowOutputs], NDArray[Number]]) -> NDArray[Number]:
        """The derivative of an output."""
        parts = [w * output(side) for w, side in zip(self._weight, self._sides, strict=True)]
        return np.asarray(np.sum(parts, axis=0))


def direction_rates(flow: ExactFlow, direction: ContactDirection) -> Differences:
    """Derivatives of a flow along a direction in which the numbers of its contacts change.

    If the shape of a sticking contact changes, its stuck directions change too; the coordinates are rotated with
    them, since there is no motion along stuck directions. Without sticking contacts they are those of the flow.
    """
    contacts = flow.system.contacts
    turn = np.eye(flow.system.size) if contacts.any_sticks_rigidly and np.any(direction.shape) else None
    pairs = (
        (direction.stiffness, contacts.arrays.force[:, :, 0]), (direction.dashpot, contacts.arrays.force[:, :, 1]),
        (direction.gap, contacts.gap), (direction.shape, contacts.shape),
        (direction.base_participation, contacts.base_participations),
        (np.array([direction.added_contacts is not None], dtype=float), np.ones(1)),
    )  # fmt: skip
    sizes = ((float(np.abs(rate).max(initial=0.0)), float(np.abs(value).max(initial=0.0))) for rate, value in pairs)
    relative = max((rate / value if value else 1.0 for rate, value in sizes if rate), default=1.0)
    step = STEP / relative
    sides = [
        FlowOutputs(replace(flow, system=shift_system(flow.system, direction, amount)), turn, flow)
        for amount in (step, -step)
    ]
    return Differences(flow, sides, (0.5 / step, -0.5 / step))


class MotionDerivative(NamedTuple):
    """Derivatives of a motion by C changes of its start; the last P of these belong to the parameters."""

    end: Floats  # (2, N) the last state, and its time derivative
    derivative: Floats  # (N, C) of the end, at a fixed time
    stored: StoredDerivatives  # what was asked for on the way


def sensitivity(
    flow: ExactFlow,
    outputs: FlowOutputs,
    log: Log,
    changes: Sequence[ParameterChange],
    start: Floats,
    instants: Sequence[tuple[int, int]] = (),
) -> MotionDerivative:
    """Derivatives of a motion by its start and by P parameters.

    Parameters
    ----------
    flow : under the loads of the motion; all its contact states are in memory.
    outputs : of this flow.
    log : the motion's G segments, and its events; those at its beginning and at its end are left out.
    changes : (P,) what each parameter changes.
    start : (N, C) changes of the start; the last P columns belong to the parameters.
    instants : (M,) times at which derivatives are stored, in order: number of the segment that begins then, or G, and 1
        after or 0 before the event with which it begins.

    Returns
    -------
    The derivatives at the end, and the stored ones.
    """
    N, F, G, M, P = flow.size, flow.sources.power.size, log.time.size, len(instants), len(changes)
    visited, state = np.unique(log.state, return_inverse=True)
    steps, last = np.diff(log.state), flow.states[log.state[-1]].phases
    # an event exactly at the end has no segment after it: the last segment is still in the phase before it
    count = log.event_time.size
    if count and last[log.event_contact[-1]] != log.event_phase[-1]:
        count -= 1
    events = zip(*(column[count - np.count_nonzero(steps) : count].tolist()
                   for column in (log.event_contact, log.event_phase)), strict=True)  # fmt: skip
    before = [flow.states[of].phases for of in log.state]
    keys = [(phases, *next(events)) if step else None for phases, step in zip(before, steps, strict=False)]
    distinct = {None if key is None else (key[0].tobytes(), *key[1:]): key for key in keys}
    number = {name: 1 + k for k, name in enumerate(distinct)}
    phases = [flow.states[k].phases for k in visited]
    first = phases[state[0]]
    both: list[FlowOutputs | ParameterChange] = [outputs, *changes]
    rates = np.array([[each.rates(of) for of in phases] for each in both])
    changed = np.array(
        [[each.state_at_start(first), *map(each.event, distinct.values()), each.state_at_end(last)] for each in both]
    )
    numbers = [number[None if key is None else (key[0].tobytes(), *key[1:])] for key in keys]
    factors = Factors(
        rates, changed, state, np.array([0, *numbers, 1 + len(distinct)]),
        np.array([each.amplitude for each in changes], dtype=complex).reshape(P, *flow.sources.amplitude.shape),
        np.array([each.exponent for each in changes], dtype=complex).reshape(P, F),
        np.array([each.begin for each in changes]).reshape(P, flow.sources.start.size),
        flow.sources.derivatives_at_start[:4],
    )  # fmt: skip
    derivative, end, columns, V = start.copy(), np.empty((2, N)), start.shape[1], N + 2 * F
    event, after = np.array(instants, dtype=np.int64).reshape(M, 2).T
    instant = Instant(np.empty((M, V)), np.empty((M, V)), np.empty((0, V)), np.empty((M, P, 2 * F)))
    stored = StoredDerivatives(
        np.zeros((G + 1, columns)), np.zeros((2, G + 1)), event.copy(), after.copy(), instant, np.empty((M, N, columns))
    )
    differentiate(flow.tables(), flow.inputs, log, factors, derivative, end, stored)
    return MotionDerivative(end, derivative, stored)


@dataclass
class VariationalFlow(PeriodicFlow):
    """The exact flow under periodic loads; flows derived from it share the modes of the contact states."""

    # under the loads of this flow, or of one that it comes from
    _flow_of_loads: ExactFlow = field(init=False, repr=False)
    _loads_key: tuple[float, float] = field(init=False, repr=False)  # frequency and level
    _last_direction: tuple[ContactDirection, Differences] | None = field(default=None, init=False, repr=False)

    def _prepare(self) -> None:
        window = LONGEST_WINDOW_RADIANS / self.omega  # for structures without a stiffness: others have their own
        longest = np.inf if self.system.stiffness.any() else window
        self._flow_of_loads = ExactFlow(self.system, self.loads.signals(self.omega, self.level), longest)
        self._loads_key = self.omega, self.level
        self._outputs = FlowOutputs(self._flow_of_loads)

    @property
    def exact(self) -> ExactFlow:
        """The exact flow under the present loads, updated when it is first used."""
        if self._loads_key != (self.omega, self.level):
            self._flow_of_loads = self._flow_of_loads.with_loads(self.loads.signals(self.omega, self.level))
            self._loads_key = self.omega, self.level
        return self._flow_of_loads

    def with_system(self, system: PiecewiseLinearSystem) -> VariationalFlow:
        """The flow of another structure, or of other contacts with as many phases, under the same loads."""
        flow = copy(self)
        flow.system, flow._flow_of_loads, flow._loads_key = (
            system,
            self.exact.with_system(system),
            (self.omega, self.level),
        )
        flow._outputs = FlowOutputs(flow._flow_of_loads)
        if self._last_direction is not None and not self._last_direction[0].scales_forces:
            flow._last_direction = None
        return flow

    def flow_map(self, start: Floats, duration: float, parameters: Sequence[Parameter] = (), t: float = 0.0) -> FlowMap:
        """The state after ``duration``, with its derivatives.

        Parameters
        ----------
        start, duration, parameters, t : see `PeriodicFlow.flow_map`.

        Returns
        -------
        FlowMap
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
        exact, (_, log) = self.exact, self._march(start, duration, t)
        changes, N = [self._change(p) for p in parameters], self.size
        result = sensitivity(exact, self._outputs, log, changes, np.eye(N, N + len(changes)))
        of_segment = np.array([exact.states[k].phases for k in log.state], dtype=np.int64)
        return FlowMap(
            start, result.end[0], result.derivative[:, :N], result.derivative[:, N:], result.end[1], duration, log.time,
            log.length, of_segment.reshape(log.state.size, -1), log.y, log.event_time, log.event_contact,
            log.event_before, log.event_phase,
        )  # fmt: skip

    def end(self, start: Floats, duration: float, t: float = 0.0) -> Floats:
        """(N,) the state after ``duration``, of one march without derivatives; see `PeriodicFlow.end`."""
        motion, _ = self._march(start, duration, t)
        inputs = self.exact.inputs_at(np.array([t + duration]))[0, 0]
        kept = self._outputs.state_at_end(self.exact.states[motion.state].phases)
        return np.asarray(kept[: self.size] @ np.append(motion.y, inputs))

    def _march(self, start: Floats, duration: float, t: float) -> tuple[Motion, Log]:
        """The motion from a state (N,) at time t, s, at its end, and its segments and events."""
        self._march_count[0] += 1
        exact = self.exact
        phases = exact.begin(start, t).phases
        begun = self._outputs.state_at_start(phases)[: self.size] @ np.append(
            start, exact.inputs_at(np.array([t]))[0, 0]
        )
        motion, turns = Motion(begun, exact.state_index(phases), time=t), 1.0 + duration * self.omega / (2.0 * np.pi)
        # 65_536, 20_000_000: in a period of the loads
        march = March(max_events=int(65_536 * turns), max_evaluations=int(20_000_000 * turns))
        log = march.on(exact, motion, t + duration)
        check_finite(motion.y)
        if not march.outcome.complete:
            raise WorkExceeded(march.outcome.message)
        return motion, log

    def _change(self, parameter: Parameter) -> ParameterChange:
        """What a parameter changes."""
        if isinstance(parameter, ContactDirection):
            if self._last_direction is None or self._last_direction[0] is not parameter:
                self._last_direction = parameter, direction_rates(self.exact, parameter)
            return self._last_direction[1]
        if not isinstance(parameter, Frequency | Level):
            raise TypeError(f"no derivative by {type(parameter).__name__}")
        amplitude, exponent = self.loads.rates_of_signals(self.omega, self.level, parameter)
        count = self.exact.sources.power.size - 1  # without the base where no contact feels it
        return SourceRates(self._outputs, amplitude[:count], exponent[:count])

    def motion(self, flow_map: FlowMap) -> Trajectory:
        """The motion, of which every output is known in closed form."""
        return flow_map.trajectory(self.exact)

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
        return self.exact.outputs_of_states(times, y, phases, lambda of: self.exact.at(of).force)

    def states_at(self, flow_map: FlowMap, times: Floats) -> Floats:
        """(nt, N) the state at increasing times within a motion."""
        return self.motion(flow_map).states_at(times)
