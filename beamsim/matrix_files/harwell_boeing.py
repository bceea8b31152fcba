"""Harwell-Boeing files: assembled matrices, real or complex, of symmetric ones one triangle.

Layout: Duff, Grimes and Lewis, Users' guide for the Harwell-Boeing sparse matrix collection, 1992. SciPy reads
unsymmetric real matrices alone, and the stiffness matrices of that collection are symmetric.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from beamsim.matrix_files.matrix import FileMatrix, file_matrix


def read_harwell_boeing(path: Path) -> FileMatrix:
    """The matrix of a file.

    Raises
    ------
    ValueError
        If it is not assembled, has no values, or cannot be read.
    """
    from scipy.sparse import csc_array

    lines = path.read_text(encoding="latin-1").splitlines()
    _, lengths, shape, formats = (lines + [""] * 4)[:4]
    kind = shape[:3].upper()
    if not re.fullmatch("[RC].A", kind):
        raise ValueError(f"its type is {kind or 'missing'}; real and complex assembled matrices are read")
    rows, columns, entries = (int(shape[k : k + 14]) for k in (14, 28, 42))
    at = 5 if int(lengths[56:70] or 0) else 4  # a line more where right-hand sides follow
    blocks = []
    counts = (columns + 1, entries, entries * (2 if kind[0] == "C" else 1))
    for start, width, count in zip((14, 28, 42), re.findall(r"[IEDFG](\d+)", formats.upper()), counts, strict=False):
        end = at + int(lengths[start : start + 14])
        words = " ".join(lines[at:end]).split()
        if len(words) != count:  # no blanks between them
            words = [word for line in lines[at:end] for word in re.findall(f".{{1,{width}}}", line.rstrip())]
        blocks.append(np.array([word.upper().replace("D", "E") for word in words], dtype=float))
        at = end
    pointers, indices = (block.astype(int) - 1 for block in blocks[:2])
    values = blocks[2].view(complex) if kind[0] == "C" else blocks[2]
    matrix = csc_array((values, indices, pointers), shape=(rows, columns))
    return file_matrix(path.stem.lower(), matrix, one_triangle=kind[1] in "SH")
