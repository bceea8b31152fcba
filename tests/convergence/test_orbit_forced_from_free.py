"""From free to forced motion by energy balance and phase resonance, and the thesis's relaxed minimisation."""

import numpy as np
import pytest

from beamsim.contacts.equilibrium import CubicSprings, find_equilibrium
from beamsim.contacts.snubbers import springs_of
from beamsim.flow.exact import ExactFlow
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.inputs.signal import Signal
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.expansions.free import observed_orders
from beamsim.orbits.free_orbits import BrakeOrbits, linear_mode
from beamsim.orbits.period import gauss_panels
from beamsim.orbits.phase_resonance import appropriate_force, find_phase_resonance, quadrature
from beamsim.orbits.shooting import ForcedOrbits
from beamsim.orbits.spring_families import SpringFamily
from beamsim.system.equations import Forcing

CHAIN = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
W2, V = np.linalg.eigh(CHAIN)
OMEGA = np.sqrt(W2)
RAYLEIGH = V.T @ (0.4 * CHAIN + 0.3 * np.diag(np.arange(1.0, 7.0))) @ V  # couples the modes
RATIOS = 8e-3 * 0.5 ** np.arange(4)

CASES = {
    "touching": ({"shape": V[4:5], "stiffness": 0.5}, "modal", V[0]),
    "gap, coupled damping": ({"shape": V[4:5], "stiffness": 0.5, "gap": 0.1}, "coupled", V[0]),
    "dashpot alone": ({"shape": V[4:5], "stiffness": 0.5, "gap": 0.1, "dashpot": 5.0}, "none", V[0]),
    "prestress": ({"shape": V[4:5], "stiffness": 0.5, "gap": -0.1, "dashpot": 2.0}, "modal", V[2]),
    "two springs": (
        {"shape": V[[4, 1]], "stiffness": [0.5, 0.3], "gap": [0.1, 0.3], "sign": [1.0, -1.0], "dashpot": [2.0, 1.0]},
        "coupled",
        V[5],
    ),
    "never pulls": (
        {"shape": V[4:5], "stiffness": 0.5, "gap": 0.1, "dashpot": 5.0, "no_tension": True}, "modal", V[0],
    ),
}  # fmt: skip


def equilibrium(system):
    if not system.contacts.stiffness.any():
        return np.zeros(system.size)
    return find_equilibrium(system.stiffness, 0, springs_of(system.contacts), system.constant_load[None, :]).q


@pytest.fixture(scope="module")
def held(make_system):
    """A nonlinear mode of the six masses, its motion, and the damped structure at a damping ratio."""

    def make(case, mode=3, energy=0.5):
        contact, damping, pattern = CASES[case]
        free = {k: v for k, v in contact.items() if k not in ("dashpot", "no_tension")}
        system = make_system(OMEGA, np.zeros(6), **free)
        pressed = np.any(np.asarray(contact.get("gap", 0.0)) < 0)
        family = SpringFamily(system, equilibrium if pressed else None)
        orbits = BrakeOrbits(family, "energy", basis=family.modes_at_rest() if pressed else None)
        guess = linear_mode(orbits, mode, np.log(energy), V[4])
        point = solve_at(orbits, guess, Settings(iterations=30), np.log(energy))
        assert point is not None
        flow, whole = orbits.cycle(point)

        def damped(ratio):
            by = {"modal": np.diag(2 * ratio * OMEGA), "coupled": ratio * RAYLEIGH, "none": np.zeros((6, 6))}[damping]
            own = contact | {"dashpot": ratio * np.asarray(contact.get("dashpot", 0.0))}
            return make_system(OMEGA, by, **own)

        return flow, whole, damped, pattern

    return make


def conjugate(flow, whole, pattern):
    """Amplitude of the fundamental of the deflection under the force."""
    t, weight = gauss_panels(np.append(whole.time, whole.duration), flow.fastest)
    q = flow.states_at(whole, t)[:, :6] @ pattern
    return abs(2 / whole.duration * np.sum(weight * np.exp(-2j * np.pi * t / whole.duration) * q))


def resonance(damped, force, pattern, level=None):
    loads = PeriodicForcing.harmonic(pattern)
    problem = ForcedOrbits(VariationalFlow(damped, loads, force.omega, force.level if level is None else level))
    point = find_phase_resonance(problem, force.start, force.omega)
    assert point is not None
    return problem, point


@pytest.mark.parametrize("case", CASES)
def test_prediction_against_phase_resonance(held, case):
    """Frequency, amplitude (so the level for an amplitude) and shape at rest are right to second order in the damping.

    A snubber that never pulls leaves earlier than it came: no motion backwards in time, and first order only.
    """
    flow, whole, damped, pattern = held(case)
    size = conjugate(flow, whole, pattern)
    off = []
    ratios, order = (RATIOS / 16, 1.0) if case == "never pulls" else (RATIOS, 2.0)
    for ratio in ratios:
        system = damped(ratio)
        force = appropriate_force(system, flow, whole, -1j * pattern)
        problem, point = resonance(system, force, pattern)
        cosine, amplitude = quadrature(problem, point)
        assert abs(cosine) < 1e-8
        n = force.start.size // 2
        q = point.u[:n] - force.start[:n]
        off.append((abs(point.parameter / force.omega - 1), abs(amplitude / size - 1), np.linalg.norm(q)))
    off = np.array(off)
    assert off[-1].max() < 2e-3
    for k in (0, 1, 2) if order == 2.0 else (1, 2):
        np.testing.assert_allclose(observed_orders(ratios, off[:, k])[-1], order, atol=0.1)


def test_another_level_does_not_hold_the_motion(held):
    """The twin: a tenth more force gives another amplitude, by as much whatever the damping."""
    flow, whole, damped, pattern = held("gap, coupled damping")
    size = conjugate(flow, whole, pattern)
    for ratio in RATIOS[-2:]:
        force = appropriate_force(damped(ratio), flow, whole, -1j * pattern)
        problem, point = resonance(damped(ratio), force, pattern, 1.1 * force.level)
        assert quadrature(problem, point)[1] / size > 1.05


def test_linear_resonance_in_closed_form(make_system):
    """One degree of freedom: A = 2 zeta omega^2 X, a quarter of a period behind."""
    system = make_system([3.0], [2 * 0.02 * 3.0], shape=[[1.0]], stiffness=0.0)
    orbits = BrakeOrbits(SpringFamily(make_system([3.0], [0.0], shape=[[1.0]], stiffness=0.0)), energy=0.5)
    point = solve_at(orbits, linear_mode(orbits, 0, 1.0), Settings(), 1.0)
    flow, whole = orbits.cycle(point)
    force = appropriate_force(system, flow, whole, np.array([-1j]))
    amplitude = 1.0 / 3.0
    assert force.level == pytest.approx(2 * 0.02 * 9.0 * amplitude, rel=1e-12)
    assert force.dissipated == pytest.approx(np.pi * force.level * amplitude, rel=1e-12)
    np.testing.assert_allclose(force.start, [-amplitude, 0.0], atol=1e-12)
    cosine = appropriate_force(system, flow, whole, np.array([1.0 + 0j]))  # the force as a cosine: a quarter earlier
    np.testing.assert_allclose(cosine.start, [0.0, 1.0], atol=1e-12)


def test_energy_balance_on_the_exact_motion(held):
    """Work of the force less what damping takes over a period of the exact motion is zero, by the transient solver."""
    _, _, damped, pattern = held("two springs")
    flow, whole, damped, pattern = held("two springs")
    system = damped(8e-3)
    force = appropriate_force(system, flow, whole, -1j * pattern)
    problem, point = resonance(system, force, pattern)
    omega, T = point.parameter, point.data.duration
    forcing = Forcing(pattern[None, :], (Signal.harmonic(force.level, omega),))
    run = simulate(ExactFlow(system, forcing, 40 * T), point.u[:-1][:12], duration=40 * T)
    times = T * np.linspace(39, 40, 4001)[:-1]
    states = run.states_at(times)
    q, v = states[:, :6], states[:, 6:]
    work = force.level * np.mean((v @ pattern) * np.sin(omega * times))
    c = system.contacts
    closed = -c.gap - c.sign * (q @ c.shape.T) > 0
    taken = np.mean(np.einsum("ti,ij,tj->t", v, system.damping, v) + ((v @ c.shape.T) ** 2 * closed) @ c.dashpot)
    assert work == pytest.approx(taken, rel=1e-3)
    assert problem.orbit(point).stable
    np.testing.assert_allclose(states[0], point.u[:-1][:12], atol=1e-7)


def test_cubic_spring(make_system):
    system = make_system(OMEGA, np.zeros(6), shape=np.zeros((0, 6)), stiffness=[])
    orbits = BrakeOrbits(SpringFamily(system, cubic=CubicSprings(V[5:6], np.array([0.5]))), "energy")
    point = solve_at(orbits, linear_mode(orbits, 3, np.log(0.5)), Settings(iterations=30), np.log(0.5))
    flow, whole = orbits.cycle(point)
    size, off = conjugate(flow, whole, V[0]), []
    for ratio in RATIOS[:3]:
        damped = make_system(OMEGA, 2 * ratio * OMEGA, shape=np.zeros((0, 6)), stiffness=[])
        force = appropriate_force(damped, flow, whole, -1j * V[0])
        loads = PeriodicForcing.harmonic(V[0])
        springs = CubicSprings(V[5:6], np.array([0.5]))
        problem = ForcedOrbits(SmoothFlow(damped, loads, force.omega, force.level, springs=springs))
        found = find_phase_resonance(problem, force.start, force.omega)
        off.append(abs(quadrature(problem, found)[1] / size - 1))
    assert observed_orders(RATIOS[:3], off)[-1] == pytest.approx(2.0, abs=0.1)


def test_force_at_a_node(make_system):
    system = make_system(OMEGA, np.zeros(6), shape=V[4:5], stiffness=0.0)
    orbits = BrakeOrbits(SpringFamily(system), energy=0.5)
    flow, whole = orbits.cycle(solve_at(orbits, linear_mode(orbits, 3, 1.0), Settings(), 1.0))
    pattern = np.zeros(6)
    pattern[0] = 1.0
    with pytest.raises(ValueError, match="node"):
        appropriate_force(system, flow, whole, pattern.astype(complex))
