r"""Sparse factors of symmetric matrices, scaled and ordered for little fill-in, and counts from the signs of pivots.

Matrices of meshes are ordered by nested dissection: the nodes are repeatedly divided into halves by a plane across
their longest extent; the rows between the halves come last. For solid meshes the factors have about half of the entries
of minimum degree ordering, and take a quarter of the time (A. George, SIAM J. Numer. Anal. 10 (1973) 345-363).

By Sylvester's law of inertia, :math:`K - \Omega^2 M = L D L^T` has as many negative entries in D as there are natural
frequencies below :math:`\Omega`, whatever an eigenvalue solver found or missed (a Sturm count).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import ldl, qr
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from beamsim.errors import ScenarioError
from beamsim.typing import Floats, Ints


def dissection(matrix: Any, places: Floats | None) -> Ints | None:
    """(N,) order of elimination of a sparse symmetric matrix; None if the places do not determine it.

    Parameters
    ----------
    matrix : (N, N) sparse.
    places : (N, 3) coordinates of the node of each row; NaN if unknown; None if all are unknown.
    """
    if places is None:
        return None
    size = matrix.shape[0]
    graph = csr_array(matrix)
    graph = csr_array((np.ones(graph.nnz, dtype=np.int32), graph.indices, graph.indptr), shape=graph.shape)
    entries = np.diff(graph.indptr)
    # a row with many entries would connect everything: it comes last
    last = (entries > 10.0 * np.median(entries)) | ~np.all(np.isfinite(places), axis=1)
    if last.sum() > size // 4:
        return None
    mark = np.zeros(size, dtype=np.int32)
    order: list[Ints] = [np.flatnonzero(last)]  # from the last to the first
    waiting = [np.flatnonzero(~last)]
    while waiting:
        rows = waiting.pop()
        parts = _cut(graph, places, rows, mark) if rows.size > 30 else None
        if parts is None:
            order.append(rows)
        else:
            order.append(parts[2])
            waiting += parts[:2]
    return np.concatenate(order[::-1])


def _cut(graph: Any, places: Floats, rows: Ints, mark: Ints) -> tuple[Ints, Ints, Ints] | None:
    """Two halves of the rows without common entries, and the rows between them; None if all are at the same place."""
    at = places[rows]
    axis = int(np.argmax(np.ptp(at, axis=0)))
    middle = np.median(at[:, axis])
    below = at[:, axis] < middle
    if not below.any():
        below = at[:, axis] <= middle
    if below.all():
        return None
    first, others = rows[below], rows[~below]
    mark[first] = 1
    touching = graph[others] @ mark > 0
    mark[first] = 0
    return first, others[~touching], others[touching]


LARGEST_FACTOR_ERROR = 0.01  # relative to the smallest eigenvalue, up to which signs of pivots count


@dataclass(frozen=True)
class SymmetricLU:
    """Factors of D A D with a unit diagonal, so that rotations in rad and displacements in m have similar pivots.

    The rows may be in another order than those of the matrix A given to `symmetric_lu`.
    """

    lu: Any  # SuperLU
    scale: Floats  # (N,) diagonal of D, in the order of A
    matrix: Any  # (N, N) D A D, in the order of the factors
    order: Ints  # (N,) rows of A in the order of the factors
    # (r,) rows with rigid-body motions that `factors_with_rigid_motions` replaces; empty if A is unchanged
    pinned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def solve(self, load: Floats) -> Floats:
        """(N,) or (N, k) solution for a load."""
        scale = self.scale if load.ndim == 1 else self.scale[:, None]
        solution = np.empty_like(load)
        solution[self.order] = self.lu.solve((scale * load)[self.order])
        return np.asarray(scale * solution)

    @property
    def pivots(self) -> Floats:
        """(N,) pivots of the scaled matrix, in the order of A; their signs count negative eigenvalues if none moved."""
        pivots = np.empty(self.scale.size)
        pivots[self.order] = self.lu.U.diagonal()[self.lu.perm_c]
        return pivots

    @property
    def root(self) -> Any:
        """(N, N) sparse B with A = B^T B, if all pivots are positive and none was exchanged."""
        upper = self.lu.U
        columns = self.lu.perm_c[np.argsort(self.order)]
        root = upper[:, columns]  # a copy, scaled in place; products with diagonal matrices would need two more copies
        root.data /= np.sqrt(upper.diagonal())[root.indices]
        root.data /= np.repeat(self.scale, np.diff(root.indptr))
        return root


def symmetric_lu(matrix: Any, order: Ints | None = None) -> SymmetricLU:
    """Factorise without pivoting; raises `RuntimeError` for an exactly singular matrix.

    ``order`` (N,) is the order of elimination, such as from `dissection`; minimum degree by default.
    """
    diagonal = np.abs(matrix.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit: Any = diags_array(scale)
    scaled = csc_array(unit @ matrix @ unit)
    if order is not None:
        scaled = scaled[order][:, order].tocsc()
    lu = splu(
        scaled, permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    return SymmetricLU(lu, scale, scaled, np.arange(scale.size) if order is None else order)


def blocks_of(matrix: Any) -> list[Ints]:
    """Rows of every diagonal block of a sparse symmetric matrix; no entry couples two blocks."""
    _, label = connected_components(matrix, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def factors_with_rigid_motions(stiffness: Any, rigid: Floats, order: Ints | None = None) -> SymmetricLU:
    """Factors of K after replacing as many rows and columns by a diagonal matrix as there are rigid-body motions.

    The rows are those in which the rigid-body motions differ most. The solution for a load in equilibrium is a
    deflection of the free structure that is zero in these rows.

    Parameters
    ----------
    stiffness : (N, N) sparse K, positive semidefinite.
    rigid : (N, r) its null space.
    order : (N,) order of elimination.

    Returns
    -------
    SymmetricLU
        Factors of a positive definite matrix.

    Raises
    ------
    ScenarioError
        If round-off makes it singular.
    """
    pinned = np.zeros(0, dtype=np.int64)
    if rigid.shape[1]:
        stiffness, pinned = _pin(stiffness, rigid)
    try:
        return replace(symmetric_lu(stiffness, order), pinned=pinned)
    except RuntimeError:
        raise _singular() from None


def _singular() -> ScenarioError:
    """The error of a stiffness matrix that is singular by round-off."""
    return ScenarioError.at(
        "bodies", "or joints have stiffnesses that differ by more than 16 digits: round-off makes the stiffness "
        "matrix singular", "bring very large and very small stiffnesses closer together",
    )  # fmt: skip


def _pin(stiffness: Any, rigid: Floats) -> tuple[Any, Ints]:
    """K with some rows and columns made diagonal, and their indices; see `factors_with_rigid_motions`."""
    size, count = rigid.shape
    # of equal rows the first: round-off must not select another one
    ranked = rigid * np.linspace(1.0, 1.0 - FIRST_ROW_PREFERENCE, size)[:, None]
    pinned: Ints = np.sort(qr(ranked.T, mode="r", pivoting=True)[1][:count])
    held = np.isin(np.arange(size), pinned).astype(float)
    free: Any = diags_array(1.0 - held)
    diagonal = stiffness.diagonal()
    pins = np.where(diagonal > 0.0, diagonal, diagonal.max() or 1.0)  # a mass that nothing restrains has no stiffness
    stiffness = free @ stiffness @ free + diags_array(held * pins)
    stiffness.eliminate_zeros()
    return stiffness, pinned


FIRST_ROW_PREFERENCE = 1e-6  # over the last row, among rows with equal rigid-body motions
# Larger matrices whose factors are inaccurate without pivoting are not factorised densely.
DENSE_COUNT = 3000
# Matrices up to this size are factorised densely at once, in less time.
SMALL_COUNT = 150


def negative_eigenvalues(matrix: Any, order: Ints | None = None) -> int | None:
    """Number of negative eigenvalues of a symmetric sparse matrix; None if round-off hides it.

    ``order`` is an optional order of elimination. A very small matrix, or a small one of which sparse factors give no
    count, is factorised densely with pivoting (Bunch and Kaufman).
    """
    if matrix.shape[0] > SMALL_COUNT:
        count = _negative_eigenvalues_of_sparse(matrix, order)
        if count is not None or matrix.shape[0] > DENSE_COUNT:
            return count
    diagonal = np.abs(matrix.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    _, d, _ = ldl(scale[:, None] * matrix.toarray() * scale)
    return int(np.sum(np.linalg.eigvalsh(d) < 0))


def _negative_eigenvalues_of_sparse(matrix: Any, order: Ints | None) -> int | None:
    """The same by sparse factors; None where they are not accurate enough.

    The sparse factorisation uses diagonal pivots. Their signs are reliable if its error, in the Frobenius norm, is far
    below the smallest eigenvalue. The error is estimated from 8 products with random signs, whose mean square equals
    the squared norm, since multiplying the factors takes far longer than computing them.
    """
    size = matrix.shape[0]
    try:
        factors = symmetric_lu(matrix, order)
    except RuntimeError:  # exactly singular
        return None
    lu, entries = factors.lu, factors.matrix.tocoo()
    if not np.array_equal(lu.perm_r, lu.perm_c):  # not all pivots on the diagonal
        return None
    permuted = csc_array((entries.data, (lu.perm_r[entries.row], lu.perm_c[entries.col])), shape=(size, size))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(size, 8))
    error = float(np.linalg.norm(lu.L @ (lu.U @ signs) - permuted @ signs) / np.sqrt(signs.shape[1]))
    inverse = LinearOperator((size, size), matvec=lu.solve, rmatvec=lu.solve, matmat=lu.solve, dtype=float)
    return int(np.sum(lu.U.diagonal() < 0)) if error * onenormest(inverse) <= LARGEST_FACTOR_ERROR else None
