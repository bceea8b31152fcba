"""The field's two masses with one stop: the frequency response curve by shooting and continuation."""

import itertools

import numpy as np
import pytest
from sampling import first_apart
from scipy.optimize import brentq

from beamsim.flow.periodic_flow import ContactDirection, PeriodicForcing, shift_system
from beamsim.flow.transient import simulate
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import Branch, BranchStep, Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.orbits.special_curves import CurveProblem, Grazing, start_of_curve
from beamsim.orbits.special_points import special_points, switch_at_period_doubling

K = np.array([[1.0, -1.0], [-1.0, 2.0]])
W2, V = np.linalg.eigh(K)


def straight_path(flow, direction):
    """Systems whose contacts move along a straight line with the parameter."""
    return lambda x: (flow.with_contacts(shift_system(flow.system, direction, x).contacts), direction)


@pytest.fixture(scope="module")
def flow_of(make_system):
    def make(omega=0.8, **changes):
        contacts = {"shape": V[:1], "stiffness": 100.0, "gap": 1.0, "sign": -1.0} | changes
        system = make_system(np.sqrt(W2), V.T @ (0.03 * K) @ V, **contacts)
        return VariationalFlow(system, PeriodicForcing.harmonic(0.1 * V[1]), omega)

    return make


def walk(problem, low=0.5, high=0.8, **settings):
    start = find_orbit(problem, forward=-1)
    branch = Branch(problem, start, low, high, Settings(**{"step": 0.05, "largest_step": 0.15} | settings))
    points, special = [], []
    for point in branch:
        if points:
            special += special_points(BranchStep(problem, points[-1], point, branch.settings))
        points.append(point)
    return branch, points, special


@pytest.fixture(scope="module")
def curve(flow_of):
    problem = ForcedOrbits(flow_of())
    return (problem, *walk(problem))


def harmonics(problem, point, count=6, samples=2048):
    flow, _ = problem.flow_at(point.parameter)
    t = np.arange(samples) * point.data.duration / samples
    x = flow.states_at(point.data, t)[:, :2] @ V[0]
    return 2 * np.abs(np.fft.rfft(x))[:count] / samples


def test_the_branch_is_whole(curve):
    _, branch, points, _ = curve
    assert branch.outcome.text == "complete: reached the end of the range at parameter 0.5"
    assert points[0].parameter == 0.8
    assert points[-1].parameter == 0.5
    assert max(p.residual for p in points) < 1e-11


def test_grazing_where_the_linear_response_reaches_the_stop(curve):
    """Touching is the linear structure's business: |q1(omega)| = gap, solved apart; published 0.653440 and 0.581900."""
    _, _, _, special = curve

    def excess(w):
        Z = K - w**2 * np.eye(2) + 0.03j * w * K
        return abs(np.linalg.solve(Z, [0.0, 0.1])[0]) - 1.0

    expected = brentq(excess, 0.62, 0.7, xtol=1e-14), brentq(excess, 0.55, 0.61, xtol=1e-14)
    found = [s.parameter for s in special if s.kind == "grazing"]
    np.testing.assert_allclose(found, expected, atol=1e-8)
    np.testing.assert_allclose(found, [0.653440, 0.581900], atol=6e-7)


def test_harmonics_on_the_larger_contacting_branch(curve):
    """Published harmonic balance with 21 harmonics at 0.7541: 1.32695, Q3 0.09319, Q5 0.02634; unstable there."""
    problem, _, points, _ = curve
    at = [
        solve_at(problem, a.u, Settings(), 0.7541)
        for a, b in itertools.pairwise(points)
        if (a.parameter - 0.7541) * (b.parameter - 0.7541) < 0
    ]
    amplitudes = [harmonics(problem, p) for p in at]
    largest = int(np.argmax([a[1] for a in amplitudes]))
    np.testing.assert_allclose(amplitudes[largest][[1, 3, 5]], [1.32695, 0.09319, 0.02634], rtol=2e-3)
    assert not problem.orbit(at[largest]).stable
    assert len(at) == 3


@pytest.mark.parametrize("index", [0, -1, "upper"])
def test_stable_motions_attract(curve, index):
    """The transient solver, started beside a stable motion, comes to it."""
    problem, _, points, _ = curve
    contacting = [p for p in points if len(p.data.signature) == 2 and problem.orbit(p).stable]
    point = contacting[len(contacting) // 2] if index == "upper" else points[index]
    orbit = problem.orbit(point)
    assert orbit.stable
    flow, _ = problem.flow_at(point.parameter)
    long = 300 * orbit.period
    near = orbit.state[:4] * (1 + 1e-3)
    end = simulate(flow.exact, near, duration=long)
    np.testing.assert_allclose(end.final_y[:4], orbit.state[:4], atol=1e-6)


def test_special_points_are_what_they_are_called(curve):
    *_, special = curve
    kinds = [s.kind for s in special]
    assert kinds.count("fold") == 2
    assert kinds.count("period_doubling") == 2
    for s in special:
        mu = np.linalg.eigvals(s.point.data.transition) if s.kind != "grazing" else None
        if s.kind == "fold":
            assert abs(s.point.tangent[-1]) < 1e-8
        elif s.kind == "period_doubling":
            assert np.min(np.abs(mu + 1)) < 1e-8
        elif s.kind == "neimark_sacker":
            pair = mu[np.argmin(np.abs(np.abs(mu) - 1))]
            assert abs(abs(pair) - 1) < 1e-8
            assert abs(pair.imag) > 1e-3


def test_branch_of_doubled_period(curve):
    problem, _, _, special = curve
    doubling = next(s for s in special if s.kind == "period_doubling" and s.parameter < 0.75)
    doubled, first = switch_at_period_doubling(problem, doubling)
    points = []
    for point in Branch(doubled, first, 0.5, 0.8):
        points.append(point)
        if len(points) == 40:
            break
    stable = [p for p in points[3:] if doubled.orbit(p).stable]
    assert stable
    best = min(stable, key=lambda p: abs(doubled.orbit(p).multipliers[0]))
    orbit = doubled.orbit(best)
    flow, _ = doubled.flow_at(best.parameter)
    half = flow.flow_map(orbit.state, orbit.period / 2).end
    assert np.linalg.norm(half - orbit.state) > 1e-2
    long = 300 * orbit.period
    end = simulate(flow.exact, orbit.state[:4] * (1 + 1e-5), duration=long)
    np.testing.assert_allclose(end.final_y[:4], orbit.state[:4], atol=1e-6)


def test_fold_followed_in_the_level(flow_of, curve):
    problem, _, _, special = curve
    fold = [s for s in special if s.kind == "fold"][1]
    folds, start = start_of_curve(problem, fold, "level", 1.0, sign=-1)
    branch = Branch(folds, start, 0.6, 1.5, Settings(tolerance=1e-9))
    last = list(branch)[-1]
    assert branch.outcome.text == "complete: reached the end of the range at parameter 0.6"
    other = ForcedOrbits(VariationalFlow(problem.flow.system, problem.flow.forcing, 0.8, 0.6))
    _, _, found = walk(other)
    assert min(abs(s.parameter - last.u[-2]) for s in found if s.kind == "fold") < 1e-6


def test_fold_followed_in_the_gap(flow_of, curve):
    """Lengths scale: a fold at (level 1, gap g) is the fold at level 1/g of the original."""
    problem, _, _, special = curve
    fold = [s for s in special if s.kind == "fold"][1]
    flow = flow_of()
    path = straight_path(flow, ContactDirection.of(flow.system.contacts, gap=1.0))
    folds, start = start_of_curve(problem, fold, path, 0.0)
    last = list(Branch(folds, start, -0.1, 0.25, Settings(tolerance=1e-9)))[-1]
    level, start = start_of_curve(problem, fold, "level", 1.0, sign=-1)
    other = list(Branch(level, start, 0.8, 1.5, Settings(tolerance=1e-9)))[-1]
    assert last.parameter == 0.25
    assert last.u[-2] == pytest.approx(other.u[-2], abs=1e-8)


def test_grazing_followed_in_the_level(curve):
    """The linear response touches all along: ``|q1(omega)| level = gap``. The first fold, 6e-9 away, goes with it."""
    problem, _, _, special = curve
    fold = next(s for s in special if s.kind == "fold")
    grazing = next(s for s in special if s.kind == "grazing")
    assert 0 < abs(fold.parameter - grazing.parameter) < 1e-8
    curve_of_grazings, start = start_of_curve(problem, grazing, "level", 1.0, sign=-1)
    branch = Branch(curve_of_grazings, start, 0.6, 1.5, Settings(tolerance=1e-9))
    points = list(branch)
    assert branch.outcome.text == "complete: reached the end of the range at parameter 0.6"
    assert len(points) < 40
    for p in points:
        omega, level = p.u[-2:]
        q1 = np.linalg.solve(K - omega**2 * np.eye(2) + 0.03j * omega * K, [0.0, 0.1])[0]
        assert abs(q1) * level == pytest.approx(1.0, abs=1e-9)


@first_apart("what", 2, ["level", "gap", "shape", "stiffness"])
@pytest.mark.parametrize("on_ground", [False, True])
def test_jacobian_of_a_grazing_curve(make_system, what, on_ground):
    """Against central differences, at a motion that has contacts besides; base-mounted, or feeling a moving base."""
    system = make_system(
        np.sqrt(W2), V.T @ (0.03 * K) @ V, shape=V, stiffness=[100.0, 3.0], gap=[1.0, 0.2], sign=-1.0,
        on_ground=on_ground
    )  # fmt: skip
    loads = PeriodicForcing(
        np.ones(1, dtype=np.int64), -0.1j * V[1:2], np.zeros(1), np.array([[0.05 + 0.02j]]), np.array([-2.0]), 1.0
    )
    flow = VariationalFlow(system, loads, 0.7)
    orbits = ForcedOrbits(flow)
    point = find_orbit(orbits)
    assert point.data.event_time.size >= 2
    direction = ContactDirection.of(
        system.contacts, **({} if what == "level" else {what: V[::-1] if what == "shape" else 1.0})
    )
    second = "level" if what == "level" else straight_path(flow, direction)
    curve = CurveProblem(orbits, second, Grazing(0, True, 0.3, 0.0))
    u = np.append(point.u, 1.0 if what == "level" else 0.0)
    _, J, _ = curve.residual(u)
    for i, size in enumerate(curve.scale(u)[0]):
        h = np.zeros(u.size)
        h[i] = 1e-6 * max(size, 0.1)
        difference = (curve.residual(u + h)[0] - curve.residual(u - h)[0]) / (2 * h[i])
        np.testing.assert_allclose(J[:, i], difference, atol=2e-5 * max(1.0, np.abs(J).max()))


@first_apart(
    ("law", "turns"), 1, [({"dashpot": 5.0, "no_tension": True}, "nonsmooth_fold"), ({"dashpot": 1.0}, "fold")]
)
def test_with_a_dashpot(flow_of, law, turns):
    """The force jumps at contact: the branch has corners at grazing and is followed through them.

    Without tension it turns back at the first one, and no multiplier is 1 there.
    """
    problem = ForcedOrbits(flow_of(**law))
    branch, points, special = walk(problem)
    assert branch.outcome.text == "complete: reached the end of the range at parameter 0.5"
    grazing = [s for s in special if s.kind in ("grazing", "nonsmooth_fold")]
    np.testing.assert_allclose([s.parameter for s in grazing], [0.6534401404, 0.5818996390], atol=1e-8)
    folds = [s for s in special if s.kind == "fold"]
    assert (grazing[0] if turns == "nonsmooth_fold" else folds[0]).kind == turns
    assert max(np.abs(problem.multipliers(s.point) - 1.0).min() for s in folds) < 1e-8
    contacting = [p for p in points if p.data.event_time.size and problem.orbit(p).stable]
    orbit = problem.orbit(contacting[len(contacting) // 2])
    problem.flow = problem.flow.with_loads(omega=orbit.parameter)
    long = 300 * orbit.period
    end = simulate(problem.flow.exact, orbit.state[:4] * (1 + 1e-4), duration=long)
    np.testing.assert_allclose(end.final_y[:4], orbit.state[:4], atol=1e-6)


def test_level_does_not_matter_without_gap(flow_of):
    """z = 0: homogeneous of degree one."""
    flow = flow_of(omega=0.7, gap=0.0)
    problem = ForcedOrbits(flow, "level")
    start = find_orbit(problem, forward=1)
    points = list(Branch(problem, start, 0.5, 3.0))
    for p in points:
        np.testing.assert_allclose(p.u[:-1] / p.parameter, start.u[:-1], rtol=1e-8, atol=1e-10)
    assert points[-1].parameter == 3.0


def test_a_branch_that_ends_says_why(flow_of):
    problem = ForcedOrbits(flow_of())
    branch, points, _ = walk(problem, most_points=7)
    assert len(points) == 7
    assert branch.outcome.numbers["points"] == 7
    impossible, points, _ = walk(problem, tolerance=1e-30)
    assert len(points) == 1
    assert impossible.outcome.code == "step_too_small"
