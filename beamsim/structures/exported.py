r"""Matrices of a whole structure for other programs: joined bodies with named nodes, and Craig-Bampton models.

Degrees of freedom that joints couple keep as many names as they have independent motions. With :math:`u = T v` those of
all bodies, and S the rows that keep their names, the exported coordinates are :math:`u_S = T_S v`.

A Craig-Bampton model keeps the boundary degrees of freedom b, including the base, and modes :math:`\Phi` of the others,
i, with a fixed boundary,

.. math:: u_i = -K_{ii}^{-1} K_{ib} u_b + \Phi \eta

(R. R. Craig, M. C. C. Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6, 1968). With all modes it
is exact; its stiffness matrix does not couple the modes to the boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import csc_array, csr_array, diags_array, vstack
from scipy.sparse.linalg import splu

from beamsim.dofs import MODAL
from beamsim.errors import MethodError
from beamsim.structures.modes import lowest_eigenpairs
from beamsim.structures.named_matrices import DofTable, NamedDofs, NamedMatrices, with_base_node
from beamsim.structures.places import UPWARDS, Place
from beamsim.structures.structure import BodyStructure, Structure
from beamsim.structures.symmetric_lu import blocks_of, symmetric_lu
from beamsim.typing import Floats, Ints


def named_structure(structure: Structure) -> tuple[NamedMatrices, Any]:
    """Matrices of a structure with its base, and the map from rows of its degrees of freedom to named rows.

    Returns
    -------
    NamedMatrices
        The bodies have consecutive node numbers, in their order.
    (M, N) sparse
        ``map @ r`` converts a row r on the structure's degrees of freedom, such as that of a place.

    Raises
    ------
    MethodError
        If springs connect the structure to the ground, which does not move with the base.
    """

    if isinstance(structure, BodyStructure):
        named, back = structure.named_dofs, csr_array(diags_array(np.ones(structure.size)))
    else:
        if np.any(structure.base_load(UPWARDS)[1]):
            raise MethodError(
                "springs", "to the ground connect the structure to a fixed point, which a base node cannot represent",
                "leave them out, or make them joints to the base",
            )  # fmt: skip
        everything: Any = vstack([member.expansion for member in structure.members], format="csr")
        kept = _independent_rows(everything)
        names = _names([member.body for member in structure.members])
        named = NamedDofs(names.table.part(kept), names.scale[kept], names.influence[kept])
        chosen = everything[kept].tocsc()
        back = csr_array(splu(chosen).solve(np.eye(structure.size)))  # v = back u_S
        back.data[np.abs(back.data) < 1e-14] = 0.0
        back.eliminate_zeros()
    mass, stiffness = (
        (back.T @ matrix @ back).tocsc()
        for matrix in (structure.mass * structure.mass_scale, structure.stiffness * structure.stiffness_scale)
    )
    damping = None if structure.damping is None else (back.T @ structure.damping @ back).tocsc()
    total = sum(member.body.total_mass for member in structure.members)
    inertia = np.asarray(back.T @ (structure.mass_scale * structure.base_load(UPWARDS)[0]))
    given = with_base_node(named, mass, stiffness, damping, inertia, total)
    return given, diags_array(1 / named.scale) @ back.T


def _names(bodies: Sequence[BodyStructure]) -> NamedDofs:
    """Names of all bodies, with consecutive node numbers."""
    dofs, places, last = [], [], 0
    named = [body.named_dofs for body in bodies]
    for each in named:
        dofs += [(node + last if node else 0, direction) for node, direction in each.table.dofs]
        given = each.table.coordinates
        places.append(np.full((len(each.table.dofs), 3), np.nan) if given is None else given)
        last += int(each.table.nodes.max(initial=0))
    coordinates = np.vstack(places)
    return NamedDofs(
        DofTable(tuple(dofs), None if np.all(np.isnan(coordinates)) else coordinates),
        np.concatenate([each.scale for each in named]),
        np.concatenate([each.influence for each in named]),
    )


def _independent_rows(expansion: Any) -> Ints:
    """As many independent rows as there are columns; among rows coupled by joints those with the largest pivots."""
    by_column = expansion.tocsc()
    kept = []
    for columns in blocks_of(abs(by_column.T) @ abs(by_column)):
        block = by_column[:, columns]
        rows = np.unique(block.indices)
        kept.append(rows[qr(block.tocsr()[rows].toarray().T, pivoting=True, mode="r")[1][: columns.size]])
    return np.sort(np.concatenate(kept))


def boundary_rows(structure: Structure, matrices: NamedMatrices, named_row_map: Any, places: Sequence[Place]) -> Ints:
    """Rows of the named matrices at the places where something acts, and those of the base.

    Parameters
    ----------
    structure : the structure with the places.
    matrices, named_row_map : results of `named_structure`.
    places : places where something acts.

    Returns
    -------
    (b,) array
        Ascending.

    Raises
    ------
    MethodError
        If a place is not at a node.
    """
    rows = set(matrices.table.rows_of(matrices.base).tolist())
    for place in places:
        row = row_at(structure, named_row_map, place)
        if row is None:
            raise MethodError(
                "boundary", f"is not at a node: {place.label}",
                "change the number of elements, or give the body a node there",
            )  # fmt: skip
        rows.add(row)
    return np.array(sorted(rows), dtype=np.int64)


def row_at(structure: Structure, named_row_map: Any, place: Place) -> int | None:
    """Row of the named matrices for the motion of a place; None if no node has this direction.

    Parameters
    ----------
    structure : the structure with the place.
    named_row_map : (M, N) sparse, from `named_structure`.
    place : place on the structure.

    Returns
    -------
    int or None
        Index of the row.
    """
    return unit_row(np.asarray(named_row_map @ structure.row(place)))


def unit_row(factors: Floats) -> int | None:
    """Index of the only degree of freedom in factors (N,), if it is there with the factor 1; None otherwise."""
    left = factors.copy()
    largest = int(np.argmax(np.abs(left)))
    left[largest] -= 1.0
    return largest if np.abs(left).sum() <= 1e-9 else None


def craig_bampton(matrices: NamedMatrices, boundary: Ints, mode_count: int) -> NamedMatrices:
    """Craig-Bampton model with a number of fixed-boundary modes (or all of them) and the boundary rows.

    Parameters
    ----------
    matrices : matrices of all rows.
    boundary : (b,) boundary rows.
    mode_count : number of modes.

    Returns
    -------
    NamedMatrices
        Modal coordinates first, then the boundary.

    Raises
    ------
    MethodError
        If there is no boundary, or it does not restrain the structure.
    """
    size = len(matrices.table.dofs)
    inner = np.setdiff1d(np.arange(size), boundary)
    if not boundary.size or not inner.size:
        raise MethodError("boundary", "is empty" if inner.size else "fixes every degree of freedom", "name places")
    stiffness, mass = (matrix.tocsr()[inner][:, inner].tocsc() for matrix in (matrices.stiffness, matrices.mass))
    try:
        factors = symmetric_lu(stiffness)
        held = bool(np.all(factors.pivots > 1e-12))
    except RuntimeError:
        held = False
    if not held:
        raise MethodError(
            "boundary", "does not restrain the structure: it can move without force",
            "let more places act on it: snubbers, springs, joints, probes",
        )  # fmt: skip
    modes = lowest_eigenpairs(stiffness, mass, min(mode_count, inner.size), 0.0, factors)[1]
    basis = np.zeros((size, modes.shape[1] + boundary.size))
    basis[inner, : modes.shape[1]] = modes
    basis[boundary, modes.shape[1] + np.arange(boundary.size)] = 1.0
    coupling = matrices.stiffness.tocsr()[inner][:, boundary].toarray()
    follow = factors.solve(-coupling)
    follow += factors.solve(-(coupling + stiffness @ follow))  # one refinement step
    basis[inner, modes.shape[1] :] = follow
    table = matrices.table.part(boundary)
    coordinates = table.coordinates
    if coordinates is not None:
        coordinates = np.vstack([np.full((modes.shape[1], 3), np.nan), coordinates])
    return NamedMatrices(
        DofTable((*((0, MODAL),) * modes.shape[1], *table.dofs), coordinates),
        _project(matrices.mass, basis, modes.shape[1]),
        _project(matrices.stiffness, basis, modes.shape[1], coupled=False),
        None if matrices.damping is None else _project(matrices.damping, basis),
        matrices.base,
        matrices.direction,
    )


def _project(matrix: Any, basis: Floats, modes: int = 0, *, coupled: bool = True) -> Any:
    """The matrix in a basis, symmetric, with exact zeros between modes and, if not ``coupled``, to the boundary."""
    projected = basis.T @ (matrix @ basis)
    projected = (projected + projected.T) / 2
    projected[:modes, :modes] = np.diag(np.diag(projected)[:modes])
    if not coupled:
        projected[:modes, modes:] = projected[modes:, :modes] = 0.0
    return csc_array(projected)
