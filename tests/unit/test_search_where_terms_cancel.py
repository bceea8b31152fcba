"""Searches of functions whose terms cancel: steps are not bounded by the curvature of each term alone."""

import numpy as np
import pytest

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

DURATION = 0.3


def moving_ground(folder, side):
    """A free beam, which a moving base does not move, and a stop on the ground; the input is a sum of splines."""
    time = np.linspace(0.0, DURATION, 61)
    values = 5.0 * (1.0 + np.sin(40 * time) + 0.4 * np.sin(130 * time) * time)
    file = folder / "input.csv"
    np.savetxt(file, np.column_stack([time, values]), delimiter=",", header="time (s),value (m/s^2)", comments="")
    return beamsim.Scenario.model_validate(
        {
            "beam": {
                "length": 0.44,
                "bending_stiffness": 12.5,
                "mass_per_length": 3.7,
                "elements": 1,
                "supports": {"left": "free", "right": "free"},
            },
            "reduction": {"modes": "all"},
            "excitation": {
                "kind": "sampled",
                "applied_to": "base",
                "quantity": "acceleration",
                "file": str(file),
            },
            "snubbers": [
                {
                    "name": "stop",
                    "position": 0.31,
                    "side": "above",
                    "mounted_on": "ground",
                    "stiffness": 30.0,
                    "gap": 0.0,
                }
            ],
            "probes": [{"name": "end", "position": 0.0}],
            "run": {"duration": DURATION, "sample_rate": 2000, "start": "rest", "convergence": "off"},
        }
    )


def motion_beside_ground(folder, side):
    system = build_system(moving_ground(folder, side))
    return simulate(exact_flow(system, DURATION), system.initial_state, max_evaluations=200_000)


@pytest.mark.parametrize("side", ["below", "above"])
def test_a_body_that_stays_at_rest_in_space_beside_a_stop(tmp_path, side):
    """The penetration is zero throughout, open or closed: a step at a time of 1e-9 s before."""
    trajectory = motion_beside_ground(tmp_path, side)
    assert trajectory.end == DURATION
    assert trajectory.evaluations < 5000
    beam = trajectory.states_at(np.array([DURATION]))[0, :2]
    assert np.abs(beam).max() > 1e-4  # rigid-body motion relative to the base


def test_the_largest_value_of_what_stays_zero(tmp_path):
    trajectory = motion_beside_ground(tmp_path, "above")
    penetration = trajectory.flow.equations.penetration
    found = trajectory.extrema(lambda phases: penetration)
    round_off = 64 * np.finfo(float).eps * 0.2  # of the terms that cancel, m
    assert abs(found.high[0]) < round_off
    assert abs(found.low[0]) < round_off
    assert found.evaluations < 20_000
