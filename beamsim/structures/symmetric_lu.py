r"""Sparse factors of symmetric matrices, scaled and ordered for little fill, and what the signs of their pivots tell.

Matrices of meshes are ordered by nested dissection: the nodes are cut in two of equal number at a plane across
their longest extent, again and again; the rows between the halves come last. On meshes of solids the factors have about
half of the entries that minimum degree leaves, and take a quarter of the time (A. George, SIAM J. Numer. Anal. 10
(1973) 345-363).

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
    """(N,) rows of a sparse symmetric matrix in the order of elimination; None where places do not tell it.

    Parameters
    ----------
    matrix : (N, N) sparse.
    places : (N, 3) coordinates of the node of each row; NaN where a row has none; None where none are known.
    """
    if places is None:
        return None
    size = matrix.shape[0]
    graph = csr_array(matrix)
    graph = csr_array((np.ones(graph.nnz, dtype=np.int32), graph.indices, graph.indptr), shape=graph.shape)
    entries = np.diff(graph.indptr)
    # a row with many entries would join everything: it comes last of all
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
    """Two halves of the rows without a common entry, and the rows between them; None where all are at one place."""
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


LARGEST_FACTOR_ERROR = 0.01  # of factors whose signs count, over the smallest eigenvalue


@dataclass(frozen=True)
class SymmetricLU:
    """Factors of D A D with a unit diagonal, so that rotations in rad and displacements in m have like pivots.

    The rows may be in another order than those of A, which `symmetric_lu` was given.
    """

    lu: Any  # SuperLU
    scale: Floats  # (N,) diagonal of D, in the order of A
    matrix: Any  # (N, N) D A D, in the order of the factors
    order: Ints  # (N,) rows of A in the order of the factors
    # (r,) rows that `factors_with_rigid_motions` replaces, which hold rigid-body motions; none where A is unchanged
    pinned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

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
    def root(self) -> Any:
        """(N, N) sparse B with A = B^T B, where all pivots are positive and none was exchanged."""
        upper = self.lu.U
        columns = self.lu.perm_c[np.argsort(self.order)]
        root = upper[:, columns]  # a copy, scaled in place: products with diagonal matrices would copy it twice more
        root.data /= np.sqrt(upper.diagonal())[root.indices]
        root.data /= np.repeat(self.scale, np.diff(root.indptr))
        return root


def symmetric_lu(matrix: Any, order: Ints | None = None) -> SymmetricLU:
    """Factors without exchanged pivots; raises `RuntimeError` for a matrix that is exactly singular.

    ``order`` (N,) is that of elimination, such as `beamsim.structures.symmetric_lu.dissection` gives; minimum degree
    without.
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
    """Rows of every block of a sparse symmetric matrix; no entry couples one block to another."""
    _, label = connected_components(matrix, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def factors_with_rigid_motions(stiffness: Any, rigid: Floats, order: Ints | None = None) -> SymmetricLU:
    """Factors of K in which a diagonal matrix replaces as many rows and columns as there are rigid-body motions.

    They are those in which these motions differ most. What the factors solve for a load in equilibrium, zero in these
    rows, is a deflection of the free structure.

    Parameters
    ----------
    stiffness : (N, N) sparse K, positive semidefinite.
    rigid : (N, r) its null space.
    order : (N,) of elimination.

    Returns
    -------
    SymmetricLU
        Of a positive definite matrix.

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
    """That round-off makes a stiffness matrix singular."""
    return ScenarioError.at(
        "bodies", "or joints have stiffnesses that differ by more than 16 digits: round-off makes the stiffness "
        "matrix singular", "bring very large and very small stiffnesses closer together",
    )  # fmt: skip


def _pin(stiffness: Any, rigid: Floats) -> tuple[Any, Ints]:
    """K with a diagonal matrix in place of some rows and columns, and which; see `factors_with_rigid_motions`."""
    size, count = rigid.shape
    # of equals the first, whatever the scale of the motions: round-off must not choose others where it differs
    ranked = rigid * np.linspace(1.0, 1.0 - FIRST_ROW_PREFERENCE, size)[:, None]
    pinned: Ints = np.sort(qr(ranked.T, mode="r", pivoting=True)[1][:count])
    held = np.isin(np.arange(size), pinned).astype(float)
    free: Any = diags_array(1.0 - held)
    stiffness = free @ stiffness @ free + diags_array(held * stiffness.diagonal())
    stiffness.eliminate_zeros()
    return stiffness, pinned


FIRST_ROW_PREFERENCE = 1e-6  # of the first row over the last one, of rows in which rigid-body motions differ equally
# Above this size a matrix whose factors are not accurate without pivoting is not factorised densely.
DENSE_COUNT = 3000


def negative_eigenvalues(matrix: Any, order: Ints | None = None) -> int | None:
    """Number of negative eigenvalues of a symmetric sparse matrix; None where round-off leaves it unknown.

    ``order`` may be the rows in the order of elimination.

    The sparse factorisation keeps to the diagonal. As many of its pivots are negative as eigenvalues if its error, in
    the Frobenius norm, is far below the smallest eigenvalue. It is known by 8 products with random signs, whose mean
    square is that of the norm: factors multiplied with each other take many times as long as they do themselves. A
    small matrix for which that fails is factorised densely with pivoting (Bunch and Kaufman).
    """
    size = matrix.shape[0]
    try:
        factors = symmetric_lu(matrix, order)
    except RuntimeError:  # exactly singular
        factors = None
    if factors is not None and np.array_equal(factors.lu.perm_r, factors.lu.perm_c):  # all pivots on the diagonal
        lu, entries = factors.lu, factors.matrix.tocoo()
        permuted = csc_array((entries.data, (lu.perm_r[entries.row], lu.perm_c[entries.col])), shape=(size, size))
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(size, 8))
        error = float(np.linalg.norm(lu.L @ (lu.U @ signs) - permuted @ signs) / np.sqrt(signs.shape[1]))
        inverse = LinearOperator((size, size), matvec=lu.solve, rmatvec=lu.solve, matmat=lu.solve, dtype=float)
        if error * onenormest(inverse) <= LARGEST_FACTOR_ERROR:
            return int(np.sum(lu.U.diagonal() < 0))
    return None if size > DENSE_COUNT else _negative_eigenvalues_of_dense(matrix)


def _negative_eigenvalues_of_dense(matrix: Any) -> int:
    """The same of a small matrix, by factors with pivoting."""
    diagonal = np.abs(matrix.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    _, d, _ = ldl(scale[:, None] * matrix.toarray() * scale)
    return int(np.sum(np.linalg.eigvalsh(d) < 0))
