"""All channels of a file of test data: CSV, HDF5, UFF (data set 58), by its ending."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.measurements.signal import (
    MeasuredSignal,
    MeasurementError,
    is_frequency,
    is_time,
    label_of,
    split_heading,
    stated,
)
from beamsim.measurements.tables import read_csv

LIST = "DIMENSION_LIST"  # attribute in which HDF5 keeps references to the scales


def read_hdf5(path: Path) -> list[MeasuredSignal]:
    """The data sets of a file, named by their path; the axis of each is its dimension scale, else the time or
    frequency of as many values in the nearest enclosing group.

    Raises
    ------
    MeasurementError
        If it is not an HDF5 file, or damaged.
    """
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise MeasurementError("is not an HDF5 file, or is damaged", "export the measurement again") from None
    found: dict[str, h5py.Dataset] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iufc" and 2 <= item.size == max(item.shape):
            found[name] = item

    with file:
        file.visititems(visit)
        try:
            return [_data_set(name, item, found, path) for name, item in found.items()]
        except ValueError as error:
            raise MeasurementError(f"is damaged: {error}", "export the measurement again") from None


def _data_set(name: str, item: h5py.Dataset, found: dict[str, h5py.Dataset], path: Path) -> MeasuredSignal:
    axis = _axis_of(name, item, found)
    x = np.arange(item.size, dtype=float) if axis is None else np.asarray(found[axis][()], dtype=float).ravel()
    of_frequency = axis is not None and is_frequency(axis.rpartition("/")[2])
    y = np.asarray(item[()]).ravel()
    y = y.astype(complex if np.iscomplexobj(y) else float)
    axis_unit = "" if axis is None else _unit(axis, found[axis])
    return MeasuredSignal(label_of(name), x, y, of_frequency, _unit(name, item), str(path), axis or "", axis_unit)


def _unit(name: str, item: h5py.Dataset) -> str:
    return stated(str(item.attrs.get("units", ""))) or split_heading(name)[1]


def _axis_of(name: str, item: h5py.Dataset, found: dict[str, h5py.Dataset]) -> str | None:
    """The dimension scale, else time or frequency in an enclosing group; None where it has another size."""
    if (scale := scale_along(item, 0)) is not None:
        axes = [str(scale.name).lstrip("/")]
    else:
        folders = name.split("/")[:-1]
        groups = ["/".join(folders[:k]) for k in range(len(folders), -1, -1)]
        axes = [other for group in groups for other in found if other.rpartition("/")[0] == group]
    axes = [axis for axis in axes if is_time(last := axis.rpartition("/")[2]) or is_frequency(last)]
    if not axes or axes[0] == name or axes[0] not in found or found[axes[0]].size != item.size:
        return None
    return axes[0]


def scale_along(dataset: h5py.Dataset, axis: int) -> h5py.Dataset | None:
    """The first scale of one dimension, None where it has none.

    HDF5 takes the references of the attribute as they are: of another type or size they are addresses of nothing.

    Raises
    ------
    ValueError
        If the attribute that refers to the scales is not one that HDF5 writes.
    """
    if LIST not in dataset.attrs:
        return None
    listed = dataset.attrs.get_id(LIST)
    kind = h5py.check_vlen_dtype(listed.dtype)
    if kind is None or h5py.check_ref_dtype(kind) is not h5py.Reference or listed.shape != (dataset.ndim,):
        raise ValueError(f"attribute {LIST} of {dataset.name} does not refer to its axes")
    scales = dataset.dims[axis]
    return scales[0] if len(scales) else None


_AXES = {17: "s", 18: "Hz"}  # the format has no other units of time
# By how many of them an SI unit is: what data set 164 states.
_LENGTHS = {1.0: "m", 1e3: "mm", 1e2: "cm", 1 / 0.0254: "in", 1 / 0.3048: "ft"}
_FORCES = {1.0: "N", 1e3: "mN", 1e2: "cN", 1 / 4.4482216: "lbf", 1 / 9.80665: "kgf"}


def data_sets(path: Path) -> list[dict[str, Any]]:
    """All data sets of a file that pyuff knows.

    Raises
    ------
    MeasurementError
        If it cannot be read.
    """
    import pyuff

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            known = [i for i, kind in enumerate(file.get_set_types()) if int(kind) in (15, 55, 58, 82, 164)]
            return [file.read_sets(i) for i in known]
    except Exception as error:  # pyuff raises exceptions of all types on damaged files
        raise MeasurementError(f"cannot be read as a universal file ({error})", "export it again") from None


def read_uff(path: Path) -> list[MeasuredSignal]:
    """The functions of a file.

    Raises
    ------
    MeasurementError
        If it cannot be read, or has none.
    """
    sets = data_sets(path)
    units = next(({"length": _named(s.get("length"), _LENGTHS), "force": _named(s.get("force"), _FORCES)}
                  for s in sets if s["type"] == 164), {})  # fmt: skip
    records = [each for each in sets if each["type"] == 58]
    if not records:
        raise MeasurementError("contains no dataset 58", "export functions at nodal degrees of freedom (dataset 58)")
    return _told_apart([_function(each, units, path) for each in records], map(_place, records))


# by the number of a direction, that of a negative one counted from the end
_DIRECTIONS = ("", "+X", "+Y", "+Z", "+RX", "+RY", "+RZ", "-RZ", "-RY", "-RX", "-Z", "-Y", "-X")


def _place(record: Mapping[str, Any]) -> str:
    """Node and direction of the response of a function."""
    direction = int(record.get("rsp_dir", 0))
    return f"node {record.get('rsp_node', 0)} {_DIRECTIONS[direction] if abs(direction) <= 6 else ''}".rstrip()


def _told_apart(signals: list[MeasuredSignal], words: Iterable[str]) -> list[MeasuredSignal]:
    """The signals, with a word each in names that several have."""
    several = Counter(signal.name for signal in signals)
    return [
        replace(signal, name=f"{signal.name} {word}") if several[signal.name] > 1 else signal
        for signal, word in zip(signals, words, strict=False)
    ]


def _function(record: Mapping[str, Any], units: Mapping[str, str], path: Path) -> MeasuredSignal:
    kind = int(record.get("abscissa_spec_data_type", 0))
    axis_unit, unit = (stated(str(record.get(f"{name}_axis_units_lab", ""))) for name in ("abscissa", "ordinate"))
    texts = [str(record.get(key, "")).strip() for key in ("id1", "rsp_ent_name")]
    name = next((text for text in texts if text.upper() not in ("", "NONE")), f"node {record.get('rsp_node', 0)}")
    y = np.asarray(record["data"])
    return MeasuredSignal(
        name, np.asarray(record["x"], dtype=float), y.astype(complex if np.iscomplexobj(y) else float), kind == 18,
        unit or _unit_of(int(record.get("ordinate_spec_data_type", 0)), units), str(path), f"of {name}",
        axis_unit or _AXES.get(kind, ""),
    )  # fmt: skip


def _unit_of(kind: int, units: Mapping[str, str]) -> str:
    """Unit of an ordinate by its specific data type; empty if unknown."""
    if kind == 13:
        return units.get("force", "")
    per_time = {8: "", 11: "/s", 12: "/s^2"}.get(kind)
    return units["length"] + per_time if per_time is not None and units.get("length") else ""


def _named(factor: Any, names: Mapping[float, str]) -> str:
    """Name of the unit of which an SI unit has so many; files state few digits."""
    value = float(factor or 0.0)
    return next((name for known, name in names.items() if abs(value / known - 1) < 1e-3), "")


TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn")
HDF5 = (".h5", ".hdf5", ".hdf")
UFF = (".uff", ".unv", ".uf", ".58")


def ending_of(path: Path) -> str:
    """The ending of a file, in small letters.

    Raises
    ------
    MeasurementError
        If the file is missing or empty.
    """
    if not path.is_file():
        raise MeasurementError("does not exist", "check the path; it is relative to the case's file")
    if path.stat().st_size == 0:
        raise MeasurementError("is empty", "export the measurement again")
    return path.suffix.lower()


def read_file(path: Path) -> list[MeasuredSignal]:
    """All channels of a file in its own units, columns of a table without an axis among them, each with a name of its
    own.

    Raises
    ------
    MeasurementError
        If the file is missing, empty, of an unknown format, damaged, or has cells that are no numbers.
    """
    ending = ending_of(path)
    readers = {**dict.fromkeys(TEXT, read_csv), **dict.fromkeys(HDF5, read_hdf5), **dict.fromkeys(UFF, read_uff)}
    reader = readers.get(ending)
    if reader is None:
        raise MeasurementError("has an unknown format", "use .csv, .h5 or .uff")
    try:
        signals = reader(path)
    except OSError as error:
        raise MeasurementError(f"cannot be read ({error.strerror or error})", "check the path") from None
    return _told_apart(signals, (f"({number})" for number in range(1, len(signals) + 1)))
