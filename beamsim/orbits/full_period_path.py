"""A path of brake orbits followed again by shooting over the whole period: a check that assumes no instant of rest.

The half-period path hands over the parameters to stop at and, beyond its jumps, where to begin again. In between the
full-period path goes its own way, each point predicted from its own last two.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from beamsim.orbits.continuation import INTERRUPTED, BranchPoint, Settings, solve_at
from beamsim.orbits.free_orbits import FreeOrbits
from beamsim.orbits.reversible import BrakeOrbits

SAME = 1e-6  # relative distance within which two solutions are one motion


@dataclass
class FullPeriodPath:
    """Iterate over it for the points; ``differences`` from the half-period path and the status are kept beside.

    Parameters
    ----------
    brake : the half-period problem (stiffness factor or energy).
    points : its path.
    gaps : parameters of its points that a jump follows.
    """

    brake: BrakeOrbits
    points: Sequence[BranchPoint]
    gaps: Collection[float] = ()
    settings: Settings = field(default_factory=lambda: Settings(iterations=15))
    status: str = "not begun"
    differences: list[float] = field(default_factory=list)  # largest of period and scaled state, relative
    orbits: FreeOrbits = field(init=False)

    def __post_init__(self) -> None:
        assert self.brake.parameter != "frequency"
        n, u = self.brake.n, self.points[0].u
        self.orbits = FreeOrbits(
            self.brake.family, np.concatenate([u[:n], np.zeros(n)]), self.brake.parameter, self.brake.energy,
            self.brake.factor,
        )  # fmt: skip

    def __iter__(self) -> Iterator[BranchPoint]:
        self.status = INTERRUPTED
        own: list[BranchPoint] = []
        for known in self.points:
            new = self._solved(known, own)
            if new is None:
                self.status = (
                    f"stopped at parameter {known.parameter:.9g}: over the whole period Newton's method does not "
                    "converge beside the half-period solution"
                )
                return
            self.differences.append(self._difference(new, known))
            yield new
            own = [*own[-1:], new] if known.parameter not in self.gaps else []
        self.status = f"complete: reached {self.points[-1].parameter:.9g}"

    def _solved(self, known: BranchPoint, own: list[BranchPoint]) -> BranchPoint | None:
        at_rest = np.concatenate([known.u[: self.brake.n], np.zeros(self.brake.n), known.u[-2:]])
        self.orbits.hold(at_rest)
        guesses = [at_rest]
        if len(own) == 2 and own[1].parameter != own[0].parameter:
            reach = (known.parameter - own[1].parameter) / (own[1].parameter - own[0].parameter)
            guesses.insert(0, own[1].u + reach * (own[1].u - own[0].u))
        elif own:
            guesses.insert(0, own[-1].u.copy())
        for guess in guesses:
            point = solve_at(self.orbits, guess, self.settings, known.parameter)
            if point is not None and self._difference(point, known) < SAME:
                return point
        return None

    def _difference(self, point: BranchPoint, known: BranchPoint) -> float:
        n = self.brake.n
        scale = self.orbits.scale(point.u)[0]
        state = point.u[: 2 * n] - np.concatenate([known.u[:n], np.zeros(n)])
        period = abs(float(point.u[-2] / known.u[-2]) - 1.0)
        return max(float(np.linalg.norm(state / scale[: 2 * n])), period)
