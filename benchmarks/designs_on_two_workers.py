"""A design grid, or a search, on one worker and on two: wall and processor time, and that both tables are identical.

    python benchmarks/designs_on_two_workers.py [points per axis | search]

Workers are threads here. The machine load before each measurement is printed as well. On a busy machine the ratio of
wall times is not meaningful; the share of a processor that the workers got shows this.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from beamsim import load_scenario
from beamsim.analyses.designs.analysis import design_study
from beamsim.analyses.designs.plan import check_cases, plan_designs

CONFIGS = Path(__file__).parents[1] / "configs"
WORKERS = (1, 2)
REPEATS = 2


def main(asked: str) -> None:
    changes = {f"vary.parameters[{k}].points": int(asked) for k in range(2)} if asked != "search" else {}
    config = CONFIGS / f"{'optimise_snubber' if asked == 'search' else 'design_stiffness_gap'}.yaml"
    plan = plan_designs(load_scenario(config, changes | {"run.sample_rate": "20 kHz"}))
    check_cases(plan)
    print(f"{plan.most} cases: {plan.scenario.title}")
    walls: dict[int, list[float]] = {workers: [] for workers in WORKERS}
    tables = {}
    for _ in range(REPEATS):
        for workers in WORKERS:
            load = os.getloadavg()[0]
            before = time.process_time()
            begin = time.perf_counter()
            result = design_study(plan, workers=workers)
            wall = time.perf_counter() - begin
            spent = time.process_time() - before
            walls[workers].append(wall)
            tables[workers] = result
            assert result.complete, result.status
            print(
                f"  {workers} worker{'s' * (workers > 1)}: wall {wall:6.2f} s, processor time of the cases "
                f"{result.summary['processor_time_s']:6.2f} s, of the process {spent:6.2f} s "
                f"({spent / wall / workers:.0%} of a processor each), load before {load:.2f}"
            )
    one, two = (min(walls[workers]) for workers in WORKERS)
    print(f"  speed-up with two workers: {one / two:.2f} (best of {REPEATS})")
    for name, response in tables[1].responses.items():
        np.testing.assert_array_equal(response.values, tables[2].responses[name].values, err_msg=name)
    print("  the tables are identical")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "20")
