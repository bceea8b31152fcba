r"""A nonlinear normal mode by shooting over the whole period, and the non-brake orbits that leave it.

A brake orbit retraces its path. With the half period's transition matrix :math:`\Phi = \begin{pmatrix} a & b
\\ c & d \end{pmatrix}` a pair of multipliers meets at +1 where c or b is singular. A kernel of c (shapes at rest
that come to rest again) leads to other brake orbits: a fold, or the tongue of an internal resonance. A kernel of b is a
kick :math:`\delta v` at the instant of rest after which the *same* place is reached half a period later: the motion
then needn't run back, and a pair of families that are each other's reversal branches off. b always has one kernel, the
shift in time, :math:`\delta v = \nabla V(q_0)`; it is set aside by bordering with the gradients at both ends.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from beamsim.analyses.nnm.paths import ModeBranches, ModePath
from beamsim.errors import NotTrustedError
from beamsim.orbits.branch import INTERRUPTED, NOT_BEGUN, BranchPoint, OrbitBranch, reached_end
from beamsim.orbits.continuation import Branch, Settings, locate, solve_at
from beamsim.orbits.free_orbits import BrakeOrbits, FreeOrbits, free_of, slowest_instant
from beamsim.orbits.special_points import beside
from beamsim.outcomes import Outcome, OutcomeKind, Stop, interruption, never, until
from beamsim.scenario.sweep import FullPeriodMethod
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
        branch = Branch(self.orbits, start, self.low, self.high, self.settings)
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


FIRST_STEP, LARGEST_STEP = 0.01, 0.05  # of a non-brake branch, in scaled unknowns
BACK = 60  # points followed back into a tongue from beyond a jump
SAME = 1e-5  # scaled distance of two that are one
NEAR = 0.2  # scaled distance between a branch's end and a symmetry breaking that is the other end of it


@dataclass(frozen=True)
class FullPeriodBranches:
    """A backbone over the whole period and what leaves it."""

    backbone: OrbitBranch
    differences: Floats  # (np,) relative, from half-period shooting
    breakings: list[SymmetryBreaking]  # along the backbone and its tongues
    non_brake: list[OrbitBranch]
    unfinished: bool  # whether it was time to end before all of them were followed

    @property
    def outcome(self) -> Outcome:
        """How all of it ended."""
        if self.backbone.outcome.complete and self.unfinished:
            return interruption("during the search for non-brake orbits")
        return self.backbone.outcome


def follow_full_period(
    job: ModePath,
    branches: ModeBranches,
    settings: FullPeriodMethod,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> FullPeriodBranches:
    """Follow a half-period backbone again over the whole period, and the non-brake orbits that branch off."""
    points = branches.backbone.points
    gaps = {p.parameter for p in points if any(job.shown(p.parameter) == j.start for j in branches.jumps)}
    path = FullPeriodPath(branches.problem, points, gaps)
    reached: list[BranchPoint] = []
    for point in until(path, stop):
        reached.append(point)
        if progress is not None:
            progress(len(reached) / len(points))
    if not reached:
        raise NotTrustedError(f"full-period shooting found no motion to start from: {path.outcome}")
    breakings = list(until(_breakings(branches, gaps), stop)) if settings.branches and not stop() else []
    low, high = sorted((points[0].parameter, points[-1].parameter))
    non_brake: list[OrbitBranch] = []
    steps = Settings(step=FIRST_STEP, largest_step=LARGEST_STEP, most_points=settings.points)
    for origin in breakings:
        if len(non_brake) == settings.branches or any(_arrives(branch, origin) for branch in non_brake):
            continue
        if stop():
            break
        orbits = NonBrakeBranch(branches.problem, origin, low, high, steps)
        beside = list(until(orbits, stop))
        if beside:
            non_brake.append(
                OrbitBranch(
                    orbits.orbits, beside, job.ended(orbits.outcome, beside[-1]), kind="non_brake", mode=origin.mode,
                    ratio=origin.ratio, origin=origin.parameter,
                )
            )  # fmt: skip
    backbone = OrbitBranch(path.orbits, reached, job.ended(path.outcome, reached[-1]), kind="backbone")
    return FullPeriodBranches(
        backbone, np.array(path.differences), breakings, non_brake, bool(settings.branches and stop())
    )  # fmt: skip


def _breakings(branches: ModeBranches, gaps: set[float]) -> list[SymmetryBreaking]:
    """Along the backbone, its tongues, and the ways back into a tongue from beyond a jump; each once."""
    orbits, breakings = branches.problem, list[SymmetryBreaking]()
    for points in _paths(branches, gaps):
        for a, b in pairwise(points):
            origin = breaking_between(orbits, a, b, Settings())
            if origin is not None and not any(_alike(orbits, origin, known) for known in breakings):
                breakings.append(origin)
    return breakings


def _paths(branches: ModeBranches, gaps: set[float]) -> Iterator[list[BranchPoint]]:
    low, high = sorted((branches.backbone.points[0].parameter, branches.backbone.points[-1].parameter))
    stretch: list[BranchPoint] = []
    for point in branches.backbone.points:
        stretch.append(point)
        if point.parameter in gaps:
            yield stretch
            stretch = []
    yield stretch
    for tongue in branches.tongues:
        yield list(tongue.points)
    for a, b in pairwise(branches.backbone.points):
        if a.parameter in gaps:
            start = b.towards(a.parameter - b.parameter)
            yield list(Branch(branches.problem, start, low, high, Settings(most_points=BACK)))


def _alike(orbits: BrakeOrbits, a: SymmetryBreaking, b: SymmetryBreaking) -> bool:
    """Whether two are one orbit, seen from either of its instants of rest."""
    u, v = a.point.u, b.point.u
    if a.mode != b.mode or not np.allclose(u[-2:], v[-2:], rtol=SAME, atol=SAME):
        return False
    scale = orbits.scale(v)[0][: orbits.n]
    ends = (v[: orbits.n], b.point.data.passage.end[: orbits.n])
    return any(float(np.linalg.norm((u[: orbits.n] - q) / scale)) < SAME for q in ends)


def _arrives(branch: OrbitBranch, origin: SymmetryBreaking) -> bool:
    """Whether a branch that has been followed ends where another begins: it would be the same one backwards."""
    if branch.outcome.code != BACK_TO_BRAKE_ORBITS.code:
        return False
    n, last, there = branch.problem.n, branch.points[-1].u, origin.point.u
    if abs(float(last[-2] / there[-2]) - 1.0) > NEAR:
        return False
    scale = branch.problem.scale(last)[0][:n]
    passage = branch.points[-1].data.passage
    times = np.linspace(0.0, passage.duration, 257)
    q = branch.points[-1].data.flow.states_at(passage, times)[:, :n]
    return bool(np.min(np.linalg.norm((q - there[:n]) / scale, axis=1)) < NEAR)
