"""MATLAB files of version 5 to 7.2, whose structure is checked before SciPy reads them.

SciPy's compiled reader trusts types, sizes and nesting, and ends the process where one is damaged. Layout: MathWorks,
MAT-File Format, R2023b, chapter 1.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamsim.files import demand_memory, free_memory, no_memory, read_input
from beamsim.sparse_parts import from_columns

_HEADER = 128  # bytes before the first element
_MATRIX, _COMPRESSED = 14, 15  # types of elements
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}  # of a number, by its type, bytes
_FORMATS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CHARACTERS = (1, 2, 4, 16, 17, 18)  # types of texts
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5  # classes of arrays
_NUMBERS = range(6, 16)  # classes
_FUNCTION, _OPAQUE = 16, 17  # classes
_COMPLEX = 0x800  # flag
_DEEPEST = 30  # nesting of cells and structs
_INFLATED_AT_ONCE = 2**24


def checked_matlab5(path: Path) -> BytesIO:
    """The content of a file, unpacked, if its structure is sound.

    Parameters
    ----------
    path : of the file.

    Returns
    -------
    BytesIO
        A file without compressed elements, as `scipy.io.loadmat` reads it; of version 4, which SciPy reads without
        compiled code, the file itself.

    Raises
    ------
    InputFileError
        If it cannot be opened, or what is packed in it has no room in memory.
    ValueError
        If its structure is damaged: says how and in which element.
    """
    raw = read_input(path, most_bytes=math.inf)
    if 0 in raw[:4]:  # version 4 has no text at its begin
        return BytesIO(raw)
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:128])
    if order is None or len(raw) < _HEADER:
        raise ValueError("it has no header of version 5")
    unpacked = bytearray(raw[:_HEADER])
    for number, element in enumerate(_elements(path, raw, order), 1):
        try:
            _Checker(order, element).top_level()
        except struct.error:
            raise ValueError(f"variable {number} ends too early") from None
        except ValueError as error:
            raise ValueError(f"variable {number} is damaged: {error}") from None
        unpacked += element
    return BytesIO(unpacked)


def _elements(path: Path, raw: bytes, order: str) -> Iterator[bytes]:
    """The elements of a file, unpacked, each with its tag."""
    at, left = _HEADER, free_memory() / 3.0  # for the elements, their copy and the arrays
    while at < len(raw):
        if at + 8 > len(raw):
            raise ValueError(f"its last {len(raw) - at} bytes are not an element")
        kind, size = struct.unpack_from(f"{order}2I", raw, at)
        if kind not in (_MATRIX, _COMPRESSED):
            raise ValueError(f"an element has the unknown type {kind}")
        if at + 8 + size > len(raw):
            raise ValueError(f"it ends {at + 8 + size - len(raw)} bytes before its last element does")
        if kind == _MATRIX:
            element = raw[at : at + 8 + size]
        else:
            element = _inflate(path, raw[at + 8 : at + 8 + size], left)
            if len(element) < 8 or struct.unpack_from(f"{order}2I", element) != (_MATRIX, len(element) - 8):
                raise ValueError("a compressed element holds something else than one array")
        left -= len(element)
        demand_memory(path, 2 * len(element), "for its arrays")
        yield element
        at += 8 + size


def _inflate(path: Path, compressed: bytes, most_bytes: float) -> bytes:
    """What was compressed, if it is complete and no more than ``most_bytes`` bytes."""
    reader, parts, size = zlib.decompressobj(), list[bytes](), 0
    while not reader.eof:
        try:
            part = reader.decompress(compressed, _INFLATED_AT_ONCE)
        except zlib.error as error:
            raise ValueError(f"a compressed element is damaged ({error})") from None
        compressed, size = reader.unconsumed_tail, size + len(part)
        if not part and not compressed and not reader.eof:
            raise ValueError("a compressed element is incomplete")
        if size > most_bytes:
            raise no_memory(path, path.stat().st_size)
        parts.append(part)
    return b"".join(parts)


class _Element(NamedTuple):
    """A part of an array: its type, and where its content begins and ends."""

    kind: int
    begin: int
    end: int


class _Checker:
    """Goes through an array element and raises a ValueError or `struct.error` at the first thing that is wrong."""

    def __init__(self, order: str, raw: bytes) -> None:
        self.order, self.raw, self.at = order, raw, 0

    def top_level(self) -> None:
        """The only element, a variable."""
        self.array(0)

    def element(self) -> _Element:
        """The next element; the place moves behind it and what fills it up to eight bytes."""
        first, size = struct.unpack_from(f"{self.order}2I", self.raw, self.at)
        if first >> 16:  # a small one: its size and type are in the first number
            kind, size, begin, after = first & 0xFFFF, first >> 16, self.at + 4, self.at + 8
            if size > 4:
                raise ValueError(f"a small element claims {size} bytes")
        else:
            kind, begin = first, self.at + 8
            after = begin + size + (-size) % 8
        if begin + size > len(self.raw):
            raise ValueError(f"an element claims {size} bytes, of which {max(len(self.raw) - begin, 0)} are there")
        self.at = min(after, len(self.raw))  # what would fill up the last one may be missing
        return _Element(kind, begin, begin + size)

    def numbers(self, count: int, kinds: tuple[int, ...] = tuple(_SIZES)) -> np.ndarray:
        """The next element, so many numbers of one of some types; ``count`` is negative where any number will do."""
        element = self.element()
        if element.kind not in kinds:
            raise ValueError(f"numbers have the type {element.kind}")
        size = element.end - element.begin
        found, rest = divmod(size, _SIZES[element.kind])
        if rest or (count >= 0 and found != count):
            raise ValueError(f"{size} bytes are there for {count} numbers of {_SIZES[element.kind]} bytes")
        kind = np.dtype(f"{self.order}{_FORMATS[element.kind]}")
        return np.frombuffer(self.raw, kind, found, element.begin)

    def text(self) -> None:
        """The next element, a name of one-byte characters."""
        element = self.element()
        if element.kind not in (1, 2, 16):
            raise ValueError(f"a name has the type {element.kind}")

    def array(self, depth: int) -> None:
        """The next element, an array of any class with all that it holds."""
        tag = self.element()
        if tag.kind != _MATRIX:
            raise ValueError(f"an element of type {tag.kind} is in the place of an array")
        if depth > _DEEPEST:
            raise ValueError(f"its cells and structs are nested more than {_DEEPEST} deep")
        if tag.begin == tag.end:  # empty
            return
        self.at = tag.begin
        flags = int(self.numbers(2, (5, 6))[0])
        class_of = flags & 0xFF
        if class_of == _OPAQUE:
            for _ in range(3):
                self.text()
            self.array(depth + 1)
        else:
            shape = self.numbers(-1, (5, 6)).tolist()
            if not 2 <= len(shape) <= 32 or min(shape) < 0:
                raise ValueError(f"its shape is {shape[:4]}")
            self.text()
            self.content(class_of, bool(flags & _COMPLEX), shape, depth)
        if self.at >= tag.end + 8:
            raise ValueError(f"an array of class {class_of} is longer than it claims")

    def content(self, class_of: int, has_imaginary: bool, shape: list[int], depth: int) -> None:
        """What follows the name of an array."""
        count = math.prod(shape)
        if class_of in _NUMBERS:
            for _ in range(1 + has_imaginary):
                self.numbers(count)
        elif class_of == _CHAR:
            element = self.element()
            size = element.end - element.begin
            if element.kind not in _CHARACTERS or not (count <= size <= 4 * count or count == 0):
                raise ValueError(f"{count} characters have the type {element.kind} and {size} bytes")
        elif class_of == _SPARSE:
            self.sparse(has_imaginary, shape)
        elif class_of == _FUNCTION:
            self.array(depth + 1)
        elif class_of in (_CELL, _STRUCT, _OBJECT):
            if class_of == _OBJECT:
                self.text()
            fields = 1 if class_of == _CELL else self.fields()
            if 8 * count * fields > len(self.raw) - self.at:
                raise ValueError(f"{count * fields} cells or fields are claimed")
            for _ in range(count * fields):
                self.array(depth + 1)
        else:
            raise ValueError(f"its class {class_of} is unknown")

    def fields(self) -> int:
        """Number of the fields of a struct, whose names come next."""
        (length,) = self.numbers(1, (5,)).tolist()
        names = self.element()
        size = names.end - names.begin
        if length <= 0 or names.kind not in (1, 2) or size % length:
            raise ValueError(f"the names of its fields have {size} bytes for names of {length}")
        return int(size // length)

    def sparse(self, has_imaginary: bool, shape: list[int]) -> None:
        """Rows, pointers and entries of a sparse array; only as many rows and entries count as the pointers say."""
        rows, pointers = self.numbers(-1, (5, 6)), self.numbers(-1, (5, 6))
        parts = [self.numbers(-1) for _ in range(1 + has_imaginary)]
        count = int(pointers[-1]) if pointers.size else 0
        there = min(rows.size, *(part.size for part in parts))
        if len(shape) != 2 or not 0 <= count <= there:
            raise ValueError(f"{count} entries are claimed, and {there} are there")
        for part in parts:
            from_columns(part[:count], rows[:count], pointers, shape)
