"""All branches of a response between two values of its parameter, whatever stops each of them.

The main branch begins at the first value. Where it ends before the last (an isolated loop, a corner that the follower
does not pass), another begins from a motion that a transient comes to where nothing is known yet: first at the far end,
then in the middle of the longest interval that is left. A branch that runs into a known one ends there. One that leaves
the range is followed beyond it only where these branches leave something out.

Motions that transients from rest do not come to are sought in two ways: by transients from states that reach the
contacts, and by following motions down in level from one at which contact exists. Other branches leave these: at
period doublings with twice the period, at branch points with the same.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from beamsim.contacts.sliders import ELASTIC, LOADING, drops
from beamsim.flow.periodic_flow import PeriodicFlow
from beamsim.orbits.branch import (
    INTERRUPTED,
    POINT_LIMIT,
    REACHED_END,
    BranchPoint,
    FailedSearch,
    OrbitBranch,
    SpecialPoint,
    too_many_points,
    with_failed_searches,
)
from beamsim.orbits.continuation import (
    NOT_SMOOTH,
    STEP_TOO_SMALL,
    Branch,
    BranchStep,
    Settings,
    interpolate_unknowns,
    solve_at,
)
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.shooting import ForcedOrbits, find_orbit, linear_guess
from beamsim.orbits.special_points import special_points, switch_at_branch_point, switch_at_period_doubling
from beamsim.outcomes import (
    Outcome,
    OutcomeKind,
    Progress,
    Where,
    both_directions,
    stop_requested,
    until_stop,
)
from beamsim.typing import Floats

RAISED_LEVELS = (3.0, 10.0, 30.0)  # levels at which a motion with contact is looked for, over that of the curve
FIRST_DEFLECTIONS = (1.5, 4.0)  # deflections that transients begin with, over those that reach the contact
TRANSIENT_PERIODS = 80  # periods that these are followed for
SETTINGS = Settings(iterations=25)
BACK_TO_PERIOD = "back_to_period"
EXCURSION = 1.5  # how far beyond the first frequency or level, as a ratio, a branch may go
COVERED_SHARE = 1e-3  # of the range: intervals shorter than this count as covered
SAME_BRANCH = 2e-3  # distance from a known branch, against the motion, within which a motion belongs to it


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
            orbit = find_orbit(ForcedOrbits(self.problem.flow_at(value)[0]))
            if orbit is not None:
                return solve_at(self.problem, np.append(orbit.u[:-1], value), SETTINGS, value, forward)
        return None

    def search(self, value: float) -> Iterator[BranchPoint | None]:
        """Motions at a value, other than those that are followed, with repetitions; None where one was sought in vain.

        Harmonic balance has them from shooting, and none with cubic springs.
        """
        if isinstance(self.problem, ForcedOrbits):
            for state in periodic_states(self.problem.flow_at(value)[0]):
                yield self._try_find(solve_at, self.problem, np.append(state, value), SETTINGS, value)
        elif self.problem.cubic is None:
            flow = self.problem.shooting(value).flow
            period = 2 * np.pi * self.problem.multiple / flow.omega
            for state in periodic_states(flow, self.problem.multiple):
                yield self._try_find(self.problem.from_flow_map, flow, flow.flow_map(state, period), value)

    @staticmethod
    def _try_find(find: Callable[..., BranchPoint | None], *argument: Any) -> BranchPoint | None:
        try:
            return find(*argument)
        except (ArithmeticError, np.linalg.LinAlgError):
            return None


def periodic_states(flow: PeriodicFlow, multiple: int = 1) -> Iterator[Floats]:
    """States of periodic motions of a system, with repetitions: by transients, and down from higher levels."""
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _from_beyond_gaps(ForcedOrbits(flow, multiple=multiple))
    with suppress(ArithmeticError, np.linalg.LinAlgError):
        yield from _follow_down(ForcedOrbits(flow, "level", multiple))


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
        for factor in FIRST_DEFLECTIONS:
            for side in (1.0, -1.0):
                z = linear * (side * factor * max(abs(float(gap)), reached) / reached)
                z = flow.end(z, TRANSIENT_PERIODS * 2 * np.pi / local.omega)
                orbit = solve_at(local, np.append(z, local.value), SETTINGS, local.value)
                if orbit is not None and local.orbit(orbit).stable:
                    yield orbit.u[:-1]


def _follow_down(problem: ForcedOrbits) -> Iterator[Floats]:
    """States at the level of the problem, on branches that come down from levels at which contact exists."""
    level = problem.level
    for factor in RAISED_LEVELS:
        high = factor * level
        raised = ForcedOrbits(problem.flow.with_loads(problem.omega, high), "level", problem.multiple)
        start = find_orbit(raised, forward=-1.0)
        if start is None or not start.data.signature:
            continue
        branch = Branch(raised, start, 0.2 * level, 2.0 * high, Settings(largest_step=0.2, most_points=150))
        for a, b in pairwise(branch):
            if (a.parameter - level) * (b.parameter - level) <= 0 and a.parameter != b.parameter:
                point = BranchStep(raised, a, b, SETTINGS).at_parameter(level)
                if point is not None:
                    yield point.u[:-1]
        return


@dataclass
class Budget:
    """Work that one level may cost, and what it was not enough for."""

    points: int
    seconds: float
    branch_points: int = 2000  # of one branch
    side_points: int = 300  # of one that leaves another branch
    branches: int = 40
    points_used: int = 0  # points so far
    start_time: float = field(default_factory=clock.monotonic)
    settings_hit: set[str] = field(default_factory=set)  # settings that ended a branch, or kept one from being followed
    not_followed: int = 0  # bifurcations from which no branch was followed

    def exhaustion(self) -> Outcome | None:
        """Why no more work is allowed; None while it is."""
        if stop_requested():
            return INTERRUPTED
        if self.points <= self.points_used:
            return with_limit(too_many_points(self.points_used), "sweep.most_points")
        if clock.monotonic() - self.start_time > self.seconds:
            spent = Outcome.of(OutcomeKind.STOPPED, "time_limit", f"the limit of {self.seconds:g} s is reached")
            return with_limit(spent, "sweep.longest_time")
        return None

    @property
    def remaining(self) -> int:
        """Points that a branch may still have: two at least."""
        return max(self.points - self.points_used, 2)

    def allows_another(self, branches: int) -> bool:
        """Whether one more branch may be followed in addition to so many; the limit that forbids it is kept."""
        spent = self.exhaustion()
        if spent is None and branches < self.branches:
            return True
        self.cut(spent or with_limit(too_many_points(self.points_used), "sweep.most_branches"))
        return False

    def cut(self, outcome: Outcome) -> None:
        """Record the setting that ended a branch."""
        if "limit" in outcome.numbers:
            self.settings_hit.add(str(outcome.numbers["limit"]))

    def exceeded(self, *, incomplete: bool) -> Outcome | None:
        """Which limits ended branches, or kept them from being followed; None where none did."""
        if not self.settings_hit:
            return None
        limits, left = ", ".join(sorted(self.settings_hit)), self.not_followed
        beyond = f"; from {left} bifurcations no branch was followed" if left else ""
        if incomplete:
            sentence = "limits on the number of points or branches were reached"
            return Outcome.of(OutcomeKind.INCOMPLETE, "limits_reached", sentence + beyond, remedy=f"raise {limits}")
        return Outcome.of(
            OutcomeKind.NOTED, "side_branches_cut",
            "coexisting and side branches end at limits on points, branches or time" + beyond,
            remedy=f"raise {limits}, or leave these branches out (sweep.side_branches: none)",
        )  # fmt: skip


def with_limit(outcome: Outcome, limit: str) -> Outcome:
    """The outcome of what ended at a setting's limit."""
    return outcome.copy_with(remedy=f"raise {limit}", numbers={**outcome.numbers, "limit": limit})


def reaches_of(first: float, last: float, beyond_first: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where branches may go: a loop of the curve may reach back beyond the first value before it goes on.

    Parameters
    ----------
    first, last : values of the unknown.
    beyond_first : whether the main branches may leave the range at its first value, by the ratio `EXCURSION`.

    Returns
    -------
    main : lowest and highest value that a main branch must not leave.
    secondary : those of branches that begin next to the main ones, a little beyond the range.
    """
    low, high = sorted((first, last))
    main = low, high
    if beyond_first:
        main = (low / EXCURSION, high) if last > first else (low, high * EXCURSION)
    little = 0.1 * (high - low)
    return main, (max(low - little, main[0]), min(high + little, main[1]))


def progress_that_grows(report: Progress) -> Callable[[float], None]:
    """A progress report that never decreases."""
    best = 0.0

    def grown(fraction: float) -> None:
        nonlocal best
        if report is not None and fraction > best:
            best = fraction
            report(min(best, 1.0))

    return grown


def gaps_between(spans: Iterable[tuple[float, float]], low: float, high: float) -> list[tuple[float, float]]:
    """The intervals of a range that the spans do not cover, long enough to matter.

    Parameters
    ----------
    spans : lowest and highest value of each, in any order.
    low, high : ends of the range.

    Returns
    -------
    list
        Begin and end of each interval, increasing; none is shorter than the share `COVERED_SHARE` of the range.
    """
    gaps, at = [], low
    for a, b in sorted(spans):
        if a - at > COVERED_SHARE * (high - low):
            gaps.append((at, a))
        at = max(at, b)
    if high - at > COVERED_SHARE * (high - low):
        gaps.append((at, high))
    return gaps


def missing(branches: Iterable[OrbitBranch], first: float, last: float) -> list[tuple[float, float]]:
    """The intervals between two values that no branch reached.

    Parameters
    ----------
    branches : with at least one point each.
    first, last : values of the unknown, in any order.

    Returns
    -------
    list
        As of `gaps_between`.
    """
    low, high = sorted((first, last))
    return gaps_between([t.span for t in branches], low, high)


def trace_range(
    tracer: Tracer, first: float, last: float, budget: Budget, report: Progress = None
) -> list[OrbitBranch]:
    """Branches from the first value to the last, as many as are needed.

    Parameters
    ----------
    tracer : how motions are found and followed.
    first, last : values of the problem's unknown.
    budget : points and time that may be spent.
    report : called with the share of the range that is covered.

    Returns
    -------
    list
        Empty where no motion was found at any value that was tried; some intervals may be left (`missing`).
    """
    low, high = sorted((first, last))
    grown = progress_that_grows(report)
    branches: list[OrbitBranch] = []
    tried: list[float] = []

    def tell(parameter: float) -> None:
        spans = [t.span for t in branches]
        known = gaps_between([*spans, (min(begin, parameter), max(begin, parameter))], low, high)
        grown(1.0 - sum(b - a for a, b in known) / (high - low))

    begin, inside = first, replace(tracer, reach=(low, high))
    for count in range(12):
        tried.append(begin)
        start = tracer.begin(begin, last - first if count == 0 else first - last)
        if start is not None:
            # forward from the first value and back from the last, from anywhere else both ways
            directions = [1.0] if begin in (first, last) else [1.0, -1.0]
            branches.append(
                join_directions(*(follow(inside, start, way, budget, branches, tell) for way in directions))
            )
        gaps, begin = missing(branches, first, last), last
        if gaps and (last in tried or not any(last in gap for gap in gaps)):
            # what a limit on points left out is looked for within the range first
            if inside is not tracer and (count > 1 or not budget.settings_hit):
                inside = tracer
                for k, branch in enumerate(branches):
                    branches[k] = followed_beyond(tracer, branch, budget, [*branches[:k], *branches[k + 1 :]])
                gaps = missing(branches, first, last)
            # the middle of the longest interval between gaps' ends and failed places
            cuts = [[a, *sorted(x for x in tried if a < x < b), b] for a, b in gaps]
            pieces = [piece for each in cuts for piece in pairwise(each)]
            a, b = max(pieces, key=lambda piece: piece[1] - piece[0], default=(low, high))
            begin = 0.5 * (a + b)
        if not gaps or budget.exhaustion():
            break
    if not missing(branches, first, last):
        budget.settings_hit.clear()  # what one branch left out, another one reached
    grown(1.0)
    return branches


def coexisting_branches(
    tracer: Tracer, values: list[float], known_branches: list[OrbitBranch], budget: Budget
) -> list[OrbitBranch]:
    """Branches that pass none of the known ones.

    Parameters
    ----------
    tracer : along the parameter.
    values : of the parameter, at which motions are sought.
    known_branches : branches so far.
    budget : points and time that may be spent.

    Returns
    -------
    list
        The new ones, followed in both directions from where they were found.
    """
    branches: list[OrbitBranch] = []
    for value in values:
        if stop_requested():
            return branches
        for start in until_stop(tracer.search(value)):
            if not budget.allows_another(len(known_branches) + len(branches)):
                return branches
            if start is None or coincides(start, [*known_branches, *branches]):
                continue
            halves = [
                follow(tracer, start, direction, budget, [*known_branches, *branches]) for direction in (1.0, -1.0)
            ]
            branches.append(join_directions(*halves))
    return branches


def follow(
    tracer: Tracer,
    start: BranchPoint,
    direction: float,
    budget: Budget,
    known_branches: list[OrbitBranch],
    progress: Progress = None,
) -> OrbitBranch:
    """What goes on in one direction from a start, up to a known branch.

    Parameters
    ----------
    tracer : with the problem and the values that must not be left.
    start : the first point.
    direction : along its tangent (> 0), or against it.
    budget : points and time that may be spent.
    known_branches : branches that it may run into.
    progress : called with the parameter of every point.

    Returns
    -------
    OrbitBranch
        From the start on, with its special points.
    """
    if direction < 0:
        start = start.reverse()
    most = min(budget.branch_points, budget.remaining)
    limit = "sweep.most_branch_points" if most == budget.branch_points else "sweep.most_points"
    branch = Branch(tracer.problem, start, *tracer.reach, Settings(most_points=most))
    return walk(branch, budget, joining(known_branches, progress=progress), limit)


def followed_beyond(
    tracer: Tracer, branch: OrbitBranch, budget: Budget, known_branches: list[OrbitBranch]
) -> OrbitBranch:
    """A branch, followed on where its last point left a range: the curve may come back.

    Parameters
    ----------
    tracer : with the values that must not be left.
    branch : within the range.
    budget, known_branches : see `follow`.

    Returns
    -------
    OrbitBranch
        The same one where it did not leave the range, or where nothing may be followed beyond it.
    """
    last = branch.points[-1]
    outwards = tracer.reach[1] if last.tangent[-1] > 0 else tracer.reach[0]
    if branch.outcome.code != REACHED_END or last.parameter == outwards or budget.exhaustion():
        return branch
    on = follow(tracer, last, 1.0, budget, known_branches)
    points, special = (*branch.points[:-1], *on.points), (*branch.special, *on.special)
    return replace(on, points=points, special=special, outcome=on.outcome.copy_with(*branch.outcome.sub_outcomes))


def joining(
    known_branches: list[OrbitBranch], *, from_bifurcation: bool = False, progress: Progress = None
) -> Callable[[BranchPoint], Outcome | None]:
    """A test of whether a branch has run into a known one.

    Parameters
    ----------
    known_branches : branches.
    from_bifurcation : whether it begins on one of them, and ends where it comes to one again.
    progress : called with the parameter of every point.

    Returns
    -------
    Callable
        To be called with every point in turn: None until the second one in a row on a known branch, then the outcome.
    """
    apart, close = not from_bifurcation, 0

    def joins(point: BranchPoint) -> Outcome | None:
        nonlocal apart, close
        if progress is not None:
            progress(point.parameter)
        together = coincides(point, known_branches)
        apart = apart or not together
        close = close + 1 if apart and together else 0
        if close < 2:
            return None
        return Outcome.of(OutcomeKind.COMPLETE, "joined_branch", "joined another branch", at=point.parameter)

    return joins


def walk(
    branch: Branch, budget: Budget, ends: Callable[[BranchPoint], Outcome | None], limit: str = "",
    *, with_special: bool = True,
) -> OrbitBranch:  # fmt: skip
    """The points of a branch with the special ones among them, until it ends by itself, by a test or by the budget.

    Parameters
    ----------
    branch : to be followed.
    budget : points and time that may be spent.
    ends : the outcome with which a point ends the branch, if it does.
    limit : the setting behind the branch's own number of points, empty where that is no setting.
    with_special : whether special points are located between neighbours.

    Returns
    -------
    OrbitBranch
        With the outcome of what ended it, and the searches for special points that failed.
    """
    points: list[BranchPoint] = []
    special: list[SpecialPoint] = []
    failed: list[FailedSearch] = []
    outcome = None
    for point in until_stop(branch):
        if points and np.array_equal(point.u, points[-1].u):  # it begins on the end of its reach
            continue
        outcome = ends(point)
        if outcome is not None and outcome.code == BACK_TO_PERIOD:
            break
        if points and with_special:
            step: BranchStep[Any] = BranchStep(branch.problem, points[-1], point, branch.settings)
            between = sorted(special_points(step, failed), key=lambda s: step.share(s.point))
            special += between
            points += [s.point for s in between]
        points.append(point)
        budget.points_used += 1
        if outcome is not None:
            break
        if spent := budget.exhaustion():
            outcome = spent.copy_with(place=Where(point.parameter))
            budget.cut(spent)
            break
    outcome = outcome or branch.outcome
    if limit and outcome.code == POINT_LIMIT and not outcome.remedy:
        outcome = with_limit(outcome, limit)
        budget.cut(outcome)
    if points:
        outcome = explain(outcome, branch.problem, points[-1])
    return OrbitBranch(branch.problem, points, with_failed_searches(outcome, failed), tuple(special))


AT_END = 1e-9  # relative distance of the parameter from the end of a branch, within which a motion lies there


def coincides(point: BranchPoint, known_branches: list[OrbitBranch]) -> bool:
    """Whether a known branch passes through a point."""
    p = point.parameter
    for branch in known_branches:
        off = branch.values - p
        low, high = np.minimum(off[:-1], off[1:]), np.maximum(off[:-1], off[1:])
        for i in np.flatnonzero((low <= AT_END * abs(p)) & (high >= -AT_END * abs(p)) & (low < high)):
            a, b = branch.points[int(i)], branch.points[int(i) + 1]
            between = a.u + np.clip(off[i] / (off[i] - off[i + 1]), 0.0, 1.0) * (b.u - a.u)
            away = float(np.linalg.norm(((between - point.u) / point.scale)[:-1]))
            apart = float(np.linalg.norm(((a.u - b.u) / point.scale)[:-1]))
            if away < SAME_BRANCH + 0.1 * apart**2:
                return True
            if away < apart and min(a.parameter, b.parameter) < p < max(a.parameter, b.parameter):
                # a sharp peak is far from its chords: on the cubic
                share = brentq(lambda s, a=a, b=b: float(interpolate_unknowns(a, b, s)[-1]) - p, 0.0, 1.0)
                off_curve = (interpolate_unknowns(a, b, share) - point.u) / point.scale
                if float(np.linalg.norm(off_curve[:-1])) < SAME_BRANCH:
                    return True
    return False


def join_directions(forward: OrbitBranch, backward: OrbitBranch | None = None) -> OrbitBranch:
    """One branch from what was followed in one direction or both."""
    if backward is None:
        return forward
    points = (*backward.points[::-1][:-1], *forward.points)
    outcome, special = both_directions(backward.outcome, forward.outcome), (*backward.special[::-1], *forward.special)
    return replace(forward, points=points, outcome=outcome, special=special)


def explain(outcome: Outcome, problem: Any, last: BranchPoint) -> Outcome:
    """The outcome of a branch, with what its contacts have to do with its end.

    Parameters
    ----------
    outcome : of the branch.
    problem : of the branch.
    last : its last point.

    Returns
    -------
    Outcome
        Another one where a friction contact begins to stick or slide at once, or a stop just yields; else the same.
    """
    if not isinstance(problem, ForcedOrbits):
        return outcome
    laws = problem.flow.system.contacts.laws
    if outcome.code == STEP_TOO_SMALL and any(drops(law) for law in laws):
        return outcome.copy_with(
            code="sticking_jumps",
            sentence="where a friction contact with a static coefficient above the sliding one begins to stick or to "
            "slide, it does so at once for a time that is not short, and the motions beyond are not neighbours of "
            "these",
            remedy="follow the range beyond with a stepped sine, begin the continuation there, or give the contact one "
            "coefficient",
        )
    if outcome.code == NOT_SMOOTH and any(law.yields for law in laws) and _nearly_yields(problem, last):
        return outcome.copy_with(
            code="just_yields",
            sentence="the motion just reaches the yield force of a stop; with any larger crush it is periodic as well, "
            "so that no single branch continues",
            remedy="follow the range beyond with a stepped sine or a study of runs, where the crush is that of their "
            "past",
        )
    return outcome


def _nearly_yields(problem: ForcedOrbits, point: BranchPoint) -> bool:
    """Whether in an elastic motion the force of a stop that yields comes close to its yield force."""
    flow, flow_map = problem.cycle(point)
    contacts, n = flow.system.contacts, 2 * flow.system.size
    times = np.linspace(0.0, flow_map.duration, 4000, endpoint=False)
    y = flow.states_at(flow_map, times)
    penetration = flow.penetration_of(y, times)[0]
    segment = np.searchsorted(flow_map.time, times, side="right") - 1
    phases = flow_map.phases[segment]
    for j, law in enumerate(contacts.laws):
        if not law.yields or np.any(phases[:, j] >= LOADING):
            continue
        (guard,) = (guard for guard in law.phases[ELASTIC].guards if guard.next == LOADING)
        slider = y[:, n + contacts.first_state[j]]
        left = guard.row.constant + guard.row.penetration * penetration[:, j] + guard.row.internal[0] * slider
        # 1e-3: of the yield force: a motion that comes closer just reaches it
        if np.any(left[phases[:, j] == ELASTIC] < 1e-3 * guard.row.constant):
            return True
    return False


SAME_PARAMETER = 1e-4  # relative distance within which a bifurcation belongs to a branch that is known
SAME_HALVES = 1e-7  # difference of a motion's halves, against the motion, below which it has the shorter period
FEWEST_POINTS = 30  # that a branch gets where many share what is left


@dataclass(frozen=True, eq=False)
class BranchingPoint:
    """A bifurcation from which branches leave."""

    branch: OrbitBranch
    event: SpecialPoint
    at_stable: bool  # whether neighbouring motions on the branch are stable

    @property
    def multiple(self) -> int:
        """Periods of the excitation in one of the motions that leave."""
        return int(self.branch.problem.multiple) * (2 if self.event.kind == "period_doubling" else 1)


def side_branches(
    main_branches: list[OrbitBranch], reach: tuple[float, float], longest: int, budget: Budget
) -> list[OrbitBranch]:
    """The branches that leave others, each once, and those that leave them.

    Those next to stable motions come first, and among these the ones far from those that were followed.

    Parameters
    ----------
    main_branches : the branches known so far, by shooting.
    reach : values of the unknown that a branch must not leave.
    longest : periods of the excitation that a motion may take, at most.
    budget : points, branches and time that may be spent.

    Returns
    -------
    list
        The branches in the order in which they were followed, without those in ``main_branches``.
    """
    known: list[OrbitBranch] = []
    followed_at: list[float] = []
    waiting = [leaving for branch in main_branches for leaving in branching_points(branch, longest)]

    def urgency(branching: BranchingPoint) -> tuple[bool, float]:
        """The smallest one first: far from the bifurcations that were followed, so that all of the range is served."""
        away = (abs(branching.event.parameter - value) for value in followed_at)
        return not branching.at_stable, -min(away, default=0.0)

    def is_an_end(branching: BranchingPoint) -> bool:
        """Whether a branch that was followed ends there."""
        value = branching.event.parameter
        ends = [p for b in known if b.problem.multiple == branching.multiple for p in (b.points[0], b.points[-1])]
        return any(abs(p.parameter - value) < SAME_PARAMETER * abs(value) for p in ends)

    while waiting:
        leaving = min(waiting, key=urgency)
        waiting.remove(leaving)
        if is_an_end(leaving):
            continue
        if not budget.allows_another(len(main_branches) + len(known)):
            budget.not_followed += 1
            continue
        followed_at.append(leaving.event.parameter)
        share = max(FEWEST_POINTS, budget.remaining // (len(waiting) + 1))
        for branch in _branches(leaving, [*main_branches, *known], reach, budget, share):
            if len(branch.points) < 2:
                continue
            known.append(branch)
            waiting += branching_points(branch, longest)
    return known


def branching_points(branch: OrbitBranch, longest: int) -> list[BranchingPoint]:
    """The bifurcations of a branch from which others leave."""
    places = {id(point): k for k, point in enumerate(branch.points)}
    bifurcations = []
    for event in branch.special:
        if event.kind in ("period_doubling", "branch_point"):
            k = places[id(event.point)]
            neighbours = [branch.points[i] for i in (k - 1, k + 1) if 0 <= i < len(branch.points)]
            bifurcations.append(BranchingPoint(branch, event, any(branch.problem.orbit(p).stable for p in neighbours)))
    return [leaving for leaving in bifurcations if leaving.multiple <= longest]


def _branches(
    branching: BranchingPoint, known_branches: list[OrbitBranch], reach: tuple[float, float], budget: Budget, share: int
) -> list[OrbitBranch]:
    """One branch of doubled period; at a branch point those to both sides."""
    problem, event = branching.branch.problem, branching.event
    if event.kind == "period_doubling":
        switched = switch_at_period_doubling(problem, event)
        return [] if switched is None else [_follow(*switched, [], reach, budget, share)]
    started: list[OrbitBranch] = []
    others = [branch for branch in known_branches if branch is not branching.branch]
    k = next(i for i, point in enumerate(branching.branch.points) if point is event.point)
    before, after = (
        branching.branch.points[max(k - 1, 0)],
        branching.branch.points[min(k + 1, len(branching.branch.points) - 1)],
    )
    for start in switch_at_branch_point(problem, event, after.u - before.u):
        if not coincides(start, [*others, *started]) and not budget.exhaustion():
            started.append(_follow(problem, start, [*known_branches, *started], reach, budget, share))
    return started


def _follow(
    problem: ForcedOrbits, start: BranchPoint, known_branches: list[OrbitBranch], reach: tuple[float, float],
    budget: Budget,
    share: int,
) -> OrbitBranch:  # fmt: skip
    """A branch until it returns: with its halves alike again, or on a known branch."""
    most = min(budget.side_points, share, budget.remaining)
    limit = "sweep.most_side_points" if most == budget.side_points else "sweep.most_points"
    last: Floats | None = None

    def halves_alike(point: BranchPoint) -> Outcome | None:
        """Beyond such a motion every one comes again, half its period later; or a step went over to those it left."""
        nonlocal last
        unlike = _half_period_difference(problem, point)
        if last is not None and (float(last @ unlike) < 0 or float(np.linalg.norm(unlike)) < SAME_HALVES):
            return Outcome.of(OutcomeKind.COMPLETE, BACK_TO_PERIOD, f"back to period {problem.multiple // 2}")
        last = unlike
        return None

    ends = joining(known_branches, from_bifurcation=True) if known_branches else halves_alike
    return walk(Branch(problem, start, *reach, Settings(most_points=most)), budget, ends, limit)


def _half_period_difference(problem: ForcedOrbits, point: BranchPoint) -> Floats:
    """Difference of the states half a period apart, relative to the size of the motion."""
    flow, _ = problem.flow_at(point.parameter)
    n2 = 2 * flow.system.size
    half = flow.states_at(point.data, np.array([0.5 * point.data.duration]))[0]
    return np.asarray((half[:n2] - point.u[:n2]) / problem.scale(point.u)[0][:n2])
