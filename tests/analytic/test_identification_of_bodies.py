"""Identified stiffnesses of snubbers on one of several bodies and between two."""

import numpy as np
import pytest

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.stiffness import snubber_point
from beamsim.scenario import load_scenario
from beamsim.scenario.parameters import value_at, with_values
from beamsim.structures.secular import stiffness_sensitivities
from tests.helpers.tables import estimates, modes

PANEL = {
    "kind": "beam", "length": 0.77, "width": 0.44, "thickness": 0.005, "youngs_modulus": 70e9, "density": 2700,
    "elements": 20, "supports": {"left": "clamped"}, "point_masses": [{"position": 0.65, "mass": 0.3}],
}  # fmt: skip
SANDWICH = {
    "kind": "beam", "length": 0.6, "bending_stiffness": 210, "mass_per_length": 3.1, "elements": 16,
    "supports": {"left": "clamped"},
}  # fmt: skip
MASSES = {"kind": "chain", "masses": [1.0, 2.0, 1.5], "springs": [900.0, 1500.0, 1200.0, 0.0]}
AT = {"name": "stop", "side": "above", "stiffness": 1e4}
BETWEEN = {
    "name": "stop", "between": [{"body": "panel", "position": 0.7}, {"body": "sandwich", "position": 0.5}],
    "stiffness": 1e4,
}  # fmt: skip
PLACES = {"panel": {"position": 0.7}, "sandwich": {"position": 0.5}, "masses": {"mass": 2}}
BODIES = {"panel": PANEL, "sandwich": SANDWICH, "masses": MASSES}


def on_body(name, stiffness=2e4):
    """A snubber on one of three bodies, and the same body alone, measured with a stiffness."""
    snubber = {**AT, "at": {"body": name, **PLACES[name]}}
    several = {"bodies": BODIES, "snubbers": [snubber], "identify_stiffness": {"snubber": "stop"}}
    alone = {
        BODIES[name]["kind"]: {key: value for key, value in BODIES[name].items() if key != "kind"},
        "snubbers": [{**AT, "at": PLACES[name]}], "identify_stiffness": {"snubber": "stop"},
    }  # fmt: skip
    placeholder = {"identify_stiffness.measured_with": [1.0]}
    point = snubber_point(load_scenario(alone, placeholder), "stop")
    measured = {
        "identify_stiffness.measured_with": (point.frequencies(stiffness, 2) / (2 * np.pi)).tolist(),
        "identify_stiffness.measured_without": (point.omega[:2] / (2 * np.pi)).tolist(),
        "identify_stiffness.uncertainty": 0.002,
    }
    return load_scenario(several, measured), load_scenario(alone, measured)


@pytest.mark.parametrize("name", list(BODIES))
def test_each_body_gives_the_answer_that_it_gives_alone(name):
    several, alone = (identify_stiffness(scenario) for scenario in on_body(name))
    stiffness = several.summary["stiffness_n_per_m"]
    assert stiffness == pytest.approx(2e4, rel=1e-9)
    assert stiffness == alone.summary["stiffness_n_per_m"]
    assert several.summary["interval_n_per_m"] == alone.summary["interval_n_per_m"]
    assert modes(several, "without_snubber").difference_percent[:2] == pytest.approx(0.0, abs=1e-9)
    kind, sensitive = BODIES[name]["kind"], several.summary["sensitivities"]
    relative = {path.replace(f"bodies.{name}", kind): each for path, each in sensitive.items()}
    assert relative == pytest.approx(alone.summary["sensitivities"], rel=1e-12)
    assert any(f"those of {name}" in warning for warning in several.warnings)


def test_only_the_parameters_of_its_body_are_updated():
    scenario, _ = on_body("panel")
    softer = load_scenario(
        scenario,
        {"bodies.panel.youngs_modulus": 60e9, "identify_stiffness.update": ["bodies.panel.youngs_modulus"]},
    )
    result = identify_stiffness(softer)
    (modulus,) = estimates(result, "update")
    assert modulus.value == pytest.approx(70e9, rel=1e-8)
    assert result.summary["stiffness_n_per_m"] == pytest.approx(2e4, rel=1e-7)
    other = load_scenario(scenario, {"identify_stiffness.update": ["bodies.masses.masses[*]"]})
    assert any("has no influence" in warning for warning in identify_stiffness(other).warnings)


def test_supports_of_a_named_body_are_chosen():
    scenario = load_scenario(on_body("panel")[0], {"identify_stiffness.update": ["bodies.panel.supports.right"]})
    result = identify_stiffness(scenario)
    assert result.summary["updated"] == {"bodies.panel.supports.right": "free"}


def between_bodies(**changes):
    bodies = {"panel": PANEL, "sandwich": SANDWICH}
    section = {"snubber": "stop", "measured_with": [1.0]}
    return load_scenario({"bodies": bodies, "snubbers": [BETWEEN], "identify_stiffness": section}, changes)


def test_a_snubber_between_two_bodies():
    scenario = between_bodies()
    # Independent: the receptances of the bodies, each pushed alone, add up where a spring joins them.
    parts = [
        snubber_point(load_scenario(scenario, {"snubbers": [{**AT, "at": {"body": name, **PLACES[name]}}]}), "stop")
        for name in ("panel", "sandwich")
    ]
    hz = float(snubber_point(scenario, "stop").frequencies(2e4, 1)[0]) / (2 * np.pi)
    assert sum(1 / float(part.stiffness(2 * np.pi * hz)) for part in parts) == pytest.approx(1 / 2e4, rel=1e-9)
    result = identify_stiffness(load_scenario(scenario, {"identify_stiffness.measured_with": [hz]}))
    assert result.summary["stiffness_n_per_m"] == pytest.approx(2e4, rel=1e-9)


def between_places_of_one_beam():
    place = [{"position": 0.2}, {"position": 0.7}]
    return load_scenario(
        {
            "beam": {key: value for key, value in PANEL.items() if key != "kind"},
            "snubbers": [{"name": "stop", "between": place, "stiffness": 1e4}],
            "identify_stiffness": {"snubber": "stop", "measured_with": [1.0]},
        }
    )


@pytest.mark.parametrize(
    "scenario",
    [between_bodies(), between_places_of_one_beam(), on_body("panel")[0], on_body("sandwich")[0]],
    ids=["between bodies", "between places of one beam", "on the first of three", "on a beam given by its stiffness"],
)
def test_sensitivities_are_those_of_direct_differences(scenario):
    omega = float(snubber_point(scenario, "stop").frequencies(2e4, 1)[0])
    relative = stiffness_sensitivities(scenario, "stop", omega)
    snubber_places = [path for path in relative if path[0] == "snubbers"]
    assert len(snubber_places) == len(scenario.snubbers[0].places)
    step = 1e-4
    for path, rate in relative.items():
        stiffness = []
        for sign in (1, -1):
            changed = with_values(scenario, {path: value_at(scenario, path) * (1 + sign * step)})
            stiffness.append(float(snubber_point(changed, "stop").stiffness(omega)))
        difference = np.log(stiffness[0] / stiffness[1]) / (2 * step)
        moved = path[-1] in ("position", "length")  # nodes move, and with them the error of the discretisation
        assert rate == pytest.approx(difference, rel=5e-3 if moved else 1e-6, abs=1e-3 if moved else 1e-8), path
