"""The JSON Schema of scenarios for SchemaStore, the public catalogue that editors use.

`python -m docs.schema_store FOLDER` writes what a pull request there consists of: the schema in draft 07, files that it
accepts and refuses, and the entry of the catalogue. All of it follows from the schema of the package and the shipped
cases, so that nothing becomes stale.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from beamsim.scenario.jsonschema import json_schema

ROOT = Path(__file__).parents[1]
NAME = "beamsim"
URL = f"https://www.schemastore.org/{NAME}.json"
CATALOGUE_ENTRY = {
    "name": "beamsim",
    "description": "Case of beamsim: a structure with elastic stops, its excitation and the requested analyses",
    "fileMatch": ["*.beamsim.yaml", "*.beamsim.yml"],
    "url": URL,
}
ACCEPTED = (
    "one_sided_65hz", "two_panels", "shock_panel", "sweep_backlash", "continuation_60_120hz", "identify_snubber",
    "nnm_first", "optimise_snubber", "hinged_yoke", "stops/chain_bumpers", "structures/plate_panel",
    "structures/imported_panel", "loads/random_vibration", "studies/design_robust", "studies/exceedance",
    "continuation/coexisting_motions",
)  # fmt: skip
REFUSED: dict[str, tuple[tuple[str | int, ...], Any]] = {
    "unknown_key": (("beam", "lenght"), "270 mm"),
    "unknown_section": (("excitations",), {}),
    "number_out_of_range": (("beam", "length"), -1.0),
    "quantity_without_number": (("run", "duration"), "long"),
    "unknown_choice": (("snubbers", 0, "side"), "left"),
    "unknown_kind": (("excitation", "kind"), "sinus"),
    "list_in_place_of_mapping": (("run",), ["1 s"]),
    "missing_key": (("excitation", "frequency"), None),
}
"""By file the place of a value in `one_sided_65hz` and what stands there instead; None if it is missing."""
_KEYWORDS = {"$defs": "definitions", "prefixItems": "items"}


def store_schema() -> dict[str, Any]:
    """The JSON Schema of a scenario in draft 07, as editors support it best, without keywords of its own."""
    schema = dict(_draft_07(json_schema()))
    return {"$schema": "http://json-schema.org/draft-07/schema#", "$id": URL} | {
        name: value for name, value in schema.items() if name != "$schema"
    }


def _draft_07(schema: Any, *, names: bool = False) -> Any:
    """A schema of draft 2020-12 in draft 07; ``names``: whether the keys are names of properties or definitions."""
    if isinstance(schema, list):
        return [_draft_07(item) for item in schema]
    if not isinstance(schema, Mapping):
        return schema
    if names:
        return {name: _draft_07(item) for name, item in schema.items()}
    changed: dict[str, Any] = {}
    for keyword, value in schema.items():
        if keyword == "$ref":
            changed[keyword] = value.replace("#/$defs/", "#/definitions/")
        elif keyword == "description":
            changed[keyword] = " ".join(value.split())
        elif keyword in ("default", "examples", "enum", "const"):
            changed[keyword] = value
        elif keyword == "items" and "prefixItems" in schema:
            changed["additionalItems"] = _draft_07(value)
        elif not keyword.startswith("x-"):
            changed[_KEYWORDS.get(keyword, keyword)] = _draft_07(value, names=keyword in ("properties", "$defs"))
    if required := [name for name in changed.get("required", ()) if name not in changed.get("properties", {})]:
        changed["properties"] = changed.get("properties", {}) | dict.fromkeys(required, True)
        changed["type"] = "object"
    return changed


def accepted_files() -> Iterator[tuple[str, str]]:
    """Name and text of shipped cases, which the schema accepts."""
    for name in ACCEPTED:
        text = (ROOT / "configs" / f"{name}.yaml").read_text(encoding="utf-8")
        yield f"{name.rpartition('/')[2]}.yaml", f"{_pragma()}\n{text.partition(chr(10))[2]}"


def refused_files() -> Iterator[tuple[str, str]]:
    """Name and text of cases that the schema refuses: each has one mistake."""
    text = (ROOT / "configs/one_sided_65hz.yaml").read_text(encoding="utf-8")
    for name, (path, value) in REFUSED.items():
        case = place = yaml.safe_load(text)
        for key in path[:-1]:
            place = place[key]
        if value is None:
            del place[path[-1]]
        else:
            place[path[-1]] = value
        yield f"{name}.yaml", f"{_pragma()}\n{yaml.safe_dump(case, sort_keys=False)}"


def _pragma() -> str:
    """First line of a file of the store's tests."""
    return f"# yaml-language-server: $schema=../../schemas/json/{NAME}.json"


def write(folder: Path) -> list[Path]:
    """Write the files of a pull request.

    Parameters
    ----------
    folder : a copy of the store's repository, or an empty folder.

    Returns
    -------
    list of Path
        The files.
    """
    texts = {
        f"src/schemas/json/{NAME}.json": json.dumps(store_schema(), indent=2, ensure_ascii=False) + "\n",
        f"catalog_entry_{NAME}.json": json.dumps(CATALOGUE_ENTRY, indent=2) + "\n",
    }
    texts |= {f"src/test/{NAME}/{name}": text for name, text in accepted_files()}
    texts |= {f"src/negative_test/{NAME}/{name}": text for name, text in refused_files()}
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


if __name__ == "__main__":
    for file in write(Path(sys.argv[1])):
        print(file)
