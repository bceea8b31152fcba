"""A matrix read from a file, and the names of its degrees of freedom where the file knows them."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.typing import Ints

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a node in the order of their numbers 1 to 6."""
MODAL = "modal"
"""Direction of a coordinate that belongs to no node: a mode, or a scalar point."""

Dof = tuple[int, str]
"""Node and direction."""


@dataclass(frozen=True)
class FileMatrix:
    """One matrix of a file."""

    name: str
    values: Any  # (rows, columns) sparse, real or complex
    rows: tuple[Dof, ...] | None = None  # None where the file only counts them
    columns: tuple[Dof, ...] | None = None


def direction_of(component: int) -> str:
    """Direction of a component, 1 to 6; of 0, a scalar point, and of any other number that of a mode.

    >>> direction_of(3), direction_of(0)
    ('z', 'modal')
    """
    return DIRECTIONS[component - 1] if 1 <= component <= 6 else MODAL


def component_of(direction: str) -> int:
    """Component of a direction, 1 to 6; 0 for a mode."""
    return DIRECTIONS.index(direction) + 1 if direction in DIRECTIONS else 0


def mirrored(values: Any) -> Any:
    """The symmetric matrix of which a file holds one triangle; a matrix with entries in both is returned as it is."""
    from scipy.sparse import tril, triu

    above, below = triu(values, 1), tril(values, -1)
    one_triangle = values.shape[0] == values.shape[1] and (above.nnz == 0) != (below.nnz == 0)
    return (values + above.T + below.T).tocsc() if one_triangle else values


def labelled(name: str, entries: dict[tuple[Dof, Dof], complex], symmetric: bool | None, square: bool) -> FileMatrix:
    """The matrix of entries by the degrees of freedom of row and column, in order of node and component.

    Parameters
    ----------
    symmetric : whether one triangle stands for both; None where the entries tell.
    square : whether rows and columns have the same degrees of freedom.
    """
    from scipy.sparse import csc_array

    rows = _in_order({row for row, _ in entries} | ({column for _, column in entries} if square else set()))
    columns = rows if square else _in_order({column for _, column in entries})
    row_number, column_number = ({dof: i for i, dof in enumerate(dofs)} for dofs in (rows, columns))
    numbers = np.array(list(entries.values()))
    if not np.iscomplexobj(numbers) or not np.any(numbers.imag):
        numbers = np.real(numbers).astype(float)
    i = np.array([row_number[row] for row, _ in entries], dtype=np.int64)
    j = np.array([column_number[column] for _, column in entries], dtype=np.int64)
    values = csc_array((numbers, (i, j)), shape=(len(rows), len(columns)))
    if symmetric is not False and square:
        values = _reflected(values, i, j, numbers) if symmetric else mirrored(values)
    return FileMatrix(name, values, rows, columns)


def _reflected(values: Any, i: Ints, j: Ints, numbers: Any) -> Any:
    """Entries of either triangle, each also on the other side."""
    from scipy.sparse import csc_array

    off = i != j
    return values + csc_array((numbers[off], (j[off], i[off])), shape=values.shape)


def _in_order(dofs: set[Dof]) -> tuple[Dof, ...]:
    return tuple(sorted(dofs, key=lambda dof: (dof[0], component_of(dof[1]))))
