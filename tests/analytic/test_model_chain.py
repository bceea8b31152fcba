"""Chains of lumped masses against closed forms and published periods."""

import numpy as np
import pytest

from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.scenario import Scenario
from beamsim.structures.chain import floating_groups
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

RUN = {"duration": 10.0, "sample_rate": 10.0, "start": "rest"}


def system(chain, **more):
    return build_system(Scenario.model_validate({"chain": chain, "run": RUN, **more}))


def test_linear_periods_of_six_masses_between_walls():
    s = system({"masses": [1] * 6, "springs": [1] * 7})
    periods = 1 / s.modes["open_frequencies_hz"].values
    np.testing.assert_allclose(periods, [14.118, 7.2406, 5.0387, 4.0182, 3.4869, 3.2224], rtol=2e-5)
    exact = 2 * np.sin(np.arange(1, 7) * np.pi / 14)
    np.testing.assert_allclose(2 * np.pi * s.modes["open_frequencies_hz"].values, exact, rtol=1e-14)


def test_free_last_mass():
    # Fixed-free chain of n: 2 sin((2 j - 1) pi / (2 (2 n + 1))).
    s = system({"masses": [1] * 4, "springs": [1] * 4})
    exact = 2 * np.sin((2 * np.arange(1, 5) - 1) * np.pi / 18)
    np.testing.assert_allclose(2 * np.pi * s.modes["open_frequencies_hz"].values, exact, rtol=1e-14)
    assert s.probes[-1].position == 4.0


def test_floating_chain_has_an_exact_zero():
    s = system({"masses": [1, 3], "springs": [0, 2]})
    assert s.dynamics.stiffness[0] == 0.0
    assert s.dynamics.stiffness[1] == pytest.approx(2 * (1 + 1 / 3), rel=1e-14)
    assert np.isnan(s.modes["damping_ratios"].values[0])


def test_a_very_soft_wall_spring_is_no_rigid_body():
    s = system({"masses": [1, 1, 1], "springs": [1e-12, 1, 1]})
    assert s.dynamics.stiffness[0] == pytest.approx(1e-12 / 3, rel=1e-6)


@pytest.mark.parametrize(
    ("springs", "grounded", "expected"),
    [
        ([1, 1, 1], [], []),
        ([0, 1, 1], [], [[0, 1, 2]]),
        ([0, 1, 1], [1], []),
        ([0, 0, 0], [], [[0], [1], [2]]),
        ([0, 1, 0, 1], [], [[0, 1]]),
        ([0, 1, 0, 0], [2], [[0, 1]]),
    ],
)
def test_floating_groups(springs, grounded, expected):
    ends = [(i - 1, i) for i, k in enumerate(springs) if k] + [(None, mass) for mass in grounded]
    rows = np.zeros((len(ends), 3))
    for row, (a, b) in zip(rows, ends, strict=True):
        for mass, sign in ((a, -1.0), (b, 1.0)):
            if mass in (0, 1, 2):
                row[mass] = sign
    assert [group.tolist() for group in floating_groups(rows)] == expected


def test_dashpots_project():
    chain = {"masses": [1, 2], "springs": [3, 4, 5], "dashpots": [0.1, 0.2, 0.3]}
    s = system(chain, probes=[{"name": "a", "mass": 1}, {"name": "b", "mass": 2}])
    shape = np.array([p.shape for p in s.probes])  # u = shape q
    physical = np.linalg.inv(shape).T @ s.dynamics.damping @ np.linalg.inv(shape)
    np.testing.assert_allclose(physical, [[0.3, -0.2], [-0.2, 0.5]], atol=1e-14)
    stiffness = np.linalg.inv(shape).T @ np.diag(s.dynamics.stiffness) @ np.linalg.inv(shape)
    np.testing.assert_allclose(stiffness, [[7, -4], [-4, 9]], atol=1e-13)
    np.testing.assert_allclose(np.linalg.inv(shape @ shape.T), np.diag([1.0, 2.0]), atol=1e-14)


def test_modal_damping_adds_to_dashpots():
    chain = {"masses": [1], "springs": [4], "dashpots": [0.1], "damping": {"kind": "modal", "ratio": 0.05}}
    s = system(chain)
    assert s.dynamics.damping[0, 0] == pytest.approx(0.1 + 2 * 0.05 * 2)
    assert s.modes["damping_ratios"].values[0] == pytest.approx((0.1 + 0.2) / 4)


def test_moving_walls_push_relative_coordinates_with_the_inertia():
    motion = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 0.1}
    probes = [{"name": "a", "mass": 1}, {"name": "b", "mass": 2}]
    s = system({"masses": [1, 3], "springs": [1, 1, 1]}, excitation=motion, probes=probes)
    shape = np.array([p.shape for p in s.probes])
    np.testing.assert_allclose(np.linalg.solve(shape.T, s.forcing.load[0]), [-1.0, -3.0], atol=1e-14)
    assert len(s.forcing.signal) == 1


def test_ground_stands_still_when_the_walls_move():
    """A mass on a ground spring alone (its wall spring vanishes): in absolute terms it is never pushed."""
    motion = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 0.1}
    chain = {"masses": [2], "springs": [0], "springs_to_ground": [{"mass": 1, "kind": "linear", "stiffness": 5.0}]}
    s = system(chain, excitation=motion)
    # Relative q = -shape^-1 d keeps the absolute displacement at zero: q'' + K q = loads must hold along it.
    t = np.linspace(0, 20, 50)
    q = -s.base[0].displacement(t) / s.probes[0].shape[0]
    acceleration = -s.base[0].acceleration(t) / s.probes[0].shape[0]
    loads = sum(row[0] * signal(t) for row, signal in zip(s.forcing.load, s.forcing.signal, strict=True))
    np.testing.assert_allclose(acceleration + s.dynamics.stiffness[0] * q, loads, atol=1e-13)


def test_cubic_springs_are_reported_and_hold_static_loads():
    chain = {"masses": [2], "springs": [3], "springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": 7.0}]}
    s = system(chain, constant_forces=[{"mass": 1, "force": 10.0}])
    assert s.cubic.count == 1
    assert s.cubic.stiffness[0] == 7.0
    assert s.dynamics.stiffness[0] == pytest.approx(1.5)
    w = s.cubic.shape[0] @ s.static_equilibrium
    assert w == pytest.approx(1.0, rel=1e-10)  # 3 w + 7 w^3 = 10


def test_gravity_and_stop_on_a_mass():
    chain = {"masses": [2], "springs": [0], "snubbers": [{"mass": 1, "side": "below", "stiffness": 50, "gap": 0.1}]}
    s = system(chain, gravity=10.0)
    assert s.snubbers[0].preload == pytest.approx(20.0)
    assert s.snubbers[0].shape @ s.static_equilibrium == pytest.approx(-0.1 - 20 / 50)
    assert s.snubbers[0].position == 1.0
    assert s.snubbers[0].stiffness_ratio == np.inf
    assert s.stress is None
    np.testing.assert_array_equal(s.stations.position, [1.0])


def test_masses_that_a_dashpot_alone_joins_fall_and_come_to_one_speed():
    """Neither has a frequency: the middle falls freely, and the difference of the speeds decays."""
    m, c, g, time = np.array([1.0, 0.5]), 0.2, 9.81, 3.0
    x, v = np.array([0.3, -0.2]), np.array([1.0, -2.0])
    chain = {"masses": list(m), "springs": [0.0, 0.0], "dashpots": [0.0, c]}
    run = {"duration": time, "start": {"displacement": list(x), "velocity": list(v)}}
    probes = [{"name": f"m{k}", "mass": k} for k in (1, 2)]
    case = {"chain": chain, "gravity": g, "probes": probes, "run": run}
    built = build_system(Scenario.model_validate(case))
    motion = simulate(exact_flow(built, time), built.initial_state)
    rate, share = c * (1.0 / m).sum(), m / m.sum()
    middle, speed = share @ x + share @ v * time - 0.5 * g * time**2, share @ v - g * time
    apart = np.diff(x)[0] - np.diff(v)[0] * np.expm1(-rate * time) / rate
    parting = np.diff(v)[0] * np.exp(-rate * time)
    of_apart = np.array([-share[1], share[0]])
    shapes = np.array([probe.shape for probe in built.probes])
    q, rates = np.split(motion.final_y[: 2 * built.dynamics.size], 2)
    np.testing.assert_allclose(shapes @ q, middle + of_apart * apart, rtol=1e-12)
    np.testing.assert_allclose(shapes @ rates, speed + of_apart * parting, rtol=1e-12)
