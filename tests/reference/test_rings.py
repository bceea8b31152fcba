"""Rings against the exact circle, integrated independently, and against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import beamsim
from beamsim.contacts.rings import ring_table
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

MASS, SHAFT, GAP, STIFFNESS, LARGEST = 2.0, 2e4, 4e-4, 1e6, 4e-5
Case = dict[str, Any]


def disc(**changes: Any) -> Case:
    """A disc on a shaft in a ring, which a half sine in an oblique direction strikes."""
    ring = {
        "name": "ring", "kind": "ring", "along": [{"row": "y"}, {"row": "z"}], "gap": GAP, "stiffness": STIFFNESS,
        "largest_penetration": LARGEST,
    }  # fmt: skip
    turn, level = changes.pop("turn", 0.3), changes.pop("level", 20.0)
    body = {
        "kind": "matrices", "base": "free", "mass": [[MASS, 0.0], [0.0, MASS]],
        "stiffness": [[SHAFT, 0.0], [0.0, SHAFT]],
        "rows": {"y": [1.0, 0.0], "z": [0.0, 1.0], "blow": [math.cos(turn), math.sin(turn)]},
    }  # fmt: skip
    return {
        "bodies": {"disc": body},
        "snubbers": [ring | changes.pop("ring", {})],
        "excitation": {"kind": "half_sine", "applied_to": {"row": "blow"}, "level": level, "duration": 0.01},
        "run": {"duration": 0.06, "sample_rate": 2e3, "convergence": "off"},
        **changes,
    }


def exact(
    case: Case, load: Any, offset: tuple[float, float] = (0.0, 0.0), dashpot: float = 0.0, drag: float = 0.0
) -> Any:
    """(2, nt) positions with the exact ring; ``drag`` is the dashpot of the shaft."""

    def force(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        at = u - offset
        r = math.hypot(*at)
        if r <= GAP:
            return np.zeros(2)
        n = at / r
        return -(STIFFNESS * (r - GAP) + dashpot * float(v @ n)) * n

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.append(y[2:], (load(t) - SHAFT * y[:2] - drag * y[2:] + force(y[:2], y[2:])) / MASS)

    def touch(t: float, y: np.ndarray) -> float:
        return math.hypot(*(y[:2] - offset)) - GAP

    end = case["run"]["duration"]
    times = np.arange(round(end * case["run"]["sample_rate"]) + 1) / case["run"]["sample_rate"]
    accuracy = {"rtol": 1e-8, "atol": 1e-11, "max_step": 1e-3}
    return solve_ivp(rate, (0.0, end), np.zeros(4), "DOP853", times, events=touch, **accuracy).y[:2]


def blow(case: Case, turn: float, level: float = 20.0) -> Any:
    """The force of the half sine."""
    way = np.array([math.cos(turn), math.sin(turn)])
    return lambda t: level * math.sin(math.pi * t / 0.01) * way if t < 0.01 else np.zeros(2)


@pytest.mark.parametrize("sides", [24, 96])
def test_oblique_blow_follows_the_exact_circle(sides: int) -> None:
    # an elastic shaft and an oblique start from an eccentric ring: impacts under angles
    offset = (1e-4, -5e-5)
    case = disc(ring={"sides": sides, "offset": offset}, turn=1.0)
    result = beamsim.run(case)
    rings, motion = result["rings"], exact(case, blow(case, 1.0), offset)
    position = np.array([rings[f"{each}_position"].sel(ring="ring").values for each in ("first", "second")])
    off = np.abs(position - (motion - np.array(offset)[:, None])).max() / GAP
    impulse_error = rings["impulse_error"].sel(ring="ring").item()
    assert off < 8.0 * impulse_error  # a few impacts, each with that error of its impulse
    assert off < {24: 0.12, 96: 0.01}[sides]


def test_whirl_along_the_wall_keeps_its_radius_and_force() -> None:
    # a rotating force: the disc runs around the ring; the exact ring is integrated
    case = disc(level=0.0, ring={"sides": 96})
    case["excitation"] = {
        "kind": "forces",
        "forces": [
            {"kind": "harmonic", "applied_to": {"row": "y"}, "level": 25.0, "frequency": 8.0},
            {"kind": "harmonic", "applied_to": {"row": "z"}, "level": 25.0, "frequency": 8.0, "phase": math.pi / 2},
        ],
    }  # fmt: skip
    case["bodies"]["disc"]["viscous"] = [[300.0, 0.0], [0.0, 300.0]]
    case["run"]["duration"] = 0.2
    rings = beamsim.run(case)["rings"].sel(ring="ring")

    def load(t: float) -> np.ndarray:
        return 25.0 * np.array([math.sin(2 * math.pi * 8.0 * t), math.cos(2 * math.pi * 8.0 * t)])

    motion = exact(case, load, drag=300.0)
    ours = np.array([rings[f"{each}_position"].values for each in ("first", "second")])
    assert np.abs(ours - motion).max() < 0.01 * GAP
    # the steady whirl in closed form: ((K - m w^2) r + k (r - g))^2 + (c w r)^2 = F^2
    omega, last = 2 * math.pi * 8.0, np.hypot(*ours[:, -20:])

    def excess(r: float) -> float:
        return math.hypot((SHAFT - MASS * omega**2) * r + STIFFNESS * (r - GAP), 300.0 * omega * r) - 25.0

    radius = brentq(excess, GAP, 2 * GAP)
    assert last.mean() == pytest.approx(radius, rel=3e-3)
    assert rings["force"].values[-20:].mean() == pytest.approx(STIFFNESS * (radius - GAP), rel=0.03)


def test_friction_along_the_wall_holds_a_steady_whirl_back() -> None:
    # steady whirl in closed form: ((K - m w^2) r + k (r - g))^2 + (mu k (r - g) + c w r)^2 = F^2
    coefficient, drag, omega, load = 0.2, 300.0, 2 * math.pi * 8.0, 25.0
    case = disc(level=0.0, ring={"sides": 24, "friction": {"coefficient": coefficient, "stiffness": 1e6}})
    case["bodies"]["disc"]["viscous"] = [[drag, 0.0], [0.0, drag]]
    force = {"kind": "harmonic", "level": load, "frequency": 8.0}
    both = [force | {"applied_to": {"row": "y"}}, force | {"applied_to": {"row": "z"}, "phase": math.pi / 2}]
    case |= {"excitation": {"kind": "forces", "forces": both}}
    case["run"] |= {"duration": 0.12, "from": 0.08}
    result = beamsim.run(case)
    rings = result["rings"].sel(ring="ring")

    def excess(r: float) -> float:
        radial, pressed = (SHAFT - MASS * omega**2) * r, STIFFNESS * (r - GAP)
        return math.hypot(radial + pressed, coefficient * pressed + drag * omega * r) - load

    radius = brentq(excess, GAP, 2 * GAP)
    pressed, late = STIFFNESS * (radius - GAP), slice(160, None)
    assert rings["force"].values[late].mean() == pytest.approx(pressed, rel=0.02)
    assert rings["friction_force"].values[late].mean() == pytest.approx(coefficient * pressed, rel=0.02)
    assert rings["work_rate"].item() == pytest.approx(pressed * omega * radius, rel=0.03)
    assert rings["friction_energy"].item() / 0.04 == pytest.approx(coefficient * pressed * omega * radius, rel=0.06)
    assert result.summary["energy_error"] < 1e-10


def test_friction_along_the_axis_is_limited_by_the_forces_of_the_sides() -> None:
    # pressed steadily against the wall and pushed along the axis, a tip loses the limit times the way that it slides
    coefficient, gap, largest, sides = 0.2, 2e-4, 4e-5, 12
    frame = {
        "kind": "frame", "nodes": {"wall": [0, 0, 0], "tip": [0, 0, 1.0]},
        "sections": {"tube": {"section": {"kind": "tube", "outer_diameter": 0.016, "wall_thickness": 1e-3},
                              "youngs_modulus": 2e11, "density": 7850.0}},
        "members": {"arm": {"nodes": ["wall", "tip"]}}, "supports": {"wall": "clamped"},
        "damping": {"kind": "modal", "ratio": 0.05},
    }  # fmt: skip
    ring = {
        "name": "ring", "kind": "ring", "node": "tip", "axis": "x", "gap": gap, "stiffness": 1e6, "sides": sides,
        "offset": [-gap, 0.0], "largest_penetration": largest,
        "friction": {"coefficient": coefficient, "stiffness": 1e7, "along_axis": True},
    }  # fmt: skip
    case = {
        "bodies": {"pipe": frame}, "snubbers": [ring], "reduction": {"modes": 4},
        "probes": [{"name": "tip", "at": {"node": "tip", "direction": "x"}}],
        "constant_forces": [{"at": {"node": "tip", "direction": "y"}, "force": 40.0}],
        "excitation": {"kind": "half_sine", "applied_to": {"node": "tip", "direction": "x"}, "level": 30.0,
                       "duration": 0.02},
        "run": {"duration": 0.02, "sample_rate": 2e4, "convergence": "off"},
    }  # fmt: skip
    result = beamsim.run(case)
    rings, way = result["rings"].sel(ring="ring"), result["histories"]["displacement"].sel(probe="tip").values
    pressed = rings["force"].values
    np.testing.assert_allclose(pressed, pressed[0], rtol=1e-8)  # the axis is perpendicular to the plane of the ring
    table = ring_table(sides, largest / gap)
    knots, slopes = gap * np.array(table.knots), 1e6 * np.array(table.slopes)
    depth = rings["first_position"].values[0] * np.cos(2 * np.pi * np.arange(sides) / sides) - gap
    steps = np.diff(slopes, prepend=0.0)
    forces = (steps[:, None] * np.maximum(depth - knots[:, None], 0.0)).sum(axis=0)
    assert forces @ np.cos(2 * np.pi * np.arange(sides) / sides) == pytest.approx(pressed[0], rel=1e-6)
    slid = np.abs(np.diff(way)).sum()
    assert rings["friction_energy"].item() == pytest.approx(coefficient * forces.sum() * slid, rel=0.01)
    assert result.summary["energy_error"] < 1e-10


def test_rests_in_an_eccentric_ring_at_the_closed_form_equilibrium() -> None:
    # a weight along an oblique direction into a ring that it touches: radial, so that the equilibrium lies on that line
    way, load = np.array([0.6, -0.8]), 12.0
    case = disc(level=0.0, ring={"offset": [-GAP * 0.6, GAP * 0.8], "sides": 192})
    case["constant_forces"] = [
        {"at": {"row": name}, "force": load * float(x)} for name, x in zip(("y", "z"), way, strict=True)
    ]
    rings = beamsim.run(case)["rings"].sel(ring="ring")
    depth = load / (SHAFT + STIFFNESS)
    position = [rings[f"{each}_position"].values[0] for each in ("first", "second")]
    np.testing.assert_allclose(position, (GAP + depth) * way, atol=0.05 * depth)
    assert rings["force"].values[0] == pytest.approx(STIFFNESS * depth, rel=0.02)


def test_motion_along_an_axis_is_that_of_a_pair_of_stops() -> None:
    case = disc(turn=0.0, ring={"sides": 192, "damping": {"kind": "viscous", "coefficient": 100.0}})
    pair = disc(turn=0.0)
    pair["snubbers"] = [
        {"name": "pair", "at": {"row": "y"}, "side": "both", "gap": GAP, "stiffness": STIFFNESS,
         "damping": {"kind": "viscous", "coefficient": 100.0}}
    ]  # fmt: skip
    ring, stops = beamsim.run(case), beamsim.run(pair)
    ours, theirs = (each["histories"]["displacement"].sel(probe=name).values
                    for each, name in ((ring, ring["histories"].labels("probe")[0]), (stops, "pair")))  # fmt: skip
    assert np.abs(ours - theirs).max() < 0.01 * GAP
    peak = max(stops.summary["peak_force_n"].values())
    assert ring.summary["peak_ring_force_n"]["ring"] == pytest.approx(peak, rel=0.03)


@pytest.mark.parametrize("turn", [0.05, 0.7, 2.9])
def test_rotating_the_axes_changes_nothing_beyond_the_bounds(turn: float) -> None:
    first, second = (beamsim.run(disc(turn=angle, level=14.0)) for angle in (0.0, turn))
    bound = first.summary["rings"]["ring"]["force_error"]
    for entry in ("peak_ring_force_n", "ring_penetration_m"):
        reference = first.summary[entry]["ring"]
        assert second.summary[entry]["ring"] == pytest.approx(reference, rel=2.0 * bound + 0.02)


def test_impacts_are_those_of_the_ring_and_not_of_its_sides() -> None:
    case = disc(turn=0.4, ring={"damping": {"kind": "viscous", "coefficient": 50.0}})
    case["run"]["impacts"] = {}
    result = beamsim.run(case)
    statistics = result["impact_statistics"]
    assert statistics.labels("snubber") == ["ring"]
    of = result["impacts"]
    assert statistics["energy_lost_j"].values[0] > 0.0
    # the energy lost in all impacts is what the energy balance has lost
    assert statistics["energy_lost_j"].values[0] == pytest.approx(
        result["histories"]["energy_dissipated"].values[-1], rel=1e-6
    )
    assert np.all(of["restitution"].values[~of["incomplete"].values] < 1.0)


def test_a_penetration_beyond_the_fitted_range_has_a_warning() -> None:
    deep = beamsim.run(disc(level=80.0))
    assert any("snubbers.ring: the penetration reaches" in text for text in deep.warnings)
    assert not any("penetration reaches" in text for text in beamsim.run(disc(level=14.0)).warnings)


def test_an_elliptical_clearance_acts_at_its_semi_axes() -> None:
    # pushed quasi-statically along each axis, the disc rests at the semi-axis plus the penetration of its load
    for row, semi_axis in (("y", 5e-4), ("z", 3e-4)):
        case = disc(level=0.0, ring={"gap": [5e-4, 3e-4], "sides": 192})
        load = 15.0 + SHAFT * semi_axis
        case["constant_forces"] = [{"at": {"row": row}, "force": load}]
        rings = beamsim.run(case)["rings"].sel(ring="ring")
        place = "first" if row == "y" else "second"
        depth = 15.0 / (SHAFT + STIFFNESS)
        assert rings[f"{place}_position"].values[0] == pytest.approx(semi_axis + depth, abs=0.2 * depth)


@pytest.mark.parametrize(
    "place", [{"node": "tip", "axis": "x"}, {"member": "arm", "position": "100 %", "axis": "local_x"}]
)
def test_a_ring_on_a_frame_is_one_at_its_two_places(place: Case) -> None:
    def pipe(ring: Case) -> Case:
        section = {"section": {"kind": "tube", "outer_diameter": 0.016, "wall_thickness": 1e-3}}
        section |= {"youngs_modulus": 2e11, "density": 7850.0}
        frame = {
            "kind": "frame", "nodes": {"wall": [0, 0, 0], "tip": [1.0, 0, 0]}, "sections": {"tube": section},
            "members": {"arm": {"nodes": ["wall", "tip"]}}, "supports": {"wall": "clamped"},
            "damping": {"kind": "modal", "ratio": 0.02},
        }  # fmt: skip
        return {
            "bodies": {"pipe": frame},
            "snubbers": [{"name": "ring", "kind": "ring", "gap": 2e-4, "stiffness": 1e5, "sides": 24} | ring],
            "probes": [{"name": "tip", "at": {"node": "tip", "direction": "z"}}],
            "constant_forces": [{"at": {"node": "tip", "direction": "y"}, "force": 1.5}],
            "excitation": {"kind": "half_sine", "applied_to": {"node": "tip", "direction": "z"}, "level": 5.0,
                           "duration": 0.01},
            "run": {"duration": 0.03, "sample_rate": 2e3, "convergence": "off"}, "reduction": {"modes": 4},
        }  # fmt: skip

    both = [{"node": "tip", "direction": direction} for direction in "yz"]
    ours, theirs = (beamsim.run(pipe(ring))["rings"].sel(ring="ring") for ring in (place, {"along": both}))
    assert ours["force"].values.max() > 1.0
    for name in ("first_position", "second_position", "force"):
        scale = np.abs(theirs[name].values).max()
        np.testing.assert_allclose(ours[name].values, theirs[name].values, atol=1e-8 * scale)


@pytest.mark.parametrize(
    ("ring", "about", "text"),
    [
        ({"sides": 50}, "sides", "no multiple of 4"),
        ({"along": [{"row": "y"}, {"row": "y"}]}, "along", "one place twice"),
        ({"along": [{"row": "y"}, {"node": 1, "direction": "rx"}]}, "along", "is a rotation"),
        ({"largest_penetration": 1e-2}, "largest_penetration", "more than 5 times the gap"),
        ({"gap": -1e-4}, "gap", "must be positive"),
        ({"side": "both"}, "side", ""),
        ({"node": 1}, "node", "keep along"),
        (
            {"friction": {"coefficient": 0.2, "stiffness": 1e6}, "damping": {"kind": "viscous", "coefficient": 9.0}},
            "friction",
            "does not go with damping",
        ),
        ({"friction": {"coefficient": 0.2, "stiffness": 1e6, "along_axis": True}}, "along_axis", "needs a node"),
    ],
)
def test_refuses_what_is_no_ring(ring: Case, about: str, text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(disc(ring=ring))
    problem = caught.value.problems[0]
    assert about in problem.path
    assert text in str(problem)


def test_refuses_a_point_that_moves_in_one_direction_only() -> None:
    case = disc()
    del case["snubbers"][0]["along"]
    case["snubbers"][0]["row"] = "y"
    with pytest.raises(ScenarioError, match="needs a point that moves in two directions"):
        load_scenario(case)


def test_random_motion_in_a_ring_says_how_far_the_record_reaches() -> None:
    """A test that is longer than its record may press a ring harder than the record does."""
    ring = {"sides": 12, "stiffness": 1e5, "largest_penetration": 0.3e-3}
    noise = [{"frequency": 10.0, "density": "40 N^2/Hz"}, {"frequency": 60.0, "density": "40 N^2/Hz"}]
    result = beamsim.run(
        load_scenario(
            disc(
                ring=ring,
                excitation={"kind": "random", "applied_to": {"row": "y"}, "psd": noise},
                run={"duration": 0.3, "sample_rate": 2e3, "test_duration": 60.0, "convergence": "off"},
            )
        )
    )
    assert result["rings"]["force"].values.max() > 0.0
    assert result.outcome.code == "largest_of_test_unknown"
