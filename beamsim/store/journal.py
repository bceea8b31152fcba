"""Journal of a design study: one line for each case solved, so that a killed study can be resumed.

The first line identifies the study, followed by a line of JSON for every case in the order of completion. Numbers are
read back without loss. An incomplete last line, from a process that was killed, is cut off.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from beamsim import __version__
from beamsim.analyses.designs.result import CaseOutcome
from beamsim.errors import ResultFileError
from beamsim.files import check_writable
from beamsim.outcomes import Outcome

LOCKED_BYTE = 2**30  # on Windows, which locks bytes: far beyond the contents


def journal_path(target: Path) -> Path:
    """Path of the journal, in the same folder as the result file."""
    return target.with_name(f"{target.name}.partial")


@contextmanager
def opened_journal(path: Path, fingerprint: str, *, resume: bool) -> Iterator[Journal]:
    """The journal of one study, for one process at a time.

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
    check_writable(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a+b") as file:
        _lock(file, path)
        yield Journal(path, file, _line({"study": f"{fingerprint} by beamsim {__version__}"}), resume=resume)


class Journal:
    """The cases of a study that are solved; see `opened_journal`."""

    def __init__(self, path: Path, file: IO[bytes], header: bytes, *, resume: bool) -> None:
        self.path, self._file = path, file
        self.outcomes: dict[int, CaseOutcome] = {}  # by index of the case
        self.dropped = 0  # solved cases of this study that are discarded without resume
        file.seek(0)
        lines = file.read().splitlines(keepends=True)
        known, size = _outcomes(lines[1:]) if lines[:1] == [header] else ({}, 0)
        if not resume:
            self.dropped = len(known)
        elif lines[:1] == [header]:
            self.outcomes = known
            file.truncate(len(header) + size)
            return
        elif lines and lines[0].endswith(b"\n"):
            raise ResultFileError(
                f"{path}: belongs to another study (the scenario, its values or the version of beamsim differ); "
                "leave out --resume to start again, or choose another path with -o"
            )
        file.truncate(0)
        self._write(header)

    def add(self, outcome: CaseOutcome) -> None:
        """Write one case."""
        self.outcomes[outcome.index] = outcome
        self._write(_line({**vars(outcome), "outcome": outcome.outcome.as_dict()}))

    def _write(self, line: bytes) -> None:
        self._file.write(line)
        self._file.flush()

    def remove(self) -> None:
        """Remove the journal once everything is in the result file."""
        self._file.close()  # Windows cannot remove open files
        self.path.unlink(missing_ok=True)


def _line(values: object) -> bytes:
    return f"{json.dumps(values, ensure_ascii=False)}\n".encode()


def _outcomes(lines: Iterable[bytes]) -> tuple[dict[int, CaseOutcome], int]:
    """The cases in lines up to the first that is incomplete, and their size in bytes."""
    outcomes, size = dict[int, CaseOutcome](), 0
    for line in lines:
        try:
            case = json.loads(line if line.endswith(b"\n") else b"")
            outcome = CaseOutcome(**{**case, "outcome": Outcome.from_dict(case["outcome"])})
        except (KeyError, TypeError, ValueError):
            break
        outcomes[outcome.index] = outcome
        size += len(line)
    return outcomes, size


def _lock(file: IO[bytes], path: Path) -> None:
    """Lock an open file for this process, if its system and file system have locks.

    Raises
    ------
    ResultFileError
        If another process has locked it.
    """
    try:
        try:
            import fcntl
        except ImportError:
            import msvcrt

            os.lseek(file.fileno(), LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        raise ResultFileError(
            f"{path}: another process is computing this study; wait for it, or choose another path with -o"
        ) from None
    except (ImportError, OSError):
        pass
