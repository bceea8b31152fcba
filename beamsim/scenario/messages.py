"""Conversion of pydantic errors to problems in terms of the scenario file."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from beamsim.scenario.base import Path, Schema, descriptions, single_line, tag_of, words_of
from beamsim.scenario.quantities import FieldType


def members(annotation: Any, tag: str = "") -> dict[str, type[Schema]]:
    """Return the classes a field may hold, by the tag that tells them apart (`""` where there is none)."""
    if get_origin(annotation) is Annotated:
        return members(get_args(annotation)[0], tag_of(annotation))
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        return {tag or tag_of(annotation): annotation}
    classes: dict[str, type[Schema]] = {}
    for argument in get_args(annotation):
        classes |= members(argument, tag)
    return classes


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def _field(root: type[Schema], location: Path) -> tuple[type[Schema], FieldInfo | None]:
    """Return the class whose key the location's last part is, and the field if there is one."""
    schema, field = root, None
    choices: dict[str, type[Schema]] = {}
    within_mapping = False
    for part in location:
        if isinstance(part, int):
            continue
        if within_mapping:  # the part is a name, such as a body's
            within_mapping = False
            continue
        if _is_tag(part) and part in choices:
            schema, choices = choices[part], {}
            continue
        if _is_tag(part):
            continue
        if field is not None and choices:
            schema, choices = next(iter(choices.values())), {}
        name = schema.keys().get(part, part)
        field = schema.model_fields.get(name)
        choices = {} if field is None else members(field.annotation)
        within_mapping = field is not None and get_origin(field.annotation) is dict
    return schema, field


def describe(root: type[Schema], error: ErrorDetails) -> tuple[Path, str, str]:
    """Return path, message and remedy of one of pydantic's errors."""
    location = tuple(error["loc"])
    path = tuple(part for part in location if not _is_tag(part))
    context, value = error.get("ctx", {}), error.get("input")
    schema, field = _field(root, location)
    shown = f"= {single_line(value)} "
    match error["type"]:
        case "beamsim":
            lead = shown if context.get("show_value") else ""
            return (*path, *context.get("at", ())), lead + context["message"], context["remedy"]
        case "missing":
            return path, "is missing", _how_to_give(str(path[-1]), schema, field)
        case "extra_forbidden":
            return path, "is not a known key", _known_keys(str(path[-1]), path, schema)
        case "union_tag_invalid" | "union_tag_not_found":
            return _kind(path, value, field)
        case "literal_error":
            choices = list(words_of(field.annotation)) if field is not None else []
            return path, shown + "is not one of " + ", ".join(choices), _did_you_mean(value, choices)
        case "model_type" | "model_attributes_type" | "dict_type":
            keys = ", ".join(_class_at(schema, field, location).keys())
            return path, shown + "must be a mapping", f"its keys are {keys}"
        case "tuple_type" | "list_type":
            return path, shown + "must be a list", "write [ ... ], also for a single value"
        case "too_short":
            return path, "is an empty list", "give at least one value"
    return path, shown + "is not accepted: " + error["msg"][:1].lower() + error["msg"][1:], ""


def _class_at(schema: type[Schema], field: FieldInfo | None, location: Path) -> type[Schema]:
    choices = {} if field is None else members(field.annotation)
    last = location[-1] if location else ""
    return choices.get(str(last)) or next(iter(choices.values()), schema)


def _how_to_give(key: str, schema: type[Schema], field: FieldInfo | None) -> str:
    if field is None:
        return ""
    for item in field.metadata:
        if isinstance(item, FieldType) and (example := item.example_for(key)):
            return f"give for example {key}: {example}"
    if get_origin(field.annotation) is Literal:
        return f"give {key}: " + " or ".join(str(choice) for choice in get_args(field.annotation))
    described = descriptions(schema).get(schema.keys().get(key, key), "")
    return f"it is: {described[:1].lower()}{described[1:].rstrip('.')}" if described else ""


def _did_you_mean(value: object, choices: list[str]) -> str:
    lower = {choice.lower(): choice for choice in choices}
    close = get_close_matches(str(value).lower(), lower, n=1)
    return f"did you mean {lower[close[0]]}?" if close else "choose one of these"


def _known_keys(key: str, path: Path, schema: type[Schema]) -> str:
    if key == "extends":
        return "extends must be at the top level of a file"
    if ":" in key:
        return f"write a space after the colon: {key.replace(':', ': ', 1)}"
    if re.match(r"\s*[\d.]", key):  # what follows the comma of 0,3 mm or 90,000 N within { }
        return "a comma separates keys: write decimals with a point, and no comma between thousands"
    keys = list(schema.keys())
    if keys == ["kind"]:
        return "this kind has no other keys; remove it"
    if home := _where_it_belongs(key, schema):
        return home
    close = get_close_matches(key.lower(), keys, n=1)
    if not close:  # thickness_mm, e_modulus, Length
        long = [known for known in keys if min(len(known), len(key)) > 3]
        close = [known for known in long if known in key.lower() or key.lower() in known][:1]
    return f"did you mean {close[0]}?" if close else "known keys: " + ", ".join(keys)


def _where_it_belongs(key: str, schema: type[Schema]) -> str:
    """Of a key that stands too far out: the section that has it, or in which it is a kind."""
    homes = []
    for section, attribute in schema.keys().items():
        annotation = schema.model_fields[attribute].annotation
        classes = members(annotation)
        if f"<{key}>" in classes:
            named = get_origin(annotation) is dict
            return f"write {section}: " + ("{NAME: {kind: %s, ...}}" if named else "{kind: %s, ...}") % key
        if any(key in part.keys() for part in classes.values()):  # noqa: SIM118
            homes.append(section)
    return "it belongs in " + " or ".join(homes[:3]) if homes else ""


def _kind(path: Path, value: Any, field: FieldInfo | None) -> tuple[Path, str, str]:
    kinds = [] if field is None else [tag[1:-1] for tag in members(field.annotation) if tag]
    if not isinstance(value, dict):
        return path, f"= {single_line(value)} must be a mapping with a kind", f"write {{kind: {kinds[0]}, ...}}"
    if value.get("kind") is None:
        return path, "has no kind", "give kind: " + ", ".join(kinds[:-1]) + " or " + kinds[-1]
    message = f"= {single_line(value['kind'])} is not one of " + ", ".join(kinds)
    return (*path, "kind"), message, _did_you_mean(value["kind"], kinds)
