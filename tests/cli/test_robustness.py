"""What a full disk, a closed pipe and odd places do to the command line: a sentence and a code, never a traceback."""

import errno
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
import pytest

import beamsim
from beamsim.errors import ResultFileError
from beamsim.labelled import Item
from beamsim.store import results as result_files
from tests.helpers.commands import invoke

CASE = """
chain: {masses: [1], springs: [1], dashpots: [0.1]}
excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 0.1 Hz}
run: {duration: 400 s, sample_rate: 20}
"""
PROGRAM = [sys.executable, "-c", "from beamsim.cli import main; main()"]


@pytest.fixture
def here(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE)
    return tmp_path


def run(here, *arguments, **how):
    # without the measurement of coverage, which writes a file of its own and complains where it cannot
    environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python itself leaves half a file on a full disk
    how = {"stdout": subprocess.PIPE, "env": environment, **how}
    return subprocess.run(
        [*PROGRAM, *arguments], cwd=here, stderr=subprocess.PIPE, text=True, timeout=120, check=False, **how
    )


def small_disk():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


@pytest.mark.skipif(os.name != "posix", reason="limits of file size are POSIX")
def test_a_full_disk_while_the_result_is_written(here):
    """HDF5 by itself ends the process with a segmentation fault here."""
    done = run(here, "run", "case.yaml", "--no-plots", "-q", preexec_fn=small_disk)
    assert done.returncode == 5, done.stderr
    assert done.stderr.startswith("beamsim: cannot write case.h5: ")
    assert "nor is there room in" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert os.listdir(here) == ["case.yaml"]


@pytest.mark.skipif(os.name != "posix", reason="limits of file size are POSIX")
@pytest.mark.parametrize(
    "command", ["export --format mat -o x.mat", "export --format uff -o x.uff", "report -o x.html"]
)
def test_a_full_disk_while_a_file_is_made_of_a_result(here, command):
    """Of a universal file the result was said to contradict itself, since pyuff raises an error of its own."""
    assert run(here, "run", "case.yaml", "--no-plots", "-q").returncode == 0
    name, *options = command.split()
    done = run(here, name, "case.h5", *options, preexec_fn=small_disk)
    assert done.returncode == 5, done.stderr
    assert done.stderr.splitlines()[-1].startswith(f"beamsim: cannot write {options[-1]}: ")
    assert sorted(os.listdir(here)) == ["case.h5", "case.yaml"]


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="needs posix_fallocate")
@pytest.mark.parametrize("full", [1, 2, 3])
def test_a_result_without_room_is_written_elsewhere(here, full, monkeypatch):
    """The first, the first two and all three of the folders are full: its own, the temporary and the home folder."""
    places = [here / name for name in ("own", "temporary", "home")]
    for place in places:
        place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(places[1]))
    monkeypatch.setenv("HOME", str(places[2]))
    reserve, tried = os.posix_fallocate, []

    def reserve_where_there_is_room(file, offset, size):
        tried.append(size)
        if len(tried) <= full:
            raise OSError(errno.ENOSPC, "No space left on device")
        reserve(file, offset, size)

    monkeypatch.setattr(os, "posix_fallocate", reserve_where_there_is_room)
    done = invoke("run", here / "case.yaml", "--no-plots", "-q", "-o", places[0])
    assert done.exit_code == 5, done.output
    assert f"cannot write {places[0] / 'case.h5'}: No space left on device (" in done.stderr
    written = [list(place.iterdir()) for place in places]
    if full == 3:
        assert written == [[], [], []]
        assert "the result is lost" in done.stderr
        return
    assert [len(files) for files in written] == [0, int(full == 1), int(full == 2)]
    elsewhere = written[full][0]
    assert f"mv {elsewhere} {places[0] / 'case.h5'}" in done.stderr
    assert beamsim.load(elsewhere).complete


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output(here):
    with open("/dev/full", "w") as full:
        done = run(here, "validate", "case.yaml", "--json", stdout=full)
    assert done.returncode == 2
    assert done.stderr.startswith("beamsim: cannot write the output: ")


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_nobody_reads_the_output(here):
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = run(here, "schema", stdout=writer)
    finally:
        os.close(writer)
    assert done.returncode == 141
    assert done.stderr == ""


def test_json_is_one_object_with_the_warnings_in_it(here):
    (here / "case.yaml").write_text(CASE.replace("frequency: 0.1 Hz", "frequency: 9 Hz"))  # sampled near its Nyquist
    done = run(here, "run", "case.yaml", "--no-plots", "--json")
    values = json.loads(done.stdout)
    assert values["status"] == "complete"
    mark = "beamsim: warning: "
    said = [line.removeprefix(mark) for line in done.stderr.splitlines() if line.startswith(mark)]
    assert said == values["warnings"]


class Stop(BaseException):
    """What a signal handler may raise at any moment."""


ITEMS = {"/": Item(), **{f"/a{k}": Item(array=np.zeros(10_000)) for k in range(20)}}


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), Stop()])
@pytest.mark.parametrize("after", [0, 3])
def test_whatever_happens_while_a_file_is_written_is_told_and_leaves_nothing(error, after, tmp_path, monkeypatch):
    made = []

    def create(*arguments):
        if len(made) == after:
            raise error
        made.append(arguments)
        return hdf5_create(*arguments)

    hdf5_create = result_files._create
    monkeypatch.setattr(result_files, "_create", create)
    expected = ResultFileError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected):
        result_files.write_items(ITEMS, tmp_path / "x.h5")
    assert os.listdir(tmp_path) == []
