"""Matrices of a file in any of the formats, by the file's ending and its first bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import MethodError
from beamsim.matrix_files.abaqus import read_abaqus
from beamsim.matrix_files.harwell_boeing import read_harwell_boeing
from beamsim.matrix_files.matrix import FileMatrix, file_matrix
from beamsim.matrix_files.nastran import read_dmig, read_op2, read_op4


def read_matrix(path: Path, name: str | None) -> FileMatrix:
    """One matrix of a file, its name without regard to case; the only one where no name is given.

    Raises
    ------
    MethodError
        About ``file`` or ``name``: it does not exist or cannot be read, it has no matrix of that name, or several.
    """
    matrices = read_matrices(path, name)
    found = [matrix for matrix in matrices if name is None or matrix.name.lower() == name.lower()]
    if found and (name is not None or len(found) == 1):
        return found[0]
    known = ", ".join(matrix.name for matrix in read_matrices(path)) or "none"
    if name is None:
        raise MethodError("file", f"holds {len(found)} matrices", f"name one: {known}")
    raise MethodError("name", f"= {name} is not a matrix of {path.name}", f"it holds {known}")


def read_matrices(path: Path, name: str | None = None) -> list[FileMatrix]:
    """All matrices of a file; with ``name``, in any case, others may be left out.

    Raises
    ------
    MethodError
        About ``file``: it does not exist, or cannot be read.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise MethodError("file", f"= {path.name} has an unknown ending", f"known are {', '.join(FORMATS)}")
    called, reader = FORMATS[ending]
    try:
        path.open("rb").close()
        return reader(path, name and name.lower())
    except MethodError:
        raise
    except OSError as error:
        raise MethodError("file", f"= {path} cannot be read ({error.strerror or error})", "check the path") from None
    except Exception as error:  # of a damaged file libraries raise errors of any kind
        raise MethodError("file", f"= {path.name} cannot be read as {called} ({error})", "write it again") from None


def _market_or_abaqus(path: Path, _: str | None) -> list[FileMatrix]:
    from scipy.io import mmread

    with open(path, "rb") as file:
        market = file.read(14).lower() == b"%%matrixmarket"
    return [file_matrix(path.stem.lower(), mmread(path)) if market else read_abaqus(path)]


def _matlab(path: Path, _: str | None) -> list[FileMatrix]:
    import h5py
    from scipy.io import loadmat

    if not h5py.is_hdf5(path):
        return _named(loadmat(path, spmatrix=False).items())
    with h5py.File(path) as stored:  # version 7.3
        return _named((name, _hdf5_matrix(item)) for name, item in stored.items())


def _hdf5_matrix(item: Any) -> Any:
    """A sparse matrix is a group of three arrays; a dense one is a data set with its axes in MATLAB's order."""
    from scipy.sparse import csc_array

    if "MATLAB_sparse" not in item.attrs:
        return _array(item).T
    pointers = item["jc"][()]
    numbers, rows = (_array(item[key]) if key in item else [] for key in ("data", "ir"))
    return csc_array((numbers, rows, pointers), shape=(int(item.attrs["MATLAB_sparse"]), len(pointers) - 1))


def _array(item: Any) -> Any:
    """Numbers of a data set; complex ones have two fields. Of a group, which is a structure, nothing."""
    values = np.asarray(item[()] if hasattr(item, "dtype") else None)
    return values["real"] + 1j * values["imag"] if values.dtype.names else values


def _numpy(path: Path, _: str | None) -> list[FileMatrix]:
    """Arrays by name, or the sparse matrix of `scipy.sparse.save_npz`."""
    from scipy.sparse import load_npz

    with np.load(path, allow_pickle=False) as stored:
        if not {"format", "shape", "data"} <= set(stored.files):
            return _named(stored.items())
    return [file_matrix(path.stem.lower(), load_npz(path))]


def _named(items: Iterable[tuple[str, Any]]) -> list[FileMatrix]:
    """Arrays of numbers with two dimensions; names with # and __ are of the file itself."""
    return [
        file_matrix(name, values)
        for name, values in items
        if not name.startswith(("#", "__")) and values.ndim == 2 and values.dtype.kind in "fciu"
    ]


FORMATS: dict[str, tuple[str, Callable[[Path, str | None], list[FileMatrix]]]] = {
    ".op4": ("OP4", read_op4),
    ".op2": ("OP2", read_op2),
    **dict.fromkeys((".pch", ".dmig", ".bdf", ".dat"), ("DMIG", read_dmig)),
    **dict.fromkeys((".mtx", ".mm"), ("MatrixMarket or Abaqus", _market_or_abaqus)),
    **dict.fromkeys((".hb", ".rua", ".rsa"), ("Harwell-Boeing", lambda path, _: [read_harwell_boeing(path)])),
    ".mat": ("MATLAB", _matlab),
    ".npz": ("NumPy", _numpy),
}
"""Name of the format, and its reader of a path and a name, by ending."""
