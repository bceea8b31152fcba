"""What nobody asked for is not fatal: a floating beam started from rest. A law that pulls says by how much."""

import numpy as np
import pytest

import beamsim
from beamsim.errors import ScenarioError
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
        assert largest >= -result["histories"]["snubber_force"].sel(snubber="stop").values.min() > 0.0
        assert f"{largest:.3g} N" in warned[0]


CLAMPED_BETWEEN = """
chain:
  masses: [2, 1]
  springs: [0, 300 N/m]
  snubbers:
    - {name: lower, mass: 1, side: below, stiffness: 1 kN/m, LOWER}
    - {name: upper, mass: 1, side: above, stiffness: 2 kN/m, UPPER}
run: {duration: 3 s, sample_rate: 100 Hz, start: {displacement: [0.02, 0.0]}, convergence: off}
"""


def test_preloads_of_opposed_snubbers_hold_a_floating_structure(tmp_path):
    """5 N on both sides are gaps of -5 and -2.5 mm, whose motion is the same; it is also the static equilibrium."""
    results = []
    for lower, upper in (("preload: 5 N", "preload: 5 N"), ("gap: -5 mm", "gap: -2.5 mm")):
        text = CLAMPED_BETWEEN.replace("LOWER", lower).replace("UPPER", upper)
        results.append(beamsim.run(loaded(tmp_path, text)))
    figures = results[0].summary
    assert figures["static_force_n"] == pytest.approx({"lower": 5.0, "upper": 5.0}, rel=1e-12)
    assert figures["gap_m"] == pytest.approx({"lower": -5e-3, "upper": -2.5e-3}, rel=1e-12)
    assert results[0]["events"]["time"].values.size > 0
    one, other = (each["histories"]["displacement"].values for each in results)
    np.testing.assert_allclose(one, other, atol=1e-12)
    still = CLAMPED_BETWEEN.replace("LOWER", "preload: 5 N").replace("UPPER", "preload: 5 N")
    at_rest = beamsim.run(
        loaded(tmp_path, still.replace("start: {displacement: [0.02, 0.0]}", "start: static_equilibrium"))
    )
    assert max(at_rest.summary["peak_displacement_m"].values()) < 1e-14


def test_a_free_beam_that_turns_between_preloaded_snubbers_starts_from_rest(tmp_path):
    """What the snubbers leave free does not matter to their gaps."""
    opposed = FLOATING.replace("gravity: -1.774053192204638", "gravity: 0").partition("snubbers:")[0]
    snubbers = "".join(
        f"  - {{name: {side}, position: 1.5, side: {side}, stiffness: 1 kN/m, preload: 3 N}}\n"
        for side in ("below", "above")
    )
    text = f"{opposed}snubbers:\n{snubbers}run: {{duration: 0.05 s, sample_rate: 1 kHz, start: rest}}\n"
    figures = beamsim.run(loaded(tmp_path, text)).summary
    assert figures["gap_m"] == pytest.approx({"below": -3e-3, "above": -3e-3}, rel=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper", "gravity", "remedy"),
    [
        ("preload: 5 N", "preload: 3 N", "0", "the nearest preloads that do are 4 N, 4 N"),
        ("preload: 50 N", "preload: 50 N", "9.81 m/s^2", "the nearest preloads that do are 64.715 N, 35.285 N"),
        ("gap: 1 mm", "preload: 3 N", "100 m/s^2", "add a snubber against which the loads push"),
    ],
)
def test_preloads_that_do_not_balance_name_those_that_do(tmp_path, lower, upper, gravity, remedy):
    text = CLAMPED_BETWEEN.replace("LOWER", lower).replace("UPPER", upper).replace("start:", "start: rest #")
    text = text.replace("rest # {displacement: [0.02, 0.0]}, convergence: off}", "rest}")
    if "gap" in lower:  # nothing below
        text = text.replace("side: below", "side: above")
    with pytest.raises(ScenarioError, match=remedy):
        beamsim.run(loaded(tmp_path, f"gravity: {gravity}\n{text}"))
