"""Newton's method on periodic motions: what a step costs, and what ends it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.response.paths import response_model
from beamsim.flow.passage import NotFinite
from beamsim.orbits.continuation import Settings, newton
from beamsim.orbits.shooting import ForcedOrbits, find_orbit

CONFIG = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"
SETTINGS = Settings(iterations=15)


@pytest.fixture
def problem() -> ForcedOrbits:
    """Of the README's case at 65 Hz."""
    scenario = beamsim.load_scenario(
        CONFIG, {"sweep": {"kind": "continuation", "from": 20.0, "to": 400.0}, "reduction.modes": 3}
    )
    model = response_model(scenario)
    return ForcedOrbits(model.orbits(model.levels[0]).flow.under(2 * np.pi * 65.0, model.levels[0]))


def test_a_flow_under_other_loads_shares_the_modes_and_leaves_the_first_as_it_is(problem):
    """The motion under a load that was set in steps is that of a flow built for it."""
    point = find_orbit(problem)
    flow, z = problem.flow, point.u[:-1]
    passage = flow.carry(z, point.data.duration)
    far = flow.under(1.3 * flow.omega, 0.7 * flow.level)
    direct = type(flow)(flow.system, flow.forcing, far.omega, far.level)
    by_far, by_direct = (each.carry(z, point.data.duration).end for each in (far, direct))
    np.testing.assert_allclose(by_far, by_direct, rtol=0, atol=1e-13 * np.abs(by_direct).max())
    assert not np.allclose(by_far, passage.end, rtol=1e-3, atol=0)
    np.testing.assert_array_equal(flow.carry(z, point.data.duration).end, passage.end)


def test_loads_that_are_not_finite_are_refused(problem):
    guess = np.append(np.zeros(problem.flow.size), problem.flow.omega)
    scale, row = problem.scale(guess)[0], np.eye(guess.size)[-1]
    problem.level = np.nan
    with pytest.raises(NotFinite):
        problem.residual(guess)
    assert newton(problem, guess, row, scale, SETTINGS) is None
