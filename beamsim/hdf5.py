"""HDF5 files as they are opened for reading: of themselves alone, and no more than they can hold.

A file of two kilobytes can claim data sets of gigabytes, have them filled with a constant, or point to other files. All
of that is found in its headers, before HDF5 makes room for anything.
"""

from __future__ import annotations

import math
import subprocess
import sys
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.errors import InputFileError
from beamsim.input_files import bytes_text, demand_memory, no_memory, open_input

MOST_UNPACKED = 1100.0
"""Bytes of values for a stored byte: deflate, the densest compression in use, reaches 1032."""
ALWAYS_READ = 100_000_000
"""Bytes of values that may be filled with a constant, which takes no room in a file."""


def open_hdf5(path: Path | str) -> h5py.File:
    """Open an HDF5 file for reading; it may not link to other files, which would then be read in its place.

    Raises
    ------
    InputFileError
        As `beamsim.input_files.open_input`; also if it is no HDF5 file, damaged, or has a link to another file.
    """
    with open_input(path):
        try:
            file = h5py.File(path, "r")
        except (OSError, ValueError, RuntimeError):
            raise InputFileError(
                path, "is not an HDF5 file, or damaged", "export it again; netCDF-3 as netCDF-4"
            ) from None
    try:
        linked = file.id.links.visit(_external, info=True)
    except (OSError, ValueError, RuntimeError) as error:
        file.close()
        reason = str(error).partition("\n")[0]
        raise InputFileError(path, f"is damaged ({reason})", "export it again") from None
    if linked is not None:
        file.close()
        name = linked.decode("utf-8", "replace")
        raise InputFileError(path, f"has {name} in another file", "export all of it to one file")
    return file


def _external(name: bytes, link: h5py.h5l.LinkInfo) -> bytes | None:
    """The name of a link if it is none within the file, which ends the visit."""
    return None if link.type in (h5py.h5l.TYPE_HARD, h5py.h5l.TYPE_SOFT) else name


def read_array(dataset: h5py.Dataset) -> Any:
    """The values of a data set, if they are in the file and have room in memory.

    Parameters
    ----------
    dataset : of an open file.

    Returns
    -------
    numpy.ndarray
        Of the shape of the data set.

    Raises
    ------
    InputFileError
        If it has no values, they are in another file, or they claim more memory than there is, or than what is stored
        can stand for.
    """
    path, name = dataset.file.filename, dataset.name
    _demand_plausible(dataset)
    size = values_size(dataset)
    demand_memory(path, size + _chunk_size(dataset), f"for the values of {name}")
    try:
        return np.asarray(dataset[()])
    except MemoryError:
        raise no_memory(path, size) from None


def values_size(dataset: h5py.Dataset) -> int:
    """Bytes of the values of a data set."""
    return math.prod(dataset.shape or ()) * int(dataset.dtype.itemsize)


def _chunk_size(dataset: h5py.Dataset) -> int:
    """Bytes of a chunk of a data set, which is unpacked as a whole; 0 where there are none."""
    return math.prod(dataset.chunks) * int(dataset.dtype.itemsize) if dataset.chunks else 0


def _demand_plausible(dataset: h5py.Dataset) -> None:
    """Refuse a data set without values, with values in other files, or with more than what is stored can stand for.

    Raises
    ------
    InputFileError
        If it is one.
    """
    path, name = dataset.file.filename, dataset.name
    if dataset.shape is None:
        raise InputFileError(path, f"has no values in {name}", "export it again")
    if dataset.is_virtual or dataset.external:
        raise InputFileError(path, f"has the values of {name} in another file", "export all of it to one file")
    stored = int(dataset.id.get_storage_size())
    for claimed, what in ((values_size(dataset), "values"), (_chunk_size(dataset), "a chunk")):
        if claimed > max(ALWAYS_READ, MOST_UNPACKED * stored):
            message = f"claims {bytes_text(claimed)} for {what} of {name}, of which {bytes_text(stored)} are stored"
            raise InputFileError(path, message, "it is damaged, or its values were never written: export it again")


LONGEST_EXAMINATION_S = 15.0
_EXAMINE = "import sys; from beamsim.hdf5 import examine; examine(sys.argv[1])"


def demand_readable(path: Path | str) -> None:
    """Refuse a file of another program that HDF5 does not survive: some damage ends the process or holds it for ever.

    Everything in the file is read once by another process; a file that has not changed is examined once.

    Raises
    ------
    InputFileError
        As `beamsim.input_files.open_input`; also if that process cannot start, ends unexpectedly, or does not end.
    """
    with open_input(path):
        state = Path(path).stat()
    if not _survived(str(path), state.st_mtime_ns, state.st_size):
        raise InputFileError(path, "is damaged: the HDF5 library cannot read it to its end", "export it again")


@lru_cache(maxsize=256)
def _survived(path: str, modified: int, size: int) -> bool:
    """Whether a process that reads the file ends by itself; exceptions are left to the reader, which locates them."""
    del modified
    limit_s = LONGEST_EXAMINATION_S + size / 1e7  # of 10 MB/s
    try:
        done = subprocess.run([sys.executable, "-c", _EXAMINE, path], capture_output=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        return False
    except OSError as error:
        message = f"cannot be examined: no other process can be started ({error.strerror or error})"
        raise InputFileError(path, message, "free memory, or end other processes") from None
    return done.returncode in (0, 1)  # 1: an exception


def examine(path: str) -> None:
    """Read all attributes and values of a file that may be damaged; for a process of its own."""
    with open_hdf5(path) as file:

        def visit(_: str, owner: h5py.Group | h5py.Dataset) -> None:
            for key in owner.attrs:
                with suppress(Exception):
                    owner.attrs[key]
            if isinstance(owner, h5py.Dataset):
                with suppress(Exception):
                    read_array(owner)

        file.visititems(visit)
