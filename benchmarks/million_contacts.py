"""A run with a million contacts: seconds and memory of the march, the evaluation and the result file.

``python -m benchmarks.million_contacts``; other numbers with ``--contacts N``, more samples with ``--rate HZ``.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import beamsim

CONTACTS_A_PERIOD = 2  # one at either stop


def case(contacts: int, rate: float) -> beamsim.Scenario:
    """A mass on a spring between two stops that it meets in every period of the base, 40 Hz."""
    frequency = 40.0
    stop = {"mass": 1, "gap": 0.05e-3, "stiffness": 1e5}
    return beamsim.load_scenario(
        {
            "chain": {"masses": [1.0], "springs": [1e3], "damping": {"kind": "modal", "ratio": 0.01}},
            "snubbers": [{"name": side, "side": side, **stop} for side in ("below", "above")],
            "excitation": {"kind": "harmonic", "applied_to": "base", "frequency": frequency, "level": 2.0},
            "run": {
                "duration": contacts / (CONTACTS_A_PERIOD * frequency), "sample_rate": rate, "convergence": "off",
                "max_events": 3 * contacts, "memory": 4e9,
            },
        }
    )  # fmt: skip


def largest_memory() -> float:
    """Of this process up to now, MB."""
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def main() -> None:
    """Print a line for each part of the run."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--contacts", type=int, default=1_000_000)
    options.add_argument("--rate", type=float, default=100.0, help="samples a second")
    asked = options.parse_args()
    beamsim.run(case(100, 1000.0))  # imports and kernels
    print(f"imports and kernels: {largest_memory():.0f} MB")
    marched = [0.0]

    def progress(share: float) -> None:
        if share >= 1.0 and not marched[0]:
            marched[0] = time.process_time()

    begin = time.process_time()
    result = beamsim.run(case(asked.contacts, asked.rate), progress)
    evaluated = time.process_time()
    samples = result["histories"]["time"].values.size
    print(f"{sum(result.summary['contacts'].values())} contacts, {samples} samples: {result.status}")
    print(f"march {marched[0] - begin:.1f} s, evaluation {evaluated - marched[0]:.1f} s, {largest_memory():.0f} MB")
    with tempfile.TemporaryDirectory() as folder:
        file = beamsim.write_result(result, Path(folder) / "case.h5")
        spent = time.process_time() - evaluated
        print(f"writing {file.stat().st_size / 1e6:.0f} MB {spent:.1f} s, {largest_memory():.0f} MB")


if __name__ == "__main__":
    main()
