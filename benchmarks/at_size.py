"""A run against its march: beams with many stops, long chains and long motions.

python -m benchmarks.at_size [NAME ...]

Every row is one warm process: processor time of the march, contact states included, and of the whole `beamsim.run`
without its convergence check and without pictures. The first case of a kind compiles. A row meets its target if the run
takes no more than three marches, 0.3 s and what its output samples take.
"""

from __future__ import annotations

import argparse
import os
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # spinning idle threads would count as processor time

import numpy as np

import beamsim
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from benchmarks.measure import CASE, processor_time

MARCHES, SECONDS = 3.0, 0.3  # that a run may take, without writing its samples
QUICK = 1.0  # s: what takes less is measured three times, and the smallest counts


def beam(stops: int) -> Any:
    """The README's beam above a row of stops, of which the outer ones are hit first; a probe at each, 0.5 s."""
    places = 0.27 * np.linspace(1.0, 0.2, stops)
    row = [
        {"name": f"s{k}", "position": float(x), "side": "below", "stiffness": 151.1e3 / stops, "gap": 2e-5 * (k - 1),
         "damping": {"kind": "ratio", "ratio": 0.02}}
        for k, x in enumerate(places, 1)
    ]  # fmt: skip
    return beamsim.load_scenario({
        "beam": {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
                 "elements": 20, "damping": {"kind": "modal", "ratio": 0.01}},
        "snubbers": row,
        "probes": [{"name": stop["name"], "position": stop["position"]} for stop in row],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 65.0},
        "run": {"duration": 0.5, "sample_rate": 5e3, "convergence": "off"},
    })  # fmt: skip


def chain(masses: int) -> Any:
    """A chain of all its modes whose last mass meets a stop, 0.5 s; it moves the less the more masses there are."""
    return beamsim.load_scenario({
        "chain": {
            "masses": [1.0 / masses] * masses, "springs": [0.0, *[4e4 * masses] * masses],
            "dashpots": [0.0, *[0.02 * masses] * masses],
            "snubbers": [{"name": "stop", "mass": masses, "side": "above", "stiffness": 1e6, "gap": 1e-4 / masses}],
        },
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "10 N", "frequency": 30.0},
        "probes": [{"name": "last", "mass": masses}],
        "run": {"duration": 0.5, "sample_rate": 5e3, "convergence": "off", "start": "rest"},
    })  # fmt: skip


def long_run(seconds: int) -> Any:
    """The README's beam, for longer, at 1 kHz."""
    changes = {"run.duration": seconds, "run.sample_rate": 1e3, "run.convergence": "off"}
    return beamsim.load_scenario(CASE, changes)


CASES = {
    **{f"beam with {n} stops": (beam, n) for n in (1, 2, 5, 10, 20, 40)},
    **{f"chain of {n} masses": (chain, n) for n in (10, 30, 100, 300)},
    **{f"motion of {n} s": (long_run, n) for n in (1, 10, 100)},
}


def smallest(function: Any) -> float:
    """s, of processor time."""
    first = processor_time(function)
    return min(first, *(processor_time(function) for _ in range(2))) if first < QUICK else first


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="rows, or parts of their names")
    names = parser.parse_args().names
    rows = [n for n in CASES if any(part in n for part in names or [""])]
    for make, size in {CASES[name][0]: CASES[name][1] for name in reversed(rows)}.items():
        beamsim.run(make(size if len(rows) == 1 and size < 10 else {beam: 2, chain: 10, long_run: 1}[make]))
    print(f"{'':20s}{'march, s':>10s}{'run, s':>10s}{'ratio':>8s}{'(run - 0.3 s) / march':>24s}{'events':>9s}")
    for name in rows:
        make, size = CASES[name]
        scenario = make(size)
        system = build_system(scenario)

        def marched(system: Any = system, scenario: Any = scenario) -> Any:
            return simulate(exact_flow(system, scenario.run.duration), system.initial_state)

        march, total = smallest(marched), smallest(lambda scenario=scenario: beamsim.run(scenario))
        beyond = (total - SECONDS) / march
        mark = "" if beyond <= MARCHES else "  above 3"
        events = marched().event_time.size if march < QUICK else -1
        print(f"{name:20s}{march:10.3f}{total:10.3f}{total / march:8.1f}{beyond:24.1f}{events:9d}{mark}", flush=True)


if __name__ == "__main__":
    main()
