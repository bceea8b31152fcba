"""The motion under a swept sine: an exact flow whose loads follow the windows of the sweep, in stretches of cycles.

Within a stretch the frequency hardly changes, so that the loads are slow polynomials times one exponential
(:func:`beamsim.inputs.swept.swept_signals`). Times count from the start of the stretch: a long sweep loses no digits.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import Log, March, Motion
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import motion_of, start
from beamsim.inputs.signal import Signal
from beamsim.inputs.swept import SweepWindows
from beamsim.outcomes import Outcome
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from beamsim.typing import Floats, Ints

STEP = 1.05  # ratio of neighbouring carriers: beside its carrier a cycle turns by no more than 0.16 rad


SweptLoads = Callable[[SweepWindows, float], tuple[Forcing, tuple[Signal, ...]]]
"""The loads under given windows with a carrier, rad/s, and what else outputs may contain."""


def carriers(frequency_hz: Floats) -> Floats:
    """Angular frequencies, rad/s, for the signals of cycles, equal ones for neighbours."""
    return np.asarray(2 * np.pi * STEP ** (np.floor(np.log(frequency_hz) / np.log(STEP)) + 0.5))


def under_windows(flow: ExactFlow, loads: SweptLoads, windows: SweepWindows, carrier: float) -> ExactFlow:
    """A flow under other windows of the sweep; what is known of its contact states is kept.

    Parameters
    ----------
    flow : under some windows.
    loads : under given windows.
    windows, carrier : the others, and their carrier, rad/s.

    Returns
    -------
    The flow over the duration of the windows.
    """
    forcing, observers = loads(windows, carrier)
    return flow.under(forcing, observers, windows.duration)


@dataclass(frozen=True)
class SweptStretch:
    """The motion over some cycles of a sweep; its times count from their beginning."""

    motion: Trajectory
    windows: SweepWindows
    first: int  # cycle
    edge: Floats  # (C + 1,) s, where the C cycles begin, and the end

    @property
    def reached(self) -> int:
        """Number of whole cycles that were computed."""
        if self.motion.outcome.complete:
            return self.edge.size - 1
        return max(int(np.searchsorted(self.edge, self.motion.end, side="right")) - 1, 0)


@dataclass
class SweptMotion(March):
    """The motion through a whole sweep.

    Parameters
    ----------
    system : the structure.
    loads : on it, under given windows.
    windows : of the sweep.
    initial_state : (N,) at t = 0; internal states of the contacts that are left out are zero.
    progress : called with the share of the cycles that is done.
    """

    system: PiecewiseLinearSystem
    loads: SweptLoads
    windows: SweepWindows
    initial_state: Floats
    max_events: int = field(default=20_000_000, kw_only=True)
    states: int = field(init=False, default=0)  # contact states visited
    end: float = field(init=False, default=0.0)  # s, reached

    def stretches(self) -> Iterator[SweptStretch]:
        """March, stretch by stretch, until the end of the sweep or of the work that is allowed."""
        carrier, told = carriers(self.windows.frequency_hz), self.progress
        flow, motion, begun = None, Motion(np.zeros(0), -1), Log.sized(0, 0)
        visited: set[bytes] = set()
        for first, last in self._parts(carrier):
            begin, since = clock.process_time(), float(self.windows.edge[first])
            windows = self.windows.of_cycles(first, last)
            if flow is None:
                forcing, observers = self.loads(windows, carrier[first])
                flow = ExactFlow(self.system, forcing, windows.duration, observers)
                motion, begun = start(flow, self.initial_state)
                self.events = begun.event_time.size
            else:
                before, flow = flow, under_windows(flow, self.loads, windows, carrier[first])
                motion.enter(flow, before)
                begun = Log.sized(0, motion.y.size, 0)
            if told is not None:
                self.progress = partial(self._report, told, since, last)
            log = Log.join([begun, self.on(flow, motion, windows.duration)])
            trajectory = motion_of(flow, motion, log, self)
            self.outcome = _later(trajectory.outcome, since)
            visited.update(flow.visited[state].tobytes() for state in np.unique(trajectory.state))
            self.states = len(visited)
            self.end = since + trajectory.end
            self.processor_time_s += clock.process_time() - begin
            yield SweptStretch(trajectory, windows, first, windows.edge)
            if not self.outcome.complete:
                return

    def _report(self, told: Callable[[float], None], since: float, last: int, time: float) -> None:
        """Tell the share of the cycles that is done, at most that of the last one of the stretch."""
        reached = float(np.searchsorted(self.windows.edge, since + time))
        told(min(reached, last) / self.windows.cycles)

    def _parts(self, carrier: Floats) -> Iterator[tuple[int, int]]:
        """First and last (left out) cycle of the stretches, with one carrier each."""
        ends: Ints = np.append(np.flatnonzero(np.diff(carrier)) + 1, carrier.size)
        first = 0
        for end in ends.tolist():
            while first < end:
                # 256: of a stretch
                last = min(first + 256, end)
                yield first, last
                first = last


def _later(outcome: Outcome, begin: float) -> Outcome:
    """An outcome whose times count from the start of the sweep."""
    if outcome.place is None:
        return outcome
    return replace(outcome, place=outcome.place._replace(value=outcome.place.value + begin))
