"""Studies on one worker and on two: wall and processor time, and that both find the same.

    python -m benchmarks.two_workers [NAME ...]

The names are those of `TASKS`; ``grid-400`` is the design grid with so many cases. Two workers are processes that start
for about a second each; their processor time counts. The share of a processor that the workers got says whether a ratio
of wall times means anything: on a busy machine it does not.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import beamsim
from beamsim.analyses.studies.plan import check_cases, plan_designs
from beamsim.trust import with_finer_model
from beamsim.trust.studies import design_study
from benchmarks.measure import spent
from docs.site_pages.configs import CONFIGS

REPEATS = 2
LOOP = [sys.executable, "-c", "for _ in range(40_000_000): pass"]

Solved = tuple[int, dict[str, Any]]  # number of cases, columns that do not depend on the workers


def studied(config: str, changes: dict[str, Any]) -> Callable[[int], Solved]:
    """The cases of a study or search, without what is computed of the best one afterwards."""
    plan = plan_designs(beamsim.load_scenario(CONFIGS[config], changes))
    check_cases(plan)

    def solve(workers: int) -> Solved:
        table = design_study(plan, workers=workers).table
        return len(next(iter(table.values()))), table

    return solve


def grid(cases: int) -> Callable[[int], Solved]:
    """Stiffness and gap of the README's snubber, with all responses."""
    points = {f"vary.parameters[{k}].points": round(cases**0.5) for k in range(2)}
    return studied("design_stiffness_gap", points | {"run.sample_rate": "20 kHz"})


def drawn(cases: int) -> Callable[[int], Solved]:
    """Draws of gap, stiffness and level of the README's case, for the peak force."""
    rng, scenario = np.random.default_rng(1), beamsim.load_scenario(CONFIGS["one_sided_65hz"])
    draws = {
        "snubbers.tip.gap": rng.normal(2e-4, 2e-5, cases),
        "snubbers.tip.stiffness": rng.uniform(1e5, 2e5, cases),
        "excitation.level": rng.uniform(15.0, 25.0, cases),
    }
    return lambda workers: (cases, dict(beamsim.ensemble(scenario, draws, ["peak_force"], workers=workers).table))


def coexisting() -> Callable[[int], Solved]:
    """Starts and disturbances; branches of unstable motions, which are not shared, are left out."""
    scenario = beamsim.load_scenario(CONFIGS["coexisting_motions"], {"sweep.unstable": False})

    def solve(workers: int) -> Solved:
        result = with_finer_model.coexisting(scenario, workers=workers)
        found = {name: result["starts"][name].values for name in ("destination", "cycles")}
        return found["cycles"].size, found

    return solve


TASKS: dict[str, Callable[[], Callable[[int], Solved]]] = {
    "grid-400": lambda: grid(400),
    "grid-1600": lambda: grid(1600),
    "ensemble": lambda: drawn(2000),
    "search": lambda: studied("optimise_snubber", {}),
    "reliability": lambda: studied("exceedance", {}),
    "coexisting": coexisting,
}


def of_the_machine() -> float:
    """How many times as fast two processes that have nothing in common are as one: no study can do better."""

    def wall(count: int) -> float:
        begin = time.perf_counter()
        for process in [subprocess.Popen(LOOP) for _ in range(count)]:
            process.wait()
        return time.perf_counter() - begin

    return 2.0 * wall(1) / wall(2)


def main(names: list[str]) -> None:
    """Solve each task by one worker and by two, in turn."""
    for name in names or TASKS:
        solve, walls, found = TASKS[name](), dict[int, list[float]]({1: [], 2: []}), dict[int, dict[str, Any]]()
        print(f"{name} (two loops of plain Python are {of_the_machine():.2f} times as fast as one)")
        for workers in [1, 2] * REPEATS:
            load, before, begin = os.getloadavg()[0], spent(), time.perf_counter()
            cases, found[workers] = solve(workers)
            wall, used = time.perf_counter() - begin, spent() - before
            walls[workers].append(wall)
            print(
                f"  {workers} worker{'s' * (workers > 1)}: {cases} cases, wall {wall:6.2f} s, processor time "
                f"{used:6.2f} s, {1e3 * used / cases:.1f} ms a case ({used / wall / workers:.0%} of a processor for "
                f"each worker), load before {load:.2f}",
                flush=True,
            )
        print(f"  two workers are {min(walls[1]) / min(walls[2]):.2f} times as fast as one (best of {REPEATS})")
        for column, values in found[1].items():
            np.testing.assert_array_equal(values, found[2][column], err_msg=column)


if __name__ == "__main__":
    main(sys.argv[1:])
