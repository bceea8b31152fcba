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
    left, right, weight = power_factors(motion.flow)
    table = np.concatenate([motion.flow.output_table(left), motion.flow.output_table(right)], axis=2)
    whole = motion.segment_integrals(table, weight)
    chosen = np.arange(0, motion.time.size, every)
    assert not motion.exponentials
    assert chosen.size > 30
    some = motion.only(chosen).segment_integrals(table, weight)
    np.testing.assert_allclose(some, whole[chosen], rtol=1e-9, atol=1e-12 * np.abs(whole).sum())
