"""The result of a study from the table of its cases: responses, margins, the choice of a case, indices."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
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
from beamsim.system.outputs import output_units
from beamsim.typing import Bools, Floats

SAMPLES = ("latin_hypercube", "sobol", "draws")  # kinds of studies that have statistics


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
    realisations = plan.study.realisations
    if plan.searches:
        plan, outcomes = asked_for(plan, outcomes)
    count, shape = realisations.count, (*plan.shape, realisations.count)
    realised = _responses(plan, outcomes)
    responses = {
        name: replace(response, values=np.take(response.values, 0, axis=len(plan.shape)).copy())
        for name, response in realised.items()
    }
    known, solved = np.zeros((2, len(plan.cases)), dtype=bool)
    known[list(outcomes)] = True
    solved[[number for number, outcome in outcomes.items() if outcome.outcome.complete]] = True
    solved = solved.reshape(-1, count).all(axis=1).reshape(plan.shape)
    missing = int(np.sum(~known.reshape(-1, count).all(axis=1)))
    failures = _failures(plan, outcomes)
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    drawn = _drawn(plan, known)
    margins, worst, met, meets = _margins(plan, realised, limits, outcomes, drawn)
    passing = solved & met
    aims = objectives(plan.scenario)
    objective, judged = aims[0], [_judged(plan, aim, realised) for aim in aims]
    known_aims = {response.name: response for response in judged if response is not None}
    values = None if judged[0] is None else judged[0].values.ravel()
    unknown = any(aim.terms and response is None for aim, response in zip(aims, judged, strict=True))
    eligible, front, first = passing.copy(), None, list[dict[str, Any]]()
    if plan.searches:  # whose first case, the scenario as it is, may lie outside of the ranges
        eligible[:1] = False
    if len(known_aims) > 1:
        pairs = zip(aims, known_aims.values(), strict=True)
        eligible = front = efficient(np.array([(-1.0 if a.largest else 1.0) * r.values for a, r in pairs]), eligible)
    # the best of many parts is no choice
    chosen = plan.kind not in (*SAMPLES, "one_at_a_time", "reliability") or bool(objective.terms)
    best = best_cases(values, margins, eligible, largest=objective.largest) if chosen and not unknown else []
    if plan.searches:
        ended = _search_ended(plan, ended, failures, found=bool(best))
    if plan.kind == "optimise":
        nearest = best or best_cases(None, margins, solved, largest=True) or [{"case": 0}]
        worst = _margins_of_one(plan, outcomes, nearest[0]["case"])
        first = best_cases(values, margins, np.arange(solved.size) == 0, largest=True)
    shares = meets.mean(axis=-1) if limits and count > 1 else None
    sensitivity, gaps = sensitivities(responses, len(plan.coordinates)) if plan.kind == "sobol" else ((), [])
    stored = {
        name: RealisedResponse(**vars(response))
        for name, response in realised.items()
        if count > 1 and is_scalar(response, shape)
    }

    def described(item: Mapping[str, Any]) -> dict[str, Any]:
        case = item["case"]
        values = {name: float(aim.values.flat[case]) for name, aim in known_aims.items()}
        more = {} if shares is None else {"passing_share": float(shares.flat[case])}
        return {**item, **({} if front is None else {"values": values}), **more, "parameters": _named(plan, case)}

    return DesignsResult(
        scenario=plan.scenario,
        analysis=plan.study.analysis,
        kind=plan.kind,
        outcome=_outcome(solved.size, missing, failures) if ended is None else ended,
        coordinates=plan.coordinates,
        solved=solved,
        responses=responses,
        margins=margins,
        limits=limits,
        passing=passing if limits else None,
        passing_share=shares,
        tolerances=realisations.tolerances(),
        realised=stored,
        sensitivity=sensitivity,
        failures=failures,
        warnings=(
            *plan.scenario.warnings, *_about_seeds(plan),
            *_about_choice(plan, objective, responses, gaps, limits, unknown=unknown),
            *_about_tables(plan, realised),
        ),
        wall_time_s=wall_time_s,
        objectives=known_aims if plan.kind == "optimise" else None,
        front=front if plan.kind == "optimise" else None,
        fingerprint=plan.fingerprint,
    ).with_summary(
        solved=solved.size - missing - len(failures),
        failed=len(failures),
        responses=_extremes(plan, responses),
        passing=int(passing.sum()) if limits else None,
        objective=" and ".join(aim.text for aim in aims) if best else None,
        as_it_is=described(first[0]) if first else None,
        near_best=_near_best(plan, values, eligible, best) if plan.searches and front is None else None,
        best=[described(item) for item in best] or None,
        tolerances=_tolerances(realisations),
        scatter=_scatter(stored, best, meets if limits else None, solved.size),
        margins=worst if limits and plan.kind != "reliability" else None,
        probability=probability(passing.ravel()[drawn]) if limits and drawn.any() else None,
        sensitivity=_sensitivity(plan, responses, sensitivity) or None,
        processor_time_s=sum(outcome.processor_time_s for outcome in outcomes.values()),
    )  # fmt: skip


def _responses(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> dict[str, Response]:
    """The responses of all realisations, whose axis follows those of the design; nan where there is none."""
    columns: dict[str, Floats] = {}
    for index in sorted(outcomes):
        for name, value in outcomes[index].values.items():
            if name not in columns:
                columns[name] = np.full((len(plan.cases), *np.shape(value)), np.nan)
            columns[name][index] = value
    units = output_units(plan.scenario)
    shape = (*plan.shape, plan.study.realisations.count)
    return {
        name: Response(name, column.reshape(shape + column.shape[1:]), *describe(name, units))
        for name, column in columns.items()
    }


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


def _scatter(
    realised: Mapping[str, RealisedResponse], best: Sequence[Mapping[str, Any]], meets: Bools | None, cases: int
) -> dict[str, Any] | None:
    """What the best case ranges over within its tolerances, or the only one; known realisations only.

    Parameters
    ----------
    realised : responses of all realisations.
    best : the best cases.
    meets : (..., realisations) whether each meets every limit; None without limits.
    cases : number of them.
    """
    if not realised or not (best or cases == 1):
        return None
    case = int(best[0]["case"]) if best else 0
    count = next(iter(realised.values())).values.size // cases
    rows = {name: response.values.reshape(-1, count)[case] for name, response in realised.items()}
    known = {name: values[np.isfinite(values)] for name, values in rows.items()}
    ranges = {
        name: {"nominal": float(rows[name][0]), "smallest": float(values.min()), "largest": float(values.max()),
               **statistics(values)}
        for name, values in known.items() if values.size
    }  # fmt: skip
    met = {} if meets is None else {"probability": probability(meets.reshape(-1, count)[case, 1:])}
    return {"case": case, "responses": ranges, **met}


def asked_for(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> tuple[DesignPlan, dict[int, CaseOutcome]]:
    """The cases that a search has asked for, up to the first that is not known with all of its realisations."""
    count = plan.study.realisations.count
    number = next(k for k in range(len(outcomes) + 1) if any(k * count + r not in outcomes for r in range(count)))
    kept = {k: outcomes[k] for k in range(number * count)}
    return plan.of([kept[k * count].given for k in range(number)]), kept


def costs(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome]) -> tuple[Floats, Floats]:
    """What a search makes small, and by how much limits are exceeded.

    Parameters
    ----------
    plan : of a search.
    outcomes : of some cases, from 0.

    Returns
    -------
    (objectives, cases) array
        Infinite where a case has no value.
    (cases,) array
        Largest share by which a limit is exceeded, 0 where each is met; infinite where that is not known.
    """
    plan, outcomes = asked_for(plan, outcomes)
    realised = _responses(plan, outcomes)
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    margins, _, met, _ = _margins(plan, realised, limits, outcomes, np.zeros(len(plan.cases), dtype=bool))
    least = np.min([margin.values for margin in margins.values()], axis=0) if margins else np.full(plan.shape, np.inf)
    beyond = np.where(met, 0.0, np.nan_to_num(1.0 / (1.0 + least) - 1.0, nan=np.inf))
    aims = objectives(plan.scenario)
    values = [
        (-1.0 if aim.largest else 1.0) * (least if response is None else response.values)
        for aim, response in ((aim, _judged(plan, aim, realised)) for aim in aims)
    ]
    return np.nan_to_num(values, nan=np.inf, posinf=np.inf, neginf=-np.inf), beyond


def _judged(plan: DesignPlan, objective: Objective, realised: Mapping[str, Response]) -> Response | None:
    """An objective of every case, as the realisations judge it; None where there is none, or it is not known."""
    realisations = plan.study.realisations
    response = objective.of(realised, (*plan.shape, realisations.count))
    if response is None:
        return None
    values = response.values.ravel()
    chosen = judging(values, realisations.count, realisations.quantile, large_is_good=objective.largest)
    return replace(response, values=values[chosen].reshape(plan.shape))


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


def _margins_of_one(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome], case: int) -> dict[str, Any]:
    """The margins of one case alone."""
    count = plan.study.realisations.count
    if case * count not in outcomes:
        return {}
    own, limits = {r: outcomes[case * count + r] for r in range(count)}, plan.scenario.limits
    alone = plan.of([own[0].given])
    given = {} if limits is None else limits.given
    _, found, _, _ = _margins(alone, _responses(alone, own), given, own, np.zeros(count, dtype=bool))
    return {name: item | {"case": case} for name, item in found.items()}


def _near_best(
    plan: DesignPlan, values: Floats | None, passing: Bools, best: Sequence[Mapping[str, Any]]
) -> dict[str, Any] | None:
    """By number its range in the designs that are nearly as good as the best one."""
    if values is None or not best:
        return None
    near = passing & (np.abs(values - best[0]["value"]) <= 0.01 * abs(best[0]["value"]))
    known = {c.path: c.values[near] for c in plan.coordinates if c.numeric}
    return {path: {"smallest": float(of.min()), "largest": float(of.max())} for path, of in known.items()}


def _about_choice(
    plan: DesignPlan, objective: Objective, responses: Mapping[str, Response], gaps: Sequence[str],
    limits: Mapping[str, float], *, unknown: bool,
) -> Iterator[str]:  # fmt: skip
    """What the choice of a case and the indices lack."""
    if unknown and responses:
        scalar = [name for name, response in responses.items() if is_scalar(response, plan.shape)]
        key, asked = "maximise" if objective.largest else "minimise", " + ".join(name for name, _ in objective.terms)
        yield f"vary.{key} = {asked}: no case has such a response; they have {', '.join(scalar)}"
    for name in limits if responses else ():
        if not any(is_scalar(r, plan.shape) for r in responses_of(responses, limited_response(name))):
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


def _drawn(plan: DesignPlan, known: Bools) -> Bools:
    """Which cases are known draws of the varied numbers, independent of each other; of Sobol' samples A and B."""
    if plan.kind not in SAMPLES or plan.study.realisations.count > 1:
        return np.zeros(plan.shape, dtype=bool).ravel()
    return known & (plan.kind != "sobol" or np.arange(known.size) < 2 * known.size // (len(plan.coordinates) + 2))


def _sensitivity(
    plan: DesignPlan, responses: Mapping[str, Response], indices: Sequence[SobolIndices]
) -> dict[str, dict[str, dict[str, Any]]]:
    """By response and parameter: Sobol' indices, the range over its values alone, or the rank correlation."""
    if plan.kind == "sobol":
        return {item.name: _by_parameter(plan, item) for item in indices}
    if plan.kind not in (*SAMPLES, "one_at_a_time", "reliability"):
        return {}
    numbers = {c.path: c.values for c in plan.coordinates if c.numeric or plan.kind not in SAMPLES}
    measure = rank_correlations if plan.kind in SAMPLES else swings
    return {name: measure(r.values, numbers) for name, r in responses.items() if is_scalar(r, plan.shape) and varies(r)}


def _ranges(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome], limit: str, value: Floats) -> Floats:
    """(2, cases and realisations) the values of a limit less and plus their changes, where these are known."""
    ranges = np.array([value.ravel(), value.ravel()])
    for number, outcome in outcomes.items():
        if limit in outcome.ranges:
            ranges[:, number] = outcome.ranges[limit]
    return ranges


def _margins(
    plan: DesignPlan,
    realised: Mapping[str, Response],
    limits: Mapping[str, float],
    outcomes: Mapping[int, CaseOutcome],
    drawn: Bools,
) -> tuple[dict[str, Response], dict[str, Any], Bools, Bools]:
    """Margin of every case, those of the worst cases for the summary, and which cases and realisations meet all limits.

    A case meets a limit if it surely does, with the change of its value by a finer model. The cases that are drawn give
    the probability of that.
    """
    margins, summary = {}, {}
    shape, quantile = (*plan.shape, plan.study.realisations.count), plan.study.realisations.quantile
    met, meets = np.ones(plan.shape, dtype=bool), np.ones(shape, dtype=bool)
    for name, limit in limits.items():
        compared = [r for r in responses_of(realised, limited_response(name)) if is_scalar(r, shape)]
        margin = np.full(plan.shape, math.nan)
        if compared:
            values, decisive = worst_of(compared, large_is_good=False)
            ranges = _ranges(plan, outcomes, name, values)
            meets &= (ranges[1] <= limit).reshape(shape)
            chosen = judging(values, shape[-1], quantile, large_is_good=False)
            value, (low, high) = values[chosen], ranges[:, chosen]
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
                **({"probability": probability((verdicts == OnLimit.MET)[drawn])} if drawn.any() else {}),
            }
    return margins, summary, met, meets


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
    decisive = np.where(np.isnan(each), -np.inf, each).argmin(axis=0) if names else []
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
