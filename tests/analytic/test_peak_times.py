"""When peaks are reached: one mass under a step of force, alone in closed form and against a stop from its samples."""

import math

import numpy as np
import pytest

import beamsim
from beamsim.cli.tables import table_rows
from beamsim.scenario import load_scenario

MASS, STIFFNESS, FORCE = 2.0, 800.0, 5.0


def pushed(dashpot=0.0, **stop):
    return load_scenario(
        {
            "chain": {"masses": [MASS], "springs": [STIFFNESS], "dashpots": [dashpot],
                      "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 3e4, **stop}]},
            "excitation": {"kind": "step", "applied_to": {"mass": 1}, "level": FORCE},
            "probes": [{"name": "mass", "mass": 1}],
            "run": {"duration": 0.25, "sample_rate": "100 kHz", "convergence": "off"},
        }
    )  # fmt: skip


def test_the_first_swing_of_one_mass():
    result = beamsim.run(pushed(gap="1 m"))
    times = result.summary["peak_times_s"]
    half_period = math.pi / math.sqrt(STIFFNESS / MASS)
    assert times["peak_displacement_m"]["mass"] == pytest.approx(half_period, rel=1e-6)
    # the acceleration is as large at the beginning as after half a period
    assert min(abs(times["peak_acceleration_g"]["mass"] - t) for t in (0.0, half_period)) < 1e-6
    assert times["peak_force_n"] == {}  # it never touches the stop


def test_a_stop_is_pressed_hardest_where_its_samples_are_largest():
    result = beamsim.run(pushed(dashpot=4.0, gap="4 mm"))
    force = result["histories"]["snubber_force"].sel(snubber="stop").values
    time = result.summary["peak_times_s"]["peak_force_n"]["stop"]
    assert time == pytest.approx(result["histories"]["time"].values[np.argmax(force)], abs=1e-5)
    assert any(text.endswith(f"{1e3 * time:.4g} ms") and " N " in text for _, text in table_rows(result))
