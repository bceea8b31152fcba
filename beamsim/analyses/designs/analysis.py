"""Design studies: many cases of one scenario, solved by workers and collected in a table of responses."""

from __future__ import annotations

import hashlib
import json
import math
import time as clock
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from threading import Event
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.cases import CaseSolver, CaseTask, Place, Study, analysis_of, solve_case, warm_up
from beamsim.analyses.designs.choice import Objective, best_cases, passing_cases
from beamsim.analyses.designs.responses import QUANTITIES, describe
from beamsim.analyses.designs.result import (
    CaseFailure,
    CaseOutcome,
    Coordinate,
    DesignsResult,
    Response,
    SobolIndices,
    is_scalar,
    responses_of,
)
from beamsim.analyses.designs.sampling import latin_hypercube, listed_values, sobol
from beamsim.analyses.designs.sensitivity import sensitivities
from beamsim.analyses.designs.table import CaseTable
from beamsim.analyses.limits import margin_of
from beamsim.analyses.parallel import default_workers, on_cluster, on_this_machine, on_threads
from beamsim.errors import Problem, ScenarioError
from beamsim.outcomes import COMPLETE, Outcome, OutcomeCode
from beamsim.scenario.base import suggestion
from beamsim.scenario.designs import LatinHypercube, Sobol, VariedParameter, Vary, drawn_parameters, varied_parameters
from beamsim.scenario.draws import Draws
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.system.outputs import output_units
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario import Scenario

Value = float | str

MOST_CHECKED = 400  # cases checked before the first is solved
MOST_SHOWN = 5  # problems and failures in a message

SAMPLES = (
    "latin_hypercube",
    "sobol",
    "draws",
)  # kinds of studies that have statistics
THREADED = ("run", "swept_sine")  # analyses whose time is spent in compiled code, which threads execute side by side


def limited_response(limit: str) -> str:
    """The end of the names of the responses that a limit is compared with.

    >>> limited_response("gap"), limited_response("outputs.clamp")
    ('largest_gap', 'outputs/clamp/peak_output')
    """
    if limit.startswith(OF_OUTPUTS):
        return f"outputs/{limit.removeprefix(OF_OUTPUTS)}/peak_output"
    return "largest_gap" if limit == "gap" else limit


@dataclass(frozen=True)
class CaseTasks(Sequence[CaseTask]):
    """The cases in order, each made when it is asked for."""

    study: Study
    columns: tuple[Sequence[Value], ...]  # of values, one a parameter
    grid: bool  # every combination, the last column varying fastest; else row by row
    cases: Ints  # numbers of those that are meant, all or some

    def __len__(self) -> int:
        return int(self.cases.size)

    @overload
    def __getitem__(self, index: int) -> CaseTask: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[CaseTask]: ...
    def __getitem__(self, index: int | slice) -> CaseTask | Sequence[CaseTask]:
        if isinstance(index, slice):
            return replace(self, cases=self.cases[index])
        case, values = int(self.cases[index]), []
        rest = case
        for column in reversed(self.columns):
            rest, k = divmod(rest, len(column)) if self.grid else (rest, case)
            values.append(column[k])
        return CaseTask(case, self.study, tuple(reversed(values)))


@dataclass(frozen=True)
class DesignPlan:
    """The cases to be computed, in order."""

    scenario: Scenario
    kind: str
    coordinates: tuple[Coordinate, ...]
    shape: tuple[int, ...]
    tasks: CaseTasks

    @property
    def study(self) -> Study:
        """What the cases share."""
        return self.tasks.study

    @property
    def fingerprint(self) -> str:
        """Hash of all that the responses depend on."""
        return self.study.fingerprint


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
    varied = varied_parameters(scenario)
    if isinstance(vary, LatinHypercube):
        columns = latin_hypercube(varied, vary.samples, vary.seed)
    elif isinstance(vary, Sobol):
        columns = sobol(varied, vary.samples, vary.seed)
    else:
        columns = [listed_values(parameter) for parameter in varied]
    _check_objective(scenario, vary)
    objective = Objective.of(vary).response
    return _plan(scenario, vary.kind, varied, columns, _asked(scenario, vary.responses, "vary.responses", objective))


def plan_draws(
    scenario: Scenario, draws: Mapping[str, Sequence[Value] | NDArray[Any]], responses: Sequence[str] = ()
) -> DesignPlan:
    """List the cases of an ensemble: one for each draw of the numbers.

    Parameters
    ----------
    scenario : with a ``run``, or a ``sweep``; what it says in ``vary`` is not used.
    draws : by path of a number of the scenario its values, all equally many: SI numbers, or text with units.
    responses : quantities or names of responses that are computed, by default all.

    Raises
    ------
    ScenarioError
        If a path does not exist, a value is not one of its field, or numbers of values differ.
    """
    if not draws:
        raise ScenarioError(Problem("draws", "is empty", "give values by path: {'snubbers.tip.gap': [0.0, 1e-4]}"))
    varied = drawn_parameters(scenario, {path: list(np.asarray(values).tolist()) for path, values in draws.items()})
    columns = [list(parameter.values) for parameter in varied]
    return _plan(scenario, "draws", varied, columns, _asked(scenario, responses, "responses"))


def _check_objective(scenario: Scenario, vary: Vary) -> None:
    for key in ("minimise", "maximise"):
        if name := getattr(vary, key):
            _check_response(scenario, name, f"vary.{key}")


def _check_response(scenario: Scenario, name: str, where: str) -> None:
    quantity = name.rpartition("/")[2]
    if quantity not in QUANTITIES:
        remedy = suggestion(quantity, QUANTITIES, "the quantities are")
        raise scenario.located(ScenarioError(Problem(where, f"= {name} is not a response", remedy)))


def _asked(scenario: Scenario, responses: Sequence[str], where: str, objective: str = "") -> tuple[str, ...]:
    """The responses asked for, the objective, and those that limits are compared with; empty for all."""
    for k, name in enumerate(responses):
        _check_response(scenario, name, f"{where}[{k}]")
    if not responses:
        return ()
    limits = () if scenario.limits is None else scenario.limits.given
    needed = (objective,) if objective else ()
    return tuple(dict.fromkeys((*responses, *needed, *(limited_response(name).rpartition("/")[2] for name in limits))))


def _plan(
    scenario: Scenario,
    kind: str,
    varied: tuple[VariedParameter, ...],
    columns: list[list[Value]],
    asked: tuple[str, ...],
) -> DesignPlan:
    base = _base(scenario)
    places = tuple(parameter.places for parameter in varied)
    if _varies_seed(places):
        base["excitation"].setdefault("amplitudes", "random")
    analysis = analysis_of(scenario)
    fingerprint = _fingerprint(base, places, columns, kind, analysis, asked)
    study = Study(analysis, _with_whole_paths(base, scenario), places, asked, fingerprint)
    grid = kind == "grid"
    shape = tuple(len(c) for c in columns) if grid else (len(columns[0]),)
    return DesignPlan(
        scenario=scenario,
        kind=kind,
        coordinates=tuple(
            Coordinate(parameter.path, _array(column), parameter.unit)
            for parameter, column in zip(varied, columns, strict=True)
        ),
        shape=shape,
        tasks=CaseTasks(study, tuple(columns), grid, np.arange(math.prod(shape))),
    )


def check_cases(plan: DesignPlan) -> None:
    """Check that the scenario of each case is valid; of many cases only an evenly spaced selection.

    Raises
    ------
    ScenarioError
        With the first invalid cases and their problems.
    """
    problems: list[Problem] = []
    draws = Draws(plan.study.base, plan.study.places)
    step = max(1, -(-len(plan.tasks) // MOST_CHECKED))
    chosen = sorted({*range(0, len(plan.tasks), step), len(plan.tasks) - 1})
    for task in (plan.tasks[k] for k in chosen):
        try:
            draws.scenario(task.values)
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
    table = CaseTable(len(plan.tasks), known)
    if progress is not None:
        progress(table.count / len(plan.tasks))
    for outcome in _solved(plan, table, workers, scheduler):
        table.add(outcome)
        if each is not None:
            each(outcome)
        if progress is not None:
            progress(table.count / len(plan.tasks))
    return gather(plan, table, clock.perf_counter() - begin)


def gather(plan: DesignPlan, table: CaseTable, wall_time_s: float = 0.0) -> DesignsResult:
    """The result of the cases in a table, which may be some of them only."""
    units = output_units(plan.scenario)
    responses = {
        name: Response(name, column.reshape(plan.shape + column.shape[1:]).copy(), *describe(name, units))
        for name, column in table.columns.items()
    }
    limits = {} if plan.scenario.limits is None else plan.scenario.limits.given
    margins, where = _margins(plan, responses, limits)
    solved = table.solved.reshape(plan.shape)
    passing = passing_cases(margins, solved)
    objective = Objective.of(plan.scenario.vary)
    chosen = plan.kind not in SAMPLES or bool(objective.response)  # the best of many parts is no choice
    best = best_cases(objective, responses, margins, passing) if chosen else []
    sensitivity, gaps = sensitivities(responses, len(plan.coordinates)) if plan.kind == "sobol" else ((), [])
    failures = tuple(
        CaseFailure(k, plan.tasks[k].values, table.failures[k].outcome) for k in sorted(table.failures)
    )  # fmt: skip
    return DesignsResult(
        scenario=plan.scenario,
        analysis=plan.study.analysis,
        kind=plan.kind,
        outcome=_outcome(len(plan.tasks), len(plan.tasks) - table.count, failures),
        coordinates=plan.coordinates,
        solved=solved,
        responses=responses,
        margins=margins,
        limits=limits,
        passing=passing if limits else None,
        sensitivity=sensitivity,
        failures=failures,
        warnings=(*plan.scenario.warnings, *_about_seeds(plan), *_about_choice(plan, objective, responses, gaps)),
        wall_time_s=wall_time_s,
        fingerprint=plan.fingerprint,
    ).with_summary(
        solved=table.count - len(failures),
        failed=len(failures),
        responses=_extremes(plan, responses),
        passing=int(passing.sum()) if limits else None,
        objective=objective.text if best else None,
        best=[{**item, "parameters": _named(plan, item["case"])} for item in best] or None,
        margins=_worst_margins(plan, margins, where, limits) if limits else None,
        sensitivity={item.name: _by_parameter(plan, item) for item in sensitivity} or None,
        processor_time_s=table.processor_time_s,
    )


def _about_choice(
    plan: DesignPlan, objective: Objective, responses: Mapping[str, Response], gaps: Sequence[str]
) -> Iterator[str]:
    """What the choice of a case and the indices lack."""
    if objective.response and responses and objective.values(responses, plan.shape) is None:
        scalar = [name for name, response in responses.items() if is_scalar(response, plan.shape)]
        key = "maximise" if objective.largest else "minimise"
        yield f"vary.{key} = {objective.response}: no case has such a response; they have {', '.join(scalar)}"
    if gaps:
        yield f"no Sobol' indices of {', '.join(gaps)}, which are not known in all cases"


def _by_parameter(plan: DesignPlan, indices: SobolIndices) -> dict[str, dict[str, float]]:
    names = ("first_order", "first_order_low", "first_order_high", "total_order", "total_order_low", "total_order_high")
    return {c.path: {name: float(getattr(indices, name)[k]) for name in names} for k, c in enumerate(plan.coordinates)}


def _solved(plan: DesignPlan, table: CaseTable, workers: int | None, scheduler: str | None) -> Iterator[CaseOutcome]:
    """The cases that are not in the table yet, in the order of completion."""
    tasks = replace(plan.tasks, cases=np.flatnonzero(~table.known))
    if not tasks:
        return iter(())
    if scheduler is not None:
        return on_cluster(solve_case, tasks, scheduler, warm_up)
    count = workers or default_workers()
    if plan.study.analysis not in THREADED:
        return on_this_machine(solve_case, tasks, count, warm_up)
    interrupted = Event()
    solver = CaseSolver(plan.study, interrupted.is_set)
    return on_threads(solver.solve, tasks, count, interrupted.set)


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


def _with_whole_paths(base: dict[str, Any], scenario: Scenario) -> dict[str, Any]:
    """The plain data with the paths of files from the root, since it has no folder that they could be relative to."""
    for place in (("excitation", "file"), ("run", "start", "orbit")):
        owner: Any = base
        for key in place[:-1]:
            owner = owner.get(key) if isinstance(owner, dict) else None
        if isinstance(owner, dict) and place[-1] in owner:
            owner[place[-1]] = str((scenario.folder_of(*place) / owner[place[-1]]).absolute())
    for name, body in scenario.bodies.items():
        placed = body.in_folder(partial(scenario.folder_of, *scenario.body_path(name)))
        if placed != body:
            base["bodies"][name] = placed.model_dump(mode="json", by_alias=True, exclude_none=True)
    return base


def _varies_seed(places: Iterable[Iterable[Place]]) -> bool:
    """Whether the study draws several realisations of a random input, whose scatter it shows."""
    return any(place == ("excitation", "seed") for of_parameter in places for place in of_parameter)


def _about_seeds(plan: DesignPlan) -> list[str]:
    """What the scatter between the seeds of a random input means."""
    if not _varies_seed(plan.study.places):
        return []
    if plan.study.base["excitation"]["amplitudes"] == "random":
        return [
            "the seeds are realisations of a Gaussian process (excitation.amplitudes: random): they scatter as records "
            "of this duration do"
        ]
    return [
        "excitation.amplitudes = fixed: the seeds scatter less than records of a Gaussian process of this duration; "
        "leave it out if the scatter matters"
    ]


def _fingerprint(
    base: Mapping[str, Any], places: Any, columns: Any, kind: str, analysis: str, asked: tuple[str, ...]
) -> str:
    text = json.dumps([analysis, kind, base, places, columns, *([asked] if asked else [])], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _array(column: list[Value]) -> NDArray[Any]:
    if any(isinstance(value, str) for value in column):
        return np.array([value if isinstance(value, str) else f"{value:g}" for value in column])
    return np.array(column, dtype=float)


def _margins(
    plan: DesignPlan, responses: Mapping[str, Response], limits: Mapping[str, float]
) -> tuple[dict[str, Response], dict[str, tuple[Floats, NDArray[np.str_]]]]:
    """Margin of every case, and the value and place that determine it."""
    margins, where = {}, {}
    for name, limit in limits.items():
        compared = [r for r in responses_of(responses, limited_response(name)) if is_scalar(r, plan.shape)]
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
        if plan.kind in SAMPLES:
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
