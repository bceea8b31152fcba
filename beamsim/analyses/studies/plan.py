"""Cases of a design study or an ensemble: their list and their validity."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.studies.objectives import objectives
from beamsim.analyses.studies.responses import begins_response, limited_response
from beamsim.cases import Case
from beamsim.errors import Problem, ScenarioError
from beamsim.results.values import BY_NAME, parameter_label
from beamsim.scenario import Scenario, Source, scenario_of
from beamsim.scenario.base import Path, as_plain_data, suggestion
from beamsim.scenario.parameters import replace_values, value_at, with_values
from beamsim.scenario.studies import (
    Correlation,
    LatinHypercube,
    OneAtATime,
    Optimise,
    Reliability,
    Sobol,
    ToleratedParameter,
    Value,
    VariedParameter,
    drawn_parameters,
    tolerances_of,
    tolerated_parameters,
    varied_parameters,
)
from beamsim.typing import Floats

MOST_CHECKED = 400  # number of cases checked before the first is solved
# analyses of a case: a run, static equilibrium, or the kind of sweep
ANALYSES = ("run", "static", "swept_sine", "stepped", "continuation")
MOST_SHOWN = 5  # problems and failures in one message


@dataclass(frozen=True)
class Realisations:
    """Sample of deviations, the same for every case; without tolerances only the case itself."""

    parameters: tuple[ToleratedParameter, ...] = ()
    # (realisations, parameters) in shares of the tolerances, from -1 to 1; the first row is zero
    deviations: Floats = field(default_factory=lambda: np.zeros((1, 0)))
    quantile: float = 1.0  # quantile that judges a case, counted from the good side
    most_further_cases: int = 0  # largest number of realisations solved to find the worst of the best cases

    @classmethod
    def of(cls, scenario: Scenario) -> Realisations:
        """Plan of a scenario with ``vary``."""
        asked = tolerances_of(scenario)
        if asked is None:
            return cls()
        parameters = tolerated_parameters(scenario)
        units = tuple(replace(p.parameter, low=-1.0, high=1.0, spacing="linear") for p in parameters)
        sample: Any = latin_hypercube(units, asked.samples, asked.seed, asked.correlations)
        return cls(
            parameters,
            np.vstack([np.zeros(len(parameters)), np.transpose(sample)]),
            asked.quantile,
            asked.search_budget,
        )

    @property
    def count(self) -> int:
        """Number of realisations of each case, with the case itself."""
        return int(self.deviations.shape[0])

    @property
    def judged_by_worst(self) -> bool:
        """True if the worst realisation judges a case, not a quantile."""
        return self.count > 1 and self.quantile == 1.0

    def values(self, case: Scenario, deviations: Iterable[float]) -> dict[Path, float]:
        """Numbers of a realisation by place, from their values in the case and their deviations.

        Parameters
        ----------
        case : scenario without deviations.
        deviations : deviation of each number, as a share of its tolerance.
        """
        values: dict[Path, float] = {}
        for parameter, deviation in zip(self.parameters, deviations, strict=True):
            written = value_at(case, parameter.parameter.places[0])
            if written is None:
                message = "has a tolerance but no value in this case"
                raise ScenarioError.at(parameter.parameter.path, message, "leave out the tolerance, or such choices")
            nominal = float(written)
            value = nominal + float(deviation) * parameter.reach(nominal)
            values |= dict.fromkeys(parameter.parameter.places, value)
        return values

    def as_data(self) -> list[Any]:
        """Plain data that the cases depend on; empty without tolerances."""
        deviations = [] if self.count == 1 else self.deviations.tolist()
        return [
            *([x.path, p.share, x.low, x.high, x.places] for p in self.parameters for x in (p.parameter,)),
            *deviations,
        ]


class ParameterColumn(NamedTuple):
    """Varied parameter with its values in every case."""

    path: str  # in the scenario
    values: NDArray[Any]  # (cases,) SI numbers or words
    unit: str  # "1" for words

    @property
    def numeric(self) -> bool:
        """True if the values are numbers."""
        return self.values.dtype.kind == "f"

    @property
    def label(self) -> str:
        """Label of the parameter, such as ``tip gap`` for ``snubbers.tip.gap``."""
        return parameter_label(self.path)


@dataclass(frozen=True)
class Study:
    """Data shared by the cases of a study."""

    analysis: str
    case: Scenario  # as written
    parameters: tuple[VariedParameter, ...]
    realisations: Realisations
    requested: tuple[str, ...]  # responses; empty for all
    fingerprint: str

    def scenario(self, case: Case) -> Scenario:
        """Scenario of a case; raises a ScenarioError if it is invalid."""
        scenario = with_parameters(self.case, self.parameters, case.values)
        if case.realisation or case.deviations:
            deviations = case.deviations or self.realisations.deviations[case.realisation].tolist()
            scenario = with_values(scenario, self.realisations.values(scenario, deviations))
        if case.compared and self.analysis != "static":
            scenario = with_values(scenario, {(self.section, "convergence"): "on"})
        return scenario.recheck()

    @property
    def section(self) -> str:
        """Section of the scenario that defines the analysis of a case."""
        return "run" if self.analysis == "run" else "sweep"


def with_parameters(scenario: Scenario, parameters: Iterable[VariedParameter], values: Iterable[Value]) -> Scenario:
    """Copy of the scenario with values of varied parameters, choices of catalogues before numbers."""
    given = dict[Path, Value]()
    for parameter, value in zip(parameters, values, strict=True):
        scenario = replace_values(scenario, parameter.choices.get(str(value), {}))
        given |= dict.fromkeys(parameter.places, value)
    return with_values(scenario, given)


def design(scenario: Scenario, case: Mapping[str, Any]) -> Scenario:
    """Scenario of a case, given as an entry ``best`` or ``as_it_is`` of the summary or as numbers, without the study.

    Its file paths are absolute.
    """
    called, varied = f"design {case['case'] + 1}" if "case" in case else "design point", varied_parameters(scenario)
    title = f"{scenario.title}, {called}".removeprefix(", ")
    alone = scenario.model_copy(update={"vary": None, "optimise": None, "title": title})
    alone = replace_values(alone, scenario.whole_paths(alone))  # it has no folder for relative paths
    alone = with_random_amplitudes(alone, varied)
    return with_parameters(alone, varied, case["parameters"].values()).recheck()


@dataclass(frozen=True)
class StudyPlan:
    """Cases of a study that are to be computed, in order; the realisations of a case follow each other.

    Examples
    --------
    >>> import beamsim
    >>> plan = beamsim.plan_designs("configs/studies/design_stiffness_gap.yaml")
    >>> plan.kind, plan.points, len(plan.cases), plan.searches
    ('grid', (12, 15), 180, False)
    >>> plan.parameters[1].path, plan.parameters[1].unit, plan.parameters[1].values[:2].round(6).tolist()
    ('snubbers.tip.gap', 'm', [-0.0002, -0.00015])
    >>> {path: round(value, 5) for path, value in plan.values_in(0).items()}
    {'snubbers.tip.stiffness': 20000.0, 'snubbers.tip.gap': -0.0002}
    """

    scenario: Scenario  #: with the study
    kind: str  #: grid, zip, one_at_a_time, latin_hypercube, sobol, optimise, reliability or draws
    points: tuple[int, ...]  #: number of values of each parameter of a grid; else empty
    study: Study
    cases: tuple[Case, ...]  #: of a search only the first one, the unchanged scenario
    most_cases: int  #: largest number of solved cases, each with its realisations

    @property
    def searches(self) -> bool:
        """True if a search requests the cases one after the other, so that they are not known beforehand."""
        return self.kind in ("optimise", "reliability")

    def with_rows(self, rows: Sequence[tuple[Value, ...]]) -> StudyPlan:
        """The same plan for cases with other values of the varied parameters."""
        each = product(rows, range(self.study.realisations.count))
        return replace(self, cases=tuple(Case(k, row, realisation) for k, (row, realisation) in enumerate(each)))

    @cached_property
    def parameters(self) -> tuple[ParameterColumn, ...]:
        """Varied parameters with their values in every case."""
        rows = [case.values for case in self.cases if not case.realisation]
        return tuple(_column(parameter, [row[k] for row in rows]) for k, parameter in enumerate(self.study.parameters))

    def values_in(self, case: int) -> dict[str, Value]:
        """Values of the varied parameters in a case, by path."""
        values = self.cases[case * self.study.realisations.count].values
        return dict(zip((parameter.path for parameter in self.study.parameters), values, strict=True))

    @property
    def fingerprint(self) -> str:
        """Hash of everything that the responses depend on."""
        return self.study.fingerprint

    @property
    def convergence(self) -> str | None:
        """Cases to compare with a finer model: all ("on"), none ("off"), or the deciding ones (None)."""
        if self.study.analysis == "static":  # little work
            return "on"
        return getattr(getattr(self.scenario, self.study.section), "convergence", None)


def plan_designs(scenario: Source) -> StudyPlan:
    """List the cases of a study before they are computed; `design_study` takes the plan.

    Parameters
    ----------
    scenario : with ``vary`` or ``optimise``, or what `beamsim.load_scenario` reads.

    Returns
    -------
    StudyPlan

    Raises
    ------
    ScenarioError
        If ``vary`` is missing, or there is no analysis for the cases.

    Examples
    --------
    >>> import beamsim
    >>> plan = beamsim.plan_designs("configs/studies/design_stiffness_gap.yaml")
    >>> [(parameter.path, parameter.values.size) for parameter in plan.parameters]
    [('snubbers.tip.stiffness', 180), ('snubbers.tip.gap', 180)]
    """
    scenario = scenario_of(scenario, "sweep")
    vary = scenario.study
    if vary is None:
        raise ScenarioError.at(
            "vary", "is missing", "add `vary: {kind: grid, parameters: [{path: ..., values: [...]}]}`"
        )
    varied = varied_parameters(scenario)
    if isinstance(vary, LatinHypercube):
        columns = latin_hypercube(varied, vary.samples, vary.seed, vary.correlations)
    elif isinstance(vary, Sobol):
        columns = sobol(varied, vary.samples, vary.seed)
    elif isinstance(vary, OneAtATime):
        columns = one_at_a_time(varied)
    elif isinstance(vary, Optimise | Reliability):
        columns = [[p.nominal] for p in varied]
    else:
        columns = [listed_values(parameter) for parameter in varied]
    aims = [(key, aim) for key in ("minimise", "maximise") if (aim := getattr(vary, key, ""))]
    needed = [(key, name) for key, aim in aims for name in ((aim,) if isinstance(aim, str) else aim)]
    for key, name in needed:
        _check_response(scenario, name, f"{vary.section}.{key}")
    if isinstance(vary, Optimise) and not needed and scenario.limits is None:
        raise scenario.located(ScenarioError.at(
            "optimise.minimise", "is missing, and there are no limits", "give for example minimise: peak_force"
        ))  # fmt: skip
    objectives(scenario)  # also checks the values that count as one
    names = tuple(name for _, name in needed)
    given = vary.responses or (names if isinstance(vary, Optimise) else ())
    if isinstance(vary, Reliability) and scenario.limits is not None:
        given = (*given, *(limited_response(name).rpartition("/")[2] for name in scenario.limits.values_by_name))
    asked = _requested_responses(scenario, given, f"{vary.section}.responses", names)
    return _plan(scenario, vary.kind, varied, columns, asked, Realisations.of(scenario))


def plan_draws(
    scenario: Scenario, draws: Mapping[str, Sequence[Value] | NDArray[Any]], responses: Sequence[str] = ()
) -> StudyPlan:
    """List the cases of an ensemble: one for each draw of the numbers.

    Parameters
    ----------
    scenario : scenario with a ``run`` or a ``sweep``; its ``vary`` is ignored.
    draws : equally many values for each path: SI numbers, or text with units.
    responses : quantities or names of responses to compute; all by default.

    Returns
    -------
    StudyPlan

    Raises
    ------
    ScenarioError
        If a path does not exist, two paths name the same number, a value is not valid, or the numbers of values differ.
    """
    if not draws:
        raise ScenarioError.at("draws", "is empty", "give values by path: {'snubbers.tip.gap': [0.0, 1e-4]}")
    varied = drawn_parameters(scenario, _values_by_path(draws))
    columns = [list(parameter.values) for parameter in varied]
    responses = (responses,) if isinstance(responses, str) else responses
    return _plan(
        scenario, "draws", varied, columns, _requested_responses(scenario, responses, "responses"), Realisations()
    )


def _values_by_path(draws: Mapping[str, Sequence[Value] | NDArray[Any]]) -> dict[str, list[Any]]:
    """Values of each path; raises a ScenarioError if they are not a one-dimensional sequence of numbers or words."""
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


def check_cases(plan: StudyPlan) -> None:
    """Check that the scenario of each case is valid; of many cases, an evenly spaced selection.

    Raises
    ------
    ScenarioError
        For the first invalid cases, with their problems.
    """
    problems: list[Problem] = []
    step = max(1, -(-len(plan.cases) // MOST_CHECKED))
    for case in (*plan.cases[:-1:step], plan.cases[-1]):
        try:
            plan.study.scenario(case)
        except ScenarioError as error:
            named = ", ".join(_assignment_text(c, value) for c, value in zip(plan.parameters, case.values, strict=True))
            within = " and within tolerances" if case.realisation else ""
            problems += [
                Problem("vary", f"with {named}{within}: {p.path} {p.message}", p.remedy or "leave out such cases")
                for p in error.problems
            ]
        if len(problems) >= MOST_SHOWN:
            break
    if problems:
        raise plan.scenario.located(ScenarioError(problems[:MOST_SHOWN]))


def _check_response(scenario: Scenario, name: str, key: str) -> None:
    quantity = name.rpartition("/")[2]
    if quantity not in BY_NAME:
        remedy = suggestion(quantity, BY_NAME, "the quantities are")
        raise scenario.located(ScenarioError.at(key, f"= {name} is not a response", remedy))
    *_, section, place = ("", "", *name.split("/")[:-1])
    if section in ("probes", "snubbers", "outputs"):
        known = [item.name for item in getattr(scenario, "all_snubbers" if section == "snubbers" else section)]
        if known and place not in known:
            remedy = suggestion(place, known, f"the {section} are")
            raise scenario.located(ScenarioError.at(key, f"= {name} names no response: no {place}", remedy))


def _requested_responses(
    scenario: Scenario, responses: Sequence[str], key: str, objectives: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Requested responses, objectives, and responses with limits; empty for all."""
    for k, name in enumerate(responses):
        _check_response(scenario, name, f"{key}[{k}]")
    if not responses:
        return ()
    limits = () if scenario.limits is None else scenario.limits.values_by_name
    return tuple(
        dict.fromkeys((*responses, *objectives, *(limited_response(name).rpartition("/")[2] for name in limits)))
    )


def analysis_of(scenario: Scenario) -> str:
    """Analysis of each case: its sweep, or else its run, or else its static equilibrium."""
    if scenario.sweep is not None:
        kind = str(scenario.sweep.kind)
        if kind not in ANALYSES:
            of_sweeps = [each for each in ANALYSES if each not in ("run", "static")]
            raise ScenarioError.at(
                "sweep.kind", f"= {kind} cannot be combined with vary", f"use one of {', '.join(of_sweeps)}"
            )
        return kind
    if scenario.run is None and scenario.excitation.items:
        raise ScenarioError.at(
            "run", "is missing", "add for example `run: {duration: 1 s}`; without sweep every case is a run, and "
            "without excitation a static equilibrium"
        )  # fmt: skip
    return "static" if scenario.run is None else "run"


def _plan(
    scenario: Scenario,
    kind: str,
    parameters: tuple[VariedParameter, ...],
    columns: list[list[Value]],
    requested: tuple[str, ...],
    realisations: Realisations,
) -> StudyPlan:
    _refuse_names_of_responses(scenario, parameters)
    places = [[parameter.places, sorted(map(str, parameter.choices.items()))] for parameter in parameters]
    case = _case(scenario, parameters)
    analysis = analysis_of(scenario)
    search = as_plain_data(scenario.vary if kind == "reliability" else scenario.optimise)
    fingerprint = fingerprint_of(
        scenario, analysis, kind, search, as_plain_data(case), places, columns, requested, realisations.as_data()
    )
    rows = list(product(*columns) if kind == "grid" else zip(*columns, strict=True))
    study = Study(
        analysis, replace_values(case, scenario.whole_paths(case)), parameters, realisations, requested, fingerprint
    )
    most = getattr(scenario.study, "most_cases", len(rows))
    points = tuple(map(len, columns)) if kind == "grid" else ()
    return StudyPlan(scenario, kind, points, study, (), most).with_rows(rows)


def _refuse_names_of_responses(scenario: Scenario, parameters: Iterable[VariedParameter]) -> None:
    """Refuse parameter names that the result uses for responses: all are columns of one table.

    Raises
    ------
    ScenarioError
        For each of them.
    """
    study = scenario.study
    where = {} if study is None else {
        each.path: f"{study.section}.parameters[{k}].name" for k, each in enumerate(study.parameters)
    }  # fmt: skip
    problems = [
        Problem(
            where.get(parameter.path, "draws"),
            f"= {parameter.path} is a name that the result of a study uses itself",
            f"choose another one, for example {parameter.path}_choice",
        )
        for parameter in parameters
        if begins_response(parameter.path)
    ]
    if problems:
        raise scenario.located(ScenarioError(problems))


def fingerprint_of(scenario: Scenario, *data: Any) -> str:
    """Hash of plain data, and of the contents of the scenario's files."""
    contents = {key: record.get("sha256") for key, record in scenario.file_records(unchanged_only=False).items()}
    return hashlib.sha256(json.dumps([*data, contents], sort_keys=True).encode()).hexdigest()


def _case(scenario: Scenario, parameters: Sequence[VariedParameter]) -> Scenario:
    """Scenario without unused sections; random inputs with several seeds have random amplitudes by default."""
    unused = ("vary", "optimise", "identify_stiffness", "nnm")
    case = scenario.model_copy(update={**dict.fromkeys(unused), "title": ""}).with_source(scenario.source)
    for name in ("run", "sweep"):
        section = getattr(case, name)
        if section is not None and section.convergence is None:
            case = with_values(case, {(name, "convergence"): "off"})
    return with_random_amplitudes(case, parameters)


def with_random_amplitudes(scenario: Scenario, parameters: Iterable[VariedParameter]) -> Scenario:
    """Scenario with random amplitudes for inputs with a varied seed, unless the scenario defines them."""
    changed = {
        (*place[:-1], "amplitudes"): "random"
        for place in varied_seeds(parameters)
        if getattr(value_at(scenario, place[:-1]), "amplitudes", "none of its keys") is None
    }
    return with_values(scenario, changed)


def varied_seeds(parameters: Iterable[VariedParameter]) -> list[Path]:
    """Paths of varied seeds: each seed is another realisation of a random or matched input."""
    return [
        place
        for parameter in parameters
        for place in parameter.places
        if place[0] == "excitation" and place[-1] == "seed"
    ]


def _column(parameter: VariedParameter, values: list[Value]) -> ParameterColumn:
    """Column of a parameter; words (such as shares of a length) contain their own unit."""
    if not any(isinstance(value, str) for value in values):
        return ParameterColumn(parameter.path, np.array(values, dtype=float), parameter.unit)
    unit = parameter.unit.removeprefix("1")
    texts = [value if isinstance(value, str) else f"{value:g} {unit}".rstrip() for value in values]
    return ParameterColumn(parameter.path, np.array(texts), "1")


def _assignment_text(column: ParameterColumn, value: Value) -> str:
    shown, unit = value if isinstance(value, str) else f"{value:.6g}", column.unit
    return f"{column.path} = {shown} {unit if unit != '1' else ''}".rstrip()


def listed_values(parameter: VariedParameter) -> list[Value]:
    """Values of a list or of an evenly spaced range."""
    if parameter.values:
        return list(parameter.values)
    spaced = np.geomspace if parameter.spacing == "logarithmic" else np.linspace
    values = spaced(parameter.low, parameter.high, parameter.points)
    values[0], values[-1] = parameter.low, parameter.high
    if parameter.integers_only:
        return [*dict.fromkeys(int(v) for v in np.rint(values))]
    return [float(v) for v in values]


def one_at_a_time(parameters: tuple[VariedParameter, ...]) -> list[list[Value]]:
    """The unchanged scenario, then each value of every parameter with the others unchanged."""
    nominal = [int(p.nominal) if p.integers_only and not isinstance(p.nominal, str) else p.nominal for p in parameters]
    rows = [nominal]
    for k, parameter in enumerate(parameters):
        others = [v for v in listed_values(parameter) if not _same_values(v, nominal[k])]
        rows += [[*nominal[:k], value, *nominal[k + 1 :]] for value in others]
    return [list(column) for column in zip(*rows, strict=True)]


def _same_values(first: Value, second: Value) -> bool:
    if isinstance(first, str) or isinstance(second, str):
        return first == second
    return math.isclose(first, second, rel_tol=1e-12)


def latin_hypercube(
    parameters: tuple[VariedParameter, ...], samples: int, seed: int, correlations: Sequence[Correlation] = ()
) -> list[list[Value]]:
    """A Latin-hypercube sample of the parameters.

    Parameters
    ----------
    parameters : parameters with ranges and distributions.
    samples : number of cases.
    seed : seed of the random numbers.
    correlations : rank correlations of pairs.

    Returns
    -------
    list
        A column of values for each parameter.

    Raises
    ------
    ScenarioError
        If no numbers have these correlations.
    """
    from scipy.stats.qmc import LatinHypercube

    cube = LatinHypercube(len(parameters), rng=np.random.default_rng(seed)).random(samples)
    return distributed(
        parameters, _correlate([p.path for p in parameters], cube, correlations) if correlations else cube
    )


def _correlate(paths: list[str], cube: Floats, correlations: Sequence[Correlation]) -> Floats:
    """Reorder the columns of a sample to obtain the rank correlations of a Gaussian copula.

    Source: R. L. Iman and W. J. Conover, Communications in Statistics B 11 (1982) 311-334. A rank correlation r of
    normal numbers corresponds to their correlation 2 sin(pi r / 6).
    """
    from scipy.stats import norm

    scores = norm.ppf(cube)
    present = np.linalg.cholesky(np.corrcoef(scores, rowvar=False))
    mixed = mixing(paths, correlations) @ np.linalg.solve(present, scores.T)
    return np.asarray(np.take_along_axis(np.sort(cube, axis=0), mixed.argsort(axis=1).argsort(axis=1).T, axis=0))


def mixing(paths: list[str], correlations: Sequence[Correlation]) -> Floats:
    """Triangular matrix that turns independent normal numbers into numbers with given rank correlations."""
    wanted = np.eye(len(paths))
    for each in correlations:
        i, j = map(paths.index, each.between)
        wanted[i, j] = wanted[j, i] = 2.0 * math.sin(math.pi / 6.0 * each.coefficient)
    try:
        return np.asarray(np.linalg.cholesky(wanted), dtype=float)
    except np.linalg.LinAlgError:
        pairs = ", ".join(f"{each.coefficient:g} of {' and '.join(each.between)}" for each in correlations)
        message = f"asks for rank correlations that are not possible together: {pairs}"
        raise ScenarioError.at("vary", message, "state the third one of three, or smaller ones") from None


def sobol(parameters: tuple[VariedParameter, ...], samples: int, seed: int) -> list[list[Value]]:
    """A sample for Sobol' indices: two independent samples A and B, then for each parameter A with its column of B.

    Source: A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270.

    Parameters
    ----------
    parameters : k parameters with ranges and distributions.
    samples : number n of rows of A and of B.
    seed : seed of the random numbers.

    Returns
    -------
    list
        A column of n (k + 2) values for each parameter.
    """
    from scipy.stats.qmc import Sobol

    count = len(parameters)
    both = Sobol(2 * count, rng=np.random.default_rng(seed)).random(samples)
    a, b = both[:, :count], both[:, count:]
    parts = [a, b]
    for k in range(count):
        mixed = a.copy()
        mixed[:, k] = b[:, k]
        parts.append(mixed)
    return distributed(parameters, np.concatenate(parts))


def distributed(parameters: tuple[VariedParameter, ...], cube: Floats) -> list[list[Value]]:
    """Map each column of the unit cube by the inverse distribution of its parameter."""
    from scipy.stats import truncnorm

    columns: list[list[Value]] = []
    for parameter, u in zip(parameters, cube.T, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.spacing == "logarithmic":
            values = low * (high / low) ** u
        elif parameter.distribution == "normal":
            deviation = truncnorm.ppf(u, -3.0, 3.0) / 3.0  # the tolerance is three standard deviations
            values = 0.5 * (low + high) + 0.5 * (high - low) * deviation
        elif parameter.values:
            places = np.minimum(np.floor(u * len(parameter.values)), len(parameter.values) - 1).astype(int)
            columns.append([parameter.values[k] for k in places])
            continue
        elif parameter.integers_only:
            values = np.minimum(np.floor(low + u * (high - low + 1.0)), high)
        else:
            values = low + u * (high - low)
        columns.append([int(v) for v in values] if parameter.integers_only else values.tolist())
    return columns
