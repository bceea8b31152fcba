"""Sweeps: frequency, phase and time of a leg, and the level over frequency as in a test specification.

Between two break frequencies the level is a power of the frequency, :math:`A(f) = A_p (f/f_p)^{s_p}`. For a base
acceleration, s = 0 is constant acceleration, s = 1 constant velocity and s = 2 constant displacement; log-log
interpolation gives any s.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamsim.scenario.excitation import Notch, ProfilePoint
from beamsim.scenario.quantities import Rate, acceleration_amplitude, power_of
from beamsim.typing import Floats, Ints


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
        """Number of cycles, in general not an integer."""
        return float(self.turns(np.array(self.last_hz)))

    def turns(self, frequency_hz: Floats) -> Floats:
        """Number of cycles from the start of the leg to a frequency."""
        if self.logarithmic:
            return np.asarray((frequency_hz - self.first_hz) / self.signed_rate)
        return np.asarray((frequency_hz - self.first_hz) * (frequency_hz + self.first_hz) / (2 * self.signed_rate))

    def frequency(self, turns: Floats) -> Floats:
        """Frequency, Hz, after a number of cycles."""
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
        """Time, s, for a number of cycles from a given frequency, without cancellation for small numbers."""
        if self.logarithmic:
            return np.asarray(np.log1p(self.signed_rate * turns / first_hz) / self.signed_rate)
        last = np.sqrt(np.maximum(first_hz**2 + 2 * self.signed_rate * turns, 0.0))
        return np.asarray(2 * turns / (first_hz + last))

    def turns_after(self, first_hz: Floats, time: Floats) -> Floats:
        """Number of cycles during a time from a given frequency."""
        if self.logarithmic:
            return np.asarray(first_hz * np.expm1(self.signed_rate * time) / self.signed_rate)
        return np.asarray(time * (first_hz + 0.5 * self.signed_rate * time))

    def time_at(self, turns: Floats) -> Floats:
        """Time, s, from the start of the leg to a number of cycles."""
        return self.time_between(np.full(np.shape(turns), self.first_hz), turns)


def make_leg(first_hz: float, last_hz: float, rate: Rate) -> Leg:
    """One direction of a sweep.

    Parameters
    ----------
    first_hz, last_hz : first and last frequency, Hz.
    rate : rate of the scenario, in octaves or Hz per second.

    Returns
    -------
    Leg
        Logarithmic for a rate in octaves.
    """
    if rate.unit == "oct/s":
        return Leg(first_hz, last_hz, float(rate.value * np.log(2.0)), True)
    return Leg(first_hz, last_hz, float(rate.value), False)


@dataclass(frozen=True)
class Profile:
    """Piecewise powers of the frequency; the first piece extends to 0 and the last to infinity.

    Parameters
    ----------
    edge : (P,) Hz, increasing; piece p begins at ``edge[p]``.
    amplitude : (P,) at ``edge[p]``, m/s^2 for a base, N for a force.
    power : (P,).
    """

    edge: Floats
    amplitude: Floats
    power: Floats

    @classmethod
    def constant(cls, level: float, quantity: str = "acceleration") -> Profile:
        """One level at all frequencies."""
        amplitude = acceleration_amplitude(level, quantity, 1.0)
        return cls(np.ones(1), np.array([amplitude]), np.array([power_of(quantity)], dtype=float))

    @classmethod
    def from_steps(cls, points: Sequence[tuple[float, float, str]]) -> Profile:
        """Piecewise constant profile from points (frequency in Hz, level, quantity); each is valid up to the next."""
        edge = np.array([f for f, _, _ in points])
        amplitude = np.array([acceleration_amplitude(level, quantity, f) for f, level, quantity in points])
        return cls(edge, amplitude, np.array([power_of(quantity) for _, _, quantity in points], dtype=float))

    @classmethod
    def log_log(cls, points: Sequence[tuple[float, float, str]]) -> Profile:
        """Profile with log-log interpolation between points, constant outside.

        Every level must be positive.
        """
        edge = np.array([f for f, _, _ in points])
        return cls.from_points(
            edge, np.array([acceleration_amplitude(level, quantity, f) for f, level, quantity in points])
        )

    @classmethod
    def from_points(cls, edge: Floats, amplitude: Floats) -> Profile:
        """Log-log interpolation between positive amplitudes (P,) at increasing frequencies (P,), constant outside."""
        slope = np.diff(np.log(amplitude)) / np.diff(np.log(edge)) if edge.size > 1 else np.zeros(0)
        if edge.size == 1:
            return cls(edge, amplitude, np.zeros(1))
        first = np.array([edge[0] * 0.5])
        return cls(
            np.concatenate([first, edge]),
            np.concatenate([amplitude[:1], amplitude]),
            np.concatenate([[0.0], slope, [0.0]]),
        )

    def __call__(self, frequency_hz: ArrayLike) -> Floats:
        """Amplitude at frequencies of any shape."""
        f = np.asarray(frequency_hz, dtype=float)
        p = self.piece(f)
        return np.asarray(self.amplitude[p] * (f / self.edge[p]) ** self.power[p])

    def piece(self, frequency_hz: Floats) -> Ints:
        """Index of the piece that applies at each frequency."""
        return np.clip(np.searchsorted(self.edge, frequency_hz, side="right") - 1, 0, None)

    def scaled(self, factor: float) -> Profile:
        """All levels multiplied by a factor."""
        return Profile(self.edge, self.amplitude * factor, self.power)

    def with_notch(self, lower_hz: float, upper_hz: float, level: float, quantity: str) -> Profile:
        """The profile with a limit between two frequencies.

        Parameters
        ----------
        lower_hz, upper_hz : ends of the notch.
        level : largest level in the notch, of ``quantity``.

        Returns
        -------
        Profile
            With edges at the ends of the notch, and at the intersections of limit and profile.
        """
        limit = Profile.constant(level, quantity)
        edge = np.union1d(self.edge, [lower_hz, upper_hz])
        if edge[0] == lower_hz:
            edge = np.append(0.5 * lower_hz, edge)
        edge = np.union1d(edge, [f for f in self._meets(limit, edge) if lower_hz < f < upper_hz])
        middle = np.append(0.5 * (edge[1:] + edge[:-1]), edge[-1])
        below = (edge >= lower_hz) & (edge < upper_hz) & (limit(middle) < self(middle))
        piece = self.piece(edge)
        return Profile(edge, np.where(below, limit(edge), self(edge)), np.where(below, limit.power, self.power[piece]))

    def _meets(self, other: Profile, edge: Floats) -> list[float]:
        """Frequencies at which the profile meets another with a single exponent; at most one in each piece."""
        found = []
        for lower, upper in itertools.pairwise(edge):
            piece = int(self.piece(lower))
            power = float(self.power[piece] - other.power[0])
            levels = self.amplitude[piece] * self.edge[piece] ** -self.power[piece], float(other(1.0))
            if power and min(levels) > 0:
                crossing = float((levels[1] / levels[0]) ** (1.0 / power))
                found += [crossing] if lower < crossing < upper else []
        return found


def make_profile(
    level: float,
    quantity: str,
    points: Sequence[ProfilePoint] = (),
    between: str = "held",
    notches: Sequence[Notch] = (),
) -> Profile:
    """The level over frequency, with notches.

    Parameters
    ----------
    level : level in SI units; with a table, a factor of it.
    quantity : quantity of the level, and of forces in points and notches that name none.
    points : the table.
    between : ``held``, or ``log_log`` for log-log interpolation.
    notches : frequency ranges with a limit.

    Returns
    -------
    Profile
        Amplitudes of the acceleration, or of the force.
    """
    default = "acceleration" if power_of(quantity) else quantity
    if points:
        table = [(p.frequency, p.level, p.quantity or default) for p in points]
        profile = (Profile.from_steps(table) if between == "held" else Profile.log_log(table)).scaled(abs(level))
    else:
        profile = Profile.constant(abs(level), quantity)
    for notch in notches:
        profile = profile.with_notch(notch.from_, notch.to, notch.level, notch.quantity or default)
    return profile


def phase_of_acceleration(quantity: str, level: float, points: Sequence[ProfilePoint] = ()) -> float:
    """Phase of the acceleration relative to the prescribed quantity (a sine), rad.

    With a table the quantity of its first point counts: a displacement is X sin(phase) in whatever quantity it is
    given, and the phase of the acceleration is continuous through the table.

    Parameters
    ----------
    quantity, level : as for `make_profile`; a negative level reverses the phase.
    points : the table of levels, if there is one.

    Returns
    -------
    float
        A multiple of a quarter turn.
    """
    if points:
        quantity = points[0].quantity or "acceleration"
    return float(0.5 * np.pi * power_of(quantity) + (np.pi if level < 0 else 0.0))
