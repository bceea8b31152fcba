"""Harwell-Boeing files: assembled matrices, real or complex, of symmetric ones one triangle.

Layout: Duff, Grimes and Lewis, Users' guide for the Harwell-Boeing sparse matrix collection, 1992. SciPy reads
unsymmetric matrices alone, and the stiffness matrices of that collection are symmetric.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from beamsim.matrix_files.matrix import FileMatrix, mirrored

_FORMAT = re.compile(r"(\d*)[IEDFG](\d+)", re.IGNORECASE)


def read_harwell_boeing(path: Path) -> FileMatrix:
    """The matrix of a file.

    Raises
    ------
    ValueError
        If it is not assembled, has no values, or cannot be read.
    """
    lines = path.read_text(encoding="latin-1").splitlines()
    if len(lines) < 4:
        raise ValueError("it ends within the heading")
    cards = [int(lines[1][k : k + 14] or 0) for k in range(0, 70, 14)]
    kind = lines[2][:3].upper()
    rows, columns, entries = (int(lines[2][k : k + 14]) for k in (14, 28, 42))
    if kind[2:] != "A" or kind[:1] not in ("R", "C"):
        raise ValueError(f"its type is {kind}; real and complex assembled matrices are read")
    formats = [lines[3][start:end] for start, end in ((0, 16), (16, 32), (32, 52))]
    at = 5 if cards[4] > 0 else 4
    blocks = []
    counts = (columns + 1, entries, entries * (2 if kind[0] == "C" else 1))
    for layout, count, length in zip(formats, counts, cards[1:4], strict=True):
        blocks.append(_numbers(lines[at : at + length], layout, count))
        at += length
    from scipy.sparse import csc_array

    pointers, indices = (np.array(block, dtype=np.int64) - 1 for block in blocks[:2])
    values = np.array(blocks[2])
    data = values[0::2] + 1j * values[1::2] if kind[0] == "C" else values
    matrix = csc_array((data, indices, pointers), shape=(rows, columns))
    return FileMatrix(path.stem.lower(), mirrored(matrix) if kind[1] in "SH" else matrix)


def _numbers(lines: list[str], layout: str, count: int) -> list[float]:
    field = _FORMAT.search(layout)
    if field is None:
        raise ValueError(f"its format {layout.strip()} is unknown")
    width, per_line = int(field[2]), int(field[1] or 1)
    words = " ".join(lines).split()
    if len(words) != count:  # no blanks between them
        words = [line[k * width : (k + 1) * width] for line in lines for k in range(per_line)]
    numbers = [float(word.upper().replace("D", "E")) for word in words if word.strip()]
    if len(numbers) != count:
        raise ValueError(f"it has {len(numbers)} numbers where {count} are stated")
    return numbers
