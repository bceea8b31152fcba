"""Search for the worst realisation within tolerances: corners of the box of deviations, then a compass search.

A random sample rarely comes near a corner of the box, where the worst realisation usually is. With few numbers all
corners are solved, otherwise those indicated by exact derivatives and a linear fit of the sample. From the worst known
points a compass search continues (R. Hooke and T. A. Jeeves, Journal of the ACM 8 (1961) 212-229), and once more
from the worst one that lies apart. Where the worse of both ended, it goes on with smaller steps.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import limited_response, matches_request
from beamsim.analyses.studies.table import StudyTable, table_of
from beamsim.cases import CaseOutcome, Evaluator
from beamsim.scenario.studies import Value
from beamsim.typing import Floats

SAMPLED, TRIED = "sampled", "tried where others are worst"
SEARCHED, UNFINISHED = "searched", "search not finished"
"""How the worst value of a case was found."""
OBJECTIVE = "objective"  # name of an objective that has the name of a limit
MOST_WITH_ALL_CORNERS = 4  # number of toleranced numbers up to which all corners are solved
COARSE = (2.0, 1.0, 0.5, 0.25, 0.125)  # step sizes of the compass searches, in tolerances
FINE = (0.0625, 0.03125)  # step sizes at the end of the worse of two searches: a resonance is narrow
LEAST_CHANGE = 1e-3  # relative change of a value that counts as worse
SEARCH_SHARE = 0.4  # share of the budget reserved for the search of the last case while the cost of a search is unknown
MOST_TRIED = 6  # cases tried before a local search starts from the best
START_DISTANCE = 0.75  # distance of the second start from the worst point, in tolerances

Point = tuple[float, ...]
"""Deviations of the numbers as shares of their tolerances, from -1 to 1."""
Changes = Mapping[str, Mapping[str, tuple[float, float]]]
"""By response and path its change where the number is smaller and where it is larger by its tolerance."""


class Judge(NamedTuple):
    """Limit or objective as a measure of badness: larger is worse."""

    name: str
    badness: Callable[[CaseOutcome], float]  # nan if unknown
    sign: float  # 1 if large responses are bad
    responses: tuple[str, ...]  # responses; the worst place counts


def judges_of(plan: StudyPlan) -> list[Judge]:
    """Judges of a study: every limit, and every objective made of responses."""
    found = list[Judge]()
    for name in {} if plan.scenario.limits is None else plan.scenario.limits.values_by_name:

        def limit_badness(outcome: CaseOutcome, name: str = name) -> float:
            return float(outcome.margins.get(name, {}).get("value", np.nan))

        found.append(Judge(name, limit_badness, 1.0, (limited_response(name),)))
    for aim in (aim for aim in objectives(plan.scenario) if aim.terms):

        def objective_badness(
            outcome: CaseOutcome, objective: Callable[..., Floats | None] = aim.of, sign: float = aim.sign
        ) -> float:
            numbers = {name: np.array([x]) for name, x in outcome.values.items() if isinstance(x, float | int)}
            value = objective(numbers)
            return np.nan if value is None else sign * float(value[0])

        limited = {judge.name: judge.sign for judge in found}
        if limited.get(aim.name) != aim.sign:  # otherwise the limit judges in the same way
            name = OBJECTIVE if aim.name in limited else aim.name
            found.append(Judge(name, objective_badness, aim.sign, tuple(name for name, _ in aim.terms)))
    return found


class WorstSearch:
    """Search for the worst realisations of the best cases of a study, within a budget.

    Parameters
    ----------
    plan : plan of the study.
    evaluate : evaluator that solves the realisations.
    changes_of : function from the index of a case and its parameter values to the changes of the responses within the
    tolerances, from derivatives; empty without derivatives.
    """

    def __init__(
        self, plan: StudyPlan, evaluate: Evaluator, changes_of: Callable[[int, tuple[Value, ...]], Changes]
    ) -> None:
        self.plan, self.evaluate, self.changes_of = plan, evaluate, changes_of
        self.searches: dict[int, bool] = {}  # by searched case: True if the search was completed
        self.critical: dict[Point, None] = {}  # worst points of the searched cases
        self._explored = set[int]()  # cases with solved corners
        self._cost = 0  # largest number of further cases of a search

    @property
    def judges_by_worst(self) -> bool:
        """True if cases are judged by their worst realisation, which a search can find."""
        realisations = self.plan.study.realisations
        return realisations.judged_by_worst and realisations.most_further_cases > 0

    def search_next(self) -> bool:
        """Search for the worst realisation of the most promising case; False if no search is needed.

        A case is first tried at the worst points of other cases, and searched only if it may still be the best. The
        budget of one search is reserved for the last case.
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
        """True if the budget allows further realisations of a case besides a search for its worst."""
        kept = self._cost or round(SEARCH_SHARE * self.plan.study.realisations.most_further_cases)
        return self.evaluate.room - len(points) >= kept

    def explore(self) -> int | None:
        """Solve the most promising case at the worst points of others and, if it may still be the best, at its corners.

        Returns
        -------
        Index of the case; None if there is none, or no budget.
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
        """Further realisations of a case, after solving it at the worst points of the other cases."""
        self.evaluate.solve_realisations(case, self._missing(case))
        return [outcome for outcome in self.evaluate.outcomes.values() if outcome.deviations and outcome.within == case]

    def most_promising(self, table: StudyTable, cases: Sequence[int] | None = None) -> int | None:
        """Case that is the best if its worst exceeds its sample as in the searched cases; None without cases.

        Parameters
        ----------
        table : table of the known cases.
        cases : indices of cases; all by default.
        """
        count = table.count
        tried = np.isin(np.arange(table.shape[0]), list(table.further_realisations))

        def expected(sampled: Floats, sign: float) -> Floats:
            """(cases,) expected worst values; for cases that were not tried, by the smallest ratio of the others."""
            judged = sign * np.max(sign * sampled, axis=1)
            sample = sign * np.max(sign * sampled[:, :count], axis=1)
            ratios = judged[tried] / sample[tried]
            known = ratios[np.isfinite(ratios)]
            if not known.size:
                return np.asarray(judged)
            ratio = known[np.argmin(sign * known)]
            return np.asarray(np.where(tried, judged, sample * ratio))

        limits = {name: expected(of.value, 1.0) for name, of in table.limits.items()}
        holds = [np.where(tried, True, limits[name] <= of.limit) for name, of in table.limits.items()]
        allowed = np.all([table.candidates, *holds], axis=0)
        if cases is not None:
            allowed &= np.isin(np.arange(table.shape[0]), cases)
        aim, cost = objectives(self.plan.scenario)[0], None
        shares = np.array([limits[name] / of.limit for name, of in table.limits.items()], dtype=float)
        if not aim.terms:
            cost = shares.max(axis=0)
        elif (values := aim.of(table.responses)) is not None:
            cost = aim.sign * expected(values, aim.sign)
        if not allowed.any() and cases is None and limits:  # take the closest one
            allowed, cost = table.candidates, shares.max(axis=0)
        if cost is None or not (allowed & np.isfinite(cost)).any():
            return None
        return int(np.argmin(np.where(allowed & np.isfinite(cost), cost, np.inf)))

    def _missing(self, case: int) -> list[Point]:
        """Worst points of other cases that are not solved for this one."""
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
        """Corners to solve for a case: all for few numbers, else those that may be the worst."""
        paths = [parameter.parameter.path for parameter in self.plan.study.realisations.parameters]
        if len(paths) <= MOST_WITH_ALL_CORNERS:
            return list(product((-1.0, 1.0), repeat=len(paths)))
        changes, points = self.changes_of(case, self.evaluate.rows[case]), self._points(case)
        return [corner for judge in judges_of(self.plan) for corner in _corners(points, judge, paths, changes)]

    def _search(self, case: int) -> None:
        """Search for the worst realisation of a case, and store its point."""
        before, points = self.evaluate.room, self._points(case)
        self.searches[case] = False
        corners = [] if case in self._explored else self._corners(case)
        self.searches[case] = points.solve(corners) and _search_from_worst(points, judges_of(self.plan))
        self._keep(case, points)
        self._cost = max(self._cost, before - self.evaluate.room)

    def _keep(self, case: int, points: _Points) -> None:
        """Store the worst point of a case, for use in other cases."""
        sampled = set(map(tuple, self.plan.study.realisations.deviations.tolist()))
        worst = [points.worst(judge) for judge in judges_of(self.plan)]
        self.critical |= dict.fromkeys(point for point in worst if point is not None and point not in sampled)
        self._explored.add(case)


class _Points:
    """Realisations of a case, each solved once."""

    def __init__(self, evaluate: Evaluator, case: int, outcomes: dict[Point, CaseOutcome]) -> None:
        self.evaluate, self.case, self.outcomes = evaluate, case, outcomes

    def solve(self, points: Iterable[Point]) -> bool:
        """Solve the points that are not known; False if the budget ends before."""
        new = [point for point in dict.fromkeys(points) if point not in self.outcomes]
        room = self.evaluate.room
        self.outcomes |= zip(new, self.evaluate.solve_realisations(self.case, new[:room]), strict=False)
        return len(new) <= room

    def badness(self, judge: Judge, point: Point) -> float:
        """Badness of a solved point; unknown values are never the worst."""
        return float(np.nan_to_num(judge.badness(self.outcomes[point]), nan=-np.inf))

    def worst(self, judge: Judge, away_from: Point | None = None) -> Point | None:
        """Worst solved point, or worst of those far enough from ``away_from``; None without points."""
        far = [
            point for point in self.outcomes
            if away_from is None or max(abs(a - b) for a, b in zip(point, away_from, strict=True)) >= START_DISTANCE
        ]  # fmt: skip
        return max(far, key=lambda point: self.badness(judge, point), default=None)


def _search_from_worst(points: _Points, judges: Sequence[Judge]) -> bool:
    """Search from the worst known points by every judge; False if the budget did not suffice."""
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
    """Corners where derivatives, and a linear fit of the sample, predict the worst value of a judge."""
    for response, by in changes.items():
        if any(matches_request(asked, response) for asked in judge.responses) and all(path in by for path in paths):
            yield tuple(1.0 if judge.sign * by[path][1] >= judge.sign * by[path][0] else -1.0 for path in paths)
    sample = np.array(list(points.outcomes))
    bad = np.array([points.badness(judge, point) for point in points.outcomes])
    known = np.isfinite(bad)
    if known.sum() > len(paths):
        design = np.column_stack([np.ones(int(known.sum())), sample[known]])
        slopes = np.linalg.lstsq(design, bad[known], rcond=None)[0][1:]
        yield tuple(np.where(slopes >= 0.0, 1.0, -1.0).tolist())


def _climb(points: _Points, judge: Judge, start: Point, steps: Iterable[float]) -> Point | None:
    """End of a compass search for the worst value of a judge; None if the budget ended it.

    A step changes one number, or all numbers that individually make it worse.
    """
    at = start
    for step in steps:
        while True:
            before, all_steps = points.badness(judge, at), list(at)
            neighbours = dict[Point, int]()  # by point the index of the changed number
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
            if not points.badness(judge, next_one) > before + LEAST_CHANGE * abs(before):
                break
            at = next_one
    return at
