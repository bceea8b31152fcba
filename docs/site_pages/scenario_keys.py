"""The page of all keys of a scenario, made from its JSON Schema: `python -m docs.site_pages.scenario_keys`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from beamsim.scenario import units
from beamsim.scenario.jsonschema import json_schema

PAGE = Path(__file__).parents[1] / "scenario_keys.md"
_INTRODUCTION = """\
# Keys of a scenario

This page is a reference for people who write cases. It lists all keys of a scenario. A quantity is a number in the SI
unit of the table, or a text with any [unit](#units) of the same dimension, such as `5 mm`. The page is made from the
JSON Schema (`beamsim schema`), which also describes the scenario to editors.

"""
_UNITS = """\
## Units

A unit is a product or quotient of the units below, with exponents and brackets: `kN/m`, `N s/m`, `g^2/Hz`,
`mm^3/(N m)`. In an acceleration or its spectral density `g` is standard gravity, elsewhere gram. A frequency is in
hertz: `60 rpm` is 1 Hz, `0.8 rad/s` is 0.127 Hz. The table is made from `beamsim/scenario/units.py`.

| units | |
|---|---|
"""


def page() -> str:
    """Return the page as MyST Markdown."""
    schema = json_schema()
    definitions = schema["$defs"]
    parts = {name: part for name, part in definitions.items() if "description" in part}
    sections = "".join(_section(name, path, parts[name]) for name, path in _paths(parts).items())
    return _INTRODUCTION + sections + _units()


def _units() -> str:
    """Return the section of the units that quantities may have."""
    defined = units.DEFINED_UNITS.items()
    rows = {
        "base units": [f"`{name}`" for name, unit in units.SIMPLE_UNITS.items() if unit.pi == 0],
        "with a definition": [f"`{name}` ({f'{number} {of}'.rstrip()})" for name, (number, of) in defined],
        "angles, and their number in a full turn": [f"`{name}` ({n})" for name, n in units.UNITS_PER_TURN.items()],
        "other names": [f"`{name}` ({of})" for name, of in units.SPELLED_OUT.items()],
        "prefixes, and their power of ten": [f"`{name}` ({power})" for name, power in units.PREFIXES.items()],
        "units that take a prefix": [f"`{name}`" for name in units.TAKE_PREFIX],
    }
    return _UNITS + "".join(f"| {name} | {', '.join(names)} |\n" for name, names in rows.items())


def _paths(parts: dict[str, Any]) -> dict[str, str]:
    """Return the first path at which each part appears, breadth first, so that a reader meets the outer keys first."""
    paths = {"Scenario": ""}
    for name in (queue := ["Scenario"]):
        for key, item in parts[name].get("properties", {}).items():
            for part, suffix in _references(item):
                if part in parts and part not in paths:
                    paths[part] = ".".join(filter(None, [paths[name], key + suffix]))
                    queue.append(part)
    return dict(sorted(paths.items(), key=lambda item: item[1].split(".")[0].split("[")[0] if item[1] else ""))


def _references(item: Any, suffix: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(item, dict):
        if "$ref" in item:
            yield item["$ref"].rsplit("/", 1)[1], suffix
        for key in ("anyOf", "oneOf"):
            for inner in item.get(key, ()):
                yield from _references(inner, suffix)
        yield from _references(item.get("items"), suffix + "[]")
        yield from _references(item.get("additionalProperties"), suffix + ".<name>")
        for inner in item.get("prefixItems", ()):
            yield from _references(inner, suffix)


def _section(name: str, path: str, part: dict[str, Any]) -> str:
    properties = part.get("properties", {})
    kind = properties.get("kind", {}).get("const")
    place = f"`{path}`" + (f", `kind: {kind}`" if kind else "") + ". " if path else ""
    required = set(part.get("required", ()))
    rows = [
        f"| `{key}` | {_cell(_type(item))} | {_default(key, item, required)} | {_cell(item.get('description', ''))} |\n"
        for key, item in properties.items()
        if not (key == "extends" and item == {"type": "null"})
    ]
    table = "| key | value | default | meaning |\n|---|---|---|---|\n" + "".join(rows)
    return f"## {_words(name).capitalize()}\n\n{place}{part.get('description', '')}\n\n{table}\n"


def _words(name: str) -> str:
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()


def _cell(text: str) -> str:
    text = re.sub(r"(?<![`\w])--\w[\w-]*", r"`\g<0>`", text)  # options, which are plain text in descriptions
    return " ".join(text.split()).replace("|", "\\|")


def _default(key: str, item: dict[str, Any], required: set[str]) -> str:
    if key in required:
        return "required"
    default = item.get("default")
    if default is None or default in ("", [], {}):
        return ""
    if isinstance(default, dict):
        inner = ", ".join(f"{name}: {value}" for name, value in default.items() if value not in (None, [], ""))
        return f"`{{{inner}}}`" if inner else ""
    return f"`{default}`".replace("True", "true").replace("False", "false")


def _type(item: dict[str, Any]) -> str:
    """Return what a value may be, in a few words."""
    if "x-unit" in item:
        examples = " or ".join(f"`{example}`" for example in item.get("examples", ()))
        return f"quantity in {item['x-unit']}, {examples}" if examples else f"quantity in {item['x-unit']}"
    if "$ref" in item:
        name = item["$ref"].rsplit("/", 1)[1]
        return f"[{_words(name)}](#{_words(name).replace(' ', '-')})"
    if "const" in item:
        return f"`{item['const']}`"
    if "enum" in item:
        return ", ".join(f"`{value}`" for value in item["enum"])
    variants = [inner for key in ("anyOf", "oneOf") for inner in item.get(key, ()) if inner.get("type") != "null"]
    if variants:
        if item.get("examples") and isinstance(item["examples"][0], str):
            return "quantity, " + " or ".join(f"`{example}`" for example in item["examples"])
        return " or ".join(dict.fromkeys(map(_type, variants)))
    kind = item.get("type")
    if kind == "array":
        if "prefixItems" in item:
            inner = list(map(_type, item["prefixItems"]))
            return f"list of {len(inner)}: {inner[0]}" if len(set(inner)) == 1 else f"list: {', '.join(inner)}"
        return f"list of {_type(item.get('items', {}))}"
    if kind == "object":
        values = item.get("additionalProperties")
        return f"mapping of names to {_type(values)}" if isinstance(values, dict) else "mapping"
    return {
        "string": "text", "integer": "whole number", "number": "number", "boolean": "`true` or `false`",
    }.get(str(kind), "value")  # fmt: skip


if __name__ == "__main__":
    PAGE.write_text(page().rstrip() + "\n", encoding="utf-8")
