"""Files: the one way in which they are opened for reading, and how they are written.

Scenarios, records, matrices, tables and result files all are opened by `open_input`, journals by `open_to_append`:
regular files of a bounded size, with the reason for each refusal. Text comes in whatever encoding.

Files are written completely or not at all, and never at the cost of what was solved before. One function,
`destination`, decides what becomes of a file in the place of a new one; everything that writes asks it. A result file
ends with the seal of its content, which says whether it still is as it was written.
"""

from __future__ import annotations

import codecs
import errno
import logging
import math
import os
import platform
import re
import secrets
import stat
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from hashlib import file_digest, sha256
from io import BufferedReader, FileIO
from itertools import count
from pathlib import Path
from typing import Any

import psutil

from beamsim.errors import BeamsimError, InputFileError, NotWrittenError, ResultFileError

_LOG = logging.getLogger(__name__)
_SEAL = b"\nbeamsim sha256 "
_SEAL_BYTES = len(_SEAL) + 65  # with the digest and the end of the line
PAUSES_S = (0.1, 0.3, 1.0)  # between attempts to replace a file that another program has open
MOST_BYTES_OF_TEXT = 1_000_000_000
"""Largest text file that is read, in bytes."""
ALWAYS_TRIED = 10_000_000
"""Bytes of memory that are asked for without a look at what is free."""
_EXPORT_LESS = "export fewer channels or samples, or split the file"
_KINDS = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"),
          (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"))  # fmt: skip

FileState = tuple[int, int, int, int]
"""Device, number and size of a file, and its time stamp in ns, which is compared with nothing but itself."""

_OPENED: dict[str, FileState] = {}  # by absolute path, the state in which this process opened a file last


# --- Reading ----------------------------------------------------------------------------------------------------------


def state_of(status: os.stat_result) -> FileState:
    """The state of a file that changes when it is replaced or written to."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def is_as_opened(path: Path | str) -> bool:
    """Whether a file is as it was when this process opened it last; True of one that it has not opened.

    Raises
    ------
    OSError
        If it does not exist any more.
    """
    now = state_of(os.stat(path))
    return _OPENED.get(os.path.abspath(path), now) == now


def open_input(path: Path | str, most_bytes: float = math.inf, remedy: str = _EXPORT_LESS) -> BufferedReader:
    """Open a file for reading, if it is a regular file that is not too large; links are followed.

    A pipe without a writer cannot block the program, nor is a device read without an end: the kind of the file is
    checked before and after it is opened.

    Parameters
    ----------
    path : of the file.
    most_bytes : size above which it is refused.
    remedy : what to do about one that is too large.

    Returns
    -------
    BufferedReader
        Open, to be closed by the caller; its ``name`` is the path.

    Raises
    ------
    InputFileError
        If the file does not exist, is not a regular file, is too large, or cannot be opened.
    """
    file: BufferedReader = _open_regular(path, "rb", -1, most_bytes, remedy)
    _OPENED[os.path.abspath(path)] = state_of(os.fstat(file.fileno()))
    return file


def open_to_append(path: Path | str) -> FileIO:
    """Open a file, which is made if it is missing, for reading and for writing at its end, unbuffered.

    Raises
    ------
    InputFileError
        If it is no regular file, or cannot be opened.
    """
    file: FileIO = _open_regular(path, "a+b", 0)
    return file


def _open_regular(path: Path | str, mode: str, buffering: int, most_bytes: float = math.inf, remedy: str = "") -> Any:
    """Open a regular file; what is there already is checked before and after it is opened."""
    try:
        if "r" in mode or os.path.exists(path):
            _demand_regular(path, os.stat(path), most_bytes, remedy)
        # without waiting for the writer of a pipe, if one took the place of the file meanwhile
        at_once = getattr(os, "O_NONBLOCK", 0)
        file = open(path, mode, buffering, opener=lambda name, flags: os.open(name, flags | at_once, 0o666))  # noqa: SIM115
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    try:
        _demand_regular(path, os.fstat(file.fileno()), most_bytes, remedy)
    except InputFileError:
        file.close()
        raise
    return file


def find_file(name: Path | str, *folders: Path | None) -> Path:
    """The file of a name in the first of some folders that has it, else in the current one.

    Parameters
    ----------
    name : of the file, with or without a path.
    folders : None is left out.
    """
    paths = [folder / name for folder in folders if folder is not None]
    return next((path for path in paths if os.path.lexists(path)), Path(name))


def _demand_regular(path: Path | str, state: os.stat_result, most_bytes: float, remedy: str) -> None:
    """Refuse what is not a regular file, and a file that is too large."""
    if not stat.S_ISREG(state.st_mode):
        kind = next((name for test, name in _KINDS if test(state.st_mode)), "no regular file")
        raise InputFileError(f"is {kind}", "give the path of a regular file", path)
    if state.st_size > most_bytes:
        message = f"has {bytes_text(state.st_size)}, more than the {bytes_text(most_bytes)} of the largest such file"
        raise InputFileError(message, remedy, path)


def _refusal(path: Path | str, error: OSError | ValueError) -> InputFileError:
    """The refusal of a file that the system does not open."""
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return InputFileError("does not exist", "check the path", path, missing=True)
    if number == errno.ELOOP:
        return InputFileError("is a link that leads back to itself", "give the path of a regular file", path)
    reason = getattr(error, "strerror", None) or str(error)
    return InputFileError(f"cannot be read ({reason})", "check its path and permissions", path)


def read_input(
    path: Path | str, most_bytes: float = MOST_BYTES_OF_TEXT, remedy: str = _EXPORT_LESS, memory: float = 1.0
) -> bytes:
    """The content of a file, which is opened by `open_input`.

    Parameters
    ----------
    path, most_bytes, remedy : as of `open_input`.
    memory : bytes of memory that a byte of the file takes until it is read.

    Raises
    ------
    InputFileError
        As `open_input`; also if the content cannot be read, grows meanwhile or has no room in memory.
    """
    with open_input(path, most_bytes, remedy) as file:
        size = os.fstat(file.fileno()).st_size
        if memory * size > ALWAYS_TRIED:
            demand_memory(path, memory * size, f"to be read from {bytes_text(size)}")
        try:
            raw = file.read(size + 1) or b""
        except OSError as error:
            raise _refusal(path, error) from None
        except MemoryError:
            raise no_memory(path, size) from None
    if len(raw) > size:
        message = f"has more than its {size} bytes: it is being written, or a file of the system without a size"
        raise InputFileError(message, "give a file that is complete", path)
    return raw


def read_text(path: Path | str, most_bytes: float = MOST_BYTES_OF_TEXT) -> str:
    """The text of a file of another program: UTF-8, UTF-16 (spreadsheets), else Windows-1252.

    Measuring systems write µ and ² of a heading in the latter; numbers are the same in all of them.

    Raises
    ------
    InputFileError
        As `read_input`.
    UnicodeDecodeError
        If it is no text.
    """
    raw = read_input(path, most_bytes)
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return raw.decode("utf-16")
    if b"\0" in raw:  # every second byte of numbers and separators in UTF-16
        text = raw.decode("utf-16-le" if raw[1:2] == b"\0" else "utf-16-be")
        if "\0" in text or max(text) >= "\u3000":
            raise UnicodeDecodeError("utf-16", raw, 0, 1, "is binary")
        return text
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252")


def bytes_text(count: float) -> str:
    """A number of bytes for messages.

    >>> bytes_text(2.4e9), bytes_text(1672)
    ('2.4 GB', '1.67 kB')
    """
    for factor, unit in ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count:.0f} bytes"


def free_memory() -> float:
    """Bytes of memory that this process can still use: what is free, and what its limits allow."""
    free = float(psutil.virtual_memory().available)
    process = psutil.Process()
    if hasattr(process, "rlimit"):  # Linux
        most = process.rlimit(psutil.RLIMIT_AS)[0]
        if most >= 0:
            free = min(free, most - process.memory_info().vms)
    return max(free, 0.0)


def demand_memory(path: Path | str, needed: float, purpose: str, remedy: str = _EXPORT_LESS) -> None:
    """Refuse a file whose content has no room in memory.

    Parameters
    ----------
    path : of the file.
    needed : bytes of memory.
    purpose : what they are for; goes on from the number.
    remedy : what to do about it, besides taking a machine with more memory.

    Raises
    ------
    InputFileError
        If less is free.
    """
    if needed > ALWAYS_TRIED and needed > (free := free_memory()):
        message = f"needs {bytes_text(needed)} of memory {purpose}, and {bytes_text(free)} are free"
        raise InputFileError(message, f"{remedy}, or use a machine with more memory", path)


def no_memory(path: Path | str, size: float) -> InputFileError:
    """The refusal of a file for which memory did not suffice; ``size`` is that of the file, in bytes."""
    message = f"has {bytes_text(size)} and needs more memory than the {bytes_text(free_memory())} that are free"
    return InputFileError(message, f"{_EXPORT_LESS}, or use a machine with more memory", path)


@contextmanager
def reading(path: Path | str, format_name: str, remedy: str = "it is damaged: export it again") -> Iterator[None]:
    """The boundary of a reader: whatever a damaged file causes in the block becomes a refusal with the file's name.

    Libraries raise exceptions of any type on damaged files, and warn of what they cannot know. Refusals of this package
    pass unchanged.

    Parameters
    ----------
    path : of the file.
    format_name : name of the format.
    remedy : what to do about a damaged file.

    Raises
    ------
    InputFileError
        In place of any other exception but an interrupt.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except BeamsimError:
        raise
    except MemoryError:
        raise no_memory(path, os.stat(path).st_size) from None
    except Exception as error:
        reason = " ".join((str(error) or type(error).__name__).split())[:300]
        raise InputFileError(f"cannot be read as {format_name} ({reason})", remedy, path) from None


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
    present: Content  # of the file there; ``OUTPUT`` where there is none
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
    target, there = _resolve(path), None
    with suppress(OSError):  # nothing is there, or not any more
        there = target.stat()
    if there is not None:
        _refuse_to_replace(path, target)
        if there.st_size:
            return _replacement(path, target, there, new, examine)
    return Placement(Path(path), target, Content.OUTPUT, moves_aside=False)


def _replacement(
    path: Path | str, target: Path, present: os.stat_result, new: Content, examine: Callable[[Path], Content] | None
) -> Placement:
    """Where a file is written in the place of one that is not empty; see `destination`."""
    own, found = _ACCESS.get().written.get(target), Content.OUTPUT
    if own == state_of(present):
        found = Content.CONTAINED
    elif examine is not None:
        found = examine(target)
    if new is Content.PARTIAL and (found is Content.RESULT or (own is not None and found is Content.PARTIAL)):
        return destination(partial_file(Path(path)), new, examine)
    return Placement(Path(path), target, found, moves_aside=found in _MOVED_ASIDE)


def _refuse_to_replace(path: Path | str, target: Path) -> None:
    """Refuse what is no regular file, and files that the command reads."""
    if not target.is_file():
        kind = "a folder" if target.is_dir() else "not a regular file"
        raise ResultFileError(f"cannot write {path}: it is {kind}; choose another path with -o")
    for file in _ACCESS.get().read:
        with suppress(OSError):
            if target.samefile(file):
                raise ResultFileError(f"cannot write {path}: this command reads that file; choose another path with -o")


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
def protected_files(paths: Iterable[Path]) -> Iterator[None]:
    """One command, which never writes over these files, nor over those of `protect`, by whatever name or link."""
    before = _ACCESS.set(_Access(tuple(paths)))
    try:
        yield
    finally:
        _ACCESS.reset(before)


def protect(path: Path) -> None:
    """Add a file to those that a command reads; without effect outside of `protected_files`."""
    access = _ACCESS.get()
    if access is not _OUTSIDE:
        access.read = (*access.read, path.absolute())


def _resolve(path: Path | str) -> Path:
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
def replacement_file(path: Path | str) -> Iterator[Path]:
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
        As `replacement_file`.
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
    replace = _replace_patiently if sys.platform == "win32" else os.replace
    if place.moves_aside:
        _replace_and_keep(temporary, place, replace)
    else:
        replace(temporary, place.target)
    _ACCESS.get().written[place.target] = state_of(place.target.stat())


def _replace_and_keep(temporary: Path, place: Placement, replace: Callable[[Path, Path], object]) -> None:
    """Move a file to its destination, where what is there keeps a second name, which a warning says."""
    aside = _with_second_name(place.target)
    try:
        replace(temporary, place.target)
    except BaseException:
        _put_back(aside, place.target)
        raise
    kept = place.path.with_name(aside.name) if place.path.name == place.target.name else aside
    _LOG.warning("warning: %s held %s; it is kept in %s", place.path, place.present.value, kept)


def _replace_patiently(temporary: Path, target: Path) -> None:
    """Rename a file to that of another, which Windows refuses for a while where another program reads what is there."""
    for pause in PAUSES_S:
        with suppress(PermissionError):
            os.replace(temporary, target)
            return
        time.sleep(pause)
    os.replace(temporary, target)


def _put_back(present: Path, target: Path) -> None:
    """Give a file its name again that was given a second one, or another one on file systems without links."""
    if target.exists():  # under both names
        _remove(present)
    else:
        os.rename(present, target)


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
        why = f"no file can be made in {folder} ({error.strerror or error})"
        raise ResultFileError(f"cannot write {path}: {why}; choose another folder with -o") from error
    finally:
        _remove(probe)
    return intended / probe.name


_ENDING = re.compile(r"\.[a-z][a-z0-9]{0,4}", re.IGNORECASE)  # of a file's name


def output_file(output: Path | None, stem: str, *suffixes: str) -> Path:
    """File named by ``-o``: the file itself if it has one of the suffixes, else ``stem`` in that folder.

    Raises
    ------
    ResultFileError
        If the file could not be written, or the name has the ending of another kind of file.
    """
    if output is not None and output.suffix.lower() in suffixes and not output.is_dir():
        path = output
    else:
        path = _named_folder(output, suffixes) / f"{stem}{suffixes[0]}"
    check_writable(path)
    return path


def output_folder(output: Path | None, stem: str, *suffixes: str) -> Path:
    """Folder named by ``-o``, checked; the current one by default. A file of one of the suffixes could be named, too.

    Raises
    ------
    ResultFileError
        If no file could be written there, or the name has the ending of a file.
    """
    folder = _named_folder(output, suffixes)
    check_writable(folder / f"{stem}_")
    return folder


def _named_folder(output: Path | None, suffixes: Sequence[str]) -> Path:
    """The folder that ``-o`` names, which does not end as files do unless there is one of that name."""
    folder = output or Path()
    if _ENDING.fullmatch(folder.suffix) and not folder.is_dir():
        raise _no_folder(folder, suffixes)
    return folder


def _no_folder(folder: Path, suffixes: Sequence[str]) -> ResultFileError:
    """That a name after ``-o`` ends as files do that are not written there."""
    remedy = (
        f"give a name that ends with {' or '.join(suffixes)}, or a folder" if suffixes else "give a folder after -o"
    )
    return ResultFileError(
        f"cannot write {folder}: files that end with {folder.suffix} are not written here; {remedy} (one whose name "
        "has an ending must exist)"
    )


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
        As `beamsim.files.open_input`.
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
