"""Additional points of a branch: at the ends of the range, at requested values and at maxima of the curve."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Generic, TypeVar

import numpy as np

from beamsim.orbits.branch import BranchPoint, OrbitBranch, reached_end
from beamsim.orbits.continuation import BranchStep, Settings
from beamsim.outcomes import stop_requested

ROUND_OFF = 1e-12  # relative distance within which a point has a value
SHARE = 1e-4  # of a step, to which a maximum is located: its height is then good to the square of this
INSIDE = 0.375  # share of the step at an end of a branch at which the search for a maximum begins

SETTINGS = Settings()
Motion = TypeVar("Motion")  # what is measured of a point


@dataclass(frozen=True)
class ReportedMaximum(Generic[Motion]):
    """A number of a motion whose maximum along the branch is reported."""

    measure: Callable[[Motion], float]
    stable_only: bool


@dataclass(frozen=True)
class TargetPoint:
    """A requested value of a quantity at which a branch gets a point."""

    quantity: str
    value: float  # as requested
    measure: Callable[[BranchPoint], float]
    parameter: float | None = None  # of the branch at the value, if the quantity is its parameter

    def on(self, step: BranchStep[Any]) -> BranchPoint | None:
        """The motion on a step of a branch that has the value; None if none is found.

        A value of the branch's parameter is met exactly, others to round-off.
        """
        if self.parameter is not None:
            return step.at_parameter(self.parameter)
        return step.locate(lambda p: self.measure(p) / self.value - 1.0)


def cut(branch: OrbitBranch, low: float, high: float) -> list[OrbitBranch]:
    """The pieces of a branch within a range, each with a point on the end of the range where it leaves it.

    Parameters
    ----------
    branch : of shooting or balance.
    low, high : ends of the range, in the unknown of the continuation.

    Returns
    -------
    list
        The branch itself where it does not leave the range, else its pieces of more than one point, in order.
    """
    margin = ROUND_OFF * (high - low)
    inside = (branch.values >= low - margin) & (branch.values <= high + margin)
    if inside.all():
        return [branch]
    pieces = []
    starts = np.flatnonzero(inside & ~np.append(False, inside[:-1]))
    ends = np.flatnonzero(inside & ~np.append(inside[1:], False))
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        points, outcome = list(branch.points[first : last + 1]), branch.outcome
        if last + 1 < len(branch.points):
            edge = low if branch.values[last + 1] < low else high
            outcome = reached_end(edge)
            points += _edge(branch.problem, branch.points[last], branch.points[last + 1], edge)
        if first > 0:
            edge = low if branch.values[first - 1] < low else high
            points = _edge(branch.problem, branch.points[first], branch.points[first - 1], edge) + points
        kept = {id(point) for point in points}
        special = tuple(s for s in branch.special if id(s.point) in kept)
        if len(points) > 1:
            pieces.append(replace(branch, points=tuple(points), outcome=outcome, special=special))
    return pieces


def _edge(problem: Any, inner: BranchPoint, outer: BranchPoint, edge: float) -> list[BranchPoint]:
    """The point at the end of the range between two neighbours; empty if the inner one lies there."""
    point = None if inner.parameter == edge else BranchStep(problem, inner, outer, SETTINGS).at_parameter(edge)
    return [] if point is None else [point]


def with_points_at(
    branch: OrbitBranch, targets: Sequence[TargetPoint], gaps: Collection[float] = ()
) -> tuple[OrbitBranch, list[tuple[TargetPoint, BranchPoint]]]:
    """The branch with a point wherever it passes a target, and these points.

    Parameters
    ----------
    branch : of shooting or balance.
    targets : requested values.
    gaps : parameters of points before a jump, across which nothing is interpolated.

    Returns
    -------
    branch : with its own points and the new ones.
    passed : each value with a point that has it, in the order of the branch; a value may be passed several times.
    """
    passed: list[tuple[TargetPoint, BranchPoint]] = []
    points: list[BranchPoint] = []
    for a, b in pairwise([*branch.points, branch.points[-1]]):
        points.append(a)
        step = BranchStep(branch.problem, a, b, Settings(iterations=15))
        between: list[tuple[TargetPoint, BranchPoint]] = []
        for each in targets:
            if abs(each.measure(a) - each.value) < ROUND_OFF * abs(each.value):
                passed.append((each, a))
            elif (
                b is not a
                and a.parameter not in gaps
                and (each.measure(a) - each.value) * (each.measure(b) - each.value) < 0
            ):
                point = each.on(step)
                between += [] if point is None else [(each, point)]
        between.sort(key=lambda found: step.share(found[1]))
        passed += between
        points += [point for _, point in between]
    return replace(branch, points=tuple(points)), passed


def with_maxima(
    branch: OrbitBranch,
    measure: Callable[[Sequence[BranchPoint]], list[Motion]],
    quantities: Iterable[ReportedMaximum[Motion]],
) -> tuple[OrbitBranch, list[Motion]]:
    """The branch with a point at the largest value of each quantity, and all points measured.

    Parameters
    ----------
    branch : of shooting or balance.
    measure : the motions of points.
    quantities : whose maxima are located.

    Returns
    -------
    branch : with its own points and the maxima.
    measured : its motions, point by point.
    """
    points, measured = list(branch.points), measure(branch.points)
    for quantity in quantities:
        if stop_requested():
            break
        values = [
            quantity.measure(m) if not quantity.stable_only or branch.problem.orbit(p).stable else -np.inf
            for p, m in zip(points, measured, strict=True)
        ]
        k = int(np.argmax(values))
        if np.isfinite(values[k]):
            _insert_maximum(branch.problem, points, measured, k, measure, quantity)
    return replace(branch, points=tuple(points)), measured


def _insert_maximum(
    problem: Any,
    points: list[BranchPoint],
    motions: list[Motion],
    k: int,
    measure: Callable[[Sequence[BranchPoint]], list[Motion]],
    q: ReportedMaximum[Motion],
) -> None:
    """Locate the maximum within the two steps about point k by Brent's method, and add the point if it is higher."""
    from scipy.optimize import minimize_scalar

    floor = q.measure(motions[k])
    best: tuple[float, float, BranchPoint, Motion] | None = None
    heights = {0.0: floor}  # by share of the step before point k (negative) or after it
    for share, other in ((-1.0, k - 1), (1.0, k + 1)):
        if 0 <= other < len(points):
            stands = not q.stable_only or problem.orbit(points[other]).stable
            heights[share] = q.measure(motions[other]) if stands else 0.5 * floor

    def height_at(share: float) -> float:
        nonlocal best
        if share not in heights:
            a, b, at = (points[k - 1], points[k], 1.0 + share) if share < 0 else (points[k], points[k + 1], share)
            point = BranchStep(problem, a, b, SETTINGS).point_at(at)
            if point is None or (q.stable_only and not problem.orbit(point).stable):
                heights[share] = 0.5 * floor
            else:
                motion = measure([point])[0]
                heights[share] = q.measure(motion)
                if best is None or heights[share] > best[0]:
                    best = heights[share], share, point, motion
        return heights[share]

    if len(heights) == 2:  # at an end of the branch, from a place inside
        height_at(INSIDE * (max(heights) + min(heights)))
    low, middle, high = sorted(heights) if len(heights) == 3 else (0.0, 0.0, 0.0)
    if heights[middle] > heights[low] and heights[middle] >= heights[high]:
        # from 2 on, since the tolerance is relative
        minimize_scalar(
            lambda x: -height_at(float(x) - 2.0), bracket=(low + 2.0, middle + 2.0, high + 2.0), tol=0.5 * SHARE,
            options={"maxiter": 40},
        )  # fmt: skip
    if best is not None and best[0] > floor * (1.0 + ROUND_OFF):
        _, share, point, motion = best
        where = k if share < 0 else k + 1
        points.insert(where, point)
        motions.insert(where, motion)
