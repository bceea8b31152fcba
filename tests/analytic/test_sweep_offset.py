"""The static part of a sweep apart from the dynamic one, and the linear responses that it is compared with."""

import numpy as np
import pytest

import beamsim
from beamsim.cli.motions import at_frequency
from beamsim.scenario import load_scenario
from beamsim.store.results import load, write_result

G = 9.80665
MASS = """\
chain: {masses: [2 kg], springs: [8 kN/m], damping: {kind: modal, ratio: 5 %}}
probes: [{name: mass, mass: 1}]
excitation: {kind: harmonic, applied_to: base, level: 1 m/s^2, frequency: 8 Hz}
sweep: {kind: swept_sine, from: 6 Hz, to: 16 Hz, rate: 10 oct/min, convergence: off}
"""
OMEGA = np.sqrt(8000.0 / 2.0)


@pytest.fixture(scope="module")
def heavy():
    return beamsim.sweep(load_scenario(MASS, {"gravity": "1 g"}))


def test_peaks_of_a_linear_motion_are_those_without_gravity(heavy):
    """Which sags it by g / omega^2 and changes nothing else; its largest displacement contains the sag."""
    light = beamsim.sweep(load_scenario(MASS))
    (loaded,), (free,) = heavy.curves.values(), light.curves.values()
    one, other = loaded.channel("displacement", "mass"), free.channel("displacement", "mass")
    assert loaded["static_displacement"].values == pytest.approx(-G / OMEGA**2, rel=1e-9)
    assert loaded.offset("mass") == loaded["static_displacement"].sel(probe="mass").item()
    assert free.offset("mass") == 0.0
    np.testing.assert_allclose(loaded.response("mass"), other.peak, rtol=1e-8, atol=1e-9 * other.peak.max())
    assert [peak.kind for peak in heavy.peaks] == [peak.kind for peak in light.peaks] == ["linear resonance"]
    assert heavy.peaks[0].value_m == pytest.approx(light.peaks[0].value_m, rel=1e-8)
    assert one.peak.max() == pytest.approx(G / OMEGA**2 + other.peak.max(), rel=2e-2)  # the downward peak beside it


def test_the_offset_is_named_and_stored(heavy, tmp_path):
    (curve,) = heavy.curves.values()
    assert at_frequency(curve, "displacement", "mass").endswith(" from equilibrium at -2.452 mm)")
    assert "from equilibrium at -2.452 mm)" in str(heavy)
    write_result(heavy, tmp_path / "heavy.h5")
    (again,) = load(tmp_path / "heavy.h5").curves.values()
    assert again["static_displacement"].values == curve["static_displacement"].values


@pytest.mark.parametrize("gap", [-1e-3, 1e-3])
def test_linear_responses_of_open_and_closed_snubbers(gap):
    """1 / |omega_0^2 - omega^2 + 2 i zeta omega_0 omega| without the stop, and with its stiffness."""
    snubber = {"name": "stop", "mass": 1, "side": "below", "stiffness": "5 kN/m", "gap": gap}
    chain = {"masses": [2.0], "springs": [8000.0], "snubbers": [snubber], "damping": {"kind": "modal", "ratio": 0.05}}
    linear = beamsim.sweep(load_scenario(MASS, {"chain": chain}))["linear"]
    omega = 2.0 * np.pi * linear["frequency_hz"].values
    for name, stiffness in (("displacement", 8000.0), ("displacement_closed", 13000.0)):
        found = linear[f"{name}_real"].sel(probe="mass").values + 1j * linear[f"{name}_imag"].sel(probe="mass").values
        expected = 1.0 / np.abs(stiffness / 2.0 - omega**2 + 2j * 0.05 * OMEGA * omega)
        np.testing.assert_allclose(np.abs(found), expected, rtol=1e-9)
    assert linear["closed_at_rest"].item() == (gap < 0.0)
