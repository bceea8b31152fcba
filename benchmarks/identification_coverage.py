"""How often the intervals of an identification hold the truth: ``python -m benchmarks.identification_coverage``.

A mass at a stop is shaken at one frequency. Each of 500 tests, with the seeds 0 to 499, has white noise, begins at a
random time, and its channel reads 10 % too much. Stiffness, dashpot and gain are fitted to it. True intervals of 95 %
hold the truth in 465 to 485 of 500 (two standard deviations of the binomial distribution).
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.vibrations import steady_vibration
from beamsim.measurements.signal import MeasuredSignal
from beamsim.scenario import load_scenario
from beamsim.typing import Complexes

GAIN, NOISE, FREQUENCY, HARMONICS = 1.1, 0.01, 0.2, 12
STIFFNESS, DASHPOT = "chain.snubbers.stop.stiffness", "chain.dashpots[0]"
CHANNEL = "identify_stiffness.nonlinear.tests[0].gain"
TRUTH = {STIFFNESS: 20.0, DASHPOT: 0.3, CHANNEL: GAIN}
BEGIN = {STIFFNESS: 21.0, DASHPOT: 0.29, CHANNEL: 1.0}


def case(numbers: dict[str, float], **sections: Any) -> dict[str, Any]:
    """A mass at a stop with these numbers, as a scenario is written."""
    stop = {"name": "stop", "mass": 1, "side": "below", "gap": 0.3, "stiffness": numbers[STIFFNESS]}
    return {
        "chain": {"masses": [1.0], "springs": [1.0], "dashpots": [numbers[DASHPOT]], "snubbers": [stop]},
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": FREQUENCY},
        "probes": [{"name": "mass", "mass": 1}],
        **sections,
    }


def measured(harmonics: Complexes, seed: int) -> MeasuredSignal:
    """A record of sixteen periods of a vibration, as its channel gives it."""
    generator = np.random.default_rng(seed)
    t = np.arange(16 * 48) / (48 * FREQUENCY)
    turning = np.exp(2j * np.pi * FREQUENCY * np.outer(t + generator.uniform(0.0, 1.0 / FREQUENCY), np.arange(1, 13)))
    scatter = NOISE * np.abs(harmonics).max() * generator.standard_normal(t.size)
    return MeasuredSignal("mass", t, GAIN * np.imag(turning @ harmonics) + scatter, unit="m")


def holding(seeds: Sequence[int]) -> Counter[str]:
    """By parameter, in how many of the tests the interval of 95 % holds the truth."""
    harmonics = steady_vibration(load_scenario(case(TRUTH))).harmonics(0, "displacement", HARMONICS)
    test = {"file": "mass.csv", "quantity": "displacement", "harmonics": 5}
    fit = {"estimate": list(TRUTH), "tests": [test], "starts": 1, "profiles": False}
    scenario = load_scenario(case(BEGIN, identify_stiffness={"snubber": "stop", "nonlinear": fit}))
    held: Counter[str] = Counter()
    for count, seed in enumerate(seeds, start=1):
        found = identify_stiffness(scenario, [measured(harmonics, seed)])
        for parameter, interval in found["nonlinear"].by_label("interval").items():
            low, high = interval.values
            held[parameter] += bool(low <= TRUTH[parameter] <= high)
        if count % 50 == 0:
            print(count, dict(held), file=sys.stderr, flush=True)
    return held


if __name__ == "__main__":
    for parameter, count in holding(range(500)).items():
        print(f"{parameter}: the truth is within the 95 % interval in {count} of 500 tests")
