"""Search for the front of two objectives: its ends, what lies between them, and its gaps.

Sources: the genetic algorithm, K. Deb et al., IEEE Transactions on Evolutionary Computation 6 (2002) 182-197; the local
search, T. M. Ragonneau, Model-based derivative-free optimization methods and software, PhD thesis, The Hong Kong
Polytechnic University, 2022.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.studies.designs import APART, BETTER, RESOLUTION, Designs, unsettled
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.table import efficient
from beamsim.errors import ScenarioError
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats

SAMPLED = 0.25  # of the cases that are allowed: ends of ranges with every choice, and a Latin hypercube
FOR_AN_END = 0.125  # of them, for each end at first
LAST = 0.4  # of them, for local searches after the genetic algorithm
STARTS = 3  # of the search for an end, from the best designs that lie apart
WIDE = 0.08  # of the length of a front: a wider gap between neighbours is searched
FINE = 0.02  # of it: a wider part between designs at which searches settled is searched after that
NEAR = 0.03  # of a range, first steps of searches from designs of the front
FOR_A_PART = 8  # cases for each number in a range, and as many more
ON_A_LIMIT = 1e-6  # by which a design stays away from a limit: less is round-off
AS_GOOD = 1e-9  # of the range of an objective: designs that are closer are as good
WORSE = 10.0  # ranges of the objectives, as which what is not known counts
SETTLED = 0.01  # relative growth of the area below a front by the last quarter of the designs
LAST_QUARTER = 0.25


def front(designs: Designs, settings: Optimise, limited: bool) -> Outcome:
    """Search for the designs of which none is better in both objectives.

    Parameters
    ----------
    designs : solves them.
    settings : of the search.
    limited : whether there are limits.

    Returns
    -------
    Outcome
        Complete, or what was left out.

    Raises
    ------
    ScenarioError
        If pymoo is not installed.
    """
    try:
        nsga2 = import_module("pymoo.algorithms.moo.nsga2").NSGA2
    except ImportError:
        raise ScenarioError.at(
            "optimise", "asks for two objectives, which takes pymoo, and that is not installed",
            "pip install 'beamsim[optimise]', or add the objectives up: minimise: {peak_force: 40 N, ...}",
        ) from None  # fmt: skip
    search = _Front(designs, settings.most_cases)
    search.sample(settings.seed)
    for goal in (0, 1):
        search.approach(goal, round(FOR_AN_END * settings.most_cases))
    _evolve(designs, settings, nsga2, limited)
    reserve = search.room // 4
    for goal in (0, 1):
        search.locate(goal, reserve)
        search.choose_among_equals(goal, reserve)
    search.refine()
    left_out = [*([] if search.settled else [BETTER]), *search.left_out()]
    return COMPLETE if not left_out or designs.exhausted else unsettled(designs.tried, left_out)


class _Part(NamedTuple):
    """A part of a front, and a local search for a design in its middle."""

    share: float  # of the length of the front, the range of each objective being one
    key: tuple[float, ...]
    goal: int  # objective that is to be small there
    ceiling: float  # of the other one


@dataclass
class _Front:
    """Local searches for the ends of a front and in its gaps."""

    designs: Designs
    most: int  # cases
    located: dict[int, float] = field(default_factory=dict)  # by objective the least value, once a search settled there
    exact: list[Floats] = field(default_factory=list)  # objectives (2,) of designs at which a search settled
    searched: set[tuple[float, ...]] = field(default_factory=set)  # parts of the front

    @property
    def room(self) -> int:
        """Number of cases that are left."""
        return self.most - self.designs.tried

    @property
    def fewest(self) -> int:
        """Cases without which a local search has no direction: two for each number in a range, and some."""
        return 2 * int(self.designs.free.sum()) + 3

    def sample(self, seed: int) -> None:
        """Solve the ends of ranges with every choice, as many of them as there is room for, and a Latin hypercube.

        A part of a front that lies apart is seldom found later.
        """
        from scipy.stats.qmc import LatinHypercube

        generator, varied = np.random.default_rng(seed), self.designs.plan.study.varied
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
        last, taken = self.designs.tried + room, list[Floats]()
        for _ in range(STARTS):
            start, left = self.designs.best_apart(taken, goal), min(last - self.designs.tried, self.room)
            if start is None or left < self.fewest:
                break
            taken += [start, self._descend(start, goal, left)[0]]

    def locate(self, goal: int, room: int) -> None:
        """Go on from the best design in an objective with the simplex method, which also follows a kink.

        Peaks have kinks where another one becomes the largest, and models of smooth functions stop there.
        """
        from scipy.optimize import Bounds, minimize

        start, free = self.designs.best_apart([], goal), self.designs.free
        room = min(room, self.room) - int(free.sum())  # the method may take as many more
        if start is None or not free.any() or room < self.fewest:
            self.located |= {} if start is None or free.any() else {goal: self._least(goal)}
            return

        def merit(numbers: Floats) -> float:
            values, excess = self.designs(self.designs.placed(start, numbers)[None])
            return float(values[goal, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, NEAR, -NEAR))])
        found: Any = minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": room},
        )  # fmt: skip
        if found.success:
            self.located[goal] = self._least(goal)

    def choose_among_equals(self, goal: int, room: int) -> None:
        """Where several designs are the best in an objective, as without contact, search for the best in the other."""
        points, values = self._meeting()
        ceiling = self._least(goal) + AS_GOOD * self._ranges()[goal]
        equals = np.flatnonzero(values[:, goal] <= ceiling)
        if equals.size > 1:
            start = points[equals[np.argmin(values[equals, 1 - goal])]]
            self._descend(start, 1 - goal, min(room, self.room), ceiling=ceiling)

    def refine(self) -> None:
        """Search in the wide gaps of the front, then between the designs at which searches settled, from both sides."""
        while self.room >= self.fewest and (part := self._widest(WIDE, gaps=True) or self._widest(FINE, gaps=False)):
            self.searched.add(part.key)
            points, values = self._meeting()
            low = np.flatnonzero(values[:, 1 - part.goal] <= part.ceiling)
            start = points[low[np.argmin(values[low, part.goal])]]
            room = min(self.room, FOR_A_PART * (1 + int(self.designs.free.sum())))
            found, settled = self._descend(start, part.goal, room, ceiling=part.ceiling, radius=NEAR)
            if settled:
                self.exact.append(self.designs.signed(found[None])[0][:, 0])

    @property
    def settled(self) -> bool:
        """Whether the area below the front hardly grew with the last quarter of the designs."""
        area, values = import_module("pymoo.indicators.hv").HV(ref_point=np.ones(2)), self._meeting()[1]
        front = self._front()[1]
        if len(front) < 2:
            return False
        scaled = (values - front.min(axis=0)) / self._ranges()
        last = float(area(scaled))
        return last - float(area(scaled[: int((1.0 - LAST_QUARTER) * len(values))])) <= SETTLED * last

    def left_out(self) -> list[str]:
        """What there was no room for, each as a clause."""
        aims, gap = objectives(self.designs.plan.scenario), self._widest(WIDE, gaps=True)
        clauses = [
            f"the {aim.text} was not located"
            for goal, aim in enumerate(aims)
            if goal not in self.located or self._least(goal) < self.located[goal] - 1e-3 * self._ranges()[goal]
        ]
        return clauses + (
            [] if gap is None else [f"gaps of up to {100 * gap.share:.0f} % of the front were not searched"]
        )

    def _meeting(self) -> tuple[Floats, Floats]:
        """Points (n, parameters) and objectives (n, 2) of all designs that meet every limit."""
        points, values, excess = self.designs.every()
        kept = (excess == 0.0) & np.isfinite(values).all(axis=1)
        return points[kept], values[kept]

    def _least(self, goal: int) -> float:
        return float(self._meeting()[1][:, goal].min(initial=np.inf))

    def _front(self) -> tuple[Floats, Floats]:
        """Points (n, parameters) and objectives (n, 2) of the front, by the first objective."""
        points, values = self._meeting()
        kept = np.flatnonzero(efficient(values.T, np.ones(len(values), dtype=bool)))
        order = kept[np.argsort(values[kept, 0])]
        return points[order], values[order]

    def _ranges(self) -> Floats:
        """(2,) of the objectives on the front; 1 where there is none."""
        values = self._front()[1]
        ranges = np.ptp(values, axis=0) if len(values) else np.zeros(2)
        return np.asarray(np.where(ranges > 0.0, ranges, 1.0))

    def _widest(self, share: float, *, gaps: bool) -> _Part | None:
        """The widest part that was not searched from both sides.

        Parameters
        ----------
        share : of the length of the front, above which a part is wide.
        gaps : whether parts are those between neighbours, else between designs at which a search settled.
        """
        values = self._front()[1]
        steps = np.linalg.norm(np.diff(values / self._ranges(), axis=0), axis=1)
        at = np.append(0.0, np.cumsum(steps))
        if not gaps:  # the ends are located, too
            exact = [np.all(np.isclose(values, each, rtol=1e-9), axis=1) for each in self.exact]
            kept = np.any([*exact, np.arange(len(values)) % max(len(values) - 1, 1) == 0], axis=0)
            values, at = values[kept], at[kept]
        parts = np.diff(at) / (at[-1] if at.size and at[-1] > 0.0 else 1.0)
        for k in np.argsort(-parts, kind="stable"):
            for goal in (1, 0) if parts[k] > share else ():
                key = (*values[k].tolist(), *values[k + 1].tolist(), float(goal))
                if key not in self.searched:
                    return _Part(float(parts[k]), key, goal, float(values[k : k + 2, 1 - goal].mean()))
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
        from scipy.optimize import Bounds, NonlinearConstraint, minimize

        free, ranges, other = self.designs.free, self._ranges(), 1 - goal
        if not free.any() or room < self.fewest:
            return start, not free.any()

        solved, last = list[Floats](), self.designs.tried + room

        def known(numbers: Floats) -> tuple[Floats, Floats]:
            if solved and self.designs.tried >= last:  # the method may ask for some more: they count as bad ones
                values, excess = self.designs.signed(solved[0][None])
                return np.full_like(values[:, 0], np.inf), np.full_like(excess[:, 0], np.inf)
            solved.append(self.designs.placed(start, np.clip(numbers, 0.0, 1.0)))
            values, excess = self.designs.signed(solved[-1][None])
            return values[:, 0], excess[:, 0]

        base = known(start[free])[0]

        def merit(numbers: Floats) -> float:
            return float(min((known(numbers)[0][goal] - base[goal]) / ranges[goal], WORSE))

        def beyond(numbers: Floats) -> Floats:
            values, excess = known(numbers)
            above = [(values[other] - ceiling) / ranges[other]] if np.isfinite(ceiling) else []
            return np.asarray(np.minimum(np.append(excess + ON_A_LIMIT, above), WORSE))

        bound = beyond(start[free]).size > 0
        found: Any = minimize(
            merit, start[free], method="COBYQA", bounds=Bounds(np.zeros(free.sum()), np.ones(free.sum())),
            constraints=NonlinearConstraint(beyond, -np.inf, 0.0) if bound else (),
            options={"maxfev": room, "initial_tr_radius": radius, "final_tr_radius": RESOLUTION},
        )  # fmt: skip
        end = self.designs.placed(start, found.x)  # a design that was solved, but for round-off
        return min(solved, key=lambda point: float(np.abs(point - end).max())), bool(found.success)


def _evolve(designs: Designs, settings: Optimise, nsga2: Any, limited: bool) -> None:
    """Go on from all designs with the non-dominated sorting genetic algorithm, its population solved as one batch.

    Parameters
    ----------
    designs, settings, limited : as of `front`.
    nsga2 : the algorithm of pymoo.
    """
    problem, evaluator, static = (
        import_module(f"pymoo.{name}") for name in ("core.problem", "core.evaluator", "problems.static")
    )
    size = min(40, max(12, settings.most_cases // 10))
    room = settings.most_cases - round(LAST * settings.most_cases) - designs.tried
    cube = problem.Problem(n_var=len(designs.plan.study.varied), n_obj=2, n_ieq_constr=int(limited), xl=0.0, xu=1.0)
    algorithm = nsga2(pop_size=size, sampling=designs.every()[0])
    algorithm.setup(cube, termination=("n_gen", 1 + max(room // size, 0)), seed=settings.seed)
    while algorithm.has_next():
        population = algorithm.ask()
        values, beyond = designs(population.get("X"))
        known = {"F": np.nan_to_num(values.T, posinf=1e30)} | ({"G": beyond[:, None]} if limited else {})
        evaluator.Evaluator().eval(static.StaticProblem(cube, **known), population)
        algorithm.tell(infills=population)
