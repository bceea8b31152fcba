"""A complete swept sine, 20 to 400 Hz at 2 oct/min, six modes: total processor time and time per cycle.

python benchmarks/swept_sine.py
"""

from __future__ import annotations

import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import beamsim
from beamsim.analyses.sweep.analysis import sweep

CASE = "configs/sweep_up_down.yaml"
ONE_WAY = {"reduction.modes": 6, "sweep.direction": "up", "sweep.levels": ["2 g"]}


def timed(**changes):
    """Best processor time of two sweeps, s, and the result."""
    scenario = beamsim.load_scenario(CASE, {**ONE_WAY, **changes})
    best = float("inf")
    for _ in range(2):
        begin = time.process_time()
        result = sweep(scenario)
        best = min(best, time.process_time() - begin)
    return best, result


def main():
    """Print the table."""
    timed(**{"sweep.to": "25 Hz"})  # compiles
    for label, changes in {
        "default: displacements, accelerations, force, 5 orders": {},
        "without accelerations": {"sweep.accelerations": False},
        "first octave only": {"sweep.to": "40 Hz"},
    }.items():
        seconds, result = timed(**changes)
        cycles = result.summary["cycles"]
        print(f"{label:56s} {seconds:6.2f} s  {cycles:6d} cycles  {1e6 * seconds / cycles:6.1f} us per cycle")


if __name__ == "__main__":
    main()
