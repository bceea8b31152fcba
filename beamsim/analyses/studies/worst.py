"""The worst that tolerances allow of a case: corners of the box of deviations, then a search from the worst points.

A sample seldom comes near a corner of the box, where the worst most often is. The corners that are solved are all of a
few numbers, else those that exact derivatives and a linear fit of the sample point to. From the worst of all points
that are known a compass search goes on (R. Hooke and T. A. Jeeves, Journal of the ACM 8 (1961) 212-229), and once more
from the worst one that lies apart. Where the worse of both ended, it goes on with smaller steps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import limited_response, means
from beamsim.analyses.studies.table import StudyTable, table_of
from beamsim.cases import CaseOutcome, Evaluator
from beamsim.scenario.studies import Value
from beamsim.typing import Floats

SAMPLED, TRIED = "sampled", "tried where others are worst"
SEARCHED, UNFINISHED = "searched", "search not finished"
"""What the worst of a case is."""
OBJECTIVE = "objective"  # what an objective is called where a limit has its name
FEW = 4  # numbers, all of whose corners are solved
COARSE = (2.0, 1.0, 0.5, 0.25, 0.125)  # steps of the compass searches, in tolerances
FINE = (0.0625, 0.03125)  # where the worse of two searches ended: a resonance is narrow
BETTER = 1e-3  # of a value, by which a step makes it worse
FOR_A_SEARCH = 0.4  # of the budget, which stays for the search of the last case while it is not known what one takes
MOST_TRIED = 6  # cases, before the best of them is where a local search starts
APART = 0.75  # in tolerances, from the worst point that was found to that where the second search starts

Point = tuple[float, ...]
"""Deviations of the numbers as shares of their tolerances, from -1 to 1."""
Changes = Mapping[str, Mapping[str, tuple[float, float]]]
"""By response and path its change where the number is smaller and where it is larger by its tolerance."""


class Judge(NamedTuple):
    """A limit or an objective: what is the worse, the larger it is."""

    name: str
    badness: Callable[[CaseOutcome], float]  # nan where it is not known
    sign: float  # 1 where large responses are bad
    asked: tuple[str, ...]  # responses, whose worst place counts


def judges_of(plan: StudyPlan) -> list[Judge]:
    """The judges of a study: every limit, and every objective that is made of responses."""
    found = list[Judge]()
    for name in {} if plan.scenario.limits is None else plan.scenario.limits.values_by_name:

        def of_limit(outcome: CaseOutcome, name: str = name) -> float:
            return float(outcome.margins.get(name, {}).get("value", np.nan))

        found.append(Judge(name, of_limit, 1.0, (limited_response(name),)))
    for aim in (aim for aim in objectives(plan.scenario) if aim.terms):

        def of_aim(outcome: CaseOutcome, of: Callable[..., Floats | None] = aim.of, sign: float = aim.sign) -> float:
            numbers = {name: np.array([x]) for name, x in outcome.values.items() if isinstance(x, float | int)}
            value = of(numbers)
            return np.nan if value is None else sign * float(value[0])

        limited = {judge.name: judge.sign for judge in found}
        if limited.get(aim.name) != aim.sign:  # else the limit judges alike
            name = OBJECTIVE if aim.name in limited else aim.name
            found.append(Judge(name, of_aim, aim.sign, tuple(name for name, _ in aim.terms)))
    return found


class WorstSearch:
    """Searches for the worst of the best cases of a study, as far as its budget goes.

    Parameters
    ----------
    plan : of the study.
    evaluate : solves the realisations.
    changes_of : by the number of a case and the values of the varied parameters, how its responses change within the
        tolerances by derivatives; none where there are none.
    """

    def __init__(
        self, plan: StudyPlan, evaluate: Evaluator, changes_of: Callable[[int, tuple[Value, ...]], Changes]
    ) -> None:
        self.plan, self.evaluate, self.changes_of = plan, evaluate, changes_of
        self.searches: dict[int, bool] = {}  # by case that was searched: whether its search came to its end
        self.critical: dict[Point, None] = {}  # where searched cases are worst
        self._explored = set[int]()  # cases whose corners are solved
        self._cost = 0  # largest number of further cases of a search

    @property
    def judges_by_worst(self) -> bool:
        """Whether cases are judged by their worst, which may be searched."""
        realisations = self.plan.study.realisations
        return realisations.judged_by_worst and realisations.most_further > 0

    def search_next(self) -> bool:
        """Search for the worst of what may be the best case, if it is not known yet; whether there was one.

        A case is first tried where others are worst, and searched only if it still may be the best. As much of the
        budget as a search took stays for the last one.
        """
        if not (self.judges_by_worst and self.evaluate.room):
            return False
        table = table_of(self.plan, self.evaluate.outcomes)
        if table.front is not None:
            case = next((item["case"] for item in table.best if item["case"] not in self.searches), None)
        else:
            case = self.most_promising(table)
        if case is None or case in self.searches:
            return False
        if table.front is None and (missing := self._missing(case)):
            if self.affords(missing):
                self.evaluate.solve_realisations(case, missing)
                return True
            tried = [number for number in table.further_realisations if table.candidates[number]]
            case = self.most_promising(table, tried) if tried else case
            if case is None or case in self.searches:
                return False
        self._search(case)
        return True

    def affords(self, points: Collection[Point] = ()) -> bool:
        """Whether further realisations of a case leave as much of the budget as a search for its worst takes."""
        kept = self._cost or round(FOR_A_SEARCH * self.plan.study.realisations.most_further)
        return self.evaluate.room - len(points) >= kept

    def explore(self) -> int | None:
        """Solve what may be the best case where others are worst and, if it still may be it, in its corners.

        Returns
        -------
        The number of the case; None where there is none, or no budget.
        """
        for _ in range(MOST_TRIED):
            case = self.most_promising(table_of(self.plan, self.evaluate.outcomes))
            if case is None or case in self._explored or not self.affords(missing := self._missing(case)):
                return case if case in self._explored else None
            if missing:
                self.evaluate.solve_realisations(case, missing)
            else:
                points, corners = self._points(case), self._corners(case)
                if not self.affords(corners):
                    return None
                points.solve(corners)
                self._keep(case, points)
        return self.most_promising(table_of(self.plan, self.evaluate.outcomes), list(self._explored))

    def realisations_worst_for_others(self, case: int) -> list[CaseOutcome]:
        """The further realisations of a case, of which those where others are worst are solved now."""
        self.evaluate.solve_realisations(case, self._missing(case))
        return [outcome for outcome in self.evaluate.outcomes.values() if outcome.deviations and outcome.within == case]

    def most_promising(self, table: StudyTable, among: Sequence[int] | None = None) -> int | None:
        """The case that is the best if its worst exceeds that of its sample as it does in searched cases; None without.

        Parameters
        ----------
        table : of the known cases.
        among : numbers of cases; all by default.
        """
        count = table.count
        tried = np.isin(np.arange(table.shape[0]), list(table.further_realisations))

        def expected(each: Floats, sign: float) -> Floats:
            """(cases,) worst values, of those that were not tried by the least ratio of the others."""
            judged = sign * np.max(sign * each, axis=1)
            sample = sign * np.max(sign * each[:, :count], axis=1)
            ratios = judged[tried] / sample[tried]
            known = ratios[np.isfinite(ratios)]
            if not known.size:
                return np.asarray(judged)
            ratio = known[np.argmin(sign * known)]
            return np.asarray(np.where(tried, judged, sample * ratio))

        limits = {name: expected(of.value, 1.0) for name, of in table.limits.items()}
        holds = [np.where(tried, True, limits[name] <= of.limit) for name, of in table.limits.items()]
        allowed = np.all([table.candidates, *holds], axis=0)
        if among is not None:
            allowed &= np.isin(np.arange(table.shape[0]), among)
        aim, cost = objectives(self.plan.scenario)[0], None
        shares = np.array([limits[name] / of.limit for name, of in table.limits.items()], dtype=float)
        if not aim.terms:
            cost = shares.max(axis=0)
        elif (values := aim.of(table.responses)) is not None:
            cost = aim.sign * expected(values, aim.sign)
        if not allowed.any() and among is None and limits:  # none is expected to meet them: that which comes nearest
            allowed, cost = table.candidates, shares.max(axis=0)
        if cost is None or not (allowed & np.isfinite(cost)).any():
            return None
        return int(np.argmin(np.where(allowed & np.isfinite(cost), cost, np.inf)))

    def _missing(self, case: int) -> list[Point]:
        """Points that are worst for other cases and not solved for this one."""
        solved = {of.deviations for of in self.evaluate.further.values() if of.within == case}
        return [point for point in self.critical if point not in solved]

    def _points(self, case: int) -> _Points:
        """Solved points of a case: its sample and its further realisations."""
        realisations, outcomes = self.plan.study.realisations, self.evaluate.outcomes
        known = {
            tuple(map(float, deviations)): outcomes[case * realisations.count + r]
            for r, deviations in enumerate(realisations.deviations)
        }
        known |= {of.deviations: outcomes[n] for n, of in self.evaluate.further.items() if of.within == case}
        return _Points(self.evaluate, case, known)

    def _corners(self, case: int) -> list[Point]:
        """The corners that are solved of a case: all of a few numbers, else those that may be the worst."""
        paths = [parameter.parameter.path for parameter in self.plan.study.realisations.parameters]
        if len(paths) <= FEW:
            return list(product((-1.0, 1.0), repeat=len(paths)))
        changes, points = self.changes_of(case, self.evaluate.rows[case]), self._points(case)
        return [corner for judge in judges_of(self.plan) for corner in _corners(points, judge, paths, changes)]

    def _search(self, case: int) -> None:
        """Search for the worst of a case, and keep where it is."""
        before, points = self.evaluate.room, self._points(case)
        self.searches[case] = False
        corners = [] if case in self._explored else self._corners(case)
        self.searches[case] = points.solve(corners) and _search_from_worst(points, judges_of(self.plan))
        self._keep(case, points)
        self._cost = max(self._cost, before - self.evaluate.room)

    def _keep(self, case: int, points: _Points) -> None:
        """Keep where a case is worst, for others."""
        sampled = set(map(tuple, self.plan.study.realisations.deviations.tolist()))
        worst = [points.worst(judge) for judge in judges_of(self.plan)]
        self.critical |= dict.fromkeys(point for point in worst if point is not None and point not in sampled)
        self._explored.add(case)


class _Points:
    """Realisations of a case, each solved once."""

    def __init__(self, evaluate: Evaluator, case: int, known: dict[Point, CaseOutcome]) -> None:
        self.evaluate, self.case, self.known = evaluate, case, known

    def solve(self, points: Iterable[Point]) -> bool:
        """Solve those of some points that are not known; whether all are: the budget may end before."""
        new = [point for point in dict.fromkeys(points) if point not in self.known]
        room = self.evaluate.room
        self.known |= zip(new, self.evaluate.solve_realisations(self.case, new[:room]), strict=False)
        return len(new) <= room

    def badness(self, judge: Judge, point: Point) -> float:
        """How bad a solved point is; what is not known is not worse than anything."""
        return float(np.nan_to_num(judge.badness(self.known[point]), nan=-np.inf))

    def worst(self, judge: Judge, apart_from: Point | None = None) -> Point | None:
        """The worst of the points that are solved, or of those that lie apart from one; None without any."""
        far = [
            point for point in self.known
            if apart_from is None or max(abs(a - b) for a, b in zip(point, apart_from, strict=True)) >= APART
        ]  # fmt: skip
        return max(far, key=lambda point: self.badness(judge, point), default=None)


def _search_from_worst(points: _Points, judges: Sequence[Judge]) -> bool:
    """Search from the worst of the known points by every judge; whether the budget sufficed."""
    ends: dict[str, Point] = {}
    for steps, apart in ((COARSE, False), (COARSE, True), (FINE, False)):
        for judge in judges:
            start = points.worst(judge, ends[judge.name] if apart else None)
            end = None if start is None else _climb(points, judge, start, steps)
            if start is not None and end is None:
                return False
            if end is not None and not apart:
                ends[judge.name] = end
    return True


def _corners(points: _Points, judge: Judge, paths: Sequence[str], changes: Changes) -> Iterator[Point]:
    """The corners where derivatives, and a linear fit of the sample, say that a case is worst by a judge."""
    for response, by in changes.items():
        if any(means(asked, response) for asked in judge.asked) and all(path in by for path in paths):
            yield tuple(1.0 if judge.sign * by[path][1] >= judge.sign * by[path][0] else -1.0 for path in paths)
    sample = np.array(list(points.known))
    bad = np.array([points.badness(judge, point) for point in points.known])
    known = np.isfinite(bad)
    if known.sum() > len(paths):
        design = np.column_stack([np.ones(int(known.sum())), sample[known]])
        slopes = np.linalg.lstsq(design, bad[known], rcond=None)[0][1:]
        yield tuple(np.where(slopes >= 0.0, 1.0, -1.0).tolist())


def _climb(points: _Points, judge: Judge, start: Point, steps: Iterable[float]) -> Point | None:
    """The end of a compass search for what is worst by a judge; None where the budget ended it.

    A step goes in one number, or in all in which one makes it worse.
    """
    at = start
    for step in steps:
        while True:
            before, all_steps = points.badness(judge, at), list(at)
            neighbours = dict[Point, int]()  # by point the number that differs
            for i, x in enumerate(at):
                ends = dict.fromkeys((max(-1.0, x - step), min(1.0, x + step)))
                neighbours |= {(*at[:i], end, *at[i + 1 :]): i for end in ends if end != x}
            if not points.solve(neighbours):
                return None
            for point in sorted(neighbours, key=lambda point: points.badness(judge, point)):
                if points.badness(judge, point) > before:
                    all_steps[neighbours[point]] = point[neighbours[point]]
            if not points.solve([tuple(all_steps)]):
                return None
            next_one = max([*neighbours, tuple(all_steps)], key=lambda point: points.badness(judge, point))
            if not points.badness(judge, next_one) > before + BETTER * abs(before):
                break
            at = next_one
    return at
