"""Sparse factors of symmetric matrices, ordered and scaled for little fill."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.typing import Floats


@dataclass(frozen=True)
class SymmetricLU:
    """Factors of D A D with a unit diagonal, so that rotations in rad and displacements in m have like pivots."""

    lu: Any  # SuperLU
    scale: Floats  # (N,) diagonal of D

    def solve(self, load: Floats) -> Floats:
        """(N,) or (N, k) solution."""
        scale = self.scale if load.ndim == 1 else self.scale[:, None]
        return np.asarray(scale * self.lu.solve(scale * load))

    @property
    def pivots(self) -> Floats:
        """(N,) pivots, of the scaled matrix, by row of A; without exchanges as many are negative as eigenvalues."""
        return np.asarray(self.lu.U.diagonal()[self.lu.perm_c])

    @property
    def root(self) -> Any:
        """(N, N) sparse B with A = B^T B, where all pivots are positive and none was exchanged."""
        from scipy.sparse import diags_array

        upper = self.lu.U.tocsr()
        return (diags_array(1 / np.sqrt(upper.diagonal())) @ upper)[:, self.lu.perm_c] @ diags_array(1 / self.scale)


def symmetric_lu(matrix: Any, *, definite: bool) -> SymmetricLU:
    """Factors by minimum degree.

    Parameters
    ----------
    definite : whether no pivots are exchanged; else very small ones are, for indefinite matrices.
    """
    from scipy.sparse import csc_array, diags_array
    from scipy.sparse.linalg import splu

    diagonal = np.abs(matrix.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit: Any = diags_array(scale)
    lu = splu(
        csc_array(unit @ matrix @ unit), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0 if definite else 1e-6,
        options={"SymmetricMode": True},
    )  # fmt: skip
    return SymmetricLU(lu, scale)
