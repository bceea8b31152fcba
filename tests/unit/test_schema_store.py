"""The schema for editors: what SchemaStore asks of it, and what an editor shows of a key."""

import json
import re
from pathlib import Path

import jsonschema
import pytest
import yaml

import beamsim
from beamsim.kinds import TemplateKind
from beamsim.scenario import template

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
DRAFT_07 = {
    "$schema", "$id", "title", "description", "type", "properties", "required", "additionalProperties", "propertyNames",
    "minProperties", "items", "additionalItems", "minItems", "maxItems", "minimum", "maximum", "exclusiveMinimum",
    "exclusiveMaximum", "minLength", "maxLength", "pattern", "enum", "const", "anyOf", "oneOf", "not", "if", "then",
    "else", "default", "examples", "definitions", "$ref",
}  # fmt: skip


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """The files of a pull request by path, and the module that writes them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        import schema_store

        folder = tmp_path_factory.mktemp("store")
        return folder, schema_store.write(folder)


@pytest.fixture(scope="module")
def schema(store):
    return json.loads((store[0] / "src/schemas/json/beamsim.json").read_text(encoding="utf-8"))


def parts(schema):
    """Every schema inside a schema."""
    if isinstance(schema, list):
        for item in schema:
            yield from parts(item)
    elif isinstance(schema, dict):
        yield schema
        for keyword, value in schema.items():
            if keyword in ("properties", "definitions"):
                for item in value.values():
                    yield from parts(item)
            elif keyword not in ("default", "examples", "enum", "const", "required"):
                yield from parts(value)


def test_the_schema_keeps_the_rules_of_the_store(schema):
    jsonschema.Draft7Validator.check_schema(schema)
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert schema["$id"] == "https://www.schemastore.org/beamsim.json"
    for part in parts(schema):
        assert set(part) <= DRAFT_07
        assert set(part.get("required", ())) <= set(part.get("properties", ()))  # strict mode of ajv
        if isinstance(part.get("items"), list):
            assert part["minItems"] == len(part["items"])
            assert part["maxItems"] == len(part["items"])
        if "$ref" in part:
            assert part["$ref"].removeprefix("#/definitions/") in schema["definitions"]
        assert not part.get("description", "").endswith(":")


def test_the_entry_of_the_catalogue_matches_files_of_beamsim_alone(store):
    entry = json.loads((store[0] / "catalog_entry_beamsim.json").read_text(encoding="utf-8"))
    assert set(entry) == {"name", "description", "fileMatch", "url"}
    assert all("beamsim" in pattern for pattern in entry["fileMatch"])
    for text in (entry["name"], entry["description"]):
        assert "schema" not in text.lower()
        assert text[-1] not in ",. \t-"


@pytest.mark.parametrize(("folder", "accepted"), [("test", True), ("negative_test", False)])
def test_files_are_accepted_and_refused(store, schema, folder, accepted):
    validator = jsonschema.Draft7Validator(schema)
    files = sorted((store[0] / f"src/{folder}/beamsim").iterdir())
    assert len(files) >= 8
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert text.startswith("# yaml-language-server: $schema=../../schemas/json/beamsim.json\n")
        assert validator.is_valid(yaml.safe_load(text)) == accepted, file.name
        if not accepted:
            with pytest.raises(beamsim.ScenarioError):
                beamsim.load_scenario(text)


@pytest.mark.parametrize("kind", TemplateKind)
def test_templates_are_accepted(schema, kind):
    assert jsonschema.Draft7Validator(schema).is_valid(yaml.safe_load(template(kind.value)))


SHOWN = {  # what an editor shows of keys that every user meets: a unit, or the choices
    ("Beam", "length"): "[m]",
    ("Beam", "youngs_modulus"): "[Pa]",
    ("Beam", "density"): "[kg/m^3]",
    ("Harmonic", "frequency"): "[Hz]",
    ("Run", "duration"): "[s]",
    ("Run", "low_pass"): "[Hz]",
    ("Snubber", "stiffness"): "[N/m]",
    ("Snubber", "gap"): "[m]",
    ("Snubber", "side"): ["below", "above", "both"],
    ("Snubber", "law"): ["no_tension"],
}


@pytest.mark.parametrize("key", SHOWN, ids=".".join)
def test_an_editor_shows_meaning_unit_and_choices_of_a_key(schema, key):
    section, name = key
    shown = schema["definitions"][section]["properties"][name]
    assert len(shown["description"]) > 10
    if isinstance(SHOWN[key], str):
        assert shown["description"].endswith(SHOWN[key])
        assert any("examples" in part for part in parts(shown))
    else:
        assert set(SHOWN[key]) <= set(re.findall(r"'([\w-]+)'", str([part.get("enum") for part in parts(shown)])))


def test_every_key_of_a_scenario_has_a_description(schema):
    for name, part in schema["definitions"].items():
        for key, item in part.get("properties", {}).items():
            assert item is True or item.get("description"), f"{name}.{key}"
