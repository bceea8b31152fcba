"""The animation of a sweep is its motion at the highest peak, computed again."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.animation import frames_of_sweep
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result
from tests.helpers.commands import invoke

PRESSED = """\
chain:
  masses: [2 kg]
  springs: [8 kN/m]
  damping: {kind: modal, ratio: 5 %}
  snubbers: [{name: stop, mass: 1, side: below, stiffness: 5 kN/m, gap: -1 mm}]
probes: [{name: mass, mass: 1}]
excitation: {kind: harmonic, applied_to: base, level: 5 m/s^2, frequency: 8 Hz}
"""
SWEEP = {"kind": "swept_sine", "from": "9 Hz", "to": "13 Hz", "rate": "40 oct/min", "convergence": "off"}


@pytest.mark.parametrize("more", [
    {"direction": "both"}, {"from": "6 Hz", "to": "16 Hz", "notch_to": {"snubbers.stop.force": "20 N"}},
])  # fmt: skip
def test_frames_are_those_of_the_cycles_about_the_highest_peak(more, tmp_path):
    """Their extremes are those of these cycles in the result, to 2 % between two of 160 frames, as is the force."""
    scenario = load_scenario(PRESSED, {"sweep": SWEEP | more})
    write_result(beamsim.sweep(scenario), tmp_path / "swept.h5")
    result = load(tmp_path / "swept.h5")
    frames = frames_of_sweep(result)
    curve = max(result.curves.values(), key=lambda each: each.response("mass").max())
    mass, force = curve.channel("displacement", "mass"), curve.channel("force", "stop")
    k = int(curve.response("mass").argmax())
    shown = slice(k - 1, k + 2)
    assert frames.time[0] == pytest.approx(curve.time[k - 1])
    assert frames.time[-1] - frames.time[0] == pytest.approx(3.0 / curve.frequency_hz[k])
    reach = float(np.ptp([mass.maximum[shown].max(), mass.minimum[shown].min()]))
    x = frames.deflection[:, 0]
    assert x.max() == pytest.approx(mass.maximum[shown].max(), abs=0.02 * reach)
    assert x.min() == pytest.approx(mass.minimum[shown].min(), abs=0.02 * reach)
    np.testing.assert_allclose(frames.ends["stop"][:, 0], x, atol=1e-12)
    assert frames.force["stop"].max() == pytest.approx(force.maximum[shown].max(), rel=1e-2)
    # pressed by 1 mm at rest: 5 kN/m of what is left of it, and nothing above that
    np.testing.assert_allclose(frames.force["stop"], np.maximum(5000.0 * (1e-3 - x), 0.0), atol=1e-9)
    np.testing.assert_allclose(frames.opening["stop"], np.maximum(x - 1e-3, 0.0), atol=1e-12)


def test_the_command_writes_it(tmp_path):
    write_result(beamsim.sweep(load_scenario(PRESSED, {"sweep": SWEEP})), tmp_path / "swept.h5")
    done = invoke("animate", str(tmp_path / "swept.h5"), "-o", str(tmp_path / "peak.html"))
    assert done.exit_code == 0
    assert "slow" in (tmp_path / "peak.html").read_text(encoding="utf-8")


STEPPED = {"kind": "stepped", "from": "9 Hz", "to": "13 Hz", "points": 5, "convergence": "off"}


@pytest.mark.parametrize("more", [{"direction": "both"}, {"levels": ["1 m/s^2", "6 m/s^2"], "direction": "down"}])
def test_frames_of_a_stepped_sweep_are_whole_periods_of_the_steady_motion(more, tmp_path):
    """At the step with the highest peak: its extremes and its force, and an end that is the beginning."""
    write_result(beamsim.sweep(load_scenario(PRESSED, {"sweep": STEPPED | more})), tmp_path / "stepped.h5")
    result = load(tmp_path / "stepped.h5")
    frames = frames_of_sweep(result)
    curve = max(result.curves.values(), key=lambda each: each.response("mass").max())
    mass = curve.channel("displacement", "mass")
    k = int(curve.response("mass").argmax())
    assert frames.time[-1] * curve.frequency_hz[k] == pytest.approx(3.0)
    x = frames.deflection[:, 0]
    reach = mass.maximum[k] - mass.minimum[k]
    assert x.max() == pytest.approx(mass.maximum[k], abs=0.02 * reach)
    assert x.min() == pytest.approx(mass.minimum[k], abs=0.02 * reach)
    assert x[-1] == pytest.approx(x[0], abs=1e-6 * reach)
    np.testing.assert_allclose(frames.force["stop"], np.maximum(5000.0 * (1e-3 - x), 0.0), atol=0.22)


def test_supports_move_in_frames_of_a_stepped_sweep():
    """A beam that is much stiffer than its motion asks for turns with its right end, by the level of that."""
    level, f = 2e-3, 3.0
    beam = {"length": 1.0, "bending_stiffness": 1e6, "mass_per_length": 1.0,
            "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.01}}  # fmt: skip
    moved = {"kind": "harmonic", "applied_to": {"support": "right"}, "level": level, "frequency": f}
    steps = {"kind": "stepped", "from": f, "to": 4.0, "points": 2, "direction": "down", "convergence": "off"}
    frames = frames_of_sweep(beamsim.sweep(load_scenario({
        "beam": beam, "excitation": moved | {"quantity": "displacement"}, "sweep": steps,
        "probes": [{"name": "middle", "position": 0.5}],
    })))  # fmt: skip
    (line,) = frames.lines
    reach = np.abs(frames.deflection).max(axis=0)
    np.testing.assert_allclose(reach, level * line.x, rtol=2e-3, atol=1e-9)
