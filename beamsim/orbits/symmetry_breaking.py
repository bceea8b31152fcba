"""Where non-brake orbits leave a family of brake orbits, and how to follow them.

A brake orbit retraces its path. With the half period's transition matrix :math:`\\Phi = \\begin{pmatrix} a & b
\\\\ c & d \\end{pmatrix}` a pair of multipliers meets at +1 where c or b is singular. A kernel of c (shapes at rest
that come to rest again) leads to other brake orbits: a fold, or the tongue of an internal resonance. A kernel of b is a
kick :math:`\\delta v` at the instant of rest after which the *same* place is reached half a period later: the motion
then needn't run back, and a pair of families that are each other's reversal branches off. b always has one kernel, the
shift in time, :math:`\\delta v = \\nabla V(q_0)`; it is set aside by bordering with the gradients at both ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint
from beamsim.orbits.continuation import Settings, follow_orbits, locate
from beamsim.orbits.free_orbits import free_of, slowest_instant
from beamsim.orbits.reversible import BrakeOrbits
from beamsim.orbits.special_points import beside
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.typing import Floats

BACK_TO_BRAKE_ORBITS = Outcome.of(OutcomeKind.COMPLETE, "back_to_brake_orbits", "returned to brake orbits")
BRAKE_ORBIT_ITSELF = Outcome.of(
    OutcomeKind.STOPPED, "brake_orbit_itself", "the orbits found are brake orbits, shifted in time"
)

LARGEST_RATIO = 12  # of the frequencies of a mode and the branch
FIRST_KICKS = (0.03, 0.01, 0.003, 0.1)  # speed that the branch begins with, over sqrt(2 E)


@dataclass(frozen=True)
class SymmetryBreaking:
    """A brake orbit from which non-brake orbits leave."""

    point: BranchPoint
    parameter: float
    kick: Floats  # (n,) velocities at the instant of rest, unit norm
    mode: int  # the linear mode with the largest part in the kick, from 0
    ratio: int  # n of n:1: that mode makes about n oscillations in a period


def _bordered(orbits: BrakeOrbits, point: BranchPoint) -> tuple[Floats, Floats]:
    """The scaled block b bordered by its trivial kernels, and the scale w of the coordinates' frequencies."""
    n = orbits.n
    q, period, factor, _ = orbits.split(point.u)
    passage = point.data.passage
    w = np.maximum(orbits.family.omega, 0.2 * np.pi / period)
    B = np.zeros((n + 1, n + 1))
    B[:n, :n] = passage.transition[:n, n : 2 * n] * w[:, None] * w
    gradient_after = orbits.family.potential(passage.end[:n], factor)[1] / w
    gradient_before = orbits.family.potential(q, factor)[1] / w
    B[:n, n] = gradient_after / np.linalg.norm(gradient_after)
    B[n, :n] = gradient_before / np.linalg.norm(gradient_before)
    return B, w


def _determinant(orbits: BrakeOrbits, point: BranchPoint) -> float:
    return float(np.linalg.det(_bordered(orbits, point)[0]))


def breaking_between(
    orbits: BrakeOrbits, a: BranchPoint, b: BranchPoint, settings: Settings
) -> SymmetryBreaking | None:
    """The point between two neighbours of a branch where non-brake orbits leave; None without one.

    Resonances of a higher order than `LARGEST_RATIO` are left out.

    Parameters
    ----------
    orbits, settings : the brake orbits, and tolerances of their points.
    a, b : the neighbours.

    Returns
    -------
    The point; None where there is none.
    """
    values = _determinant(orbits, a), _determinant(orbits, b)
    if values[0] * values[1] > 0 or min(_kick(orbits, p)[2] for p in (a, b)) > LARGEST_RATIO:
        return None
    kernel = locate(orbits, a, b, lambda p: _determinant(orbits, p), settings, values)
    if kernel is None:
        return None
    kick, mode, ratio, smallness = _kick(orbits, kernel)
    # 1e-5: smallest singular value of b, scaled, against its largest, at a located point
    if smallness > 1e-5 or not 1 <= ratio <= LARGEST_RATIO:
        return None
    return SymmetryBreaking(kernel, kernel.parameter, kick, mode, ratio)


def _kick(orbits: BrakeOrbits, point: BranchPoint) -> tuple[Floats, int, int, float]:
    """The kick closest to a kernel of b: its direction, its main mode (from 0), that mode's oscillations in a period,
    and how close it is."""
    B, w = _bordered(orbits, point)
    _, sizes, rows = np.linalg.svd(B)
    kick = w * rows[-1][: orbits.n]
    kick /= np.linalg.norm(kick)
    mode = int(np.argmax((orbits.vectors.T @ kick) ** 2))
    ratio = round(float(orbits.omega[mode]) * orbits.split(point.u)[1] / (2 * np.pi))
    return kick, mode, ratio, float(sizes[-1] / sizes[0])


@dataclass
class NonBrakeBranch:
    """Iterate over it to follow the motions that leave at a symmetry-breaking point; ``status`` says why it ended.

    The first point is the first beside the brake orbit. The two directions of the kick give motions that are each
    other's reversal; one of them is followed.

    Parameters
    ----------
    family, parameter, energy, factor : as the brake orbits'.
    origin : where to leave.
    low, high : the parameter's range.
    settings : steps and tolerances.
    """

    brake: BrakeOrbits
    origin: SymmetryBreaking
    low: float
    high: float
    settings: Settings = field(default_factory=lambda: Settings(step=0.01, largest_step=0.05, most_points=120))
    outcome: Outcome = NOT_BEGUN

    def __post_init__(self) -> None:
        self.orbits = free_of(self.brake, self.origin.point.u)

    def __iter__(self) -> Iterator[BranchPoint]:
        start = self._first()
        if start is None:
            self.outcome = Outcome.of(
                OutcomeKind.STOPPED, "no_orbit_beside", "no non-brake orbit was found near the brake orbit"
            )
            return
        branch = follow_orbits(self.orbits, start, self.low, self.high, self.settings)
        self.outcome = INTERRUPTED
        before, fastest = None, 0.0
        for count, point in enumerate(branch):
            slowest = self._slowest(point)
            speed = float(np.linalg.norm(slowest))
            fastest = max(fastest, speed)
            # 0.3: of the largest slowest speed so far: here a reversal of the motion means that rest was passed
            turned = before is not None and speed < 0.3 * fastest and float(slowest @ before) < 0
            # 1e-4: slowest speed over sqrt(2 E) that counts as rest
            if speed < 1e-4 or turned:
                self.outcome = BACK_TO_BRAKE_ORBITS if count > 1 else BRAKE_ORBIT_ITSELF
                return
            yield point
            before = slowest
            self.orbits.hold(point.u)
        self.outcome = branch.outcome

    def _slowest(self, point: BranchPoint) -> Floats:
        """(n,) velocities at the slowest instant, over sqrt(2 E)."""
        n, passage, flow = self.orbits.n, point.data.passage, point.data.flow
        time, _ = slowest_instant(flow, passage, n)
        v = flow.states_at(passage, np.array([time]))[0, n : 2 * n]
        return np.asarray(v / np.sqrt(2.0 * self.orbits.split(point.u)[3]))

    def _first(self) -> BranchPoint | None:
        """The first motion beside the brake orbit, with a kick of given size."""
        n, at = self.orbits.n, self.origin.point.u
        row = np.concatenate([np.zeros(n), self.origin.kick, np.zeros(2)])
        u = np.concatenate([at[:n], np.zeros(n), at[-2:]])
        first = beside(self.orbits, u, row, FIRST_KICKS, self.settings)
        return next((point for point in first if self.low <= point.parameter <= self.high), None)
