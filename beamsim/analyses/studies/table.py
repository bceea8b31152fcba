"""A study as one table: responses, dense over case × realisation, and how the cases do by its limits and objectives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.studies.objectives import (
    Objective,
    deciding_realisations,
    deciding_values,
    objectives,
    of_realisation,
)
from beamsim.analyses.studies.plan import StudyPlan
from beamsim.cases import CaseOutcome
from beamsim.outcomes import OutcomeKind, Verdict
from beamsim.results.values import margin_of
from beamsim.typing import Bools, Floats, Ints

SAMPLES = ("latin_hypercube", "sobol", "draws")  # kinds of studies that have statistics
MOST_BEST = 10
WIDE_GAP = 0.08  # of the length of a front: a wider gap between neighbours is searched and named
MOST_COMPARED = 1  # histories of a study of reliability that are compared, by limit
UNKNOWN_MARGIN = {"value": math.nan, "lowest": math.nan, "highest": math.nan, "verdict": Verdict.NOT_RELIABLE.value}
"""The margin of a case that is missing or has none."""


class LimitColumns(NamedTuple):
    """The columns of one limit, (cases, realisations)."""

    limit: float  # SI
    value: Floats  # that is compared with it, SI; nan where it is not known
    low: Floats  # the value less its change with a finer model
    high: Floats  # plus it
    verdict: NDArray[np.str_]
    deciding: Ints  # (cases,) realisation by which the case is judged

    def of_cases(self, column: Any) -> Any:
        """(cases,) a column at the realisations by which the cases are judged."""
        return of_realisation(column, self.deciding)


@dataclass(frozen=True)
class StudyTable:
    """The known cases of a study. Columns are (cases, realisations), and (cases,) where they are of whole cases.

    Parameters
    ----------
    plan : of the study.
    outcomes : by index, the realisations of a case after each other; may be those of some cases only.
    """

    plan: StudyPlan
    outcomes: Mapping[int, CaseOutcome]

    @property
    def count(self) -> int:
        """Number of realisations of each case in the sample, the case itself among them."""
        return self.plan.study.realisations.count

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Number of cases and of realisations of each, further ones included."""
        cases, width = self.places.shape
        return cases, width

    @cached_property
    def further_realisations(self) -> dict[int, list[CaseOutcome]]:
        """By case its further realisations, with which its worst was searched, in the order of their solution."""
        found: dict[int, list[CaseOutcome]] = {}
        for index in sorted(self.outcomes):
            if self.outcomes[index].deviations:
                found.setdefault(self.outcomes[index].within, []).append(self.outcomes[index])
        return found

    @cached_property
    def order(self) -> Ints:
        """(n,) index of the outcome at each place: those of the sample, then further ones."""
        further = [outcome.index for of in self.further_realisations.values() for outcome in of]
        return np.append(np.arange(len(self.plan.cases)), further).astype(np.int64)

    @cached_property
    def places(self) -> Ints:
        """(cases, realisations) where each outcome is in the order.

        A case with fewer further realisations than another one has the case itself in their place.
        """
        places = np.arange(len(self.plan.cases)).reshape(-1, self.count)
        more = np.repeat(places[:, :1], max(map(len, self.further_realisations.values()), default=0), axis=1)
        last = places.size
        for case, of in self.further_realisations.items():
            more[case, : len(of)] = last + np.arange(len(of))
            last += len(of)
        return np.hstack([places, more])

    @cached_property
    def _at(self) -> dict[int, int]:
        """Position of each outcome in the order, by its index."""
        return {index: place for place, index in enumerate(self.order.tolist())}

    def case_of(self, index: int) -> int:
        """The number of the case that an outcome belongs to."""
        return self.outcomes[index].within if self.outcomes[index].deviations else index // self.count

    def outcome(self, case: int, realisation: int) -> CaseOutcome:
        """One outcome of a case."""
        return self.outcomes[int(self.order[self.places[case, realisation]])]

    # Responses and outcomes

    @cached_property
    def every_response(self) -> dict[str, Floats]:
        """All responses by name, some with modes along a last axis; nan where there is none."""
        columns: dict[str, Floats] = {}
        for index in sorted(self.outcomes):
            for name, value in self.outcomes[index].values.items():
                if name not in columns:
                    columns[name] = np.full((self.order.size, *np.shape(value)), np.nan)
                columns[name][self._at[index]] = value
        return {name: column[self.places] for name, column in columns.items()}

    @cached_property
    def responses(self) -> dict[str, Floats]:
        """The responses that are one number each."""
        return {name: column for name, column in self.every_response.items() if column.ndim == 2}

    @cached_property
    def nominal(self) -> dict[str, Floats]:
        """(cases,) the same of the cases as they are, without tolerances."""
        return {name: column[:, 0] for name, column in self.responses.items()}

    def fulfils(self, condition: Callable[[CaseOutcome], bool]) -> Bools:
        """(cases,) True where the outcome is known and fulfils a condition."""
        holds = np.zeros(self.order.size, dtype=bool)
        holds[[self._at[index] for index, outcome in self.outcomes.items() if condition(outcome)]] = True
        return np.asarray(holds[self.places])

    @cached_property
    def known(self) -> Bools:
        """(cases,) True where the outcome is known, solved or failed."""
        return self.fulfils(lambda _: True)

    @cached_property
    def solved(self) -> Bools:
        """(cases,) which have responses in all realisations."""
        return np.asarray(self.fulfils(lambda outcome: not outcome.failed).all(axis=1))

    @cached_property
    def usable(self) -> Bools:
        """(cases,) which of these are computed as a whole and reliable."""
        return np.asarray(self.fulfils(lambda outcome: outcome.outcome.usable).all(axis=1))

    @cached_property
    def compared(self) -> Bools:
        """(cases,) which are compared with a finer model, in some realisation."""
        return np.asarray(self.fulfils(lambda outcome: outcome.compared).any(axis=1))

    @cached_property
    def gravest_outcomes(self) -> list[CaseOutcome | None]:
        """(cases,) of each the first of the realisations whose outcomes are the gravest; None where none is known."""
        grave = list(OutcomeKind)
        rows = ([self.outcomes.get(index) for index in of] for of in self.order[self.places].tolist())
        known = ([of for of in row if of is not None] for row in rows)
        return [max(row, key=lambda of: grave.index(of.outcome.gravest_kind), default=None) for row in known]

    @cached_property
    def failures(self) -> dict[int, CaseOutcome]:
        """By case the first of its realisations that failed."""
        first: dict[int, CaseOutcome] = {}
        for index in sorted(self.outcomes):
            if self.outcomes[index].failed:
                first.setdefault(self.case_of(index), self.outcomes[index])
        return first

    @cached_property
    def drawn(self) -> Bools:
        """(cases,) which are known and independent draws of the varied numbers; of Sobol' those of samples A and B."""
        cases, count = self.shape
        if self.plan.kind not in SAMPLES or count > 1:
            return np.zeros(cases, dtype=bool)
        independent = 2 * cases // (len(self.plan.parameters) + 2)
        return self.known[:, 0] & (self.plan.kind != "sobol" or np.arange(cases) < independent)

    # Limits

    @cached_property
    def limits(self) -> dict[str, LimitColumns]:
        """The columns of every limit by its name."""
        given = {} if self.plan.scenario.limits is None else self.plan.scenario.limits.values_by_name
        return {name: self._columns_of(name, limit) for name, limit in given.items()}

    def _columns_of(self, name: str, limit: float) -> LimitColumns:
        items = [UNKNOWN_MARGIN] * self.order.size
        for index, outcome in self.outcomes.items():
            items[self._at[index]] = {**UNKNOWN_MARGIN, **outcome.margins.get(name, {})}
        value, low, high = (
            np.array([item[key] for item in items], dtype=float)[self.places] for key in ("value", "lowest", "highest")
        )
        verdict = np.array([item["verdict"] for item in items], dtype=np.str_)[self.places]
        quantile = self.plan.study.realisations.quantile
        return LimitColumns(
            limit, value, low, high, verdict, deciding_realisations(value, quantile, large_is_good=False)
        )

    @cached_property
    def margins(self) -> dict[str, Floats]:
        """(cases,) limit / value - 1 by limit."""
        return {
            name: np.array([margin_of(of.limit, value) for value in of.of_cases(of.value).tolist()], dtype=float)
            for name, of in self.limits.items()
        }

    @cached_property
    def meets(self) -> Bools:
        """Whether every limit is surely met, with the change of its value by a finer model."""
        met = [of.verdict == Verdict.MET for of in self.limits.values()]
        return np.asarray(np.all([np.ones(self.shape, dtype=bool), *met], axis=0))

    @cached_property
    def passing(self) -> Bools:
        """(cases,) which are reliable and meet every limit."""
        met = [of.of_cases(of.verdict) == Verdict.MET for of in self.limits.values()]
        return np.asarray(np.all([self.usable, *met], axis=0))

    @cached_property
    def passing_shares(self) -> Floats | None:
        """(cases,) share of the sample that meets every limit; None without limits or tolerances."""
        return self.meets[:, : self.count].mean(axis=1) if self.limits and self.count > 1 else None

    # Objectives

    @cached_property
    def aims(self) -> list[tuple[Objective, Floats | None]]:
        """The objectives, each with (cases,) values, as the realisations judge it; None where there are none."""
        quantile, aims = self.plan.study.realisations.quantile, []
        for aim in objectives(self.plan.scenario):
            values = aim.of(self.responses)
            aims.append(
                (aim, None if values is None else deciding_values(values, quantile, large_is_good=aim.maximised))
            )
        return aims

    @property
    def unknown_aim(self) -> bool:
        """Whether an objective is a response that no case has."""
        return any(aim.terms and values is None for aim, values in self.aims)

    @cached_property
    def objectives(self) -> dict[str, Floats]:
        """(cases,) values of the objectives that are known by name."""
        return {aim.name: values for aim, values in self.aims if values is not None}

    @cached_property
    def candidates(self) -> Bools:
        """(cases,) among which the best is: those that pass, of a search without the scenario as it is."""
        candidates = self.passing.copy()
        if self.plan.searches:  # the scenario as it is may lie outside of the ranges
            candidates[:1] = False
        return candidates

    @cached_property
    def front(self) -> Bools | None:
        """(cases,) which candidates no other one is better than by one objective and as good by the other.

        None where there are no two objectives.
        """
        if len(self.objectives) < 2:
            return None
        costs = [aim.sign * values for aim, values in self.aims if values is not None]
        return efficient(np.array(costs), self.candidates)

    @property
    def eligible(self) -> Bools:
        """(cases,) the front, or else the candidates.

        A case of which only the sample is known is not better than one that was tried where tolerances are worst.
        """
        if self.front is not None:
            return self.front
        tried, values = (
            np.isin(np.arange(self.shape[0]), list(self.further_realisations)) & self.candidates,
            self.judged_first,
        )
        if not tried.any() or values is None:
            return self.candidates
        return np.asarray(self.candidates & (tried | (values >= values[tried].min())))

    @cached_property
    def judged_first(self) -> Floats | None:
        """(cases,) the first objective, small where good, or else the negative smallest margin; None without both."""
        aim, values = self.aims[0]
        if values is not None:
            return np.asarray(aim.sign * values)
        if aim.terms or not self.margins:
            return None
        return np.asarray(-np.array(list(self.margins.values()), dtype=float).min(axis=0))

    @cached_property
    def best(self) -> list[dict[str, Any]]:
        """The best cases, see `best_of`; none where the best of many parts would be no choice."""
        objective, values = self.aims[0]
        chosen = self.plan.kind not in (*SAMPLES, "one_at_a_time", "reliability") or bool(objective.terms)
        return self.best_of(values, self.eligible) if chosen and not self.unknown_aim else []

    def best_of(self, values: Floats | None, among: Bools) -> list[dict[str, Any]]:
        """The best of some cases.

        Parameters
        ----------
        values : (cases,) of the first objective; None for the smallest margin, which shall be large.
        among : (cases,) which are compared.

        Returns
        -------
        list of dict
            At most `MOST_BEST`, best first: case, value of the objective, and with limits the smallest margin and its
            limit. Empty where there is neither an objective nor a limit.
        """
        sign = -1.0 if values is None else self.aims[0][0].sign
        names, each = list(self.margins), np.array(list(self.margins.values()))
        smallest = each.min(axis=0) if names else None
        decisive = np.where(np.isnan(each), -np.inf, each).argmin(axis=0).tolist() if names else []
        values = smallest if values is None else values
        if values is None:
            return []
        known = np.flatnonzero(among & ~np.isnan(values))
        order = known[np.argsort(sign * values[known], kind="stable")]
        return [
            {
                "case": int(case),
                "value": float(values[case]),
                **({} if smallest is None else {"margin": float(smallest[case]), "limit": names[decisive[case]]}),
            }
            for case in order[:MOST_BEST]
        ]


def efficient(values: Floats, among: Bools) -> Bools:
    """Which points no other one is better than in one coordinate and at least as good in the other.

    Parameters
    ----------
    values : (2, n), to be small.
    among : (n,) which points are compared.
    """
    among = among & np.isfinite(values).all(axis=0)
    points, place = np.unique(np.where(among, values, np.inf), axis=1, return_inverse=True)  # along the first one
    least = np.minimum.accumulate(np.append(np.inf, points[1]))[:-1]
    return np.asarray(among & (points[1] < least)[place.ravel()])


def shares_between(front: Floats) -> Floats:
    """(n - 1,) distances between neighbours of a front (2, n) over its length, with each objective's range as one.

    None where there are no two designs, as where no design meets every limit.
    """
    if front.shape[1] < 2:
        return np.zeros(0)
    ranges = np.ptp(front, axis=1, keepdims=True)
    steps = np.linalg.norm(np.diff(front / np.where(ranges > 0.0, ranges, 1.0), axis=1), axis=0)
    return np.asarray(steps / steps.sum() if steps.sum() > 0.0 else steps)


def table_of(plan: StudyPlan, outcomes: Mapping[int, CaseOutcome]) -> StudyTable:
    """The table of a study; of a search that of the cases up to the first of which a realisation is not known."""
    if not plan.searches:
        return StudyTable(plan, outcomes)
    count = plan.study.realisations.count
    sampled = {index for index, outcome in outcomes.items() if not outcome.deviations}
    number = next(k for k in range(len(sampled) + 1) if any(k * count + r not in sampled for r in range(count)))
    kept = {k: outcomes[k] for k in range(number * count)}
    further = {k: outcome for k, outcome in outcomes.items() if outcome.deviations and outcome.within < number}
    return StudyTable(plan.with_rows([kept[k * count].given for k in range(number)]), kept | further)


def costs(plan: StudyPlan, outcomes: Sequence[CaseOutcome]) -> tuple[Floats, Floats]:
    """Objectives, which a search minimises, and by how much limits are exceeded.

    Parameters
    ----------
    plan : of a study that asks for cases in batches.
    outcomes : of all realisations of some cases, one after the other.

    Returns
    -------
    (objectives, cases) array
        Infinite where a case has no value, or is not reliable.
    (limits, cases) array
        Share by which a value with its change by a finer model exceeds each limit, negative where it is met; infinite
        where that is not known.
    """
    table = table_of(plan, {k: replace(outcome, index=k) for k, outcome in enumerate(outcomes)})
    cases, usable, margins = table.shape[0], table.usable, list(table.margins.values())
    least = np.min(margins, axis=0) if margins else np.full(cases, np.inf)
    values = [aim.sign * (least if of is None else of) for aim, of in table.aims]
    values = [np.where(usable, of_aim, np.nan) for of_aim in values]
    over = [of.of_cases(of.high) / of.limit for of in table.limits.values()]
    beyond = np.array([np.where(usable, each, np.nan) - 1.0 for each in over]).reshape(len(over), cases)
    known = [np.nan_to_num(each, nan=np.inf, posinf=np.inf, neginf=-np.inf) for each in (values, beyond)]
    return known[0], known[1]


def cases_to_compare(plan: StudyPlan, outcomes: Mapping[int, CaseOutcome]) -> list[int]:
    """Which cases decide and are not compared with a finer model yet.

    They are the best case (of a front those that are listed), the worst one of each limit, and all that are closer to
    a limit than its value changes in the cases that are compared. Of the histories of a study of reliability it is the
    one that is nearest to each limit.

    Parameters
    ----------
    plan : of the study.
    outcomes : by index, those of compared cases with their comparison.

    Returns
    -------
    Indices of outcomes; none of what is not reliable anyway. Comparing these may make others decide.
    """
    table, rare = table_of(plan, outcomes), plan.kind == "reliability"
    usable, compared = table.fulfils(lambda of: of.outcome.usable), table.fulfils(lambda of: of.compared)
    wanted = np.zeros(table.shape, dtype=bool)
    for of in table.limits.values():
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.abs(of.limit / of.value - 1.0)  # of values that change by as much, one reaches the limit
            changes = np.maximum(of.high / of.value - 1.0, 1.0 - of.low / of.value)
        if rare:
            nearest = usable & (apart <= np.nanmin(apart[usable], initial=np.inf))
            wanted.flat[np.flatnonzero(nearest)[:MOST_COMPARED]] = True
            continue
        values = np.where(of.of_cases(usable), of.of_cases(of.value), -np.inf)
        if np.any(np.isfinite(values)):
            worst = int(np.nanargmax(values))
            wanted[worst, of.deciding[worst]] = True
        known = changes[compared & np.isfinite(changes)]
        wanted |= usable & (apart <= known.max(initial=0.0))
    if not rare:
        for item in table.best if table.front is not None else table.best[:1]:
            case = item["case"]
            wanted[case, [0, *(of.deciding[case] for of in table.limits.values())]] = True
    chosen: list[int] = np.unique(table.order[table.places[wanted & usable & ~compared]]).tolist()
    return chosen
