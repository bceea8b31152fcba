"""Nastran's OUTPUT2 files, 32 bit, byte by byte: keys and records between Fortran's record marks."""

import struct

import numpy as np


def _record(body, order):
    mark = struct.pack(order + "i", len(body))
    return mark + body + mark


def _key(number, order):
    return _record(struct.pack(order + "i", number), order)


def _block(words, order):
    """A key with the number of words, and a record of them."""
    body = words if isinstance(words, bytes) else struct.pack(f"{order}{len(words)}i", *words)
    return _key(len(body) // 4, order) + _record(body, order)


def label(order):
    text = b"NASTRAN FORT TAPE ID CODE - "
    parts = [_block((1, 1, 26), order), _block(text, order), _block(b"BEAMSIM ", order)]
    return b"".join(parts) + _key(-1, order) + _key(0, order)


def _heading(name, trailer, order):
    """Name and trailer of a data block, and its name once more."""
    called = name.encode().ljust(8)
    first = _block(called, order) + _key(-1, order) + _block(trailer, order) + _key(-2, order)
    return first + _key(1, order) + _key(0, order) + _block(called, order) + _key(-3, order) + _key(1, order)


def matrix(name, values, order, *, kind):
    """A matrix; kind 1 real of single precision, 2 of double precision, 4 complex of double precision."""
    rows, columns = values.shape
    real = np.dtype(order + ("f4" if kind == 1 else "f8"))
    result = _heading(name, (101, columns, rows, 1, kind, 0, 0), order) + _key(1, order)
    for number, column in enumerate(values.T):
        used = np.flatnonzero(column)
        numbers = column[used[0] : used[-1] + 1].copy()
        body = (numbers.view(float) if kind > 2 else numbers).astype(real).tobytes()
        result += _block(struct.pack(order + "i", used[0] + 1) + body, order) + _key(0, order)
        result += _key(-4 - number, order) + _key(1 if number < columns - 1 else 0, order)
    return result + _key(0, order)


def table(name, records, order):
    """A table of records of whole numbers, or of bytes."""
    result = _heading(name, (101, 0, 0, 0, 0, 0, 0), order) + _key(0, order)
    for number, words in enumerate(records):
        result += _block(words, order) + _key(-4 - number, order) + _key(1, order) + _key(0, order)
    return result + _key(0, order)


def dmig_table(name, columns, *, symmetric, order):
    """The table of a DMIG matrix; entries by node and component of column and row."""
    words = struct.pack(order + "3i", 114, 1, 120) + name.encode().ljust(8)
    words += struct.pack(order + "7i", 0, 6 if symmetric else 1, 2, 0, 0, 0, len(columns))
    for column, entries in columns.items():
        words += struct.pack(order + "2i", *column)
        for row, number in entries:
            words += struct.pack(order + "2id", *row, number)
        words += struct.pack(order + "2i", -1, -1)
    return table(name, [words + struct.pack(order + "2i", -1, -1)], order)


def end(order):
    return _key(0, order)
