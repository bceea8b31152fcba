"""A design study is the same as its cases run one by one, whoever computes them."""

import math
import multiprocessing
import os
import signal

import numpy as np
import pytest
from scipy.stats import kstest, truncnorm

from beamsim.analyses.studies.plan import check_cases, plan_designs
from beamsim.analyses.studies.responses import place_of, quantity_of
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.trust import studies
from beamsim.trust.studies import design_study

pytestmark = pytest.mark.portable

BASE = """\
title: Small study
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.03 s, convergence: off}
limits: {peak_force: 20 N, bending_stress: 80 MPa, gap: 1 mm, peak_displacement: 1 mm, peak_acceleration: 100 g}
"""
GRID = """\
vary:
  kind: grid
  parameters:
    - {path: snubbers.tip.stiffness, values: [50 kN/m, 200 kN/m]}
    - {path: excitation.frequency, from: 50 Hz, to: 120 Hz, points: 3}
"""


def table(result):
    return {name: response.values for name, response in result.responses.items()}


def assert_same(one, other):
    assert list(table(one)) == list(table(other))
    for name, values in table(one).items():
        np.testing.assert_array_equal(values, table(other)[name], err_msg=name)
    np.testing.assert_array_equal(one["cases"]["solved"].values, other["cases"]["solved"].values)


@pytest.fixture(scope="module")
def grid():
    return design_study(load_scenario(BASE + GRID), workers=1)


def test_the_responses_asked_for_and_those_with_limits_are_computed(grid):
    result = design_study(load_scenario(BASE + GRID, {"vary.responses": ["contacts"]}), workers=1)
    quantities = {quantity_of(name) for name in result.responses}
    assert quantities == {
        "contacts", "peak_force", "bending_stress", "largest_gap", "peak_displacement", "peak_acceleration"
    }  # fmt: skip
    for name, response in result.responses.items():
        np.testing.assert_allclose(response.values, grid.responses[name].values, rtol=1e-10)
    margins = [study["cases"]["margin"].sel(limit="peak_force").values for study in (result, grid)]
    np.testing.assert_allclose(*margins, rtol=1e-9)
    with pytest.raises(
        ScenarioError, match=r"vary.responses\[1\] = peak_forse is not a response; did you mean peak_force"
    ):
        plan_designs(load_scenario(BASE + GRID, {"vary.responses": ["contacts", "peak_forse"]}))


def test_margins_are_limit_over_value_less_one(grid):
    force = grid.responses["snubbers/tip/peak_force"].values
    margin = grid["cases"]["margin"].sel(limit="peak_force").values
    np.testing.assert_allclose(margin, 20.0 / force - 1.0, rtol=1e-14)
    worst = grid.summary["margins"]["peak_force"]
    assert worst["value"] == force.max()
    assert worst["exceeded"] == bool(force.max() > 20.0)
    assert worst["cases_exceeding"] == int((force > 20.0).sum())
    where = np.unravel_index(force.argmax(), grid.shape)
    assert worst["parameters"]["snubbers.tip.stiffness"] == (50e3, 200e3)[where[0]]
    assert {path: grid.table[path][worst["case"]] for path in worst["parameters"]} == worst["parameters"]


def test_two_workers_of_which_one_is_killed_make_no_difference(grid):
    solved, fractions = [], []

    def each(outcome):
        solved.append(outcome.index)
        if len(solved) == 1:
            os.kill(multiprocessing.active_children()[0].pid, signal.SIGTERM)

    two = design_study(load_scenario(BASE + GRID), workers=2, on_outcome=each, progress=fractions.append)
    assert_same(grid, two)
    assert sorted(solved) == list(range(6))
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_known_cases_are_not_computed_again(grid):
    plan = plan_designs(load_scenario(BASE + GRID))
    seen = []
    first = design_study(plan, workers=1, on_outcome=seen.append)
    known = [outcome for outcome in seen if outcome.index % 2]
    again = []
    assert_same(first, design_study(plan, workers=1, solved_before=known, on_outcome=again.append))
    assert sorted(outcome.index for outcome in again) == [0, 2, 4]
    nothing = []
    assert_same(grid, design_study(plan, workers=1, solved_before=seen, on_outcome=nothing.append))
    assert nothing == []


SEARCH = """
optimise:
  minimise: peak_force
  most_cases: 24
  parameters: [{path: snubbers.tip.gap, from: 0 mm, to: 0.3 mm}]
"""


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_makes_no_difference(grid):
    """In a process of its own, which solves two cases at once."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=True, dashboard_address=":0", host="127.0.0.1"
    ) as cluster:
        result = design_study(load_scenario(BASE + GRID), scheduler=cluster.scheduler_address)
        searched = [design_study(load_scenario(BASE + SEARCH), **of) for of in (
            {"workers": 1}, {"scheduler": cluster.scheduler_address},
        )]  # fmt: skip
    assert_same(grid, result)
    assert_same(*searched)


def test_nobody_at_the_address(monkeypatch):
    distributed = pytest.importorskip("distributed")

    def nobody(*_, **__):
        raise OSError("timed out\nand more")

    monkeypatch.setattr(distributed, "Client", nobody)
    with pytest.raises(ScenarioError, match=r"tcp://nowhere:1: no scheduler answers \(timed out\)"):
        design_study(load_scenario(BASE + GRID), scheduler="tcp://nowhere:1")


def test_without_dask_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ScenarioError, match="pip install"):
        design_study(load_scenario(BASE + GRID), scheduler="tcp://nowhere:1")


def test_words_and_whole_numbers_are_varied_too():
    text = BASE + (
        "vary:\n  kind: grid\n  parameters:\n"
        "    - {path: beam.supports.right, values: [free, guided]}\n"
        "    - {path: beam.elements, from: 3, to: 5, points: 3}\n"
    )
    plan = plan_designs(load_scenario(text))
    assert [case.values for case in plan.cases[:3]] == [("free", 3), ("free", 4), ("free", 5)]
    check_cases(plan)
    result = design_study(plan, workers=1)
    assert result.complete
    f = result.responses["open_frequencies_hz"].values[:, 0].reshape(result.shape)
    assert np.all(f[1] > f[0])  # a guided end stiffens
    assert result.parameters[0].values.tolist() == ["free"] * 3 + ["guided"] * 3
    assert np.ptp(f[0]) < 1e-3 * f[0, 0]


def test_zipped_values_go_together():
    text = BASE + (
        "vary:\n  kind: zip\n  parameters:\n"
        "    - {path: beam.length, values: [250 mm, 290 mm]}\n"
        "    - {path: snubbers.tip.position, values: [250 mm, 290 mm]}\n"
    )
    result = design_study(load_scenario(text, {"snubbers[0].position": "250 mm"}), workers=1)
    assert result.complete
    assert result.shape == (2,)
    assert [p.values[1] for p in result.parameters] == [0.29, 0.29]


def test_a_latin_hypercube_has_one_value_in_every_part_of_every_range():
    n = 40
    text = BASE + (
        f"vary:\n  kind: latin_hypercube\n  samples: {n}\n  seed: 5\n  parameters:\n"
        "    - {path: snubbers.tip.stiffness, from: 10 kN/m, to: 1000 kN/m, spacing: logarithmic}\n"
        "    - {path: beam.thickness, tolerance: 3 %, distribution: normal}\n"
        "    - {path: snubbers.tip.gap, tolerance: 0.1 mm}\n"
        "    - {path: beam.elements, from: 3, to: 6}\n"
    )
    scenario = load_scenario(text)
    stiffness, thickness, gap, elements = (p.values for p in plan_designs(scenario).parameters)

    def parts(u):
        return sorted(np.floor(u * n).astype(int))

    assert parts(np.log(stiffness / 1e4) / math.log(100.0)) == list(range(n))
    assert parts((gap + 1e-4) / 2e-4) == list(range(n))
    deviation = (thickness - 5e-3) / (0.03 * 5e-3) * 3.0
    assert parts(truncnorm.cdf(deviation, -3.0, 3.0)) == list(range(n))
    assert kstest(deviation, truncnorm(-3.0, 3.0).cdf).pvalue > 0.9
    assert set(elements) == {3.0, 4.0, 5.0, 6.0}
    again = plan_designs(load_scenario(text))
    other = plan_designs(load_scenario(text.replace("seed: 5", "seed: 6")))
    np.testing.assert_array_equal(again.parameters[0].values, stiffness)
    assert again.fingerprint == plan_designs(scenario).fingerprint != other.fingerprint
    assert np.any(other.parameters[0].values != stiffness)


def test_a_case_that_cannot_be_solved_is_part_of_the_result():
    text = BASE + "vary: {kind: grid, parameters: [{path: run.max_events, values: [2, 1000000]}]}\n"
    result = design_study(load_scenario(text), workers=1)
    assert not result.complete
    assert result["cases"]["solved"].values.tolist() == [False, True]
    assert "1 of 2 cases failed; the first is case 1:" in result.status
    assert result["cases"]["failure"].values.astype(bool).tolist() == [True, False]
    force = result.responses["snubbers/tip/peak_force"].values
    assert np.isnan(force[0])
    assert force[1] > 0.0
    assert result.summary["margins"]["peak_force"]["case"] == 1


def test_values_that_make_no_scenario_together_are_named_before_computing():
    text = BASE + (
        "vary:\n  kind: grid\n  parameters:\n"
        "    - {path: beam.length, values: [200 mm, 300 mm]}\n"
        "    - {path: snubbers.tip.position, values: [150 mm, 250 mm]}\n"
    )
    scenario = load_scenario(text, {"snubbers[0].position": "200 mm"})
    with pytest.raises(ScenarioError) as caught:
        design_study(scenario, workers=1)
    (problem,) = caught.value.problems
    assert "with beam.length = 0.2 m, snubbers.tip.position = 0.25 m" in problem.message
    assert "lies beyond" in problem.message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BASE, "vary is missing"),
        (BASE.replace("run: {duration: 0.03 s, convergence: off}\n", "") + GRID, "run is missing"),
    ],
)
def test_studies_without_sense(text, message):
    with pytest.raises(ScenarioError, match=message):
        design_study(load_scenario(text))


def test_a_study_of_sweeps():
    text = BASE[: BASE.index("limits")] + (
        "sweep: {kind: swept_sine, from: 60 Hz, to: 95 Hz, rate: 240 oct/min, direction: up, convergence: off}\n"
        "limits: {peak_force: 1 N}\n"
        "vary: {kind: grid, parameters: [{path: snubbers.tip.stiffness, values: [20 kN/m, 200 kN/m]}]}\n"
    )
    scenario = load_scenario(text)
    result = design_study(scenario, workers=1)
    assert result.complete, result.status
    assert result.summary["analysis"] == "swept_sine"
    resonance = result.responses["up_0/probes/tip/resonance_frequency"].values
    assert resonance[1] > resonance[0]  # a stiffer snubber
    assert place_of("down_0/snubbers/tip/peak_force") == "tip down_0"
    from beamsim.analyses.sweep.analysis import sweep

    alone = sweep(load_scenario(text, {"snubbers[0].stiffness": 200e3}))
    assert result.responses["up_0/probes/tip/peak_displacement"].values[1] == pytest.approx(
        alone.curves["up_0"].channel("displacement", "tip").peak.max(), rel=1e-9
    )
    assert result.summary["margins"]["peak_force"]["exceeded"]


def test_a_case_that_raises_is_recorded_and_the_others_go_on(grid, monkeypatch):
    def fail(scenario, *args, solve=studies.run, **options):
        if scenario.excitation.frequency == 50.0:
            raise TypeError("no such operation")
        return solve(scenario, *args, **options)

    monkeypatch.setattr(studies, "run", fail)
    result = design_study(load_scenario(BASE + GRID), workers=1)
    assert result["cases"]["solved"].values.tolist() == [False, True, True] * 2
    text = "internal error (TypeError: no such operation) in 2 attempts"
    assert result["cases"]["failure"].values.tolist() == [text, "", ""] * 2
    force = grid.responses["snubbers/tip/peak_force"].values
    known = result["cases"]["solved"].values
    np.testing.assert_array_equal(result.responses["snubbers/tip/peak_force"].values[known], force[known])
