"""Coexisting motions of a response, which transients from rest do not come to.

At a few values of the parameter motions are looked for in two ways: by transients from states that reach the contacts,
and by following motions down in level from one at which contact exists. Each that lies on no known branch is followed
both ways.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from beamsim.analyses.continuation.branches import Budget, ShootingTracer, Tracer, coincides, follow, joined
from beamsim.interrupts import until
from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.continuation import Settings, at_parameter, follow_orbits, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit, linear_guess
from beamsim.typing import Floats

RAISED = (3.0, 10.0, 30.0)  # levels at which a motion with contact is looked for, over that of the curve
BEYOND_GAP = (1.5, 4.0)  # deflections that transients begin with, over those that reach the contact
SETTLING = 80  # periods of these transients
MOST_IN_LEVEL = 150  # points of a branch that is followed down in level
LOWEST = 0.2  # of the level, down to which it is followed
SETTINGS = Settings(iterations=25)
IN_LEVEL = Settings(largest_step=0.2, most_points=MOST_IN_LEVEL)


class SeekingTracer(Tracer, Protocol):
    """A tracer that seeks motions beside those it follows."""

    def sought(self, value: float) -> Iterator[BranchPoint | None]:
        """Motions at a value, with repetitions; None where one was sought in vain."""


def coexisting_branches(
    tracer: SeekingTracer, values: list[float], known: list[OrbitBranch], budget: Budget
) -> list[OrbitBranch]:
    """Branches that pass none of the known ones.

    Parameters
    ----------
    tracer : along the parameter.
    values : of the parameter, at which motions are sought.
    known : branches so far.
    budget : points and time that may be spent.
    """
    branches: list[OrbitBranch] = []
    for value in values:
        if budget.stop():
            return branches
        for start in until(tracer.sought(value), budget.stop):
            if not budget.allows_another(len(known) + len(branches)):
                return branches
            if start is None or coincides(start, [*known, *branches]):
                continue
            halves = [follow(tracer, start, direction, budget, [*known, *branches]) for direction in (1.0, -1.0)]
            branches.append(joined(tracer.problem, halves))
    return branches


@dataclass(frozen=True)
class SeekingShootingTracer(ShootingTracer):
    """Shooting that seeks coexisting motions; ``in_level`` is the system at a value with the level as the parameter."""

    in_level: Callable[[float], ForcedOrbits]

    def sought(self, value: float) -> Iterator[BranchPoint | None]:
        """Motions at a value, with repetitions; None where Newton's method fails."""
        for state in periodic_states(lambda: self.at(value), lambda: self.in_level(value)):
            try:
                yield solve_at(self.problem, np.append(state, value), SETTINGS, value)
            except (ArithmeticError, np.linalg.LinAlgError):
                yield None


def periodic_states(at: Callable[[], ForcedOrbits], in_level: Callable[[], ForcedOrbits]) -> Iterator[Floats]:
    """States of periodic motions of a system, with repetitions: in frequency, and with the level as the parameter."""
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _settled(at())
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _followed_down(in_level())


def _settled(local: ForcedOrbits) -> Iterator[Floats]:
    """States that transients come to which begin beyond the contacts, to either side."""
    flow, _ = local.flow_at(local.value)
    period = 2 * np.pi / local.omega
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
                for _ in range(SETTLING):
                    z = flow.carry(z, period).end
                orbit = solve_at(local, np.append(z, local.value), SETTINGS, local.value)
                if orbit is not None and local.orbit(orbit).stable:
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
        branch = follow_orbits(raised, start, LOWEST * level, 2.0 * high, IN_LEVEL)
        for a, b in pairwise(branch):
            if (a.parameter - level) * (b.parameter - level) <= 0 and a.parameter != b.parameter:
                point = at_parameter(raised, a, b, level, SETTINGS)
                if point is not None:
                    yield point.u[:-1]
        return
