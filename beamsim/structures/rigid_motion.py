"""Rigid-body motions that supports allow."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.typing import Floats

# Stretches below this, with motions and rows of unit length, are none.
_NONE = 1e-10


def unstretched(motions: Floats, stretch: Floats, length: Floats | float = 1.0) -> Floats:
    """(k, r) combinations of rigid-body motions that what holds the structure allows.

    Known by construction, so that the frequencies of these motions are zero and not round-off.

    Parameters
    ----------
    motions : (N, k) all rigid-body motions, on all degrees of freedom.
    stretch : (c, k) how far each of them stretches what holds.
    length : (c,) of the rows that give the stretch.

    Returns
    -------
    (k, r) array
        Each motion that is left, by its shares of the k.
    """
    unit = np.linalg.norm(motions, axis=0)
    if not stretch.size:
        return np.diag(1 / unit)
    _, s, vt = np.linalg.svd(stretch / np.reshape(length, (-1, 1)) / unit)
    return np.asarray(vt[int(np.sum(s > _NONE)) :].T / unit[:, None])


def orthonormal_in_mass(vectors: Floats, mass: Any) -> Floats:
    """(N, r) the same space, orthonormal in the mass matrix, each vector less what those before it hold of it."""
    if not vectors.shape[1]:
        return vectors
    lower = np.linalg.cholesky(vectors.T @ (mass @ vectors))
    return np.asarray(np.linalg.solve(lower, vectors.T).T)
