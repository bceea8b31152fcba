"""Datasets that no dataclass declares: those of design studies, whose responses are known only when they run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from beamsim.store.schema import Field


def put(group: h5py.Group, field: Field, values: Any, *scales: h5py.Dataset, scale: bool = False) -> h5py.Dataset:
    """A dataset with units and long name, along dimension scales, or as one; truth values with their meanings."""
    values = np.asarray(values)
    if field.flags is not None:
        values = values.astype(np.uint8)
    dataset = group.create_dataset(field.name, data=values)
    dataset.attrs.update({"units": field.units, "long_name": field.long_name})
    if field.flags is not None:
        dataset.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
        dataset.attrs["flag_meanings"] = " ".join(field.flags)
    if scale:
        dataset.make_scale(field.name)
    for axis, dimension in enumerate(scales):
        dataset.dims[axis].attach_scale(dimension)
    return dataset


def ordered(parent: h5py.Group, folder: str, *, required: bool = False) -> list[h5py.Group]:
    """The groups in `folder` in the order of the scenario; none where there is no such folder, unless it is required.

    Raises
    ------
    KeyError
        Where a required folder is missing or has no group.
    """
    groups = sorted(parent[folder].values(), key=lambda group: int(group.attrs["index"])) if folder in parent else []
    if required and not groups:
        raise KeyError(f"{parent.name}{folder} is missing")
    return groups


def native(owner: h5py.Group | h5py.Dataset, *names: str) -> dict[str, Any]:
    """Attributes as Python values, all of them where none is named."""
    return {
        name: value.item() if isinstance(value := owner.attrs[name], np.generic) else value
        for name in names or owner.attrs
    }


def texts(dataset: h5py.Dataset) -> list[str]:
    """The words of a dataset."""
    return [str(text) for text in dataset.asstr()[()]]


def words(values: Iterable[str]) -> NDArray[np.object_]:
    """Texts as `put` takes them."""
    return np.array(list(values), dtype=h5py.string_dtype("utf-8"))
