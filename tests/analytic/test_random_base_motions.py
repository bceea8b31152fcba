"""Random motions of the base in several axes: independent, coherent, with sines; predictions and limits."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

PSD = [{"frequency": 20, "density": 0.5}, {"frequency": 100, "density": 2.0}]
PERIOD = 4.0
SHORT = {"run": {"duration": 1.0, "sample_rate": 1000, "start": "rest", "convergence": "off"}}


def noise(axis, **more):
    return {"kind": "random", "applied_to": "base", "direction": axis, "psd": PSD, **more}


def case(*forces, **more):
    return load_scenario({
        "bodies": {"mast": {
            "kind": "frame", "nodes": {"a": [0, 0, 0], "b": [0.1, 0, 0.3]},
            "sections": {"s": {"section": {"kind": "circle", "diameter": 0.02}, "youngs_modulus": 70e9,
                               "density": 2700}},
            "members": {"m": {"nodes": ["a", "b"]}}, "elements": 1, "supports": {"a": "clamped"},
            "point_masses": [{"node": "b", "mass": 2.0}], "damping": {"kind": "modal", "ratio": 0.05},
        }},
        "snubbers": [{"name": "s", "at": {"node": "b", "direction": "x"}, "side": "above", "gap": 0.1,
                      "stiffness": 1e4}],
        "excitation": {"kind": "forces", "forces": list(forces)},
        "probes": [{"name": axis, "at": {"node": "b", "direction": axis}} for axis in "xy"],
        "run": {"duration": PERIOD, "sample_rate": 1000, "start": "rest", "convergence": "off"},
        "reduction": {"modes": 4}, **more,
    })  # fmt: skip


def lines_of(scenario):
    """(K, lines) complex amplitudes of the motions of the base within the band, at multiples of 1 / period."""
    time = np.arange(8192) * (PERIOD / 8192)
    spectra = [np.fft.rfft(motion.acceleration(time)) for motion in build_system(scenario).base]
    return np.array(spectra)[:, 90:390]  # Hz: 22.5 to 97.5


def coherence(lines):
    """Coherence of two signals, and the phase of the second relative to the first, over all lines."""
    first, second = lines / np.abs(lines)
    mean = np.mean(second * np.conj(first))
    return abs(mean) ** 2, np.degrees(np.angle(mean))


def test_axes_are_independent_unless_they_have_one_seed():
    independent, _ = coherence(lines_of(case(noise("x"), noise("y"))))
    assert independent < 0.02  # 300 lines: 0.0033 on average
    together = case(noise("x", seed=4), noise("y", seed=4, phase="90 deg"))
    found, phase = coherence(lines_of(together))
    assert found == pytest.approx(1.0, abs=1e-6)
    assert phase == pytest.approx(90.0, abs=0.1)
    said = [text for text in together.warnings if "coherent" in text]
    assert said == [
        "excitation.forces[1].seed = 4 is that of forces[0], so that both are fully coherent; give another seed for "
        "independent inputs"
    ]
    assert not [text for text in case(noise("x"), noise("y")).warnings if "coherent" in text]


def test_a_sum_of_seeds_gives_a_coherence_in_between():
    lines = lines_of(case(noise("x", seed=4, amplitudes="random"), noise("y", seed="0.8*4+0.6*7", amplitudes="random")))
    cross = np.mean(lines[1] * np.conj(lines[0]))
    found = abs(cross) ** 2 / np.prod(np.mean(np.abs(lines) ** 2, axis=1))
    assert found == pytest.approx(0.64, abs=0.12)


def test_predictions_of_independent_inputs_add_their_mean_squares():
    """The linear standard deviations under both inputs, and no prediction where they are coherent."""
    first, second = noise("x"), noise("z", seed=9)
    both, *alone = (beamsim.run(case(*of, **SHORT)).summary for of in ((first, second), (first,), (second,)))
    assert both["random_linear"].keys() == alone[0]["random_linear"].keys()
    for name, values in both["random_linear"].items():
        parts = [of["random_linear"][name]["open"] for of in alone]
        assert values["open"] == pytest.approx(np.hypot(*parts), rel=1e-9)
    assert both["gapping"]["s"]["sigmas"] > 1.0
    measured = both["random"]["x displacement"]
    assert measured["rms_low"] < both["random_linear"]["x displacement"]["open"] < measured["rms_high"]
    coherent = beamsim.run(case(noise("x", seed=9), second, **SHORT)).summary
    assert not coherent.get("random_linear")


def test_each_input_has_its_statistics_and_may_have_a_limit():
    sine = {"kind": "harmonic", "applied_to": "base", "direction": "z", "level": 3.0, "frequency": 40.0}
    curve = [["20 Hz", "1 (m/s^2)^2/Hz"], ["100 Hz", "3 (m/s^2)^2/Hz"]]
    result = beamsim.run(case(noise("x"), noise("y"), sine, limits={"psd": {"input y": curve}}))
    random = result["random"]
    assert random["name"].values[:3].tolist() == ["input x", "input y", "input z"]
    area = np.sqrt(np.trapezoid([0.5 * (f / 20) ** (np.log(4) / np.log(5)) for f in range(20, 101)]))
    for axis in "xy":
        assert random["rms"].sel(signal=f"input {axis} acceleration").item() == pytest.approx(area, rel=0.02)
    assert random["rms"].sel(signal="input z acceleration").item() == pytest.approx(3.0 / np.sqrt(2), rel=1e-3)
    assert "transmissibility_real" not in random
    assert set(result.summary["margins"]) == {"psd.input y"}
