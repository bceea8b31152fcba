"""What follows from a number follows from a new one, however it is replaced: the case is that of the edited file."""

import re
from functools import partial
from typing import get_args

import numpy as np
import pytest
from shipped import PATHS, shipped

from beamsim.analyses.designs.plan import Case, plan_designs, plan_draws
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario, load_scenario
from beamsim.scenario.base import Schema, path_text
from beamsim.scenario.parameters import find_parameters, value_at, with_values
from beamsim.scenario.quantities import LEVEL_DIMENSIONS, LevelValue, PositionType, Share, meant

BEAM = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3, elements: 8,
  nodes: [<30>, <55>], point_masses: [{position: <75>, mass: 4 g}], supports: {left: clamped},
  damping: {kind: modal, ratio: 1 %}}
snubbers:
  - {name: tip, position: <100>, side: below, stiffness: 151.1 kN/m, damping: {kind: ratio, ratio: 2 %}}
  - {name: middle, at: {position: <50>}, side: both, stiffness: 50 kN/m, gap: 1 mm}
springs_to_ground: [{kind: linear, position: <60>, stiffness: 1 kN/m}]
friction: [{name: rub, position: <70>, normal_force: 1 N, coefficient: 0.2, stiffness: 10 kN/m}]
constant_forces:
  - {position: <80>, force: 1 N}
  - {line: [<10>, <90>], force_per_length: 2 N/m}
  - {line: [<10>, <90>], force_per_length: 2 N/m, shape: {kind: table, x: [<10>, <90>], values: [1, 2]}}
excitation: {kind: harmonic, applied_to: {position: <65>}, level: 2 N, frequency: 65 Hz}
probes: [{name: a, position: <100>}, {name: b, at: {position: <45>}}]
outputs:
  - {name: w, kind: displacement, position: <40>}
  - {name: m, kind: bending_moment, at: {position: <20>}}
run: {duration: 0.05 s, outputs: [{name: s, kind: strain, position: <35>}],
  start: {released_force: {position: <85>, force: 1 N}}}
"""
SEGMENTS = """\
beam: {length: 270 mm, elements: 8, damping: {kind: modal, ratio: 1 %}, segments: [
  {from: <0>, to: <40>, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3},
  {from: <40>, to: <100>, width: 50 mm, thickness: 4 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3}]}
excitation: {kind: forces, forces: [
  {kind: harmonic, applied_to: {position: <40>}, level: 1 N, frequency: 65 Hz},
  {kind: harmonic, applied_to: {line: [<50>, <100>]}, level: 3 N/m, frequency: 65 Hz}]}
run: {duration: 0.05 s}
"""
BODIES = """\
bodies:
  one: {kind: beam, length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 8}
  two: {kind: beam, length: 180 mm, width: 40 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 8}
joints:
  - {name: rod, kind: spring, between: [{body: one, position: <60>}, {body: two, position: <y70>}], stiffness: 9 kN/m}
springs_between:
  - {kind: linear, between: [{body: one, position: <40>}, {body: two, position: <y45>}], stiffness: 2 kN/m}
constant_forces:
  - {body: two, line: [<y10>, <y90>], force_per_length: 2 N/m, shape: {kind: table, x: [<y10>, <y90>], values: [1, 2]}}
snubbers: [{name: tip, between: [{body: one, position: <100>}, {body: two, position: <y95>}], stiffness: 50 kN/m}]
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 40 Hz}
outputs: [{name: w, kind: displacement, at: {body: two, position: <y40>}}]
probes: [{name: a, at: {body: one, position: <50>}}]
run: {duration: 0.05 s}
"""
PLATE = """\
bodies:
  panel: {kind: plate, length: 270 mm, width: 180 mm, thickness: 2 mm, youngs_modulus: 70 GPa, density: 2700,
    poissons_ratio: 0.33, elements: [4, 4], supports: {left: clamped, points: [{position: [<100>, <y90>]}]},
    point_masses: [{position: [<30>, <y40>], mass: 10 g}],
    stiffeners: [{from: [<0>, <y50>], to: [<100>, <y50>], bending_stiffness: 3 N m^2, mass_per_length: 0.1 kg/m}],
    damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: stop, position: [<80>, <y20>], side: below, stiffness: 20 kN/m, gap: 0.1 mm}]
constant_forces:
  - {area: [[<10>, <y10>], [<60>, <y90>]], pressure: 20 Pa}
  - {area: whole, pressure: 9 Pa, shape: {kind: table, x: [<0>, <50>], y: [<y10>, <y30>], values: [[1, 2], [2, 3]]}}
excitation: {kind: half_sine, applied_to: base, level: 5 g, duration: 11 ms}
outputs: [{name: w, kind: displacement, position: [<40>, <y60>]},
  {name: s, kind: stress, at: {position: [<20>, <y30>]}}]
probes: [{name: a, position: [<50>, <y50>]}]
run: {duration: 0.05 s}
"""
CASES = {"beam": BEAM, "segments": SEGMENTS, "bodies": BODIES, "plate": PLATE}
SIDES = {"": 0.27, "y": 0.18}
UNITS = {
    "percent": lambda share, side: f"{share} %",
    "metres": lambda share, side: repr(share * side / 100),
    "millimetres": lambda share, side: f"{share * side * 10!r} mm",
}


def text_of(case, unit):
    """A case with its places written in a unit."""
    return re.sub(r"<(y?)(\d+)>", lambda m: UNITS[unit](int(m[2]), SIDES[m[1]]), CASES[case])


def resolved(scenario, *without):
    """By path every value of a scenario, defaults among them and shares of lengths in metres."""
    found = {}

    def add(path, value):
        if isinstance(value, Schema):
            for key, name in type(value).attributes().items():
                add((*path, key), getattr(value, name))
        elif isinstance(value, (dict, tuple)):
            for key, part in value.items() if isinstance(value, dict) else enumerate(value):
                add((*path, key), part)
        elif path[0] not in without:
            found[path_text(path)] = value_at(scenario, path) if isinstance(value, Share) else value

    for key, name in type(scenario).attributes().items():
        if key != "units":
            add((key,), getattr(scenario, name))
    if scenario.run is not None:
        found["run.sample_rate"] = scenario.sample_rate
    return found


def differences(one, other):
    """Paths at which resolved values, or paths of problems, differ by more than round-off."""
    if not isinstance(one, dict) or not isinstance(other, dict):
        return [] if one == other else [f"{one} and {other}"]
    different = [f"{path}: only once" for path in one.keys() ^ other.keys()]
    for path in one.keys() & other.keys():
        a, b = one[path], other[path]
        if path.endswith((".file", ".dofs")):
            a, b = (str(file).rpartition("/")[2] for file in (a, b))  # of a study with its folder
        numbers = all(isinstance(x, (int, float)) for x in (a, b))
        if not (np.isclose(a, b, rtol=1e-14, atol=0.0) if numbers else a == b):
            different.append(f"{path}: {a} and {b}")
    return different


@pytest.mark.parametrize("unit", ["metres", "millimetres"])
@pytest.mark.parametrize("case", CASES)
def test_a_place_is_the_same_in_percent_and_in_a_unit(case, unit):
    assert (
        differences(resolved(load_scenario(text_of(case, "percent"))), resolved(load_scenario(text_of(case, unit))))
        == []
    )


def sections(annotation, seen):
    """Every section that can be in a scenario, and its fields whose value can be a share."""
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        if annotation in seen:
            return
        seen[annotation] = {}
        for name, field in annotation.model_fields.items():
            seen[annotation][name] = any(isinstance(item, PositionType) for item in field.metadata) or is_share(
                field.annotation
            )
            sections(field.annotation, seen)
    for inner in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        sections(inner, seen)


def is_share(annotation):
    """Whether an annotation that is no section has a share of a length in it."""
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        return False
    metadata = getattr(annotation, "__metadata__", ())
    return any(isinstance(item, PositionType) for item in metadata) or any(is_share(a) for a in get_args(annotation))


def parts(value):
    """The sections of a scenario."""
    if isinstance(value, Schema):
        yield value
        value = value.__dict__
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else ():
        yield from parts(part)


def test_every_key_that_may_be_relative_is_in_a_case():
    """Twin of the tests here: a new key that takes a percentage has to be added to a case above."""
    seen = {}
    sections(Scenario, seen)
    can = {name for fields in seen.values() for name, share in fields.items() if share}
    assert {"position", "nodes", "from_", "to", "line", "area"} <= can
    given = {
        name
        for case in CASES
        for part in parts(load_scenario(text_of(case, "percent")))
        for name in type(part).model_fields
        if getattr(part, name) is not None and seen.get(type(part), {}).get(name)
    }
    assert can - given == set()


@pytest.mark.parametrize("old", ["displacement, position: 40 %", "strain, position: 35 %"])
@pytest.mark.parametrize("beyond", ["120 %", "0.324 m"])
def test_an_output_beyond_the_end_is_refused(old, beyond):
    text = text_of("beam", "percent").replace(old, f"{old.split(',')[0]}, position: {beyond}")
    with pytest.raises(ScenarioError, match=r"outputs\[0\].position = 0.324 m lies beyond beam.length"):
        load_scenario(text)


# --- numbers replaced ------------------------------------------------------------------------------------------------

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
    values.pop("run.convergence", None)
    return values


def changed(value):
    """Another number of its sort and size."""
    return value + 1 if isinstance(value, int) else value * 1.01 or 1e-4


def as_written(value, of):
    """A number as it is written in a file in place of another one."""
    unit = LEVEL_DIMENSIONS[meant(of)].unit if meant(of) in LEVEL_DIMENSIONS else ""
    return f"{value!r} {unit}" if unit else value


def compared(source, scenario, places):
    """How many numbers of a scenario were replaced in each way; all ways give the case of the edited file."""
    count, reopened = 0, load_scenario(scenario.to_yaml())
    assert differences(resolved(reopened), resolved(scenario)) == []
    assert hash(reopened) == hash(scenario)
    for place in places:
        path, old = path_text(place), value_at(scenario, place)
        value = changed(old)
        edit = {path: as_written(value, old)}
        expected = outcome(partial(load_scenario, source, edit))
        missing = isinstance(expected, list) and any(path.startswith(f"{wrong}.") for wrong in expected)
        if expected is None or missing:  # more than the number has to be written
            continue
        for name, case in (("", scenario), (" of a reopened case", reopened)):
            ways = {
                "override": outcome(partial(load_scenario, case, edit)),
                "value": outcome(lambda at=place, of=case, new=value: with_values(of, {at: new}).rechecked()),
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


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_every_number_of_a_shipped_config_replaced_gives_the_case_of_the_edited_file(path):
    scenario = shipped(path)
    assert compared(path, scenario, list(numbers(scenario))) > 0


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
        expected = outcome(partial(load_scenario, text, {path: as_written(value, old)}), *NOT_OF_A_CASE)
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
    unit = plan_draws(scenario, {path: [value]}).coordinates[0].unit
    edited = load_scenario(text, {path: f"{value!r} {unit}"})
    assert plan_draws(scenario, {path: [value]}).study.scenario(Case(0, (value,))).excitation == edited.excitation
    assert plan_draws(scenario, {path: [value]}).study.scenario(Case(0, (value,))).sample_rate == edited.sample_rate


def test_a_tolerance_is_about_the_number_as_it_follows_in_each_case():
    tolerated = "tolerances: {samples: 4, parameters: [{path: snubbers.tip.position, tolerance: 1 mm}]}"
    vary = f"vary: {{kind: grid, parameters: [{{path: beam.length, values: [270 mm, 300 mm]}}], {tolerated}}}\n"
    text = BEAM.replace("name: tip, position: <100>", "name: tip, position: <90>")
    text = re.sub(r"<(\d+)>", r"\1 %", text)
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
