"""A matrix read from a file, and the names of its degrees of freedom where the file knows them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array

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


def file_matrix(name: str, values: Any, *names: tuple[Dof, ...] | None, one_triangle: bool = False) -> FileMatrix:
    """A matrix without entries of zero.

    Parameters
    ----------
    name : of the matrix.
    values : (rows, columns) sparse or dense, real or complex.
    names : of rows and of columns, where the file has them.
    one_triangle : whether an entry stands for the opposite one as well where that is missing.

    Returns
    -------
    FileMatrix
        Sparse.
    """
    matrix: Any = csc_array(values)
    if one_triangle:
        matrix = matrix + (matrix.T - matrix.T.multiply(matrix != 0)).tocsc()
    matrix.eliminate_zeros()
    return FileMatrix(name, matrix, *names)


def labelled(name: str, entries: Any, *, square: bool, one_triangle: bool = False) -> FileMatrix:
    """The matrix of entries by degrees of freedom, in order of node and component; entries of one place are summed.

    Parameters
    ----------
    name : of the matrix.
    entries : (n, 5) node and component of the row, those of the column, and the number, real or complex.
    square : whether rows and columns have the same degrees of freedom.
    one_triangle : whether an entry stands for the opposite one as well where that is missing.

    Returns
    -------
    FileMatrix
        With names of rows and columns.
    """
    entries = np.asarray(entries)
    nodes, components = entries[:, 0:4:2].real.astype(int), entries[:, 1:4:2].real.astype(int)
    dofs = 7 * nodes + np.where((components >= 1) & (components <= 6), components, 0)
    axes = [np.unique(dofs if square else dofs[:, k]) for k in (0, 1)]
    numbers = entries[:, 4] if np.any(entries[:, 4].imag) else entries[:, 4].real
    at = tuple(np.searchsorted(axis, dofs[:, k]) for k, axis in enumerate(axes))
    values = coo_array((numbers, at), shape=(axes[0].size, axes[1].size))
    return file_matrix(name, values, *(names_of(*divmod(axis, 7)) for axis in axes), one_triangle=one_triangle)


def names_of(nodes: Iterable[int], components: Iterable[int]) -> tuple[Dof, ...]:
    """Names of degrees of freedom by node and component, 1 to 6, or 0 of a scalar point.

    >>> names_of([7, 101], [3, 0])
    ((7, 'z'), (101, 'modal'))
    """
    return tuple((int(n), (MODAL, *DIRECTIONS)[c]) for n, c in zip(nodes, components, strict=True))
