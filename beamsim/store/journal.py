"""Cases solved so far, one line each, so that a killed design study goes on where it was.

The first line says which study it is; then comes a line of JSON for every case, in the order in which they were
solved. Numbers are written so that they read back as the same bits. A line that was being written when the process
was killed is dropped.
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

VERSION = 2
LOCKED_BYTE = 2**30
SYNCED_EVERY_S = 5.0  # a crash of the whole machine costs at most the cases of this time


def journal_path(target: Path) -> Path:
    """Where the journal of a result file is: beside it."""
    return target.with_name(f"{target.name}.partial")


class Journal:
    """The journal of one study; a context manager, used by one process at a time.

    Parameters
    ----------
    path : of the journal.
    fingerprint : of all that the cases' outcomes depend on.
    resume : go on with what is there; else begin anew.

    Raises
    ------
    ResultFileError
        When the file cannot be written, belongs to another study that was to be resumed, or is in use.
    """

    def __init__(self, path: Path, fingerprint: str, *, resume: bool) -> None:
        from beamsim.version import __version__

        self.path = path
        self.fingerprint = fingerprint = f"{fingerprint} by beamsim {__version__}"
        self.dropped = 0  # cases of this very study that are given up by beginning anew
        check_writable(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        found = _read(path)
        self.known: tuple[CaseOutcome, ...] = ()
        if found is not None and found[0] == fingerprint:
            self.known, self.dropped = (found[1], 0) if resume else ((), len(found[1]))
        elif found is not None and resume:
            raise ResultFileError(
                f"{path}: belongs to another study (the scenario, its values or the version of beamsim differ); "
                "leave out --resume to begin anew, or choose another place with -o"
            )
        self._file: IO[str] | None = None
        self._synced = 0.0

    def __enter__(self) -> Journal:
        with _exclusive(self.path):  # a process that computes this study keeps its journal
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
        """Remove the journal: everything is in the result file."""
        self.__exit__()  # Windows removes no open file
        self.path.unlink(missing_ok=True)


def _line(outcome: CaseOutcome) -> str:
    return json.dumps({**vars(outcome), "outcome": outcome.outcome.as_dict()}, ensure_ascii=False) + "\n"


def _read(path: Path) -> tuple[str, tuple[CaseOutcome, ...]] | None:
    """Fingerprint and outcomes of a journal; None where there is none that makes sense."""
    try:
        lines = path.read_bytes().split(b"\n")[:-1]  # what follows the last line break was cut off
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
    """Hold the lock of a journal that may exist already while it is replaced."""
    if not path.is_file():
        yield
        return
    with open(path, "a", encoding="utf-8") as file:
        held = _lock(file, path)
        if held:
            yield
    if not held:  # Windows replaces no open file
        yield


def _lock(file: IO[str], path: Path) -> bool:
    """Lock an open file; returns whether it may be replaced while the lock is held.

    Raises
    ------
    ResultFileError
        When another process has locked it.
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
            f"{path}: another process is computing this study; wait for it, or choose another place with -o"
        ) from None
    except OSError:  # a file system without locks
        pass
    return replaceable


def _locking() -> tuple[Callable[[int], object], bool]:
    """A function that locks a file descriptor, and whether a locked file may be replaced.

    Raises
    ------
    ImportError
        Where the system has no locks.
    """
    try:
        import fcntl
    except ImportError:
        import msvcrt  # Windows: locks a byte, far beyond what is written

        def take(descriptor: int) -> None:
            os.lseek(descriptor, LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]

        return take, False
    return lambda descriptor: fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB), True
