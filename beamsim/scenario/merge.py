"""`extends` and overrides: merging of trees.

Mappings are merged, all other values are replaced. A mapping whose ``kind`` changes is replaced completely, and so
are mappings whose keys decide their meaning (``applied_to``, ``start``, ...). A key that excludes inherited ones
(``gap`` and ``preload``, ...) replaces them. ``null`` removes an inherited value.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path as FilePath

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.base import Path, path_parts, path_text, single_line, suggestion
from beamsim.scenario.names import DEFAULT_NAMES
from beamsim.scenario.tree import Node, from_python, parse

Overrides = Mapping[str, object] | Sequence[str]

ALTERNATIVES: tuple[tuple[frozenset[str], ...], ...] = tuple(
    tuple(frozenset(keys.split()) for keys in either.split("|"))
    for either in ("continue_in | from to", "gap | preload", "section | width thickness", "periods | last",
                   "modes | highest_frequency")
)  # fmt: skip
"""Keys of one mapping that exclude each other: those given replace those inherited."""

REPLACED_WHOLE = frozenset({"applied_to", "at", "start", "released_force", "reduction"})
"""Mappings told apart by the keys they have; merging two of them would make neither."""


def read_file(path: FilePath) -> Node:
    """Read a YAML file into a tree.

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


def resolve_extends(root: Node, folder: FilePath, chain: tuple[FilePath, ...] = ()) -> Node:
    """Merge a document into the one it extends, recursively.

    ``folder`` is the base of relative paths; ``chain`` has the files that extend this one.
    """
    if root.value is None:
        message = "is empty" if root.file else "the scenario is empty"
        raise ScenarioError(Problem("", message, "beamsim new writes a template", root.file))
    if not isinstance(root.value, dict):
        what = "a list" if isinstance(root.value, list) else f"only {single_line(root.value)}"
        message = f"holds {what} instead of the keys of a scenario"
        raise ScenarioError(Problem("", message, "write beam: or chain: first", root.file, root.line))
    named = root.value.pop("extends", None)
    if named is None or named.value is None:
        return root
    if not isinstance(named.value, str) or not named.value.strip():
        message = f"= {single_line(named.plain())} must be the path of one file"
        raise ScenarioError(Problem("extends", message, "write extends: base.yaml", named.file, named.line))
    path = FilePath(os.path.normpath(folder / named.value))
    identity = path.resolve()
    if identity in chain:
        message = f"= {named.value} refers back to {path}: the files extend each other in a cycle"
        raise ScenarioError(Problem("extends", message, "remove one of them", named.file, named.line))
    try:
        base = read_file(path)
    except ScenarioError as error:
        if path.is_file():
            raise
        problem = error.problems[0]
        message = f"= {named.value}: {path} {problem.message}"
        remedy = problem.remedy or "the path is relative to the file that contains it"
        raise ScenarioError(Problem("extends", message, remedy, named.file, named.line)) from None
    return merge(resolve_extends(base, path.parent, (*chain, identity)), root)


def merge(base: Node, over: Node, key: str = "") -> Node:
    """Return ``base`` with ``over`` merged into it."""
    if not isinstance(base.value, dict) or not isinstance(over.value, dict) or key in REPLACED_WHOLE:
        return over
    old, new = (side.value["kind"].value if "kind" in side.value else None for side in (base, over))
    if new is not None and new != old:
        return over
    merged = dict(base.value)
    for name, item in over.value.items():
        merged[name] = merge(merged[name], item, name) if name in merged else item
    _drop_alternatives(merged, {name for name, item in over.value.items() if item.value is not None}, over.value.keys())
    return Node(merged, over.file, over.line)


def _drop_alternatives(keys: dict[str, Node], given: Collection[str], kept: Collection[str]) -> None:
    """Take the inherited alternatives of given keys out of a mapping, apart from those to keep."""
    for either in ALTERNATIVES:
        chosen = [names for names in either if names & set(given)]
        for names in either if chosen else ():
            for name in names - set(kept) if names not in chosen else ():
                keys.pop(name, None)


_EXAMPLE = "write for example beam.thickness=4 mm, snubbers.tip.gap=0.1 mm or snubbers[0].gap=0.1 mm"


def apply_overrides(root: Node, overrides: Overrides) -> Node:
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
    root = root.copy()
    problems: list[Problem] = []
    if isinstance(overrides, str):
        overrides = [overrides]
    pairs: list[tuple[object, object]] = (
        list(overrides.items()) if isinstance(overrides, Mapping) else [(item, None) for item in overrides]
    )
    ready: list[tuple[str, Node]] = []
    for key, given in pairs:
        try:
            ready.append((str(key).strip(), from_python(given)) if isinstance(overrides, Mapping) else _split(str(key)))
        except ScenarioError as error:
            problems += error.problems
    written: set[Path] = set()
    for path, value in sorted(ready, key=lambda item: not item[0].endswith(".kind")):
        try:
            for parts in _places(root, path):
                written.add(parts)
                _set(root, path, parts, value.copy(), written)
        except ScenarioError as error:
            problems += error.problems
    if problems:
        raise ScenarioError(problems)
    return root


def _split(override: str) -> tuple[str, Node]:
    path, equals, text = override.partition("=")
    if not equals:
        raise ScenarioError(Problem("", f"the override {single_line(override)} has no =", _EXAMPLE))
    try:
        value = parse(text)
    except ScenarioError as error:
        message = f"= {single_line(text)} {error.problems[0].message}"
        raise ScenarioError(Problem(path.strip(), message, "quote the value")) from None
    return path.strip(), _unlocated(value)


def _unlocated(node: Node) -> Node:
    return from_python(node.plain())


def _places(root: Node, path: str) -> list[Path]:
    """The places that a path means, in keys and indices: names of items and ``[*]`` resolved."""
    parts = path_parts(path)
    if not parts:
        raise ScenarioError(Problem("", f"the override {single_line(path)} is not a path", _EXAMPLE))
    places: list[tuple[Path, Node | None]] = [((), root)]
    for part in parts:
        places = [place for walked, node in places for place in _step(walked, node, part, path)]
    return [walked for walked, _ in places]


def _step(walked: Path, node: Node | None, part: str | int, path: str) -> Iterator[tuple[Path, Node | None]]:
    """One part of a path further; the node is None where the path leads to what is not there yet."""
    items = node.value if node is not None else None
    if part == "*":
        if not isinstance(items, list) or not items:
            what = "is empty" if items == [] else "is not a list"
            raise ScenarioError(Problem(path, f"does not exist: {path_text(walked)} {what}", _EXAMPLE))
        yield from (((*walked, k), item) for k, item in enumerate(items))
        return
    if isinstance(items, list) and isinstance(part, str):
        part = _index_of(items, part, walked, path)
    inside = items.get(part) if isinstance(items, dict) else None
    if isinstance(items, list) and isinstance(part, int) and part < len(items):
        inside = items[part]
    yield (*walked, part), inside


def _index_of(items: list[Node], name: str, walked: Path, path: str) -> int:
    """Index of the item with a name, given or by default."""
    prefix = DEFAULT_NAMES.get(str(walked[-1]), "")
    names = [f"{prefix}_{k}" if prefix else "" for k in range(1, len(items) + 1)]
    for k, item in enumerate(items):
        if isinstance(item.value, dict) and (given := item.value.get("name")) is not None and given.value is not None:
            names[k] = str(given.value)
    if name in names:
        return names.index(name)
    where = path_text(walked)
    given_names = [known for known in names if known]
    key = any(isinstance(item.value, dict) and name in item.value for item in items)
    if key or not given_names:
        index = f"{where}[0].{name}" if items else f"{where} as a whole list"
        raise ScenarioError(Problem(path, f"does not exist: {where} is a list", f"name the item, for example {index}"))
    remedy = suggestion(name, given_names, "the names are")
    raise ScenarioError(Problem(path, f"does not exist: {where} has no item called {name}", remedy))


def _set(root: Node, path: str, parts: Path, value: Node, written: Collection[Path]) -> None:
    """Write a value at a place; what other overrides wrote there stays, see `ALTERNATIVES`."""
    node, walked = root, ""
    for depth, part in enumerate(parts):
        following = parts[depth + 1] if depth + 1 < len(parts) else None
        key = part if isinstance(part, str) else ""
        if isinstance(part, int):
            _demand_item(node, part, walked, path)
        else:
            _demand_keys(node, part, walked, path, isinstance(following, int))
        inside = node.value
        walked += f"[{part}]" if isinstance(part, int) else f".{part}" if walked else part
        if following is None:
            if isinstance(part, str) and value.value is not None:
                _drop_alternatives(inside, {part}, {name for name in inside if (*parts[:-1], name) in written})
            inside[part] = merge(inside[part], value, key) if isinstance(part, int) or part in inside else value
        elif following == "kind" and depth + 2 == len(
            parts
        ):  # merging a mapping that holds only the kind knows what to do
            inside[part] = merge(inside[part], Node({"kind": value}), key)
            return
        node = inside[part]


def _demand_item(node: Node, index: int, walked: str, path: str) -> None:
    if not isinstance(node.value, list):
        raise ScenarioError(Problem(path, f"does not exist: {walked} is not a list", _EXAMPLE))
    count = len(node.value)
    if index >= count:
        last = f"the last one is {walked}[{count - 1}]" if count else "give the whole list"
        raise ScenarioError(Problem(path, f"does not exist: {walked} has {count} item{'s' * (count != 1)}", last))


def _demand_keys(node: Node, key: str, walked: str, path: str, list_follows: bool) -> None:
    """Make ``node`` a mapping with the key, and create missing parts."""
    if node.value is None or (walked.rpartition(".")[2] in REPLACED_WHOLE and not isinstance(node.value, dict)):
        node.value, node.file, node.line = {}, None, None
    if not isinstance(node.value, dict):
        message = f"does not exist: {walked} is {single_line(node.value)}, without keys"
        raise ScenarioError(Problem(path, message, f"replace {walked} whole"))
    if key not in node.value:
        if list_follows:
            where = f"{walked}.{key}" if walked else key
            raise ScenarioError(Problem(path, f"does not exist: there is no {where}", f"give {where} as a whole list"))
        node.value[key] = Node(None)
