r"""Rotation of nodes with their own displacement systems (Nastran's field CD) to the axes of the model.

With A the unit vectors of a node's system as rows, its displacements and rotations are :math:`u_{own} = A u`. For all
rows :math:`u_{own} = T u`; the matrices become :math:`T^T M T`, and that of recovery :math:`R T`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array, eye_array

from beamsim.dofs import DIRECTIONS, MODAL
from beamsim.errors import MethodError
from beamsim.scenario.matrices import DisplacementSystem
from beamsim.structures.named_matrices import NamedMatrices
from beamsim.typing import Floats

ROUND_OFF = 1e-9  # relative to a unit vector


def rotate_to_axes(matrices: NamedMatrices, systems: Sequence[DisplacementSystem]) -> NamedMatrices:
    """Matrices with all directions along the axes of the model.

    Parameters
    ----------
    matrices : as read from the files; the table gives the system of each row.
    systems : definitions of the systems.

    Returns
    -------
    NamedMatrices
        The table also keeps the original rows, for directions in the nodes' own systems.

    Raises
    ------
    MethodError
        About ``dofs``: a system is unknown, a node has two systems or no coordinates, or its directions in the
        system do not together span axes of the model.
    """
    table, known = matrices.table, {each.number: each for each in systems}
    if table.systems is None:
        return matrices
    blocks: dict[tuple[int, bool], list[int]] = {}
    for i, (node, direction) in enumerate(table.dofs):
        if table.systems[i] and direction != MODAL:
            blocks.setdefault((node, direction in DIRECTIONS[3:]), []).append(i)
    turn: Any = eye_array(len(table.dofs), format="lil")
    for (node, _), rows in blocks.items():
        used = sorted(set(table.systems[rows].tolist()))
        if len(used) > 1 or used[0] not in known:
            message = f"puts node {node} in system {' and '.join(map(str, used))}, but systems lists"
            raise MethodError("dofs", f"{message} {', '.join(map(str, known)) or 'none'}", "give it one of the listed")
        own = [DIRECTIONS.index(table.dofs[i][1]) % 3 for i in rows]
        point = np.full(3, np.nan) if table.coordinates is None else table.coordinates[rows[0]]
        axes = axes_at(known[used[0]], point, node)[np.ix_(own, own)]
        if np.abs(axes @ axes.T - np.eye(len(own))).max() > ROUND_OFF:
            message = f"gives node {node} only {', '.join(table.dofs[i][1] for i in rows)} of its system"
            raise MethodError("dofs", message, "export all three translations, and rotations, of nodes with systems")
        turn[np.ix_(rows, rows)] = axes
    turn = csr_array(turn)

    def rotate(matrix: Any) -> Any:
        product = None if matrix is None else turn.T @ matrix @ turn
        return None if product is None else (0.5 * (product + product.T)).tocsc()

    mass, stiffness, damping = (rotate(each) for each in (matrices.mass, matrices.stiffness, matrices.damping))
    recovery = None if matrices.recovery is None else (matrices.recovery @ turn).tocsr()
    places = None if matrices.rows is None else np.asarray(matrices.rows @ turn)
    table = replace(table, systems=None, to_file_systems=turn)
    return replace(
        matrices, table=table, mass=mass, stiffness=stiffness, damping=damping, recovery=recovery, rows=places
    )


def axes_at(system: DisplacementSystem, point: Floats, node: int) -> Floats:
    """(3, 3) unit vectors of a system at a point, as rows; for a cylinder radial, tangential and axial.

    On the axis of a cylindrical system they are those of its rectangular system.

    Parameters
    ----------
    system : definition of the system.
    point : (3,) coordinates of the node.
    node : number of the node, for the message.

    Returns
    -------
    (3, 3) array

    Raises
    ------
    MethodError
        About ``dofs``: the point is unknown and the system is not rectangular.
    """
    origin, on_axis, in_plane = np.array(system.points)
    z = (on_axis - origin) / np.linalg.norm(on_axis - origin)
    y = np.cross(z, in_plane - origin)
    y /= np.linalg.norm(y)
    axes = np.array([np.cross(y, z), y, z])
    if system.kind == "rectangular":
        return axes
    if not np.all(np.isfinite(point)):
        message = f"has no coordinates of node {node}, which is in the cylindrical system {system.number}"
        raise MethodError("dofs", message, "give its x, y and z")
    along = axes[:2] @ (point - origin)
    length = float(np.linalg.norm(along))
    if length <= ROUND_OFF * float(np.linalg.norm([point - origin, on_axis - origin])):
        return axes
    cosine, sine = along / length
    return np.asarray(np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ axes)
