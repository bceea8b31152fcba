"""All channels of a file, by its ending."""

from __future__ import annotations

from pathlib import Path

from beamsim.measurements.csv_table import read_csv
from beamsim.measurements.signal import MeasuredSignal, MeasurementError

TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
HDF5 = (".h5", ".hdf5", ".hdf")
UFF = (".uff", ".unv", ".uf", ".58")


def read_file(path: Path) -> list[MeasuredSignal]:
    """All channels of a file in its own units, columns of a table without an axis among them.

    Raises
    ------
    MeasurementError
        If the file is missing, empty, of an unknown format, damaged, or has cells that are no numbers.
    """
    if not path.is_file():
        raise MeasurementError("does not exist", "check the path; it is relative to the case's file")
    if path.stat().st_size == 0:
        raise MeasurementError("is empty", "export the measurement again")
    suffix = path.suffix.lower()
    try:
        if suffix in TEXT:
            return read_csv(path)
        if suffix in HDF5:
            from beamsim.measurements.hdf5_file import read_hdf5

            return read_hdf5(path)
        if suffix in UFF:
            from beamsim.measurements.universal_file import read_uff

            return read_uff(path)
    except OSError as error:
        raise MeasurementError(f"cannot be read ({error.strerror or error})", "check the path") from None
    raise MeasurementError("has an unknown format", "use .csv, .h5 or .uff")
