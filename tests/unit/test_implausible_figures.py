"""Figures of implausible size are doubted, and round-off is not printed as data."""

import pytest

from beamsim.plots.style import amount
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

PANEL = """
beam:
  {length: 1.2 m, width: 0.4 m, thickness: 22 mm, youngs_modulus: 7 GPa, density: 300, supports: {right: clamped}}
snubbers: [{name: mid, position: 0.6 m, side: below, stiffness: 100 kN/m, gap: 0.3 mm}]
excitation: {kind: harmonic, applied_to: base, level: 1 g, frequency: 200 Hz}
run: {duration: 0.1 s}
"""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            "snubbers.mid.gap=0.3",
            "snubbers[0].gap = 0.3 m is a large gap for a structure of this size (more than 0.22 m)",
        ),
        ("snubbers.mid.gap=-0.3", "snubbers[0].gap = -0.3 m is a large prestress"),
        (
            "snubbers.mid.damping={kind: ratio, ratio: 20}",
            "snubbers[0].damping.ratio = 20 is critical damping or more; was 20 %",
        ),
        (
            "beam.damping={kind: modal, ratio: 20}",
            "beam.damping.ratio = 20 is critical damping or more; was 20 % meant?",
        ),
    ],
)
def test_doubts(change, says):
    assert load_scenario(PANEL).warnings == ()
    (warning,) = load_scenario(PANEL, [change]).warnings
    assert warning.startswith(says)


def test_a_beam_by_its_stiffness_and_a_body_between():
    panels = (
        "bodies:\n  a: {kind: beam, length: 1, bending_stiffness: 200, mass_per_length: 3}\n"
        "  b: {kind: chain, masses: [1], springs: [1, 1]}\n"
        "snubbers: [{between: [{body: a, position: 1}, {body: b, mass: 1}], stiffness: 1e5, gap: 0.3}]\n"
    )
    (warning,) = load_scenario(panels).warnings
    assert "more than 0.2 m" in warning
    assert load_scenario(panels, ["snubbers[0].gap=0.1"]).warnings == ()


def test_a_reduction_without_accuracy_is_doubted():
    damped = load_scenario(PANEL, ["beam.damping={kind: modal, ratio: 1 %}"])
    assert build_system(damped).warnings == ()
    system = build_system(load_scenario(PANEL, ["reduction={modes: 1}", "excitation.frequency=900 Hz"]))
    assert system.modes["reduction_bound"].item() > 0.01
    (warning,) = [text for text in system.warnings if "reduced model" in text]
    assert f"{system.modes['reduction_bound'].item():.2g}" in warning


def test_round_off_is_not_printed():
    assert amount(1.567e-20, "m") == "0 m"  # was 1.567e-08 pm
    assert amount(-3e-17, "N") == "0 N"
    assert amount(2.5e-12, "m") == "2.5 pm"
