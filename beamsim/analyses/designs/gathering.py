"""The result of a study from the table of its cases: responses, margins, the choice of a case, indices."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.plan import DesignPlan, Realisations, varied_seeds
from beamsim.analyses.designs.responses import describe
from beamsim.analyses.designs.result import (
    CaseFailure,
    CaseOutcome,
    DesignsResult,
    LimitVerdicts,
    Objective,
    RealisedResponse,
    Response,
    SobolIndices,
    is_scalar,
    judging,
    objectives,
    varies,
)
from beamsim.analyses.designs.statistics import probability, rank_correlations, statistics, swings
from beamsim.outcomes import OnLimit, Outcome, OutcomeKind, together
from beamsim.results.values import margin_of, margins_of
from beamsim.scenario.parameters import value_at
from beamsim.scenario.studies import Value
from beamsim.typing import Bools, Floats, Ints

_NUMBERS = re.compile(r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?")
SAMPLES = ("latin_hypercube", "sobol", "draws")  # kinds of studies that have statistics


@dataclass(frozen=True)
class _Cases:
    """The known cases of a study, and how they do by its limits and objectives.

    Parameters
    ----------
    plan : of the study.
    outcomes : by index; may be those of some cases only.
    """

    plan: DesignPlan
    outcomes: Mapping[int, CaseOutcome]

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Of the design, with the realisations along the last axis."""
        return (*self.plan.shape, self.plan.study.realisations.count)

    def scalar(self, response: Response) -> bool:
        """Whether a response of all realisations is one number each."""
        return is_scalar(response, self.shape)

    @cached_property
    def realised(self) -> dict[str, Response]:
        """The responses of all realisations, whose axis follows those of the design; nan where there is none."""
        columns: dict[str, Floats] = {}
        for index in sorted(self.outcomes):
            for name, value in self.outcomes[index].values.items():
                if name not in columns:
                    columns[name] = np.full((len(self.plan.cases), *np.shape(value)), np.nan)
                columns[name][index] = value
        units = self.plan.scenario.output_units
        return {
            name: Response(name, column.reshape(self.shape + column.shape[1:]), *describe(name, units))
            for name, column in columns.items()
        }

    @property
    def nominal(self) -> dict[str, Response]:
        """The responses of the cases as they are, without tolerances."""
        axis = len(self.plan.shape)
        return {name: replace(r, values=np.take(r.values, 0, axis).copy()) for name, r in self.realised.items()}

    @cached_property
    def scattered(self) -> dict[str, RealisedResponse]:
        """The responses that are numbers, of all realisations; none without tolerances."""
        several = self.shape[-1] > 1
        return {name: RealisedResponse(**vars(r)) for name, r in self.realised.items() if several and self.scalar(r)}

    @cached_property
    def known(self) -> Bools:
        """(cases and realisations,) which are known, whether they are solved or failed."""
        return np.isin(np.arange(len(self.plan.cases)), list(self.outcomes))

    @cached_property
    def missing(self) -> int:
        """Number of the cases whose realisations are not all known."""
        return int(np.sum(~self.known.reshape(-1, self.shape[-1]).all(axis=1)))

    def of_all(self, holds: Callable[[CaseOutcome], bool]) -> Bools:
        """Of the design's shape: which cases are known in all realisations, of each of which something holds."""
        numbers = [number for number, outcome in self.outcomes.items() if holds(outcome)]
        return np.asarray(np.isin(np.arange(len(self.plan.cases)), numbers).reshape(self.shape).all(axis=-1))

    @cached_property
    def solved(self) -> Bools:
        """Of the design's shape: which cases have responses in all realisations."""
        return self.of_all(lambda outcome: not outcome.failed)

    @cached_property
    def usable(self) -> Bools:
        """Of the design's shape: which of these are computed as a whole and reliable."""
        return self.of_all(lambda outcome: outcome.outcome.usable)

    @cached_property
    def compared(self) -> Bools:
        """Of the design's shape: which cases are compared with a finer model, in some realisation."""
        return ~self.of_all(lambda outcome: not outcome.compared) & self.known.reshape(self.shape).any(axis=-1)

    @cached_property
    def gravest(self) -> list[CaseOutcome | None]:
        """(cases,) of each the first of the realisations whose outcomes are the gravest; None where none is known."""
        grave, count = list(OutcomeKind), self.shape[-1]
        rows = ([self.outcomes.get(first + r) for r in range(count)] for first in range(0, self.known.size, count))
        known = ([of for of in row if of is not None] for row in rows)
        return [max(row, key=lambda of: grave.index(of.outcome.gravest), default=None) for row in known]

    @cached_property
    def drawn(self) -> Bools:
        """(cases,) which are known and independent draws of the varied numbers; of Sobol' those of samples A and B."""
        plan = self.plan
        if plan.kind not in SAMPLES or plan.study.realisations.count > 1:
            return np.zeros(plan.shape, dtype=bool).ravel()
        independent = 2 * self.known.size // (len(plan.coordinates) + 2)
        return self.known & (plan.kind != "sobol" or np.arange(self.known.size) < independent)

    @cached_property
    def limits(self) -> dict[str, float]:
        """By name, SI units."""
        return {} if self.plan.scenario.limits is None else self.plan.scenario.limits.given

    @cached_property
    def passing(self) -> Bools:
        """Of the design's shape: which cases are reliable and meet every limit."""
        return self.usable & self.judged.met

    @cached_property
    def shares(self) -> Floats | None:
        """Of the design's shape: share of the realisations that meet every limit; None without limits or tolerances."""
        return self.judged.meets.mean(axis=-1) if self.limits and self.shape[-1] > 1 else None

    @cached_property
    def judged(self) -> _Judged:
        """How the cases do by the limits."""
        return _margins(self)

    @cached_property
    def aims(self) -> list[tuple[Objective, Response | None]]:
        """The objectives, of every case as the realisations judge it; None where there is none, or it is not known."""
        realisations, aims = self.plan.study.realisations, []
        for objective in objectives(self.plan.scenario):
            response = objective.of(self.realised, self.shape)
            if response is not None:
                values = response.values.ravel()
                chosen = judging(values, realisations.count, realisations.quantile, large_is_good=objective.largest)
                response = replace(response, values=values[chosen].reshape(self.plan.shape))
            aims.append((objective, response))
        return aims

    def of_limit(self, name: str) -> _OfLimit:
        """How the realisations of all cases do by a limit."""
        unknown = {"value": math.nan, "lowest": math.nan, "highest": math.nan, "verdict": OnLimit.NOT_RELIABLE.value}
        items = [unknown] * self.known.size
        for number, outcome in self.outcomes.items():
            items[number] = {**unknown, **outcome.margins.get(name, {})}
        value, low, high = (
            np.array([item[key] for item in items], dtype=float) for key in ("value", "lowest", "highest")
        )
        verdicts, quantile = np.array([item["verdict"] for item in items]), self.plan.study.realisations.quantile
        return _OfLimit(
            items, value, low, high, verdicts, judging(value, self.shape[-1], quantile, large_is_good=False)
        )


class _OfLimit(NamedTuple):
    """How the realisations (N,) of all cases do by one limit."""

    items: list[dict[str, Any]]  # of their margins
    value: Floats  # SI; nan where it is not known
    low: Floats  # the value less its change with a finer model
    high: Floats  # plus it
    verdicts: NDArray[np.str_]
    chosen: Ints  # (cases,) realisations by which the cases are judged


@dataclass(frozen=True)
class _Judged:
    """How cases do by the limits.

    Parameters
    ----------
    margins : of every case, by limit.
    worst : by limit the case with the smallest margin, for the summary.
    over : by limit, of the design's shape: the value with its change over the limit; nan where it is not known.
    verdicts : by limit, of the design's shape.
    met : of the design's shape, whether a case surely meets every limit, with the change of its value by a finer model.
    meets : the same of every realisation.
    """

    margins: dict[str, Response]
    verdicts: dict[str, LimitVerdicts]
    worst: dict[str, Any]
    over: dict[str, Floats]
    met: Bools
    meets: Bools


@dataclass(frozen=True)
class _Choice:
    """What the objectives choose among the cases.

    Parameters
    ----------
    values : of each objective that is known, by its name.
    eligible : of the design's shape, among which cases is chosen.
    front : the same where there are two objectives: no case is better by one and as good by the other.
    best : the best cases, see `best_cases`.
    unknown : whether an objective is a response that no case has.
    """

    values: dict[str, Response]
    eligible: Bools
    front: Bools | None
    best: list[dict[str, Any]]
    unknown: bool


def _chosen(cases: _Cases) -> _Choice:
    """The choice of the objectives; of a search without its first case, the scenario as it is."""
    plan, (objective, first) = cases.plan, cases.aims[0]
    values = {response.name: response for _, response in cases.aims if response is not None}
    unknown = any(aim.terms and response is None for aim, response in cases.aims)
    eligible, front = cases.passing.copy(), None
    if plan.searches:  # the scenario as it is may lie outside of the ranges
        eligible[:1] = False
    if len(values) > 1:
        costs = [aim.sign * response.values for aim, response in cases.aims if response is not None]
        eligible = front = efficient(np.array(costs), eligible)
    # the best of many parts is no choice
    chosen = plan.kind not in (*SAMPLES, "one_at_a_time", "reliability") or bool(objective.terms)
    of_first = None if first is None else first.values.ravel()
    best: list[dict[str, Any]] = []
    if chosen and not unknown:
        best = best_cases(of_first, cases.judged.margins, eligible, largest=objective.largest)
    return _Choice(values, eligible, front, best, unknown)


def _about_best(cases: _Cases, choice: _Choice) -> dict[str, Any]:
    """What the summary says of limits and objectives."""
    plan, limits, margins, shares = cases.plan, cases.limits, cases.judged.margins, cases.shares
    values = None if cases.aims[0][1] is None else cases.aims[0][1].values.ravel()
    worst, first = cases.judged.worst, list[dict[str, Any]]()
    if plan.kind == "optimise":
        nearest = choice.best or best_cases(None, margins, cases.solved, largest=True) or [{"case": 0}]
        worst = _margins_of_one(cases, nearest[0]["case"])
        first = best_cases(values, margins, np.arange(cases.solved.size) == 0, largest=True)

    def described(item: Mapping[str, Any]) -> dict[str, Any]:
        case, more = item["case"], dict[str, Any]()
        if choice.front is not None:
            more["values"] = {name: float(aim.values.flat[case]) for name, aim in choice.values.items()}
        if shares is not None:
            more["passing_share"] = float(shares.flat[case])
        return {**item, **more, "parameters": _named(plan, case)}

    return {
        "passing": int(cases.passing.sum()) if limits else None,
        "objective": " and ".join(aim.text for aim, _ in cases.aims) if choice.best else None,
        "as_it_is": described(first[0]) if first else None,
        "near_best": _near_best(plan, values, choice) if plan.searches and choice.front is None else None,
        "best": [described(item) for item in choice.best] or None,
        "margins": worst if limits and plan.kind != "reliability" else None,
        "probability": probability(cases.passing.ravel()[cases.drawn]) if limits and cases.drawn.any() else None,
    }


def gather(
    plan: DesignPlan, outcomes: Mapping[int, CaseOutcome], wall_time_s: float = 0.0, ended: Outcome | None = None
) -> DesignsResult:
    """The result of the cases that are solved.

    Parameters
    ----------
    plan : of the study.
    outcomes : by index; may be those of some cases only.
    wall_time_s : of the study, s.
    ended : how a search ended; None while it goes on.

    Returns
    -------
    DesignsResult
    """
    if plan.searches:
        plan, outcomes = asked_for(plan, outcomes)
    realisations, scenario = plan.study.realisations, plan.scenario
    cases = _Cases(plan, outcomes)
    responses, failures, choice = cases.nominal, _failures(plan, outcomes), _chosen(cases)
    if plan.searches:
        ended = _search_ended(plan, ended, failures, found=bool(choice.best))
    sensitivity, gaps = sensitivities(responses, len(plan.coordinates)) if plan.kind == "sobol" else ((), [])
    optimised, limits = plan.kind == "optimise", cases.limits
    return DesignsResult(
        scenario=scenario,
        analysis=plan.study.analysis,
        kind=plan.kind,
        outcome=_outcome(cases) if ended is None else ended,
        coordinates=plan.coordinates,
        solved=cases.solved,
        responses=responses,
        margins=cases.judged.margins,
        verdicts=cases.judged.verdicts,
        case_outcomes=_texts(cases, lambda of: of.outcome.text),
        case_warnings=_texts(cases, lambda of: "\n".join(of.warnings)),
        compared=cases.compared,
        limits=limits,
        passing=cases.passing if limits else None,
        passing_share=cases.shares,
        tolerances=realisations.tolerances(),
        realised=cases.scattered,
        sensitivity=sensitivity,
        failures=failures,
        warnings=(
            *scenario.warnings, *_about_seeds(plan), *_about_choice(cases, choice, gaps), *_warnings_of_cases(cases),
        ),
        wall_time_s=wall_time_s,
        objectives=choice.values if optimised else None,
        front=choice.front if optimised else None,
        fingerprint=plan.fingerprint,
    ).with_summary(
        varied={each.path: each.summary() for each in plan.coordinates},
        solved=cases.solved.size - cases.missing - len(failures),
        failed=len(failures),
        not_reliable=sum(not of.outcome.trusted for of in _with_responses(cases)),
        compared=int(cases.compared.sum()),
        responses=_extremes(plan, responses),
        **_about_best(cases, choice),
        tolerances=_tolerances(realisations),
        scatter=_scatter(cases, choice.best),
        sensitivity=_sensitivity(plan, responses, sensitivity) or None,
        processor_time_s=sum(outcome.processor_time_s for outcome in cases.outcomes.values()),
    )  # fmt: skip


def _texts(cases: _Cases, text: Callable[[CaseOutcome], str]) -> NDArray[np.str_]:
    """Of the design's shape a text of each case, of the gravest of its realisations; empty where none is known."""
    texts = ["" if of is None else text(of) for of in cases.gravest]
    return np.array(texts, dtype=np.str_).reshape(cases.plan.shape)


def _with_responses(cases: _Cases) -> list[CaseOutcome]:
    """The gravest outcome of each case that has responses."""
    return [of for of in cases.gravest if of is not None and not of.failed]


def _warnings_of_cases(cases: _Cases) -> Iterator[str]:
    """The warnings of the cases, those that differ by numbers alone as one: the first, and in how many cases."""
    count, total = cases.shape[-1], cases.solved.size
    found: dict[str, tuple[str, set[int]]] = {}
    for index in sorted(cases.outcomes):
        for text in cases.outcomes[index].warnings:
            if text not in cases.plan.scenario.warnings:
                found.setdefault(_NUMBERS.sub("#", text), (text, set()))[1].add(index // count)
    for text, numbers in found.values():
        first = "" if total == 1 else f"case {min(numbers) + 1}: "
        more = f" (and in {len(numbers) - 1} more of {total} cases)" if len(numbers) > 1 else ""
        yield f"{first}{text}{more}"


def _failures(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> tuple[CaseFailure, ...]:
    """The cases that failed, each with the first of its realisations that did."""
    first: dict[int, CaseFailure] = {}
    for index in sorted(outcomes):
        if outcomes[index].failed:
            case = index // plan.study.realisations.count
            first.setdefault(case, CaseFailure(case, plan.cases[index].values, outcomes[index].outcome))
    return tuple(first.values())


def _tolerances(realisations: Realisations) -> dict[str, Any] | None:
    if realisations.count == 1:
        return None
    return {
        "realisations": realisations.count,
        "quantile": realisations.quantile,
        "parameters": {
            t.path: {"tolerance": t.tolerance, "unit": t.unit, "relative": t.relative}
            for t in realisations.tolerances()
        },
    }


def _scatter(cases: _Cases, best: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """What the best case ranges over within its tolerances, or the only one; known realisations only."""
    realised = cases.scattered
    if not realised or not (best or cases.solved.size == 1):
        return None
    case, count = int(best[0]["case"]) if best else 0, cases.shape[-1]
    rows = {name: response.values.reshape(-1, count)[case] for name, response in realised.items()}
    known = {name: values[np.isfinite(values)] for name, values in rows.items()}
    ranges = {
        name: {"nominal": float(rows[name][0]), "smallest": float(values.min()), "largest": float(values.max()),
               **statistics(values)}
        for name, values in known.items() if values.size
    }  # fmt: skip
    met = {"probability": probability(cases.judged.meets.reshape(-1, count)[case, 1:])} if cases.limits else {}
    return {"case": case, "responses": ranges, **met}


def asked_for(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> tuple[DesignPlan, dict[int, CaseOutcome]]:
    """The cases that a search has asked for, up to the first that is not known with all of its realisations."""
    count = plan.study.realisations.count
    number = next(k for k in range(len(outcomes) + 1) if any(k * count + r not in outcomes for r in range(count)))
    kept = {k: outcomes[k] for k in range(number * count)}
    return plan.of([kept[k * count].given for k in range(number)]), kept


def costs(plan: DesignPlan, outcomes: Sequence[CaseOutcome]) -> tuple[Floats, Floats]:
    """What a search makes small, and by how much limits are exceeded.

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
    numbered = {k: replace(outcome, index=k) for k, outcome in enumerate(outcomes)}
    cases = _Cases(*asked_for(plan, numbered))
    margins, over, shape = cases.judged.margins, cases.judged.over, cases.plan.shape
    least = np.min([margin.values for margin in margins.values()], axis=0) if margins else np.full(shape, np.inf)
    values = [aim.sign * (least if response is None else response.values) for aim, response in cases.aims]
    values = [np.where(cases.usable, of_aim, np.nan) for of_aim in values]
    beyond = np.array([np.where(cases.usable, over[name], np.nan) - 1.0 for name in over]).reshape(len(over), *shape)
    known = [np.nan_to_num(each, nan=np.inf, posinf=np.inf, neginf=-np.inf) for each in (values, beyond)]
    return known[0], known[1]


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


def _search_ended(plan: DesignPlan, ended: Outcome | None, failures: Sequence[CaseFailure], *, found: bool) -> Outcome:
    """How a search ended, with what it did not find."""
    done, most = len(plan.cases) // plan.study.realisations.count, plan.most
    if ended is None:
        sentence = f"the search has tried {done} of at most {most} designs"
        return Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", sentence, done=done, cases=most)
    if found or not done:
        return ended
    reason = f"; the first of {len(failures)} that failed: {failures[0].outcome.text}" if failures else ""
    return Outcome.of(
        OutcomeKind.INCOMPLETE, "no_feasible_design", f"none of {done} designs meets every limit{reason}", ended,
        remedy="give wider ranges, other limits, or more most_cases", done=done,
    )  # fmt: skip


def _margins_of_one(cases: _Cases, case: int) -> dict[str, Any]:
    """The margins of one case alone."""
    count = cases.shape[-1]
    if case * count not in cases.outcomes:
        return {}
    own = {r: cases.outcomes[case * count + r] for r in range(count)}
    alone = _Cases(cases.plan.of([own[0].given]), own)
    return {name: item | {"case": case} for name, item in alone.judged.worst.items()}


def _near_best(plan: DesignPlan, values: Floats | None, choice: _Choice) -> dict[str, Any] | None:
    """By number its range in the designs that are nearly as good as the best one."""
    if values is None or not choice.best:
        return None
    best = choice.best[0]["value"]
    near = choice.eligible & (np.abs(values - best) <= 0.01 * abs(best))
    ends = {p.path: (p.low, p.high) for p in plan.study.varied}
    said = {}
    for c in (c for c in plan.coordinates if c.numeric):
        within, chosen, reach = c.values[near], c.values[choice.best[0]["case"]], ends[c.path]
        at_end = np.isclose(chosen, reach, rtol=1e-9, atol=1e-9 * (reach[1] - reach[0])).any()
        said[c.path] = {"smallest": float(within.min()), "largest": float(within.max()), "at_end": bool(at_end)}
    return said


def _about_choice(cases: _Cases, choice: _Choice, gaps: Sequence[str]) -> Iterator[str]:
    """What the choice of a case and the indices lack."""
    scalar, objective = [name for name, r in cases.realised.items() if cases.scalar(r)], cases.aims[0][0]
    if choice.unknown and cases.realised:
        key, asked = "maximise" if objective.largest else "minimise", " + ".join(name for name, _ in objective.terms)
        yield f"vary.{key} = {asked}: no case has such a response; they have {', '.join(scalar)}"
    for name in cases.limits if cases.realised else ():
        if np.isnan(cases.judged.margins[name].values).all():
            yield f"limits.{name}: no case has a value that is compared with it, so no case meets every limit"
    if gaps:
        yield f"no Sobol' indices of {', '.join(gaps)}, which are not known in all cases"


def _by_parameter(plan: DesignPlan, indices: SobolIndices) -> dict[str, dict[str, float]]:
    names = ("first_order", "first_order_low", "first_order_high", "total_order", "total_order_low", "total_order_high")
    return {c.path: {name: float(getattr(indices, name)[k]) for name in names} for k, c in enumerate(plan.coordinates)}


def _about_seeds(plan: DesignPlan) -> list[str]:
    """What the scatter between the seeds of a random input means."""
    inputs = [value_at(plan.study.case, place[:-1]) for place in varied_seeds(plan.study.varied)]
    amplitudes = {each.amplitudes for each in inputs if hasattr(each, "amplitudes")}  # of random inputs alone
    if not amplitudes:
        return []
    if amplitudes == {"random"}:
        return [
            "the seeds are realisations of a Gaussian process (excitation.amplitudes: random): they scatter as records "
            "of this duration do"
        ]
    return [
        "excitation.amplitudes = fixed: the seeds scatter less than records of a Gaussian process of this duration; "
        "leave it out if the scatter matters"
    ]


def _sensitivity(
    plan: DesignPlan, responses: Mapping[str, Response], indices: Sequence[SobolIndices]
) -> dict[str, dict[str, dict[str, Any]]]:
    """By response and parameter: Sobol' indices, the range over its values alone, or the rank correlation."""
    if plan.kind == "sobol":
        return {item.name: _by_parameter(plan, item) for item in indices}
    if plan.kind not in (*SAMPLES, "one_at_a_time"):
        return {}
    numbers = {c.path: c.values for c in plan.coordinates if c.numeric or plan.kind not in SAMPLES}
    measure = rank_correlations if plan.kind in SAMPLES else swings
    return {name: measure(r.values, numbers) for name, r in responses.items() if is_scalar(r, plan.shape) and varies(r)}


def _margins(cases: _Cases) -> _Judged:
    """How cases and realisations do by the limits; the cases that are drawn give the probability that one is met."""
    margins, verdicts, summary, over = {}, {}, {}, {}
    shape = cases.plan.shape
    met, meets = np.ones(shape, dtype=bool), np.ones(cases.shape, dtype=bool)
    for name, limit in cases.limits.items():
        of = cases.of_limit(name)
        meets &= (of.verdicts == OnLimit.MET).reshape(cases.shape)
        verdict, value = of.verdicts[of.chosen], of.value[of.chosen]
        met &= (verdict == OnLimit.MET).reshape(shape)
        over[name] = (of.high[of.chosen] / limit).reshape(shape)
        margin = np.array([margin_of(limit, each) for each in value.tolist()])
        margins[name] = Response(name, margin.reshape(shape), "1", f"limits.{name} / value - 1")
        verdicts[name] = LimitVerdicts(name, verdict.reshape(shape))
        if cases.realised:
            summary[name] = _worst_of_limit(cases, name, of, margin)
    return _Judged(margins, verdicts, summary, over, met, meets)


def _worst_of_limit(cases: _Cases, name: str, of: _OfLimit, margin: Floats) -> dict[str, Any]:
    """What the summary says of a limit: the verdict on all cases, and the case with the smallest margin that has it.

    Parameters
    ----------
    cases : of the study.
    name, of : of the limit.
    margin : (cases,) for it.
    """
    verdict, known = of.verdicts[of.chosen], cases.known[of.chosen]
    exceeding, unsure = (known & (verdict == each) for each in (OnLimit.EXCEEDED, OnLimit.NOT_RELIABLE))
    judged = OnLimit.EXCEEDED if exceeding.any() else OnLimit.NOT_RELIABLE if unsure.any() else OnLimit.MET
    if judged is OnLimit.MET and not known.all():  # what is missing may exceed it
        judged = OnLimit.NOT_RELIABLE
    counts: dict[str, Any] = {"cases_exceeding": int(exceeding.sum()), "cases_not_reliable": int(unsure.sum())}
    if cases.drawn.any():
        counts["probability"] = probability((verdict == OnLimit.MET)[cases.drawn])
    among = next(each for each in (exceeding, unsure, known) if each.any())
    about = {"verdict": judged.value, "exceeded": judged is OnLimit.EXCEEDED, **counts}
    computed = np.array([k in cases.outcomes and not cases.outcomes[k].failed for k in of.chosen.tolist()])
    shown = next((each for each in (among & computed, computed, among) if not np.isnan(margin[each]).all()), among)
    sizes = np.where(shown, margin, np.nan)
    if np.isnan(sizes).all():  # of which no case has a value
        return {**margins_of(cases.plan.scenario.limits, {})[name], **about}
    case = int(np.nanargmin(sizes))
    return {**of.items[of.chosen[case]], "case": case, "parameters": _named(cases.plan, case), **about}


def _extremes(plan: DesignPlan, responses: Mapping[str, Response]) -> dict[str, Any]:
    """Extremes of every response with their cases; for a sample also mean, standard deviation and quantiles."""
    summary: dict[str, Any] = {}
    for name, response in responses.items():
        if not is_scalar(response, plan.shape):
            continue
        flat = response.values.ravel()
        if not np.any(np.isfinite(flat)):
            continue
        low, high = int(np.nanargmin(flat)), int(np.nanargmax(flat))
        summary[name] = {
            "smallest": float(flat[low]),
            "smallest_at": _named(plan, low),
            "largest": float(flat[high]),
            "largest_at": _named(plan, high),
        }
        if plan.kind in SAMPLES:
            summary[name] |= statistics(flat[np.isfinite(flat)])
    return summary


def _named(plan: DesignPlan, case: int) -> dict[str, Value]:
    """The varied numbers of a case by path."""
    values = plan.cases[case * plan.study.realisations.count].values
    return {c.path: v for c, v in zip(plan.coordinates, values, strict=True)}


def _outcome(cases: _Cases) -> Outcome:
    """How a study ended: what is missing, and what is wrong with cases."""
    total, missing, parts = cases.solved.size, cases.missing, list[Outcome]()
    if missing:
        sentence = f"{total - missing} of {total} cases computed"
        parts.append(Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", sentence, done=total - missing, cases=total))
    known = [(k, of) for k, of in enumerate(cases.gravest) if of is not None]
    for kind, code, what, holds in _KINDS_OF_CASES:
        these = [(k, of) for k, of in known if holds(of)]
        known = [pair for pair in known if pair not in these]
        if these:
            case, first = these[0]
            sentence = f"{len(these)} of {total} cases {what}; the first is case {case + 1}: {first.outcome.text}"
            parts.append(Outcome.of(kind, code, sentence, count=len(these), cases=total, case=case + 1))
    return together(parts)


_KINDS_OF_CASES: tuple[tuple[OutcomeKind, str, str, Callable[[CaseOutcome], bool]], ...] = (
    (OutcomeKind.INCOMPLETE, "cases_failed", "failed", lambda of: of.failed),
    (OutcomeKind.UNTRUSTED, "cases_not_reliable", "are not reliable", lambda of: not of.outcome.trusted),
    (OutcomeKind.INCOMPLETE, "cases_incomplete", "are incomplete", lambda of: of.outcome.cut_short),
    (OutcomeKind.DOUBTFUL, "cases_doubtful", "are not converged", lambda of: not of.outcome.complete),
)  # fmt: skip


NEAREST = 1  # histories of a study of reliability that are compared, by limit


def worth_comparing(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> list[int]:
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
    if plan.searches:
        plan, outcomes = asked_for(plan, outcomes)
    cases, rare = _Cases(plan, outcomes), plan.kind == "reliability"
    usable = np.isin(np.arange(len(plan.cases)), [k for k, of in outcomes.items() if of.outcome.usable])
    compared = np.array([k in outcomes and outcomes[k].compared for k in range(len(plan.cases))], dtype=bool)
    deciding, chosen = list[Ints](), set[int]()
    for name, limit in cases.limits.items():
        of = cases.of_limit(name)
        deciding.append(of.chosen)
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.abs(limit / of.value - 1.0)  # of values that change by as much, one reaches the limit
            changes = np.maximum(of.high / of.value - 1.0, 1.0 - of.low / of.value)
        if rare:
            chosen |= set(
                np.flatnonzero(usable & (apart <= np.nanmin(apart[usable], initial=np.inf)))[:NEAREST].tolist()
            )
            continue
        judged = np.where(usable[of.chosen], of.value[of.chosen], -np.inf)
        if np.any(np.isfinite(judged)):
            chosen.add(int(of.chosen[np.nanargmax(judged)]))
        known = changes[compared & np.isfinite(changes)]
        chosen |= set(np.flatnonzero(usable & (apart <= known.max(initial=0.0))).tolist())
    if not rare:
        best = _chosen(cases)
        for item in best.best[: len(best.best) if best.front is not None else 1]:
            chosen |= {item["case"] * cases.shape[-1], *(int(of[item["case"]]) for of in deciding)}
    return sorted(index for index in chosen if usable[index] and not compared[index])


def best_cases(
    values: Floats | None, margins: Mapping[str, Response], passing: Bools, *, largest: bool
) -> list[dict[str, Any]]:
    """The best of the cases that pass.

    Parameters
    ----------
    values : (cases,) of the objective; None for the smallest margin.
    margins : by name of the limit, each of the design's shape.
    passing : of the design's shape, whether a case meets every limit.
    largest : whether large values are better.

    Returns
    -------
    list of dict
        At most 10, best first: case, value of the objective, and with limits the smallest margin and its limit. Empty
        where there is neither an objective nor a limit.
    """
    names, each = list(margins), np.array([margin.values.ravel() for margin in margins.values()])
    smallest = each.min(axis=0) if names else None
    decisive = np.where(np.isnan(each), -np.inf, each).argmin(axis=0).tolist() if names else []
    values = smallest if values is None else values
    if values is None:
        return []
    of_passing = np.flatnonzero(passing.ravel() & ~np.isnan(values))
    order = of_passing[np.argsort((-1.0 if largest else 1.0) * values[of_passing], kind="stable")]
    return [
        {
            "case": int(case),
            "value": float(values[case]),
            **({} if smallest is None else {"margin": float(smallest[case]), "limit": names[decisive[case]]}),
        }
        for case in order[:10]
    ]


def sensitivities(responses: Mapping[str, Response], count: int) -> tuple[tuple[SobolIndices, ...], list[str]]:
    """The indices of every response that varies and is known in all cases, and the names of those with gaps.

    Parameters
    ----------
    responses : of the cases of `beamsim.analyses.designs.plan.sobol`, in their order.
    count : number of parameters.
    """
    indices, gaps = [], []
    for name, response in responses.items():
        if response.values.ndim != 1:
            continue
        if not np.all(np.isfinite(response.values)):
            gaps.append(name)
        elif varies(response):
            indices.append(_indices(name, response.values.reshape(count + 2, -1)))
    return tuple(indices), gaps


def _indices(name: str, parts: Floats) -> SobolIndices:
    """First and total indices from the responses (k + 2, n) of A, B and the k mixed samples."""
    from scipy.stats import bootstrap, sobol_indices

    count, samples = parts.shape[0] - 2, parts.shape[1]

    def of_rows(rows: NDArray[np.int64]) -> Floats:
        chosen = parts[:, rows]
        given: Any = {"f_A": chosen[:1], "f_B": chosen[1:2], "f_AB": chosen[2:, None]}
        indices = sobol_indices(func=given, n=samples)
        return np.stack([np.reshape(indices.first_order, count), np.reshape(indices.total_order, count)])

    first, total = of_rows(np.arange(samples))
    spread: Any = bootstrap(
        [np.arange(samples)], of_rows, vectorized=False, n_resamples=200, confidence_level=0.95,
        method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return SobolIndices(name, first, total, spread.low[0], spread.high[0], spread.low[1], spread.high[1])
