"""Studies: many cases of one scenario, each solved and judged as the command that solves it alone does.

There is one function that solves a case, `solve_case`. Commands call what it calls; studies, ensembles, searches and
reliability call it by `CaseSolver`, which asks for those values alone that the table has.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from contextvars import copy_context
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.statics.result import StaticResult
from beamsim.analyses.studies.designs import unfinished_search
from beamsim.analyses.studies.layouts import RUNS
from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.plan import Study, StudyPlan, check_cases, design, plan_designs
from beamsim.analyses.studies.reliability import Exceedance, run_histories, with_probability
from beamsim.analyses.studies.responses import entries_of, matches_request, responses_of_result
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.search import search
from beamsim.analyses.studies.summary import result_of
from beamsim.analyses.studies.table import cases_to_compare
from beamsim.analyses.studies.worst import Changes, WorstSearch
from beamsim.analyses.sweep.result import SweepResult
from beamsim.cases import Case, CaseOutcome, Evaluator, StopEvaluation, failed_case
from beamsim.errors import BeamsimError, allowing_hours
from beamsim.labelled import Dataset, LabelledArray
from beamsim.outcomes import Outcome, Progress, Stop, never, report_progress, stop_requested, stop_requests
from beamsim.parallel import Cluster, Computation, most_processors, worker_pool
from beamsim.results.result import CONVERGENCE
from beamsim.results.values import BY_NAME, parse_limit
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.scenario.parameters import with_values
from beamsim.scenario.run import SensitiveParameter
from beamsim.scenario.studies import Value, tolerances_of
from beamsim.system.reduced_model import SharedBuilds
from beamsim.trust.convergence import COMPARISON, unconverged_outcome
from beamsim.trust.least_time import least_time_of_study
from beamsim.trust.runs import run
from beamsim.trust.with_finer_model import continuation, static, sweep
from beamsim.typing import not_none


def solve_case(
    scenario: Scenario, analysis: str, *, entries: Collection[str] | None = None, builds: SharedBuilds | None = None
) -> RunResult | StaticResult | SweepResult | ContinuationResult:  # fmt: skip
    """Solve a case and judge it, as `beamsim run`, `beamsim static` and `beamsim sweep` do.

    Parameters
    ----------
    scenario : of the case.
    analysis : one of `beamsim.analyses.studies.plan.ANALYSES`.
    entries : of the summary of a run that are needed, by default all; outcome, warnings and margins are the same.
    builds : keeps what cases have in common.

    Returns
    -------
    The result of the command.

    Raises
    ------
    ScenarioError
        If the scenario cannot be solved.
    """
    with allowing_hours(math.inf):  # the time of the whole study was checked before
        if analysis == "run":
            around = copy_context()  # requests to stop that were made outside the run
            return run(scenario, stop=lambda: around.run(stop_requested), entries=entries, builds=builds)
        if analysis == "static":
            return static(scenario, builds=builds)
        return (continuation if analysis == "continuation" else sweep)(scenario)


class CaseSolver:
    """Solves the cases of one study and builds common parts once."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.builds = SharedBuilds()

    def __call__(self, case: Case) -> CaseOutcome:
        """Solve one case, unless a stop is requested; an error becomes the outcome of the case, so that others
        continue."""
        begin = clock.thread_time()
        try:
            solved = self._solve(case)
        except BeamsimError as error:
            solved = failed_case(case, "; ".join(str(error).splitlines()))
        return replace(solved, processor_time_s=clock.thread_time() - begin)

    def _solve(self, case: Case) -> CaseOutcome:
        """Responses, outcome, margins and warnings of a case."""
        scenario, asked, analysis = self.study.scenario(case), self.study.requested, self.study.analysis
        entries = entries_of(asked, scenario) if analysis == "run" else None
        result = solve_case(scenario, analysis, entries=entries, builds=self.builds)
        values = {} if result.outcome.ended_early else responses_of_result(result)
        if asked:
            values = {name: x for name, x in values.items() if any(matches_request(each, name) for each in asked)}
        elif entries is not None:  # a case that is compared is computed completely
            values = {name: x for name, x in values.items() if _of_entry(name) in (*entries, "")}
        margins = result.summary.get("margins", {})
        return CaseOutcome(
            case.number, values, result.outcome, margins=margins, given=case.values, warnings=result.warnings,
            compared=case.compared,
        )  # fmt: skip


def _of_entry(response: str) -> str:
    """The entry of a run's summary that a response is in."""
    return BY_NAME[response.rpartition("/")[2]].entry


def design_study(
    scenario: Source | StudyPlan,
    *,
    workers: int | None = 1,
    scheduler: str | Cluster | None = None,
    solved_before: Iterable[CaseOutcome] = (),
    on_outcome: Callable[[CaseOutcome], None] | None = None,
    progress: Callable[[float], None] | None = None,
    stop: Stop = never,
) -> StudyResult:
    """Solve every case of a scenario with ``vary`` or ``optimise``.

    The result does not depend on the number or kind of workers, or on which outcomes were known before. Each case has
    the outcome, warnings and margins that its run has. With ``convergence: on`` all cases are compared with a finer
    model, with ``off`` none; else those that decide: the best, the worst of each limit, and those that are closer to a
    limit than values change.

    Parameters
    ----------
    scenario : with ``vary`` or ``optimise``, or what `beamsim.load_scenario` reads; or its plan from `plan_designs`,
        already checked by `check_cases`. Each case is a sweep if there is a section ``sweep``, else a run.
    workers : number of processes on this machine; one is this process, several are started in addition and import the
        script that calls, so that its call stands below ``if __name__ == "__main__":``. None: one for each processor,
        if the first cases show that it is worth while to start them.
    scheduler : Dask scheduler whose workers are used instead: its address, or with how long to wait for workers.
    solved_before : outcomes of an earlier, unfinished study.
    on_outcome : called with every new outcome, in the order of completion.
    progress : called with the fraction of cases done; of a study of reliability, after each batch, with an estimate.
    stop : asked between cases, and within those of runs and swept sines, whether to end; the result then holds the
        cases that were solved.

    Returns
    -------
    StudyResult
        Of a search with what the runs of the best design and of the scenario as it is show.

    Raises
    ------
    ScenarioError
        If the scenario of a case is invalid, or there are fewer workers than one.
    NotTrustedError
        If the connection to the cluster is lost, or it has no workers; `on_outcome` was called for all solved cases.
    TooLongError
        If its cases would take longer than `beamsim.allowing_hours` allows.

    Examples
    --------
    >>> import beamsim
    >>> gaps = {"path": "chain.snubbers.bumper.gap", "values": ["0.2 mm", "0.5 mm"]}
    >>> study = {"sweep": None, "vary": {"kind": "zip", "parameters": [gaps], "responses": ["peak_force"]}}
    >>> result = beamsim.design_study(beamsim.load_scenario("configs/stops/chain_bumpers.yaml", study))
    >>> result.table["snubbers/bumper/peak_force"].round(2).tolist()
    [40.06, 37.91]
    """
    begin = clock.perf_counter()
    if isinstance(scenario, StudyPlan):
        plan = scenario
    else:
        plan = plan_designs(scenario_of(scenario, "sweep"))
        check_cases(plan)
    solved_before, total = tuple(solved_before), plan.most_cases * plan.study.realisations.count
    cases_before = len({outcome.index for outcome in solved_before})
    least_time_of_study(plan, cases_before).demand_allowed(most_processors(workers, scheduler))
    # the number of cases of a study of reliability follows from the solved ones
    of_cases = None if plan.kind == "reliability" else progress
    report_progress(of_cases, cases_before / total)

    def solved(outcome: CaseOutcome) -> None:
        if on_outcome is not None:
            on_outcome(outcome)
        report_progress(of_cases, min(1.0, len(evaluate.outcomes) / total))

    computation = Computation(partial(CaseSolver, plan.study), failed_case)
    with stop_requests(stop):
        with Evaluator(
            worker_pool(computation, total, workers=workers, scheduler=scheduler), most_cases=plan.most_cases,
            realisations=plan.study.realisations.count, with_finer_model=plan.convergence == "on",
            solved_before=solved_before, on_outcome=solved,
            most_further=plan.study.realisations.most_further_cases,
        ) as evaluate:  # fmt: skip
            worst = WorstSearch(plan, evaluate, partial(_changes_within, plan))
            ended, histories = _evaluate_cases(plan, evaluate, progress, worst)
        result = result_of(plan, evaluate.outcomes, clock.perf_counter() - begin, ended, worst.searches)
        if evaluate.ended == "interrupted":
            return result.interrupted(COMPARISON) if result.finished else result
        return _with_runs(result if histories is None else with_probability(result, histories))


def _evaluate_cases(
    plan: StudyPlan, evaluate: Evaluator, progress: Progress, worst: WorstSearch
) -> tuple[Outcome | None, Exceedance | None]:
    """Solve the cases of a plan, search the worst within tolerances of the best, and compare the deciding cases.

    Parameters
    ----------
    plan, evaluate, progress : of the study.
    worst : the search for the worst within tolerances.

    Returns
    -------
    Why a search for the best design ended, and the exceedance from histories.
    """
    ended: Outcome | None = None
    histories: Exceedance | None = None
    with suppress(StopEvaluation):
        if plan.kind == "reliability":
            histories = run_histories(plan, evaluate, progress)
        elif plan.searches:
            ended = search(plan, evaluate, worst)
        else:
            evaluate([case.values for case in plan.cases if not case.realisation])
    with suppress(StopEvaluation):
        while evaluate.ended != "interrupted":  # either may make another case the best
            if plan.kind != "reliability" and worst.search_next():
                continue
            if plan.convergence is not None or not (chosen := cases_to_compare(plan, evaluate.outcomes)):
                break
            evaluate.compare(chosen)
    return (unfinished_search(plan.most_cases) if evaluate.ended == "most_cases" else ended), histories


def _changes_within(plan: StudyPlan, case: int, values: tuple[Value, ...]) -> Changes:
    """Changes of a case's responses within its tolerances, by the exact derivatives of its run.

    None if it is not a run, or if a number has no derivative; the corners then follow from the sample.

    Parameters
    ----------
    plan : of the study.
    case : its number.
    values : of the varied parameters in it.
    """
    study = plan.study
    if study.analysis != "run":
        return {}
    numbers = tuple(
        SensitiveParameter(path=each.path, also=each.also, tolerance=each.tolerance)
        for each in not_none(tolerances_of(plan.scenario)).parameters
    )
    try:
        scenario = with_values(study.scenario(Case(case, values)), {("run", "sensitivities"): numbers}).recheck()
        result = solve_case(scenario, "run", entries=entries_of(study.requested, scenario))
    except BeamsimError:
        return {}
    found = result.summary.get("sensitivities", {})
    return {name: {path: (of["change_below"], of["change"]) for path, of in by.items()} for name, by in found.items()}


def _with_runs(result: StudyResult) -> StudyResult:
    """Add to a search the runs of its best design and of the unchanged scenario; other studies are returned
    unchanged."""
    if result.kind != "optimise" or not result.finished or "best" not in result.summary:
        return result
    chosen = {"best": result.summary["best"][0], "as_it_is": result.summary.get("as_it_is")}
    analysis = result.summary["analysis"]
    runs = {
        name: solve_case(design(result.scenario, case), analysis) for name, case in chosen.items() if case is not None
    }
    if stop_requested():
        return result.interrupted("the run of the best design")
    best = runs["best"]
    convergence: dict[str, Any] = {
        entry.name: best.summary[entry.name] for entry in CONVERGENCE if entry.name in best.summary
    }
    for doubts in ("doubtful", "after_divergence"):
        convergence[doubts] = _requested_doubts(result, convergence.get(doubts, ()))
    summary = result.summary | convergence
    shown = {name: of for name, of in runs.items() if isinstance(of, RunResult)}
    checked = replace(
        result,
        datasets=result.datasets | ({"runs": _runs(shown)} if shown else {}),
        summary={e.name: summary[e.name] for e in result.SUMMARY if e.name in summary},
    )
    parts = _outcomes_of_best(best, convergence["doubtful"], convergence["after_divergence"])
    return checked.with_outcome(result.outcome.copy_with(*(replace(part, context="the best design") for part in parts)))


def _outcomes_of_best(
    best: RunResult | StaticResult | SweepResult | ContinuationResult,
    unconverged: Sequence[str],
    after_divergence: Sequence[str],
) -> tuple[Outcome, ...]:
    """Outcomes of the result of the best design: why it cannot be used, or which objectives and limits are doubtful.

    Parameters
    ----------
    best : its result.
    unconverged : objectives and limits of the search that change with a finer model.
    after_divergence : those that depend on the motion after its contact sequences diverge.
    """
    outcome = best.outcome
    if not outcome.usable:
        return (outcome,)
    of_motion = (
        outcome.outcomes_with_code("contacts_diverge") + outcome.outcomes_with_code("motion_sensitive")
        if after_divergence
        else []
    )
    return (*((unconverged_outcome(best, unconverged),) if unconverged else ()), *of_motion)


def _runs(runs: Mapping[str, RunResult]) -> Dataset:
    """Dataset of the runs of designs: motion of the first probe, and force of the stop with the largest force."""
    times = [run["histories"]["time"].values for run in runs.values()]
    motions = [next(iter(run["histories"].by_label("displacement").items())) for run in runs.values()]
    hit = [_largest_contact_force(run["histories"].by_label("snubber_force")) for run in runs.values()]
    forces = [
        np.full(x.size, np.nan) if force is None else force.values for x, (_, force) in zip(times, hit, strict=True)
    ]
    units = dict.fromkeys(force.unit for _, force in hit if force is not None)
    values = {
        "design": list(runs),
        "probe": [name for name, _ in motions],
        "snubber": [name for name, _ in hit],
        "sample": 1 + np.arange(sum(x.size for x in times)),
        "sample_design": np.repeat(np.arange(len(runs)), [x.size for x in times]),
        "time": np.concatenate(times),
        "displacement": np.concatenate([motion.values for _, motion in motions]),
        "force": np.concatenate(forces) if units else None,
    }
    return RUNS.dataset(values, force_unit=" | ".join(units))


def _largest_contact_force(forces: Mapping[str, LabelledArray]) -> tuple[str, LabelledArray | None]:
    """The snubber with the largest force, and its force; an empty name and None without one."""
    return max(forces.items(), key=lambda item: float(np.max(np.abs(item[1].values))), default=("", None))


def _requested_doubts(result: StudyResult, values: Iterable[str]) -> list[str]:
    """Those of the values (entry.place) that are objectives or limits of a search."""
    asked = {_of_entry(name) for aim in objectives(result.scenario) for name, _ in aim.terms}
    asked |= {parse_limit(name)[0].entry for name in result["cases"].labels("limit")}
    return [key for key in values if key.partition(".")[0] in asked]
