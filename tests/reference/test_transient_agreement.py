"""The shipped cases against an independent code with DOP853 restarted at every contact, to 1e-9 of the peak."""

import numpy as np
from independent import Beam, Stop, chain, integrate, static_equilibrium
from sampling import first_apart
from shipped import config_path

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

TWO_SNUBBERS = [
    {"name": "below", "position": "200 mm", "side": "below", "stiffness": 2e4, "gap": "0.05 mm",
     "damping": {"kind": "ratio", "ratio": 0.02}, "mounted_on": "ground"},
    {"name": "above", "position": "270 mm", "side": "above", "stiffness": 5e4, "gap": "-0.02 mm",
     "damping": {"kind": "viscous", "coefficient": 5.0}, "law": "no_tension"},
]  # fmt: skip
CASES = {
    "one-sided": ("one_sided_65hz", {"reduction.modes": 4}, 0.03),
    "prestressed": ("prestressed_90hz_3g", {"reduction.modes": 4}, 0.03),
    "backlash": ("backlash_65hz_3g", {"reduction.modes": 4}, 0.03),
    "two snubbers": ("one_sided_65hz", {"reduction.modes": 3, "snubbers": TWO_SNUBBERS}, 0.03),
    "rigid body": ("released_panel", {"reduction.modes": 4}, 0.05),
    "chain": ("chain_two_dof", {"excitation.level": 0.5, "run.start": "rest"}, 60.0),
}
# Coarse meshes keep the round-off of a mesh's stiffness matrix, which is not what is compared here, below 1e-10.
COARSE = {"beam.elements": 4}
G = 9.80665


def shaken_beam(case, modes=4, stiffness=151.1e3):
    """The rig, in its own coordinates: structure, stops, rows of the probes, level (m/s^2), frequency (Hz)."""
    masses = [(x, 4.2e-3) for x in (0.135, 0.2025, 0.27)]
    beam = Beam(0.27, 0.05, 0.005, 69e9, 2700.0, 4, "clamped", masses)
    if case == "two snubbers":
        structure, shapes = beam.reduced(3, [0.2, 0.27], 0.01)
        stops = [
            Stop(beam.row(0.2) @ shapes, 2e4, gap=5e-5, on_ground=True).with_damping_ratio(structure, 0.02),
            Stop(beam.row(0.27) @ shapes, 5e4, 5.0, gap=-2e-5, side=-1.0, no_tension=True),
        ]
    else:
        structure, shapes = beam.reduced(modes, [0.27], 0.01)
        gap = {"one-sided": 0.0, "prestressed": -2e-4, "backlash": 5e-4}[case]
        stops = [Stop(beam.row(0.27) @ shapes, stiffness, gap=gap).with_damping_ratio(structure, 0.02)]
    level, hz = {"prestressed": (3 * G, 90.0), "backlash": (3 * G, 65.0)}.get(case, (2 * G, 65.0))
    return structure, stops, [beam.row(x) @ shapes for x in (0.27, 0.135)], level, hz


def independent_motion(case, times, **changes):
    """Displacement and velocity of the probes by the code of `independent`, and the events."""
    step = times[-1] / 100
    if case == "chain":
        structure = chain([1.0, 1.0], [0.0, 1.0, 1.0], [0.0, 0.03, 0.03])
        stops, rows, start = [Stop(np.array([1.0, 0.0]), 100.0, gap=1.0, side=-1.0)], np.eye(2), np.zeros(4)
        motion = integrate(
            structure, stops, lambda t: np.array([0.0, 0.5 * np.sin(0.8 * t)]), start, times, most_step=step
        )
    elif case == "rigid body":
        beam = Beam(1.0, 0.02, 0.02, 70e9, 2700.0, 4, "pinned")
        structure, shapes = beam.reduced(4, [1.0], 0.01, rigid=1)
        turning = np.array([0.0 if i % 2 else -2.0 * (i // 2) / 4 for i in range(10)]) + np.tile([0.0, -2.0], 5)
        start = np.append(np.zeros(shapes.shape[1]), shapes.T @ beam.M @ turning[1:])
        rows = [beam.row(1.0) @ shapes]
        stops = [Stop(rows[0], 20e3, gap=1e-3, on_ground=True)]
        motion = integrate(structure, stops, lambda t: 0.0, start, times, most_step=step, atol=1e-16)
    else:
        structure, stops, rows, level, hz = shaken_beam(case, **changes)
        omega = 2 * np.pi * hz
        rest = static_equilibrium(structure, stops)
        motion = integrate(
            structure, stops, lambda t: -structure.inertia * level * np.sin(omega * t),
            np.append(rest, np.zeros(rest.size)), times, most_step=step, atol=1e-16,
            base=lambda t: (-level / omega**2 * np.sin(omega * t), -level / omega * np.cos(omega * t)),
        )  # fmt: skip
    n = motion.state.shape[1] // 2
    return [motion.state[:, part] @ np.transpose(rows) for part in (slice(0, n), slice(n, 2 * n))], motion


def exact_motion(case, times):
    name, overrides, duration = CASES[case]
    scenario = beamsim.load_scenario(config_path(name), overrides if case == "chain" else overrides | COARSE)
    system = build_system(scenario)
    trajectory = simulate(exact_flow(system, duration), system.initial_state)
    shape, state, n = np.array([p.shape for p in system.probes]), trajectory.states_at(times), system.dynamics.size
    return [state[:, part] @ shape.T for part in (slice(0, n), slice(n, 2 * n))], trajectory


def differences(a, b):
    return [np.abs(x - y).max() / np.abs(y).max() for x, y in zip(a, b, strict=True)]


@first_apart("case", 3, CASES)
def test_transient(case):
    """From the scenario to the motion: nothing of the package takes part in what is expected."""
    times = np.linspace(0.0, CASES[case][2], 301)
    found, trajectory = exact_motion(case, times)
    expected, motion = independent_motion(case, times)
    assert motion.event_time.size > 0
    later = trajectory.event_time > 0.0  # what begins at the start is no event of the other code
    np.testing.assert_array_equal(trajectory.event_contact[later], motion.event_stop)
    np.testing.assert_array_equal((trajectory.touch_changes > 0)[later], motion.event_closing)
    assert max(differences(found, expected)) < 1e-9


def test_the_comparison_can_fail():
    """One part in ten million of the snubber's stiffness, or a mode less, is seen."""
    times = np.linspace(0.0, 0.02, 301)
    found, _ = exact_motion("one-sided", times)
    for change in ({"stiffness": 151.1e3 * (1 + 1e-7)}, {"modes": 3}):
        expected, _ = independent_motion("one-sided", times, **change)
        assert max(differences(found, expected)) > 1e-9
