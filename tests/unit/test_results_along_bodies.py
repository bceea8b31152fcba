"""Results along bodies of any number, kind and name: as the summary has them, and as a file gives them back."""

import numpy as np
import pytest

import beamsim
from beamsim.plots.bodies import body_figures

BEAM = {
    "length": 0.5, "width": 0.05, "thickness": 0.01, "youngs_modulus": 70e9, "density": 2700.0, "elements": 6,
    "damping": {"kind": "modal", "ratio": 0.02},
}  # fmt: skip
PLATE = {**BEAM, "kind": "plate", "width": 0.3, "poissons_ratio": 0.33, "elements": [4, 3]}
CLAMPED = {"left": "clamped"}
SHAKEN = {
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": 3.0, "frequency": 20.0},
    "run": {"duration": 0.1, "sample_rate": 2000.0, "convergence": "off", "spectrum": {"last": 0.05}},
}
CASES = {
    "beam": ({"beam": {**BEAM, "supports": CLAMPED}}, {"beam": False}),
    "named beam": ({"bodies": {"boom 1.2": {**BEAM, "kind": "beam", "supports": CLAMPED}}}, {"boom 1.2": False}),
    "named plate": ({"bodies": {"größe": {**PLATE, "supports": CLAMPED}}}, {"größe": True}),
    "beam on a plate": (
        {
            "bodies": {"panel": {**PLATE, "supports": CLAMPED}, "arm": {**BEAM, "kind": "beam", "supports": CLAMPED}},
            "joints": [{
                "kind": "spring", "stiffness": 1e4,
                "between": [{"body": "panel", "position": [0.5, 0.15]}, {"body": "arm", "position": 0.5}],
            }],
        },
        {"panel": True, "arm": False},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("structure", "plates"), CASES.values(), ids=CASES)
def test_stress_along_each_body_is_that_of_the_summary(structure, plates, tmp_path):
    first = next(iter(plates))
    place = {"position": [0.5, 0.15] if plates[first] else 0.5} | ({"body": first} if "bodies" in structure else {})
    probe = {"name": "tip", "at": place} if "bodies" in structure else {"name": "tip", "position": 0.5}
    result = beamsim.run(beamsim.load_scenario({**structure, **SHAKEN, "probes": [probe]}))
    bodies = result["bodies"].groups("station_body")
    assert list(bodies) == list(plates)
    assert max(np.max(body["peak_bending_stress"]) for body in bodies.values()) == pytest.approx(
        result.summary["largest_bending_stress_pa"], rel=1e-12
    )
    for name, body in bodies.items():
        assert np.all(np.isfinite(body["peak_bending_stress"]))
        assert ("position_y" in body and np.all(np.isfinite(body["position_y"]))) == plates[name]
    figures = body_figures(result)
    assert ("deflected_shapes" in figures) == (not all(plates.values()))
    assert any("plate_deflections" in name for name in figures) == any(plates.values())
    read = beamsim.load(beamsim.write_result(result, tmp_path / "case.h5"))["bodies"]
    for name, values in result["bodies"].items():
        np.testing.assert_array_equal(read[name], values)
