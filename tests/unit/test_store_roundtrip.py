"""Result files: what is written is read back, by us, by xarray, and by nobody when it is broken."""

import dataclasses
import json
import math
import os

import h5py
import numpy as np
import pytest

import beamsim
from beamsim.errors import ResultFileError
from beamsim.files import check_writable, replacing
from beamsim.store.results import SCHEMA_VERSION, open_result, write_result

pytestmark = pytest.mark.quick

ROOT_ATTRIBUTES = (
    "base_unit",
    "schema_version",
    "beamsim_version",
    "command",
    "scenario",
    "title",
    "method",
    "status",
    "outcome",
    "outcome_numbers",
    "created",
    "wall_time_s",
    "warnings",
    "provenance",
    "probes",
    "snubbers",
    "spectra",
    "springs",
    "friction",
    "outputs",
    "named_bodies",
    "fatigue",
)


def assert_same(a, b, path="result"):
    if dataclasses.is_dataclass(a):
        assert type(a) is type(b), path
        for field in dataclasses.fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{path}.{field.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), path
        for key in a:
            assert_same(a[key], b[key], f"{path}[{key}]")
    elif isinstance(a, (list, tuple)):
        assert len(a) == len(b), path
        for k, (one, other) in enumerate(zip(a, b, strict=True)):
            assert_same(one, other, f"{path}[{k}]")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, path
        np.testing.assert_array_equal(a, b, path)
    elif isinstance(a, float) and math.isnan(a):
        assert math.isnan(b), path
    else:
        assert type(a) is type(b), path
        assert a == b, path


CASES = {
    "beam": {},
    "no snubbers": {"snubbers": ()},
    "many": {"snubbers": ("b", "a", "c/d", "..", "é è"), "probes": ("lines", "frequency_hz", "z/y")},
    "chain": {"chain": True},
    "free": {"frequency": math.nan},
}


@pytest.mark.parametrize("case", CASES)
def test_round_trip(case, fabricated_run, tmp_path):
    result = fabricated_run(**CASES[case])
    path = write_result(result, tmp_path / "case.h5")
    read = beamsim.open_result(path)
    for field in dataclasses.fields(result):
        if field.name == "spectra":
            assert set(read.spectra) == set(result.spectra)
            for key in result.spectra:
                assert_same(result.spectra[key], read.spectra[key], str(key))
        elif field.name == "summary":
            assert read.summary.keys() == result.summary.keys()
            for key in result.summary:
                assert_same(result.summary[key], read.summary[key], key)
        elif field.name != "scenario":
            assert_same(getattr(result, field.name), getattr(read, field.name), field.name)
    assert read.title == result.title
    assert read.scenario_yaml == result.scenario.to_yaml()
    assert read.complete
    assert sorted(os.listdir(tmp_path)) == ["case.h5"]


def test_every_dataset_is_described_and_every_axis_has_its_scale(fabricated_run, tmp_path):
    path = write_result(fabricated_run(snubbers=("a", "b")), tmp_path / "case.h5")
    seen = []

    def check(name, item):
        if isinstance(item, h5py.Dataset):
            seen.append(name)
            assert isinstance(item.attrs["units"], str), name
            assert item.attrs["units"], name
            assert item.attrs["long_name"], name
            assert item.dtype.kind in "fiuO", name  # no complex, no HDF5 enumerations
            if not item.is_scale:
                for axis in range(item.ndim):
                    (scale,) = item.dims[axis].values()
                    assert scale.shape == (item.shape[axis],), name

    with h5py.File(path) as file:
        file.visititems(check)
        assert set(ROOT_ATTRIBUTES) == set(file.attrs)
        assert file.attrs["schema_version"] == SCHEMA_VERSION
        assert file.attrs["command"] == "run"
        assert json.loads(file["summary"].attrs["peak_force_n"]) == {"a": 15.11, "b": 15.11}
        assert file["summary"].attrs["energy_error"] == 3e-13
        assert list(file["snubbers/a/closed"].attrs["flag_values"]) == [0, 1]
    for name in (
        "time", "probes/tip/displacement", "probes/tip/absolute_displacement", "probes/tip/velocity",
        "probes/tip/absolute_acceleration", "snubbers/a/force", "snubbers/a/penetration", "snubbers/a/closed",
        "events/time", "events/snubber", "events/closing", "spectra/tip/frequency_hz", "spectra/tip/amplitude_db",
        "spectra/tip/amplitude", "spectra/tip/displacement/amplitude", "beam/position", "beam/peak_bending_stress",
        "energy/work_in", "energy/dissipated", "energy/stored", "modes/open_frequencies_hz",
        "modes/closed_frequencies_hz", "modes/shapes",
    ):  # fmt: skip
        assert name in seen


def test_write_replaces_through_a_link_and_makes_the_folder(fabricated_run, tmp_path):
    real = tmp_path / "deep" / "real.h5"
    link = tmp_path / "link.h5"
    link.symlink_to(real)
    write_result(fabricated_run(), link)
    assert link.is_symlink()
    assert real.stat().st_size > 0
    assert open_result(link).complete


def test_places_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("x")
    with pytest.raises(ResultFileError, match="is a folder"):
        check_writable(tmp_path)
    with pytest.raises(ResultFileError, match="not a folder"):
        check_writable(tmp_path / "file" / "case.h5")
    with pytest.raises(ResultFileError, match="not a regular file"):
        check_writable("/dev/null")

    def denied(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.touch", denied)
    with pytest.raises(
        ResultFileError, match=r"no file can be made in .* \(Permission denied\); choose another folder"
    ):
        check_writable(tmp_path / "case.h5")
    check_writable_is_side_effect_free = os.listdir(tmp_path)
    assert check_writable_is_side_effect_free == ["file"]


def test_replacing_keeps_nothing_of_an_interrupted_block(tmp_path):
    def interrupted():
        with replacing(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert os.listdir(tmp_path) == []
