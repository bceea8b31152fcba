"""The beam's response curve over many superharmonic resonances: where it begins.

One case of the thesis (one-sided contact, 2 g).
"""

import itertools

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import Branch, Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.system.build import build_system

CONFIG = config_path("one_sided_65hz")


@pytest.fixture(scope="module")
def orbits_at():
    scenario = beamsim.load_scenario(CONFIG, {"excitation.frequency": 400.0})
    system = build_system(scenario.model_copy(update={"run": None}))
    loads = PeriodicForcing.harmonic(system.forcing.load[0])

    def make(frequency_hz):
        flow = VariationalFlow(system.dynamics, loads, 2 * np.pi * frequency_hz, scenario.excitation.level)
        return ForcedOrbits(flow)

    return make


def walk(problem, low, high, forward):
    start = find_orbit(problem, forward=forward)
    branch = Branch(problem, start, 2 * np.pi * low, 2 * np.pi * high)
    points = list(branch)
    assert branch.outcome.code == "reached_end"
    return points


@pytest.fixture(scope="module")
def downwards(orbits_at):
    problem = orbits_at(45.0)
    return problem, walk(problem, 34.0, 60.0, -1.0)


def test_unstable_beginning_lies_on_the_curve(orbits_at, downwards):
    """At 35 Hz transients end in chaos; Newton's method ends on the curve that came down from 45 Hz."""
    problem, points = downwards
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
