"""Matrices that Abaqus writes with *MATRIX OUTPUT: by nodes (MATRIX INPUT, LABELS) or by numbers (COORDINATE)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from beamsim.matrix_files.matrix import FileMatrix, file_matrix, labelled


def read_abaqus(path: Path) -> FileMatrix:
    """The matrix of a file; of a symmetric one Abaqus writes one triangle.

    Raises
    ------
    ValueError
        If a line is not an entry: row node, its degree of freedom, column node, its degree of freedom and the number,
        or row, column and number. Coordinates without a node have a degree of freedom beyond 6.
    """
    from scipy.sparse import coo_array

    text = path.read_text(encoding="latin-1").replace(",", " ").upper().replace("D", "E")
    entries = np.loadtxt(text.splitlines(), comments=("*", "%", "#"), ndmin=2)
    name = path.stem.lower()
    if entries.shape[1] == 5:
        return labelled(name, entries, square=True, one_triangle=True)
    if entries.shape[1] != 3:
        raise ValueError(f"its lines have {entries.shape[1]} numbers; those of an entry have 3 or 5")
    i, j = entries[:, :2].T.astype(int) - 1
    size = 1 + max(i.max(), j.max())
    return file_matrix(name, coo_array((entries[:, 2], (i, j)), shape=(size, size)), one_triangle=True)
