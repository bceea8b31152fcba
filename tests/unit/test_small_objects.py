"""Datasets and texts that are made through the low-level interface are those that h5py makes."""

import h5py
import numpy as np
import pytest

from beamsim.store.small_objects import COMPACT_BYTES, TEXT, create_dataset, set_text

VALUES = {
    "number": np.array(2.5),
    "numbers": np.linspace(0.0, 1.0, 7),
    "columns": np.arange(12).reshape(3, 4).T,  # not contiguous
    "flags": np.array([True, False]),
    "bytes": np.array([0, 1], dtype=np.uint8),
    "empty": np.zeros(0),
    "texts": np.array(["tip", "Träger"], dtype=TEXT),
    "long": np.zeros(COMPACT_BYTES),
}


@pytest.mark.parametrize("name", VALUES)
def test_the_same_as_by_h5py(tmp_path, name):
    with h5py.File(tmp_path / "file.h5", "w") as file:
        ours, theirs = create_dataset(file, f"a/b/{name}", VALUES[name]), file.create_dataset(name, data=VALUES[name])
        set_text(ours, "units", "µm")
        theirs.attrs["units"] = "µm"
        assert (ours.name, ours.shape, ours.dtype) == (f"/a/b/{name}", theirs.shape, theirs.dtype)
        assert ours.id.get_type() == theirs.id.get_type()
        assert np.array_equal(ours[()], theirs[()])
        assert ours.attrs["units"] == "µm"
        assert ours.attrs.get_id("units").get_type() == theirs.attrs.get_id("units").get_type()


def test_small_datasets_stay_in_their_headers(tmp_path):
    with h5py.File(tmp_path / "file.h5", "w") as file:
        layouts = {name: create_dataset(file, name, VALUES[name]).id.get_create_plist().get_layout() for name in VALUES}
    assert layouts["numbers"] == h5py.h5d.COMPACT
    assert layouts["long"] == h5py.h5d.CONTIGUOUS
