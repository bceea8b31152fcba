"""A place is the same point of its body in percent, metres and millimetres, whatever key it is written under."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from places import CASES, MARKER, UNITS, differences, resolved, text_of
from rewritten import histories

import beamsim
from beamsim.analyses.compare_modes.analysis import compare_modes, read_shapes
from beamsim.analyses.identify.analysis import mode_shapes
from beamsim.analyses.identify.fit import sought_numbers
from beamsim.analyses.studies.plan import check_cases, plan_designs, plan_draws
from beamsim.errors import ScenarioError
from beamsim.responses.parameters import response_model
from beamsim.scenario import Scenario, load_scenario
from beamsim.scenario.base import Schema, path_text, walk
from beamsim.scenario.parameters import value_at
from beamsim.scenario.quantities import PositionType
from beamsim.scenario.tree import parse
from beamsim.structures.places import Link, load_site_of
from beamsim.system.build import build_system

pytestmark = pytest.mark.portable

UNSHRUNK = (Phase.explicit, Phase.reuse, Phase.generate)  # what differs is said by path, on any body
SHARES = sorted({int(share) for text in CASES.values() for _, share in MARKER.findall(text)})
BODIES = st.tuples(st.integers(80, 2500), st.integers(80, 2500)).map(lambda mm: (mm[0] / 1000, mm[1] / 1000))
INNER = [share for share in SHARES if 0 < share < 100]
MOVED = st.lists(st.integers(-8, 8), min_size=len(INNER), max_size=len(INNER)).map(
    lambda quarters: {share: share + quarter / 4 for share, quarter in zip(INNER, quarters, strict=True)}
)
"""Other shares for the markers, in quarters of a percent; their order stays."""


def sites(scenario):
    """By path where everything sits or acts, as the structure is asked: points in m, numbers of masses and nodes."""
    found = {}
    bodies = scenario.all_bodies
    for path, part in walk(scenario):
        if hasattr(part, "places") and (part.places or getattr(part, "ends", None)):
            site = load_site_of(part, scenario.body_at(path) or scenario.default_body, bodies)
            for k, end in enumerate((site.first, site.second) if isinstance(site, Link) else (site,)):
                found[path_text((*path, "body", k))] = end.body
                points = [*np.ravel(end.bounds if hasattr(end, "bounds") else end.point), getattr(end, "along", None)]
                found |= {path_text((*path, "point", k, i)): x for i, x in enumerate(points) if x is not None}
    for name, body in bodies.items():
        found |= {f"{name}.nodes[{i}]": body.metres(x) for i, x in enumerate(getattr(body, "nodes", ()))}
        for key in ("mass_positions", "mass_points", "supported_points"):
            found |= {f"{name}.{key}[{i}]": float(x) for i, x in enumerate(np.ravel(getattr(body, key, ())))}
        for i, stretch in enumerate(getattr(body, "stretches", ())):
            found |= {f"{name}.start[{i}]": stretch.start, f"{name}.end[{i}]": stretch.end}
        for i, stiffener in enumerate(getattr(body, "stiffeners", ())):
            found |= {f"{name}.line[{i}][{j}]": x for j, x in enumerate(np.ravel(body.line_of(stiffener)))}
    return found


def analysed(scenario):
    """By path what the analyses take from places that are none of the structure: bounds, values, what is followed."""
    found = {}
    if scenario.vary is not None:
        plan = plan_designs(scenario)
        check_cases(plan)
        for case in plan.cases:
            found |= {f"case[{case.number}].{path}": x for path, x in sites(plan.study.scenario(case)).items()}
    for k, number in enumerate([] if scenario.identify_stiffness is None else
                               sought_numbers(scenario, scenario.identify_stiffness.update)[0]):  # fmt: skip
        found |= {f"bounds[{k}][{i}]": bound for i, bound in enumerate(number.bounds)}
    for name in ("parameter", "follow_points_in"):
        followed = getattr(scenario.sweep, name, None)
        if getattr(followed, "kind", "") == "position":
            followed = followed.in_metres(scenario)
            ends = (followed.from_, followed.to, *followed.points_at)
            found |= {f"{name}[{i}]": x for i, x in enumerate(ends)}
    return found


@settings(deadline=None, max_examples=3, phases=UNSHRUNK, suppress_health_check=[HealthCheck.too_slow])
@given(BODIES, MOVED)
@pytest.mark.parametrize("case", CASES)
def test_a_place_is_the_same_in_percent_and_in_a_unit(case, sides, moved):
    """On bodies of any size: what is resolved, where the structure is asked, and what the analyses follow."""
    percent = load_scenario(text_of(case, "percent", sides, moved))
    for unit in ("metres", "millimetres"):
        other = load_scenario(text_of(case, unit, sides, moved))
        assert differences(resolved(percent, "vary", "identify_stiffness"),
                           resolved(other, "vary", "identify_stiffness")) == []  # fmt: skip
        assert differences(sites(percent), sites(other), rtol=1e-14) == []
        assert differences(analysed(percent), analysed(other), rtol=1e-14) == []


def markers(case):
    """Path and marker of every place of a case."""

    def within(value, path):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(part, (dict, list)):
                yield from within(part, (*path, key))
            elif isinstance(part, str) and MARKER.fullmatch(part):
                yield (*path, key), MARKER.fullmatch(part)

    return list(within(parse(CASES[case]), ()))


def test_what_is_resolved_is_the_share_of_the_side():
    """Twin of the agreement of units: points are those that this file computes itself."""
    sides, count = (0.4, 0.25), 0
    for case in CASES:
        scenario = load_scenario(text_of(case, "percent", sides))
        for path, marker in markers(case):
            if path[0] not in ("vary",) and "bounds" not in path:
                expected = int(marker[2]) / 100 * sides[len(marker[1])]
                assert value_at(scenario, path) == pytest.approx(expected, rel=1e-14), path_text(path)
                count += 1
    assert count > 60


@pytest.mark.parametrize("case", CASES)
def test_a_place_beyond_its_body_is_refused_under_its_key(case):
    """Each place in one of the units; that a place is the same in all of them is shown above."""
    for spot, (path, _) in enumerate(markers(case)):
        parts = MARKER.split(CASES[case])  # text, side, share, text, ...
        parts[3 * spot + 2] = "120"
        changed = "".join(
            text + (f"<{side}{share}>" if share else "")
            for text, side, share in zip(parts[::3], [*parts[1::3], ""], [*parts[2::3], ""], strict=True)
        )
        with pytest.raises(ScenarioError) as caught:
            check_all(beyond(changed, list(UNITS)[spot % len(UNITS)]))
        said = [problem for problem in caught.value.problems if path_text(path).startswith(problem.path or "-")]
        assert said, (path_text(path), caught.value.problems)
        assert any(word in p.message for p in said for word in ("beyond", "expected", "outside")), said
        assert all(p.remedy for p in said)


def beyond(text, unit):
    """A changed case, in a unit."""
    CASES["changed"] = text
    try:
        return text_of("changed", unit)
    finally:
        del CASES["changed"]


def check_all(text):
    """Load a case and plan its study."""
    scenario = load_scenario(text)
    if scenario.vary is not None:
        check_cases(plan_designs(scenario))


@pytest.mark.parametrize(("case", "unit"), [("beam", "metres"), ("plate", "millimetres")])
def test_a_run_is_the_same_in_percent_and_in_a_unit(case, unit):
    cases = [load_scenario(text_of(case, of, (0.43, 0.31)), {"run.convergence": "off"}) for of in ("percent", unit)]
    motions = [histories(beamsim.run(each)) for each in cases]
    assert motions[0].keys() == motions[1].keys()
    assert {"output w", "displacement of a"} <= motions[0].keys()
    for name, values in motions[0].items():
        largest = values.max(initial=0.0)
        assert largest > 0 or "force" in name or name == "contacts", name  # of a stop that is not reached
        for other in motions[1:]:
            np.testing.assert_allclose(other[name], values, rtol=0, atol=1e-9 * largest, err_msg=name)


def test_a_moving_snubber_is_followed_between_the_same_places():
    models = [response_model(load_scenario(text_of("folds", unit, (0.4, 0.2)))) for unit in UNITS]
    for model in models:
        assert (model.second.first, model.second.last) == pytest.approx((0.28, 0.4), rel=1e-14)


PLATE = """\
bodies: {panel: {kind: plate, length: 300 mm, width: 200 mm, thickness: 2 mm, youngs_modulus: 70 GPa, density: 2700,
  poissons_ratio: 0.33, elements: [2, 2], supports: {left: clamped, points: [{position: [60 %, 55 %]}]},
  stiffeners: [{from: [0, FROM], to: [100 %, TO], bending_stiffness: 30 N m^2, mass_per_length: 0.1 kg/m}]}}
probes: [{name: a, position: [100 %, 50 %]}]
run: {duration: 1 ms}
"""


@pytest.mark.parametrize(("start", "end"), [("55 %", "110 mm"), ("0.11", "55 %"), ("11 cm", "55 %")])
def test_a_stiffener_is_parallel_to_an_edge_whatever_its_ends_are_written_in(start, end):
    """0.55 of 200 mm is not 110 mm in the last digit, and the mesh had no line along such a stiffener."""
    assert 0.55 * 0.2 != 0.11
    text = PLATE.replace("[60 %, 55 %]", "[60 %, 20 %]")
    cases = [text.replace("FROM", one).replace("TO", other) for one, other in ((start, end), ("55 %", "55 %"))]
    squared = [build_system(load_scenario(text)).dynamics.stiffness for text in cases]
    np.testing.assert_allclose(squared[0], squared[1], rtol=1e-8)


@pytest.mark.parametrize("at", ["[180 mm, 110 mm]", "[60 %, 55 %]", "[0.18, 11 cm]"])
def test_a_point_support_is_found_whatever_a_place_is_written_in(at):
    text = PLATE.replace("FROM", "30 %").replace("TO", "30 %")
    with pytest.raises(ScenarioError, match="is on the point support, which cannot deflect"):
        load_scenario(text + f"snubbers: [{{name: s, position: {at}, side: below, stiffness: 1 kN/m}}]\n")


@pytest.mark.parametrize("end", ["0.6979139840844495", "100 %", "2.2897440422718156 ft"])
def test_an_end_is_the_end_whatever_it_is_written_in(end):
    """It was only where round-off put it beyond, not where it put it before."""
    assert 2.2897440422718156 * 0.3048 < 0.6979139840844495
    text = text_of("folds", "percent", (0.6979139840844495, 0.2)).replace("position: 90 %", f"position: {end}")
    text = text.replace("elements: 4", "elements: 4, supports: {left: clamped, right: pinned}").partition("sweep:")[0]
    with pytest.raises(ScenarioError, match="is the pinned right end, which cannot deflect"):
        load_scenario(text)


@pytest.mark.parametrize("place", ["position: 50 %", "position: 0.1", "position: 100 mm", "mass: 1"])
def test_a_node_is_the_place_on_imported_matrices(place):
    old = "at: {body: panel, node: 14, direction: z}"
    text = text_of("imported", "percent").replace(old, f"at: {{body: panel, {place}}}")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(text)
    assert [problem.path for problem in caught.value.problems] == [f"snubbers[0].at.{place.partition(':')[0]}"]


FOLDS = text_of("folds", "metres", (0.4, 0.2))


@pytest.mark.parametrize(
    ("old", "new", "path", "message"),
    [
        ("from: 0.28, to: 0.4", "from: 60 %, to: 240 mm", "sweep.follow_points_in.to", "equals the start"),
        ("from: 0.28, to: 0.4", "from: 20 %, to: 80 %", "sweep.follow_points_in", "leaves out the scenario's own"),
        ("position: 0.36, side: below", "between: [{position: 50 %}, {position: 90 %}]", "sweep.follow_points_in.kind",
         "between two places"),
        ("follow_points_in: {kind: position, from: 0.28, to: 0.4}",
         "points_at: [200 Hz]", "sweep.points_at[0]", "outside the range"),
    ],
)  # fmt: skip
def test_ranges_of_a_continuation_are_checked_on_the_body(old, new, path, message):
    """They are numbers only on a body: a snubber at a share, or between two places, ended in a traceback."""
    assert old in FOLDS
    with pytest.raises(ScenarioError) as caught:
        load_scenario(FOLDS.replace(old, new))
    assert [problem.path for problem in caught.value.problems] == [path]
    assert message in caught.value.problems[0].message


def test_a_listed_share_follows_the_length_in_every_case():
    text = text_of("folds", "percent").replace("sweep:", "unused:").partition("unused")[0] + "run: {duration: 0.02 s}\n"
    scenario = load_scenario(text)
    plan = plan_draws(scenario, {"snubbers.tip.position": ["40 %", "0.2"], "beam.length": [0.3, 0.5]})
    assert (plan.parameters[0].values.tolist(), plan.parameters[0].unit) == (["40 %", "0.2 m"], "1")
    for case, expected in zip(plan.cases, (0.12, 0.2), strict=True):
        assert value_at(plan.study.scenario(case), ("snubbers", 0, "position")) == pytest.approx(expected)
    ranged = text + "vary: {kind: grid, parameters: [{path: snubbers.tip.position, from: 40 %, to: 60 %, points: 3}]}\n"
    with pytest.raises(ScenarioError, match="is a share, and a range has lengths"):
        load_scenario(ranged)


def test_a_number_of_a_pair_is_read_as_its_own_field():
    """The force of a table's point was read as a length, and its unit was that of the deflection."""
    text = text_of("folds", "percent").replace("stiffness: 50 kN/m", "force_deflection: [[0 mm, 0 N], [1 mm, 9 N]]")
    scenario = load_scenario(text)
    plan = plan_draws(scenario, {"snubbers.tip.force_deflection[1][1]": ["0.01 kN", "12 N"]})
    assert plan.parameters[0].unit == "N"
    assert [case.values for case in plan.cases] == [(10.0,), (12.0,)]
    length = plan_draws(scenario, {"snubbers.tip.force_deflection[1][0]": ["2 mm"]})
    assert (length.parameters[0].unit, length.cases[0].values) == ("m", (0.002,))


@pytest.mark.parametrize("section", ["identify_stiffness.shapes_without.positions[0]", "nnm.mode"])
def test_what_no_case_of_a_study_has_cannot_be_varied(section):
    text = text_of("followed", "percent").replace("sweep:", "nnm: {mode: 1, energy: 1 mJ}\nsweep:")
    with pytest.raises(ScenarioError, match="has no effect on a case"):
        plan_draws(load_scenario(text), {section: [1, 2]})


def test_measured_shapes_are_compared_where_they_were_measured():
    """Of the second body, in every unit: the diagonal of the assurance is that of the model with itself."""
    macs = []
    for unit in UNITS:
        scenario = load_scenario(text_of("followed", unit, (0.4, 0.25)))
        shapes = mode_shapes(scenario, "tip", 2, tuple(share * 0.4 for share in (0.3, 0.6, 1.0)))
        given = {"identify_stiffness.shapes_without.shapes": shapes.T.tolist()}
        macs.append(beamsim.identify_stiffness(load_scenario(scenario, given | {"vary": None}))["shapes"]["mac"].values)
    np.testing.assert_allclose(np.diag(macs[0]), 1.0, rtol=1e-9)
    for other in macs[1:]:
        np.testing.assert_allclose(other, macs[0], rtol=1e-9)


@pytest.mark.parametrize("unit", UNITS)
def test_places_of_measured_shapes(tmp_path, unit):
    """The file of measured modes is read as the keys are; a place beyond the body is refused with its line."""
    scenario = load_scenario(text_of("beam", unit, (0.4, 0.2)))
    file = tmp_path / "shapes.csv"
    write = UNITS[unit]
    rows = [f"{write(share, 0.4)},{share / 100:.3g}" for share in (25, 50, 100)]
    file.write_text("\n".join(["position,20 Hz", *rows]) + "\n")
    compared = compare_modes(scenario, read_shapes(file, scenario))
    assert compared["compared_modes"]["mac"].values.shape[0] >= 1
    file.write_text("\n".join(["position,20 Hz", *rows, f"{write(120, 0.4)},1"]) + "\n")
    with pytest.raises(ScenarioError, match=r"lies beyond beam\.length"):
        compare_modes(scenario, read_shapes(file, scenario))


# --- that every key is in a case -------------------------------------------------------------------------------------


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


def test_every_key_that_may_be_relative_is_in_a_case():
    """Twin of the tests here: a new key that takes a percentage has to be added to a case."""
    seen = {}
    sections(Scenario, seen)
    can = {(defining(section, name), name) for section, fields in seen.items() for name in fields if fields[name]}
    given = {
        (defining(type(part), name), name)
        for case in CASES
        for _, part in walk(load_scenario(text_of(case, "percent")))
        for name in type(part).model_fields
        if getattr(part, name) is not None and seen.get(type(part), {}).get(name)
    }
    assert {f"{section.__name__}.{name}" for section, name in can - given} == set()
    assert {"position", "nodes", "from_", "to", "line", "area", "points_at", "positions"} <= {name for _, name in can}


def defining(section, name):
    """The class in which a field is written."""
    return next(base for base in reversed(section.__mro__) if name in getattr(base, "model_fields", {}))
