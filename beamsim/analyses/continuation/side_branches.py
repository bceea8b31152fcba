"""Branches that leave others: at period doublings with twice the period, at branch points with the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamsim.analyses.continuation.branches import (
    BACK_TO_PERIOD,
    Budget,
    coincides,
    joining,
    walk,
)
from beamsim.orbits.branch import BranchPoint, OrbitBranch, SpecialPoint
from beamsim.orbits.continuation import Branch, Settings
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.special_points import switch_at_branch_point, switch_at_period_doubling
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.typing import Floats

SAME_PARAMETER = 1e-4  # relative distance within which a bifurcation belongs to a branch that is known
ALIKE = 1e-7  # difference of a motion's halves, against the motion, below which it has the shorter period
FEWEST_POINTS = 30  # that a branch gets where many share what is left


@dataclass(frozen=True, eq=False)
class Leaving:
    """A bifurcation from which branches leave."""

    branch: OrbitBranch
    event: SpecialPoint
    at_stable: bool  # whether motions beside it on the branch are stable

    @property
    def multiple(self) -> int:
        """Periods of the excitation in one of the motions that leave."""
        return int(self.branch.problem.multiple) * (2 if self.event.kind == "period_doubling" else 1)


def side_branches(
    main: list[OrbitBranch], reach: tuple[float, float], longest: int, budget: Budget
) -> list[OrbitBranch]:
    """The branches that leave others, each once, and those that leave them.

    Those beside stable motions come first, and among these the ones far from those that were followed.

    Parameters
    ----------
    main : the branches known so far, by shooting.
    reach : values of the unknown that a branch must not leave.
    longest : periods of the excitation that a motion may take, at most.
    budget : points, branches and time that may be spent.

    Returns
    -------
    list
        The branches in the order in which they were followed, without those in ``main``.
    """
    known: list[OrbitBranch] = []
    followed_at: list[float] = []
    waiting = [leaving for branch in main for leaving in leavings(branch, longest)]

    def urgency(each: Leaving) -> tuple[bool, float]:
        """The smallest one first: far from the bifurcations that were followed, so that all of the range is served."""
        away = (abs(each.event.parameter - value) for value in followed_at)
        return not each.at_stable, -min(away, default=0.0)

    def is_an_end(each: Leaving) -> bool:
        """Whether a branch that was followed ends there."""
        value = each.event.parameter
        ends = [p for b in known if b.problem.multiple == each.multiple for p in (b.points[0], b.points[-1])]
        return any(abs(p.parameter - value) < SAME_PARAMETER * abs(value) for p in ends)

    while waiting:
        leaving = min(waiting, key=urgency)
        waiting.remove(leaving)
        if is_an_end(leaving):
            continue
        if not budget.allows_another(len(main) + len(known)):
            budget.not_followed += 1
            continue
        followed_at.append(leaving.event.parameter)
        share = max(FEWEST_POINTS, budget.left // (len(waiting) + 1))
        for branch in _branches(leaving, [*main, *known], reach, budget, share):
            if len(branch.points) < 2:
                continue
            known.append(branch)
            waiting += leavings(branch, longest)
    return known


def leavings(branch: OrbitBranch, longest: int) -> list[Leaving]:
    """The bifurcations of a branch from which others leave."""
    places = {id(point): k for k, point in enumerate(branch.points)}
    bifurcations = []
    for event in branch.special:
        if event.kind in ("period_doubling", "branch_point"):
            k = places[id(event.point)]
            beside = [branch.points[i] for i in (k - 1, k + 1) if 0 <= i < len(branch.points)]
            bifurcations.append(Leaving(branch, event, any(branch.problem.orbit(p).stable for p in beside)))
    return [leaving for leaving in bifurcations if leaving.multiple <= longest]


def _branches(
    leaving: Leaving, known: list[OrbitBranch], reach: tuple[float, float], budget: Budget, share: int
) -> list[OrbitBranch]:
    """One branch of doubled period; at a branch point those to both sides."""
    problem, event = leaving.branch.problem, leaving.event
    if event.kind == "period_doubling":
        switched = switch_at_period_doubling(problem, event)
        return [] if switched is None else [_followed(*switched, [], reach, budget, share)]
    started: list[OrbitBranch] = []
    others = [branch for branch in known if branch is not leaving.branch]
    k = next(i for i, point in enumerate(leaving.branch.points) if point is event.point)
    before, after = (
        leaving.branch.points[max(k - 1, 0)],
        leaving.branch.points[min(k + 1, len(leaving.branch.points) - 1)],
    )
    for start in switch_at_branch_point(problem, event, after.u - before.u):
        if not coincides(start, [*others, *started]) and not budget.spent():
            started.append(_followed(problem, start, [*known, *started], reach, budget, share))
    return started


def _followed(
    problem: ForcedOrbits, start: BranchPoint, known: list[OrbitBranch], reach: tuple[float, float], budget: Budget,
    share: int,
) -> OrbitBranch:  # fmt: skip
    """A branch until it returns: with its halves alike again, or on a known branch."""
    most = min(budget.side_points, share, budget.left)
    limit = "sweep.most_side_points" if most == budget.side_points else "sweep.most_points"
    last: Floats | None = None

    def halves_alike(point: BranchPoint) -> Outcome | None:
        """Beyond such a motion every one comes again, half its period later; or a step went over to those it left."""
        nonlocal last
        unlike = _unlike(problem, point)
        if last is not None and (float(last @ unlike) < 0 or float(np.linalg.norm(unlike)) < ALIKE):
            return Outcome.of(OutcomeKind.COMPLETE, BACK_TO_PERIOD, f"back to period {problem.multiple // 2}")
        last = unlike
        return None

    ends = joining(known, leaves=True) if known else halves_alike
    return walk(Branch(problem, start, *reach, Settings(most_points=most)), budget, ends, limit)


def _unlike(problem: ForcedOrbits, point: BranchPoint) -> Floats:
    """Difference of the states half a period apart, relative to the size of the motion."""
    flow, _ = problem.flow_at(point.parameter)
    n2 = 2 * flow.system.size
    half = flow.states_at(point.data, np.array([0.5 * point.data.duration]))[0]
    return np.asarray((half[:n2] - point.u[:n2]) / problem.scale(point.u)[0][:n2])
