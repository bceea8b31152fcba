"""Files that a scenario names: what they held when it was solved, and where they are when its result is opened."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path as FilePath
from typing import Any

from beamsim.errors import ScenarioError
from beamsim.scenario.base import Path, Schema, path_text, problem, walk
from beamsim.scenario.quantities import FileType

Record = Mapping[str, Any]
"""Of one file: ``file``, its name as it is written, ``folder``, where that was, ``bytes``, and ``sha256`` of its
content, which is missing where the file was changed or removed while the scenario was solved."""


def named_files(scenario: Schema) -> Iterator[tuple[Path, str]]:
    """Path of the key and name of every file that is given."""
    for path, part in walk(scenario):
        for key, name in type(part).keys().items():
            value = part.__dict__.get(name)
            if isinstance(value, str) and _names_file(type(part), name):
                yield (*path, key), value


@cache
def _names_file(section: type[Schema], name: str) -> bool:
    field = section.model_fields[name]
    return _holds_file_type((*field.metadata, field.annotation))


def _holds_file_type(items: Iterable[Any]) -> bool:
    return any(
        isinstance(item, FileType)
        or _holds_file_type((*getattr(item, "__metadata__", ()), *getattr(item, "__args__", ())))
        for item in items
    )


def records_of(scenario: Any, since: float) -> dict[str, Record]:
    """What the files of a scenario hold, by the keys that name them; of those that are gone nothing.

    Parameters
    ----------
    since : when the computation began, s since the epoch; what was changed later may not be what was solved.
    """
    records: dict[str, Record] = {}
    for path, name in named_files(scenario):
        folder = scenario.folder_of(*path)
        try:
            state = (folder / name).stat()
            content = {"bytes": state.st_size}
            content |= {} if state.st_mtime > since else {"sha256": _sha256(folder / name)}
        except OSError:
            content = {}
        records[path_text(path)] = {"file": name, "folder": str(folder.absolute()), **content}
    return records


def _sha256(path: FilePath) -> str:
    """Digest of the content; a file that has not changed is read once."""
    state = path.stat()
    return _digest(path.absolute(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=256)
def _digest(path: FilePath, modified: int, size: int) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class SolvedFiles:
    """The files of a scenario that was read from a result file."""

    records: Mapping[str, Record]  # by key; empty where an earlier version wrote the result
    beside: FilePath  # folder of the result file

    def folder_of(self, path: Path) -> FilePath:
        """Folder of the file that a key names: the current one, that of the result, or that in which it was solved.

        Raises
        ------
        ScenarioError
            If it is in none of them, or has another content than the one that was solved.
        """
        record = self.records.get(path_text(path)) or self.records.get(path_text(path[:-1]))
        if record is None:
            return FilePath()
        name = str(record["file"])
        folders = {
            FilePath(record["folder"]): "that of the case",
            self.beside: "that of the result",
            FilePath().absolute(): "the current folder",
        }  # each once, under the name that is nearest to the user
        there = [folder for folder in reversed(folders) if (folder / name).is_file()]
        for folder in there:
            if _is_solved(folder / name, record):
                return folder
        if there:
            reason = (
                "its content is another"
                if "sha256" in record
                else "it was changed or removed while the case was solved"
            )
            message = f"in {folders[there[0]]}, {there[0]}, is not the file that was solved: {reason}"
            remedy = "bring back the file as it was, or run the case again"
        else:
            searched = ", ".join(f"{said} ({folder})" for folder, said in reversed(folders.items()))
            message = f"is not found; searched: {searched}"
            remedy = "give the command in the folder of the case, or put the file beside the result"
        raise ScenarioError(problem(path, f"= {name} {message}", remedy))


def _is_solved(path: FilePath, record: Record) -> bool:
    return path.stat().st_size == record.get("bytes") and _sha256(path) == record.get("sha256")
