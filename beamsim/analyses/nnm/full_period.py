"""A nonlinear normal mode by shooting over the whole period, and the non-brake orbits that leave it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamsim.analyses.nnm.paths import ModeBranches, ModePath
from beamsim.errors import NotTrustedError
from beamsim.interrupts import Stop, never, until
from beamsim.orbits.branch import BranchPoint, OrbitBranch
from beamsim.orbits.continuation import Settings, follow_orbits
from beamsim.orbits.free_orbits import FullPeriodPath
from beamsim.orbits.reversible import BrakeOrbits
from beamsim.orbits.symmetry_breaking import BACK_TO_BRAKE_ORBITS, NonBrakeBranch, SymmetryBreaking, breaking_between
from beamsim.outcomes import Outcome, interruption
from beamsim.scenario.nnm import FullPeriodMethod
from beamsim.typing import Floats

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
            yield list(follow_orbits(branches.problem, start, low, high, Settings(most_points=BACK)))


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
