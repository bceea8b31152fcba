"""A nonlinear normal mode by shooting over the whole period, and the motions never at rest that leave it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.interruption import Stop, never, until
from beamsim.errors import NotTrustedError
from beamsim.orbits.continuation import INTERRUPTED, BranchPoint, Settings
from beamsim.orbits.free_orbits import FreeOrbits, FullPeriodPath
from beamsim.orbits.reversible import BrakeOrbits, follow_modes
from beamsim.orbits.symmetry_breaking import SymmetryBreaking, Wandering, breaking_between
from beamsim.typing import Floats

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from beamsim.analyses.nnm.paths import Followed, ModePath
    from beamsim.scenario.nnm_method import FullPeriodMethod

FIRST_STEP, LARGEST_STEP = 0.01, 0.05  # of a branch never at rest, in scaled unknowns
BACK = 60  # points followed back into a tongue from beyond a jump
SAME = 1e-5  # scaled distance of two that are one
NEAR = 0.2  # scaled distance between a branch's end and a symmetry breaking that is the other end of it


@dataclass(frozen=True)
class FreeBranch:
    """Motions that are never at rest, from where they leave the others."""

    origin: SymmetryBreaking
    orbits: FreeOrbits
    points: list[BranchPoint]
    status: str


@dataclass(frozen=True)
class FreePath:
    """A backbone over the whole period and what leaves it."""

    orbits: FreeOrbits
    points: list[BranchPoint]
    status: str
    differences: Floats  # (np,) relative, from half-period shooting
    breakings: list[SymmetryBreaking]  # along the backbone and its tongues
    branches: list[FreeBranch]


def follow_free(
    job: ModePath,
    followed: Followed,
    settings: FullPeriodMethod,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> FreePath:
    """Follow again, over the whole period, what half-period shooting has followed, and branch off where it can't."""
    gaps = {p.parameter for p in followed.points if any(job.shown(p.parameter) == j.start for j in followed.jumps)}
    path = FullPeriodPath(followed.orbits, followed.points, gaps)
    points: list[BranchPoint] = []
    for point in until(path, stop):
        points.append(point)
        if progress is not None:
            progress(len(points) / len(followed.points))
    if not points:
        raise NotTrustedError(f"full-period shooting found no motion to begin with: {path.status}")
    breakings = list(_breakings(followed, gaps)) if settings.branches and not stop() else []
    low, high = sorted((followed.points[0].parameter, followed.points[-1].parameter))
    branches: list[FreeBranch] = []
    steps = Settings(step=FIRST_STEP, largest_step=LARGEST_STEP, most_points=settings.points)
    for origin in breakings:
        if len(branches) == settings.branches or any(_arrives(branch, origin) for branch in branches):
            continue
        if stop():
            break
        wandering = Wandering(followed.orbits, origin, low, high, steps)
        own = list(until(wandering, stop))
        if own:
            branches.append(FreeBranch(origin, wandering.orbits, own, job.told(wandering.status, own[-1])))
    status = job.told(path.status, points[-1])
    if status.startswith("complete") and settings.branches and stop():
        status = f"{INTERRUPTED} beside the backbone, among the motions that are never at rest"
    return FreePath(path.orbits, points, status, np.array(path.differences), breakings, branches)


def _breakings(followed: Followed, gaps: set[float]) -> list[SymmetryBreaking]:
    """Along the backbone, its tongues, and the ways back into a tongue from beyond a jump; each once."""
    orbits, found = followed.orbits, list[SymmetryBreaking]()
    for points in _paths(followed, gaps):
        for a, b in pairwise(points):
            origin = breaking_between(orbits, a, b, Settings())
            if origin is not None and not any(_alike(orbits, origin, known) for known in found):
                found.append(origin)
    return found


def _paths(followed: Followed, gaps: set[float]) -> Iterator[list[BranchPoint]]:
    low, high = sorted((followed.points[0].parameter, followed.points[-1].parameter))
    stretch: list[BranchPoint] = []
    for point in followed.points:
        stretch.append(point)
        if point.parameter in gaps:
            yield stretch
            stretch = []
    yield stretch
    for tongue in followed.tongues:
        yield list(tongue.points)
    for a, b in pairwise(followed.points):
        if a.parameter in gaps:
            towards = float(np.sign(a.parameter - b.parameter))
            turned = b.tangent[-1] * towards < 0
            start = replace(b, tangent=-b.tangent, orientation=-b.orientation) if turned else b
            yield list(follow_modes(followed.orbits, start, low, high, Settings(most_points=BACK)))


def _alike(orbits: BrakeOrbits, a: SymmetryBreaking, b: SymmetryBreaking) -> bool:
    """Whether two are one orbit, seen from either of its instants of rest."""
    u, v = a.point.u, b.point.u
    if a.mode != b.mode or not np.allclose(u[-2:], v[-2:], rtol=SAME, atol=SAME):
        return False
    scale = orbits.scale(v)[0][: orbits.n]
    ends = (v[: orbits.n], b.point.data.passage.end[: orbits.n])
    return any(float(np.linalg.norm((u[: orbits.n] - q) / scale)) < SAME for q in ends)


def _arrives(branch: FreeBranch, origin: SymmetryBreaking) -> bool:
    """Whether a branch that has been followed ends where another begins: it would be the same one backwards."""
    if not branch.status.startswith("complete: came back"):
        return False
    n, last, there = branch.orbits.n, branch.points[-1].u, origin.point.u
    if abs(float(last[-2] / there[-2]) - 1.0) > NEAR:
        return False
    scale = branch.orbits.scale(last)[0][:n]
    passage = branch.points[-1].data.passage
    times = np.linspace(0.0, passage.duration, 257)
    q = branch.points[-1].data.flow.states_at(passage, times)[:, :n]
    return bool(np.min(np.linalg.norm((q - there[:n]) / scale, axis=1)) < NEAR)
