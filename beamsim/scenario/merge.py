"""`extends` and overrides: merging of trees.

Mappings are merged, all other values are replaced. A mapping whose ``kind`` changes is replaced completely, and so
are mappings whose keys decide their meaning (``applied_to``, ``start``, ...). A key that excludes inherited ones
(``gap`` and ``preload``, ...) replaces them. ``null`` removes an inherited value.
"""

from __future__ import annotations

import copy
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path as FilePath
from typing import Any

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, counted, path_parts, path_text, single_line, suggestion
from beamsim.scenario.place import DEFAULT_NAMES
from beamsim.scenario.tree import NOWHERE, WrittenList, WrittenMapping, from_python, parse

Overrides = Mapping[str, object] | Sequence[str]

ALTERNATIVES: tuple[tuple[frozenset[str], ...], ...] = tuple(
    tuple(frozenset(keys.split()) for keys in either.split("|"))
    for either in ("continue_in | from to", "gap | preload", "section | width thickness", "periods | last",
                   "modes | highest_frequency")
)  # fmt: skip
"""Keys of one mapping that exclude each other: those given replace those inherited."""

REPLACED_WHOLE = frozenset({"applied_to", "at", "start", "released_force", "reduction"})
"""Mappings told apart by the keys they have; merging two of them would make neither."""


def read_file(path: FilePath) -> Any:
    """Read a YAML file, see `beamsim.scenario.tree.parse`.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is not text, or is not YAML.
    """
    file = str(path)
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise ScenarioError(Problem("", "does not exist", _similar_file(path), file)) from None
    except IsADirectoryError:
        raise ScenarioError(Problem("", "is a directory", "give a YAML file", file)) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ScenarioError(Problem("", f"cannot be read ({reason})", "check its path and permissions", file)) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ScenarioError(Problem("", "is not text in UTF-8", "give a YAML file", file, line)) from None
    return parse(text, file)


def _similar_file(path: FilePath) -> str:
    try:
        names = [item.name for item in path.parent.iterdir() if item.suffix in (".yaml", ".yml")]
    except OSError:
        return "check the path"
    close = get_close_matches(path.name, names, n=1)
    return f"did you mean {path.parent / close[0]}?" if close else "check the path (beamsim new writes a template)"


def resolve_extends(root: Any, file: str | None, folder: FilePath, chain: tuple[FilePath, ...] = ()) -> WrittenMapping:
    """Merge a document into the one it extends, recursively.

    Parameters
    ----------
    root : the document.
    file : what it was read from.
    folder : base of relative paths.
    chain : the files that extend this one.

    Raises
    ------
    ScenarioError
        If a document holds no keys, a file cannot be read, or files extend each other in a circle.
    """
    if root is None:
        message = "is empty" if file else "the scenario is empty"
        raise ScenarioError(Problem("", message, "beamsim new writes a template", file))
    if not isinstance(root, WrittenMapping):
        what = "a list" if isinstance(root, list) else f"only {single_line(root)}"
        message = f"holds {what} instead of the keys of a scenario"
        line = root.marks[0][1] if isinstance(root, WrittenList) and root else 1
        raise ScenarioError(Problem("", message, "write beam: or chain: first", file, line))
    named, where = root.pop("extends", None), root.marks.pop("extends", NOWHERE)
    if named is None:
        return root
    if not isinstance(named, str) or not named.strip():
        message = f"= {single_line(named)} must be the path of one file"
        raise ScenarioError(Problem("extends", message, "write extends: base.yaml", *where))
    path = FilePath(os.path.normpath(folder / named))
    identity = path.resolve()
    if identity in chain:
        message = f"= {named} refers back to {path}: the files extend each other in a cycle"
        raise ScenarioError(Problem("extends", message, "remove one of them", *where))
    try:
        base = read_file(path)
    except ScenarioError as error:
        if path.is_file():
            raise
        problem = error.problems[0]
        message = f"= {named}: {path} {problem.message}"
        remedy = problem.remedy or "the path is relative to the file that contains it"
        raise ScenarioError(Problem("extends", message, remedy, *where)) from None
    merged = merge(resolve_extends(base, str(path), path.parent, (*chain, identity)), root)
    assert isinstance(merged, WrittenMapping)
    return merged


def merge(base: Any, over: Any, key: str = "") -> Any:
    """Return ``base`` with ``over`` merged into it; ``key`` is that of both."""
    if not isinstance(base, WrittenMapping) or not isinstance(over, WrittenMapping) or key in REPLACED_WHOLE:
        return over
    if over.get("kind") not in (None, base.get("kind")):
        return over
    merged = WrittenMapping(base, over.mark, base.marks | over.marks)
    for name, item in over.items():
        merged[name] = merge(merged[name], item, name) if name in merged else item
    _drop_alternatives(merged, {name for name, item in over.items() if item is not None}, over.keys())
    return merged


def _drop_alternatives(keys: WrittenMapping, given: Collection[str], kept: Collection[str]) -> None:
    """Take the inherited alternatives of given keys out of a mapping, apart from those to keep."""
    for either in ALTERNATIVES:
        chosen = [names for names in either if names & set(given)]
        for names in either if chosen else ():
            for name in names - set(kept) if names not in chosen else ():
                keys.pop(name, None)


_EXAMPLE = "write for example beam.thickness=4 mm, snubbers.tip.gap=0.1 mm or snubbers[0].gap=0.1 mm"


def apply_overrides(root: WrittenMapping, overrides: Overrides) -> WrittenMapping:
    """Return the tree with values changed: ``{"beam.thickness": "4 mm"}`` or ``["beam.thickness=4 mm"]``.

    An item of a list is given by its index or name, ``snubbers.tip.gap``, all of them by ``[*]``. Values in text are
    read as YAML. An override acts like a file that extends this one and says only that: mappings merge, one whose kind
    changes is replaced whole, ``null`` takes a key away. Overrides of a
    ``kind`` come first, whatever their order, so that they don't undo the others.

    Raises
    ------
    ScenarioError
        For every override that cannot be read or does not exist.
    """
    root = copy.deepcopy(root)
    problems: list[Problem] = []
    if isinstance(overrides, str):
        overrides = [overrides]
    pairs: list[tuple[object, object]] = (
        list(overrides.items()) if isinstance(overrides, Mapping) else [(item, None) for item in overrides]
    )
    ready: list[tuple[str, Any]] = []
    for key, given in pairs:
        try:
            ready.append((str(key).strip(), from_python(given)) if isinstance(overrides, Mapping) else _split(str(key)))
        except ScenarioError as error:
            problems += error.problems
    written: set[Path] = set()
    for path, value in sorted(ready, key=lambda item: not item[0].endswith(".kind")):
        try:
            for place in _places(root, path):
                written.add(place)
                _with(root, place, value, (), written)
        except ScenarioError as error:
            problems += [replace(each, path=path) for each in error.problems]
    if problems:
        raise ScenarioError(problems)
    return root


def _split(override: str) -> tuple[str, Any]:
    path, equals, text = override.partition("=")
    if not equals:
        raise ScenarioError(Problem("", f"the override {single_line(override)} has no =", _EXAMPLE))
    try:
        value = parse(text)
    except ScenarioError as error:
        message = f"= {single_line(text)} {error.problems[0].message}"
        raise ScenarioError(Problem(path.strip(), message, "quote the value")) from None
    return path.strip(), from_python(value)


def _missing(message: str, remedy: str = _EXAMPLE) -> ScenarioError:
    """That the place of an override does not exist; its path is for the caller to add."""
    return ScenarioError(Problem("", f"does not exist: {message}", remedy))


def _places(root: WrittenMapping, path: str) -> list[Path]:
    """The places that a path means, in keys and indices: names of items and ``[*]`` resolved."""
    parts = path_parts(path)
    if not parts:
        raise ScenarioError(Problem("", "is not a path of an override", _EXAMPLE))
    places: list[tuple[Path, Any]] = [((), root)]
    for part in parts:
        places = [place for walked, items in places for place in _step(walked, items, part)]
    return [walked for walked, _ in places]


def _step(walked: Path, items: Any, part: str | int) -> Iterator[tuple[Path, Any]]:
    """One part of a path further; the value is None where the path leads to what is not there yet."""
    if part == "*":
        if not isinstance(items, list) or not items:
            raise _missing(f"{path_text(walked)} {'is empty' if items == [] else 'is not a list'}")
        yield from (((*walked, k), item) for k, item in enumerate(items))
        return
    if isinstance(items, list) and isinstance(part, str):
        part = _index_of(items, part, walked)
    inside = items.get(part) if isinstance(items, dict) else None
    if isinstance(items, list) and isinstance(part, int) and part < len(items):
        inside = items[part]
    yield (*walked, part), inside


def _index_of(items: list[Any], name: str, walked: Path) -> int:
    """Index of the item with a name, given or by default."""
    prefix = DEFAULT_NAMES.get(str(walked[-1]), "")
    names = [f"{prefix}_{k}" if prefix else "" for k in range(1, len(items) + 1)]
    for k, item in enumerate(items):
        if isinstance(item, dict) and item.get("name") is not None:
            names[k] = str(item["name"])
    if name in names:
        return names.index(name)
    where, given_names = path_text(walked), [known for known in names if known]
    if not given_names or any(isinstance(item, dict) and name in item for item in items):
        index = f"{where}[0].{name}" if items else f"{where} as a whole list"
        raise _missing(f"{where} is a list", f"name the item, for example {index}")
    raise _missing(f"{where} has no item called {name}", suggestion(name, given_names, "the names are"))


def _with(base: Any, parts: Path, value: Any, walked: Path, written: Collection[Path]) -> Any:
    """What stands at a place with a value further inside; what other overrides wrote there stays, see `ALTERNATIVES`.

    Parameters
    ----------
    base : what stands there, which is changed; None for nothing.
    parts : of the path, from there to the value.
    value : to be merged into what stands at its place.
    walked : where ``base`` stands.
    written : the places of this and of earlier overrides.
    """
    only_kind = parts == ("kind",) and bool(walked)  # merging a mapping that holds only the kind knows what to do
    if not parts or only_kind:
        return merge(base, from_python({"kind": value}) if only_kind else copy.deepcopy(value), str(walked[-1]))
    part, rest, where = parts[0], parts[1:], path_text(walked)
    if isinstance(part, int):
        if base is None:
            raise _missing(f"there is no {where}", f"give {where} as a whole list")
        if not isinstance(base, WrittenList):
            raise _missing(f"{where} is not a list")
        if part >= len(base):
            last = f"the last one is {where}[{len(base) - 1}]" if base else "give the whole list"
            raise _missing(f"{where} has {counted(len(base), 'item')}", last)
        base[part] = _with(base[part], rest, value, (*walked, part), written)
    else:
        if base is None or (not isinstance(base, dict) and walked[-1] in REPLACED_WHOLE):
            base = WrittenMapping({})
        if not isinstance(base, WrittenMapping):
            raise _missing(f"{where} is {single_line(base)}, without keys", f"replace {where} whole")
        if not rest and value is not None:
            _drop_alternatives(base, {part}, {name for name in base if (*walked, name) in written})
        base[part] = _with(base.get(part), rest, value, (*walked, part), written)
    if rest in ((), ("kind",)):
        base.marks.pop(part, None)
    return base
