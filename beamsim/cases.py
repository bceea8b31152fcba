"""Cases of a study and their outcomes, solved in batches by a function that the caller supplies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

from beamsim.outcomes import COMPLETE, Outcome, OutcomeKind
from beamsim.results.values import Margins
from beamsim.scenario.studies import Value
from beamsim.typing import Bools


@dataclass(frozen=True)
class Case:
    """One case of a study."""

    number: int  # from 0
    values: tuple[Value, ...]  # of each varied parameter
    realisation: int = 0  # within the tolerances; 0 is the case itself
    compared: bool = False  # whether its values are compared with those of a finer model
    within: int = -1  # of a further realisation: the number of the case within whose tolerances it is
    deviations: tuple[float, ...] = ()  # of a further realisation, as shares of the tolerances


@dataclass(frozen=True)
class CaseOutcome:
    """One case, as a command has it that solves the case alone: responses, outcome, warnings and margins."""

    index: int  # in the order of the cases
    values: Mapping[str, float | list[float]]  # by name of the response; lists are per mode; none where it failed
    outcome: Outcome = COMPLETE
    processor_time_s: float = 0.0
    margins: Margins = field(default_factory=dict)
    given: tuple[Value, ...] = ()  # values of the varied parameters
    warnings: tuple[str, ...] = ()
    compared: bool = False  # whether its values were compared with those of a finer model
    within: int = -1  # as of its `Case`
    deviations: tuple[float, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether it did not come to its end, so that it has no responses."""
        return self.outcome.ended_early


def failed_case(case: Case, reason: str) -> CaseOutcome:
    """The outcome of a case that could not be solved."""
    outcome = Outcome.of(OutcomeKind.FAILED, "failed", reason)
    return CaseOutcome(case.number, {}, outcome, given=case.values, compared=case.compared)


class StopEvaluation(Exception):
    """Raised to leave the block of the `Evaluator` when not all requested cases could be solved."""


class Evaluator:
    """Solves cases in batches, by workers that stay for all of them: a context manager to be called.

    Cases are numbered in the order in which they are asked for, so that a search that depends on nothing but outcomes
    asks for the same ones again when it is resumed. After a stop, or beyond the number of cases that is allowed, the
    call ends the block; what is known by then is in `outcomes`.

    Parameters
    ----------
    solving : gives what solves cases, from `beamsim.parallel.worker_pool`; entered when the first one is solved.
    most : number of cases that are allowed, each with all of its realisations.
    realisations : of each case.
    compared : whether each case is compared with a finer model.
    most_further : number of further realisations that are allowed, of all cases together.
    known, each : as of `beamsim.trust.studies.design_study`.
    """

    def __init__(
        self, solving: AbstractContextManager[Callable[[Iterable[Case]], Iterator[CaseOutcome]]], *, most_cases: int,
        realisations: int = 1, with_finer_model: bool = False, most_further: int = 0,
        solved_before: Iterable[CaseOutcome] = (), on_outcome: Callable[[CaseOutcome], None] | None = None,
    ) -> None:  # fmt: skip
        self.most = most_cases
        self.rows: list[tuple[Value, ...]] = []  # the values of every case that was asked for, by its number
        self.outcomes: dict[int, CaseOutcome] = {}  # of these, by index: realisations of a case follow each other
        self.ended = ""  # "interrupted", or "most_cases" where more were asked for than are allowed
        self._known = {(outcome.index, outcome.compared): outcome for outcome in solved_before}
        self._each, self._count, self._solving, self._open = on_outcome, realisations, solving, ExitStack()
        self._compared, self._most_further = with_finer_model, most_further
        self.further: dict[int, Case] = {}  # further realisations of cases, by number

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> bool:
        if kind is StopEvaluation:
            self._open.close()
            return True
        return bool(self._open.__exit__(kind, error, trace))

    def __call__(self, rows: Sequence[tuple[Value, ...]]) -> list[list[CaseOutcome]]:
        """The outcomes of all realisations of cases, each given by the values of the varied parameters."""
        first, count = len(self.rows), self._count
        self.rows += rows[: self.most - first]
        batch = range(first, len(self.rows))
        if not self._solve([self._case(k * count + r, self._compared) for k in batch for r in range(count)]):
            self.ended = "interrupted"
        elif len(batch) < len(rows):
            self.ended = "most_cases"
        if self.ended:
            raise StopEvaluation
        return [[self.outcomes[k * count + r] for r in range(count)] for k in batch]

    def compare(self, indices: Sequence[int]) -> None:
        """Solve cases again, now compared with a finer model: these outcomes take the place of the others.

        Parameters
        ----------
        indices : of realisations of cases that were asked for.
        """
        if not self._solve([self._case(index, with_finer_model=True) for index in indices]):
            self.ended = "interrupted"
            raise StopEvaluation

    @property
    def room(self) -> int:
        """Number of further realisations that are still allowed."""
        return self._most_further - len(self.further)

    def solve_realisations(self, case: int, deviations: Sequence[tuple[float, ...]]) -> list[CaseOutcome]:
        """The outcomes of further realisations of a case that was asked for.

        They are numbered after all realisations of all cases that are allowed.

        Parameters
        ----------
        case : its number.
        deviations : of each realisation, as shares of the tolerances; no more than there is `room` for.
        """
        first, values = self.most * self._count + len(self.further), self.rows[case]
        new = {first + k: Case(first + k, values, 0, self._compared, case, each) for k, each in enumerate(deviations)}
        self.further |= new
        if not self._solve(list(new.values())):
            self.ended = "interrupted"
            raise StopEvaluation
        return [self.outcomes[number] for number in new]

    def _case(self, index: int, with_finer_model: bool) -> Case:
        if index in self.further:
            return replace(self.further[index], compared=with_finer_model)
        return Case(index, self.rows[index // self._count], index % self._count, with_finer_model)

    def _solve(self, cases: Sequence[Case]) -> bool:
        """Find the outcomes of cases, and say whether all are found: a stop prevents some."""
        missing = dict[int, Case]()
        for case in cases:
            known = self._known.get((case.number, case.compared))
            if known is not None and (known.given, known.deviations) == (case.values, case.deviations):
                self.outcomes[case.number] = known
            else:
                missing[case.number] = case
        for outcome in self._outcomes(list(missing.values())) if missing else ():
            if outcome.outcome.interrupted:
                continue
            case = missing.pop(outcome.index)
            found = replace(outcome, compared=case.compared, within=case.within, deviations=case.deviations)
            self.outcomes[found.index] = found
            if self._each is not None:
                self._each(found)
        return not missing

    @cached_property
    def _outcomes(self) -> Callable[[Iterable[Case]], Iterator[CaseOutcome]]:
        return self._open.enter_context(self._solving)


def probability(holds: Bools) -> dict[str, Any]:
    """Share of the cases in which something holds, with the 95 % interval of its probability (Clopper and Pearson)."""
    from scipy.stats import binomtest

    test = binomtest(int(holds.sum()), holds.size)
    interval = test.proportion_ci(0.95)
    return {"share": test.statistic, "low": float(interval.low), "high": float(interval.high), "cases": holds.size}
