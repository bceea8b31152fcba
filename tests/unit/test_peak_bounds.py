"""Segments are ruled out before the search for extremes: few pairs of a segment and an output are left, and the same
extremes."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.outputs import exact_flow, output_groups
from beamsim.flow import peak_bounds, trajectory
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

SNUBBERS = 12


@pytest.fixture(scope="module")
def motion():
    row = [
        {"name": f"s{k}", "position": float(x), "side": "below", "stiffness": 25e3, "gap": 2e-5,
         "damping": {"kind": "ratio", "ratio": 0.02}}
        for k, x in enumerate(np.linspace(0.03, 0.27, SNUBBERS), 1)
    ]  # fmt: skip
    scenario = {
        "beam": {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
                 "elements": 20, "damping": {"kind": "modal", "ratio": 0.01}},
        "reduction": {"modes": 6}, "snubbers": row,
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 65.0},
        "run": {"duration": 0.05, "sample_rate": 5e3},
    }  # fmt: skip
    system = build_system(beamsim.load_scenario(scenario))
    flow = exact_flow(system, 0.05)
    return simulate(flow, system.initial_state), output_groups(system, flow)


@pytest.fixture(scope="module")
def seeds(motion):
    whole, outputs = motion
    times = np.linspace(0.0, whole.end, 512)
    values = whole.sample(times, outputs)
    seed = np.stack([values.max(axis=0), -values.min(axis=0)])
    return seed, np.stack([times[values.argmax(axis=0)], times[values.argmin(axis=0)]])


def test_few_pairs_are_searched(motion, seeds, monkeypatch):
    whole, outputs = motion
    bounded, pairs_of = [], peak_bounds._pairs
    monkeypatch.setattr(peak_bounds, "_pairs", lambda *of: bounded.append(of[4].shape[1]) or pairs_of(*of))
    unknown = np.full((2, SNUBBERS), -np.inf)
    peak_bounds.candidates(whole, outputs.groups["force"], unknown, np.zeros((2, SNUBBERS)))
    closed = [int(np.count_nonzero(state.phases)) for state in whole.flow.states]
    assert bounded == [count for count in closed if count]  # forces of open snubbers are zero
    assert np.all(unknown >= 0.0)
    monkeypatch.undo()
    highest, _, _ = whole.maxima(outputs, *seeds)
    pairs = whole.time.size * highest.size
    known, at = (values.copy() for values in seeds)
    left = sum(c.above(known.ravel()).segment.size for c in peak_bounds.candidates(whole, outputs, known, at))
    assert whole.time.size > 50
    assert left < 0.05 * pairs
    fine = whole.sample(np.linspace(0.0, whole.end, 100_001), outputs)
    reached = np.stack([fine.max(axis=0), -fine.min(axis=0)])
    assert np.all(highest >= reached - 1e-9 * np.abs(reached))


@pytest.mark.parametrize("largest", [1e100, 1e-6])
def test_extremes_are_those_of_a_search_through_every_segment(motion, seeds, largest, monkeypatch):
    whole, outputs = motion
    few, _, evaluations = whole.maxima(outputs, *seeds)
    monkeypatch.setattr(peak_bounds, "LARGEST", largest)
    if largest > 1.0:
        monkeypatch.setattr(trajectory.Trajectory, "exponentials", False)
    every, _, more = whole.maxima(outputs, *seeds)
    np.testing.assert_allclose(few, every, rtol=3e-10, atol=1e-12)
    assert more > evaluations + whole.time.size


def test_both_signs_are_two_searches(motion, seeds):
    whole, outputs = motion
    both, _, _ = whole.maxima(outputs, *seeds)
    for sign, one, seed, when in zip((1.0, -1.0), both, *seeds, strict=True):
        alone, _, _ = whole.maxima(outputs if sign > 0 else lambda phases: -outputs(phases), seed, when)
        np.testing.assert_allclose(alone, one, rtol=3e-10, atol=1e-12)


def test_no_value_exceeds_the_bound(motion):
    whole, outputs = motion
    count = outputs(whole.flow.states[0].phases).row.shape[0]
    low = np.full((2, count), -1e300)
    known, when = low.copy(), low.copy()
    checked = 0
    for of_state in peak_bounds.candidates(whole, outputs, known, when):
        for g in np.unique(of_state.segment):
            times = whole.time[g] + np.linspace(0.0, 0.999, 50) * whole.length[g]
            values = whole.sample(times, outputs)
            reached = np.concatenate([values.max(axis=0), -values.min(axis=0)])
            mine = of_state.segment == g
            assert np.all(reached[of_state.output[mine]] <= of_state.bound[mine] + 1e-9 * np.abs(of_state.bound[mine]))
            checked += int(mine.sum())
    assert checked > count
