"""Journal of a design study: one line for each case solved, so that a killed study can be resumed.

The first line identifies the study, followed by a line of JSON for every case in the order of completion. Numbers are
read back without loss. An incomplete last line, from a process that was killed, is ignored.
"""

from __future__ import annotations

import json
import os
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from beamsim.analyses.designs.result import CaseOutcome
from beamsim.errors import ResultFileError
from beamsim.files import check_writable, replacing
from beamsim.outcomes import Outcome
from beamsim.version import __version__

VERSION = 2
LOCKED_BYTE = 2**30
SYNCED_EVERY_S = 5.0  # a crash of the machine loses at most the cases of this time


def journal_path(target: Path) -> Path:
    """Path of the journal, in the same folder as the result file."""
    return target.with_name(f"{target.name}.partial")


class Journal:
    """The journal of one study; a context manager, used by one process at a time.

    Parameters
    ----------
    path : of the journal.
    fingerprint : hash of everything that the outcomes of the cases depend on.
    resume : keep the cases already solved; else start again.

    Raises
    ------
    ResultFileError
        If the file cannot be written, belongs to another study than the one to be resumed, or is in use.
    """

    def __init__(self, path: Path, fingerprint: str, *, resume: bool) -> None:
        self.path = path
        self.fingerprint = fingerprint = f"{fingerprint} by beamsim {__version__}"
        self.dropped = 0  # solved cases of this study that are discarded without resume
        check_writable(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        stored = _read(path)
        self.known: tuple[CaseOutcome, ...] = ()
        if stored is not None and stored[0] == fingerprint:
            self.known, self.dropped = (stored[1], 0) if resume else ((), len(stored[1]))
        elif stored is not None and resume:
            raise ResultFileError(
                f"{path}: belongs to another study (the scenario, its values or the version of beamsim differ); "
                "leave out --resume to start again, or choose another path with -o"
            )
        self._file: IO[str] | None = None
        self._synced = 0.0

    def __enter__(self) -> Journal:
        with _exclusive(self.path):  # another process may be computing this study
            with replacing(self.path) as temporary, open(temporary, "w", encoding="utf-8") as file:
                header = {"beamsim_journal": VERSION, "fingerprint": self.fingerprint}
                file.write(json.dumps(header) + "\n")
                file.writelines(_line(outcome) for outcome in self.known)
            self._file = open(self.path, "a", encoding="utf-8")
        _lock(self._file, self.path)
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def add(self, outcome: CaseOutcome) -> None:
        """Write one case."""
        assert self._file is not None
        self._file.write(_line(outcome))
        self._file.flush()
        if clock.monotonic() - self._synced > SYNCED_EVERY_S:
            os.fsync(self._file.fileno())
            self._synced = clock.monotonic()

    def remove(self) -> None:
        """Remove the journal once everything is in the result file."""
        self.__exit__()  # Windows cannot remove open files
        self.path.unlink(missing_ok=True)


def _line(outcome: CaseOutcome) -> str:
    return json.dumps({**vars(outcome), "outcome": outcome.outcome.as_dict()}, ensure_ascii=False) + "\n"


def _read(path: Path) -> tuple[str, tuple[CaseOutcome, ...]] | None:
    """Fingerprint and outcomes of a journal; None if it is missing or unreadable."""
    try:
        lines = path.read_bytes().split(b"\n")[:-1]  # text after the last line break is incomplete
    except OSError:
        return None
    try:
        header = json.loads(lines[0])
        if header["beamsim_journal"] != VERSION:
            return None
    except (IndexError, KeyError, TypeError, ValueError):
        return None
    outcomes: dict[int, CaseOutcome] = {}
    for line in lines[1:]:
        try:
            case = json.loads(line)
            outcome = CaseOutcome(**{**case, "outcome": Outcome.from_dict(case["outcome"])})
        except (KeyError, TypeError, ValueError):
            break
        outcomes[outcome.index] = outcome
    return str(header["fingerprint"]), tuple(outcomes.values())


@contextmanager
def _exclusive(path: Path) -> Iterator[None]:
    """Lock a journal, if it exists, while it is replaced."""
    if not path.is_file():
        yield
        return
    with open(path, "a", encoding="utf-8") as file:
        held = _lock(file, path)
        if held:
            yield
    if not held:  # Windows cannot replace open files
        yield


def _lock(file: IO[str], path: Path) -> bool:
    """Lock an open file; returns whether it may be replaced while the lock is held.

    Raises
    ------
    ResultFileError
        If another process has locked it.
    """
    try:
        take, replaceable = _locking()
    except ImportError:  # a system without locks
        return False
    try:
        take(file.fileno())
    except (BlockingIOError, PermissionError):
        file.close()
        raise ResultFileError(
            f"{path}: another process is computing this study; wait for it, or choose another path with -o"
        ) from None
    except OSError:  # a file system without locks
        pass
    return replaceable


def _locking() -> tuple[Callable[[int], object], bool]:
    """A function that locks a file descriptor, and whether a locked file may be replaced.

    Raises
    ------
    ImportError
        If the system has no locks.
    """
    try:
        import fcntl
    except ImportError:
        import msvcrt  # Windows: locks one byte, far beyond the contents

        def take(descriptor: int) -> None:
            os.lseek(descriptor, LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]

        return take, False
    return lambda descriptor: fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB), True
