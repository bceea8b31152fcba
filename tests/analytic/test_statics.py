"""Static equilibria against closed forms, a search over all contact states, and the start of runs."""

from itertools import product

import numpy as np
import pytest
from shipped import config_path

import beamsim

GRAVITY = 9.81
BEAM = {
    "length": 1.2, "width": 0.04, "thickness": 0.008, "youngs_modulus": 210e9, "density": 7850,
    "supports": {"left": "clamped"},
}  # fmt: skip
LENGTH, BENDING = 1.2, 210e9 * 0.04 * 0.008**3 / 12
LINE_LOAD = 7850 * 0.04 * 0.008 * GRAVITY


def case_of(**more):
    return {"beam": BEAM, "gravity": GRAVITY, "probes": [{"name": "end", "position": LENGTH}]} | more


def stop(gap, stiffness=3e3, **more):
    return {"name": "stop", "position": LENGTH, "side": "below", "gap": gap, "stiffness": stiffness} | more


def force_of_stop(gap, stiffness):
    """N, of a spring under the end of a cantilever that bends under its weight."""
    free = LINE_LOAD * LENGTH**4 / (8 * BENDING)
    return max(free - gap, 0.0) / (LENGTH**3 / (3 * BENDING) + 1 / stiffness)


@pytest.mark.parametrize(("gap", "stiffness"), [(5e-3, 3e3), (0.0, 1e9), (0.1, 3e3), (-2e-3, 1e4)])
def test_a_cantilever_under_its_weight_on_an_elastic_stop(gap, stiffness):
    result = beamsim.static(case_of(snubbers=[stop(gap, stiffness)]))
    force, s = force_of_stop(gap, stiffness), result.summary
    weight = LINE_LOAD * LENGTH
    assert s["static_force_n"]["stop"] == pytest.approx(force, rel=1e-8)
    assert s["touching"]["stop"] == (force > 0)
    assert s["reaction_n"]["left"] == pytest.approx(weight - force, rel=1e-8)
    assert s["reaction_moment_n_m"]["left"] == pytest.approx(LENGTH * (weight / 2 - force), rel=1e-8, abs=1e-9)
    deflection = force * LENGTH**3 / (3 * BENDING) - LINE_LOAD * LENGTH**4 / (8 * BENDING)
    assert s["min_displacement_m"]["end"] == pytest.approx(deflection, rel=1e-7, abs=1e-12)
    left = result["equilibrium"]["gap_left"].values[0]
    assert left == pytest.approx(0.0 if force else gap + deflection, rel=1e-8)


def test_a_beam_lifts_off_its_stop_and_meets_the_one_above():
    """The tip is pushed up by a dead load: the stop below opens, the one above carries the rest."""
    stops = [stop(-1e-3, 5e3), stop(4e-3, 2e3, name="above", side="above")]
    result = beamsim.static(case_of(snubbers=stops, constant_forces=[{"position": LENGTH, "force": 30.0}]))
    up = 30.0 * LENGTH**3 / (3 * BENDING) - LINE_LOAD * LENGTH**4 / (8 * BENDING)
    force = (up - 4e-3) / (LENGTH**3 / (3 * BENDING) + 1 / 2e3)
    assert result.summary["touching"] == {"stop": False, "above": True}
    assert result.summary["static_force_n"]["above"] == pytest.approx(force, rel=1e-8)
    assert result["equilibrium"]["gap_left"].values[0] == pytest.approx(-1e-3 + 4e-3 + force / 2e3, rel=1e-8)


def test_reactions_and_stops_carry_all_loads_to_round_off():
    result = beamsim.static(config_path("resting_beam"))
    s = result.summary
    mass = 7850 * 1.2 * 0.04 * 0.008 + 1.5
    total = s["reaction_n"]["left"] + sum(s["static_force_n"].values())
    assert total == pytest.approx(mass * GRAVITY + 8.0, rel=1e-12)


def test_a_plate_rests_on_its_edge_and_a_stop():
    case = {
        "bodies": {"plate": {
            "kind": "plate", "length": 0.4, "width": 0.3, "thickness": 0.002, "youngs_modulus": 70e9,
            "poissons_ratio": 0.33, "density": 2700, "supports": {"left": "clamped"}, "elements": [6, 4],
        }},
        "gravity": GRAVITY, "probes": [{"name": "corner", "position": [0.4, 0.3]}],
        "snubbers": [
            {"name": "stop", "position": [0.4, 0.0], "side": "below", "gap": 1e-4, "stiffness": 1e4}
        ],
    }  # fmt: skip
    s = beamsim.static(case).summary
    total = s["reaction_n"]["left"] + s["static_force_n"]["stop"]
    assert s["touching"]["stop"]
    assert total == pytest.approx(0.4 * 0.3 * 0.002 * 2700 * GRAVITY, rel=1e-9)
    # moments about the clamped edge
    weight = 0.4 * 0.3 * 0.002 * 2700 * GRAVITY
    assert abs(s["reaction_moment_n_m"]["left"]) == pytest.approx(0.2 * weight - 0.4 * s["static_force_n"]["stop"])


def rest_of_chain(stiffness, weight, springs):
    """Displacements (n,) and forces by a search over all contact states; springs: row, sign, stiffness, gap."""
    for state in product([0, 1], repeat=len(springs)):
        closed = [spring for spring, shut in zip(springs, state, strict=True) if shut]
        matrix, load = stiffness.copy(), -weight
        for row, sign, k, gap in closed:
            matrix = matrix + k * np.outer(row, row)
            load = load - k * sign * gap * row
        q = np.linalg.solve(matrix, load)
        depth = [-gap - sign * (row @ q) for row, sign, _, gap in springs]
        if all((x > 0) == bool(shut) for x, shut in zip(depth, state, strict=True)):
            return q, [k * max(x, 0.0) for x, (_, _, k, _) in zip(depth, springs, strict=True)]
    raise AssertionError


@pytest.mark.parametrize("seed", range(4))
def test_several_stops_against_all_contact_states(seed):
    rng = np.random.default_rng(seed)
    masses, springs = rng.uniform(1, 3, 4), rng.uniform(1e3, 4e3, 4)
    gaps, stiffness = rng.uniform(-2e-3, 2e-2, 4), rng.uniform(1e3, 2e4, 4)
    stops = [
        {"name": f"s{k}", "at": {"mass": k + 1}, "side": "below", "gap": gaps[k], "stiffness": stiffness[k]}
        for k in range(4)
    ]
    case = {"chain": {"masses": masses.tolist(), "springs": springs.tolist()}, "gravity": GRAVITY, "snubbers": stops,
            "probes": [{"name": f"m{k}", "mass": k + 1} for k in range(4)]}  # fmt: skip
    s = beamsim.static(case).summary
    own = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    rows = [(np.eye(4)[k], 1.0, stiffness[k], gaps[k]) for k in range(4)]
    q, forces = rest_of_chain(own, masses * GRAVITY, rows)
    assert list(s["static_force_n"].values()) == pytest.approx(forces, rel=1e-9, abs=1e-9)
    assert list(s["min_displacement_m"].values()) == pytest.approx(q, rel=1e-9)
    assert s["reaction_n"]["left"] + sum(forces) == pytest.approx(masses.sum() * GRAVITY, rel=1e-12)


@pytest.mark.parametrize("name", ["resting_beam", "two_panels", "imported_panel"])
def test_the_equilibrium_is_that_from_which_a_run_starts(name):
    start = {"duration": 0.01, "sample_rate": 1e4, "convergence": "off", "start": "static_equilibrium"}
    loads = {"gravity": GRAVITY} if name != "two_panels" else {}
    still = beamsim.load_scenario(config_path(name), loads | {"excitation": None, "run": start})
    at_start = beamsim.run(still)["histories"]["displacement"].by_label()
    at_rest = beamsim.static(still)["equilibrium"].by_label("displacement")
    assert at_start.keys() == at_rest.keys()
    for probe, history in at_start.items():
        np.testing.assert_allclose(history.values, at_rest[probe].item(), rtol=1e-7, atol=1e-12)


def test_an_imported_panel_balances_a_dead_load_at_its_base():
    case = beamsim.load_scenario(
        config_path("imported_panel"), {"constant_forces": [{"node": 14, "direction": "z", "force": "-3 N"}]}
    )
    s = beamsim.static(case).summary
    assert s["touching"] == {"corner": True}
    assert s["reaction_n"]["node 15"] + sum(s["static_force_n"].values()) == pytest.approx(3.0, rel=1e-9)


def test_frequencies_of_a_beam_with_friction_are_those_of_the_published_rig():
    """Virtual RubBeR rig of NLtest, BT01: 80.3678 Hz printed; the others of an independent beam model."""
    beam = {
        "length": 0.71, "width": 0.06, "thickness": 0.05, "youngs_modulus": 0.6725 * 210e9, "density": 7850,
        "elements": 14, "supports": {"left": "clamped"}, "damping": {"kind": "modal", "ratio": 0.01},
    }  # fmt: skip
    friction = {"name": "jenkins", "at": {"position": 0.253571}, "mounted_on": "ground", "normal_force": 15,
                "coefficient": 1, "stiffness": 1e7}  # fmt: skip
    case = {
        "beam": beam,
        "friction": [friction],
        "reduction": {"modes": 6},
        "probes": [{"name": "tip", "position": 0.71}],
    }
    s = beamsim.static(case).summary
    assert s["stuck_frequencies_hz"][:3] == pytest.approx([80.3675, 452.785, 1204.18], rel=1e-5)
    assert s["sliding_frequencies_hz"][:3] == pytest.approx([67.960, 425.903, 1192.61], rel=1e-5)


def test_friction_of_a_chain_stuck_and_sliding():
    """Two masses between walls; rigid friction at the second leaves one mode of the first."""
    case = {
        "chain": {"masses": [2.0, 3.0], "springs": [1e3, 2e3, 0.0]},
        "friction": [{"name": "bracket", "at": {"mass": 2}, "normal_force": 10.0, "coefficient": 0.3}],
        "probes": [{"name": "m", "mass": 1}],
    }
    result = beamsim.static(case)
    stuck, sliding = (result["equilibrium"][f"{of}_frequencies_hz"].values for of in ("stuck", "sliding"))
    assert stuck[0] == pytest.approx(np.sqrt(3e3 / 2.0) / (2 * np.pi))
    assert np.isnan(stuck[1])
    squared = np.linalg.eigvals(np.array([[3e3 / 2, -2e3 / 2], [-2e3 / 3, 2e3 / 3]]))
    assert sliding == pytest.approx(np.sqrt(np.sort(squared)) / (2 * np.pi))
    case["friction"][0]["stiffness"] = 5e3
    stuck = beamsim.static(case)["equilibrium"]["stuck_frequencies_hz"].values
    squared = np.linalg.eigvals(np.array([[3e3 / 2, -2e3 / 2], [-2e3 / 3, 7e3 / 3]]))
    assert stuck == pytest.approx(np.sqrt(np.sort(squared)) / (2 * np.pi))
    assert any("while it sticks, other equilibria" in text for text in result.warnings)


def test_friction_on_an_open_stop_does_not_hold():
    case = {
        "chain": {"masses": [2.0, 1.0], "springs": [1e3, 1e3]},
        "snubbers": [{"name": "stop", "at": {"mass": 2}, "side": "above", "gap": 1e-3, "stiffness": 1e4}],
        "friction": [{"name": "latch", "at": {"mass": 1}, "normal_force": {"snubber": "stop"}, "coefficient": 0.3}],
        "probes": [{"name": "m", "mass": 1}],
    }
    s = beamsim.static(case).summary
    assert s["stuck_frequencies_hz"] == pytest.approx(s["sliding_frequencies_hz"])
    case["snubbers"][0]["gap"] = -1e-3
    stuck = beamsim.static(case).summary["stuck_frequencies_hz"]
    assert stuck[0] == pytest.approx(np.sqrt(11e3) / (2 * np.pi))


def test_a_cubic_spring_stiffens_with_the_weight():
    """k x + c x^3 = m g, and the frequency of the tangent stiffness k + 3 c x^2."""
    case = {
        "chain": {
            "masses": [1.0], "springs": [1e3],
            "springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 1e7}],
        },
        "gravity": GRAVITY, "probes": [{"name": "m", "mass": 1}],
    }  # fmt: skip
    s = beamsim.static(case).summary
    x = max(np.roots([1e7, 0.0, 1e3, -GRAVITY]).real)
    assert s["max_displacement_m"]["m"] == pytest.approx(-x, rel=1e-9)
    assert s["stuck_frequencies_hz"][0] == pytest.approx(np.sqrt(1e3 + 3e7 * x**2) / (2 * np.pi), rel=1e-9)


def test_a_disc_rests_in_a_ring():
    """The ring carries what the springs leave; its law is within 2 % of the force at the end of its range."""
    load = np.array([-8.0, -30.0])
    forces = [{"row": name, "force": force} for name, force in zip("yz", load.tolist(), strict=True)]
    case = beamsim.load_scenario(
        config_path("ring_whirl"), {"excitation": None, "run": None, "constant_forces": forces}
    )
    s = beamsim.static(case).summary
    q = np.array([s["min_displacement_m"][name] for name in ("y", "z")])
    carried = load - np.array([2e4, 3e4]) * q
    # the force is the largest of those along its sides
    assert s["peak_ring_force_n"]["retainer"] == pytest.approx(np.linalg.norm(carried), rel=2e-3)
    assert np.linalg.norm(carried) == pytest.approx(1e6 * (np.linalg.norm(q) - 4e-4), abs=0.02 * 1e6 * 1e-4)
