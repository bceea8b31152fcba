"""What a case of a study does, and what is done once for all of them: counts of work, not times."""

import importlib

import numpy as np
import pytest

import beamsim
from beamsim.analyses.designs.analysis import design_study
from beamsim.analyses.designs.cases import CaseSolver
from beamsim.analyses.designs.plan import plan_designs, plan_draws
from beamsim.analyses.designs.responses import entries_of_result, run_responses
from beamsim.scenario import load_scenario

BASE = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  damping: {kind: modal, ratio: 1 %}, supports: {left: clamped, right: free}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm,
  damping: {kind: ratio, ratio: 2 %}}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.1 s}
"""
CONTACT = """\
vary:
  kind: grid
  parameters:
    - {path: snubbers.tip.stiffness, values: [50 kN/m, 100 kN/m, 200 kN/m]}
    - {path: snubbers.tip.gap, from: -0.1 mm, to: 0.1 mm, points: 3}
    - {path: excitation.level, values: [1 g, 2 g]}
"""
BEAM = "vary: {kind: grid, parameters: [{path: beam.thickness, from: 4 mm, to: 6 mm, points: 3}]}\n"


@pytest.fixture
def counted(monkeypatch):
    """Counts the calls of functions, given by the module that calls them and their name."""
    counts = {}

    def count(module, name):
        module, _, inside = module.partition(":")
        owner = importlib.import_module(module)
        owner = getattr(owner, inside) if inside else owner
        real = getattr(owner, name)

        def called(*arguments, **options):
            counts[name] = counts.get(name, 0) + 1
            return real(*arguments, **options)

        monkeypatch.setattr(owner, name, called)

    for module, name in (
        ("beamsim.system.parts", "assemble"),
        ("beamsim.system.parts", "reduce_model"),
        ("beamsim.structures.reduction", "natural_modes"),
        ("beamsim.system.build", "receptance_bound"),
        ("importlib.metadata", "version"),
        ("beamsim.flow.exact", "contact_modes"),
        ("beamsim.analyses.run.motion", "spectra_of_motion"),
        ("beamsim.structures.recovery:BeamModel", "recovery"),
        ("beamsim.flow.trajectory:Trajectory", "extrema"),
        ("scipy.sparse.linalg", "splu"),
    ):
        count(module, name)
    return counts


@pytest.mark.parametrize("workers", [1, 4])
def test_cases_that_differ_in_contact_and_level_share_the_structure(counted, workers):
    result = design_study(load_scenario(BASE + CONTACT), workers=workers)
    assert result.cases == 18
    assert counted["assemble"] == counted["reduce_model"] == counted["natural_modes"] == 1
    assert counted.get("version", 0) < result.cases  # of the table alone
    assert "spectra_of_motion" not in counted
    assert "receptance_bound" not in counted
    assert counted["contact_modes"] <= 2 * 18 + 2  # open and closed, and those of a motion that loads the kernels


def test_what_is_not_asked_for_is_not_built(counted):
    scenario = load_scenario(BASE)
    beamsim.ensemble(scenario, {"snubbers.tip.gap": [0.0, 1e-4]}, ["peak_force"], workers=1)
    assert "recovery" not in counted
    assert counted["extrema"] == 2  # one search for all extremes of a case
    beamsim.ensemble(scenario, {"snubbers.tip.gap": [0.0, 1e-4]}, ["bending_stress"], workers=1)
    assert counted["recovery"] == 2  # of each case
    counted.clear()
    beamsim.ensemble(scenario, {"beam.thickness": [4e-3, 5e-3]}, ["bending_stress"], workers=1)
    assert counted["splu"] == 2  # the stiffness of each beam, for all static deflections


def test_cases_that_differ_in_the_beam_build_it_once_each(counted):
    design_study(load_scenario(BASE + BEAM), workers=1)
    assert counted["assemble"] == counted["reduce_model"] == 3


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
        study.scenario((value,))
    with pytest.raises(beamsim.ScenarioError) as whole:
        load_scenario(BASE.replace("0.1 s", "0.1 s, sample_rate: 1 kHz, convergence: off"), {path: value})
    assert message in str(drawn.value)
    assert [(p.path, p.message) for p in drawn.value.problems] == [(p.path, p.message) for p in whole.value.problems]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("side: below", "side: above"),
        ("snubbers:", "probes: [{name: a, position: 100 mm}, {name: b, position: 200 mm}]\nsnubbers:"),
        ("snubbers:", "gravity: 1 g\nsnubbers:"),
    ],
)
def test_the_figures_of_a_case_are_those_of_its_run(old, new):
    plan = plan_designs(load_scenario(BASE.replace(old, new, 1) + CONTACT))
    solver = CaseSolver(plan.study)
    task = plan.tasks[7]
    whole = run_responses(entries_of_result(beamsim.run(plan.study.scenario(task.values))))
    case = solver.solve(task).values
    assert list(case) == list(whole)
    assert max(whole.pop("energy_error"), case["energy_error"]) < 1e-9
    for name, value in whole.items():
        np.testing.assert_allclose(case[name], value, rtol=1e-10, err_msg=name)
