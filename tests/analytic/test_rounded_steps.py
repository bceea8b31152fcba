"""Steps of what moves and of forces that are reached as (1 - cos) / 2, by an undamped oscillator in closed form."""

from itertools import product

import numpy as np
from sampling import first_apart

import beamsim
from beamsim.scenario import Scenario

MASS, SPRING, STOP, LEVEL, RISE, BEGIN = 2.0, 800.0, 500.0, 2e-3, 0.05, 0.03


def reached(t, square, gain):
    """x of ``x'' + square x = gain d`` from rest, with d from 0 to LEVEL from t = 0 on."""
    w, turning = np.sqrt(square), np.pi / RISE

    def during(s):
        return 0.5 * gain * LEVEL * np.array([
            (1 - np.cos(w * s)) / square - (np.cos(turning * s) - np.cos(w * s)) / (square - turning**2),
            np.sin(w * s) / w - (w * np.sin(w * s) - turning * np.sin(turning * s)) / (square - turning**2),
        ])  # fmt: skip

    x, v = during(RISE)
    rest, s = gain * LEVEL / square, t - RISE
    free = rest + (x - rest) * np.cos(w * s) + v / w * np.sin(w * s)
    return np.where(t < 0, 0.0, np.where(t < RISE, during(t)[0], free))


STOPPED = [{"name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": -0.1}]
PLACES = {  # where the step acts, its level, what the oscillator has beside, its squared frequency and the gain
    "base": ("base", "2 mm", [], SPRING / MASS, SPRING / MASS),
    "support": ({"support": "left"}, "2 mm", [], SPRING / MASS, SPRING / MASS),
    "stop": ({"snubber": "stop"}, "2 mm", STOPPED, (SPRING + STOP) / MASS, STOP / MASS),
    "force": ({"mass": 1}, f"{LEVEL} N", [], SPRING / MASS, 1 / MASS),
}


@first_apart(
    ("method", "duration", "name"), len(PLACES),
    [*product(["exact"], [None, 0.16], PLACES), *product(["reference"], [0.16], PLACES)],
)  # fmt: skip
def test_oscillator(name, duration, method):
    at, level, snubbers, square, gain = PLACES[name]
    pulse = {} if duration is None else {"duration": duration}
    excitation = {"kind": "step", "applied_to": at, "level": level, "rise": RISE, "time": BEGIN, **pulse}
    result = beamsim.run(Scenario.model_validate({
        "chain": {"masses": [MASS], "springs": [SPRING], "snubbers": snubbers},
        "excitation": excitation, "probes": [{"name": "mass", "mass": 1}],
        "run": {"duration": 0.5, "sample_rate": 2000.0, "start": "static_equilibrium", "method": method},
    }))  # fmt: skip
    t = result["histories"]["time"].values - BEGIN
    expected = reached(t, square, gain)
    if duration is not None:
        expected -= reached(t - (duration - RISE), square, gain)
    moved = (
        result["histories"]["absolute_displacement"].sel(probe="mass").values
        if name == "base"
        else result["histories"]["displacement"].sel(probe="mass").values
        - result["histories"]["displacement"].sel(probe="mass").values[0]
    )
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-11 if method == "exact" else 3e-9)
