"""Design studies: many cases of one scenario, solved by workers and collected in a table of responses."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from threading import Event
from typing import Any

from beamsim.analyses.designs.gathering import gather
from beamsim.analyses.designs.plan import Case, DesignPlan, Study, check_cases, plan_designs
from beamsim.analyses.designs.responses import Responses, entries_of, is_asked, responses_of_result, run_responses
from beamsim.analyses.designs.result import CaseOutcome, DesignsResult
from beamsim.analyses.parallel import cluster, default_workers, processes, threads
from beamsim.analyses.run.asked import asked_figures, gives_figures, needs_recovery
from beamsim.analyses.values import Margins
from beamsim.errors import BeamsimError, ScenarioError
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind, Stop, never
from beamsim.scenario import Scenario
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds

THREADED = ("run", "swept_sine")  # analyses whose time is spent in compiled code, which threads execute side by side


def design_study(
    scenario: Scenario | DesignPlan,
    *,
    workers: int | None = None,
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
    scenario : with ``vary``; or its plan from `plan_designs`, already checked by `check_cases`. Each case is a sweep if
        there is a section ``sweep``, else a run.
    workers : number of processes on this machine; by default the number of processors.
    scheduler : address of a Dask scheduler whose workers are used instead.
    known : outcomes of an earlier, unfinished study.
    each : called with every new outcome, in the order of completion.
    progress : called with the fraction of cases done.
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
    if workers is not None and workers < 1:
        raise ScenarioError.at("workers", f"= {workers} is no number of workers", "give 1 or more, or leave it out")
    if isinstance(scenario, DesignPlan):
        plan = scenario
    else:
        plan = plan_designs(scenario)
        check_cases(plan)
    outcomes = {outcome.index: outcome for outcome in known}
    missing = [case for case in plan.cases if case.number not in outcomes]
    if progress is not None:
        progress(len(outcomes) / len(plan.cases))
    for outcome in _solved(plan.study, missing, workers, scheduler, stop):
        if outcome.outcome.interrupted:
            continue
        outcomes[outcome.index] = outcome
        if each is not None:
            each(outcome)
        if progress is not None:
            progress(len(outcomes) / len(plan.cases))
    return gather(plan, outcomes, clock.perf_counter() - begin)


def _solved(
    study: Study, cases: Sequence[Case], workers: int | None, scheduler: str | None, stop: Stop
) -> Iterator[CaseOutcome]:
    """The outcomes of cases, in the order of completion."""
    count = max(1, min(workers or default_workers(), len(cases)))
    if scheduler is None and (study.analysis in THREADED or count == 1):
        ended = Event()
        solver = CaseSolver(study, lambda: stop() or ended.is_set())
        with threads(count, ended) as pool:
            yield from pool.completed(solver.solve, cases, stop)
    elif cases:
        with processes(count, stop) if scheduler is None else cluster(scheduler) as pool:
            yield from pool.completed(partial(solve_case, study), cases, stop)


class CaseSolver:
    """Solves the cases of one study; what they share is built once. May be used by several threads."""

    def __init__(self, study: Study, stop: Stop = never) -> None:
        self.study = study
        self.stop = stop
        self.shared = SharedBuilds()

    def solve(self, case: Case) -> CaseOutcome:
        """Solve one case, unless it is to stop; an error becomes part of the outcome, so that other cases continue."""
        begin = clock.thread_time()
        values: Responses = {}
        ranges: Mapping[str, Sequence[float]] = {}
        try:
            values, outcome, ranges = self._responses(self.study.scenario(case))
        except BeamsimError as error:
            outcome = Outcome.of(OutcomeKind.FAILED, "failed", "; ".join(str(error).splitlines()))
        except (ArithmeticError, ValueError, RuntimeError) as error:
            reason = f"internal error ({type(error).__name__}: {error})"
            outcome = Outcome.of(OutcomeKind.FAILED, "failed", reason)
        values = {name: value for name, value in values.items() if is_asked(name, self.study.asked)}
        time = clock.thread_time() - begin
        return CaseOutcome(case.number, values if outcome.complete else {}, outcome, time, ranges)

    def _responses(self, scenario: Scenario) -> tuple[Responses, Outcome, Mapping[str, Sequence[float]]]:
        """Of a run the values that are asked for, if they can be had alone; else those of the whole result."""
        analysis = self.study.analysis
        if analysis == "run" and gives_figures(scenario):
            asked = entries_of(self.study.asked, scenario.excitation.stationary)
            system = build_system(scenario, self.shared, recovered=needs_recovery(asked))
            figures, outcome = asked_figures(system, scenario, asked, self.stop)
            return run_responses(figures), outcome, {}
        kind = analysis if analysis in KINDS else "sweep"
        result: Any = named(KINDS[kind].analysis)(scenario, stop=self.stop)
        margins: Margins = result.summary.get("margins", {})
        ends = {name: (x["lowest"], x["highest"]) for name, x in margins.items() if x["lowest"] != x["highest"]}
        ranges = {name: (low, high) if low < high else (-math.inf, math.inf) for name, (low, high) in ends.items()}
        return responses_of_result(result), result.outcome, ranges


_SOLVERS: dict[str, CaseSolver] = {}  # of the study that this worker process is computing


def solve_case(study: Study, case: Case) -> CaseOutcome:
    """Solve one case in a worker process, which keeps what the cases of a study share."""
    solver = _SOLVERS.get(study.fingerprint)
    if solver is None:  # threads of a cluster's worker may come here at once, each with a solver that gives the same
        solver = CaseSolver(study)
        _SOLVERS.clear()
        _SOLVERS[study.fingerprint] = solver
    return solver.solve(case)
