"""Invariant subspaces made more exact: what they leave of a matrix between them, in extended precision.

With all right and left vectors X and Xi, ``E = Xi A X`` is block diagonal but for their errors. The couplings F with
``E_ii F_ij - F_ij E_jj = -E_ij`` take these away to second order: ``X (I + F)``, ``(I - F) Xi``. After G. W. Stewart,
SIAM Rev. 15 (1973), and Ogita and Aishima, Japan J. Indust. Appl. Math. 35 (2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamsim.typing import Complexes, Floats, Ints


class Subspaces(NamedTuple):
    """All of them; what A is between them is all but block diagonal."""

    right: Complexes  # X, (N, N)
    left: Complexes  # Xi, (N, N)
    matrix: Complexes  # Xi A X, (N, N)


def refined(A: Floats, right: Complexes, left: Complexes, groups: Sequence[Ints], scale: Floats) -> Subspaces | None:
    """Subspaces of A nearer to invariant ones; None where couplings are small already or do not decrease.

    What is gained is what numbers of NumPy's `longdouble` have more digits than others, on most computers three.

    Parameters
    ----------
    A : (N, N).
    right, left : (N, N) vectors in columns, and in rows.
    groups : numbers of vectors that belong together; those in no group are alone.
    scale : (N,) what couplings make of a state is judged in coordinates so many times as large as these.

    Returns
    -------
    Subspaces or None
        With the matrix A in them.
    """
    error = (scale[:, None] * right) @ _couplings(left @ (A @ right), groups) @ (left / scale)
    # 1e-12: of a state in another one, from couplings that stay
    if np.abs(error).max(initial=0.0) <= 1e-12:
        return None
    A, X, Xi = A.astype(np.longdouble), right.astype(np.clongdouble), left.astype(np.clongdouble)
    eye, last = np.eye(A.shape[0]), np.inf
    for _ in range(4):  # each squares the coupling
        Xi = Xi + (eye - Xi @ X) @ Xi
        E = Xi @ (A @ X)
        F = _couplings(E.astype(complex), groups)
        largest = float(np.abs(F).max())
        if not largest < 0.5 * min(last, 1.0):
            break
        X, Xi, last = X + X @ F, Xi - F @ Xi, largest
        # 1e-17: coupling from which on nothing is gained
        if largest <= 1e-17:
            break
    return Subspaces(*(part.astype(complex) for part in (X, Xi, E))) if np.isfinite(last) else None


def _couplings(E: Complexes, groups: Sequence[Ints]) -> Complexes:
    """F of the module's equation; zero within groups and between eigenvalues that are not told from each other."""
    values = np.diag(E)
    apart, size = values[None, :] - values[:, None], np.abs(values)
    # 1e-9: relative distance of eigenvalues that are not told from each other
    # 1e-15: of the largest eigenvalue
    alike = np.abs(apart) <= 1e-9 * np.maximum(size[:, None], size[None, :]) + 1e-15 * size.max()
    F = np.where(alike, 0.0, E / np.where(alike, 1.0, apart))
    alone = np.setdiff1d(np.arange(values.size), np.concatenate([*groups, np.zeros(0, dtype=np.int64)]))
    for i in groups:
        from scipy.linalg import solve_sylvester

        for j in (*alone[:, None], *(g for g in groups if g is not i)):
            F[np.ix_(i, j)] = solve_sylvester(E[np.ix_(i, i)], -E[np.ix_(j, j)], -E[np.ix_(i, j)])
            F[np.ix_(j, i)] = solve_sylvester(E[np.ix_(j, j)], -E[np.ix_(i, i)], -E[np.ix_(j, i)])
        F[np.ix_(i, i)] = 0.0
    return F
