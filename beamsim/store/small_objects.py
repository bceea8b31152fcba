"""Datasets and texts as h5py writes them, at a third of its cost: files of many snubbers hold thousands of each."""

from __future__ import annotations

from functools import cache
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

TEXT = h5py.string_dtype("utf-8")
COMPACT_BYTES = 1024  # smaller datasets are kept in their header


def create_dataset(group: h5py.Group, name: str, values: NDArray[Any]) -> h5py.Dataset:
    """A dataset with its values, in groups that are made where they are missing."""
    if values.dtype.kind == "O" or not values.size:
        return group.create_dataset(name, data=values)
    space = h5py.h5s.create_simple(values.shape) if values.ndim else _scalar()
    new = h5py.h5d.create(
        group.id, name.encode(), _type(values.dtype), space, _layout(values.nbytes <= COMPACT_BYTES), _link()
    )  # fmt: skip
    new.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(values))
    return h5py.Dataset(new)


def set_text(owner: h5py.Group | h5py.Dataset, name: str, text: str) -> None:
    """A text as an attribute, which must be new."""
    attribute = h5py.h5a.create(owner.id, name.encode(), _type(TEXT), _scalar())
    attribute.write(np.array(text, dtype=TEXT))


@cache
def _type(dtype: np.dtype[Any]) -> h5py.h5t.TypeID:
    return h5py.h5t.py_create(dtype, logical=True)


@cache
def _scalar() -> h5py.h5s.SpaceID:
    return h5py.h5s.create(h5py.h5s.SCALAR)


@cache
def _layout(compact: bool) -> h5py.h5p.PropDCID:
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_obj_track_times(False)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    if compact:
        layout.set_layout(h5py.h5d.COMPACT)
    return layout


@cache
def _link() -> h5py.h5p.PropLCID:
    link = h5py.h5p.create(h5py.h5p.LINK_CREATE)
    link.set_create_intermediate_group(True)
    link.set_char_encoding(h5py.h5t.CSET_UTF8)
    return link
