"""Passages through the transient flow: near the resonance of an undamped mode, and with coupled internal states.

The particular solution ``(i k w - lambda)^-1`` that :mod:`beamsim.flow.orbit_kernels` uses is unbounded there, and the
motion loses as many digits as the frequencies have in common; where internal states of the contacts are coupled with
the structure, those kernels have none at all. Here the motion comes from the transient flow, which
writes the response as a power series in time; the transition matrix, which does not depend on the load, is the same
product of segments and events, and derivatives by parameters are central differences.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.held import held_contacts
from beamsim.flow.march import Motion, carry
from beamsim.flow.passage import (
    LARGEST_LOG,
    MOST_EVALUATIONS,
    Direction,
    Frequency,
    Level,
    Parameter,
    Passage,
    WorkExceeded,
    check_finite,
)
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.contact_state import ContactState
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.kernels import Inputs, Tables
    from beamsim.flow.march_kernels import PieceSteps

NEAR = 1e-4  # |i k w - lambda| over w below which more than four digits would be lost
DIFFERENCE = 1e-6  # relative step of the differences
ROUND_OFF = 1e-14  # of the terms that make up two rates: a smaller difference of them is none


class SeriesFlow(PeriodicFlow):
    """A periodic flow beside a transient one for the same loads, whose contact states are numbered alike."""

    @abstractmethod
    def number_in(self, exact: ExactFlow, phases: Ints) -> int:
        """Number of a contact state, made the same in a transient flow."""

    @abstractmethod
    def by_series(self) -> ExactFlow:
        """The transient flow under the present loads."""

    @abstractmethod
    def under(self, omega: float, level: float) -> Self:
        """A flow of the same structure under other loads."""

    @abstractmethod
    def by_difference(self, start: Floats, duration: float, direction: Direction, t: float) -> Floats:
        """Central difference by a direction."""


@dataclass
class _NumberedAlike:
    """A transient flow whose new states are numbered in another flow too; see `beamsim.flow.march.Marched`."""

    flow: SeriesFlow
    exact: ExactFlow

    def kernel_arguments(self) -> tuple[Tables, Inputs, None]:
        return self.exact.kernel_arguments()

    def equal_steps(self) -> PieceSteps | None:
        return self.exact.equal_steps()

    def follow(self, state: int, guard: int) -> int:
        return self.flow.number_in(self.exact, self.exact.following(state, guard))

    def visits(self, states: Ints) -> Ints:
        return states

    def time_of(self, motion: Motion) -> float:
        return motion.time


def is_resonant(states: Sequence[ContactState], multiple: Ints, omega: float) -> bool:
    """Whether a harmonic of the load is so close to an eigenvalue of one of the contact states."""
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
    flow: SeriesFlow, exact: ExactFlow, start: Floats, duration: float, parameters: Sequence[Parameter], t: float
) -> Passage:
    """As :meth:`beamsim.flow.periodic_flow.PeriodicFlow.carry`, for the same loads in ``exact``."""
    passage = _motion(flow, exact, start, duration, t)
    matrix = _by_start(exact, passage)
    columns = [_by_parameter(flow, p, start, duration, t) for p in parameters]
    by = np.array(columns).T if columns else np.zeros((start.size, 0))
    return replace(passage, transition=matrix, parameters=by)


def _motion(flow: SeriesFlow, exact: ExactFlow, start: Floats, duration: float, t: float) -> Passage:
    """The passage without its derivatives."""
    if flow.system.contacts.jointly_acting:
        phases, _, begun = exact.begin(start, t)
        begun = _as_phases_have_it(exact, phases, t).values(begun)
    else:
        phases, begun = flow.starting_state(start, t), start.copy()
    motion = Motion(begun, flow.number_in(exact, phases), time=t)
    carried = carry(
        _NumberedAlike(flow, exact), motion, (t + duration,), keep=True, max_events=LARGEST_LOG,
        max_evaluations=MOST_EVALUATIONS,
    )  # fmt: skip
    check_finite(motion.y)
    log = carried.log
    if not carried.outcome.complete or log is None:
        raise WorkExceeded(carried.outcome.message)
    phases = exact.states[motion.state].phases
    rate = _AtTime(exact.rates(phases), exact, t + duration).values(motion.y)
    kept = _as_kept(exact, phases, t + duration)
    no_parameters = np.zeros((flow.size, 0))
    return Passage(
        start, kept.values(motion.y), no_parameters, no_parameters, kept.moving(rate), duration, log.time, log.length,
        log.state, log.y, log.event_time, log.event_contact, log.event_phase,
    )  # fmt: skip


class _AtTime:
    """Linear outputs of an exact flow at one time."""

    def __init__(self, output: LinearOutput, exact: ExactFlow, t: float) -> None:
        self.row = output.row
        by_input = np.hstack([output.direct, output.direct_slope])
        self._given, self._rising = exact.inputs_at(np.array([t]), orders=2)[0] @ by_input.T

    def values(self, y: Floats) -> Floats:
        """(k,) at a state (N,)."""
        return np.asarray(self.row @ y + self._given)

    def moving(self, rate: Floats) -> Floats:
        """(k,) time derivatives where the state has a rate (N,)."""
        return np.asarray(self.row @ rate + self._rising)


def _state(exact: ExactFlow) -> LinearOutput:
    output = exact.empty_output(exact.size)
    output.row[:] = np.eye(exact.size)
    return output


def _as_phases_have_it(exact: ExactFlow, phases: Ints, t: float) -> _AtTime:
    """The state with which a motion in given phases starts, from one near it: what is held rests, and internal states
    that are penetrations are these."""
    output, held = _state(exact), held_contacts(exact.system, phases)
    if held is not None:
        n = exact.system.size
        output.row[n : 2 * n, n : 2 * n] -= held.across @ held.across.T
    contact, _ = exact.system.contacts.kept(phases)
    return _AtTime(_with_penetrations(exact, output, contact, exact.penetrations[0].some(contact)), exact, t)


def _as_kept(exact: ExactFlow, phases: Ints, t: float) -> _AtTime:
    """The state from which `ExactFlow.begin` finds the phases again."""
    contacts, output = exact.system.contacts, _state(exact)
    contact, kept = contacts.kept(phases)
    if contact.size:
        written = exact.penetrations[0].some(contact)
        written.direct[:, 0] += kept[:, 0]
        if kept[:, 1].any():
            share = kept[:, 1:] * (contact[:, None] == contacts.pressed)
            written += exact.pressing_forces(phases).combined(share)
        output = _with_penetrations(exact, output, contact, written)
    return _AtTime(output, exact, t)


def _with_penetrations(exact: ExactFlow, output: LinearOutput, contact: Ints, written: LinearOutput) -> LinearOutput:
    place = 2 * exact.system.size + exact.system.contacts.arrays.first[contact]
    output.row[place], output.direct[place] = written.row, written.direct
    output.direct_slope[place] = written.direct_slope
    return output


def _by_start(exact: ExactFlow, passage: Passage) -> Floats:
    """The transition matrix: the product over segments and events.

    At an event with the reset R, ``S+ = R' (S- + f- dt) - f+ dt``, ``dt = -grad g S- / g'`` being the change of its
    time. Events that follow at the same instant, since the phase that one leads to does not last, move with it.
    """
    inputs, phases = exact.sources.count, exact.states[passage.state[0]].phases
    t = float(passage.time[0])
    S, moved = np.eye(exact.size), np.zeros(exact.size)
    if exact.system.contacts.jointly_acting:
        S = _as_phases_have_it(exact, phases, t).row
    event = 0
    for g, (begin, length, index) in enumerate(zip(passage.time, passage.length, passage.state, strict=True)):
        S = transition(exact.states[index], inputs, length) @ S
        t = float(begin + length)
        if g + 1 < passage.time.size and passage.state[g + 1] != index:
            happening = _Event.of(
                exact, exact.states[index].phases, int(passage.event_contact[event]), int(passage.event_phase[event]),
                segment_end(exact, passage, g), t,
            )  # fmt: skip
            event += 1
            if length > 0.0 or g == 0:
                moved = happening.moved(S)
            S = happening.carried(S, moved)
    return np.asarray(_as_kept(exact, exact.states[passage.state[-1]].phases, t).row @ S)


@dataclass(frozen=True)
class _Event:
    """What happens to the state where a contact changes its phase."""

    gradient: Floats  # (N,) of the guard
    rate: float  # of the guard, 1/s times its unit
    reset: Floats  # (N, N) derivative of the state after the event by that before
    jump: Floats  # (N,) rate just before, carried over by the reset, less the rate after

    @classmethod
    def of(cls, exact: ExactFlow, before: Ints, j: int, after: int, y: Floats, t: float) -> _Event:
        """The event that takes contact ``j`` from its phase in ``before`` to ``after``, at a state (N,) and time."""
        contacts, n = exact.system.contacts, exact.system.size
        watched = contacts.watched(before)
        leads = (watched.contact[: watched.guards] == j) & (watched.following == after)
        guard = int(np.flatnonzero(leads)[0])
        functions = exact.watched(watched, before)
        following = contacts.after(before, j, after)
        flown, onwards = (exact.rates(phases) for phases in (before, following))
        rate = _AtTime(flown, exact, t).values(y)
        state = _state(exact)
        if watched.reset[guard] >= 0:
            first, count = int(watched.reset[guard]), int(contacts.arrays.states[j])
            place = slice(2 * n + int(contacts.arrays.first[j]), 2 * n + int(contacts.arrays.first[j]) + count)
            fresh = functions.some(first + np.arange(count))
            state.row[place], state.direct[place], state.direct_slope[place] = (
                fresh.row, fresh.direct, fresh.direct_slope
            )  # fmt: skip
        begun = _AtTime(state, exact, t)
        started = begun.values(y)
        jump = begun.moving(rate) - _AtTime(onwards, exact, t).values(started)
        size = np.abs(state.row) @ (np.abs(flown.row) @ np.abs(y)) + np.abs(onwards.row) @ np.abs(started)
        jump[np.abs(jump) <= ROUND_OFF * size] = 0.0
        watch = _AtTime(functions.some(np.array([guard])), exact, t)
        return cls(watch.row[0], float(watch.moving(rate)[0]), begun.row, jump)

    def moved(self, S: Floats) -> Floats:
        """(N,) change of the event's time with the columns of S; none of one that begins at rest."""
        return np.asarray(-(self.gradient @ S) / self.rate if self.rate else np.zeros(S.shape[1]))

    def carried(self, S: Floats, moved: Floats) -> Floats:
        """The sensitivity after the event, whose time changes by ``moved``."""
        return np.asarray(self.reset @ S + np.outer(self.jump, moved))


def segment_end(exact: ExactFlow, passage: Passage, g: int) -> Floats:
    """(N,) the state where a segment ends, before the event there."""
    part = slice(g, g + 1)
    piece = np.maximum(np.searchsorted(exact.sources.start, passage.time[part], side="right") - 1, 0)
    state = exact.states[int(passage.state[g])]
    zeta = state.amplitudes(exact.sources.amplitudes_at(passage.time[part], piece), passage.y[part])
    return np.asarray(state.states_after(zeta, passage.length[part])[0])


def _by_parameter(flow: SeriesFlow, p: Parameter, start: Floats, duration: float, t: float) -> Floats:
    """A central difference of two passages."""
    if isinstance(p, Direction):
        return flow.by_difference(start, duration, p, t)
    if not isinstance(p, Frequency | Level):
        raise TypeError(f"no derivative by {type(p).__name__}")
    h = DIFFERENCE * (flow.omega if isinstance(p, Frequency) else max(abs(flow.level), 1e-9))
    ends = []
    for step in (h, -h):
        by_frequency = isinstance(p, Frequency)
        other = flow.under(flow.omega + step * by_frequency, flow.level + step * (not by_frequency))
        ends.append(_motion(other, other.by_series(), start, duration, t).end)
    return np.asarray((ends[0] - ends[1]) / (2 * h))
