"""Common parts of all result files: attributes of the root, opening and creating, lazy parsing of the scenario."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, BinaryIO, Self

import h5py

from beamsim.errors import ResultFileError
from beamsim.files import replacing
from beamsim.interrupts import kept
from beamsim.kinds import KINDS
from beamsim.store import declared, schema

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.scenario import Scenario
    from beamsim.scenario.input_files import Record


MOST_OF_STRUCTURE = 2**20  # bytes HDF5 writes at once of what it may read again: headers, names, heaps


class LazyScenario:
    """Mixin of results read from a file: the scenario is parsed on first use."""

    scenario_yaml: str
    beamsim_version: str
    _title: str
    _input_files: dict[str, Record] | None
    _folder: Path  # of the result file

    @cached_property
    def scenario(self) -> Scenario:
        """The resolved scenario; the files that it names are those that were solved."""
        from beamsim.scenario import load_scenario
        from beamsim.scenario.input_files import SolvedFiles

        scenario = load_scenario(self.scenario_yaml)
        files = self._input_files
        return scenario.with_solved_files(SolvedFiles(files, self._folder)) if files else scenario

    @property
    def input_files(self) -> dict[str, Record] | None:
        """What the files of the scenario held; None where it names none, or an earlier version wrote the result."""
        return self._input_files

    @property
    def title(self) -> str:
        """Title of the scenario, available without parsing it."""
        return self._title

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Self:
        """The result with these fields, including those of `root_fields`."""
        stored = cls.__new__(cls)
        stored.__dict__.update(fields)  # without the scenario __init__ cannot be called
        return stored


class _Sink:
    """A file object for HDF5 whose methods never raise.

    The HDF5 library crashes on a full disk: it repeats failed writes when the file is closed and when the process ends,
    and reads again what it has written. The first exception, also an interrupt, is therefore stored and raised by
    `creating`; what HDF5 may read again is kept in memory.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: BaseException | None = None
        self._lost: list[tuple[int, bytes]] = []  # places and contents of what could not be written

    def write(self, data: memoryview) -> int:
        """Write the data; from a failure on they are kept in memory, or discarded if they are histories."""
        place = self._file.tell()
        if self.error is None:
            remaining = memoryview(data).cast("B")
            try:
                while remaining:
                    remaining = remaining[self._file.write(remaining) :]
            except BaseException as error:
                self.error = error
        if self.error is not None and len(data) <= MOST_OF_STRUCTURE:
            self._lost.append((place, bytes(data)))
        return len(data)

    def readinto(self, buffer: memoryview) -> int:
        """Read what was written, on the disk or not."""
        place, view = self._file.tell(), memoryview(buffer).cast("B")
        count = int(self._file.readinto(view))  # type: ignore[attr-defined]
        if self.error is None:
            return count
        view[count:] = bytes(len(view) - count)
        for begin, data in self._lost:
            first, last = max(begin, place), min(begin + len(data), place + len(view))
            if first < last:
                view[first - place : last - place] = data[first - begin : last - begin]
        return len(view)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def truncate(self, size: int) -> int:
        """Set the length of the file."""
        if self.error is None:
            try:
                self._file.truncate(size)
            except BaseException as error:
                self.error = error
        return size

    def flush(self) -> None:
        """Nothing is buffered."""

    def keep(self, error: BaseException) -> None:
        """Keep what a signal raised."""
        self.error = self.error or error

    def is_called_by(self, frame: FrameType | None) -> bool:
        """Whether a method is being executed, if only before its first line, where HDF5 would hide an exception."""
        while frame is not None:
            if frame.f_locals.get("self") is self:
                return True
            frame = frame.f_back
        return False


@contextmanager
def creating(path: Path | str) -> Iterator[h5py.File]:
    """Yield a new HDF5 file, which replaces ``path`` when it is complete.

    Raises
    ------
    ResultFileError
        If it cannot be written (no permission, disk full, a folder of that name).
    """
    with replacing(path) as temporary, open(temporary, "x+b", buffering=0) as raw:
        sink = _Sink(raw)
        try:
            with kept(sink.keep, sink.is_called_by), h5py.File(sink, "w", rdcc_nbytes=0) as file:
                yield file  # its chunks are written whole
        finally:
            if sink.error is not None:
                raise sink.error


def write_root(file: h5py.File, result: Result, command: str, **more: Any) -> None:
    """Write the attributes of every result file, the summary, and the attributes `more`."""
    from beamsim.version import __version__

    file.attrs.update(
        {
            "schema_version": schema.SCHEMA_VERSION,
            "beamsim_version": result.provenance.get("beamsim", __version__),
            "command": command,
            "scenario": result.scenario.to_yaml(),
            **more,
        }
    )
    rewrite_outcome(file, result)


def rewrite_outcome(file: h5py.File, result: Result) -> None:
    """Write what every result has, and the summary, over what there is of them."""
    from beamsim.analyses.result import Result

    declared.write(file, result, cls=Result)
    file.require_group("summary").attrs.update(schema.encode_summary(result.summary))


def root_fields(file: h5py.File) -> dict[str, Any]:
    """Attributes written by `write_root`, as fields of a result with a `LazyScenario`."""
    from beamsim.analyses.result import Result

    return {
        "scenario_yaml": str(file.attrs["scenario"]),
        "beamsim_version": str(file.attrs["beamsim_version"]),
        "_title": str(file.attrs["title"]),
        "_input_files": json.loads(file.attrs["input_files"]) if "input_files" in file.attrs else None,
        "_folder": Path(file.filename).absolute().parent,
        "summary": schema.decode_summary(dict(file["summary"].attrs)),
        **declared.read(Result, file),
    }


def kind_of(path: Path | str) -> str:
    """Kind of a result file, one of `KINDS`.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout.
    """
    with _opened(path) as file:
        return _kind(file, path)


def holds(path: Path | str, kind: str) -> bool:
    """Whether a file is a result file of this kind."""
    try:
        return kind_of(path) == kind
    except ResultFileError:
        return False


@contextmanager
def reading(path: Path | str, kind: str = "") -> Iterator[h5py.File]:
    """Open a result file of one of `KINDS` (of any kind without `kind`); errors in reading are reported as damage.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout or kind.
    """
    with _opened(path, KINDS[kind].command if kind else "run") as file:
        actual = _kind(file, path)
        if kind and actual != kind:
            raise ResultFileError(f"{path}: contains {KINDS[actual].called}, not {KINDS[kind].called}")
        with damage_of(path):
            yield file


@contextmanager
def damage_of(path: Path | str) -> Iterator[None]:
    """Report errors in reading a result file, or in what is made of it, as its damage.

    Raises
    ------
    ResultFileError
    """
    try:
        yield
    except ResultFileError:
        raise
    except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, OSError, RuntimeError) as error:
        if isinstance(error, OSError) and error.filename is not None:  # of a file that is written
            raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ResultFileError(f"{path}: damaged ({reason}); run the case again") from error


@contextmanager
def _opened(path: Path | str, command: str = "run") -> Iterator[h5py.File]:
    place = Path(path)
    try:
        if place.is_dir():
            raise ResultFileError(f"{path}: is a folder; give the .h5 file that `beamsim {command}` wrote")
        if not place.exists():
            raise ResultFileError(f"{path}: no such result file; `beamsim {command} case.yaml` writes one")
        if not place.is_file():
            raise ResultFileError(f"{path}: not a regular file; give the .h5 file that `beamsim {command}` wrote")
        file = h5py.File(place, "r")
    except PermissionError as error:
        raise ResultFileError(f"{path}: no permission to read it") from error
    except (OSError, ValueError) as error:
        raise ResultFileError(
            f"{path}: not an HDF5 file, or damaged; give the .h5 file that `beamsim {command}` wrote, "
            "or run the case again"
        ) from error
    with file:
        yield file


def _kind(file: h5py.File, path: Path | str) -> str:
    """Kind of an open file whose layout this version knows."""
    try:
        version, command, kind = (file.attrs.get(name) for name in ("schema_version", "command", "kind"))
        writer = file.attrs.get("beamsim_version", "unknown")
        designs = "designs" in file
    except (OSError, RuntimeError, KeyError) as error:
        raise ResultFileError(f"{path}: damaged ({error}); run the case again") from error
    if version is None or command is None:
        raise ResultFileError(f"{path}: an HDF5 file, but not from beamsim; give the .h5 file of `beamsim run`")
    if version != schema.SCHEMA_VERSION:
        raise ResultFileError(
            f"{path}: schema_version {version}, written by beamsim {writer}, but this beamsim reads "
            f"{schema.SCHEMA_VERSION}; open it with that version or run its scenario again"
        )
    if command == "sweep":
        return "designs" if designs else "continuation" if kind == "continuation" else "sweep"
    if command not in KINDS:
        raise ResultFileError(f"{path}: written by `beamsim {command}`, which is unknown to this version")
    return str(command)
