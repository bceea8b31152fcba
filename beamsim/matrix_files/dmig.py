"""Nastran's DMIG entries in bulk data, as EXTSEOUT and PARAM,EXTOUT punch them: small, large and free fields."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import Dof, FileMatrix, direction_of, labelled

_SYMMETRIC = 6
_RECTANGULAR = (2, 9)
_EXPONENT = re.compile(r"(?<=[\d.])([+-]\d+)$")


def _number(text: str) -> float:
    """A Fortran number: 1.5D+3, and 1.5+3, are 1500."""
    text = text.strip().upper().replace("D", "E")
    return float(text if "E" in text else _EXPONENT.sub(r"E\1", text))


def _entries(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields after DMIG of every entry, continuations appended."""
    fields: list[str] = []
    start = 0
    for number, line in enumerate(path.read_text(encoding="latin-1").splitlines(), 1):
        text = line.split("$")[0].rstrip().expandtabs(8)
        if not text:
            continue
        first = (text.split(",")[0] if "," in text else text[:8]).strip().upper()
        new = bool(first) and first[0] not in "+*"
        if new:
            if fields:
                yield start, fields
            fields, start = [], number
            if first not in ("DMIG", "DMIG*"):
                continue
        elif not start or (not fields and not new):
            continue
        fields += _fields(text, wide=first.endswith("*") if new else first.startswith("*"))
    if fields:
        yield start, fields


def _fields(text: str, wide: bool) -> list[str]:
    """Data fields of a line, without the first and the last."""
    count = 4 if wide else 8
    if "," in text:
        fields = [each.strip() for each in text.split(",")[1 : count + 1]]
    else:
        width = 16 if wide else 8
        fields = [text[8 + k * width : 8 + (k + 1) * width].strip() for k in range(count)]
    return fields + [""] * (count - len(fields))


def read_dmig(path: Path) -> list[FileMatrix]:
    """All matrices of a file, with their names in lower case and their degrees of freedom.

    Raises
    ------
    MethodError
        If there are none, or an entry cannot be read; it names the line.
    """
    forms: dict[str, int] = {}
    entries: dict[str, dict[tuple[Dof, Dof], complex]] = {}
    for line, fields in _entries(path):
        try:
            name = fields[0].lower()
            if name not in forms:
                forms[name] = int(fields[2])
                entries[name] = {}
                continue
            column = (int(fields[1]), direction_of(int(fields[2] or 0)))
            terms = fields[4:] + [""] * (-len(fields[4:]) % 4)
            for node, component, real, imaginary in zip(*(terms[k::4] for k in range(4)), strict=True):
                if node:
                    row = (int(node), direction_of(int(component or 0)))
                    value = complex(_number(real), _number(imaginary) if imaginary else 0.0)
                    entries[name][row, column] = entries[name].get((row, column), 0.0) + value
        except (ValueError, IndexError):
            raise MethodError("file", f"has a DMIG entry in line {line} that cannot be read") from None
    if not entries:
        raise MethodError("file", "has no DMIG entry", "give the punch file that holds the matrices")
    return [
        labelled(name, entries[name], symmetric=form == _SYMMETRIC, square=form not in _RECTANGULAR)
        for name, form in forms.items()
    ]
