"""The level of a sweep from a table in a CSV file."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import numpy as np

from beamsim.errors import Problem, ScenarioError
from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasuredSignal, MeasurementError
from beamsim.scenario.excitation import ProfilePoint
from beamsim.scenario.quantities import LEVEL_DIMENSIONS, LevelValue
from beamsim.scenario.units import FREQUENCY, UnitError, read_level, read_quantity


def read_profile(file: str, folder: Path, takes: tuple[str, ...]) -> tuple[ProfilePoint, ...]:
    """The points of a table whose first column is the frequency and whose second one the level.

    Parameters
    ----------
    file, folder : CSV file, and where its path begins.
    takes : quantities that the levels may be of; levels that multiply several forces have none, and no unit.

    Returns
    -------
    tuple
        Points in SI units by increasing frequency.

    Raises
    ------
    ScenarioError
        If the file cannot be read, has no unit of the levels, or is no table of increasing positive frequencies.
    """
    try:
        table = read_file(folder / file)
        factors = _factors(table, takes)
    except (MeasurementError, UnitError) as fault:
        _reject(f"= {file} {fault.message}", fault.remedy)
    frequency, level = table[0].y * factors[0], table[1].y * factors[1]
    if not (np.all(np.isfinite(frequency)) and np.all(np.isfinite(level)) and frequency[0] > 0):
        _reject(f"= {file} has frequencies or levels that are no positive numbers", "correct the table")
    if np.any(np.diff(frequency) <= 0):
        row = int(np.flatnonzero(np.diff(frequency) <= 0)[0]) + 2
        _reject(f"= {file} has frequencies that do not increase at row {row}", "sort the table")
    if np.any(level <= 0):
        row = int(np.flatnonzero(level <= 0)[0]) + 1
        _reject(f"= {file} has the level {level[row - 1]:g} in row {row}, which has no logarithm", "give a small level")
    quantity = factors[2]
    return tuple(
        ProfilePoint.model_construct(frequency=float(f), level=LevelValue(float(a), quantity))
        for f, a in zip(frequency, level, strict=True)
    )


def _factors(table: list[MeasuredSignal], takes: tuple[str, ...]) -> tuple[float, float, str | None]:
    """SI values of one in each column, and the quantity of the levels."""
    if len(table) < 2:
        raise MeasurementError("has one column", "give a frequency and a level in each row, with their units above")
    if not table[0].unit:
        raise MeasurementError("cannot be used: its first column states no unit", "head it frequency (Hz)")
    frequency = read_quantity(f"1 {table[0].unit}", FREQUENCY)
    dimensions = {name: LEVEL_DIMENSIONS[name] for name in takes if name in LEVEL_DIMENSIONS}
    if not dimensions:
        return frequency, 1.0, None
    if not table[1].unit:
        raise MeasurementError("cannot be used: its second column states no unit", "head it for example level (g)")
    value, dimension = read_level(f"1 {table[1].unit}", tuple(dimensions.values()))
    return frequency, value, next(name for name, known in dimensions.items() if known is dimension)


def _reject(message: str, remedy: str) -> NoReturn:
    raise ScenarioError(Problem("sweep.profile_file", message, remedy))
