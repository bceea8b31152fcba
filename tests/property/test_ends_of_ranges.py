"""Numbers just inside the range of a field are taken, those just outside are refused at its key."""

import itertools

import jsonschema
import numpy as np
import pytest
from extremes import cases, fields_of, places, sections, with_number
from sampling import first_apart

from beamsim import load_scenario
from beamsim.errors import ScenarioError
from beamsim.scenario.base import as_plain_data
from beamsim.scenario.units import UnitError

pytestmark = [pytest.mark.quick, pytest.mark.portable]

FIELDS = [field for section in sections() for field in fields_of(section)]
PLACES = sorted(places().items(), key=lambda item: item[1][0])
BY_CASE = {case: list(items) for case, items in itertools.groupby(PLACES, key=lambda item: item[1][0])}


def test_nearly_every_numeric_field_is_tried():
    assert len(FIELDS) > 400
    assert len(PLACES) > 0.8 * len(FIELDS)  # the others are in no case


def test_a_field_takes_its_range_and_nothing_beyond():
    for field in FIELDS:
        inside, outside = field.ends
        for number in inside:
            field.of.read(number)
        for number in outside:
            with pytest.raises(UnitError):
                field.of.read(number)


def test_the_json_schema_of_a_field_has_the_same_range():
    """But for the smallest size other than zero, which it has for numbers that are positive alone."""
    for field in FIELDS:
        valid = jsonschema.Draft202012Validator(field.of.json_schema()).is_valid
        inside, outside = field.ends
        assert all(map(valid, inside)), field.name
        for number in outside[:2]:
            assert isinstance(number, str) or not valid(number), (field.name, number)


def problems_of(data):
    """What is refused of a case; any other exception fails the test."""
    try:
        load_scenario(data)
    except ScenarioError as error:
        problems = error.problems
    else:
        return ()
    assert all(problem.path and len(str(problem)) < 700 for problem in problems), problems
    return problems


@pytest.mark.parametrize("case", BY_CASE)
def test_ends_of_ranges_in_cases(case):
    data = as_plain_data(cases()[case])
    for field, (_, path) in BY_CASE[case]:
        inside, outside = field.ends
        for number in inside:
            problems_of(with_number(data, path, number))
        for number in outside:
            problems = problems_of(with_number(data, path, number))
            assert any(field.key in str(each) for each in problems), (field.name, number)


@first_apart("case", 20, BY_CASE)
def test_two_and_three_numbers_at_the_ends_of_their_ranges(case):
    data, rng = as_plain_data(cases()[case]), np.random.default_rng(1)
    for count in (2, 3) * 10:
        changed = data
        for k in rng.permutation(len(BY_CASE[case]))[:count]:
            field, (_, path) = BY_CASE[case][k]
            changed = with_number(changed, path, field.ends[0][int(rng.integers(len(field.ends[0])))])
        problems_of(changed)
