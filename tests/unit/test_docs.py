"""The documents stay true to the code."""

import json
import re
from pathlib import Path

import beamsim
from beamsim.scenario import json_schema

ROOT = Path(__file__).parents[2]


def test_json_schema_file_is_the_one_the_program_prints():
    """Regenerate with `beamsim schema -o docs/scenario.schema.json`."""
    assert json.loads((ROOT / "docs/scenario.schema.json").read_text(encoding="utf-8")) == json_schema()


def test_cases_in_the_readme_load():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    cases = re.findall(r"```yaml\n(.*?)```", text, flags=re.S)
    assert cases
    for case in cases:
        beamsim.load_scenario(case)


def test_files_named_in_the_readme_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in re.findall(r"(?:configs|docs|benchmarks|tests)/[\w/.-]+\.(?:yaml|md|png|py|json)", text):
        assert (ROOT / name).exists(), name
