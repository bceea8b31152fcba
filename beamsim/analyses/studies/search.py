"""Searches for the best design: for one objective by differential evolution and then locally; for two in `fronts`.

Both work on the unit cube, of which each side is the range of a varied number, or the list of values or choices. They
ask for cases in batches, and for the same ones again with the same seed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.analyses.studies.designs import APART, RESOLUTION, Designs, unsettled
from beamsim.analyses.studies.fronts import front
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.analyses.studies.responses import means
from beamsim.cases import Evaluator
from beamsim.errors import ScenarioError
from beamsim.outcomes import COMPLETE, Outcome
from beamsim.scenario.studies import Optimise
from beamsim.typing import Floats, not_none

BY_EVOLUTION = 0.75  # of the cases that are allowed; the rest is for the local search
STARTS = 4  # of the local search, from the best designs that lie apart


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
    designs = Designs(plan, evaluate)
    if len(objectives(plan.scenario)) > 1:
        return front(designs, settings)
    return _best(designs, settings, plan.scenario.limits is not None)


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
        start, room = designs.best_apart(taken), settings.most_cases - designs.tried
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
    return COMPLETE if settled else unsettled(designs.tried)
