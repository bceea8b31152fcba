"""The JSON Schema of scenario files, for editors that complete and check YAML."""

from __future__ import annotations

from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from beamsim.scenario.base import Schema, descriptions
from beamsim.scenario.chain import Chain
from beamsim.scenario.identification import SteadyTest
from beamsim.scenario.quantities import NUMBER_WITH_UNIT, example_of
from beamsim.scenario.scenario import Scenario
from beamsim.scenario.tree import REPLACED_WHOLE

_PARTIAL = "Partial"
_NULL = {"type": "null"}
_WITH_UNIT = "NumberWithUnit"


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a scenario file.

    A quantity is a number in SI units or a text with a unit; its unit ends the description. A file that extends another
    one may be incomplete: sections that are merged have a second definition without required keys.
    """
    whole = Scenario.model_json_schema(by_alias=True, schema_generator=_SchemaGenerator)
    parts: dict[str, Any] = {"Scenario": whole} | whole.pop("$defs")
    extends = {
        "type": "string",
        "description": "Path of the scenario file, relative to this one, that this file modifies: mappings merge, "
        "lists are replaced, a mapping whose kind changes is replaced completely, null removes a key.",
    }
    whole["description"] = str(Scenario.__doc__).partition("\n")[0]  # without the example for Python
    whole["properties"] = {"extends": extends, **whole["properties"]}
    keys = {key: {"description": item["description"]} for key, item in whole["properties"].items()}
    complete, partial = {"$ref": "#/$defs/Scenario"}, dict[str, Any]()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "beamsim scenario",
        "description": whole["description"],
        "type": "object",
        "properties": {"extends": extends, **keys},
        "if": {"required": ["extends"]},
        "then": _loosen(complete, parts, partial),
        "else": complete,
        "$defs": _shorten(parts | partial) | {_WITH_UNIT: NUMBER_WITH_UNIT},
    }


def _shorten(schema: Any) -> Any:
    """Move the repeated schema of quantities to one definition."""
    if isinstance(schema, list):
        return [_shorten(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if schema == NUMBER_WITH_UNIT:
        return {"$ref": f"#/$defs/{_WITH_UNIT}"}
    return {name: _shorten(item) for name, item in schema.items()}


def _loosen(schema: Any, definitions: dict[str, Any], partial: dict[str, Any]) -> Any:
    """The schema for merging with another file: keys are required only inside replaced values; null is allowed.

    Parameters
    ----------
    schema : schema of a complete file.
    definitions : definitions that it refers to, by name.
    partial : filled with the changed definitions, under new names.
    """
    if isinstance(schema, list):
        return [_loosen(item, definitions, partial) for item in schema]
    if not isinstance(schema, dict):
        return schema
    loose: dict[str, Any] = {}
    for name, item in schema.items():
        if name == "$ref":
            of = item.rpartition("/")[2]
            if (found := _loosen(definitions[of], definitions, partial)) != definitions[of]:
                partial[of + _PARTIAL] = {key: each for key, each in found.items() if key != "description"}
            loose[name] = item + _PARTIAL * (of + _PARTIAL in partial)
        elif name == "items":
            loose[name] = item
        elif name == "properties":
            for key, each in item.items():
                inner = each if key in REPLACED_WHOLE else _loosen(each, definitions, partial)
                removable = {"anyOf": [inner, _NULL], "description": each["description"]}
                loose.setdefault(name, {})[key] = inner if _NULL in inner.get("anyOf", ()) else removable
        elif name == "oneOf":
            loose["anyOf"] = _loosen(item, definitions, partial)
        elif name not in ("required", "discriminator"):
            loose[name] = _loosen(item, definitions, partial)
    return loose


def _fit_examples(schema: Any, key: str) -> None:
    """Give each quantity an example with a usual size for its key."""
    for item in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        _fit_examples(item, key)
    if isinstance(schema, dict) and (example := example_of(key, schema.get("x-unit", ""))) is not None:
        schema["examples"] = [example]


class _SchemaGenerator(GenerateJsonSchema):
    """Adds the descriptions of all keys, with SI units, and suitable examples."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """The schema of a section; the kind of a body is optional under ``beam`` and ``chain``."""
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
        if "const" in items.get("kind", {}) and "length" not in items and section not in (Chain, SteadyTest):
            described["required"] = sorted({"kind", *described.get("required", ())})
        return described

    def encode_default(self, dft: Any) -> Any:
        """A default as JSON; pydantic 2.13 cannot encode a section that it has not built yet."""
        if isinstance(dft, Schema):
            type(dft).model_rebuild()
        return super().encode_default(dft)


def _unit(schema: dict[str, Any]) -> str | None:
    """The SI unit of a quantity, an optional quantity or a list of them."""
    if isinstance(schema.get("x-unit"), str):
        return str(schema["x-unit"])
    inner = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
    if isinstance(schema.get("items"), dict):
        inner.append(schema["items"])
    units = {unit for item in inner if isinstance(item, dict) and (unit := _unit(item))}
    return units.pop() if len(units) == 1 else None
