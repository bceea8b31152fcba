"""Speed in two checkouts, measured alternately: march of a transient, alone and with its contact states, swept sine,
periodic orbit, and whole runs.

python benchmarks/march_against_commit.py BEFORE AFTER [NAME ...]

BEFORE and AFTER are folders with a checkout of beamsim each. Two processes wait for orders; each order is one timed
repetition, so that both see the same moods of the machine. The smallest processor time of each counts.
"""

from __future__ import annotations

import argparse
import importlib
import os
import subprocess
import sys
import time
from pathlib import Path

RUNS = ("one_sided_65hz", "chain_two_dof", "released_panel", "random_vibration")  # `beamsim.run`
REPETITIONS = {"transient": 400, "states and transient": 400, "orbit": 400, "swept sine": 15, **dict.fromkeys(RUNS, 20)}
CASE = "configs/one_sided_65hz.yaml"
SWEEP = "configs/sweeps/sweep_up_down.yaml"
MODULES = {  # where a name is, in checkouts of today and in older ones
    "build_system": ("beamsim.system.build", "beamsim.model.build"),
    "ExactFlow": ("beamsim.flow.exact", "beamsim.dynamics.flow"),
    "simulate": ("beamsim.flow.transient", "beamsim.dynamics.transient"),
    "VariationalFlow": ("beamsim.flow.variational", "beamsim.dynamics.variational"),
    "PeriodicForcing": ("beamsim.flow.periodic_flow", "beamsim.dynamics.variational"),
    "Frequency": ("beamsim.flow.periodic_flow", "beamsim.dynamics.variational"),
    "sweep": ("beamsim.analyses.sweep.analysis", "beamsim.analyses.sweep"),
}


def find(name):
    """An object of the checkout that this process runs with."""
    for module in MODULES[name]:
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"no {name} in this checkout")


def tasks():
    """What is timed, by name."""
    import numpy as np

    import beamsim

    scenario = beamsim.load_scenario(CASE)
    system = find("build_system")(scenario)
    flow = find("ExactFlow")(system.dynamics, system.forcing, scenario.run.duration)
    simulate = find("simulate")

    def transient():
        return simulate(flow, system.initial_state).evaluations

    def states_and_transient():
        anew = find("ExactFlow")(system.dynamics, system.forcing, scenario.run.duration)
        return simulate(anew, system.initial_state).evaluations

    omega = 2 * np.pi * scenario.excitation.frequency
    loads = find("PeriodicForcing").harmonic(system.forcing.load[0] * scenario.excitation.level, omega)
    orbits = find("VariationalFlow")(system.dynamics, loads, omega)
    start = np.zeros(orbits.size)
    start[: system.initial_state.size] = system.initial_state

    def orbit():
        follow = getattr(orbits, "flow_map", None) or orbits.carry  # its name in earlier commits
        return follow(start, 8 * np.pi / omega, (find("Frequency")(),)).event_time.size

    slow = {"reduction.modes": 6, "sweep.direction": "up", "sweep.levels": ["2 g"], "sweep.to": "40 Hz"}
    swept = beamsim.load_scenario(SWEEP, slow)
    runs = {}
    for name in RUNS:
        whole = beamsim.load_scenario(f"configs/{name}.yaml")
        runs[name] = lambda whole=whole: beamsim.run(whole).summary["events"]
    return {
        "transient": transient,
        "states and transient": states_and_transient,
        "orbit": orbit,
        "swept sine": lambda: find("sweep")(swept).summary["cycles"],
        **runs,
    }


def serve():
    """Carry out orders from standard input: one timed repetition each."""
    known = tasks()
    for line in sys.stdin:
        task = known[line.strip()]
        begin = time.process_time()
        work = task()
        print(f"{time.process_time() - begin} {work}", flush=True)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("names", nargs="*", help="what is measured; everything by default")
    arguments = parser.parse_args()
    workers = []
    for folder in (arguments.before, arguments.after):
        environment = {**os.environ, "PYTHONPATH": str(folder.resolve()), "OPENBLAS_NUM_THREADS": "1"}
        command = [sys.executable, str(Path(__file__).resolve()), "--serve"]
        workers.append(
            subprocess.Popen(
                command, cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        )

    def once(worker, name):
        worker.stdin.write(name + "\n")
        worker.stdin.flush()
        seconds, work = worker.stdout.readline().split()
        return float(seconds), work

    for name, count in {name: REPETITIONS[name] for name in arguments.names or REPETITIONS}.items():
        work = [once(worker, name)[1] for worker in workers]  # compiles
        times = [[once(worker, name)[0] for worker in workers] for _ in range(count)]
        before, after = (1e3 * min(column) for column in zip(*times, strict=True))
        print(f"{name:20s} before {before:9.3f} ms  after {after:9.3f} ms  ratio {after / before:.3f}  work {work}")
    for worker in workers:
        worker.stdin.close()
        worker.wait()


if __name__ == "__main__":
    serve() if "--serve" in sys.argv else main()
