"""Every parameter of a continuation against the case that is written with its value and stepped, field by field.

The ranges are short, as only their ends are compared, and away from the value that is written.
"""

from __future__ import annotations

import numpy as np
import pytest

from beamsim.analyses.continuation.analysis import continuation
from beamsim.analyses.sweep.analysis import sweep
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.shooting import linear_guess
from beamsim.responses.parameters import response_model
from beamsim.results.values import peaks_in
from beamsim.scenario import load_scenario
from beamsim.structures.places import Place
from beamsim.system.build import build_family, build_system
from tests.helpers.branches import long_steps

STOP = {
    "name": "tip", "position": 0.23, "side": "below", "stiffness": 151.1e3, "gap": 1e-4, "mounted_on": "ground",
    "damping": {"kind": "viscous", "coefficient": 5.0},
}  # fmt: skip
RATIO = {"damping": {"kind": "ratio", "ratio": 0.02}}
TURNING = {
    "kind": "harmonic", "applied_to": "base", "direction": "ry", "about": "0 mm", "level": "60 rad/s^2",
    "frequency": 23.0,
}  # fmt: skip
LIFTED = {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": 50.0}
LOADED = {"excitation": LIFTED, "gravity": 9.81}
TABLE = {"stiffness": None, "damping": None, "force_deflection": {"points": [[0, 0], [1e-4, 10], [1e-3, 200]]}}
MAXWELL = {"damping": None, "mounted_on": "base", "maxwell": [{"stiffness": 2e4, "relaxation_time": 0.003}]}
RUBBED = {
    "name": "f", "at": {"position": 0.25}, "normal_force": {"snubber": "tip"}, "coefficient": 0.3, "stiffness": 1e4,
    "mounted_on": "base",
}  # fmt: skip
PRESSING = {"gap": -1e-5, "damping": None, "mounted_on": "base"}
PRESSED = {"excitation": LIFTED, "friction": [RUBBED]}


def beam(stop: dict, **others) -> dict:
    return {
        "beam": {
            "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
            "elements": 6, "damping": {"kind": "modal", "ratio": 0.08},
        },
        "reduction": {"modes": "all"},
        "snubbers": [{**STOP, **stop}],
        "excitation": TURNING,
        "limits": {"peak_force": 1.0, "bending_stress": "1 MPa", "peak_acceleration": "1 g", "gap": "1 mm"},
        "outputs": [
            {"name": "root", "kind": "reaction_moment", "support": "left"},
            {"name": "base", "kind": "reaction_force", "support": "base"},
            {"name": "bend", "kind": "bending_moment", "position": 0.1},
        ],
        **others,
    }  # fmt: skip


POSITION, GAP, STIFFNESS, LEVEL = "snubbers[0].position", "snubbers[0].gap", "snubbers[0].stiffness", "excitation.level"
CASES = {
    "stop on the ground, turning base: position": (beam({}), POSITION, (0.262, 0.27)),
    "stop on a turning base: position": (beam({"mounted_on": "base"}), POSITION, (0.25, 0.26)),
    "turning about a point, damping ratio: position": (
        beam(RATIO, excitation={**TURNING, "about": "100 mm"}), POSITION, (0.255, 0.27),
    ),
    "lifted base, damping ratio: position": (beam(RATIO, excitation=LIFTED), POSITION, (0.255, 0.27)),
    "table on the ground: position": (beam(TABLE), POSITION, (0.234, 0.24)),
    "Maxwell branch: position": (beam(MAXWELL, excitation=LIFTED), POSITION, (0.234, 0.24)),
    "friction under the stop: position": (beam(PRESSING, **PRESSED), POSITION, (0.25, 0.26)),
    "friction under the stop: gap": (beam(PRESSING, **PRESSED), GAP, (-2e-5, -1.7e-5)),
    "friction under the stop: stiffness": (beam(PRESSING, **PRESSED), STIFFNESS, (1.9e5, 2e5)),
    "stop on the base: gap": (beam({"mounted_on": "base"}, excitation=LIFTED), GAP, (0.0, 5e-5)),
    "stop on the ground, turning base: gap": (beam({}), GAP, (-1e-5, 2e-5)),
    "Maxwell branch: gap": (beam(MAXWELL, excitation=LIFTED), GAP, (0.0, 3e-5)),
    "damping ratio: stiffness": (beam(RATIO), STIFFNESS, (1.7e5, 2e5)),
    "stop on the ground, turning base: level": (beam({}), LEVEL, (20.0, 80.0)),
    "stop on the ground, gravity: level": (beam({}, **LOADED), LEVEL, (5.0, 15.0)),
}  # fmt: skip


def assembly(joint: dict, snubbers: list[dict], **others) -> dict:
    """An arm, and a flap that is joined to its end."""
    arm = beam({})["beam"] | {"kind": "beam", "length": 0.2, "elements": 2}
    return {
        "bodies": {"arm": arm, "flap": arm | {"length": 0.15, "supports": {"left": "free", "right": "free"}}},
        "joints": [{"name": "root", "between": [{"body": "arm", "position": 0.2}, {"body": "flap", "position": 0.0}],
                    **joint}],
        "snubbers": [{"stiffness": 4e4} | ({} if "between" in each else {"side": "below"}) | each for each in snubbers],
        "excitation": TURNING,
        "reduction": {"modes": "all"},
        "limits": {"peak_force": 1.0, "peak_acceleration": "1 g", "gap": "1 mm"},
        "outputs": [{"name": "root", "kind": "reaction_moment", "support": "left", "body": "arm"}],
        **others,
    }  # fmt: skip


def on(body: str, position: float) -> dict:
    return {"body": body, "position": position}


HINGED = {"kind": "hinge", "rotational_stiffness": 60.0, "rotational_dashpot": 0.2}
SPRUNG = {"kind": "spring", "stiffness": 5e4, "dashpot": 20.0, "rotational_stiffness": 60.0, "rotational_dashpot": 0.2}
ON_FLAP = {"name": "tip", "at": on("flap", 0.1), "gap": 1e-4, "mounted_on": "ground", **RATIO}
ON_ARM = {"name": "arm", "at": on("arm", 0.15), "side": "above", "gap": 5e-5, "damping": STOP["damping"]}
BETWEEN = {"name": "fold", "between": [on("arm", 0.05), on("flap", 0.12)], "gap": 1e-4, "damping": STOP["damping"]}
BOTH = {**ON_FLAP, "side": "both"}
SHAKEN = {"kind": "harmonic", "applied_to": {"support": "left", "body": "arm"}, "level": "1 g", "frequency": 20.0}
ASSEMBLIES = {
    "assembly, hinge, two stops, turning base: position": (
        assembly(HINGED, [ON_FLAP, ON_ARM]), "snubbers[0].at.position", (0.13, 0.14),
    ),
    "assembly, spring, pair of stops, turning base: position": (
        assembly(SPRUNG, [BOTH]), "snubbers[0].at.position", (0.13, 0.14),
    ),
    "assembly, hinge, pair of stops and one more: gap": (assembly(HINGED, [BOTH, ON_ARM]), GAP, (5e-5, 2e-4)),
    "assembly, rigid, stop between bodies, gravity: stiffness": (
        assembly({"kind": "rigid"}, [BETWEEN, ON_ARM], **LOADED), STIFFNESS, (4.5e4, 5e4),
    ),
    "assembly, spring, moved support: gap": (assembly(SPRUNG, [ON_FLAP], excitation=SHAKEN), GAP, (0.0, 4e-5)),
    "assembly, hinge, two stops, moved support: level": (
        assembly(HINGED, [ON_FLAP, ON_ARM], excitation=SHAKEN), LEVEL, (5.0, 12.0),
    ),
}  # fmt: skip
COEXISTING = (
    "assembly, hinge, pair of stops and one more: gap"  # two motions, of which a stepped sine may find the other
)
CASES |= {name: case for name, case in ASSEMBLIES.items() if name != COEXISTING}
FIRST = "stop on the ground, turning base: position"


def followed(scenario: dict, key: str, ends: tuple[float, float]):
    kind = key.rpartition(".")[2]
    along = {"kind": kind, "from": ends[0], "to": ends[1]}
    if key != LEVEL:
        along["snubber"] = scenario["snubbers"][0]["name"]
    alone = {"longest_period": 1, "seek_at": 0, "side_branches": "none"}
    section = {"kind": "continuation", "continue_in": along, **alone}
    with long_steps():
        result = continuation(load_scenario({**scenario, "sweep": section}))
    return result.branches[0]


def stepped(scenario: dict, key: str, value: float):
    hz = scenario["excitation"]["frequency"]
    section = {"kind": "stepped", "from": hz, "to": hz * (1 + 1e-9), "points": 2, "steady_to": 1e-10}
    return sweep(load_scenario({**scenario, "sweep": section}, {key: value})).curves["up_0"].cycles


def measured_along(points, at: int) -> dict[str, float]:
    """Peaks of probes, forces and outputs, the stress, gaps and shares of contact at a point or in a cycle."""
    called = {"peak_displacement": "displacement", "peak_acceleration": "acceleration", "peak_force": "force",
              "peak_moment": "force", "peak_output": "outputs", "largest_gap": "peak_gap",
              "bending_stress": "stress"}  # fmt: skip
    values = {f"{called[value.name]} {name}".strip(): x[at] for value, of in peaks_in(points) for name, x in of.items()}
    share = points.by_label("contact_share")
    return values | {f"contact_share {name}": of.values[at] for name, of in share.items()}


@pytest.mark.parametrize("name", CASES)
def test_both_ends_are_the_case_built_anew(name):
    scenario, key, ends = CASES[name]
    branch = followed(scenario, key, ends)
    compared = 0
    for end in (0, -1):
        if not branch["stable"].values[end]:
            continue  # what is stepped does not stay there
        values = measured_along(branch, end)
        anew = measured_along(stepped(scenario, key, float(branch["parameter"].values[end])), 0)
        assert values.keys() == anew.keys()
        for quantity, value in values.items():
            # moments along the beam are known to their stations, which differ by the mesh of the places added
            rel = 1e-4 if "stress" in quantity or "bend" in quantity else 1e-8
            assert value == pytest.approx(anew[quantity], rel=rel), quantity
        compared += 1
    assert compared


@pytest.mark.parametrize("name", ASSEMBLIES)
def test_a_motion_of_an_assembly_repeats_in_the_case_built_anew(name):
    """By the exact march under the loads of that case; in the case of the other end it does not repeat."""
    scenario, key, ends = ASSEMBLIES[name]
    along = {"kind": key.rpartition(".")[2], "from": ends[0], "to": ends[1]}
    named = {} if key == LEVEL else {"snubber": scenario["snubbers"][0]["name"]}
    model = response_model(load_scenario({**scenario, "sweep": {"kind": "continuation", "continue_in": along | named}}))
    problem, period = model.problem(model.levels[0]), 1.0 / scenario["excitation"]["frequency"]
    systems = [build_system(load_scenario(scenario, {key: value})) for value in ends]
    for value, anew, other in zip(ends, systems, reversed(systems), strict=True):
        unknown = model.followed.to_unknown(value)
        flow, _ = problem.flow_at(unknown)
        state = linear_guess(flow)
        for _ in range(5):
            state = flow.end(state, period)
        point = solve_at(problem, np.append(state, unknown), Settings(iterations=25), unknown, 1.0)
        state = point.u[:-1]
        assert repeats_to(anew, state, period) < 1e-9
        assert repeats_to(other, state, period) > 1e-4


def repeats_to(system, state, period):
    """Largest change of a state in two periods, over the state's size."""
    motion = simulate(ExactFlow(system.dynamics, system.forcing, 2 * period), state)
    return np.abs(motion.states_at(np.array([2 * period]))[0] - state).max() / np.abs(state).max()


def parts_of_rows(system):
    """The rows of the channels of a system without bending, by part."""
    channels = system.channels.select(lambda channel: channel.quantity not in ("bending_stress", "bending_moment"))
    return {name: channels.sizes.part(channels.linear, name) for name in channels.sizes.slices}


@pytest.mark.parametrize(("key", "value"), [(POSITION, 0.26), (GAP, -2e-5), (STIFFNESS, 9e4)])
def test_the_system_with_another_number_is_that_built_anew(key, value):
    """Contacts and channels, in coordinates that serve both."""
    scenario = beam(RATIO, excitation={**TURNING, "about": "100 mm"})
    places = tuple(Place("beam", position) for position in (0.2, 0.27))
    path = ("snubbers", 0, key.rpartition(".")[2])
    family = build_family(load_scenario(scenario), places)
    moved, anew = family.at(path, value), build_family(load_scenario(scenario, {key: value}), places).system
    for name in ("shape", "gap", "base_participations"):
        np.testing.assert_allclose(*(getattr(each.dynamics.contacts, name) for each in (moved, anew)), rtol=1e-10)
    (law,), (other,) = moved.dynamics.contacts.laws, anew.dynamics.contacts.laws
    assert (law.stiffness, law.dashpot) == (other.stiffness, pytest.approx(other.dashpot, rel=1e-12))
    # moments along the beam depend on the static vectors of the coordinates, and are compared along motions
    rows, new, old = (parts_of_rows(each) for each in (moved, anew, family.system))
    for name, expected in new.items():
        np.testing.assert_allclose(rows[name], expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max(initial=0.0))
    changed = [name for name in rows if np.any(rows[name] != old[name])]
    assert bool(changed) == (key != STIFFNESS)


def test_the_share_of_a_turning_base_is_worth_a_third():
    """Twin of the first case: 0.681 mm at 270 mm, and 0.453 mm with the share of the written position."""
    scenario, key, _ = CASES[FIRST]
    right = measured_along(stepped(scenario, key, 0.27), 0)["displacement tip"]
    assert right == pytest.approx(0.681e-3, rel=2e-3)
    assert abs(right - 0.453e-3) > 0.2e-3


def test_a_stop_at_the_axis_of_the_base_feels_nothing_of_it():
    """Where the axis lies at the written position its share is zero, and elsewhere it is not."""
    scenario = beam({"position": 0.23}, excitation={**TURNING, "about": "230 mm"})
    branch = followed(scenario, POSITION, (0.25, 0.26))
    assert branch["status"].item().startswith("reached")
    for end in (0, -1):
        anew = measured_along(stepped(scenario, POSITION, float(branch["parameter"].values[end])), 0)
        assert measured_along(branch, end)["force tip"] == pytest.approx(anew["force tip"], rel=1e-8)
