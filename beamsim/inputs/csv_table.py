"""Columns of numbers in CSV files as other programs write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.files import text_of
from beamsim.inputs.headings import split_heading, stated
from beamsim.scenario.units import ACCELERATION, FORCE, FREQUENCY, LENGTH, TIME, VELOCITY, UnitError, read_level
from beamsim.typing import Floats

_MEASURED = (TIME, FREQUENCY, ACCELERATION, VELOCITY, LENGTH, FORCE)


@dataclass(frozen=True)
class CsvTable:
    """The numbers of a file and the headings of its columns, none where the file has none."""

    headings: list[str]
    values: Floats  # (rows, columns); nan where a cell is empty

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.values.shape[1])

    @property
    def units(self) -> list[str]:
        """Of the columns; empty where a heading states none."""
        return [split_heading(heading)[1] for heading in self.headings] or [""] * self.width

    def column(self, name: str | None, default: int) -> int:
        """Number of the column with a heading, its heading without unit, or a number from 1 as its name.

        Raises ValueError where there is none.
        """
        if name is None:
            return default
        for names in (self.headings, [split_heading(heading)[0] for heading in self.headings]):
            if name in names:
                return names.index(name)
        if name.isdigit() and 1 <= int(name) <= self.width:
            return int(name) - 1
        known = f"; headings are {', '.join(self.headings)}" if self.headings else ""
        raise ValueError(f"there is no column {name} among {self.width}{known}")


def read_csv(path: Path) -> CsvTable:
    """The table of a file: comma, semicolon, tab or spaces between columns, decimal commas where they are clear.

    Raises
    ------
    OSError : where it cannot be read.
    ValueError : where it holds no table of numbers.
    """
    lines = [line for line in text_of(path).splitlines() if line.strip()]
    lines = [line for line in lines if not line.lstrip().startswith(("#", "%"))]
    if not lines:
        raise ValueError("the file is empty")
    separator = next((mark for mark in (";", "\t", ",") if mark in lines[-1]), None)
    rows = [[cell.strip().strip('"') for cell in line.split(separator)] for line in lines]
    if separator != ",":  # then a comma is that of a decimal
        rows = [
            [cell.replace(",", ".") if _is_number(cell.replace(",", ".")) else cell for cell in row] for row in rows
        ]
    first = next((i for i, row in enumerate(rows) if _is_number(row[0])), None)
    if first is None:
        raise ValueError("no line starts with a number")
    width = len(rows[first])
    headings = [] if not first else headings_of(rows[:first]) if width > 1 else [lines[first - 1].strip().strip('"')]
    if separator == "," and headings and width == 2 * len(headings):
        raise ValueError("it has decimal commas between commas; export it with decimal points")
    ragged = next((i for i, row in enumerate(rows[first:]) if len(row) != width), None)
    if ragged is not None:
        raise ValueError(f"line {first + ragged + 1} has {len(rows[first + ragged])} columns instead of {width}")
    return CsvTable(headings, np.array([[float(cell) if cell else np.nan for cell in row] for row in rows[first:]]))


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
        read_level(f"1 {unit}", _MEASURED)
    except UnitError:
        return False
    return True


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
