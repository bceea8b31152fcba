"""Identification, nonlinear modes and studies on plates, joined bodies and beams of segments."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

MATERIAL = {"youngs_modulus": 70e9, "density": 2700.0}
DAMPING = {"damping": {"kind": "modal", "ratio": 0.03}}
STOP = {"name": "s", "side": "below", "stiffness": 5e3, "gap": 1e-4}
PLATE = {
    "bodies": {"a": {"kind": "plate", "length": 0.3, "width": 0.2, "thickness": 0.002, "poissons_ratio": 0.3,
                     "elements": [3, 2], "supports": {"left": "clamped"}, **MATERIAL, **DAMPING}},
    "snubbers": [{**STOP, "at": {"position": [0.3, 0.2]}}],
    "reduction": {"modes": 4}, "excitation": {"kind": "none"},
}  # fmt: skip
SECTION = {"width": 0.03, "thickness": 0.004, **MATERIAL}
JOINED = {
    "bodies": {
        "a": {"kind": "beam", "length": 0.4, **DAMPING, "elements": 4, "segments": [
            {"from": 0.0, "to": 0.2, **SECTION},
            {"from": 0.2, "to": 0.4, "bending_stiffness": 8.0, "mass_per_length": 0.4},
        ]},
        "b": {"kind": "beam", "length": 0.3, **SECTION, **DAMPING, "supports": {"left": "free"}, "elements": 3},
    },
    "joints": [{"name": "hinge", "kind": "hinge", "rotational_stiffness": 40.0,
                "between": [{"body": "a", "position": 0.4}, {"body": "b", "position": 0.0}]}],
    "snubbers": [{**STOP, "at": {"body": "b", "position": 0.3}}], "reduction": {"modes": 4},
}  # fmt: skip
SHAKEN = {"excitation": {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 15.0}}
RUN = {"run": {"duration": 0.1, "convergence": "off"}}


def test_the_stiffness_of_a_stop_of_a_plate_is_identified():
    """From the frequencies that another stiffness gives."""
    modes = build_system(load_scenario(PLATE, {"snubbers[0].stiffness": 7321.0, "reduction": {"modes": 30}})).modes
    section = {"snubber": "s", "measured_with": modes.closed_frequencies_hz[:3].tolist()}
    found = beamsim.identify_stiffness(load_scenario(PLATE, {"identify_stiffness": section}))
    assert found.summary["stiffness_n_per_m"] == pytest.approx(7321.0, rel=1e-5)


def test_a_nonlinear_mode_of_a_plate_rises_from_the_open_plate_towards_the_bilinear_frequency():
    nnm = {"mode": 1, "continue_in": {"kind": "energy", "from": 1e-9, "to": 1e-2}}
    scenario = load_scenario(PLATE, {"nnm": nnm, "bodies.a.damping": {"kind": "modal", "ratio": 0.0}})
    modes = build_system(scenario).modes
    opened, closed = modes.open_frequencies_hz[0], modes.closed_frequencies_hz[0]
    (branch, *_) = beamsim.nnm(scenario).branches
    frequency = np.asarray(branch.frequency_hz)
    assert frequency[0] == pytest.approx(opened, rel=1e-9)  # which the stop does not touch
    assert opened < frequency.max() < 2 * opened * closed / (opened + closed)


@pytest.mark.parametrize(
    ("base", "parameters"),
    [
        (PLATE, [("bodies.a.thickness", [0.0019, 0.0021]), ("snubbers[0].at.position[0]", [0.25, 0.3])]),
        (JOINED, [("joints[0].rotational_stiffness", [20.0, 80.0]), ("bodies.b.thickness", [0.003, 0.004])]),
        (JOINED, [("bodies.a.segments[1].bending_stiffness", [6.0, 9.0]),
                  ("bodies.a.segments[0].thickness", [0.0035, 0.004])]),
    ],
)  # fmt: skip
def test_cases_of_a_study_are_runs(base, parameters):
    """Each case gives what a run with its values gives."""
    vary = {"kind": "grid", "parameters": [{"path": path, "values": values} for path, values in parameters]}
    found = beamsim.design_study(load_scenario({**base, **SHAKEN, **RUN, "vary": vary})).responses
    (first, xs), (second, ys) = parameters
    for i, x in enumerate(xs):
        for j, y in enumerate(ys):
            alone = beamsim.run(load_scenario({**base, **SHAKEN, **RUN}, {first: x, second: y})).summary
            assert found["snubbers/s/peak_force"].values[i, j] == pytest.approx(alone["peak_force_n"]["s"], rel=1e-10)
            assert alone["peak_force_n"]["s"] > 0
