"""HDF5 files of flat items: written completely or not at all, and read with a check of their axes."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from beamsim.errors import ResultFileError
from beamsim.files import replacing
from beamsim.measurements.read import scale_along
from beamsim.store.flat import Item, Items, last

TEXT = h5py.string_dtype("utf-8")
MAPPED_BYTES = 2**24  # larger arrays are read from the file where they are used
_OF_HDF5 = ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")
_ITEM_BYTES = 4096  # more than HDF5 takes for an item besides its values and texts


def write_items(items: Items, path: Path | str) -> None:
    """Write items to a file, which replaces ``path`` when it is complete.

    Raises
    ------
    ResultFileError
        If it cannot be written (no permission, disk full, a folder of that name).
    """
    with replacing(path) as temporary:
        _reserve(temporary, sum(map(_size, items.values())))
        with h5py.File(temporary, "w", alignment_threshold=_ITEM_BYTES, alignment_interval=8) as file:  # for maps
            for place, item in items.items():
                _create(file, place, item)
            for place, item in items.items():
                for k, axis in enumerate(item.axes):
                    file[place].dims[k].attach_scale(file[axis])


def _size(item: Item) -> int:
    texts = sum(len(value) for value in item.attributes.values() if isinstance(value, str))
    values = 0 if item.values is None else item.values.size * item.values.dtype.itemsize
    return values + 4 * texts + _ITEM_BYTES


def _reserve(path: Path, size: int) -> None:
    """Take and give back the room of a file on its disk: HDF5 ends the process where a disk is full.

    Raises
    ------
    OSError
        If there is not enough.
    """
    with open(path, "xb") as file:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):  # of file systems that cannot
                raise


def _create(file: h5py.File, place: str, item: Item) -> None:
    """Make the group or dataset of an item."""
    values = item.values
    if values is None:
        owner = file.require_group(place)
    else:
        array = np.asarray(values)
        if array.dtype.kind in "OU":
            array = array.astype(TEXT)
        owner = file.create_dataset(place, data=array.view(np.uint8) if array.dtype == np.bool_ else array)
    for name, value in item.attributes.items():
        owner.attrs[name] = value
    if item.scale:
        owner.make_scale(last(place))


def read_items(file: h5py.File) -> Items:
    """The items of an open file.

    Raises
    ------
    ValueError
        If an array is of another length than its axis, or neither of numbers nor of text.
    """
    items: Items = {"/": Item(_attributes(file))}
    scales: dict[int, str] = {}  # by address: to ask a scale for its name, HDF5 searches the file
    along: dict[str, list[int]] = {}

    def note(name: str, owner: h5py.Group | h5py.Dataset) -> None:
        place = f"/{name}"
        item = items[place] = Item(_attributes(owner))
        if isinstance(owner, h5py.Dataset):
            item.values, item.scale = _values(owner), owner.is_scale
            if item.scale:
                scales[_address(owner)] = place
            else:
                along[place] = [_address(scale_along(owner, k)) for k in range(owner.ndim)]

    file.visititems(note)
    for place, addresses in along.items():
        item = items[place]
        item.axes = tuple(scales.get(address, "") for address in addresses)
        for k, axis in enumerate(item.axes):
            if axis and items[axis].values.shape != item.values.shape[k : k + 1]:
                raise ValueError(f"{place} has {item.values.shape[k]} values along {axis}")
    return items


def _address(dataset: h5py.Dataset | None) -> int:
    """Where a dataset is in its file; -1 of none."""
    return -1 if dataset is None else int(h5py.h5o.get_info(dataset.id).addr)


def _attributes(owner: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    values = {name: owner.attrs[name] for name in owner.attrs if name not in _OF_HDF5}
    for value in values.values():
        for text in np.atleast_1d(value) if isinstance(value, np.ndarray) else (value,):
            if isinstance(text, str):
                text.encode()  # h5py reads bytes that are no UTF-8 as surrogates: the error says that they are damage
    return values


def _values(dataset: h5py.Dataset) -> Any:
    """The values: numbers, texts as objects, flags as truth values."""
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr()[()], dtype=object)
    if not np.issubdtype(dataset.dtype, np.number) and dataset.dtype != np.bool_:
        raise ValueError(f"{dataset.name} holds {dataset.dtype}, neither numbers nor text")
    offset = dataset.id.get_offset() if dataset.nbytes > MAPPED_BYTES else None
    if offset is None:
        values = np.asarray(dataset[()])
    else:
        values = np.memmap(dataset.file.filename, dataset.dtype, "c", offset, dataset.shape)
    flags = "flag_meanings" in dataset.attrs
    return values.view(np.bool_) if flags and values.dtype == np.uint8 else values


@contextmanager
def opened(path: Path | str, command: str = "run") -> Iterator[h5py.File]:
    """An HDF5 file, open for reading; errors in reading it are reported as its damage.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable or damaged; ``command`` is what writes such files.
    """
    place = Path(path)
    remedy = f"give the .h5 file that `beamsim {command}` wrote"
    try:
        if place.is_dir():
            raise ResultFileError(f"{path}: is a folder; {remedy}")
        if not place.exists():
            raise ResultFileError(f"{path}: no such result file; `beamsim {command} case.yaml` writes one")
        if not place.is_file():
            raise ResultFileError(f"{path}: not a regular file; {remedy}")
        file = h5py.File(place, "r")
    except PermissionError as error:
        raise ResultFileError(f"{path}: no permission to read it") from error
    except (OSError, ValueError) as error:
        raise ResultFileError(f"{path}: not an HDF5 file, or damaged; {remedy}, or run the case again") from error
    with file:
        try:
            yield file
        except (LookupError, ValueError, ArithmeticError, OSError, RuntimeError) as error:
            reason = str(error.args[0] if isinstance(error, KeyError) and error.args else error).partition("\n")[0]
            raise ResultFileError(f"{path}: damaged ({reason or type(error).__name__}); run the case again") from error
