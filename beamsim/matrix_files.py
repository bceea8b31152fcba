"""Matrices of other programs' files, and the names of their degrees of freedom where a file knows them.

OP2, OP4, DMIG, Abaqus, MatrixMarket, Harwell-Boeing, MATLAB and NumPy. Never here: what a matrix means for a structure.
"""

from __future__ import annotations

import math
import os
import re
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import h5py
import numpy as np
from scipy.sparse import coo_array, csc_array, issparse, save_npz

from beamsim.dofs import DIRECTIONS, MODAL, Dof
from beamsim.errors import InputFileError, MethodError
from beamsim.files import bytes_text, demand_memory, open_input, read_input, reading, replacement_file
from beamsim.hdf5 import open_hdf5, read_array
from beamsim.matlab5 import checked_matlab5
from beamsim.sparse_parts import (
    MOST_ROWS,
    from_blocks,
    from_columns,
    from_coordinates,
    from_diagonals,
    from_rows,
    matrix_shape,
    whole_numbers,
)


@dataclass(frozen=True)
class FileMatrix:
    """One matrix of a file."""

    name: str  # in lower case
    values: Any  # (rows, columns) sparse, real or complex
    rows: tuple[Dof, ...] | None = None  # None where the file only counts them
    columns: tuple[Dof, ...] | None = None
    place: str = ""  # where it is in the file; empty where a file has one, or names are unique


def file_matrix(name: str, values: Any, *names: tuple[Dof, ...] | None, one_triangle: bool = False) -> FileMatrix:
    """A matrix without entries of zero.

    Parameters
    ----------
    name : of the matrix.
    values : (rows, columns) sparse or dense, real or complex.
    names : of rows and of columns, where the file has them.
    one_triangle : whether an entry stands for the opposite one as well where that is missing.

    Returns
    -------
    FileMatrix
        Sparse.
    """
    matrix: Any = csc_array(values)
    if one_triangle:
        matrix = matrix + (matrix.T - matrix.T.multiply(matrix != 0)).tocsc()
    matrix.eliminate_zeros()
    rows, columns = names or (None, None)
    return FileMatrix(name, matrix, rows, columns)


def label_matrix(name: str, entries: Any, *, square: bool, one_triangle: bool = False) -> FileMatrix:
    """The matrix of entries by degrees of freedom, in order of node and component.

    Parameters
    ----------
    name : of the matrix.
    entries : (n, 5) node and component of the row, those of the column, and the number, real or complex.
    square : whether rows and columns have the same degrees of freedom.
    one_triangle : whether an entry stands for the opposite one as well where that is missing.

    Returns
    -------
    FileMatrix
        With names of rows and columns.

    Raises
    ------
    MethodError
        About ``file``, if two entries have the same place.
    ValueError
        If a number is not finite, or a node or component is no whole number.
    """
    entries = _finite(np.asarray(entries))
    places = whole_numbers("nodes and components", entries[:, :4].real.ravel()).reshape(-1, 4)
    nodes, components = places[:, 0::2], places[:, 1::2]
    dofs = 7 * nodes + np.where((components >= 1) & (components <= 6), components, 0)
    axes = [np.unique(dofs if square else dofs[:, k]) for k in (0, 1)]
    numbers = entries[:, 4] if np.any(entries[:, 4].imag) else entries[:, 4].real
    at = tuple(np.searchsorted(axis, dofs[:, k]) for k, axis in enumerate(axes))
    _demand_unique(at[0], at[1], lambda k: "node {:g} {:g}, node {:g} {:g}".format(*entries[k, :4].real))
    values = coo_array((numbers, at), shape=(axes[0].size, axes[1].size))
    return file_matrix(name, values, *(names_of(*divmod(axis, 7)) for axis in axes), one_triangle=one_triangle)


def _finite(entries: Any) -> Any:
    """Entries of a file by row, if all their numbers are finite; raises `ValueError` otherwise."""
    if (bad := np.flatnonzero(~np.isfinite(entries).all(axis=1))).size:
        raise ValueError(f"its entry {bad[0] + 1} holds a number that is not finite")
    return entries


def _demand_unique(rows: Any, columns: Any, place_of: Callable[[int], str]) -> None:
    """Refuse two entries of one place, which a sparse matrix would sum.

    Parameters
    ----------
    rows, columns : (n,) places of the entries.
    place_of : name of that of an entry, by its number from 0.

    Raises
    ------
    MethodError
        About ``file``, with the numbers of both entries.
    """
    order = np.lexsort((columns, rows))
    same = (np.diff(rows[order]) == 0) & (np.diff(columns[order]) == 0)
    if same.any():
        first, second = sorted(order[np.flatnonzero(same)[0] :][:2].tolist())
        raise MethodError(
            "file", f"has two entries for {place_of(second)}, numbers {first + 1} and {second + 1}",
            "remove one of them, or give each of two matrices a file",
        )  # fmt: skip


def names_of(nodes: Iterable[int], components: Iterable[int]) -> tuple[Dof, ...]:
    """Names of degrees of freedom by node and component, 1 to 6, or 0 of a scalar point.

    >>> names_of([7, 101], [3, 0])
    ((7, 'z'), (101, 'modal'))
    """
    return tuple((int(n), (MODAL, *DIRECTIONS)[c]) for n, c in zip(nodes, components, strict=True))


_SYMMETRIC, _BY_COLUMN_NUMBER = 6, 9  # forms of a matrix
_RECTANGULAR = (2, _BY_COLUMN_NUMBER)


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
        all_names, shapes, *_ = pyyeti().op4.dir(str(path), verbose=False)
        for shape in shapes:  # before room is made for what headers claim
            matrix_shape(shape)
        loaded = pyyeti().op4.load(str(path), name, into="list", sparse=True)
        names = loaded[0] if len(set(loaded[0])) == len(loaded[0]) else all_names
    numbers = [number for number, called in enumerate(names, 1) if called in loaded[0]]
    return [
        replace(file_matrix(called, m, one_triangle=form == _SYMMETRIC), place=f"matrix {number} of the file")
        for number, called, m, form in zip(numbers, *loaded[:3], strict=True)
    ]


def read_op2(path: Path, name: str | None = None) -> list[FileMatrix]:
    """Matrices and DMIG tables of an OUTPUT2 file; only those of a name if it is given."""
    nastran = pyyeti()
    _demand_records(path)
    with nastran.OP2(str(path)) as file:
        wanted = [block for block in file.dblist if name in (None, block.name.lower())]
        tables = [each for each in wanted if each.headers and each.headers[0][0] == _OF_DMIG]
        _demand_room(path, [block for block in wanted if block.dbtype > 0], tables)
        _demand_one_of_each(tables)
        matrices = file.rdop2mats([name] if name else None, lower=True, which="all")
        labelled_ones = [_of_dmig_table(table.name.lower(), _record_of(file, table)) for table in tables]
    return [
        replace(file_matrix(called, values), place=f"matrix {number} of this name")
        for called, several in matrices.items()
        for number, values in enumerate(several, 1)
    ] + labelled_ones


_OF_DMIG = (114, 1, 120)
"""First numbers of a table of DMIG entries."""


def _demand_one_of_each(tables: Sequence[Any]) -> None:
    """Refuse two tables of one name."""
    names = [table.name.lower() for table in tables]
    if repeated := [called for called, times in Counter(names).items() if times > 1]:
        places = [number for number, called in enumerate(names, 1) if called == repeated[0]]
        raise ValueError(f"it holds {repeated[0]} as DMIG tables {' and '.join(map(str, places))}: remove all but one")


def _record_of(file: Any, table: Any) -> Any:
    """(n,) the numbers of a table's first record."""
    file.set_position(table.start)
    file.rdop2nt()
    return file.rdop2record()


def _of_dmig_table(name: str, record: Any) -> FileMatrix:
    """The matrix of a table of DMIG entries.

    Twelve numbers, of which number 6 is the form and 7 the type, precede the columns: node and component of the column,
    those of each row with the entry, and -1, -1. Layout: MSC Nastran, Programmer's reference, data block DMIG.

    Parameters
    ----------
    name : of the matrix.
    record : (n,) four-byte integers, two of which make an entry of double precision.

    Returns
    -------
    FileMatrix
        With names of rows and columns.

    Raises
    ------
    ValueError
        If it is not of four-byte integers, its type is unknown, or a column does not end.
    """
    if record.itemsize != 4 or record.size < 12 or not 1 <= record[7] <= 4:
        raise ValueError(f"the DMIG table {name} is of an unknown type")
    form, kind = int(record[6]), np.dtype(("f4", "f8", "c8", "c16")[record[7] - 1]).newbyteorder(record.dtype.byteorder)
    step, begin = 2 + kind.itemsize // 4, 12
    ends = np.flatnonzero((record[:-1] == -1) & (record[1:] == -1))
    columns = []
    while begin < record.size - 2:
        start = begin + 2
        later = ends[np.searchsorted(ends, start) :]
        end = next((int(each) for each in later if (each - start) % step == 0), None)
        if end is None:
            raise ValueError(f"a column of the DMIG table {name} does not end")
        rows = record[start:end].reshape(-1, step)
        entries = np.empty((len(rows), 5), dtype=complex)
        entries[:, :2] = rows[:, :2]
        entries[:, 2:4] = record[begin], 0 if form == _BY_COLUMN_NUMBER else record[begin + 1]
        entries[:, 4] = np.ascontiguousarray(rows[:, 2:]).view(kind)[:, 0]
        columns.append(entries)
        begin = end + 2
    entries = np.concatenate(columns) if columns else np.empty((0, 5))
    return label_matrix(name, entries, square=form not in _RECTANGULAR, one_triangle=form == _SYMMETRIC)


def _demand_records(path: Path) -> None:
    """Refuse an OUTPUT2 file that is no sequence of records, each between two counts of its bytes.

    pyYeti skips by these counts, in circles where one is negative.
    """
    with open_input(path) as file:
        order = "<" if file.read(4) in (struct.pack("<i", 4), struct.pack("<i", 8)) else ">"
        size, at = os.fstat(file.fileno()).st_size, 0
        while at < size:
            file.seek(at)
            (count,) = struct.unpack(f"{order}i", file.read(4))
            file.seek(at + 4 + count if count >= 0 else size)
            if file.read(4) != struct.pack(f"{order}i", count):
                raise ValueError(f"the record at byte {at} does not end where it says")
            at += 8 + count


def _demand_room(path: Path, matrices: Iterable[Any], tables: Iterable[Any]) -> None:
    """Refuse blocks of an OUTPUT2 file that together have no room in memory, where matrices are dense at first."""
    needed = 0
    for block in matrices:
        rows, columns = matrix_shape(block.size)
        needed += 16 * rows * columns
        demand_memory(path, needed, f"up to the {rows} x {columns} numbers of {block.name}")
    for block in tables:
        needed += _BYTES_OF_TABLE * block.nbytes
        demand_memory(path, needed, f"up to the entries of {block.name}")


_BYTES_OF_TABLE = 30
"""Bytes of memory for each byte of a table of DMIG entries."""


def read_dmig(path: Path, _: str | None = None) -> list[FileMatrix]:
    """Matrices of DMIG entries in small, large and free fields, as EXTSEOUT and PARAM,EXTOUT punch them."""
    text = _text(path)
    cards = pyyeti().rdcards(StringIO(text), r"dmig\b", regex=True, return_var="list", blank=0, follow_includes=False)
    lines = _headings_of_dmig(text)
    found: list[tuple[str, list[Any]]] = []
    latest: dict[str, list[Any]] = {}  # cards of the last matrix of a name
    for name, *fields in cards or ():
        if fields[0] == 0 or name.lower() not in latest:  # a heading
            latest[name.lower()] = []
            found.append((name.lower(), latest[name.lower()]))
        latest[name.lower()].append(fields)
    return [
        replace(_of_cards(name, *fields), place=f"line {lines[name].pop(0)}" if lines.get(name) else "")
        for name, fields in found
    ]


def _text(path: Path) -> str:
    """Text of a file of any 8-bit encoding; lines end with a newline."""
    return StringIO(read_input(path).decode("latin-1"), newline=None).getvalue()


def _headings_of_dmig(text: str) -> dict[str, list[int]]:
    """Lines with the headings of each matrix, from 1, by its name in lower case."""
    found: dict[str, list[int]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        card = line.lower()
        if not card.startswith("dmig"):
            continue
        width = 16 if card[4:5] == "*" else 8
        fields = card.split(",")[1:3] if "," in card else [card[8 : 8 + width], card[8 + width : 8 + 2 * width]]
        if len(fields) == 2 and fields[1].strip() == "0":
            found.setdefault(fields[0].strip(), []).append(number)
    return found


def _of_cards(name: str, heading: list[Any], *columns: list[Any]) -> FileMatrix:
    """The matrix of the fields of its entries after the name; blank ones are zero."""
    form = heading[1]
    entries = [
        (row, component, *column[:2], complex(float(real), float(imaginary)))
        for column in columns
        for row, component, real, imaginary in zip_longest(*(column[k::4] for k in range(3, 7)), fillvalue=0)
        if row
    ]
    return label_matrix(name, entries, square=form not in _RECTANGULAR, one_triangle=form == _SYMMETRIC)


def read_matrix(path: Path, name: str | None) -> FileMatrix:
    """One matrix of a file, its name without regard to case; the only one where no name is given.

    Raises
    ------
    MethodError
        About ``file`` or ``name``: it does not exist or cannot be read, it has no matrix of that name, or several.
    """
    found = [each for each in read_matrices(path, name) if name is None or each.name.lower() == name.lower()]
    found = [each for each in found if each.name == name] or found
    if len(found) == 1:
        return found[0]
    if len({each.name for each in found}) == 1:
        places = " and ".join(each.place or each.name for each in found)
        raise MethodError(
            "file", f"= {path.name} holds {len(found)} matrices {found[0].name}: {places}",
            "remove all but one of them from the file",
        )  # fmt: skip
    known = ", ".join(matrix.name for matrix in read_matrices(path))
    if not known:
        raise MethodError("file", f"= {path.name} holds no matrix", "check the file")
    if name is None:
        raise MethodError("file", f"holds {len(found)} matrices", f"name one: {known}")
    raise MethodError("name", f"= {name} is not a matrix of {path.name}", f"it holds {known}")


def read_matrices(path: Path, name: str | None = None) -> list[FileMatrix]:
    """All matrices of a file; with ``name``, in any case, others may be left out.

    Raises
    ------
    MethodError
        About ``file``: it does not exist, or cannot be read.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise MethodError("file", f"= {path.name} has an unknown ending", f"known are {', '.join(FORMATS)}")
    called, memory, reader = FORMATS[ending]
    try:
        with reading(path, called, "check the file"), open_input(path) as file:  # which some readers open themselves
            if not (size := os.fstat(file.fileno()).st_size):
                raise InputFileError("is empty", "check the file", path)
            demand_memory(path, memory * size, f"for the {bytes_text(size)} of the file")
            return reader(path, name and name.lower())
    except InputFileError as error:
        raise MethodError("file", f"= {path.name} {error.message}", error.remedy) from None


def _market_or_abaqus(path: Path, _: str | None) -> list[FileMatrix]:
    """The matrix of a file; Abaqus writes one triangle of a symmetric one, with *MATRIX OUTPUT.

    Raises
    ------
    ValueError
        If a line of Abaqus is not an entry: row node, its degree of freedom, column node, its degree of freedom and the
        number (MATRIX INPUT, LABELS), or row, column and number (COORDINATE), all finite. Coordinates without a node
        have a degree of freedom beyond 6.
    """
    name = path.stem.lower()
    text = _text(path)
    if text[:14].lower() == "%%matrixmarket":
        return [file_matrix(name, _of_market(text))]
    lines = (line.replace(",", " ").upper().replace("D", "E") for line in text.splitlines())
    entries = np.loadtxt(lines, comments=("*", "%", "#"), ndmin=2)
    if entries.shape[1] == 5:
        return [label_matrix(name, entries, square=True, one_triangle=True)]
    i, j, numbers = _finite(entries).T
    _demand_unique(i, j, lambda k: f"row {i[k]:g}, column {j[k]:g}")
    size = int(max(i.max(), j.max()))
    values = from_coordinates(numbers, i - 1, j - 1, (size, size))
    return [file_matrix(name, values, one_triangle=True)]


def _of_market(text: str) -> Any:
    """The matrix of a text in MatrixMarket's format, with both triangles of a symmetric one.

    SciPy's reader writes beyond its arrays where a dense symmetric matrix has more entries than its size says. Layout:
    Boisvert, Pozo and Remington, The Matrix Market exchange formats, NISTIR 5935, 1996.

    Raises
    ------
    ValueError
        If its heading is unknown, an entry is none or outside the matrix, or there are not as many as it says.
    """
    heading, *lines = (line for line in text.splitlines() if line.strip())
    lines = [line for line in lines if not line.lstrip().startswith("%")]
    words = heading.lower().split()[1:]
    layout, field, symmetry = words[1:] if words[:1] == ["matrix"] and len(words) == 4 else ("", "", "")
    width = {"pattern": 0, "complex": 2, **dict.fromkeys(("real", "double", "integer", "unsigned-integer"), 1)}.get(
        field
    )
    if width is None or layout not in ("array", "coordinate") or symmetry not in _OPPOSITE or not lines:
        raise ValueError(f"its heading is {heading.strip()[:80]}")
    sizes = [int(size) for size in lines[0].split()]
    rows, columns = matrix_shape(sizes[:2])
    if layout == "array":
        places = _places_of_dense(rows, columns, symmetry)
        count, width_of_line = places[0].size, width
    else:
        places = None
        count, width_of_line = int(sizes[2]) if len(sizes) == 3 else -1, 2 + width
    if len(lines) - 1 != count:
        raise ValueError(f"it has {len(lines) - 1} lines of entries instead of {count}")
    table = np.loadtxt(lines[1:], comments=None, ndmin=2) if count else np.empty((0, width_of_line))
    if table.shape[1] != width_of_line:
        raise ValueError(f"its lines have {table.shape[1]} numbers instead of {width_of_line}")
    i, j = places or (whole_numbers("places", table[:, k]) - 1 for k in (0, 1))
    numbers = table[:, -2] + 1j * table[:, -1] if width == 2 else table[:, -1] if width else np.ones(count)
    if opposite := _OPPOSITE[symmetry]:
        off = np.flatnonzero(i != j)
        i, j = np.concatenate([i, j[off]]), np.concatenate([j, i[off]])
        numbers = np.concatenate([numbers, opposite(numbers[off])])
    matrix = from_coordinates(numbers, i, j, (rows, columns))
    _demand_unique(i, j, lambda k: f"row {i[k] + 1}, column {j[k] + 1}")
    return matrix


_OPPOSITE: dict[str, Callable[[Any], Any] | None] = {
    "general": None, "symmetric": np.positive, "skew-symmetric": np.negative, "hermitian": np.conj,
}  # fmt: skip
"""By symmetry what an entry stands for at the opposite place."""


def _places_of_dense(rows: int, columns: int, symmetry: str) -> tuple[Any, Any]:
    """Rows and columns of the entries of a dense matrix, column by column; of a symmetric one the lower triangle."""
    if rows * columns > MOST_ROWS:
        raise ValueError(f"it is a dense matrix of {rows} x {columns}")
    j, i = np.divmod(np.arange(rows * columns), max(rows, 1))
    lower = np.full(i.size, True) if symmetry == "general" else i > j if symmetry == "skew-symmetric" else i >= j
    return i[lower], j[lower]


def _harwell_boeing(path: Path, _: str | None) -> list[FileMatrix]:
    """The matrix of a file, which SciPy reads neither symmetric nor complex; of a symmetric one it has one triangle.

    Layout: Duff, Grimes and Lewis, Users' guide for the Harwell-Boeing sparse matrix collection, 1992.

    Raises
    ------
    ValueError
        If it is not assembled, has no values, or cannot be read.
    """
    lines = _text(path).upper().replace("D", "E").splitlines()
    _, lengths, shape, formats = (lines + [""] * 4)[:4]
    kind = shape[:3]
    if not re.fullmatch("[RC].A", kind):
        raise ValueError(f"its type is {kind or 'missing'}; real and complex assembled matrices are read")
    rows, columns, entries = (int(shape[k : k + 14]) for k in (14, 28, 42))
    matrix_shape((rows, columns))
    rest = iter(lines[5 if int(lengths[56:70] or 0) else 4 :])  # a line more where right-hand sides follow
    blocks, counts = [], (columns + 1, entries, entries * (2 if kind[0] == "C" else 1))
    for start, width, count in zip((14, 28, 42), re.findall(r"[IEFG](\d+)", formats), counts, strict=False):
        block = list(islice(rest, int(lengths[start : start + 14])))
        numbers = " ".join(block).split()
        if len(numbers) != count:  # no blanks between them
            numbers = [number for line in block for number in re.findall(f".{{1,{width}}}", line.rstrip())]
        if len(numbers) != count:
            raise ValueError(f"it has {len(numbers)} instead of {count} numbers in one of its parts")
        blocks.append(np.array(numbers, dtype=float))
    if len(blocks) < len(counts):
        raise ValueError("its line of formats is damaged")
    pointers, indices = (whole_numbers("pointers and rows", block) - 1 for block in blocks[:2])
    values = blocks[2].view(complex) if kind[0] == "C" else blocks[2]
    matrix = from_columns(values, indices, pointers, (rows, columns))
    column_of = np.repeat(np.arange(columns), np.diff(pointers))
    _demand_unique(indices, column_of, lambda k: f"row {indices[k] + 1}, column {column_of[k] + 1}")
    return [file_matrix(path.stem.lower(), matrix, one_triangle=kind[1] in "SH")]


_HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of HDF5, behind what MATLAB puts before them."""


def matlab_variables(path: Path) -> Iterator[tuple[str, Any]]:
    """The variables of a MATLAB file by name, those of structs as ``struct.field`` or ``structs(2).field``.

    Parameters
    ----------
    path : of a file of version 5 to 7.2, or 7.3, which is HDF5.

    Yields
    ------
    tuple
        Name, and an array, a sparse array or, of characters, a text. Cells and objects are left out.

    Raises
    ------
    ValueError
        If a variable occurs twice.
    """
    from scipy.io import loadmat, whosmat

    with open_input(path) as file:
        start = file.read(520)
    if _HDF5 in (start[:8], start[512:]):  # version 7.3
        with open_hdf5(path) as stored:
            yield from _hdf5_variables("", stored)
        return
    places: dict[str, int] = {}
    content: Any = checked_matlab5(path)
    for place, (name, *_) in enumerate(whosmat(content), 1):
        if name in places:
            raise ValueError(f"the variable {name} occurs twice, as number {places[name]} and {place}")
        places[name] = place
    content.seek(0)
    for name, value in loadmat(content, spmatrix=False).items():
        if not name.startswith("__"):
            yield from _variables(name, value)


def _variables(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """A variable of version 5, a struct by its fields."""
    kind = getattr(value, "dtype", np.dtype(object))
    if type(value) is np.ndarray and kind.names:
        for number, each in enumerate(value.ravel(), 1):
            for field in kind.names:
                yield from _variables(f"{name}{'' if value.size == 1 else f'({number})'}.{field}", each[field])
    elif kind.kind == "U":
        yield name, "".join(value.ravel()[:1])
    elif kind.kind in "fciub":
        yield name, value


def _hdf5_variables(name: str, item: Any, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """A variable of version 7.3: a group is a struct; a data set of references has one of its fields of each element.

    Raises
    ------
    ValueError
        If groups contain each other.
    """
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if depth > 32:
        raise ValueError(f"{name[:40]} ... contains itself")
    if "MATLAB_sparse" in item.attrs:
        yield name, _hdf5_matrix(item)
    elif isinstance(item, h5py.Group):
        for field, each in item.items():
            if not field.startswith("#"):
                yield from _hdf5_variables(f"{name}.{field}" if name else field, each, depth + 1)
    elif "MATLAB_empty" in item.attrs or item.shape is None:
        return
    elif h5py.check_ref_dtype(item.dtype) is h5py.Reference:
        parent, _, field = name.rpartition(".")
        references = [] if kind == "cell" or not parent else read_array(item).ravel(order="F")
        for number, reference in enumerate(references, 1):
            yield from _hdf5_variables(f"{parent}({number}).{field}", item.file[reference], depth + 1)
    elif kind == "char":
        yield name, "".join(map(chr, read_array(item).ravel()))
    else:
        yield name, _array(item).T


def _matlab(path: Path, _: str | None) -> list[FileMatrix]:
    variables = list(matlab_variables(path))
    for name, value in variables:
        if issparse(value):
            _demand_unique_of(name, value)
    return _named_matrices(variables)


def _demand_unique_of(name: str, values: Any) -> None:
    """Refuse two entries of one place in a sparse matrix of MATLAB, which has none."""
    entries = values.tocoo()
    rows, columns = entries.row, entries.col
    _demand_unique(rows, columns, lambda k: f"row {rows[k] + 1}, column {columns[k] + 1} of {name}")


def _hdf5_matrix(item: Any) -> Any:
    """A sparse matrix is a group of three arrays."""
    pointers = read_array(item["jc"])
    numbers, rows = (_array(item[key]) if key in item else [] for key in ("data", "ir"))
    return from_columns(numbers, rows, pointers, (int(item.attrs["MATLAB_sparse"]), pointers.size - 1))


def _array(item: Any) -> Any:
    """Numbers of a data set; complex ones have two fields."""
    values = read_array(item)
    return values["real"] + 1j * values["imag"] if values.dtype.names else values


def _numpy(path: Path, _: str | None) -> list[FileMatrix]:
    """Arrays by name, or the sparse matrix of `scipy.sparse.save_npz`."""
    arrays = _arrays_of_archive(path)
    if not {"format", "shape", "data"} <= arrays.keys():
        return _named_matrices(arrays.items())
    called, shape, values = arrays["format"], arrays["shape"], arrays["data"]
    layout = called.item() if called.size == 1 else ""
    layout = layout.decode("latin-1") if isinstance(layout, bytes) else str(layout)
    builders: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
        "csc": (from_columns, ("indices", "indptr")), "csr": (from_rows, ("indices", "indptr")),
        "bsr": (from_blocks, ("indices", "indptr")), "coo": (from_coordinates, ("row", "col")),
        "dia": (from_diagonals, ("offsets",)),
    }  # fmt: skip
    if layout not in builders:
        raise ValueError(f"its sparse format is {layout!r}; known are {', '.join(builders)}")
    build, keys = builders[layout]
    if missing := [key for key in keys if key not in arrays]:
        raise ValueError(f"it lacks the array {missing[0]}")
    return [file_matrix(path.stem.lower(), build(values, *(arrays[key] for key in keys), shape))]


def _arrays_of_archive(path: Path) -> dict[str, Any]:
    """The arrays of an NPZ archive by name.

    Raises
    ------
    InputFileError
        If they have no room in memory.
    ValueError
        If two have one name, or one is of objects, or is not as long as its header says.
    """
    with open_input(path) as file, ZipFile(file) as archive:
        members = archive.infolist()
        if len({member.filename for member in members}) < len(members):
            raise ValueError("it holds two arrays of one name")
        demand_memory(path, 2 * sum(member.file_size for member in members), "for its arrays")
        return {member.filename.removesuffix(".npy"): _array_of_member(archive, member) for member in members}


def _array_of_member(archive: ZipFile, member: ZipInfo) -> Any:
    """An array of an archive; its header is checked before there is room made for it."""
    if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise ValueError(f"{member.filename} is compressed by a method that NumPy does not use")
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"{member.filename} has the unknown version {version}")
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, kind = read_header(stream)
        if kind.hasobject or kind.itemsize == 0:
            raise ValueError(f"{member.filename} holds {kind}, no numbers")
        size, rest = math.prod(shape) * kind.itemsize, member.file_size - stream.tell()
        if min(shape, default=0) < 0 or size != rest:
            raise ValueError(
                f"{member.filename} claims {bytes_text(size)} for shape {shape}, and has {bytes_text(rest)}"
            )
        values = np.frombuffer(bytearray(stream.read()), dtype=kind)
    return values.reshape(shape, order="F" if fortran else "C")


def _named_matrices(items: Iterable[tuple[str, Any]]) -> list[FileMatrix]:
    """Arrays of numbers with two dimensions."""
    return [
        replace(file_matrix(name, values), place=name)
        for name, values in items
        if not isinstance(values, str) and values.ndim == 2 and values.dtype.kind in "fciu"
    ]


FORMATS: dict[str, tuple[str, int, Callable[[Path, str | None], list[FileMatrix]]]] = {
    ".op4": ("OP4", 6, read_op4),
    ".op2": ("OP2", 0, read_op2),
    **dict.fromkeys((".pch", ".dmig", ".bdf", ".dat"), ("DMIG", 20, read_dmig)),
    **dict.fromkeys((".mtx", ".mm"), ("MatrixMarket or Abaqus", 10, _market_or_abaqus)),
    **dict.fromkeys((".hb", ".rua", ".rsa"), ("Harwell-Boeing", 10, _harwell_boeing)),
    ".mat": ("MATLAB", 0, _matlab),
    ".npz": ("NumPy", 0, _numpy),
}
"""By ending: name of the format, bytes of memory for a byte of the file, and the reader of a path and a name.

The numbers of bytes were measured; OP2, MATLAB and NumPy files, whose headers say how large the matrices are, are
checked by their readers."""
ENDINGS = (".op4", ".mat", ".mtx", ".npz")
"""OP4, MATLAB, MatrixMarket, NumPy; the first two hold several matrices, of the others each has a file."""


def write_matrices(path: Path, matrices: dict[str, Any], *, binary: bool = False) -> dict[str, Path]:
    """Write matrices by name; numbers are those of double precision, in ASCII with 17 significant digits.

    Parameters
    ----------
    path : its ending is one of `ENDINGS`; where a file holds one matrix its name is appended to the stem.
    matrices : (rows, columns) sparse, in OP4 and MATLAB files also dense, by names of at most 8 characters.
    binary : whether OP4 files hold the bytes of numbers instead of ASCII.

    Returns
    -------
    dict
        File of each: the path itself where a file holds several.

    Raises
    ------
    MethodError
        If pyYeti, which writes OP4, is not installed.
    """
    from scipy.io import mmwrite, savemat

    ending = path.suffix.lower()
    if ending in (".op4", ".mat"):
        with replacement_file(path) as temporary:
            if ending == ".op4":
                pyyeti().op4.write(str(temporary), matrices, binary=binary)
            else:
                savemat(temporary, matrices, appendmat=False)
        return dict.fromkeys(matrices, path)
    files = {name: path.with_name(f"{path.stem}_{name}{ending}") for name in matrices}
    for name, file in files.items():
        with replacement_file(file) as temporary, open(temporary, "wb") as stream:
            if ending == ".mtx":
                mmwrite(stream, matrices[name].tocoo(), precision=17)
            else:
                save_npz(stream, matrices[name].tocsc())
    return files
