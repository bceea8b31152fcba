"""The Python of the documents runs as it is printed, on the results that the documents speak of."""

import contextlib
import io
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from shipped import config_path

import beamsim
from tests.helpers.solved import words_of

ROOT = Path(__file__).parents[2]
RUN, MODE = ("run", "configs/one_sided_65hz.yaml"), ("nnm", "configs/nnm_first.yaml")
SWEEP = words_of("sweep", config_path("sweep_one_sided_2g"))
GIVEN = {  # by document what its readers have already: result files, each with its command, and names
    "docs/before_after.md": ({}, {}),
    "docs/curves_of_special_points.md": ({}, {}),
    "docs/from_arrays.md": ({}, {}),
    "docs/measurements.md": ({}, {}),
    "docs/nonlinear_modes.md": ({}, {}),
    "docs/python.md": ({"nnm_first.h5": MODE}, {}),
    "docs/result_files.md": ({"case.h5": RUN}, {}),
    "docs/sensitivities.md": ({}, {"scenario": "configs/studies/sensitivities.yaml"}),
    "docs/statics.md": ({}, {}),
    "docs/studies.md": ({}, {}),
    "docs/sweeps.md": ({"case.h5": SWEEP}, {}),
}
LISTS = {"docs/identification.md"}  # of what one result or another has


def blocks(document):
    return re.findall(r"```python\n(.*?)```", (ROOT / document).read_text(encoding="utf-8"), re.S)


def test_every_document_with_python_is_run():
    found = {path.relative_to(ROOT).as_posix() for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]}
    assert {document for document in found if blocks(document)} - LISTS == GIVEN.keys()


@pytest.mark.parametrize("document", GIVEN)
def test_python_of_a_document_runs_as_printed(document, solve, tmp_path, monkeypatch):
    for module in ("xarray", "h5netcdf"):
        pytest.importorskip(module)
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    files, names = GIVEN[document]
    for name, command in files.items():
        done = solve(*command)
        assert done.exit_code == 0, done.output
        shutil.copy(done.file, name)
    known = {"beamsim": beamsim, **{name: beamsim.load_scenario(path) for name, path in names.items()}}
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in blocks(document):
            exec(compile(block, document, "exec"), known)
    if document == "docs/result_files.md":
        end, largest = map(float, printed.getvalue().splitlines()[0].split())
        assert end == 0.8
        assert (
            largest
            == known["beamsim"].load("case.h5")["histories"]["displacement"].sel(probe="tip").values[14000:].max()
        )
        assert known["tip"].dims == ("time",)
        np.testing.assert_allclose(np.diff(known["tip"].time.values), 5e-5, atol=1e-12)
