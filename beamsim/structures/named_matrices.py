r"""Matrices of a body for other programs, with a node for its base.

The coordinates q of a body are relative to its base. With the absolute displacements :math:`u = q + r d` the base's
displacement d becomes a degree of freedom of its own,

.. math:: M = \begin{pmatrix} M_{qq} & L - M_{qq} r \\ \cdot & r^T M_{qq} r - 2 r^T L + m \end{pmatrix}, \quad
    K = \begin{pmatrix} K_{qq} & -K_{qq} r \\ \cdot & r^T K_{qq} r \end{pmatrix},

with L the inertia under a motion of the base and m the mass of the body.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import block_array, csc_array, diags_array

from beamsim.structures.dof_table import DofTable, NamedDofs
from beamsim.typing import Floats


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
    recovery: Any = None  # (k, N) sparse: other quantities, by unit of each degree of freedom; None without
    time_unit: float = 1.0  # s, of the velocities and accelerations that the recovery matrix takes
    units: str = ""  # of the files that they were read from


def moves_freely(stiffness: Any, motion: Floats, within: float = 1e-6) -> bool:
    """Whether the forces of a motion are round-off beside those that the entries of K would give one by one.

    Parameters
    ----------
    stiffness : (N, N) sparse K.
    motion : (N,).
    within : what counts as round-off.

    Returns
    -------
    bool
    """
    return bool(np.abs(stiffness @ motion).max() <= within * (abs(stiffness) @ np.abs(motion)).max())


def with_base_node(
    named: NamedDofs, mass: Any, stiffness: Any, damping: Any, inertia: Floats, total_mass: float
) -> NamedMatrices:
    """Matrices of a body on its supports, which move with a node of their own, the last one; none without supports.

    Parameters
    ----------
    named : names and units of the degrees of freedom.
    mass, stiffness, damping : (N, N) sparse, physical, for the degrees of freedom as the body has them; damping may be
        None, and acts on motion relative to the base.
    inertia : (N,) kg under a unit acceleration of the base.
    total_mass : kg, with what the supports hold.

    Returns
    -------
    NamedMatrices
        Absolute displacements.
    """
    physical: Any = diags_array(1 / named.scale)
    mass, stiffness = (physical @ matrix @ physical for matrix in (mass, stiffness))
    damping = None if damping is None else physical @ damping @ physical
    load = inertia / named.scale
    r = named.influence
    tiny = 1e-9  # round-off
    if moves_freely(stiffness, r, tiny) and np.abs(load - mass @ r).max() <= tiny * np.abs(load).max():
        return NamedMatrices(named.table, mass, stiffness, damping, ())
    base = int(named.table.nodes.max()) + 1
    places = named.table.coordinates
    return NamedMatrices(
        DofTable((*named.table.dofs, (base, "z")), None if places is None else np.vstack([places, np.zeros(3)])),
        _with_base(mass, load - mass @ r, float(r @ (mass @ r) - 2 * r @ load + total_mass)),
        _with_base(stiffness, -(stiffness @ r), float(r @ (stiffness @ r))),
        None if damping is None else _with_base(damping, -(damping @ r), float(r @ (damping @ r))),
        (base,),
    )


def _with_base(matrix: Any, column: Floats, corner: float) -> Any:
    """The matrix with one more row and column."""
    beside = csc_array(column[:, None])
    return block_array([[matrix, beside], [beside.T, csc_array([[corner]])]], format="csc")
