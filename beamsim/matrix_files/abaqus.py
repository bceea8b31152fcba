"""Matrices that Abaqus writes with *MATRIX OUTPUT: by nodes (MATRIX INPUT, LABELS) or by numbers (COORDINATE)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import Dof, FileMatrix, direction_of, labelled, mirrored


def read_abaqus(path: Path) -> FileMatrix:
    """The matrix of a file; of a symmetric one Abaqus writes one triangle.

    Raises
    ------
    MethodError
        If a line has neither 3 nor 5 numbers.
    """
    by_number: list[tuple[float, ...]] = []
    entries: dict[tuple[Dof, Dof], complex] = {}
    for line, text in enumerate(path.read_text(encoding="latin-1").splitlines(), 1):
        if not text.strip() or text.lstrip().startswith(("*", "%", "#")):
            continue
        try:
            numbers = [float(each) for each in text.replace(",", " ").replace("D", "E").split()]
            if len(numbers) == 3:
                by_number.append(tuple(numbers))
            else:
                row, row_component, column, column_component, value = numbers
                pair = (_dof(row, row_component), _dof(column, column_component))
                entries[pair] = entries.get(pair, 0.0) + value
        except ValueError:
            raise MethodError(
                "file",
                f"has a line {line} that is not an entry of an Abaqus matrix",
                "lines have row node, its degree of freedom, column node, its degree of freedom, and the number; "
                "or row, column and number",
            ) from None
    name = path.stem.lower()
    if entries and by_number:
        raise MethodError("file", "has lines with 3 and with 5 numbers", "write the matrices to one file each")
    if entries:
        return labelled(name, entries, symmetric=None, square=True)
    return FileMatrix(name, mirrored(_coordinate(by_number)))


def _dof(node: float, component: float) -> Dof:
    """Node and direction; coordinates without a node (internal ones, generalised ones) have no direction."""
    return round(node), direction_of(round(component))


def _coordinate(lines: list[tuple[float, ...]]) -> Any:
    from scipy.sparse import csc_array

    i, j, values = np.array(lines).reshape(-1, 3).T
    size = int(max(i.max(initial=0), j.max(initial=0)))
    return csc_array((values, (i.astype(np.int64) - 1, j.astype(np.int64) - 1)), shape=(size, size))
