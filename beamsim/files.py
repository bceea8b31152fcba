"""Files that are either old or new, never half-written."""

from __future__ import annotations

import os
import platform
import secrets
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import IO

from beamsim.errors import NotWrittenError, ResultFileError

PAUSES_S = (0.1, 0.3, 1.0)  # between attempts to replace a file that another program has open


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, which takes its place when the block succeeds.

    On any failure, an interrupt included, the temporary file goes and an existing file stays as it
    was. The folder is made if it is missing. A symbolic link is followed.

    Raises
    ------
    ResultFileError
        When the place cannot be written.
    NotWrittenError
        When it could be, and then is full or fails.
    """
    check_writable(path)
    target = Path(path).resolve()
    temporary = _temporary_in(target.parent)
    _remove_abandoned(target.parent)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        with open(temporary, "rb+") as written:
            os.fsync(written.fileno())
        _replace(temporary, target)
    except OSError as error:
        raise NotWrittenError(path, error.strerror or str(error)) from error
    finally:
        _remove(temporary)


def move_aside(path: Path, file: IO[bytes] | None = None) -> Path:
    """Rename a file to the first free name of ``path.1``, ``path.2``, ..., so that nothing in it is lost.

    Parameters
    ----------
    path : of the file.
    file : closed first, on systems that cannot rename open files.

    Returns
    -------
    The new name.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    if file is not None:
        file.close()
    free = next(aside for k in count(1) if not (aside := path.with_name(f"{path.name}.{k}")).exists())
    os.rename(path, free)
    return free


@cache
def _machine() -> str:
    """An identifier of this machine, or this container, among those that write to the same folder."""
    with suppress(OSError):  # process numbers are those of a container
        return sha256(f"{platform.node()} {os.readlink('/proc/self/ns/pid')}".encode()).hexdigest()[:12]
    return sha256(platform.node().encode()).hexdigest()[:12]


def _temporary_in(folder: Path) -> Path:
    """A name for a temporary file, which says which process of which machine writes it."""
    return folder / f".beamsim-{_machine()}-{os.getpid()}-{secrets.token_hex(6)}.tmp"


def _remove_abandoned(folder: Path) -> None:
    """Remove the temporary files of processes of this machine that were killed; those of other machines stay."""
    if sys.platform == "win32":  # which has no harmless way to ask for a process
        return
    with suppress(OSError):
        for path in folder.glob(f".beamsim-{_machine()}-*-*.tmp"):
            process = path.name.split("-")[2]
            if process.isdecimal() and not _runs(int(process)):
                _remove(path)


def _runs(process: int) -> bool:
    """Whether a process of this machine exists."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it belongs to another user
        return True
    return True


_PROTECTED: ContextVar[tuple[Path, ...] | None] = ContextVar("protected", default=None)


@contextmanager
def protecting(paths: Iterable[Path]) -> Iterator[None]:
    """Refuse within the block to write over these files, and those of `protect`, by whatever name or link."""
    before = _PROTECTED.set(tuple(paths))
    try:
        yield
    finally:
        _PROTECTED.reset(before)


def protect(path: Path) -> None:
    """Add a file that a command reads to those that `protecting` protects; without effect outside of its block."""
    protected = _PROTECTED.get()
    if protected is not None:
        _PROTECTED.set((*protected, path.absolute()))


def _refuse_protected(target: Path, path: Path | str) -> None:
    for file in _PROTECTED.get() or ():
        with suppress(OSError):
            if target.exists() and target.samefile(file):
                raise ResultFileError(f"cannot write {path}: this command reads that file; choose another path with -o")


def _remove(path: Path) -> None:
    """Remove a temporary file; where that fails, what went wrong before is the message."""
    with suppress(OSError):
        path.unlink(missing_ok=True)


def _replace(temporary: Path, target: Path) -> None:
    """Move a file to its place; Windows refuses that for a moment while another program reads what is there."""
    for pause in PAUSES_S:
        try:
            os.replace(temporary, target)
            return
        except PermissionError:
            if sys.platform != "win32":
                raise
            time.sleep(pause)
    os.replace(temporary, target)


def check_writable(path: Path | str) -> None:
    """Make sure, before a long computation, that the file could be written afterwards.

    Raises
    ------
    ResultFileError
        When it could not: a folder of that name, a folder without permission, a file where a folder should be.
    """
    try:
        target = Path(path).resolve()
        for part in (target, *target.parents):
            if part.is_symlink():  # which could not be followed
                part.stat()
        _check_writable(target, path)
    except RuntimeError as error:  # of Python before 3.13, where links lead back to each other; later an OSError
        raise ResultFileError(
            f"cannot write {path}: its links lead back to each other; choose another path with -o"
        ) from error
    except ValueError as error:  # a NUL in it, or a character that the file system's encoding lacks
        raise ResultFileError(
            f"cannot write {str(path)!a}: no file can have this name; choose another path with -o"
        ) from error
    except OSError as error:
        raise ResultFileError(f"cannot write {path}: {error.strerror or error}; choose another path with -o") from error


def _check_writable(target: Path, path: Path | str) -> None:
    if target.exists() and not target.is_file():
        kind = "a folder" if target.is_dir() else "not a regular file"
        raise ResultFileError(f"cannot write {path}: it is {kind}; choose another path with -o")
    _refuse_protected(target, path)
    folder = target.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise ResultFileError(f"cannot write {path}: {folder} is not a folder; choose another path with -o")
    probe = _temporary_in(folder)
    try:  # permissions alone do not tell (administrators, network drives, read-only mounts)
        probe.touch()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ResultFileError(
            f"cannot write {path}: no file can be made in {folder} ({reason}); choose another folder with -o"
        ) from error
    finally:
        _remove(probe)


def output_file(output: Path | None, stem: str, *suffixes: str) -> Path:
    """File named by ``-o``: the file itself if it has one of the suffixes, else ``stem`` in that folder.

    Raises
    ------
    ResultFileError
        If the file could not be written.
    """
    if output is not None and output.suffix.lower() in suffixes and not output.is_dir():
        path = output
    else:
        path = (output or Path()) / f"{stem}{suffixes[0]}"
    check_writable(path)
    return path


def output_folder(output: Path | None, stem: str) -> Path:
    """Folder named by ``-o``, checked; the current one by default."""
    folder = output or Path()
    check_writable(folder / f"{stem}_")
    return folder
