"""HDF5 files as they are opened for reading: of themselves alone, without links to other files."""

from __future__ import annotations

from pathlib import Path

import h5py

from beamsim.errors import InputFileError
from beamsim.input_files import open_input


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
