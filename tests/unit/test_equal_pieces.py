"""Motions of many equal pieces: evaluated together they give what the kernels give segment by segment."""

from __future__ import annotations

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.energy import power_factors
from beamsim.analyses.run.outputs import exact_flow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from tests.helpers.observed import all_outputs

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
    return motion, all_outputs(build_system(beamsim.load_scenario(CASE)), motion.flow)


def of_case() -> Trajectory:
    system = build_system(beamsim.load_scenario(CASE))
    return simulate(exact_flow(system, DURATION), system.initial_state)


def largest_difference(one: np.ndarray, other: np.ndarray) -> float:
    return float((np.abs(one - other).max(axis=0) / np.abs(other).max(axis=0)).max())


def some_times() -> np.ndarray:
    """Times that fall on a pattern within the pieces, and times that do not."""
    even = np.arange(1, int(DURATION * 20e3)) / 20e3
    return np.sort(np.concatenate([even, np.random.default_rng(2).uniform(0.0, DURATION, 100)]))


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
