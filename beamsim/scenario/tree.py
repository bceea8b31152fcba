"""YAML as data that remember the file and line of every value, and back to text.

PyYAML by itself reads ``2e5`` as text, ``off`` as false, and keeps the last of two equal keys in
silence. Here numbers and booleans are those of YAML 1.2, and equal keys are refused. Anchors, aliases
and merge keys (``<<``) work.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from numbers import Integral, Real
from typing import Any

import yaml

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, path_parts, path_text, single_line

MOST_CHARACTERS = 1_000_000
"""A longer document is refused: reading it would take seconds."""
MOST_NODES = 200_000
"""A file that unfolds to more values than this (aliases of aliases) is refused."""


Mark = tuple[str | None, int | None]
"""File and line."""
NOWHERE: Mark = (None, None)


class WrittenMapping(dict[str, Any]):
    """A mapping, where it was written, and where the value of each key was."""

    def __init__(self, items: Mapping[str, Any], mark: Mark = NOWHERE, marks: Mapping[str, Mark] | None = None) -> None:
        super().__init__(items)
        self.mark = mark
        self.marks: dict[Any, Mark] = dict(marks or {})


class WrittenList(list[Any]):
    """A list, and where each of its items was written."""

    def __init__(self, items: Iterable[Any], marks: Iterable[Mark] = ()) -> None:
        super().__init__(items)
        self.marks: dict[Any, Mark] = dict(enumerate(marks))


def from_python(value: object) -> Any:
    """Plain data of a Python value: mappings, sequences, numbers (NumPy's too), text; none of it has a place."""
    if isinstance(value, Mapping):
        return WrittenMapping({str(key): from_python(item) for key, item in value.items()})
    if isinstance(value, (list, tuple)):
        return WrittenList(from_python(item) for item in value)
    if isinstance(value, (bool, str)) or value is None:
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    return from_python(value.tolist()) if hasattr(value, "tolist") else value  # NumPy arrays and scalars


def locate(root: Any, path: Path) -> Mark:
    """Return file and line of the value at a path, or of the nearest enclosing one."""
    value, mark = root, (root.mark[0], None)
    for part in path:
        part = str(part) if isinstance(value, dict) else part
        inside = part in value if isinstance(value, dict) else isinstance(value, list) and part in range(len(value))
        if not inside:
            break
        mark, value = value.marks.get(part, NOWHERE), value[part]
    return mark


def located_problem(root: Any, problem: Problem) -> Problem:
    """Return the problem with the file and line of the value at its path."""
    file, line = locate(root, tuple(path_parts(problem.path)))
    return replace(problem, file=file, line=line)


class _Loader(yaml.SafeLoader):
    """Resolves plain scalars as YAML 1.2 does."""


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
    """Read one YAML document: mappings and lists that know where they were written, and scalars.

    Raises
    ------
    ScenarioError
        If it is not YAML, holds several documents or custom tags, or a mapping has two equal keys
        or one that is not text; all of these at once.
    """
    if len(text) > MOST_CHARACTERS:
        message = f"has {len(text):.3g} characters, more than the {MOST_CHARACTERS:.0e} of the longest scenario"
        raise ScenarioError(Problem("", message, "keep measured data in files of their own", file))
    try:
        document = yaml.compose(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        raise ScenarioError(_syntax_problem(error, text, file)) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        character = f"U+{error.character:04X}" if isinstance(error.character, int) else str(error.character)
        message = f"contains a character that YAML does not allow ({character})"
        raise ScenarioError(Problem("", message, "remove it", file, line)) from None
    except (RecursionError, ValueError) as error:
        message = "is nested too deeply" if isinstance(error, RecursionError) else f"is not YAML: {error}"
        raise ScenarioError(Problem("", message, "check the brackets", file)) from None
    if document is None:
        return None
    reader = _Reader(file)
    try:
        data = reader.data(document, ())
    except RecursionError:
        raise ScenarioError(Problem("", "is nested too deeply", "check the brackets", file)) from None
    if reader.problems:
        raise ScenarioError(reader.problems)
    return data


def _open_bracket(error: yaml.MarkedYAMLError, text: str) -> str:
    """The bracket within which parsing failed, and its line; empty where it failed outside of brackets."""
    mark = error.context_mark
    if mark is None or error.context not in ("while parsing a flow mapping", "while parsing a flow sequence"):
        return ""
    return f"{text.splitlines()[mark.line][mark.column]} of line {mark.line + 1}"


def _colon_remedy(lines: list[str]) -> str:
    """What to do about a colon, in the last of the lines, where none may be: the line before may lack one."""
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
        return Problem(
            "", "contains a second document", "keep one document per file", file, mark.line + 1 if mark else None
        )
    remedy = "check indentation, colons, quotes and brackets"
    line = text.splitlines()[mark.line] if mark and mark.line < len(text.splitlines()) else ""
    if path := re.search(r"[A-Za-z_][\w.]*\[(?:\d+|\*)\][\w.\[\]*]*", line):
        remedy = f'quote a path with brackets: "{path[0]}"'
    elif mark and line[mark.column : mark.column + 1] == "*":
        remedy = "quote text that begins with *"
    elif opened := _open_bracket(error, text):
        remedy = f"is the {opened} closed, with a comma between all that it holds?"
    elif mark and error.problem in (
        "mapping values are not allowed here",
        "expected '<document start>', but found '<block mapping start>'",
    ):
        remedy = _colon_remedy(text.splitlines()[: mark.line + 1])
    return Problem(
        "",
        "is not YAML: " + ", ".join(parts),
        remedy,
        file,
        mark.line + 1 if mark else None,
    )


class _Reader:
    """Turns PyYAML's nodes into data that know their places."""

    def __init__(self, file: str | None) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.open: set[int] = set()
        self.count = 0

    def data(self, node: yaml.Node, path: Path) -> Any:
        self.count += 1
        if self.count > MOST_NODES:
            raise ScenarioError(
                Problem("", f"unfolds to more than {MOST_NODES} values", "use fewer aliases", self.file)
            )
        if id(node) in self.open:
            self._problem(path, "contains itself through an alias", "remove the alias", node)
            return None
        self.open.add(id(node))
        try:
            if isinstance(node, yaml.MappingNode):
                self._plain_tag(node, "map", path)
                return self._mapping(node, path)
            if isinstance(node, yaml.SequenceNode):
                self._plain_tag(node, "seq", path)
                items = [self.data(item, (*path, index)) for index, item in enumerate(node.value)]
                return WrittenList(items, map(self._mark, node.value))
            return self._scalar(node, path)
        finally:
            self.open.discard(id(node))

    def _mark(self, node: yaml.Node) -> Mark:
        return self.file, node.start_mark.line + 1

    def _problem(self, path: Path, message: str, remedy: str, node: yaml.Node) -> None:
        self.problems.append(Problem(path_text(path), message, remedy, *self._mark(node)))

    def _plain_tag(self, node: yaml.Node, tag: str, path: Path) -> None:
        if node.tag != _TAG + tag:
            self._problem(path, f"has the tag {node.tag}", "remove the tag", node)

    def _mapping(self, node: yaml.MappingNode, path: Path) -> WrittenMapping:
        items, merged = WrittenMapping({}, self._mark(node)), WrittenMapping({})
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _TAG + "merge":
                for source in self._merged(value_node, path, key_node):
                    merged.update({key: value for key, value in source.items() if key not in merged})
                    merged.marks = source.marks | merged.marks
                continue
            key = key_node.value
            if not isinstance(key_node, yaml.ScalarNode) or key_node.tag not in (_TAG + "str", _TAG + "bool"):
                shown = single_line(key) if isinstance(key, str) else "a list or mapping"
                self._problem(path, f"has the key {shown}, which is not text", "name the key", key_node)
                continue
            value = self.data(value_node, (*path, key))
            if key in items:
                message = f"is given twice, first in line {lines[key]}"
                self._problem((*path, key), message, "keep one of the two", key_node)
                continue
            items[key], lines[key] = value, key_node.start_mark.line + 1
            items.marks[key] = self._mark(value_node if isinstance(value_node.value, str) else key_node)
        for key in merged.keys() - items.keys():
            items.marks[key] = merged.marks.get(key, NOWHERE)
        items.update({key: value for key, value in merged.items() if key not in items})
        return items

    def _merged(self, node: yaml.Node, path: Path, key: yaml.Node) -> Iterator[WrittenMapping]:
        for source in node.value if isinstance(node, yaml.SequenceNode) else [node]:
            if isinstance(source, yaml.MappingNode):
                yield self.data(source, path)
            else:
                self._problem(path, "merges (<<) what is not a mapping", "merge an alias of a mapping: <<: *name", key)

    def _scalar(self, node: yaml.Node, path: Path) -> object:
        text: str = node.value
        kind = node.tag.removeprefix(_TAG)
        try:
            if kind in ("str", "merge"):
                return text
            if kind == "null":
                return None
            if kind == "bool":
                return {"true": True, "false": False}[text.lower()]
            if kind == "int":
                return int(text, 0) if text[:2] in ("0o", "0x") else int(text)
            if kind == "float":
                lower = text.lower()
                return float(lower.replace(".inf", "inf").replace(".nan", "nan"))
        except (ValueError, KeyError):
            self._problem(path, f"= {single_line(text)} is not a valid {kind}", "correct it, or remove its tag", node)
            return None
        self._problem(path, f"has the tag {node.tag}", "remove the tag", node)
        return None


class _Dumper(yaml.SafeDumper):
    """Quotes text that YAML 1.1 or YAML 1.2 would read as something else."""


_Dumper.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"),
    list("-+.0123456789"),
)


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    """Escape the line break U+0085, which PyYAML writes as it is and reads back as a space."""
    style = '"' if "\x85" in text else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _represent_text)

_FIRST = ("name", "kind", "body", "at", "position", "mass", "between", "masses", "applied_to", "level")


def dumped(data: Any) -> str:
    """Plain data as YAML text, the keys that say what a mapping is first."""
    return yaml.dump(
        _ordered(data), Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120
    )


def _ordered(value: Any) -> Any:
    if isinstance(value, dict):
        keys = [*(key for key in _FIRST if key in value), *(key for key in value if key not in _FIRST)]
        return {key: _ordered(value[key]) for key in keys}
    return [_ordered(item) for item in value] if isinstance(value, list) else value
