"""What all result files share: the attributes of the root, opening and creating, a scenario that is parsed late."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self

import h5py

from beamsim.errors import ResultFileError
from beamsim.files import replacing
from beamsim.kinds import KINDS
from beamsim.store import declared, schema

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.scenario import Scenario


class LazyScenario:
    """Mixin of results read from a file: the scenario is parsed when it is first asked for."""

    scenario_yaml: str
    beamsim_version: str
    _title: str

    @cached_property
    def scenario(self) -> Scenario:
        """The resolved scenario."""
        from beamsim.scenario import load_scenario

        return load_scenario(self.scenario_yaml)

    @property
    def title(self) -> str:
        """The scenario's title, known without parsing it."""
        return self._title

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> Self:
        """The result with these fields, those of `root_fields` among them."""
        stored = cls.__new__(cls)
        stored.__dict__.update(fields)  # the scenario is left out, so __init__ cannot be called
        return stored


class _Sink:
    """A file for HDF5 to write to that never fails while it does.

    The library does not survive a full disk: what it could not write it tries again when the file is closed and when
    the process ends, and crashes. So the first exception, an interrupt too, is kept for `creating` to raise.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.error: BaseException | None = None

    def write(self, data: memoryview) -> int:
        """Take the data; after a failure they are dropped."""
        if self.error is None:
            left = memoryview(data).cast("B")
            try:
                while left:
                    left = left[self._file.write(left) :]
            except BaseException as error:
                self.error = error
        return len(data)

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


@contextmanager
def creating(path: Path | str) -> Iterator[h5py.File]:
    """Yield a new HDF5 file, which takes the place of ``path`` when it is complete.

    Raises
    ------
    ResultFileError
        When it cannot be written (no permission, disk full, a folder of that name).
    """
    with replacing(path) as temporary, open(temporary, "x+b", buffering=0) as raw:
        sink = _Sink(raw)
        try:
            with h5py.File(sink, "w") as file:
                yield file
        finally:
            if sink.error is not None:
                raise sink.error


def write_root(file: h5py.File, result: Result, command: str, **more: Any) -> None:
    """Write what every result file carries, the summary included, and the attributes `more`."""
    from beamsim.analyses.result import Result
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
    declared.write(file, result, cls=Result)
    file.create_group("summary").attrs.update(schema.encode_summary(result.summary))


def root_fields(file: h5py.File) -> dict[str, Any]:
    """What `write_root` wrote, as fields of a result with a `LazyScenario`."""
    from beamsim.analyses.result import Result

    return {
        "scenario_yaml": str(file.attrs["scenario"]),
        "beamsim_version": str(file.attrs["beamsim_version"]),
        "_title": str(file.attrs["title"]),
        "summary": schema.decode_summary(dict(file["summary"].attrs)),
        **declared.read(Result, file),
    }


def kind_of(path: Path | str) -> str:
    """Which of `KINDS` a result file is.

    Raises
    ------
    ResultFileError
        When the file is missing, unreadable, damaged, not one of beamsim's, or of another layout.
    """
    with _opened(path) as file:
        return _kind(file, path)


def holds(path: Path | str, kind: str) -> bool:
    """Whether a file is a result of this kind; False where it is none at all."""
    try:
        return kind_of(path) == kind
    except ResultFileError:
        return False


@contextmanager
def reading(path: Path | str, kind: str = "") -> Iterator[h5py.File]:
    """Open a result file of one of `KINDS` (of any, without `kind`); what fails while it is read is told as damage.

    Raises
    ------
    ResultFileError
        When the file is missing, unreadable, damaged, not one of beamsim's, of another layout or of another kind.
    """
    with _opened(path, KINDS[kind].command if kind else "run") as file:
        found = _kind(file, path)
        if kind and found != kind:
            raise ResultFileError(f"{path}: holds {KINDS[found].called}, not {KINDS[kind].called}")
        try:
            yield file
        except (KeyError, ValueError, TypeError, IndexError, AttributeError, OSError, RuntimeError) as error:
            raise ResultFileError(f"{path}: damaged ({error}); run the case again") from error


@contextmanager
def _opened(path: Path | str, command: str = "run") -> Iterator[h5py.File]:
    place = Path(path)
    try:
        if place.is_dir():
            raise ResultFileError(f"{path}: is a folder; give the .h5 file that `beamsim {command}` wrote")
        if not place.exists():
            raise ResultFileError(f"{path}: no such result file; `beamsim {command} case.yaml` writes one")
        if not place.is_file():
            raise ResultFileError(f"{path}: no ordinary file; give the .h5 file that `beamsim {command}` wrote")
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
        raise ResultFileError(f"{path}: an HDF5 file, but not one of beamsim's; give the .h5 file of `beamsim run`")
    if version != schema.SCHEMA_VERSION:
        raise ResultFileError(
            f"{path}: schema_version {version}, written by beamsim {writer}, but this beamsim reads "
            f"{schema.SCHEMA_VERSION}; open it with that version or run its scenario again"
        )
    if command == "sweep":
        return "designs" if designs else "continuation" if kind == "continuation" else "sweep"
    if command not in KINDS:
        raise ResultFileError(f"{path}: written by `beamsim {command}`, which this version does not know")
    return str(command)
