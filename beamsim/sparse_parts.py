"""Sparse matrices from the arrays of files, which are checked before any compiled code follows them.

SciPy's conversions trust indices and pointers: one that is out of range makes them write outside their arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from beamsim.typing import Ints

MOST_ROWS = 10_000_000
"""Largest number of rows or columns of a matrix, far beyond models whose matrices are imported."""


def matrix_shape(shape: Any) -> tuple[int, int]:
    """Numbers of rows and columns of a file, checked.

    Raises
    ------
    ValueError
        If they are not two whole numbers from 0 to `MOST_ROWS`.
    """
    sizes = np.asarray(shape).ravel()
    if sizes.size != 2 or sizes.dtype.kind not in "iu":
        raise ValueError("its shape is not two whole numbers")
    rows, columns = (int(size) for size in sizes)
    if not 0 <= min(rows, columns) <= max(rows, columns) <= MOST_ROWS:
        raise ValueError(f"its shape is {rows} x {columns}; up to {MOST_ROWS} rows and columns are read")
    return rows, columns


def whole_numbers(name: str, values: Any) -> Ints:
    """Indices or pointers of a file as integers.

    Raises
    ------
    ValueError
        If they are no list of whole numbers; ``name`` says of what.
    """
    array = np.asarray(values)
    if array.ndim != 1:
        raise ValueError(f"its {name} are no list")
    if array.dtype.kind == "f" and np.all(np.abs(array) < 2.0**53) and np.all(array == np.floor(array)):
        array = array.astype(np.int64)
    if array.size and array.dtype.kind not in "iu":
        raise ValueError(f"its {name} are not whole numbers")
    if array.size and array.dtype == np.uint64 and array.max() >= 2**63:
        raise ValueError(f"its {name} reach {array.max()}")
    return array.astype(np.int64)


def from_coordinates(values: Any, rows: Any, columns: Any, shape: Any) -> Any:
    """The matrix of entries by row and column.

    Parameters
    ----------
    values, rows, columns : (n,) entries and their places from 0.
    shape : numbers of rows and columns.

    Returns
    -------
    coo_array

    Raises
    ------
    ValueError
        If the arrays differ in length, or a place is outside the matrix.
    """
    shape, values = matrix_shape(shape), _numbers(values)
    places = whole_numbers("rows", rows), whole_numbers("columns", columns)
    for name, place, size in zip(("row", "column"), places, shape, strict=True):
        _demand_as_many(name, place, values.size)
        _demand_range(name, place, size)
    return coo_array((values, places), shape=shape)


def from_columns(values: Any, rows: Any, pointers: Any, shape: Any) -> Any:
    """The matrix of entries column by column.

    Parameters
    ----------
    values, rows : (n,) entries and their rows from 0.
    pointers : (columns + 1,) number of the first entry of each column, and n.
    shape : numbers of rows and columns.

    Returns
    -------
    csc_array

    Raises
    ------
    ValueError
        If the arrays differ in length, pointers do not rise from 0 to n, or a row is outside the matrix.
    """
    count_of_rows, columns = matrix_shape(shape)
    values, indices, starts = _check_compressed(("row", "column"), values, rows, pointers, (count_of_rows, columns))
    return csc_array((values, indices, starts), shape=(count_of_rows, columns))


def from_rows(values: Any, columns: Any, pointers: Any, shape: Any) -> Any:
    """The matrix of entries row by row; as `from_columns`."""
    rows, count_of_columns = matrix_shape(shape)
    values, indices, starts = _check_compressed(("column", "row"), values, columns, pointers, (count_of_columns, rows))
    return csr_array((values, indices, starts), shape=(rows, count_of_columns))


def from_blocks(values: Any, columns: Any, pointers: Any, shape: Any) -> Any:
    """The matrix of dense blocks of equal size, block row by block row.

    Parameters
    ----------
    values : (n, r, c) blocks.
    columns : (n,) block columns from 0.
    pointers : (block rows + 1,) number of the first block of each block row, and n.
    shape : numbers of rows and columns.

    Returns
    -------
    coo_array

    Raises
    ------
    ValueError
        As `from_columns`; also if blocks do not fit in the matrix.
    """
    blocks, shape = np.asarray(values), matrix_shape(shape)
    if blocks.ndim != 3 or 0 in blocks.shape[1:] or any(n % m for n, m in zip(shape, blocks.shape[1:], strict=True)):
        raise ValueError(f"its blocks of {blocks.shape[1:]} do not divide its shape {shape}")
    height, width = blocks.shape[1:]
    coarse = shape[0] // height, shape[1] // width
    numbers, indices, starts = _check_compressed(
        ("block column", "block row"), np.arange(len(blocks)), columns, pointers, (coarse[1], coarse[0])
    )
    rows = np.repeat(np.arange(coarse[0]), np.diff(starts))
    across, down = np.meshgrid(np.arange(width), np.arange(height))
    row = (height * rows[:, None] + down.ravel()).ravel()
    column = (width * indices[:, None] + across.ravel()).ravel()
    return from_coordinates(blocks[numbers].ravel(), row, column, shape)


def from_diagonals(values: Any, offsets: Any, shape: Any) -> Any:
    """The matrix of diagonals.

    Parameters
    ----------
    values : (n, m) of each diagonal the entries by their column; those outside the matrix have no meaning.
    offsets : (n,) number of columns by which a diagonal is right of the main one.
    shape : numbers of rows and columns.

    Returns
    -------
    coo_array

    Raises
    ------
    ValueError
        If there are not as many diagonals as offsets, or two have the same offset.
    """
    diagonals, (rows, columns) = np.asarray(values), matrix_shape(shape)
    offsets = whole_numbers("offsets", offsets)
    if diagonals.ndim != 2 or len(diagonals) != offsets.size:
        raise ValueError(f"it has {len(diagonals)} diagonals with {offsets.size} offsets")
    if np.unique(offsets).size < offsets.size:
        raise ValueError("two of its diagonals have the same offset")
    _demand_range("offset", np.abs(offsets), max(rows, columns, 1))
    column = np.broadcast_to(np.arange(diagonals.shape[1]), diagonals.shape)
    row = column - offsets[:, None]
    inside = (row >= 0) & (row < rows) & (column < columns)
    return from_coordinates(diagonals[inside], row[inside], column[inside], (rows, columns))


def _numbers(values: Any) -> Any:
    """Entries of a matrix as a list of numbers."""
    array = np.asarray(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "fciub"):
        raise ValueError("its entries are no list of numbers")
    return array


def _demand_as_many(name: str, indices: Ints, count: int) -> None:
    """Refuse indices that are not one for each of ``count`` entries."""
    if indices.size != count:
        raise ValueError(f"it has {count} entries, and {indices.size} of them have a {name}")


def _demand_range(name: str, indices: Ints, size: int) -> None:
    """Refuse an index that is not from 0 to ``size`` - 1."""
    if indices.size and not 0 <= indices.min() <= indices.max() < size:
        wrong = int(np.flatnonzero((indices < 0) | (indices >= size))[0])
        raise ValueError(f"the {name} of entry {wrong + 1} is {indices[wrong] + 1}, outside 1 to {size}")


def _check_compressed(
    names: tuple[str, str], values: Any, indices: Any, pointers: Any, sizes: tuple[int, int]
) -> tuple[Any, Ints, Ints]:
    """Entries, indices and pointers of a compressed matrix, checked.

    Parameters
    ----------
    names : of what indices and of what pointers count.
    values, indices : (n,).
    pointers : (sizes[1] + 1,).
    sizes : of the matrix along both.
    """
    entries = _numbers(values)
    places, starts = whole_numbers(f"{names[0]}s", indices), whole_numbers("pointers", pointers)
    if starts.size != sizes[1] + 1:
        raise ValueError(f"it has {starts.size} pointers for {sizes[1]} {names[1]}s, instead of one more")
    _demand_as_many(names[0], places, entries.size)
    if starts[0] != 0 or starts[-1] != entries.size:
        raise ValueError(
            f"its pointers go from {starts[0]} to {starts[-1]}, instead of 0 to its {entries.size} entries"
        )
    if np.any(starts[1:] < starts[:-1]):
        wrong = int(np.flatnonzero(starts[1:] < starts[:-1])[0])
        raise ValueError(f"the pointer of {names[1]} {wrong + 2} is less than that of {names[1]} {wrong + 1}")
    _demand_range(names[0], places, sizes[0])
    return entries, places, starts
