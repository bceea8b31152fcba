"""What a full disk, a closed pipe and odd places do to the command line: a sentence and a code, never a traceback."""

import errno
import io
import json
import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest

from beamsim.errors import ResultFileError
from beamsim.store import stored
from beamsim.store.stored import creating

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
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("beamsim: cannot write case.h5: ")
    assert len(done.stderr.splitlines()) == 1
    assert os.listdir(here) == ["case.yaml"]


def test_what_a_full_disk_did_not_take_is_read_back(tmp_path):
    """HDF5 reads names of events again in large files, and ended the process with a segmentation fault."""

    class Full(io.FileIO):
        def write(self, data):
            if self.tell() + len(data) > 100:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    with Full(tmp_path / "file", "w+b") as raw:
        sink = stored._Sink(raw)
        sink.write(b"a" * 90)
        sink.seek(80)
        sink.write(b"b" * 50)
        sink.seek(70)
        buffer = bytearray(b"x" * 70)
        assert sink.readinto(buffer) == 70
    assert buffer == b"a" * 10 + b"b" * 50 + bytes(10)
    assert sink.error.errno == errno.ENOSPC


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


def write_twenty(path):
    with creating(path) as file:
        for k in range(20):
            file[f"a{k}"] = np.zeros(10_000)


class Stop(BaseException):
    """What a signal handler may raise at any moment."""


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), Stop()])
@pytest.mark.parametrize("after", [0, 3])
def test_whatever_happens_while_hdf5_writes_is_told_and_leaves_nothing(error, after, tmp_path, monkeypatch):
    class Failing(stored._Sink):
        writes = 0

        def write(self, data):
            class File:
                def write(_, left):
                    raise error

                def tell(_):
                    return 0

            Failing.writes += 1
            if Failing.writes > after:
                self._file, kept = File(), self._file
                try:
                    return super().write(data)
                finally:
                    self._file = kept
            return super().write(data)

    monkeypatch.setattr(stored, "_Sink", Failing)
    expected = ResultFileError if isinstance(error, OSError) else type(error)
    with pytest.raises(expected):
        write_twenty(tmp_path / "x.h5")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["write", "truncate", "flush"])
def test_a_signal_anywhere_in_a_call_of_hdf5_ends_the_writing(number, name, tmp_path, monkeypatch):
    """Python runs a handler also before the first line of a method, where it can catch nothing itself."""

    class Signalled(stored._Sink):
        pending = True

        def write(self, data):
            return self._when("write", super().write, data)

        def truncate(self, size):
            return self._when("truncate", super().truncate, size)

        def flush(self):
            return self._when("flush", super().flush)

        def _when(self, method, call, *arguments):
            if method == name and Signalled.pending:
                Signalled.pending = False
                signal.raise_signal(number)
            return call(*arguments)

    def stop(*_):
        raise Stop

    monkeypatch.setattr(stored, "_Sink", Signalled)
    before = signal.signal(number, stop)
    try:
        with pytest.raises(Stop):
            write_twenty(tmp_path / "x.h5")
        assert signal.getsignal(number) is stop
    finally:
        signal.signal(number, before)
    assert not Signalled.pending
    assert os.listdir(tmp_path) == []


def test_writes_that_take_only_a_part_are_continued(tmp_path, monkeypatch):
    class Partial(stored._Sink):
        def __init__(self, file):
            class Slow:
                def write(_, left):
                    return file.write(left[: max(1, min(1000, len(left) // 2))])

                def __getattr__(_, name):
                    return getattr(file, name)

            super().__init__(Slow())

    monkeypatch.setattr(stored, "_Sink", Partial)
    values = np.random.default_rng(1).normal(size=50_000)
    with creating(tmp_path / "x.h5") as file:
        file["a"] = values
    with h5py.File(tmp_path / "x.h5") as file:
        np.testing.assert_array_equal(file["a"][()], values)
