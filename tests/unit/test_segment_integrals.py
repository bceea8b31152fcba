"""Integrals over some of the segments of a motion are those over the same segments among all."""

import numpy as np
import pytest

from beamsim.analyses.run.energy import power_factors
from beamsim.analyses.run.outputs import exact_flow
from beamsim.flow.transient import simulate
from beamsim.scenario import Scenario
from beamsim.system.build import build_system


@pytest.fixture(scope="module")
def motion():
    """A swept sine, whose terms have powers of time, against a stop."""
    stop = {"name": "stop", "mass": 1, "side": "below", "stiffness": 9e4, "gap": 1e-4}
    stop["damping"] = {"kind": "viscous", "coefficient": 25.0}
    case = {
        "chain": {"masses": [1.0], "springs": [1e4], "snubbers": [stop]},
        "excitation": {"kind": "swept_sine", "applied_to": "base", "level": 5.0, "from": 15.0, "to": 25.0,
                       "rate": "20 oct/min"},
        "run": {"duration": 1.0, "sample_rate": 500.0},
    }  # fmt: skip
    system = build_system(Scenario.model_validate(case))
    return simulate(exact_flow(system, 1.0), system.initial_state, max_events=10_000)


@pytest.mark.parametrize("every", [2, 3])
def test_gaps_between_segments_change_nothing(motion, every):
    factors = power_factors(motion.flow)
    whole = motion.segment_integrals(*factors)
    chosen = np.arange(0, motion.time.size, every)
    assert not motion.exponentials
    assert chosen.size > 30
    some = motion.only(chosen).segment_integrals(*factors)
    np.testing.assert_allclose(some, whole[chosen], rtol=1e-9, atol=1e-12 * np.abs(whole).sum())


def test_integrals_with_weights_of_their_own_against_quadrature(motion):
    """Of the state, as tracking filters of a swept sine ask for."""
    rng = np.random.default_rng(3)
    part = motion.only(np.flatnonzero(motion.length > 1e-4)[::5])
    exponent = rng.normal(size=(2, part.segments)) * 20.0 - 2j * np.pi * rng.uniform(0.0, 400.0, (2, part.segments))
    polynomial = rng.normal(size=(2, part.segments, 4)) * part.length[:, None] ** -np.arange(4)
    state = motion.flow.empty_output(motion.flow.size)
    state.row[:] = np.eye(motion.flow.size)

    found = part.weighted_integrals(lambda phases: state, exponent, polynomial)
    point, gauss = np.polynomial.legendre.leggauss(60)
    for w, g in np.ndindex(exponent.shape):
        tau = 0.5 * part.length[g] * (1.0 + point)
        weight = np.exp(exponent[w, g] * tau) * np.polynomial.polynomial.polyval(tau, polynomial[w, g])
        values = motion.states_at(part.time[g] + tau)
        expected = 0.5 * part.length[g] * ((gauss * weight) @ values)
        size = 0.5 * part.length[g] * ((gauss * np.abs(weight)) @ np.abs(values))
        assert np.all(np.abs(found[w, g] - expected) < 1e-11 * size)
