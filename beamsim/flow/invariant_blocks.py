r"""Block-diagonal form of a state matrix: one form for distinct, coincident and defective eigenvalues.

.. math:: A = \sum_b X_b T_b \Xi_b, \qquad e^{A\tau} = \sum_b X_b\, e^{\mu_b\tau}
          \Big(\sum_k N_b^k \tau^k / k!\Big)\, \Xi_b, \qquad N_b = T_b - \mu_b I .

A well-separated eigenvalue is a block of size one (N = 0). Eigenvalues so close that their
eigenvectors are ill-conditioned (near-critical damping, coincident frequencies, the double zero of a
rigid-body mode) share a block; the power series of its small or nilpotent N is then exact to round-off
over a bounded time. Method after Bavely and Stewart, SIAM J. Numer. Anal. 16 (1979).

With all right and left vectors X and Xi, ``E = Xi A X`` is block diagonal but for their errors. The couplings F with
``E_ii F_ij - F_ij E_jj = -E_ij`` take these away to second order: ``X (I + F)``, ``(I - F) Xi``. After G. W. Stewart,
SIAM Rev. 15 (1973), and Ogita and Aishima, Japan J. Indust. Appl. Math. 35 (2018).

A spring and a dashpot change the matrices by one dyad each. With the modes of
:math:`Q(\lambda) = \lambda^2 + C\lambda + K`, scaled such that
:math:`Q^{-1} = \sum_j u_j u_j^T / (\lambda - \mu_j)` over all 2n eigenvalues, those of
:math:`Q + z \phi\phi^T`, :math:`z = k + c\lambda`, are the zeros of the secular function

.. math:: f(\lambda) = 1 + z(\lambda) \sum_j \frac{p_j^2}{\lambda - \mu_j}, \qquad p_j = \phi^T u_j,
          \qquad u' = \sum_j \frac{p_j u_j}{\lambda - \mu_j} \Big/ \sqrt{\sum_j
          \frac{p_j^2}{(\lambda - \mu_j)^2} + \frac{c}{z^2}} .

All zeros are searched for at once (O. Aberth, Math. Comp. 27, 1973). A zero is held as the distance from its nearest
pole, and the vectors take the p of which the zeros found are exact (M. Gu and S. C. Eisenstat, SIAM J. Matrix Anal.
Appl. 15, 1994): so they stay orthogonal where zeros crowd or hardly move. Conjugate poles are added as one fraction,
without cancellation. That takes some n^2 operations and one product of matrices, against some 25 n^3 for the eigenvalue
problem of order 2n. The result is checked with two motions and discarded where it is not exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import schur

from beamsim.system.equations import PiecewiseLinearSystem
from beamsim.typing import TINY, Complexes, Floats, Ints


class Subspaces(NamedTuple):
    """Right and left vectors of all subspaces of A, and A between them, which is nearly block diagonal."""

    right: Complexes  # X, (N, N)
    left: Complexes  # Xi, (N, N)
    matrix: Complexes  # Xi A X, (N, N)


def refined(A: Floats, right: Complexes, left: Complexes, groups: Sequence[Ints], scale: Floats) -> Subspaces | None:
    """Improve approximate invariant subspaces of A; None if couplings are already small or do not decrease.

    Parameters
    ----------
    A : (N, N).
    right, left : (N, N) vectors in columns, and in rows.
    groups : numbers of the vectors of each block; a vector in no group is a block of its own.
    scale : (N,) factors of the coordinates in which the size of couplings is judged.

    Returns
    -------
    Subspaces or None
        With the matrix A in them.
    """
    error = (scale[:, None] * right) @ _couplings(left @ (A @ right), groups) @ (left / scale)
    if np.abs(error).max(initial=0.0) <= NEGLIGIBLE_COUPLING:
        return None
    X, Xi, eye, last = right, left, np.eye(A.shape[0]), np.inf
    for _ in range(4):  # each squares the coupling
        Xi = Xi + (eye - Xi @ X) @ Xi
        E = Xi @ (A @ X)
        F = _couplings(E, groups)
        largest = float(np.abs(F).max())
        if not largest < 0.5 * min(last, 1.0):
            break
        X, Xi, last = X + X @ F, Xi - F @ Xi, largest
    return Subspaces(X, Xi, E) if np.isfinite(last) else None


def _couplings(E: Complexes, groups: Sequence[Ints]) -> Complexes:
    """F of the module's equation; zero within groups and between eigenvalues that count as equal."""
    values = np.diag(E)
    apart, size = values[None, :] - values[:, None], np.abs(values)
    alike = np.abs(apart) <= SAME_EIGENVALUE * np.maximum(size[:, None], size[None, :]) + ROUND_OFF * size.max()
    F = np.where(alike, 0.0, E / np.where(alike, 1.0, apart))
    alone = np.setdiff1d(np.arange(values.size), np.concatenate([*groups, np.zeros(0, dtype=np.int64)]))
    for i in groups:
        from scipy.linalg import solve_sylvester

        for j in (*alone[:, None], *(g for g in groups if g is not i)):
            F[np.ix_(i, j)] = solve_sylvester(E[np.ix_(i, i)], -E[np.ix_(j, j)], -E[np.ix_(i, j)])
            F[np.ix_(j, i)] = solve_sylvester(E[np.ix_(j, j)], -E[np.ix_(i, i)], -E[np.ix_(j, i)])
        F[np.ix_(i, i)] = 0.0
    return F


LARGEST_PROJECTOR = 200.0  # norm of a block's spectral projector above which blocks are merged
ACCEPTED_PROJECTOR = 1e6  # norm that is accepted where merging does not get below the largest
NEGLIGIBLE_COUPLING = 1e-12  # relative coupling of two blocks that is accepted
SAME_EIGENVALUE = 1e-9  # relative distance of eigenvalues that count as equal
ROUND_OFF = 1e-15  # of the largest eigenvalue
SEPARATE_PAIR = 1e-3  # relative distance of a damped mode's two eigenvalues that still get their own blocks
WIDE_GAP = 1e3  # ratio of neighbouring sizes of eigenvalues from which on the smaller ones are those of the inverse
LARGEST_ERROR = 1e-11  # relative error of a motion and its rate, from which on the eigenvalue problem is solved anew
LAST_STEP = 4e-16  # of a zero's distance from its pole
STEP_OF_ROUND_OFF = 1e-12  # of a zero's distance from its pole: a smaller step that no longer shrinks is round-off


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


class BlockForm(NamedTuple):
    """All invariant subspaces of a matrix, or of a part of it."""

    simple: SimpleModes
    blocks: list[Block]  # the others

    def transform(self, to_state: Floats, from_state: Floats) -> BlockForm:
        """The subspaces in other coordinates, or as part of a longer state.

        ``to_state`` (N', N) maps this state into the other one, ``from_state`` (N, N') maps back.
        """
        right, left, eigenvalue = self.simple
        blocks = [replace(b, right=to_state @ b.right, left=b.left @ from_state) for b in self.blocks]
        return BlockForm(SimpleModes(to_state @ right, left @ from_state, eigenvalue), blocks)

    def join(self, other: BlockForm) -> BlockForm:
        """These subspaces and others of the same state."""
        right, left, eigenvalue = zip(self.simple, other.simple, strict=True)
        modes = SimpleModes(np.hstack(right), np.vstack(left), np.concatenate(eigenvalue))
        return BlockForm(modes, self.blocks + other.blocks)


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
    half = 0.5 * damping
    discriminant = half**2 - omega_squared
    root = np.sqrt(discriminant.astype(complex))
    rate = np.maximum(np.sqrt(np.abs(omega_squared)) + np.abs(half), 1.0 / window)  # of each mode, 1/s
    separate = np.abs(root) > SEPARATE_PAIR * rate
    s = np.flatnonzero(separate)
    lam = np.concatenate([-half[s] + root[s], -half[s] - root[s]])
    # the smaller of two real roots by their product, without cancellation; exactly zero for a rigid-body mode
    real = np.flatnonzero(discriminant[s] > 0)
    larger = half[s] + np.copysign(1.0, half[s]) * root[s]
    lam[real], lam[s.size + real] = -omega_squared[s[real]] / larger[real], -larger[real]
    other = np.concatenate([lam[s.size :], lam[: s.size]])
    mode = np.concatenate([s, s])
    difference = lam - other
    X = np.vstack([shapes[:, mode] / difference, shapes[:, mode] * (lam / difference)])
    Xi = np.hstack([-other[:, None] * shapes[:, mode].T, shapes[:, mode].T], dtype=complex)
    together = np.flatnonzero(~separate)
    of_blocks = zip(shapes.T[together], omega_squared[together], damping[together], rate[together], strict=True)
    return BlockForm(SimpleModes(X, Xi, lam), [_second_order_block(*of_block) for of_block in of_blocks])


def _second_order_block(shape: Floats, omega_squared: float, damping: float, rate: float) -> Block:
    """The block of a mode (n,) whose two eigenvalues are not separate; ``rate`` is that of the mode, 1/s, or 0."""
    n, unit = shape.size, rate or 1.0
    right, left = np.zeros((2 * n, 2), dtype=complex), np.zeros((2, 2 * n), dtype=complex)
    right[:n, 0], right[n:, 1] = shape / unit, shape
    left[0, :n], left[1, n:] = shape * unit, shape
    matrix = np.array([[0.0, unit], [-omega_squared / unit, -damping]], dtype=complex)
    return Block(right, left, matrix, complex(-0.5 * damping), 1.0)


def block_diagonalise(A: Floats, window: float = np.inf, inverse: Callable[[], Floats] | None = None) -> BlockForm:
    """Blocks of a general real matrix, as small as conditioning allows.

    Parameters
    ----------
    A : (N, N).
    window : s, longest time for which the blocks will be used.
    inverse : gives the inverse of A in closed form. From it follow the eigenvalues far below the largest, which A
        determines only to the round-off of the largest (a heavily overdamped contact).

    Returns
    -------
    simple, blocks : see `second_order_blocks`.

    Notes
    -----

    Where eigenvectors are ill-conditioned, the coordinates are scaled first: displacements and the internal states of a
    contact much stiffer than the structure have other sizes (balancing, after Osborne, J. ACM 7 (1960)). Balancing, and
    the eigenvalue solver, which does the same, may enlarge round-off (Watkins, ETNA 23 (2006)): the remaining coupling
    of the blocks is measured in the given coordinates, see `refined`.
    """
    simple = _separate(A, inverse)
    if simple is None:
        return _balanced_blocks(A, window, inverse)
    modes = BlockForm(simple, [])
    # round-off of the largest eigenvalue in the others
    return _refined(A, modes, np.ones(A.shape[0])) if inverse is None and A.shape[0] > 1 else modes


def _balanced_blocks(A: Floats, window: float, inverse: Callable[[], Floats] | None) -> BlockForm:
    """Blocks of a matrix with ill-conditioned eigenvectors, in scaled coordinates; see `block_diagonalise`."""
    from scipy.linalg import matrix_balance

    scale = np.asarray(matrix_balance(A, permute=False, separate=True)[1][0], dtype=float)  # powers of two
    balanced = A / scale[:, None] * scale
    simple = _separate(balanced, None if inverse is None else lambda: inverse() / scale[:, None] * scale)
    modes = _clusters(balanced, window) if simple is None else BlockForm(simple, [])
    if inverse is None and A.shape[0] > 1:
        modes = _refined(balanced, modes, scale)
    return modes if np.all(scale == 1.0) else modes.transform(np.diag(scale), np.diag(1.0 / scale))


def _refined(A: Floats, modes: BlockForm, scale: Floats) -> BlockForm:
    """The block form with the couplings removed that round-off has left; both members of each conjugate pair."""
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


def _small_from_inverse(
    lam: Complexes, X: Complexes, inverse: Callable[[], Floats]
) -> tuple[Complexes, Complexes]:  # fmt: skip
    """Eigenvalues and vectors of a matrix, those below the widest gap of their sizes from its inverse."""
    size = np.sort(np.abs(lam))
    if not size[0] > 0:
        return lam, X
    at = int(np.argmax(size[1:] / size[:-1]))
    if size[at + 1] < WIDE_GAP * size[at]:
        return lam, X
    return _slow_from_inverse(lam, X, inverse(), np.sqrt(size[at]) * np.sqrt(size[at + 1]))


def _slow_from_inverse(lam: Complexes, X: Complexes, inverse: Floats, limit: float) -> tuple[Complexes, Complexes]:
    """Eigenvalues and vectors of a matrix, those of sizes below a limit from its inverse."""
    mu, Y = (part.astype(complex) for part in np.linalg.eig(inverse))
    fast, slow = np.abs(lam) > limit, np.abs(mu) * limit > 1.0
    if fast.sum() + slow.sum() != lam.size:
        return lam, X
    return np.append(lam[fast], 1.0 / mu[slow]), np.concatenate([X[:, fast], Y[:, slow]], axis=1)


def _separate(A: Floats, inverse: Callable[[], Floats] | None) -> SimpleModes | None:
    """Every eigenvalue with a block of its own, or None where eigenvectors are too ill-conditioned for that.

    Those below the widest gap of their sizes are taken from the inverse, if there is one.
    """
    lam, X = (part.astype(complex) for part in np.linalg.eig(A))
    if inverse is not None:
        lam, X = _small_from_inverse(lam, X, inverse)
    try:
        Xi = np.linalg.inv(X).astype(complex)
    except np.linalg.LinAlgError:
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # of vectors that are parallel to round-off
        norms = np.linalg.norm(X, axis=0) * np.linalg.norm(Xi, axis=1)
    return SimpleModes(X, Xi, lam) if np.all(np.isfinite(norms)) and norms.max() <= LARGEST_PROJECTOR else None


def _clusters(A: Floats, window: float) -> BlockForm:
    """Merge neighbouring eigenvalues until every spectral projector is well-conditioned."""
    size = A.shape[0]
    lam = np.linalg.eigvals(A).astype(complex)
    best = ACCEPTED_PROJECTOR
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


SPLIT_BY_ROUND_OFF = 1e-9  # of the largest eigenvalue, by which round-off splits a multiple eigenvalue at zero


def _groups(lam: Complexes, tolerance: float, window: float) -> list[Ints]:
    """Single-linkage clusters; of two conjugate clusters only the upper one."""
    largest = float(np.max(np.abs(lam), initial=0.0))
    # a multiple eigenvalue at zero is split by round-off of the largest, or by less than the window resolves
    floor = max((SPLIT_BY_ROUND_OFF + 1e-3 * tolerance) * largest, tolerance / window)
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


# Coordinates from which on updated modes take a third of the time of a fresh eigenvalue problem where one contact
# differs, and the number of contacts that may differ. Measured alternating in one process: one contact 1.1 times as
# fast at 24 coordinates, 2.3 at 40, 3.1 at 52, 5.5 at 80; two contacts 1.6 at 52 and 2.7 at 80; four 1.0 and 1.5.
LEAST_COORDINATES, MOST_CHANGED = 52, 2


def neighbouring_modes(
    system: PiecewiseLinearSystem, neighbour: SimpleModes, phases_before: Ints, phases: Ints
) -> SimpleModes | None:
    """Modes of (q, q') in a contact state from those of another one.

    Undamped modes are computed anew: their eigenvalues have no real part, and round-off would give them one.

    Parameters
    ----------
    system : the structure.
    neighbour : modes with the phases ``phases_before``, one of each conjugate pair.
    phases_before, phases : (m,) of the contacts in the known state and in the new one.

    Returns
    -------
    modes : one of each conjugate pair; None where they have to be computed anew.
    """
    n, contacts = system.size, system.contacts
    damped = contacts.damped or bool(np.diag(system.damping).any())
    if not damped or system.coupled_by_damping or np.count_nonzero(phases_before != phases) > MOST_CHANGED:
        return None
    if any(
        contacts.couples_states(of) or contacts.sticks_rigidly(of).any() or contacts.presses(of)
        for of in (phases_before, phases)
    ):
        return None
    upper = np.flatnonzero(neighbour.eigenvalue.imag > 0.0)
    if upper.size < n:
        return None
    old, new = (contacts.arrays.force[np.arange(contacts.count), each] for each in (phases_before, phases))
    change = (new - old)[:, :2]
    upper = upper[np.argsort(neighbour.eigenvalue[upper].imag)]
    pole, rows = neighbour.eigenvalue[upper], neighbour.left[upper, n : 2 * n]  # vectors, one a row
    largest = np.argmax(np.abs(rows), axis=1)
    rows *= np.sqrt(neighbour.right[largest, upper] / rows[np.arange(n), largest])[:, None]
    for j in np.flatnonzero(change.any(axis=1)):
        p = rows @ contacts.shape[j]
        some = np.flatnonzero(p)
        found = _with_dyad(pole[some], rows[some], p[some], *change[j].tolist())
        if found is None:
            return None
        pole[some], rows[some] = found
        order = np.argsort(pole.imag)
        pole, rows = pole[order], rows[order]
    acting = np.flatnonzero(new[:, :2].any(axis=1))
    k, c, shape = new[acting, 0], new[acting, 1], contacts.shape[acting]
    left = (pole[:, None] + np.diag(system.damping)) * rows + ((rows @ shape.T) * c) @ shape
    modes = SimpleModes(np.hstack([rows, pole[:, None] * rows]).T, np.hstack([left, rows]), pole)
    return modes if _error(system, k, c, shape, modes) < LARGEST_ERROR else None


def _with_dyad(
    pole: Complexes, rows: Complexes, p: Complexes, k: float, c: float
) -> tuple[Complexes, Complexes] | None:
    """Modes after adding a spring k and a dashpot c along one direction.

    Parameters
    ----------
    pole : (n,) eigenvalues in the upper half-plane, sorted by their imaginary parts.
    rows, p : (n, n') their vectors u, and (n,) the components of these along the direction.
    k, c : N/m and N s/m.

    Returns
    -------
    pole, rows : the same after the change; None if some were not found.
    """
    found = _zeros(pole, p * p, k, c)
    if found is None:
        return None
    near, offset = found
    zero, pairs = pole[near] + offset, _Pairs.of(pole[near], offset, pole)
    apart = pole[:, None] - pole
    np.fill_diagonal(apart, 1.0)
    squares = np.prod(pairs.from_pole * pairs.from_conjugate.conj() / (apart.T * (pole - pole.conj()[:, None])), axis=0)
    exact = np.sqrt(squares / (k + c * pole))
    exact *= np.where((exact * p.conj()).real < 0.0, -1.0, 1.0)
    total = c / (k + c * zero) ** 2 + np.sum(
        (exact / pairs.from_pole) ** 2 + (exact.conj() / pairs.from_conjugate) ** 2, axis=1
    )
    moved = exact[:, None] * rows
    parts = np.concatenate([moved.real, (moved * pole.conj()[:, None]).real])
    factors = pairs.pair_sum / np.sqrt(total)[:, None]
    return zero, np.hstack([factors * zero[:, None], -factors]) @ parts


class _Pairs(NamedTuple):
    """Differences of numbers (m,) from poles (n,) and from their conjugates."""

    from_pole: Complexes  # (m, n)
    from_conjugate: Complexes  # (m, n)
    pair_sum: Complexes  # (m, n) 2 over their products

    @classmethod
    def of(cls, origin: Complexes, offset: Complexes, pole: Complexes) -> _Pairs:
        """Differences of numbers ``origin + offset``, given separately so that small ones keep their digits."""
        to = (origin[:, None] - pole) + offset[:, None]
        other = (origin[:, None] - pole.conj()) + offset[:, None]
        return cls(to, other, 2.0 / (to * other))


def _zeros(pole: Complexes, residue: Complexes, k: float, c: float) -> tuple[Ints, Complexes] | None:
    """Zeros of the secular function in the upper half-plane, as offsets from poles; None where not all were found.

    The poles (n,) are sorted by their imaginary parts.
    """
    n = pole.size
    if np.any(np.abs(np.diff(pole)) < 1e-10 * np.abs(pole[:-1])):
        return None  # two zeros coincide
    offset = -(k + c * pole) * residue
    space = np.diff(pole.imag, prepend=0.0, append=np.inf)
    offset *= np.minimum(1.0, 0.4 * np.where(offset.imag > 0.0, space[1:], space[:-1]) / np.abs(offset))
    near, last, turned = np.arange(n), np.full(n, np.inf), (residue * pole.conj()).real
    busy = np.arange(n)
    for _ in range(60):
        zeros = pole[near] + offset
        zero = zeros[busy]
        pairs = _Pairs.of(pole[near[busy]], offset[busy], pole)
        part = (zero[:, None] * residue.real - turned) * pairs.pair_sum
        inverse = (pairs.from_pole.real + 1j * zero.imag[:, None]) * pairs.pair_sum
        apart = zero[:, None] - zeros
        apart[np.arange(busy.size), busy] = np.inf
        others = (inverse - 1.0 / apart - 1.0 / (zero[:, None] - zeros.conj())).sum(axis=1)
        total, z = part.sum(axis=1), k + c * zero
        value = 1.0 + z * total
        step = -value / (c * total + z * (residue.real * pairs.pair_sum - part * inverse).sum(axis=1) + value * others)
        if not np.all(np.isfinite(step)):
            return None
        new = offset[busy] + step
        below = (pole[near[busy]] + new).imag < 0.0  # the conjugate is the zero that is still missing
        new = np.where(below, (pole[near[busy]] + new).conj() - pole[near[busy]], new)
        size = np.where(below, np.inf, np.abs(step))
        neighbours = np.clip(near[busy] + np.array([[0], [-1], [1]]), 0, n - 1)
        offsets = (pole[near[busy]] - pole[neighbours]) + new
        nearest = np.argmin(np.abs(offsets), axis=0), np.arange(busy.size)  # from which the distance is known best
        near[busy], offset[busy] = neighbours[nearest], offsets[nearest]
        scale = np.abs(offset[busy])
        done = (size <= LAST_STEP * scale) | ((size <= STEP_OF_ROUND_OFF * scale) & (size >= 0.5 * last[busy]))
        last[busy] = size
        busy = busy[~done]
        if not busy.size:
            return (near, offset) if np.all((pole[near] + offset).imag > 0.0) else None
    return None


def _error(system: PiecewiseLinearSystem, k: Floats, c: Floats, shape: Floats, modes: SimpleModes) -> float:
    """Relative error, in the norm of the energy, of two motions and their rates from the modes."""
    n = system.size
    omega = np.sqrt(np.maximum(system.stiffness, TINY))[:, None]
    motion = np.array([[1.0, 1.0], [1.0, -1.0]])[np.arange(2 * n) * (np.arange(2 * n) + 1) // 2 % 2]
    motion[:n] /= omega
    amplitude = modes.left @ motion
    both = 2.0 * (modes.right @ np.hstack([amplitude, amplitude * modes.eigenvalue[:, None]])).real
    back, rate = both[:, :2], both[:, 2:]
    q, v = motion[:n], motion[n:]
    force = system.stiffness[:, None] * q + np.diag(system.damping)[:, None] * v
    force += shape.T @ (k[:, None] * (shape @ q) + c[:, None] * (shape @ v))
    lost, late = back - motion, rate - np.vstack([v, -force])
    for part in (lost, late):
        part[:n] *= omega
    return float(max(np.abs(lost).max(), np.abs(late).max() / max(np.abs(force).max(), float(omega.max()))))
