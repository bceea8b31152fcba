"""Motions of the beam that repeat after three periods of the shaker: found by a transient, shot, followed, checked.

They lie on a closed curve of their own, apart from the curve of the excitation's period, between two folds.
"""

import itertools

import numpy as np
import pytest
from independent import Beam, Stop, integrate
from shipped import config_path

import beamsim
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits import continuation
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit, linear_guess
from beamsim.orbits.special_points import special_points
from beamsim.system.build import build_system

CONFIG = config_path("one_sided_65hz")
HZ = 60.0


@pytest.fixture(scope="module")
def orbits():
    scenario = beamsim.load_scenario(CONFIG, {"excitation.frequency": 400.0})
    system = build_system(scenario.model_copy(update={"run": None}))
    loads = PeriodicForcing.harmonic(system.forcing.load[0])
    flow = VariationalFlow(system.dynamics, loads, 2 * np.pi * HZ, scenario.excitation.level)
    return ForcedOrbits(flow, multiple=3)


@pytest.fixture(scope="module")
def found(orbits):
    """Newton's method from the end of a transient of 150 periods."""
    z = linear_guess(orbits.flow)
    for _ in range(150):
        z = orbits.flow.flow_map(z, 2 * np.pi / orbits.omega).end
    return find_orbit(orbits, z)


@pytest.fixture(scope="module")
def ring(orbits, found):
    branch = Branch(orbits, found, 2 * np.pi * 40, 2 * np.pi * 90)
    points = list(branch)
    return branch, points, [s for a, b in itertools.pairwise(points) for s in special_points(BranchStep(orbits, a, b))]


def after_one_period(orbits, point):
    """How far the motion is from itself a third of its period later, against its size."""
    z = point.u[:-1]
    once = orbits.flow_at(point.parameter)[0].flow_map(z, 2 * np.pi / point.parameter).end
    return np.linalg.norm((once - z)[: orbits.flow.system.size]) / orbits.scale(point.u)[0][0]


def test_it_is_a_motion_of_three_periods(orbits, found):
    orbit = orbits.orbit(found)
    assert orbit.stable
    assert orbit.residual < 1e-11
    assert after_one_period(orbits, found) > 0.1
    single = find_orbit(ForcedOrbits(orbits.flow))
    assert not ForcedOrbits(orbits.flow).orbit(single).stable


def test_independent_integration_comes_back(orbits, found):
    """The beam of the scenario, assembled and stepped over the three periods by a code of its own."""
    beam = Beam(0.27, 0.05, 0.005, 69e9, 2700.0, 20, "clamped", [(x, 4.2e-3) for x in (0.135, 0.2025, 0.27)])
    structure, shapes = beam.reduced(6, [0.27], 0.01)
    stop = Stop(beam.row(0.27) @ shapes, 151.1e3).with_damping_ratio(structure, 0.02)
    orbit, level = orbits.orbit(found), 2 * 9.80665
    n = len(shapes.T)
    # the two codes may count a coordinate positive where the other counts it negative
    sign = np.tile(np.sign(stop.row * orbits.flow.system.contacts.shape[0]), 2)
    np.testing.assert_allclose(np.abs(stop.row), np.abs(orbits.flow.system.contacts.shape[0]), rtol=1e-6)
    start = sign * orbit.state[: 2 * n]
    end = integrate(
        structure, [stop], lambda t: -structure.inertia * level * np.sin(2 * np.pi * HZ * t), start,
        np.array([orbit.period]), most_step=1e-3, rtol=1e-9,
    ).state[-1]  # fmt: skip
    size = np.repeat([1.0, orbit.parameter], n) * np.linalg.norm(start[:n])
    np.testing.assert_allclose(end / size, start / size, atol=1e-6)


def test_curve_is_closed_and_the_same_both_ways(orbits, found, ring):
    branch, points, special = ring
    assert branch.outcome.code == "closed_curve"
    assert points[-1] is points[0]
    assert max(p.residual for p in points) < 1e-11
    # an isolated curve: it comes near the motions of a single period (multipliers close to the cube roots of one
    # there) but never meets them
    away = [after_one_period(orbits, p) for p in points]
    assert 1e-3 < min(away) < 0.01
    nearest = points[int(np.argmin(away))]
    single = ForcedOrbits(orbits.flow)
    mu = single.multipliers(solve_at(single, nearest.u, Settings(iterations=20), nearest.parameter))
    assert np.min(np.abs(np.abs(np.angle(mu)) / (2 * np.pi) - 1 / 3)) < 0.01
    back = solve_at(orbits, found.u, Settings(), found.parameter, -float(np.sign(found.tangent[-1])))
    other = list(Branch(orbits, back, 2 * np.pi * 40, 2 * np.pi * 90))
    again = [s for a, b in itertools.pairwise(other) for s in special_points(BranchStep(orbits, a, b))]
    folds, folds_again = (sorted(s.parameter for s in x if s.kind == "fold") for x in (special, again))
    np.testing.assert_allclose(folds, folds_again, rtol=1e-8)
    assert sorted(s.kind for s in special) == sorted(s.kind for s in again)


def test_folds_bound_the_motion(orbits, ring):
    """Multiplier one at each; the transient keeps to the motion before the last fold, and leaves it beyond."""
    _, points, special = ring
    folds = [s for s in special if s.kind == "fold"]
    for s in folds:
        assert np.min(np.abs(orbits.multipliers(s.point) - 1.0)) < 1e-5
    last = max(folds, key=lambda s: s.parameter)
    assert last.parameter >= max(p.parameter for p in points)
    stable = [p for p in points if orbits.orbit(p).stable]
    near = max(stable, key=lambda p: p.parameter)
    n = orbits.flow.system.size

    def settled(omega, z):
        """Distance between the states 300 and 303 periods later, against the motion."""
        orbits.flow = orbits.flow.with_loads(omega)
        ends = []
        for _ in range(2):
            periods = 300 if not ends else 3
            z = simulate(orbits.flow.exact, z, duration=2 * np.pi / omega * periods).final_y
            ends.append(z)
        return ends[0], np.linalg.norm((ends[1] - ends[0])[:n]) / orbits.scale(near.u)[0][0]

    start = near.u[:-1][: 2 * n]
    kept, change = settled(near.parameter, start * (1 + 1e-4))
    assert change < 1e-6
    assert np.linalg.norm((kept - start)[:n]) < 1e-5 * orbits.scale(near.u)[0][0]
    _, change = settled(last.parameter * 1.002, start)
    assert change > 1e-2


def test_steps_do_not_land_on_another_branch(orbits, found, monkeypatch):
    """Round the curve twice, past the place where it nearly meets the motions of a single period; the twin: without the
    check of the chord the branch goes over to them there."""
    monkeypatch.setattr(continuation, "_passes", lambda a, b, start: False)

    def on_another_branch():
        points = Branch(orbits, found, 2 * np.pi * 40, 2 * np.pi * 90, Settings(most_points=300))
        return sum(after_one_period(orbits, p) < 1e-6 for p in points)

    assert on_another_branch() == 0
    monkeypatch.setattr(continuation, "MOST_OFF_PLANE", np.inf)
    assert on_another_branch() > 10
