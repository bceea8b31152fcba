"""Measurements of a pad from a file: dynamic stiffness or modulus over frequency, or relaxation over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from beamsim.measurements.read import read_file
from beamsim.measurements.signal import MeasurementError, by_dimension
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
    MeasurementError
        If the file cannot be read, or is neither.
    """
    table = read_file(file)
    columns = by_dimension(table, _DIMENSIONS)
    for column in table:
        if not column.unit and any(word in column.name.lower() for word in ("loss", "tan", "eta")):
            columns.setdefault("loss", np.asarray(column.y, dtype=float))
    if "modulus" in columns and "stiffness" not in columns:
        if per_modulus is None:
            raise MeasurementError("gives a modulus", "add height and area of the pad, which make it a stiffness")
        columns["stiffness"] = columns["modulus"] * per_modulus
    for kind, needed in (("dynamic", ("frequency", "stiffness", "loss")), ("relaxation", ("time", "stiffness"))):
        if all(name in columns for name in needed):
            rows = np.column_stack([columns[name] for name in needed])
            bad = np.flatnonzero(~(np.isfinite(rows).all(axis=1) & (rows >= 0.0).all(axis=1) & (rows[:, 1] > 0.0)))
            if bad.size:
                row = f"row {bad[0] + 1} of the numbers is not complete, or not positive"
                raise MeasurementError(f"cannot be used: {row}", "correct the table")
            return kind, rows
    raise MeasurementError(
        "is no test of a pad",
        "it needs columns frequency (Hz), storage (kN/m), loss factor, or time (s), stiffness (kN/m), with units in "
        "the headings",
    )
