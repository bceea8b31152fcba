"""Files that are either old or new, never half-written."""

from __future__ import annotations

import os
import secrets
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

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
    temporary = target.with_name(f".beamsim-{secrets.token_hex(6)}.tmp")
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
        _check_writable(Path(path).resolve(), path)
    except RuntimeError as error:  # of Python before 3.13, where links lead back to each other
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
    folder = target.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise ResultFileError(f"cannot write {path}: {folder} is not a folder; choose another path with -o")
    probe = folder / f".beamsim-{secrets.token_hex(6)}.tmp"
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
