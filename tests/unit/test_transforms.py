"""Fourier integrals at equally spaced frequencies against those that are computed one by one."""

import numpy as np
import pytest

from beamsim.flow.channels import NEIGHBOURS, MotionPart, evenly_spaced_sums, interpolate_integrals
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.scenario import Scenario
from beamsim.system.build import build_system
from tests.helpers.observed import all_outputs

STOP = {"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0, "gap": 0.01}
SAWTOOTH = {"kind": "sawtooth", "applied_to": "base", "level": 10.0, "duration": 0.3}
WEAK = {"law": "no_tension", "damping": {"kind": "viscous", "coefficient": 1e-7}}  # its face returns in 0.3 ns
FALL = {"gravity": 9.81}


def part_of(changes, stop, highest, duration=5.0):
    """Two masses above a stop, of which the first fifth of the time is left out."""
    chain = {"masses": [1.0, 0.5], "springs": [40.0, 30.0], "dashpots": [0.1, 0.2], "snubbers": [STOP | stop]}
    run = {"duration": duration, "start": "rest"}
    system = build_system(Scenario.model_validate({"chain": chain, "run": run, **changes}))
    flow = exact_flow(system, duration)
    motion = simulate(flow, system.initial_state)
    return MotionPart(motion.extract(0.2 * duration, duration), all_outputs(system, flow), highest)


def test_sums_over_uneven_times():
    rng = np.random.default_rng(4)
    times, values, step = rng.uniform(0.0, 2.0, 500), rng.normal(size=(500, 3)), np.pi / 2.0
    parts = ((times[part], values[part]) for part in np.array_split(np.arange(500), 4))
    exact = np.exp(-1j * step * np.outer(np.arange(101), times)) @ values
    np.testing.assert_allclose(evenly_spaced_sums(parts, step, 101, 3), exact, atol=1e-11)


def test_between_the_known_frequencies():
    """A ramp that lasts for 2 s, at frequencies next to those that are known."""
    step, length = np.pi / 2.0, 2.0

    def ramp(omega):
        turn = 1j * omega * length
        with np.errstate(invalid="ignore", divide="ignore"):
            value = length**2 * (1.0 - (1.0 + turn) * np.exp(-turn)) / turn**2
        return np.where(omega == 0.0, 0.5 * length**2, value)

    known = ramp(step * np.arange(60 + NEIGHBOURS))
    position = np.append(np.random.default_rng(5).uniform(0.05, 59.0, 200), [0.0, 7.0])
    np.testing.assert_allclose(interpolate_integrals(known, position), ramp(step * position), atol=1e-12)


@pytest.mark.parametrize("highest", [8.0, 200.0])
@pytest.mark.parametrize(
    ("changes", "stop"),
    [
        ({}, {}),  # at rest
        (FALL, {}),
        (FALL, {"stiffness": 1e7}),  # short contacts
        (FALL, WEAK),
        ({"excitation": SAWTOOTH}, {}),
        ({"excitation": {**SAWTOOTH, "kind": "half_sine"}}, {"stiffness": 1e7}),
        ({"chain": {"masses": [1.0], "springs": [0.0], "snubbers": [STOP]}, **FALL}, {}),  # polynomials of time alone
    ],
)
def test_integrals_are_those_that_are_computed_one_by_one(changes, stop, highest):
    part = part_of(changes, stop, highest)
    step = np.pi / part.duration
    exact = part.motion.fourier_integrals(part.rows_of, step * np.arange(part.all_integrals.shape[1]))
    size = np.sqrt(part.mean_squares) * part.duration
    assert np.all(np.abs(part.all_integrals - exact).max(axis=1) <= 1e-11 * size)
    between = np.array([0.3, 0.77 * highest, highest])
    direct = part.motion.fourier_integrals(part.rows_of, between)
    for column in range(size.size):
        assert np.all(np.abs(part.integrals(between, column) - direct[column]) <= 1e-11 * size[column])
    np.testing.assert_allclose(part.means, exact[:, 0].real / part.duration, atol=1e-12 * size.max())
    for half in part.halves:  # of which the second has what the first leaves
        between = np.array([0.0, 2.0 * np.pi / half.duration, 0.77 * highest, highest])
        direct = half.motion.fourier_integrals(part.rows_of, between)
        for column in range(size.size):
            assert np.all(np.abs(half.integrals(between, column) - direct[column]) <= 1e-11 * size[column])


def test_deviations_about_a_level_keep_their_digits():
    """A mass that swings by 1e-6 m about a deflection of 98 m."""
    chain = {"masses": [1.0], "springs": [0.1]}
    run = {"duration": 50.0, "start": {"displacement": [-98.1 + 1e-6]}}
    system = build_system(Scenario.model_validate({"chain": chain, "gravity": 9.81, "run": run}))
    flow = exact_flow(system, 50.0)
    outputs = all_outputs(system, flow)
    part = MotionPart(simulate(flow, system.initial_state).extract(0.0, 50.0), outputs, 0.0)
    swings = np.abs(part.means) > 90.0
    assert swings.any()
    for begin, found in zip((0.0, 37.5), part.quarter_deviations, strict=True):
        sampled = part.motion.sample(np.linspace(begin, begin + 12.5, 20001), outputs) - part.means
        np.testing.assert_allclose(found[swings], np.sqrt((sampled[:, swings] ** 2).mean(axis=0)), rtol=1e-3)
