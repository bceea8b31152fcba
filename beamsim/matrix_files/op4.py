"""Nastran's OUTPUT4 files: ASCII and binary, either byte order, 32 and 64 bit, dense and both sparse layouts.

Layout: MSC Nastran's and NX Nastran's descriptions of the OUTPUT4 module. A matrix is a heading (columns, rows, form,
type, name), then one record a column that is not empty, then a record with a column number beyond the last. The record
of a dense column begins at its first row that is not zero. A row of 0 in it announces strings, each with its length in
words and its first row, packed in one integer (L + 1) 65536 + row, or, if the number of rows was written negative, in
two integers L + 1 and row. A word has 4 bytes, or 8 where integers have.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import FileMatrix, mirrored
from beamsim.typing import Floats, Ints

_SYMMETRIC = 6  # form of a matrix
_LARGEST_PACKED_ROW = 65535


@dataclass
class _Entries:
    """Entries of a matrix as they are read: strings of consecutive rows of a column."""

    rows: int
    columns: int
    form: int
    kind: int  # 1, 2: real; 3, 4: complex; even ones have double precision
    name: str
    strings: list[int] = field(default_factory=list)  # row and column from 1, and real numbers, of each string in turn
    numbers: list[Floats] = field(default_factory=list)  # of all strings, one after the other

    def matrix(self) -> FileMatrix:
        from scipy.sparse import csc_array

        numbers = np.concatenate([np.zeros(0), *self.numbers])
        first, column, lengths = np.array(self.strings, dtype=np.int64).reshape(-1, 3).T
        first = first - 1
        if self.kind > 2:
            numbers, lengths = numbers[0::2] + 1j * numbers[1::2], lengths // 2
        if np.any((first < 0) | (first + lengths > self.rows)):
            raise MethodError("file", f"has rows of {self.name} beyond the {self.rows} that its heading states")
        rows = _consecutive(first, lengths)
        columns = np.repeat(column - 1, lengths)
        matrix = csc_array((numbers, (rows, columns)), shape=(self.rows, self.columns))
        matrix.eliminate_zeros()
        return FileMatrix(self.name, mirrored(matrix) if self.form == _SYMMETRIC else matrix)


def _consecutive(first: Ints, lengths: Ints) -> Ints:
    """first[0], first[0] + 1, ... (lengths[0] of them), then those of the second."""
    return np.repeat(first - np.cumsum(lengths) + lengths, lengths) + np.arange(lengths.sum())


def read_op4(path: Path, name: str | None = None) -> list[FileMatrix]:
    """All matrices of a file, with their names in lower case.

    Parameters
    ----------
    name : the others then are empty, which saves time.

    Raises
    ------
    MethodError
        If the file is no OP4 file, or ends within a matrix.
    """
    data = path.read_bytes()
    layout = _layout(data)
    try:
        entries = _read_ascii(data.decode("latin-1"), name) if layout is None else _read_binary(data, name, *layout)
        matrices = [each.matrix() for each in entries]
    except (ValueError, IndexError, struct.error, StopIteration) as error:
        raise MethodError(
            "file", f"cannot be read as OP4 ({error})", "write it again: ASSIGN OUTPUT4, OUTPUT4 in DMAP"
        ) from None
    return matrices


def _layout(data: bytes) -> tuple[str, str] | None:
    """Byte order and integer type of a binary file, whose first record has 24 or 48 bytes; None for text."""
    for order in "<>":
        if len(data) >= 4 and (length := struct.unpack(order + "i", data[:4])[0]) in (24, 48):
            return order, "i" if length == 24 else "q"
    return None


def _read_binary(data: bytes, only: str | None, order: str, integer: str) -> Iterator[_Entries]:
    wide = integer == "q"
    word, name_bytes = (8, 16) if wide else (4, 8)
    read_length, read_column = struct.Struct(order + "i").unpack_from, struct.Struct(order + 3 * integer).unpack_from
    read_packed, read_pair = struct.Struct(order + integer).unpack_from, struct.Struct(order + 2 * integer).unpack_from
    position = 0

    def record() -> tuple[int, int]:
        """Where the next one begins and ends."""
        nonlocal position
        (length,) = read_length(data, position)
        start = position + 4
        if length < 0 or start + length > len(data):
            raise ValueError(f"it ends within a record, at byte {position}")
        position += length + 8
        return start, start + length

    while position < len(data):
        at, end = record()
        columns, rows, form, kind = struct.unpack_from(order + 4 * integer, data, at)
        name = data[at + 4 * word : at + 4 * word + name_bytes].decode("latin-1")
        entries = _Entries(abs(rows), columns, form, kind, "".join(name.split()).lower())  # 4 characters a word
        real = np.dtype(f"{order}f{8 if wide or kind % 2 == 0 else 4}")
        starts: list[int] = []
        strings = entries.strings
        while True:
            at, end = record()
            column, row, _ = read_column(data, at)
            if column > columns:
                break
            if only not in (None, entries.name):
                continue
            at += 3 * word
            if row > 0:
                starts.append(at)
                strings += (row, column, (end - at) // real.itemsize)
                continue
            while at < end:
                if rows < 0:
                    length, first = read_pair(data, at)
                    length, at = length - 1, at + 2 * word
                else:
                    (packed,) = read_packed(data, at)
                    length, first, at = (packed >> 16) - 1, packed & 0xFFFF, at + word
                starts.append(at)
                strings += (first, column, length * word // real.itemsize)
                at += length * word
                if length < 0 or at > end:
                    raise ValueError(f"a string of column {column} ends beyond its record")
        entries.numbers.append(_gathered(data, starts, strings[2::3], real))
        yield entries


def _gathered(data: bytes, starts: list[int], counts: list[int], real: Any) -> Floats:
    """Numbers of the strings that begin at these bytes, which are multiples of 4."""
    words = np.frombuffer(data, np.uint32, count=len(data) // 4)
    lengths = np.array(counts, dtype=np.int64) * (real.itemsize // 4)
    at = _consecutive(np.array(starts, dtype=np.int64) // 4, lengths)
    return np.asarray(words[at].view(real), dtype=float)


_FORMAT = re.compile(r"(?:1P,)?\s*(\d+)[ED](\d+)\.", re.IGNORECASE)


def _read_ascii(text: str, only: str | None) -> Iterator[_Entries]:
    lines = text.splitlines()
    at = 0
    while at < len(lines):
        if not lines[at].strip():
            at += 1
            continue
        heading = lines[at].rstrip()
        digits = 16 if heading.endswith("|I16") else 8
        columns, rows, form, kind = _integers(heading, [digits, digits, 8, 8])
        named = heading[2 * digits + 16 :]
        layout = _FORMAT.search(named[8:])
        per_line, width = (int(layout[1]), int(layout[2])) if layout else (5, 16)
        entries = _Entries(abs(rows), columns, form, kind, named[:8].strip().lower())
        words = 2 if kind % 2 == 0 else 1  # of a number, in the lengths of strings
        at += 1

        text_width, kept = per_line * width, only in (None, entries.name)

        while True:
            column, row, length = _integers(lines[at], 3 * [digits])
            at += 1
            if column > columns:
                at += 1  # one line, whose number means nothing
                break
            while row > 0 or length > 0:  # a dense column is one string; headings of others count words
                if row > 0:
                    first, count = row, length
                elif rows < 0:
                    count, first = _integers(lines[at], 2 * [digits])
                    length -= count + 1
                    count, at = (count - 1) // words, at + 1
                else:
                    packed = int(lines[at])
                    first, count = packed & 0xFFFF, (packed >> 16) - 1
                    length -= count + 1
                    count, at = count // words, at + 1
                end = at + -(-count // per_line)
                if end > len(lines):
                    raise ValueError("it ends within a column")
                if kept:
                    block = "".join([line.ljust(text_width)[:text_width] for line in lines[at:end]])
                    block = block.replace("D", "E").replace("d", "e")
                    entries.strings += (first, column, count)
                    entries.numbers.append(
                        np.array([float(block[k : k + width]) for k in range(0, count * width, width)])
                    )
                at = end
                if row > 0:
                    break
        yield entries


def _integers(line: str, widths: Sequence[int]) -> list[int]:
    """Integers of a line in columns of these widths; columns may be narrower where blanks part them."""
    fields, start = [], 0
    for width in widths:
        fields.append(line[start : start + width])
        start += width
    try:
        return [int(each) for each in fields]
    except ValueError:
        return [int(each) for each in line.split()[: len(widths)]]


def write_op4(path: Path, matrices: dict[str, Any], *, binary: bool = False) -> None:
    """Write real matrices with double precision; sparse ones where that is shorter.

    Parameters
    ----------
    matrices : sparse or dense, by names of at most 8 characters.
    binary : little endian, 32 bit; else ASCII with 17 significant digits, which is exact as well.
    """
    with open(path, "wb") as file:
        for name, values in matrices.items():
            _write(file, name, values, binary)


def _write(file: Any, name: str, values: Any, binary: bool) -> None:
    from scipy.sparse import csc_array

    matrix = csc_array(values)
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    rows, columns = matrix.shape
    sparse = matrix.nnz < rows * columns / 3
    big = sparse and rows > _LARGEST_PACKED_ROW
    difference: Any = matrix - matrix.T if rows == columns else matrix
    symmetric = rows == columns and not np.any(difference.data)
    heading = (columns, -rows if big else rows, _SYMMETRIC if symmetric else 1 if rows == columns else 2, 2)
    if binary:
        _record(file, struct.pack("<4i8s", *heading, name.upper().encode().ljust(8)))
    else:
        file.write(("".join(f"{n:8d}" for n in heading) + f"{name.upper():<8}1P,3E24.16\n").encode())
    for column in range(columns):
        span = slice(*matrix.indptr[column : column + 2])
        i, numbers = matrix.indices[span], matrix.data[span]
        if i.size == 0:
            continue
        if not sparse:
            i, numbers = np.arange(i[0], i[-1] + 1), matrix[i[0] : i[-1] + 1, [column]].toarray().ravel()
        pieces = np.split(np.arange(i.size), np.flatnonzero(np.diff(i) > 1) + 1) if sparse else [np.arange(i.size)]
        strings = [(int(i[piece[0]]) + 1, numbers[piece]) for piece in pieces]
        words = 2 if binary or sparse else 1  # ASCII files count the numbers of a dense column
        start = 0 if sparse else strings[0][0]
        length = sum(words * each.size + (0 if not sparse else 2 if big else 1) for _, each in strings)
        if binary:
            body = struct.pack("<3i", column + 1, start, length)
            for first, each in strings:
                head = _string_head(each.size, first, big) if sparse else ()
                body += struct.pack(f"<{len(head)}i", *head) + each.astype("<f8").tobytes()
            _record(file, body)
            continue
        file.write(f"{column + 1:8d}{start:8d}{length:8d}\n".encode())
        for first, each in strings:
            if sparse:
                file.write(("".join(f"{n:8d}" for n in _string_head(each.size, first, big)) + "\n").encode())
            _write_numbers(file, each)
    if binary:
        _record(file, struct.pack("<3id", columns + 1, 1, 2, 1.0))
    else:
        file.write(f"{columns + 1:8d}{1:8d}{1:8d}\n{1.0:24.16E}\n".encode())


def _string_head(count: int, first: int, big: bool) -> tuple[int, ...]:
    return (2 * count + 1, first) if big else ((2 * count + 1) * 65536 + first,)


def _record(file: Any, body: bytes) -> None:
    length = struct.pack("<i", len(body))
    file.write(length + body + length)


def _write_numbers(file: Any, numbers: Floats) -> None:
    for start in range(0, numbers.size, 3):
        file.write(("".join(f"{x:24.16E}" for x in numbers[start : start + 3]) + "\n").encode())
