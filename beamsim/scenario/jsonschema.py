"""The JSON Schema of scenario files, for editors that complete and check YAML."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from beamsim.scenario.base import Schema, descriptions
from beamsim.scenario.chain import Chain
from beamsim.scenario.quantities import NUMBER_WITH_UNIT, example_of
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.tree import REPLACED_WHOLE

_COMPLETE = "Complete"
_WITH_UNIT = "NumberWithUnit"


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a scenario file.

    Quantities are a number in SI units or a string with a unit; the unit ends each description. A file that extends
    another need not be complete: what is merged with that file is described once with nothing required, and what a
    complete file has to say in addition stands in definitions of its own.
    """
    whole = Scenario.model_json_schema(by_alias=True, schema_generator=_Describing)
    parts: dict[str, Any] = {"Scenario": whole} | whole.pop("$defs")
    merged = set[str]()
    _find_merged("Scenario", parts, merged)
    extends = {
        "type": "string",
        "description": "Path of the scenario file, relative to this one, that this file modifies: mappings merge, "
        "lists are replaced, a mapping whose kind changes is replaced completely, null removes a key.",
    }
    definitions = {name: _loosened(part) if name in merged else part for name, part in parts.items()}
    definitions["Scenario"]["properties"] = {"extends": extends, **definitions["Scenario"]["properties"]}
    keys = {key: {"description": item["description"]} for key, item in whole["properties"].items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "beamsim scenario",
        "description": Scenario.__doc__,
        "type": "object",
        "properties": {"extends": extends, **keys},
        "anyOf": [{"$ref": "#/$defs/Scenario"}],
        "if": {"required": ["extends"]},
        "then": {},
        "else": {"$ref": f"#/$defs/Scenario{_COMPLETE}"},
        "$defs": _shortened(definitions) | _complete(parts, merged) | {_WITH_UNIT: NUMBER_WITH_UNIT},
    }


def _shortened(schema: Any) -> Any:
    """The same with the text of a quantity in one place."""
    if isinstance(schema, list):
        return [_shortened(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if schema == NUMBER_WITH_UNIT:
        return {"$ref": f"#/$defs/{_WITH_UNIT}"}
    return {name: _shortened(item) for name, item in schema.items()}


def _complete(parts: dict[str, Any], merged: set[str]) -> dict[str, Any]:
    """By name what complete files have to say in addition, see `_demands`; only where that is something."""
    demanding = merged
    while True:
        demands = {name: found for name in sorted(demanding) if (found := _demands(parts[name], demanding))}
        if demands.keys() == demanding:
            return {f"{name}{_COMPLETE}": found for name, found in demands.items()}
        demanding = set(demands)


def _find_merged(name: str, parts: dict[str, Any], merged: set[str]) -> None:
    """Add a definition and those that it holds to the ones that are merged with another file's."""

    def visit(schema: Any) -> None:
        for key, item in schema.items() if isinstance(schema, dict) else ():
            if key == "$ref":
                _find_merged(item.rpartition("/")[2], parts, merged)
            elif key == "properties":
                for field in item.keys() - REPLACED_WHOLE:
                    visit(item[field])
            elif key in ("anyOf", "oneOf"):
                for each in item:
                    visit(each)
            elif key != "items":
                visit(item)

    if name not in merged:
        merged.add(name)
        visit(parts[name])


def _loosened(schema: Any) -> Any:
    """Return the schema of a partial mapping: nothing is required, except inside mappings that are replaced."""
    if isinstance(schema, list):
        return [_loosened(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    loose: dict[str, Any] = {}
    for name, item in schema.items():
        if name == "items":
            loose[name] = item
        elif name == "properties":
            loose[name] = {field: item[field] if field in REPLACED_WHOLE else _loosened(item[field]) for field in item}
        elif name == "oneOf":
            loose["anyOf"] = _loosened(item)
        elif name not in ("required", "discriminator"):
            loose[name] = _loosened(item)
    return loose


def _demands(schema: dict[str, Any], merged: set[str]) -> dict[str, Any]:
    """What a complete file has to say beyond what `_loosened` asks for; empty where that is nothing."""
    if "$ref" in schema:
        return {"$ref": schema["$ref"] + _COMPLETE} if schema["$ref"].rpartition("/")[2] in merged else {}
    demanded: dict[str, Any] = {}
    if "properties" in schema:
        inner = {key: found for key, item in schema["properties"].items() if (found := _demands(item, merged))}
        kind = schema["properties"].get("kind", {})
        if "const" in kind and "kind" in schema.get("required", ()):
            inner["kind"] = {"const": kind["const"]}
        demanded |= {"required": schema["required"]} if schema.get("required") else {}
        demanded |= {"properties": inner} if inner else {}
    for key in ("items", "additionalProperties"):
        if isinstance(schema.get(key), dict) and (found := _demands(schema[key], merged)):
            demanded[key] = found
    for key in ("anyOf", "oneOf"):
        inside = [_demands(item, merged) for item in schema.get(key, ())]
        if any(inside):
            demanded["anyOf"] = [found or item for found, item in zip(inside, schema[key], strict=True)]
    return demanded


def _fit_examples(schema: Any, key: str) -> None:
    """Give each quantity of a key an example of a size that is usual for it."""
    for item in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        _fit_examples(item, key)
    if isinstance(schema, dict) and (example := example_of(key, schema.get("x-unit", ""))) is not None:
        schema["examples"] = [example]


class _Describing(GenerateJsonSchema):
    """Adds the descriptions of all keys, ended by their SI units, and examples that suit them."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """The schema of a section; of bodies, which ``beam`` and ``chain`` name, the kind need not be given."""
        described = super().model_schema(schema)
        section: type[Schema] = schema["cls"]
        texts, items = descriptions(section), described["properties"]
        described.pop("title", None)
        for key, attribute in section.keys().items():
            item = items[key]
            item.pop("title", None)
            unit = _unit(item)
            item["description"] = f"{texts[attribute]} [{unit}]" if unit else texts[attribute]
            _fit_examples(item, key)
        if "const" in items.get("kind", {}) and "length" not in items and section is not Chain:
            described["required"] = sorted({"kind", *described.get("required", ())})
        return described


def _unit(schema: dict[str, Any]) -> str | None:
    """Return the SI unit of a quantity, an optional quantity or a list of them."""
    if isinstance(schema.get("x-unit"), str):
        return str(schema["x-unit"])
    inner = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
    if isinstance(schema.get("items"), dict):
        inner.append(schema["items"])
    units = {unit for item in inner if isinstance(item, dict) and (unit := _unit(item))}
    return units.pop() if len(units) == 1 else None
