"""One case of a design study: from parameter values to responses.

A case is sent to its worker as the scenario as it was written and the values to replace in it, so that every worker, on
this machine or another, computes the same numbers.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from beamsim.analyses.designs.responses import (
    Responses,
    continuation_responses,
    entries_of,
    entries_of_result,
    is_asked,
    run_responses,
    sweep_responses,
)
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.analyses.run.asked import asked_figures, gives_figures, needs_recovery
from beamsim.errors import BeamsimError, Problem, ScenarioError
from beamsim.interrupts import Stop, never
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeCode
from beamsim.scenario import Scenario, SpectrumSettings
from beamsim.scenario.parameters import with_values
from beamsim.scenario.sweep import SteppedSine, SweptSine
from beamsim.scenario.varied import Value
from beamsim.system.build import build_system
from beamsim.system.shared import SharedBuilds

SHORT = 0.01  # share of the range that is followed in a warm-up

Place = tuple[str | int, ...]


@dataclass(frozen=True)
class Study:
    """What the cases of a study share."""

    analysis: str
    case: Scenario  # as it was written
    places: tuple[tuple[Place, ...], ...]  # of each parameter
    asked: tuple[str, ...] = ()  # responses; empty for all
    fingerprint: str = ""

    def scenario(self, values: Sequence[Value]) -> Scenario:
        """The scenario with values of the first parameters, or of all; raises a ScenarioError if it is invalid."""
        given = {place: value for at, value in zip(self.places, values, strict=False) for place in at}
        return with_values(self.case, given).rechecked()


@dataclass(frozen=True)
class CaseTask:
    """Data of one case for a worker."""

    index: int
    study: Study
    values: tuple[Value, ...]  # of each parameter


@dataclass(frozen=True)
class Analysis:
    """How a case is solved."""

    solve: Callable[[Scenario, CaseSolver, Stop], tuple[Responses, Outcome]]  # responses and outcome
    rehearse: Callable[[Scenario], object]  # a short case that compiles all functions needed


def analysis_of(scenario: Scenario) -> str:
    """Analysis of each case: its sweep, else its run."""
    kind = "run" if scenario.sweep is None else str(scenario.sweep.kind)
    if kind not in ANALYSES:
        raise ScenarioError(
            Problem("sweep.kind", f"= {kind} cannot be combined with vary", f"use one of {', '.join(ANALYSES)}")
        )
    if kind == "run" and scenario.run is None:
        raise ScenarioError(
            Problem("run", "is missing", "add for example `run: {duration: 1 s}`; without sweep every case is a run")
        )
    return kind


class CaseSolver:
    """Solves the cases of one study; what they share is built once. May be used by several threads."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self.shared = SharedBuilds()

    def solve(self, task: CaseTask, stop: Stop = never) -> CaseOutcome:
        """Solve one case, unless it is to stop; an error becomes part of the outcome, so that other cases continue."""
        begin = clock.thread_time()
        try:
            scenario = self.study.scenario(task.values)
            values, outcome = ANALYSES[self.study.analysis].solve(scenario, self, stop)
        except BeamsimError as error:
            values, outcome = {}, Outcome.of(OutcomeCode.FAILED, reason="; ".join(str(error).splitlines()))
        except (ArithmeticError, ValueError, RuntimeError) as error:
            reason = f"internal error ({type(error).__name__}: {error})"
            values, outcome = {}, Outcome.of(OutcomeCode.FAILED, reason=reason)
        values = {name: value for name, value in values.items() if is_asked(name, self.study.asked)}
        return CaseOutcome(task.index, values if outcome.complete else {}, outcome, clock.thread_time() - begin)


def solve_case(task: CaseTask) -> CaseOutcome:
    """Solve one case in a worker process, which keeps what the cases of a study share."""
    return _solver(task.study).solve(task)


_SOLVERS: dict[str, CaseSolver] = {}  # of the study that this worker is computing


def _solver(study: Study) -> CaseSolver:
    solver = _SOLVERS.get(study.fingerprint)
    if solver is None:  # threads of a cluster's worker may come here at once, each with a solver that gives the same
        solver = CaseSolver(study)
        _SOLVERS.clear()
        _SOLVERS[study.fingerprint] = solver
    return solver


def warm_up(task: CaseTask | None) -> None:
    """Import the modules that a case needs and compile them (or load the compiled code)."""
    if task is not None:
        try:
            ANALYSES[task.study.analysis].rehearse(task.study.scenario(task.values))
        except BeamsimError:
            return  # reported when the case is solved


def published(kind: str) -> Callable[..., Any]:
    """The function of a scenario that computes a result of a kind for everybody."""
    computing: Callable[..., Any] = named(KINDS[kind].analysis)
    return computing


def _solve_run(scenario: Scenario, solver: CaseSolver, stop: Stop) -> tuple[Responses, Outcome]:

    settings = scenario.run
    assert settings is not None
    if gives_figures(scenario):
        asked = entries_of(solver.study.asked, scenario.excitation.kind)
        system = build_system(scenario, solver.shared, assessed=False, recovered=needs_recovery(asked))
        figures, outcome = asked_figures(system, scenario, asked, stop)
        return run_responses(figures), outcome
    result = published("run")(scenario, stop=stop)
    return run_responses(entries_of_result(result)), result.outcome


def _rehearse_run(scenario: Scenario) -> object:
    settings = scenario.run
    assert settings is not None
    short = min(settings.duration, max(1e-3 * settings.duration, 50.0 / scenario.sample_rate))
    settings = settings.model_copy(update={"duration": short, "spectrum": SpectrumSettings()})
    return published("run")(scenario.model_copy(update={"run": settings}))


def _solve_sweep(scenario: Scenario, solver: CaseSolver, stop: Stop) -> tuple[Responses, Outcome]:
    result = published("sweep")(scenario, stop=stop)
    return sweep_responses(result), result.outcome


def _rehearse_sweep(scenario: Scenario) -> object:
    settings = scenario.sweep
    assert isinstance(settings, (SweptSine, SteppedSine))
    change: dict[str, object] = {"to": 1.01 * settings.from_, "levels": settings.levels[:1], "direction": "up"}
    if settings.kind == "stepped":
        change["points"] = 2
    return published("sweep")(scenario.model_copy(update={"sweep": settings.model_copy(update=change)}))


def _solve_response(scenario: Scenario, solver: CaseSolver, stop: Stop) -> tuple[Responses, Outcome]:
    result = published("continuation")(scenario, stop=stop)
    return continuation_responses(result), result.outcome


def _rehearse_response(scenario: Scenario) -> object:
    settings: Any = scenario.sweep
    path = settings.parameter
    short = path.from_ + SHORT * (path.to - path.from_)
    change: dict[str, object] = {"levels": settings.levels[:1], "overlay": None, "follow_folds_in": None}
    if settings.continue_in is None:
        change["to"] = short
    else:
        change["continue_in"] = path.model_copy(update={"to": short})
    return published("continuation")(scenario.model_copy(update={"sweep": settings.model_copy(update=change)}))


ANALYSES: dict[str, Analysis] = {
    "run": Analysis(_solve_run, _rehearse_run),
    "swept_sine": Analysis(_solve_sweep, _rehearse_sweep),
    "stepped": Analysis(_solve_sweep, _rehearse_sweep),
    "continuation": Analysis(_solve_response, _rehearse_response),
}
"""Analyses of a case by name: a run, or the kind of sweep."""
