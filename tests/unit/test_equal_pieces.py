"""Motions of many equal pieces: evaluated together they give what the kernels give segment by segment."""

from __future__ import annotations

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.energy import energy_of_segments, power_factors
from beamsim.analyses.run.outputs import exact_flow, output_groups
from beamsim.flow import exact, moments
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

DURATION = 0.06  # s: 2,400 pieces of a spline
CASE = {
    "beam": {
        "length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700,
        "damping": {"kind": "modal", "ratio": 0.01},
    },
    "reduction": {"modes": 3},
    "snubbers": [{"name": "tip", "position": 0.27, "side": "below", "stiffness": 151e3, "gap": 2e-5}],
    "excitation": {
        "kind": "random", "applied_to": "base", "seed": 1,
        "psd": [{"frequency": 20, "density": "0.05 g^2/Hz"}, {"frequency": 2000, "density": "0.05 g^2/Hz"}],
    },
    "run": {"duration": DURATION, "sample_rate": 20e3, "convergence": "off"},
}  # fmt: skip


@pytest.fixture(scope="module")
def motion() -> tuple[Trajectory, object]:
    motion = of_case()
    assert motion.event_time.size > 10  # contact opens and closes
    return motion, output_groups(build_system(beamsim.load_scenario(CASE)), motion.flow)


def of_case() -> Trajectory:
    system = build_system(beamsim.load_scenario(CASE))
    return simulate(exact_flow(system, DURATION), system.initial_state)


def largest_difference(one: np.ndarray, other: np.ndarray) -> float:
    return float((np.abs(one - other).max(axis=0) / np.abs(other).max(axis=0)).max())


def some_times() -> np.ndarray:
    """Times that fall on a pattern within the pieces, and times that do not."""
    even = np.arange(1, int(DURATION * 20e3)) / 20e3
    return np.sort(np.concatenate([even, np.random.default_rng(2).uniform(0.0, DURATION, 100)]))


def test_most_pieces_take_one_look_for_contact(motion):
    """High powers of time are no reason to approach the end of a short piece in steps that double."""
    assert motion[0].evaluations < 1.5 * motion[0].time.size


def test_integrals_of_products(motion):
    """Against a fine rule on the samples."""
    trajectory, _ = motion
    left, right, weight = power_factors(trajectory.flow)
    cuts = np.unique(np.concatenate([trajectory.time, some_times(), [DURATION]]))
    node, gauss = np.polynomial.legendre.leggauss(12)
    middle, half = 0.5 * (cuts[1:] + cuts[:-1]), 0.5 * np.diff(cuts)
    times = (middle[:, None] + half[:, None] * node).ravel()
    products = (trajectory.sample(times, left) * trajectory.sample(times, right)) @ weight
    parts = np.einsum("pnq,n,p->pq", products.reshape(-1, node.size, 2), gauss, half)
    fine = np.vstack([np.zeros(2), np.cumsum(parts, axis=0)])[np.searchsorted(cuts, some_times())]
    exact = trajectory.product_integrals(some_times(), left, right, weight)
    assert largest_difference(exact, fine) < 1e-11


def test_integrals_of_products_from_a_later_time_on(motion):
    trajectory, _ = motion
    begin, end = 0.02071, DURATION
    late = trajectory.within(begin, end)  # begins a little before
    times, factors = some_times()[some_times() > begin], power_factors(trajectory.flow)
    together = late.product_integrals(times, *factors, begin)
    whole = trajectory.product_integrals(np.append(begin, times), *factors)
    assert largest_difference(together, whole[1:] - whole[0]) < 1e-11


def test_equal_pieces_share_their_moments(motion, monkeypatch):
    trajectory, _ = motion
    asked = []
    right = moments.exponential_moments
    monkeypatch.setattr(moments, "exponential_moments", lambda x, top: (asked.append(x.shape[0]), right(x, top))[1])
    balance = energy_of_segments(trajectory)
    assert balance.error < 1e-11
    assert balance.history.stored.size == trajectory.time.size + 1  # the balance is looked at in every piece
    assert 0 < sum(asked) <= trajectory.time.size / 8


@pytest.fixture
def searched(monkeypatch) -> Trajectory:
    """The motion with every piece searched for contact."""
    monkeypatch.setattr(exact, "as_arrays", lambda *of: None)
    return of_case()


def test_steps_over_equal_pieces_give_the_motion_of_the_search(motion, searched):
    stepped = motion[0]
    assert stepped.flow.equal_steps() is not None
    assert searched.flow.equal_steps() is None
    np.testing.assert_array_equal(stepped.event_contact, searched.event_contact)
    np.testing.assert_allclose(stepped.event_time, searched.event_time, rtol=0, atol=1e-12 * DURATION)
    assert stepped.time.size == searched.time.size
    assert largest_difference(stepped.y, searched.y) < 1e-9


def test_most_pieces_are_stepped_over(motion, searched, monkeypatch):
    """The search, at a hundred times the cost, is left with those in which a contact may open or close."""
    stepped, entered = motion[0], []
    walk = exact.step_of

    def with_doubt(*of):
        step = walk(*of)
        entered.append(step)
        return step._replace(doubt=np.full(step.doubt.shape, np.inf))

    assert stepped.evaluations <= searched.evaluations  # a piece counts as one
    monkeypatch.undo()
    monkeypatch.setattr(exact, "step_of", with_doubt)
    never = of_case()
    assert len(entered) == len(never.flow.states)  # one matrix for each contact state
    assert never.evaluations == searched.evaluations  # twin: a step of doubt leaves all to the search


def test_a_wrong_step_shows(motion, monkeypatch):
    right = exact.step_of
    monkeypatch.setattr(exact, "step_of", lambda *of: right(*of)._replace(matrix=1.00001 * right(*of).matrix))
    wrong = of_case()
    common = min(wrong.y.shape[0], motion[0].y.shape[0])
    assert largest_difference(motion[0].y[:common], wrong.y[:common]) > 1e-6
