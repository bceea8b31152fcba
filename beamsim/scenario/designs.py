"""Varied parameters: lists, ranges and tolerances of any numbers of a scenario, as a grid, zipped or sampled."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol, Self

from pydantic import Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import BY_KIND, Schema, Variants, fail, path_text
from beamsim.scenario.quantities import (
    FACTOR,
    LEVEL_DIMENSIONS,
    FieldType,
    LevelType,
    LevelValue,
    NotNegativeWhole,
    NumberOrText,
    Quantile,
    Quantity,
    Rate,
    SteppedCount,
    Text,
    Whole,
    level_unit,
)
from beamsim.scenario.units import UnitError

MOST_CASES = 200_000
"""Largest number of cases of a study."""

Path = tuple[str | int, ...]
Value = float | str

_SECTIONS = ("vary", "limits", "title")  # no case depends on them
_LIST_EXAMPLE = "write for example {path: snubbers.tip.gap, values: [0 mm, 0.1 mm]}"


AnyValue = Annotated[float | str, NumberOrText(words=True)]
Spacing = Literal["linear", "logarithmic"]


class _Parameter(Schema):
    """What all varied parameters share."""

    path: Text
    """Path of the number or choice, for example beam.thickness, snubbers.tip.gap or beam.point_masses[*].mass."""
    also: tuple[Text, ...] = ()
    """Other paths that take the same value, such as a probe that moves with a snubber."""


class ListedParameter(_Parameter):
    """A list of values."""

    values: Annotated[tuple[AnyValue, ...], Field(min_length=1)]
    """The values, with or without unit; or choices, such as supports."""


class _Ranged(_Parameter):
    """A parameter with a range."""

    from_: AnyValue = Field(alias="from")
    """First value."""
    to: AnyValue
    """Last value."""
    spacing: Spacing = "linear"
    """Whether the values or their logarithms are evenly spaced, or sampled uniformly."""


class _Toleranced(_Parameter):
    """A parameter with a tolerance about its value in the scenario."""

    tolerance: AnyValue
    """Deviation to either side: in percent of the scenario's value, or in the quantity's own unit."""


class RangedParameter(_Ranged):
    """Evenly spaced values of a range."""

    points: SteppedCount
    """Number of values."""


class TolerancedParameter(_Toleranced):
    """The value in the scenario and its tolerance."""

    points: SteppedCount = 3
    """Number of values from the lowest to the highest."""


class SampledRange(_Ranged):
    """Any value of a range."""


class SampledTolerance(_Toleranced):
    """Any value within the tolerance about the value in the scenario."""

    distribution: Literal["uniform", "normal"] = "uniform"
    """Uniform within the tolerance; or normal, truncated at the tolerance of three standard deviations."""


def _by_keys(*keys: str) -> Callable[[Any], str | None]:
    """Tells members of a union apart by the first of the keys that they have."""

    def choose(value: Any) -> str | None:
        given = value if isinstance(value, dict) else type(value).keys() if isinstance(value, _Parameter) else ()
        return next((f"<{key}>" for key in keys if key in given), None)

    return choose


AnyParameter = Annotated[
    Annotated[ListedParameter, Tag("<values>")]
    | Annotated[RangedParameter, Tag("<from>")]
    | Annotated[TolerancedParameter, Tag("<tolerance>")],
    Variants(
        _by_keys("values", "tolerance", "from"),
        "names no values",
        "give path with values: [...], with from, to and points, or with a tolerance",
    ),
]
SampledParameter = Annotated[
    Annotated[SampledRange, Tag("<from>")] | Annotated[SampledTolerance, Tag("<tolerance>")],
    Variants(
        _by_keys("tolerance", "from"), "names no range to sample", "give path with from and to, or with a tolerance"
    ),
]


class _Study(Schema):
    """What all kinds of studies share."""

    responses: tuple[Text, ...] = ()
    """Responses that are computed, such as peak_force; all by default, of which the bending stress takes longest."""
    minimise: Text = ""
    """Response that is smallest in the best case that meets every limit: a quantity such as peak_force, which counts
    where it is largest, or a response by name, such as snubbers/tip/peak_force. Without it the best case is the one
    with the largest margin."""
    maximise: Text = ""
    """Response that is largest in the best case; see minimise."""

    @model_validator(mode="after")
    def _one_objective(self) -> Self:
        if self.minimise and self.maximise:
            raise fail("stands beside minimise", "name one objective, minimise or maximise", ("maximise",))
        return self


class Tolerances(Schema):
    """What manufacture leaves open: every case is solved as it is, and again for each of a sample of deviations."""

    samples: SteppedCount = 20
    """Number of deviations, a Latin-hypercube sample; it is the same for all cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    quantile: Quantile = 1.0
    """Limits and the objective judge a case by this quantile of its values, counted from the good side; by default by
    the worst of them."""
    parameters: Annotated[tuple[SampledTolerance, ...], Field(min_length=1)]
    """The numbers with a tolerance. That of a varied number is about its value in each case."""

    def settle(self) -> None:
        """Refuse a quantile beyond what the realisations, the nominal one among them, can tell from the worst."""
        super().settle()
        if self.quantile < 1.0 and math.ceil(self.quantile * self.samples) >= self.samples:
            enough = math.ceil(round(1.0 / (1.0 - self.quantile), 6))
            raise fail(
                f"= {100 * self.quantile:.10g} % of {self.samples + 1} realisations is the worst of them",
                f"give samples: {enough} or more, or leave quantile out", ("quantile",),
            )  # fmt: skip


class _ToleratedStudy(_Study):
    """What the kinds of studies share that choose among cases."""

    tolerances: Tolerances | None = None
    """Deviations of each case, by which it is judged."""


class Grid(_ToleratedStudy):
    """Every combination of the parameters' values."""

    kind: Literal["grid"] = "grid"
    """Every combination."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class Zipped(_ToleratedStudy):
    """All first values together, all second values together, and so on."""

    kind: Literal["zip"] = "zip"
    """Values paired by position."""
    parameters: Annotated[tuple[AnyParameter, ...], Field(min_length=1)]
    """The varied parameters; all need the same number of values."""


class LatinHypercube(_ToleratedStudy):
    """A Latin-hypercube sample: one value of every parameter in each of `samples` equally likely intervals."""

    kind: Literal["latin_hypercube"] = "latin_hypercube"
    """A Latin-hypercube sample."""
    samples: SteppedCount
    """Number of cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters."""


class Sobol(_Study):
    """A sample for Sobol' indices: which parameter accounts for which share of a response's variance."""

    kind: Literal["sobol"] = "sobol"
    """A sample for Sobol' indices."""
    samples: SteppedCount
    """Size n of the sample, a power of two; there are n times the number of parameters plus two cases."""
    seed: NotNegativeWhole = 0
    """Seed of the random generator."""
    parameters: Annotated[tuple[SampledParameter, ...], Field(min_length=1)]
    """The varied parameters, which are independent of each other."""


Vary = Annotated[Grid | Zipped | LatinHypercube | Sobol, BY_KIND]


@dataclass(frozen=True)
class VariedParameter:
    """A varied parameter in SI units."""

    path: str
    places: tuple[Path, ...]  # where its value goes
    unit: str  # SI unit, "1" for plain numbers and words
    nominal: Value  # in the scenario
    values: tuple[Value, ...]  # as listed; empty for a range
    low: float = math.nan
    high: float = math.nan
    points: int = 0  # of a range
    spacing: str = "linear"
    distribution: str = "uniform"
    whole: bool = False  # only whole numbers

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.values) or self.points


class Varied(Protocol):
    """A scenario in which something is varied."""

    @property
    def whole(self) -> Schema:
        """The scenario itself."""

    @property
    def vary(self) -> Vary | None:
        """What is varied."""


def varied_parameters(scenario: Varied) -> tuple[VariedParameter, ...]:
    """The varied parameters of a scenario that passed its checks."""
    assert scenario.vary is not None
    return tuple(resolve_parameter(scenario.whole, parameter) for parameter in scenario.vary.parameters)


def drawn_parameters(scenario: Schema, draws: Mapping[str, list[Any]]) -> tuple[VariedParameter, ...]:
    """The parameters of an ensemble: by path the values of all draws, SI numbers or text as a list of values has it.

    Raises
    ------
    ScenarioError
        Located in ``draws``.
    """
    parameters, problems, taken = [], [], dict[Path, str]()
    for path, values in draws.items():
        if not values:
            problems.append(Problem(f"draws[{path!r}]", "has no values", "give one value for each case"))
            continue
        try:
            parameters.append(_drawn_parameter(scenario, path, values))
        except PydanticCustomError as error:
            context = error.context or {}
            problems.append(Problem(f"draws[{path!r}]", context["message"], context["remedy"]))
            continue
        others = (taken.setdefault(place, path) for place in parameters[-1].places)
        if other := next((name for name in others if name != path), None):
            remedy = "give the values of every number once"
            problems.append(Problem(f"draws[{path!r}]", f"names a number that {other} names too", remedy))
    counts = {parameter.path: len(parameter.values) for parameter in parameters}
    if len(set(counts.values())) > 1:
        given = ", ".join(f"{count} of {path}" for path, count in counts.items())
        problems.append(Problem("draws", f"have different numbers of values: {given}", "give all of them equally many"))
    if problems:
        raise ScenarioError(problems)
    return tuple(parameters)


def _drawn_parameter(scenario: Schema, path: str, values: list[Any]) -> VariedParameter:
    from beamsim.scenario.parameters import field_type_at, value_at

    places = _places(scenario, path, ("path",))
    field = field_type_at(scenario, places[0])
    text = any(isinstance(value, str) for value in values)
    read = [_read(scenario, places[0], value, ()) for value in values] if text else values
    nominal = value_at(scenario, places[0])
    whole = isinstance(field, Whole) or (field is None and isinstance(nominal, int))
    if whole:
        read = [int(value) if not isinstance(value, str) and float(value).is_integer() else value for value in read]
    return VariedParameter(
        path=path, places=tuple(places), unit=_unit(scenario, places[0], field), nominal=math.nan, values=tuple(read),
        whole=whole,
    )  # fmt: skip


def case_count(vary: Vary) -> int:
    """Number of cases that are solved, each realisation counted."""
    if isinstance(vary, Sobol):
        return vary.samples * (len(vary.parameters) + 2)
    realisations = 1 if vary.tolerances is None else 1 + vary.tolerances.samples
    if isinstance(vary, LatinHypercube):
        return vary.samples * realisations
    counts = [_count(parameter) for parameter in vary.parameters]
    return (counts[0] if isinstance(vary, Zipped) else math.prod(counts)) * realisations


def design_problems(scenario: Schema, vary: Vary) -> Iterator[Problem]:
    """Unknown paths, values that their fields do not accept, too many cases."""
    yield from parameter_problems(scenario, vary.parameters, ("vary", "parameters"))
    if isinstance(vary, Zipped):
        counts = [_count(parameter) for parameter in vary.parameters]
        if len(set(counts)) > 1:
            yield Problem(
                "vary.parameters",
                f"have {', '.join(map(str, counts))} values, which cannot be zipped",
                "give all of them equally many, or write kind: grid",
            )
    if isinstance(vary, Sobol) and vary.samples & (vary.samples - 1):
        power = 2 ** (vary.samples - 1).bit_length()
        yield Problem("vary.samples", f"= {vary.samples} is not a power of two", f"take {power // 2} or {power}")
    count = case_count(vary)
    if count > MOST_CASES:
        yield Problem(
            "vary",
            f"asks for {count:.3g} cases (at most {MOST_CASES:,} are computed)".replace(",", " "),
            "take fewer values of each parameter, or sample: kind: latin_hypercube with samples: 1000",
        )


def parameter_problems(scenario: Schema, parameters: Sequence[Any], section: Path) -> Iterator[Problem]:
    """What is wrong with the parameters that a section lists, each alone and with the others."""
    taken: dict[Path, int] = {}
    for index, parameter in enumerate(parameters):
        at = (*section, index)
        try:
            varied = resolve_parameter(scenario, parameter)
        except PydanticCustomError as error:
            context = error.context or {}
            yield Problem(path_text((*at, *context["at"])), context["message"], context["remedy"])
            continue
        for place in varied.places:
            if taken.setdefault(place, index) != index:
                yield Problem(
                    path_text((*at, "path")),
                    f"= {varied.path} is varied twice, also by {path_text(('vary', 'parameters', taken[place]))}",
                    "list every parameter once",
                )
                break


def _count(parameter: Schema) -> int:
    if isinstance(parameter, ListedParameter):
        return len(parameter.values)
    assert isinstance(parameter, (RangedParameter, TolerancedParameter))
    return parameter.points


def resolve_parameter(scenario: Schema, parameter: Any) -> VariedParameter:
    """Resolve a parameter; raises what `fail` builds, ``at`` being relative to the parameter."""
    from beamsim.scenario.parameters import choices_at, field_type_at, value_at

    places = _places(scenario, parameter.path, ("path",))
    for k, path in enumerate(parameter.also):
        places += _places(scenario, path, ("also", k))
    first = places[0]
    field = field_type_at(scenario, first)
    choices = choices_at(scenario, first)
    nominal = value_at(scenario, first)
    nominal = str(nominal) if isinstance(nominal, Rate) else nominal  # with its unit, like a word
    common: dict[str, Any] = {
        "path": parameter.path,
        "places": tuple(places),
        "unit": _unit(scenario, first, field),
        "nominal": nominal if isinstance(nominal, str) else float(nominal),
        "whole": isinstance(field, Whole) or (field is None and isinstance(nominal, int)),
    }

    def read(value: Value, at: Path, place: Path = first) -> Value:
        return _read(scenario, place, value, at)

    if isinstance(parameter, ListedParameter):
        values = tuple(read(value, ("values", k)) for k, value in enumerate(parameter.values))
        for k, value in enumerate(parameter.values):
            for place in places[1:]:
                read(value, ("values", k), place)
        if len(set(values)) < len(values):
            raise fail("lists a value twice", "list every value once", ("values",))
        return VariedParameter(**common, values=values)
    if choices or isinstance(nominal, str):
        raise fail(f"= {parameter.path} is a choice, which has no range", _LIST_EXAMPLE, ("path",))
    points = getattr(parameter, "points", 0)
    if isinstance(parameter, (RangedParameter, SampledRange)):
        low, high = (float(read(v, (key,))) for v, key in ((parameter.from_, "from"), (parameter.to, "to")))
        if low == high:
            raise fail(f"= {high:g} equals the start of the range", "give a range, or values: [...]", ("to",))
        if isinstance(parameter, SampledRange) and low > high:
            raise fail(f"= {high:g} lies below from = {low:g}", "write the lower value as from", ("to",))
        if parameter.spacing == "logarithmic" and not (low > 0.0 and high > 0.0):
            key = "from" if low <= 0.0 else "to"
            raise fail(
                "must be positive where the spacing is logarithmic", "give a positive value, or spacing: linear", (key,)
            )
        spacing = parameter.spacing
    else:
        if any(value_at(scenario, place) != nominal for place in places):
            raise fail(
                "needs one nominal value, but these paths have different ones",
                "vary them separately",
                ("path",),
            )
        deviation = _deviation(scenario, first, parameter.tolerance, float(nominal))
        low, high, spacing = float(nominal) - deviation, float(nominal) + deviation, "linear"
    for end in (low, high):
        for place in places:
            read(end, ("tolerance" if hasattr(parameter, "tolerance") else "from",), place)
    if common["whole"] and points and abs(high - low) + 1 < points:
        raise fail(
            f"= {points} is more than the whole numbers from {low:g} to {high:g}", "take fewer points", ("points",)
        )
    distribution = getattr(parameter, "distribution", "uniform")
    return VariedParameter(
        **common, values=(), low=low, high=high, points=points, spacing=spacing, distribution=distribution
    )


def _places(scenario: Schema, path: str, at: Path) -> list[Path]:
    from beamsim.scenario.parameters import choices_at, find_parameters, value_at

    try:
        places = find_parameters(scenario, path, (Rate,))
    except PydanticCustomError as error:
        context = error.context or {}
        raise fail(context["message"], context["remedy"], at) from None
    for place in places:
        if place[0] in _SECTIONS:
            raise fail(f"= {path} has no effect on a case", "vary a number of the structure or the excitation", at)
        free_text = isinstance(value_at(scenario, place), str) and len(choices_at(scenario, place)) < 2
        if place[-1] == "kind" or (free_text and not _takes_words(scenario, place)):
            raise fail(f"= {path} is neither a number nor a choice", "vary a number, or a word such as a support", at)
    return places


def _takes_words(scenario: Schema, place: Path) -> bool:
    from beamsim.scenario.parameters import field_type_at

    return isinstance(field_type_at(scenario, place), Whole)  # reduction.modes: all


def _read(scenario: Schema, place: Path, value: Value, at: Path) -> Value:
    """Read a value as the field at a place does."""
    from beamsim.scenario.parameters import choices_at, field_type_at

    choices = choices_at(scenario, place)
    if choices:
        if value not in choices:
            raise fail(f"= {value} is not one of {', '.join(choices)}", "choose one of these", at)
        return value
    field = field_type_at(scenario, place)
    if field is None:
        if isinstance(value, str):
            raise fail(f"= {value} must be a number", f"write the SI value for {path_text(place)}", at)
        return float(value)
    try:
        number = field.read(value)
    except UnitError as error:
        shown = f"{value:.12g}" if isinstance(value, float) else value
        raise fail(f"= {shown} {error.message} (as {path_text(place)})", error.remedy, at) from None
    if isinstance(number, LevelValue):
        quantity = _quantity(scenario, place)
        if number.quantity not in (None, quantity):
            raise fail(
                f"= {value} is given in a unit of {number.quantity}, and the level there is of {quantity}",
                f"give it in a unit of {quantity}" if quantity != FACTOR else "give a plain number: 0.5",
                at,
            )
        return float(number)
    if isinstance(number, Rate):
        return str(number)
    return number if isinstance(number, (int, float, str)) else float(number)


def _deviation(scenario: Schema, place: Path, tolerance: Value, nominal: float) -> float:
    """Deviation in SI units: a share of the nominal value, or an absolute one in the field's dimension."""
    from beamsim.scenario.parameters import field_type_at
    from beamsim.scenario.units import RATIO, read_level, read_quantity

    at: Path = ("tolerance",)
    field = field_type_at(scenario, place)
    try:
        if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
            deviation = abs(nominal) * read_quantity(tolerance, RATIO)
        elif isinstance(field, Quantity) and field.dimension.unit:
            deviation = read_quantity(tolerance, field.dimension)
        elif isinstance(field, LevelType):
            quantity = _quantity(scenario, place)
            dimension = RATIO if quantity == FACTOR else LEVEL_DIMENSIONS[quantity]
            deviation = read_level(tolerance, (dimension,))[0]
        else:
            deviation = read_quantity(tolerance, RATIO)
    except UnitError as error:
        raise fail(f"= {tolerance} {error.message}", "write for example 2 %, or 0.05 mm for a length", at) from None
    if not deviation > 0.0:
        remedy = "give it in the quantity's own unit" if nominal == 0.0 else "write for example 2 %"
        raise fail(f"= {tolerance} of {nominal:g} leaves nothing to vary", remedy, at)
    return deviation


def _quantity(scenario: Any, place: Path) -> str:
    """Quantity of the level at a place: its own force's, or that of the whole excitation."""
    excitation = scenario.excitation
    if place[:2] == ("excitation", "forces"):
        excitation = excitation.forces[place[2]]
    return getattr(excitation, "quantity", None) or "acceleration"


def _unit(scenario: Schema, place: Path, field: FieldType | None) -> str:
    if isinstance(field, Quantity):
        return field.dimension.unit or "1"
    if isinstance(field, LevelType):
        return level_unit(_quantity(scenario, place))
    return "1"
