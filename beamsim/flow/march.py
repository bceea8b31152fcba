"""The march from event to event: the host loop around the compiled one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.flow.stopping import check_stop, never
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.flow.kernels import Inputs, Tables
    from beamsim.flow.march_kernels import PieceSteps

FIRST_LOG = 64
LONGEST_LOG = 2048  # segments between two reports of progress
EVALUATIONS_A_CALL = 50_000  # of the compiled march, between which signals are handled: less than half a second


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


class Marched(Protocol):
    """What the march needs of a flow."""

    def kernel_arguments(self) -> tuple[Tables, Inputs]:
        """Tables of the contact states so far, and sources."""

    def equal_steps(self) -> PieceSteps | None:
        """What carries the motion over pieces of the sources that are equally long, where they are many."""

    def follow(self, state: int, guard: int) -> int:
        """Number of the state after the event of a guard, built where it is not there yet."""

    def visits(self, states: Ints) -> Ints:
        """Numbers for the log of the states of the last segments."""


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
        from beamsim.flow.event_kernels import BEGINNING

        return cls(y, state, BEGINNING)

    def copy(self) -> Motion:
        """A copy that continues from here."""
        return replace(self, y=self.y.copy())

    def advance(self, flow: Marched, end: float, log: Log, most_evaluations: int) -> tuple[int, int, int, int]:
        """One call of the compiled march.

        Parameters
        ----------
        flow : whose contact states are visited.
        end : s.
        log : takes segments and events.
        most_evaluations : of the guards.

        Returns
        -------
        status, segments, events, evaluations : see `beamsim.flow.march_kernels.march`.
        """
        from beamsim.flow.march_kernels import NEED_STATE, Position, march

        code, self.time, self.piece, self.state, self.guard, segments, events, evaluations = march(
            *flow.kernel_arguments(), flow.equal_steps(),
            Position(self.time, self.piece, self.state, self.guard, self.waits), end, self.y, log, most_evaluations,
        )  # fmt: skip
        self.waits = code == NEED_STATE
        return code, segments, events, evaluations


@dataclass(frozen=True)
class Carried:
    """Work done to carry a motion on."""

    log: Log | None
    segments: int
    events: int
    evaluations: int
    outcome: Outcome


def carry(
    flow: Marched,
    motion: Motion,
    stops: Iterable[float],
    *,
    keep: bool,
    max_events: int,
    max_evaluations: int,
    progress: Callable[[float], None] | None = None,
    stop: Callable[[], bool] = never,
) -> Carried:
    """Carry a motion on, with contact states built as they are visited.

    Parameters
    ----------
    flow, motion : the motion is changed in place.
    stops : s, times at which progress is reported; the last one ends it.
    keep : whether segments and events are logged.
    max_events, max_evaluations : numbers of events and of evaluations of the guards, beyond which it ends early with an
        outcome that says so.
    progress : called with the time reached, now and then and at every stop.
    stop : says whether to end, several times a second.
    """
    from beamsim.flow.march_kernels import BUDGET, DONE, STUCK

    size, parts = FIRST_LOG if keep else 0, []
    segments = events = evaluations = 0
    outcome, code = COMPLETE, DONE
    for end in stops:
        while outcome.complete:
            log = Log.sized(size, motion.y.size, max_events + 1 - events)
            most = min(max_evaluations - evaluations, EVALUATIONS_A_CALL)
            check_stop()
            code, n_seg, n_ev, n_eval = motion.advance(flow, end, log, most)
            segments, events, evaluations = segments + n_seg, events + n_ev, evaluations + n_eval
            if keep:
                part = log.first(n_seg, n_ev)
                parts.append(part._replace(state=flow.visits(part.state)))
                size = min(2 * size, LONGEST_LOG)
            if motion.waits:
                flow.follow(motion.state, motion.guard)
            if code == STUCK or (code == BUDGET and evaluations >= max_evaluations):
                outcome = Outcome.of(OutcomeCode.EVALUATION_LIMIT, time=motion.time, evaluations=evaluations)
            elif events > max_events:
                outcome = Outcome.of(OutcomeCode.EVENT_LIMIT, time=motion.time, events=events)
            elif stop():
                outcome = Outcome.of(OutcomeCode.INTERRUPTED, parameter=motion.time, unit="s")
            elif progress is not None:
                progress(motion.time)
            if code == DONE:
                break
    return Carried(Log.join(parts) if parts else None, segments, events, evaluations, outcome)
