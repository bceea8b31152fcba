"""Mistakes in a scenario are refused where they stand, with a remedy: one table, `tests/data/refusals.yaml`."""

from pathlib import Path

import pytest
import yaml

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

ROOT = Path(__file__).parents[2]
TABLE = yaml.safe_load((ROOT / "tests/data/refusals.yaml").read_text(encoding="utf-8"))


def marks(group):
    """Quick is what no compiled kernel is needed for."""
    return pytest.mark.quick if group.get("by", "build") == "build" else ()


def loaded(group, changes):
    """The case of a group with changes, taken as far as the function that refuses it."""
    case = group["case"]
    scenario = load_scenario(ROOT / case if isinstance(case, str) else case, changes)
    by = group.get("by")
    if by == "build":
        build_system(scenario)
    elif by and changes:
        getattr(beamsim, by)(scenario)


@pytest.mark.quick
@pytest.mark.parametrize("group", TABLE, ids=lambda group: group["about"])
def test_the_case_as_it_stands_is_accepted(group):
    loaded(group, ())


@pytest.mark.parametrize(
    ("group", "changes", "says"),
    [
        pytest.param(group, *refused, id=f"{group['about']}-{number}", marks=marks(group))
        for group in TABLE
        for number, refused in enumerate(group["refused"])
    ],
)
def test_a_mistake_is_refused_where_it_stands(group, changes, says):
    with pytest.raises(ScenarioError) as refused:
        loaded(group, changes)
    assert refused.value.exit_code == 2
    assert all(problem.remedy for problem in refused.value.problems)
    parts = [says] if isinstance(says, str) else says
    assert any(all(part in str(problem) for part in parts) for problem in refused.value.problems), refused.value
