"""Cases of a study, solved in batches by workers that stay: what plain studies, searches and reliability ask."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any, Self

from beamsim.analyses.designs.plan import Case, Study
from beamsim.analyses.designs.responses import Responses, entries_of, is_asked, responses_of_result, run_responses
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.analyses.parallel import working
from beamsim.analyses.run.asked import asked_figures, gives_figures, needs_recovery
from beamsim.analyses.values import Margins
from beamsim.errors import BeamsimError, ScenarioError
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import Value
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds

THREADED = ("run", "swept_sine")  # analyses whose time is spent in compiled code, which threads execute side by side


def unsettled(tried: int) -> Outcome:
    """The outcome of a search that ended while better designs were still found."""
    sentence = f"the search ended after {tried} designs while it still found better ones"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy="give more most_cases", tried=tried
    )


class Ended(Exception):
    """What was asked for is not all known; the block of the `Evaluator` ends."""


class Evaluator:
    """Solves cases of one study in batches, by workers that stay for all of them: a context manager to be called.

    Cases are numbered in the order in which they are asked for, so that a search that depends on nothing but outcomes
    asks for the same ones again when it is resumed. After a stop, or beyond the number of cases that is allowed, the
    call ends the block; what is known by then is in `outcomes`.

    Parameters
    ----------
    study : that the cases belong to.
    workers, scheduler, known, stop : as of `beamsim.analyses.designs.analysis.design_study`.
    each : called with every new outcome, in the order of completion.
    most : number of cases that are allowed, each with all of its realisations.

    Raises
    ------
    ScenarioError
        If there are fewer workers than one.
    NotTrustedError
        If workers end unexpectedly.
    """

    def __init__(
        self, study: Study, *, workers: int | None = None, scheduler: str | None = None,
        known: Iterable[CaseOutcome] = (), each: Callable[[CaseOutcome], None] | None = None, stop: Stop = never,
        most: int,
    ) -> None:  # fmt: skip
        if workers is not None and workers < 1:
            raise ScenarioError.at("workers", f"= {workers} is no number of workers", "give 1 or more, or leave it out")
        self.study, self.most = study, most
        self.rows: list[tuple[Value, ...]] = []  # the values of every case that was asked for, by its number
        self.outcomes: dict[int, CaseOutcome] = {}  # of these, by index: realisations of a case follow each other
        self.ended = ""  # "interrupted", or "most_cases" where more were asked for than are allowed
        self._known = {outcome.index: outcome for outcome in known}
        self._each, self._stop = each, stop
        self._asked_workers, self._scheduler = workers, scheduler
        self._open = ExitStack()
        self._solved: Callable[[Sequence[Case]], Iterator[CaseOutcome]] | None = None  # once there are workers

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> bool:
        if kind is Ended:
            self._open.close()
            return True
        return bool(self._open.__exit__(kind, error, trace))

    def __call__(self, rows: Sequence[tuple[Value, ...]]) -> list[list[CaseOutcome]]:
        """The outcomes of all realisations of cases, each given by the values of the varied parameters."""
        first, count = len(self.rows), self.study.realisations.count
        self.rows += rows[: self.most - first]
        batch = range(first, len(self.rows))
        cases = [Case(k * count + r, self.rows[k], r) for k in batch for r in range(count)]
        known = [self._known[case.number] for case in cases if case.number in self._known]
        self.outcomes |= {
            outcome.index: outcome for outcome in known if outcome.given == self.rows[outcome.index // count]
        }
        missing = [case for case in cases if case.number not in self.outcomes]
        for outcome in self._workers()(missing) if missing else ():
            if outcome.outcome.interrupted:
                continue
            self.outcomes[outcome.index] = outcome
            if self._each is not None:
                self._each(outcome)
        if any(case.number not in self.outcomes for case in cases):
            self.ended = "interrupted"
        elif len(batch) < len(rows):
            self.ended = "most_cases"
        if self.ended:
            raise Ended
        return [[self.outcomes[k * count + r] for r in range(count)] for k in batch]

    def _workers(self) -> Callable[[Sequence[Case]], Iterator[CaseOutcome]]:
        """What solves cases in the order of completion; there are no more workers than cases that are not known."""
        if self._solved is None:
            unknown = self.most * self.study.realisations.count - len(self._known)
            workers = working(
                lambda ending: CaseSolver(self.study, ending).solve, partial(solve_case, self.study), unknown,
                self._stop, workers=self._asked_workers, scheduler=self._scheduler,
                threaded=self.study.analysis in THREADED,
            )  # fmt: skip
            self._solved = self._open.enter_context(workers)
        return self._solved


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
        return CaseOutcome(case.number, values if outcome.complete else {}, outcome, time, ranges, case.values)

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
