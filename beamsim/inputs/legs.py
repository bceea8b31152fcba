"""One direction of a sweep: frequency, phase and time of a linear or logarithmic sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.scenario.quantities import Rate
from beamsim.typing import Floats


@dataclass(frozen=True)
class Leg:
    """A sweep from one frequency to another: ``f' = rate * f`` (logarithmic) or ``f' = rate`` (linear)."""

    first_hz: float
    last_hz: float
    rate: float  # 1/s or Hz/s, positive
    logarithmic: bool

    @property
    def signed_rate(self) -> float:
        """The rate, negative for a downward sweep."""
        return self.rate if self.last_hz > self.first_hz else -self.rate

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.time_from(np.array(self.first_hz), np.array(self.last_hz)))

    @property
    def cycles(self) -> float:
        """Number of cycles, in general not whole."""
        return float(self.turns(np.array(self.last_hz)))

    def turns(self, frequency_hz: Floats) -> Floats:
        """Cycles from the start of the leg to a frequency."""
        if self.logarithmic:
            return np.asarray((frequency_hz - self.first_hz) / self.signed_rate)
        return np.asarray((frequency_hz - self.first_hz) * (frequency_hz + self.first_hz) / (2 * self.signed_rate))

    def frequency(self, turns: Floats) -> Floats:
        """The inverse of `turns`, Hz."""
        if self.logarithmic:
            return np.asarray(self.first_hz + self.signed_rate * turns)
        return np.sqrt(np.maximum(self.first_hz**2 + 2 * self.signed_rate * turns, 0.0))

    def frequency_after(self, first_hz: Floats, time: Floats) -> Floats:
        """Frequency, Hz, a time after a given frequency."""
        if self.logarithmic:
            return np.asarray(first_hz * np.exp(self.signed_rate * time))
        return np.asarray(first_hz + self.signed_rate * time)

    def time_from(self, first_hz: Floats, frequency_hz: Floats) -> Floats:
        """Time, s, from one frequency to another: the inverse of `frequency_after`."""
        change = np.log(frequency_hz / first_hz) if self.logarithmic else frequency_hz - first_hz
        return np.asarray(change / self.signed_rate)

    def change_per_radian(self, frequency_hz: Floats) -> Floats:
        """Relative change of the frequency while the phase grows by a radian."""
        slope = self.signed_rate * frequency_hz if self.logarithmic else self.signed_rate
        return np.asarray(slope / (2 * np.pi * frequency_hz**2))

    def time_between(self, first_hz: Floats, turns: Floats) -> Floats:
        """Time, s, for a number of cycles from a given frequency; without cancellation for small numbers."""
        if self.logarithmic:
            return np.asarray(np.log1p(self.signed_rate * turns / first_hz) / self.signed_rate)
        last = np.sqrt(np.maximum(first_hz**2 + 2 * self.signed_rate * turns, 0.0))
        return np.asarray(2 * turns / (first_hz + last))

    def turns_after(self, first_hz: Floats, time: Floats) -> Floats:
        """Cycles during a time from a given frequency."""
        if self.logarithmic:
            return np.asarray(first_hz * np.expm1(self.signed_rate * time) / self.signed_rate)
        return np.asarray(time * (first_hz + 0.5 * self.signed_rate * time))

    def time_at(self, turns: Floats) -> Floats:
        """Time since the start of the leg, s."""
        return self.time_between(np.full(np.shape(turns), self.first_hz), turns)


def make_leg(first_hz: float, last_hz: float, rate: Rate) -> Leg:
    """One direction of a sweep.

    Parameters
    ----------
    first_hz, last_hz : Hz, from and to.
    rate : of the scenario, in octaves or Hz per second.

    Returns
    -------
    Leg
        Logarithmic for octaves.
    """
    if rate.unit == "oct/s":
        return Leg(first_hz, last_hz, float(rate.value * np.log(2.0)), True)
    return Leg(first_hz, last_hz, float(rate.value), False)
