"""The cases of a design study or an ensemble: which there are, and whether each is valid."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.cases import CaseTask, Place, Study, analysis_of
from beamsim.analyses.designs.choice import Objective
from beamsim.analyses.designs.realisations import Realisations
from beamsim.analyses.designs.responses import QUANTITIES
from beamsim.analyses.designs.result import (
    Coordinate,
)
from beamsim.analyses.designs.sampling import latin_hypercube, listed_values, sobol
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import plain, suggestion
from beamsim.scenario.designs import LatinHypercube, Sobol, Vary
from beamsim.scenario.input_files import named_files
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.scenario.parameters import value_at, with_values
from beamsim.scenario.varied import Value, VariedParameter, drawn_parameters, varied_parameters
from beamsim.typing import Ints

MOST_CHECKED = 400  # cases checked before the first is solved


MOST_SHOWN = 5  # problems and failures in a message


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
    cases: Ints  # numbers of those that are meant, all or some; a case's realisations follow each other
    realisations: Realisations

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
        design, realisation = divmod(case, self.realisations.count)
        rest = design
        for column in reversed(self.columns):
            rest, k = divmod(rest, len(column)) if self.grid else (rest, design)
            values.append(column[k])
        of_case = values[::-1]
        return CaseTask(case, self.study, self.realisations.values(of_case, self._further(of_case), realisation))

    def _further(self, of_case: Sequence[Value]) -> list[float]:
        """The numbers that only have a tolerance, as they are in a case."""
        numbers = [parameter.number for parameter in self.realisations.further]
        try:
            scenario = self.study.scenario(of_case) if numbers else None
        except ScenarioError:  # reported where the case is checked or solved
            scenario = None
        return [float(n.nominal if scenario is None else value_at(scenario, n.places[0])) for n in numbers]


@dataclass(frozen=True)
class DesignPlan:
    """The cases to be computed, in order."""

    scenario: Scenario
    kind: str
    coordinates: tuple[Coordinate, ...]
    shape: tuple[int, ...]
    tasks: CaseTasks

    @property
    def realisations(self) -> Realisations:
        """What each case is within tolerances."""
        return self.tasks.realisations

    def named(self, values: Sequence[Value]) -> dict[str, Value]:
        """The values of a task by path."""
        paths = (*(c.path for c in self.coordinates), *(p.number.path for p in self.realisations.further))
        return dict(zip(paths, values, strict=True))

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
    asked = _asked(scenario, vary.responses, "vary.responses", objective)
    return _plan(scenario, vary.kind, varied, columns, asked, Realisations.of(scenario))


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
        If a path does not exist or names the same number as another one, a value is not one of its field, or numbers of
        values differ.
    """
    if not draws:
        raise ScenarioError(Problem("draws", "is empty", "give values by path: {'snubbers.tip.gap': [0.0, 1e-4]}"))
    varied = drawn_parameters(scenario, _listed(draws))
    columns = [list(parameter.values) for parameter in varied]
    responses = (responses,) if isinstance(responses, str) else responses
    return _plan(scenario, "draws", varied, columns, _asked(scenario, responses, "responses"), Realisations())


def _listed(draws: Mapping[str, Sequence[Value] | NDArray[Any]]) -> dict[str, list[Any]]:
    """The values of each path; raises a ScenarioError where they are no row of numbers or words."""
    listed, problems = dict[str, list[Any]](), []
    for path, values in draws.items():
        try:
            array = np.asarray(values)
        except ValueError:  # lists of different lengths
            array = np.empty((0, 0))
        if array.ndim != 1:
            what = f"an array of the shape {array.shape}" if array.size else "no array"
            what = "a single value" if array.ndim == 0 else what
            problems.append(Problem(f"draws[{path!r}]", f"is {what}", "give one value for each case, a row of them"))
        elif array.size and array.dtype.kind not in "biufUO":
            problems.append(
                Problem(f"draws[{path!r}]", f"has values of type {array.dtype}", "give real numbers or text")
            )
        else:
            listed[path] = array.tolist()
    if problems:
        raise ScenarioError(problems)
    return listed


def check_cases(plan: DesignPlan) -> None:
    """Check that the scenario of each case is valid; of many cases only an evenly spaced selection.

    Raises
    ------
    ScenarioError
        With the first invalid cases and their problems.
    """
    problems: list[Problem] = []
    units = {c.path: c.unit for c in plan.coordinates}
    units |= {p.number.path: p.number.unit for p in plan.realisations.further}
    step = max(1, -(-len(plan.tasks) // MOST_CHECKED))
    chosen = sorted({*range(0, len(plan.tasks), step), len(plan.tasks) - 1})
    for task in (plan.tasks[k] for k in chosen):
        try:
            plan.study.scenario(task.values)
        except ScenarioError as error:
            named = ", ".join(_assigned(path, value, units) for path, value in plan.named(task.values).items())
            problems += [
                Problem("vary", f"with {named}: {p.path} {p.message}", p.remedy or "leave out such cases")
                for p in error.problems
            ]
        if len(problems) >= MOST_SHOWN:
            break
    if problems:
        raise plan.scenario.located(ScenarioError(problems[:MOST_SHOWN]))


def _check_objective(scenario: Scenario, vary: Vary) -> None:
    for key in ("minimise", "maximise"):
        if name := getattr(vary, key):
            _check_response(scenario, name, f"vary.{key}")


def _check_response(scenario: Scenario, name: str, where: str) -> None:
    quantity = name.rpartition("/")[2]
    if quantity not in QUANTITIES:
        remedy = suggestion(quantity, QUANTITIES, "the quantities are")
        raise scenario.located(ScenarioError(Problem(where, f"= {name} is not a response", remedy)))
    *_, section, place = ("", "", *name.split("/")[:-1])
    if section in ("probes", "snubbers", "outputs"):
        known = [item.name for item in getattr(scenario, section)]
        if known and place not in known:
            remedy = suggestion(place, known, f"the {section} are")
            raise scenario.located(ScenarioError(Problem(where, f"= {name} names no response: no {place}", remedy)))


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
    realisations: Realisations,
) -> DesignPlan:
    places = (*(parameter.places for parameter in varied), *realisations.further_places)
    case = _case(scenario, varies_seed(places))
    analysis = analysis_of(scenario)
    contents = {key: record.get("sha256") for key, record in scenario.file_records(since=math.inf).items()}
    further = [*([asked] if asked else []), *realisations.as_data(), *([contents] if contents else [])]
    fingerprint = _fingerprint(plain(case), places, columns, kind, analysis, further)
    study = Study(analysis, _with_whole_paths(case, scenario), places, asked, fingerprint)
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
        tasks=CaseTasks(study, tuple(columns), grid, np.arange(math.prod(shape) * realisations.count), realisations),
    )


def _case(scenario: Scenario, seed_varies: bool) -> Scenario:
    """The scenario without unused sections; noise of several seeds has random amplitudes where nothing else is said."""
    # a sweep computes stress and gap only if there are limits on them; a run always does
    unused = ("vary", "identify_stiffness", "nnm", *(("limits",) if scenario.sweep is None else ()))
    case = scenario.model_copy(update={**dict.fromkeys(unused), "title": ""}).with_source(scenario.source)
    for name in ("run", "sweep"):
        section = getattr(case, name)
        if section is not None and section.convergence is None:
            case = with_values(case, {(name, "convergence"): "off"})
    if seed_varies and getattr(case.excitation, "amplitudes", None) is None:
        case = with_values(case, {("excitation", "amplitudes"): "random"})
    return case


def _with_whole_paths(case: Scenario, scenario: Scenario) -> Scenario:
    """The case with the paths of files from the root, since it has no folder that they could be relative to."""
    files = {at: str((scenario.folder_of(*at) / name).absolute()) for at, name in named_files(case)}
    return with_values(case, files)


def varies_seed(places: Iterable[Iterable[Place]]) -> bool:
    """Whether the study draws several realisations of a random input, whose scatter it shows."""
    return any(place == ("excitation", "seed") for of_parameter in places for place in of_parameter)


def _fingerprint(
    base: Mapping[str, Any], places: Any, columns: Any, kind: str, analysis: str, further: list[Any]
) -> str:  # fmt: skip
    text = json.dumps([analysis, kind, base, places, columns, *further], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _array(column: list[Value]) -> NDArray[Any]:
    if any(isinstance(value, str) for value in column):
        return np.array([value if isinstance(value, str) else f"{value:g}" for value in column])
    return np.array(column, dtype=float)


def _assigned(path: str, value: Value, units: Mapping[str, str]) -> str:
    shown = value if isinstance(value, str) else f"{value:.6g}"
    return f"{path} = {shown} {units[path] if units[path] != '1' else ''}".rstrip()
