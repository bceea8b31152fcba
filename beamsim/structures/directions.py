r"""Nodes with displacement systems of their own, as Nastran's field CD gives them, turned to the axes of the model.

With A the unit vectors of a node's system as rows, its displacements and rotations are :math:`u_{own} = A u`. Of all
rows :math:`u_{own} = T u`, and the matrices become :math:`T^T M T`, that of recovery :math:`R T`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from beamsim.errors import MethodError
from beamsim.matrix_files import DIRECTIONS, MODAL
from beamsim.scenario.matrices import DisplacementSystem
from beamsim.structures.named_matrices import DofTable, NamedMatrices
from beamsim.typing import Floats

ROUND_OFF = 1e-9  # of a unit vector


def along_the_axes(given: NamedMatrices, systems: Sequence[DisplacementSystem]) -> NamedMatrices:
    """The matrices with all directions along the axes of the model.

    Parameters
    ----------
    given : as the files have them; its table says which system each row has.
    systems : by their numbers.

    Returns
    -------
    NamedMatrices
        Its table keeps what its rows were, for directions of the nodes' own systems.

    Raises
    ------
    MethodError
        About ``dofs`` or ``systems``: a system is unknown, a node has two or lacks coordinates, or the directions
        that it has are not together some of the axes of the model.
    """
    table, known = given.table, {each.number: each for each in systems}
    if table.systems is None or not np.any(table.systems):
        return given
    blocks: dict[tuple[int, bool], list[int]] = {}
    for i, (node, direction) in enumerate(table.dofs):
        if table.systems[i] and direction != MODAL:
            blocks.setdefault((node, direction in DIRECTIONS[3:]), []).append(i)
    names, size = list(table.dofs), len(table.dofs)
    others = np.setdiff1d(np.arange(size), [i for rows in blocks.values() for i in rows])
    entries = [np.array([others, others, np.ones(others.size)])]
    for (node, turns), rows in blocks.items():
        along, axes = _block(table, node, rows, known)
        for i, axis in zip(rows, along, strict=True):
            names[i] = (node, DIRECTIONS[axis + 3 * turns])
        at, to = np.meshgrid(rows, rows, indexing="ij")
        entries.append(np.array([at.ravel(), to.ravel(), axes.ravel()]))
    row, column, value = np.hstack(entries)
    turn = csr_array((value, (row.astype(int), column.astype(int))), shape=(size, size))

    def turned(matrix: Any) -> Any:
        product = None if matrix is None else turn.T @ matrix @ turn
        return None if product is None else (0.5 * (product + product.T)).tocsc()

    return replace(
        given,
        table=DofTable(tuple(names), table.coordinates, turn=turn),
        mass=turned(given.mass), stiffness=turned(given.stiffness), damping=turned(given.damping),
        recovery=None if given.recovery is None else (given.recovery @ turn).tocsr(),
    )  # fmt: skip


def _block(
    table: DofTable, node: int, rows: Sequence[int], known: Mapping[int, DisplacementSystem]
) -> tuple[list[int], Floats]:
    """Axes of the model that the rows of a node become, 0 to 2 each, and (k, k) their shares in the rows as they were.

    Parameters
    ----------
    table : names, coordinates and systems of all rows.
    node, rows : its number, and its rows of displacements or of rotations.
    known : systems by number.

    Raises
    ------
    MethodError
        See `along_the_axes`.
    """
    assert table.systems is not None
    used = {int(table.systems[i]) for i in table.rows_of([node]) if table.dofs[i][1] != MODAL}
    if len(used) > 1 or not used <= known.keys():
        told = f"puts node {node} in {' and '.join(f'system {each}' for each in sorted(used))}"
        raise MethodError("dofs", f"{told}, but systems lists {', '.join(map(str, known)) or 'none'}",
                          "give each node one of the listed systems, or none")  # fmt: skip
    point = np.full(3, np.nan) if table.coordinates is None else table.coordinates[rows[0]]
    own = [DIRECTIONS.index(table.dofs[i][1]) % 3 for i in rows]
    axes = axes_at(known[used.pop()], point, node)[own]
    spanned = np.flatnonzero(np.abs(np.linalg.norm(axes, axis=0) - 1.0) < ROUND_OFF).tolist()
    if len(spanned) < len(own):
        raise MethodError(
            "dofs", f"gives node {node} only {', '.join(table.dofs[i][1] for i in rows)} of its system, which are "
            "not along axes of the model", "export all three translations, and rotations, of nodes with systems",
        )  # fmt: skip
    free = iter([axis for axis in spanned if axis not in own])
    along = [axis if axis in spanned else next(free) for axis in own]
    return along, axes[:, along]


def axes_at(system: DisplacementSystem, point: Floats, node: int) -> Floats:
    """(3, 3) unit vectors of a system at a point, as rows: radial, tangential and axial of a cylinder.

    On the axis of a cylindrical or spherical system they are those of its rectangular one.

    Parameters
    ----------
    system : of the scenario.
    point : (3,) of the node.
    node : its number, for the message.

    Returns
    -------
    (3, 3) array

    Raises
    ------
    MethodError
        About ``dofs``: the point is not known, and the system is not rectangular.
    """
    origin, on_axis, in_plane = np.array(system.points)
    z = (on_axis - origin) / np.linalg.norm(on_axis - origin)
    y = np.cross(z, in_plane - origin)
    y /= np.linalg.norm(y)
    axes = np.array([np.cross(y, z), y, z])
    if system.kind == "rectangular":
        return axes
    if not np.all(np.isfinite(point)):
        raise MethodError("dofs", f"has no coordinates of node {node}, which is in the {system.kind} system "
                          f"{system.number}", "give its x, y and z")  # fmt: skip
    along = axes @ (point - origin)
    beside = float(np.hypot(along[0], along[1]))
    if beside <= ROUND_OFF * max(float(np.linalg.norm(on_axis - origin)), float(np.linalg.norm(along))):
        return axes
    x, y = axes[:2].T @ along[:2] / beside, axes[:2].T @ [-along[1], along[0]] / beside
    if system.kind == "cylindrical":
        return np.array([x, y, z])
    up, out = np.array([along[2], beside]) / np.hypot(along[2], beside)
    return np.array([out * x + up * z, up * x - out * z, y])
