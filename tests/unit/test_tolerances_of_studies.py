"""Cases judged within tolerances: which numbers each realisation takes, and what is made of them."""

import csv

import numpy as np
import pytest

import beamsim
from beamsim.analyses.studies.plan import plan_designs
from beamsim.analyses.studies.summary import result_of
from beamsim.cases import CaseOutcome
from beamsim.errors import ScenarioError
from beamsim.outcomes import Outcome, OutcomeKind
from beamsim.scenario import load_scenario
from beamsim.store.export import export_result
from beamsim.store.results import write_result
from beamsim.trust.studies import design_study
from tests.fabricated import solved_case

BASE = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s, convergence: off}
"""
STIFFNESSES = [50e3, 100e3, 200e3]
FORCE = "snubbers/tip/peak_force"


def scenario(tolerances, limits="{peak_force: 30 N}", more="minimise: peak_force, responses: [peak_force], "):
    return load_scenario(
        f"{BASE}limits: {limits}\n"
        f"vary: {{kind: grid, {more}parameters: [{{path: snubbers.tip.stiffness, values: {STIFFNESSES}}}], "
        f"tolerances: {tolerances}}}\n"
    )


def of_forces(forces, tolerances, limits="{peak_force: 30 N}", more="minimise: peak_force, "):
    """A result with given forces (cases, realisations); nan: failed."""
    plan = plan_designs(scenario(tolerances, limits, more))
    assert len(plan.cases) == np.size(forces)
    outcomes = {}
    for k, force in enumerate(np.ravel(forces)):
        failed = Outcome.of(OutcomeKind.FAILED, "failed", "why")
        found = solved_case(plan.scenario.limits.values_by_name, k, {FORCE: float(force)})
        outcomes[k] = CaseOutcome(k, {}, failed) if np.isnan(force) else found
    return result_of(plan, outcomes)


def margins_of(result):
    return result["cases"]["margin"].sel(limit="peak_force").values


def test_deviations_are_about_the_value_in_each_case_and_the_same_in_all():
    plan = plan_designs(
        scenario(
            "{samples: 6, seed: 3, parameters: [{path: snubbers.tip.stiffness, tolerance: 10 %}, "
            "{path: snubbers.tip.gap, tolerance: 0.02 mm}, "
            "{path: beam.thickness, tolerance: 2 %, distribution: normal}]}"
        )
    )
    cases = [plan.study.scenario(case) for case in plan.cases]
    values = np.array([(c.snubbers[0].stiffness, c.snubbers[0].gap, c.beam.thickness) for c in cases]).reshape(3, 7, 3)
    np.testing.assert_array_equal(values[:, 0], [[k, 0.0, 5e-3] for k in STIFFNESSES])
    shares = values[:, :, 0] / np.array(STIFFNESSES)[:, None] - 1.0
    np.testing.assert_allclose(shares, np.broadcast_to(shares[0], shares.shape), atol=1e-15)
    np.testing.assert_array_equal(values[:, :, 1:], np.broadcast_to(values[0, :, 1:], (3, 7, 2)))
    for deviations in (shares[0, 1:] / 0.1, values[0, 1:, 1] / 2e-5):  # one in each sixth of the tolerance
        assert sorted(np.floor((deviations + 1.0) * 3.0)) == [0, 1, 2, 3, 4, 5]
    assert 0.0 < np.abs(values[0, 1:, 2] / 5e-3 - 1.0).max() <= 0.02


def test_each_realisation_is_a_run_with_its_numbers():
    result = design_study(
        scenario("{samples: 2, parameters: [{path: snubbers.tip.gap, tolerance: 0.05 mm}]}"), workers=1
    )
    gaps = 0.05e-3 * result["realisations"]["deviation"].values[0]
    realised = result["realisations"]["value"].sel(response=FORCE).values
    for i, stiffness in enumerate(STIFFNESSES):
        for j, gap in enumerate(gaps):
            case = load_scenario(
                BASE, [f"snubbers.tip.stiffness={stiffness!r}", f"snubbers.tip.gap={float(gap)!r}"]
            )  # fmt: skip
            force = beamsim.run(case).summary["peak_force_n"]["tip"]
            assert realised[i, j] == pytest.approx(force, rel=1e-12)
    np.testing.assert_array_equal(result.responses[FORCE].values, realised[:, 0])


FORCES = np.array([[10.0, 31.0, 12.0, 11.0, 13.0], [20.0, 21.0, 22.0, 23.0, 24.0], [5.0, 33.0, 32.0, 6.0, 7.0]])
FOUR = "samples: 4, parameters: [{path: beam.thickness, tolerance: 1 %}]"


def test_by_default_the_worst_realisation_judges():
    result = of_forces(FORCES, f"{{{FOUR}}}")
    np.testing.assert_allclose(margins_of(result), 30.0 / np.array([31.0, 24.0, 33.0]) - 1.0)
    assert result["cases"]["passing"].values.tolist() == [False, True, False]
    assert result.deciding_values(FORCE).tolist() == [31.0, 24.0, 33.0]
    np.testing.assert_allclose(result["cases"]["passing_share"].values, [0.8, 1.0, 0.6])
    assert [(item["case"], item["value"]) for item in result.summary["best"]] == [(1, 24.0)]
    assert result.summary["scatter"]["responses"][FORCE]["smallest"] == 20.0
    assert result.summary["scatter"]["responses"][FORCE]["nominal"] == 20.0
    met = result.summary["scatter"]["probability"]  # of the four deviations: the case itself is no draw
    assert (met["share"], met["cases"]) == (1.0, 4)
    assert met["low"] == pytest.approx(0.025**0.25, rel=1e-6)


def test_a_quantile_leaves_the_worst_realisations_out():
    result = of_forces(FORCES, f"{{quantile: 75 %, {FOUR}}}")
    np.testing.assert_allclose(margins_of(result), 30.0 / np.array([13.0, 23.0, 32.0]) - 1.0)
    assert result["cases"]["passing"].values.tolist() == [True, True, False]
    assert result.deciding_values(FORCE).tolist() == [13.0, 23.0, 32.0]
    assert [(item["case"], item["value"]) for item in result.summary["best"]] == [(0, 13.0), (1, 23.0)]


def test_of_a_response_that_shall_be_large_the_smallest_counts():
    result = of_forces(FORCES, f"{{{FOUR}}}", "{peak_force: 50 N}", "maximise: peak_force, ")
    assert [(item["case"], item["value"]) for item in result.summary["best"]] == [(1, 20.0), (0, 10.0), (2, 5.0)]
    assert result.deciding_values(FORCE).tolist() == [10.0, 20.0, 5.0]


@pytest.mark.parametrize(("goal", "of_known", "best"), [("minimise", [10, 8, 7], 2), ("maximise", [9, 8, 7], 0)])
def test_the_worst_place_of_those_that_a_case_has_judges_it(goal, of_known, best):
    """A case without a curve is judged by the curves that it has: by margins, pictures and the choice alike."""
    plan = plan_designs(scenario("null", more=f"{goal}: peak_force, "))
    forces = [{"up_0": 9.0, "down_0": 10.0}, {"up_0": 8.0}, {"down_0": 7.0}]
    outcomes = {
        k: solved_case(
            plan.scenario.limits.values_by_name, k, {f"{curve}/{FORCE}": force for curve, force in of.items()}
        )
        for k, of in enumerate(forces)
    }
    result = result_of(plan, outcomes)
    assert result.deciding_values(*result.responses).tolist() == of_known
    assert {item["case"]: item["value"] for item in result.summary["best"]} == dict(enumerate(of_known))
    assert result.summary["best"][0]["case"] == best
    np.testing.assert_allclose(margins_of(result), 30.0 / np.array([10.0, 8.0, 7.0]) - 1.0)


def test_a_limit_that_no_response_is_compared_with_is_not_met():
    result = of_forces(FORCES, f"{{{FOUR}}}", "{peak_force: 50 N, gap: 1 mm}")
    assert result["cases"]["passing"].values.tolist() == [False, False, False]
    assert "best" not in result.summary
    assert any("limits.gap: no case has a value" in warning for warning in result.warnings)


def test_a_case_with_a_realisation_that_failed_does_not_pass(tmp_path):
    forces = FORCES.copy()
    forces[1, 3] = np.nan
    result = of_forces(forces, f"{{{FOUR}}}")
    assert result["cases"]["passing"].values.tolist() == [False, False, False]
    assert result.summary["failed"] == 1
    assert result["cases"]["failure"].values.tolist() == ["", "why", ""]
    assert result.outcome.code == "cases_failed"
    export_result(write_result(result, tmp_path / "study.h5"), tmp_path / "tables", "csv")
    place = tmp_path / "tables" / "cases_by_case.csv"
    with open(place, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    place = tmp_path / "tables" / "realisations_by_case_and_realisation.csv"
    with open(place, encoding="utf-8") as file:
        realised = [float(row[next(name for name in row if "force" in name)]) for row in csv.DictReader(file)]
    largest = np.reshape(realised, (3, -1)).max(axis=1)
    assert np.isnan(largest[1])
    assert largest[2] == 33.0
    assert [float(row["passing_share"]) for row in rows] == pytest.approx([0.8, 0.8, 0.6])


def test_where_the_deciding_realisation_is_missing_in_every_case_nothing_is_known_of_the_limit():
    """It ended in an internal error, and the cases that were solved were lost with their result file."""
    plan = plan_designs(scenario(f"{{{FOUR}}}"))
    given = plan.scenario.limits.values_by_name
    known = {k: solved_case(given, k, {FORCE: 10.0}) for k in range(len(plan.cases)) if k % 5 != 3}
    result = result_of(plan, known)
    margin = result.summary["margins"]["peak_force"]
    assert (margin["limit"], margin["verdict"], margin["cases_exceeding"]) == (30.0, "not reliable", 0)
    assert np.isnan(margin["value"])
    assert "case" not in margin
    assert result.outcome.code == "cases_missing"
    assert result["cases"]["passing"].values.tolist() == [False] * 3
    assert np.isfinite(result["realisations"]["value"].values).sum() == 12


def test_a_case_known_in_part_is_compared_only_if_one_of_its_realisations_is():
    plan = plan_designs(scenario(f"{{{FOUR}}}"))
    given = plan.scenario.limits.values_by_name
    known = {k: solved_case(given, k, {FORCE: 10.0}, compared=k == 5) for k in (0, 1, 5)}
    result = result_of(plan, known)
    assert result["cases"]["compared"].values.tolist() == [False, True, False]
    assert result.summary["compared"] == 1
    assert result.summary["solved"] == 0


def test_a_search_none_of_whose_designs_is_known_in_full_has_no_cases(tmp_path):
    """It was interrupted among the realisations of its first design, which ended in an internal error."""
    plan = plan_designs(
        load_scenario(
            f"{BASE}limits: {{peak_force: 30 N}}\noptimise: {{minimise: peak_force, parameters: "
            f"[{{path: snubbers.tip.gap, from: 0 mm, to: 1 mm}}], tolerances: {{{FOUR}}}}}\n"
        )
    )
    result = result_of(plan, {0: solved_case(plan.scenario.limits.values_by_name, 0, {FORCE: 10.0}, given=(0.0,))})
    assert (result.count, result.outcome.code) == (0, "cases_missing")
    assert result.summary["varied"] == {"snubbers.tip.gap": {"values": 0, "unit": "m"}}
    read = beamsim.load(write_result(result, tmp_path / "search.h5"))
    assert read["cases"]["parameter_value"].values.shape == (1, 0)
    assert read.summary == result.summary
    assert "has tried 0 of at most" in str(read)
    assert read.plot() == {}


def test_a_number_that_is_varied_with_others_has_a_tolerance_with_them():
    both = "[{name: tip, position: 270 mm, side: below, stiffness: 1 kN/m}, {name: top, position: 270 mm, side: above, "
    text = BASE.replace("snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]", (
        f"snubbers: {both}stiffness: 1 kN/m}}]"
    )) + (
        "vary: {kind: grid, parameters: [{path: 'snubbers[*].stiffness', values: [1 kN/m, 2 kN/m]}], "
        "tolerances: {parameters: [{path: %s, tolerance: 1 %%}]}}"
    )  # fmt: skip
    with pytest.raises(ScenarioError, match=r"is varied in part, as snubbers\[\*\]\.stiffness"):
        load_scenario(text % "snubbers.tip.stiffness")
    plan = plan_designs(load_scenario(text % "'snubbers[*].stiffness'"))
    stiffnesses = [[s.stiffness for s in plan.study.scenario(case).snubbers] for case in plan.cases]
    assert all(tip == top for tip, top in stiffnesses)
    assert len({tip for tip, _ in stiffnesses}) == 2 * 21


def test_an_objective_at_an_unknown_place_is_found_before_any_case_is_solved():
    with pytest.raises(ScenarioError, match="no tipp"):
        plan_designs(scenario(f"{{{FOUR}}}", more="minimise: snubbers/tipp/peak_force, "))
