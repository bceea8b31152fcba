"""Every limit in every analysis: it is compared with a value, and decides, or it is refused by its name."""

import pytest

import beamsim
from beamsim.errors import ScenarioError

MODEL = """\
chain: {masses: [1 kg, 1 kg], springs: [1 kN/m, 1 kN/m], damping: {kind: modal, ratio: 5 %}}
snubbers:
  - {name: above, mass: 2, side: above, gap: 2 mm, stiffness: 4 kN/m}
  - {name: below, mass: 2, side: below, gap: 2 mm, stiffness: 4 kN/m}
probes: [{name: tip, mass: 2}]
outputs: [{name: wall, kind: reaction_force, support: left}]
"""
SINE = "excitation: {kind: harmonic, applied_to: base, level: 2, frequency: 3 Hz}\n"
SHOCK = "excitation: {kind: half_sine, applied_to: base, level: 2 g, duration: 20 ms}\n"
NOISE = """\
excitation:
  kind: random
  applied_to: base
  psd: [{frequency: 1 Hz, density: 0.01 g^2/Hz}, {frequency: 20 Hz, density: 0.01 g^2/Hz}]
"""
SHORT = "run: {duration: 1 s, sample_rate: 500 Hz}\n"
ANALYSES = {  # the function, and the case
    "run": (beamsim.run, SINE + SHORT),
    "shock": (beamsim.run, SHOCK + "run: {duration: 0.5 s, sample_rate: 1 kHz, srs: {from: 5 Hz, to: 100 Hz}}\n"),
    "random": (beamsim.run, NOISE + "run: {duration: 20 s, sample_rate: 200 Hz}\n"),
    "stepped": (beamsim.sweep, SINE + "sweep: {kind: stepped, from: 2 Hz, to: 4 Hz, points: 3}\n"),
    "continuation": (
        beamsim.continuation,
        SINE + "sweep: {kind: continuation, from: 2.8 Hz, to: 3 Hz, side_branches: none}\n",
    ),
    "study": (
        beamsim.design_study, SINE + SHORT + "vary: {kind: grid, parameters: [{path: excitation.level, values: [2]}]}\n"
    ),
}  # fmt: skip
PEAKS = {
    "peak_force": "1 N", "peak_displacement": "1 mm", "peak_acceleration": "0.1 g", "gap": "1 mm",
    "outputs": "{wall: 0.1 N}",
}  # fmt: skip
OTHERS = {
    "gapping": ("50 %", {"run", "stepped", "study"}),
    "rms_displacement": ("0.1 mm", {"run", "shock", "random", "study"}),
    "rms_acceleration": ("0.01 g", {"run", "shock", "random", "study"}),
    "rms_force": ("0.1 N", {"random"}),
    "srs": ("{tip: [[5 Hz, 0.1 g], [100 Hz, 0.1 g]]}", {"shock"}),
    "psd": ("{tip: [[1 Hz, 1e-6 g^2/Hz], [20 Hz, 1e-6 g^2/Hz]]}", {"random"}),
    "response": ("{tip: [[1 Hz, 0.01 g], [20 Hz, 0.01 g]]}", {"stepped"}),
    "bending_stress": ("1 MPa", set()),
    "peak_moment": ("1 N m", set()),
}  # what is small, and where it is known


def limited(analysis, limits):
    solve, text = ANALYSES[analysis]
    return solve(beamsim.load_scenario(f"{MODEL}{text}limits: {limits}\n"))


@pytest.mark.parametrize("analysis", ANALYSES)
def test_limits_decide_where_they_are_known_and_are_refused_elsewhere(analysis):
    known = PEAKS | {name: small for name, (small, where) in OTHERS.items() if analysis in where}
    margins = limited(analysis, "{" + ", ".join(f"{name}: {small}" for name, small in known.items()) + "}").summary[
        "margins"
    ]
    assert {name.partition(".")[0] for name in margins} == set(known)
    assert all(item["exceeded"] for item in margins.values())
    for name in OTHERS.keys() - known.keys():
        with pytest.raises(ScenarioError, match=rf"limits\.{name}"):
            limited(analysis, f"{{{name}: {OTHERS[name][0]}}}")


def test_a_limit_whose_value_no_case_has_is_not_reliable():
    """Friction that holds has no linear motion beside it, so that no level of gapping is known."""
    solve, text = ANALYSES["study"]
    dry = "friction: [{name: dry, mass: 1, normal_force: 1 N, coefficient: 0.5}]\n"
    result = solve(beamsim.load_scenario(f"{MODEL}{dry}{text}limits: {{gapping: 50 %, peak_force: 1 kN}}\n"))
    assert {name: item["verdict"] for name, item in result.summary["margins"].items()} == {
        "gapping": "not reliable", "peak_force": "ok",
    }  # fmt: skip
