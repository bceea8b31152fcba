"""Changed scenarios are scenarios or located problems, nothing else; what is a scenario is the same in YAML."""

import contextlib
import copy

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shipped import PATHS, shipped

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario, units
from beamsim.scenario.tree import parse

pytestmark = pytest.mark.quick

NUMBERS = [0, -1, 7, -0.0, 1e-300, 1e308, 5e-324, float("nan"), float("inf"), 2**63, 10**40, 0.5]
TEXTS = [
    "",
    "1 kg",
    "5 mm",
    "2 g",
    "10 %",
    "1e400 m",
    "nan",
    "1,5 mm",
    "3 furlongs",
    "rest",
    "base",
    "none",
    "../..",
    "~",
]
KINDS = [None, True, [], {}, {"kind": "chain"}, [{"mass": 1}], {"position": "50 %"}]


def problems(call):
    """The problems of a call, none if it succeeds; None for a refusal that names none. Anything else is raised."""
    try:
        call()
    except ScenarioError as error:
        return error.problems or None
    return ()


def places(value):
    """Every (container, key) of a tree."""
    for key, item in list(value.items() if isinstance(value, dict) else enumerate(value)):
        yield value, key
        if isinstance(item, (dict, list)):
            yield from places(item)


@settings(deadline=None, max_examples=100, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(PATHS), st.data())
def test_changed_scenarios_never_end_in_a_traceback(path, data):
    """One to three values of a shipped config replaced, taken away or exchanged; as a mapping and as YAML."""
    tree = shipped(path).model_dump(mode="json", by_alias=True, exclude_none=True)
    for _ in range(data.draw(st.integers(1, 3))):
        spots = list(places(tree))
        holder, key = data.draw(st.sampled_from(spots))
        other, there = data.draw(st.sampled_from(spots))
        new = data.draw(st.sampled_from([*NUMBERS, *TEXTS, *KINDS]) | st.floats() | st.text(max_size=5))
        match data.draw(st.sampled_from(["replace", "remove", "rename", "exchange", "scale"])):
            case "remove":
                del holder[key]
            case "rename" if isinstance(holder, dict):
                holder[f"{key}x"] = holder.pop(key)
            case "exchange":
                holder[key] = copy.deepcopy(other[there])
            case "scale" if isinstance(holder[key], float):
                holder[key] *= data.draw(st.sampled_from([-1.0, 0.1, 1.3, 10.0]))
            case _:
                holder[key] = new

    def read():
        scenario = load_scenario(tree)
        assert all(scenario.warnings)
        text = scenario.to_yaml()
        again = load_scenario(text)
        assert again == scenario
        assert hash(again) == hash(scenario)
        assert again.to_yaml() == text

    assert problems(read) is not None


@settings(deadline=None, max_examples=50)
@given(st.text(alphabet="{}[]:,-#&*!|>'\"% \n\tab1.e<", max_size=40))
def test_any_text_is_yaml_or_a_problem(text):
    assert problems(lambda: parse(text)) is not None


@settings(deadline=None, max_examples=80)
@given(st.text(max_size=12) | st.from_regex(r"\d{1,3}(\.\d)? ?[a-zA-Z%/^*²() 0-9·-]{1,8}", fullmatch=True))
def test_any_text_is_a_quantity_or_a_unit_error(text):
    for dimension in (units.LENGTH, units.FREQUENCY, units.ACCELERATION, units.RATIO):
        with contextlib.suppress(units.UnitError):
            assert abs(units.read_quantity(text, dimension)) < float("inf")


@given(st.floats(-1e30, 1e30).filter(lambda x: x == 0.0 or abs(x) >= 1e-30))
def test_numbers_survive_text(number):
    assert units.read_quantity(repr(number), units.LENGTH) == number
    assert units.read_quantity(f"{number!r} m", units.LENGTH) == number
