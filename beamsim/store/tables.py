"""A result file of any kind as tables: datasets along the same dimension scales are columns of one table.

The dimension scales of the file define the tables: which datasets belong together, their axes and the units. A
dimension without a scale is numbered from 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from beamsim.dataclass import dataclass
from beamsim.measurements.hdf5_file import scale_along


@dataclass(frozen=True)
class Axis:
    """Axis of one dimension of a table."""

    path: str  # of the scale in the file, or empty
    name: str
    units: str
    long_name: str
    values: NDArray[Any]  # (n,)


@dataclass(frozen=True)
class Column:
    """One dataset of a table."""

    path: str
    name: str  # path from the group of the table to the dataset, ``probes/tip/peak_displacement``
    units: str
    long_name: str
    values: NDArray[Any]  # shape of the axes of the table


@dataclass(frozen=True)
class ExportTable:
    """Datasets along the same axes; scalars have no axis."""

    group: str  # path of the group of the table, without leading slash
    axes: tuple[Axis, ...]
    columns: list[Column] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Name of the file: the group and the axes."""
        where = self.group.replace("/", "_")
        along = "_and_".join(axis.name for axis in self.axes)
        if not self.axes:
            return f"{where}_values" if where else "values"
        return f"{where}_by_{along}" if where else f"by_{along}"


def tables_of(file: h5py.File) -> list[ExportTable]:
    """All datasets of a file except scales, as tables in the order of the file."""
    tables: dict[tuple[Any, ...], ExportTable] = {}
    for dataset in datasets(file):
        axes = tuple(_axis(dataset, k) for k in range(dataset.ndim))
        group = _owner(dataset, axes)
        key = (group, *((axis.path or (axis.name, axis.values.size)) for axis in axes))
        table = tables.setdefault(key, ExportTable(group, axes))
        name = dataset.name.removeprefix(f"/{group}").strip("/")
        units, long_name = (str(dataset.attrs.get(key, "")) for key in ("units", "long_name"))
        table.columns.append(Column(dataset.name, name, units, long_name, values_of(dataset)))
    return list(tables.values())


def datasets(group: h5py.Group) -> Iterator[h5py.Dataset]:
    """The datasets below a group except scales."""
    for item in group.values():
        if isinstance(item, h5py.Group):
            yield from datasets(item)
        elif not item.is_scale:
            yield item


def values_of(dataset: h5py.Dataset) -> NDArray[Any]:
    """Values as NumPy arrays: strings as objects, flags as Booleans."""
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr()[()], dtype=object)
    values = np.asarray(dataset[()])
    return values.astype(bool) if "flag_meanings" in dataset.attrs else values


def _axis(dataset: h5py.Dataset, k: int) -> Axis:
    scale = scale_along(dataset, k)
    if scale is None:
        number = np.arange(1, dataset.shape[k] + 1)
        return Axis("", "index" if k == 0 else f"index_{k + 1}", "1", "number along this dimension", number)
    units, long_name = (str(scale.attrs.get(key, "")) for key in ("units", "long_name"))
    return Axis(scale.name, scale.name.rpartition("/")[2], units, long_name, values_of(scale))


def _owner(dataset: h5py.Dataset, axes: tuple[Axis, ...]) -> str:
    """Group of the table of a dataset: that of the innermost of its scales, else its own."""
    parent = dataset.name.rpartition("/")[0]
    homes = [axis.path.rpartition("/")[0] for axis in axes if axis.path]
    above = [home for home in homes if f"{parent}/".startswith(f"{home}/")]
    return str(max(above, key=len) if above else parent).strip("/")
