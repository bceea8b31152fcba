"""HDF5 files as they are opened for reading: of themselves alone, and no more than they can hold.

A file of two kilobytes can claim data sets of gigabytes, have them filled with a constant, or point to other files. All
of that is found in its headers, before HDF5 makes room for anything. Damage elsewhere can end the process inside HDF5's
library: a file that does not carry the right seal of this program is read by another process first.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import time
from contextlib import suppress
from functools import lru_cache
from io import BufferedReader
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import bytes_text, demand_memory, is_as_written, no_memory, open_input

MOST_UNPACKED = 1100.0
"""Bytes of values for a stored byte: deflate, the densest compression in use, reaches 1032."""
ALWAYS_READ = 100_000_000
"""Bytes of values that may be filled with a constant, which takes no room in a file."""


_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def open_hdf5(path: Path | str) -> h5py.File:
    """Open an HDF5 file for reading; it may not link to other files, which would then be read in its place.

    A file that is not as this program wrote it is examined by another process before.

    Raises
    ------
    InputFileError
        As `beamsim.files.open_input`; also if it is no HDF5 file, damaged, or has a link to another file.
    """
    with open_input(path) as file:
        state = os.fstat(file.fileno())
        _demand_signature(path, file, state.st_size)
    if not is_as_written(path):
        _demand_survived(str(path), state.st_mtime_ns, state.st_size)
    return _open(path)


def _open(path: Path | str) -> h5py.File:
    """Open a file that HDF5 survives."""
    try:
        file = h5py.File(path, "r")
    except (OSError, ValueError, RuntimeError):
        raise _not_hdf5(path) from None
    try:
        linked = file.id.links.visit(_external, info=True)
    except (OSError, ValueError, RuntimeError) as error:
        file.close()
        reason = str(error).partition("\n")[0]
        raise InputFileError(f"is damaged ({reason})", "export it again", path) from None
    if linked is not None:
        file.close()
        name = linked.decode("utf-8", "replace")
        raise InputFileError(f"has {name} in another file", "export all of it to one file", path)
    return file


def _not_hdf5(path: Path | str) -> InputFileError:
    return InputFileError("is not an HDF5 file, or damaged", "export it again; netCDF-3 as netCDF-4", path)


def _demand_signature(path: Path | str, file: BufferedReader, size: int) -> None:
    """Refuse a file without the first bytes of HDF5, which stand at its begin or at 512, 1024, 2048, ... bytes."""
    place = 0
    while place < size:
        file.seek(place)
        if file.read(len(_SIGNATURE)) == _SIGNATURE:
            return
        place = max(512, 2 * place)
    raise _not_hdf5(path)


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
    demand_plausible(dataset)
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


def demand_plausible(dataset: h5py.Dataset) -> None:
    """Refuse a data set without values, with values in other files, or with more than what is stored can stand for.

    Raises
    ------
    InputFileError
        If it is one.
    """
    if dataset.shape is None:
        raise InputFileError(f"has no values in {dataset.name}", "export it again", dataset.file.filename)
    if dataset.is_virtual or dataset.external:
        message = f"has the values of {dataset.name} in another file"
        raise InputFileError(message, "export all of it to one file", dataset.file.filename)
    stored = int(dataset.id.get_storage_size())
    for claimed, what in ((values_size(dataset), "values"), (_chunk_size(dataset), "a chunk")):
        if claimed > max(ALWAYS_READ, MOST_UNPACKED * stored):
            of = f"{what} of {dataset.name}, of which {bytes_text(stored)} are stored"
            remedy = "it is damaged, or its values were never written: export it again"
            raise InputFileError(f"claims {bytes_text(claimed)} for {of}", remedy, dataset.file.filename)


LONGEST_EXAMINATION_S = 15.0
"""Processor time that another process may take to read a small file."""

WAITING = 4.0
"""Times that long is waited for it, on a busy machine."""

_EXAMINE = "import sys; from beamsim.hdf5 import examine; examine(*sys.argv[1:])"


@lru_cache(maxsize=256)
def _demand_survived(path: str, modified: int, size: int) -> None:
    """Refuse a file that HDF5 does not survive: some damage ends the process or holds it for ever.

    Everything in the file is read once by another process. Exceptions there are left to the reader, which locates them.

    Raises
    ------
    InputFileError
        As `run_apart`.
    """
    del modified
    run_apart(_EXAMINE, path, str(_longest_s(size)), library="the HDF5 library")


def _longest_s(size: int) -> float:
    """Processor time in s that another process may take for a file of a size in bytes."""
    return LONGEST_EXAMINATION_S + size / 1e7  # of 10 MB/s


def run_apart(code: str, path: Path | str, *arguments: str, library: str) -> None:
    """Run code about a file in another Python process, which a damaged file may end or hold.

    Parameters
    ----------
    code : gets the path and the arguments as ``sys.argv[1:]``.
    path : of the file.
    arguments : further ones.
    library : what reads the file there, for messages.

    Raises
    ------
    InputFileError
        If that process cannot start, ends unexpectedly, or does not end.
    """
    # -P: without modules of the current folder
    command = [sys.executable, "-P", "-c", code, str(path), *arguments]
    surroundings = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    wait_s = WAITING * _longest_s(os.stat(path).st_size)
    try:
        done = subprocess.run(command, capture_output=True, timeout=wait_s, check=False, env=surroundings)
    except subprocess.TimeoutExpired:
        message = f"was not read to its end by {library} within {wait_s:.3g} s"
        raise InputFileError(message, "export it again, or try once more on a less busy machine", path) from None
    except OSError as error:
        code_of_end, reason = 1, f"no other process can be started ({error.strerror or error})"
    else:
        code_of_end, reason = done.returncode, done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
    if code_of_end == 1:  # of an exception before the file was opened
        raise InputFileError(f"cannot be examined: {reason}", "free memory, or end other processes", path)
    if code_of_end != 0:
        raise InputFileError(f"is damaged: {library} cannot read it to its end", "export it again", path)


def examine(path: str, longest_s: str) -> None:
    """Read all that readers read of a file that may be damaged; for a process of its own.

    Parameters
    ----------
    path : of the file.
    longest_s : s; processor time after which the process ends by a signal, where the system can do that.
    """
    if sys.platform != "win32":
        import resource

        seconds = math.ceil(time.process_time() + float(longest_s))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    with suppress(Exception), _open(path) as file:
        places = ["/"]
        with suppress(Exception):
            file.visit(places.append)
        for place in places:
            with suppress(Exception):
                _read_all(file[place])


def _read_all(owner: h5py.Group | h5py.Dataset) -> None:
    """Read attributes, values and axes of a group or data set."""
    for key in owner.attrs:
        with suppress(Exception):
            owner.attrs[key]
    if isinstance(owner, h5py.Dataset):
        with suppress(Exception):
            read_array(owner)
        if not owner.is_scale:
            scales_of(owner)


LIST = "DIMENSION_LIST"
"""Attribute in which HDF5 keeps references to the scales of a data set."""


def scales_of(dataset: h5py.Dataset) -> list[h5py.Dataset | None]:
    """The first scale of each dimension, None where it has none.

    HDF5 takes the references of the attribute as they are: of another type or size they are addresses of nothing.

    Raises
    ------
    ValueError
        If the attribute that refers to the scales is not one that HDF5 writes.
    """
    count, attributes = dataset.ndim, dataset.attrs
    if LIST not in attributes:
        return [None] * count
    listed = attributes.get_id(LIST)
    kind = h5py.check_vlen_dtype(listed.dtype)
    if kind is None or h5py.check_ref_dtype(kind) is not h5py.Reference or listed.shape != (count,):
        raise ValueError(f"attribute {LIST} of {dataset.name} does not refer to its axes")
    return [scales[0] if len(scales) else None for scales in dataset.dims]
