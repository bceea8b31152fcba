"""The documents stay true to the code."""

import json
import re
from pathlib import Path

import pytest

import beamsim
from beamsim.scenario import json_schema

ROOT = Path(__file__).parents[2]


def test_json_schema_file_is_the_one_the_program_prints():
    """Regenerate with `beamsim schema -o docs/scenario.schema.json`."""
    assert json.loads((ROOT / "docs/scenario.schema.json").read_text(encoding="utf-8")) == json_schema()


def test_result_files_are_documented_as_they_are_declared():
    """Renew with `python -m beamsim.store.describe docs/result_files.md`."""
    from beamsim.store.describe import MARK, renewed

    text = (ROOT / "docs/result_files.md").read_text(encoding="utf-8")
    assert MARK in text
    assert renewed(text) == text
    assert renewed(text.replace("| `time` | s |", "| `time` | h |")) == text


def test_cases_in_the_readme_load():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    cases = re.findall(r"```yaml\n(.*?)```", text, flags=re.S)
    assert cases
    for case in cases:
        beamsim.load_scenario(case)


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md"])
def test_files_named_in_a_document_exist(document):
    text = (ROOT / document).read_text(encoding="utf-8")
    for name in re.findall(r"(?:beamsim|configs|docs|benchmarks|tests)/[\w/.-]+\.(?:yaml|md|png|py|json)", text):
        assert (ROOT / name).exists(), name


def test_the_set_up_of_contributing_is_the_readme_s():
    command = next(line for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines() if "[dev]" in line)
    assert command in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines()


def test_every_package_has_its_place_in_contributing():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for path in (ROOT / "beamsim").iterdir():
        if path.is_dir() and (path / "__init__.py").exists():
            assert f"`{path.name}`" in text, path.name
