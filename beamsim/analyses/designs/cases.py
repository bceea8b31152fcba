"""One case of a design study: from parameter values to responses.

A case is sent to its worker as the scenario as it was written and the values to replace in it, so that every worker, on
this machine or another, computes the same numbers.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from beamsim.analyses.designs.realisations import Realisations
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
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path
from beamsim.scenario.parameters import Value, with_values
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds


@dataclass(frozen=True)
class Case:
    """One case of a study."""

    number: int  # from 0
    values: tuple[Value, ...]  # of each varied parameter
    realisation: int = 0  # within the tolerances; 0 is the case itself


@dataclass(frozen=True)
class Study:
    """What the cases of a study share."""

    analysis: str
    case: Scenario  # as it was written
    places: tuple[tuple[Path, ...], ...]  # of each varied parameter
    realisations: Realisations
    asked: tuple[str, ...]  # responses; empty for all
    fingerprint: str

    def scenario(self, case: Case) -> Scenario:
        """The scenario of a case; raises a ScenarioError if it is invalid."""
        given = {place: value for at, value in zip(self.places, case.values, strict=True) for place in at}
        scenario = with_values(self.case, given)
        if case.realisation:
            scenario = with_values(scenario, self.realisations.values(scenario, case.realisation))
        return scenario.rechecked()


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

    def __init__(self, study: Study, stop: Stop = never) -> None:
        self.study = study
        self.stop = stop
        self.shared = SharedBuilds()

    def solve(self, case: Case) -> CaseOutcome:
        """Solve one case, unless it is to stop; an error becomes part of the outcome, so that other cases continue."""
        begin = clock.thread_time()
        try:
            values, outcome = ANALYSES[self.study.analysis](self.study.scenario(case), self)
        except BeamsimError as error:
            values, outcome = {}, _failed("; ".join(str(error).splitlines()))
        except (ArithmeticError, ValueError, RuntimeError) as error:
            values, outcome = {}, _failed(f"internal error ({type(error).__name__}: {error})")
        values = {name: value for name, value in values.items() if is_asked(name, self.study.asked)}
        return CaseOutcome(case.number, values if outcome.complete else {}, outcome, clock.thread_time() - begin)


def _failed(reason: str) -> Outcome:
    return Outcome.of(OutcomeKind.FAILED, "failed", reason)


_SOLVERS: dict[str, CaseSolver] = {}  # of the study that this worker process is computing


def solve_case(study: Study, case: Case) -> CaseOutcome:
    """Solve one case in a worker process, which keeps what the cases of a study share."""
    solver = _SOLVERS.get(study.fingerprint)
    if solver is None:  # threads of a cluster's worker may come here at once, each with a solver that gives the same
        solver = CaseSolver(study)
        _SOLVERS.clear()
        _SOLVERS[study.fingerprint] = solver
    return solver.solve(case)


def published(kind: str) -> Callable[..., Any]:
    """The function of a scenario that computes a result of a kind for everybody."""
    computing: Callable[..., Any] = named(KINDS[kind].analysis)
    return computing


def _run(scenario: Scenario, solver: CaseSolver) -> tuple[Responses, Outcome]:
    if gives_figures(scenario):
        asked = entries_of(solver.study.asked, scenario.excitation.kind)
        system = build_system(scenario, solver.shared, assessed=False, recovered=needs_recovery(asked))
        figures, outcome = asked_figures(system, scenario, asked, solver.stop)
        return run_responses(figures), outcome
    result = published("run")(scenario, stop=solver.stop)
    return run_responses(entries_of_result(result)), result.outcome


def _sweep(scenario: Scenario, solver: CaseSolver) -> tuple[Responses, Outcome]:
    result = published("sweep")(scenario, stop=solver.stop)
    return sweep_responses(result), result.outcome


def _continuation(scenario: Scenario, solver: CaseSolver) -> tuple[Responses, Outcome]:
    result = published("continuation")(scenario, stop=solver.stop)
    return continuation_responses(result), result.outcome


ANALYSES: dict[str, Callable[[Scenario, CaseSolver], tuple[Responses, Outcome]]] = {
    "run": _run, "swept_sine": _sweep, "stepped": _sweep, "continuation": _continuation
}  # fmt: skip
"""Responses and outcome of a case by its analysis: a run, or the kind of sweep."""
