"""The one way in which files are opened for reading: regular files of a bounded size, with the reason for each refusal.

Scenarios, records, matrices, tables and result files all come through `open_input`, journals through `open_to_append`.
Text comes in whatever encoding.
"""

from __future__ import annotations

import codecs
import errno
import math
import os
import stat
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader, FileIO
from pathlib import Path
from typing import Any

import psutil

from beamsim.errors import BeamsimError, InputFileError

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


def state_of(status: os.stat_result) -> FileState:
    """What changes when a file is replaced or written to."""
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
        file = open(path, mode, buffering, opener=_without_waiting)  # noqa: SIM115 (the caller closes it)
    except (OSError, ValueError) as error:
        raise _refusal(path, error) from None
    try:
        _demand_regular(path, os.fstat(file.fileno()), most_bytes, remedy)
    except InputFileError:
        file.close()
        raise
    return file


def found_in(name: Path | str, *folders: Path | None) -> Path:
    """The file of a name in the first of some folders that has it, else in the current one.

    Parameters
    ----------
    name : of the file, with or without a path.
    folders : None is left out.
    """
    paths = [folder / name for folder in folders if folder is not None]
    return next((path for path in paths if os.path.lexists(path)), Path(name))


def _without_waiting(path: str, flags: int) -> int:
    """Opener that does not wait for the writer of a pipe, if one took the place of the file meanwhile."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)


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


def demand_memory(path: Path | str, needed: float, why: str, remedy: str = _EXPORT_LESS) -> None:
    """Refuse a file whose content has no room in memory.

    Parameters
    ----------
    path : of the file.
    needed : bytes of memory.
    why : what they are for; goes on from the number.
    remedy : what to do about it, besides taking a machine with more memory.

    Raises
    ------
    InputFileError
        If less is free.
    """
    if needed > ALWAYS_TRIED and needed > (free := free_memory()):
        message = f"needs {bytes_text(needed)} of memory {why}, and {bytes_text(free)} are free"
        raise InputFileError(message, f"{remedy}, or use a machine with more memory", path)


def no_memory(path: Path | str, size: float) -> InputFileError:
    """The refusal of a file for which memory did not suffice; ``size`` is that of the file, in bytes."""
    message = f"has {bytes_text(size)} and needs more memory than the {bytes_text(free_memory())} that are free"
    return InputFileError(message, f"{_EXPORT_LESS}, or use a machine with more memory", path)


@contextmanager
def reading(path: Path | str, called: str, remedy: str = "it is damaged: export it again") -> Iterator[None]:
    """The boundary of a reader: whatever a damaged file causes in the block becomes a refusal with the file's name.

    Libraries raise exceptions of any type on damaged files, and warn of what they cannot know. Refusals of this package
    pass unchanged.

    Parameters
    ----------
    path : of the file.
    called : name of the format.
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
        raise InputFileError(f"cannot be read as {called} ({reason})", remedy, path) from None
