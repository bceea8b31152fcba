"""All channels of a file of test data: CSV, HDF5, netCDF-4, MATLAB, UFF (data set 58), by its ending."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

from beamsim.errors import InputFileError
from beamsim.input_files import open_input, reading
from beamsim.measurements.arrays import HDF5, MATLAB, read_hdf5, read_matlab
from beamsim.measurements.signal import MeasuredSignal
from beamsim.measurements.tables import read_csv
from beamsim.measurements.universal import ENDINGS, read_uff
from beamsim.scenario.files import DecimalMark

TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")


def ending_of(path: Path) -> str:
    """The ending of a file, in small letters.

    Raises
    ------
    InputFileError
        If the file is missing, no regular file, or empty.
    """
    with open_input(path) as file:
        if not file.read(1):
            raise InputFileError("is empty", "export the measurement again")
    return path.suffix.lower()


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
    readers = {
        **dict.fromkeys(HDF5, ("HDF5", read_hdf5)), **dict.fromkeys(MATLAB, ("MATLAB", read_matlab)),
        **dict.fromkeys(ENDINGS, ("a universal file", read_uff)),
    }  # fmt: skip
    if ending not in (*TEXT, *readers):
        raise InputFileError("has an unknown format", "use .csv, .h5, .nc, .mat or .uff")
    if decimal is not None and ending in readers:
        raise InputFileError("is no text table, which alone has a decimal mark", "leave decimal out")
    called, read = readers.get(ending, ("a text table", partial(read_csv, decimal=decimal)))
    with reading(path, called):
        signals = read(path)
    several = Counter(signal.name for signal in signals)
    return [
        replace(signal, name=f"{signal.name} ({number})") if several[signal.name] > 1 else signal
        for number, signal in enumerate(signals, 1)
    ]
