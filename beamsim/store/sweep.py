"""What an interrupted sweep left, and the curves of sweeps in other results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.errors import ResultFileError
from beamsim.store.declared import read, write
from beamsim.store.results import open_sweep

if TYPE_CHECKING:
    from beamsim.scenario import Scenario


def write_curve(group: h5py.Group, curve: SweepCurve) -> None:
    """Write one curve of a sweep."""
    write(group, curve)


def read_curve(name: str, group: h5py.Group) -> SweepCurve:
    """Inverse of `write_curve`."""
    return SweepCurve(**read(SweepCurve, group, key=name))


def earlier_sweep(path: Path | str, scenario: Scenario) -> SweepResult | None:
    """What an interrupted sweep of the same scenario left at ``path``; None where there is nothing.

    Raises
    ------
    ResultFileError
        When the file is of another scenario, or damaged.
    """
    if not Path(path).exists():
        return None
    stored = open_sweep(path)
    if getattr(stored, "scenario_yaml", "") != scenario.to_yaml():
        raise ResultFileError(
            f"{path}: holds a sweep of another scenario; leave out --resume, or choose another place with -o"
        )
    return stored
