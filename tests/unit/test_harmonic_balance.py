"""Harmonic balance: exact forces, exact Jacobians, condensation, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.contacts.equilibrium import CubicSprings
from beamsim.errors import MethodError
from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.orbits.aft import close_intervals, cubic, one_sided, to_complex, to_real, toeplitz
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.harmonic_balance import Condensation, ForcedBalance

pytestmark = pytest.mark.quick


def smooth_coefficients(seed, H):
    """Random real coefficients that fall as 1/h²."""
    h = np.repeat(np.arange(1, H + 2), 2)[: 2 * H + 1]
    return np.random.default_rng(seed).normal(size=2 * H + 1) / h**2


def sampled(D, count):
    t = np.arange(count) * 2 * np.pi / count
    return (np.exp(1j * np.multiply.outer(t, np.arange(D.size))) @ D).real


def harmonics_of(values, highest):
    c = np.fft.rfft(values)[: highest + 1] * 2 / values.size
    c[0] /= 2
    return c


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 12))
def test_positive_part_against_fine_samples(seed, H):
    D = to_complex(smooth_coefficients(seed, H))
    found = one_sided(D, 2 * H)
    fine = harmonics_of(np.maximum(sampled(D, 1 << 15), 0.0), 2 * H)
    np.testing.assert_allclose(found.positive, fine, atol=3e-8 * np.abs(D).sum() * H**2)
    np.testing.assert_allclose(toeplitz(found.chi, 2 * H, H) @ to_real(D), found.positive, atol=1e-13)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 12))
def test_cubic_force_is_exact(seed, H):
    W = to_complex(smooth_coefficients(seed, H))
    force, slope = cubic(W, 3 * H)
    np.testing.assert_allclose(force, harmonics_of(sampled(W, 1 << 9) ** 3, 3 * H), atol=1e-12)
    np.testing.assert_allclose(toeplitz(slope, 3 * H, H) @ to_real(W), 3 * force, atol=1e-12)


def test_a_contact_shorter_than_a_sample_is_seen():
    """cos(tau - a) just above its threshold, between two samples of any power of two."""
    a, depth = 1.2345, 1e-9
    D = np.array([-(1 - depth), np.exp(-1j * a)])
    closed = close_intervals(D)
    assert closed.shape == (1, 2)
    np.testing.assert_allclose(closed[0], a + np.arccos(1 - depth) * np.array([-1, 1]), atol=1e-10)
    always, never = np.array([2.0, 1.0 + 0j]), np.array([-2.0, 1.0 + 0j])
    np.testing.assert_array_equal(close_intervals(always), [[0.0, 2 * np.pi]])
    assert close_intervals(never).size == 0
    # and a gap that short within a closed contact
    assert close_intervals(-D).shape == (1, 2)


def general_case(make_system, n=4, coupled=True):
    """Rigid-body mode, dead load, dashpots, contact on a moving ground, a cubic spring."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(n, n))
    C = 0.01 * A @ A.T if coupled else np.diag([0.0, 0.01, 0.0, 0.02])
    system = make_system(
        [0.0, 1.0, 1.7, 2.6], C, 0.1 * rng.normal(size=n), shape=rng.normal(size=(2, n)), stiffness=[3.0, 5.0],
        dashpot=[0.3, 0.1], gap=[0.1, -0.2], sign=[1.0, -1.0], on_ground=[True, False],
    )  # fmt: skip
    forcing = PeriodicForcing(
        np.array([1, 3]), rng.normal(size=(2, n)) + 0j, np.array([2.0, 0.0]), np.array([[0.3], [0.2j]]),
        np.array([-2.0, 0.0]), 1.3,
    )  # fmt: skip
    return system, forcing, CubicSprings(rng.normal(size=(1, n)), np.array([0.4]))


def jacobian_error(problem, u, step=1e-6):
    _, J, _ = problem.residual(u)
    scale = problem.scale(u)[0]
    worst = 0.0
    for i in range(u.size):
        e = np.zeros(u.size)
        e[i] = step * scale[i]
        difference = (problem.residual(u + e)[0] - problem.residual(u - e)[0]) / (2 * step)
        worst = max(worst, np.abs(difference - J[:, i] * scale[i]).max())
    return worst / np.abs(J * scale).max()


@pytest.mark.parametrize("coupled", [True, False])
@pytest.mark.parametrize("parameter", ["frequency", "level"])
def test_forced_jacobian(make_system, parameter, coupled):
    system, forcing, springs = general_case(make_system, coupled=coupled)
    problem = ForcedBalance(system, forcing, 9, parameter, 1.1, 0.7, 2, springs)
    x = np.array([smooth_coefficients(s, 9) for s in range(3)]).T.ravel()
    assert jacobian_error(problem, np.append(x, 1.2)) < 1e-8


@pytest.mark.parametrize("coupled", [True, False])
def test_condensation_leaves_the_whole_structure_balanced(make_system, coupled):
    """A solution of the condensed equations solves those of every coordinate, harmonic by harmonic."""
    system, forcing, springs = general_case(make_system, coupled=coupled)
    system = replace(system, contacts=replace(system.contacts, gap=np.array([0.02, -0.03])))
    problem = ForcedBalance(system, forcing, 12, "frequency", 4.1, 0.2, 1, springs)
    point = None
    for start in (problem.linear_guess(4.1), np.append(0.1 * np.ones(3 * 25), 4.1)):
        point = point or solve_at(problem, start, Settings(iterations=60, tolerance=1e-12), 4.1)
    assert point is not None
    motion = point.data
    w = np.arange(13) * motion.fundamental
    Z = np.array([np.diag(system.stiffness - x**2) + 1j * x * system.damping for x in w])
    load = problem._loads(4.1, 0.2)[0] + motion.forces @ problem.rows
    np.testing.assert_allclose((Z @ motion.coordinates[:, :, None])[:, :, 0], load, atol=1e-9)
    np.testing.assert_allclose(motion.coordinates @ problem.rows.T, motion.deflections, atol=1e-10)
    # and in time, from samples of the springs' laws
    t = np.linspace(0, motion.period, 7)
    q, v = np.split(motion.states(t), 2, axis=1)
    base = np.exp(1j * np.multiply.outer(t, [4.1, 3 * 4.1])) @ forcing.at(4.1, 0.2)[1]
    c = system.contacts
    delta = -c.gap - c.sign * (q @ c.shape.T + np.multiply.outer(base.real, c.on_ground))
    assert np.any(delta > 0)
    assert v.shape == q.shape


def test_receptance_at_an_undamped_resonance_is_regular():
    """Springs S on both sides: the same receptance by a direct inverse, exactly at a natural frequency and at zero."""
    stiffness, rows = np.array([0.0, 1.0, 4.0]), np.array([[1.0, 0.6, 0.2]])
    structure = Condensation(stiffness, np.zeros((3, 3)), rows, 1.0)
    load = np.ones((5, 3), dtype=complex)
    found = structure.at(0.5, load, np.zeros_like(load))
    S = structure.shifts(4)
    for k in range(5):
        Z = np.diag(stiffness - (0.5 * k) ** 2) + (rows.T * S[k]) @ rows
        np.testing.assert_allclose(found.receptance[k], rows @ np.linalg.solve(Z, rows.T), rtol=1e-10)
        np.testing.assert_allclose(found.response[k], rows @ np.linalg.solve(Z, load[k]), rtol=1e-10)


def test_refusals(make_system):
    linear = make_system([1.0], [0.1], shape=np.zeros((0, 1)), stiffness=[])
    with pytest.raises(MethodError, match="linear"):
        ForcedBalance(linear, PeriodicForcing.harmonic(np.ones(1)))
    plain = make_system([1.0, 2.0], [0.1, 0.1], shape=[[1.0, 0.0]], stiffness=1.0)
    with pytest.raises(MethodError, match="use 3 or more"):
        ForcedBalance(plain, PeriodicForcing.harmonic(np.ones(2)), 2, multiple=3)
    with pytest.raises(ArithmeticError, match="negative"):
        ForcedBalance(plain, PeriodicForcing.harmonic(np.ones(2)), 3).residual(np.append(np.zeros(7), -1.0))
