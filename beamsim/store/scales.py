"""Dimension scales of a dataset, read so that a damaged file is an error and not the end of the process."""

from __future__ import annotations

import h5py

LIST = "DIMENSION_LIST"  # attribute in which HDF5 keeps references to the scales


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
