"""The varied numbers of a scenario and those with a tolerance, in SI units with their places."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic_core import PydanticCustomError

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import quantities as q
from beamsim.scenario.base import Path, fail, refused
from beamsim.scenario.designs import (
    LatinHypercube,
    ListedParameter,
    RangedParameter,
    SampledRange,
    Sobol,
    TolerancedParameter,
    Tolerances,
    Vary,
    Zipped,
)
from beamsim.scenario.parameters import choices_at, field_type_at, find_parameters, read_as, value_at
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.units import RATIO, UnitError, read_level, read_quantity

Value = float | str

_SECTIONS = ("vary", "limits", "title")  # no case depends on them
_LIST_EXAMPLE = "write for example {path: snubbers.tip.gap, values: [0 mm, 0.1 mm]}"


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


def varied_parameters(scenario: ScenarioParts) -> tuple[VariedParameter, ...]:
    """The varied parameters of a scenario that passed its checks."""
    assert scenario.vary is not None
    return tuple(resolve_parameter(scenario, parameter) for parameter in scenario.vary.parameters)


def drawn_parameters(scenario: ScenarioParts, draws: Mapping[str, list[Any]]) -> tuple[VariedParameter, ...]:
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
            problems.append(replace(refused(error, ()), path=f"draws[{path!r}]"))
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


def _drawn_parameter(scenario: ScenarioParts, path: str, values: list[Any]) -> VariedParameter:
    places = _places(scenario, path, ("path",))
    field = field_type_at(scenario, places[0])
    text = any(isinstance(value, str) for value in values)
    read = [_read(scenario, places[0], value, ()) for value in values] if text else values
    nominal = value_at(scenario, places[0])
    whole = isinstance(field, q.Whole) or (field is None and isinstance(nominal, int))
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
    counts = [value_count(parameter) for parameter in vary.parameters]
    return (counts[0] if isinstance(vary, Zipped) else math.prod(counts)) * realisations


def value_count(parameter: Any) -> int:
    """Number of values of a listed or ranged parameter."""
    if isinstance(parameter, ListedParameter):
        return len(parameter.values)
    assert isinstance(parameter, (RangedParameter, TolerancedParameter))
    return parameter.points


def resolve_parameter(scenario: ScenarioParts, parameter: Any) -> VariedParameter:
    """Resolve a parameter; raises what `fail` builds, ``at`` being relative to the parameter."""
    places = _places(scenario, parameter.path, ("path",))
    for k, path in enumerate(parameter.also):
        places += _places(scenario, path, ("also", k))
    first = places[0]
    field = field_type_at(scenario, first)
    choices = choices_at(scenario, first)
    nominal = value_at(scenario, first)
    nominal = str(nominal) if isinstance(nominal, q.Rate) else nominal  # with its unit, like a word
    common: dict[str, Any] = {
        "path": parameter.path,
        "places": tuple(places),
        "unit": _unit(scenario, first, field),
        "nominal": nominal if isinstance(nominal, str) else float(nominal),
        "whole": isinstance(field, q.Whole) or (field is None and isinstance(nominal, int)),
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


def _places(scenario: ScenarioParts, path: str, at: Path) -> list[Path]:
    places = find_parameters(scenario, path, (q.Rate,), at)
    for place in places:
        if place[0] in _SECTIONS:
            raise fail(f"= {path} has no effect on a case", "vary a number of the structure or the excitation", at)
        free_text = isinstance(value_at(scenario, place), str) and len(choices_at(scenario, place)) < 2
        if place[-1] == "kind" or (free_text and not _takes_words(scenario, place)):
            raise fail(f"= {path} is neither a number nor a choice", "vary a number, or a word such as a support", at)
    return places


def _takes_words(scenario: ScenarioParts, place: Path) -> bool:
    return isinstance(field_type_at(scenario, place), q.Whole)  # reduction.modes: all


def _read(scenario: ScenarioParts, place: Path, value: Value, at: Path) -> Value:
    """Read a value as the field at a place does; a level must be of the quantity there."""
    read: Any = read_as(scenario, place, value, at)
    if isinstance(read, q.LevelValue):
        quantity = _quantity(scenario, place)
        if read.quantity not in (None, quantity):
            raise fail(
                f"= {value} is given in a unit of {read.quantity}, and the level there is of {quantity}",
                f"give it in a unit of {quantity}" if quantity != q.FACTOR else "give a plain number: 0.5",
                at,
            )
        return float(read)
    return str(read) if isinstance(read, q.Rate) else read


def _deviation(scenario: ScenarioParts, place: Path, tolerance: Value, nominal: float) -> float:
    """Deviation in SI units: a share of the nominal value, or an absolute one in the field's dimension."""
    at: Path = ("tolerance",)
    field = field_type_at(scenario, place)
    try:
        if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
            deviation = abs(nominal) * read_quantity(tolerance, RATIO)
        elif isinstance(field, q.Quantity) and field.dimension.unit:
            deviation = read_quantity(tolerance, field.dimension)
        elif isinstance(field, q.LevelType):
            quantity = _quantity(scenario, place)
            dimension = RATIO if quantity == q.FACTOR else q.LEVEL_DIMENSIONS[quantity]
            deviation = read_level(tolerance, (dimension,))[0]
        else:
            deviation = read_quantity(tolerance, RATIO)
    except UnitError as error:
        raise fail(f"= {tolerance} {error.message}", "write for example 2 %, or 0.05 mm for a length", at) from None
    if not deviation > 0.0:
        remedy = "give it in the quantity's own unit" if nominal == 0.0 else "write for example 2 %"
        raise fail(f"= {tolerance} of {nominal:g} leaves nothing to vary", remedy, at)
    return deviation


def _quantity(scenario: ScenarioParts, place: Path) -> str:
    """Quantity of the level at a place: its own force's, or that of the whole excitation."""
    excitation: Any = scenario.excitation
    if place[:2] == ("excitation", "forces"):
        excitation = excitation.forces[place[2]]
    return getattr(excitation, "quantity", None) or "acceleration"


def _unit(scenario: ScenarioParts, place: Path, field: q.FieldType | None) -> str:
    if isinstance(field, q.Quantity):
        return field.dimension.unit or "1"
    if isinstance(field, q.LevelType):
        return q.level_unit(_quantity(scenario, place))
    return "1"


@dataclass(frozen=True)
class ToleratedParameter:
    """A number with a tolerance, in SI units."""

    number: VariedParameter  # about its value in the scenario
    share: float | None  # the tolerance as a share of the value, where it is given in percent

    def reach(self, value: float) -> float:
        """Largest deviation from a value."""
        return 0.5 * (self.number.high - self.number.low) if self.share is None else self.share * abs(value)


def tolerances_of(scenario: ScenarioParts) -> Tolerances | None:
    """The tolerances of a study."""
    return None if scenario.vary is None or isinstance(scenario.vary, Sobol) else scenario.vary.tolerances


def tolerated_parameters(scenario: ScenarioParts) -> tuple[ToleratedParameter, ...]:
    """The numbers with a tolerance of a scenario that passed its checks; none without tolerances."""
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
