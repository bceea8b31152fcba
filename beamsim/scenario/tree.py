"""YAML as a tree that remembers the file and line of every value.

PyYAML by itself reads ``2e5`` as text, ``off`` as false, and keeps the last of two equal keys in
silence. Here numbers and booleans are those of YAML 1.2, and equal keys are refused. Anchors, aliases
and merge keys (``<<``) work.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Any

import yaml

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, path_text, single_line

MOST_CHARACTERS = 1_000_000
"""A longer document is refused: reading it would take seconds."""
MOST_NODES = 200_000
"""A file that unfolds to more values than this (aliases of aliases) is refused."""


@dataclass
class Node:
    """A value and where it was written; ``value`` is a dict or list of nodes, or a scalar."""

    value: Any
    file: str | None = None
    line: int | None = None

    def plain(self) -> Any:
        """Return the value without locations."""
        if isinstance(self.value, dict):
            return {key: item.plain() for key, item in self.value.items()}
        if isinstance(self.value, list):
            return [item.plain() for item in self.value]
        return self.value

    def copy(self) -> Node:
        """Return a tree of its own."""
        if isinstance(self.value, dict):
            return replace(self, value={key: item.copy() for key, item in self.value.items()})
        if isinstance(self.value, list):
            return replace(self, value=[item.copy() for item in self.value])
        return replace(self)


def from_python(value: object, file: str | None = None, line: int | None = None) -> Node:
    """Return the tree of a Python value: mappings, sequences, numbers (NumPy's too), text."""
    if isinstance(value, Mapping):
        return Node({str(key): from_python(item, file, line) for key, item in value.items()}, file, line)
    if isinstance(value, (list, tuple)):
        return Node([from_python(item, file, line) for item in value], file, line)
    if isinstance(value, (bool, str)) or value is None:
        return Node(value, file, line)
    if isinstance(value, Integral):
        return Node(int(value), file, line)
    if isinstance(value, Real):
        return Node(float(value), file, line)
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return from_python(value.tolist(), file, line)
    return Node(value, file, line)


def locate(root: Node, path: Path) -> tuple[str | None, int | None]:
    """Return file and line of the value at a path, or of the nearest enclosing one."""
    node = root
    where: tuple[str | None, int | None] = (root.file, None)
    for part in path:
        inner = _inner(node, part)
        if inner is None:
            break
        node = inner
        where = (node.file, node.line)
    return where


def node_at(root: Node, path: Path) -> Node:
    """Return the value at a path.

    Raises
    ------
    KeyError
        If there is none.
    """
    for part in path:
        inner = _inner(root, part)
        if inner is None:
            raise KeyError(part)
        root = inner
    return root


def located(root: Node, path: Path, problem: Problem) -> Problem:
    """Return the problem with the file and line of the value at a path."""
    file, line = locate(root, path)
    return replace(problem, file=file, line=line)


def path_parts(path: str) -> Path:
    """Return ``snubbers[0].gap`` as keys and indices."""
    return tuple(int(match[2]) if match[2] else match[1] for match in re.finditer(r"([^.\[\]]+)|\[(\d+)\]", path))


def _inner(node: Node, part: str | int) -> Node | None:
    """Return the value at a key or index, or None."""
    if isinstance(node.value, dict):
        inner: Node | None = node.value.get(part)
        return inner
    if isinstance(node.value, list) and isinstance(part, int) and part < len(node.value):
        item: Node = node.value[part]
        return item
    return None


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


def parse(text: str, file: str | None = None) -> Node:
    """Read one YAML document.

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
        return Node(None, file, None)
    reader = _Reader(file)
    try:
        node = reader.node(document, (), document.start_mark.line + 1)
    except RecursionError:
        raise ScenarioError(Problem("", "is nested too deeply", "check the brackets", file)) from None
    if reader.problems:
        raise ScenarioError(reader.problems)
    return node


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
    """Turns PyYAML's nodes into ours."""

    def __init__(self, file: str | None) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.open: set[int] = set()
        self.count = 0

    def node(self, node: yaml.Node, path: Path, line: int) -> Node:
        self.count += 1
        if self.count > MOST_NODES:
            raise ScenarioError(
                Problem("", f"unfolds to more than {MOST_NODES} values", "use fewer aliases", self.file)
            )
        if id(node) in self.open:
            self._problem(path, "contains itself through an alias", "remove the alias", node.start_mark.line + 1)
            return Node(None, self.file, line)
        self.open.add(id(node))
        try:
            if isinstance(node, yaml.MappingNode):
                self._plain_tag(node, "map", path)
                return Node(self._mapping(node, path), self.file, line)
            if isinstance(node, yaml.SequenceNode):
                self._plain_tag(node, "seq", path)
                items = [
                    self.node(item, (*path, index), item.start_mark.line + 1) for index, item in enumerate(node.value)
                ]
                return Node(items, self.file, line)
            assert isinstance(node, yaml.ScalarNode)
            return Node(self._scalar(node, path), self.file, line)
        finally:
            self.open.discard(id(node))

    def _problem(self, path: Path, message: str, remedy: str, line: int) -> None:
        self.problems.append(Problem(path_text(path), message, remedy, self.file, line))

    def _plain_tag(self, node: yaml.Node, tag: str, path: Path) -> None:
        if node.tag != _TAG + tag:
            self._problem(path, f"has the tag {node.tag}", "remove the tag", node.start_mark.line + 1)

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Node]:
        items: dict[str, Node] = {}
        merged: dict[str, Node] = {}
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if key_node.tag == _TAG + "merge":
                for name, item in self._merged(value_node, path, line):
                    merged.setdefault(name, item)
                continue
            key = key_node.value
            if not isinstance(key_node, yaml.ScalarNode) or key_node.tag not in (_TAG + "str", _TAG + "bool"):
                shown = single_line(key) if isinstance(key, str) else "a list or mapping"
                self._problem(path, f"has the key {shown}, which is not text", "name the key", line)
                continue
            value_line = value_node.start_mark.line + 1
            item = self.node(value_node, (*path, key), value_line if isinstance(value_node.value, str) else line)
            if key in items:
                self._problem((*path, key), f"is given twice, first in line {lines[key]}", "keep one of the two", line)
                continue
            items[key], lines[key] = item, line
        return items | {key: item for key, item in merged.items() if key not in items}

    def _merged(self, node: yaml.Node, path: Path, line: int) -> Iterator[tuple[str, Node]]:
        sources = node.value if isinstance(node, yaml.SequenceNode) else [node]
        for source in sources:
            if not isinstance(source, yaml.MappingNode):
                self._problem(path, "merges (<<) what is not a mapping", "merge an alias of a mapping: <<: *name", line)
                continue
            yield from self.node(source, path, line).value.items()

    def _scalar(self, node: yaml.ScalarNode, path: Path) -> object:
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
            self._problem(
                path,
                f"= {single_line(text)} is not a valid {kind}",
                "correct it, or remove its tag",
                node.start_mark.line + 1,
            )
            return None
        self._problem(path, f"has the tag {node.tag}", "remove the tag", node.start_mark.line + 1)
        return None
