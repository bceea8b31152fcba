"""A body with imported matrices, as a structure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import coo_array, csr_array, eye_array

from beamsim.dofs import MODAL, Dof
from beamsim.errors import MethodError, ScenarioError
from beamsim.scenario import Scenario
from beamsim.scenario.matrices import MatricesBody
from beamsim.structures.assembly import with_places_of_files
from beamsim.structures.imported import (
    base_influence,
    condensation,
    massless_basis,
    read_matrices_of,
)
from beamsim.structures.modes import lowest_eigenpairs, orthonormal_in_mass
from beamsim.structures.named_matrices import (
    TRANSLATIONS,
    DofTable,
    FileSummary,
    NamedDofs,
    NamedMatrices,
    moves_freely,
    size_and_mass,
)
from beamsim.structures.places import NAMED_ROW, NODES, UPWARDS, BaseDirection, LoadedRegion, Place, Recovery, Site
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import (
    BodyField,
    BodyStructure,
    MemberBody,
    ReducedBasis,
    Restraint,
    WeightedValues,
)
from beamsim.structures.symmetric_lu import SymmetricLU, dissection, factors_with_rigid_motions, negative_eigenvalues
from beamsim.typing import Floats, Ints, not_none

# A motion is rigid if its forces are below this fraction of the absolute contributions, and its frequency is far below
# the next one.
_RIGID, _GAP = 1e-9, 1e-5
NOT_HELD_REMARK = "the base does not restrain it"
"""Beginning of the remark on motions without stiffness although there is a base."""
DENSE_SHARE = 0.8  # share of node pairs, above which a matrix is not one of elements
# relative frequency shifts, if round-off hides a count
_COUNT_OFFSETS = 1e-7, 1e-5, 1e-3
_SOFT = "check the model that wrote it: loads that soften it, negative springs, constraints by multipliers"


@dataclass(frozen=True)
class MatricesStructure(BodyStructure):
    """Matrices of another program; places are nodes with a direction."""

    source_matrices: NamedMatrices  # matrices of all rows in the files
    table: DofTable  # names of the rows of `expansion`
    expansion: Any  # (rows, N) sparse: rows of the files that do not move with the base, from the degrees of freedom
    massless: Floats  # (rows,) massless share of a row
    scaled_stiffness: Any  # (N, N) scaled K
    factors: SymmetricLU  # factors of K, with rigid-body modes as in `factors_with_rigid_motions`
    _motions: dict[BaseDirection, Floats] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def stiffness(self) -> Any:
        """(N, N) scaled K."""
        return self.scaled_stiffness

    @cached_property
    def factorised_stiffness(self) -> SymmetricLU:
        """Factors of K, already known."""
        return self.factors

    @property
    def most_modes(self) -> int:
        """Number of modes to keep by default; static vectors represent the higher ones."""
        return max(1, min(self.size - int(self.rigid.shape[1]), 100))

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency: negative eigenvalues of K - omega^2 M.

        If round-off hides this number, the count at a slightly higher frequency is returned.

        Raises
        ------
        MethodError
            If the count cannot be determined.
        """
        for aside in (0.0, *_COUNT_OFFSETS):
            limit = omega * (1 + aside)
            count = negative_eigenvalues(self.stiffness - limit**2 * self.mass, self.order)
            if count is not None:
                return count + int(self.rigid.shape[1])
        limit = omega * self.frequency_scale / (2 * np.pi)
        raise MethodError(
            "reduction",
            f"by frequency is not possible: the modes of {self.name} below {limit:.4g} Hz cannot be counted",
            "give reduction.modes, and look at the matrices with `beamsim check`",
        )  # fmt: skip

    def row_number(self, place: Place) -> int | None:
        """Row of the files for a place; None if there is none."""
        return self.table.number.get((round(place.coordinate), place.direction.removeprefix("local_")))

    def place_problem(self, place: Place | LoadedRegion, for_force: bool) -> tuple[str, str, str] | None:
        """Key, message and remedy if the place does not exist, or nothing can act there; else None."""
        assert isinstance(place, Place)  # the scenario refuses other places
        if place.direction == NAMED_ROW:
            return self._row_problem(place, for_force)
        node = round(place.coordinate)
        number = self.row_number(place)
        if number is None:
            if node in self.source_matrices.base:
                return "node", f"= {node} moves with the base", "name a node that does not move with the base"
            known = any(each == node for each, _ in self.table.dofs)
            return (
                "direction" if known else "node",
                f"= {place.direction} is not a direction of node {node}"
                if known
                else f"= {node} is not a node of {self.name}",
                self.table.remedy(node),
            )
        if for_force and self.massless[self.table.row(node, place.direction) != 0.0].max() > 1e-6:
            return (
                "node", f"= {node} has no mass in {place.direction}: a force there would move it without inertia",
                "give the node a mass in the model that writes the matrices, or act on a node with mass",
            )  # fmt: skip
        return None

    def _row_problem(self, place: Place, for_force: bool) -> tuple[str, str, str] | None:
        """See `place_problem`, of a named row."""
        row = self.unsupported_row(place)[self._rows[1]]
        if not row.any():
            return (
                "row",
                "moves with the base alone",
                "give a factor of a degree of freedom that does not move with it",
            )
        if for_force and self.massless[row != 0.0].max() > 1e-6:
            return (
                "row",
                "moves a degree of freedom without mass: a force there would move it without inertia",
                "set its factor to zero, or give it a mass in the model that writes the matrices",
            )
        return None

    def restraints(self, base: BaseDirection) -> Sequence[Restraint]:
        """Every direction of every node of the base."""
        held, _ = self._rows
        dofs, moved = self.source_matrices.table.dofs, self.rigid_motion(base)
        unit = np.zeros((held.size, len(dofs)))
        unit[np.arange(held.size), held] = 1.0
        return [
            Restraint(self.support_name(dofs[row][0]), dofs[row][1], float(moved[row]), motion)
            for row, motion in zip(held, unit, strict=True)
        ]

    def support_name(self, node: int) -> str:
        """Name of the support at a node of the base."""
        return f"node {node}"

    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(rows of the files,) row of a place."""
        assert isinstance(place, Place)  # the scenario refuses the others
        if place.direction == NAMED_ROW:
            return np.asarray(not_none(self.source_matrices.rows)[round(place.coordinate)])
        table, node = self.source_matrices.table, round(place.coordinate)
        if (row := table.row(node, place.direction)) is None:
            raise ValueError(f"{place.label} does not exist; {table.remedy(node)}")
        return row

    def forces_of(self, motion: Floats) -> Floats:
        """(3, rows of the files) forces for a displacement, N, acceleration and velocity of all rows."""
        given = (self.source_matrices.stiffness, self.source_matrices.mass, self.source_matrices.damping)
        return np.array([np.zeros(motion.size) if matrix is None else matrix @ motion for matrix in given])

    def work(self, motion: Floats, forces: Floats) -> Floats:
        """(3,) work of forces (3, rows of the files) along a motion of all rows."""
        if self.expansion.shape[0] != self.size and motion[self._rows[0]].any():
            raise MethodError(
                "outputs", f"request forces of moving supports, but degrees of freedom of {self.name} without mass "
                "were condensed", "leave out the reactions and energies, or give these degrees of freedom a mass",
            )  # fmt: skip
        return forces @ motion

    def recovery_row(self, number: int, order: int = 0) -> Floats:
        """(rows of the files,) a row of the recovery matrix."""
        return np.asarray(self.source_matrices.recovery[[number]].toarray()[0] * self.source_matrices.time_unit**order)

    @property
    def named_dofs(self) -> NamedDofs:
        """Names from the files; generic coordinates if massless motions were condensed."""
        if self.expansion.shape[0] != self.size:
            names = tuple((i + 1, MODAL) for i in range(self.size))
            return NamedDofs(DofTable(names), np.ones(self.size), np.zeros(self.size))
        return NamedDofs(self.table, np.ones(self.size), self.rigid_motion(UPWARDS)[self._rows[1]])

    @property
    def named_matrices(self) -> NamedMatrices:
        """The matrices of the files, made symmetric."""
        return self.source_matrices

    def given_field(self, numbers: Sequence[float]) -> BodyField:
        """One number for each row of the matrices that are written in the case; those of the base do not count."""
        if self.expansion.shape[0] != self.size:
            raise MethodError("mass", "has motions without mass: a start needs an inertia for each", "leave them out")
        root = np.linalg.cholesky(self.mass.toarray()).T
        given = np.asarray(numbers, dtype=float)[self._rows[1]]
        return BodyField(WeightedValues(root, np.ones(self.size), root @ given))

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground under a unit motion of the base."""
        given, (held, free), influence = self.source_matrices, self._rows, self.rigid_motion(motion)
        stiffness, moved = given.stiffness[free][:, free], influence[free]
        ground = np.zeros(free.size) if held.size or moves_freely(stiffness, moved) else -(stiffness @ moved)
        inertia = given.mass[free] @ influence
        return np.asarray(self.expansion.T @ inertia) / self.mass_scale, np.asarray(self.expansion.T @ ground)

    def demand_undamped(self, motion: BaseDirection) -> None:
        """Refuse a motion of the base if dashpots connect the matrices to something that does not move with it.

        Raises
        ------
        MethodError
            If there are such dashpots.
        """
        damping, free = self.source_matrices.damping, self._rows[1]
        if damping is not None and not moves_freely(damping[free], self.rigid_motion(motion)):
            raise MethodError(
                "viscous", "damps a rigid motion of the base: dashpots go to something that does not move with it",
                "remove dashpots to ground from the model, or load it by forces, so that the base is at rest",
            )  # fmt: skip

    @cached_property
    def _rows(self) -> tuple[Ints, Ints]:
        """Rows of the files that move with the base, and the others."""
        held = _base_rows(self.source_matrices)
        return held, np.setdiff1d(np.arange(len(self.source_matrices.table.dofs)), held)

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(rows of the files,) rigid displacement for a unit motion of the base."""
        if motion not in self._motions:
            self._motions[motion] = base_influence(
                self.source_matrices, *self._rows, motion, no_rigid_motion=not self.rigid.shape[1]
            )
        return self._motions[motion]

    def unit_stiffness(self, site: Site) -> float:
        """Static stiffness of the structure at a site, N/m; with inertia relief if it is free; 0 of free masses."""
        row = self.row(site)
        deflection = float(row @ static_deflections(self, row[:, None])[:, 0])
        return self.stiffness_scale / deflection if deflection else 0.0  # of free masses none

    def reassemble(self, section: Any) -> MatricesStructure:
        """The body itself."""
        return self

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Displacements in the direction of the base at a limited number of nodes, and at nodes with forces.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            At nodes of the files.
        """
        direction = self.source_matrices.direction
        numbers = [i for i, (_, each) in enumerate(self.table.dofs) if each == direction]
        chosen = {numbers[k] for k in np.linspace(0, len(numbers) - 1, min(len(numbers), 200)).astype(int)}
        at = {self.row_number(place) for place in sites if place.direction == direction} - {None}
        rows = np.array(sorted(chosen | at, key=lambda i: int(self.table.nodes[i])), dtype=np.int64)
        shapes = self.expansion[rows] @ (member.expansion @ basis.vectors) / np.sqrt(member.structure.mass_scale)
        points = None if self.table.coordinates is None else self.table.coordinates[rows]
        nodes = self.table.nodes[rows].astype(float)
        if not rows.size:  # modal models without interface nodes have no places
            nodes, points, shapes = (
                np.array([*self.source_matrices.base[:1], 0.0][:1]),
                None,
                np.zeros((1, shapes.shape[1])),
            )
        lines, in_space = None, None
        if points is not None and np.all(np.isfinite(points)):
            lines = self._lines(nodes, points)
            in_space = self._in_space(nodes, member.expansion @ basis.vectors) / np.sqrt(member.structure.mass_scale)
        return Recovery(
            self.name, NODES, nodes, np.asarray(shapes), points=points, lines=lines, direction=direction,
            in_space=in_space,
        )  # fmt: skip

    def _in_space(self, nodes: Floats, vectors: Floats) -> Floats:
        """(nodes, 3, n) x, y and z of nodes for fields (N, n); zero where a node has no such degree of freedom."""
        found = np.zeros((nodes.size, 3, vectors.shape[1]))
        for k, node in enumerate(nodes.astype(int).tolist()):
            for axis, direction in enumerate(TRANSLATIONS):
                if (row := self.table.number.get((node, direction))) is not None:
                    found[k, axis] = self.expansion[[row]] @ vectors
        return found

    def _lines(self, nodes: Floats, points: Floats) -> Ints | None:
        """(k, 2) pairs of nodes that elements connect: edges, without diagonals.

        None for a matrix that couples most nodes, such as a condensed one.
        """
        stiffness, of_rows = coo_array(self.source_matrices.stiffness), self.source_matrices.table.nodes
        at = np.minimum(np.searchsorted(nodes, of_rows), nodes.size - 1)
        shown = nodes[at] == of_rows
        i, j = (at[ends][shown[stiffness.row] & shown[stiffness.col]] for ends in (stiffness.row, stiffness.col))
        near = np.zeros((nodes.size, nodes.size), dtype=bool)
        near[i, j] = near[j, i] = i != j
        if nodes.size > 2 and near.sum() > DENSE_SHARE * nodes.size * (nodes.size - 1):
            return None
        apart = np.linalg.norm(points[:, None] - points, axis=2)
        pairs = np.argwhere(np.triu(near))
        edges = [
            (a, b)
            for a, b in pairs
            if not np.any(near[a] & near[b] & (np.maximum(apart[a], apart[b]) < (1.0 - 1e-6) * apart[a, b]))
        ]
        return np.array(edges, dtype=np.int64).reshape(-1, 2) if edges else None

    def deflections(self, vectors: Floats) -> Floats:
        """Displacements of nodes; if there are none, all degrees of freedom."""
        rows = np.flatnonzero([direction in TRANSLATIONS for _, direction in self.table.dofs])
        return np.asarray(self.expansion[rows] @ vectors) if rows.size else np.asarray(vectors)

    def largest_at(self, field: Floats) -> str:
        """Node and direction of the largest displacement of a field (N,), or of the largest rotation."""
        node, direction = self._largest_row(field)
        return f"node {node} {direction}"

    def _largest_row(self, field: Floats) -> Dof:
        """Node and direction of the largest displacement of a field (N,), or of the largest rotation."""
        return _largest_row(self.table, self.expansion @ field)

    def point_of(self, place: Place) -> Floats | None:
        """(3,) coordinates of the node, m, if the table has them."""
        number = self.row_number(place)
        if number is None or self.table.coordinates is None or not np.all(np.isfinite(self.table.coordinates[number])):
            return None
        return np.asarray(self.table.coordinates[number])


def assemble_matrices(section: MatricesBody, name: str = "", nodes: Sequence[Any] = ()) -> MatricesStructure:
    """Read, check, condense and scale the matrices of a body.

    Parameters
    ----------
    section : section of the body.
    name : name of the body.
    nodes : not used, since all nodes are in the files.

    Returns
    -------
    MatricesStructure
        With a summary of its files.

    Raises
    ------
    ScenarioError
        At the invalid key of the body.
    """
    with _name_body(name):
        given, found = read_body(section, name)
        if section.base != "free":
            given = replace(given, base=section.base.nodes, direction=section.base.direction)
        return replace(structure_of(given, section.damping, name), file_summary=found)


def read_body(section: MatricesBody, name: str) -> tuple[NamedMatrices, FileSummary]:
    """The matrices in the files of a body, in SI units, with a summary for the user.

    Raises
    ------
    ScenarioError
        At the invalid key of the body.
    """
    with _name_body(name):
        given = read_matrices_of(section)
    found, by_default = size_and_mass(given), section.units is None
    return given, FileSummary(name, len(given.table.dofs), given.units, by_default, found, given.remarks)


def summaries_of_files(scenario: Scenario) -> tuple[FileSummary, ...]:
    """Summaries of the files of imported bodies, without assembling the structure.

    Raises
    ------
    ScenarioError
        If a file cannot be read or used.
    """
    return tuple(
        read_body(with_places_of_files(scenario, name), name)[1]
        for name, body in scenario.all_bodies.items()
        if body.is_read_from_files
    )


@contextmanager
def _name_body(name: str) -> Iterator[None]:
    """Add the name of the body to errors about its keys."""
    try:
        yield
    except MethodError as error:
        raise ScenarioError.at(f"bodies.{name}.{error.about}", error.message, error.remedy) from None


def structure_of(matrices: NamedMatrices, damping: Any = None, name: str = "") -> MatricesStructure:
    """The structure of matrices whose base is given by `NamedMatrices.base`.

    Parameters
    ----------
    matrices : matrices of all rows, SI units.
    damping : section of the scenario, modal or Rayleigh; None without damping.
    name : name of the body.

    Returns
    -------
    MatricesStructure
        On the rows that have mass and do not move with the base.

    Raises
    ------
    MethodError
        If all rows move with the base, the base moves against springs or dashpots, or the matrices are not valid.
    """
    held = _base_rows(matrices)
    free = np.setdiff1d(np.arange(len(matrices.table.dofs)), held)
    if not free.size:
        raise MethodError("base", "fixes every degree of freedom", "name the supported nodes alone")
    table = matrices.table.part(free)
    mass, stiffness = (matrix[free][:, free].tocsc() for matrix in (matrices.mass, matrices.stiffness))
    expansion, share, condensed = _without_massless(mass, stiffness, table)
    products = (expansion.T @ matrix @ expansion for matrix in (mass, stiffness))
    reduced_mass, reduced_stiffness = (((m + m.T) / 2).tocsc() for m in products)
    order = None
    if expansion.shape[0] == expansion.shape[1]:  # without condensation the rows are those of nodes
        order = dissection(abs(reduced_stiffness) + abs(reduced_mass), table.coordinates)
    rigid, flexible, factors = rigid_modes(reduced_stiffness, reduced_mass, table, expansion, order)
    loose = [_not_held(table, expansion @ rigid)] if held.size and rigid.shape[1] else []
    viscous = None if matrices.damping is None else (expansion.T @ matrices.damping[free][:, free] @ expansion).tocsc()
    mass_scale = float(np.mean(reduced_mass.diagonal()))
    stiffness_scale = mass_scale * flexible**2 if flexible else 1.0
    rigid = rigid * np.sqrt(mass_scale)
    factors = replace(factors, scale=factors.scale * np.sqrt(stiffness_scale))
    structure = MatricesStructure(
        name=name,
        mass=reduced_mass / mass_scale,
        factor=stiffness_factor(factors, rigid),
        damping=viscous,
        rigid=rigid,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        section=None,
        stated_damping=damping,
        all_dofs_map=csr_array(eye_array(len(matrices.table.dofs), format="csr")[:, free] @ expansion),
        source_matrices=matrices,
        table=table,
        expansion=expansion.tocsr(),
        massless=share,
        scaled_stiffness=(reduced_stiffness / stiffness_scale).tocsc(),
        factors=factors,
        order=order,
        notes=(*matrices.remarks, *condensed, *loose),
    )
    structure.base_load(UPWARDS)  # refuses base nodes that are also connected to the ground
    return structure


def _not_held(table: DofTable, rigid: Floats) -> str:
    """A remark on rigid motions (N, r) that a base does not prevent."""
    places = dict.fromkeys(" ".join(map(str, _largest_row(table, motion))) for motion in rigid.T)
    motions = "a motion" if rigid.shape[1] == 1 else f"{rigid.shape[1]} motions"
    return (
        f"{NOT_HELD_REMARK}: {motions} without stiffness, largest at {', '.join(f'node {place}' for place in places)}"
    )


def _without_massless(mass: Any, stiffness: Any, table: DofTable) -> tuple[Any, Floats, list[str]]:
    """(N, n) motion of all rows for each motion with mass, (N,) massless share of each row, and remarks."""
    massive, massless = massless_basis(mass, table)
    size, count = massless.shape
    if not count or size > 4000:  # too large to compute the motions here
        return eye_array(size, format="csc"), np.zeros(size), []
    share = np.asarray(abs(massless).max(axis=1).toarray()).ravel()
    remark = f"{count} motions without mass follow the others statically"
    return condensation(stiffness, massive, massless), share, [remark]


def _largest_row(table: DofTable, motion: Floats) -> Dof:
    """Node and direction of the largest displacement of a motion (N,), or of the largest rotation."""
    motion = np.abs(motion)
    shifts = np.where([direction in TRANSLATIONS for _, direction in table.dofs], motion, 0.0)
    row = int(np.argmax(shifts if shifts.max() > _RIGID * motion.max() else motion))
    return table.dofs[row]


def _base_rows(matrices: NamedMatrices) -> Ints:
    for k, node in enumerate(matrices.base):
        if not matrices.table.rows_of([node]).size:
            raise MethodError(
                f"base.nodes[{k}]", f"= {node} is not a node of the matrices", matrices.table.remedy(node)
            )
    return matrices.table.rows_of(matrices.base)


def rigid_modes(
    stiffness: Any, mass: Any, table: DofTable, expansion: Any, order: Ints | None = None
) -> tuple[Floats, float, SymmetricLU]:
    """Motions without strain energy, the first flexible frequency, and factors of the stiffness.

    Parameters
    ----------
    stiffness, mass : (N, N) sparse, N/m and kg.
    table, expansion : names of the rows, and their expansion (rows, N) from the N degrees of freedom, for messages.
    order : (N,) order of elimination.

    Returns
    -------
    (N, r), rad/s, SymmetricLU
        The motions are orthonormal in the mass matrix.

    Raises
    ------
    MethodError
        If the stiffness or mass matrix is not positive semidefinite.
    """
    size = mass.shape[0]
    count = min(size, 8)
    diagonal = stiffness.diagonal()
    typical = float(np.median(diagonal) or np.max(diagonal)) or 1.0  # 1 where every mass is free
    shift = -1e-9 * typical / float(np.mean(mass.diagonal()))
    try:
        squared, vectors = lowest_eigenpairs(stiffness, mass, count, shift, order)
    except LinAlgError:
        raise MethodError("mass", "is not positive definite", "check the model that wrote it") from None
    one_by_one = (abs(stiffness) @ np.abs(vectors)).max(axis=0)
    force = np.abs(stiffness @ vectors).max(axis=0) / np.where(one_by_one > 0, one_by_one, 1.0)
    rigid = 0
    for k in range(1, min(count + 1, 7)):
        if force[:k].max() <= _RIGID and (k == size or abs(squared[k - 1]) <= _GAP * squared[min(k, count - 1)]):
            rigid = k
    lowest = squared[rigid:]
    if lowest.size and lowest[0] <= 0:
        node, direction = table.dofs[int(np.argmax(np.abs(expansion @ vectors[:, rigid])))]
        raise MethodError(
            "stiffness", f"is not positive semidefinite: a motion largest at node {node} {direction} releases energy",
            _SOFT,
        )  # fmt: skip
    null = orthonormal_in_mass(vectors[:, :rigid], mass)
    held = factors_with_rigid_motions(stiffness, null, order)
    if np.any(held.pivots <= 0):
        negative = int(np.sum(held.pivots <= 0))
        raise MethodError(
            "stiffness", f"is not positive semidefinite: {negative} of its pivots are negative", _SOFT
        )  # fmt: skip
    return np.asarray(null), float(np.sqrt(lowest[0])) if lowest.size else 0.0, held


def stiffness_factor(factors: SymmetricLU, rigid: Floats) -> Any:
    """(p, N) sparse B with K = B^T B and B R = 0: the Cholesky factor after the rigid motions R are fixed.

    It is applied to a motion minus its rigid part at the fixed degrees of freedom.
    """
    root = csr_array(factors.root)
    pinned = factors.pinned
    if not pinned.size:
        return root
    bent = np.setdiff1d(np.arange(rigid.shape[0]), root[:, pinned].tocoo().row)
    root = root[bent]
    followed = csr_array(root @ (rigid @ np.linalg.inv(rigid[pinned])))
    pins = csr_array((np.ones(pinned.size), (np.arange(pinned.size), pinned)), shape=(pinned.size, rigid.shape[0]))
    return csr_array(root - followed @ pins)
