"""The backbone of a nonlinear normal mode, through the tongues of its internal resonances.

Where n times the mode's frequency meets another mode's, the branch of periodic motions turns off into a *tongue*: its
energy goes over to the other mode, and the parameter turns back. The backbone is then not connected. It is followed
here at fixed parameters; a tongue is traced as a branch of its own, and the backbone begun again beyond it from the
motion dominated by the mode asked for. Such jumps are kept: nothing carries on from a point that has not converged.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from beamsim.dynamics.continuation import BranchPoint, Settings, correct
from beamsim.dynamics.reversible import BrakeOrbits

__all__ = ["Backbone", "Jump", "Tongue"]

Floats = NDArray[np.float64]

STEPS = (1.0, 0.7, 1.4, 0.4)  # of the step in the parameter, tried in turn
SHORTER = (0.12, 0.03, 0.008)  # the same where the nonlinearity is strong
CLEAR = 0.95  # share of a motion that is no part of a tongue
GONE_OVER = 0.02  # of the energy left in the mode asked for ends a tongue's tracing
LEAST_SHARE = 0.5  # of the energy in the mode asked for
FURTHEST = 0.25  # from the prediction, in scaled unknowns, for a point to belong to the backbone
FURTHEST_JUMP = 0.8  # the same beyond a tongue
JUMP_ITERATIONS = 12  # of Newton's method there
LONGEST_JUMP = 64  # steps


@dataclass(frozen=True)
class Tongue:
    """A branch of internal resonance."""

    mode: int  # the other mode, from 0
    ratio: int  # n: the other mode makes n oscillations in a period
    parameter: float  # where it leaves the backbone
    points: list[BranchPoint]
    status: str


@dataclass(frozen=True)
class Jump:
    """A gap in the backbone, bridged by starting again."""

    start: float  # parameter of the last point before
    end: float  # parameter of the first point beyond
    mode: int  # the other mode of the resonance, from 0; -1 where it isn't known
    ratio: int  # n of n:1; 0 where it isn't known


@dataclass
class Backbone:
    """Iterate over it for the backbone's points; tongues, jumps and the status are kept beside.

    Parameters
    ----------
    orbits : the shooting problem (stiffness factor or energy).
    start : a converged motion, dominated by ``mode``.
    end : the last parameter (the logarithm of the energy where that is followed).
    mode : from 0.
    points : about how many points to make of the path.
    largest_ratio : internal resonances of a higher order are stepped over (a jump is kept where the step was longer
        than usual).
    tongue_points : length of a traced tongue.
    """

    orbits: BrakeOrbits
    start: BranchPoint
    end: float
    mode: int
    points: int = 100
    largest_ratio: int = 12
    tongue_points: int = 120
    settings: Settings = field(default_factory=lambda: Settings(iterations=6))
    status: str = "not begun"
    tongues: list[Tongue] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    _clear: list[BranchPoint] = field(default_factory=list, repr=False)
    _recent: list[BranchPoint] = field(default_factory=list, repr=False)

    def share(self, point: BranchPoint) -> float:
        """Share of the energy in the mode asked for."""
        q, _, factor, _ = self.orbits.split(point.u)
        return float(self.orbits.share(q, factor)[self.mode])

    def __iter__(self) -> Iterator[BranchPoint]:
        begin = self.start.parameter
        forward = 1.0 if self.end > begin else -1.0
        full = abs(self.end - begin) / self.points
        a, clean = self._pointing(self.start, forward), self.start
        step = full
        self._clear = [a]
        yield a
        while (self.end - a.parameter) * forward > 1e-12 * full:
            left = abs(self.end - a.parameter)
            b = None
            for part in STEPS:
                reach = min(part * step, left)
                b = self._at(a, clean, a.parameter + forward * reach, forward)
                if b is not None or (part > 1.0 and reach == left):
                    break
            if b is None and self.share(a) > CLEAR:
                b, step = self._shorter(a, step, left, forward)
            if b is None:
                b = self._beyond(a, clean, full, forward)
                if b is None:
                    self.status = (
                        f"stopped at parameter {a.parameter:.9g}: no motion dominated by mode {self.mode + 1} was "
                        f"found within {LONGEST_JUMP} steps beyond"
                    )
                    return
            else:
                self._crossed(a, b, forward)
            yield b
            a = b
            step = min(full, 1.6 * step)
            self._recent = [*self._recent[-3:], b]
            if self.share(b) > 0.5 * (1.0 + LEAST_SHARE):
                clean = b
                self._clear.append(b)
        self.status = f"complete: reached {self.end:.9g}"

    def _shorter(self, a: BranchPoint, step: float, left: float, forward: float) -> tuple[BranchPoint | None, float]:
        """A much shorter step, for strong nonlinearity far from any tongue."""
        for part in SHORTER:
            reach = min(part * step, left)
            t = a.tangent
            if abs(t[-1]) < 1e-3:
                break
            guess = a.u + forward * reach / (t[-1] * a.scale[-1]) * t * a.scale
            b = self._solve(guess, a.parameter + forward * reach, FURTHEST, forward)
            if b is not None and self.share(b) > CLEAR:
                return b, part * step
        return None, step

    @staticmethod
    def _pointing(point: BranchPoint, forward: float) -> BranchPoint:
        if point.tangent[-1] * forward < 0:
            return replace(point, tangent=-point.tangent, orientation=-point.orientation)
        return point

    def _at(self, a: BranchPoint, clean: BranchPoint, value: float, forward: float) -> BranchPoint | None:
        """The motion dominated by the mode at a parameter, close to what its neighbours predict."""
        for guess in self._predictions(a, clean, value):
            point = self._solve(guess, value, FURTHEST, forward)
            if point is not None:
                return point
        return None

    def _predictions(self, a: BranchPoint, clean: BranchPoint, value: float) -> Iterator[Floats]:
        """Guesses close to a: along the tangent where it isn't that of a tongue, along the last chord, and a itself."""
        t = a.tangent
        if abs(t[-1]) > 0.7 or (abs(t[-1]) > 0.7 * float(np.linalg.norm(t[-2:])) and float(np.abs(t[:-2]).max()) < 0.3):
            yield a.u + (value - a.parameter) / (t[-1] * a.scale[-1]) * t * a.scale
        before = [p for p in self._clear if p is not clean and abs(p.parameter - clean.parameter) > 1e-12]
        if before:
            p = before[-1]
            yield clean.u + (value - clean.parameter) / (clean.parameter - p.parameter) * (clean.u - p.u)
        yield next(self._guesses(clean, value))

    def _solve(self, guess: Floats, value: float, furthest: float, forward: float) -> BranchPoint | None:
        guess[-1] = value
        scale = self.orbits.scale(guess)[0]
        row = np.zeros(guess.size)
        row[-1] = 1.0
        settings = self.settings if furthest <= FURTHEST else replace(self.settings, iterations=JUMP_ITERATIONS)
        point = correct(self.orbits, guess, row, value / float(scale[-1]), scale, settings, furthest=furthest)
        if point is None or self.share(point) <= LEAST_SHARE or not self._once(point):
            return None
        return self._pointing(point, forward)

    def _once(self, point: BranchPoint) -> bool:
        """Whether the mode has swung to its other side half a period on: a motion run through twice has not."""
        q, _, factor, _ = self.orbits.split(point.u)
        rest = getattr(self.orbits.family, "rest", None)
        still = 0.0 if rest is None else rest(factor)
        shape = self.orbits.vectors[:, self.mode]
        other = point.data.passage.end[: self.orbits.n]
        return float(shape @ (q - still)) * float(shape @ (other - still)) < 0

    def _guesses(self, clean: BranchPoint, value: float) -> Iterator[Floats]:
        """First guesses beyond a tongue: the last clear motion, and the linear mode alone, at periods extrapolated."""
        periods = [float(clean.u[-2])]
        history = [(p.parameter, np.log(p.u[-2])) for p in self._clear[-6:]]
        if len(history) >= 3:
            x, y = np.array(history).T
            slope = np.polyfit(x - x[-1], y, 1)
            periods.insert(0, float(np.exp(np.polyval(slope, value - x[-1]))))
        estimate = getattr(self.orbits.family, "period_estimate", None)
        if estimate is not None:
            _, _, factor, energy = self.orbits.split(np.append(clean.u[:-1], value))
            known = estimate(self.mode, factor, energy)
            if known is not None:
                periods.insert(0, known)
        q, _, factor, _ = self.orbits.split(clean.u)
        energy = self.orbits.split(np.append(clean.u[:-1], value))[3]
        rest = getattr(self.orbits.family, "rest", None)
        still = np.zeros_like(q) if rest is None else rest(factor)
        shape = self.orbits.vectors[:, self.mode]
        size = np.sqrt(2.0 * energy) / float(self.orbits.omega[self.mode])
        pure = still + shape * np.copysign(size, shape @ (q - still))
        for period in periods:
            yield self.orbits.unknowns(pure, period, value)
            yield self.orbits.unknowns(q.copy(), period, value)

    def _beyond(self, a: BranchPoint, clean: BranchPoint, full: float, forward: float) -> BranchPoint | None:
        """Trace the tongue that begins after a, and begin again beyond."""
        mode, ratio = self._partner(a)
        near = ratio > 0 and abs(self._own(a, mode)) < 0.15
        tongue = self._trace(a, mode) if near else None
        if tongue is not None:
            ratio = tongue.ratio
        distance = 0.5 * full
        while distance <= LONGEST_JUMP * full:
            value = a.parameter + forward * distance
            if (value - self.end) * forward > 0:
                value = self.end
            for guess in self._guesses(clean, value):
                b = self._solve(guess, value, FURTHEST_JUMP, forward)
                if b is not None:
                    self.jumps.append(Jump(a.parameter, value, mode, ratio))
                    return b
            if value == self.end:
                return None
            distance *= 1.5
        return None

    def _crossed(self, a: BranchPoint, b: BranchPoint, forward: float) -> None:
        """Trace the tongues of low order that lie between two neighbours.

        A disturbance of the shape in mode r alone comes to rest again after half a period where
        ``n omega = omega_r``: there the derivative of its velocity by its own amplitude changes sign.
        """
        for mode in range(self.orbits.n):
            if mode == self.mode or self._own(a, mode) * self._own(b, mode) > 0:
                continue
            if self._order(a, mode) > self.largest_ratio + 0.5:
                continue
            left, right = a, b
            for _ in range(10):
                middle = self._at(left, left, 0.5 * (left.parameter + right.parameter), forward)
                if middle is None:
                    break
                if self._own(middle, mode) * self._own(a, mode) > 0:
                    left = middle
                else:
                    right = middle
            tongue = self._trace(left, mode)
            if tongue is not None:
                self.jumps.append(Jump(left.parameter, right.parameter, mode, tongue.ratio))

    def _own(self, point: BranchPoint, mode: int) -> float:
        """Derivative of a mode's velocity after half a period by its amplitude at the start, over its frequency."""
        return self.orbits.own(point, mode)

    def _order(self, point: BranchPoint, mode: int) -> float:
        return float(self.orbits.omega[mode]) * self.orbits.split(point.u)[1] / (2 * np.pi)

    def _partner(self, a: BranchPoint) -> tuple[int, int]:
        """The other mode (from 0) of a resonance of low order close to a, and its rough order; (-1, 0) if there is
        none."""
        n = self.orbits.n
        best, closest = (-1, 0), 0.4
        for mode in range(n):
            order = self._order(a, mode)
            distance = abs(self._own(a, mode))
            if mode != self.mode and order <= self.largest_ratio + 0.5 and distance < closest:
                best, closest = (mode, max(round(order), 1)), distance
        return best

    def _trace(self, start: BranchPoint, other: int) -> Tongue | None:
        """Follow the branch itself into the tongue of another mode, over the thinner tongues of third modes that cross
        it."""
        order = round(self._order(start, other))
        near = 4.0 * abs(self.end - self.start.parameter) / self.points
        for known in self.tongues:
            if (known.mode, known.ratio) == (other, order) and abs(known.parameter - start.parameter) < near:
                return known
        for first in (2e-3, 3e-2):
            tongue = self._traced(start, other, first)
            if tongue is not None:
                self.tongues.append(tongue)
                return tongue
        return None

    def _traced(self, start: BranchPoint, other: int, ds: float) -> Tongue | None:
        """One attempt with a first step of a certain length.

        The predictor is the chord of the last two points: the tangent would be led astray by third modes.
        """
        points = [start]
        status = f"stopped after {self.tongue_points} points, the most asked for"
        chord = start.tangent * start.scale
        scale = self.orbits.scale(start.u)[0]
        third = np.delete(start.tangent[: self.orbits.n], [self.mode, other])
        if float(third @ third) > 0.2:
            before = [p for p in self._recent if p is not start and abs(p.parameter - start.parameter) > 1e-9]
            chord = np.zeros_like(start.u)
            chord[-1] = float(np.sign(self.end - start.parameter))
            if before:
                chord = start.u - before[-1].u
        low, high = sorted((self.start.parameter, self.end))
        while len(points) < self.tongue_points:
            a = points[-1]
            row = chord / scale
            row /= np.linalg.norm(row)
            new = None
            for part in STEPS:
                w = a.u / scale + part * ds * row
                b = correct(
                    self.orbits, w * scale, row, float(row @ w), scale, self.settings, row, furthest=1.5 * part * ds
                )
                if b is None or not low <= b.parameter <= high:
                    continue
                q, _, factor, _ = self.orbits.split(b.u)
                share = self.orbits.share(q, factor)
                if share[self.mode] + share[other] > 0.8:
                    new = b
                    break
            if new is None:
                ds *= 0.4
                if ds < 1e-6:
                    status = "stopped: no further motion of these two modes was found"
                    break
                continue
            chord = new.u - a.u
            points.append(new)
            if share[self.mode] < GONE_OVER:
                status = "complete: the energy has gone over to the other mode"
                break
            ds = min(0.08, 1.4 * ds)
        shares = [self.share(p) for p in points]
        if min(shares) > LEAST_SHARE:
            return None
        deepest = points[int(np.argmin(shares))]
        return Tongue(other, self._count(deepest, other), start.parameter, points, status)

    def _count(self, point: BranchPoint, mode: int) -> int:
        """Oscillations of one modal coordinate in a period, from the changes of sign of its velocity in half of it."""
        passage, n = point.data.passage, self.orbits.n
        period = self.orbits.split(point.u)[1]
        samples = 32 * (2 + round(float(self.orbits.omega[mode]) * period))
        times = np.linspace(0.0, 0.5 * period, samples)[1:-1]
        v = point.data.flow.states_at(passage, times)[:, n:] @ self.orbits.vectors[:, mode]
        return int(np.count_nonzero(v[:-1] * v[1:] < 0)) + 1
