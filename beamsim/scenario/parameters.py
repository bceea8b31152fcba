"""Numbers of a scenario addressed by path: read them, and build the same scenario with other values.

A path is written as in overrides, ``beam.point_masses[0].mass``; ``[*]`` means every item of a list
(``beam.point_masses[*].mass``: all the masses together), and a snubber may be named: ``snubbers.tip.stiffness``
(``snubbers[1st].stiffness`` where the name is not a word).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, TypeVar, get_args, get_origin

from pydantic import ValidationError

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario import quantities as q
from beamsim.scenario.base import (
    Path,
    Schema,
    Unfit,
    path_parts,
    path_text,
    plain,
    single_line,
    suggestion,
    words_of,
)
from beamsim.scenario.excitation import Input, MatchedInput, RandomInput
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.quantities import FieldType, LevelValue, PositionType, Share, meant
from beamsim.scenario.studies import (
    Catalogue,
    IdentifyStiffness,
    LatinHypercube,
    ListedParameter,
    Measured,
    OneAtATime,
    Optimise,
    RangedParameter,
    Reliability,
    SampledRange,
    Scattered,
    Sobol,
    SoughtParameter,
    TolerancedParameter,
    Tolerances,
    Vary,
    Zipped,
)
from beamsim.scenario.sweep import PositionPath
from beamsim.scenario.tree import apply_overrides, from_python, in_a_body, indices
from beamsim.scenario.units import NUMBER, RATIO, Dimension, UnitError, read_quantity

AnyScenario = TypeVar("AnyScenario", bound=ScenarioParts)
Part = TypeVar("Part", bound=Schema)


def find_parameters(scenario: ScenarioParts, path: str, at: Path = ()) -> list[Path]:
    """The places that a path names, at least one: numbers, words and sweep rates.

    Parameters
    ----------
    scenario : what has them.
    path : as a user writes it.
    at : where the path stands, for what is raised.

    Returns
    -------
    list of Path
        In the order of the scenario.

    Raises
    ------
    Unfit
        where the path does not exist; to be located by the caller.
    """
    parts = path_parts(path)
    if not parts:
        raise Unfit(f"= {path} is not a path", "write for example beam.youngs_modulus or snubbers.tip.stiffness", at)
    try:
        return _walk(scenario, parts, ())
    except Unfit as error:
        remedy = in_a_body(from_python(plain(scenario)), parts) or error.remedy
        raise Unfit(f"= {path} {error.message}", remedy, at) from None


def value_at(scenario: ScenarioParts, place: Path) -> Any:
    """The value at a place, by default or as it was written; a share of a length is given in metres."""
    if place == ("run", "sample_rate"):
        return scenario.sample_rate
    value: Any = scenario
    for part in place:
        value = _inside(value, part)
    return _in_metres(scenario, place, value)


def _in_metres(scenario: ScenarioParts, place: Path, value: Any) -> Any:
    """A value of the field at a place, a share of a length in metres."""
    side = side_at(scenario, place) if isinstance(value, Share) else None
    return value if side is None else scenario.all_bodies[side.body].metres(value, side.axis)


class Side(NamedTuple):
    """What a position is measured along."""

    body: str  # its name
    axis: int  # number of the side of the body, from 0


def side_at(scenario: ScenarioParts, place: Path) -> Side | None:
    """What the position at a place is measured along; None where there is none, or of no body."""
    body = scenario.all_bodies.get(body_of(scenario, place))
    if body is None or not isinstance(field_type_at(scenario, place), PositionType):
        return None
    # the second number of a point, and y of a table, lie along the second side
    second = isinstance(place[-1], int) and (place[-2] == "y" or (place[-2] != "x" and place[-1] == 1))
    return Side(body_of(scenario, place), int(second and len(body.sides) > 1))


def body_of(scenario: ScenarioParts, place: Path) -> str:
    """Name of the body that something at a place is on; empty where none is named and there are several.

    It is that in which the place is, which is named beside it, or that of the snubber which is.
    """
    value: Any = scenario
    named = scenario.body_at(place) or scenario.default_body
    for part in place:
        value = _inside(value, part)
        if isinstance(value, PositionPath | IdentifyStiffness):
            stops = (*scenario.located_snubbers, *scenario.written_snubbers)  # of pairs each stop, and both as one
            found = [each for each in stops if value.snubber in (None, each.item.name)]
            named = found[0].bodies[0] if found else ""
        elif isinstance(body := getattr(value, "body", None), str):
            named = body
    return named


def _inside(owner: Any, part: str | int) -> Any:
    if isinstance(owner, Schema):
        return getattr(owner, type(owner).attributes().get(str(part), str(part)))
    return owner[part]


def with_values(scenario: AnyScenario, values: Mapping[Path, object]) -> AnyScenario:
    """The same scenario with other values at these places, as if they had been written there.

    Parts are not compared with each other; see `beamsim.scenario.Scenario.rechecked`.

    Parameters
    ----------
    scenario : what holds the values.
    values : by place SI numbers, words, or whole parts of the scenario; a level keeps its quantity.

    Returns
    -------
    AnyScenario
        In which what follows from the values has followed.

    Raises
    ------
    ScenarioError
        If a field does not accept its value.
    """
    return replaced(scenario, {place: _as_read(scenario, place, value) for place, value in values.items()})


def replaced(part: Part, values: Mapping[Path, object]) -> Part:
    """The same scenario, or part, with other values at these places, which may be a little outside of their bounds."""
    for place, value in values.items():
        part = _replaced(part, place, value)
    return part


def _as_read(scenario: ScenarioParts, place: Path, value: object) -> object:
    """A value as the field at a place reads it; parts, words and plain flags as they are."""
    if isinstance(value, Schema) or field_type_at(scenario, place) is None:
        return value
    try:
        read = read_as(scenario, place, value)
    except Unfit as error:
        raise ScenarioError(error.problem(place)) from None
    return LevelValue(read, meant(read) or meant(value_at(scenario, place))) if isinstance(read, LevelValue) else read


def read_as(scenario: ScenarioParts, place: Path, value: object, at: Path = ()) -> Any:
    """Read a value as the field at a place would: an SI number, which may know its quantity, a word, rate or share.

    Parameters
    ----------
    scenario : what has the field.
    place : of the field.
    value : a number, perhaps with a unit, or a word.
    at : where the value stands, for what is raised.

    Returns
    -------
    float | int | str | Rate | Share

    Raises
    ------
    Unfit
        Where the field would refuse it.
    """
    shown = f"= {single_line(value)}"
    if choices := choices_at(scenario, place):
        if value not in choices:
            raise Unfit(f"{shown} is not one of {', '.join(choices)}", "choose one of these", at)
        return value
    field = field_type_at(scenario, place)
    if field is None:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise Unfit(f"{shown} must be a number", f"write the SI value for {path_text(place)}", at)
        return float(value)
    try:
        return field.read(value)
    except UnitError as error:
        as_place = f" (as {path_text(place)})" if at not in ((), place) else ""
        raise Unfit(f"{shown} {error.message}{as_place}", error.remedy, at) from None


def bounds_of(scenario: ScenarioParts, sought: SoughtParameter) -> tuple[float, float]:
    """Lowest and highest value of a number that is sought, in SI units; infinite where none are given.

    Raises
    ------
    Unfit
        Where the field would refuse one of them, or it lies beyond the body that the number is a position on.
    """
    if not sought.bounds:
        return -math.inf, math.inf
    place = find_parameters(scenario, sought.parameter)[0]
    low, high = (_in_metres(scenario, place, read_as(scenario, place, bound, ("bounds",))) for bound in sought.bounds)
    if (side := side_at(scenario, place)) is not None:
        for bound in (low, high):
            beyond = scenario.all_bodies[side.body].beyond(scenario.body_path(side.body), ("bounds",), bound, side.axis)
            for found in beyond:
                raise Unfit(found.message, found.remedy, ("bounds",))
    return low, high


def choices_at(scenario: ScenarioParts, place: Path) -> tuple[str, ...]:
    """The words that the field at a place may hold (supports); none for a number."""
    if not isinstance(place[-1], str) or not isinstance(value_at(scenario, place), str):
        return ()
    words = words_of(_field(value_at(scenario, place[:-1]), place[-1]).annotation)
    return words if len(words) > 1 else ()


def _field(owner: Schema, key: str) -> Any:
    return type(owner).model_fields[type(owner).keys()[key]]


def field_type_at(scenario: ScenarioParts, place: Path) -> FieldType | None:
    """What reads the value at a place; None for words and plain flags."""
    last = max(k for k, part in enumerate(place) if isinstance(part, str))
    owner = value_at(scenario, place[:last])
    if not isinstance(owner, Schema):
        return None
    return field_type(owner, str(place[last]), place[last + 1 :])


def field_type(owner: Schema, key: str, indices: Path = ()) -> FieldType | None:
    """What reads the value of a key of a section, or the number at these indices of it."""
    field = _field(owner, key)
    return next(_types(field.annotation, field.metadata, indices), None)


def _types(annotation: Any, metadata: Iterable[Any], indices: Path) -> Iterator[FieldType]:
    """What reads a value, or the number at these indices of it: of a pair the second may be of another sort."""
    yield from (item for item in metadata if isinstance(item, FieldType))
    parts = get_args(annotation)
    if get_origin(annotation) is tuple:
        first, indices = indices[:1], indices[1:]
        parts = parts if Ellipsis in parts else tuple(part for k, part in enumerate(parts) if k in first or not first)
    for part in parts:
        yield from _types(part, getattr(part, "__metadata__", ()), indices)


def _walk(value: Any, parts: list[str | int], walked: Path) -> list[Path]:
    if not parts:
        leaf = isinstance(value, int | float | str | Share | q.Rate) and not isinstance(value, bool)
        if walked != ("run", "sample_rate") and not leaf:
            raise Unfit("is not a number", _keys_below(value))
        return [walked]
    part, rest, where = parts[0], parts[1:], path_text(walked) or "the scenario"
    if isinstance(value, tuple):
        return [place for k in indices(value, part, walked) for place in _walk(value[k], rest, (*walked, k))]
    if not isinstance(value, Schema | dict) or not isinstance(part, str) or part == "*":
        raise Unfit(f"does not exist: {where} is not a list", "omit the rest of the path")
    keys = value if isinstance(value, dict) else type(value).attributes()
    if part not in keys:
        known = "the names are" if isinstance(value, dict) else "its keys are"
        raise Unfit(f"does not exist: {where} has no {part}", suggestion(part, keys, known))
    inner = _inside(value, part)
    if inner is None and (*walked, part) != ("run", "sample_rate"):
        raise Unfit("has no value in this scenario", f"give {path_text((*walked, part))} a value to start from")
    return _walk(inner, rest, (*walked, part))


def _keys_below(value: Any) -> str:
    if isinstance(value, tuple):
        return "add [*] for all its items, or an index"
    if isinstance(value, Schema):
        return f"continue with one of {', '.join(type(value).keys())}"
    return ""


def _replaced(owner: Any, place: Path, value: object) -> Any:
    part, rest = place[0], place[1:]
    inner = _replaced(_inside(owner, part), rest, value) if rest else value
    if isinstance(owner, tuple):
        return tuple(inner if index == part else item for index, item in enumerate(owner))
    if isinstance(owner, dict):
        return {**owner, part: inner}
    return owner.model_copy(update={part: inner})


Value = float | str

_SECTIONS = ("vary", "optimise", "limits", "title", "identify_stiffness", "nnm")  # no case depends on them
AS_IT_IS = "as it is"  # in a catalogue what the scenario has, where that is none of the choices
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
    choices: Mapping[str, Mapping[Path, Any]] = field(default_factory=dict)  # of a catalogue, what each sets

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.values) or self.points

    @property
    def set_by(self) -> tuple[Path, ...]:
        """All places that depend on it."""
        return (*self.places, *dict.fromkeys(place for changes in self.choices.values() for place in changes))


def varied_parameters(scenario: ScenarioParts) -> tuple[VariedParameter, ...]:
    """The varied parameters of a scenario that passed its checks; in a reliability study also the seeds of inputs."""
    assert scenario.study is not None
    numbers = tuple(resolve_parameter(scenario, parameter) for parameter in scenario.study.parameters)
    if not isinstance(scenario.study, Reliability):
        return numbers
    places = [("excitation", *at, "seed") for at, _ in inputs_with_seed(scenario.excitation)]
    return (*numbers, *(_number(scenario, path_text(place), [place]) for place in places))


def inputs_with_seed(excitation: Input) -> list[tuple[Path, RandomInput | MatchedInput]]:
    """The inputs whose realisation follows from a seed, each with its path within the excitation."""
    return [(at, item) for at, item in excitation.items if isinstance(item, RandomInput | MatchedInput)]


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
        except Unfit as error:
            problems.append(replace(error.problem(()), path=f"draws[{path!r}]"))
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
    number = _number(scenario, path, _places(scenario, path, ("path",)))
    text = any(isinstance(value, str) for value in values)
    read = [_read(scenario, number.places[0], value, ()) for value in values] if text else values
    if number.whole:
        read = [int(value) if not isinstance(value, str) and float(value).is_integer() else value for value in read]
    return replace(number, nominal=math.nan, values=tuple(read))


def _number(scenario: ScenarioParts, path: str, places: Sequence[Path]) -> VariedParameter:
    """The number or word at places, before it is varied."""
    field, nominal = field_type_at(scenario, places[0]), value_at(scenario, places[0])
    nominal = str(nominal) if isinstance(nominal, q.Rate) else nominal  # with its unit, like a word
    return VariedParameter(
        path=path, places=tuple(places), unit=_unit(scenario, places[0]),
        nominal=nominal if isinstance(nominal, str) else float(nominal), values=(),
        whole=isinstance(field, q.Whole) or (field is None and isinstance(nominal, int)),
    )  # fmt: skip


def case_count(vary: Vary | Optimise) -> int:
    """Number of cases that are solved at most, each realisation counted."""
    if isinstance(vary, Sobol):
        return vary.samples * (len(vary.parameters) + 2)
    if isinstance(vary, Reliability):
        return vary.most_cases
    if isinstance(vary, LatinHypercube | Optimise):
        count = vary.samples if isinstance(vary, LatinHypercube) else vary.most_cases
    else:
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


def resolve_parameter(scenario: ScenarioParts, parameter: Any) -> VariedParameter:
    """Resolve a parameter; raises `Unfit`, ``at`` being relative to the parameter."""
    if isinstance(parameter, Catalogue):
        return _resolved_catalogue(scenario, parameter)
    places = _places(scenario, parameter.path, ("path",))
    for k, path in enumerate(parameter.also):
        places += _places(scenario, path, ("also", k))
    first, number = places[0], _number(scenario, parameter.path, places)
    nominal = number.nominal

    def read_end(value: Value, at: Path) -> float:
        end = _read(scenario, first, value, at)
        if isinstance(end, str):
            raise Unfit(f"= {value} is a share, and a range has lengths", "write a length, or values: [40 %, 60 %]", at)
        return float(end)

    if isinstance(parameter, ListedParameter):
        read = [
            [_read(scenario, place, value, ("values", k)) for place in places]
            for k, value in enumerate(parameter.values)
        ]
        values = tuple(of_places[0] for of_places in read)
        if len(set(values)) < len(values):
            raise Unfit("lists a value twice", "list every value once", ("values",))
        return replace(number, values=values)
    if isinstance(parameter, Measured):
        data = () if isinstance(parameter.data, str) else parameter.data
        return replace(number, values=tuple(read_end(value, ("data", k)) for k, value in enumerate(data)))
    if choices_at(scenario, first) or isinstance(nominal, str):
        raise Unfit(f"= {parameter.path} is a choice, which has no range", _LIST_EXAMPLE, ("path",))
    points = getattr(parameter, "points", 0)
    if isinstance(parameter, (RangedParameter, SampledRange)):
        low, high = (read_end(v, (key,)) for v, key in ((parameter.from_, "from"), (parameter.to, "to")))
        _check_range(parameter, low, high)
        spacing = parameter.spacing
    else:
        if any(value_at(scenario, place) != nominal for place in places):
            raise Unfit(
                "needs one nominal value, but these paths have different ones",
                "vary them separately",
                ("path",),
            )
        key = "deviation" if isinstance(parameter, Scattered) else "tolerance"
        deviation = _deviation(scenario, first, getattr(parameter, key), float(nominal), key)
        if getattr(parameter, "distribution", "") == "lognormal" and not float(nominal) > 0.0:
            raise Unfit(f"is about {nominal:g}, which is not positive", "write distribution: normal", ("distribution",))
        low, high, spacing = float(nominal) - deviation, float(nominal) + deviation, "linear"
    for end in (low, high):
        for place in places:
            if not isinstance(parameter, Scattered):  # which has no ends
                _read(scenario, place, end, ("tolerance" if hasattr(parameter, "tolerance") else "from",))
    if number.whole and points and abs(high - low) + 1 < points:
        raise Unfit(
            f"= {points} is more than the whole numbers from {low:g} to {high:g}", "take fewer points", ("points",)
        )
    distribution = getattr(parameter, "distribution", "uniform")
    return replace(number, low=low, high=high, points=points, spacing=spacing, distribution=distribution)


def _check_range(parameter: RangedParameter | SampledRange, low: float, high: float) -> None:
    """Refuse a range that is empty, falls where it must not, or has no logarithm."""
    if low == high:
        raise Unfit(f"= {high:g} equals the start of the range", "give a range, or values: [...]", ("to",))
    if isinstance(parameter, SampledRange) and low > high:
        raise Unfit(f"= {high:g} lies below from = {low:g}", "write the lower value as from", ("to",))
    if parameter.spacing == "logarithmic" and not (low > 0.0 and high > 0.0):
        key = "from" if low <= 0.0 else "to"
        raise Unfit(
            "must be positive where the spacing is logarithmic", "give a positive value, or spacing: linear", (key,)
        )


def _resolved_catalogue(scenario: ScenarioParts, catalogue: Catalogue) -> VariedParameter:
    """What each choice changes: where a scenario with these overrides differs from the one without."""
    written = {key: value for key, value in plain(scenario).items() if key not in _SECTIONS}
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
        raise Unfit(f"cannot be set: {message}", remedy, ("choices", name))
    if idle := {place[0] for changes in choices.values() for place in changes} & {*_SECTIONS}:
        raise Unfit(f"set {idle.pop()}, on which no case depends", "set what the structure is made of", ("choices",))
    nominal = next((name for name, changes in choices.items() if not changes), AS_IT_IS)
    return VariedParameter(catalogue.name, (), "1", nominal, tuple(choices), choices=choices)


def _differences(one: Any, other: Any, place: Path) -> Iterator[tuple[Path, Any]]:
    """Where two parts of scenarios differ, and what the second one has there."""
    keys: Iterable[tuple[Any, Any]] = ()
    if isinstance(one, Schema) and type(one) is type(other):
        one, other, keys = one.__dict__, other.__dict__, type(one).keys().items()
    elif isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        keys = zip(one, one, strict=True)
    elif isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        keys = enumerate(range(len(one)))
    elif one != other:
        yield place, other
    for key, name in keys:
        yield from _differences(one[name], other[name], (*place, key))


def _places(scenario: ScenarioParts, path: str, at: Path) -> list[Path]:
    places = find_parameters(scenario, path, at)
    for place in places:
        if place[0] in _SECTIONS:
            raise Unfit(f"= {path} has no effect on a case", "vary a number of the structure or the excitation", at)
        free_text = isinstance(value_at(scenario, place), str) and len(choices_at(scenario, place)) < 2
        takes_words = isinstance(field_type_at(scenario, place), q.Whole)  # reduction.modes: all
        if place[-1] == "kind" or (free_text and not takes_words):
            raise Unfit(f"= {path} is neither a number nor a choice", "vary a number, or a word such as a support", at)
    return places


def _read(scenario: ScenarioParts, place: Path, value: Value, at: Path) -> Value:
    """Read a value as the field at a place does; a level must be of the quantity there."""
    read: Any = read_as(scenario, place, value, at)
    if isinstance(read, q.LevelValue):
        field: Any = field_type_at(scenario, place)
        known = dict(field.quantities)
        there, said = _dimension_of_level(scenario, place, known), known.get(str(read.quantity))
        if said is not None and said != there:
            remedy = f"write for example {there.example}"
            raise Unfit(f"= {value} is {said.with_article}, and {path_text(place)} is {there.with_article}", remedy, at)
        return float(read)
    return str(read) if isinstance(read, q.Rate | Share) else read  # a share follows the length in each case


def _deviation(scenario: ScenarioParts, place: Path, tolerance: Value, nominal: float, key: str) -> float:
    """Deviation under a key in SI units: a share of the nominal value, or an absolute one in the field's dimension."""
    at: Path = (key,)
    try:
        if isinstance(tolerance, str) and tolerance.rstrip().endswith("%"):
            deviation = abs(nominal) * read_quantity(tolerance, RATIO)
        else:
            of = _dimension(scenario, place)
            deviation = read_quantity(tolerance, of if of is not None and of.unit else RATIO)
    except UnitError as error:
        raise Unfit(f"= {tolerance} {error.message}", "write for example 2 %, or 0.05 mm for a length", at) from None
    if not deviation > 0.0:
        remedy = "give it in the quantity's own unit" if nominal == 0.0 else "write for example 2 %"
        raise Unfit(f"= {tolerance} of {nominal:g} leaves nothing to vary", remedy, at)
    return deviation


def _dimension(scenario: ScenarioParts, place: Path) -> Dimension | None:
    """What a number at a place is; None of whole numbers and words."""
    field = field_type_at(scenario, place)
    if isinstance(field, q.LevelType):
        return _dimension_of_level(scenario, place, dict(field.quantities))
    return field.dimension if isinstance(field, q.Quantity) else None


def _dimension_of_level(scenario: ScenarioParts, place: Path, known: Mapping[str, Dimension]) -> Dimension:
    """What a level at a place is, of those that are known: as its unit says there, else of what stands around it."""
    excitation: Any = scenario.excitation
    if "0" in known:  # numbers of a shape, by the power of x
        body = scenario.all_bodies[str(place[-3]) if "bodies" in place else scenario.default_body]
        return known.get(str(body.power_of_start(int(place[-1]))), NUMBER)
    if place[:2] == ("excitation", "forces"):
        excitation = excitation.forces[place[2]]
    quantity = q.meant(value_at(scenario, place)) or getattr(excitation, "quantity", None) or "acceleration"
    if quantity == q.FACTOR:
        return NUMBER
    spoken = quantity.replace("_", " ")
    return known.get(quantity) or next((of for name, of in known.items() if spoken in name), NUMBER)


def unit_of(scenario: ScenarioParts, path: str) -> str:
    """SI unit of the number at a path; "1" for plain numbers."""
    return _unit(scenario, find_parameters(scenario, path)[0])


def _unit(scenario: ScenarioParts, place: Path) -> str:
    of = _dimension(scenario, place)
    return "1" if of is None else of.unit or "1"


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
    return getattr(scenario.study, "tolerances", None)


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
