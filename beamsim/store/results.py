"""Writing and reading of result files.

The fields of the result declare what is stored, see `beamsim.fields`; `beamsim.store.flat` makes items of them, and
`beamsim.store.hdf5` a file. ``/summary`` has no datasets, only attributes under the names of the summary. Numbers and
texts are native attributes; everything else (per-probe values, lists, truth values, nothing) is a JSON text, and the
attribute ``json_encoded`` lists the names of those, separated by spaces. A NaN is ``null`` in JSON: inside a list or an
object read it back as NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from beamsim import __version__
from beamsim.errors import ResultFileError
from beamsim.fields import plain
from beamsim.kinds import KINDS, kind_of_class, named
from beamsim.store.flat import Item, Items, Reader, items_of
from beamsim.store.hdf5 import opened, read_items, write_items

if TYPE_CHECKING:
    from beamsim.analyses.result import Result
    from beamsim.scenario import Scenario
    from beamsim.scenario.scenario import Record

SCHEMA_VERSION = 2
JSON_ENCODED = "json_encoded"


# --- Writing ---------------------------------------------------------------------------------------------------------


def write_result(result: Result, path: Path | str) -> Path:
    """Write a result to ``path``; an existing file is replaced only when the new one is complete.

    Raises
    ------
    ResultFileError
        If the file cannot be written (no permission, disk full, a folder of that name).
    """
    items = items_of(result)
    items["/"].attributes |= {
        "schema_version": SCHEMA_VERSION,
        "beamsim_version": result.provenance.get("beamsim", __version__),
        "command": KINDS[kind_of_class(type(result))].command,
        "scenario": result.scenario.to_yaml(),
    }
    items["/summary"] = Item(encode_summary(result.summary))
    write_items(items, path)
    return Path(path)


def encode_summary(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Summary as attributes, see the module's docstring."""
    attributes: dict[str, Any] = {}
    encoded = []
    for name, value in summary.items():
        if isinstance(value, (str, int, float, np.integer, np.floating)) and not isinstance(value, bool):
            attributes[name] = value
        else:
            attributes[name] = json.dumps(plain(value), ensure_ascii=False)
            encoded.append(name)
    attributes[JSON_ENCODED] = " ".join(encoded)
    return attributes


def decode_summary(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Inverse of `encode_summary`."""
    encoded = set(str(attributes[JSON_ENCODED]).split())
    summary: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in encoded:
            decoded = json.loads(value)
            summary[name] = _nan_for_null(decoded) if isinstance(decoded, (dict, list)) else decoded
        elif name != JSON_ENCODED:
            summary[name] = value.item() if isinstance(value, np.generic) else value
    return summary


def _nan_for_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _nan_for_null(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_nan_for_null(item) for item in value]
    return math.nan if value is None else value


# --- Reading ---------------------------------------------------------------------------------------------------------


class LazyScenario:
    """Mixin of results read from a file: the scenario is parsed on first use."""

    scenario_yaml: str
    beamsim_version: str
    _title: str
    _input_files: dict[str, Record] | None
    _folder: Path  # of the result file

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario as it was written; the files that it names are those that were solved."""
        from beamsim.scenario import load_scenario
        from beamsim.scenario.scenario import SolvedFiles

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
        """The result with these fields; without the scenario ``__init__`` cannot be called."""
        stored = cls.__new__(cls)
        stored.__dict__.update(fields)
        return stored


@cache
def _stored(cls: Any) -> Any:
    return type(f"Stored{cls.__name__}", (LazyScenario, cls), {"__doc__": f"A `{cls.__name__}` read from a file."})


def open_result(path: Path | str, kind: str = "") -> Any:
    """Read a result file of one of `KINDS` (of any kind without `kind`).

    ``result.scenario`` is parsed on first use.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout or kind.
    """
    return open_with_items(path, kind)[0]


def open_with_items(path: Path | str, kind: str = "") -> tuple[Any, Items]:
    """A result as by `open_result`, and the items of its file."""
    with opened(path, KINDS[kind].command if kind else "run") as file:
        actual = _kind(file, path)
        if kind and actual != kind:
            raise ResultFileError(f"{path}: contains {KINDS[actual].called}, not {KINDS[kind].called}")
        items, home = read_items(file), named(KINDS[actual].result)
        root = items["/"].attributes
        fields = {
            "scenario_yaml": str(root["scenario"]),
            "beamsim_version": str(root["beamsim_version"]),
            "_title": str(root["title"]),
            "_input_files": json.loads(root["input_files"]) if "input_files" in root else None,
            "_folder": Path(path).absolute().parent,
            "summary": decode_summary(items["/summary"].attributes),
            **Reader(items).fields(home),
        }
    return _stored(home).of(fields), items


def kind_of(path: Path | str) -> str:
    """Kind of a result file, one of `KINDS`.

    Raises
    ------
    ResultFileError
        If the file is missing, unreadable, damaged, not from beamsim, or of another layout.
    """
    with opened(path) as file:
        return _kind(file, path)


def holds(path: Path | str, kind: str) -> bool:
    """Whether a file is a result file of this kind."""
    try:
        return kind_of(path) == kind
    except ResultFileError:
        return False


def _kind(file: Any, path: Path | str) -> str:
    """Kind of an open file whose layout this version knows."""
    version, command, kind = (file.attrs.get(name) for name in ("schema_version", "command", "kind"))
    if version is None or command is None:
        raise ResultFileError(f"{path}: an HDF5 file, but not from beamsim; give the .h5 file of `beamsim run`")
    if version != SCHEMA_VERSION:
        writer = file.attrs.get("beamsim_version", "unknown")
        raise ResultFileError(
            f"{path}: schema_version {version}, written by beamsim {writer}, but this beamsim reads "
            f"{SCHEMA_VERSION}; open it with that version or run its scenario again"
        )
    if command == "sweep":
        return "designs" if "designs" in file else "continuation" if kind == "continuation" else "sweep"
    if command not in KINDS:
        raise ResultFileError(f"{path}: written by `beamsim {command}`, which is unknown to this version")
    return str(command)
