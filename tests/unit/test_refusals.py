"""Mistakes are refused where they stand, with a remedy: `refusals.yaml` and `file_refusals.yaml` in `tests/data`."""

from pathlib import Path

import pytest
import yaml
from shipped import LOADER

import beamsim
from beamsim.errors import ScenarioError
from beamsim.measurements.channels import read_tests
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

ROOT = Path(__file__).parents[2]
MISTAKES, FILES = (
    yaml.load((ROOT / "tests/data" / name).read_text(encoding="utf-8"), LOADER)
    for name in ("refusals.yaml", "file_refusals.yaml")
)
OTHERS = {"build": build_system, "read_tests": read_tests}


def entries(table):
    """Group and refusal of each line; quick is what no compiled kernel is needed for."""
    return [
        pytest.param(
            group, refused, id=f"{group['about']}-{number}",
            marks=pytest.mark.quick if group.get("by", "build") in OTHERS else (),
        )
        for group in table
        for number, refused in enumerate(group["refused"])
    ]  # fmt: skip


def loaded(group, changes):
    """The case of a group with changes."""
    case = group["case"]
    if isinstance(case, dict) and "extends" in case:
        case = {**case, "extends": str(ROOT / case["extends"])}
    return load_scenario(ROOT / case if isinstance(case, str) else case, changes)


def taken(group, changes):
    """The case with changes, taken as far as the function that refuses it."""
    scenario = loaded(group, changes)
    if by := group.get("by"):
        (OTHERS.get(by) or getattr(beamsim, by))(scenario)


def assert_refused(group, changes, says):
    with pytest.raises(ScenarioError) as refused:
        taken(group, changes)
    assert refused.value.exit_code == 2
    assert all(problem.remedy for problem in refused.value.problems)
    parts = [says] if isinstance(says, str) else says
    assert any(all(part in str(problem) for part in parts) for problem in refused.value.problems), refused.value


@pytest.mark.quick
@pytest.mark.parametrize("group", MISTAKES, ids=lambda group: group["about"])
def test_the_case_as_it_stands_is_accepted(group):
    scenario = loaded(group, ())
    if group.get("by") == "build":
        build_system(scenario)


@pytest.mark.parametrize(("group", "refused"), entries(MISTAKES))
def test_a_mistake_is_refused_where_it_stands(group, refused):
    assert_refused(group, *refused)


@pytest.mark.parametrize(("group", "refused"), entries(FILES))
def test_a_file_that_cannot_be_used_is_refused(group, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, says, *changes = refused
    if text is not None:
        Path(group["file"]).write_text(text, encoding="utf-8")
    assert_refused(group, changes, says)
