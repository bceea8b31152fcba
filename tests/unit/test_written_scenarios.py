"""Scenarios that the program writes carry units and load to the same numbers."""

import re
from pathlib import Path

import pytest
import yaml
from sampling import first_apart

from beamsim.kinds import TemplateKind
from beamsim.scenario import load_scenario, template
from beamsim.scenario.parameters import unit_at, yaml_with_units
from tests.helpers.commands import invoke

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[2]
CASES = sorted([*(ROOT / "configs").rglob("*.yaml"), *(ROOT / "tests" / "data" / "examples").glob("*.yaml")])


def leaves(value, place=()):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, (*place, key))
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from leaves(item, (*place, k))
    else:
        yield place, value


def check(scenario):
    text = yaml_with_units(scenario)
    again = load_scenario(text)
    assert again == scenario  # numbers compare exactly
    assert again.to_yaml().partition("units:")[0] == scenario.to_yaml().partition("units:")[0]
    for place, value in leaves(yaml.safe_load(text)):
        if isinstance(value, float):
            assert unit_at(scenario, place) == "1", (place, value)


@first_apart("path", 9, CASES[::12] + [path for k, path in enumerate(CASES) if k % 12], ids=lambda path: path.stem)
def test_every_shipped_case_is_written_with_units_and_loads_to_the_same_numbers(path, monkeypatch):
    monkeypatch.chdir(path.parent)  # files that it names
    check(load_scenario(path.name))


@pytest.mark.parametrize("kind", [kind.value for kind in TemplateKind])
def test_so_is_every_template(kind):
    check(load_scenario(template(kind)))


def test_values_that_are_no_round_numbers(monkeypatch):
    text = (ROOT / "tests/data/examples/one_sided_65hz.yaml").read_text()
    changes = {
        "beam.length": 0.1 + 0.2,
        "snubbers[0].gap": 1e-5 / 3,
        "excitation.level": "1.7 g",
        "beam.density": 1e3 / 7,
    }
    scenario = load_scenario(text, changes)
    check(scenario)
    assert "length: 0.30000000000000004 m" in yaml_with_units(scenario)
    assert "gap: 3.3333333333333337e-06 m" in yaml_with_units(scenario)


def test_a_pad_is_printed_with_units():
    done = invoke("pad", "--modulus", "5 MPa", "--area", "4 cm^2", "--height", "6 mm", "--loss-factor", "0.1",
                  "--frequency", "65 Hz")  # fmt: skip
    assert done.exit_code == 0, done.output
    (snubber,) = yaml.safe_load(done.stdout)["snubbers"]
    assert re.fullmatch(r"333333\.333333 N/m", snubber["stiffness"])
    assert snubber["damping"]["coefficient"].endswith(" N s/m")
    case = (ROOT / "tests/data/examples/one_sided_65hz.yaml").read_text()
    scenario = load_scenario(case, {"snubbers": [snubber]})
    assert scenario.snubbers[0].stiffness == pytest.approx(5e6 * 4e-4 / 6e-3, rel=1e-11)
