"""What a case of a study does, and what is done once for all of them: counts of work, not times."""

import itertools

import pytest

import beamsim
from beamsim.analyses.designs.plan import Case, plan_draws
from beamsim.scenario import load_scenario

BASE = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  damping: {kind: modal, ratio: 1 %}, supports: {left: clamped, right: free}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm,
  damping: {kind: ratio, ratio: 2 %}}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.1 s}
"""


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("snubbers.tip.stiffness", -5.0, "snubbers[0].stiffness = -5 must be positive"),
        ("beam.thickness", float("nan"), "beam.thickness"),
        ("beam.length", 0.2, "snubbers[0].position"),
        ("excitation.frequency", 1e9, "run.sample_rate"),
    ],
)
def test_a_bad_number_gives_the_located_error_of_a_whole_scenario(path, value, message):
    base = load_scenario(BASE.replace("0.1 s", "0.1 s, sample_rate: 1 kHz"))
    study = plan_draws(base, {path: [value]}).study
    with pytest.raises(beamsim.ScenarioError) as drawn:
        study.scenario(Case(0, (value,)))
    with pytest.raises(beamsim.ScenarioError) as whole:
        load_scenario(BASE.replace("0.1 s", "0.1 s, sample_rate: 1 kHz, convergence: off"), {path: value})
    assert message in str(drawn.value)
    assert [(p.path, p.message) for p in drawn.value.problems] == [(p.path, p.message) for p in whole.value.problems]


@pytest.mark.parametrize("side", ["below", "above"])
def test_the_figures_of_a_case_are_those_of_its_run(side):
    vary = {"kind": "grid", "parameters": [{"path": "snubbers.tip.stiffness", "values": [50e3, 200e3]},
                                           {"path": "snubbers.tip.gap", "values": [-1e-4, 1e-4]}]}  # fmt: skip
    base = load_scenario(BASE.replace("side: below", f"side: {side}"))
    found = beamsim.design_study(load_scenario(base, {"vary": vary}), workers=1).responses
    for (i, stiffness), (j, gap) in itertools.product(enumerate([50e3, 200e3]), enumerate([-1e-4, 1e-4])):
        changes = {"snubbers.tip.stiffness": stiffness, "snubbers.tip.gap": gap, "run.convergence": "off"}
        alone = beamsim.run(load_scenario(base, changes)).summary
        for response, figure in (
            ("snubbers/tip/peak_force", "peak_force_n"), ("probes/tip/peak_displacement", "peak_displacement_m"),
        ):  # fmt: skip
            assert found[response].values[i, j] == pytest.approx(alone[figure]["tip"], rel=1e-10)
            assert alone[figure]["tip"] > 0
