"""Inputs whose last piece lasts far longer than the pieces before it, on slow modes: closed forms."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import Scenario

OMEGA = 0.3  # rad/s
START = 2e-3  # s, of the input: the piece before it is short


def run(excitation):
    case = {
        "chain": {"masses": [1.0], "springs": [OMEGA**2]},
        "excitation": {"time": START, **excitation},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 60.0, "sample_rate": 5.0},
    }
    return beamsim.run(Scenario.model_validate(case))


@pytest.mark.parametrize("on_base", [False, True])
def test_a_step_that_begins_late(on_base):
    """x = level / omega^2 (1 - cos omega t) from the step on."""
    result = run({"kind": "step", "applied_to": "base" if on_base else {"mass": 1}, "level": 0.2})
    since = np.maximum(result["histories"]["time"].values - START, 0)
    expected = (-1 if on_base else 1) * 0.2 / OMEGA**2 * (1 - np.cos(OMEGA * since))
    np.testing.assert_allclose(result["histories"]["displacement"].sel(probe="mass").values, expected, atol=1e-12)
    assert result.summary["energy_error"] < 1e-12


def test_a_base_that_drifts_after_a_short_pulse():
    """A spring to the ground feels the base's displacement, which grows linearly after the pulse."""
    case = {
        "chain": {
            "masses": [1.0], "springs": [0.0],
            "springs_to_ground": [{"mass": 1, "kind": "linear", "stiffness": OMEGA**2}],
        },
        "excitation": {"kind": "half_sine", "applied_to": "base", "level": 3.0, "duration": 4e-3, "time": START},
        "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 60.0, "sample_rate": 5.0, "start": "rest"},
    }  # fmt: skip
    result = beamsim.run(Scenario.model_validate(case))
    later = result["histories"]["time"].values > 0.1
    # nothing but the spring to the ground holds the mass: it stands still in space
    absolute = result["histories"]["absolute_displacement"].sel(probe="mass").values[later]
    np.testing.assert_allclose(absolute, 0.0, atol=1e-12)
    assert np.abs(result["histories"]["base_displacement"].values[0][later]).max() > 0.1
