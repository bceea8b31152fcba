"""Result files of every kind, kept from when the layout was settled: they open, and are written again as they were."""

import gzip
from functools import cache
from pathlib import Path
from pkgutil import resolve_name

import h5py
import numpy as np
import pytest

import beamsim
from beamsim.kinds import KINDS
from beamsim.store.results import SCHEMA_VERSION, kind_of

FOLDER = Path(__file__).parents[1] / "data" / "results"
FILES = sorted(FOLDER.glob("*.h5.gz"))
ONE_OF_EACH_KIND = ("coexisting", "compare", "compare_modes", "continuation", "designs", "identify_update", "nnm",
                    "run_random", "static", "sweep")  # fmt: skip
OF_HDF5 = {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}
OF_BYTES = {"checksum"}  # which kept files of earlier versions have


def described(path):
    """Everything a file says: attributes of groups, and of datasets also their values, types and axes."""
    told = {}

    def note(name, item):
        name = f"/{name}".rstrip("/") or "/"
        for key, value in item.attrs.items():
            if key not in OF_HDF5 | OF_BYTES:
                told[f"{name}@{key}"] = sorted(value.split()) if key == "json_encoded" else np.asarray(value).tolist()
        if isinstance(item, h5py.Dataset):
            text = h5py.check_string_dtype(item.dtype) is not None
            told[name] = np.asarray(item.asstr()[()], dtype=object) if text else np.asarray(item[()])
            axes = [[scale.name for scale in dimension.values()] for dimension in item.dims]
            told[f"{name} axes"] = item.is_scale, axes

    with h5py.File(path) as file:
        note("", file)
        file.visititems(note)
    return told


def unpacked(packed, folder):
    path = folder / packed.name.removesuffix(".gz")
    path.write_bytes(gzip.decompress(packed.read_bytes()))
    return path


@pytest.fixture(scope="module")
def keep(tmp_path_factory):
    """Gives the path of a kept file, its result, and the path of the file that is written from it now."""

    @cache
    def by_name(name):
        folder = tmp_path_factory.mktemp("kept")
        path = unpacked(FOLDER / f"{name}.h5.gz", folder)
        result = beamsim.load(path)
        return path, result, beamsim.write_result(result, folder / "again.h5")

    return by_name


@pytest.fixture(params=[path.name.partition(".")[0] for path in FILES])
def kept(request, keep):
    """What `keep` gives, of each kept file."""
    return keep(request.param)


def test_a_kept_file_is_written_again_as_it_was(kept):
    earlier, _, again = kept
    old, new = described(earlier), described(again)
    assert set(old) == set(new)
    for name in old:
        if isinstance(old[name], np.ndarray) and old[name].dtype != object:
            assert old[name].dtype == new[name].dtype, name
            round_off = 1e-11 if name.endswith(("_db", "_deg")) else 0.0  # of what is worked out again
            np.testing.assert_allclose(new[name], old[name], rtol=1e-13, atol=round_off, err_msg=name)
        else:
            np.testing.assert_equal(new[name], old[name], name)


def test_every_dataset_is_described_and_every_axis_has_its_scale(kept):
    def check(name, item):
        if isinstance(item, h5py.Dataset):
            assert isinstance(item.attrs["units"], str), name
            assert item.attrs["units"] or name == "peaks/level", name  # a level has the unit of its sweep
            assert item.attrs["long_name"], name
            assert item.dtype.kind in "fiuO", name  # no complex, no HDF5 enumerations
            for axis in range(0 if item.is_scale else item.ndim):
                (scale,) = item.dims[axis].values()
                assert scale.shape == (item.shape[axis],), name

    with h5py.File(kept[2]) as file:
        file.visititems(check)
        assert file.attrs["schema_version"] == SCHEMA_VERSION


@pytest.mark.filterwarnings("ignore:Duplicate dimension names")
@pytest.mark.parametrize("name", ONE_OF_EACH_KIND)
def test_xarray_opens_every_group_of_every_kind(name, keep):
    """That every axis of all files has its scale, by which xarray opens them, shows the test above."""
    xarray = pytest.importorskip("xarray")
    _, _, path = keep(name)
    with h5py.File(path) as file:
        groups = ["/"]
        file.visititems(lambda name, item: groups.append(f"/{name}") if isinstance(item, h5py.Group) else None)
    opened = xarray.open_groups(path, engine="h5netcdf", phony_dims="sort")
    assert set(opened) == set(groups)
    for dataset in opened.values():
        with dataset:
            dataset.load()


def test_there_is_a_file_of_every_kind(tmp_path):
    kinds = {packed.name.partition(".")[0]: kind_of(unpacked(packed, tmp_path)) for packed in FILES}
    assert sorted(kinds[name] for name in ONE_OF_EACH_KIND) == sorted(KINDS)
    assert {name: resolve_name(kind.result).KIND for name, kind in KINDS.items()} == {name: name for name in KINDS}
    assert max(path.stat().st_size for path in FILES) < 100_000


def test_every_number_of_the_summary_is_declared(kept):
    _, result, _ = kept
    declared = [quantity.name for quantity in type(result).SUMMARY]
    assert len(set(declared)) == len(declared)
    assert set(result.summary) <= set(declared)


def test_a_difference_is_seen(tmp_path):
    """The comparison fails where a unit, an axis, an attribute or a value is another."""
    smallest = min(FILES, key=lambda packed: packed.stat().st_size)
    path = unpacked(smallest, tmp_path)
    before = described(path)

    def differing(change):
        other = unpacked(smallest, tmp_path)
        with h5py.File(other, "a") as file:
            change(file)
        after = described(other)
        return [name for name, value in before.items() if not _equal(value, after[name])]

    assert differing(lambda file: None) == []
    name = next(name for name, value in before.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f")
    assert f"{name}@units" in differing(lambda file: file[name].attrs.modify("units", "furlong"))
    assert name in differing(lambda file: file[name].write_direct(np.full(file[name].shape, 7.0)))
    axes = next(name for name, value in before.items() if name.endswith(" axes") and value[1] and value[1][0])

    def detach(file):
        dimension = file[axes.removesuffix(" axes")].dims[0]
        dimension.detach_scale(dimension[0])

    assert axes in differing(detach)


def _equal(old, new):
    try:
        np.testing.assert_equal(new, old)
    except AssertionError:
        return False
    return True
