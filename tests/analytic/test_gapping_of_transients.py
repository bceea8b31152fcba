"""Gapping of shocks, records and random input: motions just below and above the level; a deviation in closed form."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

import beamsim
from beamsim.cli.tables import all_rows
from beamsim.scenario import load_scenario

PULSE = {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "11 ms", "time": "2 ms"}


def panel(excitation, gaps=(-3e-4, -3e-4), law="kelvin_voigt", **more):
    damping = {"kind": "viscous", "coefficient": 30.0}
    stops = [
        {"name": name, "position": 0.4, "side": side, "stiffness": 1e5, "gap": gap, "damping": damping, "law": law}
        for name, side, gap in zip(("below", "above"), ("below", "above"), gaps, strict=True)
    ]
    return load_scenario(
        {
            "beam": {"length": 1.2, "bending_stiffness": 2967.0, "mass_per_length": 2.4,
                     "supports": {"left": "pinned", "right": "pinned"}, "damping": {"kind": "modal", "ratio": 0.02}},
            "snubbers": stops,
            "excitation": excitation,
            "reduction": {"modes": 8},
            "run": {"duration": 0.06, "sample_rate": "5 kHz", "convergence": "off", **more},
        }
    )  # fmt: skip


@pytest.mark.parametrize("law", ["kelvin_voigt", "no_tension"])
def test_a_shock_just_below_the_level_changes_no_contact_and_one_just_above_does(law):
    of = beamsim.run(panel(PULSE, law=law)).summary["gapping"]
    first = next(name for name in of if "not_predicted" not in of[name])
    level = of[first]["level"]
    assert of[first]["closed_at_rest"]
    assert of[first]["share_of_level"] == pytest.approx(level / (20 * 9.80665), rel=1e-12)
    below = beamsim.run(panel(PULSE | {"level": 0.9999 * level}, law=law))
    above = beamsim.run(panel(PULSE | {"level": 1.0001 * level}, law=law))
    assert below.summary["solver_events"] == 0
    assert above.summary["solver_events"] > 0
    assert above.summary["gapping"][first]["first_change_s"] == pytest.approx(of[first]["time_s"], abs=2e-4)
    # a linear run is its own prediction
    assert below.summary["gapping"][first]["level"] == pytest.approx(level, rel=1e-9)
    assert below.summary["gapping"][first]["first_change_s"] is None


def test_the_preload_of_the_table_keeps_all_closed():
    """Two opposed stops of one stiffness press each other by k times half the sum of what the gaps lack."""
    result = beamsim.run(panel(PULSE))
    of = result.summary["gapping"]
    needed = max(item["preload_n"] for item in of.values())
    assert needed == max(item["preload_alone_n"] for item in of.values())  # both are closed at rest
    for factor, opens in ((1.0001, False), (0.9999, True)):
        gap = -factor * needed / 1e5  # both pressed by as much: the panel stays straight
        again = beamsim.run(panel(PULSE, gaps=(gap, gap)))
        assert again.summary["static_force_n"]["below"] == pytest.approx(factor * needed, rel=1e-9)
        assert (again.summary["solver_events"] > 0) is opens


def test_a_record_has_a_factor_but_no_level(tmp_path):
    time = np.linspace(0.0, 0.06, 301)
    np.savetxt(
        tmp_path / "record.csv", np.column_stack([time, 150.0 * np.sin(400.0 * time) * np.exp(-60.0 * time)]),
        delimiter=",", header="time (s),acceleration (m/s^2)", comments="",
    )  # fmt: skip
    record = {"kind": "sampled", "applied_to": "base", "file": str(tmp_path / "record.csv"), "quantity": "acceleration"}
    result = beamsim.run(panel(record))
    of = next(item for item in result.summary["gapping"].values() if "not_predicted" not in item)
    assert "level" not in of
    assert 0.0 < of["share_of_level"] < 1.0
    rows = [text for _, text in all_rows("run", result)]
    assert any("times this input at" in text and "in linear motion" in text for text in rows)


def test_a_motion_that_does_not_start_at_equilibrium_is_compared_with_nothing():
    assert "gapping" not in beamsim.run(panel(PULSE, start={"displacement": [0.0, 1.2e-3, -1e-3]})).summary


def test_of_a_random_input_the_standard_deviation_is_that_of_one_mass():
    m, c, k, stop, density, low, high, pressed = 2.0, 6.0, 900.0, 700.0, 0.4, 0.5, 12.0, 3e-3
    scenario = load_scenario(
        {
            "chain": {"masses": [m], "springs": [k], "dashpots": [c],
                      "snubbers": [{"name": "stop", "mass": 1, "side": "below", "stiffness": stop, "gap": -pressed}]},
            "excitation": {"kind": "random", "applied_to": {"mass": 1}, "seed": 1,
                           "psd": [{"frequency": low, "density": density}, {"frequency": high, "density": density}]},
            "probes": [{"name": "mass", "mass": 1}],
            "run": {"duration": 20.0, "sample_rate": "200 Hz", "convergence": "off"},
        }
    )  # fmt: skip
    result = beamsim.run(scenario)
    of = result.summary["gapping"]["stop"]

    def squared(hz):
        w = 2 * math.pi * hz
        return density / abs(k + stop - m * w**2 + 1j * c * w) ** 2

    deviation = math.sqrt(quad(squared, low, high, limit=500, points=[math.sqrt((k + stop) / m) / (2 * math.pi)])[0])
    at_rest = pressed * k / (k + stop)
    assert of["sigmas"] == pytest.approx(at_rest / deviation, rel=1e-6)
    assert of["preload_n"] == pytest.approx(3.0 * stop * deviation, rel=1e-6)
    assert of["preload_alone_n"] == pytest.approx(3.0 * stop * deviation, rel=1e-6)
    assert any("sigma of the stationary linear motion" in text for _, text in all_rows("run", result))
