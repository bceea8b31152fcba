"""Text tables: rows of cells, and the columns of a table of numbers as signals."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamsim.files import text_of
from beamsim.measurements.signal import MeasuredSignal, MeasurementError, is_frequency, split_heading, stated
from beamsim.scenario import units as si

_MEASURED = (
    si.TIME, si.FREQUENCY, si.ACCELERATION, si.VELOCITY, si.LENGTH, si.FORCE, si.MOMENT, si.ANGLE, si.PRESSURE,
)  # fmt: skip
_WORD = re.compile(r"\S+(?:\s+[(\[][^)\]]*[)\]])?")  # with its unit


class TextRow(NamedTuple):
    """The cells of a line of a file."""

    line: int  # from 1
    cells: list[str]


def read_rows(path: Path) -> tuple[list[TextRow], str]:
    """The cells of a file, and what separates them: semicolon, tab, comma or, in words, blanks.

    Empty lines and comments, which begin with # or %, are left out. The mark of most lines separates; decimal commas
    stand between semicolons or tabs.

    Raises
    ------
    MeasurementError
        If the file cannot be read, is no text or has nothing in it.
    """
    try:
        text = text_of(path)
    except UnicodeDecodeError:
        raise MeasurementError("is not text", "export it as CSV again") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith(("#", "%"))]
    if not lines:
        raise MeasurementError("contains no data", "export it again")
    mark = max(";\t,", key=lambda mark: sum(mark in line for _, line in lines))
    if not any(mark in line for _, line in lines):
        return [TextRow(number, _WORD.findall(line)) for number, line in lines], " "
    reader = csv.reader((line for _, line in lines), delimiter=mark, skipinitialspace=True)
    return [TextRow(lines[reader.line_num - 1][0], [cell.strip() for cell in row]) for row in reader], mark


def read_csv(path: Path) -> list[MeasuredSignal]:
    """The columns of a file, the first as the axis of the others; cells that are empty are nan.

    Raises
    ------
    MeasurementError
        If it holds no table of numbers, or a cell of it is none: with its line and heading.
    """
    rows, mark = read_rows(path)

    def number(cell: str) -> float | None:
        try:
            return float(cell if mark == "," else cell.replace(",", "."))
        except ValueError:
            return None if cell else np.nan

    first = next((i for i, row in enumerate(rows) if row.cells[0] and number(row.cells[0]) is not None), -1)
    if first < 0:
        raise MeasurementError("has no samples: no line starts with a number", "export the measurement again")
    # a row with numbers beside its first cell, right above the samples, is a sample with a fault
    while first > 1 and any(cell and number(cell) is not None for cell in rows[first - 1].cells):
        first -= 1
    width = len(rows[first].cells)
    headings = headings_of([row.cells for row in rows[:first]]) if first else [f"column {k + 1}" for k in range(width)]
    if width == 1:
        headings = [" ".join(headings)]
    if mark == "," and width == 2 * len(headings):
        raise MeasurementError("has decimal commas between commas", "export it with decimal points")
    if width != len(headings):
        raise MeasurementError(f"has {len(headings)} headings for {width} columns", "give each column one heading")
    values = np.empty((len(rows) - first, width))
    for i, row in enumerate(rows[first:]):
        if len(row.cells) != width:
            message = f"has {len(row.cells)} columns in line {row.line} instead of {width}"
            raise MeasurementError(message, "correct the line")
        for j, cell in enumerate(row.cells):
            value = number(cell)
            if value is None:
                where = f"in line {row.line}, sample {i + 1} of {headings[j]}"
                raise MeasurementError(f"has {cell!r} {where}: it is not a number", "only numbers follow the headings")
            values[i, j] = value
    units = [split_heading(heading)[1] for heading in headings]
    axis, of_frequency = values[:, 0], is_frequency(headings[0])
    return [MeasuredSignal(headings[0], np.arange(axis.size, dtype=float), axis, unit=units[0], source=str(path))] + [
        MeasuredSignal(headings[j], axis, values[:, j], of_frequency, units[j], str(path), headings[0], units[0])
        for j in range(1, width)
    ]


def headings_of(rows: list[list[str]]) -> list[str]:
    """Headings of the columns from the rows above the numbers: the last row, with the units that may stand below it.

    >>> headings_of([["Test 7"], ["Frequency", "tip"], ["Hz", "g"]])
    ['Frequency (Hz)', 'tip (g)']
    """
    last = rows[-1]
    if len(rows) < 2 or len(rows[-2]) != len(last) or not all(map(_is_unit, last)):
        return last
    units = (stated(cell.strip("()[] ")) for cell in last)
    return [f"{name} ({unit})" if unit else name for name, unit in zip(rows[-2], units, strict=True)]


def _is_unit(text: str) -> bool:
    """Whether a cell is a unit of what is measured, or says that there is none."""
    unit = stated(text.strip("()[] "))
    if not unit:
        return True
    try:
        si.read_level(f"1 {unit}", _MEASURED)
    except si.UnitError:
        return False
    return True
