"""The search for the worst within tolerances: what it solves, what it says, and where it is kept."""

from itertools import product

import numpy as np
import pytest

import beamsim
from beamsim import load_scenario
from beamsim.analyses.studies.plan import check_cases, plan_designs
from beamsim.cli.studies import design_screen
from beamsim.plots.studies import design_figures
from beamsim.store.results import write_result
from beamsim.store.studies import journal_path, opened_journal, stored_study
from beamsim.trust.studies import CaseSolver, design_study
from tests.fabricated import solved_case

FORCE = "snubbers/stop/peak_force"
K, S, GAP, START = 8e3, 3e4, 1e-3, 4e-3


def force(k, s, g):
    """Largest force of an undamped oscillator released at START: k x0^2 = k (g + d)^2 + s d^2."""
    d = (-k * g + np.sqrt((k * g) ** 2 - (k + s) * k * (g**2 - START**2))) / (k + s)
    return s * d


CASE = f"""
chain: {{masses: [2.0], springs: [{K}], snubbers: [{{name: stop, mass: 1, side: below, stiffness: {S}, gap: 1 mm}}]}}
excitation: {{kind: none}}
probes: [{{name: mass, mass: 1}}]
run: {{duration: 0.3, start: {{displacement: [{START}]}}, convergence: off}}
"""


def study(gaps=(GAP, 2e-3), more="", limit="100 N", samples=4):
    return load_scenario(f"""{CASE}
limits: {{peak_force: {limit}}}
vary:
  kind: grid
  minimise: peak_force
  responses: [peak_force, peak_displacement]
  parameters: [{{path: chain.snubbers.stop.gap, values: {list(gaps)}}}]
  tolerances:
    samples: {samples}
    {more}
    parameters:
      - {{path: "chain.springs[0]", tolerance: 10 %}}
      - {{path: chain.snubbers.stop.stiffness, tolerance: 20 %}}
      - {{path: chain.snubbers.stop.gap, tolerance: 0.3 mm}}
""")


WORST = force(1.1 * K, 1.2 * S, 2e-3 - 3e-4)


@pytest.fixture(scope="module")
def solved():
    """The result of the study as it stands, and the outcomes of its cases in the order in which they were solved."""
    outcomes = []
    return design_study(study(), on_outcome=outcomes.append), outcomes


def test_the_worst_is_the_closed_form_at_its_corner(solved):
    result, _ = solved
    worst = result.summary["worst"]
    assert (worst["case"], worst["kind"], worst["most_further_cases"]) == (1, "searched", 150)
    assert worst["by"]["peak_force"]["value"] == pytest.approx(WORST, rel=1e-9)
    assert list(worst["by"]["peak_force"]["deviations"].values()) == [1.0, 1.0, -1.0]
    assert worst["by"]["peak_force"]["of_sample"] < 0.97 * WORST
    best = result.summary["best"]
    assert (best[0]["value"], best[0]["worst"]) == (pytest.approx(WORST, rel=1e-9), "searched")
    assert best[1]["worst"] == "sampled"
    np.testing.assert_allclose(result.deciding_values(FORCE)[1], WORST, rtol=1e-9)
    of = result.summary["scatter"]["responses"]
    assert (of[FORCE]["largest"], of[FORCE]["largest_is"]) == (pytest.approx(WORST, rel=1e-9), "searched")
    assert (of[FORCE]["smallest_is"], of["probes/mass/peak_displacement"]["largest_is"]) == ("sampled", "sampled")


def test_every_printed_worst_is_called_sampled_or_searched(solved, tmp_path):
    result, _ = solved
    screen = design_screen(result)
    text = "\n".join(map(str, [screen.rows, *screen.lines]))
    count = result.summary["worst"]["further_cases"]
    assert f"worst of the best case within its tolerances: searched with {count} further cases of at most 150" in text
    assert "worst peak force" in text
    assert "stop gap -0.3 mm" in text
    assert "(worst sampled)" in text  # of the limit, in the other case
    title = next(iter(design_figures(result).values())).title
    assert "sample of 5 realisations within the tolerances; limits and objective of the best case searched" in title
    again = beamsim.load(write_result(result, tmp_path / "study.h5"))
    assert (again.summary["worst"], again.summary["best"]) == (result.summary["worst"], result.summary["best"])
    further = again["further_realisations"]
    assert further["further_case"].values.tolist() == [1] * count
    assert further["value"].sel(response=FORCE).values.max() == pytest.approx(WORST, rel=1e-9)
    np.testing.assert_array_equal(again.deciding_values(FORCE), result.deciding_values(FORCE))


def test_a_design_whose_searched_worst_exceeds_a_limit_is_not_the_best():
    """The sample of the second design meets the limit, and its corner does not; nor does the first there."""
    sampled = design_study(study(more="worst_cases: 0"))
    assert (sampled.summary["best"][0]["case"], sampled.summary["best"][0]["worst"]) == (1, "sampled")
    assert sampled.summary["worst"]["kind"] == "sampled"
    between = 0.5 * (sampled.summary["best"][0]["value"] + WORST)
    result = design_study(study(gaps=(1.9e-3, 2e-3), limit=f"{between} N"))
    assert "best" not in result.summary
    searched = result["further_realisations"]["further_case"].values[
        0
    ]  # the better one; the other is tried in its worst
    assert (searched, result.summary["margins"]["peak_force"]["case"]) == (1, 0)
    assert result.summary["margins"]["peak_force"]["worst"] == "tried where others are worst"
    assert result["cases"]["passing"].values.tolist() == [False, False]


def test_a_budget_that_ends_is_said():
    result = design_study(study(more="worst_cases: 5"))
    assert result.summary["worst"]["further_cases"] == 5
    assert result.summary["worst"]["kind"] == "search not finished"
    assert any("vary.tolerances.worst_cases = 5 ended the search" in text for text in result.warnings)


def test_a_quantile_is_not_searched():
    result = design_study(study(samples=20, more="quantile: 90 %"))
    assert "worst" not in result.summary
    assert "worst" not in result.summary["best"][0]
    assert "further_realisations" not in result.datasets


def test_a_search_that_was_interrupted_goes_on_with_what_is_in_the_journal(solved, tmp_path):
    (whole, kept), plan, target = solved, plan_designs(study()), tmp_path / "study.h5"
    check_cases(plan)
    with opened_journal(journal_path(target), plan.fingerprint, resume=False) as journal:
        for outcome in kept[:-7]:
            journal.add(outcome)
    with opened_journal(journal_path(target), plan.fingerprint, resume=True) as journal:
        before = len(journal.solved)
        again, _ = stored_study(plan, journal, target)
        assert len(journal.solved) - before == 7
    assert again.summary["worst"] == whole.summary["worst"]
    values = [of["further_realisations"]["value"].values for of in (again, whole)]
    np.testing.assert_array_equal(*values)


@pytest.mark.parametrize("seed", range(2))
def test_a_search_with_three_tolerances_finds_the_best_of_a_grid(monkeypatch, seed):
    """Designs that are best by their samples are up to 28 % worse than the optimum, or exceed the limit in a corner."""
    limit = 2.6e-3

    def responses(gap, stiffness, spring=0.0, more=0.0, shift=0.0):
        s, g = stiffness * (1.0 + more), gap + shift
        found = force(K * (1.0 + spring), s, g)
        return found, g + found / s

    def solve(solver, case):
        deviations = case.deviations or solver.study.realisations.deviations[case.realisation]
        found = responses(*case.values, *np.array([0.1, 0.2, 3e-4]) * deviations)
        names = FORCE, "probes/mass/peak_displacement"
        values = dict(zip(names, map(float, found), strict=True))
        return solved_case({"peak_displacement": limit}, case.number, values, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    scenario = load_scenario(f"""{CASE}
limits: {{peak_displacement: {limit}}}
optimise:
  minimise: peak_force
  most_cases: 120
  seed: {seed}
  parameters:
    - {{path: chain.snubbers.stop.gap, from: 0.5 mm, to: 3 mm}}
    - {{path: chain.snubbers.stop.stiffness, from: 5 kN/m, to: 500 kN/m, spacing: logarithmic}}
  tolerances:
    samples: 4
    parameters:
      - {{path: "chain.springs[0]", tolerance: 10 %}}
      - {{path: chain.snubbers.stop.stiffness, tolerance: 20 %}}
      - {{path: chain.snubbers.stop.gap, tolerance: 0.3 mm}}
""")
    grid = np.meshgrid(np.linspace(5e-4, 3e-3, 601), np.geomspace(5e3, 5e5, 601), indexing="ij")
    corners = [responses(*grid, *c) for c in product((-0.1, 0.1), (-0.2, 0.2), (-3e-4, 3e-4))]
    forces, depths = np.max(corners, axis=0)
    result = design_study(scenario)
    best = result.summary["best"][0]
    assert result.complete
    assert best["worst"] == result.summary["worst"]["kind"] == "searched"
    assert best["value"] == pytest.approx(forces[depths <= limit].min(), rel=5e-3)
    assert best["margin"] >= 0.0


def test_the_worst_of_a_search_for_the_best_design():
    result = design_study(
        load_scenario(f"""{CASE}
limits: {{peak_force: 100 N}}
optimise:
  minimise: peak_force
  most_cases: 12
  responses: [peak_force]
  parameters: [{{path: chain.snubbers.stop.gap, from: 1 mm, to: 2 mm}}]
  tolerances: {{samples: 2, parameters: [{{path: chain.snubbers.stop.gap, tolerance: 0.3 mm}}]}}
""")
    )
    worst, gap = result.summary["worst"], result.summary["best"][0]["parameters"]["chain.snubbers.stop.gap"]
    assert worst["kind"] == "searched"
    assert worst["by"]["peak_force"]["value"] == pytest.approx(force(K, S, gap - 3e-4), rel=1e-9)
    assert result.summary["margins"]["peak_force"]["value"] == pytest.approx(force(K, S, gap - 3e-4), rel=1e-9)
