"""What ``-o`` may name: a file of the kind that is written, or a folder; never a folder called like another file."""

import shutil
from pathlib import Path

import pytest
from matplotlib.animation import FFMpegWriter

from tests.helpers.commands import invoke

CASE = """
chain: {masses: [1 kg], springs: [1 kN/m], snubbers: [{name: stop, mass: 1, side: below, gap: 1 mm, stiffness: 1e5}]}
excitation: {kind: harmonic, applied_to: base, frequency: 5 Hz, level: 2 g}
probes: [{name: mass, mass: 1}]
run: {duration: 0.2 s, sample_rate: 500 Hz, convergence: off}
"""


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    (folder / "case.yaml").write_text(CASE)
    done = invoke("run", folder / "case.yaml", "--no-plots", "-o", folder / "case.h5")
    assert done.exit_code == 0, done.output
    return folder


OF_FILES = "give a name that ends with {}, or a folder (one whose name has an ending must exist)"
OF_FOLDERS = "give a folder after -o (one whose name has an ending must exist)"
REFUSED = [
    (["run", "case.yaml"], "x.csv", OF_FILES.format(".h5 or .hdf5")),
    (["run", "case.yaml"], "x.YAML", OF_FILES.format(".h5 or .hdf5")),
    (["run", "case.yaml"], "below/x.png", OF_FILES.format(".h5 or .hdf5")),
    (["plot", "case.h5"], "x.png", OF_FOLDERS),
    (["plot", "case.h5", "--format", "pdf"], "x.pdf", OF_FOLDERS),
    (["validate", "case.yaml", "--sketch"], "x.png", OF_FOLDERS),
    (["report", "case.h5"], "x.pdf", OF_FILES.format(".html or .htm")),
    (["animate", "case.h5"], "x.avi", OF_FILES.format(".gif or .html or .htm or .mp4")),
    (["export", "case.h5", "--format", "mat"], "x.h5", OF_FILES.format(".mat")),
    (["export", "case.h5", "--format", "csv"], "x.xlsx", OF_FOLDERS),
    (["export-structure", "case.yaml"], "x.h5", OF_FILES.format(".op4 or .mat or .mtx or .npz")),
    (["schema"], "x.yaml", OF_FILES.format(".json")),
]  # fmt: skip


@pytest.mark.parametrize(("command", "name", "remedy"), REFUSED)
def test_a_name_with_the_ending_of_another_kind_is_refused(command, name, remedy, stored, tmp_path, monkeypatch):
    if command[0] == "report":
        pytest.importorskip("plotly")
    for file in stored.iterdir():
        shutil.copy(file, tmp_path)
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.chdir(tmp_path)
    done = invoke(*command, "-o", name)
    assert done.exit_code == 2, done.output
    assert f"cannot write {name}: files that end with {Path(name).suffix} are not written here; {remedy}" in done.output
    assert sorted(tmp_path.rglob("*")) == before


def test_folders_may_have_points_in_their_names(stored, tmp_path):
    """Twin: what is no ending of a file, and a folder that exists."""
    (tmp_path / "there.old").mkdir()
    for name in ("results.2026-11-30", "there.old", "v1.2", "new"):
        done = invoke("run", stored / "case.yaml", "--no-plots", "-o", tmp_path / name)
        assert done.exit_code == 0, done.output
        assert (tmp_path / name / "case.h5").is_file()


def test_a_file_is_no_folder(stored, tmp_path):
    (tmp_path / "taken").write_text("a file")
    done = invoke("run", stored / "case.yaml", "--no-plots", "-o", tmp_path / "taken")
    assert done.exit_code == 2
    assert f"{tmp_path / 'taken'} is not a folder" in done.output
    assert (tmp_path / "taken").read_text() == "a file"


def test_a_new_scenario_is_called_like_one(tmp_path):
    done = invoke("new", tmp_path / "x.h5")
    assert done.exit_code == 2
    assert "x.h5 is not a name of a scenario; give one that ends with .yaml" in done.output
    assert list(tmp_path.iterdir()) == []


def test_a_video_needs_ffmpeg(stored, tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    done = invoke("animate", stored / "case.h5", "-o", tmp_path / "x.mp4")
    assert done.exit_code == 2
    assert "a video needs the program ffmpeg, which is not found" in done.output
    assert "give a name that ends with .gif or .html" in done.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="ffmpeg is not installed")
def test_a_video_is_written(stored, tmp_path):
    done = invoke("animate", stored / "case.h5", "-o", tmp_path / "x.mp4")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "x.mp4").read_bytes()[4:8] == b"ftyp"
    assert [path.name for path in tmp_path.iterdir()] == ["x.mp4"]
