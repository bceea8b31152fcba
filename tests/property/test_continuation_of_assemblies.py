"""A system that a continuation has changed is the case built anew: random assemblies, every parameter.

Systems are compared by what does not depend on their coordinates: by how all channels respond to the excitation, to a
force at each contact and to the constant loads, and by their contacts. Motions along branches are compared in
tests/reference/test_continuation_built_anew.py.
"""

from __future__ import annotations

from collections import Counter
from itertools import product

import numpy as np
import pytest
from assemblies import Assembly, parameters
from sampling import first_apart

from beamsim.errors import ScenarioError
from beamsim.responses.parameters import response_model
from beamsim.scenario import load_scenario
from beamsim.scenario.base import path_text
from beamsim.scenario.parameters import value_at
from beamsim.system.build import build_system

SPEEDS = 2 * np.pi * np.array([3.0, 20.0, 45.0])  # rad/s


def followed(data, along):
    """The model of a continuation; None where it has no form of the snubber's law."""
    try:
        return response_model(load_scenario({**data, "sweep": {"kind": "continuation", "continue_in": along}}))
    except ScenarioError as error:
        if along["kind"] in ("stiffness", "position") and "contact law is not made of these two alone" in str(error):
            return None
        raise


def rows_of(system, section=""):
    """Linear rows of the channels, of all sections or of one; stresses have stations, and are left out."""
    wanted = lambda channel: channel.quantity != "bending_stress" and section in ("", channel.section)  # noqa: E731
    return system.channels.select(wanted).linear


def responses(system, speed, section=""):
    """Amplitudes of all channels, open contacts: (channels, m + 2) under a unit force of each contact, the constant
    loads and the excitation."""
    dynamics, contacts, forcing = system.dynamics, system.dynamics.contacts, system.forcing
    rows = rows_of(system, section)
    signals, iw = system.sine.at(np.array([speed]))[0], 1j * speed
    exciting = signals @ forcing.load
    loads = np.vstack([contacts.sign[:, None] * contacts.shape, dynamics.constant_load, exciting]).T
    q = np.linalg.solve(np.diag(dynamics.stiffness - speed**2) + iw * dynamics.damping, loads)
    of = {name: rows[:, columns] for name, columns in system.channels.sizes.slices.items()}
    found = of["displacement"] @ q + iw * (of["velocity"] @ q) - speed**2 * (of["acceleration"] @ q)
    found[:, -1] += of["load"] @ signals
    return found


def described(system):
    """By name what a system is, whatever its coordinates are."""
    contacts, rest = system.dynamics.contacts, system.static_equilibrium
    rows = rows_of(system)
    found = {f"channels at {speed:.3g} rad/s": responses(system, speed) for speed in SPEEDS}
    found |= {
        f"channels by {name}": system.channels.sizes.part(rows, name)
        for name in ("contact", "opening", "constant", "cubic")
    }
    found |= {name: np.asarray(getattr(contacts, name), dtype=float) for name in
              ("gap", "sign", "on_ground", "base_participations", "pressing_contacts", "pressed_contacts")}  # fmt: skip
    found |= {f"laws: {name}": np.asarray(of, dtype=float) for name, of in contacts.arrays._asdict().items()}
    found["at rest"] = contacts.shape @ (np.full(system.dynamics.size, np.nan) if rest is None else rest)
    found["start"] = contacts.shape @ system.initial_state[: system.dynamics.size]
    for snubber in system.snubbers:
        numbers = ("position", "stiffness", "dashpot", "gap", "preload", "blocked_force", "stiffness_ratio")
        found[snubber.name] = np.array([getattr(snubber, name) for name in numbers])
    found["probes"] = np.array([(probe.position, *probe.base_influence) for probe in system.probes])
    return found


def unlike(one, other):
    """Names of what differs."""
    assert one.keys() == other.keys()
    bad = []
    for name, x in one.items():
        y = other[name]
        largest = np.abs(y[np.isfinite(y)]).max(initial=0.0)
        if x.shape != y.shape or not np.allclose(x, y, rtol=1e-6, atol=1e-7 * largest + 1e-15, equal_nan=True):
            bad.append(name)
    return bad


def tried(along):
    """Two values of a parameter: within its range, and the last."""
    return [along["from"] + share * (along["to"] - along["from"]) for share in (0.37, 1.0)]


def meshed_alike(assembly, along, path):
    """The scenario with a probe, which is a node of the mesh, at every place where the snubber is compared.

    Where supports move, contacts and probes are nodes, so that the mesh of the case built anew is another one.
    """
    if assembly.moves != "support" or along["kind"] != "position":
        return assembly.data
    written = value_at(load_scenario(assembly.data), path)
    body = find_body(assembly.data, path)
    places = dict.fromkeys([written, along["from"], *tried(along)])
    probes = [{"name": f"p{k}", "at": {"body": body, "position": x}} for k, x in enumerate(places)]
    return assembly.data | {"probes": probes}


def find_body(data, path):
    """The body that a snubber is on."""
    return data["snubbers"][path[1]]["at"]["body"]


def moved_as_built(assembly, along, path):
    """Compare the model of a continuation with the case built with two of its values; False where it is refused."""
    data = meshed_alike(assembly, along, path)
    model = followed(data, along)
    if model is None:
        return False
    for value in tried(along):
        unknown = model.followed.to_unknown(value)
        moved = model.followed.system(model.system, unknown)
        anew = build_system(load_scenario(data, {path_text(path): value}))
        assert unlike(described(moved), described(anew)) == [], (along, value)
        contacts, _ = model.followed.moved_snubber(model.followed.from_unknown(unknown))
        for name in ("shape", "gap", "base_participations"):
            np.testing.assert_array_equal(getattr(contacts, name), getattr(moved.dynamics.contacts, name))
    return True


def loads_as_built(assembly, along):
    """Compare the periodic loads of a continuation with those of the case built with two of its values, in time."""
    model, scenario, times = followed(assembly.data, along), load_scenario(assembly.data), np.linspace(0.0, 0.2, 9)
    frequency, level = scenario.excitation.frequency, scenario.excitation.level
    for value in tried(along):
        hz, size = (value, level) if along["kind"] == "frequency" else (frequency, value)
        anew = build_system(scenario.model_copy(update={"excitation": scenario.excitation.at(hz, size)})).forcing
        omega = 2 * np.pi * hz
        force, base, _, _ = model.loads.at(omega, size)
        turned = np.exp(1j * omega * times)
        expected = np.array([signal(times) for signal in anew.signal]).T @ anew.load
        np.testing.assert_allclose(
            np.outer(turned, force.sum(axis=0)).real, expected, atol=1e-10 * np.abs(expected).max()
        )
        if (moves := anew.base_at(times)) is not None:
            moved = np.outer(turned, base.sum(axis=0)).real
            np.testing.assert_allclose(moved, moves, atol=1e-10 * np.abs(moves).max())
    return True


def compared(assembly, along, path):
    """Compare one parameter; False where it is refused."""
    if along["kind"] in ("frequency", "level"):
        return loads_as_built(assembly, along)
    return moved_as_built(assembly, along, path)


@first_apart(
    ("kind", "moves"),
    3,
    product(["position", "frequency", "level", "gap", "stiffness"], ["base", "turning", "support"]),
)
def test_the_first_number_of_its_kind(kind, moves):
    assembly = Assembly(10, moves)
    of_kind = [each for each in parameters(assembly.data) if each[0]["kind"] == kind]
    assert any(compared(assembly, *each) for each in of_kind)


@pytest.mark.parametrize("seed", [0, 1, 3, 7, 9, 10, 11])
def test_every_parameter_of_an_assembly(seed):
    assembly = Assembly(seed)
    count = Counter(along["kind"] for along, path in parameters(assembly.data) if compared(assembly, along, path))
    assert count["gap"] > 1


def test_the_comparison_can_fail():
    """Twin: a system that stays as it was differs in each parameter of a snubber, in what it must."""
    assembly, seen = Assembly(10, "turning"), {}
    unmoved = build_system(load_scenario(assembly.data))
    for along, path in parameters(assembly.data):
        if along["kind"] in ("gap", "stiffness", "position") and along["kind"] not in seen:
            anew = build_system(load_scenario(assembly.data, {path_text(path): along["to"]}))
            seen[along["kind"]] = set(unlike(described(unmoved), described(anew)))
    assert "gap" in seen["gap"]
    assert "laws: force" in seen["stiffness"]
    assert any(name.startswith("channels at") for name in seen["position"])


PAIR = {
    "beam": {
        "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0, "elements": 6,
        "damping": {"kind": "modal", "ratio": 0.08},
    },
    "snubbers": [{
        "name": "tip", "position": 0.24, "side": "both", "stiffness": 151e3, "gap": 1e-4, "mounted_on": "ground",
        "damping": {"kind": "ratio", "ratio": 0.02},
    }],
    "excitation": {"kind": "harmonic", "applied_to": "base", "direction": "ry", "level": 60.0, "frequency": 50.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("along", "step", "changing"),
    [
        ({"kind": "gap", "from": 1e-4, "to": 2e-4}, 1e-6, {"gap"}),
        ({"kind": "stiffness", "from": 1e5, "to": 2e5, "snubber": "tip"}, 1.0, {"stiffness", "dashpot"}),
        ({"kind": "position", "from": 0.22, "to": 0.26}, 1e-6, {"shape", "dashpot", "base_participations"}),
    ],
    ids=lambda along: along["kind"] if isinstance(along, dict) else "",
)
def test_both_stops_of_a_pair_are_followed(along, step, changing):
    """Their numbers change together; the derivatives were those of one stop, and no motion was followed."""
    moved = followed(PAIR, along).followed.moved_snubber
    value = tried(along)[0]
    _, rates = moved(value)
    above, below = moved(value + step)[0], moved(value - step)[0]
    changed = set()
    for name in ("stiffness", "dashpot", "gap", "shape", "base_participations"):
        difference = (getattr(above, name) - getattr(below, name)) / (2 * step)
        exact = rates.base_participation if name == "base_participations" else getattr(rates, name)
        np.testing.assert_allclose(exact, difference, rtol=2e-5, atol=1e-8 * np.abs(difference).max(initial=1e-3))
        changed |= {name} if np.all(exact.reshape(2, -1).any(axis=1)) else set()
    assert changed == changing


@pytest.mark.parametrize(
    ("snubber", "message", "remedy"),
    [
        ("tip.below", "is one stop of a pair, and both have the same gap", "name the pair: tip"),
        ("tap", "is an unknown snubber", "tip"),
    ],
)
def test_one_stop_of_a_pair_has_no_number_of_its_own(snubber, message, remedy):
    along = {"kind": "gap", "from": 0.0, "to": 1e-4, "snubber": snubber}
    with pytest.raises(ScenarioError) as caught:
        load_scenario({**PAIR, "sweep": {"kind": "continuation", "continue_in": along}})
    (problem,) = caught.value.problems
    assert problem.path == "sweep.continue_in.snubber"
    assert message in problem.message
    assert remedy in problem.remedy


def test_a_stop_moves_up_to_a_support_that_moves():
    """Within the last element of the written case, what the support adds to the motion is that of the case itself."""
    span = PAIR["beam"] | {"supports": {"left": "pinned", "right": "pinned"}, "elements": 4}
    shaken = {"kind": "harmonic", "applied_to": {"support": "right"}, "level": "1 mm", "frequency": 30.0}
    stops = [PAIR["snubbers"][0] | {"position": 0.135}]
    data = {"beam": span, "snubbers": stops, "excitation": shaken, "reduction": {"modes": "all"}}
    along = {"kind": "position", "from": 0.135, "to": 0.25}
    model = followed(data, along)
    moved = model.followed.system(model.system, model.followed.to_unknown(0.25))
    probes = [{"name": f"p{k}", "position": x} for k, x in enumerate((0.135, 0.25))]
    anew = build_system(load_scenario({**data, "probes": probes}, {"snubbers[0].position": 0.25}))
    found, expected = (responses(system, 190.0, "snubbers") for system in (moved, anew))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())
