"""Search for the front of two objectives: its ends, what lies between them (`proposals`), and its gaps."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np

from beamsim.analyses.studies.designs import (
    APART,
    NEAR,
    ON_A_LIMIT,
    RESOLUTION,
    WORSE,
    Designs,
    SolvedPoints,
    local_search,
    unfinished_search,
)
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.proposals import propose_designs, ranges_of
from beamsim.analyses.studies.table import WIDE, efficient, shares_between
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats, Ints

SAMPLED = 0.25  # of the cases that are allowed: ends of ranges with every choice, and a Latin hypercube
FOR_AN_END = 0.125  # of them, for each end at first
PROPOSED = 0.7  # of them, after which ends are located and gaps are searched; the rest is proposed by the model, too
LOCATING = 0.07  # of them, to locate an end
STARTS = 3  # of the search for an end, from the best designs that lie apart
BATCH = 8  # designs that the model proposes at a time
FOR_A_PART = 8  # cases for each number in a range, and as many more
AS_GOOD = 1e-9  # of the range of an objective: designs that are closer are as good
SETTLED = 0.01  # of the ranges of the objectives, by which the last quarter of the designs may improve a front
LAST_QUARTER = 0.25


def front(designs: Designs, settings: Optimise) -> Outcome:
    """Search for the designs of which none is better in both objectives.

    Parameters
    ----------
    designs : solves them.
    settings : of the search.

    Returns
    -------
    Outcome
        Complete, or what was left out.
    """
    most = settings.most_cases
    search = _FrontSearch(designs, most, np.random.default_rng(settings.seed))
    search.sample()
    for goal in (0, 1):
        search.approach(goal, round(FOR_AN_END * most))
    search.propose(round(PROPOSED * most))
    for goal in (0, 1):
        search.locate(goal, round(LOCATING * most))
        search.choose_among_equals(goal, round(LOCATING * most))
    search.search_gaps()
    search.propose(most)
    left_out = search.front_doubts()
    return COMPLETE if not left_out or designs.exhausted else unfinished_search(designs.design_count, left_out)


class _Gap(NamedTuple):
    """A gap in a front, and a local search for a design in its middle."""

    share: float  # of the length of the front, the range of each objective being one
    goal: int  # objective that is to be small there
    ceiling: float  # of the other one


class _Front(NamedTuple):
    """The front of some designs."""

    numbers: Ints  # (n,) of its designs, by the first objective
    values: Floats  # (n, 2) of them
    ranges: Floats  # (2,) of the objectives on it


def _front_of(known: SolvedPoints) -> _Front:
    """The designs that meet every limit of which none is better in both objectives."""
    numbers = np.flatnonzero(efficient(known.values.T, known.excess == 0.0))
    numbers = numbers[np.argsort(known.values[numbers, 0])]
    return _Front(numbers, known.values[numbers], ranges_of(known, numbers))


@dataclass
class _FrontSearch:
    """Searches for the ends of a front, between them, and in its gaps."""

    designs: Designs
    most: int  # cases
    generator: np.random.Generator
    searched: list[tuple[int, float, float]] = field(default_factory=list)  # gaps: objective, ends of the other one
    _last: tuple[int, _Front] | None = None  # number of designs, and their front

    @property
    def room(self) -> int:
        """Number of cases that are left."""
        return self.most - self.designs.design_count

    @property
    def least_cases(self) -> int:
        """Cases without which a local search has no direction: two for each number in a range, and some."""
        return 2 * int(self.designs.free.sum()) + 3

    @property
    def front(self) -> _Front:
        """The front of all designs."""
        known = self.designs.all_designs
        if self._last is None or self._last[0] != len(known.points):
            self._last = len(known.points), _front_of(known)
        return self._last[1]

    def sample(self) -> None:
        """Solve the ends of ranges with every choice, as many of them as there is room for, and a Latin hypercube.

        A part of a front that lies apart is seldom found later.
        """
        from scipy.stats.qmc import LatinHypercube

        generator, varied = self.generator, self.designs.plan.study.varied
        levels = [
            (np.arange(len(p.values)) + 0.5) / len(p.values) if p.values else np.array([0.0, 1.0]) for p in varied
        ]
        most = max(round(SAMPLED * self.most), 12)
        if np.prod([float(each.size) for each in levels]) <= most // 2:
            ends = np.array(list(product(*levels)))
        else:
            ends = np.column_stack([generator.choice(each, most // 2) for each in levels])
        within = LatinHypercube(len(varied), rng=generator).random(most - len(ends))
        self.designs(np.vstack([ends, within]))

    def approach(self, goal: int, room: int) -> None:
        """Search for the least value of an objective from the best designs that lie apart."""
        last, taken = self.designs.design_count + room, list[Floats]()
        for _ in range(STARTS):
            start, left = self.designs.best_apart(taken, goal), min(last - self.designs.design_count, self.room)
            if start is None or left < self.least_cases:
                break
            taken += [start, self._descend(start, goal, left)[0]]

    def propose(self, last: int) -> None:
        """Try what a model of the known designs proposes, a batch at a time, up to a number of designs."""
        varied = self.designs.plan.study.varied
        while (room := min(last, self.most) - self.designs.design_count) > 0:
            found = propose_designs(
                varied, self.designs.all_designs, self.front.numbers, min(BATCH, room), self.generator
            )
            if not len(found):
                return
            self.designs(found)

    def locate(self, goal: int, room: int) -> None:
        """Go on from the best design in an objective with the simplex method, which also follows a kink.

        Peaks have kinks where another one becomes the largest, and models of smooth functions stop there.
        """
        from scipy.optimize import Bounds, minimize

        start, free = self.designs.best_apart([], goal), self.designs.free
        room = min(room, self.room) - int(free.sum())  # the method may take as many more
        if start is None or not free.any() or room < self.least_cases:
            return

        def merit(numbers: Floats) -> float:
            values, excess = self.designs(self.designs.placed(start, numbers)[None])
            return float(values[goal, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, NEAR, -NEAR))])
        minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": room},
        )  # fmt: skip

    def choose_among_equals(self, goal: int, room: int) -> None:
        """Where several designs are the best in an objective, as without contact, search for the best in the other."""
        known, front = self.designs.all_designs, self.front
        meeting = np.flatnonzero((known.excess == 0.0) & np.isfinite(known.values).all(axis=1))
        if not meeting.size:
            return
        ceiling = float(known.values[meeting, goal].min()) + AS_GOOD * float(front.ranges[goal])
        equals = meeting[known.values[meeting, goal] <= ceiling]
        if equals.size > 1:
            start = known.points[equals[np.argmin(known.values[equals, 1 - goal])]]
            self._descend(start, 1 - goal, min(room, self.room), ceiling=ceiling)

    def search_gaps(self) -> None:
        """Search in the wide gaps of the front for a design in the middle, from both sides."""
        while self.room >= self.least_cases and (gap := self._widest()):
            values, other = self.front.values, 1 - gap.goal
            low = np.flatnonzero(values[:, other] <= gap.ceiling)
            nearest = low[np.argmin(values[low, gap.goal])]
            above = values[values[:, other] > gap.ceiling, other].min()
            self.searched.append((gap.goal, float(values[nearest, other]), float(above)))
            room = min(self.room, FOR_A_PART * (1 + int(self.designs.free.sum())))
            start = self.designs.all_designs.points[self.front.numbers[nearest]]
            self._descend(start, gap.goal, room, ceiling=gap.ceiling, radius=NEAR)

    def front_doubts(self) -> list[str]:
        """Why a front is in doubt, each as a clause: what the last quarter of the designs improved, and gaps."""
        known = self.designs.all_designs
        before = _front_of(SolvedPoints(*(each[: int((1.0 - LAST_QUARTER) * len(each))] for each in known)))
        if not len(before.values):
            return ["the first designs that meet every limit were found late"]
        after, clauses = self.front, list[str]()
        ends = (before.values.min(axis=0) - after.values.min(axis=0)) / after.ranges
        for aim, growth in zip(objectives(self.designs.plan.scenario), ends.tolist(), strict=True):
            if growth > SETTLED:
                clauses.append(f"the {aim.text} was still found to be better, by {100 * growth:.2g} % of the front")
        behind = (before.values[:, None, :] - after.values[None, :, :]) / after.ranges
        if (most := float(behind.min(axis=2).max())) > SETTLED:
            clauses.append(f"designs of the front were still improved, by up to {100 * most:.2g} % of it")
        if (gap := self._widest()) is not None:
            clauses.append(f"gaps of up to {100 * gap.share:.0f} % of the front were not searched")
        return clauses

    def _widest(self) -> _Gap | None:
        """The widest gap that was not searched from both sides."""
        values = self.front.values
        parts = shares_between(values.T)
        for k in np.argsort(-parts, kind="stable"):
            for goal in (1, 0) if parts[k] > WIDE else ():
                ceiling = float(values[k : k + 2, 1 - goal].mean())
                if not any(of == goal and low <= ceiling <= high for of, low, high in self.searched):
                    return _Gap(float(parts[k]), goal, ceiling)
        return None

    def _descend(
        self, start: Floats, goal: int, room: int, *, ceiling: float = np.inf, radius: float = APART
    ) -> tuple[Floats, bool]:
        """Search for the least value of an objective among designs with the words and whole numbers of one of them.

        Parameters
        ----------
        start : (parameters,) design.
        goal : number of the objective.
        room : number of cases.
        ceiling : of the other objective.
        radius : of the first steps, on the unit cube.

        Returns
        -------
        (parameters,) array
            Where it ended.
        bool
            Whether it settled there.
        """
        free, ranges, other = self.designs.free, self.front.ranges, 1 - goal
        if not free.any() or room < self.least_cases:
            return start, not free.any()

        solved, last = list[Floats](), self.designs.design_count + room

        def known(numbers: Floats) -> tuple[Floats, Floats]:
            if solved and self.designs.design_count >= last:  # the method may ask for some more: they count as bad ones
                values, excess = self.designs.objectives_and_excesses(solved[0][None])
                return np.full_like(values[:, 0], np.inf), np.full_like(excess[:, 0], np.inf)
            solved.append(self.designs.placed(start, np.clip(numbers, 0.0, 1.0)))
            values, excess = self.designs.objectives_and_excesses(solved[-1][None])
            return values[:, 0], excess[:, 0]

        base = known(start[free])[0]

        def merit(numbers: Floats) -> float:
            return float(min((known(numbers)[0][goal] - base[goal]) / ranges[goal], WORSE))

        def beyond(numbers: Floats) -> Floats:
            values, excess = known(numbers)
            above = [(values[other] - ceiling) / ranges[other]] if np.isfinite(ceiling) else []
            return np.asarray(np.minimum(np.append(excess + ON_A_LIMIT, above), WORSE))

        numbers, settled = local_search(merit, beyond, start[free], room, (radius, RESOLUTION))
        end = self.designs.placed(start, numbers)  # a design that was solved, but for round-off
        return min(solved, key=lambda point: float(np.abs(point - end).max())), settled
