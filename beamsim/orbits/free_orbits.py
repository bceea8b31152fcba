"""Periodic motions of the undamped, unforced system that need not be brake orbits: shooting over a whole period.

Unknowns are the state (2n), the period and a parameter. To ``y(T) - y(0) = 0`` come the energy and a phase condition,
Poincaré's :math:`(y_0 - y_{ref})^T f(y_{ref}) = 0`. Energy being conserved, one of these 2n + 2 equations follows from
the others: Newton's method takes the least-squares solution of a consistent system, and converges as fast.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from beamsim.flow.contact_state import LinearOutput
from beamsim.flow.exact import ExactFlow
from beamsim.flow.passage import Passage
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.flow.variational import floquet_multipliers
from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint, Orbit, reached_end
from beamsim.orbits.conservative import ConservativeOrbits, on_unit_circle
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.extrema import extrema_of
from beamsim.orbits.grazing import cyclic
from beamsim.orbits.reversible import BrakeOrbits
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.typing import Complexes, Floats


@dataclass
class FreeOrbits(ConservativeOrbits):
    """Full-period shooting as a continuation problem; x is the state y0 (2n).

    ``reference`` is the state of the motion that fixes the phase (a motion nearby, in its own phase).
    """

    reference: Floats = field(kw_only=True)  # (2n,)
    _slope: Floats = field(init=False)

    def __post_init__(self) -> None:
        self._fix(self.factor)

    def hold(self, u: Floats) -> None:
        """Fix the phase by another motion, given by its unknowns."""
        self.reference = u[: 2 * self.n].copy()
        self._fix(self.split(u)[2])

    def _fix(self, factor: float) -> None:
        _, gradient, _ = self.family.potential(self.reference[: self.n], factor)
        self._slope = np.concatenate([self.reference[self.n :], -gradient])

    @property
    def closing(self) -> tuple[slice, Floats]:
        """The whole state after a period."""
        return slice(0, 2 * self.n), np.eye(2 * self.n)

    @property
    def phase(self) -> tuple[Floats, float] | None:
        """Poincaré's condition."""
        return self._slope, float(self._slope @ self.reference)

    def same_events(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether two motions have the same order of contacts over a period, wherever it begins."""
        return cyclic(a.data.passage) == cyclic(b.data.passage)

    def multipliers(self, point: BranchPoint) -> Complexes:
        """Floquet multipliers; two are 1."""
        N = 2 * self.n
        return floquet_multipliers(point.data.passage.transition[:N, :N])

    def orbit(self, point: BranchPoint) -> Orbit:
        """What a converged point means."""
        y, period, _, _ = self.split(point.u)
        mu = self.multipliers(point)
        # 1e-6: (mu + 1/mu)/2 may leave [-1, 1] by this much: the trivial pair and round-off
        stable = on_unit_circle(0.5 * (mu + 1.0 / mu), 1e-6)
        return Orbit(point.parameter, y, period, mu, stable, point.residual, point.data.energy)


def free_of(brake: BrakeOrbits, u: Floats) -> FreeOrbits:
    """Shooting over the whole period in the parameter of brake orbits, the phase held by one of them."""
    at_rest = np.append(u[: brake.n], np.zeros(brake.n))
    return FreeOrbits(brake.family, brake.parameter, brake.energy, brake.factor, reference=at_rest)


def slowest_instant(flow: PeriodicFlow, passage: Passage, n: int) -> tuple[float, float]:
    """When in a passage the kinetic energy is least, s, and its value, J: zero where everything is at rest at once.

    Parameters
    ----------
    flow, passage : the motion.
    n : number of coordinates.

    Returns
    -------
    Time, s, and kinetic energy, J.
    """

    def speeds(exact: ExactFlow) -> LinearOutput:
        return exact.rates(exact.system.contacts.start).some(slice(0, n))

    ends = np.array([0.0, passage.duration])
    found = extrema_of(flow, passage, speeds, lambda _, y: y[:, n : 2 * n], ends, squares=np.array([0]))
    return float(found.when_low[0, 0]), float(found.low[0, 0])


@dataclass
class FullPeriodPath:
    """A path of brake orbits followed again over the whole period: a check that assumes no instant of rest.

    The half-period path hands over the parameters to stop at and, beyond its jumps, where to begin again. In between
    the full-period path is independent: each point is predicted from its own last two. Iterate over it for the points;
    ``differences`` from the half-period path and the outcome are kept beside.

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
    outcome: Outcome = NOT_BEGUN
    differences: list[float] = field(default_factory=list)  # largest of period and scaled state, relative
    orbits: FreeOrbits = field(init=False)

    def __post_init__(self) -> None:
        self.orbits = free_of(self.brake, self.points[0].u)

    def __iter__(self) -> Iterator[BranchPoint]:
        self.outcome = INTERRUPTED
        last: list[BranchPoint] = []
        for brake_point in self.points:
            new = self._solved(brake_point, last)
            if new is None:
                self.outcome = Outcome.of(
                    OutcomeKind.STOPPED, "full_period_diverged",
                    "Newton's method over the full period does not converge from the half-period solution",
                    at=brake_point.parameter,
                )  # fmt: skip
                return
            self.differences.append(self._difference(new, brake_point))
            yield new
            last = [*last[-1:], new] if brake_point.parameter not in self.gaps else []
        self.outcome = reached_end(self.points[-1].parameter)

    def _solved(self, brake_point: BranchPoint, last: list[BranchPoint]) -> BranchPoint | None:
        at_rest = np.concatenate([brake_point.u[: self.brake.n], np.zeros(self.brake.n), brake_point.u[-2:]])
        self.orbits.hold(at_rest)
        ahead = [last[-1].u] if last else []
        if len(last) == 2 and last[1].parameter != last[0].parameter:
            reach = (brake_point.parameter - last[1].parameter) / (last[1].parameter - last[0].parameter)
            ahead = [last[1].u + reach * (last[1].u - last[0].u)]
        for guess in (*ahead, at_rest):
            point = solve_at(self.orbits, guess, self.settings, brake_point.parameter)
            # 1e-6: relative distance within which two solutions are one motion
            if point is not None and self._difference(point, brake_point) < 1e-6:
                return point
        return None

    def _difference(self, point: BranchPoint, brake_point: BranchPoint) -> float:
        n = self.brake.n
        scale = self.orbits.scale(point.u)[0]
        state = point.u[: 2 * n] - np.concatenate([brake_point.u[:n], np.zeros(n)])
        period = abs(float(point.u[-2] / brake_point.u[-2]) - 1.0)
        return max(float(np.linalg.norm(state / scale[: 2 * n])), period)
