"""Documentation of the result files, generated from the declarations of the results.

``python -m beamsim.store.describe docs/result_files.md`` updates the part of the file below `MARK`.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from beamsim.analyses.result import Result
from beamsim.fields import (
    OUTCOME,
    Attribute,
    Axes,
    Counter,
    Dataset,
    Group,
    Member,
    Members,
    Table,
    described,
    filled,
    is_array,
    key_of,
    members_of,
)
from beamsim.kinds import KINDS, named
from beamsim.store.flat import joined

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
    rows = [
        Row("schema_version", "", "attribute", "version of the layout"),
        Row("checksum", "", "attribute", "SHA-256 of attributes, texts, axes and all arrays of up to 1 MiB"),
        Row("command", "", "attribute", "command that wrote the file"),
        Row("scenario", "", "attribute", "the case as written, YAML in SI units; sufficient to run it again"),
    ]
    common = next(iter(sections_of(Result)))
    return "## Every file\n\n" + _markdown(Section("/", "Attributes of every file.", rows + common.rows))


def sections_of(cls: type, kind: str = "", known: dict[Any, str] | None = None) -> Iterator[Section]:
    """The groups that the class of a result declares.

    Parameters
    ----------
    cls : the class.
    kind : of the result; named where a later section refers to a class that is described here.
    known : where a class has been described; classes described here are added.

    Yields
    ------
    Section
        That of the root first.
    """
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
            rows += [
                Row(_spoken(name, given, "<{}>"), *(_spoken(text, given) for text in others))
                for name, *others in _rows(member, given.get("link", ""))
            ]
            inner += _inner(member, path, given)
    text = inspect.cleandoc(cls.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
    if rows:
        yield Section(path, _safe(text), rows)
    for inner_class, below, more in inner:
        if inner_class in known and not more:
            yield Section(below, f"As {known[inner_class].removesuffix(f' of {kind}')}.", [])
        else:
            known.setdefault(inner_class, f"`{below}` of {kind}")
            yield from _sections(inner_class, below, more, known, set(), kind)


def _rows(member: Member, on: str) -> Iterator[Row]:
    """The datasets and attributes of a field; ``on`` is the dataset that a dataclass is, where it is one."""
    match member.declaration:
        case Dataset() as d:
            name = on if d.name == "." else member.stored_name
            axes = "attribute" if d.per is not None and member.scalar else "is an axis" if d.scale else _axes(d.along)
            where = [] if d.per is None else [d.per, "<name>"]
            for part, unit, meaning in _parts(name, d, member):
                yield Row("/".join(filter(None, (*where, part))), unit, axes, meaning)
        case Attribute() as d if member.stored_name not in _OF_DATASETS:
            owner = f"attribute of {d.at or on}" if d.at or on else "attribute"
            yield Row(member.stored_name, d.unit, owner, d.meaning)
            if d.codec is OUTCOME:
                yield Row("outcome", "", owner, "code of how it ended")
                yield Row(
                    "outcome_numbers", "", owner, "its kind, sentence, remedy, place, numbers and parts, JSON object"
                )
        case Group(path="") as d:
            for below in members_of(d.of):
                yield from _rows(below, "")
        case Members() as d:
            yield Row(member.name, "", "attribute", f"the keys of {_place(member, d)} in order, JSON list")
        case Table() as d:
            columns = members_of(d.of)
            axis = d.rows.name if d.rows else next(c.stored_name for c in columns if c.declaration.scale)
            for column in columns:
                along = " × ".join(filter(None, (axis, _axes(column.declaration.along))))
                for name, unit, meaning in _parts(column.stored_name, column.declaration, column):
                    place = "/".join(filter(None, (d.path, name)))
                    yield Row(place, unit, "is an axis" if column.declaration.scale else along, meaning)


def _inner(member: Member, path: str, given: Mapping[str, Any]) -> Iterator[tuple[Any, str, Mapping[str, Any]]]:
    """Classes of the groups of a field, their paths, and what of them is given."""
    match member.declaration:
        case Group(path="") as d:
            for below in members_of(d.of):
                yield from _inner(below, path, given)
        case Group() as d:
            on = {"link": d.path} if is_array(d.of) else {}
            yield d.of, joined(path, d.path), on
        case Members() as d:
            on = {"link": d.called} if is_array(d.of) else {}
            yield d.of, joined(path, _place(member, d)), on


def _place(member: Member, declared: Members) -> str:
    """Path of the groups of a field, with the keys in angle brackets."""
    key = key_of(declared.of)
    name = "<name>" if declared.labelled else f"<{key or ('name' if member.type.startswith('dict[str') else 'n')}>"
    return "/".join(filter(None, (declared.folder, declared.called or declared.pattern.replace("{}", name))))


def _parts(name: str, declared: Dataset, member: Member) -> Iterator[tuple[str, str, str]]:
    """Name, unit and meaning of the dataset, or of the two datasets of complex numbers."""
    if declared.phase:
        yield name, declared.unit, declared.meaning
        yield f"{name}_phase_deg", "degree", declared.phase
    elif "Complexes" in member.type and declared.imaginary:
        yield f"{name}_real", declared.unit, declared.meaning
        yield f"{name}_imag", declared.unit, declared.imaginary
    elif "Complexes" in member.type:
        yield f"{name}_real, {name}_imag", declared.unit, f"{declared.meaning}, real and imaginary part"
    else:
        flags = f" ({declared.flags[0]}, {declared.flags[1]})" if declared.flags else ""
        yield name, declared.unit, declared.meaning + flags


def _axes(along: Any) -> str:
    if isinstance(along, Axes):
        return f"{along.called}; {along.more.name}" if along.more else along.called
    return " × ".join(item.name if isinstance(item, Counter) else item for item in along)


def _spoken(text: str, given: Mapping[str, Any], unknown: str = "*{}*") -> str:
    """A text with known fields filled in and other fields replaced by their names."""
    known = {name: given.get(name, unknown.format(name)) for name in re.findall(r"\{(\w+)", text)}
    return filled(text, (known,))


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
