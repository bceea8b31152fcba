"""Studies: parameters of a scenario that vary from case to case, each named by its path."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError

from beamsim.errors import ScenarioError
from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    BY_FORM,
    TWO_ITEMS,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    Whole,
    as_plain_data,
    count_text,
    path_text,
    problem,
    unknown,
)
from beamsim.scenario.excitation import Input, MatchedInput, RandomInput
from beamsim.scenario.files import DecimalMark
from beamsim.scenario.parameters import (
    choices_at,
    dimension_at,
    dimension_of_level,
    field_type_at,
    find_parameters,
    listing_problems,
    read_as,
    unit_at,
    value_at,
)
from beamsim.scenario.quantities import Share
from beamsim.scenario.tree import apply_overrides, from_python
from beamsim.scenario.units import RATIO, UnitError, read_quantity

Objective = Annotated[q.Text | tuple[q.Text, ...] | dict[q.Text, q.AnyValue], BY_FORM]
Spacing = Literal["linear", "logarithmic"]
LEAST_DATA = 10  # measured values that a distribution needs at least


class _Parameter(Schema):
    """Common part of all varied parameters."""

    path: q.Text
    """Path of the number or choice, for example beam.thickness, snubbers.tip.gap or beam.point_masses[*].mass."""
    also: tuple[q.Text, ...] = ()
    """Other paths with the same value, such as a probe that moves with a snubber."""


class ListedParameter(_Parameter):
    """A parameter with a list of values."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("values",)

    values: Annotated[tuple[q.AnyValue, ...], Field(min_length=1)]
    """The values, with or without unit; or words, such as kinds of supports."""


class Catalogue(Schema):
    """A choice that sets several keys at once, such as one of several available snubbers."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("choices",)

    name: q.Name = "choice"
    """Name of the choice, used in the result file and its table."""
    choices: Annotated[dict[q.Text, dict[q.Text, Any]], Field(min_length=1)]
    """For each choice the values that it sets, as with --set: {hard: {snubbers.tip.stiffness: 200 kN/m,
    snubbers.tip.gap: 0 mm}, soft: {snubbers.tip.stiffness: null, snubbers.tip.force_deflection: [[0 mm, 0 N], [1 mm, 90
    N]]}}."""

    @property
    def path(self) -> str:
        """A name for it in place of a path."""
        return self.name


class _Ranged(_Parameter):
    """A parameter with a range."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("from",)

    from_: q.AnyValue = Field(alias="from")
    """First value."""
    to: q.AnyValue
    """Last value."""
    spacing: Spacing = "linear"
    """linear or logarithmic spacing of the values, or of the distribution of samples."""


class _Toleranced(_Parameter):
    """A parameter with a tolerance about its value in the scenario."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("tolerance",)

    tolerance: q.AnyValue
    """Deviation to either side: in percent of the value in the scenario, or in the unit of the quantity."""


class RangedParameter(_Ranged):
    """Evenly spaced values of a range."""

    points: q.SteppedCount
    """Number of values."""


class TolerancedParameter(_Toleranced):
    """A parameter at several values within its tolerance."""

    points: q.SteppedCount = 3
    """Number of values from the lowest to the highest."""


class SampledRange(_Ranged):
    """A parameter that is sampled in a range."""


class SampledTolerance(_Toleranced):
    """A parameter that is sampled within its tolerance."""

    distribution: Literal["uniform", "normal"] = "uniform"
    """uniform within the tolerance; or normal, where the tolerance is three standard deviations and truncates it."""


class ScatteredParameter(_Parameter):
    """A random parameter; its mean is the value in the scenario."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("deviation",)

    deviation: q.AnyValue
    """Standard deviation: in percent of the value in the scenario, or in the unit of the quantity."""
    distribution: Literal["normal", "lognormal"] = "normal"
    """lognormal for quantities that cannot be negative, such as a stiffness."""


class MeasuredParameter(_Parameter):
    """A random parameter with measured values; its distribution is a smooth fit to them."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("data",)

    data: Annotated[Annotated[tuple[q.AnyValue, ...], Field(min_length=LEAST_DATA)] | q.FileName, BY_FORM]
    """The values, with or without unit; or a file with columns, relative to the scenario's folder, whose headings may
    contain units."""
    column: q.Text | None = None
    """Heading or number of the column in the file; required if there are several."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""


AnyParameter = Annotated[
    ListedParameter | Catalogue | TolerancedParameter | RangedParameter,
    Variants(
        "names no values",
        "give path with values: [...], with from, to and points, or with a tolerance; or choices by name",
    ),
]
DesignParameter = Annotated[
    ListedParameter | Catalogue | SampledRange,
    Variants("names no range", "give path with from and to, or with values: [...]; or choices by name"),
]
SampledParameter = Annotated[
    SampledTolerance | SampledRange,
    Variants("names no range to sample", "give path with from and to, or with a tolerance"),
]

RandomParameter = Annotated[
    ScatteredParameter | MeasuredParameter | SampledTolerance | SampledRange,
    Variants("has no distribution", "give path with a deviation, with data, with a tolerance, or with from and to"),
]


MOST_CASES = 200_000
"""Largest number of cases of a study."""


class _CaseSection(Schema):
    """Common part of sections that define many cases."""

    section: ClassVar[str] = "vary"

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: unknown paths, values that their fields refuse, too many cases."""
        parameters: tuple[Any, ...] = getattr(self, "parameters", ())
        yield from parameter_problems(scenario, parameters, (*path, "parameters"))
        count = case_count(self)
        if count > MOST_CASES:
            yield problem(
                path,
                f"asks for {count:.3g} cases (at most {MOST_CASES:,} are computed)".replace(",", " "),
                "take fewer values of each parameter, or sample: kind: latin_hypercube with samples: 1000",
            )


class _Study(_CaseSection):
    """Common part of studies that compare cases."""

    responses: tuple[q.Text, ...] = ()
    """Responses to compute, such as peak_force; all by default. The bending stress takes longest."""
    minimise: q.Text = ""
    """Response that the best case minimises among those that meet every limit: a quantity such as peak_force, of which
    the largest value counts, or a response by name, such as snubbers/tip/peak_force. Without it the best case is the
    one with the largest margin. """
    maximise: q.Text = ""
    """Response that the best case maximises; see minimise."""

    def check(self) -> None:
        """Refuse two objectives."""
        self.exclude("maximise", "minimise", remedy="name one objective, minimise or maximise")


class Correlation(Schema):
    """Correlation of two random parameters."""

    between: Annotated[tuple[q.Text, ...], TWO_ITEMS]
    """Paths of both parameters, as in the list of parameters."""
    coefficient: Annotated[float, q.Quantity(units.NUMBER, above=-1.0, below=1.0)]
    """Rank correlation (Spearman): 1 for the same order, -1 for the opposite order."""


def _correlation_problems(sample: LatinHypercube | Reliability | Tolerances, path: Path) -> Problems:
    """Problems of correlations: unknown parameters, a parameter with itself, repetitions, too few samples."""
    paths, stated = [parameter.path for parameter in sample.parameters], set[frozenset[str]]()
    for k, correlation in enumerate(sample.correlations):
        place, pair = (*path, "correlations", k, "between"), frozenset(correlation.between)
        for j, item_path in enumerate(correlation.between):
            yield from unknown((*place, j), item_path, "parameter", paths)
        if len(pair) < 2 or pair in stated:
            what = "are one parameter" if len(pair) < 2 else "have a correlation already"
            yield problem(place, f"= {', '.join(correlation.between)} {what}", "name two parameters, each pair once")
        stated.add(pair)
    if stated and sample.samples <= len(paths):
        message = f"= {sample.samples} is too few for correlations of {count_text(len(paths), 'parameter')}"
        yield problem((*path, "samples"), message, f"take more than {len(paths)}")


class Tolerances(Schema):
    """Manufacturing tolerances: every case is solved with nominal values and again for a sample of deviations."""

    samples: q.SteppedCount = 20
    """Number of deviations, a Latin-hypercube sample; the same for all cases."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""
    quantile: q.Quantile = 1.0
    """Limits and the objective use this quantile of a case's values, counted from the good side; by default the worst
    value."""
    worst_cases: q.NotNegativeWhole | None = None
    """Largest number of additional cases to find the worst deviation of the best design, if the worst value is used; by
    default 50 per parameter. 0: only the sample is used."""
    parameters: Annotated[tuple[SampledTolerance, ...], Field(min_length=1)]
    """The parameters with a tolerance. For a varied parameter the tolerance is around its value in each case."""
    correlations: tuple[Correlation, ...] = ()
    """Correlations of the deviations; by default they are independent."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: unknown paths, invalid deviations, whole numbers, parameters that are varied in part."""
        problems = list(parameter_problems(scenario, self.parameters, (*path, "parameters")))
        yield from problems
        yield from _correlation_problems(self, path)
        if problems:
            return
        try:
            varied = varied_parameters(scenario)
        except InvalidValueError:
            return  # reported at the varied parameter
        for k, asked in enumerate(self.parameters):
            number, place = resolve_parameter(scenario, asked), (*path, "parameters", k, "path")
            if number.integers_only:
                message = f"= {asked.path} is a whole number, which has no tolerance"
                yield problem(place, message, "vary it: values: [...]")
            for other in varied:
                if set(number.places) & set(other.places) and set(number.places) != set(other.places):
                    message = f"= {number.path} is varied in part, as {other.path}"
                    remedy = f"write the path as it is varied: {other.path}, with the same `also`"
                    yield problem(place, message, remedy)

    @property
    def search_budget(self) -> int:
        """Largest number of additional cases to find the worst deviation of the best design."""
        return 50 * len(self.parameters) if self.worst_cases is None else self.worst_cases

    def check(self) -> None:
        """Refuse a quantile that the sample with the nominal case cannot distinguish from the worst."""
        if self.quantile < 1.0 and math.ceil(self.quantile * self.samples) >= self.samples:
            enough = math.ceil(round(1.0 / (1.0 - self.quantile), 6))
            raise InvalidValueError(
                f"= {100 * self.quantile:.10g} % of {self.samples + 1} realisations is the worst of them",
                f"give samples: {enough} or more, or leave quantile out", ("quantile",),
            )  # fmt: skip


class _ToleratedStudy(_Study):
    """Common part of studies that select a best case."""

    tolerances: Tolerances | None = None
    """Deviations of each case, which are part of its evaluation."""


class Grid(_ToleratedStudy):
    """All combinations of the parameters' values."""

    kind: Literal["grid"] = "grid"
    """All combinations."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class Zipped(_ToleratedStudy):
    """First values of all parameters together, second values together, and so on."""

    kind: Literal["zip"] = "zip"
    """Values paired by position."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters; all need the same number of values."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the numbers of values differ."""
        yield from super().problems(scenario, path)
        counts = [value_count(parameter) for parameter in self.parameters]
        if len(set(counts)) > 1:
            yield problem(
                (*path, "parameters"),
                f"have {', '.join(map(str, counts))} values, which cannot be zipped",
                "give all of them equally many, or write kind: grid",
            )


class OneAtATime(_Study):
    """The nominal case, and every value of each parameter with all others nominal (tornado chart)."""

    kind: Literal["one_at_a_time"] = "one_at_a_time"
    """One parameter at a time."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class LatinHypercube(_ToleratedStudy):
    """A Latin-hypercube sample: one value of every parameter in each of `samples` equally likely intervals."""

    kind: Literal["latin_hypercube"] = "latin_hypercube"
    """A Latin-hypercube sample."""
    samples: q.SteppedCount
    """Number of cases."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters."""
    correlations: tuple[Correlation, ...] = ()
    """Correlations of the parameters; by default they are independent."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of correlations with unknown parameters."""
        yield from super().problems(scenario, path)
        yield from _correlation_problems(self, path)


class Sobol(_Study):
    """A sample for Sobol' indices: the share of each parameter in the variance of a response."""

    kind: Literal["sobol"] = "sobol"
    """A sample for Sobol' indices."""
    samples: q.SteppedCount
    """Size n of the sample, a power of two; the number of cases is n (number of parameters + 2)."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters; they are independent."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a sample size that is not a power of two, and a single parameter."""
        yield from super().problems(scenario, path)
        if self.samples & (self.samples - 1):
            power = 2 ** (self.samples - 1).bit_length()
            message = f"= {self.samples} is not a power of two"
            yield problem((*path, "samples"), message, f"take {power // 2} or {power}")
        if len(self.parameters) < 2:
            message = "has one, which causes all of the variance"
            yield problem((*path, "parameters"), message, "write kind: latin_hypercube")


Variation = Annotated[float, q.Quantity(replace(units.RATIO, example="10 %"), above=0.0)]


LEAST_SAMPLES = 100  # smallest sample for which intervals have their stated coverage (benchmarks/probabilities.py)


class Reliability(_CaseSection):
    """Probability of exceeding limits. Random and matched inputs have another realisation in every history."""

    kind: Literal["reliability"] = "reliability"
    """The probability of exceeding limits."""
    method: Literal["monte_carlo", "form", "importance_sampling", "subset"] | None = None
    """form: first-order reliability method, without an interval; importance_sampling around the design points, the
    default; subset: subset simulation, the default with random inputs; monte_carlo, the default with a matched
    record."""
    event: Literal["any_limit", "all_limits"] = "any_limit"
    """any_limit: failure if any limit is exceeded (series system); all_limits: if all are (parallel system)."""
    coefficient_of_variation: Variation | None = None
    """Largest relative standard deviation of the probability; a less certain result is marked as not reliable. By
    default 10 %, 30 % for subset simulation."""
    samples: q.SteppedCount = 1000
    """Histories in each level of a subset simulation, in the first sample of importance sampling, in the sample with
    increased scatter (512 at most) and in further batches; at least 100, except for form and monte_carlo."""
    most_cases: q.SteppedCount = 20_000
    """Largest number of histories."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""
    parameters: tuple[RandomParameter, ...] = ()
    """The random parameters; none is required with a random or matched input."""
    correlations: tuple[Correlation, ...] = ()
    """Correlations of the parameters; by default they are independent."""
    responses: tuple[q.Text, ...] = ()
    """Responses to compute in addition to those with limits."""

    def method_with(self, inputs: Sequence[RandomInput | MatchedInput]) -> str:
        """The method; by default it follows from the random inputs."""
        if any(isinstance(item, MatchedInput) for item in inputs):
            return self.method or "monte_carlo"
        return self.method or ("subset" if inputs else "importance_sampling")

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: nothing random, random whole numbers, no limit, few samples, an unsuitable method."""
        yield from super().problems(scenario, path)
        yield from _correlation_problems(self, path)
        inputs = inputs_with_seed(scenario.excitation)
        if not (self.parameters or inputs):
            message = "is empty, and the excitation is not random"
            yield problem((*path, "parameters"), message, "list the numbers that scatter")
        if scenario.limits is None:
            message = "is missing, so that there is nothing to exceed"
            yield problem(("limits",), message, "add limits: {peak_force: 50 N}")
        matched = any(isinstance(item, MatchedInput) for _, item in inputs)
        method = self.method_with([item for _, item in inputs])
        if method in ("subset", "importance_sampling") and self.samples < LEAST_SAMPLES:
            message = f"= {self.samples} is too few for {method.replace('_', ' ')}, whose interval would be too narrow"
            yield problem((*path, "samples"), message, f"take {LEAST_SAMPLES} or more, or write method: monte_carlo")
        if inputs and self.method in ("form", "importance_sampling"):
            yield problem(
                (*path, "method"), f"= {self.method} is for numbers only, and the excitation is random",
                "write monte_carlo" if matched else "write subset, or monte_carlo",
            )  # fmt: skip
        elif matched and self.method == "subset":
            message = (
                "= subset needs small steps between realisations, but a matched record cannot change gradually between "
                "two seeds"
            )
            yield problem((*path, "method"), message, "write monte_carlo")
        for k, parameter in enumerate(self.parameters):
            with suppress(InvalidValueError):  # reported with the parameter
                if resolve_parameter(scenario, parameter).integers_only:
                    message = f"= {parameter.path} is a whole number, which does not scatter"
                    yield problem((*path, "parameters", k, "path"), message, "leave it out")
        for place, item in inputs:
            if isinstance(item, RandomInput) and item.amplitudes == "fixed":
                message = "= fixed is not a Gaussian process"
                yield problem(("excitation", *place, "amplitudes"), message, "leave it out, or write random")


class Optimise(_CaseSection):
    """The best design: a search for parameters that meet every limit and minimise or maximise a response."""

    kind: ClassVar[str] = "optimise"
    section: ClassVar[str] = "optimise"

    parameters: Annotated[tuple[DesignParameter, ...], Field(min_length=1)]
    """The design parameters: numbers with ranges or values, and catalogues."""
    minimise: Objective = ""
    """Response to minimise, as in vary.minimise; or a weighted sum of responses, each divided by the given value,
    {peak_force: 40 N, tip/peak_displacement: 1 mm}; or a list of two responses, for a Pareto front. Without an
    objective the smallest margin of the limits is maximised. """
    maximise: Objective = ""
    """Response to maximise; together with minimise there are two objectives."""
    tolerances: Tolerances | None = None
    """Deviations of each design, which are part of its evaluation: the best design is the best as built."""
    responses: tuple[q.Text, ...] = ()
    """Responses to compute in addition to the objectives and limits; only these by default."""
    most_cases: q.SteppedCount = 400
    """Largest number of designs, each with its deviations."""
    seed: q.RandomSeed = 0
    """Seed of the random generator."""

    def check(self) -> None:
        """Refuse more than two objectives."""
        count = sum(len(aim) if isinstance(aim, tuple) else bool(aim) for aim in (self.minimise, self.maximise))
        if count > 2:
            raise InvalidValueError(
                f"= {count} objectives, of which two are compared", "add some up: {peak_force: 40 N, ...}"
            )


Vary = Annotated[Grid | Zipped | OneAtATime | LatinHypercube | Sobol | Reliability, BY_FORM]


Value = float | str

_SECTIONS = ("vary", "optimise", "limits", "title", "identify_stiffness", "nnm")  # no case depends on them
UNCHANGED_CHOICE = "as it is"  # entry of a catalogue that leaves the scenario unchanged
_LIST_EXAMPLE = "write for example {path: snubbers.tip.gap, values: [0 mm, 0.1 mm]}"


@dataclass(frozen=True)
class VariedParameter:
    """A varied parameter with values in SI units."""

    path: str
    places: tuple[Path, ...]  # paths that get its value
    unit: str  # SI unit, "1" for plain numbers and words
    nominal: Value  # in the scenario
    values: tuple[Value, ...]  # as listed; empty for a range
    low: float = math.nan
    high: float = math.nan
    points: int = 0  # number of values of a range
    spacing: str = "linear"
    distribution: str = "uniform"
    integers_only: bool = False  # whether only whole numbers are allowed
    # of a catalogue, the values that each choice sets
    choices: Mapping[str, Mapping[Path, Any]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.values) or self.points

    @property
    def dependent_places(self) -> tuple[Path, ...]:
        """All paths that it changes, directly or as a consequence."""
        return (*self.places, *dict.fromkeys(place for changes in self.choices.values() for place in changes))


def varied_parameters(scenario: Whole) -> tuple[VariedParameter, ...]:
    """The varied parameters of a valid scenario; in a reliability study also the seeds of inputs."""
    assert scenario.study is not None
    numbers = tuple(resolve_parameter(scenario, parameter) for parameter in scenario.study.parameters)
    if not isinstance(scenario.study, Reliability):
        return numbers
    places = [("excitation", *at, "seed") for at, _ in inputs_with_seed(scenario.excitation)]
    return (*numbers, *(_number(scenario, path_text(place), [place]) for place in places))


def inputs_with_seed(excitation: Input) -> list[tuple[Path, RandomInput | MatchedInput]]:
    """The inputs with a seed, with their paths below the excitation."""
    return [(at, item) for at, item in excitation.items if isinstance(item, RandomInput | MatchedInput)]


def drawn_parameters(scenario: Whole, draws: Mapping[str, list[Any]]) -> tuple[VariedParameter, ...]:
    """The parameters of an ensemble, from the values of all draws by path (SI numbers, or text as in a list of values).

    Raises
    ------
    ScenarioError
        With its location in ``draws``.
    """
    parameters, problems, taken = [], [], dict[Path, str]()
    for path, values in draws.items():
        if not values:
            problems.append(problem((f"draws[{path!r}]",), "has no values", "give one value for each case"))
            continue
        try:
            parameters.append(_drawn_parameter(scenario, path, values))
        except InvalidValueError as error:
            problems.append(problem((f"draws[{path!r}]",), error.message, error.remedy))
            continue
        others = (taken.setdefault(place, path) for place in parameters[-1].places)
        if other := next((name for name in others if name != path), None):
            remedy = "give the values of every number once"
            problems.append(problem((f"draws[{path!r}]",), f"names a number that {other} names too", remedy))
    counts = {parameter.path: len(parameter.values) for parameter in parameters}
    if len(set(counts.values())) > 1:
        given = ", ".join(f"{count} of {path}" for path, count in counts.items())
        problems.append(
            problem(("draws",), f"have different numbers of values: {given}", "give all of them equally many")
        )
    if problems:
        raise ScenarioError(problems)
    return tuple(parameters)


def _drawn_parameter(scenario: Whole, path: str, values: list[Any]) -> VariedParameter:
    number = _number(scenario, path, _places(scenario, path, ("path",)))
    text = any(isinstance(value, str) for value in values)
    read = [_read(scenario, number.places[0], value, ()) for value in values] if text else values
    if number.integers_only:
        read = [int(value) if not isinstance(value, str) and float(value).is_integer() else value for value in read]
    return replace(number, nominal=math.nan, values=tuple(read))


def _number(scenario: Whole, path: str, places: Sequence[Path]) -> VariedParameter:
    """The number or word at these paths, with its nominal value."""
    field, nominal = field_type_at(scenario, places[0]), value_at(scenario, places[0])
    nominal = str(nominal) if isinstance(nominal, q.Rate) else nominal  # with its unit, like a word
    return VariedParameter(
        path=path, places=tuple(places), unit=unit_at(scenario, places[0]),
        nominal=nominal if isinstance(nominal, str) else float(nominal), values=(),
        integers_only=isinstance(field, q.WholeNumber) or (field is None and isinstance(nominal, int)),
    )  # fmt: skip


def case_count(vary: _CaseSection) -> int:
    """Largest number of cases, counting every realisation."""
    if isinstance(vary, Sobol):
        return vary.samples * (len(vary.parameters) + 2)
    if isinstance(vary, Reliability):
        return vary.most_cases
    if isinstance(vary, LatinHypercube | Optimise):
        count = vary.samples if isinstance(vary, LatinHypercube) else vary.most_cases
    else:
        assert isinstance(vary, Grid | Zipped | OneAtATime)
        counts = [value_count(parameter) for parameter in vary.parameters]
        if isinstance(vary, OneAtATime):
            return 1 + sum(counts)
        count = counts[0] if isinstance(vary, Zipped) else math.prod(counts)
    return count * (1 if vary.tolerances is None else 1 + vary.tolerances.samples)


def value_count(parameter: Any) -> int:
    """Number of values of a listed or ranged parameter."""
    if isinstance(parameter, ListedParameter | Catalogue):
        return len(parameter.values if isinstance(parameter, ListedParameter) else parameter.choices)
    assert isinstance(parameter, (RangedParameter, TolerancedParameter))
    return parameter.points


def parameter_problems(scenario: Whole, parameters: Sequence[Any], path: Path) -> Problems:
    """Problems of the parameters in a list at a path, individually and together."""
    yield from listing_problems(parameters, path, lambda each: resolve_parameter(scenario, each).dependent_places)


def resolve_parameter(scenario: Whole, parameter: Any) -> VariedParameter:
    """Resolve a parameter; raises `InvalidValueError` with a path relative to the parameter."""
    if isinstance(parameter, Catalogue):
        return _resolved_catalogue(scenario, parameter)
    places = _places(scenario, parameter.path, ("path",))
    for k, path in enumerate(parameter.also):
        places += _places(scenario, path, ("also", k))
    first, number = places[0], _number(scenario, parameter.path, places)
    nominal = number.nominal

    def read_end(value: Value, path: Path) -> float:
        end = _read(scenario, first, value, path)
        if isinstance(end, str):
            raise InvalidValueError(
                f"= {value} is a share, and a range has lengths", "write a length, or values: [40 %, 60 %]", path
            )
        return float(end)

    if isinstance(parameter, ListedParameter):
        read = [
            [_read(scenario, place, value, ("values", k)) for place in places]
            for k, value in enumerate(parameter.values)
        ]
        values = tuple(of_places[0] for of_places in read)
        if len(set(values)) < len(values):
            raise InvalidValueError("lists a value twice", "list every value once", ("values",))
        return replace(number, values=values)
    if isinstance(parameter, MeasuredParameter):
        data = () if isinstance(parameter.data, str) else parameter.data
        return replace(number, values=tuple(read_end(value, ("data", k)) for k, value in enumerate(data)))
    if choices_at(scenario, first) or isinstance(nominal, str):
        raise InvalidValueError(f"= {parameter.path} is a choice, which has no range", _LIST_EXAMPLE, ("path",))
    points = getattr(parameter, "points", 0)
    if isinstance(parameter, (RangedParameter, SampledRange)):
        low, high = (read_end(v, (key,)) for v, key in ((parameter.from_, "from"), (parameter.to, "to")))
        _check_range(parameter, low, high)
        spacing = parameter.spacing
    else:
        if any(value_at(scenario, place) != nominal for place in places):
            raise InvalidValueError(
                "needs one nominal value, but these paths have different ones", "vary them separately", ("path",)
            )
        key = "deviation" if isinstance(parameter, ScatteredParameter) else "tolerance"
        deviation = _deviation(scenario, first, getattr(parameter, key), float(nominal), key)
        if getattr(parameter, "distribution", "") == "lognormal" and not float(nominal) > 0.0:
            raise InvalidValueError(
                f"is about {nominal:g}, which is not positive", "write distribution: normal", ("distribution",)
            )
        low, high, spacing = float(nominal) - deviation, float(nominal) + deviation, "linear"
    for end in (low, high):
        for place in places:
            if not isinstance(parameter, ScatteredParameter):  # which has no range
                _read(scenario, place, end, ("tolerance" if hasattr(parameter, "tolerance") else "from",))
    if number.integers_only and points and abs(high - low) + 1 < points:
        raise InvalidValueError(
            f"= {points} is more than the whole numbers from {low:g} to {high:g}", "take fewer points", ("points",)
        )
    distribution = getattr(parameter, "distribution", "uniform")
    return replace(number, low=low, high=high, points=points, spacing=spacing, distribution=distribution)


def _check_range(parameter: RangedParameter | SampledRange, low: float, high: float) -> None:
    """Refuse a range that is empty, falls, or has no logarithm."""
    if low == high:
        raise InvalidValueError(f"= {high:g} equals the start of the range", "give a range, or values: [...]", ("to",))
    if isinstance(parameter, SampledRange) and low > high:
        raise InvalidValueError(f"= {high:g} lies below from = {low:g}", "write the lower value as from", ("to",))
    if parameter.spacing == "logarithmic" and not (low > 0.0 and high > 0.0):
        key = "from" if low <= 0.0 else "to"
        raise InvalidValueError(
            "must be positive where the spacing is logarithmic", "give a positive value, or spacing: linear", (key,)
        )


def _resolved_catalogue(scenario: Whole, catalogue: Catalogue) -> VariedParameter:
    """Values that each choice of a catalogue sets, found by comparing the scenario with and without its overrides."""
    written = {key: value for key, value in as_plain_data(scenario).items() if key not in _SECTIONS}
    as_it_is, choices = type(scenario).model_validate(written), dict[str, dict[Path, Any]]()
    for name, settings in catalogue.choices.items():
        try:
            chosen = type(scenario).model_validate(apply_overrides(from_python(written), settings))
        except ScenarioError as error:
            problem = error.problems[0]
            message, remedy = f"{problem.path} {problem.message}", problem.remedy
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = [part for part in first["loc"] if not str(part).startswith("<")]
            message = f"{path_text(tuple(where))} {first['msg'].removeprefix('Value error, ')}"
            remedy = getattr(first.get("ctx", {}).get("error"), "remedy", "write what --set takes")
        else:
            choices[name] = dict(_differences(as_it_is, chosen, ()))
            continue
        raise InvalidValueError(f"cannot be set: {message}", remedy, ("choices", name))
    if idle := {place[0] for changes in choices.values() for place in changes} & {*_SECTIONS}:
        raise InvalidValueError(
            f"set {idle.pop()}, on which no case depends", "set properties of the structure", ("choices",)
        )
    nominal = next((name for name, changes in choices.items() if not changes), UNCHANGED_CHOICE)
    return VariedParameter(catalogue.name, (), "1", nominal, tuple(choices), choices=choices)


def _differences(first: Any, second: Any, place: Path) -> Iterator[tuple[Path, Any]]:
    """Yield the differences between two sections, with the values of the second."""
    keys: Iterable[tuple[Any, Any]] = ()
    if isinstance(first, Schema) and type(first) is type(second):
        first, second, keys = first.__dict__, second.__dict__, type(first).keys().items()
    elif isinstance(first, dict) and isinstance(second, dict) and first.keys() == second.keys():
        keys = zip(first, first, strict=True)
    elif isinstance(first, tuple) and isinstance(second, tuple) and len(first) == len(second):
        keys = enumerate(range(len(first)))
    elif first != second:
        yield place, second
    for key, name in keys:
        yield from _differences(first[name], second[name], (*place, key))


def _places(scenario: Whole, path: str, source_path: Path) -> list[Path]:
    places = find_parameters(scenario, path, source_path)
    for place in places:
        if place[0] in _SECTIONS:
            raise InvalidValueError(
                f"= {path} has no effect on a case", "vary a number of the structure or the excitation", source_path
            )
        free_text = isinstance(value_at(scenario, place), str) and len(choices_at(scenario, place)) < 2
        takes_words = isinstance(field_type_at(scenario, place), q.WholeNumber)  # reduction.modes: all
        if place[-1] == "kind" or (free_text and not takes_words):
            raise InvalidValueError(
                f"= {path} is neither a number nor a choice", "vary a number, or a word such as a support", source_path
            )
    return places


def _read(scenario: Whole, place: Path, value: Value, path: Path) -> Value:
    """Read a value as the field at a path does; a level must have the quantity of that field."""
    read: Any = read_as(scenario, place, value, path)
    if isinstance(read, q.LevelValue):
        field: Any = field_type_at(scenario, place)
        known = dict(field.quantities)
        there, stated = dimension_of_level(scenario, place, known), known.get(str(read.quantity))
        if stated is not None and stated != there:
            remedy = f"write for example {there.example}"
            raise InvalidValueError(
                f"= {value} is {stated.with_article}, and {path_text(place)} is {there.with_article}", remedy, path
            )
        return float(read)
    return str(read) if isinstance(read, q.Rate | Share) else read  # a share follows the length in each case


def _deviation(scenario: Whole, place: Path, tolerance: Value, nominal: float, key: str) -> float:
    """The deviation at a key in SI units: a share of the nominal value, or an absolute value."""
    at: Path = (key,)
    try:
        if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
            deviation = abs(nominal) * read_quantity(tolerance, RATIO)
        else:
            of = dimension_at(scenario, place)
            deviation = read_quantity(tolerance, of if of is not None and of.unit else RATIO)
    except UnitError as error:
        raise InvalidValueError(
            f"= {tolerance} {error.message}", "write for example 2 %, or 0.05 mm for a length", at
        ) from None
    if not deviation > 0.0:
        remedy = "give it in the quantity's own unit" if nominal == 0.0 else "write for example 2 %"
        raise InvalidValueError(f"= {tolerance} of {nominal:g} leaves nothing to vary", remedy, at)
    return deviation


@dataclass(frozen=True)
class ToleratedParameter:
    """A parameter with a tolerance, in SI units."""

    parameter: VariedParameter  # with its nominal value
    share: float | None  # the tolerance as a share of the value, if given in percent

    def reach(self, value: float) -> float:
        """Largest deviation from a value."""
        return 0.5 * (self.parameter.high - self.parameter.low) if self.share is None else self.share * abs(value)


def tolerances_of(scenario: Whole) -> Tolerances | None:
    """The tolerances of a study."""
    return getattr(scenario.study, "tolerances", None)


def tolerated_parameters(scenario: Whole) -> tuple[ToleratedParameter, ...]:
    """The parameters with a tolerance in a valid scenario; empty without tolerances."""
    tolerances = tolerances_of(scenario)
    if tolerances is None:
        return ()
    parameters = []
    for asked in tolerances.parameters:
        number = resolve_parameter(scenario, asked)
        share = None
        if isinstance(asked.tolerance, str) and asked.tolerance.rstrip().endswith("%"):
            share = 0.5 * (number.high - number.low) / abs(float(number.nominal))
        parameters.append(ToleratedParameter(number, share))
    return tuple(parameters)
