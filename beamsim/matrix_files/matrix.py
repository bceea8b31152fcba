"""A matrix read from a file, and the names of its degrees of freedom where the file knows them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a node in the order of their numbers 1 to 6."""
MODAL = "modal"
"""Direction of a coordinate that belongs to no node: a mode, or a scalar point."""

Dof = tuple[int, str]
"""Node and direction."""


@dataclass(frozen=True)
class FileMatrix:
    """One matrix of a file."""

    name: str  # in lower case
    values: Any  # (rows, columns) sparse, real or complex
    rows: tuple[Dof, ...] | None = None  # None where the file only counts them
    columns: tuple[Dof, ...] | None = None


def file_matrix(name: str, values: Any, *, one_triangle: bool = False) -> FileMatrix:
    """A matrix whose file only counts its degrees of freedom, without entries of zero.

    Parameters
    ----------
    name : of the matrix.
    values : (rows, columns) sparse or dense, real or complex.
    one_triangle : whether one triangle stands for both where the other is empty.

    Returns
    -------
    FileMatrix
        Without names of rows and columns.
    """
    from scipy.sparse import csc_array, tril, triu

    matrix = csc_array(values)
    matrix.eliminate_zeros()
    if one_triangle and matrix.shape[0] == matrix.shape[1]:
        above, below = triu(matrix, 1), tril(matrix, -1)
        if above.nnz == 0 or below.nnz == 0:
            matrix = (matrix + above.T + below.T).tocsc()
    return FileMatrix(name, matrix)


def labelled(name: str, entries: Any, *, square: bool, one_triangle: bool = False) -> FileMatrix:
    """The matrix of entries by degrees of freedom, in order of node and component; entries of one place are summed.

    Parameters
    ----------
    name : of the matrix.
    entries : (n, 5) node and component of the row, those of the column, and the number, real or complex.
    square : whether rows and columns have the same degrees of freedom.
    one_triangle : whether one triangle stands for both where the other is empty.

    Returns
    -------
    FileMatrix
        With names of rows and columns.
    """
    from scipy.sparse import coo_array

    entries = np.asarray(entries)
    nodes, components = entries[:, 0:4:2].real.astype(int), entries[:, 1:4:2].real.astype(int)
    dofs = 7 * nodes + np.where((components >= 1) & (components <= 6), components, 0)
    rows, columns = (np.unique(dofs if square else dofs[:, k]) for k in (0, 1))
    numbers = entries[:, 4] if np.any(entries[:, 4].imag) else entries[:, 4].real
    at = np.searchsorted(rows, dofs[:, 0]), np.searchsorted(columns, dofs[:, 1])
    values = coo_array((numbers, at), shape=(rows.size, columns.size))
    matrix = file_matrix(name, values, one_triangle=one_triangle)
    return replace(matrix, rows=names_of(rows // 7, rows % 7), columns=names_of(columns // 7, columns % 7))


def names_of(nodes: Iterable[int], components: Iterable[int]) -> tuple[Dof, ...]:
    """Names of degrees of freedom by node and component, 1 to 6, or 0 of a scalar point.

    >>> names_of([7, 101], [3, 0])
    ((7, 'z'), (101, 'modal'))
    """
    return tuple((int(n), (MODAL, *DIRECTIONS)[c]) for n, c in zip(nodes, components, strict=True))
