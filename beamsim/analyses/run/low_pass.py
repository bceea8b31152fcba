"""What an accelerometer reads whose signal passes a filter.

The filter is a Butterworth low-pass of four poles, -3 dB at its frequency, causal, and zero before the run:
``H(s) = Omega^4 / prod(s - p_j)`` with ``p_j = Omega exp(i pi (2 j + 3) / 8)``, ``j = 1 ... 4``. Of time-stepped
motions the panels of `linear_filter` end at the integrator's steps, whose dense output is a polynomial there: the peaks
do not depend on the rate of the output.
"""

from __future__ import annotations

import numpy as np

from beamsim.analyses.run.linear_filter import LONGEST_TURN, Extreme, LinearFilter, Signal, panels
from beamsim.flow.trajectory import Trajectory
from beamsim.typing import Complexes, Floats, Ints

POLES = 4
PANELS_A_PERIOD = 32  # of the filter's frequency; peaks between panels are then right to 1e-5


class LowPassFilter:
    """The filter of k signals, led through them from t = 0 on part by part; it keeps the extremes of its output."""

    def __init__(self, frequency_hz: float, signals: int) -> None:
        self._filter = LinearFilter(*butterworth(frequency_hz), signals)
        self._longest = 1.0 / (PANELS_A_PERIOD * frequency_hz)
        self._value = self._slope = np.zeros(signals)

    @property
    def extremes(self) -> Extreme:
        """Lowest and highest output so far, with their times."""
        return self._filter.extremes

    def through(self, times: Floats, signal: Signal, longest: float = np.inf) -> Floats:
        """(nt, k) the output at increasing ``times``, the first of which is the end of the part before.

        Between two of them the signal is smooth; a panel is at most ``longest``, s.
        """
        _, value, _, of_times = self.curve(times, signal, longest)
        return value[of_times]

    def curve(self, times: Floats, signal: Signal, longest: float = np.inf) -> tuple[Floats, Floats, Floats, Ints]:
        """The same at the ends of all panels: these (P + 1,), the output and its slope there (P + 1, k).

        The last are the indices of ``times`` among them.
        """
        blocks, of_times = panels(times, signal, min(longest, self._longest))
        ends, values, slopes = [times[:1]], [self._value[None]], [self._slope[None]]
        for block in blocks:
            value, slope = self._filter.through(block)
            ends.append(block.ends[1:])
            values.append(value)
            slopes.append(slope)
        self._value, self._slope = values[-1][-1], slopes[-1][-1]
        return np.concatenate(ends), np.vstack(values), np.vstack(slopes), of_times


def known_times(part: Trajectory, times: Floats) -> tuple[Floats, float]:
    """Ends of panels that a motion and output times ask for, and how long panels may be, s."""
    fastest = part.flow.largest_exponent
    known = np.unique(np.concatenate([part.time, times[times <= part.end], [part.end]]))
    return known, LONGEST_TURN / fastest if fastest > 0 else np.inf


def butterworth(frequency_hz: float) -> tuple[Complexes, Complexes]:
    """Poles with a positive imaginary part, rad/s, and their residues; the others are their conjugates."""
    omega = 2 * np.pi * frequency_hz
    poles = omega * np.exp(1j * np.pi * (2 * np.arange(1, POLES + 1) + POLES - 1) / (2 * POLES))
    others = poles[:, None] - poles + np.eye(POLES)
    residues = omega**POLES / others.prod(axis=1)
    upper = poles.imag > 0
    return poles[upper], residues[upper]
