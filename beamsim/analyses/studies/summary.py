"""Result of a study from the table of its cases: datasets, summary, warnings and outcome."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from beamsim.analyses.studies.layouts import CASES, FURTHER, REALISATIONS, SOBOL
from beamsim.analyses.studies.plan import ParameterColumn, StudyPlan, varied_seeds
from beamsim.analyses.studies.responses import describe, matches_request
from beamsim.analyses.studies.result import StudyResult
from beamsim.analyses.studies.statistics import (
    rank_correlations,
    sensitivities,
    statistics,
    swings,
    varies,
)
from beamsim.analyses.studies.table import (
    SAMPLES,
    UNKNOWN_MARGIN,
    WIDE_GAP,
    LimitColumns,
    StudyTable,
    shares_between,
    table_of,
)  # fmt: skip
from beamsim.analyses.studies.worst import SAMPLED, SEARCHED, TRIED, UNFINISHED, Judge, judges_of
from beamsim.cases import CaseOutcome, probability
from beamsim.labelled import Dataset
from beamsim.outcomes import Outcome, OutcomeKind, Verdict, first_with_others
from beamsim.results.values import limit_unit, margins_of
from beamsim.scenario.parameters import value_at
from beamsim.scenario.quantities import QUESTION_END
from beamsim.scenario.studies import ToleratedParameter
from beamsim.typing import Floats

_NUMBERS = re.compile(r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?")
_NEAR = 0.01  # relative distance within which designs are nearly as good as the best one
Indices = Mapping[str, Mapping[str, Floats]]
"""Sobol' indices of the parameters by response and order, see `sensitivities`."""


def result_of(
    plan: StudyPlan, outcomes: Mapping[int, CaseOutcome], wall_time_s: float = 0.0,
    search_outcome: Outcome | None = None, searches: Mapping[int, bool] = MappingProxyType({}),
) -> StudyResult:  # fmt: skip
    """Assemble the result of the solved cases.

    Parameters
    ----------
    plan : plan of the study.
    outcomes : outcomes by index; possibly of some cases only.
    wall_time_s : wall time of the study, s.
    search_outcome : outcome of a search; None while it continues.
    searches : by case whose worst was searched, True if the search was completed.

    Returns
    -------
    StudyResult
    """
    table = table_of(plan, outcomes)
    plan, scenario = table.plan, plan.scenario
    indices, gaps = sensitivities(table.nominal, len(plan.parameters)) if plan.kind == "sobol" else ({}, [])
    if plan.searches:
        search_outcome = _search_ended(table, search_outcome)
    datasets = {"cases": _cases(table)}
    if table.count > 1:
        datasets["realisations"] = _realisations(table)
    if table.further_realisations:
        datasets["further_realisations"] = _further_dataset(table)
    if indices:
        orders = next(iter(indices.values()))
        values = {order: np.stack([of[order] for of in indices.values()]) for order in orders}
        parameters = [parameter.path for parameter in plan.parameters]
        datasets["sobol"] = SOBOL.dataset({"response": list(indices), "parameter": parameters, **values})
    return StudyResult(
        scenario=scenario,
        outcome=_outcome(table) if search_outcome is None else search_outcome,
        datasets=datasets,
        warnings=(*scenario.warnings, *_seed_notes(plan), *_choice_warnings(table, gaps),
            *_worst_search_notes(table, searches), *_warnings_of_cases(table),
        ),
        wall_time_s=wall_time_s,
    ).with_summary(
        cases=table.shape[0],
        varied={parameter.path: _range_of_values(parameter.values, parameter.unit) for parameter in plan.parameters},
        solved=int(table.solved.sum()),
        failed=len(table.failures),
        not_reliable=sum(of is not None and not of.failed and not of.outcome.trusted for of in table.gravest_outcomes),
        compared=int(table.compared.sum()),
        responses=_extremes(table),
        **_best_entries(table, searches),
        tolerances=_tolerances(plan),
        worst=_worst(table, searches),
        scatter=_scatter(table, searches),
        sensitivity=_sensitivity(table, indices) or None,
        processor_time_s=sum(outcome.processor_time_s for outcome in table.outcomes.values()),
    )  # fmt: skip


# --- Datasets --------------------------------------------------------------------------------------------------------


def _cases(table: StudyTable) -> Dataset:
    """Dataset of the cases."""
    plan, units = table.plan, table.plan.scenario.output_units
    cases, columns, aims = table.shape[0], plan.parameters, [aim for aim, values in table.aims if values is not None]
    words = [parameter for parameter in columns if not parameter.numeric]
    modal = {name: column[:, 0] for name, column in table.every_response.items() if column.ndim > 2}
    modes = max((column.shape[1] for column in modal.values()), default=0)
    values: dict[str, Any] = {
        "analysis": plan.study.analysis,
        "kind": plan.kind,
        "fingerprint": plan.fingerprint,
        "case": 1 + np.arange(cases),
        "solved": table.solved,
        "outcome": ["" if of is None else of.outcome.text for of in table.gravest_outcomes],
        "failure": [table.failures[k].outcome.text if k in table.failures else "" for k in range(cases)],
        "warnings": ["" if of is None else "\n".join(of.warnings) for of in table.gravest_outcomes],
        "compared": table.compared,
        "parameter": [parameter.path for parameter in columns],
        "parameter_points": plan.points or None,
        "parameter_value": np.array([p.values if p.numeric else np.full(cases, np.nan) for p in columns]),
        "parameter_text": [[""] * cases if p.numeric else p.values.tolist() for p in columns] if words else None,
        "response": list(table.responses),
        "value": np.array(list(table.nominal.values())),
        "modal_response": list(modal),
        "limit": list(table.limits),
        "limit_value": [of.limit for of in table.limits.values()],
        "margin": np.array(list(table.margins.values())),
        "verdict": np.array([of.of_cases(of.verdict) for of in table.limits.values()]),
        "passing": table.passing if table.limits else None,
        "passing_share": table.passing_shares,
        "objective": list(table.objectives),
        "objective_value": np.array(list(table.objectives.values())),
        "front": table.front if plan.kind == "optimise" else None,
    }
    if modal:
        padded = np.full((len(modal), cases, modes), np.nan)
        for whole, column in zip(padded, modal.values(), strict=True):
            whole[:, : column.shape[1]] = column
        values |= {"mode": 1 + np.arange(modes), "modal_value": padded}
    return CASES.dataset(values, {
        "parameter": [{"unit": parameter.unit} for parameter in columns],
        "response": _words(table.responses, units),
        "modal_response": _words(modal, units),
        "limit": [{"unit": limit_unit(plan.scenario, name)} for name in table.limits],
        "objective": [{"unit": aim.unit(table.responses, units)} for aim in {aim.name: aim for aim in aims}.values()],
    })  # fmt: skip


def _words(names: Mapping[str, Any], output_units: Mapping[str, str]) -> list[dict[str, str]]:
    """Unit and meaning of responses."""
    return [dict(zip(("unit", "long_name"), describe(name, output_units), strict=True)) for name in names]


def _realisations(table: StudyTable) -> Dataset:
    """Dataset of the realisations within tolerances."""
    realisations, cases, count = table.plan.study.realisations, table.shape[0], table.count
    tolerances = [_tolerance(parameter) for parameter in realisations.parameters]
    values = {
        "case": 1 + np.arange(cases),
        "realisation": np.arange(count),
        "response": list(table.responses),
        "value": np.array([column[:, :count] for column in table.responses.values()]),
        "number": [parameter.parameter.path for parameter in realisations.parameters],
        "deviation": realisations.deviations.T,
        **{name: [of[name] for of in tolerances] for name in ("tolerance", "relative")},
    }
    words = {"response": _words(table.responses, table.plan.scenario.output_units), "number": tolerances}
    return REALISATIONS.dataset(values, words)


def _further_dataset(table: StudyTable) -> Dataset:
    """Dataset of the further realisations, used in the search for the worst."""
    every = [(case, outcome) for case, of in table.further_realisations.items() for outcome in of]
    values = {
        "further": 1 + np.arange(len(every)),
        "further_case": [case for case, _ in every],
        "further_outcome": [outcome.outcome.text for _, outcome in every],
        "number": [parameter.parameter.path for parameter in table.plan.study.realisations.parameters],
        "deviation": np.array([outcome.deviations for _, outcome in every]).T,
        "response": list(table.responses),
        "value": np.array([[outcome.values.get(name, np.nan) for _, outcome in every] for name in table.responses]),
    }
    return FURTHER.dataset(values, {"response": _words(table.responses, table.plan.scenario.output_units)})


def _tolerance(parameter: ToleratedParameter) -> dict[str, Any]:
    number, share = parameter.parameter, parameter.share
    if share is None:
        return {"tolerance": 0.5 * (number.high - number.low), "unit": number.unit, "relative": False}
    return {"tolerance": share, "unit": "1", "relative": True}


# --- Summary ---------------------------------------------------------------------------------------------------------


def _range_of_values(values: Any, unit: str) -> dict[str, Any]:
    """Number of different values of a parameter, and their ends, or the words."""
    different = list(dict.fromkeys(values.tolist()))
    if different and isinstance(different[0], str):
        return {"values": len(different), "unit": "", "chosen_from": different}
    ends = {"smallest": min(different), "largest": max(different)} if different else {}
    return {"values": len(different), "unit": unit, **ends}


def _kind_of_worst(table: StudyTable, case: int, searches: Mapping[int, bool]) -> str | None:
    """How the worst that judges a case was found: sampled or searched; None if no worst judges it."""
    if not table.plan.study.realisations.judged_by_worst:
        return None
    if case in searches:
        return SEARCHED if searches[case] else UNFINISHED
    return TRIED if case in table.further_realisations else SAMPLED


def _best_entries(table: StudyTable, searches: Mapping[int, bool]) -> dict[str, Any]:
    """Summary entries about limits and objectives."""
    plan, values, best = table.plan, table.aims[0][1], table.best
    worst = {name: _worst_of_limit(table, name, of) for name, of in table.limits.items() if table.every_response}
    first: list[dict[str, Any]] = []
    if plan.kind == "optimise":
        nearest = best or table.best_of(None, table.solved) or [{"case": 0}]
        worst = _margins_of_one(table, nearest[0]["case"])
        first = table.best_of(values, np.arange(table.shape[0]) == 0)

    def described(item: Mapping[str, Any]) -> dict[str, Any]:
        case, more = item["case"], dict[str, Any]()
        if table.front is not None:
            more["values"] = {name: float(aim[case]) for name, aim in table.objectives.items()}
        if table.passing_shares is not None:
            more["passing_share"] = float(table.passing_shares[case])
        if (kind := _kind_of_worst(table, case, searches)) is not None:
            more["worst"] = kind
        return {**item, **more, "parameters": plan.values_in(case)}

    for of in (of for of in worst.values() if "case" in of):
        of |= {} if (kind := _kind_of_worst(table, of["case"], searches)) is None else {"worst": kind}
    sampled = table.limits and table.drawn.any()
    return {
        "passing": int(table.passing.sum()) if table.limits else None,
        "objective": " and ".join(aim.text for aim, _ in table.aims) if best else None,
        "as_it_is": described(first[0]) if first else None,
        "near_best": _near_best(table) if plan.searches and table.front is None else None,
        "front_ends": _front_ends(table) if plan.searches and table.front is not None and best else None,
        "front_gaps": _front_gaps(table) if plan.searches and table.front is not None and best else None,
        "best": [described(item) for item in best] or None,
        "margins": worst if table.limits and plan.kind != "reliability" else None,
        "probability": probability(table.passing[table.drawn]) if sampled else None,
    }


def _near_best(table: StudyTable) -> dict[str, Any] | None:
    """Range of each number in the designs that are nearly as good as the best one."""
    values = table.aims[0][1]
    if values is None or not table.best:
        return None
    case, best = table.best[0]["case"], table.best[0]["value"]
    near = table.eligible & (np.abs(values - best) <= _NEAR * abs(best))
    near_best = {}
    for parameter in (parameter for parameter in table.plan.parameters if parameter.numeric):
        within = parameter.values[near]
        near_best[parameter.path] = {
            "smallest": float(within.min()), "largest": float(within.max()), "at_end": _at_end(table, parameter, case)
        }  # fmt: skip
    return near_best


def _front_ends(table: StudyTable) -> list[dict[str, Any]]:
    """Design of the front that is best in each objective, with the numbers that are at ends of their ranges."""
    among, found = np.flatnonzero(table.eligible), list[dict[str, Any]]()
    for aim, values in table.aims:
        if values is not None:
            case = int(among[np.argmin(aim.sign * values[among])])
            at_end = [parameter.path for parameter in table.plan.parameters if _at_end(table, parameter, case)]
            of_case = {name: float(each[case]) for name, each in table.objectives.items()}
            chosen = table.plan.values_in(case)
            found.append(
                {"objective": aim.text, "case": case, "values": of_case, "parameters": chosen, "at_end": at_end}
            )
    return found


def _front_gaps(table: StudyTable) -> list[dict[str, Any]] | None:
    """Wide gaps of the front with the objectives at both ends, widest first; None without gaps."""
    cases, names = np.flatnonzero(table.eligible), list(table.objectives)
    values = np.array([table.objectives[name][cases] for name in names])
    values = values[:, np.argsort(values[0])]
    shares = shares_between(values)
    gaps = [
        {"share": float(shares[k]), **{end: dict(zip(names, values[:, at].tolist(), strict=True)) for end, at in ends}}
        for k in np.argsort(-shares, kind="stable").tolist()
        if shares[k] > WIDE_GAP
        for ends in [(("from", k), ("to", k + 1))]
    ]
    return gaps or None


def _at_end(table: StudyTable, parameter: ParameterColumn, case: int) -> bool:
    """True if a number of a case is at an end of its range."""
    if not parameter.numeric:
        return False
    low, high = next((p.low, p.high) for p in table.plan.study.parameters if p.path == parameter.path)
    if not np.isfinite([low, high]).all():  # a list of values has no range
        return False
    return bool(np.isclose(parameter.values[case], (low, high), rtol=1e-9, atol=1e-9 * (high - low)).any())


def _margins_of_one(table: StudyTable, case: int) -> dict[str, Any]:
    """Margins of a single case."""
    count = table.count
    if case * count not in table.outcomes:
        return {}
    own = {r: table.outcomes[case * count + r] for r in range(count)}
    own |= {of.index: replace(of, within=0) for of in table.further_realisations.get(case, ())}
    alone = StudyTable(table.plan.with_rows([own[0].given]), own)
    if not alone.every_response:
        return {}
    return {name: _worst_of_limit(alone, name, of) | {"case": case} for name, of in alone.limits.items()}


def _worst_of_limit(table: StudyTable, name: str, columns: LimitColumns) -> dict[str, Any]:
    """Summary of a limit: the verdict on all cases, and the case with the smallest margin and that verdict.

    Parameters
    ----------
    table, name, columns : table of the study, name and columns of the limit.
    """
    verdict, known, margin = columns.of_cases(columns.verdict), columns.of_cases(table.known), table.margins[name]
    graver = Verdict.EXCEEDED, Verdict.NOT_RELIABLE, Verdict.UNDECIDED
    exceeding, unsure, undecided = with_verdict = [known & (verdict == each) for each in graver]
    judged = next((each for each, cases in zip(graver, with_verdict, strict=True) if cases.any()), Verdict.MET)
    if judged is Verdict.MET and not known.all():  # a missing value may exceed the limit
        judged = Verdict.NOT_RELIABLE
    counts: dict[str, Any] = {"cases_exceeding": int(exceeding.sum()), "cases_not_reliable": int(unsure.sum())}
    if undecided.any():
        counts["cases_undecided"] = int(undecided.sum())
    if table.drawn.any():
        counts["probability"] = probability((verdict == Verdict.MET)[table.drawn])
    about = {"verdict": judged.value, "exceeded": judged is Verdict.EXCEEDED, **counts}
    among = next((each for each in with_verdict if each.any()), known)
    computed = columns.of_cases(table.fulfils(lambda outcome: not outcome.failed))
    shown = next((each for each in (among & computed, computed, among) if not np.isnan(margin[each]).all()), among)
    sizes = np.where(shown, margin, np.nan)
    if np.isnan(sizes).all():  # no case has a value
        return {**margins_of(table.plan.scenario.limits, {})[name], **about}
    case = int(np.nanargmin(sizes))
    outcome = table.outcome(case, int(columns.deciding[case]))
    found = {**UNKNOWN_MARGIN, **outcome.margins.get(name, {})}
    return {**found, "case": case, "parameters": table.plan.values_in(case), **about}


def _extremes(table: StudyTable) -> dict[str, Any]:
    """Extremes of every response with their cases; for a sample also mean, standard deviation and quantiles."""
    summary: dict[str, Any] = {}
    for name, values in table.nominal.items():
        known = values[np.isfinite(values)]
        if not known.size:
            continue
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        summary[name] = {
            "smallest": float(values[low]),
            "smallest_at": table.plan.values_in(low),
            "largest": float(values[high]),
            "largest_at": table.plan.values_in(high),
        }
        if table.plan.kind in SAMPLES:
            summary[name] |= statistics(known)
    return summary


def _tolerances(plan: StudyPlan) -> dict[str, Any] | None:
    realisations = plan.study.realisations
    if realisations.count == 1:
        return None
    parameters = {parameter.parameter.path: _tolerance(parameter) for parameter in realisations.parameters}
    return {"realisations": realisations.count, "quantile": realisations.quantile, "parameters": parameters}


def _worst(table: StudyTable, searches: Mapping[int, bool]) -> dict[str, Any] | None:
    """Worst values of the best case within the tolerances, by limit and objective, and their deviations."""
    realisations = table.plan.study.realisations
    if not (table.best and realisations.judged_by_worst):
        return None
    case, found = int(table.best[0]["case"]), {}
    for judge in judges_of(table.plan):
        sample = [table.outcome(case, r) for r in range(table.count)]
        every = [*sample, *table.further_realisations.get(case, ())]
        worst = max(every, key=lambda of: np.nan_to_num(judge.badness(of), nan=-np.inf))
        deviations = worst.deviations or realisations.deviations[worst.index - case * table.count].tolist()
        found[judge.name] = {
            "value": judge.sign * judge.badness(worst),
            "of_sample": judge.sign * float(np.nanmax([judge.badness(of) for of in sample])),
            "deviations": {p.parameter.path: x for p, x in zip(realisations.parameters, deviations, strict=True)},
        }
    kind = _kind_of_worst(table, case, searches)
    return {
        "case": case, "kind": kind, "further_cases": sum(map(len, table.further_realisations.values())),
        "most_further_cases": realisations.most_further_cases, "by": found,
    }  # fmt: skip


def _scatter(table: StudyTable, searches: Mapping[int, bool]) -> dict[str, Any] | None:
    """Ranges of the responses of the best (or only) case within its tolerances, over known realisations.

    Extremes include all solved realisations; statistics only those of the sample.
    """
    cases, count = table.shape[0], table.count
    if count == 1 or not table.responses or not (table.best or cases == 1):
        return None
    case = int(table.best[0]["case"]) if table.best else 0
    rows = {name: column[case] for name, column in table.responses.items()}
    ranges = {}
    for name, every in rows.items():
        known, sample = every[np.isfinite(every)], every[:count][np.isfinite(every[:count])]
        if not sample.size:
            continue
        ends = {"smallest": float(known.min()), "largest": float(known.max())}
        ranges[name] = {"nominal": float(every[0]), **ends, **_kinds_of_ends(table, case, name, searches)}
        ranges[name] |= {key: value for key, value in statistics(sample).items() if key not in ends}
    met = {"probability": probability(table.meets[case, 1:count])} if table.limits else {}
    return {"case": case, "responses": ranges, **met}


def _kinds_of_ends(table: StudyTable, case: int, name: str, searches: Mapping[int, bool]) -> dict[str, str]:
    """How the smallest and largest value of a response within the tolerances were found: sampled or searched.

    Parameters
    ----------
    table, case : table of the study, and index of the case.
    name : name of the response.
    searches : by case whose worst was searched, True if the search was completed.
    """

    def searched(judge: Judge) -> bool:
        """True if the search by a judge applies to this response: its place is the worst one."""
        named = [other for other in table.responses if any(matches_request(asked, other) for asked in judge.responses)]
        ends = {other: np.nanmax(judge.sign * table.responses[other][case]) for other in named}
        return name in ends and len(judge.responses) == 1 and ends[name] == max(ends.values())

    kinds = {"smallest_is": SAMPLED, "largest_is": SAMPLED}
    if (kind := _kind_of_worst(table, case, searches)) is not None:
        for judge in (judge for judge in judges_of(table.plan) if searched(judge)):
            kinds["largest_is" if judge.sign > 0.0 else "smallest_is"] = kind
    return kinds


def _sensitivity(table: StudyTable, indices: Indices) -> dict[str, dict[str, dict[str, Any]]]:
    """Sensitivity by response and parameter: Sobol' indices, range over the parameter alone, or rank correlation."""
    kind, parameters = table.plan.kind, table.plan.parameters
    if kind == "sobol":
        return {
            name: {p.path: {order: float(of[order][k]) for order in of} for k, p in enumerate(parameters)}
            for name, of in indices.items()
        }
    if kind not in (*SAMPLES, "one_at_a_time"):
        return {}
    numbers = {p.path: p.values for p in parameters if p.numeric or kind not in SAMPLES}
    measure = rank_correlations if kind in SAMPLES else swings
    return {name: measure(values, numbers) for name, values in table.nominal.items() if varies(values)}


# --- Warnings and outcome --------------------------------------------------------------------------------------------


def _choice_warnings(table: StudyTable, gaps: Sequence[str]) -> Iterator[str]:
    """Warnings about the choice of the best case and about sensitivity indices."""
    objective = table.aims[0][0]
    if table.unknown_aim and table.every_response:
        key, asked = "maximise" if objective.maximised else "minimise", " + ".join(name for name, _ in objective.terms)
        yield f"vary.{key} = {asked}: no case has such a response; they have {', '.join(table.responses)}"
    for name in table.limits if table.every_response else ():
        if np.isnan(table.margins[name]).all():
            yield f"limits.{name}: no case has a value that is compared with it, so no case meets every limit"
    if gaps:
        yield f"no Sobol' indices of {', '.join(gaps)}, which are not known in all cases"


def _worst_search_notes(table: StudyTable, searches: Mapping[int, bool]) -> Iterator[str]:
    """Note if the budget ended the search for the worst of the best case, or did not allow one."""
    most = table.plan.study.realisations.most_further_cases
    if not table.best or not most or sum(map(len, table.further_realisations.values())) < most:
        return
    case = int(table.best[0]["case"])
    if _kind_of_worst(table, case, searches) != SEARCHED:
        key = f"{getattr(table.plan.scenario.study, 'section', 'vary')}.tolerances.worst_cases"
        yield (
            f"{key} = {most} ended the search for the worst of case {case + 1} early: raise it, or the worst "
            "may be worse than is printed"
        )


def _seed_notes(plan: StudyPlan) -> list[str]:
    """Note on the scatter between the seeds of a random input."""
    inputs = [value_at(plan.study.case, place[:-1]) for place in varied_seeds(plan.study.parameters)]
    amplitudes = {each.amplitudes for each in inputs if hasattr(each, "amplitudes")}  # random inputs only
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


def _warnings_of_cases(table: StudyTable) -> Iterator[str]:
    """Warnings of the cases; those that differ only in numbers are combined: the first, and the number of cases."""
    total = table.shape[0]
    found: dict[str, tuple[str, set[int]]] = {}
    for index in sorted(table.outcomes):
        for text in table.outcomes[index].warnings:
            if text not in table.plan.scenario.warnings:
                found.setdefault(_NUMBERS.sub("#", text), (text, set()))[1].add(table.case_of(index))
    for text, numbers in found.values():
        if text.startswith("limits.") and text.endswith(QUESTION_END) and len(numbers) < total:
            continue  # a study that approaches its limit in other cases uses the right unit
        first = "" if total == 1 else f"case {min(numbers) + 1}: "
        more = f" (and in {len(numbers) - 1} more of {total} cases)" if len(numbers) > 1 else ""
        yield f"{first}{text}{more}"


def _search_ended(table: StudyTable, outcome: Outcome | None) -> Outcome:
    """Outcome of a search, with what it did not find."""
    done, most, failures = table.shape[0], table.plan.most_cases, list(table.failures.values())
    if outcome is None:
        sentence = f"the search has tried {done} of at most {most} designs"
        return Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", sentence, done=done, cases=most)
    if table.best or not done:
        return outcome
    reason = f"; the first of {len(failures)} that failed: {failures[0].outcome.text}" if failures else ""
    sentence = f"no feasible design found after {done} of {most} cases{reason}"
    more = ", or more most_cases" if done >= most else ""
    return Outcome.of(
        OutcomeKind.INCOMPLETE,
        "no_feasible_design",
        sentence,
        remedy=f"give wider ranges, other limits{more}",
        done=done,
    )


def _outcome(table: StudyTable) -> Outcome:
    """Outcome of a study: missing cases, and unreliable cases."""
    total, parts = table.shape[0], list[Outcome]()
    done = int(table.known.all(axis=1).sum())
    if done < total:
        sentence = f"{done} of {total} cases computed"
        parts.append(Outcome.of(OutcomeKind.INCOMPLETE, "cases_missing", sentence, done=done, cases=total))
    known = [(k, of) for k, of in enumerate(table.gravest_outcomes) if of is not None]
    for kind, code, what, holds in _KINDS_OF_CASES:
        these = [(k, of) for k, of in known if holds(of)]
        known = [(k, of) for k, of in known if not holds(of)]
        if these:
            case, first = these[0]
            predicate = what if len(these) > 1 else what.replace("are ", "is ")
            sentence = f"{len(these)} of {total} cases {predicate}; the first is case {case + 1}: {first.outcome.text}"
            parts.append(Outcome.of(kind, code, sentence, count=len(these), cases=total, case=case + 1))
    return first_with_others(parts)


_KINDS_OF_CASES: tuple[tuple[OutcomeKind, str, str, Callable[[CaseOutcome], bool]], ...] = (
    (OutcomeKind.INCOMPLETE, "cases_failed", "failed", lambda of: of.failed),
    (OutcomeKind.UNTRUSTED, "cases_not_reliable", "are not reliable", lambda of: not of.outcome.trusted),
    (OutcomeKind.INCOMPLETE, "cases_incomplete", "are incomplete", lambda of: of.outcome.cut_short),
    (OutcomeKind.NOT_HELD, "cases_not_held", "are not held to the limits of the sweep",
     lambda of: of.outcome.gravest_kind is OutcomeKind.NOT_HELD),
    (OutcomeKind.DOUBTFUL, "cases_doubtful", "are not converged", lambda of: not of.outcome.complete),
)  # fmt: skip
