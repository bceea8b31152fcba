"""The result of a study from the table of its cases: responses, margins, the choice of a case, indices."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.plan import DesignPlan, Realisations, varies_seed
from beamsim.analyses.designs.responses import describe
from beamsim.analyses.designs.result import (
    CaseFailure,
    CaseOutcome,
    DesignsResult,
    Objective,
    RealisedResponse,
    Response,
    SobolIndices,
    is_scalar,
    judging,
    limited_response,
    objectives,
    responses_of,
    varies,
    worst_of,
)
from beamsim.analyses.designs.statistics import probability, rank_correlations, statistics, swings
from beamsim.analyses.doubts import forces_beyond_tables
from beamsim.analyses.values import margin_of, margins_of
from beamsim.outcomes import OnLimit, Outcome, OutcomeKind, on_limit, together
from beamsim.scenario.parameters import Value
from beamsim.typing import Bools, Floats

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

    @cached_property
    def solved(self) -> Bools:
        """Of the design's shape: which cases have responses in all realisations."""
        complete = [number for number, outcome in self.outcomes.items() if outcome.outcome.complete]
        return np.asarray(np.isin(np.arange(len(self.plan.cases)), complete).reshape(self.shape).all(axis=-1))

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
        """Of the design's shape: which cases are solved and meet every limit."""
        return self.solved & self.judged.met

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


@dataclass(frozen=True)
class _Judged:
    """How cases do by the limits.

    Parameters
    ----------
    margins : of every case, by limit.
    worst : by limit the case with the smallest margin, for the summary.
    over : by limit, of the design's shape: the value with its change over the limit; nan where it is not known.
    met : of the design's shape, whether a case surely meets every limit, with the change of its value by a finer model.
    meets : the same of every realisation.
    """

    margins: dict[str, Response]
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
        outcome=_outcome(cases.solved.size, cases.missing, failures) if ended is None else ended,
        coordinates=plan.coordinates,
        solved=cases.solved,
        responses=responses,
        margins=cases.judged.margins,
        limits=limits,
        passing=cases.passing if limits else None,
        passing_share=cases.shares,
        tolerances=realisations.tolerances(),
        realised=cases.scattered,
        sensitivity=sensitivity,
        failures=failures,
        warnings=(
            *scenario.warnings, *_about_seeds(plan),
            *_about_choice(cases, choice, gaps), *_about_tables(plan, cases.realised),
        ),
        wall_time_s=wall_time_s,
        objectives=choice.values if optimised else None,
        front=choice.front if optimised else None,
        fingerprint=plan.fingerprint,
    ).with_summary(
        solved=cases.solved.size - cases.missing - len(failures),
        failed=len(failures),
        responses=_extremes(plan, responses),
        **_about_best(cases, choice),
        tolerances=_tolerances(realisations),
        scatter=_scatter(cases, choice.best),
        sensitivity=_sensitivity(plan, responses, sensitivity) or None,
        processor_time_s=sum(outcome.processor_time_s for outcome in cases.outcomes.values()),
    )  # fmt: skip


def _about_tables(plan: DesignPlan, responses: Mapping[str, Response]) -> list[str]:
    """Stops that some case presses further than their tables go, where all cases have the same tables."""
    varied = [*(c.path for c in plan.coordinates), *(p.number.path for p in plan.study.realisations.parameters)]
    if any("force_deflection" in path for path in varied):
        return []
    forces = [{r.name.split("/")[-2]: r.values} for r in responses_of(responses, "peak_force")]
    return forces_beyond_tables(plan.scenario, forces)


def _failures(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> tuple[CaseFailure, ...]:
    """The cases that failed, each with the first of its realisations that did."""
    first: dict[int, CaseFailure] = {}
    for index in sorted(outcomes):
        if not outcomes[index].outcome.complete:
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
        Infinite where a case has no value.
    (limits, cases) array
        Share by which a value with its change by a finer model exceeds each limit, negative where it is met; infinite
        where that is not known.
    """
    numbered = {k: replace(outcome, index=k) for k, outcome in enumerate(outcomes)}
    cases = _Cases(*asked_for(plan, numbered))
    margins, over, shape = cases.judged.margins, cases.judged.over, cases.plan.shape
    least = np.min([margin.values for margin in margins.values()], axis=0) if margins else np.full(shape, np.inf)
    values = [aim.sign * (least if response is None else response.values) for aim, response in cases.aims]
    beyond = np.array([over[name] - 1.0 for name in over]).reshape(len(over), *shape)
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
        if not any(r.name in scalar for r in responses_of(cases.realised, limited_response(name))):
            yield f"limits.{name}: no case has a response that is compared with it, so no case meets every limit"
    if gaps:
        yield f"no Sobol' indices of {', '.join(gaps)}, which are not known in all cases"


def _by_parameter(plan: DesignPlan, indices: SobolIndices) -> dict[str, dict[str, float]]:
    names = ("first_order", "first_order_low", "first_order_high", "total_order", "total_order_low", "total_order_high")
    return {c.path: {name: float(getattr(indices, name)[k]) for name in names} for k, c in enumerate(plan.coordinates)}


def _about_seeds(plan: DesignPlan) -> list[str]:
    """What the scatter between the seeds of a random input means."""
    if not varies_seed(plan.study.varied):
        return []
    if getattr(plan.study.case.excitation, "amplitudes", None) == "random":
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


def _ranges(outcomes: Mapping[int, CaseOutcome], limit: str, value: Floats) -> Floats:
    """(2, cases and realisations) the values of a limit less and plus their changes, where these are known."""
    ranges = np.array([value.ravel(), value.ravel()])
    for number, outcome in outcomes.items():
        if limit in outcome.ranges:
            ranges[:, number] = outcome.ranges[limit]
    return ranges


def _margins(cases: _Cases) -> _Judged:
    """How cases and realisations do by the limits; the cases that are drawn give the probability that one is met."""
    margins, summary, over = {}, {}, {}
    plan, shape, quantile = cases.plan, cases.shape, cases.plan.study.realisations.quantile
    met, meets = np.ones(plan.shape, dtype=bool), np.ones(shape, dtype=bool)
    for name, limit in cases.limits.items():
        compared = [r for r in responses_of(cases.realised, limited_response(name)) if cases.scalar(r)]
        margin = over[name] = np.full(plan.shape, math.nan)
        if compared:
            values, decisive = worst_of(compared, large_is_good=False)
            ranges = _ranges(cases.outcomes, name, values)
            meets &= (ranges[1] <= limit).reshape(shape)
            chosen = judging(values, shape[-1], quantile, large_is_good=False)
            value, (low, high) = values[chosen], ranges[:, chosen]
            over[name] = (high / limit).reshape(plan.shape)
            verdicts = np.array([on_limit(a, b, limit) for a, b in zip(low.tolist(), high.tolist(), strict=True)])
            met &= (verdicts == OnLimit.MET).reshape(plan.shape)
            margin = np.array([margin_of(limit, each) for each in value.tolist()]).reshape(plan.shape)
        else:  # a limit that nothing is compared with is not met
            met[:], meets[:] = False, False
        margins[name] = Response(name, margin, "1", f"limits.{name} / value - 1")
        if np.any(np.isfinite(margin) | np.isposinf(margin)):
            case = int(np.nanargmin(margin))
            at = compared[decisive[chosen[case]]].place
            summary[name] = {
                **margins_of(plan.scenario.limits, {name: (float(value[case]), at)})[name],
                "lowest": float(np.nanmax(low)),  # a limit is exceeded in all cases if it is in one
                "highest": float(np.nanmax(high)),
                "case": case,
                "parameters": _named(plan, case),
                "cases_exceeding": int(np.sum(verdicts == OnLimit.EXCEEDED)),
                **({"probability": probability((verdicts == OnLimit.MET)[cases.drawn])} if cases.drawn.any() else {}),
            }
        elif cases.realised:  # of which no case has a value
            summary[name] = margins_of(plan.scenario.limits, {})[name]
    return _Judged(margins, summary, over, met, meets)


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


def _outcome(cases: int, missing: int, failures: tuple[CaseFailure, ...]) -> Outcome:
    parts = []
    if missing:
        sentence = f"{cases - missing} of {cases} cases computed"
        parts.append(Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", sentence, done=cases - missing, cases=cases))
    if failures:
        first = failures[0]
        parts.append(
            Outcome.of(
                OutcomeKind.INCOMPLETE, "cases_failed",
                f"{len(failures)} of {cases} cases failed; the first is case {first.case + 1}: {first.outcome.text}",
                failed=len(failures), cases=cases, case=first.case + 1,
            )
        )  # fmt: skip
    return together(parts)


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
