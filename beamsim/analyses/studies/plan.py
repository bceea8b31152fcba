"""The cases of a design study or an ensemble: which there are, and whether each is valid."""

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

MOST_CHECKED = 400  # cases checked before the first is solved
ANALYSES = ("run", "swept_sine", "stepped", "continuation")  # of a case: a run, or the kind of sweep
MOST_SHOWN = 5  # problems and failures in a message


@dataclass(frozen=True)
class Realisations:
    """The same sample of deviations about every case; without tolerances only the case itself."""

    parameters: tuple[ToleratedParameter, ...] = ()
    # (realisations, parameters) in shares of the tolerances, from -1 to 1; the first row, zero, is the case itself
    deviations: Floats = field(default_factory=lambda: np.zeros((1, 0)))
    quantile: float = 1.0  # by which a case is judged, counted from the good side
    most_further: int = 0  # realisations that are solved to find the worst of the best cases

    @classmethod
    def of(cls, scenario: Scenario) -> Realisations:
        """The plan of a scenario with ``vary``."""
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
        """Number of realisations of each case, the case itself among them."""
        return int(self.deviations.shape[0])

    @property
    def judged_by_worst(self) -> bool:
        """Whether a case is judged by the worst that its tolerances allow, and not by a quantile."""
        return self.count > 1 and self.quantile == 1.0

    def values(self, case: Scenario, deviations: Iterable[float]) -> dict[Path, float]:
        """The numbers of a realisation by place; each deviates from what it is in the case, or follows from there.

        Parameters
        ----------
        case : the scenario without deviations.
        deviations : of each number, as a share of its tolerance.
        """
        values: dict[Path, float] = {}
        for parameter, deviation in zip(self.parameters, deviations, strict=True):
            written = value_at(case, parameter.parameter.places[0])
            if written is None:
                message = "has a tolerance, and no value in this case"
                raise ScenarioError.at(parameter.parameter.path, message, "leave out the tolerance, or such choices")
            nominal = float(written)
            value = nominal + float(deviation) * parameter.reach(nominal)
            values |= dict.fromkeys(parameter.parameter.places, value)
        return values

    def as_data(self) -> list[Any]:
        """Plain data of all that the cases depend on; empty without tolerances."""
        deviations = [] if self.count == 1 else self.deviations.tolist()
        return [
            *([x.path, p.share, x.low, x.high, x.places] for p in self.parameters for x in (p.parameter,)),
            *deviations,
        ]


class ParameterColumn(NamedTuple):
    """A varied parameter in every case."""

    path: str  # in the scenario
    values: NDArray[Any]  # (cases,) SI numbers or words
    unit: str  # "1" of words

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype.kind == "f"

    @property
    def label(self) -> str:
        """The parameter in words: ``tip gap`` for ``snubbers.tip.gap``."""
        return parameter_label(self.path)


@dataclass(frozen=True)
class Study:
    """Common data of the cases of a study."""

    analysis: str
    case: Scenario  # as it was written
    varied: tuple[VariedParameter, ...]
    realisations: Realisations
    asked: tuple[str, ...]  # responses; empty for all
    fingerprint: str

    def scenario(self, case: Case) -> Scenario:
        """The scenario of a case; raises a ScenarioError if it is invalid."""
        scenario = with_parameters(self.case, self.varied, case.values)
        if case.realisation or case.deviations:
            deviations = case.deviations or self.realisations.deviations[case.realisation].tolist()
            scenario = with_values(scenario, self.realisations.values(scenario, deviations))
        if case.compared:
            scenario = with_values(scenario, {(self.section, "convergence"): "on"})
        return scenario.recheck()

    @property
    def section(self) -> str:
        """The section of the scenario that says what is done with a case."""
        return "run" if self.analysis == "run" else "sweep"


def with_parameters(scenario: Scenario, varied: Iterable[VariedParameter], values: Iterable[Value]) -> Scenario:
    """The scenario with these values of varied parameters, the choices of catalogues before the numbers."""
    given = dict[Path, Value]()
    for parameter, value in zip(varied, values, strict=True):
        scenario = replace_values(scenario, parameter.choices.get(str(value), {}))
        given |= dict.fromkeys(parameter.places, value)
    return with_values(scenario, given)


def design(scenario: Scenario, case: Mapping[str, Any]) -> Scenario:
    """The scenario of a case, as ``best`` and ``as_it_is`` of the summary have it, or of numbers, without the study.

    Its paths of files begin at the root.
    """
    called, varied = f"design {case['case'] + 1}" if "case" in case else "design point", varied_parameters(scenario)
    title = f"{scenario.title}, {called}".removeprefix(", ")
    alone = scenario.model_copy(update={"vary": None, "optimise": None, "title": title})
    alone = replace_values(alone, scenario.whole_paths(alone))  # it has no folder that they could be relative to
    alone = with_random_amplitudes(alone, varied)
    return with_parameters(alone, varied, case["parameters"].values()).recheck()


@dataclass(frozen=True)
class StudyPlan:
    """The cases to be computed, in order; the realisations of a case within its tolerances follow each other."""

    scenario: Scenario
    kind: str
    points: tuple[int, ...]  # of a grid the number of values of each parameter; else none
    study: Study
    cases: tuple[Case, ...]  # of a search only the first one, the scenario as it is
    most: int  # number of cases that are solved at most, each with its realisations

    @property
    def searches(self) -> bool:
        """Whether a search asks for the cases one after the other, so that none is known beforehand."""
        return self.kind in ("optimise", "reliability")

    def of(self, rows: Sequence[tuple[Value, ...]]) -> StudyPlan:
        """The same plan for cases with these values of the varied parameters."""
        each = product(rows, range(self.study.realisations.count))
        return replace(self, cases=tuple(Case(k, row, realisation) for k, (row, realisation) in enumerate(each)))

    @cached_property
    def parameters(self) -> tuple[ParameterColumn, ...]:
        """The varied parameters with their values in every case."""
        rows = [case.values for case in self.cases if not case.realisation]
        return tuple(_column(parameter, [row[k] for row in rows]) for k, parameter in enumerate(self.study.varied))

    def values_in(self, case: int) -> dict[str, Value]:
        """The values of the varied parameters in a case by path."""
        values = self.cases[case * self.study.realisations.count].values
        return dict(zip((parameter.path for parameter in self.study.varied), values, strict=True))

    @property
    def fingerprint(self) -> str:
        """Hash of all that the responses depend on."""
        return self.study.fingerprint

    @property
    def convergence(self) -> str | None:
        """Which cases are compared with a finer model: all (on), none (off), or those that decide (None)."""
        return getattr(getattr(self.scenario, self.study.section), "convergence", None)


def plan_designs(scenario: Source) -> StudyPlan:
    """List the cases of a scenario with ``vary``, or of what `beamsim.load_scenario` reads.

    Raises
    ------
    ScenarioError
        If ``vary`` is missing, or there is no analysis for the cases.
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
            "optimise.minimise", "is missing, and there are no limits", "give what is to be small: minimise: peak_force"
        ))  # fmt: skip
    objectives(scenario)  # whose values that count as one may be none
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
    scenario : with a ``run``, or a ``sweep``; what it says in ``vary`` is not used.
    draws : by path of a number of the scenario its values, all equally many: SI numbers, or text with units.
    responses : quantities or names of responses that are computed, by default all.

    Returns
    -------
    StudyPlan

    Raises
    ------
    ScenarioError
        If a path does not exist or names the same number as another one, a value is not one of its field, or numbers of
        values differ.
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


def check_cases(plan: StudyPlan) -> None:
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


def _check_response(scenario: Scenario, name: str, where: str) -> None:
    quantity = name.rpartition("/")[2]
    if quantity not in BY_NAME:
        remedy = suggestion(quantity, BY_NAME, "the quantities are")
        raise scenario.located(ScenarioError.at(where, f"= {name} is not a response", remedy))
    *_, section, place = ("", "", *name.split("/")[:-1])
    if section in ("probes", "snubbers", "outputs"):
        known = [item.name for item in getattr(scenario, "all_snubbers" if section == "snubbers" else section)]
        if known and place not in known:
            remedy = suggestion(place, known, f"the {section} are")
            raise scenario.located(ScenarioError.at(where, f"= {name} names no response: no {place}", remedy))


def _requested_responses(
    scenario: Scenario, responses: Sequence[str], where: str, objectives: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """The responses asked for, the objectives, and those that limits are compared with; empty for all."""
    for k, name in enumerate(responses):
        _check_response(scenario, name, f"{where}[{k}]")
    if not responses:
        return ()
    limits = () if scenario.limits is None else scenario.limits.values_by_name
    return tuple(
        dict.fromkeys((*responses, *objectives, *(limited_response(name).rpartition("/")[2] for name in limits)))
    )


def analysis_of(scenario: Scenario) -> str:
    """Analysis of each case: its sweep, else its run."""
    kind = "run" if scenario.sweep is None else str(scenario.sweep.kind)
    if kind not in ANALYSES:
        raise ScenarioError.at(
            "sweep.kind", f"= {kind} cannot be combined with vary", f"use one of {', '.join(ANALYSES)}"
        )
    if kind == "run" and scenario.run is None:
        raise ScenarioError.at(
            "run", "is missing", "add for example `run: {duration: 1 s}`; without sweep every case is a run"
        )
    return kind


def _plan(
    scenario: Scenario,
    kind: str,
    varied: tuple[VariedParameter, ...],
    columns: list[list[Value]],
    asked: tuple[str, ...],
    realisations: Realisations,
) -> StudyPlan:
    _refuse_names_of_responses(scenario, varied)
    places = [[parameter.places, sorted(map(str, parameter.choices.items()))] for parameter in varied]
    case = _case(scenario, varied)
    analysis = analysis_of(scenario)
    search = as_plain_data(scenario.vary if kind == "reliability" else scenario.optimise)
    fingerprint = fingerprint_of(
        scenario, analysis, kind, search, as_plain_data(case), places, columns, asked, realisations.as_data()
    )
    rows = list(product(*columns) if kind == "grid" else zip(*columns, strict=True))
    study = Study(analysis, replace_values(case, scenario.whole_paths(case)), varied, realisations, asked, fingerprint)
    most = getattr(scenario.study, "most_cases", len(rows))
    points = tuple(map(len, columns)) if kind == "grid" else ()
    return StudyPlan(scenario, kind, points, study, (), most).of(rows)


def _refuse_names_of_responses(scenario: Scenario, varied: Iterable[VariedParameter]) -> None:
    """Refuse names of parameters that responses of the result have: all are columns of one table.

    Raises
    ------
    ScenarioError
        With each of them.
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
        for parameter in varied
        if begins_response(parameter.path)
    ]
    if problems:
        raise scenario.located(ScenarioError(problems))


def fingerprint_of(scenario: Scenario, *data: Any) -> str:
    """Hash of plain data, and of the contents of the files that a scenario names."""
    contents = {key: record.get("sha256") for key, record in scenario.file_records(unchanged_only=False).items()}
    return hashlib.sha256(json.dumps([*data, contents], sort_keys=True).encode()).hexdigest()


def _case(scenario: Scenario, varied: Sequence[VariedParameter]) -> Scenario:
    """The scenario without unused sections; noise of several seeds has random amplitudes by default."""
    unused = ("vary", "optimise", "identify_stiffness", "nnm")
    case = scenario.model_copy(update={**dict.fromkeys(unused), "title": ""}).with_source(scenario.source)
    for name in ("run", "sweep"):
        section = getattr(case, name)
        if section is not None and section.convergence is None:
            case = with_values(case, {(name, "convergence"): "off"})
    return with_random_amplitudes(case, varied)


def with_random_amplitudes(scenario: Scenario, varied: Iterable[VariedParameter]) -> Scenario:
    """The scenario whose inputs with a varied seed have random amplitudes, where the scenario does not say which."""
    changed = {
        (*place[:-1], "amplitudes"): "random"
        for place in varied_seeds(varied)
        if getattr(value_at(scenario, place[:-1]), "amplitudes", "none of its keys") is None
    }
    return with_values(scenario, changed)


def varied_seeds(varied: Iterable[VariedParameter]) -> list[Path]:
    """Where the seeds of inputs are that a study varies: each is another realisation of a random or matched input."""
    return [
        place for parameter in varied for place in parameter.places if place[0] == "excitation" and place[-1] == "seed"
    ]


def _column(parameter: VariedParameter, values: list[Value]) -> ParameterColumn:
    """The values of a parameter; words, shares of a length among them, say their unit themselves."""
    if not any(isinstance(value, str) for value in values):
        return ParameterColumn(parameter.path, np.array(values, dtype=float), parameter.unit)
    unit = parameter.unit.removeprefix("1")
    texts = [value if isinstance(value, str) else f"{value:g} {unit}".rstrip() for value in values]
    return ParameterColumn(parameter.path, np.array(texts), "1")


def _assignment_text(column: ParameterColumn, value: Value) -> str:
    shown, unit = value if isinstance(value, str) else f"{value:.6g}", column.unit
    return f"{column.path} = {shown} {unit if unit != '1' else ''}".rstrip()


def listed_values(parameter: VariedParameter) -> list[Value]:
    """The values of a list or of an evenly spaced range."""
    if parameter.values:
        return list(parameter.values)
    spaced = np.geomspace if parameter.spacing == "logarithmic" else np.linspace
    values = spaced(parameter.low, parameter.high, parameter.points)
    values[0], values[-1] = parameter.low, parameter.high
    if parameter.integers_only:
        return [*dict.fromkeys(int(v) for v in np.rint(values))]
    return [float(v) for v in values]


def one_at_a_time(varied: tuple[VariedParameter, ...]) -> list[list[Value]]:
    """The scenario's own values, then each value of every parameter, the others being as in the scenario."""
    nominal = [int(p.nominal) if p.integers_only and not isinstance(p.nominal, str) else p.nominal for p in varied]
    rows = [nominal]
    for k, parameter in enumerate(varied):
        others = [v for v in listed_values(parameter) if not _same(v, nominal[k])]
        rows += [[*nominal[:k], value, *nominal[k + 1 :]] for value in others]
    return [list(column) for column in zip(*rows, strict=True)]


def _same(one: Value, other: Value) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return math.isclose(one, other, rel_tol=1e-12)


def latin_hypercube(
    varied: tuple[VariedParameter, ...], samples: int, seed: int, correlations: Sequence[Correlation] = ()
) -> list[list[Value]]:
    """A Latin-hypercube sample of the parameters.

    Parameters
    ----------
    varied : with their ranges and distributions.
    samples : number of cases.
    seed : of the random numbers.
    correlations : of pairs of them.

    Returns
    -------
    list
        A column of values for each parameter.

    Raises
    ------
    ScenarioError
        If there are no numbers with these correlations.
    """
    from scipy.stats.qmc import LatinHypercube

    cube = LatinHypercube(len(varied), rng=np.random.default_rng(seed)).random(samples)
    return distributed(varied, _correlate([p.path for p in varied], cube, correlations) if correlations else cube)


def _correlate(paths: list[str], cube: Floats, correlations: Sequence[Correlation]) -> Floats:
    """The columns of a sample put into orders that have the rank correlations of a Gaussian copula.

    Source: R. L. Iman and W. J. Conover, Communications in Statistics B 11 (1982) 311-334. A rank correlation r of
    normal numbers belongs to the correlation 2 sin(pi r / 6) of them.
    """
    from scipy.stats import norm

    scores = norm.ppf(cube)
    present = np.linalg.cholesky(np.corrcoef(scores, rowvar=False))
    mixed = mixing(paths, correlations) @ np.linalg.solve(present, scores.T)
    return np.asarray(np.take_along_axis(np.sort(cube, axis=0), mixed.argsort(axis=1).argsort(axis=1).T, axis=0))


def mixing(paths: list[str], correlations: Sequence[Correlation]) -> Floats:
    """The triangular matrix that makes normal numbers with rank correlations of independent ones."""
    wanted = np.eye(len(paths))
    for each in correlations:
        i, j = map(paths.index, each.between)
        wanted[i, j] = wanted[j, i] = 2.0 * math.sin(math.pi / 6.0 * each.coefficient)
    try:
        return np.asarray(np.linalg.cholesky(wanted), dtype=float)
    except np.linalg.LinAlgError:
        pairs = ", ".join(f"{each.coefficient:g} of {' and '.join(each.between)}" for each in correlations)
        message = f"asks for rank correlations that no numbers have together: {pairs}"
        raise ScenarioError.at("vary", message, "state the third one of three, or smaller ones") from None


def sobol(varied: tuple[VariedParameter, ...], samples: int, seed: int) -> list[list[Value]]:
    """A sample for Sobol' indices: two independent samples A and B, then for each parameter A with its column of B.

    Source: A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270.

    Parameters
    ----------
    varied : k parameters with their ranges and distributions.
    samples : n rows of A and of B.
    seed : of the random numbers.

    Returns
    -------
    list
        A column of n (k + 2) values for each parameter.
    """
    from scipy.stats.qmc import Sobol

    count = len(varied)
    both = Sobol(2 * count, rng=np.random.default_rng(seed)).random(samples)
    a, b = both[:, :count], both[:, count:]
    parts = [a, b]
    for k in range(count):
        mixed = a.copy()
        mixed[:, k] = b[:, k]
        parts.append(mixed)
    return distributed(varied, np.concatenate(parts))


def distributed(varied: tuple[VariedParameter, ...], cube: Floats) -> list[list[Value]]:
    """Map each column of the unit cube by the inverse distribution of its parameter."""
    from scipy.stats import truncnorm

    columns: list[list[Value]] = []
    for parameter, u in zip(varied, cube.T, strict=True):
        low, high = parameter.low, parameter.high
        if parameter.spacing == "logarithmic":
            values = low * (high / low) ** u
        elif parameter.distribution == "normal":
            deviation = truncnorm.ppf(u, -3.0, 3.0) / 3.0  # three standard deviations are the tolerance
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
