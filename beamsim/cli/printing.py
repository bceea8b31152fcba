"""The printer of commands: values as lines, tables, a first screen, lists of files, JSON.

A value is a text, a number, a list, a mapping by name, a record (a mapping by what is told), records by name, or a list
of records. Label and unit of what a record tells follow from its name: ``mean_peak_force_n`` is a mean peak force in N.
"""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from beamsim.cli.session import show
from beamsim.fields import unit_in
from beamsim.outcomes import MOST_LISTED
from beamsim.plots.style import Scale, amount, is_known, scale_for

WIDTH = 160  # characters, above which records stand side by side instead of below each other
MOST_ROWS = 24  # of a table
NONE = "-"


def percent(share: float, digits: int = 3) -> str:
    """A share in percent.

    >>> percent(0.9969, 2), percent(0.0031, 2), percent(12.345)
    ('100 %', '0.31 %', '1230 %')
    """
    return f"{float(f'{100 * share:.{digits}g}'):g} %"


def told(name: str, value: Any, unit: str = "", digits: int = 4) -> str:
    """The text of a value that has this name, with the unit of the name if no other is given; empty where not known.

    >>> told("peak_force_n", 2.5), told("contact_share", 0.25), told("stable", True), told("rate_hz", [1.0, 2.0])
    ('2.5 N', '25 %', 'yes', '1, 2 Hz')
    >>> told("margin", -0.4032), told("damping_ratios", [0.01, 0.0127])
    ('-40.3 %', '1, 1.27 %')

    Parameters
    ----------
    name : of the value, whose ending says its unit.
    value : truth, text, number, several of them, or None.
    unit : SI, or g; empty for that of the name.
    digits : of several numbers.

    Returns
    -------
    In one line.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if not is_known(value):
        return ""
    unit = unit or unit_in(name) or "1"
    if isinstance(value, (list, tuple)):
        if any(isinstance(item, str) for item in value):
            return ", ".join(map(str, value))
        if any(isinstance(item, (list, tuple)) for item in value):
            return "; ".join(told(name, item, unit, digits) for item in value[:MOST_LISTED])
        scale = scale_for(unit, [item for item in value if is_known(item)])
        if unit == "1" and _is_share(name):
            scale = Scale(100.0, "%")
        shown = [f"{item * scale.factor:.{digits}g}" if is_known(item) else NONE for item in value[:MOST_LISTED]]
        return f"{', '.join(shown)}{', …' if len(value) > MOST_LISTED else ''} {scale.unit}".strip()
    return percent(value) if unit == "1" and _is_share(name) else amount(value, unit)


def _is_share(name: str) -> bool:
    """Whether a number of this name is shown in percent."""
    shares = ("share", "margin", "damping_ratio", "coverage")
    return any(word in name for word in shares) and not name.endswith("_at")


def aligned(rows: Sequence[Sequence[str]], gap: int = 3) -> list[str]:
    """Rows of cells as lines, the cells in columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))] if rows else []
    between = " " * gap
    return [between.join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def under_headings(texts: Sequence[Mapping[str, str]]) -> list[list[str]]:
    """The headings of texts by heading, then a row of cells for each; headings under which nothing is are left out."""
    names = dict.fromkeys(name for text in texts for name in text)
    headings = [name for name in names if any(text.get(name) for text in texts)]
    return [headings, *([text.get(name) or NONE for name in headings] for text in texts)]


def more_rows(count: int) -> list[dict[str, str]]:
    """What is below the first rows of a table of so many."""
    return [{"": f"and {count - MOST_ROWS} more in the file"}] if count > MOST_ROWS else []


def print_table(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """A title and aligned rows on standard output, wrapped to the width of a terminal."""
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    show(table_text(title, rows, terminal))


def table_text(title: str, rows: Sequence[tuple[str, str]], terminal: int | None = None) -> str:
    """A title and aligned rows.

    Parameters
    ----------
    title : first line.
    rows : label and text of each.
    terminal : characters in a line at most; None for lines of any length.

    Returns
    -------
    Lines, the texts in a column.
    """
    indent = 4 + max((len(label) for label, _ in rows), default=0)
    lines = aligned([(f"  {label}", text) for label, text in rows], gap=2)
    return "\n".join([title, *(part for line in lines for part in _wrapped(line, indent, terminal))])


def _wrapped(row: str, indent: int, width: int | None) -> list[str]:
    """A row in lines of at most ``width`` characters, those after the first indented, where there is room for text."""
    # texts get at least 40 columns; narrower terminals wrap by themselves
    if width is None or len(row) <= width or width - indent < 40:
        return [row]
    return textwrap.wrap(row, width, subsequent_indent=" " * (indent + 2), break_long_words=False)
