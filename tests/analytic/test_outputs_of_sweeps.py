"""Outputs of sweeps, continuations and studies against those of the settled run."""

import numpy as np
import pytest
from sampling import first_apart

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from tests.helpers.branches import long_steps

BEAM = {"kind": "beam", "length": 0.5, "width": 0.04, "thickness": 0.006, "youngs_modulus": 70e9, "density": 2700.0,
        "elements": 5, "damping": {"kind": "viscous", "coefficient": 20.0}}  # fmt: skip
OUTPUTS = [
    {"name": "clamp", "kind": "reaction_force", "body": "inner", "support": "left"},
    {"name": "clamp_moment", "kind": "reaction_moment", "body": "inner", "support": "left"},
    {"name": "base", "kind": "reaction_force", "support": "base"},
    {"name": "hinge", "kind": "joint_force", "joint": "hinge"},
    {"name": "gauge", "kind": "strain", "at": {"body": "inner", "position": 0.1}},
    {"name": "tip", "kind": "acceleration", "at": {"body": "outer", "position": 0.5}},
]
ENERGIES = [{"name": "strain_energy", "kind": "strain_energy", "body": "inner"},
            {"name": "kinetic_energy", "kind": "kinetic_energy", "body": "outer"}]  # fmt: skip
FORCES = [
    {
        "kind": "harmonic",
        "applied_to": {"body": "inner", "position": 0.3},
        "level": 4.0,
        "frequency": 25.0,
        "phase": 0.5,
    },
    {
        "kind": "harmonic",
        "applied_to": {"body": "outer", "line": "whole"},
        "level": 6.0,
        "frequency": 25.0,
        "phase": 2.0,
    },
]
BASE = {"kind": "harmonic", "applied_to": "base", "level": 15.0, "frequency": 25.0}
STEPPED = {"kind": "stepped", "from": 24.0, "to": 25.0, "points": 2, "steady_to": 1e-10}
CONTINUED = {"kind": "continuation", "from": 24.0, "to": 25.0, "points_at": [25.0], "side_branches": "none"}
ENDS = ("output_maximum", "output_minimum")


def case(excitation, **more):
    return load_scenario(
        {
            "bodies": {"inner": {**BEAM, "supports": {"left": "clamped"}},
                       "outer": {**BEAM, "supports": {"left": "free", "right": "pinned"}}},
            "joints": [{"name": "hinge", "kind": "hinge",
                        "between": [{"body": "inner", "position": 0.5}, {"body": "outer", "position": 0.0}],
                        "rotational_stiffness": 20.0}],
            "snubbers": [{"name": "s", "at": {"body": "outer", "position": 0.2}, "side": "both", "gap": 1e-4,
                          "stiffness": 2e3}],
            "gravity": 9.81,
            "reduction": {"modes": 8},
            "excitation": excitation,
            "outputs": OUTPUTS,
            **more,
        }
    )  # fmt: skip


@first_apart("excitation", 1, [BASE, {"kind": "forces", "forces": FORCES}])
def test_steady_outputs_are_those_of_the_settled_run(excitation, tmp_path):
    outputs = [*OUTPUTS, *ENERGIES]
    settled = beamsim.run(
        case(excitation, outputs=outputs, run={"duration": 1.5, "sample_rate": 25.0 * 2000, "convergence": "off"})
    )
    expected = {name: output.values[-4001:] for name, output in settled["histories"].by_label("output_value").items()}
    stepped = sweep_alone(case(excitation, outputs=outputs, sweep=STEPPED))
    assert any("strain_energy is an energy" in warning for warning in stepped.warnings)
    curve = stepped.curves["up_0"]
    assert curve.places("output") == [output["name"] for output in OUTPUTS]
    for name in curve.places("output"):
        output = curve.channel("output", name)
        x, size = expected[name], np.abs(expected[name]).max()
        assert output.maximum[-1] == pytest.approx(x.max(), abs=2e-4 * size)
        assert output.minimum[-1] == pytest.approx(x.min(), abs=2e-4 * size)
        assert output.mean[-1] == pytest.approx(x[:-1].mean(), abs=1e-4 * size)
        assert output.rms[-1] == pytest.approx(np.sqrt(np.mean(x[:-1] ** 2)), rel=1e-4)
    for method in ({"kind": "shooting"}, {"kind": "harmonic_balance", "harmonics": 41}):
        with long_steps():
            followed = beamsim.continuation(case(excitation, outputs=outputs, sweep={**CONTINUED, "method": method}))
        branch = followed.branches[0]
        k = int(np.argmin(np.abs(branch["frequency_hz"].values - 25.0)))
        tolerance = 3e-3 if method["kind"] == "shooting" else 2e-2  # accelerations of 41 harmonics
        assert branch.labels("output") == list(expected)
        for name, x in expected.items():
            size, high, low = np.abs(x).max(), *(branch[of].sel(output=name).values for of in ENDS)
            assert high[k] == pytest.approx(x.max(), abs=tolerance * size), (name, method)
            assert low[k] == pytest.approx(x.min(), abs=tolerance * size), (name, method)
        stable = branch["stable"].values
        largest = np.max([np.abs(branch[of].sel(output="hinge").values) for of in ENDS], axis=0)
        assert followed.summary["peak_output"]["hinge"]["value"] == largest[stable].max()
    for number, result in enumerate((stepped, followed)):
        write_result(result, tmp_path / f"{number}.h5")
        again = load(tmp_path / f"{number}.h5")
        rows = "points" if number else "cycles"
        one, other = (each[rows].sel(output="hinge") for each in (result, again))
        np.testing.assert_array_equal(one["output_maximum"].values, other["output_maximum"].values)
        about = [other[f"output_{of}"].item() for of in ("unit", "quantity", "at")]
        assert about == ["N", "joint_force", "hinge"]


def test_a_swept_sine_gives_outputs_that_balance_the_loads():
    """The base carries what supports, snubber and gravity ask for in every cycle: against the two supports."""
    sweep = {"kind": "swept_sine", "from": 20.0, "to": 30.0, "rate": "5 Hz/s"}
    right = {"name": "right", "kind": "reaction_force", "body": "outer", "support": "right"}
    curve = sweep_alone(case(BASE, outputs=[*OUTPUTS, right], sweep=sweep)).curves["up_0"]
    forces = curve["mean_force"].by_label()
    sides = sum(mean.values * (1 if "below" in name else -1) for name, mean in forces.items())
    total = curve.channel("output", "clamp").mean + curve.channel("output", "right").mean + sides
    np.testing.assert_allclose(
        curve.channel("output", "base").mean, total, rtol=0, atol=1e-9 * curve.channel("output", "base").peak.max()
    )
    assert curve.channel("output", "base").peak.shape == curve.frequency_hz.shape
