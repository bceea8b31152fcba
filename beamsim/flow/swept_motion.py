"""Swept motions: what the loads are along a sweep, and the level that a controller gives them.

Within a chunk the frequency hardly changes, so that the loads are slow polynomials times one exponential
(:func:`beamsim.inputs.swept.swept_signals`). Times count from the start of the chunk: a long sweep loses no digits.

The sweep is followed a few cycles at a time. Where a limit would be exceeded, the motion is computed ahead under levels
that are tried, and goes on under the largest that meets the limits there: an exact prediction in place of the estimates
of a controller.

Each trial looks ahead over several corrections of the level, changes its logarithm evenly over all of them, and counts
the later half. The motion goes on over the first of them alone, then the next trial begins. A level that held the limit
at every cycle by itself would overshoot from one to the next, since a response lags behind its excitation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from beamsim.flow.compiled import processor_time
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import Log, March, Motion, motion_of, start
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.swept import SweepWindows, windows_of_cycles
from beamsim.outcomes import Outcome, never, report_progress
from beamsim.system.equations import Forcing, PiecewiseLinearSystem, RowsOf
from beamsim.typing import TINY, Floats, Ints

CYCLES_OF_CHUNK = 256
STEP = 1.05  # ratio of neighbouring carriers: relative to its carrier a cycle turns by no more than 0.16 rad


SweptLoads = Callable[[SweepWindows, float], Forcing]
"""The loads under given windows with a carrier, rad/s."""


def carriers(frequency_hz: Floats) -> Floats:
    """Angular frequencies, rad/s, for the signals of cycles, equal ones for neighbours."""
    return np.asarray(2 * np.pi * STEP ** (np.floor(np.log(frequency_hz) / np.log(STEP)) + 0.5))


def with_windows(flow: ExactFlow, loads: SweptLoads, windows: SweepWindows, carrier: float) -> ExactFlow:
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
    return flow.with_loads(loads(windows, carrier), windows.duration)


@dataclass(frozen=True)
class SweptChunk:
    """The motion over some cycles of a sweep; its times count from their beginning."""

    motion: Trajectory
    windows: SweepWindows
    first: int  # cycle
    edges: Floats  # (C + 1,) s, where the C cycles begin, and the end

    @property
    def cycle_count(self) -> int:
        """Number of whole cycles that were computed."""
        if self.motion.outcome.complete:
            return self.edges.size - 1
        return max(int(np.searchsorted(self.edges, self.motion.end, side="right")) - 1, 0)


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

    def chunks(self) -> Iterator[SweptChunk]:
        """March, chunk by chunk, until the end of the sweep or until the allowed work is spent."""
        carrier, report = carriers(self.windows.frequency_hz), self.progress
        flow, motion, begun = None, Motion(np.zeros(0), -1), Log.sized(0, 0)
        visited: set[bytes] = set()
        for first, last in self._parts(carrier):
            begin, since = processor_time(), float(self.windows.edge[first])
            windows = self.windows.of_cycles(first, last)
            if flow is None:
                flow = ExactFlow(self.system, self.loads(windows, carrier[first]), windows.duration)
                motion, begun = start(flow, self.initial_state)
                self.events = begun.event_time.size
            else:
                before, flow = flow, with_windows(flow, self.loads, windows, carrier[first])
                motion.enter(flow, before)
                begun = Log.sized(0, motion.y.size, 0)
            if report is not None:
                self.progress = partial(self._report, report, since, last)
            log = Log.join([begun, self.on(flow, motion, windows.duration)])
            trajectory = motion_of(flow, motion, log, self)
            self.outcome = _shift_outcome(trajectory.outcome, since)
            visited.update(flow.visited_phases[state].tobytes() for state in np.unique(trajectory.state))
            self.states = len(visited)
            self.end = since + trajectory.end
            self.processor_time_s += processor_time() - begin
            yield SweptChunk(trajectory, windows, first, windows.edge)
            if not self.outcome.complete:
                return

    def _report(self, report: Callable[[float], None], begin: float, last_cycle: int, time: float) -> None:
        """Report the completed share of the cycles, at most up to the last cycle of the chunk."""
        reached = float(np.searchsorted(self.windows.edge, begin + time))
        report(min(reached, last_cycle) / self.windows.cycles)

    def _parts(self, carrier: Floats) -> Iterator[tuple[int, int]]:
        """First and last (left out) cycle of the chunks, with one carrier each."""
        ends: Ints = np.append(np.flatnonzero(np.diff(carrier)) + 1, carrier.size)
        first = 0
        for end in ends.tolist():
            while first < end:
                last = min(first + CYCLES_OF_CHUNK, end)
                yield first, last
                first = last


def _shift_outcome(outcome: Outcome, begin: float) -> Outcome:
    """An outcome whose times count from the start of the sweep."""
    if outcome.place is None:
        return outcome
    return replace(outcome, place=outcome.place._replace(value=outcome.place.value + begin))


STEEPEST = float(np.log(2.0))  # change of the logarithm of the level in one correction
CLOSE = 2e-3  # distance from a limit at which a trial ends, in its logarithm
BETWEEN_CORRECTIONS = 1e-3  # relative change of the frequency between two corrections of the level
CORRECTIONS_AHEAD, CYCLES_AHEAD = 6, 8  # that are looked ahead, the longer of them
TRIALS_AT_START, TRIALS = 8, 6  # of the level at the start, and of one correction
CYCLES_BELOW_LIMITS = 64  # that are followed at once
LEAST_CHANGE = 0.02  # of the slope, from one trial to the next
AS_FOLLOWED = 1e-3  # relative difference between the table of the level and the level that was followed


class _MotionAtEnd(NamedTuple):
    """A motion, and the flow in which its contact state has its number."""

    motion: Motion
    flow: ExactFlow


@dataclass
class LevelControl:
    """Follows one leg of a sweep from its start.

    Parameters
    ----------
    system : the structure.
    loads : on it, under given windows.
    outputs : the K limited quantities, written for a flow.
    limits : (K,).
    leg : the sweep, up or down.
    specification : amplitude without notches, continuous and positive.
    phase : of the sine at the start, rad.
    moves_base : whether the sine moves the base.
    state : (N,) at the start.
    stop, progress : as in `beamsim.flow.transient.simulate`.
    """

    system: PiecewiseLinearSystem
    loads: SweptLoads
    outputs: Callable[[ExactFlow], RowsOf]
    limits: Floats
    leg: Leg
    specification: Profile
    phase: float
    moves_base: bool
    state: Floats
    stop: Callable[[], bool] = never
    progress: Callable[[float], None] | None = None
    trials: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        windows = windows_of_cycles(self.leg, self.specification, 0, 1, phase=self.phase, base_motion=self.moves_base)
        forcing = self.loads(windows, self._carrier(0, 1))
        self._latest = ExactFlow(self.system, forcing, windows.duration)  # whose contact states are kept
        self._there = _MotionAtEnd(start(self._latest, self.state)[0], self._latest)
        low, high = sorted((self.leg.first_hz, self.leg.last_hz))
        edges = self.specification.edge
        self._corners = edges[(edges > low) & (edges < high)]
        self._total = int(self.leg.cycles)

    def level(self) -> tuple[Floats, Floats]:
        """Frequencies (P,), increasing, and amplitudes (P,) between which the level is interpolated on log-log axes."""
        cycle, gain, slope = [0], [self._start()], 0.0  # the gain is the logarithm of level over specification
        while cycle[-1] < self._total and not self.stop():
            at = cycle[-1]
            step = self._step(at)
            ahead = np.unique(np.minimum(at + step * np.arange(1, self._horizon(step) // step + 1), self._total))
            unlimited = self._unlimited(at, self._horizon(step)) if gain[-1] == 0.0 else at
            if unlimited > at:
                cycle.append(unlimited)
                gain.append(0.0)
                slope = 0.0
            else:
                cycle.append(int(ahead[0]))
                slope = self._slope(at, ahead, gain[-1], slope)
                gain.append(min(gain[-1] + slope, 0.0))
            report_progress(self.progress, cycle[-1] / self._total)
        return self._table(np.array(cycle), np.array(gain))

    def _step(self, cycle: int) -> int:
        """Cycles between two corrections."""
        change = 2 * np.pi * float(np.abs(self.leg.change_per_radian(self.leg.frequency(np.array(float(cycle))))))
        return max(1, int(BETWEEN_CORRECTIONS / change))

    @staticmethod
    def _horizon(step: int) -> int:
        """Cycles that are looked ahead."""
        return max(CORRECTIONS_AHEAD * step, CYCLES_AHEAD)

    def _start(self) -> float:
        """Gain at the start, where the transient already exceeds a limit at the full level."""
        gain, end = 0.0, min(self._horizon(self._step(0)), self._total)
        for _ in range(TRIALS_AT_START):
            excess, _ = self._ahead(0, np.array([end]), np.array([gain, gain]), 0)
            if excess <= CLOSE:
                break
            gain -= excess
        return gain

    def _unlimited(self, cycle: int, horizon: int) -> int:
        """Cycle up to which the specification may be followed: no limit is exceeded up to a horizon beyond it."""
        length = max(CYCLES_BELOW_LIMITS, 2 * horizon)
        while length >= 2 * horizon:
            end = min(cycle + length, self._total)
            to = end if end == self._total else end - horizon
            excess, there = self._ahead(cycle, np.unique([to, end]), np.zeros(3), 0)
            if excess <= 0.0:
                self._there = there
                return to
            length //= 2
        return cycle

    def _slope(self, cycle: int, cycles_ahead: Ints, gain: float, guess: float) -> float:
        """Change of the gain in the next step, the largest at which the limits are met ahead; the motion goes on."""
        low, high = -STEEPEST, min(-gain, STEEPEST)
        log_frequency = np.log(self.leg.frequency(np.append(cycle, cycles_ahead).astype(float)))
        steps = (log_frequency - log_frequency[0]) / (log_frequency[1] - log_frequency[0])  # nearly 0, 1, 2, ...
        tried: list[tuple[float, float, _MotionAtEnd]] = []  # slope, excess, motion after the step
        slope = min(max(guess, low), high)
        while True:
            path = np.minimum(gain + slope * steps, 0.0)
            tried.append((slope, *self._ahead(cycle, cycles_ahead, path, cycles_ahead.size // 2)))
            excess = tried[-1][1]
            over = min((t for t in tried if t[1] > 0.0), key=lambda t: t[0], default=None)
            under = max((t for t in tried if t[1] <= 0.0), key=lambda t: t[0], default=None)
            at_end = (over is None and slope >= high) or (under is None and slope <= low)
            if abs(excess) <= CLOSE or at_end or len(tried) == TRIALS:
                break
            # half the change of the level in half of the corrections: a first guess of what it does to the response
            change = max(LEAST_CHANGE, abs(excess) / max(0.3 * cycles_ahead.size, 1.0))
            if over is None:
                slope = min(high, slope + change)
            elif under is None:
                slope = max(low, slope - change)
            else:
                share = over[1] / (over[1] - under[1])
                slope = over[0] + min(max(share, 0.1), 0.9) * (under[0] - over[0])
        met = [t for t in tried if t[1] <= CLOSE]
        slope, _, self._there = max(met, key=lambda t: t[0]) if met else min(tried, key=lambda t: t[1])
        return slope

    def _ahead(self, cycle: int, cycles_ahead: Ints, gain: Floats, skipped: int) -> tuple[float, _MotionAtEnd]:
        """Largest logarithm of value over limit in the cycles ahead, and the motion at the first of them.

        The gains (A + 1,) are those at ``cycle`` and ``cycles_ahead`` (A,). Cycles before ``cycles_ahead[skipped - 1]``
        do not count.
        """
        self.trials += 1
        # the level turns where it returns to the specification, and is straight before and after that
        turn = int(np.count_nonzero(gain < 0.0))
        kept = np.unique(np.clip([0, turn - 1, turn, cycles_ahead.size], 0, cycles_ahead.size))
        frequency = self.leg.frequency(np.append(cycle, cycles_ahead)[kept].astype(float))
        profile = self._profile(frequency, gain[kept])
        windows = windows_of_cycles(
            self.leg, profile, cycle, int(cycles_ahead[-1]), phase=self.phase, base_motion=self.moves_base
        )
        flow = with_windows(self._latest, self.loads, windows, self._carrier(cycle, int(cycles_ahead[-1])))
        begun, self._latest = self._there.motion.copy(), flow
        begun.enter(flow, self._there.flow)
        march = March(max_evaluations=100_000_000, stop=self.stop)
        parts = [march.on(flow, begun, float(windows.edge[cycles_ahead[0] - cycle]))]
        there = _MotionAtEnd(begun.copy(), flow)
        parts.append(march.on(flow, begun, windows.duration))
        motion = motion_of(flow, begun, Log.join(parts), march)
        found = motion.extrema(self.outputs(flow), windows.edge)
        counted = slice(int(cycles_ahead[skipped - 1]) - cycle if skipped else 0, None)
        share = float(np.max(np.maximum(found.high, -found.low)[counted] / self.limits))
        return float(np.log(max(share, TINY))), there

    def _carrier(self, first: int, last: int) -> float:
        return float(carriers(self.leg.frequency(np.array(0.5 * (first + last)))))

    def _profile(self, frequency: Floats, gain: Floats) -> Profile:
        """The level between frequencies, in the order of the leg, at which the gains are given."""
        order = np.argsort(frequency)
        f, g = frequency[order], gain[order]
        corners = self._corners[(self._corners > f[0]) & (self._corners < f[-1])]
        return Profile.from_points(*self._points(np.union1d(f, corners), f, g))

    def _points(self, frequency: Floats, gain_frequency: Floats, gain: Floats) -> tuple[Floats, Floats]:
        return frequency, self.specification(frequency) * np.exp(
            np.interp(np.log(frequency), np.log(gain_frequency), gain)
        )

    def _table(self, cycle: Ints, gain: Floats) -> tuple[Floats, Floats]:
        """The level at the cycles, and at the corners of the specification, thinned."""
        frequency = self.leg.frequency(cycle.astype(float))
        if self.leg.cycles - cycle[-1] > 1e-6:
            frequency, gain = np.append(frequency, self.leg.last_hz), np.append(gain, gain[-1])
        frequency[0], frequency[-1] = self.leg.first_hz, self.leg.last_hz
        order = np.argsort(frequency)
        frequency, gain = frequency[order], gain[order]
        kept = corners(np.log(frequency), gain, AS_FOLLOWED)
        frequency, gain = frequency[kept], gain[kept]
        return self._points(np.union1d(frequency, self._corners), frequency, gain)


def corners(x: Floats, y: Floats, tolerance: float) -> Ints:
    """Numbers of the points of a curve through which a polygon passes that is within a tolerance of y (Ramer, 1972).

    Parameters
    ----------
    x, y : (k,) of the curve, x increasing.
    tolerance : in the unit of y.

    Returns
    -------
    (c,) array
        Ascending, the first and the last point among them.

    Examples
    --------
    >>> corners(np.arange(5.0), np.array([0.0, 1.0, 2.0, 1.0, 0.0]), 0.1)
    array([0, 2, 4])
    """
    kept, intervals = {0, x.size - 1}, [(0, x.size - 1)]
    while intervals:
        first, last = intervals.pop()
        inner = slice(first + 1, last)
        line = y[first] + (y[last] - y[first]) * (x[inner] - x[first]) / (x[last] - x[first])
        distance = np.abs(y[inner] - line)
        if distance.size and distance.max() > tolerance:
            middle = first + 1 + int(distance.argmax())
            kept.add(middle)
            intervals += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)
