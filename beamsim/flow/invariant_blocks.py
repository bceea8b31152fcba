"""Block-diagonal form of a state matrix: one form for distinct, coincident and defective eigenvalues.

.. math:: A = \\sum_b X_b T_b \\Xi_b, \\qquad e^{A\\tau} = \\sum_b X_b\\, e^{\\mu_b\\tau}
          \\Big(\\sum_k N_b^k \\tau^k / k!\\Big)\\, \\Xi_b, \\qquad N_b = T_b - \\mu_b I .

A well-separated eigenvalue is a block of size one (N = 0). Eigenvalues so close that their
eigenvectors are ill-conditioned (near-critical damping, coincident frequencies, the double zero of a
rigid-body mode) share a block; the power series of its small or nilpotent N is then exact to round-off
over a bounded time. Method after Bavely and Stewart, SIAM J. Numer. Anal. 16 (1979).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import schur

from beamsim.flow.refined_blocks import refined
from beamsim.typing import Complexes, Floats, Ints

LARGEST_PROJECTOR = 200.0  # norm of a block's spectral projector above which blocks are merged


@dataclass(frozen=True)
class Block:
    """One invariant subspace of dimension m of a real (N, N) matrix."""

    right: Complexes  # X_b, (N, m)
    left: Complexes  # Xi_b, (m, N)
    matrix: Complexes  # T_b, (m, m)
    centre: complex  # mu_b
    weight: float  # 2 for one of a conjugate pair (the other is left out), 1 for a self-conjugate block

    @property
    def radius(self) -> float:
        """Largest distance of an eigenvalue from the centre."""
        if self.matrix.shape[0] == 1:
            return 0.0
        return float(np.max(np.abs(np.linalg.eigvals(self.matrix) - self.centre)))

    def conjugate(self) -> Block:
        """The block of the conjugate eigenvalues."""
        return Block(self.right.conj(), self.left.conj(), self.matrix.conj(), self.centre.conjugate(), self.weight)


class SimpleModes(NamedTuple):
    """Eigenvalues with a block of their own; of a conjugate pair both, or the one in the upper half-plane alone."""

    right: Complexes  # X, (N, e)
    left: Complexes  # Xi, (e, N)
    eigenvalue: Complexes  # (e,)

    def upper(self) -> SimpleModes:
        """One of each conjugate pair, and the real ones."""
        kept = np.flatnonzero(self.eigenvalue.imag >= 0.0)
        if kept.size == self.eigenvalue.size:
            return self
        return SimpleModes(self.right[:, kept], self.left[kept], self.eigenvalue[kept])

    def whole(self) -> SimpleModes:
        """Both of each pair, from what `upper` returns."""
        pair = np.flatnonzero(self.eigenvalue.imag > 0.0)
        return SimpleModes(
            np.hstack([self.right, self.right[:, pair].conj()]), np.vstack([self.left, self.left[pair].conj()]),
            np.append(self.eigenvalue, self.eigenvalue[pair].conj()),
        )  # fmt: skip


class BlockForm(NamedTuple):
    """All invariant subspaces of a matrix, or of a part of it."""

    simple: SimpleModes
    blocks: list[Block]  # the others

    def placed(self, out: Floats, back: Floats) -> BlockForm:
        """Those of a state of which this one is a part, or the same in other coordinates: ``out`` (N', N) puts this
        state into it, ``back`` (N, N') takes it out."""
        right, left, eigenvalue = self.simple
        blocks = [replace(b, right=out @ b.right, left=b.left @ back) for b in self.blocks]
        return BlockForm(SimpleModes(out @ right, left @ back, eigenvalue), blocks)

    def joined(self, other: BlockForm) -> BlockForm:
        """These subspaces and others of the same state."""
        one, two = self.simple, other.simple
        return BlockForm(
            SimpleModes(
                np.hstack([one.right, two.right]), np.vstack([one.left, two.left]),
                np.append(one.eigenvalue, two.eigenvalue),
            ), self.blocks + other.blocks,
        )  # fmt: skip


def second_order_blocks(shapes: Floats, omega_squared: Floats, damping: Floats, window: float = np.inf) -> BlockForm:
    """Blocks of uncoupled modes ``eta'' + d eta' + omega^2 eta = 0`` in the state (q, q').

    Parameters
    ----------
    shapes : (n, r) orthonormal modes, one a column.
    omega_squared, damping : (r,) of each mode.
    window : longest time for which the blocks will be used; eigenvalues that cannot be distinguished
        within it share a block.

    Returns
    -------
    simple : eigenvalues with a block of their own; of a conjugate pair both.
    blocks : blocks of size two (rigid-body modes, near-critical damping).
    """
    n = shapes.shape[0]
    if not omega_squared.size:
        return BlockForm(
            SimpleModes(np.zeros((2 * n, 0), complex), np.zeros((0, 2 * n), complex), np.zeros(0, complex)), []
        )
    half = 0.5 * damping
    discriminant = half**2 - omega_squared
    root = np.sqrt(discriminant.astype(complex))
    scale = np.sqrt(np.abs(omega_squared)) + np.abs(half)
    # 1e-3: relative distance of a damped mode's two eigenvalues that still get their own blocks
    separate = np.abs(root) > 1e-3 * np.maximum(scale, 1.0 / window)
    s = np.flatnonzero(separate)
    lam = np.concatenate([-half[s] + root[s], -half[s] - root[s]])
    # the smaller of two real roots by their product, without cancellation; exactly zero for a rigid-body mode
    real = np.flatnonzero(discriminant[s] > 0)
    lam[real] = -omega_squared[s[real]] / (half[s[real]] + root[s[real]])
    other = np.concatenate([lam[s.size :], lam[: s.size]])
    mode = np.concatenate([s, s])
    difference = lam - other
    X = np.empty((2 * n, lam.size), dtype=complex)
    X[:n] = shapes[:, mode] / difference
    X[n:] = shapes[:, mode] * (lam / difference)
    Xi = np.empty((lam.size, 2 * n), dtype=complex)
    Xi[:, :n] = -other[:, None] * shapes[:, mode].T
    Xi[:, n:] = shapes[:, mode].T
    blocks = []
    for i in np.flatnonzero(~separate):
        unit = max(float(scale[i]), 1.0 / window) if np.isfinite(window) else float(scale[i]) or 1.0
        right = np.zeros((2 * n, 2), dtype=complex)
        right[:n, 0] = shapes[:, i] / unit
        right[n:, 1] = shapes[:, i]
        left = np.zeros((2, 2 * n), dtype=complex)
        left[0, :n] = shapes[:, i] * unit
        left[1, n:] = shapes[:, i]
        matrix = np.array([[0.0, unit], [-omega_squared[i] / unit, -damping[i]]], dtype=complex)
        blocks.append(Block(right, left, matrix, complex(-half[i]), 1.0))
    return BlockForm(SimpleModes(X, Xi, lam), blocks)


def block_diagonalise(A: Floats, window: float = np.inf, inverse: Callable[[], Floats] | None = None) -> BlockForm:
    """Blocks of a general real matrix, as small as conditioning allows.

    Parameters
    ----------
    A : (N, N).
    window : s, longest time for which the blocks will be used.
    inverse : gives that of A, written down rather than computed, and with it the eigenvalues far below the largest,
        which A itself knows only to the round-off of the largest (a heavily overdamped contact).

    Returns
    -------
    simple, blocks : see `second_order_blocks`.

    Notes
    -----

    Where eigenvectors are ill-conditioned, the coordinates are scaled first: displacements and the internal states of a
    contact much stiffer than the structure have other sizes (balancing, after Osborne, J. ACM 7 (1960)). Balancing, and
    the eigenvalue solver, which does the same, may enlarge round-off (Watkins, ETNA 23 (2006)): what the blocks leave
    of A between them is measured in the given coordinates, see `refined`.
    """
    simple, balanced, scale = _separate(A, inverse), A, np.ones(A.shape[0])
    modes = None if simple is None else BlockForm(simple, [])
    if modes is None:
        from scipy.linalg import matrix_balance

        scale = np.asarray(matrix_balance(A, permute=False, separate=True)[1][0], dtype=float)  # powers of two
        balanced = A / scale[:, None] * scale
        simple = _separate(balanced, None if inverse is None else lambda: inverse() / scale[:, None] * scale)
        modes = _clusters(balanced, window) if simple is None else BlockForm(simple, [])
    if inverse is None and A.shape[0] > 1:  # round-off of the largest eigenvalue in the others
        modes = _refined(balanced, modes, scale)
    return modes if np.all(scale == 1.0) else modes.placed(np.diag(scale), np.diag(1.0 / scale))


def _refined(A: Floats, modes: BlockForm, scale: Floats) -> BlockForm:
    """BlockForm, both of each conjugate pair, and blocks without the couplings that round-off has left between them."""
    simple, blocks = modes
    whole = [*blocks, *(b.conjugate() for b in blocks if b.weight == 2.0)]
    count = simple.eigenvalue.size
    ends = count + np.cumsum([0, *(b.matrix.shape[0] for b in whole)])
    groups = [np.arange(first, last) for first, last in pairwise(ends)]
    found = refined(
        A, np.concatenate([simple.right, *(b.right for b in whole)], axis=1),
        np.concatenate([simple.left, *(b.left for b in whole)]), groups, scale,
    )  # fmt: skip
    if found is None:
        return modes
    right, left, matrix = found
    better = SimpleModes(right[:, :count], left[:count], np.diag(matrix)[:count].copy())
    real = simple.eigenvalue.imag == 0.0
    better.right.imag[:, real] = better.left.imag[real] = better.eigenvalue.imag[real] = 0.0
    return BlockForm(better, [
        replace(b, right=right[:, g], left=left[g], matrix=matrix[np.ix_(g, g)])
        for b, g in zip(blocks, groups, strict=False)
    ])  # fmt: skip


def _separate(A: Floats, inverse: Callable[[], Floats] | None) -> SimpleModes | None:
    """Every eigenvalue with a block of its own, or None where eigenvectors are too ill-conditioned for that."""
    lam, X = _eigenpairs(A, inverse)
    try:
        Xi = np.linalg.inv(X).astype(complex)
    except np.linalg.LinAlgError:
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # of vectors that are parallel to round-off
        norms = np.linalg.norm(X, axis=0) * np.linalg.norm(Xi, axis=1)
    return SimpleModes(X, Xi, lam) if np.all(np.isfinite(norms)) and norms.max() <= LARGEST_PROJECTOR else None


def _eigenpairs(A: Floats, inverse: Callable[[], Floats] | None) -> tuple[Complexes, Complexes]:
    """Eigenvalues and eigenvectors; those below the widest gap of the sizes from the inverse, if there is one."""
    lam, X = (part.astype(complex) for part in np.linalg.eig(A))
    size = np.sort(np.abs(lam))
    if inverse is None or not size[0] > 0:
        return lam, X
    at = int(np.argmax(size[1:] / size[:-1]))
    # 1e3: ratio of neighbouring sizes of eigenvalues from which on the smaller ones are those of the inverse
    if size[at + 1] < 1e3 * size[at]:
        return lam, X
    limit = np.sqrt(size[at]) * np.sqrt(size[at + 1])
    mu, Y = (part.astype(complex) for part in np.linalg.eig(inverse()))
    fast, slow = np.abs(lam) > limit, np.abs(mu) * limit > 1.0
    if fast.sum() + slow.sum() != lam.size:
        return lam, X
    return np.concatenate([lam[fast], 1.0 / mu[slow]]), np.concatenate([X[:, fast], Y[:, slow]], axis=1)


def _clusters(A: Floats, window: float) -> BlockForm:
    """Merge neighbouring eigenvalues until every spectral projector is well-conditioned."""
    size = A.shape[0]
    lam = np.linalg.eigvals(A).astype(complex)
    # 1e6: norm that is accepted where merging does not get below the largest
    best = 1e6
    blocks = [Block(np.eye(size, dtype=complex), np.eye(size, dtype=complex), A.astype(complex), _mean(lam, True), 1.0)]
    for tolerance in (1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1):
        groups = _groups(lam, tolerance, window)
        if len(groups) == 1 or best <= LARGEST_PROJECTOR:
            break
        candidate = [b for b in (_invariant(A, lam, group) for group in groups) if b is not None]
        worst = max((float(np.linalg.norm(b.right, 2) * np.linalg.norm(b.left, 2)) for b in candidate), default=np.inf)
        identity = sum((b.weight * (b.right @ b.left).real for b in candidate), np.zeros((size, size)))
        if worst < best and np.abs(identity - np.eye(size)).max() < 1e-9:
            blocks, best = candidate, worst
    none = np.zeros((size, 0), dtype=complex)
    return BlockForm(SimpleModes(none, none.T, none[0]), blocks)


def _groups(lam: Complexes, tolerance: float, window: float) -> list[Ints]:
    """Single-linkage clusters; of two conjugate clusters only the upper one."""
    largest = float(np.max(np.abs(lam), initial=0.0))
    # what splits a multiple eigenvalue at zero is round-off of the largest, or too small to be seen within the window
    floor = max((1e-9 + 1e-3 * tolerance) * largest, tolerance / window)
    near = np.abs(lam[:, None] - lam[None, :]) <= (
        tolerance * np.maximum(np.abs(lam)[:, None], np.abs(lam)[None, :]) + floor
    )
    label = np.arange(lam.size)
    for _ in range(lam.size):
        spread = np.min(np.where(near, label[None, :], lam.size), axis=1)
        if np.array_equal(spread, label):
            break
        label = spread
    groups = [np.flatnonzero(label == k) for k in np.unique(label)]
    return [g for g in groups if _self_conjugate(lam[g]) or lam[g].imag.sum() > 0]


def _self_conjugate(group: Complexes) -> bool:
    return bool(abs(group.imag.sum()) <= 1e-9 * np.abs(group).sum()) or not np.any(group)


def _mean(group: Complexes, real: bool) -> complex:
    mean = complex(group.mean())
    return complex(mean.real) if real else mean


def _invariant(A: Floats, lam: Complexes, group: Ints) -> Block | None:
    """The block of a cluster from two ordered Schur forms, or None where the ordering is ambiguous."""
    chosen, rest = lam[group], np.delete(lam, group)

    def inside(value: complex) -> bool:
        return bool(np.min(np.abs(chosen - value)) < np.min(np.abs(rest - value)))

    def inside_conjugate(value: complex) -> bool:
        return inside(value.conjugate())

    _, Z, count = schur(A.astype(complex), output="complex", sort=inside)  # type: ignore[call-overload]
    _, W, count_left = schur(  # type: ignore[call-overload]
        A.T.astype(complex), output="complex", sort=inside_conjugate
    )
    m = group.size
    if count != m or count_left != m:
        return None
    right = Z[:, :m]
    left = np.linalg.solve(W[:, :m].conj().T @ right, W[:, :m].conj().T)
    real = _self_conjugate(chosen)
    return Block(right, left, left @ A @ right, _mean(chosen, real), 1.0 if real else 2.0)
