"""What not every system has is simulated as absent, or as it is on Windows."""

import errno
import io
import os
import signal
import sys
from types import SimpleNamespace

import pytest

from beamsim import files
from beamsim.cases import CaseOutcome
from beamsim.cli import prepare_streams
from beamsim.cli.session import broken_pipe, discard_output, interruptible
from beamsim.errors import ResultFileError
from beamsim.parallel import default_workers
from beamsim.store.studies import LOCKED_BYTE, opened_journal

pytestmark = pytest.mark.quick


@pytest.fixture
def of_windows(monkeypatch):
    """Locks of Windows instead of those of POSIX; files that are locked."""
    locked = set()

    def locking(descriptor, mode, size):
        assert (os.lseek(descriptor, 0, os.SEEK_CUR), mode, size) == (LOCKED_BYTE, 2, 1)
        place = os.fstat(descriptor).st_ino
        if place in locked:
            raise PermissionError(errno.EACCES, "Permission denied")
        locked.add(place)

    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    return locked


def test_a_journal_is_locked_as_windows_does(of_windows, tmp_path):
    path = tmp_path / "case.h5.partial"
    with opened_journal(path, "print", resume=False) as journal:
        journal.add(CaseOutcome(0, {"bending_stress": 1.0}))
        with pytest.raises(ResultFileError, match="another process"), opened_journal(path, "print", resume=True):
            pass
        journal.add(CaseOutcome(1, {"bending_stress": 2.0}))
    of_windows.clear()  # closing a file unlocks it
    with opened_journal(path, "print", resume=True) as journal:
        assert list(journal.outcomes) == [0, 1]


def test_a_journal_without_locks(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", None)
    with opened_journal(tmp_path / "case.h5.partial", "print", resume=False) as journal:
        journal.add(CaseOutcome(0, {}))
    with opened_journal(journal.path, "print", resume=True) as again:
        assert len(again.outcomes) == 1


@pytest.mark.parametrize(("refusals", "succeeds"), [(2, True), (9, False)])
def test_a_file_that_is_being_read_is_replaced_a_little_later(refusals, succeeds, tmp_path, monkeypatch):
    left = [refusals]

    def replace(source, target, move=os.replace):
        if left[0]:
            left[0] -= 1
            raise PermissionError(errno.EACCES, "Permission denied")
        move(source, target)

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(os, "replace", replace)
    monkeypatch.setattr(files, "PAUSES_S", (0.0, 0.0, 0.0))
    target = tmp_path / "case.h5"
    target.write_text("old")

    def write():
        with files.replacement_file(target) as temporary:
            temporary.write_text("new")

    if succeeds:
        write()
    else:
        with pytest.raises(ResultFileError, match="cannot write"):
            write()
    assert target.read_text() == ("new" if succeeds else "old")
    assert os.listdir(tmp_path) == ["case.h5"]


def test_workers_where_processors_cannot_be_bound(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert default_workers() == 3
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert default_workers() == 1


def test_a_broken_pipe_of_windows(monkeypatch):
    invalid = OSError(errno.EINVAL, "Invalid argument")
    assert broken_pipe(BrokenPipeError())
    assert not broken_pipe(invalid)
    monkeypatch.setattr(sys, "platform", "win32")
    assert broken_pipe(invalid)
    assert not broken_pipe(OSError(errno.EINVAL, "Invalid argument", "case.h5"))


def test_output_is_discarded_without_a_file_behind_it(monkeypatch):
    monkeypatch.setattr(sys, "stdout", io.StringIO())  # which has no descriptor
    discard_output()
    print("nowhere")
    with monkeypatch.context() as without:
        without.delattr(os, "dup2")
        discard_output()
    print("nowhere")


def test_a_signal_that_another_language_handles_is_left_alone(monkeypatch):
    changed = []
    monkeypatch.setattr(signal, "getsignal", lambda number: None)
    monkeypatch.setattr(signal, "signal", lambda number, handler: changed.append(number))
    with interruptible() as interrupted:
        assert not interrupted()
    assert not changed


def test_streams_hold_every_character(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="cp1252")
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    prepare_streams()
    print("k ≥ 1 ∕ s, Größe, \ud800", file=stream, flush=True)
    written = stream.buffer.getvalue().decode(stream.encoding)
    assert r"\ud800" in written
    assert written.startswith("k")
