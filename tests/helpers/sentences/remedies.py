"""Whether keys, commands and options that a screen advises exist."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from beamsim.cli.app import app
from tests.helpers.screens import ResultFacts

SCHEMA = json.loads((Path(__file__).parents[3] / "docs/scenario.schema.json").read_text(encoding="utf-8"))

KEYS = {key for of in (SCHEMA, *SCHEMA["$defs"].values()) for key in of.get("properties", ())}

KINDS = {
    of["properties"]["kind"]["const"]
    for of in SCHEMA["$defs"].values()
    if "const" in of.get("properties", {}).get("kind", {})
}

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def wrong_remedies(text: str, facts: ResultFacts) -> Iterator[str]:
    """Keys, kinds and options that a screen names and that do not exist, or not for its command."""
    for path in re.findall(
        r"(?<![\w./-])((?:run|sweep|nnm|reduction|vary|optimise|identify_stiffness|excitation"
        r"|limits)(?:\.[a-z_]{2,})+)(?!\.h5)",
        text,
    ):
        if not has_key({"$ref": "#/$defs/Scenario"}, path.split(".")):
            yield f"{path}: no scenario has this key"
        section = path.split(".")[0]
        if (
            section in ("run", "sweep", "nnm", "identify_stiffness")
            and COMMANDS_OF[section] != facts.command
            and section not in facts.scenario
        ):
            yield f"{path}: `{facts.command}` does not use it"
    for kind in re.findall(r"\(kind: (\w+)", text):
        if kind not in KINDS:
            yield f"kind: {kind} does not exist"
    options = {option for parameter in COMMANDS[facts.command].params for option in parameter.opts}
    yield from (
        f"{option}: `{facts.command}` has no such option"
        for option in re.findall(r"(?<![\w-])(--[a-z][a-z-]+)", text)
        if option not in options
    )
    for command in re.findall(r"`beamsim ([a-z-]+)", text):
        if command not in COMMANDS:
            yield f"there is no command {command}"


COMMANDS_OF = {"run": "run", "sweep": "sweep", "nnm": "nnm", "identify_stiffness": "identify-stiffness"}


def has_key(schema: Any, path: list[str]) -> bool:
    """Whether a path of keys exists below a part of the JSON Schema."""
    if isinstance(schema, list):
        return any(has_key(each, path) for each in schema)
    if not isinstance(schema, dict):
        return False
    if "$ref" in schema:
        return has_key(SCHEMA["$defs"][schema["$ref"].rsplit("/", 1)[1]], path)
    if not path:
        return True
    if path[0] in schema.get("properties", {}):
        return has_key(schema["properties"][path[0]], path[1:])
    others = [schema.get("additionalProperties")] if "additionalProperties" in schema else []
    inside = any(has_key(each, path[1:]) for each in others)
    return inside or any(
        has_key(schema[key], path) for key in ("anyOf", "oneOf", "allOf", "items", "prefixItems") if key in schema
    )
