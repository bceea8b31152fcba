"""The level of a swept sine that keeps the largest values of every cycle below limits.

The sweep is followed a few cycles at a time. Where a limit would be exceeded, the motion is computed ahead under levels
that are tried, and goes on under the largest that meets the limits there: an exact prediction in place of the estimates
of a controller.

Each trial looks ahead over several corrections of the level, changes its logarithm evenly over all of them, and counts
the later half. The motion goes on over the first of them alone, then the next trial begins. A level that held the limit
at every cycle by itself would overshoot from one to the next, since a response lags behind its excitation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from beamsim.flow.contact_state import OutputOf
from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import Log, March, Motion
from beamsim.flow.swept_motion import SweptLoads, carriers, under_windows
from beamsim.flow.transient import motion_of, start
from beamsim.inputs.profiles import Leg, Profile
from beamsim.inputs.swept import windows_of_cycles
from beamsim.outcomes import never
from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import Floats, Ints

STEEPEST = float(np.log(2.0))  # change of the logarithm of the level in one correction
CLOSE = 2e-3  # distance from a limit at which a trial ends, in its logarithm


class _Reached(NamedTuple):
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
    of_base : whether the sine moves the base.
    state : (N,) at the start.
    stop, progress : as in `beamsim.flow.transient.simulate`.
    """

    system: PiecewiseLinearSystem
    loads: SweptLoads
    outputs: Callable[[ExactFlow], OutputOf]
    limits: Floats
    leg: Leg
    specification: Profile
    phase: float
    of_base: bool
    state: Floats
    stop: Callable[[], bool] = never
    progress: Callable[[float], None] | None = None
    trials: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        windows = windows_of_cycles(self.leg, self.specification, 0, 1, phase=self.phase, of_base=self.of_base)
        forcing, observers = self.loads(windows, self._carrier(0, 1))
        self._latest = ExactFlow(self.system, forcing, windows.duration, observers)  # whose contact states are kept
        self._there = _Reached(start(self._latest, self.state)[0], self._latest)
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
            if self.progress is not None:
                self.progress(cycle[-1] / self._total)
        return self._table(np.array(cycle), np.array(gain))

    def _step(self, cycle: int) -> int:
        """Cycles between two corrections."""
        change = 2 * np.pi * float(np.abs(self.leg.change_per_radian(self.leg.frequency(np.array(float(cycle))))))
        # 1e-3: change of the frequency between two corrections of the level
        return max(1, int(1e-3 / change))

    @staticmethod
    def _horizon(step: int) -> int:
        """Cycles that are looked ahead."""
        # 6: corrections that are looked ahead
        # 8: cycles
        return max(6 * step, 8)

    def _start(self) -> float:
        """Gain at the start, where the transient already exceeds a limit at the full level."""
        gain, end = 0.0, min(self._horizon(self._step(0)), self._total)
        # 8: trials of the level at the start
        for _ in range(8):
            excess, _ = self._ahead(0, np.array([end]), np.array([gain, gain]), 0)
            if excess <= CLOSE:
                break
            gain -= excess
        return gain

    def _unlimited(self, at: int, horizon: int) -> int:
        """Cycle up to which the specification may be followed: no limit is exceeded up to a horizon beyond it."""
        # 64: cycles that are followed at once below the limits
        length = max(64, 2 * horizon)
        while length >= 2 * horizon:
            end = min(at + length, self._total)
            to = end if end == self._total else end - horizon
            excess, there = self._ahead(at, np.unique([to, end]), np.zeros(3), 0)
            if excess <= 0.0:
                self._there = there
                return to
            length //= 2
        return at

    def _slope(self, at: int, ahead: Ints, gain: float, guess: float) -> float:
        """Change of the gain in the next step, the largest at which the limits are met ahead; the motion goes on."""
        low, high = -STEEPEST, min(-gain, STEEPEST)
        log_frequency = np.log(self.leg.frequency(np.append(at, ahead).astype(float)))
        steps = (log_frequency - log_frequency[0]) / (log_frequency[1] - log_frequency[0])  # nearly 0, 1, 2, ...
        tried: list[tuple[float, float, _Reached]] = []  # slope, excess, motion after the step
        slope = min(max(guess, low), high)
        while True:
            path = np.minimum(gain + slope * steps, 0.0)
            tried.append((slope, *self._ahead(at, ahead, path, ahead.size // 2)))
            excess = tried[-1][1]
            over = min((t for t in tried if t[1] > 0.0), key=lambda t: t[0], default=None)
            under = max((t for t in tried if t[1] <= 0.0), key=lambda t: t[0], default=None)
            at_end = (over is None and slope >= high) or (under is None and slope <= low)
            # 6: of one correction
            if abs(excess) <= CLOSE or at_end or len(tried) == 6:
                break
            # half the change of the level in half of the corrections: a first guess of what it does to the response
            # 0.02: of the slope, from one trial to the next
            change = max(0.02, abs(excess) / max(0.3 * ahead.size, 1.0))
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

    def _ahead(self, at: int, ahead: Ints, gain: Floats, skipped: int) -> tuple[float, _Reached]:
        """Largest logarithm of a value over its limit in the cycles from ``ahead[skipped - 1]`` on, and the motion at
        ``ahead[0]``, under the gains (A + 1,) at the cycles ``at`` and ``ahead`` (A,)."""
        self.trials += 1
        # the level turns where it returns to the specification, and is straight before and after that
        turn = int(np.count_nonzero(gain < 0.0))
        kept = np.unique(np.clip([0, turn - 1, turn, ahead.size], 0, ahead.size))
        frequency = self.leg.frequency(np.append(at, ahead)[kept].astype(float))
        profile = self._profile(frequency, gain[kept])
        windows = windows_of_cycles(self.leg, profile, at, int(ahead[-1]), phase=self.phase, of_base=self.of_base)
        flow = under_windows(self._latest, self.loads, windows, self._carrier(at, int(ahead[-1])))
        begun, self._latest = self._there.motion.copy(), flow
        begun.enter(flow, self._there.flow)
        march = March(max_evaluations=100_000_000, stop=self.stop)
        parts = [march.on(flow, begun, float(windows.edge[ahead[0] - at]))]
        there = _Reached(begun.copy(), flow)
        parts.append(march.on(flow, begun, windows.duration))
        motion = motion_of(flow, begun, Log.join(parts), march)
        found = motion.extrema(self.outputs(flow), windows.edge)
        counted = slice(int(ahead[skipped - 1]) - at if skipped else 0, None)
        share = float(np.max(np.maximum(found.high, -found.low)[counted] / self.limits))
        return float(np.log(max(share, 1e-300))), there

    def _carrier(self, first: int, last: int) -> float:
        return float(carriers(self.leg.frequency(np.array(0.5 * (first + last)))))

    def _profile(self, frequency: Floats, gain: Floats) -> Profile:
        """The level between frequencies, in the order of the leg, at which the gains are given."""
        order = np.argsort(frequency)
        f, g = frequency[order], gain[order]
        corners = self._corners[(self._corners > f[0]) & (self._corners < f[-1])]
        return Profile.through(*self._points(np.union1d(f, corners), f, g))

    def _points(self, frequency: Floats, given: Floats, gain: Floats) -> tuple[Floats, Floats]:
        return frequency, self.specification(frequency) * np.exp(np.interp(np.log(frequency), np.log(given), gain))

    def _table(self, cycle: Ints, gain: Floats) -> tuple[Floats, Floats]:
        """The level at the cycles, and at the corners of the specification, thinned."""
        frequency = self.leg.frequency(cycle.astype(float))
        if self.leg.cycles - cycle[-1] > 1e-6:
            frequency, gain = np.append(frequency, self.leg.last_hz), np.append(gain, gain[-1])
        frequency[0], frequency[-1] = self.leg.first_hz, self.leg.last_hz
        order = np.argsort(frequency)
        frequency, gain = frequency[order], gain[order]
        # 1e-3: relative difference between the table of the level and the level that was followed
        kept = corners(np.log(frequency), gain, 1e-3)
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
    kept, stretches = {0, x.size - 1}, [(0, x.size - 1)]
    while stretches:
        first, last = stretches.pop()
        inner = slice(first + 1, last)
        line = y[first] + (y[last] - y[first]) * (x[inner] - x[first]) / (x[last] - x[first])
        distance = np.abs(y[inner] - line)
        if distance.size and distance.max() > tolerance:
            middle = first + 1 + int(distance.argmax())
            kept.add(middle)
            stretches += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)
