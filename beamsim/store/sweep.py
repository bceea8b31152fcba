"""Partial results of interrupted sweeps."""

from __future__ import annotations

from pathlib import Path

from beamsim.analyses.sweep.result import SweepResult
from beamsim.errors import ResultFileError
from beamsim.scenario import Scenario
from beamsim.store.results import open_sweep


def earlier_sweep(path: Path | str, scenario: Scenario) -> SweepResult | None:
    """The partial result of an interrupted sweep of the same scenario; None if there is no file.

    Raises
    ------
    ResultFileError
        If the file is of another scenario, or damaged.
    """
    if not Path(path).exists():
        return None
    stored = open_sweep(path)
    if getattr(stored, "scenario_yaml", "") != scenario.to_yaml():
        raise ResultFileError(
            f"{path}: contains a sweep of another scenario; leave out --resume, or choose another path with -o"
        )
    return stored
