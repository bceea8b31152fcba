"""Peaks of continuations are those of the continuous motion: a run from the same orbit has them, however short."""

import pytest

import beamsim
from beamsim.scenario import load_scenario
from tests.helpers.branches import peaks_of

DAMPED = {"damping": {"kind": "ratio", "ratio": 0.05}}
CASES = {
    "two stops, one with a dashpot": (37.0, 0.03, [
        {"name": "tip", "position": 0.4, "side": "below", "stiffness": 2e4, "gap": 1e-4, **DAMPED},
        {"name": "middle", "position": 0.25, "side": "above", "stiffness": 2e4, "gap": 3e-4},
    ]),
    "stiff stops": (37.0, 0.3, [
        {"name": "tip", "position": 0.4, "side": "below", "stiffness": 1e9, "gap": 1e-4},
        {"name": "middle", "position": 0.25, "side": "above", "stiffness": 1e8, "gap": 3e-4},
    ]),
    "table": (37.0, 0.03, [{
        "name": "tip", "position": 0.4, "side": "below", "gap": 1e-4,
        "force_deflection": [[0, 0], [1e-4, 1], [3e-4, 5], [1e-3, 40]],
    }]),
}  # fmt: skip


def case(name, **more):
    frequency, ratio, snubbers = CASES[name]
    beam = {"length": 0.4, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700,
            "damping": {"kind": "modal", "ratio": ratio}}  # fmt: skip
    base = {"kind": "harmonic", "applied_to": "base", "level": "1 g", "frequency": frequency}
    return {"beam": beam, "snubbers": snubbers, "excitation": base, "reduction": {"modes": 6}} | more


@pytest.mark.parametrize("name", [*list(CASES)[:2], "table"])
def test_a_run_from_an_orbit_has_its_peaks(name, tmp_path):
    """Samples and a parabola through a jump gave 145 for 132 m/s^2, and 58 for 296 N at a stiff stop; 2048 samples and
    finer ones about the likely peaks 131.737881327 for 131.737880285."""
    frequency = CASES[name][0]
    followed = {"kind": "continuation", "from": frequency, "to": 1.0003 * frequency, "seek_at": 0,
                "side_branches": "none"}  # fmt: skip
    curve = beamsim.continuation(load_scenario(case(name, sweep=followed)))
    beamsim.write_result(curve, tmp_path / "orbits.h5")
    start = {"orbit": str(tmp_path / "orbits.h5"), "branch": 0, "point": 1}
    run = beamsim.run(load_scenario(case(name, run={"duration": 1 / frequency, "start": start, "convergence": "off"})))
    branch, s = curve.branches[0], run.summary
    for snubber, force in s["peak_force_n"].items():
        assert peaks_of(branch, snubber, "force")[0] == pytest.approx(force, rel=1e-9)
        assert branch["contact_share"].sel(snubber=snubber).values[0] == pytest.approx(
            s["contact_share"][snubber], rel=1e-9
        )
    for probe, acceleration in s["peak_acceleration_g"].items():
        assert peaks_of(branch, probe)[0] == pytest.approx(s["peak_displacement_m"][probe], rel=1e-9)
        assert peaks_of(branch, probe, "absolute_acceleration")[0] == pytest.approx(9.80665 * acceleration, rel=1e-9)
