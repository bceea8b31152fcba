"""Harmonic balance against exact motions: rates in the number of harmonics, published amplitudes, stability."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.aft import to_real
from beamsim.orbits.continuation import Branch, Settings, solve_at
from beamsim.orbits.harmonic_balance import ForcedBalance, truncation, with_harmonics
from beamsim.orbits.shooting import ForcedOrbits

K = np.array([[1.0, -1.0], [-1.0, 2.0]])
W2, V = np.linalg.eigh(K)
FORCING = PeriodicForcing.harmonic(0.1 * V[1])
OMEGA = 0.7541


def amplitudes(point):
    """(H + 1,) of the first mass's harmonics."""
    return np.abs(point.data.coordinates @ V[0])


@pytest.fixture(scope="module")
def system_of(make_system):
    def make(**changes):
        contacts = {"shape": V[:1], "stiffness": 100.0, "gap": 1.0, "sign": -1.0} | changes
        return make_system(np.sqrt(W2), V.T @ (0.03 * K) @ V, **contacts)

    return make


def walk(problem):
    start = solve_at(problem, problem.linear_guess(0.8), Settings(), 0.8, forward=-1)
    branch = Branch(problem, start, 0.5, 0.8, Settings())
    return branch, list(branch)


@pytest.fixture(scope="module")
def curve(system_of):
    problem = ForcedBalance(system_of(), FORCING, 21, omega=0.8)
    return problem, *walk(problem)


@pytest.fixture(scope="module")
def at_omega(curve):
    """The three motions at 0.7541, the smallest first."""
    problem, _, points = curve
    found = [
        solve_at(problem, a.u + (b.u - a.u) * (OMEGA - a.parameter) / (b.parameter - a.parameter), Settings(), OMEGA)
        for a, b in pairwise(points)
        if (a.parameter - OMEGA) * (b.parameter - OMEGA) < 0
    ]
    return sorted(found, key=lambda p: amplitudes(p)[1])


def refined(problem, point, H, omega=OMEGA):
    finer = replace(problem, harmonics=H)
    W = with_harmonics(point.data.deflections, H)
    found = solve_at(finer, np.append(to_real(W).ravel(), omega), Settings(iterations=30), omega)
    assert found is not None
    return finer, found


def exact_harmonics(system, motion, omega=OMEGA, count=4096):
    """Shooting begun from the balanced motion: its orbit and its deflection's harmonics."""
    orbits = ForcedOrbits(VariationalFlow(system, FORCING, omega))
    point = solve_at(orbits, np.append(motion.states(np.zeros(1))[0], omega), Settings(iterations=20), omega)
    assert point is not None
    t = np.arange(count) * point.data.duration / count
    x = orbits.flow.states_at(point.data, t)[:, :2] @ V[0]
    c = 2 * np.fft.rfft(x) / count
    c[0] /= 2
    return orbits.orbit(point), c


def test_published_amplitudes(curve, at_omega):
    """NLvib example 03 with 21 harmonics at 0.7541: 1.32695, Q3 0.09319, Q5 0.02634; unstable."""
    problem, branch, _ = curve
    assert branch.outcome.text == "complete: reached the end of the range at parameter 0.5"
    assert len(at_omega) == 3
    largest = at_omega[-1]
    np.testing.assert_allclose(amplitudes(largest)[[1, 3, 5]], [1.32695, 0.09319, 0.02634], rtol=2e-3)
    assert abs(ForcedBalance(problem.system, FORCING, 21).multipliers(largest)[0]) > 1.1


def test_error_estimate_and_rate(system_of, curve, at_omega):
    """The estimate from the neglected harmonics is the error; the error falls about as H^-4."""
    problem, _, _ = curve
    errors, counts = [], [21, 43, 87, 175]
    for H in counts:
        finer, point = refined(problem, at_omega[-1], H)
        _, exact = exact_harmonics(system_of(), point.data)
        w = point.data.deflections[:, 0]
        off = np.concatenate([exact[: H + 1] - w, exact[H + 1 : 1500]])
        errors.append(np.linalg.norm(off) / np.linalg.norm(w))
        assert truncation(finer, point) == pytest.approx(errors[-1], rel=0.2)
    assert errors[0] < 2e-3
    assert errors[-1] < 1e-6
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > 3.5


def test_stability_is_that_of_the_motion_by_shooting(system_of, curve, at_omega):
    """Floquet multipliers of all three motions, from balances that are themselves good to a few digits."""
    problem, _, _ = curve
    for coarse in at_omega:
        _, point = refined(problem, coarse, 21)
        orbit, _ = exact_harmonics(system_of(), point.data)
        found = ForcedBalance(system_of(), FORCING, 21).multipliers(point)
        np.testing.assert_allclose(np.sort(np.abs(found)), np.sort(np.abs(orbit.multipliers)), atol=1e-8)
        assert bool(np.abs(found[0]) <= 1.0) == orbit.stable


def test_kelvin_voigt_dashpot(system_of):
    """The force jumps: convergence is slower, but to the same motion, and the level may change as well."""
    damped = system_of(dashpot=1.0)
    coarse = ForcedBalance(damped, FORCING, 21, omega=0.8)
    omega, start = 0.7, solve_at(coarse, coarse.linear_guess(0.8), Settings(), 0.8, forward=-1)
    near = next(
        a for a, b in pairwise(Branch(coarse, start, 0.5, 0.8, Settings()))
        if (a.parameter - omega) * (b.parameter - omega) < 0 and amplitudes(a)[1] > 1.05
    )  # fmt: skip
    errors, counts = [], [21, 43, 87, 175]
    for H in counts:
        _, point = refined(coarse, near, H, omega)
        _, exact = exact_harmonics(damped, point.data, omega)
        w = point.data.deflections[:, 0]
        errors.append(np.linalg.norm(exact[: H + 1] - w) / np.linalg.norm(w))
    assert errors[-1] < 1e-4
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] > 1.8
    level = ForcedBalance(damped, FORCING, 21, "level", omega)
    start = solve_at(level, np.append(refined(coarse, near, 21, omega)[1].u[:-1], 1.0), Settings(iterations=30), 1.0)
    branch = Branch(level, start, 0.9, 1.2, Settings())
    assert list(branch)[-1].parameter in (0.9, 1.2)


def test_cubic_spring_converges_exponentially(make_system):
    """A smooth spring: each harmonic gains a digit, down to the integration's own round-off."""
    system = make_system(np.sqrt(W2), V.T @ (0.1 * K) @ V, shape=np.zeros((0, 2)), stiffness=[])
    springs = CubicSprings(V[:1], np.array([0.8]))
    load = PeriodicForcing.harmonic(0.3 * V[1])
    orbits = ForcedOrbits(SmoothFlow(system, load, 0.9, springs=CubicSprings(V[:1], np.array([0.8]))))
    errors = []
    for H in (1, 3, 5, 7, 9, 19):
        problem = ForcedBalance(system, load, H, omega=0.9, cubic=springs)
        point = solve_at(problem, problem.linear_guess(0.9), Settings(iterations=40), 0.9)
        exact = solve_at(orbits, np.append(point.data.states(np.zeros(1))[0], 0.9), Settings(iterations=15), 0.9)
        errors.append(np.abs(point.data.states(np.zeros(1))[0] - exact.u[:4]).max())
        estimate = truncation(problem, point)
        assert estimate < 30 * errors[-1] + 1e-12
    balanced = ForcedBalance(system, load, H, omega=0.9, cubic=springs)
    np.testing.assert_allclose(
        np.sort(np.abs(balanced.multipliers(point))), np.sort(np.abs(orbits.orbit(exact).multipliers)), atol=1e-9
    )
    assert errors[-1] < 1e-12
    assert np.all(np.diff(np.log(errors[:5])) < -1.5)
