"""Result files: what is written is read back, by us, by xarray, and by nobody when it is broken."""

import json
import os

import h5py
import pytest

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
