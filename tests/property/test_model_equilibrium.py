"""Static equilibrium: the contact conditions hold, the energy is least, and what has no answer says so."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.contacts.equilibrium import FLOATING_MESSAGE, UNBALANCED_MESSAGE, CubicSprings, Springs, find_equilibrium

pytestmark = pytest.mark.quick


def random_case(seed, n, m, rigid, balanced):
    rng = np.random.default_rng(seed)
    omega2 = np.concatenate([np.zeros(rigid), np.sort(10 ** rng.uniform(0, 6, n - rigid))])
    shape = rng.normal(size=(m, n))
    springs = Springs(
        shape=shape,
        sign=rng.choice([-1.0, 1.0], m),
        stiffness=10 ** rng.uniform(0, 6, m),
        gap=rng.choice([0.0, 1.0, 1.0, 1.0], m) * rng.normal(size=m) * 1e-3,
    )
    load = rng.normal(size=n) * 10 ** rng.uniform(-3, 3)
    if balanced and rigid:
        # Rigid-body loads that positive contact forces can carry.
        push = rng.uniform(0, 1, m) * rng.integers(0, 2, m)
        load[:rigid] = -(springs.sign * push) @ shape[:, :rigid]
    return omega2, springs, load


def energy(omega2, springs, load, q):
    delta = np.maximum(-springs.gap - springs.sign * (springs.shape @ q), 0)
    return q @ (omega2 * q) / 2 + springs.stiffness @ delta**2 / 2 - load @ q


def gradient_error(omega2, springs, load, q):
    delta = np.maximum(-springs.gap - springs.sign * (springs.shape @ q), 0)
    push = springs.shape.T @ (springs.sign * springs.stiffness * delta)
    size = np.abs(omega2 * q).max() + np.abs(push).max(initial=0.0) + np.abs(load).max()
    size += np.abs(springs.shape.T * springs.stiffness * springs.gap).max(initial=0.0)
    return np.abs(omega2 * q - push - load).max() / max(size, 1e-300)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 8), m=st.integers(0, 6))
@settings(max_examples=30, deadline=None)
def test_contact_conditions_hold_on_a_supported_structure(seed, n, m):
    omega2, springs, load = random_case(seed, n, m, 0, False)
    found = find_equilibrium(omega2, 0, springs, load[None, :])
    assert found.q is not None
    assert found.reason == ""
    delta = -springs.gap - springs.sign * (springs.shape @ found.q)
    size = np.abs(springs.gap).max(initial=0) + np.abs(springs.shape * found.q).max(initial=0)
    np.testing.assert_allclose(
        found.force / np.maximum(springs.stiffness, 1),
        np.maximum(delta, 0) * np.minimum(springs.stiffness, 1),
        atol=1e-9 * size,
    )
    assert np.all(found.force >= 0)
    assert gradient_error(omega2, springs, load, found.q) < 1e-6


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 6), m=st.integers(1, 5), rigid=st.integers(1, 2))
@settings(max_examples=30, deadline=None)
def test_floating_structures_agree_with_the_least_energy_over_every_contact_set(seed, n, m, rigid):
    omega2, springs, load = random_case(seed, n, m, min(rigid, n), True)
    rigid = min(rigid, n)
    found = find_equilibrium(omega2, rigid, springs, load[None, :])
    assert found.reason != UNBALANCED_MESSAGE  # by construction
    if found.q is None:
        return
    assert gradient_error(omega2, springs, load, found.q) < 1e-6
    best = energy(omega2, springs, load, found.q)
    for closed in itertools.product([False, True], repeat=m):
        closed = np.array(closed)
        k = np.diag(omega2) + springs.shape[closed].T @ (springs.stiffness[closed, None] * springs.shape[closed])
        f = load - springs.shape[closed].T @ (springs.sign * springs.stiffness * springs.gap)[closed]
        q = np.linalg.lstsq(k, f, rcond=None)[0]
        value = energy(omega2, springs, load, q)
        assert best <= value + 1e-7 * (abs(value) + abs(best) + 1e-12)


@given(seed=st.integers(0, 2**32 - 1), m=st.integers(0, 5))
@settings(max_examples=25, deadline=None)
def test_loads_that_no_contact_can_carry_run_away(seed, m):
    omega2, springs, load = random_case(seed, 4, m, 1, False)
    opening = springs.sign * springs.shape[:, 0]  # every contact opens along +1: a load that way finds no stop
    springs = Springs(springs.shape * np.sign(opening)[:, None], springs.sign, springs.stiffness, springs.gap)
    load[0] = abs(load[0]) + 1.0
    found = find_equilibrium(omega2, 1, springs, load[None, :])
    assert found.q is None
    assert found.reason == UNBALANCED_MESSAGE
    assert np.isnan(found.force).all()


def one_mass(gaps, sides, load=0.0, stiffness=100.0):
    m = len(gaps)
    springs = Springs(np.ones((m, 1)), np.array(sides, float), np.full(m, stiffness), np.array(gaps, float))
    return find_equilibrium(np.zeros(1), 1, springs, np.array([[load]]))


def test_a_free_mass_rests_on_its_stop():
    found = one_mass([1.0], [1.0], load=-5.0)
    assert found.q == pytest.approx([-1.05], rel=1e-14)
    assert found.force == pytest.approx([5.0], rel=1e-14)


def test_a_free_mass_that_touches_both_stops_is_held():
    found = one_mass([0.0, 0.0], [1.0, -1.0])
    assert found.reason == ""
    assert found.q == pytest.approx([0.0])


def test_a_free_mass_clamped_between_prestressed_stops():
    found = one_mass([-1.0, -3.0], [1.0, -1.0])
    assert found.q == pytest.approx([-1.0])
    assert found.force == pytest.approx([200.0, 200.0])


def test_balanced_loads_whose_sum_is_round_off_float_and_do_not_run_away():
    loads = np.array([[0.1], [0.2], [-0.30000000000000004 * (1 + 1e-15)]])
    springs = Springs(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0))
    assert find_equilibrium(np.zeros(1), 1, springs, loads).reason == FLOATING_MESSAGE


def test_a_plane_body_on_three_stops():
    # Two rigid-body coordinates (height, rotation), two stops below at +-1, load off centre but between them.
    springs = Springs(np.array([[1.0, -1.0], [1.0, 1.0]]), np.ones(2), np.full(2, 10.0), np.zeros(2))
    found = find_equilibrium(np.zeros(2), 2, springs, np.array([[-4.0, -2.0]]))
    assert found.force == pytest.approx([1.0, 3.0])
    # Beyond them it tips over.
    assert find_equilibrium(np.zeros(2), 2, springs, np.array([[-4.0, -5.0]])).reason == UNBALANCED_MESSAGE


@given(
    load=st.floats(-1e3, 1e3).map(lambda f: round(f, 9)),
    stiffness=st.sampled_from([0.0, 1.0, 50.0]),
    cubic=st.floats(1e-2, 1e6),
)
@settings(max_examples=25, deadline=None)
def test_cubic_springs_enter_the_balance(load, stiffness, cubic):
    springs = Springs(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0))
    rigid = 0 if stiffness else 1
    found = find_equilibrium(
        np.array([stiffness]), rigid, springs, np.array([[load]]), CubicSprings(np.ones((1, 1)), np.array([cubic]))
    )
    if load == 0 and rigid:
        return
    assert found.q is not None
    q = found.q[0]
    assert stiffness * q + cubic * q**3 == pytest.approx(load, rel=1e-8, abs=1e-300)
