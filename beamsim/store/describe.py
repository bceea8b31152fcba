"""Documentation of the result files, generated from the declarations of the results.

``python -m beamsim.store.describe docs/result_files.md`` updates the part of the file below `MARK`.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

from beamsim.kinds import KINDS
from beamsim.labelled import Variable
from beamsim.store.results import ROOT
from beamsim.summaries import complete_entry

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
        called = kind.description.removeprefix("the result of ")
        parts.append(f"## {name}: {called}\n")
        parts += [_markdown(section) for section in sections_of(cls)]
        summary = [Row(e.name, e.unit, "attribute", e.meaning) for e in (complete_entry(cls, e) for e in cls.SUMMARY)]
        if summary:
            parts.append(_markdown(Section("/summary", "The printed summary, also with `--json`.", summary)))
    return "\n".join(parts)


def _root() -> str:
    rows = [Row(name, "", "attribute", meaning) for name, meaning in ROOT.items()]
    return "## Every file\n\n" + _markdown(Section("/", "Attributes of every file.", rows))


def sections_of(cls: Any) -> list[Section]:
    """The datasets that the class of a result declares, in order."""
    return [
        Section(
            f"/{layout.name}", _safe(layout.text),
            [_row_of(name, variable) for name, variable in layout.variables.items()],
        )
        for layout in cls.DATASETS
    ]  # fmt: skip


def _row_of(name: str, variable: Variable) -> Row:
    """The row of a variable of a labelled dataset."""
    axes = "is an axis" if variable.dims == (name,) else " × ".join(variable.dims)
    flags = f" ({variable.flags[0]}, {variable.flags[1]})" if variable.flags else ""
    numbers = f", in {variable.names.partition('/')[0]}" if variable.names else ""
    return Row(name, _replace_fields(variable.unit), axes, _replace_fields(variable.meaning) + flags + numbers)


def _replace_fields(text: str) -> str:
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


def regenerate(text: str) -> str:
    """A document with the part below `MARK` generated again."""
    return f"{text.partition(MARK)[0]}{MARK}\n\n{documentation()}"


if __name__ == "__main__":
    document = Path(sys.argv[1])
    document.write_text(regenerate(document.read_text(encoding="utf-8")), encoding="utf-8")
