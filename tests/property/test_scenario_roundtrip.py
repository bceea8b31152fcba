"""Changed scenarios are scenarios or located problems, nothing else; what is a scenario is the same in YAML."""

import contextlib
import copy
import json

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shipped import PATHS, shipped

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario, units
from beamsim.scenario.tree import parse

pytestmark = [pytest.mark.quick, pytest.mark.portable]

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
YAML = [
    "2e5",
    "off",
    "null",
    "true",
    "1:30",
    "~",
    "=",
    "- a",
    "a: b",
    "'",
    "\n",
    ".inf",
]
KINDS = [None, True, [], {}, {"kind": "chain"}, [{"mass": 1}], {"position": "50 %"}]


def problems(call):
    """The problems of a call, none if it succeeds; None for a refusal that names none. Anything else is raised."""
    try:
        call()
    except ScenarioError as error:
        return error.problems or None
    return ()


def tree_of(path):
    """What a shipped config says, as a mapping; fields that it leaves out are absent."""
    return json.loads(json.dumps(parse(shipped(path).to_yaml())))


def comes_back(tree):
    """The scenario of a tree, which is the same when it is written as YAML and read again."""
    scenario = load_scenario(tree)
    assert all(scenario.warnings)
    text = scenario.to_yaml()
    again = load_scenario(text)
    assert again == scenario
    assert hash(again) == hash(scenario)
    assert again.to_yaml() == text
    return scenario


def places(value):
    """Every (container, key) of a tree."""
    for key, item in list(value.items() if isinstance(value, dict) else enumerate(value)):
        yield value, key
        if isinstance(item, (dict, list)):
            yield from places(item)


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(PATHS), st.data())
def test_changed_scenarios_never_end_in_a_traceback(path, data):
    """One to three values of a shipped config replaced, taken away or exchanged; as a mapping and as YAML."""
    tree = tree_of(path)
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

    assert problems(lambda: comes_back(tree)) is not None


TITLES = st.text(st.characters(categories=("L", "M", "N", "P", "S", "Zs")), max_size=20)  # what can be printed


@settings(deadline=None, max_examples=15, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(PATHS), TITLES | st.sampled_from(YAML), st.floats(0.9, 1.1))
def test_yaml_round_trip(path, title, factor):
    """Every number with a fraction of a shipped config changed, under any title."""
    tree = tree_of(path) | {"title": title}
    orders = tree.get("sweep", {}).pop("orders", [])  # which are whole numbers or simple fractions
    for holder, key in list(places(tree)):
        if key == "quantile":  # a higher one than the samples resolve is refused
            holder[key] *= min(factor, 1.0)
        elif isinstance(holder[key], float):
            holder[key] *= factor
    if orders:
        tree["sweep"]["orders"] = orders
    assert comes_back(tree).title == (title if title.isprintable() else title.strip())


WORDS = [
    *("beam", "chain", "snubbers", "gravity", "excitation", "probes", "run", "reduction", "sweep", "nnm", "title"),
    *("what", "length", "kind", "masses", "springs", "level", "start", "side", "mass", "position"),
]
MAPPINGS = st.dictionaries(st.sampled_from(WORDS), st.deferred(lambda: TREES), max_size=4)
LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(TEXTS)
TREES = LEAVES | MAPPINGS | st.lists(LEAVES | MAPPINGS, max_size=3)


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(MAPPINGS)
def test_any_mapping_is_a_scenario_or_problems(data):
    assert problems(lambda: load_scenario(data)) is not None


@settings(deadline=None, max_examples=25)
@given(st.text(alphabet="{}[]:,-#&*!|>'\"% \n\tab1.e<", max_size=40))
def test_any_text_is_yaml_or_a_problem(text):
    assert problems(lambda: parse(text)) is not None


@settings(deadline=None, max_examples=40)
@given(st.text(max_size=12) | st.from_regex(r"\d{1,3}(\.\d)? ?[a-zA-Z%/^*²() 0-9·-]{1,8}", fullmatch=True))
def test_any_text_is_a_quantity_or_a_unit_error(text):
    for dimension in (units.LENGTH, units.FREQUENCY, units.ACCELERATION, units.RATIO):
        with contextlib.suppress(units.UnitError):
            assert abs(units.read_quantity(text, dimension)) < float("inf")


@given(st.floats(-1e6, 1e6).filter(lambda x: x == 0.0 or abs(x) >= 1e-20))
def test_numbers_survive_text(number):
    assert units.read_quantity(repr(number), units.LENGTH) == number
    assert units.read_quantity(f"{number!r} m", units.LENGTH) == number
