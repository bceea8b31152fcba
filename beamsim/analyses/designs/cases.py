"""Cases of a study, solved in batches by workers that stay: what plain studies, searches and reliability ask."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import cached_property
from typing import Any, Self

from beamsim.analyses.designs.plan import Case, Study
from beamsim.analyses.designs.responses import Responses, entries_of, means, responses_of_result, run_responses
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.analyses.run.asked import asked_figures, gives_figures, needs_recovery
from beamsim.analyses.values import Margins
from beamsim.errors import BeamsimError
from beamsim.kinds import KINDS, named
from beamsim.outcomes import Outcome, OutcomeKind, Stop, never
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import Value
from beamsim.system.build import build_system
from beamsim.system.parts import SharedBuilds


def unsettled(tried: int) -> Outcome:
    """The outcome of a search that ended while better designs were still found."""
    sentence = f"the search ended after {tried} designs while it still found better ones"
    return Outcome.of(
        OutcomeKind.DOUBTFUL, "search_not_converged", sentence, remedy="give more most_cases", tried=tried
    )


class Ended(Exception):
    """What was asked for is not all known; the block of the `Evaluator` ends."""


class Evaluator:
    """Solves cases in batches, by workers that stay for all of them: a context manager to be called.

    Cases are numbered in the order in which they are asked for, so that a search that depends on nothing but outcomes
    asks for the same ones again when it is resumed. After a stop, or beyond the number of cases that is allowed, the
    call ends the block; what is known by then is in `outcomes`.

    Parameters
    ----------
    solving : gives what solves cases, from `beamsim.analyses.parallel.working`; entered when the first one is solved.
    most : number of cases that are allowed, each with all of its realisations.
    realisations : of each case.
    known, each : as of `beamsim.analyses.designs.analysis.design_study`.
    """

    def __init__(
        self, solving: AbstractContextManager[Callable[[Iterable[Case]], Iterator[CaseOutcome]]], *, most: int,
        realisations: int = 1, known: Iterable[CaseOutcome] = (), each: Callable[[CaseOutcome], None] | None = None,
    ) -> None:  # fmt: skip
        self.most = most
        self.rows: list[tuple[Value, ...]] = []  # the values of every case that was asked for, by its number
        self.outcomes: dict[int, CaseOutcome] = {}  # of these, by index: realisations of a case follow each other
        self.ended = ""  # "interrupted", or "most_cases" where more were asked for than are allowed
        self._known = {outcome.index: outcome for outcome in known}
        self._each, self._count, self._solving, self._open = each, realisations, solving, ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> bool:
        if kind is Ended:
            self._open.close()
            return True
        return bool(self._open.__exit__(kind, error, trace))

    def __call__(self, rows: Sequence[tuple[Value, ...]]) -> list[list[CaseOutcome]]:
        """The outcomes of all realisations of cases, each given by the values of the varied parameters."""
        first, count = len(self.rows), self._count
        self.rows += rows[: self.most - first]
        batch = range(first, len(self.rows))
        cases = [Case(k * count + r, self.rows[k], r) for k in batch for r in range(count)]
        known = [self._known[case.number] for case in cases if case.number in self._known]
        self.outcomes |= {
            outcome.index: outcome for outcome in known if outcome.given == self.rows[outcome.index // count]
        }
        missing = [case for case in cases if case.number not in self.outcomes]
        for outcome in self._solved(missing) if missing else ():
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

    @cached_property
    def _solved(self) -> Callable[[Iterable[Case]], Iterator[CaseOutcome]]:
        return self._open.enter_context(self._solving)


class CaseSolver:
    """Solves the cases of one study; what they share is built once."""

    def __init__(self, study: Study, stop: Stop = never) -> None:
        self.study = study
        self.stop = stop
        self.shared = SharedBuilds()

    def __call__(self, case: Case) -> CaseOutcome:
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
        if asked := self.study.asked:
            values = {name: x for name, x in values.items() if any(means(each, name) for each in asked)}
        time = clock.thread_time() - begin
        return CaseOutcome(case.number, values if outcome.complete else {}, outcome, time, ranges, case.values)

    def _responses(self, scenario: Scenario) -> tuple[Responses, Outcome, Mapping[str, Sequence[float]]]:
        """Of a run the values that are asked for, if they can be had alone; else those of the whole result."""
        analysis = self.study.analysis
        if analysis == "run" and gives_figures(scenario):
            asked = entries_of(self.study.asked, scenario)
            system = build_system(scenario, self.shared, recovered=needs_recovery(asked))
            figures, outcome = asked_figures(system, asked, self.stop)
            return run_responses(figures), outcome, {}
        kind = analysis if analysis in KINDS else "sweep"
        result: Any = named(KINDS[kind].analysis)(scenario, stop=self.stop)
        margins: Margins = result.summary.get("margins", {})
        ends = {name: (x["lowest"], x["highest"]) for name, x in margins.items() if x["lowest"] != x["highest"]}
        ranges = {name: (low, high) if low < high else (-math.inf, math.inf) for name, (low, high) in ends.items()}
        return responses_of_result(result), result.outcome, ranges
