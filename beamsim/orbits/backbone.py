"""The backbone of a nonlinear normal mode, through the tongues of its internal resonances.

Where n times the mode's frequency meets another mode's, the branch of periodic motions turns off into a *tongue*: its
energy is transferred to the other mode, and the parameter turns back. The backbone is then not connected. It is
followed here at fixed parameters; a tongue is traced as a branch of its own, and the backbone restarts beyond it from
the motion dominated by the requested mode. Such jumps are recorded; a point that has not converged is never used.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint, OrbitBranch, reached_end, too_many_points
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits
from beamsim.orbits.tongues import LEAST_SHARE, Tongues, resonance_between
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind, Where
from beamsim.typing import Floats

MODE_LOST = "mode_lost"

STEPS = (1.0, 0.7, 1.4, 0.4)  # of the step in the parameter, tried in turn
PURE_SHARE = 0.95  # share of energy above which a motion is outside every tongue
LEAST_FORWARD = 0.7  # part of the parameter in the unit tangent of a branch that is not about to turn into a tongue
ENERGY_LOSS = 0.1  # that the mode may lose over a unit of the parameter (a logarithm, or a factor of one)
SHARES_AT_JUMP = (0.8, 0.65)  # shares of the energy; a motion that the mode dominates more is looked for there, at the
# lower one over periods and shapes as well, until it has the higher one
MOST_DEVIATION = 0.25  # from the prediction, in scaled unknowns, for a point to belong to the backbone
MOST_DEVIATION_AT_JUMP = 0.8  # the same beyond a tongue
SEARCHED_SPEEDS = (-0.3, -0.1, 0.1, 0.3)  # of the speed, in another mode


@dataclass(frozen=True)
class Jump:
    """A gap in the backbone, bridged by starting again."""

    start: float  # parameter of the last point before
    end: float  # parameter of the first point beyond
    mode: int  # the other mode of the resonance, from 0
    ratio: int  # n of n:1


STEP_AT_STIFF_GRAZING = 1e-11  # at a grazing of a stiff stop a branch turns within the stop's compliance


@dataclass
class Backbone:
    """Iterate over it for the backbone's points; tongues, jumps and the outcome are kept as attributes.

    Parameters
    ----------
    orbits : the shooting problem (stiffness factor or energy).
    start : a converged motion, dominated by ``mode``.
    end : the last parameter (the logarithm of the energy where that is followed).
    mode : from 0.
    points : about how many points to make of a path of few steps.
    largest_ratio : internal resonances of a higher order are stepped over, unless the backbone is cut there: then the
        tongue is followed whatever its order.
    tongue_points : length of a traced tongue.
    """

    orbits: BrakeOrbits
    start: BranchPoint
    end: float
    mode: int
    points: int = 100
    largest_ratio: int = 20
    tongue_points: int = 40
    settings: Settings = field(default_factory=lambda: Settings(iterations=6))
    outcome: Outcome = NOT_BEGUN
    tongues: list[OrbitBranch] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)
    _points_outside_tongues: list[BranchPoint] = field(default_factory=list, repr=False)
    _smallest_share: float = LEAST_SHARE
    _lost_dominance: bool = False  # whether the mode lost its dominance by continuity, outside every tongue
    _resonance_at_end: Outcome | None = None
    _since_jump: list[BranchPoint] = field(default_factory=list, repr=False)  # since the last jump

    def __post_init__(self) -> None:
        low, high = sorted((self.start.parameter, self.end))
        self._forward = 1.0 if self.end > self.start.parameter else -1.0
        self._search = Tongues(self.orbits, self.mode, low, high, self.tongue_points, self.settings)

    def share(self, point: BranchPoint) -> float:
        """Share of the energy in the requested mode."""
        return float(self.orbits.share_at(point)[self.mode])

    def __iter__(self) -> Iterator[BranchPoint]:
        self.outcome, self._resonance_at_end, self._lost_dominance = INTERRUPTED, None, False
        a = self.start.orient(self._forward)
        self._points_outside_tongues, step, count = [a], self._step(a), 1
        yield a
        while (self.end - a.parameter) * self._forward > 1e-12 * self._step(a):
            full = self._step(a)
            ahead = self._ahead(a, step, full)
            if not ahead:
                self.outcome = Outcome.of(
                    OutcomeKind.STOPPED, MODE_LOST,
                    "the branch turns back into a tongue of internal resonance, and no motion of mode "
                    f"{self.mode + 1} was found beyond it", self._share_note(a), at=a.parameter,
                )  # fmt: skip
                if self._resonance_at_end is not None:
                    self.outcome = COMPLETE.copy_with(self._resonance_at_end)
                return
            for point in self._fill_in(a, ahead):
                count += 1
                yield point
            a = ahead[-1]
            if count > 3000:
                self.outcome = too_many_points(count, a.parameter)
                return
            step = min(full, 1.6 * step)
            self._since_jump = [*self._since_jump[-3:], *ahead][-4:]
            if self._lost_dominance or self.share(a) > 0.5 * (1.0 + LEAST_SHARE):
                self._points_outside_tongues.append(a)
        parts = [self._share_note(a)] if self.share(a) < LEAST_SHARE else []
        if self._resonance_at_end is not None:
            parts.append(self._resonance_at_end)
        self.outcome = reached_end(self.end).copy_with(*parts)

    def _ahead(self, a: BranchPoint, step: float, full_step: float) -> list[BranchPoint]:
        """The next points of the backbone; none where it ends.

        In turn: by a step in the parameter, along the branch, beyond the resonance that cuts the backbone, along the
        branch even where that is a tongue.
        """
        # where the mode holds less outside tongues, 0.7 of that
        self._smallest_share = min(LEAST_SHARE, 0.7 * self.share(self._points_outside_tongues[-1]))
        if self._resonance_at_end is not None:
            return self._continue_branch(a, full_step, stop_at_tongue=False)
        b = self._motion_after_step(a, step)
        ahead = [b] if b is not None else self._continue_branch(a, full_step, stop_at_tongue=True)
        if ahead:
            for before, point in pairwise([a, *ahead]):
                self._trace_tongues(before, point)
            return ahead
        b = self._restart_beyond(a, full_step)
        if b is not None and (b.parameter - self.end) * self._forward <= 0:
            return [b]
        if b is not None:  # the path ends within the resonance: its tongue is followed up to there
            self._resonance_at_end = Outcome.of(
                OutcomeKind.NOTED, "ends_in_resonance",
                "an internal resonance, which continues beyond the end of the range, interrupts the backbone",
                at=Where(((a.parameter, b.parameter),)),
            )  # fmt: skip
            self.jumps = [jump for jump in self.jumps if jump.end != b.parameter]
        return self._continue_branch(a, full_step, stop_at_tongue=False)

    def _motion_after_step(self, a: BranchPoint, step: float) -> BranchPoint | None:
        """The motion after a step in the parameter, or the neighbouring one that the mode dominates more."""
        remaining = abs(self.end - a.parameter)
        b = None
        for part in STEPS:
            reach = min(part * step, remaining)
            b = self._motion_at(a, a.parameter + self._forward * reach)
            if b is not None or (part > 1.0 and reach == remaining):
                break
        if b is None:
            return None
        dominated = self._on_dominated_branch(a, b)
        if dominated is None:
            return b
        self._cut(a, dominated)
        return dominated

    def _fill_in(self, a: BranchPoint, points: list[BranchPoint]) -> Iterator[BranchPoint]:
        """The points after a, with intermediate points where the curve would be coarse, but none across jumps."""
        jumped = {jump.start for jump in self.jumps}
        for before, point in pairwise([a, *points]):
            if before.parameter not in jumped:
                step = abs(point.parameter - before.parameter)
                pieces = round(step * self.points / abs(self.end - self.start.parameter))
                values = np.linspace(before.parameter, point.parameter, max(pieces, 1) + 1)[1:-1].tolist()
                between = BranchStep(self.orbits, before, point, self.settings)
                found = (between.at_parameter(value) for value in values)
                yield from (each for each in found if each is not None)
            yield point

    def _step(self, point: BranchPoint) -> float:
        """The longest step in the parameter from a point."""
        if self.orbits.parameter == "stiffness_factor":
            # whatever the range, too; of a factor above one relative to its value
            return 0.01 * max(1.0, abs(point.parameter))
        # 0.05: of its logarithm, whatever the range: where the path ends must not change how it gets there
        return 0.05

    def _share_note(self, point: BranchPoint) -> Outcome:
        """A note of the mode with its share of the energy, and the mode with the largest of the other shares."""
        shares = self.orbits.share_at(point)
        others = np.delete(shares, self.mode)
        other = int(np.argmax(others)) if others.size else 0
        mode, other = self.mode + 1, other + 1 + (other >= self.mode)
        share, other_share = float(shares[self.mode]), float(others.max(initial=0.0))
        return Outcome.of(
            OutcomeKind.NOTED, "energy_shared",
            f"there mode {mode} holds {share:.0%} of the energy and mode {other} {other_share:.0%}",
            mode=mode, share=share, other=other, other_share=other_share,
        )  # fmt: skip

    def _continue_branch(self, a: BranchPoint, full_step: float, *, stop_at_tongue: bool) -> list[BranchPoint]:
        """Points of the branch from a to about a step further, by arclength.

        They end where the parameter turns back; with ``stop_at_tongue`` also where the mode has less than
        `PURE_SHARE` of the energy and loses it quickly to a tongue.
        """
        low, high = sorted((a.parameter, self.end))
        points: list[BranchPoint] = []
        for point in Branch(self.orbits, a, low, high, Settings(most_points=60, smallest_step=STEP_AT_STIFF_GRAZING)):
            if point is a:
                continue
            along, lost = float(point.tangent[-1]) * self._forward, self.share(a) - self.share(point)
            slowly = along >= LEAST_FORWARD and lost <= ENERGY_LOSS * abs(point.parameter - a.parameter)
            if along <= 0 or (stop_at_tongue and self.share(point) <= PURE_SHARE and not slowly):
                break
            points.append(point)
            if abs(point.parameter - a.parameter) >= full_step:
                break
        self._lost_dominance = self._lost_dominance or (bool(points) and self.share(points[-1]) <= PURE_SHARE)
        return points

    def _motion_at(self, a: BranchPoint, value: float) -> BranchPoint | None:
        """The motion dominated by the mode at a parameter, close to what its neighbours predict."""
        return next(self._solve(self._predictions(a, value), value, MOST_DEVIATION), None)

    def _on_dominated_branch(self, a: BranchPoint, b: BranchPoint) -> BranchPoint | None:
        """The motion at the parameter of b that the mode dominates more, where the branch from a to b is a tongue's.

        It is looked for where the share of the mode falls to one of the levels `SHARES_AT_JUMP`.
        """
        lost = self.share(a) - self.share(b)
        crossed = [level for level in SHARES_AT_JUMP if self.share(b) < level <= self.share(a)]
        if not crossed or lost <= ENERGY_LOSS * abs(b.parameter - a.parameter):
            return None
        # 0.05: of the energy, that the mode has more of in a motion which is worth a jump
        least = self.share(b) + 0.05
        found = self._solve(self._guesses(b.parameter), b.parameter, MOST_DEVIATION_AT_JUMP)
        point = next((point for point in found if self.share(point) > least), None)
        if point is None and SHARES_AT_JUMP[1] in crossed:
            point = self._search_motion(b.parameter)
        return point if point is not None and self.share(point) > least else None

    def _predictions(self, a: BranchPoint, value: float) -> Iterator[Floats]:
        """Guesses close to a: along the tangent where it isn't that of a tongue, along the last chord, and a itself."""
        t = a.tangent
        forward = abs(t[-1]) > LEAST_FORWARD * float(np.linalg.norm(t[-2:])) and float(np.abs(t[:-2]).max()) < 0.3
        if forward or abs(t[-1]) > LEAST_FORWARD:
            yield a.u + (value - a.parameter) / (t[-1] * a.scale[-1]) * t * a.scale
        clean = self._points_outside_tongues[-1]
        before = [p for p in self._points_outside_tongues if abs(p.parameter - clean.parameter) > 1e-12]
        if before:
            p = before[-1]
            yield clean.u + (value - clean.parameter) / (clean.parameter - p.parameter) * (clean.u - p.u)
        yield next(self._guesses(value))

    def _solve(self, guesses: Iterable[Floats], value: float, largest_distance: float) -> Iterator[BranchPoint]:
        """Motions at a parameter, dominated by the mode, to which Newton's method converges from guesses."""
        settings = self.settings if largest_distance <= MOST_DEVIATION else replace(self.settings, iterations=12)
        for guess in guesses:
            if not self.orbits.split(np.append(guess[:-1], value))[1] > 0:  # a period extrapolated too far
                continue
            point = solve_at(self.orbits, guess, settings, value, self._forward, largest_distance)
            if (
                point is not None
                and self.share(point) > self._smallest_share
                and self.orbits.swings_once(point, self.mode)
            ):
                yield point

    def _guesses(self, value: float) -> Iterator[Floats]:
        """First guesses beyond a tongue: the last clear motion, and the linear mode alone, at periods extrapolated."""
        clean = self._points_outside_tongues[-1]
        periods = [float(clean.u[-2])]
        history = [(p.parameter, np.log(p.u[-2])) for p in self._points_outside_tongues[-6:]]
        if len(history) >= 3:
            x, y = np.array(history).T
            slope = np.polyfit(x - x[-1], y, 1)
            periods.insert(0, float(np.exp(np.polyval(slope, value - x[-1]))))
        family = self.orbits.family
        q, _, before, _ = self.orbits.split(clean.u)
        _, _, factor, energy = self.orbits.split(np.append(clean.u[:-1], value))
        known = family.period_estimate(self.mode, factor, energy)
        if known is not None:
            periods.insert(0, known)
        away, still = q - family.static_equilibrium(before), family.static_equilibrium(factor)
        shape = self.orbits.vectors[:, self.mode]
        size = np.sqrt(2.0 * energy) / float(self.orbits.omega[self.mode])
        pure = still + shape * np.copysign(size, shape @ away)
        for period in periods:
            yield self.orbits.unknowns(pure, period, value)
            yield self.orbits.unknowns(still + away, period, value)

    def _restart_beyond(self, a: BranchPoint, full_step: float) -> BranchPoint | None:
        """Restart the backbone beyond the resonance that interrupts it after a, and trace its tongue.

        The motion may lie beyond the end of the path, so that where the path ends does not decide whether there is one.
        """
        distances = 0.5 * 1.5 ** np.arange(12)
        remaining = abs(self.end - a.parameter) / full_step
        for distance in sorted({remaining, *distances.tolist()}):
            value = self.end if distance == remaining else a.parameter + self._forward * distance * full_step
            b = next(self._solve(self._guesses(value), value, MOST_DEVIATION_AT_JUMP), None)
            if b is None and distance > 1.0:
                b = self._search_motion(value)
            if b is not None:
                self._cut(a, b)
                return b
        return None

    def _search_motion(self, value: float) -> BranchPoint | None:
        """The motion with the largest share of the mode that a search over periods and shapes finds at a parameter.

        Where the frequency has grown by tens of per cent along a jump neither the last period nor the linear mode
        alone is near any motion: the mode then carries a part of those whose frequency is a low multiple of its own.
        """
        known = list(self._guesses(value))
        periods = np.array([period for guess in known if (period := self.orbits.split(guess)[1]) > 0])
        pure = known[0][: self.orbits.n]
        _, _, factor, _ = self.orbits.split(known[0])
        still = self.orbits.family.static_equilibrium(factor)
        omega = float(self.orbits.omega[self.mode])
        size = float(self.orbits.vectors[:, self.mode] @ (pure - still))
        best: BranchPoint | None = None
        for period in np.geomspace(0.98 * periods.min(), 1.02 * periods.max(), 10):
            for other in range(min(self.orbits.n, self.mode + 3)):
                if other == self.mode or self.orbits.omega[other] <= 0:
                    continue
                for part in SEARCHED_SPEEDS:
                    lent = part * abs(size) * omega / float(self.orbits.omega[other]) * self.orbits.vectors[:, other]
                    shape = still + np.sqrt(1.0 - part**2) * (pure - still) + lent
                    # searched further, to 1.5, since nothing else was found
                    for b in self._solve([self.orbits.unknowns(shape, period, value)], value, 1.5):
                        best = b if best is None or self.share(b) > self.share(best) else best
            if best is not None and self.share(best) > SHARES_AT_JUMP[0]:
                break
        return best

    def _cut(self, a: BranchPoint, b: BranchPoint) -> None:
        """Keep a jump with its resonance, and the tongue unless it is known."""
        if self._leads_to(a, b):
            return
        mode, ratio = resonance_between(self.orbits, a, b, self.mode)
        self.jumps.append(Jump(a.parameter, b.parameter, mode, ratio))
        if not self._is_traced(mode, ratio, a.parameter):
            tongue = self._search.tongue_between(a, b, mode)
            within = [p for p in self._since_jump[-2:] if p is not a]
            if tongue is None and within:
                tongue = self._search.trace([*within, a], mode, a.parameter)
            if tongue is not None:
                self.tongues.append(tongue)
        self._since_jump = []

    def _leads_to(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether the branch leads from a to b after all, only faster than the predictions that keep out of tongues."""
        chord = (b.u - a.u) / self.orbits.scale(a.u)[0]
        size = float(np.linalg.norm(chord))
        along = min(float(a.tangent @ chord), float(b.tangent @ chord))
        # 0.9: cosine between a step and the tangents at its ends that tells a step from a jump
        return size < MOST_DEVIATION and along > 0.9 * size and a.orientation * b.orientation > 0

    def _is_traced(self, mode: int, ratio: int, parameter: float) -> bool:
        # 4.0: steps of the backbone within which a resonance of the same mode and order is the same tongue
        near = 4.0 * self._step(self.start)
        return any((t.mode, t.ratio) == (mode, ratio) and abs(t.origin - parameter) < near for t in self.tongues)

    def _trace_tongues(self, a: BranchPoint, b: BranchPoint) -> None:
        """Trace the tongues of low order that lie between two neighbours."""
        period = self.orbits.split(a.u)[1]
        for mode in range(self.orbits.n):
            if mode == self.mode or self.orbits.mode_slope(a, mode) * self.orbits.mode_slope(b, mode) > 0:
                continue
            if float(self.orbits.omega[mode]) * period / (2 * np.pi) > self.largest_ratio + 0.5:
                continue
            tongue = self._search.tongue_between(a, b, mode)
            if tongue is not None and not self._is_traced(mode, tongue.ratio, tongue.origin):
                self.tongues.append(tongue)
                self.jumps.append(Jump(a.parameter, b.parameter, mode, tongue.ratio))
