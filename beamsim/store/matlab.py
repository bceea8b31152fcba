"""MATLAB files (version 5): nested structs under valid field names."""

from __future__ import annotations

import re
import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from beamsim.files import replacing

HEADER = 128  # bytes of a MAT file before its variables
COMPRESSED = 15  # type of an element that holds another one, compressed
BYTES_AT_ONCE = 2**20  # that are compressed between two chances for a signal to be handled


def write_mat(variables: Mapping[str, Any], path: Path) -> None:
    """Write nested mappings as structs; lists of numbers become columns, other lists cells, None becomes NaN.

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    from scipy.io import savemat

    with replacing(path) as temporary, tempfile.TemporaryFile(dir=temporary.parent) as plain:
        target: Any = plain  # SciPy's stubs know paths alone
        savemat(target, _matlab(variables), long_field_names=True, oned_as="column")
        plain.seek(0)
        with open(temporary, "xb") as compressed:
            _compress(plain, compressed)


def _compress(plain: BinaryIO, compressed: BinaryIO) -> None:
    """Copy a MAT file, each of its variables compressed.

    `scipy.io.savemat` would compress a variable in one call, of many seconds where it is long, that no signal ends.
    """
    compressed.write(plain.read(HEADER))
    while tag := plain.read(8):
        packer, remaining = zlib.compressobj(), int(np.frombuffer(tag, np.uint32)[1])
        begin = compressed.tell()
        compressed.write(bytes(8))
        compressed.write(packer.compress(tag))
        while remaining > 0:
            part = plain.read(min(remaining, BYTES_AT_ONCE))
            remaining -= len(part)
            compressed.write(packer.compress(part))
        compressed.write(packer.flush())
        end = compressed.tell()
        compressed.seek(begin)
        compressed.write(np.array([COMPRESSED, end - begin - 8], np.uint32).tobytes())
        compressed.seek(end)


def _matlab(value: Any) -> Any:
    if isinstance(value, Mapping):
        fields: dict[str, Any] = {}
        for name, item in value.items():
            field = _field_name(str(name))
            while field in fields:
                field += "_"
            fields[field] = _matlab(item)
        return fields
    if isinstance(value, (list, tuple)):
        if all(isinstance(item, (int, float)) for item in value):
            return np.array(value, dtype=float)
        cells = np.empty(len(value), dtype=object)
        cells[:] = [_matlab(item) for item in value]
        return cells
    return np.nan if value is None else value


def _field_name(name: str) -> str:
    field = re.sub(r"[^0-9A-Za-z_]", "_", name)[:60]
    return field if re.match(r"[A-Za-z]", field) else f"x{field}"
