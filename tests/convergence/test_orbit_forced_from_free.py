"""From free to forced motion, and the thesis's relaxed minimisation as a comparison."""

import numpy as np
import pytest

from beamsim.dynamics.continuation import Settings, solve_at
from beamsim.dynamics.forced_from_free import appropriate_force
from beamsim.dynamics.relaxed_minimisation import relaxed_path
from beamsim.dynamics.reversible import BrakeOrbits, ContactStiffness, linear_mode
from beamsim.dynamics.shooting import ForcedOrbits
from beamsim.dynamics.variational import PeriodicForcing, VariationalFlow

CHAIN = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
W2, V = np.linalg.eigh(CHAIN)


def test_forced_motion_rides_the_backbone(make_system):
    """The level predicted by energy balance holds the damped chain on its mode, the better the less the damping."""
    mass, epsilon = 5, 0.5
    system = make_system(np.sqrt(W2), np.zeros(6), shape=V[mass - 1 : mass], stiffness=epsilon)
    orbits = BrakeOrbits(ContactStiffness(system), energy=0.5)
    point = solve_at(orbits, linear_mode(orbits, 3, 1.0, V[mass - 1]), Settings(iterations=25), 1.0)
    mode = orbits.mode(point)
    flow, whole = orbits.cycle(point)
    times = np.linspace(0, mode.period, 2049)
    states = flow.states_at(whole, times)
    off = []
    for ratio in (4e-3, 2e-3, 1e-3):
        damped = make_system(np.sqrt(W2), 2 * ratio * np.sqrt(W2), shape=V[mass - 1 : mass], stiffness=epsilon)
        force = appropriate_force(damped, mode, times, states, V[mass - 1])
        forced = VariationalFlow(damped, PeriodicForcing.harmonic(V[mass - 1]), force.omega, force.level)
        problem = ForcedOrbits(forced)
        u = np.concatenate([force.start, [force.omega]])
        held = solve_at(problem, u, Settings(iterations=25), force.omega)
        assert held is not None
        off.append(np.linalg.norm(held.u[:6] - force.start[:6]) / np.linalg.norm(force.start[:6]))
    assert off[-1] < 0.05
    assert off[2] < 0.7 * off[1] < 0.5 * off[0]


def test_force_at_a_node(make_system):
    system = make_system(np.sqrt(W2), np.zeros(6), shape=V[4:5], stiffness=0.0)
    orbits = BrakeOrbits(ContactStiffness(system), energy=0.5)
    point = solve_at(orbits, linear_mode(orbits, 3, 1.0), Settings(), 1.0)
    flow, whole = orbits.cycle(point)
    times = np.linspace(0, whole.duration, 257)
    pattern = np.zeros(6)
    pattern[0] = 1.0
    with pytest.raises(ValueError, match="node"):
        appropriate_force(system, orbits.mode(point), times, flow.states_at(whole, times), pattern)


def test_relaxed_minimisation(make_system):
    """The thesis's method comes as close as its tolerance lets it, with many more motions computed."""
    system = make_system(np.sqrt(W2), np.zeros(6), shape=V[4:5], stiffness=0.5)
    orbits = BrakeOrbits(ContactStiffness(system), energy=0.5)
    start = linear_mode(orbits, 3, 0.0, V[4])
    steps = list(relaxed_path(orbits, start, np.linspace(0.0, 1.0, 8), tolerance=1e-8))
    assert all(s.reached for s in steps)
    exact = orbits.mode(solve_at(orbits, linear_mode(orbits, 3, 1.0, V[4]), Settings(iterations=25), 1.0))
    assert steps[-1].period == pytest.approx(exact.period, rel=1e-3)
    assert steps[-1].period != pytest.approx(exact.period, rel=1e-9)
    assert sum(s.passages for s in steps) > 8
