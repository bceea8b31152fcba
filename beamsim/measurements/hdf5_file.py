"""Channels in HDF5 files, beamsim's own among them: data sets of one dimension, and what is measured along them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.measurements.headings import is_frequency, is_time, label_of, split_heading, stated
from beamsim.measurements.signal import MeasuredSignal, MeasurementError

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
            return [_signal(name, item, found, path) for name, item in found.items()]
        except ValueError as error:
            raise MeasurementError(f"is damaged: {error}", "export the measurement again") from None


def _signal(name: str, item: h5py.Dataset, found: dict[str, h5py.Dataset], path: Path) -> MeasuredSignal:
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
