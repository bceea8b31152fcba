"""What follows from a number follows from a new one, however it is replaced: the case is that of the edited file."""

import re
from collections import Counter
from functools import cache, partial

import pytest
from places import BEAM, CASES, differences, resolved, text_of
from sampling import first_apart
from shipped import PATHS, shipped

from beamsim.analyses.studies.plan import plan_designs, plan_draws
from beamsim.cases import Case
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.base import Schema, path_text
from beamsim.scenario.parameters import find_parameters, value_at, with_values
from beamsim.scenario.quantities import LEVEL_DIMENSIONS, LevelValue, Share, meant

pytestmark = pytest.mark.portable

NOT_OF_A_CASE = ("title", "vary", "limits", "identify_stiffness", "nnm")


def numbers(value, path=()):
    """Paths of all numbers of a scenario, written or by default."""
    if isinstance(value, Schema):
        for key, name in type(value).attributes().items():
            yield from numbers(getattr(value, name), (*path, key))
    elif isinstance(value, (dict, tuple)):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(part, (*path, key))
    elif isinstance(value, (int, float, Share)) and not isinstance(value, bool):
        yield path


def outcome(load, *without):
    """Resolved values of the scenario that a function gives, or the paths of what is wrong with it.

    None where an override cannot say it: a number of a list, or of a section in short, that is not written.
    """
    try:
        scenario = load()
    except ScenarioError as error:
        absent = any(problem.message.startswith("does not exist: ") for problem in error.problems)
        return None if absent else sorted({problem.path for problem in error.problems})
    values = resolved(scenario, *without)
    for path in ("run.convergence", "sweep.convergence"):  # off in the cases of a study
        values.pop(path, None)
    return values


def changed(value):
    """Another number of its sort and size."""
    return value + 1 if isinstance(value, int) else value * 1.01 or 1e-4


def as_written(value, of, path):
    """A number as it is written in a file in place of another one at a path."""
    unit = LEVEL_DIMENSIONS[meant(of)].unit if meant(of) in LEVEL_DIMENSIONS else ""
    if unit and path.endswith(".density"):
        unit = f"({unit})^2/Hz"
    return f"{value!r} {unit}" if unit else value


def compared(source, scenario, places):
    """How many numbers of a scenario were replaced in each way; all ways give the case of the edited file.

    Every second number is replaced in the scenario, the others in that of its own text.
    """
    count, reopened = 0, load_scenario(scenario.to_yaml())
    assert differences(resolved(reopened), resolved(scenario)) == []
    assert hash(reopened) == hash(scenario)
    for place in places:
        path, old = path_text(place), value_at(scenario, place)
        value = changed(old)
        edit = {path: as_written(value, old, path)}
        expected = outcome(partial(load_scenario, source, edit))
        missing = isinstance(expected, list) and any(path.startswith(f"{wrong}.") for wrong in expected)
        if expected is None or missing:  # more than the number has to be written
            continue
        name, case = ("", scenario) if count % 2 else (" of a reopened case", reopened)
        ways = {
            "override": outcome(partial(load_scenario, case, edit)),
            "value": outcome(lambda at=place, of=case, new=value: with_values(of, {at: new}).recheck()),
        }
        for way, found in ways.items():
            assert differences(found, expected) == [], f"{path} by {way}{name}"
        count += 1
    return count


@pytest.mark.parametrize("case", CASES)
def test_a_number_replaced_anywhere_gives_the_case_of_the_edited_file(case):
    text = text_of(case, "percent")
    scenario = load_scenario(text)
    assert compared(text, scenario, list(numbers(scenario))) > 15


def kind_of_place(place, scenario):
    """What numbers of several configs have in common: their keys, and the kinds of the sections around them."""
    kinds, section = [], scenario
    for key in place[:-1]:
        section = getattr(section, section.attributes()[key]) if isinstance(section, Schema) else section[key]
        kinds.append(getattr(section, "kind", ""))
    return [re.sub(r"\[[^]]*\]", "[]", path_text(place)), *map(str, kinds)]


@cache
def chosen_places():
    """Paths of numbers by shipped config: those of which fewer than two configs before it have one of the same kind."""
    seen, chosen = Counter(), {}
    for path in PATHS:
        scenario = shipped(path)
        kinds = {repr(kind_of_place(place, scenario)): place for place in numbers(scenario)}
        chosen[path] = [place for kind, place in kinds.items() if seen[kind] < 2]
        seen.update(list(kinds))
    return chosen


@first_apart("path", 5, PATHS[::20] + [path for k, path in enumerate(PATHS) if k % 20], ids=lambda path: path.stem)
def test_every_number_of_a_shipped_config_replaced_gives_the_case_of_the_edited_file(path):
    compared(path, shipped(path), chosen_places()[path])


@pytest.mark.parametrize("case", CASES)
def test_studies_vary_the_case_of_the_edited_file(case):
    text, count = text_of(case, "percent"), 0
    scenario = load_scenario(text)
    for place in list(numbers(scenario))[::3]:
        path, old = path_text(place), value_at(scenario, place)
        value = changed(old)
        try:
            plan = plan_draws(scenario, {path: [value]})
        except ScenarioError:
            continue  # no number that a study can vary
        expected = outcome(partial(load_scenario, text, {path: as_written(value, old, path)}), *NOT_OF_A_CASE)
        if isinstance(expected, dict):
            found = outcome(lambda p=plan, v=value: p.study.scenario(Case(0, (v,))), *NOT_OF_A_CASE)
            assert differences(found, expected) == [], path
            count += 1
    assert count > 5


def test_a_level_keeps_its_quantity():
    """Twin of the units above: a bare number in place of a level is one of the same quantity, in a scenario."""
    text = re.sub(
        r"excitation: .*\n", "excitation: {kind: harmonic, applied_to: base, level: 0.1 mm, frequency: 65 Hz}\n",
        text_of("beam", "percent"),
    )  # fmt: skip
    scenario = load_scenario(text)
    for changed_one in (
        load_scenario(scenario, {"excitation.level": 2e-4}),
        load_scenario(text, {"excitation.level": "0.2 mm"}),
    ):
        assert (changed_one.excitation.quantity, changed_one.excitation.level) == ("displacement", 2e-4)
    assert load_scenario(text, {"excitation.level": 2e-4}).excitation.quantity == "acceleration"
    assert isinstance(scenario.excitation.level, LevelValue)


DEFAULTS = [
    ("excitation: {kind: trapezoid, applied_to: base, level: 20 g, duration: 11 ms}", "excitation.duration", 20e-3),
    ("excitation: {kind: harmonic, applied_to: base, level: 0.1 mm, frequency: 65 Hz}", "excitation.level", 2e-4),
    ("excitation: {kind: harmonic, applied_to: base, level: 0.1 mm, frequency: 65 Hz}", "excitation.frequency", 650.0),
]


@pytest.mark.parametrize(("excitation", "path", "value"), DEFAULTS)
def test_defaults_follow(excitation, path, value):
    text = re.sub(r"excitation: .*\n", excitation + "\n", text_of("beam", "percent"))
    scenario = load_scenario(text)
    unit = plan_draws(scenario, {path: [value]}).parameters[0].unit
    edited = load_scenario(text, {path: f"{value!r} {unit}"})
    assert plan_draws(scenario, {path: [value]}).study.scenario(Case(0, (value,))).excitation == edited.excitation
    assert plan_draws(scenario, {path: [value]}).study.scenario(Case(0, (value,))).sample_rate == edited.sample_rate


def test_a_tolerance_is_about_the_number_as_it_follows_in_each_case():
    tolerated = "tolerances: {samples: 4, parameters: [{path: snubbers.tip.position, tolerance: 1 mm}]}"
    vary = f"vary: {{kind: grid, parameters: [{{path: beam.length, values: [270 mm, 300 mm]}}], {tolerated}}}\n"
    text = BEAM.replace("name: tip, position: <100>", "name: tip, position: <90>")
    text = re.sub(r"<(\d+)>", r"\1 %", text).replace("length: L", "length: 270 mm")
    plan = plan_designs(load_scenario(text + vary))
    place = find_parameters(plan.scenario, "snubbers.tip.position")[0]
    for each in plan.cases:
        case = plan.study.scenario(each)
        assert abs(value_at(case, place) - 0.9 * case.beam.length) <= 1e-3
    assert {round(each.values[0], 3) for each in plan.cases} == {0.27, 0.3}


def test_sections_changed_in_python_are_kept():
    scenario = load_scenario(text_of("beam", "percent"))
    run = scenario.run.model_copy(update={"duration": 0.2})
    changed = scenario.model_copy(update={"run": run, "friction": ()})
    drawn = plan_draws(changed, {"beam.length": [0.3]}).study.scenario(Case(0, (0.3,)))
    assert drawn.run.duration == 0.2
    assert drawn.friction == ()
    assert value_at(drawn, ("snubbers", 0, "position")) == 0.3
