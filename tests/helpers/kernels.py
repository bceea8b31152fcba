"""Compiled kernels of the tests: short cases that call all of them.

``python tests/helpers/kernels.py K N`` compiles the share of worker K of N into Numba's cache on disk.
"""

from __future__ import annotations

import sys
from typing import Any

from shipped import config_path

import beamsim
from beamsim.flow.compiled import cache_folder

# One short case for each group of compiled kernels; a worker compiles its share first, all of it lands in the cache.
# Of two workers one has those that share the kernels of the march, so that few are compiled by both.
CASES: list[tuple[str, str, dict[str, Any]]] = [
    ("run", "one_sided_65hz", {"run.duration": 0.4}),
    ("continuation", "chain_two_dof", {}),  # before the next: it has the search for extremes of two kinds of motions
    ("sweep", "sweep_up_down", {"sweep.from": 60.0, "sweep.to": 62.0, "sweep.direction": "up", "sweep.levels": [9.81]}),
    ("nnm", "nnm_chain_cubic_energy", {}),
    ("run", "random_vibration", {"run.duration": 0.1, "run.spectrum.last": 0.05, "run.convergence": "off"}),
]


def any_compiled() -> bool:
    """Whether Numba's cache has any kernel of these sources."""
    folder = cache_folder()
    return folder is not None and next(folder.rglob("*.nbi"), None) is not None


def call(worker: int, workers: int) -> None:
    """Call a worker's share of the kernels, which compiles what the cache does not have."""
    for analysis, name, overrides in CASES[worker::workers]:
        getattr(beamsim, analysis)(beamsim.load_scenario(config_path(name), overrides))


if __name__ == "__main__":
    call(int(sys.argv[1]), int(sys.argv[2]))
