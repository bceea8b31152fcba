"""Text tables: rows of cells, their columns, and which column is an axis of which others.

Spreadsheets, measuring systems and programs write such tables with any separator, decimal mark and encoding. CSV
readers of other packages are given the decimal mark and remove thousands marks wherever they stand (pandas with
``thousands=","`` makes 15 of 1,5), so the text is judged here, and `csv` only takes lines apart.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamsim.errors import InputFileError
from beamsim.files import demand_memory, read_text
from beamsim.measurements.decimals import NumberFormat, could_be_number, number_format, numbers_in
from beamsim.measurements.functions import is_unit_of
from beamsim.measurements.signal import MeasuredSignal, axis_kind, counts_samples, label_unit, split_heading
from beamsim.scenario import units as si
from beamsim.scenario.files import DecimalMark
from beamsim.typing import Floats

_MEASURED = (
    si.TIME, si.FREQUENCY, si.ACCELERATION, si.VELOCITY, si.LENGTH, si.FORCE, si.MOMENT, si.ANGLE, si.PRESSURE,
)  # fmt: skip
_WORD = re.compile(r'"[^"]*"|[^ \t]+(?:[ \t]+[(\[][^)\]]*[)\]])?')  # with its unit
_STARTS_WITH_NUMBER = re.compile(r'\s*"?[+\-−]?[0-9.,]')
_BLANK_WITHIN = re.compile(r"[^ \t,][ \t]+[^ \t,]")


MOST_LINES = 10_000_000
MOST_CELLS = 10_000_000
MOST_COLUMNS = 10_000
MOST_CHARACTERS_OF_LINE = 1_000_000
MOST_CHARACTERS_OF_CELL = 2_000
"""Bounds of a text table; a cell takes five microseconds to be read."""
_BYTES_OF_LINE, _BYTES_OF_CELL = 320, 90  # of memory, besides the characters
_LINE_ENDS = "\n\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
_SMALLER = "export fewer channels or samples to a file, or export HDF5 or MATLAB"


class TextRow(NamedTuple):
    """The cells of a line of a file."""

    line: int  # from 1
    cells: list[str]


@dataclass(frozen=True)
class TextRows:
    """The lines of a file that are no comments, as cells."""

    rows: list[TextRow]
    separator: str  # semicolon, tab, comma or, in words, blank
    comments: dict[int, list[str]]  # by line the cells of comments, which may be headings

    @property
    def unquoted_commas(self) -> bool:
        """Whether commas separate columns, so that those of numbers would have to be in quotes."""
        return self.separator == ","


def read_rows(path: Path) -> TextRows:
    """The cells of a file, and what separates them.

    Empty lines are left out, and comments, which begin with # or %. Semicolon or tab separate where most lines of
    numbers have one; else commas or blanks, whichever makes a table. A first line ``sep=;`` states it.

    Raises
    ------
    InputFileError
        If the file cannot be read, is no text, has nothing in it, is too large, or commas and blanks could both
        separate its columns.
    """
    try:
        text = read_text(path)
    except UnicodeDecodeError:
        raise InputFileError("is not text", "export it as CSV again") from None
    if (count := sum(map(text.count, _LINE_ENDS))) > 2 * MOST_LINES:  # two ends of a line of Windows
        raise InputFileError(f"has {count} line ends; up to {MOST_LINES} lines are read", _SMALLER)
    demand_memory(path, _BYTES_OF_LINE * count + 2 * len(text), f"for its {count + 1} lines")
    lines, comments = list[tuple[int, str]](), list[tuple[int, str]]()
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip(" \t;,"):
            (comments if line.lstrip().startswith(("#", "%")) else lines).append((number, line))
    if not lines:
        raise InputFileError("contains no data", "export it again")
    if stated := re.fullmatch(r"sep=([;,\t|])", lines[0][1].strip(" \r\n")):  # by spreadsheets, for spreadsheets
        lines = lines[1:] or lines
    separator = stated[1] if stated else _separator(path, lines)
    remarks = [(number, line.lstrip().lstrip("#%")) for number, line in comments]
    return TextRows(
        list(_split(path, lines, separator)),
        separator,
        {row.line: row.cells for row in _split(path, remarks, separator)},
    )


def _split(path: Path, lines: Sequence[tuple[int, str]], separator: str) -> Iterator[TextRow]:
    """The cells of lines, without those that are empty because lines end with a separator."""
    _demand_room(path, lines, separator)
    if separator == " ":
        rows = [TextRow(number, [cell.strip('"') for cell in _WORD.findall(line)]) for number, line in lines]
    else:
        reader = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
        try:
            rows = [TextRow(lines[reader.line_num - 1][0], [cell.strip() for cell in row]) for row in reader]
        except csv.Error as error:
            where = f"in line {lines[max(reader.line_num - 1, 0)][0]}"
            raise InputFileError(f"cannot be read {where} ({error})", "export it again") from None
    for row in rows:
        if (longest := max(map(len, row.cells), default=0)) > MOST_CHARACTERS_OF_CELL:
            message = f"has a cell of {longest} characters in line {row.line}; up to {MOST_CHARACTERS_OF_CELL} are read"
            raise InputFileError(message, "correct the line, or export it again")
    widths = Counter(len(row.cells) for row in rows)
    widest = max(widths, default=0)
    if widest > 1 and separator != " " and all(len(row.cells) < widest or not row.cells[-1] for row in rows):
        rows = [TextRow(row.line, row.cells[: widest - 1]) for row in rows]
    yield from rows


def _demand_room(path: Path, lines: Sequence[tuple[int, str]], separator: str) -> None:
    """Refuse a table that is too large to be taken apart, by the numbers of its separators.

    Raises
    ------
    InputFileError
        If its cells have no room in memory, a line is too long, or there are too many columns or cells.
    """
    cells = 0
    for number, line in lines:
        if len(line) > MOST_CHARACTERS_OF_LINE:
            message = f"has {len(line)} characters in line {number}; up to {MOST_CHARACTERS_OF_LINE} are read"
            raise InputFileError(message, _SMALLER)
        columns = len(line.split()) if separator == " " else line.count(separator) + 1
        if columns > MOST_COLUMNS:
            message = f"has {columns} columns in line {number}; up to {MOST_COLUMNS} are read"
            raise InputFileError(message, _SMALLER)
        cells += columns
    if cells > MOST_CELLS:
        message = f"has {cells} cells in {len(lines)} lines; up to {MOST_CELLS} cells are read"
        raise InputFileError(message, _SMALLER)
    demand_memory(path, _BYTES_OF_LINE * len(lines) + _BYTES_OF_CELL * cells, f"for its {cells} cells", _SMALLER)


def _separator(path: Path, lines: Sequence[tuple[int, str]]) -> str:
    """What separates the cells of lines with their numbers."""
    data = [each for each in lines if _STARTS_WITH_NUMBER.match(each[1])] or list(lines)
    for mark in ";\t":
        if 2 * sum(mark in line for _, line in data) > len(data):
            return mark
    if 2 * sum("," in line for _, line in data) < len(data):
        return " "
    if not any(_BLANK_WITHIN.search(line) for _, line in data):
        return ","
    possible = [mark for mark in ", " if _is_table(path, lines, data[0][0], mark)]
    if len(possible) == 2:
        raise InputFileError(
            f"can have its columns separated by commas or by blanks: line {data[0][0]} is {data[0][1].strip()}",
            "export it with semicolons or tabs between the columns",
        )
    return possible[0] if possible else ","


def _is_table(path: Path, lines: Sequence[tuple[int, str]], first: int, separator: str) -> bool:
    """Whether a separator makes rows of equal width from the headings on, of two cells or more that can be values."""
    begin = next(k for k, (number, _) in enumerate(lines) if number == first)
    rows = [row.cells for row in _split(path, lines[max(begin - 1, 0) :], separator)]
    cells = [cell for row in rows[min(begin, 1) :] for cell in row]
    return all(map(_can_be_value, cells)) and len({len(row) for row in rows}) == 1 < len(rows[0])


def _can_be_value(cell: str) -> bool:
    """Whether a cell is a number, perhaps with its unit (25 %), or a text without a comma in it."""
    if not _STARTS_WITH_NUMBER.match(cell):
        return "," not in cell
    number, _, unit = cell.partition(" ")
    return could_be_number(cell) or (could_be_number(number) and not _STARTS_WITH_NUMBER.match(unit))


@dataclass(frozen=True)
class NamedColumns:
    """A table below one row of headings, some of whose columns hold texts; numbers have decimal points."""

    headings: list[str]
    line: int  # of the headings
    rows: list[TextRow]
    numbers: NumberFormat

    @property
    def names(self) -> list[str]:
        """Headings without units, in lower case."""
        return [split_heading(heading)[0].lower() for heading in self.headings]

    @property
    def units(self) -> list[str]:
        """Units of the headings, empty where they have none."""
        return [label_unit(split_heading(heading)[1]) for heading in self.headings]


def read_named_columns(path: Path, decimal: DecimalMark | None = None, texts: Collection[str] = ()) -> NamedColumns:
    """A table whose first row has the headings; headings may begin with numbers themselves.

    Parameters
    ----------
    path : of the file.
    decimal : its decimal mark, where the user states it.
    texts : names of columns, in lower case, that hold texts.

    Returns
    -------
    NamedColumns
        In cells of other columns, and in headings, numbers are written with decimal points.

    Raises
    ------
    InputFileError
        If the file cannot be read, has no rows, a row is not as long as the headings, or its decimal mark is unknown.
    """
    first, *rows = read_rows(path).rows
    of_text = [split_heading(heading)[0].lower() in texts for heading in first.cells]
    for row in rows:
        if len(row.cells) != len(first.cells):
            message = f"has {len(row.cells)} columns in line {row.line} instead of {len(first.cells)}"
            raise InputFileError(message, "give each line a cell for each heading")
    cells = [
        (row.line, number)
        for row in (first, *rows)
        for cell, text in zip(row.cells, of_text, strict=True)
        if not text and (row is not first or begins_with_number(cell))
        for number in numbers_in(cell)
    ]
    numbers = number_format(cells, decimal)
    plain = [
        TextRow(
            row.line,
            [
                cell if text else numbers.with_decimal_points(cell)
                for cell, text in zip(row.cells, of_text, strict=True)
            ],
        )
        for row in rows
    ]
    headings = [numbers.with_decimal_points(each) if begins_with_number(each) else each for each in first.cells]
    return NamedColumns(headings, first.line, plain, numbers)


def begins_with_number(text: str) -> bool:
    """Whether a text begins with a number, perhaps with its unit behind."""
    return bool(_STARTS_WITH_NUMBER.match(text) and numbers_in(text))


def read_csv(path: Path, decimal: DecimalMark | None = None) -> list[MeasuredSignal]:
    """The columns of a table of numbers, each along its axis; cells that are empty are nan.

    An axis is a column headed as a time or frequency; with several of them each is that of the columns up to the next
    one. Where no heading says so, it is the first column in a unit of time or frequency, else the first of all.

    Parameters
    ----------
    path : of the file.
    decimal : its decimal mark, where the user states it.

    Returns
    -------
    list of MeasuredSignal
        In the order of the file and in its units; axes, and counts of the samples, have no axis themselves.

    Raises
    ------
    InputFileError
        If it holds no table of numbers, or a cell of it is none: with its line and heading.
    """
    text = read_rows(path)
    first = _first_sample(text.rows)
    samples = text.rows[first:]
    width = Counter(len(row.cells) for row in samples).most_common(1)[0][0]
    headings = _headings(text, first, width)
    for row in samples:
        if len(row.cells) != width:
            raise _misfit(text, f"{len(row.cells)} columns in line {row.line} instead of {width}", "correct the line")
    numbers = number_format(((row.line, cell) for row in samples for cell in row.cells), decimal)
    values = np.empty((len(samples), width))
    for i, row in enumerate(samples):
        for j, cell in enumerate(row.cells):
            value = numbers.value(cell)
            if value is None:
                where = f"in line {row.line}, sample {i + 1} of {headings[j]}"
                raise InputFileError(
                    f"has {cell[:60]!r} {where}: it is not a number", "only numbers follow the headings"
                )
            values[i, j] = value
    return list(_signals(headings, values, str(path)))


def _first_sample(rows: Sequence[TextRow]) -> int:
    """Number of the first row of the table: it begins with a number, and is as long as most rows, if any such is."""
    width = Counter(len(row.cells) for row in rows).most_common(1)[0][0]
    begin = (k for k, row in enumerate(rows) if could_be_number(row.cells[0]))
    first = next(begin, None)
    if first is None:
        raise InputFileError("has no samples: no line starts with a number", "export the measurement again")
    if len(rows[first].cells) != width:
        first = next((k for k in begin if len(rows[k].cells) == width), first)
    # a row with numbers next to its first cell, right above the samples, is a sample with a fault
    while first > 1 and len(rows[first - 1].cells) == width and any(map(could_be_number, rows[first - 1].cells)):
        first -= 1
    return first


def _headings(text: TextRows, first: int, width: int) -> list[str]:
    """The headings of the columns, each with a name of its own."""
    above = [row.cells for row in text.rows[:first]]
    before = text.rows[first].line
    remark = text.comments.get(max((line for line in text.comments if line < before), default=0), [])
    if not above and len(remark) == width and not any(map(could_be_number, remark)):
        above = [remark]
    if not above:
        _refuse_split_numbers(text, first)
        return [f"column {k + 1}" for k in range(width)]
    headings = headings_of(above)
    if width == 1:
        headings = [" ".join(headings)]
    if len(headings) == width + 1 and not headings[-1]:
        headings = headings[:-1]
    if len(headings) != width:
        remedy = "give each column one heading"
        raise _misfit(text, f"{len(headings)} headings for {width} columns", remedy, may_be_split=width > len(headings))
    several = Counter(headings)
    return [f"{heading} ({k + 1})" if several[heading] > 1 else heading for k, heading in enumerate(headings)]


def _misfit(text: TextRows, message: str, remedy: str, may_be_split: bool = True) -> InputFileError:
    """A row that is not as long as another one, and what may have split it."""
    if text.unquoted_commas and may_be_split:
        message += ", or decimal commas (or commas between thousands) between commas"
        remedy = "export it with semicolons or tabs between the columns, or with decimal points"
    elif text.separator == " " and may_be_split:
        remedy += "; where blanks separate thousands, export it with semicolons or tabs between the columns"
    return InputFileError(f"has {message}", remedy)


def _refuse_split_numbers(text: TextRows, first: int) -> None:
    """Refuse a table without headings in which commas cut numbers in two: digits behind one begin with zeros."""
    if not text.unquoted_commas:
        return
    for row in text.rows[first:]:
        if any(re.fullmatch(r"0[0-9]+", cell) for cell in row.cells[1:]):
            raise InputFileError(
                f"seems to have decimal commas between commas, as in line {row.line}: {','.join(row.cells)}",
                "export it with semicolons or tabs between the columns, or with decimal points",
            )


def headings_of(rows: list[list[str]]) -> list[str]:
    """Headings of the columns from the rows above the numbers: the last row, with the units that may stand below it.

    >>> headings_of([["Test 7"], ["Frequency", "tip"], ["Hz", "g"]])
    ['Frequency (Hz)', 'tip (g)']
    """
    last = rows[-1]
    if len(rows) < 2 or len(rows[-2]) != len(last) or not all(map(_is_unit, last)):
        return last
    units = (label_unit(cell.strip("()[] ")) for cell in last)
    return [f"{name} ({unit})" if unit else name for name, unit in zip(rows[-2], units, strict=True)]


def _is_unit(text: str) -> bool:
    """Whether a cell is a unit of what is measured, or says that there is none."""
    unit = label_unit(text.strip("()[] "))
    return not unit or is_unit_of(unit, *_MEASURED)


_NUMBERED_AXIS = re.compile(r"(x|t)[ _]?([0-9]+|value|values|axis|achse|wert)?", re.IGNORECASE)


def _signals(headings: Sequence[str], values: Floats, source: str) -> Iterator[MeasuredSignal]:
    """The columns of a table along their axes."""
    axes = _axes(headings, values)
    starts = set(axes)
    for j, (heading, axis) in enumerate(zip(headings, axes, strict=True)):
        x, y = np.arange(len(values), dtype=float), values[:, j]
        of_group = j if j in starts else axis
        if of_group is not None:  # cells below a group that is shorter than others are empty
            padding = np.isnan(values[:, of_group]) & np.isnan(y)
            end = padding.size - int(np.argmin(padding[::-1]))
            x, y = (x if axis is None else values[:, axis])[:end], y[:end]
        named = "" if axis is None else headings[axis]
        yield MeasuredSignal(
            name=heading, x=x, y=y, is_over_frequency=_kind(named) == "frequency", unit=split_heading(heading)[1],
            source=source, axis=named, axis_unit=split_heading(named)[1],
        )  # fmt: skip


def _kind(heading: str) -> str:
    """Time or frequency, from the name of a heading, else from its unit."""
    unit = split_heading(heading)[1]
    of_unit = "time" if unit and is_unit_of(unit, si.TIME) else "frequency"
    return axis_kind(heading) or (of_unit if unit and is_unit_of(unit, si.TIME, si.FREQUENCY) else "")


def _axes(headings: Sequence[str], values: Floats) -> list[int | None]:
    """The column that is the axis of each column; None of axes, of counts of the samples, and where it is unknown."""
    count = len(headings)
    counts = [counts_samples(heading, column) for heading, column in zip(headings, values.T, strict=True)]
    others = [j for j in range(count) if not counts[j]]
    axes = [j for j in others if axis_kind(headings[j])] or _numbered_axes(headings, others)
    named = bool(axes)
    axes = axes or [j for j in others if _kind(headings[j])][:1] or others[: len(others) > 1]
    known = set(axes)
    last = max((j for j in others if j not in known), default=-1)
    # one right behind another, or behind all columns, belongs to the same samples and starts no group
    starts = {j for j in axes if j == axes[0] or (j - 1 not in known and j < last)}
    unknown = {
        j
        for j in others
        if j not in known and _kind(headings[j]) == "time" and np.all(np.diff(values[np.isfinite(values[:, j]), j]) > 0)
    }
    found: list[int | None] = []
    start = next(iter(starts)) if len(starts) == 1 else None  # also of the columns before it
    doubtful = False
    for j in range(count):
        if j in starts:
            start, doubtful = j, False
        found.append(None if j in starts or counts[j] or doubtful else start)
        doubtful = doubtful or (named and start is not None and start < j and j in unknown)
    return found


def _numbered_axes(headings: Sequence[str], channel_columns: Sequence[int]) -> list[int]:
    """Axes called X_1, X_2 ... or t1, t2 ..., from the first column on, each before a column of another name."""
    names = [split_heading(heading) for heading in headings]
    axes = [
        j
        for j in channel_columns
        if (match := _NUMBERED_AXIS.fullmatch(names[j][0]))
        and match[2]
        and (not names[j][1] or is_unit_of(names[j][1], si.TIME, si.FREQUENCY))
    ]
    alternate = (
        bool(axes)
        and axes[0] == channel_columns[0]
        and all(j + 1 in channel_columns and j + 1 not in axes for j in axes)
    )
    return axes if alternate else []
