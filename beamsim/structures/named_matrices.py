r"""Matrices of a body for other programs, with a node for its base.

The coordinates q of a body are relative to its base. With the absolute displacements :math:`u = q + r d` the base's
displacement d becomes a degree of freedom of its own,

.. math:: M = \begin{pmatrix} M_{qq} & L - M_{qq} r \\ \cdot & r^T M_{qq} r - 2 r^T L + m \end{pmatrix}, \quad
    K = \begin{pmatrix} K_{qq} & -K_{qq} r \\ \cdot & r^T K_{qq} r \end{pmatrix},

with L the inertia under a motion of the base and m the mass of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from beamsim.structures.dof_table import DofTable, NamedDofs
from beamsim.typing import Floats

_ROUND_OFF = 1e-9


@dataclass(frozen=True)
class NamedMatrices:
    """Matrices in SI units and the names of their rows."""

    table: DofTable
    mass: Any  # (N, N) sparse, kg
    stiffness: Any  # (N, N) sparse, N/m
    damping: Any  # (N, N) sparse, N s/m: dashpots and viscous damping; None without
    base: tuple[int, ...]  # nodes that move with the base; none where nothing does
    direction: str = "z"  # in which the base moves
    remarks: tuple[str, ...] = ()  # what was done to the matrices of files


class ScaledBody(Protocol):
    """What is taken of a body: its matrices in scaled units, and the names of its degrees of freedom."""

    @property
    def mass(self) -> Any:
        """(n, n) sparse, scaled."""

    @property
    def stiffness(self) -> Any:
        """(n, n) sparse, scaled."""

    @property
    def damping(self) -> Any:
        """(n, n) sparse, N s/m, or None."""

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes and directions of the degrees of freedom."""

    @property
    def mass_scale(self) -> float:
        """kg a unit of the scaled mass."""

    @property
    def stiffness_scale(self) -> float:
        """N/m a unit of the scaled stiffness."""

    @property
    def inertia(self) -> Floats:
        """(n,) scaled load of a unit acceleration of the base."""

    @property
    def total_mass(self) -> float:
        """Mass of the body, kg."""


def with_base_node(body: ScaledBody) -> NamedMatrices:
    """Matrices of a body on its supports, which move with a node of their own, the last one; none without supports."""
    from scipy.sparse import diags_array

    named = body.named_dofs
    physical: Any = diags_array(1 / named.scale)
    mass = body.mass_scale * (physical @ body.mass @ physical)
    stiffness = body.stiffness_scale * (physical @ body.stiffness @ physical)
    load = body.mass_scale * body.inertia / named.scale
    r = named.influence
    free = np.abs(stiffness @ r).max() <= _ROUND_OFF * (abs(stiffness) @ np.abs(r)).max()
    if free and np.abs(load - mass @ r).max() <= _ROUND_OFF * np.abs(load).max():
        viscous = None if body.damping is None else physical @ body.damping @ physical
        return NamedMatrices(named.table, mass, stiffness, viscous, ())
    base_mass = float(r @ (mass @ r) - 2 * r @ load + body.total_mass)
    damping = None
    if body.damping is not None:
        damping = physical @ body.damping @ physical
        damping = _with_base(damping, np.zeros(r.size), 0.0)
    base = int(named.table.nodes.max()) + 1
    places = named.table.coordinates
    return NamedMatrices(
        DofTable((*named.table.dofs, (base, "z")), None if places is None else np.vstack([places, np.zeros(3)])),
        _with_base(mass, load - mass @ r, base_mass),
        _with_base(stiffness, -(stiffness @ r), float(r @ (stiffness @ r))),
        damping,
        (base,),
    )


def _with_base(matrix: Any, column: Floats, corner: float) -> Any:
    """The matrix with one more row and column."""
    from scipy.sparse import block_array, csc_array

    beside = csc_array(column[:, None])
    return block_array([[matrix, beside], [beside.T, csc_array([[corner]])]], format="csc")
