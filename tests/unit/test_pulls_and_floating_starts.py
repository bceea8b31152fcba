"""What nobody asked for is not fatal: a floating beam started from rest. A law that pulls says by how much."""

import numpy as np
import pytest

import beamsim
from beamsim.errors import NotTrustedError
from beamsim.scenario import load_scenario

FLOATING = """
beam:
  length: 3.4223425000871788
  width: 0.07060241215895702
  thickness: 0.16396808472049362
  youngs_modulus: 52107674871.622955
  density: 1555.8323321474638
  elements: 5
  supports: {left: free, right: free}
gravity: -1.774053192204638
snubbers:
  - name: stop
    position: 1.7111712500435894
    side: above
    stiffness: 617.3713684565334
    damping: {kind: viscous, coefficient: 3019.544148071633}
    gap: 0
excitation: {kind: none}
run: {duration: 0.05 s, sample_rate: 1 kHz, start: rest}
"""
BOUNCING = """
chain:
  masses: [1]
  springs: [100 N/m]
  snubbers: [{name: stop, mass: 1, side: below, stiffness: 10 kN/m, gap: 1 mm, DAMPING, law: LAW}]
excitation: {kind: harmonic, applied_to: base, level: 10 m/s^2, frequency: 2 Hz}
run: {duration: 2 s, sample_rate: 1 kHz, start: rest}
"""


def loaded(folder, text):
    (folder / "case.yaml").write_text(text)
    return load_scenario(folder / "case.yaml")


def test_a_floating_beam_with_a_stop_at_mid_span_starts_from_rest(tmp_path):
    result = beamsim.run(loaded(tmp_path, FLOATING))
    assert result.complete
    assert np.isnan(result.summary["static_force_n"]["stop"])


def test_an_equilibrium_that_is_lost_stops_only_what_starts_from_it(tmp_path, monkeypatch):
    def lost(*_):
        raise NotTrustedError("static equilibrium: lost")

    monkeypatch.setattr("beamsim.system.build.find_equilibrium", lost)
    assert beamsim.run(loaded(tmp_path, FLOATING)).complete
    with pytest.raises(NotTrustedError):
        beamsim.run(loaded(tmp_path, FLOATING.replace("start: rest", "start: static_equilibrium")))


@pytest.mark.parametrize(
    ("damping", "law", "pulls"),
    [
        ("damping: {kind: viscous, coefficient: 60 N s/m}", "kelvin_voigt", True),
        ("damping: {kind: viscous, coefficient: 60 N s/m}", "no_tension", False),
        ("damping: {kind: viscous, coefficient: 0}", "kelvin_voigt", False),
    ],
)
def test_a_law_that_pulls_says_by_how_much(tmp_path, damping, law, pulls):
    result = beamsim.run(loaded(tmp_path, BOUNCING.replace("DAMPING", damping).replace("LAW", law)))
    largest = result.summary["largest_pull_n"]["stop"]
    warned = [warning for warning in result.warnings if "no_tension" in warning]
    assert result.summary["contacts"]["stop"] >= 2
    assert (largest > 0.1) is pulls is bool(warned)
    if pulls:
        assert largest >= -result.snubbers["stop"].force.min() > 0.0
        assert f"{largest:.3g} N" in warned[0]
