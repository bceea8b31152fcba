"""Numbers of a scenario addressed by path: read them, and build the same scenario with other values.

A path is written as in overrides, ``beam.point_masses[0].mass``; ``[*]`` means every item of a list
(``beam.point_masses[*].mass``: all the masses together), and a snubber may be named: ``snubbers.tip.stiffness``
(``snubbers[1st].stiffness`` where the name is not a word).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar, get_args

from pydantic_core import PydanticCustomError

from beamsim.errors import ScenarioError
from beamsim.scenario.base import (
    Path,
    Schema,
    counted,
    fail,
    path_parts,
    path_text,
    refused,
    single_line,
    suggestion,
    words_of,
)
from beamsim.scenario.body import Body
from beamsim.scenario.parts import ScenarioParts
from beamsim.scenario.quantities import FieldType, LevelValue, Share, meant
from beamsim.scenario.units import UnitError

AnyScenario = TypeVar("AnyScenario", bound=ScenarioParts)


def find_parameters(
    scenario: ScenarioParts, path: str, more: tuple[type, ...] = (), at: Path = ()
) -> list[Path]:  # fmt: skip
    """The places that a path names, at least one: numbers and words.

    Parameters
    ----------
    scenario : what has them.
    path : as a user writes it.
    more : types of other values that it may name.
    at : where the path stands, for what `fail` builds.

    Raises
    ------
    PydanticCustomError
        As `fail` builds it, where the path does not exist; to be located by the caller.
    """
    parts = path_parts(path)
    if not parts:
        raise fail(f"= {path} is not a path", "write for example beam.youngs_modulus or snubbers.tip.stiffness", at)
    try:
        paths = _walk(scenario, parts, (), path, (int, float, str, Share, *more))
    except PydanticCustomError as error:
        found = refused(error, ())
        raise fail(found.message, found.remedy, at) from None
    if not paths:
        raise fail(f"= {path} matches nothing: the list is empty", "add an item, or omit the path", at)
    return paths


def value_at(scenario: ScenarioParts, place: Path) -> Any:
    """The value at a place, by default or as it was written; a share of a length is given in metres."""
    if place == ("run", "sample_rate"):
        return scenario.sample_rate
    value: Any = scenario
    body = scenario.all_bodies.get(scenario.default_body)
    for part in place:
        if isinstance(value, Body):
            body = value
        elif isinstance(named := getattr(value, "body", None), str):
            body = scenario.all_bodies.get(named)
        value = _inside(value, part)
    if isinstance(value, Share) and body is not None:
        return body.metres(value, _axis(place) if len(body.sides) > 1 else 0)
    return value


def _axis(place: Path) -> int:
    """Along which side of its body a position is: the second number of a point, and y of a table, along the second."""
    if isinstance(place[-1], str):
        return 0
    return 1 if place[-2] == "y" or (place[-2] != "x" and place[-1] == 1) else 0


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


def replaced(scenario: AnyScenario, values: Mapping[Path, object]) -> AnyScenario:
    """The same scenario with other values at these places, which may be a little outside of their bounds."""
    for place, value in values.items():
        scenario = _replaced(scenario, place, value)
    return scenario


def _as_read(scenario: ScenarioParts, place: Path, value: object) -> object:
    """A value as the field at a place reads it; parts, words and plain flags as they are."""
    if isinstance(value, Schema) or field_type_at(scenario, place) is None:
        return value
    try:
        read = read_as(scenario, place, value)
    except PydanticCustomError as error:
        raise ScenarioError(refused(error, place)) from None
    return LevelValue(read, meant(read) or meant(value_at(scenario, place))) if isinstance(read, LevelValue) else read


def read_as(scenario: ScenarioParts, place: Path, value: object, at: Path = ()) -> Any:
    """Read a value as the field at a place would: an SI number, which may know its quantity, a word, or a rate.

    Parameters
    ----------
    scenario : what has the field.
    place : of the field.
    value : a number, perhaps with a unit, or a word.
    at : where the value stands, for what `fail` builds.

    Returns
    -------
    float | int | str | Rate

    Raises
    ------
    PydanticCustomError
        Where the field would refuse it.
    """
    shown = f"= {single_line(value)}"
    if choices := choices_at(scenario, place):
        if value not in choices:
            raise fail(f"{shown} is not one of {', '.join(choices)}", "choose one of these", at)
        return value
    field = field_type_at(scenario, place)
    if field is None:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise fail(f"{shown} must be a number", f"write the SI value for {path_text(place)}", at)
        return float(value)
    try:
        return field.read(value)
    except UnitError as error:
        as_place = f" (as {path_text(place)})" if at not in ((), place) else ""
        raise fail(f"{shown} {error.message}{as_place}", error.remedy, at) from None


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
    field = _field(owner, str(place[last]))
    types = [item for item in field.metadata if isinstance(item, FieldType)] or _field_types(field.annotation)
    return types[0].absolute if types else None


def _field_types(annotation: Any) -> list[FieldType]:
    types = [item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, FieldType)]
    for argument in get_args(annotation):
        types += _field_types(argument)
    return types


def _walk(value: Any, parts: list[str | int], walked: Path, path: str, leaves: tuple[type, ...]) -> list[Path]:
    if not parts:
        if walked != ("run", "sample_rate") and (isinstance(value, bool) or not isinstance(value, leaves)):
            raise fail(f"= {path} is not a number", _keys_below(value))
        return [walked]
    part, rest = parts[0], parts[1:]
    if isinstance(value, tuple):
        if part == "*":
            return [place for k, item in enumerate(value) for place in _walk(item, rest, (*walked, k), path, leaves)]
        if isinstance(part, int):
            if part >= len(value):
                count = counted(len(value), "item")
                raise fail(f"= {path} does not exist: {path_text(walked)} has {count}", "items are numbered from 0")
            return _walk(value[part], rest, (*walked, part), path, leaves)
        names = [getattr(item, "name", None) for item in value]
        if part in names:
            return _walk(value[names.index(part)], rest, (*walked, names.index(part)), path, leaves)
        known = [name for name in names if name]
        remedy = f"the names are {', '.join(known)}" if known else "give an index, or [*] for all of them"
        raise fail(f"= {path} does not exist: {path_text(walked)} has no {part}", remedy)
    if isinstance(value, dict):
        if part in value:
            return _walk(value[part], rest, (*walked, part), path, leaves)
        raise fail(f"= {path} does not exist: {path_text(walked)} has no {part}", f"the names are {', '.join(value)}")
    if not isinstance(value, Schema) or not isinstance(part, str) or part == "*":
        raise fail(f"= {path} does not exist: {path_text(walked)} is not a list", "omit the rest of the path")
    keys = type(value).attributes()
    if part not in keys:
        where = path_text(walked) or "the scenario"
        raise fail(f"= {path} does not exist: {where} has no {part}", suggestion(part, keys, "its keys are"))
    inner = getattr(value, keys[part])
    if inner is None and (*walked, part) != ("run", "sample_rate"):
        raise fail(
            f"= {path} has no value in this scenario", f"give {path_text((*walked, part))} a value to start from"
        )
    return _walk(inner, rest, (*walked, part), path, leaves)


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
