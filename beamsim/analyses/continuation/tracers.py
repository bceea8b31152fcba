"""How a continuation finds and follows motions: by shooting, or by harmonic balance.

Motions that transients from rest do not come to are sought in two ways: by transients from states that reach the
contacts, and by following motions down in level from one at which contact exists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.branch import BranchPoint, FailedSearch, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings, at_parameter, solve_at
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.shooting import ForcedOrbits, find_orbit, linear_guess
from beamsim.orbits.special_points import special_points
from beamsim.typing import Floats

RAISED = (3.0, 10.0, 30.0)  # levels at which a motion with contact is looked for, over that of the curve
BEYOND_GAP = (1.5, 4.0)  # deflections that transients begin with, over those that reach the contact
SETTLING = 80  # periods of these transients
LOWEST = 0.2  # of the level, down to which a motion is followed
SETTINGS = Settings(iterations=25)
IN_LEVEL = Settings(largest_step=0.2, most_points=150)


@dataclass(frozen=True)
class Tracer:
    """Finds and follows the motions of a problem, by shooting or by harmonic balance.

    Parameters
    ----------
    problem : along the parameter.
    reach : values that a branch must not leave.
    """

    problem: ForcedOrbits | ForcedBalance
    reach: tuple[float, float]

    def begin(self, value: float, forward: float) -> BranchPoint | None:
        """A motion at a value, its tangent pointing forward: a stable one if a transient reaches it."""
        with suppress(ArithmeticError, np.linalg.LinAlgError):
            if isinstance(self.problem, ForcedBalance):
                return self.problem.first_motion(value, forward)
            orbit = find_orbit(ForcedOrbits(self.problem.flow_at(value)[0]), stable=True)
            if orbit is not None:
                return solve_at(self.problem, np.append(orbit.u[:-1], value), SETTINGS, value, forward)
        return None

    def sought(self, value: float) -> Iterator[BranchPoint | None]:
        """Motions at a value beside those that are followed, with repetitions; None where one was sought in vain.

        Harmonic balance has them from shooting, and none with cubic springs.
        """
        if isinstance(self.problem, ForcedOrbits):
            for state in periodic_states(self.problem.flow_at(value)[0]):
                yield self._found(solve_at, self.problem, np.append(state, value), SETTINGS, value)
        elif self.problem.cubic is None:
            local, basis = self.problem.by_shooting(value)
            flow, period = local.flow, 2 * np.pi * self.problem.multiple / local.omega
            for state in periodic_states(flow, self.problem.multiple):
                local.flow = flow
                yield self._found(self.problem.from_passage, local, basis, flow.carry(state, period), value)

    @staticmethod
    def _found(find: Callable[..., BranchPoint | None], *of: Any) -> BranchPoint | None:
        try:
            return find(*of)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None

    def branch(self, start: BranchPoint, settings: Settings) -> Branch:
        """The continuation of a motion."""
        return Branch(self.problem, start, *self.reach, settings)

    def special(
        self, a: BranchPoint, b: BranchPoint, settings: Settings, failed: list[FailedSearch]
    ) -> list[SpecialPoint]:
        """Special points between two neighbours; searches that fail are appended. Sums of harmonics have no corners."""
        problem: Any = self.problem  # a balance has what is asked of motions without corners
        return special_points(problem, a, b, settings, failed)


def _settled(local: ForcedOrbits, flow: PeriodicFlow, z: Floats, periods: int) -> tuple[Floats, BranchPoint | None]:
    """A state after some periods, and the stable motion that it comes to."""
    for _ in range(periods):
        z = flow.carry(z, 2 * np.pi / local.omega).end
    orbit = solve_at(local, np.append(z, local.value), SETTINGS, local.value)
    return z, orbit if orbit is not None and local.orbit(orbit).stable else None


def periodic_states(flow: PeriodicFlow, multiple: int = 1) -> Iterator[Floats]:
    """States of periodic motions of a system, with repetitions: by transients, and down from higher levels."""
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _from_beyond_gaps(ForcedOrbits(flow, multiple=multiple))
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _followed_down(ForcedOrbits(flow, "level", multiple))


def _from_beyond_gaps(local: ForcedOrbits) -> Iterator[Floats]:
    """States that transients come to which begin beyond the contacts, to either side."""
    flow = local.flow
    linear = linear_guess(flow)
    n = flow.system.size
    springs = flow.system.contacts.split()  # one per breakpoint of a piecewise-linear law
    for shape, gap in zip(springs.shape, springs.gap, strict=True):
        reached = float(np.abs(shape @ linear[:n]))
        if reached == 0.0:
            continue
        for factor in BEYOND_GAP:
            for side in (1.0, -1.0):
                z = linear * (side * factor * max(abs(float(gap)), reached) / reached)
                _, orbit = _settled(local, flow, z, SETTLING)
                if orbit is not None:
                    yield orbit.u[:-1]


def _followed_down(problem: ForcedOrbits) -> Iterator[Floats]:
    """States at the level of the problem, on branches that come down from levels at which contact exists."""
    level = problem.level
    for factor in RAISED:
        high = factor * level
        raised = ForcedOrbits(problem.flow.under(problem.omega, high), "level", problem.multiple)
        start = find_orbit(raised, forward=-1.0)
        if start is None or not start.data.signature:
            continue
        branch = Branch(raised, start, LOWEST * level, 2.0 * high, IN_LEVEL)
        for a, b in pairwise(branch):
            if (a.parameter - level) * (b.parameter - level) <= 0 and a.parameter != b.parameter:
                point = at_parameter(raised, a, b, level, SETTINGS)
                if point is not None:
                    yield point.u[:-1]
        return
