"""Identification of a snubber stiffness: closed form against the iteration of the thesis (H. Hazim, 2010).

python benchmarks/identify_stiffness.py
"""

from __future__ import annotations

import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import beamsim

CASE = "configs/identify_snubber.yaml"


def best_of(scenario, repeats):
    """Smallest processor time of an identification, s, and its result."""
    best = float("inf")
    for _ in range(repeats):
        begin = time.process_time()
        result = beamsim.identify_stiffness(scenario)
        best = min(best, time.process_time() - begin)
    return best, result


def main():
    """Print time, stiffness and eigenvalue solutions of the secular function and of algorithm 1 of the thesis."""
    rows = []
    for method in ("secular", "thesis"):
        scenario = beamsim.load_scenario(CASE, {"identify_stiffness.method": method})
        best_of(scenario, 1)
        seconds, result = best_of(scenario, 5)
        rows.append((seconds, result.summary["eigenvalue_solutions"]))
        print(
            f"{method:8s} {1e3 * seconds:8.1f} ms  {result.summary['eigenvalue_solutions']:6d} eigenvalue solutions  "
            f"k = {result.summary['stiffness_n_per_m']:.6g} N/m"
        )
    print(f"ratios: time {rows[1][0] / rows[0][0]:.1f}, eigenvalue solutions {rows[1][1] / rows[0][1]:.0f}")


if __name__ == "__main__":
    main()
