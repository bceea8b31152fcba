"""Matrices of a file in any of the formats, by the file's ending and its first bytes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from beamsim.errors import MethodError
from beamsim.matrix_files.abaqus import read_abaqus
from beamsim.matrix_files.dmig import read_dmig
from beamsim.matrix_files.harwell_boeing import read_harwell_boeing
from beamsim.matrix_files.matrix import FileMatrix
from beamsim.matrix_files.op4 import read_op4

FORMATS = {
    ".op4": "OP4", ".pch": "DMIG", ".dmig": "DMIG", ".bdf": "DMIG", ".dat": "DMIG", ".mtx": "MatrixMarket or Abaqus",
    ".mm": "MatrixMarket", ".hb": "Harwell-Boeing", ".rua": "Harwell-Boeing", ".rsa": "Harwell-Boeing",
    ".mat": "MATLAB", ".npz": "NumPy",
}  # fmt: skip
"""Format by ending."""


def read_matrix(path: Path, name: str | None) -> FileMatrix:
    """One matrix of a file, its name without regard to case; the only one where no name is given.

    Raises
    ------
    MethodError
        About ``file`` or ``name``: it does not exist or cannot be read, it has no matrix of that name, or several.
    """
    matrices = read_matrices(path, name)
    known = ", ".join(matrix.name for matrix in matrices)
    if name is None:
        if len(matrices) != 1:
            raise MethodError("file", f"holds {len(matrices)} matrices", f"name one: {known}")
        return matrices[0]
    for matrix in matrices:
        if matrix.name.lower() == name.lower():
            return matrix
    raise MethodError("name", f"= {name} is not a matrix of {path.name}", f"it holds {known or 'none'}")


def read_matrices(path: Path, name: str | None = None) -> Sequence[FileMatrix]:
    """All matrices of a file; with ``name`` the entries of others may be left out.

    Raises
    ------
    MethodError
        About ``file``: it does not exist, or cannot be read.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise MethodError("file", f"= {path.name} has an unknown ending", f"known are {', '.join(FORMATS)}")
    try:
        if ending == ".op4":
            return read_op4(path, name.lower() if name else None)
        if FORMATS[ending] == "DMIG":
            return read_dmig(path)
        if ending in (".mtx", ".mm"):
            with open(path, "rb") as file:
                market = file.read(14).lower() == b"%%matrixmarket"
            return [_market(path)] if market else [read_abaqus(path)]
        if FORMATS[ending] == "Harwell-Boeing":
            return [read_harwell_boeing(path)]
        return _matlab(path) if ending == ".mat" else _numpy(path)
    except OSError as error:
        raise MethodError("file", f"= {path} cannot be read ({error.strerror or error})", "check the path") from None
    except (ValueError, KeyError, NotImplementedError, EOFError) as error:
        raise MethodError("file", f"= {path.name} cannot be read as {FORMATS[ending]} ({error})") from None


def _matrix(name: str, values: Any) -> FileMatrix:
    from scipy.sparse import csc_array

    return FileMatrix(name, csc_array(values))


def _market(path: Path) -> FileMatrix:
    from scipy.io import mmread

    return _matrix(path.stem.lower(), mmread(path))


def _matlab(path: Path) -> list[FileMatrix]:
    """Arrays of two dimensions; version 7.3 is HDF5."""
    with open(path, "rb") as file:
        hdf5 = b"MATLAB 7.3" in file.read(128)[:10]
    if not hdf5:
        from scipy.io import loadmat
        from scipy.io.matlab import MatReadError

        try:
            items = loadmat(path, spmatrix=False)
        except MatReadError as error:
            raise ValueError(error) from None
        return [_matrix(name, values) for name, values in items.items() if _is_matrix(values)]
    import h5py

    with h5py.File(path) as stored:
        return [_matrix(name, _hdf5_values(item)) for name, item in stored.items() if not name.startswith("#")]


def _hdf5_values(item: Any) -> Any:
    """A matrix of a version 7.3 file: sparse as a group, dense as a data set with its axes in MATLAB's order."""
    import h5py
    from scipy.sparse import csc_array

    if isinstance(item, h5py.Group):
        columns = item["jc"][()]
        rows, data = (item[key][()] if key in item else [] for key in ("ir", "data"))
        return csc_array((_plain(data), rows, columns), shape=(int(item.attrs["MATLAB_sparse"]), len(columns) - 1))
    return _plain(item[()]).T


def _plain(values: Any) -> Any:
    """Complex numbers as such."""
    names = getattr(values.dtype, "names", None) if hasattr(values, "dtype") else None
    return values["real"] + 1j * values["imag"] if names else values


def _is_matrix(values: Any) -> bool:
    kind = getattr(getattr(values, "dtype", None), "kind", "")
    return kind in "fciu" and kind != "" and values.ndim == 2


def _numpy(path: Path) -> list[FileMatrix]:
    """Arrays of two dimensions by name, or the sparse matrix of `scipy.sparse.save_npz`."""
    import numpy as np

    with np.load(path, allow_pickle=False) as stored:
        names = set(stored.files)
        if not {"format", "shape", "data"} <= names:
            return [_matrix(name, stored[name]) for name in stored.files if _is_matrix(stored[name])]
    from scipy.sparse import load_npz

    return [_matrix(path.stem.lower(), load_npz(path))]
