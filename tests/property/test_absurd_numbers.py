"""Numbers that nobody can mean, at every key of the shipped scenarios that holds a number, are refused there."""

import math
from pathlib import Path

import pytest
from shipped import PATHS, shipped

from beamsim import load_scenario
from beamsim.errors import ScenarioError
from beamsim.scenario.base import as_plain_data
from beamsim.scenario.jsonschema import json_schema

pytestmark = [pytest.mark.quick, pytest.mark.portable]

ROOT = Path(__file__).parents[2]
ABSURD = (
    1e30, -1e30, 1e-30, 1e308, -1e308, 1e-308, 5e-324, math.nan, math.inf, -math.inf,
    10**400, -(10**5000), "1e99999", "1e400 m", "7" * 5000, -1, 0, 1e15, True,
)  # fmt: skip


def numbers_in(data, path=()):
    """Paths of all numbers in plain data."""
    if isinstance(data, dict):
        for key, item in data.items():
            yield from numbers_in(item, (*path, key))
    elif isinstance(data, list):
        for index, item in enumerate(data):
            yield from numbers_in(item, (*path, index))
    elif isinstance(data, (int, float)) and not isinstance(data, bool):
        yield path


def replaced(data, path, value):
    """A copy of plain data with another value at a path."""
    if not path:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[path[0]] = replaced(data[path[0]], path[1:], value)
    return copy


def places_by_file():
    """One place of every key that holds a number in a shipped scenario, by file."""
    seen = {}
    for file in PATHS:
        for path in numbers_in(as_plain_data(shipped(file))):
            seen.setdefault(tuple("*" if isinstance(part, int) else part for part in path), (file, path))
    found = {}
    for file, path in seen.values():
        found.setdefault(file, []).append(path)
    return found


PLACES = places_by_file()


def problems_of(data):
    """What is refused of a scenario; any other exception fails the test."""
    try:
        load_scenario(data)
    except ScenarioError as error:
        return error.problems
    return ()


def assert_accepted_or_refused(file, values_of):
    """Put each of the values of a place there; whatever is refused is refused with a short message."""
    data = as_plain_data(shipped(file))
    for number, path in enumerate(PLACES[file]):
        for value in values_of(number):
            problems = problems_of(replaced(data, path, value))
            assert all(problem.path and len(str(problem)) < 700 for problem in problems), (path, value)


@pytest.mark.parametrize("file", PLACES, ids=lambda file: file.stem)
def test_absurd_numbers_are_accepted_or_refused(file):
    """A third of them at each place, the others at the two places after it."""
    assert_accepted_or_refused(file, lambda number: ABSURD[number % 3 :: 3])


OUTSIDE = (1e40, -1e40, 1e308, -1e308, math.nan, math.inf, -math.inf, 10**400, "1e99999")


@pytest.mark.parametrize("file", PLACES, ids=lambda file: file.stem)
def test_what_no_quantity_can_be_is_refused_where_it_stands(file):
    """In contrast to the above: nothing accepts these, and the message names the key."""
    data = as_plain_data(shipped(file))
    for number, path in enumerate(PLACES[file]):
        value = OUTSIDE[number % len(OUTSIDE)]
        with pytest.raises(ScenarioError) as refused:
            load_scenario(replaced(data, path, value))
        key = next(str(part) for part in reversed(path) if isinstance(part, str))
        assert any(key in str(problem) for problem in refused.value.problems), (path, value, str(refused.value))


def bounds_in(schema):
    """Minimum and maximum of all numbers in a JSON Schema."""
    if isinstance(schema, dict) and schema.get("type") in ("number", "integer"):
        low = schema.get("minimum", schema.get("exclusiveMinimum"))
        yield low, schema.get("maximum", schema.get("exclusiveMaximum"))
    for item in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from bounds_in(item)


def test_the_json_schema_bounds_every_number():
    bounds = list(bounds_in(json_schema()["$defs"]))
    assert len(bounds) > 300
    assert all(low is not None and high is not None and -1e60 <= low < high <= 1e60 for low, high in bounds)
