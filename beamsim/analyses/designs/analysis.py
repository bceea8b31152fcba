"""Design studies: many cases of one scenario, solved by workers and collected in a table of responses."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.cases import CaseTask, Place, analysis_of, case_scenario, solve_case, warm_up
from beamsim.analyses.designs.responses import describe
from beamsim.analyses.designs.result import CaseFailure, CaseOutcome, Coordinate, DesignsResult, Response, is_scalar
from beamsim.analyses.limits import margin_of
from beamsim.analyses.parallel import default_workers, on_cluster, on_this_machine
from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.scenario.designs import LatinHypercube, VariedParameter, varied_parameters
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

Value = float | str

MOST_CHECKED = 400  # cases checked before the first is solved
MOST_SHOWN = 5  # problems and failures in a message
NORMAL_REACH = 3.0  # standard deviations in a tolerance

LIMITED_QUANTITIES = {
    "peak_force": "peak_force",
    "bending_stress": "bending_stress",
    "peak_displacement": "peak_displacement",
    "peak_acceleration": "peak_acceleration",
    "gap": "largest_gap",
}
"""For each limit, the response quantity with which it is compared."""


@dataclass(frozen=True)
class DesignPlan:
    """The cases to be computed, in order."""

    scenario: Scenario
    analysis: str
    kind: str
    coordinates: tuple[Coordinate, ...]
    shape: tuple[int, ...]
    tasks: tuple[CaseTask, ...]
    fingerprint: str


def plan_designs(scenario: Scenario) -> DesignPlan:
    """List the cases of a scenario with ``vary``.

    Raises
    ------
    ScenarioError
        If ``vary`` is missing, or there is no analysis for the cases.
    """
    vary = scenario.vary
    if vary is None:
        raise ScenarioError(
            Problem("vary", "is missing", "add `vary: {kind: grid, parameters: [{path: ..., values: [...]}]}`")
        )
    analysis = analysis_of(scenario)
    varied = varied_parameters(scenario)
    if isinstance(vary, LatinHypercube):
        columns = _latin_hypercube(varied, vary.samples, vary.seed)
    else:
        columns = [_values(parameter) for parameter in varied]
    shape = tuple(len(c) for c in columns) if vary.kind == "grid" else (len(columns[0]),)
    rows: Iterable[tuple[Value, ...]] = (
        itertools.product(*columns) if vary.kind == "grid" else zip(*columns, strict=True)
    )
    base = _base(scenario)
    places = tuple(parameter.places for parameter in varied)
    if _varies_seed(places):
        base["excitation"].setdefault("amplitudes", "random")
    return DesignPlan(
        scenario=scenario,
        analysis=analysis,
        kind=vary.kind,
        coordinates=tuple(
            Coordinate(parameter.path, _array(column), parameter.unit)
            for parameter, column in zip(varied, columns, strict=True)
        ),
        shape=shape,
        tasks=tuple(CaseTask(k, analysis, base, places, row) for k, row in enumerate(rows)),
        fingerprint=_fingerprint(base, places, columns, vary.kind, analysis),
    )


def check_cases(plan: DesignPlan) -> None:
    """Check that the scenario of each case is valid; of many cases only an evenly spaced selection.

    Raises
    ------
    ScenarioError
        With the first invalid cases and their problems.
    """
    problems: list[Problem] = []
    step = max(1, -(-len(plan.tasks) // MOST_CHECKED))
    chosen = sorted({*range(0, len(plan.tasks), step), len(plan.tasks) - 1})
    for task in (plan.tasks[k] for k in chosen):
        try:
            case_scenario(task)
        except ScenarioError as error:
            named = ", ".join(_assigned(c, value) for c, value in zip(plan.coordinates, task.values, strict=True))
            problems += [
                Problem("vary", f"with {named}: {p.path} {p.message}", p.remedy or "leave out such cases")
                for p in error.problems
            ]
        if len(problems) >= MOST_SHOWN:
            break
    if problems:
        raise plan.scenario.located(ScenarioError(problems[:MOST_SHOWN]))


def remaining(plan: DesignPlan, known: Mapping[int, CaseOutcome]) -> list[CaseTask]:
    """The cases still to be solved."""
    return [task for task in plan.tasks if task.index not in known]


def design_study(
    scenario: Scenario | DesignPlan,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    known: Iterable[CaseOutcome] = (),
    each: Callable[[CaseOutcome], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> DesignsResult:
    """Solve every case of a scenario with ``vary``.

    The result does not depend on the number or kind of workers, or on which outcomes were known before.

    Parameters
    ----------
    scenario : with ``vary``; or its plan from `plan_designs`, already checked by `check_cases`. Each case is a sweep if
        there is a section ``sweep``, else a run.
    workers : number of processes on this machine; by default the number of processors.
    scheduler : address of a Dask scheduler whose workers are used instead.
    known : outcomes of an earlier, unfinished study.
    each : called with every new outcome, in the order of completion.
    progress : called with the fraction of cases done.

    Raises
    ------
    ScenarioError
        If the scenario of a case is invalid.
    NotTrustedError
        If workers end unexpectedly; `each` has been called for all solved cases.
    """
    begin = clock.perf_counter()
    if isinstance(scenario, DesignPlan):
        plan = scenario
    else:
        plan = plan_designs(scenario)
        check_cases(plan)
    outcomes = {outcome.index: outcome for outcome in known}
    tasks = remaining(plan, outcomes)
    if progress is not None:
        progress(len(outcomes) / len(plan.tasks))
    for outcome in _solved(tasks, workers, scheduler):
        outcomes[outcome.index] = outcome
        if each is not None:
            each(outcome)
        if progress is not None:
            progress(len(outcomes) / len(plan.tasks))
    return gather(plan, outcomes, clock.perf_counter() - begin)


def gather(plan: DesignPlan, outcomes: Mapping[int, CaseOutcome], wall_time_s: float = 0.0) -> DesignsResult:
    """Collect the outcomes, possibly of some cases only, in one table."""
    solved = np.zeros(len(plan.tasks), dtype=bool)
    failed = [outcomes[k] for k in sorted(outcomes) if not outcomes[k].outcome.complete]
    good = [outcomes[k] for k in sorted(outcomes) if outcomes[k].outcome.complete]
    solved[[outcome.index for outcome in good]] = True
    responses = _responses(plan, good)
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    margins, where = _margins(plan, responses, limits)
    failures = tuple(CaseFailure(o.index, plan.tasks[o.index].values, o.outcome) for o in failed)
    missing = len(plan.tasks) - len(outcomes)
    return DesignsResult(
        scenario=plan.scenario,
        analysis=plan.analysis,
        kind=plan.kind,
        outcome=_outcome(len(plan.tasks), missing, failures),
        coordinates=plan.coordinates,
        solved=solved.reshape(plan.shape),
        responses=responses,
        margins=margins,
        limits=limits,
        failures=failures,
        warnings=(*plan.scenario.warnings, *_about_seeds(plan)),
        wall_time_s=wall_time_s,
        fingerprint=plan.fingerprint,
    ).with_summary(
        solved=len(good),
        failed=len(failed),
        responses=_extremes(plan, responses),
        margins=_worst_margins(plan, margins, where, limits) if limits else None,
        processor_time_s=float(sum(o.processor_time_s for o in outcomes.values())),
    )


def _solved(tasks: list[CaseTask], workers: int | None, scheduler: str | None) -> Iterator[CaseOutcome]:
    if not tasks:
        return iter(())
    if scheduler is not None:
        return on_cluster(solve_case, tasks, scheduler, warm_up)
    return on_this_machine(solve_case, tasks, workers or default_workers(), warm_up)


def _base(scenario: Scenario) -> dict[str, Any]:
    """The scenario as plain data, without unused sections; an automatic sample rate is chosen again for each case."""
    base: dict[str, Any] = scenario.model_dump(mode="json", by_alias=True, exclude_none=True)
    # a sweep computes stress and gap only if there are limits on them; a run always does
    unused = ("vary", "title", "identify_stiffness", "nnm", *(("limits",) if scenario.sweep is None else ()))
    for key in unused:
        base.pop(key, None)
    if "run" in base:
        base["run"].setdefault("convergence", "off")
    if "run" in base and scenario.automatic_sample_rate:
        base["run"].pop("sample_rate", None)
    if scenario.sweep is not None and not scenario.sweep.levels:
        del base["sweep"]["levels"]  # an empty list is refused
    return base


def _varies_seed(places: Iterable[Iterable[Place]]) -> bool:
    """Whether the study draws several realisations of a random input, whose scatter it shows."""
    return any(place == ("excitation", "seed") for of_parameter in places for place in of_parameter)


def _about_seeds(plan: DesignPlan) -> list[str]:
    """What the scatter between the seeds of a random input means."""
    task = plan.tasks[0]
    if not _varies_seed(task.places):
        return []
    if task.base["excitation"]["amplitudes"] == "random":
        return [
            "the seeds are realisations of a Gaussian process (excitation.amplitudes: random): they scatter as records "
            "of this duration do"
        ]
    return [
        "excitation.amplitudes = fixed: the seeds scatter less than records of a Gaussian process of this duration; "
        "leave it out if the scatter matters"
    ]


def _fingerprint(base: Mapping[str, Any], places: Any, columns: Any, kind: str, analysis: str) -> str:
    text = json.dumps([analysis, kind, base, places, columns], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _array(column: list[Value]) -> NDArray[Any]:
    if any(isinstance(value, str) for value in column):
        return np.array([value if isinstance(value, str) else f"{value:g}" for value in column])
    return np.array(column, dtype=float)


def _values(parameter: VariedParameter) -> list[Value]:
    if parameter.values:
        return list(parameter.values)
    spaced = np.geomspace if parameter.spacing == "logarithmic" else np.linspace
    values = spaced(parameter.low, parameter.high, parameter.points)
    values[0], values[-1] = parameter.low, parameter.high
    return [*dict.fromkeys(int(v) for v in np.rint(values))] if parameter.whole else values.tolist()


def _latin_hypercube(varied: tuple[VariedParameter, ...], samples: int, seed: int) -> list[list[Value]]:
    """Sample the unit cube and map each column by the inverse distribution of its parameter."""
    from scipy.stats import truncnorm
    from scipy.stats.qmc import LatinHypercube as Sampler

    cube = Sampler(len(varied), rng=np.random.default_rng(seed)).random(samples)
    columns: list[list[Value]] = []
    for parameter, u in zip(varied, cube.T, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.spacing == "logarithmic":
            values = low * (high / low) ** u
        elif parameter.distribution == "normal":
            deviation = truncnorm.ppf(u, -NORMAL_REACH, NORMAL_REACH) / NORMAL_REACH
            values = 0.5 * (low + high) + 0.5 * (high - low) * deviation
        elif parameter.whole:
            values = np.minimum(np.floor(low + u * (high - low + 1.0)), high)
        else:
            values = low + u * (high - low)
        columns.append([int(v) for v in values] if parameter.whole else values.tolist())
    return columns


def _responses(plan: DesignPlan, outcomes: list[CaseOutcome]) -> dict[str, Response]:
    names = dict.fromkeys(name for outcome in outcomes for name in outcome.values)
    responses: dict[str, Response] = {}
    for name in names:
        widths = {len(v) for o in outcomes if isinstance(v := o.values.get(name), list)}
        table = np.full((len(plan.tasks), max(widths, default=1)), np.nan)
        for outcome in outcomes:
            given = outcome.values.get(name, math.nan)
            row = given if isinstance(given, list) else [given]
            table[outcome.index, : len(row)] = row
        table = table if widths else table[:, 0]
        responses[name] = Response(name, table.reshape(plan.shape + table.shape[1:]), *describe(name))
    return responses


def _margins(
    plan: DesignPlan, responses: Mapping[str, Response], limits: Mapping[str, float]
) -> tuple[dict[str, Response], dict[str, tuple[Floats, NDArray[np.str_]]]]:
    """Margin of every case, and the value and place that determine it."""
    margins, where = {}, {}
    for name, limit in limits.items():
        compared = [
            r for r in responses.values() if r.quantity == LIMITED_QUANTITIES[name] and is_scalar(r, plan.shape)
        ]
        if not compared:
            continue
        values = np.stack([r.values.ravel() for r in compared])
        decisive = np.where(np.isnan(values), -np.inf, values).argmax(axis=0)
        worst = values[decisive, np.arange(values.shape[1])]
        where[name] = worst, np.array([r.place for r in compared])[decisive]
        margin = np.array([margin_of(limit, float(value)) for value in worst]).reshape(plan.shape)
        margins[name] = Response(name, margin, "1", f"limits.{name} / value - 1")
    return margins, where


def _worst_margins(
    plan: DesignPlan,
    margins: Mapping[str, Response],
    where: Mapping[str, tuple[Floats, NDArray[np.str_]]],
    limits: Mapping[str, float],
) -> dict[str, Any]:
    summary = {}
    for name, response in margins.items():
        flat = response.values.ravel()
        if not np.any(np.isfinite(flat) | np.isposinf(flat)):
            continue
        case = int(np.nanargmin(flat))
        values, places = where[name]
        summary[name] = {
            "limit": limits[name],
            "value": float(values[case]),
            "margin": float(flat[case]),
            "at": str(places[case]),
            "exceeded": bool(values[case] > limits[name]),
            "case": case,
            "parameters": _named(plan, case),
            "cases_exceeding": int(np.sum(values > limits[name])),
        }
    return summary


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
        if plan.kind == "latin_hypercube":
            known = flat[np.isfinite(flat)]
            summary[name] |= {
                "mean": float(known.mean()),
                "standard_deviation": float(known.std(ddof=1)) if known.size > 1 else math.nan,
                "quantile_5_percent": float(np.quantile(known, 0.05)),
                "quantile_95_percent": float(np.quantile(known, 0.95)),
            }
    return summary


def _named(plan: DesignPlan, case: int) -> dict[str, Value]:
    return {c.path: v for c, v in zip(plan.coordinates, plan.tasks[case].values, strict=True)}


def _assigned(coordinate: Coordinate, value: Value) -> str:
    shown = value if isinstance(value, str) else f"{value:.6g}"
    return f"{coordinate.path} = {shown} {coordinate.unit if coordinate.unit != '1' else ''}".rstrip()


def _outcome(cases: int, missing: int, failures: tuple[CaseFailure, ...]) -> Outcome:
    parts = []
    if missing:
        parts.append(Outcome.of(OutcomeCode.CASES_MISSING, done=cases - missing, cases=cases))
    if failures:
        first = failures[0]
        parts.append(
            Outcome.of(
                OutcomeCode.CASES_FAILED, failed=len(failures), cases=cases, case=first.case + 1,
                reason=first.outcome.text,
            )
        )  # fmt: skip
    return parts[0].but(*parts[1:]) if parts else COMPLETE
