"""Writing and reading of result files.

A file holds the labelled datasets of its result (`beamsim.labelled`), each a group; the result declares their
variables.
Files are written completely or not at all. ``/summary`` has no datasets, only attributes under the names of the
summary. Numbers and texts are native attributes; everything else (per-probe values, lists, truth values, nothing) is a
JSON text, and the attribute ``json_encoded`` lists the names of those, separated by spaces. A NaN is ``null`` in JSON:
inside a list or an object read it back as NaN. Infinite numbers there are the texts ``Infinity`` and ``-Infinity``.
"""

from __future__ import annotations

import errno
import json
import math
import os
import secrets
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from pydantic import TypeAdapter

from beamsim.errors import BeamsimError, InputFileError, NotWrittenError, ResultFileError, ScenarioError
from beamsim.files import (
    Content,
    FileState,
    demand_memory,
    destination,
    is_as_written,
    partial_file,
    put_in_place,
    remove_own,
    seal,
    state_of,
    temporary_file,
)
from beamsim.hdf5 import demand_plausible, open_hdf5, read_array, scales_of, values_size
from beamsim.kinds import KINDS
from beamsim.labelled import Item, Items, LargeArray, last
from beamsim.outcomes import Outcome
from beamsim.results.result import demand_result
from beamsim.scenario import Scenario
from beamsim.scenario.scenario import SolvedFiles, stored_scenario
from beamsim.summaries import as_builtin, by_name, demand_summary, record

if TYPE_CHECKING:
    from beamsim.results.result import Result

SCHEMA_VERSION = 4
JSON_ENCODED = "json_encoded"
_CONTRADICTION = "its contents contradict each other"


# --- Writing ---------------------------------------------------------------------------------------------------------


def write_result(result: Result, path: Path | str, *, resumed: bool = False) -> Path:
    """Write a result to a file, which is replaced only when the new one is written completely.

    A complete result there is not replaced by a partial one, which goes to ``NAME_partial.h5``. A partial result there
    is renamed to ``NAME.h5.1``, ``.2``, ... unless the new one contains it, being of the same scenario and complete or
    resumed. So is a file that is no result of this version.

    Parameters
    ----------
    result : of any command.
    path : of the file.
    resumed : whether it contains what an earlier command has computed of it.

    Returns
    -------
    pathlib.Path
        Of the file that was written.

    Raises
    ------
    ResultFileError
        If the file cannot be written (no permission, disk full, a folder of that name).

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "case.h5"
    >>> beamsim.write_result(beamsim.run("configs/stops/chain_bumpers.yaml"), file).name
    'case.h5'
    >>> folder.cleanup()
    """
    demand_result(result)
    items = items_of(result)
    cut_short = result.outcome.cut_short
    examine = partial(_content, items["/"].attributes, contains=resumed or not cut_short)
    written = write_items(items, path, Content.PARTIAL if cut_short else Content.RESULT, examine)
    if not cut_short:
        remove_own(partial_file(Path(path)))
    return written


ROOT = {
    "schema_version": "version of the layout",
    "command": "command that wrote the file",
    "kind": "kind of the result, one of the headings below",
    "scenario": "the case as written, YAML in SI units; sufficient to run it again",
    "title": "title of the scenario",
    "status": "how the computation ended: complete, or why it stopped early and what to try",
    "outcome": "code of how it ended",
    "outcome_numbers": "its kind, sentence, remedy, place, numbers and sub-outcomes, JSON object",
    "warnings": "warnings, JSON list",
    "wall_time_s": "wall time, s",
    "command_processor_time_s": "processor time, s, of the command that wrote the file, with its workers on the same "
    "machine, up to then; none where no command did",
    "beamsim_version": "version of beamsim that computed the result",
    "created": "when the result was made, ISO 8601, UTC",
    "provenance": "versions of Python and of the packages that the numbers depend on, JSON object",
    "input_files": "JSON object: by key of the scenario the file that it names, the folder that this is relative to, "
    "size and SHA-256 of the content; none where no file is named",
}
"""Attributes of the root of a result file, with their meanings."""


def items_of(result: Result) -> Items:
    """Everything of a result as its file stores it: attributes of the root, the summary, its datasets."""
    items = {"/": Item(root_attributes(result)), "/summary": Item(encode_summary(result.summary))}
    for dataset in result.datasets.values():
        items |= dataset.read()
    return items


def root_attributes(result: Result) -> dict[str, Any]:
    """What every result file says of its result."""
    attributes = {
        "schema_version": SCHEMA_VERSION, "command": KINDS[result.KIND].command, "kind": result.KIND,
        "scenario": result.scenario.to_yaml(), "title": result.title, **result.outcome.as_texts(),
        "warnings": _json(result.warnings), "wall_time_s": result.wall_time_s,
        "beamsim_version": result.beamsim_version, "created": result.created, "provenance": _json(result.provenance),
    }  # fmt: skip
    optional = {
        "command_processor_time_s": result.command_processor_time_s,
        "input_files": None if result.input_files is None else _json(result.input_files),
    }
    return attributes | {name: value for name, value in optional.items() if value is not None}


def _json(value: Any, **infinities: Mapping[float, str]) -> str:
    return json.dumps(as_builtin(value, **infinities), ensure_ascii=False)


_TEXTS: TypeAdapter[Any] = TypeAdapter(tuple[str, ...])
_TEXT_BY_NAME: TypeAdapter[Any] = TypeAdapter(dict[str, str])
_TEXT: TypeAdapter[Any] = TypeAdapter(str)
_NUMBER: TypeAdapter[Any] = TypeAdapter(float)
_NUMBER_IF_ANY: TypeAdapter[Any] = TypeAdapter(float | None)


def _root_fields(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a result that are attributes of the root.

    Raises
    ------
    KeyError
        If one is missing.
    ValueError
        If one is of another type.
    """
    return {
        "outcome": Outcome.from_texts(attributes),
        "warnings": _TEXTS.validate_json(attributes["warnings"], strict=True),
        "wall_time_s": _NUMBER.validate_python(attributes["wall_time_s"]),
        "command_processor_time_s": _NUMBER_IF_ANY.validate_python(attributes.get("command_processor_time_s")),
        "beamsim_version": _TEXT.validate_python(attributes["beamsim_version"], strict=True),
        "created": _TEXT.validate_python(attributes["created"], strict=True),
        "provenance": _TEXT_BY_NAME.validate_json(attributes["provenance"], strict=True),
    }


def _content(attributes: Mapping[str, Any], path: Path, *, contains: bool) -> Content:
    """What a file in the place of a new result holds; only its attributes are read.

    Parameters
    ----------
    attributes : attributes of the new result.
    path : of the file.
    contains : whether the new result contains a partial one of the same scenario.

    Returns
    -------
    Content
    """
    try:
        with open_result(path) as file:
            _kind(file, path)
            found = dict(file.attrs)
            cut_short = Outcome.from_texts(found).cut_short
            same = all(found.get(name) == attributes.get(name) for name in ("command", "scenario", "input_files"))
    except ResultFileError:
        return Content.UNKNOWN
    if not cut_short:
        return Content.RESULT
    return Content.CONTAINED if contains and same else Content.PARTIAL


def keep_result(result: Result, path: Path | str, *, resumed: bool = False) -> Path:
    """Write a result to a file; where that fails, to the first of the temporary and the home folder that has room.

    Parameters
    ----------
    result, path, resumed : as of `write_result`.

    Returns
    -------
    pathlib.Path
        Of the file that was written.

    Raises
    ------
    NotWrittenError
        If it is not in ``path`` (nor in `partial_file`): says where it is and how to move it, or that it is lost.
    """
    try:
        return write_result(result, path, resumed=resumed)
    except ResultFileError as error:
        raise _save_elsewhere(result, Path(path), error) from None


def _save_elsewhere(result: Result, path: Path, error: ResultFileError) -> NotWrittenError:
    """Write a result that could not be written to a path to another folder; the error that says where it is then."""
    reason = error.reason if isinstance(error, NotWrittenError) else str(error)
    target, folders = path.absolute(), [tempfile.gettempdir(), str(Path.home())]
    with suppress(OSError):  # the folder may be gone
        reason += f" ({shutil.disk_usage(target.parent).free / 1e6:.3g} MB are free there)"
    for folder in folders:
        elsewhere = Path(folder) / f"{target.stem}-{secrets.token_hex(3)}{target.suffix}"
        try:
            write_result(result, elsewhere)
        except ResultFileError:
            continue
        move = shlex.join(["mv", str(elsewhere), str(path)])
        size = f"{elsewhere.stat().st_size / 1e6:.3g} MB"
        return NotWrittenError(path, reason, f"the result ({size}) is in {elsewhere}; make room and move it: {move}")
    reason += f", nor is there room in {' or '.join(folders)}"
    remedy = "the result is lost; make room, or choose another path with -o, and run again"
    return NotWrittenError(path, reason, remedy)


INFINITIES = {math.inf: "Infinity", -math.inf: "-Infinity"}  # which JSON does not have; null is nan


def encode_summary(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Summary as attributes, see the module's docstring."""
    text_or_number = (str, int, float, np.integer, np.floating)
    encoded = [name for name, each in summary.items() if isinstance(each, bool) or not isinstance(each, text_or_number)]
    texts = {name: _json(summary[name], infinities=INFINITIES) for name in encoded}
    return {**summary, **texts, JSON_ENCODED: " ".join(encoded)}


def decode_summary(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Inverse of `encode_summary`."""
    encoded = set(str(attributes[JSON_ENCODED]).split())
    summary: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in encoded:
            decoded = json.loads(value)
            summary[name] = _with_all_numbers(decoded) if isinstance(decoded, (dict, list)) else decoded
        elif name != JSON_ENCODED:
            summary[name] = value.item() if isinstance(value, np.generic) else value
    return summary


def _with_all_numbers(value: Any) -> Any:
    """The value as it was before it was JSON."""
    if isinstance(value, dict):
        return {key: _with_all_numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_all_numbers(item) for item in value]
    if isinstance(value, str):
        return next((number for number, text in INFINITIES.items() if text == value), value)
    return math.nan if value is None else value


# --- Reading ---------------------------------------------------------------------------------------------------------


def load(path: Path | str, kind: str = "", *, whole: bool = False, open_files: bool = True) -> Any:
    """Read a result file of one of `KINDS` (of any kind without `kind`).

    The file is closed again. Arrays larger than 1 MiB are checked by their declarations now, and their values read when
    a field of the result is first used, for which the file must not have changed.

    Parameters
    ----------
    path : of the file.
    kind : of the result.
    whole : whether to read all values now, so that the file may change.
    open_files : whether files that its scenario names may be opened when the scenario is solved again.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout, kind or scenario.

    Examples
    --------
    >>> import beamsim, pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "case.h5"
    >>> _ = beamsim.write_result(beamsim.run("configs/stops/chain_bumpers.yaml"), file)
    >>> result = beamsim.load(file, "run", whole=True)
    >>> type(result).__name__, result.scenario.chain.snubbers[0].gap, len(result["events"]["time"].values)
    ('RunResult', 0.0005, 118)
    >>> folder.cleanup()
    """
    return open_with_items(path, kind, whole=whole, open_files=open_files)[0]


def open_with_items(
    path: Path | str, kind: str = "", *, whole: bool = False, open_files: bool = False
) -> tuple[Any, Items]:
    """A result as by `load`, and the items of its file."""
    with open_result(path, KINDS[kind].command if kind else "run") as file:
        actual = _kind(file, path)
        if kind and actual != kind:
            raise ResultFileError(f"{path}: contains {KINDS[actual].description}, not {KINDS[kind].description}")
        items, cls = read_items(file), resolve_name(KINDS[actual].result)
        _check_times(items)
        if whole:
            for item in items.values():
                item.array = item.values
        layouts = [each for each in cls.DATASETS if not each.optional or f"/{each.name}" in items]
        result = cls(
            scenario=_scenario(items["/"], path, open_files),
            summary=decode_summary(items["/summary"].attributes),
            datasets={layout.name: layout.read(items) for layout in layouts},
            **_root_fields(items["/"].attributes),
        )
        if not is_as_written(path):
            raise ValueError("it was changed after it was written")
        demand_summary(result)
    return result, items


_FILE_RECORDS: TypeAdapter[Any] = TypeAdapter(
    by_name(record({"file": str, "folder": str}, {"bytes": int, "sha256": str}))
)


def _scenario(root: Item, path: Path | str, open_files: bool) -> Scenario:
    """The scenario as it was written; the files that it names are those that were solved.

    Raises
    ------
    ResultFileError
        If it is none of this version.
    """
    try:
        scenario = stored_scenario(str(root.attributes["scenario"]))
    except ScenarioError as error:
        writer = root.attributes["beamsim_version"]
        raise ResultFileError(
            f"{path}: its scenario, written by beamsim {writer}, cannot be read by this version ({error.problems[0]}); "
            "open it with that version, or correct the scenario and run it again"
        ) from error
    files = _FILE_RECORDS.validate_json(str(root.attributes.get("input_files", "{}")), strict=True)
    return scenario.with_solved_files(SolvedFiles(files, Path(path).absolute().parent, open_files))


def kind_of(path: Path | str) -> str:
    """Kind of a result file, one of `KINDS`.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout.
    """
    with open_result(path) as file:
        return _kind(file, path)


def is_result_of_kind(path: Path | str, kind: str) -> bool:
    """Whether a file is a result file of this kind."""
    try:
        return kind_of(path) == kind
    except ResultFileError:
        return False


def _kind(file: Any, path: Path | str) -> str:
    """Kind of the result in an open file whose layout this version knows."""
    version, command, kind = (file.attrs.get(name) for name in ("schema_version", "command", "kind"))
    if version is None or command is None:
        raise ResultFileError(f"{path}: an HDF5 file, but not from beamsim; give the .h5 file of `beamsim run`")
    if not isinstance(version, (int, np.integer)) or not isinstance(kind, str):
        raise ValueError("schema_version or kind is of another type")
    if version != SCHEMA_VERSION:
        writer = file.attrs.get("beamsim_version", "unknown")
        raise ResultFileError(
            f"{path}: schema_version {version}, written by beamsim {writer}, but this beamsim reads "
            f"{SCHEMA_VERSION}; open it with that version or run its scenario again"
        )
    if kind not in KINDS:
        raise ResultFileError(f"{path}: written by `beamsim {command}`, whose result is unknown to this version")
    return str(kind)


TEXT = h5py.string_dtype("utf-8")
_OF_HDF5 = ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")
CHUNK_BYTES = 2**20  # of an array, that have a checksum together, if a row is not larger
_ITEM_BYTES = 8192  # more than HDF5 takes for an item besides its values and texts


def write_items(
    items: Items, path: Path | str, new: Content = Content.OUTPUT, examine: Callable[[Path], Content] | None = None
) -> Path:
    """Write items to a file, which takes its place when it is complete.

    Parameters
    ----------
    items : of a result.
    path, new, examine : as of `beamsim.files.destination`.

    Returns
    -------
    pathlib.Path
        Of the file that was written.

    Raises
    ------
    ResultFileError
        If it cannot be written (no permission, disk full, a folder of that name).
    """
    with temporary_file(path) as temporary:
        texts = sum(len(each) for item in items.values() for each in item.attributes.values() if isinstance(each, str))
        arrays = sum(item.array.nbytes for item in items.values() if item.array is not None)
        _reserve(temporary, arrays + 4 * texts + _ITEM_BYTES * len(items))
        with h5py.File(temporary, "w") as file:
            owners = {place: _create(file, place, item) for place, item in items.items()}
            for place, item in items.items():
                for k, axis in enumerate(item.axes):
                    owners[place].dims[k].attach_scale(owners[axis])
        seal(temporary)
        decided = destination(path, new, examine)
        put_in_place(temporary, decided)
    return decided.path


def _reserve(path: Path, size: int) -> None:
    """Take and give back the room of a file on its disk: HDF5 ends the process where a disk is full.

    Raises
    ------
    OSError
        If there is not enough.
    """
    with open(path, "xb") as file:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
            else:
                file.truncate(size)
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):  # of file systems that cannot
                raise


def _create(file: h5py.File, place: str, item: Item) -> h5py.Group | h5py.Dataset:
    """Make the group or dataset of an item."""
    if item.array is None:
        owner = file.require_group(place)
    else:
        array = np.asarray(item.array)
        if array.dtype.kind in "OU":
            array = array.astype(TEXT)
        array = array.view(np.uint8) if array.dtype == np.bool_ else array
        whole = array if array.flags.c_contiguous or not array.size else None
        owner = file.create_dataset(place, array.shape, array.dtype, whole, **_checksum(array))
        if whole is None:  # HDF5 copies what is not in one piece in memory
            count = max(CHUNK_BYTES * array.shape[0] // array.nbytes, 1)
            for first in range(0, array.shape[0], count):
                owner[first : first + count] = array[first : first + count]
    attributes = owner.attrs
    for name, value in item.attributes.items():
        attributes[name] = value
    if item.scale:
        owner.make_scale(last(place))
    return owner


def _checksum(array: Any) -> dict[str, Any]:
    """Options with which HDF5 stores a checksum of every chunk of an array; none where it cannot.

    It has none for single numbers, nothing, and text. Chunks are equal parts along the last axes: none is
    padded much, and what belongs to one member is read alone.
    """
    if not array.ndim or not array.size or array.dtype.kind == "O":
        return {}
    chunks, room = [1] * array.ndim, max(CHUNK_BYTES // array.dtype.itemsize, 1)
    for axis in reversed(range(array.ndim)):
        size = array.shape[axis]
        chunks[axis] = -(-size // -(-size // room))
        room //= chunks[axis]
        if chunks[axis] < size or not room:
            break
    return {"fletcher32": True, "chunks": tuple(chunks)}


def read_items(file: h5py.File) -> Items:
    """The items of an open file; large arrays are not read.

    Raises
    ------
    ValueError
        If an array is of another length than its axis, or neither of numbers nor of text.
    """
    items: Items = {"/": Item(_attributes(file))}
    scales: dict[int, str] = {}  # by address: to ask a scale for its name, HDF5 searches the file
    along: dict[str, list[int]] = {}
    state = state_of(os.stat(file.filename))

    def note(name: str, owner: h5py.Group | h5py.Dataset) -> None:
        place = f"/{name}"
        item = items[place] = Item(_attributes(owner))
        if isinstance(owner, h5py.Dataset):
            item.array, item.scale = _read_array(owner, state), owner.is_scale
            if item.scale:
                scales[_address(owner)] = place
            else:
                along[place] = [_address(scale) for scale in scales_of(owner)]

    file.visititems(note)
    for place, addresses in along.items():
        item = items[place]
        item.axes = tuple(scales.get(address, "") for address in addresses)
        for k, axis in enumerate(item.axes):
            if axis and items[axis].array.shape != item.array.shape[k : k + 1]:
                raise ValueError(f"{place} has {item.array.shape[k]} values along {axis}")
    return items


def _address(dataset: h5py.Dataset | None) -> int:
    """Where a dataset is in its file; -1 of none."""
    return -1 if dataset is None else int(h5py.h5o.get_info(dataset.id).addr)


def _attributes(owner: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    stored = owner.attrs
    values = {name: stored[name] for name in stored if name not in _OF_HDF5}
    for value in values.values():
        for text in np.atleast_1d(value) if isinstance(value, np.ndarray) else (value,):
            if isinstance(text, str):
                text.encode()  # h5py reads bytes that are no UTF-8 as surrogates: the error says that they are damage
    return values


@dataclass(frozen=True)
class StoredArray(LargeArray):
    """A large array of numbers in a result file, which is closed: values are read when they are used.

    Indexing reads a part, `numpy.asarray` the whole. Both raise a `ResultFileError` if the file has changed since, or
    cannot be read.
    """

    path: str
    name: str  # of the dataset
    state: FileState  # of the file
    selection: tuple[Any, ...] = ()  # numbers and ranges along the axes of the dataset, of a part of it

    def part(self, index: tuple[Any, ...]) -> Any:
        """A part of the array, which is read when it is used; a part of a part is read now.

        Parameters
        ----------
        index : a number or a range for each axis.
        """
        if self.selection:
            return np.asarray(self)[index]
        ranges = ((each, size) for each, size in zip(index, self.shape, strict=True) if isinstance(each, slice))
        return replace(self, shape=tuple(len(range(*each.indices(size))) for each, size in ranges), selection=index)

    def __getitem__(self, index: Any) -> Any:
        if self.selection:
            return np.asarray(self)[index]
        with self._opened() as dataset:
            return np.asarray(dataset[index]).view(self.dtype)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        with self._opened() as dataset:
            if not self.selection:
                return np.asarray(read_array(dataset).view(self.dtype), dtype)
            demand_memory(self.path, self.nbytes, f"for the values of {self.name}")
            return np.asarray(np.asarray(dataset[self.selection]).view(self.dtype), dtype)

    @contextmanager
    def _opened(self) -> Iterator[h5py.Dataset]:
        with open_result(self.path) as file:
            if state_of(os.stat(self.path)) != self.state:
                raise ResultFileError(f"{self.path}: has changed since it was opened; open it again")
            yield file[self.name]


def _read_array(dataset: h5py.Dataset, state: FileState) -> Any:
    """An array: texts as objects, flags as truth values; of numbers above `CHUNK_BYTES` a `StoredArray`."""
    demand_plausible(dataset)
    if dataset.compression is not None or dataset.scaleoffset is not None:
        raise ValueError(f"{dataset.name} is compressed, as no result is")
    size, dtype = values_size(dataset), dataset.dtype
    if dataset.id.get_storage_size() < size:
        raise ValueError(f"{dataset.name} claims more values than the file holds")
    if h5py.check_string_dtype(dtype) is not None:
        return np.asarray(dataset.asstr()[()], dtype=object)
    if not np.issubdtype(dtype, np.number) and dtype != np.bool_:
        raise ValueError(f"{dataset.name} holds {dtype}, neither numbers nor text")
    flags = dtype == np.uint8 and "flag_meanings" in dataset.attrs
    kind = np.dtype(np.bool_) if flags else dtype
    if size > CHUNK_BYTES:
        return StoredArray(dataset.shape, kind, os.path.abspath(dataset.file.filename), dataset.name, state)
    try:
        return np.asarray(dataset[()]).view(kind)
    except OSError as error:
        raise ValueError(f"{dataset.name} cannot be read: {error}") from None


@contextmanager
def open_result(path: Path | str, command: str = "run") -> Iterator[h5py.File]:
    """An HDF5 file, open for reading; errors in reading it are reported as its damage.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable or damaged; ``command`` is what writes such files.
    """
    remedy = f"give the .h5 file that `beamsim {command}` wrote"
    try:
        file = open_hdf5(path)
    except InputFileError as error:
        if error.missing:
            raise ResultFileError(f"{path}: no such result file; `beamsim {command} case.yaml` writes one") from None
        raise ResultFileError(f"{path}: {error.message}; {remedy}, or run the case again") from None
    try:
        with file, refusing_damage(path, "damaged"):
            yield file
    except InputFileError as error:
        raise ResultFileError(f"{path}: damaged ({error.message}); run the case again") from None


@contextmanager
def refusing_damage(path: Path | str, fault: str = _CONTRADICTION) -> Iterator[None]:
    """The boundary around what uses a result file: whatever a damaged or edited one causes becomes a refusal.

    Reading finds wrong types, forms and sizes. That parts of a result contradict each other (a value of a snubber that
    its scenario does not have) shows where they are used together: in a picture, a table, an export.

    Parameters
    ----------
    path : of the result file.
    fault : what is wrong with the file; the message goes on with the reason.

    Raises
    ------
    ResultFileError
        In place of any exception but those of this package, of the operating system, and for lack of memory.
    """
    try:
        yield
    except (BeamsimError, MemoryError, BrokenPipeError):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        reason = str(error).partition("\n")[0][:200]
        if isinstance(error, KeyError) and error.args:
            missing = str(error.args[0])[:200]
            reason = missing if " " in missing else f"{missing} is missing"
        raise ResultFileError(f"{path}: {fault} ({reason or type(error).__name__}); run the case again") from error


@contextmanager
def stored_result(path: Path | str, kind: str = "", *, open_files: bool = False) -> Iterator[Any]:
    """A result that is read by `load` and shown in the block, inside the boundary for damaged files.

    No file that its scenario names is opened meanwhile, unless ``open_files`` says so.

    Raises
    ------
    ResultFileError
        As `load`; also if parts of the result contradict each other.
    """
    result = load(path, kind, open_files=open_files)
    with refusing_damage(path):
        yield result


def _check_times(items: Items) -> None:
    """Raise a ValueError where the times of a result are not those from a start to an end, as a run writes them."""
    times = items["/histories/time"].array if "/histories/time" in items else np.zeros(1)
    if not 0.0 <= times[0] <= times[-1] < np.inf:
        raise ValueError("its times are not those of a run")
