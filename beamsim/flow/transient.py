"""The exact transient, without time-stepping error: the march from contact to contact, as a whole or chunk by chunk.

Each chunk is marched once. Values of a motion that does not fit into the memory have to be computed from each chunk
while it is in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from beamsim.errors import MethodError
from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.kernels import BEGINNING, BUDGET, DONE, NEED_STATE, ONWARDS, STUCK, Position, march
from beamsim.flow.trajectory import Trajectory, too_many_events
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, check_stop, interruption, never
from beamsim.typing import Floats, Ints, not_none


class Log(NamedTuple):
    """Segments and events in order of time."""

    time: Floats  # (S,) start of each segment, s
    length: Floats  # (S,) s
    state: Ints  # (S,) contact state; in a joined log the number of the visited one
    piece: Ints  # (S,) of the sources
    y: Floats  # (S, N) at the start
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_before: Ints  # (E,) phase of the contact before the event
    event_phase: Ints  # (E,) after it

    @classmethod
    def sized(cls, segments: int, size: int, most_events: int | None = None) -> Log:
        """An empty log.

        Parameters
        ----------
        segments : room for them.
        size : N, of the state.
        most_events : room for events, at most one more than segments.

        Returns
        -------
        Arrays that are not filled in.
        """
        whole = np.int64
        events = segments + 1 if most_events is None else min(segments + 1, most_events)
        return cls(
            np.empty(segments), np.empty(segments), np.empty(segments, whole), np.empty(segments, whole),
            np.empty((segments, size)), np.empty(events), *(np.empty(events, whole) for _ in range(3)),
        )  # fmt: skip

    @classmethod
    def join(cls, logs: list[Log]) -> Log:
        """Logs joined in order."""
        return logs[0] if len(logs) == 1 else cls(*(np.concatenate(column) for column in zip(*logs, strict=True)))


@dataclass
class Motion:
    """State of a march, changed in place."""

    y: Floats  # (N,)
    state: int  # contact state
    guard: int = ONWARDS  # whose event is here, or ONWARDS, or BEGINNING of the motion
    time: float = 0.0  # s
    piece: int = 0  # of the sources
    awaits_state: bool = False  # the state after that event is not built

    def copy(self) -> Motion:
        """A copy that continues from here."""
        return replace(self, y=self.y.copy())

    def enter(self, flow: ExactFlow, previous: ExactFlow) -> None:
        """Continue in a flow with other loads, starting at its t = 0."""
        self.state = flow.state_index(previous.states[self.state].phases)
        self.time, self.piece = 0.0, 0


def too_many_evaluations(time: float, evaluations: int) -> Outcome:
    """The outcome of a motion that ended at a time, s, since so many evaluations did not suffice."""
    text = f"{evaluations} evaluations of the contact gaps do not suffice"
    return Outcome.of(OutcomeKind.STOPPED, "evaluation_limit", text, at=Where(time, "s"))


SEGMENTS_OF_REPORT = 2048  # between two reports of progress
EVALUATIONS_AT_ONCE = 50_000  # of the compiled march, between which it may be stopped: less than half a second
SPENT = 500_000  # evaluations, seconds of work, after which those of the whole motion are estimated
HOPELESS = 10.0  # times the evaluations that are allowed, beyond which a motion is not marched on
FEW_EVENTS = 20  # evaluations for each event; with more events than that contacts chatter, which comes to an end


@dataclass
class March:
    """The host loop around the compiled march, with limits on its work and counts of it.

    Parameters
    ----------
    max_events, max_evaluations : numbers of events and of evaluations of the guards, beyond which a motion ends early,
        with an outcome that says so.
    progress : called with the time reached, now and then and where a motion ends.
    stop : says whether to end, several times a second.
    refuses_hopeless : whether to refuse a motion that would need far more evaluations than are allowed.
    """

    max_events: int = field(default=1_000_000, kw_only=True)
    max_evaluations: int = field(default=2_000_000_000, kw_only=True)
    progress: Callable[[float], None] | None = field(default=None, kw_only=True)
    stop: Callable[[], bool] = field(default=never, kw_only=True)
    refuses_hopeless: bool = field(default=False, kw_only=True)
    segments: int = field(init=False, default=0)
    events: int = field(init=False, default=0)
    evaluations: int = field(init=False, default=0)
    outcome: Outcome = field(init=False, default=COMPLETE)
    processor_time_s: float = field(init=False, default=0.0)

    def on(self, flow: ExactFlow, motion: Motion, end: float) -> Log:
        """Carry a motion on, in place, with contact states built as they are visited.

        Parameters
        ----------
        flow, motion : the motion goes on in it.
        end : s.

        Returns
        -------
        Segments and events since; ``outcome`` says whether the end was reached.

        Raises
        ------
        MethodError
            About the ``duration``, where that is foreseen.
        """
        parts, code = [Log.sized(0, motion.y.size, 0)], None
        begin, before, events_before = motion.time, self.evaluations, self.events
        while self.outcome.complete and code != DONE:
            check_stop()
            log = Log.sized(SEGMENTS_OF_REPORT, motion.y.size, max(self.max_events + 1 - self.events, 0))
            most = min(self.max_evaluations - self.evaluations, EVALUATIONS_AT_ONCE)
            at = Position(motion.time, motion.piece, motion.state, motion.guard, motion.awaits_state)
            code, motion.time, motion.piece, motion.state, motion.guard, segments, events, evaluations = march(
                flow.tables(), flow.inputs, at, end, motion.y, log, most
            )
            self.segments, self.events = self.segments + segments, self.events + events
            self.evaluations += evaluations
            part = Log._make(column[: segments if k < 5 else events] for k, column in enumerate(log))
            parts.append(part._replace(state=flow.visit_numbers(part.state)))
            motion.awaits_state = code == NEED_STATE
            if motion.awaits_state:
                flow.follow(motion.state, motion.guard)
            if code == STUCK or (code == BUDGET and self.evaluations >= self.max_evaluations):
                self.outcome = too_many_evaluations(motion.time, self.evaluations)
            elif self.events > self.max_events:
                self.outcome = too_many_events(motion.time, self.max_events)
            elif self.stop():
                self.outcome = interruption(at=Where(motion.time, "s"))
            else:
                spent, passed = self.evaluations - before, self.events - events_before
                if spent > SPENT and passed * FEW_EVENTS < spent and self.refuses_hopeless:
                    self._refuse_hopeless(spent, (motion.time - begin) / (end - begin), end)
                if self.progress is not None:
                    self.progress(motion.time)
        return Log.join(parts)

    def _refuse_hopeless(self, evaluations: int, share: float, end: float) -> None:
        """Refuse a motion that would take many times as many evaluations as are allowed.

        Parameters
        ----------
        evaluations : evaluations of the guards up to now.
        share : of the motion, that they sufficed for.
        end : of the motion, s.
        """
        if share * self.max_evaluations * HOPELESS < evaluations:
            needed = f"about {evaluations / share:.0e}" if share > 0.0 else "countless"
            raise MethodError(
                "duration",
                f"= {end:g} s would take {needed} evaluations of the contact gaps, of which {self.max_evaluations:.0e} "
                "are allowed: some natural frequency, open or in contact, is very high",
                "check stiffnesses and masses, shorten the motion, or leave out high modes (reduction)",
            )


def simulate(
    flow: ExactFlow,
    initial_state: Floats,
    *,
    duration: float | None = None,
    max_events: int = 1_000_000,
    max_evaluations: int = 2_000_000_000,
) -> Trajectory:
    """The motion from a state at t = 0, (q, q') and any internal states of the contacts, without time-stepping error.

    Contacts are found by the certified march of :mod:`beamsim.flow.kernels`. The work is bounded: a motion
    with more than ``max_events`` events or ``max_evaluations`` evaluations of the event functions ends early,
    with an outcome that says so.

    A contact that is made at t = 0, where its gap is just closed, is the first event. One that touched before has none
    there; see `beamsim.flow.exact.StartOfMotion`.

    Parameters
    ----------
    flow : the system under its forcing.
    initial_state : (2n,) at least; internal states that are left out are zero.
    duration : s; that of the flow by default.
    max_events, max_evaluations : where it ends early.

    Returns
    -------
    Trajectory : segments and events; sample it for outputs.
    """
    end = float(flow.duration if duration is None else duration)
    march = March(max_events=max_events, max_evaluations=max_evaluations)
    motion, begun = start(flow, initial_state)
    return motion_of(flow, motion, Log.join([begun, march.on(flow, motion, end)]), march)


def start(flow: ExactFlow, initial_state: Floats) -> tuple[Motion, Log]:
    """A motion at t = 0, and the events of contacts that close at t = 0."""
    y = np.asarray(initial_state, dtype=float)
    y = np.pad(y, (0, flow.size - y.size))
    begin = flow.begin(y)
    first = np.flatnonzero(begin.contact_made)
    begun = Log.sized(0, y.size)._replace(
        event_time=np.zeros(first.size), event_contact=first, event_before=begin.phases_before[first],
        event_phase=begin.phases[first],
    )  # fmt: skip
    return Motion(begin.state, flow.state_index(begin.phases), BEGINNING), begun


def _log_of_start(flow: ExactFlow, motion: Motion, log: Log) -> Log:
    """A log with one segment of zero length at the present state."""
    one = np.zeros(1, dtype=np.int64)
    return log._replace(
        time=np.array([motion.time]), length=np.zeros(1), state=flow.visit_numbers(one + motion.state), piece=one,
        y=motion.y[None, :].copy(),
    )  # fmt: skip


def motion_of(flow: ExactFlow, motion: Motion, log: Log, march: March) -> Trajectory:
    """The trajectory of a motion up to where it got.

    Parameters
    ----------
    flow, motion : the motion after the march.
    log : its segments and events.
    march : how it ended, and what it took.

    Returns
    -------
    The motion up to its end, or up to where it leaves the range of floating-point numbers.
    """
    if not log.time.size:  # the work ended within the first segment: only the start is known
        log = _log_of_start(flow, motion, log)
    trajectory = Trajectory(flow, motion.time, *log, motion.y.copy(), march.evaluations, march.outcome)
    return trajectory if np.all(np.isfinite(motion.y)) else trajectory.up_to_finite()


@dataclass
class MotionInChunks(March):
    """A motion from a state at t = 0 to the end of its flow.

    Parameters
    ----------
    flow : of the whole motion; where it is taken in chunks, on the first pieces of a record of which all its inputs
        are made, see `beamsim.inputs.signal`.
    initial_state : at t = 0.
    pieces_at_once : of the record in a chunk; by default the whole motion is one.
    progress : called with the share of the motion that is done.
    """

    flow: ExactFlow
    initial_state: Floats
    pieces_at_once: int | None = None
    refuses_hopeless: bool = field(default=True, kw_only=True)
    one_chunk: bool = field(init=False)
    chunk_s: float = field(init=False)  # s, length of a chunk
    end: float = field(init=False, default=0.0)  # s, reached
    # known after the last chunk
    event_time: Floats = field(init=False)  # (E,) s
    event_contact: Ints = field(init=False)  # (E,)
    event_phase: Ints = field(init=False)  # (E,) of the contact after the event
    touch_changes: Ints = field(init=False)  # (E,) 1 where contact is made, -1 where it ends, 0 at other changes
    contact_share: Floats = field(init=False)  # (m,) share of the time during which each contact touches
    states: int = field(init=False)  # number of contact states visited

    def __post_init__(self) -> None:
        self.one_chunk = self.pieces_at_once is None
        self._step, self._at_once = self.flow.duration, 1  # a motion of one chunk is one piece
        if self.pieces_at_once is not None:
            self._step, self._at_once = not_none(self.flow.record).step, self.pieces_at_once
        self.chunk_s = self._at_once * self._step
        report = self.progress
        if report is not None:
            self.progress = lambda time: report(time / self.flow.duration)

    def chunks(self) -> Iterator[Trajectory]:
        """March, chunk by chunk, once."""
        begin, flow, duration = processor_time(), self.flow, self.flow.duration
        parts: list[tuple[Any, ...]] = []
        motion, begun = start(flow, self.initial_state)
        pieces = 1 if self.one_chunk else int(np.ceil(duration / self._step - 1e-9))
        for first in range(0, pieces, self._at_once):
            last = min(first + self._at_once, pieces)
            if not self.one_chunk:
                flow, motion.piece = self.flow.on_pieces(first, last + 1), 0
            log = self.on(flow, motion, duration if last == pieces else last * self._step)
            self._latest = motion_of(flow, motion, Log.join([begun, log]) if first == 0 else log, self)
            self.outcome, self.end = self._latest.outcome, self._latest.end
            self.processor_time_s += processor_time() - begin
            if not self.outcome.complete and self.progress is not None:
                self.progress(duration)  # nothing of the march remains to be done
            if first == 0 or self._latest.length.any():
                yield self._latest
            begin, part = processor_time(), self._latest
            of_events = part.event_time, part.event_contact, part.event_before, part.event_phase
            parts.append((float(part.length.sum()), part.contact_share(), *of_events))
            if not self.outcome.complete:
                break
        length, share, *events = zip(*parts, strict=True)
        self.contact_share = np.array(length) @ np.array(share) / max(sum(length), np.finfo(float).tiny)
        self.event_time, self.event_contact, before, self.event_phase = map(np.concatenate, events)
        self.touch_changes = flow.system.contacts.touch_changes(self.event_contact, before, self.event_phase)
        self.states = len(flow.visited_phases)

    def end_with(self, part: Trajectory) -> None:
        """Discard the motion after the first part of the latest chunk, since the evaluation ended there."""
        self.outcome, self.end, self._latest = interruption(at=Where(part.end, "s")), part.end, part
