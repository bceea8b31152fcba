"""Base motion of a swept sine without drift.

An acceleration :math:`\\mathrm{Re}[\\alpha e^{i\\varphi}]` whose frequency changes leaves two constants in its double
integral: an offset of the velocity, with which the base drifts away, and one of the displacement. The motion without
drift is the one whose offsets vanish when the sweep is continued, by its own law of frequency and level, until it is
slow: the integrals start from the far end of that sweep. With
:math:`p = \\dot f / (2\\pi f^2)`, the relative change of the frequency in a radian, and
:math:`\\alpha \\propto f^s`, it is

.. math:: v = \\mathrm{Re}\\Big[\\frac{\\alpha}{i\\omega} K_v e^{i\\varphi}\\Big], \\qquad
          d = \\mathrm{Re}\\Big[\\frac{\\alpha}{(i\\omega)^2} K_d e^{i\\varphi}\\Big],

.. math:: K_v = \\int_0^\\infty g(y)\\, e^{-y} dy, \\qquad K_d = \\int_0^\\infty h(y)\\, g(y)\\, e^{-y} dy

with :math:`g = (1 + ipy)^s e^{-ipy^2/2}`, :math:`h = y` for a linear sweep and :math:`g = (1 + ipy)^{s-1}`,
:math:`h = \\log(1 + ipy) / (ip)` for a logarithmic one. Here :math:`iy/\\omega` is the time, in a logarithmic sweep iy
the phase, from the considered moment to a later one, rotated to where the sine decays. Both integrals are evaluated
along :math:`y = e^{\\mp i\\pi/4} r` for p above and below zero, where the integrand does not oscillate at any sweep
rate. In a slow sweep both are 1.

On a steep line of a log-log table, which represents a step, the level changes within a radian. There the acceleration
is integrated in time from the line's end with the lower level, where the motion is that of a constant level.

Where two intervals meet, at a corner or step of the profile or at a turn, v and d jump by :math:`J_v` and
:math:`J_d`. The jumps are impulses :math:`J_v \\delta + J_d \\delta'` of the acceleration; they are replaced by
:math:`J_v w + J_d w'`, where w is a smooth pulse of unit area a few cycles long. Outside the pulse the motion is not
changed, and everywhere d, v and the acceleration that is applied are derivatives of one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from beamsim.inputs.profiles import Leg, Profile
from beamsim.summaries import Entry, Number
from beamsim.typing import Complexes, Floats, Ints

TURNS_ROUND_OFF = 1e-9  # cycles; a smaller difference is round-off


@cache
def _path() -> tuple[Floats, Floats]:
    """Nodes r and weights of an integral from 0 to infinity whose integrand falls as exp(-r / sqrt(2)) or faster.

    The trapezoidal rule in x with :math:`r = e^{x - e^{-4-x}}`, so that the integrand fades faster than exponentially
    at both ends (H. Takahasi and M. Mori, Publ. RIMS 9, 1974). It is exact to round-off, also where the integrand
    changes within r = 0.001, as in a sweep of p = 1,000.
    """
    x = np.arange(-7.8, 4.05, 0.1)
    fading = np.exp(-4.0 - x)
    r = np.exp(x - fading)
    return r, 0.1 * r * (1.0 + fading)


def drift_free(leg: Leg, power: float, frequency_hz: Floats) -> tuple[Complexes, Complexes]:
    """Complex factors of velocity and displacement without drift.

    Parameters
    ----------
    leg : direction and rate of the sweep.
    power : exponent s of the frequency in the acceleration amplitude.
    frequency_hz : (F,) Hz; the sweep law is continued beyond the ends of the leg.

    Returns
    -------
    tuple
        K_v and K_d, (F,) each; 1 for an infinitely slow sweep; see the equations above.
    """
    p = leg.change_per_radian(frequency_hz)
    turn = np.exp(-0.25j * np.pi * np.sign(leg.signed_rate))
    velocity, displacement = (np.zeros(frequency_hz.shape, dtype=complex) for _ in range(2))
    for r, weight in zip(*_path(), strict=True):
        y = turn * r
        z = 1j * p * y
        growth = 0.5 * np.log1p(2 * z.real + np.abs(z) ** 2) + 1j * np.arctan2(z.imag, 1 + z.real)  # log(1 + z)
        if leg.logarithmic:
            value, arm = np.exp((power - 1) * growth - y), growth / (1j * p)
        else:
            value, arm = np.exp(power * growth - 0.5j * p * y**2 - y), y
        value *= turn * weight
        velocity += value
        displacement += value * arm
    return velocity, displacement


def _along_steep_line(leg: Leg, power: float, quiet_end_hz: float, frequency_hz: Floats) -> tuple[Complexes, Complexes]:
    """The same factors (F,), integrated in time from the end with the lower level.

    The displacement is the integral of the acceleration times the remaining time.
    """
    from scipy.integrate import quad_vec

    first, first_nu = np.array(quiet_end_hz), 2j * np.pi * quiet_end_hz
    time = leg.time_from(first, frequency_hz)

    def acceleration(t: Floats) -> Complexes:
        turns = leg.turns_after(first, t)
        return np.asarray((leg.frequency_after(first, t) / quiet_end_hz) ** power * np.exp(2j * np.pi * turns))

    def integrands(x: float) -> Complexes:
        change = first_nu * time * acceleration(x * time)
        return np.array([change, first_nu * time * (1 - x) * change])

    gained, _ = quad_vec(integrands, 0.0, 1.0, epsabs=1e-14, epsrel=1e-13, norm="max", limit=1000)
    K_v, K_d = drift_free(leg, 0.0, np.array([quiet_end_hz]))
    ratio = 2j * np.pi * frequency_hz / first_nu
    now = acceleration(time)
    return (K_v + gained[0]) / now * ratio, (K_d + K_v * first_nu * time + gained[1]) / now * ratio**2


def motion_without_drift(
    leg: Leg, profile: Profile, piece: int, frequency_hz: Floats, alpha: Complexes
) -> tuple[Complexes, Complexes]:
    """Complex velocity and displacement of a base on one piece of a profile.

    Parameters
    ----------
    leg : direction and rate of the sweep.
    profile : level over frequency.
    piece : index of the profile's piece.
    frequency_hz : (F,) Hz, on that piece.
    alpha : (F,) m/s^2, complex accelerations at these frequencies.

    Returns
    -------
    tuple
        (F,) m/s and (F,) m.
    """
    power = float(profile.power[piece])
    low, high = sorted((leg.first_hz, leg.last_hz))
    if piece > 0:
        low = max(low, float(profile.edge[piece]))
    if piece + 1 < profile.edge.size:
        high = min(high, float(profile.edge[piece + 1]))
    if abs(power * leg.change_per_radian(np.array(low))) > 0.5:  # of the logarithm of the level in a radian
        factors = _along_steep_line(leg, power, low if power > 0 else high, frequency_hz)
    else:
        factors = drift_free(leg, power, frequency_hz)
    nu = 2j * np.pi * frequency_hz
    return alpha / nu * factors[0], alpha / nu**2 * factors[1]


@cache
def _pulse() -> tuple[Polynomial, Polynomial, Polynomial]:
    """A pulse of unit area on [-1, 1], with its integral and double integral from -1."""
    pulse = 35 / 32 * Polynomial([1.0, 0.0, -1.0]) ** 3
    rise = pulse.integ(lbnd=-1)
    return pulse, rise, rise.integ(lbnd=-1)


@dataclass(frozen=True)
class Correction:
    """A pulse of the base acceleration that removes a jump of the drift-free motion."""

    time: float  # s, time of the jump
    half_width: float  # s
    velocity: float  # m/s, J_v
    displacement: float  # m, J_d
    level: float  # m/s^2, the larger of the levels at the jump

    def displacement_about(self, time: Floats) -> Floats:
        """(T, 9) Taylor coefficients of the added displacement about given times.

        Before the jump this is the double integral of the pulse; after it, the double integral minus the jump's own
        effect.
        """
        _, rise, ramp = _pulse()
        x = (time - self.time) / self.half_width
        out = np.zeros((x.size, ramp.degree() + 1))
        inside = np.abs(x) < 1.0
        x = x[inside]
        total = self.velocity * self.half_width * ramp + self.displacement * rise
        factor = 1.0
        for k in range(out.shape[1]):
            out[inside, k] = (total if k == 0 else total.deriv(k))(x) * factor
            factor /= (k + 1) * self.half_width
        after = x > 0
        rows = np.flatnonzero(inside)[after]
        out[rows, 0] -= self.velocity * self.half_width * x[after] + self.displacement
        out[rows, 1] -= self.velocity
        return out

    def acceleration(self, time: Floats) -> Floats:
        """Acceleration of the pulse at times (T,), m/s^2."""
        x = (time - self.time) / self.half_width
        shape, _, _ = _pulse()
        pulse = self.velocity / self.half_width * shape(x) + self.displacement / self.half_width**2 * shape.deriv()(x)
        return np.where(np.abs(x) < 1.0, pulse, 0.0)


@dataclass(frozen=True)
class CorrectionSize:
    """Size of the largest correction of a sweep."""

    ENTRIES: ClassVar[tuple[Entry, ...]] = (  # of a summary
        Entry(
            "base_correction_m_s2",
            "m/s^2",
            "largest correction that keeps the motion of a swept base continuous",
            form=Number,
        ),
        Entry(
            "base_correction_share",
            "1",
            "that correction over the level of the sweep there",
            form=Number,
        ),
    )
    acceleration: float  # m/s^2, largest correction of the base acceleration
    share: float  # the correction over the level of the sweep at that time
    time: float  # s, time of the largest correction

    @classmethod
    def of(cls, corrections: Sequence[Correction]) -> CorrectionSize:
        """The size of the correction that is largest relative to the level; overlapping corrections are added."""
        largest = cls(0.0, 0.0, 0.0)
        for correction in corrections:
            near = correction.time + correction.half_width * np.linspace(-1.0, 1.0, 201)
            overlapping = [
                c for c in corrections if abs(c.time - correction.time) < c.half_width + correction.half_width
            ]
            total = np.abs(np.sum([c.acceleration(near) for c in overlapping], axis=0))
            k = int(total.argmax())
            if total[k] > largest.share * correction.level:
                largest = cls(float(total[k]), float(total[k]) / correction.level, float(near[k]))
        return largest

    def summary(self) -> dict[str, float]:
        """Entries for the summary of a run or sweep."""
        return {"base_correction_m_s2": self.acceleration, "base_correction_share": self.share}

    def warnings(self, *, stepped_levels: bool) -> list[str]:
        """Warnings about a large correction; ``stepped_levels``: whether each level lasts up to the next."""
        if self.share <= 0.01:
            return []
        return [
            f"the base's acceleration is corrected by up to {self.acceleration:.3g} m/s^2 ({self.share:.1%} of the "
            f"level) near {self.time:.4g} s, where its velocity would jump otherwise: "
            + ("let the level change over several cycles (between: log_log), or " if stepped_levels else "")
            + "sweep more slowly"
        ]


def jumps(legs: Sequence[Leg], profile: Profile, phase: float) -> tuple[Correction, ...]:
    """Corrections of a sweep: at corners and steps of the profile, and where the direction changes.

    Parameters
    ----------
    legs : directions of the sweep, in order.
    profile : level over frequency.
    phase : of the sine at the start, rad.

    Returns
    -------
    tuple
        Corrections in order of time.
    """
    corrections = []
    turns, time = 0.0, 0.0
    before: tuple[Leg, int] | None = None  # leg and piece of the profile
    for leg in legs:
        begins, pieces = leg_pieces(leg, profile, turns % 1.0)
        for begin, piece in zip(begins, pieces, strict=True):
            if before is not None:
                frequency = float(leg.frequency(begin))
                angle = phase + 2 * np.pi * (turns % 1.0 + begin % 1.0)
                start = time + float(leg.time_at(begin))
                corrections.append(_correction(before, (leg, piece), frequency, profile, start, angle))
            before = (leg, piece)
        turns += leg.cycles
        time += leg.duration
    return tuple(corrections)


def leg_pieces(leg: Leg, profile: Profile, cycle_fraction: float) -> tuple[Floats, Ints]:
    """Start of each piece of the profile, in cycles since the start of a leg, and the indices of the pieces.

    An edge that coincides with the end of a cycle up to round-off is moved there.

    Parameters
    ----------
    leg : direction of the sweep.
    profile : level over frequency.
    cycle_fraction : completed fraction of a cycle at the start of the leg.

    Returns
    -------
    tuple
        (P,) turns and (P,) numbers.
    """
    low, high = sorted((leg.first_hz, leg.last_hz))
    turns = np.sort(leg.turns(profile.edge[(profile.edge > low) & (profile.edge < high)]))
    whole = np.round(turns + cycle_fraction) - cycle_fraction
    turns = np.where(np.abs(turns - whole) < TURNS_ROUND_OFF, whole, turns)
    turns = turns[(turns > TURNS_ROUND_OFF) & (turns < leg.cycles - TURNS_ROUND_OFF)]
    bounds = np.concatenate([[0.0], turns, [leg.cycles]])
    return bounds[:-1], profile.piece(leg.frequency(0.5 * (bounds[1:] + bounds[:-1])))


def _correction(
    before: tuple[Leg, int], after: tuple[Leg, int], frequency_hz: float, profile: Profile, time: float, angle: float
) -> Correction:
    levels, velocities, displacements = [], [], []
    for leg, piece in (before, after):
        level = float(profile.amplitude[piece] * (frequency_hz / profile.edge[piece]) ** profile.power[piece])
        alpha = np.array([-1j * level * np.exp(1j * angle)])  # Re[-i e^{i phi}] = sin phi
        velocity, displacement = motion_without_drift(leg, profile, piece, np.array([frequency_hz]), alpha)
        levels.append(level)
        velocities.append(float(velocity[0].real))
        displacements.append(float(displacement[0].real))
    half_width = 2.0 / frequency_hz  # two cycles
    return Correction(time, half_width, velocities[1] - velocities[0], displacements[1] - displacements[0], max(levels))
