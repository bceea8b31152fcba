"""Search for the Pareto front of two objectives: its ends, the designs between them (`proposals`), and its gaps."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.designs import (
    FIRST_RADIUS,
    LIMIT_MARGIN,
    PENALTY,
    RESOLUTION,
    START_DISTANCE,
    Designs,
    SolvedPoints,
    local_search,
    unfinished_search,
)
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.proposals import propose_designs, ranges_of
from beamsim.analyses.studies.table import WIDE_GAP, efficient, shares_between
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats, Ints

SAMPLE_SHARE = 0.25  # of the allowed cases: ends of ranges with every choice, and a Latin hypercube
END_SHARE = 0.125  # of the allowed cases, for each end at first
# of the allowed cases, after which ends are located and gaps searched; later cases use the model again
PROPOSAL_SHARE = 0.7
LOCATION_SHARE = 0.07  # of the allowed cases, to locate an end
STARTS = 3  # of the search for an end, from the best designs that differ enough
BATCH = 8  # designs that the model proposes at once
CASES_PER_NUMBER = 8  # cases for each number with a range, and as many more
EQUAL_OBJECTIVES = 1e-9  # of the range of an objective: closer designs count as equal
# of the ranges of the objectives: improvement of a converged front in the last quarter of the designs
CONVERGED_SHARE = 0.01
LAST_QUARTER = 0.25


def front(designs: Designs, settings: Optimise) -> Outcome:
    """Search for the designs that no other design improves in both objectives.

    Parameters
    ----------
    designs : solver of designs.
    settings : settings of the search.

    Returns
    -------
    Outcome
        Complete, or the parts that were skipped.
    """
    most = settings.most_cases
    search = _FrontSearch(designs, most, np.random.default_rng(settings.seed))
    search.sample()
    for goal in (0, 1):
        search.approach(goal, round(END_SHARE * most))
    search.propose(round(PROPOSAL_SHARE * most))
    for goal in (0, 1):
        search.locate(goal, round(LOCATION_SHARE * most))
        search.choose_among_equals(goal, round(LOCATION_SHARE * most))
    search.search_gaps()
    search.propose(most)
    left_out = search.front_doubts()
    return COMPLETE if not left_out or designs.exhausted else unfinished_search(designs.design_count, left_out)


class _Gap(NamedTuple):
    """Gap in a front, with a local search for a design in its middle."""

    share: float  # of the length of the front, with the range of each objective as one
    goal: int  # objective to minimise
    ceiling: float  # upper bound of the other objective


class _Front(NamedTuple):
    """Front of some designs."""

    numbers: Ints  # (n,) indices of its designs, sorted by the first objective
    values: Floats  # (n, 2) their objectives
    ranges: Floats  # (2,) ranges of the objectives on the front


def _front_of(solved: SolvedPoints) -> _Front:
    """Designs that meet every limit and that no other one improves in both objectives."""
    numbers = np.flatnonzero(efficient(solved.values.T, solved.excess == 0.0))
    numbers = numbers[np.argsort(solved.values[numbers, 0])]
    return _Front(numbers, solved.values[numbers], ranges_of(solved, numbers))


@dataclass
class _FrontSearch:
    """Search for the ends of a front, for designs between them, and in its gaps."""

    designs: Designs
    most_cases: int  # largest number of cases
    generator: np.random.Generator
    searched_gaps: list[tuple[int, float, float]] = field(default_factory=list)  # gaps: objective, ends of the other
    _last: tuple[int, _Front] | None = None  # number of designs, and their front

    @property
    def remaining_cases(self) -> int:
        """Number of remaining cases."""
        return self.most_cases - self.designs.design_count

    @property
    def least_cases(self) -> int:
        """Fewest cases of a useful local search: two for each number with a range, and a constant."""
        return 2 * int(self.designs.free.sum()) + 3

    @property
    def front(self) -> _Front:
        """Front of all designs."""
        known = self.designs.all_designs
        if self._last is None or self._last[0] != len(known.points):
            self._last = len(known.points), _front_of(known)
        return self._last[1]

    def sample(self) -> None:
        """Solve the ends of ranges with every choice (as many as the budget allows) and a Latin hypercube.

        Separate parts of a front are rarely found later.
        """
        from scipy.stats.qmc import LatinHypercube

        generator, parameters = self.generator, self.designs.plan.study.parameters
        levels = [
            (np.arange(len(p.values)) + 0.5) / len(p.values) if p.values else np.array([0.0, 1.0]) for p in parameters
        ]
        most = max(round(SAMPLE_SHARE * self.most_cases), 12)
        if np.prod([float(each.size) for each in levels]) <= most // 2:
            ends = np.array(list(product(*levels)))
        else:
            ends = np.column_stack([generator.choice(each, most // 2) for each in levels])
        within = LatinHypercube(len(parameters), rng=generator).random(most - len(ends))
        self.designs(np.vstack([ends, within]))

    def approach(self, goal: int, most_cases: int) -> None:
        """Minimise an objective, starting from the best designs that differ enough."""
        last, taken = self.designs.design_count + most_cases, list[Floats]()
        for _ in range(STARTS):
            start, left = (
                self.designs.best_away_from(taken, goal),
                min(last - self.designs.design_count, self.remaining_cases),
            )
            if start is None or left < self.least_cases:
                break
            taken += [start, self._descend(start, goal, left)[0]]

    def propose(self, last: int) -> None:
        """Solve batches of proposals from a model of the known designs, up to a number of designs."""
        parameters = self.designs.plan.study.parameters
        while (room := min(last, self.most_cases) - self.designs.design_count) > 0:
            found = propose_designs(
                parameters, self.designs.all_designs, self.front.numbers, min(BATCH, room), self.generator
            )
            if not len(found):
                return
            self.designs(found)

    def locate(self, goal: int, most_cases: int) -> None:
        """Continue from the best design of an objective with the simplex method, which can follow a kink.

        Peaks have kinks where another peak becomes the largest; smooth models stop there.
        """
        from scipy.optimize import Bounds, minimize

        start, free = self.designs.best_away_from([], goal), self.designs.free
        most_cases = min(most_cases, self.remaining_cases) - int(free.sum())  # the method may use as many more
        if start is None or not free.any() or most_cases < self.least_cases:
            return

        def merit(numbers: Floats) -> float:
            values, excess = self.designs(self.designs.with_numbers(start, numbers)[None])
            return float(values[goal, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, FIRST_RADIUS, -FIRST_RADIUS))])
        minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": most_cases},
        )  # fmt: skip

    def choose_among_equals(self, goal: int, most_cases: int) -> None:
        """If several designs are equally good in an objective (as without contact), minimise the other one."""
        known, front = self.designs.all_designs, self.front
        meeting = np.flatnonzero((known.excess == 0.0) & np.isfinite(known.values).all(axis=1))
        if not meeting.size:
            return
        ceiling = float(known.values[meeting, goal].min()) + EQUAL_OBJECTIVES * float(front.ranges[goal])
        equals = meeting[known.values[meeting, goal] <= ceiling]
        if equals.size > 1:
            start = known.points[equals[np.argmin(known.values[equals, 1 - goal])]]
            self._descend(start, 1 - goal, min(most_cases, self.remaining_cases), ceiling=ceiling)

    def search_gaps(self) -> None:
        """Search for a design in the middle of each wide gap of the front, from both sides."""
        while self.remaining_cases >= self.least_cases and (gap := self._widest()):
            values, other = self.front.values, 1 - gap.goal
            low = np.flatnonzero(values[:, other] <= gap.ceiling)
            nearest = low[np.argmin(values[low, gap.goal])]
            above = values[values[:, other] > gap.ceiling, other].min()
            self.searched_gaps.append((gap.goal, float(values[nearest, other]), float(above)))
            room = min(self.remaining_cases, CASES_PER_NUMBER * (1 + int(self.designs.free.sum())))
            start = self.designs.all_designs.points[self.front.numbers[nearest]]
            self._descend(start, gap.goal, room, ceiling=gap.ceiling, radius=FIRST_RADIUS)

    def front_doubts(self) -> list[str]:
        """Reasons why a front may not be converged, as clauses: late improvements and unsearched gaps."""
        known = self.designs.all_designs
        before = _front_of(SolvedPoints(*(each[: int((1.0 - LAST_QUARTER) * len(each))] for each in known)))
        if not len(before.values):
            return ["the first designs that meet every limit were found late"]
        after, clauses = self.front, list[str]()
        ends = (before.values.min(axis=0) - after.values.min(axis=0)) / after.ranges
        for aim, growth in zip(objectives(self.designs.plan.scenario), ends.tolist(), strict=True):
            if growth > CONVERGED_SHARE:
                clauses.append(f"the {aim.text} was still found to be better, by {100 * growth:.2g} % of the front")
        behind = (before.values[:, None, :] - after.values[None, :, :]) / after.ranges
        if (most := float(behind.min(axis=2).max())) > CONVERGED_SHARE:
            clauses.append(f"designs of the front were still improved, by up to {100 * most:.2g} % of it")
        if (gap := self._widest()) is not None:
            clauses.append(f"gaps of up to {100 * gap.share:.0f} % of the front were not searched")
        return clauses

    def _widest(self) -> _Gap | None:
        """Widest gap that was not yet searched from both sides."""
        values = self.front.values
        parts = shares_between(values.T)
        for k in np.argsort(-parts, kind="stable"):
            for goal in (1, 0) if parts[k] > WIDE_GAP else ():
                ceiling = float(values[k : k + 2, 1 - goal].mean())
                if not any(of == goal and low <= ceiling <= high for of, low, high in self.searched_gaps):
                    return _Gap(float(parts[k]), goal, ceiling)
        return None

    def _descend(
        self, start: Floats, goal: int, most_cases: int, *, ceiling: float = np.inf, radius: float = START_DISTANCE
    ) -> tuple[Floats, bool]:
        """Minimise an objective among designs with the same choices and whole numbers as a given design.

        Parameters
        ----------
        start : (parameters,) initial design.
        goal : index of the objective.
        most_cases : largest number of cases.
        ceiling : upper bound of the other objective.
        radius : size of the first steps on the unit cube.

        Returns
        -------
        (parameters,) array
            Final design.
        bool
            True if the search converged.
        """
        free, ranges, other = self.designs.free, self.front.ranges, 1 - goal
        if not free.any() or most_cases < self.least_cases:
            return start, not free.any()

        solved, last = list[Floats](), self.designs.design_count + most_cases

        def known_values(numbers: Floats) -> tuple[Floats, Floats]:
            if solved and self.designs.design_count >= last:  # further requests of the method count as bad designs
                values, excess = self.designs.objectives_and_excesses(solved[0][None])
                return np.full_like(values[:, 0], np.inf), np.full_like(excess[:, 0], np.inf)
            solved.append(self.designs.with_numbers(start, np.clip(numbers, 0.0, 1.0)))
            values, excess = self.designs.objectives_and_excesses(solved[-1][None])
            return values[:, 0], excess[:, 0]

        base = known_values(start[free])[0]

        def merit(numbers: Floats) -> float:
            return float(min((known_values(numbers)[0][goal] - base[goal]) / ranges[goal], PENALTY))

        def excesses(numbers: Floats) -> Floats:
            values, excess = known_values(numbers)
            above = [(values[other] - ceiling) / ranges[other]] if np.isfinite(ceiling) else []
            return np.asarray(np.minimum(np.append(excess + LIMIT_MARGIN, above), PENALTY))

        numbers, settled = local_search(merit, excesses, start[free], most_cases, (radius, RESOLUTION))
        end = self.designs.with_numbers(start, numbers)  # a solved design, up to round-off
        return min(solved, key=lambda point: float(np.abs(point - end).max())), settled
