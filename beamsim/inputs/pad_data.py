"""Measurements of a pad from a file: dynamic stiffness or modulus over frequency, or relaxation over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from beamsim.inputs.csv_table import read_csv
from beamsim.inputs.headings import split_heading
from beamsim.scenario import units
from beamsim.typing import Floats

_DIMENSIONS = {
    "frequency": units.FREQUENCY, "time": units.TIME, "stiffness": units.STIFFNESS, "modulus": units.PRESSURE,
}  # fmt: skip


def read_pad_data(file: Path, per_modulus: float | None) -> tuple[str, Floats]:
    """The kind, dynamic or relaxation, and (p, 3) or (p, 2) rows in SI units.

    ``per_modulus`` is the stiffness for a unit of modulus, area over height, m; None where it is unknown.

    Raises
    ------
    OSError, ValueError : where the file cannot be read, or is neither.
    """
    table = read_csv(file)
    columns: dict[str, Floats] = {}
    for column, heading in enumerate(table.headings):
        name, unit = split_heading(heading)
        if unit:
            kind, factor = _kind_of(unit, column)
            columns.setdefault(kind, table.values[:, column] * factor)
        elif any(word in name.lower() for word in ("loss", "tan", "eta")):
            columns.setdefault("loss", table.values[:, column])
    if "modulus" in columns and "stiffness" not in columns:
        if per_modulus is None:
            raise ValueError("it gives a modulus; add height and area of the pad, which make it a stiffness")
        columns["stiffness"] = columns["modulus"] * per_modulus
    for kind, needed in (("dynamic", ("frequency", "stiffness", "loss")), ("relaxation", ("time", "stiffness"))):
        if all(name in columns for name in needed):
            rows = np.column_stack([columns[name] for name in needed])
            bad = np.flatnonzero(~(np.isfinite(rows).all(axis=1) & (rows >= 0.0).all(axis=1) & (rows[:, 1] > 0.0)))
            if bad.size:
                raise ValueError(f"row {bad[0] + 1} of the numbers is not complete, or not positive")
            return kind, rows
    raise ValueError(
        "it needs columns frequency (Hz), storage (kN/m), loss factor, or time (s), stiffness (kN/m), with units in "
        "the headings"
    )


def _kind_of(unit: str, column: int) -> tuple[str, float]:
    try:
        factor, dimension = units.read_level(f"1 {unit}", tuple(_DIMENSIONS.values()))
    except units.UnitError:
        problem = f"column {column + 1} is in {unit}, which is no unit of frequency, time, stiffness or modulus"
        raise ValueError(problem) from None
    return next(kind for kind, known in _DIMENSIONS.items() if known is dimension), factor
