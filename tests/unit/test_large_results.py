"""Large arrays of result files: read when they are used, in part or whole, and never from another file."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pkgutil import resolve_name

import h5py
import numpy as np
import pytest

from beamsim.errors import ResultFileError
from beamsim.kinds import KINDS
from beamsim.labelled import LabelledArray
from beamsim.store import results
from beamsim.store.export import export_result
from beamsim.store.results import StoredArray, items_of, load, open_with_items, write_result

SAMPLES = 4001
LARGE = 20_000  # bytes of an array, in place of 1 MiB


@pytest.fixture
def long_run(fabricated_run, tmp_path, monkeypatch):
    """File of a run with large arrays, and the run."""
    monkeypatch.setattr(results, "CHUNK_BYTES", LARGE)
    run = fabricated_run()
    assert run["histories"]["time"].values.size == SAMPLES
    run.summary.pop("spectral_lines")  # which have not all that the table shows
    return write_result(run, tmp_path / "long.h5"), run


@pytest.fixture
def read_bytes(monkeypatch):
    """Bytes of the arrays that are read from files, by name of the dataset."""
    counted = {}
    read = h5py.Dataset.__getitem__

    def counting(dataset, index, *more):
        values = read(dataset, index, *more)
        counted[dataset.name] = counted.get(dataset.name, 0) + np.asarray(values).nbytes
        return values

    monkeypatch.setattr(h5py.Dataset, "__getitem__", counting)
    return counted


def large(counted):
    """The arrays of which more than a sample was read, and how often."""
    return {name: size / (8 * SAMPLES) for name, size in counted.items() if size > LARGE}


def test_values_are_read_once_when_they_are_used(long_run, read_bytes):
    path, run = long_run
    result = load(path)
    assert large(read_bytes) == {}
    for _ in range(2):
        np.testing.assert_array_equal(
            result["histories"]["velocity"].sel(probe="tip").values,
            run["histories"]["velocity"].sel(probe="tip").values,
        )
    assert large(read_bytes) == {"/histories/velocity": 1.0}
    assert "low_passed_acceleration" not in result["histories"]


def test_a_part_of_a_part_is_that_of_its_place(long_run):
    path, run = long_run
    whole = run["histories"]["displacement"].sel(probe="tip").values
    time = float(run["histories"]["time"].values[700])
    assert load(path)["histories"]["displacement"].sel(probe="tip").sel(time=time).item() == whole[700]
    part = load(path)["histories"].isel(time=slice(500, 900))
    np.testing.assert_array_equal(part["displacement"].sel(probe="tip").values, whole[500:900])
    assert part["displacement"].sel(probe="tip", time=time).item() == whole[700]


def test_info_reads_no_large_array(long_run, read_bytes):
    result = load(long_run[0])
    assert "peak" in str(result)
    assert large(read_bytes).keys() <= {"/histories/time"}


def test_plots_read_what_they_draw(long_run, read_bytes):
    path, run = long_run
    result = load(path)
    pictures = resolve_name(KINDS["run"].figures)(result)
    read = large(read_bytes)
    assert "displacement" in pictures
    assert len(run["histories"].labels("probe")) == 2
    for times_read in read.values():  # once for each place, and single samples before
        assert 0.0 <= times_read % 1.0 <= 3 / SAMPLES
        assert times_read < 2.1
    drawn = {f"/histories/{of}" for of in ("displacement", "absolute_acceleration")}
    assert drawn <= read.keys()
    unused = {
        f"/histories/{name}"
        for name in ("energy_work_in", "energy_stored", "absolute_displacement", "base_displacement")
    }
    assert not unused & read.keys()


def same(one, other):
    """Whether two values hold the same, whatever they are made of."""
    if is_dataclass(one) and not isinstance(one, LabelledArray):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one) if f.name != "scenario")
    if isinstance(one, LabelledArray):
        return (one.dims, one.unit, one.meaning) == (other.dims, other.unit, other.meaning) and same(
            one.values, other.values
        )
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        numbers = one.dtype.kind in "fc"
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=numbers)
    return one == other or (one != one and other != other)


def test_results_are_the_same_whichever_arrays_are_large(fabricated_run, tmp_path, monkeypatch):
    path = write_result(fabricated_run(rate=1e3), tmp_path / "case.h5")
    read_at_once = load(path)
    monkeypatch.setattr(results, "CHUNK_BYTES", 200)
    path = write_result(fabricated_run(rate=1e3), tmp_path / "case.h5")
    result, items = open_with_items(path)
    stored = [item for item in items.values() if isinstance(item.array, StoredArray)]
    assert len(stored) > 30
    assert {item.array.dtype.kind for item in stored} == {"b", "f", "i"}
    assert all(item.values.dtype == item.array.dtype and item.values.nbytes == item.array.nbytes for item in stored)
    assert same(result, read_at_once)
    assert same(*(items_of(each)["/histories/velocity"].values for each in (result, read_at_once)))


def test_exports_are_the_same_whichever_arrays_are_large(fabricated_run, tmp_path, monkeypatch):
    path = write_result(fabricated_run(rate=1e3), tmp_path / "case.h5")
    tables = export_result(path, tmp_path / "whole", "csv")
    monkeypatch.setattr(results, "CHUNK_BYTES", 200)
    monkeypatch.setattr("beamsim.store.export.ROWS_AT_ONCE", 150)
    write_result(fabricated_run(rate=1e3), path)
    again = export_result(path, tmp_path / "again", "csv")
    assert len(tables) == len(again)
    for one, other in zip(tables, again, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_file_that_was_replaced_is_not_read_any_more(long_run, fabricated_run):
    path, run = long_run
    whole, result = load(path, whole=True), load(path)
    force = result["histories"]["snubber_force"].sel(snubber="tip").values
    write_result(fabricated_run(), path)
    assert result["histories"]["snubber_force"].sel(snubber="tip").values is force
    with pytest.raises(ResultFileError, match=r"long\.h5: has changed since it was opened; open it again"):
        _ = result["histories"]["velocity"].sel(probe="tip").values
    np.testing.assert_array_equal(
        whole["histories"]["velocity"].sel(probe="tip").values, run["histories"]["velocity"].sel(probe="tip").values
    )
    path.unlink()
    with pytest.raises(ResultFileError, match=r"long\.h5: no such result file"):
        _ = result["histories"]["velocity"].sel(probe="tip").values


def test_a_result_is_written_over_its_own_file(long_run):
    path, run = long_run
    result = load(path)
    write_result(replace(result, wall_time_s=3.0), path)
    again = load(path)
    assert again.wall_time_s == 3.0
    for each in (again, result):
        np.testing.assert_array_equal(
            each["histories"]["velocity"].sel(probe="tip").values, run["histories"]["velocity"].sel(probe="tip").values
        )


def test_damage_in_a_large_array_is_found_before_it_is_used(long_run):
    path, _ = long_run
    with h5py.File(path) as file:
        at = file["/histories/velocity"].id.get_chunk_info(0).byte_offset
    data = bytearray(path.read_bytes())
    data[at + 1000] ^= 1
    path.write_bytes(data)
    with pytest.raises(ResultFileError, match=r"long\.h5: damaged \(it was changed after it was written\)"):
        load(path)
