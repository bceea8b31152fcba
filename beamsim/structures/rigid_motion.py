"""Rigid-body motions that supports allow."""

from __future__ import annotations

from typing import Any

import numpy as np

from beamsim.typing import Floats, Ints


def allowed_rigid_modes(motions: Floats, mass: Any, held: Ints) -> Floats:
    """(N, r) rigid-body modes that the supports allow, orthonormal in the mass matrix.

    Known by construction, so that their frequencies are zero and not round-off.

    Parameters
    ----------
    motions : (N, k) all rigid-body motions, on all degrees of freedom.
    mass : (N, N) mass matrix.
    held : degrees of freedom that supports hold or springs pull back.
    """
    allowed = motions
    if held.size:
        _, s, vt = np.linalg.svd(motions[held])
        allowed = motions @ vt[int(np.sum(s > 1e-9)) :].T
    return orthonormal_in_mass(allowed, mass) if allowed.shape[1] else allowed


def orthonormal_in_mass(vectors: Floats, mass: Any) -> Floats:
    """(N, r) the same space, orthonormal in the mass matrix, each vector less what those before it hold of it."""
    lower = np.linalg.cholesky(vectors.T @ (mass @ vectors))
    return np.asarray(np.linalg.solve(lower, vectors.T).T)
