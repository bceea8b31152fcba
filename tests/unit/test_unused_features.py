"""What a case does not use is not executed when it is read and built."""

import sys

import pytest

from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

BEAM = {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa", "density": "2700 kg/m^3"}
STOP = {"name": "tip", "position": "270 mm", "side": "below", "stiffness": "151 kN/m", "gap": "0.1 mm"}
CASE = {
    "beam": BEAM,
    "snubbers": [STOP],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "65 Hz"},
    "run": {"duration": "0.1 s"},
}
FEATURES = {  # functions, and a change of the case that needs them
    "open_loops": {"joints": [{"name": "foot", "kind": "hinge", "between": [{"position": "100 mm"}, "base"]}]},
    "describe_springs": {"springs_to_ground": [{"kind": "cubic", "position": "100 mm", "stiffness": "1 kN/m^3"}]},
    "_check_rigid_friction": {"friction": [{"position": "100 mm", "normal_force": "1 N", "coefficient": 0.3,
                                            "stiffness": "10 kN/m"}]},
    "resolve_preloads": {"snubbers": [{**{k: v for k, v in STOP.items() if k != "gap"}, "preload": "5 N"}]},
    "_table_of": {"snubbers": [{**{k: v for k, v in STOP.items() if k != "stiffness"},
                                "force_deflection": [["0 mm", "0 N"], ["1 mm", "5 N"]]}]},
    "_end_springs": {"beam": {**BEAM, "supports": {"right": {"stiffness": "1 kN/m"}}}},
    "output_channels": {"outputs": [{"name": "m", "kind": "bending_moment", "position": "10 mm"}]},
    "_start_on_supports": {"excitation": {**CASE["excitation"], "applied_to": {"support": "left"}}},
    "_influence_of_mountings": {"excitation": {**CASE["excitation"], "applied_to": {"snubber": "tip"}}},
    "_release_shape": {
        "run": {"duration": "0.1 s", "start": {"released_force": {"position": "100 mm", "force": "-1 N"}}}
    },
    "_pulse": {"excitation": {"kind": "half_sine", "applied_to": "base", "level": "2 g", "duration": "5 ms"}},
    "_check_places": {"constant_forces": [{"line": "whole", "force_per_length": "1 N/m"}]},
}  # fmt: skip


def executed(case):
    """Names of the functions that reading and building execute."""
    names = set()

    def note(frame, event, _):
        if event == "call" and "beamsim" in frame.f_code.co_filename:
            names.add(frame.f_code.co_name)

    sys.setprofile(note)
    try:
        build_system(load_scenario(case))
    finally:
        sys.setprofile(None)
    return names


@pytest.mark.parametrize("function", FEATURES)
def test_a_feature_is_executed_where_it_is_used_and_only_there(function):
    assert function in executed(CASE | FEATURES[function])
    assert function not in executed(CASE)
