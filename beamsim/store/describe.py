"""Documentation of the result files, generated from the declarations of the results.

``python -m beamsim.store.describe docs/result_files.md`` updates the part of the file below `MARK`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

from beamsim.fields import (
    Arrays,
    Attribute,
    Axes,
    Counter,
    Dataset,
    Group,
    Key,
    Member,
    Members,
    PerName,
    Table,
    described,
    members_of,
)
from beamsim.kinds import KINDS, named
from beamsim.typing import Complexes

MARK = "<!-- made by python -m beamsim.store.describe; do not edit below -->"
_OF_DATASETS = ("units", "long_name")


class Row(NamedTuple):
    """One dataset or attribute."""

    name: str
    unit: str
    axes: str
    meaning: str


class Section(NamedTuple):
    """One group of a file."""

    path: str
    text: str
    rows: list[Row]


def documentation() -> str:
    """All kinds of result files, group by group, as Markdown."""
    parts = [_root()]
    known: dict[Any, str] = {}
    for name, kind in KINDS.items():
        cls = named(kind.result)
        called = kind.called.removeprefix("the result of ")
        parts.append(f"## {name}: {called}\n")
        parts += [_markdown(section) for section in _merged(sections_of(cls, name, known))]
        summary = [Row(e.name, e.unit, "attribute", e.meaning) for e in (described(cls, e) for e in cls.SUMMARY)]
        if summary:
            parts.append(_markdown(Section("/summary", "The printed summary, also with `--json`.", summary)))
    return "\n".join(parts)


def _merged(sections: Iterable[Section]) -> list[Section]:
    """Sections, with the rows of several dataclasses in one group combined."""
    merged: dict[str, Section] = {}
    for section in sections:
        if section.path in merged and section.rows:
            merged[section.path].rows.extend(section.rows)
        else:
            merged.setdefault(section.path, section)
    return list(merged.values())


def _root() -> str:
    from beamsim.analyses.result import Result

    rows = [
        Row("schema_version", "", "attribute", "version of the layout"),
        Row("beamsim_version", "", "attribute", "version of beamsim that computed the result"),
        Row("command", "", "attribute", "command that wrote the file"),
        Row("scenario", "", "attribute", "resolved scenario, YAML; sufficient to run the case again"),
    ]
    common = next(iter(sections_of(Result)))
    return "## Every file\n\n" + _markdown(Section("/", "Attributes of every file.", rows + common.rows))


def sections_of(cls: type, kind: str = "", known: dict[Any, str] | None = None) -> Iterator[Section]:
    """The groups declared by the class of a result, the root first.

    ``known`` says where a class has been described; classes described here are added.
    """
    from beamsim.analyses.result import Result

    inherited = {member.name for member in members_of(Result)} if cls is not Result else set()
    yield from _sections(cls, "/", {}, {} if known is None else known, inherited, kind)


def _sections(
    cls: Any, path: str, given: Mapping[str, Any], known: dict[Any, str], left_out: set[str], kind: str
) -> Iterator[Section]:
    """The section of a class, then those of the groups in it."""
    rows: list[Row] = []
    inner: list[tuple[Any, str, Mapping[str, Any]]] = []
    for member in members_of(cls):
        if member.name not in left_out:
            _describe(member, path, given, rows, inner, given.get("link", ""))
    text = (cls.__doc__ or "").strip().partition("\n\n")[0].replace("\n    ", " ")
    if rows:
        yield Section(path, _safe(text), rows)
    for inner_class, below, more in inner:
        if inner_class in known and not more:
            yield Section(below, f"As {known[inner_class].removesuffix(f' of {kind}')}.", [])
        else:
            known.setdefault(inner_class, f"`{below}` of {kind}")
            yield from _sections(inner_class, below, more, known, set(), kind)


def _describe(
    member: Member,
    path: str,
    given: Mapping[str, Any],
    rows: list[Row],
    inner: list[tuple[Any, str, Any]],
    on: str = "",
) -> None:
    """Add the rows of a field, and its groups."""

    def add(name: str, unit: str, axes: str, meaning: str) -> None:
        rest = (_spoken(text, given) for text in (unit, axes, meaning))
        rows.append(Row(_spoken(name, given, "<{}>"), *rest))

    match member.declaration:
        case Dataset() as d:
            for name, unit, meaning in _parts(member.stored_name, d, member.annotation):
                add(name, unit, "is an axis" if d.scale else _axes(d.along), meaning)
        case PerName(folder=folder, values=d):
            item = get_args(member.annotation)[1]
            for name, unit, meaning in _parts(d.name or member.name, d, item):
                where = "/".join(filter(None, (folder, "<name>", name)))
                add(where, unit, "attribute" if item in (int, float) else _axes(d.along), meaning)
        case Attribute() as d if member.stored_name not in _OF_DATASETS:
            owner = f"attribute of {d.at or on}" if d.at or on else "attribute"
            add(member.stored_name, d.unit, owner, d.meaning)
            if d.codec == "outcome":
                add("outcome", "", owner, "the same as a code")
                add("outcome_numbers", "", owner, "the numbers that belong to it, JSON object")
        case Group() as d if d.path:
            inner.append((member.annotation, _joined(path, d.path), d.given))
        case Group() as d:
            for below in members_of(member.annotation):
                _describe(below, path, {**given, **d.given}, rows, inner, d.on)
        case Members() as d:
            item = get_args(member.annotation)[1 if get_origin(member.annotation) is dict else 0]
            inner.append((item, _joined(path, _place(member, d, item)), d.given))
        case Arrays() as d:
            if d.listed:
                add(d.listed, "", f"attribute of {d.folder}", f"each {d.called} by name, in order, JSON list")
            item = get_args(member.annotation)[1 if get_origin(member.annotation) is dict else 0]
            inner.append((item, _joined(path, f"{d.folder}/<{d.called}>"), {"link": f"<{d.called}>"}))
        case Table() as d:
            _describe_table(member, d, rows, add)


def _describe_table(member: Member, declared: Table, rows: list[Row], add: Any) -> None:
    cls = get_args(member.annotation)[0]
    axis = declared.rows.name if declared.rows else ""
    for column in members_of(cls):
        axis = axis or (column.stored_name if column.declaration.scale else "")
    for column in members_of(cls):
        name = "/".join(filter(None, (declared.path, column.stored_name)))
        along = " × ".join([axis, *filter(None, [_axes(column.declaration.along)])])
        add(name, column.declaration.unit, "is an axis" if column.declaration.scale else along,
            column.declaration.meaning)  # fmt: skip


def _parts(name: str, declared: Dataset, annotation: Any) -> Iterator[tuple[str, str, str]]:
    """Name, unit and meaning of the dataset, or of the two datasets of complex numbers."""
    if declared.phase:
        yield name, declared.unit, declared.meaning
        yield f"{name}_phase_deg", "degree", declared.phase
    elif annotation == Complexes and declared.imaginary:
        yield f"{name}_real", declared.unit, declared.meaning
        yield f"{name}_imag", declared.unit, declared.imaginary
    elif annotation == Complexes:
        yield f"{name}_real, {name}_imag", declared.unit, f"{declared.meaning}, real and imaginary part"
    else:
        flags = f" ({declared.flags[0]}, {declared.flags[1]})" if declared.flags else ""
        yield name, declared.unit, declared.meaning + flags


def _place(member: Member, declared: Members, item: Any) -> str:
    """Path of the group of a member, with its key in angle brackets."""
    key = next((m.name for m in members_of(item) if isinstance(m.declaration, Key)), "")
    numbered = get_origin(member.annotation) is tuple or get_args(member.annotation)[0] is int
    name = "<name>" if declared.labelled else f"<{key or ('n' if numbered else 'name')}>"
    return "/".join(filter(None, (declared.folder, declared.called or declared.pattern.replace("{}", name))))


def _axes(along: Any) -> str:
    if isinstance(along, Axes):
        return f"{along.called}; {along.more.name}" if along.more else along.called
    return " × ".join(item.name if isinstance(item, Counter) else item for item in along)


def _joined(path: str, below: str) -> str:
    return f"{path.rstrip('/')}/{below}"


def _spoken(text: str, given: Mapping[str, Any], unknown: str = "*{}*") -> str:
    """A text with known fields filled in and other fields replaced by their names."""

    def name(field: re.Match[str]) -> str:
        value = str(given[field[1]]) if field[1] in given else unknown.format(field[1])
        return value.replace("_", " ") if field[2] else value

    return re.sub(r"\{(\w+)(:words)?\}", name, text)


def _markdown(section: Section) -> str:
    lines = [f"### `{section.path}`\n", f"{section.text}\n"]
    if section.rows:
        lines += ["| name | unit | axes | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{row.name}` | {_safe(row.unit)} | {_safe(row.axes)} | {_safe(row.meaning)} |" for row in section.rows
        ]
        lines.append("")
    return "\n".join(lines)


def _safe(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace(">", "&gt;")


def renewed(text: str) -> str:
    """A document with the part below `MARK` generated again."""
    return f"{text.partition(MARK)[0]}{MARK}\n\n{documentation()}"


if __name__ == "__main__":
    document = Path(sys.argv[1])
    document.write_text(renewed(document.read_text(encoding="utf-8")), encoding="utf-8")
