"""Search for the best design: differential evolution and a local search for one objective; `fronts` for two.

Both work on the unit cube, each side of which is the range of a varied number, or a list of values or choices. They
request cases in batches; the same seed gives the same cases.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.analyses.studies.designs import (
    FIRST_RADIUS,
    LIMIT_MARGIN,
    PENALTY,
    RESOLUTION,
    START_DISTANCE,
    Designs,
    local_search,
    unfinished_search,
)
from beamsim.analyses.studies.fronts import front
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import matches_request
from beamsim.analyses.studies.worst import WorstSearch
from beamsim.cases import Evaluator
from beamsim.errors import ScenarioError
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats, not_none

EVOLUTION_SHARE = 0.75  # of the allowed cases; the rest is for the local search
WORST_SEARCH_SHARE = 0.2  # of the cases: for a local search with the worst realisations found within tolerances
ROUNDS = 3  # of that search, each with the worst realisation of the previous design
LOCAL_TOLERANCE = 2e-4  # of a range: tolerance of that search, since a limit within tolerances usually governs
# of the objective and limits: improvement of a converged search in the last quarter of its designs
CONVERGED_SHARE = 0.01
STARTS = 4  # of the local search, from the best designs that differ enough


def search(plan: StudyPlan, evaluate: Evaluator, worst: WorstSearch) -> Outcome:
    """Solve designs until the best one, or the front of two objectives, is found.

    Parameters
    ----------
    plan : plan of the search.
    evaluate : evaluator that solves the cases and keeps their outcomes.
    worst : the search for the worst within tolerances.

    Returns
    -------
    Outcome
        Complete, or why the best design is not certain.
    """
    settings = not_none(plan.scenario.optimise)
    first = evaluate([plan.cases[0].values])[0][0]
    for name in (name for aim in objectives(plan.scenario) for name, _ in aim.terms):
        if first.outcome.complete and not any(matches_request(name, known) for known in first.values):
            raise ScenarioError.at(
                "optimise", f"asks for {name}, but no design has it", "leave responses out to see all"
            )
    designs = Designs(plan, evaluate)
    if len(objectives(plan.scenario)) > 1:
        return front(designs, settings)
    most = settings.most_cases - (round(WORST_SEARCH_SHARE * settings.most_cases) if worst.judges_by_worst else 0)
    ended = _best(designs, settings.model_copy(update={"most_cases": most}), plan.scenario.limits is not None)
    return (_improve_worst(designs, worst, settings.most_cases) if worst.judges_by_worst else None) or ended


def _best(designs: Designs, settings: Optimise, limited: bool) -> Outcome:
    """Differential evolution, one batch per population, then the simplex method from its best designs.

    Sources: R. Storn and K. Price, Journal of Global Optimization 11 (1997) 341-359; J. Lampinen, CEC 2002.
    """
    from scipy.optimize import Bounds, NonlinearConstraint, differential_evolution, minimize

    parameters = designs.plan.study.parameters
    count = len(parameters)
    size = max(8, -(-16 // count))
    generations = max(1, int(EVOLUTION_SHARE * settings.most_cases / (size * count)) - 1)

    def excesses(points: Floats) -> Floats:
        return designs(points.reshape(count, -1).T)[1].reshape(1, -1)

    def objective(points: Any) -> Any:
        return np.asarray(designs(points.T)[0][0])

    found: Any = differential_evolution(
        objective, Bounds(np.zeros(count), np.ones(count)), maxiter=generations, popsize=size, polish=False,
        vectorized=True, updating="deferred", rng=np.random.default_rng(settings.seed),
        constraints=NonlinearConstraint(excesses, -np.inf, 0.0) if limited else (),
    )  # fmt: skip

    free = designs.free
    settled, least, taken = bool(found.success) or designs.exhausted, np.inf, list[Floats]()
    for _ in range(STARTS if free.any() else 0):
        start, room = designs.best_away_from(taken), settings.most_cases - designs.design_count
        if start is None or room < 1:
            break

        def merit(point: Floats, start: Floats = start) -> float:
            values, excess = designs(designs.with_numbers(start, point)[None])
            return float(values[0, 0]) if excess[0] == 0.0 else np.inf

        first = start[free]
        simplex = np.vstack([first, first + np.diag(np.where(first < 0.5, START_DISTANCE, -START_DISTANCE) / 2.0)])
        local: Any = minimize(
            merit, first, method="Nelder-Mead", bounds=Bounds(0.0 * first, 0.0 * first + 1.0),
            options={"initial_simplex": simplex, "xatol": RESOLUTION, "fatol": np.inf, "maxfev": room},
        )  # fmt: skip
        taken += [start, designs.with_numbers(start, local.x)]
        if local.fun < least:
            least, settled = local.fun, bool(local.success)
    return COMPLETE if settled else unfinished_search(designs.design_count)


def _improve_worst(designs: Designs, worst: WorstSearch, most: int) -> Outcome | None:
    """Local search for the best design, judged by the sample and by the worst realisations of other designs.

    A sample alone judges a design too favourably; a search for the worst realisation corrects it (the cutting-set
    method of A. Mutapcic and S. Boyd, Optimization Methods and Software 24 (2009) 381-406).

    Parameters
    ----------
    designs, worst : designs, and the search for the worst.
    most : largest number of designs.

    Returns
    -------
    Complete, or what the last local search did not reach; None without a local search.
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
        ended = _descend_worst(designs, worst, start, most, FIRST_RADIUS if k else START_DISTANCE)
    return ended


def _descend_worst(designs: Designs, worst: WorstSearch, start: Floats, most: int, radius: float) -> Outcome:
    """Local search for the best design, judged by the sample and by the worst realisations of other designs.

    Parameters
    ----------
    designs, worst, most : as above.
    start : (parameters,) design with known corners.
    radius : size of the first steps.

    Returns
    -------
    Complete, or why it did not converge.
    """
    tried: dict[tuple[float, ...], tuple[float, Floats]] = {}
    ended_by, free = "", designs.free

    def known_values(numbers: Floats) -> tuple[float, Floats]:
        nonlocal ended_by
        point = designs.with_numbers(start, np.clip(numbers, 0.0, 1.0))
        if (key := tuple(point.tolist())) not in tried:
            if designs.design_count >= most or not worst.affords(worst.critical):
                ended_by = "most_cases" if designs.design_count >= most else "worst_cases of its tolerances"
                return np.inf, np.full_like(base[1], np.inf)
            tried[key] = designs.objective_with_further(point, worst.realisations_worst_for_others)
        return tried[key]

    base = tried[tuple(start.tolist())] = designs.objective_with_further(start, worst.realisations_worst_for_others)
    scale = abs(base[0]) if np.isfinite(base[0]) and base[0] else 1.0

    def merit(numbers: Floats) -> float:
        return float(min(known_values(numbers)[0] / scale, PENALTY))

    def excesses(numbers: Floats) -> Floats:
        return np.asarray(np.minimum(known_values(numbers)[1] + LIMIT_MARGIN, PENALTY))

    _, settled = local_search(merit, excesses, start[free], most - designs.design_count + 1, (radius, LOCAL_TOLERANCE))
    over = [(value, float(of.max(initial=0.0))) for value, of in tried.values()]
    least = min(value if excess <= 0.0 else np.inf for value, excess in over)
    before = min(value if excess <= CONVERGED_SHARE else np.inf for value, excess in over[: -(-3 * len(over) // 4)])
    if (settled and not ended_by) or abs(before - least) <= CONVERGED_SHARE * abs(least) < np.inf:
        return COMPLETE
    return unfinished_search(designs.design_count, key=ended_by or "most_cases")
