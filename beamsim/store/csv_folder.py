"""Folders of CSV tables: one row per observation, one column per quantity with its unit, full precision."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from beamsim.errors import ResultFileError
from beamsim.files import replacing

ROWS_AT_ONCE = 2**16  # of a table that are written together
_UNITS = {"": "", "1": "", "degree": "deg", "kg^-0.5": "per_sqrt_kg", "kg^0.5 m": "m_sqrt_kg"}


def header(name: str, unit: str) -> str:
    """Name of a column: the quantity and its unit, ``velocity_m_per_s``.

    >>> header("peak_force", "N"), header("absolute_acceleration", "m/s^2"), header("frequency_hz", "Hz")
    ('peak_force_n', 'absolute_acceleration_m_per_s2', 'frequency_hz')
    """
    suffix = _UNITS.get(unit)
    if suffix is None:
        spelt = re.sub(r"\((.*)\)\^2", r"\1 squared", unit).lower().replace("/", "_per_").replace("^", "")
        suffix = re.sub(r"[^0-9a-z]+", "_", spelt).strip("_")
    return name if not suffix or name.endswith(f"_{suffix}") else f"{name}_{suffix}"


def flat(values: Any, item: str = "") -> Iterator[tuple[str, Any]]:
    """Nested mappings and lists as pairs of path, separated by slashes, and value; list items are numbered from 1."""
    if isinstance(values, Mapping):
        for name, value in values.items():
            yield from flat(value, f"{item}/{name}" if item else str(name))
    elif isinstance(values, (list, tuple)):
        for number, value in enumerate(values, 1):
            yield from flat(value, f"{item}/{number}" if item else str(number))
    else:
        yield item, values


class CsvFolder:
    """Tables written to one folder, each completely or not at all.

    Raises
    ------
    ResultFileError
        If the path is not a folder or a file cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        if folder.exists() and not folder.is_dir():
            raise ResultFileError(f"cannot write {folder}: it exists and is not a folder; choose another path with -o")
        self.folder = folder
        self.written: list[Path] = []

    @contextmanager
    def _table(self, name: str, columns: Sequence[str]) -> Iterator[TextIO]:
        self.written.append(self.folder / f"{name}.csv")
        with replacing(self.written[-1]) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerow(columns)
            yield stream

    def rows(self, name: str, columns: Sequence[str], values: Iterable[Sequence[Any]]) -> None:
        """Write a table from its rows; numbers are read back without loss."""
        with self._table(name, columns) as stream:
            csv.writer(stream).writerows(values)

    def numbers(self, name: str, columns: Mapping[str, Any]) -> None:
        """Write a table from columns of numbers: arrays, or histories that are read in parts."""
        with self._table(name, list(columns)) as stream:
            for first in range(0, max(len(column) for column in columns.values()), ROWS_AT_ONCE):
                part = slice(first, first + ROWS_AT_ONCE)
                rows = np.column_stack([column[part] for column in columns.values()])
                np.savetxt(stream, rows, fmt="%.17g", delimiter=",", newline="\r\n")

    def summary(self, summary: Mapping[str, Any]) -> None:
        """Write the table ``summary``: one number per row."""
        self.rows(
            "summary", ("name", "item", "value"),
            ((name, item, value) for name, values in summary.items() for item, value in flat(values)),
        )  # fmt: skip

    def text(self, name: str, text: str) -> None:
        """Write a text file."""
        self.written.append(self.folder / name)
        with replacing(self.written[-1]) as temporary:
            temporary.write_text(text, encoding="utf-8")
