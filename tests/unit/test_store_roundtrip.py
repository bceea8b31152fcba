"""Result files: what is written is read back, by us, by xarray, and by nobody when it is broken."""

import dataclasses
import os

import h5py
import numpy as np
import pytest

from beamsim.errors import ResultFileError
from beamsim.files import check_writable, replacement_file
from beamsim.store.results import load, write_result

pytestmark = pytest.mark.quick


def test_long_scenario_fits(fabricated_run, tmp_path):
    fabricated = fabricated_run()

    class Long(type(fabricated.scenario)):
        def to_yaml(self):
            return super().to_yaml() + "# padding\n" * 200_000

    path = write_result(dataclasses.replace(fabricated, scenario=Long()), tmp_path / "long.h5")
    with h5py.File(path) as file:
        assert len(file.attrs["scenario"]) > 2_000_000
    assert load(path).scenario.title == fabricated.title


def test_a_result_that_was_read_is_one_like_any_other(fabricated_run, tmp_path):
    """It has its class, and what is replaced in it leaves the rest."""
    made = fabricated_run()
    read = load(write_result(made, tmp_path / "case.h5"))
    assert type(read) is type(made)
    replaced = dataclasses.replace(read, wall_time_s=2.0)
    assert (replaced.title, replaced.scenario, replaced.beamsim_version) == (made.title, read.scenario, "0.1.0")
    again = load(write_result(replaced, tmp_path / "again.h5"))
    assert (again.title, again.beamsim_version, again.wall_time_s) == (made.title, "0.1.0", 2.0)


def test_infinite_and_unknown_numbers_of_a_summary_come_back(fabricated_run, tmp_path):
    numbers = {"tip": np.inf, "root": np.nan, "middle": 1.0, "end": -np.inf}
    made = fabricated_run()
    made = dataclasses.replace(made, summary=made.summary | {"gapping_ratio": numbers})
    path = write_result(made, tmp_path / "case.h5")
    read = load(path).summary["gapping_ratio"]
    np.testing.assert_array_equal(list(read.values()), list(numbers.values()))
    with h5py.File(path) as file:  # standard JSON
        assert '"Infinity"' in file["summary"].attrs["gapping_ratio"]


def test_a_scenario_of_another_version_is_told_with_its_writer(fabricated_run, tmp_path):
    path = write_result(fabricated_run(), tmp_path / "case.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["scenario"] = file.attrs["scenario"] + "colour: red\n"
    with pytest.raises(ResultFileError, match=r"case\.h5: its scenario, written by beamsim 0\.1\.0, .*colour"):
        load(path)


def test_write_replaces_through_a_link_and_makes_the_folder(fabricated_run, tmp_path):
    real = tmp_path / "deep" / "real.h5"
    link = tmp_path / "link.h5"
    link.symlink_to(real)
    write_result(fabricated_run(), link)
    assert link.is_symlink()
    assert real.stat().st_size > 0
    assert load(link).complete


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
        with replacement_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert os.listdir(tmp_path) == []
