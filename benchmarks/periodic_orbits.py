"""Periodic motions: processor time for the nonlinear modes of the thesis and a two-mass benchmark (NLvib example 03).

    python -m benchmarks.periodic_orbits

One process, processor time after compilation, best of three. The last column is the time reported in 2010 (H. Hazim,
thesis, chapter 3), or the target of this project.
"""

from __future__ import annotations

import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import beamsim
from beamsim.analyses.continuation.analysis import continuation
from beamsim.analyses.nnm.analysis import nnm
from docs.site_pages.configs import CONFIGS

JOBS = (
    ("nnm_thesis_mode_1", nnm, "20 h in 2010"),
    ("nnm_first", nnm, "1 s"),
    ("nnm_chain_mass_5", nnm, "4.65 min in 2010"),
    ("nnm_chain_mass_1", nnm, "8.25 min in 2010"),
    ("chain_cubic", nnm, "6.6 min in 2010"),
    ("chain_two_dof", continuation, "1 s"),
    ("continuation_60_120hz", continuation, ""),
)


def main() -> None:
    print(f"{'case':<24}{'points':>8}{'processor time':>18}   reference")
    for name, analysis, reference in JOBS:
        scenario = beamsim.load_scenario(CONFIGS[name])
        best = None
        for _ in range(4):
            begin = time.process_time()
            result = analysis(scenario)
            spent = time.process_time() - begin
            best = spent if best is None else min(best, spent)
        print(f"{name:<24}{result.summary['points']:>8}{best:>16.3f} s   {reference}")


if __name__ == "__main__":
    main()
