r"""Preparation of matrices from other programs: checks, symmetry, condensation of massless motions, base.

With b the degrees of freedom that move with the base and q the others, the static influence of the base is
:math:`R_q = -K_{qq}^{-1} K_{qb} R_b`, exact for a rigid motion :math:`R_b` and for fixed-interface (Craig-Bampton)
modes, whose rows are zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import block_diag, csc_array, csr_array, eye_array, hstack

from beamsim.dofs import MODAL, Dof
from beamsim.errors import MethodError
from beamsim.matrix_files import FileMatrix, read_matrix
from beamsim.scenario.matrices import MatricesBody, RecoverySource, name_of, sizes_of
from beamsim.structures.directions import rotate_to_axes
from beamsim.structures.named_matrices import (
    TRANSLATIONS,
    DofTable,
    NamedMatrices,
    doubtful_units,
    in_si_units,
    moves_freely,
    read_dof_table,
)
from beamsim.structures.places import ROTATIONS, BaseDirection
from beamsim.structures.symmetric_lu import blocks_of, symmetric_lu
from beamsim.typing import Floats, Ints

# Asymmetry relative to the largest entry that single precision or truncated digits explain.
ROUND_OFF = 1e-6
# Relative to neighbouring masses; smaller masses count as zero.
MASSLESS = 1e-11
# In the units of the file; products of several entries must not overflow.
LARGEST_ENTRY = 1e30


def read_matrices_of(section: MatricesBody) -> NamedMatrices:
    """Read the matrices of a body, check them and make them symmetric.

    Raises
    ------
    MethodError
        About a key of the body.
    """
    read = {key: _read(key, source) for key, source in section.sources.items()}
    table = _table(section, read)
    remarks: list[str] = []
    sizes = sizes_of(section.units)
    named = {key: _in_order(key, matrix, table) for key, matrix in read.items()}
    mass, stiffness, damping = named["mass"], named["stiffness"], named.get("viscous")
    if np.iscomplexobj(mass):
        raise MethodError("mass", "is complex", "give a real mass matrix")
    structural = named.get("structural_damping")
    if np.iscomplexobj(stiffness):
        structural = stiffness.imag if structural is None else structural
        stiffness = stiffness.real
        if section.structural_damping is None and np.any(structural.data):
            raise MethodError(
                "stiffness", "is complex: structural damping has no equivalent in the time domain",
                "convert it at a frequency, structural_damping: {frequency: 50 Hz}, or give a real matrix",
            )  # fmt: skip
    elif section.structural_damping is not None and structural is None:
        raise MethodError(
            "structural_damping", "names no file, and the stiffness matrix is real", "give file: and name:"
        )
    given = {"mass": mass, "stiffness": stiffness, "viscous": damping, "structural_damping": structural}
    mass, stiffness, damping, structural = (
        None if matrix is None else _symmetric(key, matrix, table, remarks) for key, matrix in given.items()
    )
    if section.structural_damping is not None and structural is not None:
        frequency = section.structural_damping.frequency
        equivalent = structural / (2 * np.pi * frequency * sizes.time)
        damping = equivalent if damping is None else damping + equivalent
        remarks.append(f"structural damping acts as viscous damping that has the same effect at {frequency:g} Hz alone")
    _check_diagonals(mass, stiffness, table)
    recovery = None if section.recovery is None else _recovery(section.recovery, table)
    rows = _further_rows(section, table)
    held = table.rows_of(() if section.base == "free" else section.base.nodes)
    if not isinstance(section.stiffness, tuple):
        _demand_restrained(mass, stiffness, table, held)
    used = _used_rows((mass, stiffness, damping), recovery, table)
    if used.size < len(table.dofs):
        remarks.append(f"rows without mass and stiffness were left out: {len(table.dofs) - used.size}")
    mass, stiffness, damping = (
        None if matrix is None else matrix[used][:, used].tocsc() for matrix in (mass, stiffness, damping)
    )
    as_written = NamedMatrices(
        table.part(used), mass, stiffness, damping, (), units=name_of(section.units),
        recovery=None if recovery is None else recovery[:, used], rows=None if rows is None else rows[:, used],
    )  # fmt: skip
    converted = in_si_units(rotate_to_axes(as_written, section.systems), sizes)
    remarks += doubtful_units(converted, section.units)
    return replace(converted, remarks=tuple(remarks))


def _demand_restrained(mass: Any, stiffness: Any, table: DofTable, base_rows: Ints) -> None:
    """Refuse rows of files with mass and no stiffness, but for those of the base, as of a Craig-Bampton model."""
    if not np.any(stiffness.data):
        raise MethodError("stiffness", "is zero", "give the stiffness matrix of the model")
    empty, massive = (np.asarray(abs(matrix).sum(axis=1)).ravel() for matrix in (stiffness, mass))
    loose = np.setdiff1d(np.flatnonzero((empty == 0.0) & (massive > 0.0)), base_rows)
    if loose.size:
        node, direction = table.dofs[int(loose[0])]
        others = f" and {loose.size - 1} more" if loose.size > 1 else ""
        raise MethodError(
            "stiffness", f"is zero at node {node} {direction}{others}, which has mass: nothing restrains it",
            "constrain it in the model that writes the matrices, or connect it there by a spring",
        )  # fmt: skip


def _used_rows(matrices: Sequence[Any], recovery: Any, table: DofTable) -> Ints:
    """Rows with a nonzero entry in some matrix; programs write zero rows for fixed degrees of freedom.

    Parameters
    ----------
    matrices : (N, N) sparse mass, stiffness and damping; None where there is none.
    recovery : (k, N) sparse, or None.
    table : names of the rows.

    Returns
    -------
    (n,) indices of rows.

    Raises
    ------
    MethodError
        If an omitted row is needed for recovery.
    """
    entries = [np.asarray(abs(m).sum(axis=1)).ravel() for m in matrices if m is not None]
    used = np.flatnonzero(np.any(np.array(entries) > 0.0, axis=0))
    if recovery is not None and used.size < len(table.dofs):
        lost = np.setdiff1d(np.unique(recovery.tocoo().col[recovery.tocoo().data != 0.0]), used)
        if lost.size:
            node, direction = table.dofs[int(lost[0])]
            raise MethodError(
                "recovery", f"has a column of node {node} {direction}, which has neither mass nor stiffness",
                "leave that column zero, or constrain the degree of freedom in the model that writes the matrices",
            )  # fmt: skip
    return used


def _further_rows(section: MatricesBody, table: DofTable) -> Floats | None:
    """(k, N) factors of the section's further places; None if there are none."""
    size = len(table.dofs)
    for name, factors in section.rows.items():
        if len(factors) != size:
            message = f"has {len(factors)} factors, and the matrices have {size} rows"
            raise MethodError(f"rows.{name}", message, "give a factor for each degree of freedom")
    return np.array(list(section.rows.values())) if section.rows else None


def _recovery(source: RecoverySource, table: DofTable) -> Any:
    """(rows, N) sparse recovery matrix, with columns in the order of the table."""
    matrix = _of_file("recovery", source)
    values = csr_array(matrix.values)
    if np.iscomplexobj(values):
        raise MethodError("recovery", "is complex", "give a real matrix")
    size = len(table.dofs)
    if matrix.columns is not None:
        at = _placed("recovery", matrix.columns, table)
        entries = values.tocoo()
        values = csr_array((entries.data, (entries.row, at[entries.col])), shape=(values.shape[0], size))
    if values.shape != (len(source.rows), size):
        rows, columns = values.shape
        raise MethodError(
            "recovery", f"has {rows} rows and {columns} columns, but {len(source.rows)} rows are named and there are "
            f"{size} degrees of freedom", "name each row, and give a column for each row of the mass matrix",
        )  # fmt: skip
    return values


def _read(key: str, source: Any) -> FileMatrix:
    matrix = FileMatrix(key, csc_array(np.array(source))) if isinstance(source, tuple) else _of_file(key, source)
    if matrix.values.shape[0] != matrix.values.shape[1]:
        rows, columns = matrix.values.shape
        raise MethodError(key, f"has {rows} rows and {columns} columns", "give a square matrix")
    return matrix


def _of_file(key: str, source: Any) -> FileMatrix:
    try:
        matrix = read_matrix(Path(source.file), source.name)
    except MethodError as error:
        raise MethodError(f"{key}.{error.about}", error.message, error.remedy) from None
    if not np.all(np.isfinite(matrix.values.data)):
        raise MethodError(key, "has entries that are not finite", "check the analysis that wrote the file")
    if (largest := float(np.abs(matrix.values.data).max(initial=0.0))) > LARGEST_ENTRY:
        message = f"has an entry of {largest:.3g}, and takes entries up to {LARGEST_ENTRY:g}"
        raise MethodError(key, message, "check the analysis that wrote the file")
    return matrix


def _table(section: MatricesBody, file_matrices: dict[str, FileMatrix]) -> DofTable:
    """Names of the rows, from the table or from the files."""
    if section.dofs is not None:
        table = read_dof_table(Path(section.dofs.file), sizes_of(section.units).length, section.dofs.decimal)
        for key, matrix in file_matrices.items():
            if matrix.rows is None and matrix.values.shape[0] != len(table.dofs):
                raise MethodError(
                    "dofs", f"has {len(table.dofs)} rows, but the matrix {key} has {matrix.values.shape[0]}",
                    "give a line for each row, in the order of the rows, and none for those that were constrained",
                )  # fmt: skip
        return table
    sizes = {key: matrix.values.shape[0] for key, matrix in file_matrices.items() if matrix.rows is None}
    if sizes:
        if len(set(sizes.values())) > 1:
            raise MethodError(
                min(sizes, key=lambda key: sizes[key]),
                "and the others differ in size: " + ", ".join(f"{key} has {n} rows" for key, n in sizes.items()),
                "export all matrices from the same set of degrees of freedom",
            )
        if isinstance(section.mass, tuple):
            return DofTable(tuple((i + 1, "z") for i in range(len(section.mass))))
        raise MethodError("dofs", "is missing: the files do not name their rows", "give a table node,direction[,x,y,z]")
    together: dict[Dof, None] = {}
    for matrix in file_matrices.values():
        together |= dict.fromkeys(matrix.rows or ())
    return DofTable(tuple(sorted(together, key=lambda dof: (dof[0], dof[1] == MODAL, dof[1]))))


def _in_order(key: str, matrix: FileMatrix, table: DofTable) -> Any:
    """The matrix in the order of the table; missing entries are zero."""
    if matrix.rows is None:
        return csc_array(matrix.values)
    at = _placed(key, matrix.rows, table)
    entries = matrix.values.tocoo()
    size = len(table.dofs)
    return csc_array((entries.data, (at[entries.row], at[entries.col])), shape=(size, size))


def _placed(key: str, names: Sequence[Dof], table: DofTable) -> Ints:
    """Row of the table for each name in a file."""
    place = {dof: i for i, dof in enumerate(table.dofs)}
    unknown = next((dof for dof in names if dof not in place), None)
    if unknown is not None:
        raise MethodError(
            "dofs", f"does not name node {unknown[0]} {unknown[1]}, which {key} has", table.remedy(unknown[0])
        )
    return np.array([place[dof] for dof in names], dtype=np.int64)


def _symmetric(key: str, matrix: Any, table: DofTable, remarks: list[str]) -> Any:
    difference = (matrix - matrix.T).tocoo()
    largest = float(np.abs(matrix.data).max(initial=0.0))
    asymmetry = float(np.abs(difference.data).max(initial=0.0))
    if asymmetry <= np.finfo(float).eps * largest:  # explained by another order of summation
        return matrix if asymmetry == 0.0 else ((matrix + matrix.T) / 2).tocsc()
    if asymmetry > ROUND_OFF * largest:
        worst = int(np.argmax(np.abs(difference.data)))
        row, column = (" ".join(map(str, table.dofs[i])) for i in (difference.row[worst], difference.col[worst]))
        raise MethodError(
            key, f"is not symmetric: the entries of node {row} and node {column} differ by {asymmetry:.3g}, "
            f"{asymmetry / largest:.1g} of the largest entry",
            "export the symmetric matrix; gyroscopic, circulatory and follower terms are not modelled",
        )  # fmt: skip
    remarks.append(
        f"the matrix {key} was made symmetric: its transpose differed by {asymmetry / largest:.1g} of the largest entry"
    )
    return ((matrix + matrix.T) / 2).tocsc()


def _check_diagonals(mass: Any, stiffness: Any, table: DofTable) -> None:
    for key, matrix, what in (("mass", mass, "mass"), ("stiffness", stiffness, "stiffness")):
        diagonal = matrix.diagonal()
        worst = int(np.argmin(diagonal)) if diagonal.size else 0
        if diagonal.size and diagonal[worst] < -MASSLESS * diagonal.max(initial=0.0):
            node, direction = table.dofs[worst]
            raise MethodError(
                key, f"has a negative {what} of {diagonal[worst]:.4g} at node {node} {direction}",
                "check the signs, units and concentrated masses of the model that wrote it",
            )  # fmt: skip
    if not np.any(mass.data):
        raise MethodError("mass", "is zero", "give the mass matrix of the model")


def massless_basis(mass: Any, table: DofTable) -> tuple[Any, Any]:
    """Sparse orthonormal bases of the motions with mass (N, m) and without mass (N, p).

    Blocks of the mass matrix are treated separately, each scaled to a unit diagonal.

    Raises
    ------
    MethodError
        If a motion has a negative mass beyond round-off.
    """
    size, diagonal = mass.shape[0], mass.diagonal()
    massive = np.ones(size, dtype=bool)  # rows that stay unchanged
    bases: tuple[list[Floats], list[Floats]] = ([], [])
    mixed = []
    for block in blocks_of(mass):
        if block.size == 1:
            massive[block] = diagonal[block[0]] > MASSLESS * diagonal.max()
        elif block.size <= 800:  # larger blocks are assumed to have mass in every motion
            null = _null_motions(mass[block][:, block].toarray(), table.part(block))
            if null.shape[1]:
                massive[block] = False
                mixed.append(block)
                bases[0].append(np.linalg.svd(null)[0][:, null.shape[1] :])
                bases[1].append(null)
    rows = np.concatenate([*mixed, np.zeros(0, dtype=np.int64)])
    units: Any = eye_array(size, format="csc")
    empty = np.setdiff1d(np.flatnonzero(~massive), rows)
    spread = units[:, rows]
    found = []
    for own, blocks in ((np.flatnonzero(massive), bases[0]), (empty, bases[1])):
        columns = [units[:, own]]
        if blocks:
            columns.append(spread @ block_diag([csc_array(block) for block in blocks], format="csc"))
        found.append(hstack(columns, format="csc"))
    return found[0], found[1]


def _null_motions(mass: Floats, table: DofTable) -> Floats:
    """(n, p) orthonormal massless motions of a block (n, n) of the mass matrix, scaled to a unit diagonal."""
    root = np.sqrt(np.maximum(np.diag(mass), 0.0))
    inverse = np.divide(1.0, root, out=np.ones_like(root), where=root > 0)
    values, vectors = np.linalg.eigh(mass * np.outer(inverse, inverse))
    if values[0] < -ROUND_OFF * values[-1]:
        node, direction = table.dofs[int(np.argmax(np.abs(vectors[:, 0])))]
        raise MethodError(
            "mass", f"has a motion with negative mass, largest at node {node} {direction}",
            "check the offsets and units of concentrated masses in the model that wrote it",
        )  # fmt: skip
    none = values <= max(MASSLESS, 4 * root.size * np.finfo(float).eps) * values[-1]
    return np.linalg.qr(vectors[:, none] * inverse[:, None])[0]


def condensation(stiffness: Any, basis_with_mass: Any, basis_without_mass: Any) -> Any:
    """(N, m) motion of all rows for a unit of each motion with mass; massless motions follow without force.

    Parameters
    ----------
    stiffness : (N, N) sparse.
    basis_with_mass, basis_without_mass : (N, m) and (N, p) sparse bases of motions with and without mass.

    Returns
    -------
    (N, m) sparse
        Motions of all rows.

    Raises
    ------
    MethodError
        About ``mass``: the stiffness does not restrain the massless motions.
    """
    inner = (basis_without_mass.T @ stiffness @ basis_without_mass).toarray()
    try:
        follow = np.linalg.solve(inner, (basis_without_mass.T @ stiffness @ basis_with_mass).toarray())
        trusted = np.linalg.cond(inner / np.sqrt(np.outer(np.diag(inner), np.diag(inner)))) < 1e13
    except np.linalg.LinAlgError:
        trusted = False
    if not trusted:
        raise MethodError(
            "mass", "has degrees of freedom with neither mass nor stiffness",
            "constrain them in the model that writes the matrices (AUTOSPC), or leave their rows out",
        )  # fmt: skip
    whole = basis_with_mass - basis_without_mass @ csc_array(follow)
    whole.data[np.abs(whole.data) < 1e-16] = 0.0
    whole.eliminate_zeros()
    return whole.tocsc()


def rigid_rows(table: DofTable, motion: BaseDirection, base_rows: Ints) -> Floats:
    """(N,) rigid motion of every row, m or rad, for a unit motion of the base.

    Parameters
    ----------
    table : names and coordinates of the rows.
    motion : motion of the base.
    base_rows : rows that move with it.

    Returns
    -------
    (N,) array
        1 for a translation along the axis of a row.

    Raises
    ------
    MethodError
        About ``dofs``: a rotation needs the coordinates of all nodes, unless the base is a single node.
    """
    if motion.direction not in ROTATIONS or (table.coordinates is None and np.unique(table.nodes[base_rows]).size == 1):
        return table.of_direction(motion.direction)
    placed = np.array([direction in TRANSLATIONS for _, direction in table.dofs])
    if table.coordinates is None or not np.all(np.isfinite(table.coordinates[placed])):
        raise MethodError("dofs", "has no coordinates of the nodes, which a rotation of the base needs",
                          "give the columns x, y, z")  # fmt: skip
    moved = motion.displacements(np.nan_to_num(table.coordinates))
    along = np.array([table.of_direction(direction) for direction in TRANSLATIONS])
    return np.asarray(np.einsum("ni,in->n", moved, along) + table.of_direction(motion.direction))


def base_influence(
    matrices: NamedMatrices, base_rows: Ints, free_rows: Ints, motion: BaseDirection, *, no_rigid_motion: bool
) -> Floats:
    """(N,) displacement of every row for a unit displacement of the base.

    Parameters
    ----------
    matrices : matrices of all rows.
    base_rows, free_rows : rows that move with the base, and the others.
    motion : motion of the base; without a direction the one of the section.
    no_rigid_motion : whether the held rows leave no rigid-body motion.

    Returns
    -------
    (N,) array
        m and rad, for a metre or radian of the base.

    Raises
    ------
    MethodError
        If the base cannot move without force, because the stiffness connects to something else.
    """
    if not motion.direction:  # a rotation about the first node of the base
        points, motion = matrices.table.coordinates, BaseDirection(matrices.direction)
        if points is not None and base_rows.size and np.all(np.isfinite(points[base_rows[0]])):
            motion = replace(motion, axis_point=tuple(points[base_rows[0]].tolist()))
    influence = rigid_rows(matrices.table, motion, base_rows)
    if not base_rows.size:
        return influence
    if not influence[base_rows].any():
        there = sorted({matrices.table.dofs[row][1] for row in base_rows})
        raise MethodError(
            "base", f"moves in {motion.direction}, but none of its nodes has that direction",
            f"they have {', '.join(there)}: choose one of these, or name other nodes",
        )  # fmt: skip
    # If the named directions move without force, solving would only add round-off.
    if no_rigid_motion and not moves_freely(matrices.stiffness, influence):
        lu = symmetric_lu(matrices.stiffness[free_rows][:, free_rows])
        influence[free_rows] = lu.solve(-(matrices.stiffness[free_rows][:, base_rows] @ influence[base_rows]))
    if not moves_freely(matrices.stiffness, influence):
        force = matrices.stiffness @ influence
        worst = matrices.table.dofs[int(np.argmax(np.abs(force)))]
        raise MethodError(
            "base", f"needs {np.abs(force).max():.4g} N for a unit motion, at node {worst[0]} {worst[1]}: "
            "the stiffness connects the structure to something that does not move with the base",
            "remove springs to ground from the model, name all supported nodes, or use base: free",
        )  # fmt: skip
    return influence
