"""All channels of a file of test data, by its ending: CSV, HDF5, netCDF, MATLAB, UFF (data set 58), TDMS, MDF, LVM."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from pkgutil import resolve_name

from beamsim.errors import InputFileError
from beamsim.files import open_input, reading
from beamsim.measurements.signal import MeasuredSignal
from beamsim.measurements.tables import read_csv
from beamsim.scenario.files import DecimalMark

TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
UNIVERSAL = (".uff", ".unv", ".uf", ".58")
HDF5 = (".h5", ".hdf5", ".hdf")
_BY_ENDING = {
    **dict.fromkeys(HDF5, ("HDF5", "arrays:read_hdf5")),
    **dict.fromkeys((".nc", ".nc4", ".cdf"), ("netCDF", "laboratory:read_netcdf")),
    ".mat": ("MATLAB", "arrays:read_matlab"),
    **dict.fromkeys(UNIVERSAL, ("a universal file", "universal:read_uff")),
    ".tdms": ("TDMS", "laboratory:read_tdms"),
    **dict.fromkeys((".mf4", ".mdf"), ("MDF", "mdf:read_mdf")),
    ".lvm": ("LVM", "laboratory:read_lvm"),
}
"""What a file is called, and its reader, which is imported for such a file alone; others are text tables."""
ENDINGS_OF_RECORDS = {*TEXT, *_BY_ENDING} - {*HDF5}
"""Endings of files of test data alone; those of HDF5 are of results too."""


def ending_of(path: Path) -> str:
    """The ending of a file, in small letters; ``.mdf`` of an MDF file of version 3 with the ending of a text table.

    Raises
    ------
    InputFileError
        If the file is missing, no regular file, or empty.
    """
    with open_input(path) as file:
        begin = file.read(8)
    if not begin:
        raise InputFileError("is empty", "export the measurement again")
    ending = path.suffix.lower()
    return ".mdf" if ending == ".dat" and begin == b"MDF     " else ending


def read_file(path: Path, decimal: DecimalMark | None = None) -> list[MeasuredSignal]:
    """All channels of a file in its own units, columns of a table without an axis among them, each with a name of its
    own.

    Parameters
    ----------
    path : of the file.
    decimal : decimal mark of a text table, where the user states it.

    Returns
    -------
    list of MeasuredSignal

    Raises
    ------
    InputFileError
        If the file is missing, empty, of an unknown format, damaged, or has cells that are no numbers.
    """
    ending = ending_of(path)
    if ending not in (*TEXT, *_BY_ENDING):
        raise InputFileError("has an unknown format", "use .csv, .h5, .nc, .mat, .uff, .tdms, .mf4 or .lvm")
    if decimal is not None and ending in _BY_ENDING:
        raise InputFileError("is not a text table; only these have a decimal mark", "leave decimal out")
    called, reader = _BY_ENDING.get(ending, ("a text table", ""))
    read = resolve_name(f"beamsim.measurements.{reader}") if reader else partial(read_csv, decimal=decimal)
    with reading(path, called):
        signals: list[MeasuredSignal] = read(path)
    several = Counter(signal.name for signal in signals)
    return [
        replace(signal, name=f"{signal.name} ({number})") if several[signal.name] > 1 else signal
        for number, signal in enumerate(signals, 1)
    ]
