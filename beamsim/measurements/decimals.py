"""How the numbers of a text file are written: one decimal mark for the whole file, decided before any is read.

A point or comma followed by groups of exactly three digits can be a decimal mark or can separate thousands. It is taken
for neither before all numbers of the file have been looked at; where they leave it open, the user is asked.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from beamsim.errors import InputFileError
from beamsim.scenario.files import DecimalMark

_BLANKS = " \u00a0\u202f\u2009\u2007"  # ordinary, no-break, narrow no-break, thin and figure blank
_GROUPING = f"'’{_BLANKS}"  # marks that can only separate thousands
_OTHER: dict[str, DecimalMark] = {".": ",", ",": "."}
_NAMES = {".": "point", ",": "comma"}
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)


_PATTERNS = {
    mark: re.compile(
        rf"[+-]?(?:(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)(?:[eEdD][+-]?[0-9]+)?"  # without marks between thousands
        rf"|[1-9][0-9]{{0,2}}(?P<mark>{grouping})[0-9]{{3}}(?:(?P=mark)[0-9]{{3}})*(?:{point}[0-9]*)?)"
    )
    for mark, other in _OTHER.items()
    for point, grouping in [(re.escape(mark), f"[{re.escape(other + _GROUPING)}]")]
}
"""By decimal mark the numbers; thousands are grouped by one kind of mark, and not before an exponent."""
_PLAIN = {
    mark: str.maketrans({other: None, **dict.fromkeys(_GROUPING), mark: ".", "d": "e", "D": "e"})
    for mark, other in _OTHER.items()
}
_WITHIN_TEXT = re.compile(
    rf"(?<![\w.,])[0-9.,](?:[0-9.,{re.escape(_GROUPING)}]*[0-9.,])?(?:[eEdD][+-]?[0-9]+(?![0-9A-Za-z]))?"
)


def _strip(cell: str) -> str:
    return cell.strip().replace("−", "-")


def could_be_number(cell: str) -> bool:
    """Whether a cell is a finite number with one of the two decimal marks.

    >>> [could_be_number(cell) for cell in ("-1.104,5", "1'104", "12.05.2024", "0,5 mm", "1.5D-03")]
    [True, True, False, False, True]
    """
    cell = _strip(cell)
    return any(pattern.fullmatch(cell) for pattern in _PATTERNS.values())


def numbers_in(text: str) -> list[str]:
    """The numbers in a text, without their signs.

    >>> numbers_in("56,0 Hz"), numbers_in("0,3 - 1,1i"), numbers_in("1 104 mm"), numbers_in("tip2")
    (['56,0'], ['0,3', '1,1'], ['1 104'], [])
    """
    return [number for number in _WITHIN_TEXT.findall(text) if could_be_number(number)]


@dataclass(frozen=True)
class NumberFormat:
    """The decimal mark of a file; every other mark in its numbers separates thousands."""

    decimal: DecimalMark = "."

    def value(self, cell: str) -> float | None:
        """The number in a cell, nan of an empty one, and None where it is no number."""
        cell = _strip(cell)
        if _PATTERNS[self.decimal].fullmatch(cell):
            return float(cell.translate(_PLAIN[self.decimal]))
        if not cell or _NOT_FINITE.fullmatch(cell):
            return float(cell or "nan")
        return None

    def with_decimal_points(self, text: str) -> str:
        """A text whose numbers are written with a decimal point and without marks between thousands.

        >>> NumberFormat(",").with_decimal_points("-1.104,5 mm"), NumberFormat(",").with_decimal_points("tip2")
        ('-1104.5 mm', 'tip2')
        """

        def replace(match: re.Match[str]) -> str:
            number = match[0]
            return number if self.value(number) is None else number.translate(_PLAIN[self.decimal])

        return _WITHIN_TEXT.sub(replace, text.strip()).replace("−", "-")


def number_format(cells: Iterable[tuple[int, str]], decimal: DecimalMark | None = None) -> NumberFormat:
    """Decide how the numbers of a file are written.

    A mark separates thousands only if groups of exactly three digits follow it in every number that has it. If points
    and commas both occur, one of them is the decimal mark, and the other one must separate thousands.

    Parameters
    ----------
    cells : line and text of all cells that may hold numbers; others are passed over.
    decimal : the decimal mark that the user states.

    Returns
    -------
    NumberFormat

    Raises
    ------
    InputFileError
        If two numbers contradict each other, a number contradicts the stated mark, or exactly three digits follow every
        mark and the user states none: with the line.
    """
    proof: dict[str, tuple[int, str]] = {}  # by decimal mark the first number that has no other
    open_case: tuple[int, str] | None = None
    for line, cell in cells:
        points, commas = cell.count("."), cell.count(",")
        if not (points or commas):
            continue
        if (commas == 0 and points == 1 and "." in proof) or (points == 0 and commas == 1 and "," in proof):
            continue  # with its only mark as the decimal mark it is a number, or none at all
        number = _strip(cell)
        possible = [mark for mark, pattern in _PATTERNS.items() if pattern.fullmatch(number)]
        if len(possible) == 1:
            proof.setdefault(possible[0], (line, number))
        elif possible:
            open_case = open_case or (line, number)
    if decimal is not None:
        _check_stated(decimal, proof)
        return NumberFormat(decimal)
    if len(proof) == 2:
        numbers = " and ".join(f"{number} in line {line}" for line, number in sorted(proof.values()))
        raise InputFileError(
            f"has {numbers}: of point and comma one must be the decimal mark, and groups of exactly three digits must "
            "follow the other one, which separates thousands",
            "write all numbers with the same decimal mark",
        )
    if proof:
        return NumberFormat(_mark_of(next(iter(proof))))
    if open_case is not None:
        raise _ambiguity_error(*open_case)
    return NumberFormat()


def _check_stated(decimal: DecimalMark, evidence: dict[str, tuple[int, str]]) -> None:
    """Refuse a stated decimal mark that a number contradicts."""
    if (other := evidence.get(_OTHER[decimal])) is not None:
        raise InputFileError(
            f"has {other[1]} in line {other[0]}, which is no number with a decimal {_NAMES[decimal]} (decimal: "
            f'"{decimal}")',
            f'write decimal: "{_OTHER[decimal]}", or leave decimal out',
        )


def _mark_of(text: str) -> DecimalMark:
    return "." if text == "." else ","


def _ambiguity_error(line: int, number: str) -> InputFileError:
    mark = next(each for each in number if each in _OTHER)
    values = [NumberFormat(each).value(number) for each in (_mark_of(mark), _OTHER[mark])]
    either = " or ".join(np.format_float_positional(value or 0.0, trim="-") for value in values)
    return InputFileError(
        f"has {number} in line {line}, which can be {either}: three digits follow each {_NAMES[mark]} of the file",
        f'state the decimal mark with decimal (--decimal): decimal: "{mark}", or decimal: "{_OTHER[mark]}" if the '
        f"{_NAMES[mark]} separates thousands",
    )
