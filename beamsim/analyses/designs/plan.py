"""The cases of a design study or an ensemble: which there are, and whether each is valid."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.designs.cases import Case, Study, analysis_of
from beamsim.analyses.designs.choice import Objective
from beamsim.analyses.designs.realisations import Realisations
from beamsim.analyses.designs.responses import QUANTITIES
from beamsim.analyses.designs.result import Coordinate
from beamsim.analyses.designs.sampling import latin_hypercube, listed_values, sobol
from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.base import Path, plain, suggestion
from beamsim.scenario.parameters import Value, VariedParameter, drawn_parameters, varied_parameters, with_values
from beamsim.scenario.reporting import OF_OUTPUTS
from beamsim.scenario.scenario import named_files
from beamsim.scenario.studies import LatinHypercube, Sobol, Vary

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
class DesignPlan:
    """The cases to be computed, in order; the realisations of a case within its tolerances follow each other."""

    scenario: Scenario
    kind: str
    coordinates: tuple[Coordinate, ...]
    shape: tuple[int, ...]
    study: Study
    cases: tuple[Case, ...]

    @property
    def realisations(self) -> Realisations:
        """What each case is within tolerances."""
        return self.study.realisations

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
    step = max(1, -(-len(plan.cases) // MOST_CHECKED))
    for case in (*plan.cases[:-1:step], plan.cases[-1]):
        try:
            plan.study.scenario(case)
        except ScenarioError as error:
            named = ", ".join(_assigned(c, value) for c, value in zip(plan.coordinates, case.values, strict=True))
            within = " and within tolerances" if case.realisation else ""
            problems += [
                Problem("vary", f"with {named}{within}: {p.path} {p.message}", p.remedy or "leave out such cases")
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
    places = tuple(parameter.places for parameter in varied)
    case = _case(scenario, varies_seed(places))
    analysis = analysis_of(scenario)
    contents = {key: record.get("sha256") for key, record in scenario.file_records(since=math.inf).items()}
    all_of_it = [analysis, kind, plain(case), places, columns, asked, realisations.as_data(), contents]
    fingerprint = hashlib.sha256(json.dumps(all_of_it, sort_keys=True).encode()).hexdigest()
    rows = product(*columns) if kind == "grid" else zip(*columns, strict=True)
    each = product(rows, range(realisations.count))
    return DesignPlan(
        scenario=scenario,
        kind=kind,
        coordinates=tuple(
            Coordinate(parameter.path, _array(column), parameter.unit)
            for parameter, column in zip(varied, columns, strict=True)
        ),
        shape=tuple(len(c) for c in columns) if kind == "grid" else (len(columns[0]),),
        study=Study(analysis, _with_whole_paths(case, scenario), places, realisations, asked, fingerprint),
        cases=tuple(Case(k, values, realisation) for k, (values, realisation) in enumerate(each)),
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


def varies_seed(places: Iterable[Iterable[Path]]) -> bool:
    """Whether the study draws several realisations of a random input, whose scatter it shows."""
    return any(place == ("excitation", "seed") for of_parameter in places for place in of_parameter)


def _array(column: list[Value]) -> NDArray[Any]:
    if any(isinstance(value, str) for value in column):
        return np.array([value if isinstance(value, str) else f"{value:g}" for value in column])
    return np.array(column, dtype=float)


def _assigned(coordinate: Coordinate, value: Value) -> str:
    shown, unit = value if isinstance(value, str) else f"{value:.6g}", coordinate.unit
    return f"{coordinate.path} = {shown} {unit if unit != '1' else ''}".rstrip()
