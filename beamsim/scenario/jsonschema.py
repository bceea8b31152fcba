"""The JSON Schema of scenario files, for editors that complete and check YAML."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from beamsim.scenario.base import Schema
from beamsim.scenario.examples import example_of
from beamsim.scenario.merge import REPLACED_WHOLE
from beamsim.scenario.messages import members
from beamsim.scenario.scenario import Scenario


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a scenario file.

    Quantities are a number in SI units or a string with a unit; the unit ends each description. A file that
    extends another need not be complete: for it nothing is required.
    """
    complete = Scenario.model_json_schema(by_alias=True)
    _describe(complete)
    _require_kinds(complete)
    _show_units(complete)
    _fit_examples(complete)
    parts: dict[str, Any] = complete.pop("$defs")
    complete["properties"] = {"extends": {"type": "null"}, **complete["properties"]}
    extends = {
        "type": "string",
        "description": "Path of the scenario file, relative to this one, that this file modifies: mappings merge, "
        "lists are replaced, a mapping whose kind changes is replaced completely, null removes a key.",
    }
    changes = _loosened(complete)
    changes["properties"]["extends"] = extends
    keys = {
        key: {"description": item["description"]} for key, item in complete["properties"].items() if key != "extends"
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "beamsim scenario",
        "description": Scenario.__doc__,
        "type": "object",
        "properties": {"extends": extends, **keys},
        "if": {"required": ["extends"]},
        "then": {"$ref": f"#/$defs/Scenario{_CHANGES}"},
        "else": {"$ref": "#/$defs/Scenario"},
        "$defs": {
            "Scenario": complete,
            **parts,
            f"Scenario{_CHANGES}": changes,
            **{f"{name}{_CHANGES}": _loosened(part) for name, part in parts.items()},
        },
    }


_CHANGES = "Changes"


def _fit_examples(schema: Any, key: str = "") -> None:
    """Give each quantity an example of a size that is usual for its key."""
    if isinstance(schema, list):
        for item in schema:
            _fit_examples(item, key)
    elif isinstance(schema, dict):
        if (example := example_of(key, schema.get("x-unit", ""))) is not None:
            schema["examples"] = [example]
        for name, item in schema.items():
            if name == "properties":
                for inner in item:
                    _fit_examples(item[inner], inner)
            else:
                _fit_examples(item, key)


def _loosened(schema: Any) -> Any:
    """Return the schema of a partial mapping: nothing is required, except inside mappings that are replaced."""
    if isinstance(schema, list):
        return [_loosened(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    loose: dict[str, Any] = {}
    for name, item in schema.items():
        if name == "$ref":
            loose[name] = item + _CHANGES
        elif name == "items":
            loose[name] = item
        elif name == "properties":
            loose[name] = {field: item[field] if field in REPLACED_WHOLE else _loosened(item[field]) for field in item}
        elif name == "oneOf":
            loose["anyOf"] = _loosened(item)
        elif name not in ("required", "default"):
            loose[name] = _loosened(item)
    return loose


def _require_kinds(schema: dict[str, Any]) -> None:
    """Require the key that distinguishes variants (in Python it has a default)."""
    for part in schema["$defs"].values():
        if "const" in part["properties"].get("kind", {}):
            part["required"] = sorted({"kind", *part.get("required", ())})


def _describe(schema: dict[str, Any]) -> None:
    """Add the descriptions of all keys."""
    classes = {Scenario.__name__: Scenario} | {part.__name__: part for part in _parts(Scenario)}
    for name, properties in [(Scenario.__name__, schema), *schema["$defs"].items()]:
        described = classes[name].descriptions()
        for key, attribute in classes[name].keys().items():
            properties["properties"][key].pop("title", None)
            properties["properties"][key]["description"] = described[attribute]


def _parts(schema: type[Schema]) -> Iterator[type[Schema]]:
    """Yield all classes a schema is made of."""
    for field in schema.model_fields.values():
        for part in members(field.annotation).values():
            yield part
            yield from _parts(part)


def _show_units(schema: Any) -> None:
    """End the description of every quantity with its SI unit."""
    if isinstance(schema, list):
        for item in schema:
            _show_units(item)
        return
    if not isinstance(schema, dict):
        return
    unit = _unit(schema)
    if unit and isinstance(schema.get("description"), str):
        schema["description"] = f"{schema['description']} [{unit}]"
    for item in schema.values():
        _show_units(item)


def _unit(schema: dict[str, Any]) -> str | None:
    """Return the SI unit of a quantity, an optional quantity or a list of them."""
    if isinstance(schema.get("x-unit"), str):
        return str(schema["x-unit"])
    inner = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
    if isinstance(schema.get("items"), dict):
        inner.append(schema["items"])
    units = {unit for item in inner if isinstance(item, dict) and (unit := _unit(item))}
    return units.pop() if len(units) == 1 else None
