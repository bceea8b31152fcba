"""The beam's response curve over many superharmonic resonances: where it begins and what is found on it.

One case of the thesis (one-sided contact, 2 g).
"""

import itertools
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import Settings, follow_orbits, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.orbits.special_points import special_points
from beamsim.outcomes import OutcomeCode
from beamsim.system.build import build_system

CONFIG = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"


@pytest.fixture(scope="module")
def orbits_at():
    scenario = beamsim.load_scenario(CONFIG, {"excitation.frequency": 400.0})
    system = build_system(scenario.model_copy(update={"run": None}))
    loads = PeriodicForcing.harmonic(system.forcing.load[0])

    def make(frequency_hz):
        flow = VariationalFlow(system.dynamics, loads, 2 * np.pi * frequency_hz, scenario.excitation.level)
        return ForcedOrbits(flow)

    return make


def walk(problem, low, high, forward, **settings):
    start = find_orbit(problem, forward=forward)
    before = problem.flow.passages
    branch = follow_orbits(problem, start, 2 * np.pi * low, 2 * np.pi * high, Settings(**settings))
    points = list(branch)
    assert branch.outcome.code is OutcomeCode.REACHED_END
    carried = problem.flow.passages - before
    found = [s for a, b in itertools.pairwise(points) for s in special_points(problem, a, b, branch.settings)]
    return points, found, carried, problem.flow.passages - before - carried


@pytest.fixture(scope="module")
def downwards(orbits_at):
    problem = orbits_at(45.0)
    return problem, *walk(problem, 34.0, 60.0, -1.0)


@pytest.mark.slow
def test_special_points_do_not_depend_on_the_steps(orbits_at, downwards):
    """Steps of a quarter find the same points, to 1e-8: none hides, in a pair, within a step."""
    _, _, found, _, _ = downwards
    _, finer, _, _ = walk(orbits_at(45.0), 34.0, 60.0, -1.0, step=0.0125, largest_step=0.0125)
    assert len(found) > 40

    def ordered(special):
        return sorted((s.kind, s.parameter) for s in special)

    assert [k for k, _ in ordered(finer)] == [k for k, _ in ordered(found)]
    np.testing.assert_allclose([x for _, x in ordered(finer)], [x for _, x in ordered(found)], rtol=1e-8)


@pytest.mark.slow
def test_unstable_beginning_lies_on_the_curve(orbits_at, downwards):
    """At 35 Hz transients end in chaos; the path of falling damping ends on the curve that came down from 45 Hz."""
    problem, points, _, _, _ = downwards
    omega = 2 * np.pi * 35.0
    on_curve = [
        solve_at(problem, a.u + (b.u - a.u) * (omega - a.parameter) / (b.parameter - a.parameter), Settings(), omega)
        for a, b in itertools.pairwise(points)
        if (a.parameter - omega) * (b.parameter - omega) <= 0
    ]

    def distance(point):
        return min(np.linalg.norm((p.u - point.u) / p.scale) for p in on_curve)

    other = orbits_at(35.0)
    start = find_orbit(other)
    assert not other.orbit(start).stable
    assert distance(start) < 1e-8
