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
    modes: list[Floats] = []
    for column in allowed.T:
        for done in modes:
            column = column - done * (done @ (mass @ column))
        modes.append(column / np.sqrt(column @ (mass @ column)))
    return np.array(modes).reshape(len(modes), motions.shape[0]).T
