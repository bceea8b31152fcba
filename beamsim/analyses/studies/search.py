"""Searches for the best design: for one objective by differential evolution and then locally; for two in `fronts`.

Both work on the unit cube, of which each side is the range of a varied number, or the list of values or choices. They
ask for cases in batches, and for the same ones again with the same seed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.analyses.studies.designs import (
    APART,
    NEAR,
    ON_A_LIMIT,
    RESOLUTION,
    WORSE,
    Designs,
    local_search,
    unfinished_search,
)
from beamsim.analyses.studies.fronts import front
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import means
from beamsim.analyses.studies.worst import WorstSearch
from beamsim.cases import Evaluator
from beamsim.errors import ScenarioError
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats, not_none

BY_EVOLUTION = 0.75  # of the cases that are allowed; the rest is for the local search
WITHIN_TOLERANCES = 0.2  # of the cases, where the worst judges them: a local search with the worst that was found
ROUNDS = 3  # of that search, each with the worst of the design before
CLOSER = 2e-4  # of a range, to which that search locates a design, which a limit within tolerances mostly binds
SETTLED = 0.01  # of the objective and limits, by which the last quarter of a search that the budget ended may improve
STARTS = 4  # of the local search, from the best designs that lie apart


def search(plan: StudyPlan, evaluate: Evaluator, worst: WorstSearch) -> Outcome:
    """Try designs until the best one, or the front of two objectives, is found.

    Parameters
    ----------
    plan : of the search.
    evaluate : solves the cases; all that is known of them is kept there.
    worst : the search for the worst within tolerances.

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
    designs = Designs(plan, evaluate)
    if len(objectives(plan.scenario)) > 1:
        return front(designs, settings)
    most = settings.most_cases - (round(WITHIN_TOLERANCES * settings.most_cases) if worst.judges_by_worst else 0)
    ended = _best(designs, settings.model_copy(update={"most_cases": most}), plan.scenario.limits is not None)
    return (_improve_worst(designs, worst, settings.most_cases) if worst.judges_by_worst else None) or ended


def _best(designs: Designs, settings: Optimise, limited: bool) -> Outcome:
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

    free = designs.free
    settled, least, taken = bool(found.success) or designs.exhausted, np.inf, list[Floats]()
    for _ in range(STARTS if free.any() else 0):
        start, room = designs.best_apart(taken), settings.most_cases - designs.design_count
        if start is None or room < 1:
            break

        def merit(point: Floats, start: Floats = start) -> float:
            values, excess = designs(designs.placed(start, point)[None])
            return float(values[0, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, APART, -APART) / 2.0)])
        local: Any = minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": room},
        )  # fmt: skip
        taken += [start, designs.placed(start, local.x)]
        if local.fun < least:
            least, settled = local.fun, bool(local.success)
    return COMPLETE if settled else unfinished_search(designs.design_count)


def _improve_worst(designs: Designs, worst: WorstSearch, most: int) -> Outcome | None:
    """Search for the best design locally, judged by the sample and where others are worst, until that is its worst.

    A sample judges a design too well; what it misses is known after a search for the worst (the cutting-set method of
    A. Mutapcic and S. Boyd, Optimization Methods and Software 24 (2009) 381-406).

    Parameters
    ----------
    designs, worst : of the search.
    most : number of designs that are tried at most.

    Returns
    -------
    Complete, or what the last local search did not come to; None without one.
    """
    ended: Outcome | None = None
    for k in range(ROUNDS):
        before = len(worst.critical)
        case = worst.explore()
        if (
            case is None
            or not designs.free.any()
            or designs.design_count >= most
            or (k and len(worst.critical) == before)
        ):
            break
        start = designs.points[worst.evaluate.rows[case]]
        ended = _descend_worst(designs, worst, start, most, NEAR if k else APART)
    return ended


def _descend_worst(designs: Designs, worst: WorstSearch, start: Floats, most: int, radius: float) -> Outcome:
    """Search locally for the best design, judged by the sample and where others are worst.

    Parameters
    ----------
    designs, worst, most : as above.
    start : (parameters,) design whose corners are known.
    radius : of the first steps.

    Returns
    -------
    Complete, or what it did not come to.
    """
    tried: dict[tuple[float, ...], tuple[float, Floats]] = {}
    ended_by, free = "", designs.free

    def known(numbers: Floats) -> tuple[float, Floats]:
        nonlocal ended_by
        point = designs.placed(start, np.clip(numbers, 0.0, 1.0))
        if (key := tuple(point.tolist())) not in tried:
            if designs.design_count >= most or not worst.affords(worst.critical):
                ended_by = "most_cases" if designs.design_count >= most else "worst_cases of its tolerances"
                return np.inf, np.full_like(base[1], np.inf)
            tried[key] = designs.signed_with(point, worst.realisations_worst_for_others)
        return tried[key]

    base = tried[tuple(start.tolist())] = designs.signed_with(start, worst.realisations_worst_for_others)
    scale = abs(base[0]) if np.isfinite(base[0]) and base[0] else 1.0

    def merit(numbers: Floats) -> float:
        return float(min(known(numbers)[0] / scale, WORSE))

    def beyond(numbers: Floats) -> Floats:
        return np.asarray(np.minimum(known(numbers)[1] + ON_A_LIMIT, WORSE))

    _, settled = local_search(merit, beyond, start[free], most - designs.design_count + 1, (radius, CLOSER))
    over = [(value, float(of.max(initial=0.0))) for value, of in tried.values()]
    least = min(value if excess <= 0.0 else np.inf for value, excess in over)
    before = min(value if excess <= SETTLED else np.inf for value, excess in over[: -(-3 * len(over) // 4)])
    if (settled and not ended_by) or abs(before - least) <= SETTLED * abs(least) < np.inf:
        return COMPLETE
    return unfinished_search(designs.design_count, more=ended_by or "most_cases")
