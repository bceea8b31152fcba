"""Access to numbers of a scenario by path: read them, and build the same scenario with other values.

A path has the form of overrides, ``beam.point_masses[0].mass``. ``[*]`` means every item of a list
(``beam.point_masses[*].mass``: all masses together). An item may be named: ``snubbers.tip.stiffness``, or
``snubbers[1st].stiffness`` if the name is not a single word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, get_args, get_origin

from beamsim.errors import ScenarioError
from beamsim.scenario import quantities as q
from beamsim.scenario.base import (
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Whole,
    as_plain_data,
    path_parts,
    path_text,
    problem,
    single_line,
    suggestion,
    words_of,
)
from beamsim.scenario.quantities import FieldType, LevelValue, PositionType, Share, meant
from beamsim.scenario.tree import body_path_remedy, dump_yaml, from_python, indices
from beamsim.scenario.units import NUMBER, Dimension, UnitError

Part = TypeVar("Part", bound=Schema)


def find_parameters(scenario: Whole, path: str, source_path: Path = ()) -> list[Path]:
    """Paths of all values that a path of the user stands for, at least one: numbers, words and sweep rates.

    Parameters
    ----------
    scenario : with the values.
    path : as the user wrote it.
    source_path : path of the key that contains the path, for the error.

    Returns
    -------
    list of Path
        In the order of the scenario.

    Raises
    ------
    InvalidValueError
        If the path does not exist; the caller adds the location.
    """
    parts = path_parts(path)
    if not parts:
        raise InvalidValueError(
            f"= {path} is not a path", "write for example beam.youngs_modulus or snubbers.tip.stiffness", source_path
        )
    try:
        return _walk(scenario, parts, ())
    except InvalidValueError as error:
        remedy = body_path_remedy(from_python(as_plain_data(scenario)), parts) or error.remedy
        raise InvalidValueError(f"= {path} {error.message}", remedy, source_path) from None


def value_at(scenario: Whole, place: Path) -> Any:
    """The value at a path, given or default; a share of a length is converted to metres."""
    if place == ("run", "sample_rate"):
        return scenario.sample_rate
    value: Any = scenario
    for part in place:
        value = _inside(value, part)
    return in_metres(scenario, place, value) if isinstance(value, Share) else value


def in_metres(scenario: Whole, place: Path, value: Any) -> Any:
    """A value for the field at a path; a share of a length is converted to metres."""
    if not isinstance(value, Share):
        return value
    member, body = getattr(value_at(scenario, place[:-1]), "member", None), body_of(scenario, place)
    if member is not None and body in scenario.all_bodies:
        return scenario.all_bodies[body].distance_along(member, value)
    side = side_at(scenario, place)
    return value if side is None else scenario.all_bodies[side.body].metres(value, side.axis)


class Side(NamedTuple):
    """An axis of a body along which positions are measured."""

    body: str  # name of the body
    axis: int  # number of the axis, from 0


def side_at(scenario: Whole, place: Path) -> Side | None:
    """The axis along which the position at a path is measured; None if it is not a position on a known body."""
    body = scenario.all_bodies.get(body_of(scenario, place))
    if body is None or not body.sides or not isinstance(field_type_at(scenario, place), PositionType):
        return None
    # the second number of a point, and y of a table, lie along the second side
    second = isinstance(place[-1], int) and (place[-2] == "y" or (place[-2] != "x" and place[-1] == 1))
    return Side(body_of(scenario, place), int(second and len(body.sides) > 1))


def body_of(scenario: Whole, place: Path) -> str:
    """Name of the body of an item at a path; empty if none is named and there are several.

    It is the body that contains the item, or the one named at the item or at its snubber.
    """
    value: Any = scenario
    named: str = scenario.body_at(place) or scenario.default_body
    for part in place:
        value = _inside(value, part)
        if "snubber" in getattr(type(value), "model_fields", ()):
            stops = (*scenario.located_snubbers, *scenario.listed("snubbers"))  # of pairs each stop, and both as one
            found = [each for each in stops if value.snubber in (None, each.item.name)]
            named = found[0].bodies[0] if found else ""
        elif isinstance(body := getattr(value, "body", None), str):
            named = body
    return named


def _inside(owner: Any, part: str | int) -> Any:
    if isinstance(owner, Schema):
        return getattr(owner, type(owner).attributes().get(str(part), str(part)))
    return owner[part]


def with_values(scenario: Part, values: Mapping[Path, object]) -> Part:
    """A copy of the scenario with other values at these paths, as if the user had written them.

    The sections are not checked against each other; see `beamsim.scenario.Scenario.recheck`.

    Parameters
    ----------
    scenario : with the values.
    values : for each path an SI number, a word, or a complete section; a level keeps its quantity.

    Returns
    -------
    Part
        The copy; values that depend on the changed ones are updated.

    Raises
    ------
    ScenarioError
        If a field does not accept its value.
    """
    read = dict(values)
    for place, value in values.items():
        field = None if isinstance(value, Schema) else field_type_at(scenario, place)
        if field is None:
            continue  # parts, words and plain flags as they are
        try:
            read[place] = number = field.read(value)
        except UnitError as error:
            message = f"= {single_line(value)} {error.message}"
            raise ScenarioError(problem(place, message, error.remedy)) from None
        if isinstance(number, LevelValue):
            read[place] = LevelValue(number, meant(number) or meant(value_at(scenario, place)))
    return replace_values(scenario, read)


def replace_values(part: Part, values: Mapping[Path, object]) -> Part:
    """A copy of a scenario or section with other values at these paths; bounds are not strictly checked."""
    for place, value in values.items():
        owners: list[Any] = [part]
        for key in place[:-1]:
            owners.append(_inside(owners[-1], key))
        inner: Any = value
        for owner, key in zip(reversed(owners), reversed(place), strict=True):
            if isinstance(owner, tuple):
                inner = tuple(inner if index == key else item for index, item in enumerate(owner))
            else:
                inner = {**owner, key: inner} if isinstance(owner, dict) else owner.model_copy(update={str(key): inner})
        part = inner
    return part


def read_as(scenario: Whole, place: Path, value: object, path: Path = ()) -> Any:
    """Read a value as the field at a path would: an SI number (with its quantity), a word, a rate or a share.

    Parameters
    ----------
    scenario : with the field.
    place : of the field.
    value : a number, perhaps with a unit, or a word.
    path : path of the value, for the error.

    Returns
    -------
    float | int | str | Rate | Share

    Raises
    ------
    InvalidValueError
        If the field would refuse it.
    """
    if choices := choices_at(scenario, place):
        if value not in choices:
            raise InvalidValueError(
                f"= {single_line(value)} is not one of {', '.join(choices)}", "choose one of these", path
            )
        return value
    field = field_type_at(scenario, place)
    try:
        if field is not None:
            return field.read(value)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise UnitError("must be a number", f"write the SI value for {path_text(place)}")
        return float(value)
    except UnitError as error:
        as_place = f" (as {path_text(place)})" if field is not None and path not in ((), place) else ""
        raise InvalidValueError(f"= {single_line(value)} {error.message}{as_place}", error.remedy, path) from None


def choices_at(scenario: Whole, place: Path) -> tuple[str, ...]:
    """The words that the field at a path accepts (such as kinds of support); empty for a number."""
    if not isinstance(place[-1], str) or not isinstance(value_at(scenario, place), str):
        return ()
    owner = type(value_at(scenario, place[:-1]))
    words = words_of(owner.model_fields[owner.keys()[place[-1]]].annotation)
    return words if len(words) > 1 else ()


def field_type_at(scenario: Whole, place: Path) -> FieldType | None:
    """The type that reads the value at a path; None for words and flags."""
    last = max(k for k, part in enumerate(place) if isinstance(part, str))
    owner = value_at(scenario, place[:last])
    while isinstance(owner, dict) and last:  # values by name: those of the field with the mapping
        last -= 1
        owner = value_at(scenario, place[:last])
    if not isinstance(owner, Schema):
        return None
    return field_type(owner, str(place[last]), place[last + 1 :])


def field_type(owner: Schema, key: str, indices: Path = ()) -> FieldType | None:
    """The type that reads a key of a section, or the number at these indices of its value."""
    field = type(owner).model_fields[type(owner).keys()[key]]
    return next(_types(field.annotation, field.metadata, indices), None)


def _types(annotation: Any, metadata: Iterable[Any], indices: Path) -> Iterator[FieldType]:
    """Yield the types that read a value, or the number at these indices of it."""
    yield from (item for item in metadata if isinstance(item, FieldType))
    parts = get_args(annotation)
    if get_origin(annotation) in (dict, Mapping):
        parts, indices = parts[1:], indices[1:]
    if get_origin(annotation) is tuple:
        first, indices = indices[:1], indices[1:]
        parts = parts if Ellipsis in parts else tuple(part for k, part in enumerate(parts) if k in first or not first)
    for part in parts:
        yield from _types(part, getattr(part, "__metadata__", ()), indices)


def _walk(value: Any, parts: list[str | int], prefix: Path) -> list[Path]:
    if not parts:
        leaf = isinstance(value, int | float | str | Share | q.Rate) and not isinstance(value, bool)
        if prefix != ("run", "sample_rate") and not leaf:
            raise InvalidValueError("is not a number", _keys_below(value))
        return [prefix]
    part, rest, where = parts[0], parts[1:], path_text(prefix) or "the scenario"
    if isinstance(value, tuple):
        return [place for k in indices(value, part, prefix) for place in _walk(value[k], rest, (*prefix, k))]
    if not isinstance(value, Schema | dict) or not isinstance(part, str) or part == "*":
        raise InvalidValueError(f"does not exist: {where} is not a list", "omit the rest of the path")
    keys = value if isinstance(value, dict) else type(value).attributes()
    if part not in keys:
        known = "the names are" if isinstance(value, dict) else "its keys are"
        raise InvalidValueError(f"does not exist: {where} has no {part}", suggestion(part, keys, known))
    inner = _inside(value, part)
    if inner is None and (*prefix, part) != ("run", "sample_rate"):
        raise InvalidValueError(
            "has no value in this scenario", f"give {path_text((*prefix, part))} a value to start from"
        )
    return _walk(inner, rest, (*prefix, part))


def _keys_below(value: Any) -> str:
    if isinstance(value, tuple):
        return "add [*] for all its items, or an index"
    if isinstance(value, Schema):
        return f"continue with one of {', '.join(type(value).keys())}"
    return ""


def dimension_at(scenario: Whole, place: Path) -> Dimension | None:
    """Dimension of the number at a path; None for whole numbers and words."""
    field = field_type_at(scenario, place)
    if isinstance(field, q.LevelType):
        return dimension_of_level(scenario, place, dict(field.quantities))
    return field.dimension if isinstance(field, q.Quantity) else None


def dimension_of_level(scenario: Whole, place: Path, dimensions: Mapping[str, Dimension]) -> Dimension:
    """Dimension of the level at a path: from its unit, else from the neighbouring keys."""
    excitation: Any = scenario.excitation
    if "0" in dimensions:  # numbers of a shape, by the power of x
        body = scenario.all_bodies[str(place[-3]) if "bodies" in place else scenario.default_body]
        return dimensions.get(str(body.power_of_start(int(place[-1]))), NUMBER)
    if place[:2] == ("excitation", "forces"):
        excitation = excitation.forces[place[2]]
    quantity = q.meant(value_at(scenario, place)) or getattr(excitation, "quantity", None) or "acceleration"
    if quantity == q.FACTOR:
        return NUMBER
    spoken = quantity.replace("_", " ")
    return dimensions.get(quantity) or next((of for name, of in dimensions.items() if spoken in name), NUMBER)


def unit_of(scenario: Whole, path: str) -> str:
    """SI unit of the numbers at a path of the user; "1" for plain numbers."""
    return unit_at(scenario, find_parameters(scenario, path)[0])


def unit_at(scenario: Whole, place: Path) -> str:
    """SI unit of the number at a path; "1" for plain numbers and words."""
    of = dimension_at(scenario, place)
    return "1" if of is None else of.unit or "1"


def yaml_with_units(scenario: Whole) -> str:
    """The scenario as YAML with SI units, for people to read.

    It loads to exactly the same numbers.
    """

    def written(value: Any, place: Path) -> Any:
        if isinstance(value, dict):
            return {key: written(item, (*place, key)) for key, item in value.items()}
        if isinstance(value, list):
            return [written(item, (*place, k)) for k, item in enumerate(value)]
        unit = unit_at(scenario, place) if isinstance(value, float) else "1"
        return value if unit == "1" else f"{value!r} {unit}"

    return dump_yaml(written(as_plain_data(scenario), ()))


def listing_problems(items: Sequence[Any], section: Path, places_of: Callable[[Any], Iterable[Path]]) -> Problems:
    """Problems of the parameters that a section lists, and of parameters that are listed twice.

    Parameters
    ----------
    items : the listed items.
    section : path of the list.
    places_of : function that gives the paths of an item's numbers; raises `InvalidValueError`.

    Yields
    ------
    Problem
    """
    taken: dict[Path, int] = {}
    for index, item in enumerate(items):
        try:
            first = min((taken.setdefault(place, index) for place in places_of(item)), default=index)
        except InvalidValueError as error:
            yield error.problem((*section, index))
            continue
        if first != index:
            key = "parameter" if hasattr(item, "parameter") else "path"
            message = f"= {getattr(item, key)} names a number that {path_text((*section, first))} already names"
            yield problem((*section, index, key), message, "list every number once")
