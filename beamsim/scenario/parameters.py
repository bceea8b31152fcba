"""Numbers of a scenario addressed by path: read them, and build the same scenario with other values.

A path is written as in overrides, ``beam.point_masses[0].mass``; ``[*]`` means every item of a list
(``beam.point_masses[*].mass``: all the masses together), and a snubber may be named: ``snubbers.tip.stiffness``
(``snubbers[1st].stiffness`` where the name is not a word).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from beamsim.scenario.base import Schema, counted, fail, path_parts, path_text, suggestion
from beamsim.scenario.quantities import FieldType

Path = tuple[str | int, ...]
AnySchema = TypeVar("AnySchema", bound=Schema)


def find_parameters(scenario: Schema, path: str, more: tuple[type, ...] = ()) -> list[Path]:
    """The places that a path names, at least one: numbers and words, and values of the types in ``more``.

    Raises
    ------
    PydanticCustomError
        As `fail` builds it, where the path does not exist; to be located by the caller.
    """
    parts = path_parts(path)
    if not parts:
        raise fail(f"= {path} is not a path", "write for example beam.youngs_modulus or snubbers.tip.stiffness")
    paths = _walk(scenario, parts, (), path, (int, float, str, *more))
    if not paths:
        raise fail(f"= {path} matches nothing: the list is empty", "add an item, or omit the path")
    return paths


def value_at(scenario: Schema, place: Path) -> Any:
    """The value at a place."""
    value: Any = scenario
    for part in place:
        held: Any = value
        value = held[part] if isinstance(value, (tuple, dict)) else getattr(value, _attribute(value, str(part)))
    return value


def with_values(scenario: AnySchema, values: Mapping[Path, object]) -> AnySchema:
    """The same scenario with other values at these places (SI numbers within their bounds: nothing is checked)."""
    for place, value in values.items():
        scenario = _replaced(scenario, place, value)
    return scenario


def read_as(scenario: Schema, place: Path, value: object) -> float:
    """Read a number, perhaps with a unit, as the field at a place would.

    Raises
    ------
    PydanticCustomError
        Where the field would refuse it.
    """
    from beamsim.scenario.units import UnitError

    owner = value_at(scenario, place[:-1])
    if isinstance(place[-1], str) and isinstance(owner, Schema):
        field = type(owner).model_fields[_attribute(owner, place[-1])]
        types = [item for item in field.metadata if isinstance(item, FieldType)] or _field_types(field.annotation)
        if types:
            try:
                return float(types[0].absolute.read(value))
            except UnitError as error:
                raise fail(error.message, error.remedy, show_value=True) from None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise fail("must be a number", f"write the SI value for {path_text(place)}")
    return float(value)


def choices_at(scenario: Schema, place: Path) -> tuple[str, ...]:
    """The words that the field at a place may hold (supports); none for a number."""
    if not isinstance(place[-1], str) or not isinstance(value_at(scenario, place), str):
        return ()
    owner = value_at(scenario, place[:-1])
    words = _words(type(owner).model_fields[_attribute(owner, place[-1])].annotation)
    return words if len(words) > 1 else ()


def _words(annotation: Any) -> tuple[str, ...]:
    """Words of an annotation, or of the members of a union."""
    from typing import Literal, get_args, get_origin

    if get_origin(annotation) is Literal:
        return tuple(get_args(annotation))
    return tuple(word for member in get_args(annotation) for word in _words(member))


def field_type_at(scenario: Schema, place: Path) -> FieldType | None:
    """What reads the value at a place; None for words and plain flags."""
    last = max(k for k, part in enumerate(place) if isinstance(part, str))
    owner = value_at(scenario, place[:last])
    if not isinstance(owner, Schema):
        return None
    field = type(owner).model_fields[_attribute(owner, str(place[last]))]
    types = [item for item in field.metadata if isinstance(item, FieldType)] or _field_types(field.annotation)
    return types[0].absolute if types else None


def _field_types(annotation: Any) -> list[FieldType]:
    from typing import get_args

    types = [item for item in getattr(annotation, "__metadata__", ()) if isinstance(item, FieldType)]
    for argument in get_args(annotation):
        types += _field_types(argument)
    return types


def _walk(value: Any, parts: list[str | int], walked: Path, path: str, leaves: tuple[type, ...]) -> list[Path]:
    if not parts:
        if isinstance(value, bool) or not isinstance(value, leaves):
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
    keys = type(value).keys()
    if part not in keys:
        where = path_text(walked) or "the scenario"
        raise fail(f"= {path} does not exist: {where} has no {part}", suggestion(part, keys, "its keys are"))
    inner = getattr(value, keys[part])
    if inner is None:
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


def _attribute(owner: Any, key: str) -> str:
    name: str = type(owner).keys().get(key, key)
    return name


def _replaced(owner: Any, place: Path, value: object) -> Any:
    part, rest = place[0], place[1:]
    if isinstance(part, int):
        items = list(owner)
        items[part] = _replaced(items[part], rest, value) if rest else value
        return tuple(items)
    if isinstance(owner, dict):
        return {**owner, part: _replaced(owner[part], rest, value)}
    name = _attribute(owner, part)
    inner = _replaced(getattr(owner, name), rest, value) if rest else value
    return owner.model_copy(update={name: inner})
