"""Searches for the best design: for one objective by differential evolution and then locally, for two by NSGA-II.

Both work on the unit cube, of which each side is the range of a varied number, or the list of values or choices. They
ask for cases in batches, and for the same ones again with the same seed.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan, distributed
from beamsim.analyses.studies.responses import means
from beamsim.analyses.studies.table import costs
from beamsim.cases import Evaluator
from beamsim.errors import ScenarioError
from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.scenario.studies import Optimise, Value
from beamsim.typing import Floats, not_none

BY_EVOLUTION = 0.75  # of the cases that are allowed; the rest is for the local search, of a front for a sample at first
STARTS = 4  # of the local search, from the best designs that lie apart
APART = 0.1  # of a range
RESOLUTION = 1e-3  # of the ranges, to which the best design is located
SETTLED = 0.01  # relative change of the area below a front in the last quarter of its generations


def search(plan: StudyPlan, evaluate: Evaluator) -> Outcome:
    """Try designs until the best one, or the front of two objectives, is found.

    Parameters
    ----------
    plan : of the search.
    evaluate : solves the cases; all that is known of them is kept there.

    Returns
    -------
    Outcome
        Complete, or why the best design is in doubt.
    """
    settings = not_none(plan.scenario.optimise)
    first = evaluate([plan.cases[0].values])[0][0]
    for name in (name for aim in objectives(plan.scenario) for name, _ in aim.terms):
        if first.outcome.complete and not any(means(name, known) for known in first.values):
            raise ScenarioError.at(
                "optimise", f"asks for {name}, which no design has", "leave responses out to see all"
            )
    method = _front if len(objectives(plan.scenario)) > 1 else _best
    return method(_Designs(plan, evaluate), settings, plan.scenario.limits is not None)


def unsettled(tried: int) -> Outcome:
    """The outcome of a search that ended while better designs were still found."""
    sentence = f"the search ended after {tried} designs while it still found better ones"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy="give more most_cases", tried=tried
    )


class _Designs:
    """Costs of designs, each solved once."""

    def __init__(self, plan: StudyPlan, evaluate: Evaluator) -> None:
        self.plan, self.evaluate = plan, evaluate
        self.known: dict[tuple[Value, ...], tuple[Floats, float]] = {}
        self.points: dict[tuple[Value, ...], Floats] = {}  # of the unit cube

    def __call__(self, cube: Floats) -> tuple[Floats, Floats]:
        """Objectives (objectives, n) and excess of the limits (n,) of points (n, parameters) of the unit cube."""
        rows = list(zip(*distributed(self.plan.study.varied, cube), strict=True))
        self.points |= dict(zip(rows, cube, strict=True))
        new = [row for row in dict.fromkeys(rows) if row not in self.known]
        if new:
            outcomes = [outcome for of_case in self.evaluate(new) for outcome in of_case]
            values, beyond = costs(self.plan, outcomes)
            most = beyond.max(axis=0, initial=0.0)
            self.known |= {row: (values[:, k], float(most[k])) for k, row in enumerate(new)}
        found = [self.known[row] for row in rows]
        values = np.reshape([values for values, _ in found], (len(rows), len(objectives(self.plan.scenario))))
        return values.T, np.array([beyond for _, beyond in found])

    @property
    def exhausted(self) -> bool:
        """Whether there is no other design."""
        counts = [len(p.values) or (p.high - p.low + 1.0 if p.whole else np.inf) for p in self.plan.study.varied]
        return len(self.points) >= float(np.prod(counts))

    def best_apart(self, taken: list[Floats]) -> Floats | None:
        """The best point that meets every limit and lies apart from others; None where there is none."""
        kept = [row for row in self.points if self.known[row][1] == 0.0 and np.isfinite(self.known[row][0][0])]
        ranked = (self.points[row] for row in sorted(kept, key=lambda row: float(self.known[row][0][0])))
        return next((p for p in ranked if all(np.max(np.abs(p - other)) >= APART for other in taken)), None)


def _best(designs: _Designs, settings: Optimise, limited: bool) -> Outcome:
    """Differential evolution of a population that is solved as one batch, then the simplex method from the best of it.

    Sources: R. Storn and K. Price, Journal of Global Optimization 11 (1997) 341-359; J. Lampinen, CEC 2002.
    """
    from scipy.optimize import Bounds, NonlinearConstraint, differential_evolution, minimize

    varied = designs.plan.study.varied
    count = len(varied)
    size = max(8, -(-16 // count))
    generations = max(1, int(BY_EVOLUTION * settings.most_cases / (size * count)) - 1)

    def beyond(points: Floats) -> Floats:
        return designs(points.reshape(count, -1).T)[1].reshape(1, -1)

    def objective(points: Any) -> Any:
        return np.asarray(designs(points.T)[0][0])

    found: Any = differential_evolution(
        objective, Bounds(np.zeros(count), np.ones(count)), maxiter=generations, popsize=size, polish=False,
        vectorized=True, updating="deferred", rng=np.random.default_rng(settings.seed),
        constraints=NonlinearConstraint(beyond, -np.inf, 0.0) if limited else (),
    )  # fmt: skip

    def placed(design: Floats, point: Floats) -> Floats:
        design = design.copy()
        design[free] = point
        return design

    free = np.array([not (p.values or p.whole) for p in varied])
    settled, least, taken = bool(found.success) or designs.exhausted, np.inf, list[Floats]()
    for _ in range(STARTS if free.any() else 0):
        start, room = designs.best_apart(taken), settings.most_cases - len(designs.evaluate.rows)
        if start is None or room < 1:
            break

        def merit(point: Floats, start: Floats = start) -> float:
            values, excess = designs(placed(start, point)[None])
            return float(values[0, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, APART, -APART) / 2.0)])
        local: Any = minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": room},
        )  # fmt: skip
        taken += [start, placed(start, local.x)]
        if local.fun < least:
            least, settled = local.fun, bool(local.success)
    return COMPLETE if settled else unsettled(len(designs.evaluate.rows))


def _front(designs: _Designs, settings: Optimise, limited: bool) -> Outcome:
    """The non-dominated sorting genetic algorithm for two objectives, its population solved as one batch.

    The best of a Latin hypercube are the first population: a part of the front that lies apart is seldom found later.
    Source: K. Deb et al., IEEE Transactions on Evolutionary Computation 6 (2002) 182-197.
    """
    from scipy.stats.qmc import LatinHypercube

    try:
        nsga2, problem = import_module("pymoo.algorithms.moo.nsga2"), import_module("pymoo.core.problem")
        evaluator, static = import_module("pymoo.core.evaluator"), import_module("pymoo.problems.static")
        hypervolume = import_module("pymoo.indicators.hv")
    except ImportError:
        raise ScenarioError.at(
            "optimise", "asks for two objectives, which takes pymoo, and that is not installed",
            "pip install 'beamsim[optimise]', or add the objectives up: minimise: {peak_force: 40 N, ...}",
        ) from None  # fmt: skip
    size = min(40, max(12, settings.most_cases // 10))
    count, first = len(designs.plan.study.varied), max(size, round((1.0 - BY_EVOLUTION) * settings.most_cases))
    generations = max(2, 1 + (settings.most_cases - 1 - first) // size)
    cube = problem.Problem(n_var=count, n_obj=2, n_ieq_constr=int(limited), xl=0.0, xu=1.0)
    sample = LatinHypercube(count, rng=np.random.default_rng(settings.seed)).random(first)
    algorithm = nsga2.NSGA2(pop_size=size, sampling=sample)
    algorithm.setup(cube, termination=("n_gen", generations), seed=settings.seed)
    fronts: list[Floats] = []
    while algorithm.has_next():
        population = algorithm.ask()
        values, beyond = designs(population.get("X"))
        known = {"F": np.nan_to_num(values.T, posinf=1e30)} | ({"G": beyond[:, None]} if limited else {})
        evaluator.Evaluator().eval(static.StaticProblem(cube, **known), population)
        algorithm.tell(infills=population)
        fronts.append(np.empty((0, 2)) if algorithm.opt is None else algorithm.opt.get("F"))
    every = np.vstack(fronts)
    low, high = every.min(axis=0), every.max(axis=0)
    area = hypervolume.HV(ref_point=np.ones(2))
    areas = [float(area((front - low) / np.where(high > low, high - low, 1.0))) for front in fronts]
    change = areas[-1] - areas[(3 * len(areas)) // 4 - 1]
    return COMPLETE if change <= SETTLED * areas[-1] else unsettled(len(designs.evaluate.rows))
