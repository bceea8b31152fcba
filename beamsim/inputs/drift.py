"""Base motion of a swept sine without drift.

An acceleration :math:`\\mathrm{Re}[\\alpha e^{i\\varphi}]` whose frequency changes leaves two constants in its double
integral. On a smooth stretch of the sweep (one direction, one power of the frequency) they are fixed by integrating
from that side on which the frequency grows without bound, along a path in the complex plane on which the exponential
decays. With :math:`p = \\dot f / (2\\pi f^2)` and the amplitude :math:`\\alpha \\propto f^s`,

.. math:: v = \\mathrm{Re}\\Big[\\frac{\\alpha}{i\\omega} K_v e^{i\\varphi}\\Big], \\qquad
          d = \\mathrm{Re}\\Big[\\frac{\\alpha}{(i\\omega)^2} K_d e^{i\\varphi}\\Big],

.. math:: K_v = \\int_0^\\infty g(y)\\, e^{-y} dy, \\qquad K_d = \\int_0^\\infty h(y)\\, g(y)\\, e^{-y} dy

with :math:`g = (1 + ipy)^s e^{-ipy^2/2}`, :math:`h = y` for a linear sweep and :math:`g = (1 + ipy)^{s-1}`,
:math:`h = \\log(1 + ipy) / (ip)` for a logarithmic one. Both factors tend to 1 in slow sweeps.

Where the level itself changes within a radian, as on the steep line of a log-log table that stands for a step, g grows
faster than the exponential decays. There the acceleration is integrated along the time, from the quieter end of the
stretch, where the motion is the one that belongs to a constant level.

Where two stretches meet, at a corner or step of the profile or at a turn, v and d jump by :math:`J_v` and
:math:`J_d`. The jumps are impulses :math:`J_v \\delta + J_d \\delta'` of the acceleration; they are replaced by
:math:`J_v w + J_d w'`, where w is a smooth pulse of unit area a few cycles long. Outside the pulse the motion is not
changed, and everywhere d, v and the acceleration that is applied are derivatives of one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.fields import Entry, attribute, declared
from beamsim.inputs.legs import Leg
from beamsim.inputs.profiles import Profile
from beamsim.typing import Complexes, Floats, Ints

if TYPE_CHECKING:
    from numpy.polynomial import Polynomial

SLOW = 0.01  # change of frequency per radian up to which the Gauss-Laguerre rule is exact to round-off
LAGUERRE_NODES = 12
STEP = 0.05  # of the double-exponential rule
SAME_TURNS = 1e-9  # cycles that are not told apart
SAMPLES = 201  # of a pulse, to find its largest value
WORTH_SAYING = 0.01  # share of the level
HALF_WIDTH = 2.0  # of a correction, in cycles
LARGE_POWER = 4.0  # up to which the factors are accurate in a sweep of any rate
STEEP = 0.5  # change of the logarithm of the level per radian, above which a large power is integrated in time
PANEL = 1.0  # radians, and change of the logarithm of the level, on a panel of the Gauss-Legendre rule
LEGENDRE_NODES = 16


@cache
def _pulse() -> tuple[Polynomial, Polynomial, Polynomial]:
    """A pulse of unit area on [-1, 1], its integral and its double integral from -1."""
    from numpy.polynomial import Polynomial  # a tenth of the import of NumPy, which sweeps alone need

    pulse = 35 / 32 * Polynomial([1.0, 0.0, -1.0]) ** 3
    rise = pulse.integ(lbnd=-1)
    return pulse, rise, rise.integ(lbnd=-1)


def drift_free(leg: Leg, power: float, frequency_hz: Floats) -> tuple[Complexes, Complexes]:
    """Factors (K_v, K_d) of the velocity and the displacement without drift, at frequencies (F,) of a leg.

    Accurate to about 1e-14 for powers up to `LARGE_POWER`, and for others in sweeps in which the level does not change
    by more than `STEEP` in a radian. In slow sweeps by Gauss-Laguerre quadrature, which is exact for the first terms of
    the asymptotic series; else by double-exponential quadrature (H. Takahasi and M. Mori, 1974) on a path turned by 45
    degrees, on which the integrands neither oscillate fast nor come near their branch points.
    """
    change = leg.change_per_radian(frequency_hz)
    velocity, displacement = np.empty(change.shape, dtype=complex), np.empty(change.shape, dtype=complex)
    slow = np.abs(change) <= SLOW
    for part, rule in ((slow, _laguerre), (~slow, _double_exponential)):
        if part.any():
            p = np.abs(change[part])
            velocity[part], displacement[part] = _integrals(p, power, leg.logarithmic, *rule(p, leg.logarithmic))
    falling = change < 0
    return np.where(falling, velocity.conj(), velocity), np.where(falling, displacement.conj(), displacement)


def _laguerre(p: Floats, logarithmic: bool) -> tuple[Complexes, Complexes, Floats]:
    node, weight = _laguerre_rule()
    return node.astype(complex), (weight * np.exp(node)).astype(complex), np.ones(p.shape)


@cache
def _laguerre_rule() -> tuple[Floats, Floats]:
    node, weight = np.polynomial.laguerre.laggauss(LAGUERRE_NODES)
    return node, weight


def _double_exponential(p: Floats, logarithmic: bool) -> tuple[Complexes, Complexes, Floats]:
    x = np.arange(-5.5, 5.0, STEP)
    turn = np.exp(-0.25j * np.pi)
    node = np.exp(x - np.exp(-x)) * turn
    # the integrand of a linear sweep decays as exp(-p |y|^2 / 2) where that is faster
    return node, node * (1 + np.exp(-x)) * STEP, np.ones(p.shape) if logarithmic else 1 / (1 + np.sqrt(p))


def _integrals(
    p: Floats, power: float, logarithmic: bool, node: Complexes, weight: Complexes, scale: Floats
) -> tuple[Complexes, Complexes]:
    """K_v and K_d by a rule whose nodes are stretched by ``scale``."""
    velocity, displacement = np.zeros(p.shape, dtype=complex), np.zeros(p.shape, dtype=complex)
    for x, w in zip(node, weight, strict=True):
        y = scale * x
        z = 1j * p * y
        growth = 0.5 * np.log1p(2 * z.real + np.abs(z) ** 2) + 1j * np.arctan2(z.imag, 1 + z.real)  # log(1 + z)
        if logarithmic:
            value, arm = scale * w * np.exp((power - 1) * growth - y), growth / (1j * p)
        else:
            value, arm = scale * w * np.exp(power * growth - y - 0.5 * z * y), y
        velocity += value
        displacement += value * arm
    return velocity, displacement


@cache
def _legendre_rule() -> tuple[Floats, Floats]:
    node, weight = np.polynomial.legendre.leggauss(LEGENDRE_NODES)
    return node, weight


def motion_without_drift(
    leg: Leg, profile: Profile, piece: int, frequency_hz: Floats, alpha: Complexes
) -> tuple[Complexes, Complexes]:
    """Complex velocity and displacement (F,) that belong to accelerations ``alpha`` (F,) on one piece of a profile."""
    power = float(profile.power[piece])
    low, high = sorted((leg.first_hz, leg.last_hz))
    if piece > 0:
        low = max(low, float(profile.edge[piece]))
    if piece + 1 < profile.edge.size:
        high = min(high, float(profile.edge[piece + 1]))
    fastest = abs(float(leg.change_per_radian(np.array(low))))
    if abs(power) > LARGE_POWER and abs(power) * fastest > STEEP:
        return _from_the_quiet_end(leg, profile, piece, (low, high) if power > 0 else (high, low), frequency_hz, alpha)
    K_v, K_d = drift_free(leg, power, frequency_hz)
    nu = 2j * np.pi * frequency_hz
    return alpha / nu * K_v, alpha / nu**2 * K_d


def _from_the_quiet_end(
    leg: Leg, profile: Profile, piece: int, ends: tuple[float, float], frequency_hz: Floats, alpha: Complexes
) -> tuple[Complexes, Complexes]:
    """The same by Gauss-Legendre quadrature in time, from the first of the two ``ends`` of the piece, Hz."""
    quiet = np.array(ends[0])
    power, rate = float(profile.power[piece]), leg.signed_rate
    amplitude = float(profile.amplitude[piece] * (ends[0] / profile.edge[piece]) ** power)

    def time_to(frequency: Floats) -> Floats:
        return np.asarray((np.log(frequency / quiet) if leg.logarithmic else frequency - quiet) / rate)

    def turning(time: Floats) -> Complexes:
        return np.asarray(np.exp(2j * np.pi * leg.turns_after(quiet, time)))

    time = time_to(frequency_hz)
    order = np.argsort(np.abs(time), kind="stable")
    stops = np.concatenate([[0.0], time[order]])
    swing = 2 * np.pi * leg.turns_after(quiet, stops)
    growth = power * np.log(leg.frequency_after(quiet, stops) / quiet)
    panels = np.ceil(np.maximum(np.abs(np.diff(swing)), np.abs(np.diff(growth))) / PANEL).astype(int).clip(1)
    gap = np.repeat(np.arange(panels.size), panels)
    within = np.arange(gap.size) - np.repeat(np.cumsum(panels) - panels, panels)
    length = (np.diff(stops) / panels)[gap]
    begin = stops[gap] + within * length
    node, weight = _legendre_rule()
    to_end = 0.5 * np.outer(length, 1.0 - node)  # s, from a node to the end of its panel
    at = (begin + length)[:, None] - to_end
    level = amplitude * (leg.frequency_after(quiet, at) / quiet) ** power
    sine = 0.5 * length[:, None] * weight * level * turning(at)
    nu = 2j * np.pi * ends[0]
    K_v, K_d = drift_free(leg, 0.0, quiet[None])
    velocity = amplitude / nu * K_v[0] + np.concatenate([[0.0], np.cumsum(sine.sum(axis=1))])
    gain = velocity[:-1] * length + (sine * to_end).sum(axis=1)
    displacement = amplitude / nu**2 * K_d[0] + np.cumsum(gain)
    last = np.cumsum(panels) - 1
    out = np.empty((2, time.size), dtype=complex)
    out[:, order] = velocity[last + 1], displacement[last]
    out *= alpha / np.abs(alpha) / turning(time)
    return out[0], out[1]


@dataclass(frozen=True)
class Correction:
    """The pulse that takes up a jump of the motion without drift."""

    time: float  # s, of the jump
    half_width: float  # s
    velocity: float  # m/s, J_v
    displacement: float  # m, J_d
    level: float  # m/s^2, the larger of the levels at the jump

    def displacement_about(self, time: Floats) -> Floats:
        """(T, 9) coefficients, in powers of the time since each of some times, of what is added to the displacement.

        Before the jump the pulse's own double integral; after it less what the jump itself has added.
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
        """The pulse at times (T,), m/s^2."""
        x = (time - self.time) / self.half_width
        shape, _, _ = _pulse()
        pulse = self.velocity / self.half_width * shape(x) + self.displacement / self.half_width**2 * shape.deriv()(x)
        return np.where(np.abs(x) < 1.0, pulse, 0.0)


@declared
class CorrectionSize:
    """How large the largest of some corrections is."""

    ENTRIES: ClassVar[tuple[Entry, ...]] = (  # of a summary
        Entry("base_correction_m_s2", "m/s^2", "largest correction that keeps the motion of a swept base continuous"),
        Entry("base_correction_share", "1", "that correction over the level of the sweep there", "base correction"),
    )
    acceleration: float = attribute("m/s^2", "largest correction of the base's acceleration")
    share: float = attribute("1", "that correction over the level of the sweep there")
    time: float = attribute("s", "when that is")

    @classmethod
    def of(cls, corrections: Sequence[Correction]) -> CorrectionSize:
        """The size of the correction that is largest in relation to the level; overlapping ones add up."""
        largest = cls(0.0, 0.0, 0.0)
        for correction in corrections:
            near = correction.time + correction.half_width * np.linspace(-1.0, 1.0, SAMPLES)
            overlapping = [
                c for c in corrections if abs(c.time - correction.time) < c.half_width + correction.half_width
            ]
            total = np.abs(np.sum([c.acceleration(near) for c in overlapping], axis=0))
            k = int(total.argmax())
            if total[k] > largest.share * correction.level:
                largest = cls(float(total[k]), float(total[k]) / correction.level, float(near[k]))
        return largest

    def summary(self) -> dict[str, float]:
        """Its entries in the summary of a run or a sweep."""
        return {"base_correction_m_s2": self.acceleration, "base_correction_share": self.share}

    def warnings(self) -> list[str]:
        """What to say about it: nothing where it is small."""
        if self.share <= WORTH_SAYING:
            return []
        return [
            f"the base's acceleration is corrected by up to {self.acceleration:.3g} m/s^2 ({self.share:.1%} of the "
            f"level) near {self.time:.4g} s, where its velocity would jump otherwise: let the level change over "
            "several cycles (between: log_log), or sweep more slowly"
        ]


def jumps(legs: Sequence[Leg], profile: Profile, phase: float) -> tuple[Correction, ...]:
    """The corrections of a sweep: at the profile's corners and steps, and at turns."""
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


def leg_pieces(leg: Leg, profile: Profile, fraction: float) -> tuple[Floats, Ints]:
    """Turns since the start of a leg at which each piece of the profile begins, and the numbers of the pieces.

    An edge that lies on the end of a cycle to within round-off is moved there; ``fraction`` is the part of a cycle that
    is over at the start of the leg.
    """
    low, high = sorted((leg.first_hz, leg.last_hz))
    turns = np.sort(leg.turns(profile.edge[(profile.edge > low) & (profile.edge < high)]))
    whole = np.round(turns + fraction) - fraction
    turns = np.where(np.abs(turns - whole) < SAME_TURNS, whole, turns)
    turns = turns[(turns > SAME_TURNS) & (turns < leg.cycles - SAME_TURNS)]
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
    return Correction(
        time, HALF_WIDTH / frequency_hz, velocities[1] - velocities[0], displacements[1] - displacements[0], max(levels)
    )
