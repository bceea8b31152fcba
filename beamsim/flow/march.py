"""The march from event to event: the host loop around the compiled one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.kernels import BEGINNING, BUDGET, DONE, NEED_STATE, STUCK, Position, march
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where, interruption, never
from beamsim.typing import Floats, Ints

EVENT_LIMIT, NOT_FINITE = "event_limit", "not_finite"


def too_many_events(time: float, events: int) -> Outcome:
    """The outcome of a motion that has more than the largest number of contact events at a time in s."""
    sentence = f"there are more than {events} contact events"
    return Outcome.of(OutcomeKind.STOPPED, EVENT_LIMIT, sentence, at=Where(time, "s"), events=events)


def not_finite(time: float) -> Outcome:
    """The outcome of a motion that cannot be represented after a time in s."""
    return Outcome.of(
        OutcomeKind.STOPPED, NOT_FINITE, "the motion leaves the range of floating-point numbers", at=Where(time, "s"),
        remedy="check the initial motion and the size of the loads",
    )  # fmt: skip


class Log(NamedTuple):
    """Segments and events in order of time."""

    time: Floats  # (S,) start of each segment, s
    length: Floats  # (S,) s
    state: Ints  # (S,) contact state; in a joined log the number of the visited one
    piece: Ints  # (S,) of the sources
    y: Floats  # (S, N) at the start
    event_time: Floats  # (E,) s
    event_contact: Ints  # (E,)
    event_phase: Ints  # (E,) of the contact after the event

    @classmethod
    def sized(cls, segments: int, size: int, most_events: int | None = None) -> Log:
        """An empty log; with a size of zero nothing is kept.

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
            np.empty((segments, size)), np.empty(events), np.empty(events, whole), np.empty(events, whole),
        )  # fmt: skip

    def first(self, segments: int, events: int) -> Log:
        """The part that is filled."""
        return Log(
            self.time[:segments], self.length[:segments], self.state[:segments], self.piece[:segments],
            self.y[:segments], self.event_time[:events], self.event_contact[:events], self.event_phase[:events],
        )  # fmt: skip

    @classmethod
    def join(cls, parts: list[Log]) -> Log:
        """Logs joined in order."""
        return parts[0] if len(parts) == 1 else cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@dataclass
class Motion:
    """A state that is carried along in place."""

    y: Floats  # (N,)
    state: int  # contact state
    guard: int = -1  # whose event is here; -1: none, or see `beginning`
    time: float = 0.0  # s
    piece: int = 0  # of the sources
    waits: bool = False  # the state after that event is not built

    @classmethod
    def beginning(cls, y: Floats, state: int) -> Motion:
        """A motion at t = 0, with the state of `ExactFlow.begin`."""
        return cls(y, state, BEGINNING)

    def copy(self) -> Motion:
        """A copy that continues from here."""
        return replace(self, y=self.y.copy())

    def enter(self, flow: ExactFlow, before: ExactFlow) -> None:
        """Go on in a flow under other loads, from its own time 0."""
        self.state = flow.state_index(before.states[self.state].phases)
        self.time, self.piece = 0.0, 0

    def advance(self, flow: ExactFlow, end: float, log: Log, most_evaluations: int) -> tuple[int, int, int, int]:
        """One call of the compiled march.

        Parameters
        ----------
        flow : whose contact states are visited.
        end : s.
        log : takes segments and events.
        most_evaluations : of the guards.

        Returns
        -------
        status, segments, events, evaluations : see `beamsim.flow.kernels.march`.
        """
        code, self.time, self.piece, self.state, self.guard, segments, events, evaluations = march(
            flow.tables(), flow.inputs(),
            Position(self.time, self.piece, self.state, self.guard, self.waits), end, self.y, log, most_evaluations,
        )  # fmt: skip
        self.waits = code == NEED_STATE
        return code, segments, events, evaluations


@dataclass
class March:
    """The host loop around the compiled march: what it may take, and what it took.

    Parameters
    ----------
    max_events, max_evaluations : numbers of events and of evaluations of the guards, beyond which a motion ends early,
        with an outcome that says so.
    progress : called with the time reached, now and then and where a motion ends.
    stop : says whether to end, several times a second.
    """

    max_events: int = field(default=1_000_000, kw_only=True)
    max_evaluations: int = field(default=2_000_000_000, kw_only=True)
    progress: Callable[[float], None] | None = field(default=None, kw_only=True)
    stop: Callable[[], bool] = field(default=never, kw_only=True)
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
        """
        parts, code = [Log.sized(0, motion.y.size, 0)], None
        while self.outcome.complete and code != DONE:
            # 2048: between two reports of progress
            log = Log.sized(2048, motion.y.size, max(self.max_events + 1 - self.events, 0))
            # 50_000: of the compiled march, between which it may be stopped: less than half a second
            most = min(self.max_evaluations - self.evaluations, 50_000)
            code, n_seg, n_ev, n_eval = motion.advance(flow, end, log, most)
            self.segments, self.events = self.segments + n_seg, self.events + n_ev
            self.evaluations += n_eval
            part = log.first(n_seg, n_ev)
            parts.append(part._replace(state=flow.visits(part.state)))
            if motion.waits:
                flow.follow(motion.state, motion.guard)
            if code == STUCK or (code == BUDGET and self.evaluations >= self.max_evaluations):
                self.outcome = Outcome.of(
                    OutcomeKind.STOPPED, "evaluation_limit",
                    f"{self.evaluations} evaluations of the contact gaps do not suffice", at=Where(motion.time, "s"),
                )  # fmt: skip
            elif self.events > self.max_events:
                self.outcome = too_many_events(motion.time, self.max_events)
            elif self.stop():
                self.outcome = interruption(at=Where(motion.time, "s"))
            elif self.progress is not None:
                self.progress(motion.time)
        return Log.join(parts)
