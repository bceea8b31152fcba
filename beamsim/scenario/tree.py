"""YAML as data that store the file and line of every value; and back to text.

PyYAML alone reads ``2e5`` as text and ``off`` as false, and silently keeps the last of two equal keys. Here numbers and
booleans follow YAML 1.2, and equal keys are refused. Anchors, aliases and merge keys (``<<``) work.

`extends` and overrides merge such trees: mappings are merged, all other values are replaced. A mapping whose ``kind``
changes is replaced completely, and so are mappings whose keys decide their meaning (``applied_to``, ``start``, ...). A
key that excludes inherited ones (``gap`` and ``preload``, ...) replaces them. ``null`` removes an inherited value.
"""

from __future__ import annotations

import copy
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from numbers import Integral, Real
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any

import yaml

from beamsim.errors import InputFileError, Problem, ScenarioError
from beamsim.files import protect, read_input
from beamsim.scenario.base import (
    NO_MARK,
    InvalidValueError,
    Mark,
    Path,
    count_text,
    path_parts,
    path_text,
    problem,
    single_line,
    suggestion,
)
from beamsim.scenario.body import DEFAULT_NAMES
from beamsim.scenario.units import Dimension, UnitError, read_quantity

MOST_CHARACTERS = 1_000_000
"""A longer document is refused: reading it would take seconds."""
_KEEP_APART = "keep measured data in files of their own"
MOST_VALUES = 25_000
"""A document with more keys and values (as written, or with aliases expanded) is refused: PyYAML would need more than
two seconds."""
_UNFOLDS = f"unfolds to more than {MOST_VALUES} values"


class WrittenMapping(dict[str, Any]):
    """A mapping with the location of itself and of the value of each key."""

    mark: Mark = NO_MARK
    marks: Mapping[Any, Mark] = MappingProxyType({})


class WrittenList(list[Any]):
    """A list with the location of each item."""

    marks: Mapping[Any, Mark] = MappingProxyType({})
    from_python_array = False  # whether it is a Python array or list, not text


def from_python(value: object) -> Any:
    """Convert a Python value to plain data: mappings, sequences, numbers (also NumPy), text; without locations."""
    if isinstance(value, Mapping):
        return WrittenMapping({str(key): from_python(item) for key, item in value.items()})
    if isinstance(value, (list, tuple)):
        items = WrittenList(from_python(item) for item in value)
        items.from_python_array = getattr(value, "of_python", True)
        return items
    if isinstance(value, (bool, str)) or value is None:
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        try:
            return float(value)
        except OverflowError:  # of a fraction
            return math.inf
    return from_python(value.tolist()) if hasattr(value, "tolist") else value  # NumPy arrays and scalars


def locate(root: Any, path: Path) -> Mark:
    """File and line of the value at a path, or of the nearest enclosing value."""
    value, mark = root, (root.mark[0], None)
    for part in path:
        part = str(part) if isinstance(value, dict) else part
        inside = part in value if isinstance(value, dict) else isinstance(value, list) and part in range(len(value))
        if not inside:
            break
        mark, value = value.marks.get(part, NO_MARK), value[part]
    return mark


def located_problem(root: Any, item: Problem) -> Problem:
    """A copy of a problem with the file and line of its path."""
    file, line = locate(root, tuple(path_parts(item.path)) or _written_path(root, item.path))
    return replace(item, file=file, line=line)


def _written_path(root: Any, path: str) -> Path:
    """Keys and indices of the value at a path with an invalid key (``gap:0.1 mm``), or of the one above it."""
    value, walked = root, Path()
    while isinstance(value, (dict, list)):
        below = {path_text((*walked, key)): key for key in (value if isinstance(value, dict) else range(len(value)))}
        texts = [text for text in below if path == text or path.startswith((f"{text}.", f"{text}["))]
        if not texts:
            break
        key = below[max(texts, key=len)]
        value, walked = value[key], (*walked, key)
    return walked


class _TooLong(Exception):
    """The document has more values than allowed; stores the line of the first value beyond the limit."""


class _Loader(yaml.SafeLoader):
    """Resolves plain scalars as YAML 1.2 does, and stops at `MOST_VALUES`."""

    value_count = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Compose the next value; stop if there are too many."""
        self.value_count += 1
        if self.value_count > MOST_VALUES:
            raise _TooLong(self.line + 1)
        return super().compose_node(parent, index)


_Loader.yaml_implicit_resolvers = {}
_TAG = "tag:yaml.org,2002:"
for _tag, _pattern, _first in (
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", "-+.0123456789"),
    ("float", r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)", "-+."),
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("merge", r"<<", "<"),
):
    _Loader.add_implicit_resolver(_TAG + _tag, re.compile(rf"(?:{_pattern})\Z"), list(_first))


def parse(text: str, file: str | None = None) -> Any:
    """Read one YAML document, with the location of mappings, lists and values.

    Raises
    ------
    ScenarioError
        If it is not YAML, contains several documents or custom tags, or a mapping has equal keys or a key that is not
        text; with all such problems.
    """
    reader = _Reader(file)
    try:
        document = yaml.compose(text, Loader=_Loader)
        data = None if document is None else reader.data(document, ())
    except (_TooLong, yaml.YAMLError, RecursionError, ValueError) as error:
        raise ScenarioError(_unreadable(error, text, file)) from None
    if reader.problems:
        raise ScenarioError(reader.problems)
    return data


def _unreadable(error: Exception, text: str, file: str | None) -> Problem:
    """The problem of a text that is not a valid document."""
    if isinstance(error, _TooLong):
        message = f"has more than {MOST_VALUES} keys and values"
        return problem((), message, _KEEP_APART, (file, error.args[0]))
    if isinstance(error, yaml.MarkedYAMLError):
        return _syntax_problem(error, text, file)
    if isinstance(error, yaml.reader.ReaderError):
        line = text.count("\n", 0, error.position) + 1
        character = f"U+{error.character:04X}" if isinstance(error.character, int) else str(error.character)
        message = f"contains a character that YAML does not allow ({character})"
        return problem((), message, "remove it", (file, line))
    message = "is nested too deeply" if isinstance(error, RecursionError) else f"is not YAML: {error}"
    return problem((), message, "check the brackets", (file, None))


def _open_bracket(error: yaml.MarkedYAMLError, text: str) -> str:
    """The bracket inside which parsing failed, and its line; empty if it failed outside brackets."""
    mark = error.context_mark
    if mark is None or error.context not in ("while parsing a flow mapping", "while parsing a flow sequence"):
        return ""
    return f"{text.splitlines()[mark.line][mark.column]} of line {mark.line + 1}"


def _colon_remedy(lines: list[str]) -> str:
    """The remedy for a misplaced colon in the last of the lines: the line before may lack one."""
    before = [number for number, line in enumerate(lines[:-1], 1) if line.partition("#")[0].strip()]
    if before and ":" not in lines[before[-1] - 1].partition("#")[0]:
        return f"line {before[-1]} has no colon between key and value"
    return "check the indentation of this line and the one before, and quote text that contains a colon"


def _syntax_problem(error: yaml.MarkedYAMLError, text: str, file: str | None) -> Problem:
    mark = error.problem_mark or error.context_mark
    parts = [part for part in (error.context, error.problem) if part]
    if error.problem and "found character '\\t'" in error.problem:
        parts = ["tabs cannot indent"]
    if error.problem == "but found another document":
        place = file, mark.line + 1 if mark else None
        return problem((), "contains a second document", "keep one document per file", place)
    remedy = "check indentation, colons, quotes and brackets"
    line = text.splitlines()[mark.line] if mark and mark.line < len(text.splitlines()) else ""
    if path := re.search(r"[A-Za-z_][\w.]*\[(?:\d+|\*)\][\w.\[\]*]*", line):
        remedy = f'quote a path with brackets: "{path[0]}"'
    elif mark and line[mark.column : mark.column + 1] == "*":
        remedy = "quote text that begins with *"
    elif opened := _open_bracket(error, text):
        remedy = f"is the {opened} closed, with commas between its items?"
    elif mark and error.problem in (
        "mapping values are not allowed here",
        "expected '<document start>', but found '<block mapping start>'",
    ):
        remedy = _colon_remedy(text.splitlines()[: mark.line + 1])
    return problem((), "is not YAML: " + ", ".join(parts), remedy, (file, mark.line + 1 if mark else None))


@dataclass
class _Reader:
    """Converts PyYAML's nodes to data with locations."""

    file: str | None
    problems: list[Problem] = field(default_factory=list)
    open_nodes: set[int] = field(default_factory=set)
    count: int = 0

    def data(self, node: yaml.Node, path: Path) -> Any:
        """Convert a node at a path: mappings and lists with locations, and scalars."""
        self.count += 1
        if self.count > MOST_VALUES:
            raise ScenarioError(problem((), _UNFOLDS, "use fewer aliases", (self.file, None)))
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, path)
        if node.tag != _TAG + ("map" if isinstance(node, yaml.MappingNode) else "seq"):
            self._problem(path, f"has the tag {node.tag}", "remove the tag", node)
        if id(node) in self.open_nodes:
            self._problem(path, "contains itself through an alias", "remove the alias", node)
            return None
        self.open_nodes.add(id(node))
        try:
            if isinstance(node, yaml.MappingNode):
                return self._mapping(node, path)
            items = WrittenList(self.data(item, (*path, index)) for index, item in enumerate(node.value))
            items.marks = {index: (self.file, item.start_mark.line + 1) for index, item in enumerate(node.value)}
            return items
        finally:
            self.open_nodes.discard(id(node))

    def _note_duplicate(self, path: Path, line: int, node: yaml.Node) -> None:
        """Record a key that was already given, with its line."""
        self._problem(path, f"is given twice, first in line {line}", "keep one of the two", node)

    def _scalar(self, node: yaml.ScalarNode, path: Path) -> object:
        """Convert the text, number or boolean of a node at a path."""
        kind = node.tag.removeprefix(_TAG)
        try:
            return _SCALARS[kind](node.value)
        except (ValueError, KeyError):
            self._unreadable_scalar(node, path, kind)
            return None

    def _unreadable_scalar(self, node: yaml.ScalarNode, path: Path, kind: str) -> None:
        """Record a node with an unknown tag, or with text that does not fit its tag."""
        if kind in _SCALARS:
            message = f"= {single_line(node.value)} is not a valid {kind}"
            self._problem(path, message, "correct it, or remove its tag", node)
        else:
            self._problem(path, f"has the tag {node.tag}", "remove the tag", node)

    def _problem(self, path: Path, message: str, remedy: str, node: yaml.Node) -> None:
        self.problems.append(problem(path, message, remedy, (self.file, node.start_mark.line + 1)))

    def _mapping(self, node: yaml.MappingNode, path: Path) -> WrittenMapping:
        items, merges = WrittenMapping(), []
        marks: dict[str, Mark] = {}
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            if key_node.tag not in (_TAG + "str", _TAG + "bool") or not isinstance(key_node, yaml.ScalarNode):
                merges += self._merged(key_node, value_node, path)
                continue
            key = key_node.value
            value = self.data(value_node, (*path, key))
            if key in items:
                self._note_duplicate((*path, key), lines[key], key_node)
                continue
            items[key], lines[key] = value, key_node.start_mark.line + 1
            marked = value_node if isinstance(value_node.value, str) else key_node
            marks[key] = self.file, marked.start_mark.line + 1
        for key_node, value_node in merges:
            self._merge(items, marks, value_node, path, key_node)
        items.mark, items.marks = (self.file, node.start_mark.line + 1), marks
        return items

    def _merged(self, key_node: yaml.Node, value_node: yaml.Node, path: Path) -> list[tuple[yaml.Node, yaml.Node]]:
        """Resolve a key that is not text: a merge key gives the keys of another mapping, others are problems."""
        if key_node.tag == _TAG + "merge":
            return [(key_node, value_node)]
        shown = single_line(key_node.value) if isinstance(key_node.value, str) else "a list or mapping"
        self._problem(path, f"has the key {shown}, which is not text", "name the key", key_node)
        return []

    def _merge(
        self, items: WrittenMapping, marks: dict[str, Mark], node: yaml.Node, path: Path, key_node: yaml.Node
    ) -> None:
        """Add the keys of merged mappings that a mapping does not have itself; the first mapping wins."""
        for source in node.value if isinstance(node, yaml.SequenceNode) else [node]:
            if not isinstance(source, yaml.MappingNode):
                remedy = "merge an alias of a mapping: <<: *name"
                self._problem(path, "merges (<<) a value that is not a mapping", remedy, key_node)
                continue
            merged = self.data(source, path)
            for key, value in merged.items():
                if key not in items:
                    items[key], marks[key] = value, merged.marks.get(key, NO_MARK)


_SCALARS: dict[str, Callable[[str], object]] = {
    "str": str,
    "merge": str,
    "null": lambda text: None,
    "bool": lambda text: {"true": True, "false": False}[text.lower()],
    "int": lambda text: int(text, 0 if text[:2] in ("0o", "0x") else 10),
    "float": lambda text: float(text.lower().replace(".inf", "inf").replace(".nan", "nan")),
}
"""Function that reads the text of each kind of scalar, by its YAML name."""


class _Dumper(yaml.SafeDumper):
    """Quotes text that YAML 1.1 or YAML 1.2 would read as another type."""


_Dumper.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?\Z"),
    list("-+.0123456789"),
)


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Escape the line break U+0085, which PyYAML writes unchanged and reads back as a space."""
    style = '"' if "\x85" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent_text)

_FIRST = ("name", "kind", "body", "at", "position", "mass", "between", "masses", "applied_to", "level")


def dump_yaml(data: Any) -> str:
    """Plain data as YAML text; keys that identify a mapping come first."""
    return yaml.dump(
        _order(data), Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120
    )


def _order(value: Any) -> Any:
    if isinstance(value, dict):
        keys = [*(key for key in _FIRST if key in value), *(key for key in value if key not in _FIRST)]
        return {key: _order(value[key]) for key in keys}
    return [_order(item) for item in value] if isinstance(value, list) else value


Overrides = Mapping[str, object] | Sequence[str]

ALTERNATIVES: tuple[tuple[frozenset[str], ...], ...] = tuple(
    tuple(frozenset(keys.split()) for keys in either.split("|"))
    for either in ("continue_in | from to", "gap | preload", "section | width thickness", "periods | last",
                   "modes | highest_frequency")
)  # fmt: skip
"""Keys of a mapping that exclude each other: a given key replaces the inherited ones."""

REPLACED_WHOLE = frozenset({"applied_to", "at", "mounted_on", "start", "released_force", "reduction"})
"""Mappings that are identified by their keys; merging two of them would be invalid."""


def read_file(path: FilePath) -> Any:
    """Read a YAML file, see `beamsim.scenario.tree.parse`.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is too long, is not text, or is not YAML.
    """
    protect(path)
    file = str(path)
    try:
        raw = read_input(path, 4 * MOST_CHARACTERS, _KEEP_APART)
    except InputFileError as error:
        remedy = _similar_file(path) if error.missing else error.remedy
        raise ScenarioError(problem((), error.message, remedy, (file, None))) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ScenarioError(_not_text(raw, error, file)) from None
    if len(text) > MOST_CHARACTERS:
        message = f"has {len(text):.3g} characters, more than the {MOST_CHARACTERS:.0e} of the longest scenario"
        raise ScenarioError(problem((), message, _KEEP_APART, (file, None)))
    return parse(text, file)


def _not_text(raw: bytes, error: UnicodeDecodeError, file: str) -> Problem:
    """The problem of a file that is not text; with a remedy for result files."""
    if raw.startswith(b"\x89HDF"):  # 0x89 cannot start a UTF-8 character
        remedy = f'a result is read by beamsim.load("{file}"), its case is beamsim.load("{file}").scenario'
        return problem((), "is an HDF5 file, not YAML", remedy, (file, None))
    line = raw.count(b"\n", 0, error.start) + 1
    return problem((), "is not text in UTF-8", "give a YAML file", (file, line))


def _similar_file(path: FilePath) -> str:
    try:
        names = [item.name for item in path.parent.iterdir() if item.suffix in (".yaml", ".yml")]
    except OSError:
        return "check the path"
    close = get_close_matches(path.name, names, n=1)
    return f"did you mean {path.parent / close[0]}?" if close else "check the path (beamsim new writes a template)"


def resolve_extends(root: Any, file: str | None, folder: FilePath, chain: tuple[FilePath, ...] = ()) -> WrittenMapping:
    """Merge a document into the document that it extends, recursively.

    Parameters
    ----------
    root : the document.
    file : the file that it was read from.
    folder : base folder of relative paths.
    chain : the files that extend this one.

    Returns
    -------
    WrittenMapping
        The merged document, without ``extends``.

    Raises
    ------
    ScenarioError
        If a document has no keys, a file cannot be read, or files extend each other in a circle.
    """
    if not isinstance(root, WrittenMapping):
        raise ScenarioError(_without_keys(root, file))
    named, where = root.pop("extends", None), root.marks.get("extends", NO_MARK)
    return root if named is None else _merge_into_base(root, named, where, folder, chain)


def _merge_into_base(
    root: WrittenMapping, base_name: Any, mark: Mark, folder: FilePath, chain: tuple[FilePath, ...]
) -> WrittenMapping:
    """Merge a document into the file that it extends; see `resolve_extends`."""
    if not isinstance(base_name, str) or not base_name.strip():
        message = f"= {single_line(base_name)} must be the path of one file"
        raise ScenarioError(problem(("extends",), message, "write extends: base.yaml", mark))
    path = FilePath(os.path.normpath(folder / base_name))
    try:
        base = read_file(path)
    except ScenarioError as error:
        if os.path.isfile(path):
            raise
        first = error.problems[0]
        message = f"= {base_name}: {path} {first.message}"
        remedy = first.remedy or "the path is relative to the file that contains it"
        raise ScenarioError(problem(("extends",), message, remedy, mark)) from None
    identity = path.resolve()
    if identity in chain:
        message = f"= {base_name} refers back to {path}: the files extend each other in a cycle"
        raise ScenarioError(problem(("extends",), message, "remove one of them", mark))
    merged = merge(resolve_extends(base, str(path), path.parent, (*chain, identity)), root)
    assert isinstance(merged, WrittenMapping)
    return merged


def _without_keys(root: Any, file: str | None) -> Problem:
    """The problem of a document that is empty, a list or a single value."""
    if root is None:
        message = "is empty" if file else "the scenario is empty"
        return problem((), message, "beamsim new writes a template", (file, None))
    what = "a list" if isinstance(root, list) else f"only {single_line(root)}"
    line = root.marks[0][1] if isinstance(root, WrittenList) and root else 1
    return problem((), f"holds {what} instead of the keys of a scenario", "write beam: or chain: first", (file, line))


class _NestedOverrides(WrittenMapping):
    """Overrides inside a mapping, by key, or inside a list, by index; they do not replace it as a whole."""


def merge(base: Any, changes: Any, key: str = "") -> Any:
    """Merge a value into the corresponding value of the extended document.

    Parameters
    ----------
    base : the value that is extended.
    changes : the value to merge. It replaces ``base`` unless both are mappings of the same kind whose key is not in
        `REPLACED_WHOLE`.
    key : key of both values.

    Returns
    -------
    The merged value.
    """
    inside = isinstance(changes, _NestedOverrides)
    if isinstance(base, WrittenList) and inside:
        items = WrittenList(merge(item, changes[k]) if k in changes else item for k, item in enumerate(base))
        items.marks = {
            **base.marks,
            **{k: NO_MARK for k, item in changes.items() if not isinstance(item, _NestedOverrides)},
        }
        return items
    if not isinstance(base, WrittenMapping) or not isinstance(changes, WrittenMapping):
        return changes
    if (key in REPLACED_WHOLE and not inside) or changes.get("kind") not in (None, base.get("kind")):
        return changes
    written = {
        name: changes.marks.get(name, NO_MARK)
        for name, item in changes.items()
        if not isinstance(item, _NestedOverrides)
    }
    merged = WrittenMapping(base)
    merged.mark, merged.marks = base.mark if inside else changes.mark, {**base.marks, **written}
    for name, item in changes.items():
        merged[name] = merge(merged[name], item, name) if name in merged else item
        if item is None and name in base:
            del merged[name]
    given = {name for name, item in changes.items() if item is not None}
    for either in ALTERNATIVES:  # a given key replaces inherited alternatives
        chosen = [names for names in either if names & given]
        for names in either if chosen else ():
            for name in names - changes.keys() if names not in chosen else ():
                merged.pop(name, None)
    return merged


_EXAMPLE = "write for example beam.thickness=4 mm, snubbers.tip.gap=0.1 mm or snubbers[0].gap=0.1 mm"


def apply_overrides(root: WrittenMapping, overrides: Overrides) -> WrittenMapping:
    """Change values in a document: ``{"beam.thickness": "4 mm"}`` or ``["beam.thickness=4 mm"]``.

    A list item is named by its index or name, ``snubbers.tip.gap``, all items by ``[*]``. Values given as text are read
    as YAML. Overrides act like one file that extends this one: mappings are merged, a mapping whose kind changes is
    replaced, ``null`` removes a key. An override of a whole mapping or list is applied before overrides inside it, in
    any order.

    Raises
    ------
    ScenarioError
        With every override that cannot be read or whose path does not exist.
    """
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
    added, changed = _NestedOverrides({}), root
    for path, value in sorted(ready, key=lambda item: len(path_parts(item[0]))):
        try:
            for place in _places(changed, path):
                within: Any = added
                for depth, part in enumerate(place[:-1], 1):
                    within = within.setdefault(part, _NestedOverrides({})) if isinstance(within, dict) else within[part]
                    if within is None:
                        raise InvalidValueError(
                            f"contradicts {path_text(place[:depth])} = null", "leave one of the two out"
                        )
                within[place[-1]] = copy.deepcopy(value)
            changed = merge(root, added)
        except InvalidValueError as error:
            remedy = body_path_remedy(root, path_parts(path)) or error.remedy
            problems.append(problem((path,), error.message, remedy))
    if problems:
        raise ScenarioError(problems)
    return changed


def written_number(root: Any, path: Path, value: float, dimension: Dimension) -> float | str | None:
    """The text or number that the user wrote for a value, or in the parameters of a study; None if there is none.

    Parameters
    ----------
    root : the data.
    path : path of the number.
    value, dimension : SI, and its dimension.
    """
    here = root
    for key in path:
        inside = key in here if isinstance(here, dict) else isinstance(here, list) and key in range(len(here))
        here = here[key] if inside else None
    for text in (here, *_numbers(root.get("vary")), *_numbers(root.get("optimise"))):
        with suppress(UnitError):
            if read_quantity(text, dimension) == value:
                return text  # type: ignore[no-any-return]
    return None


def _numbers(data: Any) -> Iterator[Any]:
    """All numbers and texts in data, except those from Python arrays."""
    if isinstance(data, dict):
        data = list(data.values())
    if isinstance(data, list):
        for item in () if isinstance(data, WrittenList) and data.from_python_array else data:
            yield from _numbers(item)
    else:
        yield data


def _split(override: str) -> tuple[str, Any]:
    path, equals, text = override.partition("=")
    if equals and not path.strip():
        raise ScenarioError(problem((), f"the override {single_line(override)} has no path before =", _EXAMPLE))
    if not equals:
        raise ScenarioError(problem((), f"the override {single_line(override)} has no =", _EXAMPLE))
    try:
        value = parse(text)
    except ScenarioError as error:
        message = f"= {single_line(text)} {error.problems[0].message}"
        raise ScenarioError(problem((path.strip(),), message, "quote the value")) from None
    return path.strip(), from_python(value)


def _places(root: WrittenMapping, path: str) -> list[Path]:
    """Paths of all values that a path stands for, with names of items and ``[*]`` resolved."""
    parts = path_parts(path)
    if not parts:
        raise InvalidValueError("is not a path of an override", _EXAMPLE)
    places: list[tuple[Path, Any]] = [((), root)]
    for part in parts:
        places = [place for walked, items in places for place in _step(walked, items, part)]
    return [walked for walked, _ in places]


def _step(prefix: Path, items: Any, part: str | int) -> Iterator[tuple[Path, Any]]:
    """Resolve one part of a path; the value is None if it does not exist yet."""
    where = path_text(prefix)
    if isinstance(items, list):
        yield from (((*prefix, k), items[k]) for k in indices(items, part, prefix))
    elif items is None and (isinstance(part, int) or (prefix and prefix[-1] in DEFAULT_NAMES)):
        raise InvalidValueError(f"does not exist: there is no {where}", f"give {where} as a whole list")
    elif isinstance(part, int) or part == "*":
        raise InvalidValueError(f"does not exist: {where} is not a list", _EXAMPLE)
    elif items is None or isinstance(items, dict) or prefix[-1] in REPLACED_WHOLE:
        yield (*prefix, part), items.get(part) if isinstance(items, dict) else None
    else:
        message = f"does not exist: {where} is {single_line(items)}, without keys"
        raise InvalidValueError(message, f"replace {where} whole")


def indices(items: Sequence[Any], part: str | int, prefix: Path) -> Sequence[int]:
    """Indices of the list items that a part of a path stands for: one by its index or name, all by ``*``.

    Parameters
    ----------
    items : data as written, or sections.
    part : the part of the path.
    prefix : path of the list.

    Raises
    ------
    InvalidValueError
        If there is no such item.
    """
    where = path_text(prefix)
    if part == "*" and items:
        return range(len(items))
    if isinstance(part, int):
        if part < len(items):
            return [part]
        last = f"the last one is {where}[{len(items) - 1}]" if items else "give the whole list"
        raise InvalidValueError(f"does not exist: {where} has {count_text(len(items), 'item')}", last)
    default_name = DEFAULT_NAMES.get(str(prefix[-1]), "")
    names = [f"{default_name}_{k}" if default_name else "" for k in range(1, len(items) + 1)]
    for k, item in enumerate(items):
        if (named := item.get("name") if isinstance(item, dict) else getattr(item, "name", None)) is not None:
            names[k] = str(named)
    if part in names:
        return [names.index(part)]
    known = [name for name in names if name]
    if not known or any(part in item for item in items if isinstance(item, dict)):
        example = f"name the item, for example {where}[0].{part}" if items else f"give {where} as a whole list"
        raise InvalidValueError(f"does not exist: {where} is {'a list' if items else 'empty'}", example)
    raise InvalidValueError(
        f"does not exist: {where} has no item called {part}", suggestion(part, known, "the names are")
    )


def body_path_remedy(root: WrittenMapping, parts: Sequence[str | int]) -> str:
    """A remedy that adds the body to the path of one of its items (``chain.snubbers.stop``); empty if there is none."""
    single = {(key,): root.get(key) for key in ("beam", "chain")}
    several = root.get("bodies")
    bodies = single | {("bodies", key): body for key, body in (several if isinstance(several, dict) else {}).items()}
    for where, body in bodies.items():
        items = body.get(parts[0]) if isinstance(body, dict) and len(parts) > 1 else None
        if isinstance(items, list) and isinstance(parts[1], str):
            with suppress(InvalidValueError):
                indices(items, parts[1], (parts[0],))
                return f"did you mean {path_text((*where, *parts))}?"
    return ""
