"""Stepped sine, swept sine, shooting and harmonic balance on beams of segments, plates and joined bodies agree."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.scenario import load_scenario

MATERIAL = {"youngs_modulus": 70e9, "density": 2700.0}
DAMPING = {"damping": {"kind": "modal", "ratio": 0.05}}
SEGMENTS = {
    "kind": "beam", "length": 0.6, **DAMPING,
    "segments": [
        {"from": 0.0, "to": 0.3, "section": {"kind": "rectangle", "width": 0.04, "thickness": 0.008}, **MATERIAL},
        {"from": 0.3, "to": 0.6, "bending_stiffness": 20.0, "mass_per_length": 0.5},
    ],
}  # fmt: skip
PLATE = {"kind": "plate", "length": 0.4, "width": 0.3, "thickness": 0.003, "poissons_ratio": 0.3, "elements": [3, 3],
         "supports": {"left": "clamped"}, **MATERIAL, **DAMPING}  # fmt: skip
OUTER = {"kind": "beam", "length": 0.4, "width": 0.04, "thickness": 0.004, **MATERIAL, **DAMPING,
         "supports": {"left": "free", "right": "pinned"}}  # fmt: skip
HINGE = [{"name": "hinge", "kind": "hinge", "between": [{"body": "a", "position": 0.6}, {"body": "b", "position": 0}]}]
STRUCTURES = {
    "segments": ({"bodies": {"a": SEGMENTS}}, 0.5),
    "plate": ({"bodies": {"a": PLATE}}, [0.35, 0.2]),
    "joined": ({"bodies": {"a": SEGMENTS, "b": OUTER}, "joints": HINGE}, 0.5),
}


def case(name, sweep):
    structure, position = STRUCTURES[name]
    at = {"body": "a", "position": position}
    stop = {"name": "s", "at": at, "side": "below", "stiffness": 1e3, "gap": -2e-4}
    return load_scenario({**structure, "snubbers": [stop], "probes": [{"name": "p", "at": at}],
                          "excitation": {"kind": "harmonic", "applied_to": "base", "level": 6.0, "frequency": 20.0},
                          "reduction": {"modes": 4}, "sweep": {"from": 20.0, "to": 21.0, **sweep}})  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", STRUCTURES)
def test_four_methods_give_one_response(name):
    stepped = sweep_alone(case(name, {"kind": "stepped", "points": 2, "steady_to": 1e-9})).curves["up_0"]
    peak = stepped.displacement["p"].peak[-1]
    assert stepped.force["s"].peak[-1] > 0
    swept = sweep_alone(case(name, {"kind": "swept_sine", "rate": "0.5 Hz/s"})).curves["up_0"]
    assert swept.displacement["p"].peak[-1] == pytest.approx(peak, rel=0.05)
    for method in ({"kind": "shooting"}, {"kind": "harmonic_balance", "harmonics": 31}):
        settings = {"kind": "continuation", "points_at": [21.0], "side_branches": "none", "method": method}
        branch = beamsim.continuation(case(name, settings)).branches[0]
        k = int(np.argmin(np.abs(branch.frequency_hz - 21.0)))
        assert branch.peak_displacement["p"][k] == pytest.approx(peak, rel=2e-3)
