"""Motions of so many pieces of the inputs that they are not kept: marched in stretches, each evaluated and forgotten.

The states at checkpoints are kept. What is asked for later is marched again from the checkpoint before it, with the
same bits, since a checkpoint is where a piece begins, where a segment begins in any case.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.flow.contact_state import OutputOf
from beamsim.flow.march import Carried, Log, carry
from beamsim.flow.stopping import never
from beamsim.flow.transient import motion_of, start
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.typing import Bools, Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.exact import ExactFlow
    from beamsim.flow.trajectory import Trajectory

CHECKPOINT_PIECES = 4096  # between two checkpoints


class LongMotion:
    """A motion under inputs that are made of one record, see `beamsim.inputs.streamed`.

    Parameters
    ----------
    flow : on the first pieces of the record.
    initial_state : at t = 0.
    pieces_at_once : of a stretch.
    max_events, progress, stop : see `beamsim.flow.transient.simulate`.
    """

    def __init__(
        self,
        flow: ExactFlow,
        initial_state: Floats,
        pieces_at_once: int,
        *,
        max_events: int = 1_000_000,
        progress: Callable[[float], None] | None = None,
        stop: Callable[[], bool] = never,
    ) -> None:
        record = flow.record
        assert record is not None
        self.flow, self.record, self.outcome = flow, record, COMPLETE
        self.pieces_at_once = max(pieces_at_once // CHECKPOINT_PIECES, 1) * CHECKPOINT_PIECES
        motion, self._begun = start(flow, initial_state)
        self._first_phases = flow.visited[int(flow.visits(np.array([motion.state]))[0])]
        self._checkpoints, self._motion = [motion.copy()], motion
        self._max_events, self._progress, self._stop = max_events, progress, stop
        self._durations: list[tuple[float, Floats]] = []  # of each stretch its end and, (visited,), s in contact states
        self._events = [self._begun]
        self._latest: tuple[int, int, Trajectory] | None = None
        self.evaluations = self.segments = 0
        self.processor_time_s = 0.0

    @property
    def end(self) -> float:
        """s, reached."""
        return self._motion.time

    @property
    def stretch_s(self) -> float:
        """Length of a stretch, s."""
        return self.pieces_at_once * self.record.step

    def stretches(self) -> Iterator[Trajectory]:
        """March, stretch by stretch."""
        pieces = int(np.ceil(self.flow.duration / self.record.step - 1e-9))
        for first in range(0, pieces, self.pieces_at_once):
            last = min(first + self.pieces_at_once, pieces)
            begin = clock.process_time()
            stretch = self._march(first, last, last == pieces)
            self.processor_time_s += clock.process_time() - begin
            self.outcome = stretch.outcome
            if stretch.length.sum() > 0 or first == 0:
                yield stretch
            if not self.outcome.complete:
                return

    def _march(self, first: int, last: int, ends: bool) -> Trajectory:
        """Go on to the piece ``last``, or to the end of the motion, and keep checkpoints on the way."""
        flow, motion = self.flow.on_pieces(first, last + 1), self._motion
        motion.piece = 0
        parts, events = [], sum(part.event_time.size for part in self._events)
        stops = [*(k * self.record.step for k in range(first + CHECKPOINT_PIECES, last + 1, CHECKPOINT_PIECES))]
        if ends and (not stops or stops[-1] < flow.duration):
            stops = [*(t for t in stops if t < flow.duration), flow.duration]
        carried = Carried(None, 0, 0, 0, COMPLETE)
        for end in stops:
            carried = carry(
                flow, motion, (end,), keep=True, max_events=self._max_events - events, max_evaluations=2_000_000_000,
                stop=self._stop,
            )  # fmt: skip
            assert carried.log is not None
            parts.append(carried.log)
            events += carried.events
            self.evaluations += carried.evaluations
            self.segments += carried.segments
            if not carried.outcome.complete or not np.all(np.isfinite(motion.y)):
                break
            self._checkpoints.append(motion.copy())
            if self._progress is not None:
                self._progress(motion.time / flow.duration)
        whole = replace(carried, log=Log.join(parts))
        begun = self._begun if first == 0 else Log.sized(0, motion.y.size, 0)
        stretch = motion_of(flow, motion.copy(), begun, whole, 0.0)
        if not stretch.outcome.complete:
            motion.time = stretch.end
        if stretch.outcome.code is OutcomeCode.EVENT_LIMIT:
            stretch = replace(stretch, outcome=stretch.outcome.but(events=events))
        self._events.append(_events_of(whole.log))
        self._durations.append((stretch.end, np.bincount(stretch.state, stretch.length).astype(float)))
        return stretch

    def cut(self, end: float) -> None:
        """Forget what is after a checkpoint's time, where the evaluation was interrupted."""
        kept = [point for point in self._checkpoints if point.time <= end]
        self._checkpoints, self._motion = kept, kept[-1].copy()
        self._events = [_before(part, end) for part in self._events]
        self._durations = [(at, durations) for at, durations in self._durations if at <= end]
        self.outcome = Outcome.of(OutcomeCode.INTERRUPTED, parameter=self.end, unit="s")

    def within(self, begin: float, end: float) -> Trajectory:
        """The segments of a part of the motion, marched again; see `beamsim.flow.trajectory.Trajectory.within`."""
        times = np.array([point.time for point in self._checkpoints])
        at = max(int(np.searchsorted(times, begin, side="right")) - 1, 0)
        first = at * CHECKPOINT_PIECES
        last = min(max(int(np.ceil(end / self.record.step - 1e-9)) + 1, first + 1), self.record.pieces - 1)
        if self._latest is None or self._latest[:2] != (first, last):
            self._latest = first, last, self._again(at, first, last)
        return self._latest[2].within(begin, end)

    def again(self) -> Iterator[Trajectory]:
        """The motion that was reached, stretch by stretch, marched again."""
        for first in range(0, self.record.pieces - 1, self.pieces_at_once):
            begin = float(self.record.start(first, first + 1)[0])
            if begin >= self.end:
                return
            last = min(first + self.pieces_at_once, self.record.pieces - 1)
            yield self.within(begin, min(float(self.record.start(last, last + 1)[0]), self.end))

    def _again(self, checkpoint: int, first: int, last: int) -> Trajectory:
        flow, motion = self.flow.on_pieces(first, last + 1), self._checkpoints[checkpoint].copy()
        motion.piece = 0
        end = min(last * self.record.step, self.end)
        carried = carry(flow, motion, (end,), keep=True, max_events=10**9, max_evaluations=10**12)
        return motion_of(flow, motion, Log.sized(0, motion.y.size, 0), carried, 0.0)

    def sample(self, times: Floats, output_of: OutputOf) -> Floats:
        """Outputs (nt, k) at increasing times; at an event the state after it counts."""
        count = output_of(self.flow.system.contacts.start).row.shape[0]
        out, first = np.empty((times.size, count)), 0
        while first < times.size:
            begin = float(times[first])
            last = max(int(np.searchsorted(times, begin + self.stretch_s)), first + 1)
            out[first:last] = self.within(begin, float(times[last - 1])).sample(times[first:last], output_of)
            first = last
        return out

    def states_at(self, times: Floats) -> Floats:
        """(nt, N) the state: (q, q') and the contacts' internal states."""
        return np.concatenate([self.within(t, t).states_at(np.array([t])) for t in times])

    @property
    def events(self) -> Log:
        """All events, no segments."""
        return Log.join(self._events)

    @property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        log, contacts = self.events, self.flow.system.contacts
        return contacts.touch_changes(self._first_phases, log.event_time, log.event_contact, log.event_phase)

    @property
    def event_time(self) -> Floats:
        """(E,) s."""
        return self.events.event_time

    @property
    def event_contact(self) -> Ints:
        """(E,)."""
        return self.events.event_contact

    @property
    def event_phase(self) -> Ints:
        """(E,) of the contact after the event."""
        return self.events.event_phase

    @property
    def event_closing(self) -> Bools:
        """(E,) whether contact is made at the event."""
        return np.asarray(self.touch_changes > 0)

    def contact_share(self) -> Floats:
        """(m,) share of the time during which each contact touches."""
        flags = self.flow.system.contacts.touching(np.array(self.flow.visited, dtype=np.int64)).astype(float)
        total = sum((float(durations.sum()) for _, durations in self._durations), 0.0)
        in_contact = np.zeros(flags.shape[1])
        for _, durations in self._durations:
            in_contact += durations @ flags[: durations.size]
        return in_contact / total if total > 0 else in_contact


def _events_of(log: Log | None) -> Log:
    """The events alone; no part of an array that holds the segments too, which would keep it."""
    assert log is not None
    events = {name: getattr(log, name).copy() for name in ("event_time", "event_contact", "event_phase")}
    return Log.sized(0, log.y.shape[1], 0)._replace(**events)


def _before(log: Log, end: float) -> Log:
    kept = log.event_time < end
    return log._replace(
        event_time=log.event_time[kept], event_contact=log.event_contact[kept], event_phase=log.event_phase[kept]
    )  # fmt: skip
