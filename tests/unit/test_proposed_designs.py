"""Designs that a model proposes for a front of two objectives, whose front is known in closed form."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.studies.designs import SolvedPoints
from beamsim.analyses.studies.plan import plan_designs
from beamsim.analyses.studies.proposals import gains, propose_designs
from beamsim.cli.studies import design_screen
from beamsim.trust.studies import CaseSolver, design_study
from tests.fabricated import solved_case

CASE = {
    "chain": {"masses": [1.0], "springs": [1e4]},
    "excitation": {"kind": "none"},
    "snubbers": [
        {"name": name, "mass": 1, "side": side, "gap": "1 mm", "stiffness": 2e4}
        for name, side in (("stop", "above"), ("other", "below"))
    ],
    "run": {"duration": "0.1 s", "start": {"velocity": [0.5]}},
}
FORCE, DEPTH = "snubbers/stop/peak_force", "probes/mass_1/peak_displacement"
RANGES = [
    {"path": "snubbers.stop.gap", "from": "0 mm", "to": "1 mm"},
    {"path": "snubbers.other.gap", "from": "0 mm", "to": "1 mm"},
]


def searched(monkeypatch, of, *, most_cases, parameters=RANGES, limits=None, seed=0):
    """A search whose objectives are a function of the numbers, each from 0 to 1."""

    def solve(solver, case):
        numbers = [1e3 * float(x) for x in case.values]
        values = dict(zip((FORCE, DEPTH), map(float, of(*numbers)), strict=True))
        return solved_case(limits or {}, case.number, values, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    optimise = {"minimise": [FORCE, DEPTH], "parameters": parameters, "most_cases": most_cases, "seed": seed}
    with_limits = {} if limits is None else {"limits": limits}
    return design_study(beamsim.load_scenario(CASE | with_limits | {"optimise": optimise}))


def front_of(result):
    values = result["cases"]["objective_value"].values[:, result["cases"]["front"].values]
    return values[:, np.argsort(values[0])]


def parabola(u, v):
    """(u^2, (1 - u)^2) and as much more in both as v differs from 0.3: the front is sqrt(f) + sqrt(g) = 1."""
    away = (v - 0.3) ** 2
    return u**2 + away, (1.0 - u) ** 2 + away


def test_the_area_that_points_add_to_a_front():
    """To a front of two points, up to 1.1 in both; a point behind the front adds none."""
    front = np.array([[0.0, 1.0], [1.0, 0.0]])
    points = np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 1.0], [0.2, 1.0]])
    np.testing.assert_allclose(gains(points, front), [0.25, 1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(gains(np.array([[-0.5, 2.0], [-0.5, 0.5]]), front), [0.0, 0.8], atol=1e-12)


def test_proposals_lie_on_the_front_that_the_model_knows():
    """Of a smooth function that is known at 60 designs; none is proposed twice, nor what is known."""
    varied = plan_designs(
        beamsim.load_scenario(CASE | {"optimise": {"minimise": [FORCE, DEPTH], "parameters": RANGES}})
    ).study.parameters
    generator = np.random.default_rng(1)
    points = generator.random((60, 2))
    values = np.array(parabola(*points.T)).T
    behind = ((values[:, None, :] >= values).all(axis=2) & (values[:, None, :] > values).any(axis=2)).any(axis=1)
    front = np.flatnonzero(~behind)[np.argsort(values[~behind, 0])]
    known = SolvedPoints(points, values, np.zeros((60, 0)))
    found = propose_designs(varied, known, front, 8, generator)
    assert len(np.unique(np.round(found, 4), axis=0)) == len(found) == 8
    assert gains(np.array(parabola(*found.T)).T, values[front]).min() > 0.0
    assert np.abs(np.sqrt(parabola(*found.T)).sum(axis=0) - 1.0).mean() < 0.05


@pytest.mark.parametrize("seed", range(2))
def test_a_front_in_closed_form_is_reached(monkeypatch, seed):
    result = searched(monkeypatch, parabola, most_cases=160, seed=seed)
    force, depth = front_of(result)
    assert result.complete
    np.testing.assert_allclose(np.sqrt(force) + np.sqrt(depth), 1.0, atol=0.02)
    assert max(force.min(), depth.min()) < 5e-3
    assert "front_gaps" not in result.summary


def test_a_front_on_a_limit_is_reached(monkeypatch):
    """f = u and g = v where (1 - f) (1 - g) may be 0.5 at most by the limit of a third response: a curve."""
    limit = {"peak_acceleration": 0.5}

    def solve(solver, case):
        u, v = (1e3 * float(x) for x in case.values)
        values = {FORCE: u, DEPTH: v, "probes/mass_1/peak_acceleration": (1.0 - u) * (1.0 - v)}
        return solved_case(limit, case.number, values, given=case.values)

    monkeypatch.setattr(CaseSolver, "__call__", solve)
    optimise = {"minimise": [FORCE, DEPTH], "parameters": RANGES, "most_cases": 160, "seed": 1}
    result = design_study(beamsim.load_scenario(CASE | {"limits": limit, "optimise": optimise}))
    force, depth = front_of(result)
    product = (1.0 - force) * (1.0 - depth)
    assert product.max() <= 0.5
    assert product.min() > 0.48
    assert max(force.min(), depth.min()) < 5e-3


def test_a_front_that_is_discontinuous_has_its_gap_named(monkeypatch):
    """f = u and a g that falls by 0.6 at u = 0.5: no design lies between."""
    result = searched(monkeypatch, lambda u, v: (u + v, (1.0 if u < 0.5 else 0.4) - 0.2 * u + v), most_cases=160)
    (gap,) = result.summary["front_gaps"]
    names = [name.replace("/", "_") for name in (FORCE, DEPTH)]
    assert gap["from"][names[0]] == pytest.approx(0.5, abs=0.02)
    assert (gap["from"][names[1]], gap["to"][names[1]]) == (pytest.approx(0.9, abs=0.01), pytest.approx(0.3, abs=0.01))
    assert result.complete
    assert any("gap" in line for line in design_screen(result).lines)


def test_a_front_of_a_narrow_valley_with_few_cases_is_in_doubt(monkeypatch):
    """Twenty cases do not find the designs with v = 0.37 + u / 5, whose front is g = (1 - f)^2."""

    def valley(u, v):
        away = 5.0 * abs(v - 0.37 - 0.2 * u)
        return u + away, (1.0 - u) ** 2 + away

    result = searched(monkeypatch, valley, most_cases=20)
    force, depth = front_of(result)
    assert (depth - (1.0 - force) ** 2).max() > 0.1
    assert result.outcome.code == "search_not_converged"
    assert "NOT CONVERGED" in design_screen(result).text(result, ["study.h5"]).splitlines()[0]


def test_a_front_of_which_no_design_meets_the_limits_says_so(monkeypatch):
    result = searched(monkeypatch, lambda u, v: (1.0 + u, 1.0 + v), most_cases=80, limits={"peak_force": 0.5})
    assert result.outcome.code == "no_feasible_design"
    assert f"no feasible design found after {result.count} of 80 cases" in result.outcome.text
    assert "front_ends" not in result.summary


def test_one_number_alone_has_a_front(monkeypatch):
    result = searched(monkeypatch, lambda u: parabola(u, 0.3), most_cases=60, parameters=RANGES[:1])
    force, depth = front_of(result)
    np.testing.assert_allclose(np.sqrt(force) + np.sqrt(depth), 1.0, atol=1e-9)
    assert max(force.min(), depth.min()) == pytest.approx(0.0, abs=1e-12)
    assert result.complete
