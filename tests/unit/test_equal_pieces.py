"""Motions of many equal pieces: evaluated together they give what the kernels give segment by segment."""

from __future__ import annotations

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.energy import energy_of_segments, power_factors
from beamsim.analyses.run.outputs import exact_flow, output_groups
from beamsim.flow import equal_pieces, fourier, trajectory
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
    system = build_system(beamsim.load_scenario(CASE))
    flow = exact_flow(system, DURATION)
    motion = simulate(flow, system.initial_state)
    assert motion.event_time.size > 10  # contact opens and closes
    return motion, output_groups(system, flow)


@pytest.fixture
def one_by_one(monkeypatch):
    def switch() -> None:
        for module in (trajectory, fourier):
            monkeypatch.setattr(module, "many_pieces", lambda motion: False)

    return switch


def largest_difference(one: np.ndarray, other: np.ndarray) -> float:
    return float((np.abs(one - other).max(axis=0) / np.abs(other).max(axis=0)).max())


def some_times() -> np.ndarray:
    """Times that fall on a pattern within the pieces, and times that do not."""
    even = np.arange(1, int(DURATION * 20e3)) / 20e3
    return np.sort(np.concatenate([even, np.random.default_rng(2).uniform(0.0, DURATION, 100)]))


def test_most_pieces_take_one_look_for_contact(motion):
    """High powers of time are no reason to approach the end of a short piece in steps that double."""
    assert motion[0].evaluations < 1.5 * motion[0].time.size


def test_samples(motion, one_by_one):
    trajectory, groups = motion
    together = trajectory.sample(some_times(), groups)
    one_by_one()
    assert largest_difference(together, trajectory.sample(some_times(), groups)) < 1e-11


def test_integrals_of_products(motion, one_by_one):
    trajectory, _ = motion
    together = trajectory.product_integrals(some_times(), *power_factors(trajectory.flow))
    one_by_one()
    alone = trajectory.product_integrals(some_times(), *power_factors(trajectory.flow))
    assert largest_difference(together, alone) < 1e-11


def test_integrals_of_products_from_a_later_time_on(motion, one_by_one):
    trajectory, _ = motion
    begin, end = 0.02071, DURATION
    late = trajectory.within(begin, end)  # begins a little before
    times, factors = some_times()[some_times() > begin], power_factors(trajectory.flow)
    together = late.product_integrals(times, *factors, begin)
    whole = trajectory.product_integrals(np.append(begin, times), *factors)
    assert largest_difference(together, whole[1:] - whole[0]) < 1e-11
    one_by_one()
    assert largest_difference(together, late.product_integrals(times, *factors, begin)) < 1e-11


def test_maxima(motion, one_by_one):
    trajectory, groups = motion
    count = groups(trajectory.flow.system.contacts.start).row.shape[0]
    together, when, evaluations = trajectory.maxima(groups, np.full(count, -np.inf), np.zeros(count))
    one_by_one()
    alone, when_alone, all_evaluations = trajectory.maxima(groups, np.full(count, -np.inf), np.zeros(count))
    np.testing.assert_allclose(together, alone, rtol=1e-10)
    np.testing.assert_allclose(when, when_alone, atol=1e-9)
    assert evaluations < all_evaluations / 10


def test_bound_on_what_samples_fold(motion, one_by_one):
    trajectory, groups = motion
    part = fourier.MotionPart.of(trajectory, groups, 0.01, DURATION, np.pi * 60e3)
    together = part.folded(1 / 60e3, 2 * np.pi * 20e3, open_ends=False)
    one_by_one()
    np.testing.assert_allclose(part.folded(1 / 60e3, 2 * np.pi * 20e3, open_ends=False), together, rtol=1e-6)


def test_few_segments_are_evaluated_one_by_one(motion, monkeypatch):
    """The whole evaluation costs a few matrices, and kernels only for the segments next to events."""
    trajectory, _ = motion
    kept = []
    segment_by_segment = Trajectory._integrals
    monkeypatch.setattr(
        Trajectory, "_integrals", lambda self, *of: (kept.append(self.time.size), segment_by_segment(self, *of))[1]
    )
    balance = energy_of_segments(trajectory)
    assert balance.error < 1e-11
    assert balance.history.stored.size == trajectory.time.size + 1  # the balance is looked at in every piece
    assert kept
    assert max(kept) <= trajectory.time.size / 8


def test_a_wrong_amplitude_shows(motion, one_by_one, monkeypatch):
    trajectory, groups = motion
    right = equal_pieces.amplitudes
    monkeypatch.setattr(equal_pieces, "amplitudes", lambda *of: 1.0001 * right(*of))
    together = trajectory.sample(some_times(), groups)
    one_by_one()
    assert largest_difference(together, trajectory.sample(some_times(), groups)) > 1e-5
