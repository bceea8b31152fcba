"""Design studies: many cases of one scenario, solved by workers and collected in a table of responses."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterable
from functools import partial

from beamsim.analyses.designs.cases import CaseSolver, Evaluator, unsettled
from beamsim.analyses.designs.gathering import gather
from beamsim.analyses.designs.plan import DesignPlan, check_cases, plan_designs
from beamsim.analyses.designs.reliability import Exceedance, asked, concluded
from beamsim.analyses.designs.result import CaseOutcome, DesignsResult
from beamsim.analyses.designs.search import search
from beamsim.analyses.parallel import working
from beamsim.outcomes import Outcome, Stop, never, tell
from beamsim.scenario import Scenario


def design_study(
    scenario: Scenario | DesignPlan,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    known: Iterable[CaseOutcome] = (),
    each: Callable[[CaseOutcome], None] | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> DesignsResult:
    """Solve every case of a scenario with ``vary``.

    The result does not depend on the number or kind of workers, or on which outcomes were known before.

    Parameters
    ----------
    scenario : with ``vary`` or ``optimise``; or its plan from `plan_designs`, already checked by `check_cases`. Each
        case is a sweep if there is a section ``sweep``, else a run.
    workers : number of processes on this machine; one is this process, several start beside it and import the script
        that calls, so that its call stands below ``if __name__ == "__main__":``.
    scheduler : address of a Dask scheduler whose workers are used instead.
    known : outcomes of an earlier, unfinished study.
    each : called with every new outcome, in the order of completion.
    progress : called with the fraction of cases done; not of a study of reliability.
    stop : asked between cases, and within those of runs and swept sines, whether to end; the result then holds the
        cases that were solved.

    Returns
    -------
    DesignsResult

    Raises
    ------
    ScenarioError
        If the scenario of a case is invalid, or there are fewer workers than one.
    NotTrustedError
        If workers end unexpectedly; `each` has been called for all solved cases.
    """
    begin = clock.perf_counter()
    if isinstance(scenario, DesignPlan):
        plan = scenario
    else:
        plan = plan_designs(scenario)
        check_cases(plan)
    ended: Outcome | None = None
    histories: Exceedance | None = None
    known, total = tuple(known), plan.most * plan.study.realisations.count
    progress = None if plan.kind == "reliability" else progress  # which does not know how many it needs

    def solved(outcome: CaseOutcome) -> None:
        if each is not None:
            each(outcome)
        tell(progress, len(evaluate.outcomes) / total)

    tell(progress, len(known) / total)
    unknown, count = total - len(known), plan.study.realisations.count
    solving = working(partial(CaseSolver, plan.study), unknown, stop, workers=workers, scheduler=scheduler)
    with Evaluator(solving, most=plan.most, realisations=count, known=known, each=solved) as evaluate:
        if plan.kind == "reliability":
            histories = asked(plan, evaluate)
        elif plan.searches:
            ended = search(plan, evaluate)
        else:
            evaluate([case.values for case in plan.cases if not case.realisation])
    ended = unsettled(plan.most) if evaluate.ended == "most_cases" else ended
    result = gather(plan, evaluate.outcomes, clock.perf_counter() - begin, ended)
    if histories is not None and evaluate.ended != "interrupted":
        result = concluded(result, histories)
    return result
