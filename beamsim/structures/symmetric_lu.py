"""Sparse factors of symmetric matrices, ordered and scaled for little fill."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csc_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from beamsim.typing import Floats, Ints


@dataclass(frozen=True)
class SymmetricLU:
    """Factors of D A D with a unit diagonal, so that rotations in rad and displacements in m have like pivots.

    The rows may be in another order than those of A, which `symmetric_lu` was given.
    """

    lu: Any  # SuperLU
    scale: Floats  # (N,) diagonal of D, in the order of A
    matrix: Any  # (N, N) D A D, in the order of the factors
    order: Ints  # (N,) rows of A in the order of the factors

    def solve(self, load: Floats) -> Floats:
        """(N,) or (N, k) solution."""
        scale = self.scale if load.ndim == 1 else self.scale[:, None]
        solution = np.empty_like(load)
        solution[self.order] = self.lu.solve((scale * load)[self.order])
        return np.asarray(scale * solution)

    @property
    def pivots(self) -> Floats:
        """(N,) pivots, of the scaled matrix, by row of A; without exchanges as many are negative as eigenvalues."""
        pivots = np.empty(self.scale.size)
        pivots[self.order] = self.lu.U.diagonal()[self.lu.perm_c]
        return pivots

    @property
    def signs_are_certain(self) -> bool:
        """Whether as many pivots are negative as eigenvalues: no error of the factors moves one across zero.

        The error, in the Frobenius norm, is far below the smallest eigenvalue. It is known by 8 products with random
        signs, whose mean square is that of the norm: factors multiplied with each other take many times as long as they
        do themselves.
        """
        if not np.array_equal(self.lu.perm_r, self.lu.perm_c):  # a pivot was taken off the diagonal
            return False

        lu, entries, size = self.lu, self.matrix.tocoo(), self.scale.size
        permuted = csc_array((entries.data, (lu.perm_r[entries.row], lu.perm_c[entries.col])), shape=(size, size))
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(size, 8))
        error = float(np.linalg.norm(lu.L @ (lu.U @ signs) - permuted @ signs) / np.sqrt(signs.shape[1]))
        inverse = LinearOperator((size, size), matvec=lu.solve, rmatvec=lu.solve, matmat=lu.solve, dtype=float)
        # 0.01: of the smallest eigenvalue: the error of factors whose signs count
        return bool(error * onenormest(inverse) <= 0.01)

    @property
    def root(self) -> Any:
        """(N, N) sparse B with A = B^T B, where all pivots are positive and none was exchanged."""
        upper = self.lu.U
        columns = self.lu.perm_c[np.argsort(self.order)]
        root = upper[:, columns]  # a copy, scaled in place: products with diagonal matrices would copy it twice more
        root.data /= np.sqrt(upper.diagonal())[root.indices]
        root.data /= np.repeat(self.scale, np.diff(root.indptr))
        return root


def unit_diagonal(matrix: Any) -> tuple[Any, Floats]:
    """D A D with a diagonal of 1, -1 and 0, sparse, and the diagonal (N,) of D."""
    diagonal = np.abs(matrix.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit: Any = diags_array(scale)
    return csc_array(unit @ matrix @ unit), scale


def symmetric_lu(matrix: Any, order: Ints | None = None) -> SymmetricLU:
    """Factors without exchanged pivots; raises `RuntimeError` for a matrix that is exactly singular.

    ``order`` (N,) is that of elimination, such as `beamsim.structures.dissection.dissection` gives; minimum degree
    without.
    """
    scaled, scale = unit_diagonal(matrix)
    if order is not None:
        scaled = scaled[order][:, order].tocsc()
    lu = splu(
        scaled, permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    return SymmetricLU(lu, scale, scaled, np.arange(scale.size) if order is None else order)


def blocks_of(matrix: Any) -> list[Ints]:
    """Rows of every block of a sparse symmetric matrix; no entry couples one block to another."""
    _, label = connected_components(matrix, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def pinned_rows(rigid: Floats) -> Ints:
    """(r,) degrees of freedom that hold rigid-body motions (N, r): those in which they differ most."""
    count = rigid.shape[1]
    return np.sort(qr(rigid.T, mode="r", pivoting=True)[1][:count]) if count else np.zeros(0, dtype=np.int64)


def held_factors(stiffness: Any, rigid: Floats, order: Ints | None = None) -> SymmetricLU:
    """Factors of K with the rows and columns of `pinned_rows` replaced by those of a diagonal matrix.

    What they solve for a load in equilibrium, zero in these rows, is a deflection of the free structure.

    Parameters
    ----------
    stiffness : (N, N) sparse K, positive semidefinite.
    rigid : (N, r) its null space.
    order : (N,) of elimination.

    Returns
    -------
    SymmetricLU
        Of a positive definite matrix.
    """
    pinned = np.zeros(stiffness.shape[0])
    pinned[pinned_rows(rigid)] = 1.0
    if pinned.any():
        free: Any = diags_array(1.0 - pinned)
        stiffness = free @ stiffness @ free + diags_array(pinned * stiffness.diagonal())
        stiffness.eliminate_zeros()
    return symmetric_lu(stiffness, order)
