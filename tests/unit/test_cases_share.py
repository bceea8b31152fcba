"""What a case of a study does, and what is done once for all of them: counts of work, not times."""

import itertools

import pytest

import beamsim
from beamsim.analyses.studies.plan import plan_draws
from beamsim.cases import Case
from beamsim.flow.trajectory import Trajectory
from beamsim.scenario import load_scenario
from beamsim.scenario.units import STANDARD_GRAVITY

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
    """Bodies that differ in damping alone have their shapes and their stations in common."""
    varied = {"snubbers.tip.stiffness": [50e3, 200e3], "snubbers.tip.gap": [-1e-4, 1e-4],
              "beam.damping.ratio": [0.01, 0.03]}  # fmt: skip
    vary = {"kind": "grid", "parameters": [{"path": path, "values": values} for path, values in varied.items()]}
    base = load_scenario(BASE.replace("side: below", f"side: {side}"), {"run.convergence": "off"})
    found = beamsim.design_study(load_scenario(base, {"vary": vary}), workers=1).responses
    for case, at in enumerate(itertools.product(range(2), repeat=3)):
        changes = {path: values[k] for (path, values), k in zip(varied.items(), at, strict=True)}
        alone = beamsim.run(load_scenario(base, changes)).summary
        for response, figure in (
            ("snubbers/tip/peak_force", "peak_force_n"), ("snubbers/tip/largest_gap", "largest_gap_m"),
            ("probes/tip/peak_displacement", "peak_displacement_m"),
            ("probes/tip/peak_acceleration", "peak_acceleration_g"), ("bending_stress", "largest_bending_stress_pa"),
            ("bending_stress_position", "largest_bending_stress_position_m"), ("energy_error", "energy_error"),
        ):  # fmt: skip
            expected = alone[figure]["tip"] if isinstance(alone[figure], dict) else alone[figure]
            scale = STANDARD_GRAVITY if figure.endswith("_g") else 1.0
            assert found[response].values[case] == pytest.approx(expected * scale, rel=1e-10), response
        assert alone["peak_force_n"]["tip"] > 0


def test_the_largest_stress_is_searched_for_once_along_the_beam(monkeypatch):
    """A case asks for no other peak than the largest: stations that stay below it are not searched."""
    evaluations = {}
    whole = Trajectory.extrema
    for each, name in ((beamsim.run, "run"), (beamsim.design_study, "study")):

        def counted(*args, name=name, **options):
            found = whole(*args, **options)
            evaluations[name] = evaluations.get(name, 0) + found.evaluations
            return found

        monkeypatch.setattr(Trajectory, "extrema", counted)
        vary = {} if name == "run" else {"vary": {"kind": "grid", "responses": ["bending_stress"], "parameters": [
            {"path": "excitation.level", "values": [19.6]}]}}  # fmt: skip
        each(load_scenario(BASE, {"beam.elements": 100, "run.convergence": "off", **vary}))
    assert evaluations["study"] < 0.5 * evaluations["run"]
