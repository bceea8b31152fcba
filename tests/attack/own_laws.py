"""Contact laws: springs and dashpots, force-deflection tables, Maxwell branches, bent springs, dry friction.

Each phase of a law is linear: rows are factors of the penetration (the stretch, of friction), its rate, 1, and the
law's own states, all in m. Written from the forces of springs and dashpots: a branch has its elastic stretch as state,
friction that of its spring, a released pad the compression of its face.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np


@dataclass(frozen=True)
class Exit:
    """An end of a phase: where a row falls through zero."""

    row: np.ndarray  # (3 + s,)
    following: int
    state: int = -1  # that starts anew, -1: none
    value: np.ndarray | None = None  # (3 + s,) row of its value
    late: float = 1.0  # of the row for a unit of a penetration that has passed zero


def unit(size, **entries):
    """A row with some entries: ``d``, ``v``, ``one`` or ``s0``, ``s1``, …"""
    row = np.zeros(size)
    for name, value in entries.items():
        row[{"d": 0, "v": 1, "one": 2}[name] if name in ("d", "v", "one") else 3 + int(name[1:])] = value
    return row


@dataclass(frozen=True)
class Curve:
    """A rising force through points, from zero on; the last slope goes on."""

    knots: tuple  # m, the first zero
    slopes: tuple  # N/m

    def segment(self, x):
        return max(int(np.searchsorted(self.knots, x, side="right")) - 1, 0)

    def line(self, i):
        """(slope, force at zero) of a segment."""
        below = sum(s * (b - a) for s, a, b in zip(self.slopes, self.knots, self.knots[1 : i + 1], strict=False))
        return self.slopes[i], below - self.slopes[i] * self.knots[i]

    def energy(self, i, x):
        """Of a segment's parabola, from zero on."""
        total = 0.0
        for j in range(i + 1):
            end = self.knots[j + 1] if j < i else x
            slope, zero = self.line(j)
            total += slope * (end**2 - self.knots[j] ** 2) / 2 + zero * (end - self.knots[j])
        return total

    def ends(self, i, row, shift):
        """Exits at the ends of a segment but the first end, of a quantity with a row."""
        one = unit(row.size, one=1.0)
        found = [Exit(row - self.knots[i] * one, i - 1 + shift, late=0.0)] if i > 0 else []
        if i + 1 < len(self.knots):
            found.append(Exit(self.knots[i + 1] * one - row, i + 1 + shift, late=0.0))
        return found


class Law:
    """What most laws are: without states of their own, static force, stored energy and ends of their own."""

    states, pushes, knots = 0, False, ()

    def touching(self, phase):
        return phase == 0

    def phase_at(self, *_):
        return 0

    def static(self, _):
        """(slope, force) under a slow penetration."""
        return 0.0, 0.0

    def rates(self, _):
        return np.zeros((0, 3))

    def stored(self, *_):
        return 0.0

    def changed(self, _):
        """With other numbers where phases change."""
        return self


class OneSided(Law):
    """A law of a curve, which has a segment for each penetration."""

    pushes = True

    @property
    def knots(self):
        return self.curve.knots

    def static(self, delta):
        slope, zero = self.curve.line(self.curve.segment(delta))
        return slope, slope * delta + zero


class Spring(Law):
    """A spring whose stretch is the state."""

    states = 1

    def force(self, _):
        return unit(4, s0=self.stiffness)

    def stored(self, _, __, states):
        return 0.5 * self.stiffness * states[0] ** 2


@dataclass(frozen=True)
class TableStop(OneSided):
    """A curve beside a dashpot while there is penetration; phases: open, then one for each segment."""

    curve: Curve
    dashpot: float

    @property
    def phases(self):
        return 1 + len(self.curve.slopes)

    def touching(self, phase):
        return phase > 0

    def phase_at(self, delta, _):
        return 1 + self.curve.segment(delta) if delta > 0 else 0

    def force(self, phase):
        if phase == 0:
            return np.zeros(3)
        slope, zero = self.curve.line(phase - 1)
        return unit(3, d=slope, v=self.dashpot, one=zero)

    def exits(self, phase):
        delta = unit(3, d=1.0)
        if phase == 0:
            return [Exit(-delta, 1)]
        ends = self.curve.ends(phase - 1, delta, 1)
        return ends if phase > 1 else [Exit(delta, 0), *ends]

    def stored(self, phase, delta, _):
        return self.curve.energy(phase - 1, delta) if phase else 0.0


@dataclass(frozen=True)
class Pad(OneSided):
    """A curve, a dashpot and Maxwell branches that never pull; phases: released on each segment, then touching.

    States: compression of the released face, then the elastic stretch of each branch. The released face is without
    force: the forces of curve, dashpot and branches balance.
    """

    curve: Curve
    dashpot: float
    branches: tuple  # (N/m, s) each

    @property
    def states(self):
        return 1 + len(self.branches)

    @property
    def phases(self):
        return 2 * len(self.curve.slopes)

    def touching(self, phase):
        return phase >= len(self.curve.slopes)

    def phase_at(self, delta, _):
        return len(self.curve.slopes) + self.curve.segment(delta) if delta > 0 else 0

    def balance(self, i, quantity):
        """Row of the force of curve and branches, the curve being compressed by a quantity with a row."""
        slope, zero = self.curve.line(i)
        row = slope * quantity + zero * unit(quantity.size, one=1.0)
        for j, (k, _) in enumerate(self.branches):
            row[4 + j] += k
        return row

    def force(self, phase):
        size, m = 3 + self.states, len(self.curve.slopes)
        if phase < m:
            return np.zeros(size)
        return self.balance(phase - m, unit(size, d=1.0)) + unit(size, v=self.dashpot)

    def rates(self, phase):
        size, m = 3 + self.states, len(self.curve.slopes)
        rows = np.zeros((self.states, size))
        if phase >= m:
            moved = unit(size, v=1.0)
        elif self.dashpot > 0:
            moved = rows[0] = -self.balance(phase, unit(size, s0=1.0)) / self.dashpot
        else:
            stiffness = self.curve.slopes[phase] + sum(k for k, _ in self.branches)
            for j, (k, time) in enumerate(self.branches):
                rows[0, 4 + j] = k / time / stiffness
            moved = rows[0]
        for j, (_, time) in enumerate(self.branches):
            rows[1 + j] = moved
            rows[1 + j, 4 + j] -= 1.0 / time
        return rows

    def exits(self, phase):
        size, m = 3 + self.states, len(self.curve.slopes)
        delta, face = unit(size, d=1.0), unit(size, s0=1.0)
        if phase < m:
            return [Exit(face - delta, m + phase), *self.curve.ends(phase, face, 0)]
        i = phase - m
        slope = self.curve.slopes[i] + sum(k for k, _ in self.branches)
        return [Exit(self.force(phase), i, 0, delta, late=slope), *self.curve.ends(i, delta, m)]

    def stored(self, phase, delta, states):
        m = len(self.curve.slopes)
        of_curve = self.curve.energy(phase - m, delta) if phase >= m else self.curve.energy(phase, states[0])
        return of_curve + sum(0.5 * k * e**2 for (k, _), e in zip(self.branches, states[1:], strict=True))


@dataclass(frozen=True)
class Bent(Law):
    """A piecewise-linear spring, less its linear part at rest; phases are its segments."""

    bends: tuple  # m
    slopes: tuple  # N/m, one more

    @property
    def phases(self):
        return len(self.slopes)

    @property
    def knots(self):
        return self.bends

    def phase_at(self, stretch, *_):
        return int(np.searchsorted(self.bends, stretch, side="right"))

    @property
    def slope_at_rest(self):
        """Of the smaller one where zero is a bend."""
        at = int(np.searchsorted(self.bends, 0.0, side="left"))
        if at < len(self.bends) and self.bends[at] == 0.0 and self.slopes[at + 1] < self.slopes[at]:
            at += 1
        return self.slopes[at]

    def line(self, segment):
        """(slope, force at zero stretch) of a segment; the force is zero at zero stretch."""
        points, force = [0.0], [0.0]
        at = self.phase_at(0.0)
        if segment >= at:
            for i in range(at, segment):
                force.append(force[-1] + self.slopes[i] * (self.bends[i] - points[-1]))
                points.append(self.bends[i])
        else:
            for i in range(at, segment, -1):
                force.append(force[-1] + self.slopes[i] * (self.bends[i - 1] - points[-1]))
                points.append(self.bends[i - 1])
        return self.slopes[segment], force[-1] - self.slopes[segment] * points[-1]

    def static(self, stretch):
        slope, zero = self.line(self.phase_at(stretch))
        return slope - self.slope_at_rest, slope * stretch + zero - self.slope_at_rest * stretch

    def force(self, phase):
        slope, zero = self.line(phase)
        return unit(3, d=slope - self.slope_at_rest, one=zero)

    def exits(self, phase):
        stretch, one = unit(3, d=1.0), unit(3, one=1.0)
        found = [Exit(stretch - self.bends[phase - 1] * one, phase - 1, late=0.0)] if phase > 0 else []
        if phase < len(self.bends):
            found.append(Exit(self.bends[phase] * one - stretch, phase + 1, late=0.0))
        return found

    def stored(self, _, stretch, __):
        ends = np.sort([0.0, stretch])
        points = np.unique([*ends, *(b for b in self.bends if ends[0] < b < ends[1])])
        total = 0.0
        for a, b in pairwise(points):
            slope, zero = self.line(self.phase_at(0.5 * (a + b)))
            total += slope * (b * b - a * a) / 2 + zero * (b - a)
        return (total if stretch > 0 else -total) - self.slope_at_rest * stretch**2 / 2

    def changed(self, change):
        return replace(self, bends=tuple(change(np.array(self.bends))))


@dataclass(frozen=True)
class SpringFriction(Spring):
    """Dry friction behind a spring, whose stretch is the state; phases: sticks, slides forwards, backwards."""

    stiffness: float
    static_limit: float  # N
    sliding: float  # N
    phases = 3

    def rates(self, phase):
        return unit(4, v=float(phase == 0))[None, :]

    def exits(self, phase):
        if phase:
            return [Exit(unit(4, v=1.0 if phase == 1 else -1.0), 0, late=0.0)]
        found = []
        for following, sign in ((1, 1.0), (2, -1.0)):
            row = unit(4, one=self.static_limit, s0=-sign * self.stiffness)
            found.append(Exit(row, following, 0, unit(4, one=sign * self.sliding / self.stiffness), late=0.0))
        return found


@dataclass(frozen=True)
class Branch(Spring):
    """A Maxwell branch that always acts, of a joint; its state is the stretch of its spring."""

    stiffness: float
    time: float  # s, of relaxation
    phases = 1

    def rates(self, _):
        return unit(4, v=1.0, s0=-1.0 / self.time)[None, :]

    def exits(self, _):
        return []


@dataclass(frozen=True)
class RigidFriction(Law):
    """Dry friction that holds a motion exactly while it sticks; phases as of `SpringFriction`."""

    static_limit: float
    sliding: float
    phases = 3

    def phase_at(self, _, rate):
        return 0 if rate == 0.0 else 1 if rate > 0 else 2

    def force(self, phase):
        return unit(3, one=(0.0, self.sliding, -self.sliding)[phase])

    def exits(self, phase):
        """Of sliding; those of sticking depend on the force that holds it."""
        return [Exit(unit(3, v=1.0 if phase == 1 else -1.0), 0, late=0.0)] if phase else []
