"""The worst that tolerances allow of a case: corners of the box of deviations, then a search from the worst points.

A sample seldom comes near a corner of the box, where the worst most often is. The corners that are solved are all of a
few numbers, else those that exact derivatives and a linear fit of the sample point to. From the worst of all points
that are known a compass search goes on (R. Hooke and T. A. Jeeves, Journal of the ACM 8 (1961) 212-229), and once more
from the worst one that lies apart. Where the worse of both ended, it goes on with smaller steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import limited_response, means
from beamsim.analyses.studies.table import table_of
from beamsim.cases import CaseOutcome, Evaluator
from beamsim.scenario.studies import Value
from beamsim.typing import Floats

SAMPLED, SEARCHED, UNFINISHED = "sampled", "searched", "search not finished"
"""What the worst of a case is."""
OBJECTIVE = "objective"  # what an objective is called where a limit has its name
FEW = 4  # numbers, all of whose corners are solved
COARSE = (2.0, 1.0, 0.5, 0.25, 0.125)  # steps of the compass searches, in tolerances
FINE = (0.0625, 0.03125)  # where the worse of two searches ended: a resonance is narrow
BETTER = 1e-3  # of a value, by which a step makes it worse
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
    """What judges the cases of a study: every limit and every objective that is made of responses."""
    found = list[Judge]()
    for name in {} if plan.scenario.limits is None else plan.scenario.limits.given:

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
        self.finished: dict[int, bool] = {}  # by case that was searched: whether its search came to its end

    def go_on(self) -> bool:
        """Search for the worst of the best case, if it was not yet searched; whether there was one to be searched."""
        realisations = self.plan.study.realisations
        if not (self.evaluate.room and realisations.judged_by_worst):
            return False
        table = table_of(self.plan, self.evaluate.outcomes)
        best = [item["case"] for item in (table.best if table.front is not None else table.best[:1])]
        case = next((case for case in best if case not in self.finished), None)
        if case is None:
            return False
        sample = {
            tuple(map(float, deviations)): self.evaluate.outcomes[case * realisations.count + r]
            for r, deviations in enumerate(realisations.deviations)
        }
        self.finished[case] = False
        points = _Points(self.evaluate, case, sample)
        paths = [parameter.number.path for parameter in realisations.parameters]
        changes = self.changes_of(case, self.evaluate.rows[case]) if len(paths) > FEW else {}
        self.finished[case] = _searched(points, judges_of(self.plan), paths, changes)
        return True


class _Points:
    """Realisations of a case, each solved once."""

    def __init__(self, evaluate: Evaluator, case: int, known: dict[Point, CaseOutcome]) -> None:
        self.evaluate, self.case, self.known = evaluate, case, known

    def solve(self, points: Iterable[Point]) -> bool:
        """Solve those of some points that are not known; whether all are: the budget may end before."""
        new = [point for point in dict.fromkeys(points) if point not in self.known]
        room = self.evaluate.room
        self.known |= zip(new, self.evaluate.within(self.case, new[:room]), strict=False)
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


def _searched(points: _Points, judges: Sequence[Judge], paths: Sequence[str], changes: Changes) -> bool:
    """Search for the worst by every judge; whether the budget sufficed."""
    count = len(paths)
    if count <= FEW:
        corners = list(product((-1.0, 1.0), repeat=count))
    else:
        corners = [corner for judge in judges for corner in _corners(points, judge, paths, changes)]
    if not points.solve(corners):
        return False
    ends: dict[str, Point] = {}
    for steps, apart in ((COARSE, False), (COARSE, True), (FINE, False)):
        for judge in judges:
            start = points.worst(judge, ends[judge.name] if apart else None)
            end = None if start is None else _climbed(points, judge, start, steps)
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


def _climbed(points: _Points, judge: Judge, start: Point, steps: Iterable[float]) -> Point | None:
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
