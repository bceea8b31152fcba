"""Reactions under a turning base, and the force and moment of the whole base."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.scenario import load_scenario
from tests.helpers.independent import Beam

L, W, H, E, RHO, BETA, HZ = 0.9, 0.03, 0.004, 70e9, 2700.0, 1e-3, 11.0
BEAM = {"length": L, "width": W, "thickness": H, "youngs_modulus": E, "density": RHO, "elements": 6,
        "damping": {"kind": "rayleigh", "stiffness": BETA}}  # fmt: skip
ABOUT = 0.25
OUTPUTS = [
    {"name": "force", "kind": "reaction_force", "support": "left"},
    {"name": "moment", "kind": "reaction_moment", "support": "left"},
    {"name": "prop", "kind": "reaction_force", "support": "right"},
    {"name": "base_force", "kind": "reaction_force", "support": "base"},
    {"name": "base_moment", "kind": "reaction_moment", "support": "base", "about": ABOUT},
]
TURN = {"kind": "harmonic", "applied_to": "base", "direction": "ry", "about": "100 mm", "level": 20.0, "frequency": HZ}


@pytest.mark.parametrize("joined", [False, True])
def test_a_turning_base_against_independent_matrices(joined):
    """A propped cantilever, as one beam and as two that are joined rigidly at 0.45 m: amplitudes of all reactions."""
    sweep = {"kind": "stepped", "from": HZ, "to": HZ + 1, "points": 2, "steady_to": 1e-11}
    outputs = [{**each, "body": "a" if each["support"] == "left" else "b"} if joined and each["support"] != "base"
               else each for each in OUTPUTS]  # fmt: skip
    half = {**BEAM, "kind": "beam", "length": L / 2, "elements": 3}
    structure = (
        {"bodies": {"a": {**half, "supports": {"left": "clamped"}},
                    "b": {**half, "supports": {"left": "free", "right": "pinned"}}},
         "joints": [{"name": "weld", "kind": "rigid",
                     "between": [{"body": "a", "position": L / 2}, {"body": "b", "position": 0}]}]}
        if joined
        else {"beam": {**BEAM, "supports": {"left": "clamped", "right": "pinned"}}}
    )  # fmt: skip
    scenario = load_scenario({**structure, "excitation": TURN, "sweep": sweep, "outputs": outputs,
                              "reduction": {"modes": "all"}})  # fmt: skip
    curve = sweep_alone(scenario).curves["up_0"]
    k = list(curve.orders).index(1.0)
    first = {name: 1j * curve.channel("output", name).harmonics[k, 0] for name in curve.places("output")}

    whole, w = Beam(L, W, H, E, RHO, 6, "free"), 2 * np.pi * HZ
    x = np.linspace(0, L, 7)
    turned = np.column_stack([0.1 - x, -np.ones(7)]).ravel()  # z and slope for a unit of ry about x = 0.1
    held = [0, 1, 12]
    free = np.setdiff1d(np.arange(14), held)
    dynamic = (1 + 1j * w * BETA) * whole.K - w**2 * whole.M
    q = np.zeros(14, dtype=complex)
    q[free] = np.linalg.solve(dynamic[np.ix_(free, free)], -20.0 * (whole.M @ turned)[free])
    forces = dynamic @ q + 20.0 * whole.M @ turned
    about = np.column_stack([ABOUT - x, -np.ones(7)]).ravel()
    expected = {"force": forces[0], "moment": forces[1], "prop": forces[12], "base_force": forces[0] + forces[12],
                "base_moment": about @ forces}  # fmt: skip
    for name, value in expected.items():
        assert abs(first[name] - value) < 1e-7 * abs(value), name


def test_a_snubber_and_a_joint_on_the_base_share_the_moment():
    """Static equilibrium of a floating beam on a joint to the base and a snubber: levers of both, and of a rotation."""
    scenario = load_scenario({
        "bodies": {"panel": {**BEAM, "kind": "beam", "supports": {"left": "free"}}},
        "joints": [{"name": "foot", "kind": "hinge", "between": [{"body": "panel", "position": 0.2}, "base"]}],
        "snubbers": [{"name": "s", "at": {"body": "panel", "position": 0.8}, "side": "below", "stiffness": 1e4,
                      "gap": 0.0}],
        "gravity": 9.81, "run": {"duration": 0.01, "sample_rate": 1000.0, "convergence": "off"},
        "outputs": [{"name": "base", "kind": "reaction_force", "support": "base"},
                    {"name": "foot", "kind": "joint_force", "joint": "foot"},
                    {"name": "origin", "kind": "reaction_moment", "support": "base"},
                    {"name": "foot_moment", "kind": "reaction_moment", "support": "base", "about": 0.2}],
    })  # fmt: skip
    outputs = beamsim.run(scenario)["histories"].by_label("output_value")
    found = {name: output.values[0] for name, output in outputs.items()}
    weight = RHO * W * H * L * 9.81
    assert found["base"] == pytest.approx(weight, rel=1e-9)
    assert found["origin"] == pytest.approx(-weight * L / 2, rel=1e-9)
    assert found["foot_moment"] == pytest.approx(weight * (0.2 - L / 2), rel=1e-9)
    assert found["foot"] == pytest.approx(weight * (0.8 - L / 2) / 0.6, rel=1e-9)


def test_the_base_of_a_plate_holds_its_weight_about_any_axis():
    plate = {"kind": "plate", "length": 0.5, "width": 0.3, "thickness": 0.003, "youngs_modulus": 70e9,
             "poissons_ratio": 0.3, "density": 2700.0, "elements": [4, 4],
             "supports": {"bottom": "clamped", "points": [{"position": [0.5, 0.3]}]},
             "point_masses": [{"position": [0.1, 0.2], "mass": 0.5}]}  # fmt: skip
    scenario = load_scenario({
        "bodies": {"panel": plate}, "gravity": 9.81, "run": {"duration": 0.01, "sample_rate": 1000.0},
        "outputs": [{"name": "rx", "kind": "reaction_moment", "support": "base", "direction": "rx"},
                    {"name": "ry", "kind": "reaction_moment", "support": "base", "about": [0.1, 0.2]}],
    })  # fmt: skip
    outputs = beamsim.run(scenario)["histories"].by_label("output_value")
    found = {name: output.values[0] for name, output in outputs.items()}
    weight = 2700 * 0.003 * 0.5 * 0.3 * 9.81
    assert found["rx"] == pytest.approx(weight * 0.15 + 0.5 * 9.81 * 0.2, rel=1e-9)
    assert found["ry"] == pytest.approx(weight * (0.1 - 0.25), rel=1e-9)
