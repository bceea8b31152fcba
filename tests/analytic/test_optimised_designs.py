"""Best designs of a mass that runs into stops, in closed form.

A mass m with the velocity v presses a stop of the stiffness k by x = v sqrt(m / k) with the force F = v sqrt(m k): the
product of both is m v^2 whatever the stiffness. The weak spring that holds the mass adds to k where it matters. An
equal stop behind the mass catches it when it comes back.
"""

import re

import numpy as np
import pytest

import beamsim
from beamsim.analyses.studies.plan import design
from beamsim.trust.studies import CaseSolver, design_study
from tests.fabricated import solved_case

MASS, SPEED, HELD = 2.0, 0.5, 10.0
CASE = {
    "chain": {"masses": [MASS], "springs": [HELD]},
    "snubbers": [{"name": side, "mass": 1, "side": side, "gap": 0.0, "stiffness": 2e4} for side in ("above", "below")],
    "run": {"duration": "0.1 s", "start": {"displacement": [0.0], "velocity": [f"{SPEED} m/s"]}},
}
STIFFNESS = {"path": "snubbers[*].stiffness", "from": "1 kN/m", "to": "100 kN/m", "spacing": "logarithmic"}
FORCE, DEPTH = "peak_force", "peak_displacement"
WHERE = "snubbers[*].stiffness"


def searched(optimise, **others):
    case = CASE | {"optimise": {"most_cases": 160} | optimise} | others
    return beamsim.design_study(beamsim.load_scenario(case), workers=1)


def best(result):
    return result.summary["best"][0]


def closed(stiffness, gap=0.0, mass=MASS):
    """Largest force and displacement, with the spring that holds the mass."""
    both = stiffness + HELD  # m v^2 = k x^2 + h (x + g)^2
    depth = (np.sqrt(both * mass * SPEED**2 - stiffness * HELD * gap**2) - HELD * gap) / both
    return stiffness * depth, depth + gap


@pytest.fixture
def in_closed_form(monkeypatch):
    """The motions of stiffnesses, gaps and masses by their closed form, where many of them are searched."""

    def solve(self, case):
        stiffness, *others = case.values
        gap = others[0] if others else 0.0
        mass = float((others[1] or f"{MASS} kg").split()[0]) if len(others) > 1 else MASS
        force, depth = closed(stiffness, gap, mass)
        values = {"snubbers/above/peak_force": force, "probes/mass_1/peak_displacement": depth}
        limits = self.study.case.limits
        return solved_case({} if limits is None else limits.values_by_name, case.number, values, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solve)


def test_a_limit_that_binds_gives_the_stiffness_in_closed_form():
    """The smallest force is that of the softest stop that the mass presses no deeper than the limit."""
    limit = 4e-3
    stiffness = MASS * SPEED**2 / limit**2 - HELD
    result = searched({"minimise": FORCE, "parameters": [STIFFNESS]}, limits={"peak_displacement": limit})
    assert result.complete
    assert result.count <= 160
    assert best(result)["parameters"][WHERE] == pytest.approx(stiffness, rel=2e-3 * np.log(100.0))
    assert best(result)["value"] == pytest.approx(closed(stiffness)[0], rel=5e-3)
    assert 0.0 <= best(result)["margin"] < 5e-3
    verdict = result.summary["margins"]["peak_displacement"]
    assert (verdict["verdict"], verdict["case"]) == ("ok", best(result)["case"])
    assert result.summary["as_it_is"]["value"] == pytest.approx(closed(2e4)[0], rel=1e-6)


def test_a_limit_binds_where_the_value_with_its_change_by_a_finer_model_reaches_it(monkeypatch):
    """A design between that and the limit is not sure to meet it; the search does not settle there."""

    def solve(self, case):
        force, depth = closed(case.values[0])
        values = {"snubbers/above/peak_force": force, "probes/mass_1/peak_displacement": depth}
        return solved_case({DEPTH: limit}, case.number, values, {DEPTH: (0.9 * depth, 1.1 * depth)}, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    limit = 4e-3
    result = searched({"minimise": FORCE, "parameters": [STIFFNESS]}, limits={DEPTH: limit})
    assert result.complete
    assert closed(best(result)["parameters"][WHERE])[1] == pytest.approx(limit / 1.1, rel=5e-3)


def test_values_that_count_as_one_add_up_responses_of_different_units(in_closed_form):
    """F / F0 + x / x0 is smallest where both are equal: k = F0 / x0."""
    aim = {FORCE: "60 N", DEPTH: "10 mm"}
    result = searched({"minimise": aim, "parameters": [STIFFNESS]})
    assert best(result)["parameters"][WHERE] == pytest.approx(60.0 / 10e-3, rel=0.02)  # flat: second order in k
    force, depth = closed(60.0 / 10e-3)
    assert best(result)["value"] == pytest.approx(force / 60.0 + depth / 10e-3, rel=1e-4)
    near = result.summary["near_best"][WHERE]
    for end in (near["smallest"], near["largest"]):
        f, x = closed(end)
        assert f / 60.0 + x / 10e-3 <= 1.01 * best(result)["value"] * (1.0 + 1e-6)
    assert near["at_end"] is False


@pytest.mark.parametrize(("sense", "end"), [("minimise", 1e3), ("maximise", 1e5)])
def test_a_best_number_at_an_end_of_its_range_is_said(in_closed_form, sense, end):
    """A stiffer stop is hit harder, so that the best one is at an end."""
    result = searched({sense: FORCE, "parameters": [STIFFNESS], "most_cases": 60})
    assert result.summary["near_best"][WHERE]["at_end"] is True
    assert best(result)["parameters"][WHERE] == pytest.approx(end, rel=1e-9)


def test_without_an_objective_the_smallest_margin_is_largest():
    """Limits with the same share of the force and of the displacement: k = F0 / x0 again, a kink of the objective."""
    limits = {"peak_force": "90 N", "peak_displacement": "15 mm"}
    result = searched({"parameters": [STIFFNESS]}, limits=limits)
    assert best(result)["parameters"][WHERE] == pytest.approx(90.0 / 15e-3, rel=5e-3)
    assert result.summary["objective"] == "largest margin"


@pytest.mark.parametrize("seed", range(1))
def test_the_best_design_within_tolerances_is_the_one_that_meets_the_limit_at_their_worst(seed):
    """The softest stop that they allow goes deepest, the stiffest one has the largest force; no sample has either.

    The last designs are judged where others are worst, so that the best one is searched and at the limit.
    """
    limit = 4e-3
    tolerances = {"samples": 4, "parameters": [{"path": WHERE, "tolerance": "20 %"}]}
    optimise = {"minimise": FORCE, "parameters": [STIFFNESS], "tolerances": tolerances, "most_cases": 80, "seed": seed}
    result = searched(optimise, limits={"peak_displacement": limit})
    assert np.abs(result["realisations"]["deviation"].values).max() < 1.0
    stiffness = (MASS * SPEED**2 / limit**2 - HELD) / 0.8
    found = best(result)["parameters"][WHERE]
    assert result.summary["worst"]["kind"] == best(result)["worst"] == "searched"
    assert stiffness * (1.0 - 1e-6) < found < 1.005 * stiffness
    most = closed(1.2 * found)[0]
    assert 0.99 * most < best(result)["value"] <= most * (1.0 + 1e-6)


def test_a_front_has_designs_of_which_none_is_better_in_both():
    """Every stiffness is on the front, whose product of force and displacement is m v^2; damping is not."""
    damping = {"path": "snubbers[*].damping.coefficient", "from": "0 N s/m", "to": "50 N s/m"}
    dashpot = [stop | {"damping": {"kind": "viscous", "coefficient": "5 N s/m"}} for stop in CASE["snubbers"]]
    optimise = {"minimise": [FORCE, DEPTH], "parameters": [STIFFNESS], "most_cases": 60}
    result = searched(optimise)
    force, depth = result["cases"]["objective_value"].values
    np.testing.assert_allclose(force * depth, MASS * SPEED**2, rtol=2e-2)
    assert result["cases"]["front"].values.sum() > 0.9 * result.count
    both = searched(optimise | {"parameters": [STIFFNESS, damping], "most_cases": 60}, snubbers=dashpot)
    force, depth = both["cases"]["objective_value"].values
    better = (
        (force[:, None] <= force) & (depth[:, None] <= depth) & ((force[:, None] < force) | (depth[:, None] < depth))
    )
    front = both["cases"]["front"].values
    np.testing.assert_array_equal(front, ~better.any(axis=0))
    assert 0 < front.sum() < both.count


@pytest.mark.parametrize("seed", range(1))
def test_a_front_reaches_its_ends_in_closed_form(in_closed_form, seed):
    """The least force is that of the softest stop, the least displacement that of the stop that the limit allows.

    The lightest of three masses is best in both; gaps add to the displacement, and take a ten-thousandth of the force.
    """
    limit = 60.0
    masses = {"name": "mass", "choices": {f"{m} kg": {"chain.masses": [m]} for m in (5.0, MASS, 3.0)}}
    gap = {"path": "snubbers[*].gap", "from": "0 mm", "to": "0.2 mm"}
    optimise = {"minimise": [FORCE, DEPTH], "parameters": [STIFFNESS, gap, masses], "most_cases": 240, "seed": seed}
    result = searched(optimise, limits={FORCE: limit})
    assert result.count <= 240
    of_front = result["cases"]["front"].values
    force, depth = result["cases"]["objective_value"].values[:, of_front]
    softest, stiffest = closed(1e3), MASS * SPEED**2 / limit
    assert force.min() == pytest.approx(softest[0], rel=1e-3)  # less by the spring's share in a gap
    assert depth.min() == pytest.approx(stiffest, rel=5e-3)
    np.testing.assert_array_less(force * depth, 1.02 * MASS * SPEED**2)  # none is far from the front
    order = np.argsort(force)
    ranges = np.array([limit - softest[0], softest[1] - stiffest])
    steps = np.linalg.norm(np.diff(np.array([force, depth])[:, order], axis=1) / ranges[:, None], axis=0)
    assert steps.max() < 0.1 * steps.sum()
    low, high = result.summary["front_ends"]
    assert (low["objective"], high["objective"]) == ("smallest peak force", "smallest peak displacement")
    assert low["parameters"]["mass"] == high["parameters"]["mass"] == f"{MASS} kg"
    assert low["at_end"] == [WHERE, "snubbers[*].gap"]
    assert high["at_end"] == ["snubbers[*].gap"]
    assert high["values"][DEPTH] == pytest.approx(depth.min(), rel=1e-12)


def test_a_front_says_what_there_was_no_room_for(in_closed_form):
    """Fourteen cases are too few for two numbers."""
    gap = {"path": "snubbers[*].gap", "from": "0 mm", "to": "2 mm"}
    result = searched({"minimise": [FORCE, DEPTH], "parameters": [STIFFNESS, gap], "most_cases": 14})
    assert result.count <= 14
    assert result.outcome.code == "search_not_converged"
    assert re.search("found to be better|still improved|not searched", result.outcome.text)


@pytest.mark.parametrize("seed", range(1))
def test_a_front_has_the_designs_of_a_small_region_as_well(monkeypatch, seed):
    """Of one product in four, in 6 % of its gaps: nothing nearby points there, and half of the front is there."""

    def solved(solver, case):
        u, v, product = case.values
        near = max(0.0, 1.0 - 5e3 * u) * max(0.0, 3.5e3 * v - 2.5) if product == "d" else 0.0
        values = (10.0 * (1e3 * u + 1e3 * v), 1.0 - 100.0 * u) if near == 0.0 else (40.0, 0.9 - 0.8 * near)
        named = dict(zip(("snubbers/above/peak_force", "probes/mass_1/peak_displacement"), values, strict=True))
        return solved_case({}, case.number, named, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solved)
    gaps = [{"path": f"snubbers[{k}].gap", "from": "0 mm", "to": "1 mm"} for k in range(2)]
    product = {"choices": {name: {"run.duration": "0.1 s"} for name in "abcd"}}
    optimise = {"minimise": [FORCE, DEPTH], "parameters": [*gaps, product], "most_cases": 1000, "seed": seed}
    result = design_study(beamsim.load_scenario(CASE | {"optimise": optimise}))
    force, depth = result["cases"]["objective_value"].values[:, result["cases"]["front"].values]
    assert force.min() < 0.1
    assert depth.min() < 0.3  # 0.9 elsewhere, 0.1 where it is best


def test_the_best_of_a_catalogue_sets_all_that_the_choice_sets():
    """Tables and numbers of products; the table is that of a linear stop, so that closed forms hold of it as well."""
    table = [[0.0, 0.0], [0.1, 800.0]]
    choices = {
        "hard": {WHERE: "40 kN/m"},
        "table": {WHERE: None, "snubbers[*].force_deflection": table},
        "soft": {WHERE: "2 kN/m", "snubbers[*].gap": "1 mm"},
        "as drawn": {},
    }
    optimise = {"minimise": FORCE, "parameters": [{"name": "product", "choices": choices}], "most_cases": 40}
    result = searched(optimise, limits={"peak_displacement": "9 mm"})
    assert best(result)["parameters"] == {"product": "table"}  # the soft one is pressed beyond the limit
    assert best(result)["value"] == pytest.approx(closed(8e3)[0], rel=1e-6)
    assert result.count == 5  # each once, and the scenario as it is
    assert result.summary["as_it_is"]["value"] == pytest.approx(closed(2e4)[0], rel=1e-6)
    alone = design(result.scenario, result.summary["best"][0])
    assert alone.snubbers[0].force_deflection == ((0.0, 0.0), (0.1, 800.0))
    assert beamsim.run(beamsim.load_scenario(alone.to_yaml())).summary["peak_force_n"]["above"] == pytest.approx(
        best(result)["value"], rel=1e-9
    )


def test_what_cannot_be_met_is_said(in_closed_form):
    result = searched({"minimise": FORCE, "parameters": [STIFFNESS], "most_cases": 40}, limits={"peak_force": "1 N"})
    assert "best" not in result.summary
    assert result.outcome.code == "no_feasible_design"
    assert f"no feasible design found after {result.count} of 40 cases" in result.outcome.text
    assert ("most_cases" in result.outcome.text) == (result.count == 40)  # more of them only help where all were tried
    margin = result.summary["margins"]["peak_force"]  # of the design that comes nearest
    assert margin["verdict"] == "exceeded"
    assert margin["value"] == pytest.approx(closed(1e3)[0], rel=0.05)
