"""Result files: what is written is read back, by us, by xarray, and by nobody when it is broken."""

import dataclasses
import os

import pytest

from beamsim.errors import ResultFileError
from beamsim.files import check_writable, replacing
from beamsim.store.results import open_result, write_result

pytestmark = pytest.mark.quick


def test_long_scenario_fits(fabricated_run, tmp_path):
    fabricated = fabricated_run()

    class Long(type(fabricated.scenario)):
        def to_yaml(self):
            return "title: long\n" + "# padding\n" * 200_000

    path = write_result(dataclasses.replace(fabricated, scenario=Long()), tmp_path / "long.h5")
    assert len(open_result(path).scenario_yaml) > 2_000_000


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
