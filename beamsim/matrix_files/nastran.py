"""Nastran's matrices by pyYeti, the extra ``nastran``: OUTPUT4, OUTPUT2, and DMIG entries of bulk data."""

from __future__ import annotations

import warnings
from itertools import zip_longest
from pathlib import Path
from typing import Any

from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import FileMatrix, file_matrix, labelled, names_of

_SYMMETRIC, _RECTANGULAR = 6, (2, 9)  # forms of a matrix


def pyyeti() -> Any:
    """The module ``nastran`` of pyYeti; raises `MethodError` where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from pyyeti import nastran
    except ImportError:
        raise MethodError(
            "file", "is one of Nastran, for which pyYeti is needed", "pip install 'beamsim[nastran]'"
        ) from None
    return nastran


def read_op4(path: Path, name: str | None = None) -> list[FileMatrix]:
    """Matrices of an OUTPUT4 file, ASCII or binary; only that of a name, in lower case, if it is given."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", "Premature end-of-file")
        loaded = pyyeti().op4.load(str(path), name, into="list", sparse=True)
    return [file_matrix(called, m, one_triangle=form == _SYMMETRIC) for called, m, form, _ in zip(*loaded, strict=True)]


def read_op2(path: Path, name: str | None = None) -> list[FileMatrix]:
    """Matrices and DMIG tables of an OUTPUT2 file, of equal names the last; only that of a name if it is given."""
    nastran = pyyeti()
    with nastran.OP2(str(path)) as file:
        matrices = file.rdop2mats([name] if name else None, lower=True)
        # tables of DMIG entries begin with these numbers
        tables = [each.name.lower() for each in file.dblist if each.headers and each.headers[0][0] == (114, 1, 120)]
    found = [file_matrix(called, values) for called, values in matrices.items()]
    for called, frame in (nastran.rddmig(str(path), tables, square=True) if tables else {}).items():
        axes = ([*zip(*axis, strict=True)] if axis.nlevels == 2 else (axis, [0] * axis.size) for axis in frame.axes)
        found.append(file_matrix(called, frame, *(names_of(*axis) for axis in axes)))
    return found


def read_dmig(path: Path, _: str | None = None) -> list[FileMatrix]:
    """Matrices of DMIG entries in small, large and free fields, as EXTSEOUT and PARAM,EXTOUT punch them."""
    with open(path, encoding="latin-1") as file:
        cards = pyyeti().rdcards(file, r"dmig\b", regex=True, return_var="list", blank=0, follow_includes=False)
    by_name: dict[str, list[Any]] = {}
    for name, *fields in cards or ():
        by_name.setdefault(name.lower(), []).append(fields)
    return [_of_cards(name, *fields) for name, fields in by_name.items()]


def _of_cards(name: str, heading: list[Any], *columns: list[Any]) -> FileMatrix:
    """The matrix of the fields of its entries after the name; blank ones are zero."""
    form = heading[1]
    entries = [
        (row, component, *column[:2], complex(float(real), float(imaginary)))
        for column in columns
        for row, component, real, imaginary in zip_longest(*(column[k::4] for k in range(3, 7)), fillvalue=0)
        if row
    ]
    return labelled(name, entries, square=form not in _RECTANGULAR, one_triangle=form == _SYMMETRIC)
