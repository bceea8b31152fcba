"""Printed table of a result of any kind, from its summary and the declarations of the entries.

Values by place form one table for each section: the largest force of a snubber is in one row with its other values,
each with its error from the convergence check. Every record, and every list of records, is a table of its own.
"""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pkgutil import resolve_name
from typing import Any, NamedTuple, get_args

from beamsim.cli.screens import MOST_ROWS, NO_VALUE, WIDTH, Errors, align_columns, interpretation_text
from beamsim.cli.session import show
from beamsim.kinds import KINDS
from beamsim.plots.style import amount, use_units, value_text
from beamsim.results.result import Result
from beamsim.summaries import Entry, Plain, complete_entry, place_in_words, unit_in, words

# entries about values, which are printed with these values
VALUE_ENTRIES = ("status", "convergence", "doubtful", "after_divergence", "peak_times_s", "peak_frequencies_hz",
             "output_unit")  # fmt: skip
ACRONYMS = ("fdac", "frac", "mac", "psd", "srs")
Row = tuple[str, str]


class Cell(NamedTuple):
    """Text of a table cell, and its position."""

    title: str
    row: str
    column: str
    text: str


def all_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of all rows of a result's table: the first screen, then the complete summary."""
    yield from _first_rows(kind, result)
    yield from table_rows(result)


def _first_rows(kind: str, result: Result) -> Iterator[Row]:
    """Label and text of the rows of the first screen."""
    screen = resolve_name(KINDS[kind].screen)(result)
    yield from _labelled("status", filter(None, screen.status(result)))
    yield from _labelled("understood", filter(None, [interpretation_text(result)]))
    yield from _labelled("result", screen.body())


def table_rows(result: Result) -> Iterator[Row]:
    """Label and text of the summary rows, section by section."""
    tables: dict[str, dict[str, dict[str, str]]] = {}
    errors = Errors(result)
    for entry in (complete_entry(type(result), e) for e in type(result).SUMMARY if e.name not in VALUE_ENTRIES):
        value = result.summary.get(entry.name)
        if value is not None:
            for cell in _PrintedEntry(result, entry, errors).cells(value, entry.form):
                if cell.text:
                    tables.setdefault(cell.title, {}).setdefault(cell.row, {})[cell.column] = cell.text
    for title, table in tables.items():
        yield from _labelled(title, _table_lines(table))
    yield from _labelled("other errors", align_columns(list(errors.other_errors()), gap=2))
    if (used := result.command_processor_time_s) is not None:
        yield "processor time of the command", f"{amount(used, 's')}, with its workers"
    yield "wall time", amount(result.wall_time_s, "s")


def text_table(kind: str, result: Result) -> str:
    """Table of a result as text, for the Python prompt, in the units of the scenario."""
    with use_units(result.scenario.display_scales):
        return table_text(result.title, list(all_rows(kind, result)))


def html_table(kind: str, result: Result) -> str:
    """Table of a result for a notebook: the first screen, below it all other values, which unfold on a click."""
    with use_units(result.scenario.display_scales):
        first = escape(table_text(result.title, list(_first_rows(kind, result))))
        others = escape(table_text("", list(table_rows(result))).lstrip("\n"))
    return f"<pre>{first}</pre><details><summary>All values</summary><pre>{others}</pre></details>"


def print_table(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """Print a title and aligned rows, wrapped to the width of the terminal."""
    terminal = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    show(table_text(title, rows, terminal))


def table_text(title: str, rows: Sequence[tuple[str, str]], terminal: int | None = None) -> str:
    """Format a title and aligned rows.

    Parameters
    ----------
    title : first line.
    rows : label and text of each row.
    terminal : largest line length; None for no wrapping.

    Returns
    -------
    Lines with aligned texts.
    """
    indent = 4 + max((len(label) for label, _ in rows), default=0)
    lines = align_columns([(f"  {label}", text) for label, text in rows], gap=2)
    return "\n".join([title, *(part for line in lines for part in _wrap(line, indent, terminal))])


def _wrap(row: str, indent: int, width: int | None) -> list[str]:
    """Split a row into lines of at most ``width`` characters, with later lines indented, if there is room for text."""
    # texts get at least 40 columns; narrower terminals wrap by themselves
    if width is None or len(row) <= width or width - indent < 40:
        return [row]
    return textwrap.wrap(row, width, subsequent_indent=" " * (indent + 2), break_long_words=False)


def _labelled(label: str, texts: Iterable[str]) -> Iterator[Row]:
    for k, text in enumerate(texts):
        yield "" if k else label, text


class _PrintedEntry(NamedTuple):
    """Summary entry of a result as table cells."""

    result: Result
    entry: Entry
    errors: Errors

    def cells(self, value: Any, form: Any, place: tuple[str, ...] = ()) -> Iterator[Cell]:
        """Cells of a value at a place, whose type the entry declares."""
        title, row = _heading(self.entry.name), place_in_words(self.entry.name, " ".join(place))
        if isinstance(value, Mapping) and self._is_keyed_by_place(value, form, place):
            of_each = (get_args(form) or (None, None))[1]
            for name, each in value.items():
                yield from self.cells(each, of_each, (*place, name))
        elif isinstance(value, Mapping):
            yield from self._record(title, row, value, place)
        elif _is_table(value):
            yield from self._records(" ".join(filter(None, (title, row))), value, place)
        elif value not in ([], ()):
            own = "" if place or self.entry.section else "summary"
            yield Cell(self.entry.section or own or title, row, title, self._text(value, place))

    def _is_keyed_by_place(self, value: Mapping[str, Any], form: Any, place: tuple[str, ...]) -> bool:
        """True if the keys of a mapping are names of places; keys of a record are names of values."""
        if form is None:  # a field of the result
            return not place and all(isinstance(each, Mapping) for each in value.values())
        if form is Plain or not get_args(form):
            return False
        return bool(self.entry.section) or not place or any(isinstance(each, Mapping) for each in value.values())

    def _record(self, title: str, row: str, record: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[Cell]:
        plain = {_heading(*keys) for keys, *_ in _leaves(record) if unit_in(keys[-1]) is None}
        for keys, value, owner in _leaves(record):
            column, unit = _heading(*keys), unit_in(keys[-1])
            if unit and column in plain:  # amplitude and amplitude_db
                column = f"{column} ({unit})"
            part = " ".join(filter(None, (title, row, column)))
            if _is_table(value):
                yield from self._records(part, value, (*place, *keys))
            elif isinstance(value, Mapping):
                for names, each in _by_name(value):
                    yield from self._record(part, " ".join(names), each, (*place, *keys, *names))
            else:
                yield Cell(title, row, column, self._text(value, place, keys, owner))

    def _records(self, title: str, records: Sequence[Mapping[str, Any]], place: tuple[str, ...]) -> Iterator[Cell]:
        """Numbered records; of many, those that the entry ranks highest."""
        numbers: Sequence[int] = range(len(records))
        if len(records) > MOST_ROWS and self.entry.ranked_by:
            numbers = sorted(numbers, key=lambda k: -(records[k].get(self.entry.ranked_by) or 0.0))
        for k in sorted(numbers[:MOST_ROWS]):
            yield from self._record(title, str(k + 1), records[k], (*place, str(k + 1)))
        if len(records) > MOST_ROWS:
            yield Cell(title, f"and {len(records) - MOST_ROWS} more in the file", "", " ")

    def _text(
        self, value: Any, place: tuple[str, ...], keys: tuple[str, ...] = (), record: Mapping[str, Any] | None = None
    ) -> str:
        """Value with its unit, the time or frequency of a maximum, and its error."""
        unit = self.result.unit_of(self.entry, place, keys, record or {})
        if self.entry.shown and isinstance(value, Sequence):
            value = value[: self.result.summary[self.entry.shown]]
        named = next((key for key in keys if unit_in(key) is not None), keys[-1]) if keys else self.entry.name
        text = value_text(named, value, unit, digits=6 if "hz" in (named[-2:], unit.lower()) else 4)
        if named == "margin" and (value == math.inf or (record or {}).get("value") == 0.0):
            text = "infinite"  # result files store it as unknown
        at = "" if keys else self._place_text(place)
        error = self.errors.text(self.entry.name, " ".join((*place, *keys)), several=isinstance(value, list))
        return ", ".join(filter(None, (f"{text}{at}", error)))

    def _place_text(self, place: tuple[str, ...]) -> str:
        """Time or frequency of a largest value."""
        for name, unit in (("peak_times_s", "s"), ("peak_frequencies_hz", "Hz")):
            found = self.result.summary.get(name, {}).get(self.entry.name)
            for key in place:
                found = None if found is None else found.get(key)
            if found is not None:
                return f" at {amount(found, unit)}"
        return ""


def _is_table(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and any(isinstance(each, Mapping) for each in value)


def _leaves(
    record: Mapping[str, Any], parent_keys: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any, Mapping[str, Any]]]:
    """Keys of every value of a record (or of records by name), the value, and its record."""
    for name, value in record.items():
        if isinstance(value, Mapping) and not _has_records(value):
            yield from _leaves(value, (*parent_keys, name))
        else:
            yield (*parent_keys, name), value, record


def _has_records(value: Mapping[str, Any]) -> bool:
    return bool(value) and all(isinstance(each, Mapping) for each in value.values())


def _by_name(value: Mapping[str, Any], parent_keys: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Records by their names, which may have several levels."""
    for name, each in value.items():
        if _has_records(each):
            yield from _by_name(each, (*parent_keys, name))
        else:
            yield (*parent_keys, name), each


def _heading(*keys: str) -> str:
    """Keys of a summary in words; paths of the scenario remain unchanged."""
    return " ".join(key if "." in key else " ".join(map(_capitalise_acronym, words(key).split())) for key in keys)


def _capitalise_acronym(word: str) -> str:
    return word.upper() if word in ACRONYMS else word


def _table_lines(table: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Lines of a table: one line per value for a single place, else as many columns as fit."""
    if set(table) == {""}:
        rows = [(name, line) for name, text in table[""].items() for line in text.splitlines()]
        names = [name if k == 0 or rows[k - 1][0] != name else "" for k, (name, _) in enumerate(rows)]
        yield from align_columns([(name, line) for name, (_, line) in zip(names, rows, strict=True)], gap=2)
        return
    columns = [column for column in dict.fromkeys(c for row in table.values() for c in row) if column]
    if len(table) < len(columns):
        table = {column: {place: row.get(column, NO_VALUE) for place, row in table.items()} for column in columns}
        columns = list(dict.fromkeys(c for row in table.values() for c in row))
    while columns:
        count = len(columns)
        while True:
            lines = align_columns(
                [
                    ["", *columns[:count]],
                    *([p, *(r.get(c, NO_VALUE) for c in columns[:count])] for p, r in table.items()),
                ]
            )
            if count == 1 or max(map(len, lines)) <= WIDTH:
                break
            count -= 1
        yield from lines
        columns = columns[count:]
