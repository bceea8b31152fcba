r"""Bodies that joints and springs make one structure.

A joint that holds is a linear constraint :math:`G u = 0` on the degrees of freedom u of all bodies. It is eliminated:
:math:`u = T v` with an orthonormal, sparse basis T of the null space of G, so that the matrices of the joined structure
are :math:`T^T M T` and :math:`T^T K T`, without a penalty or a multiplier. Springs and dashpots of joints add their
rows to K and C. All coordinates are relative to the base, so a place that is joined to the base moves with it exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, vstack

from beamsim.structures.modes import orthonormal_in_mass, unstretched
from beamsim.structures.several import SeveralBodies, assemble_side_by_side
from beamsim.structures.structure import BodyStructure
from beamsim.structures.supports import Coupling
from beamsim.structures.symmetric_lu import blocks_of
from beamsim.typing import Floats


def join(
    bodies: Sequence[BodyStructure], couplings: Sequence[Coupling], origins: Mapping[str, float] | None = None
) -> SeveralBodies:
    """One structure of bodies that are coupled; ``origins`` are where they begin on their common axis, m.

    Parameters
    ----------
    bodies : all that are coupled.
    couplings : joints and springs, direction by direction.
    origins : m, where bodies begin on their common axis.

    Returns
    -------
    SeveralBodies
        On the dofs that the constraints leave.
    """
    apart = assemble_side_by_side(bodies)
    held = apart.rows([c.site for c in couplings if c.stiffness is None])
    basis = null_space_basis(held)
    springs = [c for c in couplings if c.stiffness]
    rows = apart.rows([c.site for c in springs])
    stiffness = np.array([c.stiffness for c in springs], dtype=float)
    dashpots = [c for c in couplings if c.dashpot]
    damping: Any = csr_array((apart.size, apart.size)) if apart.damping is None else apart.damping
    beside = csr_array(apart.rows([c.site for c in dashpots]))
    damping = damping + beside.T @ (beside * np.array([c.dashpot for c in dashpots])[:, None])
    scaled = csr_array(rows * np.sqrt(stiffness / apart.stiffness_scale)[:, None])
    mass = (basis.T @ (apart.mass @ basis)).tocsc()
    holding = np.vstack([held, rows])
    holding = holding[np.any(holding != 0, axis=1)]
    kept = unstretched(apart.rigid, holding @ apart.rigid, np.linalg.norm(holding, axis=1))
    return SeveralBodies(
        name="",
        mass=mass,
        factor=vstack([apart.factor, scaled], format="csr") @ basis,
        damping=(basis.T @ damping @ basis).tocsc() if apart.damping is not None or dashpots else None,
        rigid=orthonormal_in_mass(basis.T @ (apart.rigid @ kept), mass),
        mass_scale=apart.mass_scale,
        stiffness_scale=apart.stiffness_scale,
        expansions=tuple((member.body, member.expansion @ basis) for member in apart.members),
        couplings=tuple(couplings),
        origins=tuple((origins or {}).items()),
    )


def null_space_basis(rows: Floats) -> Any:
    """(N, N - rank) sparse orthonormal basis of the null space of constraints (c, N).

    Constraints without a common degree of freedom are treated apart, which keeps the basis sparse: a column outside
    all constraints is a unit vector.
    """
    size = rows.shape[1]
    pattern = csr_array(rows != 0, dtype=float)
    constrained = np.any(rows != 0, axis=0)
    free = np.flatnonzero(~constrained)
    i, j, values = [free], [np.arange(free.size)], [np.ones(free.size)]
    count = free.size
    for dofs in blocks_of(pattern.T @ pattern):
        if not constrained[dofs[0]]:
            continue
        constraints = rows[np.any(rows[:, dofs] != 0, axis=1)][:, dofs]
        _, s, vt = np.linalg.svd(constraints / np.linalg.norm(constraints, axis=1, keepdims=True))
        # smaller singular values are those of constraints that say the same twice
        null = vt[int(np.sum(s > 1e-10 * s[0])) :].T
        i.append(np.repeat(dofs, null.shape[1]))
        j.append(np.tile(count + np.arange(null.shape[1]), dofs.size))
        values.append(null.ravel())
        count += null.shape[1]
    entries = (np.concatenate(values), (np.concatenate(i), np.concatenate(j)))
    return coo_array(entries, shape=(size, count)).tocsr()
