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
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

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
    matrix = _by_start(flow, exact, passage, t)
    columns = [_by_parameter(flow, p, start, duration, t) for p in parameters]
    by = np.array(columns).T if columns else np.zeros((start.size, 0))
    return replace(passage, transition=matrix, parameters=by)


def _motion(flow: SeriesFlow, exact: ExactFlow, start: Floats, duration: float, t: float) -> Passage:
    """The passage without its derivatives."""
    motion = Motion(start.copy(), flow.number_in(exact, flow.starting_state(start, t)), time=t)
    carried = carry(
        _NumberedAlike(flow, exact), motion, (t + duration,), keep=True, max_events=LARGEST_LOG,
        max_evaluations=MOST_EVALUATIONS,
    )  # fmt: skip
    check_finite(motion.y)
    log = carried.log
    if not carried.outcome.complete or log is None:
        raise WorkExceeded(carried.outcome.message)
    slope = _rate(flow, motion.y, exact.states[motion.state].phases, t + duration)
    no_parameters = np.zeros((flow.size, 0))
    return Passage(
        start, motion.y, no_parameters, no_parameters, slope, duration, log.time, log.length, log.state, log.y,
        log.event_time, log.event_contact, log.event_phase,
    )  # fmt: skip


def _rate(flow: SeriesFlow, y: Floats, phases: Ints, t: float) -> Floats:
    """Time derivative of the state in given phases."""
    s, c, n = flow.system, flow.system.contacts, flow.system.size
    delta, rate = _penetration(flow, y, t)
    phase = np.exp(1j * flow.loads.multiple * flow.omega * t)
    load = s.constant_load + (flow.loads.at(flow.omega, flow.level)[0] * phase[:, None]).sum(axis=0).real
    push = (c.sign * c.forces(phases[None], delta[None], rate[None], y[None, 2 * n :])[0]) @ c.shape
    free, drive = c.internal_rates(phases)
    inside = free @ y[2 * n :] + drive[:, :, 0] @ delta + drive[:, :, 1] @ rate + drive[:, :, 2].sum(axis=1)
    acceleration = load + push - s.stiffness * y[:n] - s.damping @ y[n : 2 * n]
    return np.concatenate([y[n : 2 * n], acceleration, inside])


def _penetration(flow: SeriesFlow, y: Floats, t: float) -> tuple[Floats, Floats]:
    c, n = flow.system.contacts, flow.system.size
    d, v = flow.base_motion(t)
    delta = -c.gap - c.sign * (c.shape @ y[:n] + c.felt * d)
    return delta, -c.sign * (c.shape @ y[n : 2 * n] + c.felt * v)


def _by_start(flow: SeriesFlow, exact: ExactFlow, passage: Passage, t: float) -> Floats:
    """The transition matrix: the product over segments and events."""
    N, inputs = flow.size, exact.sources.count
    S = np.eye(N)
    event = 0
    for g, (begin, length, index) in enumerate(zip(passage.time, passage.length, passage.state, strict=True)):
        S = transition(exact.states[index], inputs, length) @ S
        if g + 1 < passage.time.size and passage.state[g + 1] != index:
            before = exact.states[index].phases
            j, after = passage.event_contact[event], passage.event_phase[event]
            event += 1
            y = segment_end(exact, passage, g)
            S = _saltation(flow, before, int(j), int(after), y, begin + length) @ S
    return S


def segment_end(exact: ExactFlow, passage: Passage, g: int) -> Floats:
    """(N,) the state where a segment ends, before the event there."""
    part = slice(g, g + 1)
    piece = np.maximum(np.searchsorted(exact.sources.start, passage.time[part], side="right") - 1, 0)
    state = exact.states[int(passage.state[g])]
    zeta = state.amplitudes(exact.sources.amplitudes_at(passage.time[part], piece), passage.y[part])
    return np.asarray(state.states_after(zeta, passage.length[part])[0])


def _saltation(flow: SeriesFlow, before: Ints, j: int, after: int, y: Floats, t: float) -> Floats:
    """What an event does to small changes of the state just before it."""
    c, n, N, a = flow.system.contacts, flow.system.size, flow.size, flow.system.contacts.arrays
    guard = next(i for i in range(a.guards[j, before[j]]) if a.next[j, before[j], i] == after)
    r, first = int(a.states[j]), 2 * n + int(a.first[j])
    rate_before = _rate(flow, y, before, t)
    rows = np.zeros((3 + r, N))  # the contact's penetration, its rate, 1 and internal states by the state
    rows[0, :n] = rows[1, n : 2 * n] = -c.sign[j] * c.shape[j]
    rows[3:, first : first + r] = np.eye(r)
    _, speed = _penetration(flow, y, t)
    moving = rows @ rate_before
    if c.felt[j] and flow.loads.count:
        iw = 1j * flow.loads.multiple * flow.omega
        base = flow.loads.at(flow.omega, flow.level)[1] * np.exp(iw * t)
        moving[0] = speed[j]
        moving[1] -= c.sign[j] * c.felt[j] * float((iw**2 * base).sum().real)
    delta, rate = _penetration(flow, y, t)
    motion = np.concatenate([[delta[j], rate[j], 1.0], y[first : first + r]])
    gradient = a.guard[j, before[j], guard, : 3 + r] @ rows
    gdot = float(a.guard[j, before[j], guard, : 3 + r] @ moving)
    out = np.eye(N)
    jump = np.zeros(N)  # rate just before, carried over by the reset, less the rate after
    jump[n : 2 * n] = -c.sign[j] * c.shape[j] * float(a.jump[j, before[j], guard, : 3 + r] @ motion)
    if a.resets[j, before[j], guard]:
        reset = a.reset[j, before[j], guard, :r, : 3 + r]
        fresh = np.concatenate([motion[:3], reset @ motion])
        out[first : first + r] = reset @ rows
        jump[first : first + r] = reset @ moving - a.dynamics[j, after, :r, : 3 + r] @ fresh
    elif r:
        by_phase = a.dynamics[j, :, :r, : 3 + r] @ motion
        jump[first : first + r] = by_phase[before[j]] - by_phase[after]
    if gdot:
        out -= np.outer(jump, gradient / gdot)
    return out


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
