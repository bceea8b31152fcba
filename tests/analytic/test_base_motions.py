"""Several motions of the base at once: a rigid body on springs whose base moves along and about all axes."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse import csc_array

import beamsim
from beamsim.errors import ScenarioError
from beamsim.matrix_files import write_matrices
from beamsim.scenario import load_scenario
from beamsim.structures.named_matrices import DofTable, write_dof_table

AXES = ("x", "y", "z", "rx", "ry", "rz")
MASS = np.array([2.0, 2.0, 2.0, 0.02, 0.03, 0.04])  # kg, kg m^2
HZ = np.array([31.0, 37.0, 29.0, 47.0, 41.0, 53.0])  # natural frequencies, one for each axis
STIFFNESS, ZETA = MASS * (2 * np.pi * HZ) ** 2, 0.03
PLACE, ABOUT = np.array([0.3, 0.1, 0.2]), np.array([0.05, -0.02, 0.1])
LEVEL = np.array([9.0, 7.0, 8.0, 60.0, 50.0, 40.0])  # m/s^2, rad/s^2
TONE, PHASE = np.array([21.0, 33.0, 26.0, 44.0, 39.0, 17.0]), np.array([0.3, 1.1, -0.4, 2.0, 0.0, 0.7])
SECONDS = 0.2


def rigid(at):
    """(6, 6) motion of a node for a unit of each motion of the base, about a point at ``at`` from it."""
    x, y, z = at
    moved = np.eye(6)
    moved[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    return moved


MOVED = rigid(PLACE - ABOUT)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Scenarios of the body, which springs at its centre join to a base node at the origin."""
    folder = tmp_path_factory.mktemp("rigid")
    apart = np.hstack([-rigid(PLACE), np.eye(6)])
    table = DofTable(tuple((node, axis) for node in (1, 2) for axis in AXES), np.repeat([[0, 0, 0], PLACE], 6, axis=0))
    mass = np.diag(np.concatenate([np.full(6, 1e-3), MASS]))
    write_matrices(folder / "m.op4", {"m": csc_array(mass), "k": csc_array(apart.T @ np.diag(STIFFNESS) @ apart)})
    write_dof_table(folder / "dofs.csv", table)

    def scenario(forces, **more):
        excitation = forces if isinstance(forces, dict) else {"kind": "forces", "forces": forces}
        (folder / "case.yaml").write_text(json.dumps({
            "bodies": {"unit": {
                "kind": "matrices", "mass": {"file": "m.op4", "name": "m"}, "stiffness": {"file": "m.op4", "name": "k"},
                "dofs": "dofs.csv", "base": {"nodes": [1]}, "damping": {"kind": "modal", "ratio": ZETA},
            }},
            "excitation": excitation, "reduction": {"modes": "all"},
            "probes": [{"name": axis, "at": {"node": 2, "direction": axis}} for axis in AXES[:3]],
            "run": {"duration": SECONDS, "sample_rate": 2000, "start": "rest", "convergence": "off"}, **more,
        }))  # fmt: skip
        return load_scenario(folder / "case.yaml")

    return scenario


def sine(k, **more):
    turning = {"about": ABOUT.tolist()} if k > 2 else {}
    return {"kind": "harmonic", "applied_to": "base", "direction": AXES[k], "level": LEVEL[k], "frequency": TONE[k],
            "phase": PHASE[k], **turning, **more}  # fmt: skip


SINES = [sine(k) for k in range(6)]


def base_at(t, order):
    """(6, ...) displacements (order 0), velocities or accelerations of the base."""
    w = (2 * np.pi * TONE)[:, None]
    return (-LEVEL[:, None] / w**2 * w**order * np.sin(w * t + PHASE[:, None] + order * np.pi / 2)).reshape(
        6, *np.shape(t)
    )


def response_in_closed_form(t):
    """(6, nt) displacement relative to the base: of each axis an oscillator under six sines, from rest."""
    w0 = (2 * np.pi * HZ)[:, None]
    damped, found = w0 * np.sqrt(1 - ZETA**2), np.zeros((6, t.size))
    for k in range(6):
        w = 2 * np.pi * TONE[k]
        steady = -MOVED[:, k, None] * LEVEL[k] * np.exp(1j * PHASE[k]) / (w0**2 - w**2 + 2j * ZETA * w0 * w)
        x, v = -steady.imag, -(1j * w * steady).imag
        decay = np.exp(-ZETA * w0 * t) * (x * np.cos(damped * t) + (v + ZETA * w0 * x) / damped * np.sin(damped * t))
        found += (steady * np.exp(1j * w * t)).imag + decay
    return found


def of_probes(result, name):
    return np.array([result["histories"][name].sel(probe=axis).values for axis in AXES[:3]])


def test_a_rigid_body_under_six_motions_of_its_base(case):
    """Relative and absolute motion in closed form, and each motion of the base under its name."""
    result = beamsim.run(case(SINES))
    t, histories = result["histories"]["time"].values, result["histories"]
    expected = response_in_closed_form(t)[:3]
    found = of_probes(result, "displacement")
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    absolute = expected + (MOVED @ base_at(t, 0))[:3]
    np.testing.assert_allclose(
        of_probes(result, "absolute_displacement"), absolute, rtol=0, atol=1e-9 * np.abs(absolute).max()
    )
    assert histories.labels("base_motion") == list(AXES)
    np.testing.assert_allclose(histories["base_acceleration"].values, base_at(t, 2), atol=1e-10 * LEVEL.max())
    assert [histories["base_displacement"].sel(base_motion=axis).unit for axis in ("x", "rx")] == ["m", "rad"]
    assert result.summary["energy_error"] < 1e-10


def test_linear_motions_add_up(case):
    """Sines, noise, a pulse and a swept sine along and about several axes: accelerations, reactions and outputs."""
    outputs = [{"name": "foot", "kind": "reaction_force", "support": "base"},
               {"name": "turn", "kind": "reaction_moment", "support": "base", "direction": "rx"},
               {"name": "a", "kind": "acceleration", "at": {"node": 2, "direction": "y"}}]  # fmt: skip
    psd = [{"frequency": 20, "density": 0.5}, {"frequency": 200, "density": 0.5}]
    parts = [
        SINES[0], sine(4),
        {"kind": "random", "applied_to": "base", "direction": "y", "psd": psd, "period": 2.0,
         "seed": 3},
        {"kind": "half_sine", "applied_to": "base", "direction": "x", "level": 30.0, "duration": 0.011, "time": 0.02},
        {"kind": "swept_sine", "applied_to": "base", "direction": "z", "level": 3.0, "from": 20, "to": 60,
         "rate": "90 Hz/s"},
        {"kind": "harmonic", "applied_to": {"node": 2, "direction": "z"}, "level": 3.0, "frequency": 30.0},
    ]  # fmt: skip
    runs = [beamsim.run(case(each, outputs=outputs)) for each in (parts, *parts)]
    for name in ("displacement", "absolute_acceleration", "output_value"):
        together, *alone = (run["histories"][name].values for run in runs)
        size = np.abs(together).max(axis=1, keepdims=True)
        np.testing.assert_allclose(sum(alone) / size, together / size, rtol=0, atol=1e-9, err_msg=name)


GROUND = {"stiffness": 4e5, "mounted_on": "ground"}
STOPS = [
    {"name": "below", "at": {"node": 2, "direction": "z"}, "side": "below", "gap": 1e-4, **GROUND},
    {"name": "right", "at": {"node": 2, "direction": "x"}, "side": "above", "gap": 5e-5, **GROUND},
    {"name": "back", "at": {"node": 2, "direction": "y"}, "side": "below", "gap": 1e-4, **GROUND, "mounted_on": "base"},
]
ROWS, SIDES, GAPS = [2, 0, 1], np.array([-1.0, 1.0, -1.0]), np.array([1e-4, 5e-5, 1e-4])
ON_GROUND = np.array([1.0, 1.0, 0.0])


def depth(t, u):
    """(3,) penetrations of the stops at relative displacements (6,)."""
    return SIDES * (u[ROWS] + ON_GROUND * (MOVED @ base_at(t, 0))[ROWS]) - GAPS


def integrated(times):
    """(6, nt) motion with the stops, whose springs have no dashpots, by DOP853."""
    inertia, c = MASS[:, None] * MOVED, 2 * ZETA * MASS * 2 * np.pi * HZ

    def rates(t, y):
        u, v = np.split(y, 2)
        force = -inertia @ base_at(t, 2) - c * v - STIFFNESS * u
        force[ROWS] -= SIDES * GROUND["stiffness"] * np.maximum(depth(t, u), 0.0)
        return np.concatenate([v, force / MASS])

    settings = {"rtol": 1e-13, "atol": 1e-17, "max_step": 4e-4}  # small steps across the kinks of the forces
    return solve_ivp(rates, times[[0, -1]], np.zeros(12), "DOP853", times, **settings).y[:6]


def test_stops_on_the_ground_under_six_motions_against_an_independent_integration(case):
    result = beamsim.run(case(SINES, snubbers=STOPS))
    expected = integrated(result["histories"]["time"].values)
    assert all(count > 2 for count in result.summary["contacts"].values())
    found = of_probes(result, "displacement")
    np.testing.assert_allclose(found, expected[:3], rtol=0, atol=1e-8 * np.abs(expected[:3]).max())
    assert result.summary["energy_error"] < 1e-9
    free = response_in_closed_form(result["histories"]["time"].values)[:3]
    assert np.abs(free - expected[:3]).max() > 0.05 * np.abs(free).max()  # the twin: without stops it differs


def test_one_frequency_in_several_axes_works_wherever_a_sine_does(case):
    """Stepped sweep, continuation by both methods: the same motion with a stop on the ground as a long run."""
    phased = [sine(k, frequency=24.0, level=float(0.5 * LEVEL[k])) for k in (0, 2, 4)]
    stops = {"snubbers": STOPS[:1], "run": None, "gravity": 0.0}
    sweep = {"kind": "stepped", "from": 24.0, "to": 25.0, "points": 2, "direction": "up", "convergence": "off"}
    stepped = beamsim.sweep(case(phased, **stops, sweep=sweep))
    peaks = [stepped["cycles"]["max_displacement"].sel(probe="z").values[0]]
    follow = {"kind": "continuation", "from": 23.9, "to": 24.1, "points_at": [24.0], "side_branches": "none"}
    for method in ({"kind": "shooting"}, {"kind": "harmonic_balance", "harmonics": 24}):
        branch = beamsim.continuation(case(phased, **stops, sweep={**follow, "method": method})).branches[0]
        at = int(np.argmin(np.abs(branch["frequency_hz"].values - 24.0)))
        peaks.append(branch["max_displacement"].sel(probe="z").values[at])
    run = {"duration": 4.0, "sample_rate": 2000, "start": "rest", "convergence": "off"}
    motion = beamsim.run(case(phased, **{**stops, "run": run}))["histories"]
    assert motion["snubber_force"].values[:, -500:].max() > 1.0
    largest = motion["displacement"].sel(probe="z").values[-500:].max()
    assert peaks == pytest.approx([largest] * len(peaks), rel=2e-4)


@pytest.mark.parametrize(
    ("second", "sweep", "words"),
    [
        (sine(0, frequency=24.0, phase=0.5), {"kind": "swept_sine"}, "forces[1].phase = 0.5 rad is neither 0 nor 180"),
        (sine(0, frequency=24.0, level="1 mm", phase=0), {"kind": "swept_sine"}, "forces[1].level is a displacement"),
        (sine(0, frequency=25.0), {"kind": "stepped"}, "forces[1].frequency = 25 Hz, and another force has 24 Hz"),
        (
            {"kind": "step", "applied_to": "base", "direction": "x", "level": 1.0},
            {"kind": "stepped"},
            "has no frequency",
        ),
    ],
)
def test_sweeps_refuse_what_they_cannot_follow(case, second, sweep, words):
    more = {"rate": "1 oct/min"} if sweep["kind"] == "swept_sine" else {}
    with pytest.raises(ScenarioError) as refused:
        case([sine(2, frequency=24.0, phase=0), second], run=None, sweep={**sweep, "from": 20, "to": 30, **more})
    assert words in str(refused.value)


PHASORS = 0.004 * np.array([1.0, 0.5 * np.exp(0.7j)])
CHAIN = {
    "chain": {"masses": [2.0], "springs": [800.0], "dashpots": [8.0]},
    "springs_to_ground": [{"kind": "cubic", "stiffness": 4e6, "name": "c", "at": {"mass": 1}}],
    "snubbers": [{"name": "s", "mass": 1, "side": "above", "gap": 1e-4, "stiffness": 3e3, "mounted_on": "ground"}],
    "probes": [{"name": "p", "mass": 1}],
}  # fmt: skip


def shaken(phasors, **more):
    sine = {"kind": "harmonic", "applied_to": "base", "quantity": "displacement", "frequency": 2.0}
    forces = [{**sine, "level": float(abs(of)), "phase": float(np.angle(of))} for of in phasors]
    return load_scenario({**CHAIN, "excitation": {"kind": "forces", "forces": forces}, **more})


@pytest.mark.parametrize("method", [{"kind": "shooting"}, {"kind": "harmonic_balance", "harmonics": 9}])
def test_two_sines_in_one_direction_are_one_with_the_sum_of_their_phasors(method):
    """A branch with a cubic spring and a stop on the ground, and its energy balance."""
    sweep = {"kind": "continuation", "from": 1.98, "to": 2.02, "side_branches": "none", "method": method}
    two, one = (
        beamsim.continuation(shaken(of, sweep=sweep | {"convergence": "off"})).branches[0]
        for of in (PHASORS, [PHASORS.sum()])
    )
    assert two["max_force"].values.min() > 0.1
    for name in ("max_displacement", "max_force"):
        ends = (branch[name].values[0][[0, -1]] for branch in (two, one))
        np.testing.assert_allclose(*ends, rtol=1e-8)
    assert two["energy_error"].values.max() < 1e-9


def test_a_cubic_spring_on_the_ground_is_stepped_under_two_motions_of_the_base():
    """The same property of time stepping, which the exact motion has no part in."""
    run = {"duration": 0.4, "sample_rate": 500, "start": "rest", "convergence": "off", "method": "reference"}
    two, one = (beamsim.run(shaken(of, run=run)) for of in (PHASORS, [PHASORS.sum()]))
    found, expected = (of["histories"]["absolute_displacement"].values for of in (two, one))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    assert two.summary["energy_error"] < 1e-7
