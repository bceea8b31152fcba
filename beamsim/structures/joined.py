r"""Bodies that joints and springs make one structure.

A joint that holds is a linear constraint :math:`G u = 0` on the degrees of freedom u of all bodies. It is eliminated:
:math:`u = T v` with an orthonormal, sparse basis T of the null space of G, so that the matrices of the joined structure
are :math:`T^T M T` and :math:`T^T K T`, without a penalty or a multiplier. Springs and dashpots of joints add their
rows to K and C. All coordinates are relative to the base, so a place that is joined to the base moves with it exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.rigid_motion import orthonormal_in_mass
from beamsim.structures.several import SeveralBodies, assemble_side_by_side
from beamsim.structures.structure import BodyStructure, Coupling
from beamsim.typing import Floats

# Singular values of constraints below this, beside the largest, come from constraints that say the same twice.
_DEPENDENT = 1e-10


@dataclass(frozen=True)
class JoinedBodies(SeveralBodies):
    """Bodies and what couples them; its modes are those of the whole."""

    coupled_by: tuple[Coupling, ...]

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Joints and springs, direction by direction."""
        return self.coupled_by

    @cached_property
    def most_modes(self) -> int | None:
        """Modes up to the frequency that every body's discretisation carries; None where all of them are."""
        bodies = [member.body for member in self.members]
        if all(body.most_modes is None for body in bodies):
            return None
        highest = min(_carried(body) for body in bodies if body.most_modes is not None)
        if np.isinf(highest):
            return None
        counts = [min(body.frequency_count(highest / body.frequency_scale), body.size) for body in bodies]
        return max(sum(counts), 1)


def _carried(body: BodyStructure) -> float:
    """Angular frequency, rad/s, below which a body has as many modes as its discretisation carries; inf for all."""
    assert body.most_modes is not None
    low, high = 0.0, 1.0
    while (count := body.frequency_count(high)) <= body.most_modes:
        if count >= body.size:
            return np.inf
        low, high = high, 2 * high
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if body.frequency_count(middle) <= body.most_modes else (low, middle)
    return low * body.frequency_scale


def join(
    bodies: Sequence[BodyStructure], couplings: Sequence[Coupling], origins: Mapping[str, float] | None = None
) -> JoinedBodies:
    """One structure of bodies that are coupled; ``origins`` are where they begin on their common axis, m."""
    from scipy.sparse import csr_array, vstack

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
    pulls = np.where([c.to_ground for c in springs], stiffness, 0.0) @ rows if springs else np.zeros(apart.size)
    scaled = csr_array(rows * np.sqrt(stiffness / apart.stiffness_scale)[:, None])
    mass = (basis.T @ (apart.mass @ basis)).tocsc()
    return JoinedBodies(
        name="",
        mass=mass,
        factor=vstack([apart.factor, scaled], format="csr") @ basis,
        damping=(basis.T @ damping @ basis).tocsc() if apart.damping is not None or dashpots else None,
        inertia=basis.T @ apart.inertia,
        ground=basis.T @ (apart.ground - pulls),
        rigid=_rigid_modes(mass, basis.T @ apart.rigid, apart.rigid, np.vstack([held, rows])),
        mass_scale=apart.mass_scale,
        stiffness_scale=apart.stiffness_scale,
        deflection_dofs=np.zeros(0, dtype=np.int64),
        expansions=tuple((member.body, member.expansion @ basis) for member in apart.members),
        coupled_by=tuple(couplings),
        origins=tuple((origins or {}).items()),
    )


def null_space_basis(rows: Floats) -> Any:
    """(N, N - rank) sparse orthonormal basis of the null space of constraints (c, N).

    Constraints without a common degree of freedom are treated apart, which keeps the basis sparse: a column outside
    all constraints is a unit vector.
    """
    from scipy.sparse import coo_array, csr_array
    from scipy.sparse.csgraph import connected_components

    size = rows.shape[1]
    pattern = csr_array(rows != 0, dtype=float)
    _, label = connected_components(pattern.T @ pattern, directed=False)
    constrained = np.any(rows != 0, axis=0)
    free = np.flatnonzero(~constrained)
    i, j, values = [free], [np.arange(free.size)], [np.ones(free.size)]
    count = free.size
    for group in np.unique(label[constrained]):
        dofs = np.flatnonzero(constrained & (label == group))
        constraints = rows[np.any(rows[:, dofs] != 0, axis=1)][:, dofs]
        _, s, vt = np.linalg.svd(constraints / np.linalg.norm(constraints, axis=1, keepdims=True))
        null = vt[int(np.sum(s > _DEPENDENT * s[0])) :].T
        i.append(np.repeat(dofs, null.shape[1]))
        j.append(np.tile(count + np.arange(null.shape[1]), dofs.size))
        values.append(null.ravel())
        count += null.shape[1]
    entries = (np.concatenate(values), (np.concatenate(i), np.concatenate(j)))
    return coo_array(entries, shape=(size, count)).tocsr()


def _rigid_modes(mass: Any, rigid: Floats, apart: Floats, rows: Floats) -> Floats:
    """(N, r) rigid-body modes of the joined structure, orthonormal in its mass matrix.

    Those motions of the bodies as rigid ones that stretch nothing; known by construction, so that their frequencies
    are zero and not round-off.

    Parameters
    ----------
    rigid, apart : (N, q) and (N of the bodies apart, q) rigid-body modes of the bodies.
    rows : (c, N of the bodies apart) what constraints and springs hold.
    """
    if not apart.shape[1]:
        return rigid
    if rows.shape[0]:
        unit = np.linalg.norm(apart, axis=0)
        length = np.linalg.norm(rows, axis=1, keepdims=True)
        stretch = rows / np.where(length > 0, length, 1.0) @ (apart / unit)
        _, s, vt = np.linalg.svd(stretch)
        free = vt[int(np.sum(s > _DEPENDENT)) :].T / unit[:, None]
        rigid = rigid @ free
    return orthonormal_in_mass(rigid, mass) if rigid.shape[1] else rigid
