"""A response by harmonic balance, in the terms of :mod:`beamsim.analyses.continuation.branches`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.analyses.continuation.branches import first_orbit
from beamsim.analyses.continuation.coexisting import periodic_states
from beamsim.analyses.continuation.paths import ResponseModel
from beamsim.errors import locating
from beamsim.orbits.branch import BranchPoint, FailedSearch, OrbitBranch, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings
from beamsim.orbits.harmonic_balance import ForcedBalance, truncation
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.special_points import special_points
from beamsim.typing import Floats


@dataclass(frozen=True)
class BalanceTracer:
    """Finds and follows sums of harmonics."""

    problem: ForcedBalance
    reach: tuple[float, float]

    def begin(self, value: float, forward: float) -> BranchPoint | None:
        """A motion at a value, of a stable orbit where a transient comes to one."""
        try:
            return self.problem.first_motion(value, forward, first_orbit)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None

    def sought(self, value: float) -> Iterator[BranchPoint | None]:
        """Motions at a value, by shooting from several starts; none with cubic springs."""
        if self.problem.cubic is not None:
            return
        local, basis = self.problem.by_shooting(value)
        period = 2 * np.pi * self.problem.multiple / local.omega
        in_level = ForcedOrbits(local.flow, "level", self.problem.multiple)
        for state in periodic_states(lambda: local, lambda: in_level):
            omega, level = self.problem.at(value)
            local.flow = local.flow.under(omega, level)
            try:
                yield self.problem.from_passage(local, basis, local.flow.carry(state, period), value)
            except (ArithmeticError, np.linalg.LinAlgError):
                yield None

    def branch(self, start: BranchPoint, settings: Settings) -> Branch:
        """What goes on from a motion."""
        return Branch(self.problem, start, *self.reach, settings)

    def special(
        self, a: BranchPoint, b: BranchPoint, settings: Settings, failed: list[FailedSearch]
    ) -> list[SpecialPoint]:
        """Folds, period doublings, Neimark–Sacker and branch points; sums of harmonics have no corners."""
        problem: Any = self.problem  # has what shooting's search asks for
        return special_points(problem, a, b, settings, failed)


def balance_tracer(model: ResponseModel, harmonics: int, level: float, reach: tuple[float, float]) -> BalanceTracer:
    """The tracer of one level (or of the level, where that is followed).

    Raises
    ------
    ScenarioError : where the snubbers' law is beyond the method.
    """
    f = model.followed
    omega = 2 * np.pi * (f.first if f.kind == "frequency" else model.frequency_hz)
    cubic = model.system.cubic if model.system.cubic.count else None
    with locating({"contacts": "snubbers", "harmonics": "sweep.method.harmonics"}):
        problem = ForcedBalance(
            model.system.dynamics,
            model.loads,
            harmonics,
            "frequency" if f.kind == "frequency" else "level",
            omega,
            level,
            cubic=cubic,
        )
    return BalanceTracer(problem, reach)


def neglected(branch: OrbitBranch) -> Floats:
    """(np,) what the neglected harmonics are worth at each point, against the motion."""
    errors = np.empty(len(branch.points))
    for k, point in enumerate(branch.points):
        try:
            errors[k] = truncation(branch.problem, point, across=True).error
        except (ArithmeticError, np.linalg.LinAlgError):
            errors[k] = np.inf
    return errors
