"""Converts pydantic's validation errors to problems in terms of the scenario file."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from beamsim.errors import Problem
from beamsim.scenario.base import (
    SYNONYMS,
    Path,
    Schema,
    closest_name,
    count_text,
    descriptions,
    kinds_of,
    nested_annotations,
    problem,
    single_line,
    suggestion,
    tag_of,
    words_of,
)
from beamsim.scenario.quantities import FieldType, Quantity, example_of
from beamsim.scenario.units import UnitError


def problems_of(root: type[Schema], error: ValidationError) -> list[Problem]:
    """Problems of a validation error; a too short list is not reported if its items are invalid too."""
    details = error.errors(include_url=False)
    wrong = [detail["loc"] for detail in details]
    return [
        problem(*describe(root, detail))
        for detail in details
        if detail["type"] != "too_short"
        or not any(loc != detail["loc"] and loc[: len(detail["loc"])] == detail["loc"] for loc in wrong)
    ]


def members(annotation: Any, tag: str = "") -> dict[str, type[Schema]]:
    """The classes that a field may hold, by their union tag (`""` if there is none)."""
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
    """The class that has the last part of a location as its key, and the field, if there is one."""
    schema, field = root, None
    choices: dict[str, type[Schema]] = {}
    within_mapping = False
    for number, part in enumerate(location, 1):
        if _is_tag(part):
            if part in choices and number < len(location):  # the last part is a form of the field itself
                schema, choices = choices[str(part)], {}
        elif within_mapping:  # the part is a name, such as that of a body
            within_mapping = False
        elif isinstance(part, str):
            if field is not None and choices:
                schema, choices = next(iter(choices.values())), {}
            field = schema.model_fields.get(schema.keys().get(part, part))
            choices = {} if field is None else members(field.annotation)
            within_mapping = field is not None and any(
                get_origin(each) is dict for each in nested_annotations(field.annotation)
            )
    return schema, field


def describe(root: type[Schema], error: ErrorDetails) -> tuple[Path, str, str]:
    """Path, message and remedy of one of pydantic's errors."""
    location = tuple(error["loc"])
    path = tuple(part for part in location if not _is_tag(part))
    context, value = error.get("ctx", {}), error.get("input")
    schema, field = _field(root, location)
    shown = f"= {single_line(value)} "
    match error["type"]:
        case "value_error":
            unfit = context["error"]
            if not isinstance(unfit, UnitError):
                return (*path, *unfit.at), unfit.message, unfit.remedy
            return path, shown + unfit.message, _with_usual_example(unfit.remedy, path, field)
        case "variants":
            return path, shown + error["msg"], context["remedy"]
        case "missing":
            return path, "is missing", _entry_remedy(str(path[-1]), schema, field)
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
        case "too_short" if not value:
            needed = field is None or field.is_required()
            return path, "is an empty list", "give at least one value" + ("" if needed else ", or leave it out")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            bound = f"at most {most}" if least is None else f"at least {least}"
            return path, f"has {count_text(len(value), 'value')}, but takes {bound}", _field_text(schema, field)
    return path, shown + "is not accepted: " + error["msg"][:1].lower() + error["msg"][1:], ""


def _class_at(schema: type[Schema], field: FieldInfo | None, location: Path) -> type[Schema]:
    choices = {} if field is None else members(field.annotation)
    last = location[-1] if location else ""
    return choices.get(str(last)) or next(iter(choices.values()), schema)


def _entry_remedy(key: str, schema: type[Schema], field: FieldInfo | None) -> str:
    if field is None:
        return ""
    for item in field.metadata:
        if isinstance(item, FieldType) and item.example:
            usual = example_of(key, item.dimension.unit) if isinstance(item, Quantity) else None
            return f"give for example {key}: {usual or item.example}"
    if get_origin(field.annotation) is Literal:
        return f"give {key}: " + " or ".join(str(choice) for choice in get_args(field.annotation))
    return _field_text(schema, field)


def _with_usual_example(remedy: str, path: Path, field: FieldInfo | None) -> str:
    """Replace the dimension's example in a remedy by one that suits the key."""
    key = next((part for part in reversed(path) if isinstance(part, str)), "")
    for item in (*field.metadata, *nested_annotations(field.annotation)) if field is not None else ():
        if isinstance(item, Quantity) and remedy == f"write for example {item.dimension.example}":
            return f"write for example {example_of(key, item.dimension.unit) or item.dimension.example}"
    return remedy


def _field_text(schema: type[Schema], field: FieldInfo | None) -> str:
    name = next((name for name, each in schema.model_fields.items() if each is field), "")
    described = descriptions(schema).get(name, "")
    return f"it is: {described[:1].lower()}{described[1:].rstrip('.')}" if described else ""


def _did_you_mean(value: object, choices: list[str]) -> str:
    meant = closest_name(str(value), choices)
    return f"did you mean {meant}?" if meant else "choose one of these"


def _known_keys(key: str, path: Path, schema: type[Schema]) -> str:
    if key == "extends":
        return "extends must be at the top level of a file"
    if ":" in key:
        return f"write a space after the colon: {key.replace(':', ': ', 1)}"
    if re.match(r"\s*[\d.]", key):  # the rest after the comma in 0,3 mm or 90,000 N within { }
        return "a comma separates keys: write decimals with a point, and no comma between thousands"
    keys = list(schema.keys())
    if keys == ["kind"]:
        return "this kind has no other keys; remove it"
    same = key in SYNONYMS.get(closest_name(key, keys), "").split()
    if not same and (home := _section_of_key(key, schema)):
        return home
    return suggestion(key, keys, "known keys:")


def _section_of_key(key: str, schema: type[Schema]) -> str:
    """The section to which a key at the wrong level belongs."""
    homes = []
    for section, attribute in schema.keys().items():
        annotation = schema.model_fields[attribute].annotation
        classes = members(annotation)
        if any(key in kinds_of(part) for part in classes.values()):
            named = get_origin(annotation) is dict
            return f"write {section}: " + ("{NAME: {kind: %s, ...}}" if named else "{kind: %s, ...}") % key
        if any(key in part.keys() for part in classes.values()):  # noqa: SIM118
            homes.append(section)
    return "it belongs in " + " or ".join(homes[:3]) if homes else ""


def _kind(path: Path, value: Any, field: FieldInfo | None) -> tuple[Path, str, str]:
    classes = {} if field is None else members(field.annotation)
    kinds = [kind for part in classes.values() for kind in kinds_of(part)]
    if not isinstance(value, dict):
        return path, f"= {single_line(value)} must be a mapping with a kind", f"write {{kind: {kinds[0]}, ...}}"
    if value.get("kind") is None:
        return path, "has no kind", "give kind: " + ", ".join(kinds[:-1]) + " or " + kinds[-1]
    message = f"= {single_line(value['kind'])} is not one of " + ", ".join(kinds)
    return (*path, "kind"), message, _did_you_mean(value["kind"], kinds)
