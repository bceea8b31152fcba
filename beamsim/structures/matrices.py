"""A body with imported matrices, and what it answers as a structure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import MethodError, Problem, ScenarioError
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.dissection import dissection
from beamsim.structures.distributed import Distributed
from beamsim.structures.dof_table import TRANSLATIONS, DofTable, NamedDofs
from beamsim.structures.file_summary import FileSummary, summary_of
from beamsim.structures.imported import (
    CONDENSED_UP_TO,
    GROUNDED,
    base_influence,
    condensation,
    massless_basis,
    read_matrices_of,
    rigid_rows,
)
from beamsim.structures.named_matrices import NamedMatrices
from beamsim.structures.places import Place, Site
from beamsim.structures.reduction import static_deflections
from beamsim.structures.rigid_motion import orthonormal_in_mass
from beamsim.structures.stations import NODES, Recovery
from beamsim.structures.structure import BodyStructure, MemberBody
from beamsim.structures.sturm import negative_eigenvalues
from beamsim.structures.supports import Support
from beamsim.structures.symmetric_lu import SymmetricLU, symmetric_lu
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario.matrices import MatricesBody
    from beamsim.structures.basis import ReducedBasis

_DENSE = 600  # size up to which all eigenvalues are computed at once
_MOST_MODES = 100  # flexible modes that a default reduction keeps
_MOST_STATIONS = 200
# A motion is rigid where its forces are below this fraction of those of its entries one by one, and its frequency
# is far below the next.
_RIGID, _GAP = 1e-9, 1e-5
# Smallest pivot of a stiffness with a unit diagonal above which no motion is rigid; round-off leaves some 1e-13.
_FIRM = 1e-9
NOT_HELD = "the base does not hold it"
"""How the remark about motions that have no stiffness although the base is held begins."""
_SCALE_ONLY = 1e-6  # relative error of a first frequency that scales the matrices and does nothing else
_INACCURATE = 1e-11  # backward error of factors
_ASIDE = (1e-7, 1e-5, 1e-3)  # of a frequency below which modes are counted, where the count is hidden at it
_SOFT = "check the model that wrote it: loads that soften it, negative springs, constraints by multipliers"


@dataclass(frozen=True)
class MatricesStructure(BodyStructure):
    """Matrices of another program; places are nodes with a direction."""

    whole_damping: Any  # modal or Rayleigh, that of the body; None without
    given: NamedMatrices  # matrices of all rows
    table: DofTable  # of the rows of `expansion`
    expansion: Any  # (rows, N) sparse: rows of the files that do not move with the base, from the degrees of freedom
    massless: Floats  # (rows,) share of a row that has no mass
    influence: Floats  # (rows,) displacement for a unit displacement of the base
    given_stiffness: Any  # (N, N) scaled K
    factors: SymmetricLU | None = None  # of K, where they are known
    order: Ints | None = None  # (N,) of elimination, of a large model whose nodes have coordinates
    notes: tuple[str, ...] = field(default=())
    read: FileSummary | None = None  # None of matrices that no body of a scenario names
    _influences: dict[BaseDirection, Floats] = field(default_factory=dict, init=False, repr=False, compare=False)
    _counted: dict[float, int] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def stiffness(self) -> Any:
        """(N, N) scaled K, as it was given."""
        return self.given_stiffness

    @cached_property
    def factorised_stiffness(self) -> Any:
        """Factors of K; with rigid-body modes bordered by them."""
        if self.rigid.shape[1]:
            return super().factorised_stiffness
        return self.factors or symmetric_lu(self.stiffness, definite=True, order=self.order)

    @property
    def elimination_order(self) -> Ints | None:
        """(N,) rows by nested dissection of a large model whose nodes have coordinates."""
        return self.order

    def factorise(self, matrix: Any) -> Any:
        """Factors with an ordering for symmetric matrices, which have far less fill.

        Exchanged pivots would undo that: they are exchanged only where the factors are not accurate without.
        """
        factors = symmetric_lu(matrix, definite=True, order=self.order)
        load = np.linspace(1.0, 2.0, self.size)
        solution = factors.solve(load)
        error = np.abs(matrix @ solution - load).max() / (abs(matrix) @ np.abs(solution) + load).max()
        return factors if error <= _INACCURATE else symmetric_lu(matrix, definite=False, order=self.order)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was done to the matrices of the files."""
        return tuple(f"{self.name}: {note}" for note in self.notes)

    @property
    def file_summary(self) -> FileSummary | None:
        """What its files hold."""
        return self.read

    @property
    def most_modes(self) -> int:
        """Static vectors carry what the modes above these do."""
        return max(1, min(self.size - int(self.rigid.shape[1]), _MOST_MODES))

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency: negative eigenvalues of K - omega^2 M.

        Where round-off hides that number, it is that of a slightly higher frequency.

        Raises
        ------
        MethodError
            If it stays hidden.
        """
        for aside in (0.0, *_ASIDE):
            limit = omega * (1 + aside)
            count = negative_eigenvalues(self.stiffness - limit**2 * self.mass, self.order)
            if count is not None:
                self._counted[limit] = count
                return count + int(self.rigid.shape[1])
        limit = omega * self.frequency_scale / (2 * np.pi)
        raise MethodError(
            "reduction",
            f"by frequency is not possible: the modes of {self.name} below {limit:.4g} Hz cannot be counted",
            "give reduction.modes, and look at the matrices with `beamsim check`",
        )  # fmt: skip

    @property
    def counted(self) -> Mapping[float, int]:
        """What `frequency_count` has found."""
        return self._counted

    def row_number(self, place: Place) -> int | None:
        """Row of the files of a place; None where there is none."""
        return self.table.number.get((round(place.coordinate), place.direction))

    def place_row(self, place: Place) -> Floats:
        """(N,) motion of a node in a direction for a unit of each degree of freedom."""
        number = self.row_number(place)
        if number is None:
            raise ValueError(f"{place.label} does not exist; {self.table.remedy(round(place.coordinate))}")
        return np.asarray(self.expansion[[number]].toarray()[0])

    def place_problem(self, place: Place | Distributed, acts: bool) -> tuple[str, str, str] | None:
        """Key, message and remedy where there is no such place, or nothing can act there."""
        assert isinstance(place, Place)  # the scenario refuses the others
        node = round(place.coordinate)
        number = self.row_number(place)
        if number is None:
            if node in self.given.base:
                return "node", f"= {node} moves with the base", "name a node that the base does not hold"
            known = any(each == node for each, _ in self.table.dofs)
            return (
                "direction" if known else "node",
                f"= {place.direction} is not a direction of node {node}"
                if known
                else f"= {node} is not a node of {self.name}",
                self.table.remedy(node),
            )
        if acts and self.massless[number] > 1e-6:
            return (
                "node", f"= {node} has no mass in {place.direction}: a force there would move it without inertia",
                "give the node a mass in the model that writes the matrices, or act on a node with mass",
            )  # fmt: skip
        return None

    @property
    def supports(self) -> tuple[Support, ...]:
        """Every direction of every node that the base holds."""
        given = self.given
        held = _held_rows(given)
        free = np.setdiff1d(np.arange(len(given.table.dofs)), held)
        motion = given.table.of_direction(given.direction)
        motion[free] = self.influence
        inertia = given.mass[held] @ motion

        def on_dofs(matrix: Any) -> Floats:
            return (
                np.zeros((held.size, self.size))
                if matrix is None
                else (self.expansion.T @ matrix[free][:, held]).toarray().T
            )

        rows = (on_dofs(given.stiffness), on_dofs(given.mass), on_dofs(given.damping))
        return tuple(
            Support(
                f"node {given.table.dofs[row][0]}", given.table.dofs[row][1], stiffness, mass, damping,
                inertia=float(inertia[k]), base_motion=float(motion[row]), body=self.name,
                under=partial(self._force_on_row, row), forces={self.name: np.array([stiffness, mass, damping])},
                beside=partial(self._between_rows, row),
            )
            for k, (row, stiffness, mass, damping) in enumerate(zip(held, *rows, strict=True))
        )  # fmt: skip

    def _force_on_row(self, row: int, base: BaseDirection) -> tuple[float, float]:
        """Force on a row of the files for a unit acceleration of the base, kg, and none for its displacement."""
        return float((self.given.mass[[row]] @ self._whole_influence(base))[0]), 0.0

    def _between_rows(self, row: int, other: Support) -> Floats:
        """(3,) force on a row of the files for a unit motion of another row that the base holds, or of itself."""
        if self.expansion.shape[0] != self.size:
            raise MethodError(
                "outputs", f"ask for forces of supports that move, but degrees of freedom of {self.name} without mass "
                "were condensed", "leave out the reactions and energies, or give these degrees of freedom a mass",
            )  # fmt: skip
        given = (self.given.stiffness, self.given.mass, self.given.damping)
        return np.array([0.0 if matrix is None else matrix[row, self._row_of(other)] for matrix in given])

    def _row_of(self, support: Support) -> int:
        """Which row of the files a support holds."""
        return self.given.table.dofs.index((int(support.name.removeprefix("node ")), support.direction))

    def recovered_by(self, number: int, support: Support, order: int = 0) -> float:
        """A row of the recovery matrix for a unit motion of what the base holds."""
        return float(self.given.recovery[number, self._row_of(support)]) * self.given.time_unit**order

    def recovered(self, number: int, motion: BaseDirection, order: int = 0) -> tuple[Floats, float]:
        """A row of the recovery matrix: (N,) for a unit of each degree of freedom, and of the base's motion."""
        held, free = self._rows
        row = self.given.recovery[[number]] * self.given.time_unit**order
        if self._is_default(motion):
            moving = self.given.table.of_direction(self.given.direction)
        else:
            moving = rigid_rows(self.given.table, motion, held)
        moving[free] = self._influence(motion)
        return np.asarray((row[:, free] @ self.expansion).toarray()[0]), float((row @ moving)[0])

    @property
    def total_mass(self) -> float:
        """Mass that a motion of the base moves, kg."""
        motion = self.given.table.of_direction(self.given.direction)
        held = self.given.table.rows_of(self.given.base)
        motion[np.setdiff1d(np.arange(motion.size), held)] = self.influence
        return float(motion @ (self.given.mass @ motion))

    @property
    def named_dofs(self) -> NamedDofs:
        """Those of the files; coordinates of their own where motions without mass were condensed."""
        if self.expansion.shape[0] != self.size:
            return super().named_dofs
        return NamedDofs(self.table, np.ones(self.size), self.influence)

    @property
    def named_matrices(self) -> NamedMatrices:
        """Those of the files, made symmetric."""
        return self.given

    def base_motion_of(self, place: Place, motion: BaseDirection) -> float:
        """How far the place moves with the base, as a rigid body, in its direction."""
        number = self.row_number(place)
        return 0.0 if number is None else float(self._influence(motion)[number])

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground under a unit motion of the base."""
        if self._is_default(motion):
            return self.inertia, self.ground
        held, free = self._rows
        inertia, ground = _base_forces(self.given, held, free, self._whole_influence(motion))
        return np.asarray(self.expansion.T @ inertia) / self.mass_scale, np.asarray(self.expansion.T @ ground)

    def _whole_influence(self, motion: BaseDirection) -> Floats:
        """(rows of the files,) displacement for a unit motion of the base that is not the default."""
        held, free = self._rows
        influence = np.zeros(len(self.given.table.dofs))
        influence[free] = self._influence(motion)
        influence[held] = rigid_rows(self.given.table, motion, held)[held]
        return influence

    def base_supports(self, motion: BaseDirection) -> tuple[Support, ...]:
        """Every direction of every node that the base holds, as far as it moves with it."""
        if self._is_default(motion):
            return self.supports
        held, _ = self._rows
        moved = rigid_rows(self.given.table, motion, held)[held]
        return tuple(replace(each, base_motion=float(w)) for each, w in zip(self.supports, moved, strict=True))

    def _is_default(self, motion: BaseDirection) -> bool:
        return not motion.direction or (not motion.rotates and motion.direction == self.given.direction)

    @cached_property
    def _rows(self) -> tuple[Ints, Ints]:
        """Rows of the files that the base holds, and the others."""
        held = _held_rows(self.given)
        return held, np.setdiff1d(np.arange(len(self.given.table.dofs)), held)

    def _influence(self, motion: BaseDirection) -> Floats:
        """(rows,) displacement for a unit motion of the base."""
        if self._is_default(motion):
            return self.influence
        if motion not in self._influences:
            held, free = self._rows
            lu = None
            if held.size and not self.rigid.shape[1]:
                lu = symmetric_lu(self.given.stiffness[free][:, free].tocsc(), definite=True)
            self._influences[motion] = base_influence(self.given, held, free, motion, lu)[free]
        return self._influences[motion]

    def unit_stiffness(self, site: Site) -> float:
        """Static stiffness of the structure there, N/m; with inertia relief where it is free."""
        row = self.row(site)
        return self.stiffness_scale / float(row @ static_deflections(self, row[:, None])[:, 0])

    def reassembled(self, section: Any) -> MatricesStructure:
        """Itself."""
        return self

    @property
    def stated_damping(self) -> Any:
        """That of the body."""
        return self.whole_damping

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Displacements in the direction of the base, at no more nodes than can be drawn, and where forces act."""
        direction = self.given.direction
        numbers = [i for i, (_, each) in enumerate(self.table.dofs) if each == direction]
        chosen = {numbers[k] for k in np.linspace(0, len(numbers) - 1, min(len(numbers), _MOST_STATIONS)).astype(int)}
        at = {self.row_number(place) for place in sites if place.direction == direction} - {None}
        rows = np.array(sorted(chosen | at, key=lambda i: int(self.table.nodes[i])), dtype=np.int64)
        shapes = self.expansion[rows] @ member.field(basis.vectors) / np.sqrt(member.whole.mass_scale)
        points = None if self.table.coordinates is None else self.table.coordinates[rows]
        return Recovery(self.name, NODES, self.table.nodes[rows].astype(float), np.asarray(shapes), points=points)

    def deflections(self, vectors: Floats) -> Floats:
        """Displacements of nodes, else all that there is."""
        rows = np.flatnonzero([direction in TRANSLATIONS for _, direction in self.table.dofs])
        return np.asarray(self.expansion[rows] @ vectors) if rows.size else np.asarray(vectors)

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute displacement of a node."""
        return float(np.abs(self.deflections(field)).max())

    def largest_at(self, field: Floats) -> str:
        """Node and direction of the largest displacement of a field (N,), or rotation where nothing is displaced."""
        return _largest_at(self.table, self.expansion @ field)

    def point_of(self, place: Place) -> Floats | None:
        """(3,) coordinates of the node, m, where the table gives them."""
        number = self.row_number(place)
        if number is None or self.table.coordinates is None or not np.all(np.isfinite(self.table.coordinates[number])):
            return None
        return np.asarray(self.table.coordinates[number])


def assemble_matrices(section: MatricesBody, name: str = "", nodes: Sequence[Any] = ()) -> MatricesStructure:
    """Read, check, condense and scale the matrices of a body; ``nodes``, where something joins it, are there anyhow.

    Raises
    ------
    ScenarioError
        At the key of the body that is wrong.
    """
    with _located(name):
        given = read_matrices_of(section)
        found = summary_of(given, section, name)
        if section.base != "free":
            given = replace(given, base=section.base.nodes, direction=section.base.direction)
        return replace(structure_of(given, section.damping, name), read=found)


def summarise_files(section: MatricesBody, name: str) -> FileSummary:
    """Read the files of a body, without assembling it.

    Raises
    ------
    ScenarioError
        At the key of the body that is wrong.
    """
    with _located(name):
        return summary_of(read_matrices_of(section), section, name)


@contextmanager
def _located(name: str) -> Iterator[None]:
    """Name the body in errors about its keys."""
    try:
        yield
    except MethodError as error:
        raise ScenarioError(Problem(f"bodies.{name}.{error.about}", error.message, error.remedy)) from None


def structure_of(given: NamedMatrices, damping: Any = None, name: str = "") -> MatricesStructure:
    """The structure of matrices whose base holds what `NamedMatrices.base` says; raises `MethodError`."""
    from scipy.sparse import csc_array, identity

    remarks = list(given.remarks)
    held = _held_rows(given)
    size = len(given.table.dofs)
    free = np.setdiff1d(np.arange(size), held)
    if not free.size:
        raise MethodError("base", "holds every degree of freedom", "name the supported nodes alone")
    mass, stiffness = (matrix[free][:, free].tocsc() for matrix in (given.mass, given.stiffness))
    massive, massless = massless_basis(mass, given.table.part(free))
    if massless.shape[1] and free.size <= CONDENSED_UP_TO:
        expansion = condensation(stiffness, massive, massless)
        remarks.append(f"{massless.shape[1]} motions without mass follow the others statically")
        share = np.asarray(abs(massless).max(axis=1).toarray()).ravel()
    else:
        expansion, share = csc_array(identity(free.size)), np.zeros(free.size)
    reduced_mass, reduced_stiffness = (
        ((m + m.T) / 2).tocsc() for m in (expansion.T @ matrix @ expansion for matrix in (mass, stiffness))
    )
    order = None
    if expansion.shape[0] == expansion.shape[1]:  # nothing was condensed, so that rows are those of nodes
        order = dissection(abs(reduced_stiffness) + abs(reduced_mass), given.table.part(free).coordinates)
    rigid, flexible, factors = rigid_modes(reduced_stiffness, reduced_mass, given.table.part(free), expansion, order)
    if held.size and rigid.shape[1]:
        places = dict.fromkeys(_largest_at(given.table.part(free), motion) for motion in (expansion @ rigid).T)
        motions = "a motion" if rigid.shape[1] == 1 else f"{rigid.shape[1]} motions"
        remarks.append(f"{NOT_HELD}: {motions} without stiffness, largest at {', '.join(places)}")
    lu = None
    if held.size and not rigid.shape[1]:
        lu = _held_factors(stiffness, order) if factors is None or massless.shape[1] else factors
    influence = base_influence(given, held, free, _default_motion(given, held), lu)
    inertia, ground = _base_forces(given, held, free, influence)
    viscous = None if given.damping is None else given.damping[free][:, free].tocsc()
    if viscous is not None:
        viscous = (expansion.T @ viscous @ expansion).tocsc()
    mass_scale = float(np.mean(reduced_mass.diagonal()))
    stiffness_scale = mass_scale * flexible**2 if flexible else 1.0
    rigid = rigid * np.sqrt(mass_scale)
    scaled = reduced_stiffness / stiffness_scale
    factors = None if factors is None else factors.of_multiple(1 / stiffness_scale)
    return MatricesStructure(
        name=name,
        mass=reduced_mass / mass_scale,
        factor=stiffness_factor(scaled, rigid, factors, order),
        damping=viscous,
        inertia=np.asarray(expansion.T @ inertia) / mass_scale,
        ground=np.asarray(expansion.T @ ground),
        rigid=rigid,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        deflection_dofs=np.zeros(0, dtype=np.int64),
        section=None,
        whole_damping=damping,
        given=given,
        table=given.table.part(free),
        expansion=expansion.tocsr(),
        massless=share,
        influence=influence[free],
        given_stiffness=scaled.tocsc(),
        factors=factors,
        order=order,
        notes=tuple(remarks),
    )


def _largest_at(table: DofTable, motion: Floats) -> str:
    """Node and direction of the largest displacement of a motion (N,), or rotation where nothing is displaced."""
    motion = np.abs(motion)
    shifts = np.where([direction in TRANSLATIONS for _, direction in table.dofs], motion, 0.0)
    row = int(np.argmax(shifts if shifts.max() > _RIGID * motion.max() else motion))
    return f"node {table.dofs[row][0]} {table.dofs[row][1]}"


def _held_factors(stiffness: Any, order: Ints | None) -> SymmetricLU:
    """Factors of the stiffness of a structure that the base holds."""
    try:
        return symmetric_lu(stiffness, definite=True, order=order)
    except RuntimeError:  # exactly singular, yet no motion was found to be rigid
        raise MethodError("stiffness", "is singular although the base holds the structure", _SOFT) from None


def _default_motion(given: NamedMatrices, held: Ints) -> BaseDirection:
    """The direction that the section names; a rotation is one about the first node that is held."""
    points = given.table.coordinates
    if points is None or not held.size or not np.all(np.isfinite(points[held[0]])):
        return BaseDirection(given.direction)
    x, y, z = points[held[0]].tolist()
    return BaseDirection(given.direction, (x, y, z))


def _base_forces(given: NamedMatrices, held: Ints, free: Ints, influence: Floats) -> tuple[Floats, Floats]:
    """(free,) inertia, kg, and force of springs to the ground, N/m, under a unit motion of the base.

    Raises
    ------
    MethodError
        Where dashpots go to something that does not move with the base.
    """
    stiffness = given.stiffness[free][:, free]
    ground = -(stiffness @ influence[free]) if not held.size else np.zeros(free.size)
    if np.abs(ground).max() <= GROUNDED * (abs(stiffness) @ np.abs(influence[free])).max(initial=0.0):
        ground = np.zeros(free.size)
    if given.damping is not None:
        dragged = given.damping[free] @ influence
        if np.abs(dragged).max() > GROUNDED * (abs(given.damping[free]) @ np.abs(influence)).max():
            raise MethodError(
                "viscous", "damps a rigid motion of the base: dashpots go to something that does not move with it",
                "remove dashpots to ground from the model",
            )  # fmt: skip
    return given.mass[free] @ influence, ground


def _held_rows(given: NamedMatrices) -> Ints:
    for k, node in enumerate(given.base):
        if not given.table.rows_of([node]).size:
            raise MethodError(f"base.nodes[{k}]", f"= {node} is not a node of the matrices", given.table.remedy(node))
    return given.table.rows_of(given.base)


def rigid_modes(
    stiffness: Any, mass: Any, table: DofTable, expansion: Any, order: Ints | None = None
) -> tuple[Floats, float, SymmetricLU | None]:
    """(N, r) motions without strain energy, orthonormal in the mass matrix, and the first flexible frequency, rad/s.

    Of a large structure that is held firmly, by its pivots, also the factors of its stiffness; else None.

    Raises
    ------
    MethodError
        If the stiffness or the mass matrix is not positive semidefinite.
    """
    from scipy.linalg import LinAlgError, eigh
    from scipy.sparse.linalg import LinearOperator, eigsh

    size = mass.shape[0]
    count = min(size, 8)
    if size <= _DENSE:
        try:
            squared, vectors = eigh(stiffness.toarray(), mass.toarray(), subset_by_index=[0, count - 1])
        except LinAlgError:
            raise MethodError("mass", "is not positive definite", "check the model that wrote it") from None
    elif (held := _held_firmly(stiffness, order)) is not None:
        inverse = LinearOperator(mass.shape, matvec=held.solve)
        squared = eigsh(
            stiffness, k=1, M=mass, sigma=0.0, OPinv=inverse, v0=np.linspace(1.0, 2.0, size), tol=_SCALE_ONLY,
            return_eigenvectors=False,
        )  # fmt: skip
        return np.zeros((size, 0)), float(np.sqrt(squared[0])), held
    else:
        shift = -1e-9 * float(np.median(stiffness.diagonal()) / np.mean(mass.diagonal()))
        inverse = LinearOperator(
            mass.shape, matvec=symmetric_lu(stiffness - shift * mass, definite=True, order=order).solve
        )
        squared, vectors = eigsh(stiffness, k=count, M=mass, sigma=shift, OPinv=inverse, v0=np.linspace(1.0, 2.0, size))
        order = np.argsort(squared)
        squared, vectors = squared[order], vectors[:, order]
    one_by_one = (abs(stiffness) @ np.abs(vectors)).max(axis=0)
    force = np.abs(stiffness @ vectors).max(axis=0) / np.where(one_by_one > 0, one_by_one, 1.0)
    rigid = 0
    for k in range(1, min(count, 7)):
        if force[:k].max() <= _RIGID and (k == size or abs(squared[k - 1]) <= _GAP * squared[min(k, count - 1)]):
            rigid = k
    lowest = squared[rigid:]
    if lowest.size and lowest[0] <= 0:
        node, direction = table.dofs[int(np.argmax(np.abs(expansion @ vectors[:, rigid])))]
        raise MethodError(
            "stiffness", f"is not positive semidefinite: a motion largest at node {node} {direction} releases energy",
            _SOFT,
        )  # fmt: skip
    null = vectors[:, :rigid]
    if rigid:
        null = orthonormal_in_mass(null, mass)
    return np.asarray(null), float(np.sqrt(lowest[0])) if lowest.size else 0.0, None


def _held_firmly(stiffness: Any, order: Ints | None) -> SymmetricLU | None:
    """Factors of a stiffness whose pivots are all far above those that a motion without strain energy leaves."""
    try:
        factors = symmetric_lu(stiffness, definite=True, order=order)
    except RuntimeError:  # exactly singular
        return None
    return factors if factors.pivots.min() > _FIRM else None


def stiffness_factor(
    stiffness: Any, rigid: Floats, factors: SymmetricLU | None = None, order: Ints | None = None
) -> Any:
    """(p, N) sparse B with K = B^T B and B R = 0: the Cholesky factor of what is left when rigid motions are held.

    Held at as many degrees of freedom as there are rigid motions, where these differ most, the structure has a positive
    definite stiffness; B of the others is applied to the motion less the rigid one that those have. ``factors`` of K
    may be known.
    """
    from scipy.linalg import qr
    from scipy.sparse import csr_array

    size, count = rigid.shape
    pinned = np.sort(qr(rigid.T, pivoting=True)[2][:count]) if count else np.zeros(0, dtype=np.int64)
    others = np.setdiff1d(np.arange(size), pinned)
    if not others.size:
        return csr_array((0, size))
    if factors is None:
        within = None if order is None else np.argsort(np.argsort(order)[others])
        lu = symmetric_lu(stiffness[others][:, others], definite=True, order=within)
    else:
        lu = factors
    if np.any(lu.pivots <= 0):
        raise MethodError(
            "stiffness",
            f"is not positive semidefinite: {int(np.sum(lu.pivots <= 0))} of its pivots are negative",
            _SOFT,
        )
    factor = lu.root
    if not count:
        return factor
    # B acts on u_o - R_o R_p^-1 u_p.
    selection = csr_array((np.ones(others.size), (np.arange(others.size), others)), shape=(others.size, size))
    followed = csr_array(rigid[others] @ np.linalg.inv(rigid[pinned]))
    pins = csr_array((np.ones(count), (np.arange(count), pinned)), shape=(count, size))
    return csr_array(factor @ (selection - followed @ pins))
