"""Documentation of the result files, generated from the declarations of the results.

``python -m beamsim.store.describe docs/result_files.md`` updates the part of the file below `MARK`.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

from beamsim.fields import (
    OUTCOME,
    ArrayField,
    Attribute,
    Group,
    Key,
    Member,
    Members,
    Table,
    described,
    members_of,
)
from beamsim.kinds import KINDS
from beamsim.labelled import Variable, last, parent
from beamsim.store.layout import Spot, StoragePlace, place_in, places_in, root_place, spot
from beamsim.store.results import ROOT

MARK = "<!-- made by python -m beamsim.store.describe; do not edit below -->"


class Row(NamedTuple):
    """One variable or attribute."""

    name: str
    unit: str
    axes: str
    meaning: str


class Section(NamedTuple):
    """One dataset of a file, a group below the root."""

    path: str
    text: str
    rows: list[Row]


def documentation() -> str:
    """All kinds of result files, dataset by dataset, as Markdown."""
    parts = [_root()]
    for name, kind in KINDS.items():
        cls = resolve_name(kind.result)
        called = kind.called.removeprefix("the result of ")
        parts.append(f"## {name}: {called}\n")
        parts += [_markdown(section) for section in sections_of(cls)]
        summary = [Row(e.name, e.unit, "attribute", e.meaning) for e in (described(cls, e) for e in cls.SUMMARY)]
        if summary:
            parts.append(_markdown(Section("/summary", "The printed summary, also with `--json`.", summary)))
    return "\n".join(parts)


def _root() -> str:
    rows = [Row(name, "", "attribute", meaning) for name, meaning in ROOT.items()]
    return "## Every file\n\n" + _markdown(Section("/", "Attributes of every file.", rows))


def sections_of(cls: Any) -> list[Section]:
    """The datasets that the class of a result declares.

    Parameters
    ----------
    cls : the class.

    Returns
    -------
    list of Section
        That of the root first, without what every file has.
    """
    sections: dict[str, Section] = {}
    for layout in cls.DATASETS:
        rows = [_row_of(name, variable) for name, variable in layout.variables.items()]
        sections[f"/{layout.name}"] = Section(f"/{layout.name}", _safe(layout.text), rows)
    for of, place in places_in(cls, root_place(cls)):
        about = inspect.cleandoc(of.__doc__ or "").partition("\n\n")[0].replace("\n", " ")
        for member in members_of(of):
            for path, row in _rows(member, place):
                rows_of = path if path == "/" or path == f"/{place.dataset}" else ""
                text = about if rows_of else "The rows of all members, one member after the other."
                section = sections.setdefault(path, Section(path, _safe(text), []))
                if row not in section.rows:
                    section.rows.append(row)
    return sorted(sections.values(), key=lambda section: section.path != "/")


def _row_of(name: str, declared: Variable) -> Row:
    """The row of a variable of a labelled dataset."""
    axes = "is an axis" if declared.dims == (name,) else " × ".join(declared.dims)
    flags = f" ({declared.flags[0]}, {declared.flags[1]})" if declared.flags else ""
    numbers = f", in {declared.names.partition('/')[0]}" if declared.names else ""
    return Row(name, _spoken(declared.unit), axes, _spoken(declared.meaning) + flags + numbers)


def _rows(member: Member, place: StoragePlace) -> Iterator[tuple[str, Row]]:
    """The variables and attributes of a field, each with the path of its dataset."""
    match member.declaration:
        case ArrayField() as d:
            at = spot(member, place if d.per is None else place_in(place, member.name, d))
            if d.per is not None:
                text = f"JSON list of the names that {last(at.path)} has values for"
                yield place.attributes, Row(f"{place.prefix}{member.name}", "", "attribute", text)
            yield from _of_spot(at, d, member, place)
        case Attribute() as d:
            yield from _attributes(member, d, place)
        case Group() as d if place.dims:
            text = f"JSON list of the members that have {d.path or d.prefix}"
            yield place.attributes, Row(f"{place.prefix}{member.name}", "", "attribute", text)
        case Members() as d:
            text = f"JSON list of the values of {d.dim} in order; of several owners a list for each, or one for all"
            yield place.attributes, Row(f"{place.prefix}{member.name}", "", "attribute", text)
            of = place_in(place, member.name, d)
            meaning = next((m.declaration.meaning for m in members_of(d.of) if isinstance(m.declaration, Key)), "name")
            yield f"/{of.dataset}", Row(d.dim, "1", "is an axis", meaning)
        case Table() as d:
            below = place_in(place, member.name, d)
            for column in members_of(d.of):
                yield from _of_spot(spot(column, below), column.declaration, column, below)


def _attributes(member: Member, declared: Attribute, place: StoragePlace) -> Iterator[tuple[str, Row]]:
    """The attributes of a field; of members they are variables along their dimension."""
    home = f"/{place.dataset}" if place.dims else place.attributes
    along = " × ".join(place.dims) or "attribute"
    name = f"{place.prefix}{{}}{_ending(place)}"
    yield home, Row(name.format(member.stored_name), _spoken(declared.unit), along, _spoken(declared.meaning))
    if declared.codec is OUTCOME:
        numbers = "its kind, sentence, remedy, place, numbers and parts, JSON object"
        yield home, Row(name.format("outcome"), "", along, "code of how it ended")
        yield home, Row(name.format("outcome_numbers"), "", along, numbers)


def _of_spot(at: Spot, declared: ArrayField, member: Member, place: StoragePlace) -> Iterator[tuple[str, Row]]:
    """The variables of a field, and what says whose their rows are."""
    axes = "is an axis" if at.scale else " × ".join((*at.kept, *(axis.dim for axis in at.axes))) or "a number"
    if at.whose is not None:
        yield f"/{at.dataset}", Row(at.whose.dim, "1", "is an axis", "number of the row")
        for dim in at.whose.place.dims:
            meaning = f"number of the {dim}, from 0, in {at.whose.place.dataset}"
            yield f"/{at.dataset}", Row(dim, "1", at.whose.dim, meaning)
        dims, number_of_rows = " × ".join(at.whose.place.dims), f"number of rows in {at.dataset}"
        yield parent(at.whose.path), Row(f"{last(at.whose.path)}_count", "1", dims, number_of_rows)
    for axis in at.axes:
        if axis.counter is not None and not axis.table:
            yield f"/{at.dataset}", Row(axis.name, "1", "is an axis", axis.counter.meaning)
    for name, unit, meaning in _parts(last(at.path) + _ending(place), declared, member):
        yield f"/{at.dataset}", Row(name, _spoken(unit), axes, _spoken(meaning))


def _ending(place: StoragePlace) -> str:
    return f"_<{place.split}>" if place.split else ""


def _parts(name: str, declared: ArrayField, member: Member) -> Iterator[tuple[str, str, str]]:
    """Name, unit and meaning of the variable, or of the two variables of complex numbers."""
    if "Complexes" in member.type and declared.imaginary:
        yield f"{name}_real", declared.unit, declared.meaning
        yield f"{name}_imag", declared.unit, declared.imaginary
    elif "Complexes" in member.type:
        yield f"{name}_real, {name}_imag", declared.unit, f"{declared.meaning}, real and imaginary part"
    else:
        flags = f" ({declared.flags[0]}, {declared.flags[1]})" if declared.flags else ""
        yield name, declared.unit, declared.meaning + flags


def _spoken(text: str) -> str:
    """A text with fields that are replaced by their names."""
    return re.sub(r"\{(\w+)\}", r"*\1*", text)


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
