"""A structure before reduction: sparse, scaled, nothing modal yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.structures.mesh import Mesh


@dataclass(frozen=True)
class FullModel:
    """M u'' + C u' + K u = f on the N degrees of freedom that the supports leave.

    Every degree of freedom is a deflection in metres. M and K are scaled: the physical matrices
    are ``mass_scale * mass`` and ``stiffness_scale * factor.T @ factor``.
    """

    mass: Any  # (N, N) sparse
    factor: Any  # (p, N) sparse B with K = B^T B
    damping: Any  # (N, N) sparse, N s/m (physical): dashpots or uniform viscous damping; None without
    inertia: Floats  # (N,) (M_full r) on the free dofs, r = 1 on every deflection, before the supports were applied
    ground: Floats  # (N,) N/m (physical): force on each dof for a unit displacement of the ground
    rigid: Floats  # (N, r) rigid-body modes, orthonormal in `mass`
    mass_scale: float  # kg
    stiffness_scale: float  # N/m
    deflection: Callable[[float], Floats]  # position (m, or mass number) -> (N,) row that gives the deflection
    frequency_count: Callable[[float], int]  # bound on the number of modes below scaled omega
    deflection_dofs: Ints  # dofs that are deflections, left to right: they fix the sign of modes
    free: Ints  # (N,) which of the unsupported structure's dofs are left
    mesh: Mesh | None = None  # None for a chain

    @property
    def size(self) -> int:
        """N."""
        return int(self.inertia.size)

    @property
    def frequency_scale(self) -> float:
        """Physical over scaled angular frequency, rad/s."""
        return float(np.sqrt(self.stiffness_scale / self.mass_scale))

    def rows(self, positions: object) -> Floats:
        """(m, N) deflection rows at m positions."""
        rows = [self.deflection(float(x)) for x in positions]  # type: ignore[attr-defined]
        return np.array(rows).reshape(len(rows), self.size)
