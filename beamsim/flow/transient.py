"""The exact transient, without time-stepping error: the march from contact to contact, at once or in stretches.

The latest stretch and the states at checkpoints are kept. What is asked for later is marched again from the checkpoint
before it, with the same bits, since a checkpoint is where a piece begins, where a segment begins in any case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import Log, March, Motion
from beamsim.flow.processor_time import processor_time
from beamsim.flow.trajectory import Trajectory
from beamsim.outcomes import never
from beamsim.typing import Bools, Floats, Ints


def simulate(
    flow: ExactFlow,
    initial_state: Floats,
    *,
    duration: float | None = None,
    max_events: int = 1_000_000,
    max_evaluations: int = 2_000_000_000,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> Trajectory:
    """The motion from a state at t = 0, (q, q') and any internal states of the contacts, without time-stepping error.

    Contacts are found by the certified march of :mod:`beamsim.flow.kernels`. The work is bounded: a motion
    with more than ``max_events`` events or ``max_evaluations`` evaluations of the watched functions ends early,
    with an outcome that says so, as does one that ``stop`` ends, which is asked several times a second.

    A contact that begins at t = 0, where its gap is just closed, is the first event. One that is pressed there was in
    contact before and has none.

    Parameters
    ----------
    flow : the system under its forcing.
    initial_state : (2n,) at least; internal states that are left out are zero.
    duration : s; that of the flow by default.
    max_events, max_evaluations : where it ends early.
    progress : called with the share that is done.
    stop : asked whether to end.

    Returns
    -------
    Trajectory : segments and events; sample it for outputs.
    """
    end = float(flow.duration if duration is None else duration)
    march = March(
        max_events=max_events, max_evaluations=max_evaluations, stop=stop,
        progress=None if progress is None else lambda t: progress(t / end),
    )  # fmt: skip
    motion, begun = start(flow, initial_state)
    return motion_of(flow, motion, Log.join([begun, march.on(flow, motion, end)]), march)


def start(flow: ExactFlow, initial_state: Floats) -> tuple[Motion, Log]:
    """A motion at t = 0, and the events of the contacts that begin at this very time."""
    y = flow.whole_state(np.asarray(initial_state, dtype=float))
    phases, entered, y = flow.begin(y)
    first = np.flatnonzero(entered)
    begun = Log.sized(0, y.size)._replace(
        event_time=np.zeros(first.size), event_contact=first, event_phase=phases[first]
    )  # fmt: skip
    return Motion.beginning(y, flow.state_index(phases)), begun


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
    if not log.time.size:  # out of budget within the first segment: at least the start is known
        one = np.zeros(1, dtype=np.int64)
        log = log._replace(
            time=np.array([motion.time]), length=np.zeros(1), state=flow.visits(one + motion.state), piece=one,
            y=motion.y[None, :].copy(),
        )  # fmt: skip
    trajectory = Trajectory(flow, motion.time, *log, motion.y, march.evaluations, march.outcome)
    return trajectory if np.all(np.isfinite(motion.y)) else trajectory.up_to_finite()


CHECKPOINT_PIECES = 4096  # between two checkpoints


class MotionInStretches(March):
    """A motion from a state at t = 0 to the end of its flow.

    Parameters
    ----------
    flow : of the whole motion; where it is taken in stretches, on the first pieces of a record of which all its inputs
        are made, see `beamsim.inputs.signal`.
    initial_state : at t = 0.
    pieces_at_once : of the record in a stretch; by default the whole motion is one.
    max_events, progress, stop : see `beamsim.flow.transient.simulate`.
    """

    def __init__(
        self,
        flow: ExactFlow,
        initial_state: Floats,
        pieces_at_once: int | None = None,
        *,
        max_events: int = 1_000_000,
        progress: Callable[[float], None] | None = None,
        stop: Callable[[], bool] = never,
    ) -> None:
        begin = processor_time()
        told = None if progress is None else lambda time: progress(time / flow.duration)
        super().__init__(max_events=max_events, progress=told, stop=stop)
        self.flow, self.one_stretch = flow, pieces_at_once is None
        self._step, self._pieces, self._at_once = flow.duration, 1, 1  # a motion of one stretch is one piece
        if pieces_at_once is not None:
            assert flow.record is not None
            self._step = flow.record.step
            self._pieces = int(np.ceil(flow.duration / self._step - 1e-9))
            self._at_once = max(pieces_at_once // CHECKPOINT_PIECES, 1) * CHECKPOINT_PIECES
        motion, self._begun = start(flow, initial_state)
        self._first_phases = flow.visited[int(flow.visits(np.array([motion.state]))[0])]
        self._checkpoints, self._motion = [motion.copy()], motion
        none = np.zeros(flow.system.contacts.count)
        self._shares: list[tuple[float, float, Floats]] = [(0.0, 0.0, none)]  # end, s, length, s, and (m,) in contact
        self._events: list[Log] = []
        self._latest: Trajectory | None = None
        self.processor_time_s = processor_time() - begin

    @property
    def end(self) -> float:
        """s, reached."""
        return self._motion.time

    @property
    def stretch_s(self) -> float:
        """Length of a stretch, s."""
        return self._at_once * self._step

    def stretches(self) -> Iterator[Trajectory]:
        """March, stretch by stretch."""
        for first in range(0, self._pieces, self._at_once):
            begin = processor_time()
            stretch = self._march(first, min(first + self._at_once, self._pieces))
            self.processor_time_s += processor_time() - begin
            self.outcome, self._latest = stretch.outcome, stretch
            if stretch.length.sum() > 0 or first == 0:
                yield stretch
            if not self.outcome.complete:
                return

    def _march(self, first: int, last: int) -> Trajectory:
        """Go on to the piece ``last``, or to the end of the motion, and keep checkpoints on the way."""
        flow, motion, duration = self._on_pieces(first, last), self._motion, self.flow.duration
        stops = [k * self._step for k in range(first + CHECKPOINT_PIECES, last + 1, CHECKPOINT_PIECES)]
        if last == self._pieces:
            stops = [*(t for t in stops if t < duration), duration]
        parts = [self._begun] if first == 0 else []
        for end in stops:
            parts.append(self.on(flow, motion, end))
            if not self.outcome.complete or not np.all(np.isfinite(motion.y)):
                break
            self._checkpoints.append(motion.copy())
        stretch = motion_of(flow, motion.copy(), Log.join(parts), self)
        if not stretch.outcome.complete:
            motion.time = stretch.end
        self._events.append(_events_of(stretch))
        self._shares.append((stretch.end, float(stretch.length.sum()), stretch.contact_share()))
        return stretch

    def _on_pieces(self, first: int, last: int) -> ExactFlow:
        """The flow on some of the pieces, the first of which the motion is to go on with."""
        if self.one_stretch:
            return self.flow
        self._motion.piece = 0
        return self.flow.on_pieces(first, last + 1)

    def within(self, begin: float, end: float) -> Trajectory:
        """The segments of a part of the motion; see `beamsim.flow.trajectory.Trajectory.within`.

        Parameters
        ----------
        begin, end : s; what is not part of the latest stretch is marched again.
        """
        latest = self._latest
        if latest is None or (not self.one_stretch and (begin < latest.time[0] or end > latest.end)):
            latest = self._latest = self._again(begin, end)
        whole = begin <= float(latest.time[0]) and end >= latest.end
        return latest if whole else latest.within(begin, end)

    def again(self) -> Iterator[Trajectory]:
        """The motion that was reached, stretch by stretch; what is not kept is marched again."""
        for first in range(0, self._pieces, self._at_once):
            if first and first * self._step >= self.end:
                return
            yield self.within(first * self._step, min((first + self._at_once) * self._step, self.end))

    def _again(self, begin: float, end: float) -> Trajectory:
        """From the checkpoint before a time to the end of the piece in which another one is."""
        at = max(int(np.searchsorted([point.time for point in self._checkpoints], begin, side="right")) - 1, 0)
        first = at * CHECKPOINT_PIECES
        last = min(max(int(np.ceil(end / self._step - 1e-9)) + 1, first + 1), self._pieces)
        flow, motion = self.flow.on_pieces(first, last + 1), self._checkpoints[at].copy()
        motion.piece = 0
        march = March(max_events=10**9, max_evaluations=10**12)
        return motion_of(flow, motion, march.on(flow, motion, min(last * self._step, self.end)), march)

    def sample(self, times: Floats, output_of: OutputOf) -> Floats:
        """Outputs (nt, k) at increasing times; at an event the state after it counts."""
        count = output_of(self.flow.system.contacts.start).row.shape[0]
        out, first = np.empty((times.size, count)), 0
        while first < times.size:
            begin = float(times[first])
            last = max(int(np.searchsorted(times, begin + self.stretch_s, side="right")), first + 1)
            out[first:last] = self.within(begin, float(times[last - 1])).sample(times[first:last], output_of)
            first = last
        return out

    def states_at(self, times: Floats) -> Floats:
        """(nt, N) the state: (q, q') and the contacts' internal states."""
        return np.concatenate([self.within(t, t).states_at(np.array([t])) for t in times])

    @property
    def log_of_events(self) -> Log:
        """All events, no segments."""
        return Log.join(self._events)

    @property
    def touch_changes(self) -> Ints:
        """(E,) 1 where contact is made, -1 where it ends, 0 at other changes of phase."""
        log, contacts = self.log_of_events, self.flow.system.contacts
        return contacts.touch_changes(self._first_phases, log.event_time, log.event_contact, log.event_phase)

    @property
    def event_time(self) -> Floats:
        """(E,) s."""
        return self.log_of_events.event_time

    @property
    def event_contact(self) -> Ints:
        """(E,)."""
        return self.log_of_events.event_contact

    @property
    def event_phase(self) -> Ints:
        """(E,) of the contact after the event."""
        return self.log_of_events.event_phase

    @property
    def event_closing(self) -> Bools:
        """(E,) whether contact is made at the event."""
        return np.asarray(self.touch_changes > 0)

    def contact_share(self) -> Floats:
        """(m,) share of the time during which each contact touches."""
        _, length, share = (np.array(column) for column in zip(*self._shares, strict=True))
        return np.asarray(length @ share / max(length.sum(), np.finfo(float).tiny))


def _events_of(stretch: Trajectory) -> Log:
    """The events alone; no part of an array that holds the segments too, which would keep it."""
    return Log.sized(0, stretch.y.shape[1], 0)._replace(
        event_time=stretch.event_time.copy(), event_contact=stretch.event_contact.copy(),
        event_phase=stretch.event_phase.copy(),
    )  # fmt: skip
