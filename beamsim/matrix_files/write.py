"""Named matrices to files of other programs, by the file's ending."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from beamsim.files import replacing
from beamsim.matrix_files.nastran import write_op4

ENDINGS = (".op4", ".mat", ".mtx", ".npz")
"""OP4, MATLAB, MatrixMarket, NumPy; the first two hold several matrices, of the others each has a file."""


def write_matrices(path: Path, matrices: dict[str, Any], *, binary: bool) -> dict[str, tuple[Path, str]]:
    """Write sparse matrices by name; where each is, and its name in the file.

    Parameters
    ----------
    path : its ending is one of `ENDINGS`; where a file holds one matrix its name is appended to the stem.
    matrices : (rows, columns) sparse, by name.
    binary : whether OP4 files hold the bytes of numbers.

    Returns
    -------
    dict
        Path, and name in that file, by name.

    Raises
    ------
    MethodError
        If pyYeti, which writes OP4, is not installed.
    """
    from scipy.io import mmwrite, savemat
    from scipy.sparse import save_npz

    ending = path.suffix.lower()
    if ending in (".op4", ".mat"):
        with replacing(path) as temporary:
            if ending == ".op4":
                write_op4(temporary, matrices, binary=binary)
            else:
                savemat(temporary, matrices, appendmat=False)
        return {name: (path, name) for name in matrices}
    files = {name: path.with_name(f"{path.stem}_{name}{ending}") for name in matrices}
    for name, file in files.items():
        with replacing(file) as temporary, open(temporary, "wb") as stream:
            if ending == ".mtx":
                mmwrite(stream, matrices[name].tocoo(), precision=17)
            else:
                save_npz(stream, matrices[name].tocsc())
    return {name: (file, "") for name, file in files.items()}
