"""A scenario written in other words gives the same result, as a thousand do in `python -m tests.attack`."""

import copy

import numpy as np
import pytest
from rewritten import SAME, difference, in_unit, positions, put, reflected, rewrite, scenario_of, told

from beamsim.scenario.units import LENGTH, STIFFNESS, read_quantity

SEEDS = {9: "a plate", 10: "imported matrices", 21: "a beam and a chain that are joined", 22: "a chain"}


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_physics_in_other_words(seed, tmp_path):
    """Shares and metres, ratios and dashpots, units, names, order, both mirrors, studies, files."""
    findings = rewrite(seed, tmp_path)
    assert [(f.source, f.words, f.differences) for f in findings if f.differences] == []
    assert {f.words for f in findings} == set(SAME)
    assert sum(f.outcome == "agrees" for f in findings) >= 5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40, 60))
def test_more_scenarios_in_other_words(seed, tmp_path):
    assert [(f.source, f.words, f.differences) for f in rewrite(seed, tmp_path) if f.differences] == []


def test_a_place_that_is_another_differs(tmp_path):
    """Twin of the agreement: a millionth of a body's length is seen in every scenario that has places."""
    _, tree = scenario_of(9, tmp_path)
    first, moved = told(tree), copy.deepcopy(tree)
    path, side, _ = next(each for each in positions(tree) if each[0][0] == "snubbers")
    put(moved, path, f"{100 * (tree['snubbers'][0]['position'][path[-1]] / side + 1e-6)!r} %")
    other = told(moved)
    assert any(difference(name, first[name], other[name], ()) for name in first)


def test_what_the_words_are_made_with():
    """Polynomials from the other end, and quantities in other units, against numbers that are known."""
    assert reflected(np.array([1.0, 2.0, 3.0]), 2.0).tolist() == [
        1 + 4 + 12,
        -2 - 12,
        3.0,
    ]  # 1 + 2 (2 - x) + 3 (2 - x)^2
    rng = np.random.default_rng(1)
    for unit, dimension in (("m", LENGTH), ("N/m", STIFFNESS)):
        texts = {in_unit(0.3048, unit, rng) for _ in range(40)}
        assert len({text.split(" ")[1] for text in texts}) > 3
        assert all(read_quantity(text, dimension) == pytest.approx(0.3048, rel=1e-15) for text in texts)
