"""Files that are written: completely or not at all, and never at the cost of what was solved before.

One function, `destination`, decides what becomes of a file in the place of a new one; everything that writes asks it.
A result file ends with the seal of its content, which says whether it still is as it was written.
"""

from __future__ import annotations

import logging
import os
import platform
import secrets
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from hashlib import file_digest, sha256
from itertools import count
from pathlib import Path

from beamsim.errors import NotWrittenError, ResultFileError
from beamsim.input_files import FileState, open_input, state_of

_LOG = logging.getLogger(__name__)
_SEAL = b"\nbeamsim sha256 "
_SEAL_BYTES = len(_SEAL) + 65  # with the digest and the end of the line
PAUSES_S = (0.1, 0.3, 1.0)  # between attempts to replace a file that another program has open


# --- What may be replaced --------------------------------------------------------------------------------------------


class Content(Enum):
    """What a file holds, as far as it decides whether another may take its place; the values complete a message."""

    OUTPUT = "nothing that cannot be written again"  # a picture, a table, a page, an export, the scenario of an optimum
    RESULT = "a complete result"
    PARTIAL = "a partial result"
    JOURNAL = "the cases solved before"
    CONTAINED = "nothing that the new file lacks"  # such as an earlier state of the new file
    UNKNOWN = "a file that cannot be read as a result or a journal of this version"


_MOVED_ASIDE = (Content.PARTIAL, Content.JOURNAL, Content.UNKNOWN)


@dataclass(frozen=True)
class Placement:
    """Where a new file goes, and what becomes of the one that is there."""

    path: Path  # as the user gave it, or its `partial_file`
    target: Path  # the same without symbolic links
    found: Content  # of the file there; ``OUTPUT`` where there is none
    moves_aside: bool  # whether that file gets another name first, instead of being replaced


def destination(
    path: Path | str, new: Content = Content.OUTPUT, examine: Callable[[Path], Content] | None = None
) -> Placement:
    """Decide where a file is written, and what becomes of the file that is there.

    ======================  ===================================  ===================
    there is                a complete result, journal, output   a partial result
    ======================  ===================================  ===================
    nothing                 is written                           is written
    what is contained       replaces it                          replaces it
    an output               replaces it                          replaces it
    a complete result       replaces it                          goes to another name, `partial_file`
    a partial result        moves it aside                       moves it aside
    a journal               moves it aside                       moves it aside
    what is unknown         moves it aside                       moves it aside
    ======================  ===================================  ===================

    A file that the command reads is never written, nor is anything but a regular file. What this command wrote itself
    is contained in what it writes later; where another command has written to the place since, a partial result goes to
    another name, so that two commands do not move each other's files.

    Parameters
    ----------
    path : as the user gave it.
    new : what is to be written.
    examine : what a file holds that is not empty and that this command did not write; by default an output.

    Returns
    -------
    Placement

    Raises
    ------
    ResultFileError
        If nothing can be written there.
    """
    target, access, found, there = _resolved(path), _ACCESS.get(), Content.OUTPUT, None
    with suppress(OSError):  # nothing is there, or not any more
        there = target.stat()
    if there is not None and not target.is_file():
        kind = "a folder" if target.is_dir() else "not a regular file"
        raise ResultFileError(f"cannot write {path}: it is {kind}; choose another path with -o")
    for file in () if there is None else access.read:
        with suppress(OSError):
            if target.samefile(file):
                raise ResultFileError(f"cannot write {path}: this command reads that file; choose another path with -o")
    if there is not None and there.st_size:
        own = access.written.get(target)
        if own == state_of(there):
            found = Content.CONTAINED
        elif examine is not None:
            found = examine(target)
        if new is Content.PARTIAL and (found is Content.RESULT or (own is not None and found is Content.PARTIAL)):
            return destination(partial_file(Path(path)), new, examine)
    return Placement(Path(path), target, found, moves_aside=found in _MOVED_ASIDE)


def partial_file(path: Path) -> Path:
    """File of a partial result where a complete one is in the file ``path``."""
    return path.with_name(f"{path.stem}_partial{path.suffix}")


@dataclass
class _Access:
    """The files that a command reads, and the state of those that it has written."""

    read: tuple[Path, ...] = ()
    written: dict[Path, FileState] = field(default_factory=dict)


_OUTSIDE = _Access()
_ACCESS: ContextVar[_Access] = ContextVar("access", default=_OUTSIDE)


@contextmanager
def protecting(paths: Iterable[Path]) -> Iterator[None]:
    """One command, which never writes over these files, nor over those of `protect`, by whatever name or link."""
    before = _ACCESS.set(_Access(tuple(paths)))
    try:
        yield
    finally:
        _ACCESS.reset(before)


def protect(path: Path) -> None:
    """Add a file to those that a command reads; without effect outside of `protecting`."""
    access = _ACCESS.get()
    if access is not _OUTSIDE:
        access.read = (*access.read, path.absolute())


def _resolved(path: Path | str) -> Path:
    """The path without symbolic links.

    Raises
    ------
    ResultFileError
        If links lead back to each other, or no file can have this name.
    """
    try:
        target = Path(path).resolve()
        for part in (target, *target.parents):
            if part.is_symlink():  # which could not be followed
                part.stat()
        target.exists()
        return target
    except (RuntimeError, ValueError, OSError) as error:
        raise _without_target(path, error) from error


def _without_target(path: Path | str, error: Exception) -> ResultFileError:
    """Why no file can be written to a path that cannot be followed."""
    name, reason = str(path), str(error)
    if isinstance(error, OSError):
        reason = error.strerror or reason
    elif isinstance(error, ValueError):  # a NUL in it, or a character that the file system's encoding lacks
        name, reason = ascii(name), "no file can have this name"
    else:  # RuntimeError of Python before 3.13; later it is an OSError
        reason = "its links lead back to each other"
    return ResultFileError(f"cannot write {name}: {reason}; choose another path with -o")


# --- Writing ---------------------------------------------------------------------------------------------------------


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
    with temporary_file(path) as temporary:
        yield temporary
        put_in_place(temporary, destination(path))


@contextmanager
def temporary_file(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, for `put_in_place`; what is left of it goes with the block.

    Raises
    ------
    ResultFileError, NotWrittenError
        As `replacing`.
    """
    temporary = check_writable(path)
    folder = temporary.parent
    if sys.platform != "win32":  # which has no harmless way to ask for a process
        with suppress(OSError):  # what processes of this machine left that were killed
            machine = temporary.name.split("-")[1]
            for abandoned in folder.glob(f".beamsim-{machine}-*-*.tmp"):
                process = abandoned.name.split("-")[2]
                if process.isdecimal() and not _runs(int(process)):
                    _remove(abandoned)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield temporary
    except OSError as error:
        raise NotWrittenError(path, error.strerror or str(error)) from error
    finally:
        _remove(temporary)


def put_in_place(temporary: Path, place: Placement) -> None:
    """Move a complete file to its destination; on failure the file that is there stays as it was.

    Raises
    ------
    OSError
        If it cannot be moved.
    """
    with open(temporary, "rb+") as written:
        os.fsync(written.fileno())
    aside = _with_second_name(place.target) if place.moves_aside else None
    try:
        for k, pause in enumerate((0.0, *PAUSES_S)):  # Windows refuses it while another program reads what is there
            time.sleep(pause)
            try:
                os.replace(temporary, place.target)
                break
            except PermissionError:
                if sys.platform != "win32" or k == len(PAUSES_S):
                    raise
    except BaseException:
        if aside is not None:
            _put_back(aside, place.target)
        raise
    _ACCESS.get().written[place.target] = state_of(place.target.stat())
    if aside is not None:
        kept = place.path.with_name(aside.name) if place.path.name == place.target.name else aside
        _LOG.warning("warning: %s held %s; it is kept in %s", place.path, place.found.value, kept)


def _put_back(aside: Path, target: Path) -> None:
    """Give a file its name again that was given a second one, or another one on file systems without links."""
    if target.exists():  # under both names
        _remove(aside)
    else:
        os.rename(aside, target)


def move_aside(path: Path) -> Path:
    """Rename a file to the first free name of ``path.1``, ``path.2``, ..., so that nothing in it is lost.

    Parameters
    ----------
    path : of the file; no process has it open on systems that cannot rename open files.

    Returns
    -------
    The new name.

    Raises
    ------
    OSError
        If it cannot be renamed.
    """
    aside = _with_second_name(path)
    _remove(path)
    return aside


def remove_own(path: Path) -> None:
    """Remove a file if this command wrote it, and nobody has changed it since."""
    target, written = path.resolve(), _ACCESS.get().written
    with suppress(OSError):
        if target in written and written.pop(target) == state_of(target.stat()):
            _remove(target)


def _with_second_name(path: Path) -> Path:
    """The first free name of ``path.1``, ``path.2``, ..., under which a file can be found from now on.

    A link never replaces a file of that name that another process makes meanwhile. File systems without links rename.
    """
    for k in count(1):
        aside = path.with_name(f"{path.name}.{k}")
        try:
            os.link(path, aside)
            return aside
        except FileExistsError:
            continue
        except OSError:
            if os.path.lexists(aside):
                continue
            os.rename(path, aside)
            return aside
    raise AssertionError("numbers end")  # pragma: no cover


def _runs(process: int) -> bool:
    """Whether a process of this machine exists."""
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # it belongs to another user
        return True
    return True


def _remove(path: Path) -> None:
    """Remove a temporary file; where that fails, what went wrong before is the message."""
    with suppress(OSError):
        path.unlink(missing_ok=True)


def check_writable(path: Path | str) -> Path:
    """Make sure, before a long computation, that the file could be written afterwards.

    Returns
    -------
    Path
        A name for a temporary file in its folder, which says which process of which machine writes it.

    Raises
    ------
    ResultFileError
        When it could not: a folder of that name, a folder without permission, a file where a folder should be.
    """
    folder = intended = destination(path).target.parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise ResultFileError(f"cannot write {path}: {folder} is not a folder; choose another path with -o")
    machine = platform.node()
    with suppress(OSError):  # process numbers are those of a container
        machine = f"{machine} {os.readlink('/proc/self/ns/pid')}"
    name = sha256(machine.encode()).hexdigest()[:12]
    probe = folder / f".beamsim-{name}-{os.getpid()}-{secrets.token_hex(6)}.tmp"
    try:  # permissions alone do not tell (administrators, network drives, read-only mounts)
        probe.touch()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ResultFileError(
            f"cannot write {path}: no file can be made in {folder} ({reason}); choose another folder with -o"
        ) from error
    finally:
        _remove(probe)
    return intended / probe.name


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


# --- Files as they were written ---------------------------------------------------------------------------------------


def seal(path: Path | str) -> None:
    """Append the SHA-256 of a closed file to it; HDF5 does not read what is behind its own end.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with open_input(path) as file:
        digest = file_digest(file, "sha256").hexdigest()
    with open(path, "ab") as file_to_seal:
        file_to_seal.write(_SEAL + digest.encode() + b"\n")


def is_as_written(path: Path | str) -> bool:
    """Whether a file ends with the seal of its content, so that nothing in it has changed since.

    Raises
    ------
    InputFileError
        As `beamsim.input_files.open_input`.
    """
    with open_input(path) as file:
        state = os.fstat(file.fileno())
    return _is_intact(str(path), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=256)
def _is_intact(path: str, modified: int, size: int) -> bool:
    """As `is_as_written`, once for each change of the file."""
    del modified
    with open_input(path) as file:
        file.seek(max(size - _SEAL_BYTES, 0))
        if not (end := file.read(_SEAL_BYTES)).startswith(_SEAL):
            return False
        file.seek(0)
        digest, rest = sha256(), size - _SEAL_BYTES
        while rest and (part := file.read(min(rest, 1 << 20))):
            digest.update(part)
            rest -= len(part)
    return end == _SEAL + digest.hexdigest().encode() + b"\n"
