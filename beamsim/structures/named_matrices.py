r"""Matrices of a body by named degrees of freedom: node and direction, as other programs have them.

The coordinates q of a body are relative to its base. With the absolute displacements :math:`u = q + r d` the base's
displacement d becomes a degree of freedom of its own,

.. math:: M = \begin{pmatrix} M_{qq} & L - M_{qq} r \\ \cdot & r^T M_{qq} r - 2 r^T L + m \end{pmatrix}, \quad
    K = \begin{pmatrix} K_{qq} & -K_{qq} r \\ \cdot & r^T K_{qq} r \end{pmatrix},

with L the inertia under a motion of the base and m the mass of the body.

Matrices from and to the units of other programs: with L, M, F and T the SI sizes of the units of length, mass, force
and time, the energies of a file are in F L (strain energy) and in :math:`M L^2 / T^2` (kinetic energy), and a degree of
freedom u is in units of s: L of a displacement, 1 (rad) of a rotation. With D the diagonal matrix of 1 / s

.. math:: K_{SI} = F L\, D K D, \quad M_{SI} = M L^2\, D M D, \quad C_{SI} = F L T\, D C D.

A modal coordinate has :math:`s = L \sqrt{M}`, so that modes that are normalised to a unit modal mass stay that, as if
the model had been in SI units; of any other scaling the motion of the nodes is the same.
"""

from __future__ import annotations

import csv
from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import block_array, csc_array, diags_array, eye_array

from beamsim.dofs import DIRECTIONS, MODAL, Dof
from beamsim.errors import InputFileError, MethodError
from beamsim.files import reading
from beamsim.measurements.tables import NamedColumns, read_named_columns
from beamsim.scenario import units as si
from beamsim.scenario.base import MOST_NAMES
from beamsim.scenario.files import DecimalMark
from beamsim.scenario.matrices import FileUnits, UnitSizes, UnitSystem
from beamsim.typing import Floats, Ints

TRANSLATIONS = DIRECTIONS[:3]


@dataclass(frozen=True)
class DofTable:
    """Row i of the matrices belongs to ``dofs[i]``."""

    dofs: tuple[Dof, ...]
    coordinates: Floats | None = None  # (N, 3) of each row's node, m beyond the file; NaN where none are given
    systems: Ints | None = None  # (N,) number of the system of each row in the file; 0 of the model's axes
    to_file_systems: Any = None  # (N, N) sparse, rows as they were in those systems; None where there were none

    @cached_property
    def number(self) -> dict[Dof, int]:
        """Row of each node and direction; modal coordinates of one node are distinguished by their order alone."""
        return {dof: i for i, dof in enumerate(self.dofs) if dof[1] != MODAL}

    @cached_property
    def nodes(self) -> Ints:
        """(N,) node of each row."""
        return np.array([node for node, _ in self.dofs], dtype=np.int64)

    def of_direction(self, direction: str) -> Floats:
        """(N,) 1 where a row has this direction, else 0."""
        return np.array([1.0 if each == direction else 0.0 for _, each in self.dofs])

    def rows_of(self, nodes: Sequence[int]) -> Ints:
        """Rows of these nodes."""
        return np.flatnonzero(np.isin(self.nodes, nodes))

    def part(self, rows: Ints) -> DofTable:
        """The table of some rows."""
        coordinates = None if self.coordinates is None else self.coordinates[rows]
        systems = None if self.systems is None else self.systems[rows]
        turn = None if self.to_file_systems is None else self.to_file_systems[rows][:, rows]
        return DofTable(tuple(self.dofs[i] for i in rows), coordinates, systems, turn)

    def row(self, node: int, direction: str) -> Floats | None:
        """(N,) shares in a direction of a node, an axis of the model or of its own system (``local_x``)."""
        number = self.number.get((node, direction.removeprefix("local_")))
        turned = self.to_file_systems is not None and direction.startswith("local_")
        units = self.to_file_systems if turned else eye_array(len(self.dofs), format="csr")
        return None if number is None else np.asarray(units[[number]].toarray()[0])

    def remedy(self, node: int) -> str:
        """What there is instead of an unknown node, or direction of a node."""
        directions = [each for number, each in self.dofs if number == node]
        if directions:
            return f"node {node} has {', '.join(directions)}"
        known = sorted({number for number, each in self.dofs if each != MODAL})
        if not known:
            return "there are modal coordinates alone"
        if len(known) <= MOST_NAMES:
            return f"the nodes are {', '.join(map(str, known))}"
        k = bisect(known, node)
        next_to = f"; next to it are {known[k - 1]} and {known[k]}" if 0 < k < len(known) else ""
        return f"the {len(known)} nodes are numbered from {known[0]} to {known[-1]}{next_to}"


@dataclass(frozen=True)
class NamedDofs:
    """Degrees of freedom of a body as other programs have them."""

    table: DofTable
    scale: Floats  # (N,) what the table names, in m and rad, for a unit of each degree of freedom
    influence: Floats  # (N,) each, in the table's units, when the base moves by 1 m


_TABLE_LAYOUT = "head its columns node, direction and, if wanted, x (mm), y (mm), z (mm) and system, in any order"
_AXES = ("x", "y", "z")


def read_dof_table(path: Path, length: float = 1.0, decimal: DecimalMark | None = None) -> DofTable:
    """The table of a text file with columns headed node, direction and, if wanted, x, y, z, and system, in any order.

    Parameters
    ----------
    path : of the file.
    length : m, the unit of the coordinates that the table gives back, and of those whose headings have no unit.
    decimal : decimal mark of the numbers, where the user states it.

    Returns
    -------
    DofTable

    Raises
    ------
    MethodError
        About ``dofs``: the file cannot be read, headings are missing or unknown, a line is wrong, or two lines name the
        same.
    """
    try:
        with reading(path, "a table of degrees of freedom"):
            return _dof_table(path, length, decimal)
    except InputFileError as error:
        raise MethodError("dofs", f"= {path.name} {error.message}", error.remedy) from None


def _dof_table(path: Path, length: float, decimal: DecimalMark | None) -> DofTable:
    """See `read_dof_table`."""
    table = read_named_columns(path, decimal, texts=("direction",))
    columns, factors = _dof_columns(table, length)
    dofs: list[Dof] = []
    places: list[list[float]] = []
    systems: list[int] = []
    first: dict[Dof, int] = {}
    for number, cells in table.rows:
        direction = cells[columns["direction"]].lower()
        if direction not in (*DIRECTIONS, MODAL):
            raise MethodError(
                "dofs", f"= {path.name} has the direction {direction or 'missing'} in line {number}",
                f"directions are {', '.join(DIRECTIONS)} and {MODAL}",
            )  # fmt: skip
        try:
            node = cells[columns["node"]]
            dof = (int(node or 0) if direction == MODAL else int(node), direction)
            place = [cells[columns[axis]] if axis in columns else "" for axis in _AXES]
            places.append(
                [float(cell) * factors[axis] if cell else np.nan for axis, cell in zip(_AXES, place, strict=True)]
            )
            systems.append(int(cells[columns["system"]] or 0) if "system" in columns else 0)
        except ValueError:
            raise MethodError(
                "dofs",
                f"= {path.name} has a line {number} that cannot be read: {','.join(cells)}",
                "write a node's number, a direction and, if wanted, three coordinates and the number of a system",
            ) from None
        if direction != MODAL and dof in first:
            raise MethodError(
                "dofs", f"= {path.name} names node {dof[0]} {direction} in lines {first[dof]} and {number}",
                "give each row of the matrices one line",
            )  # fmt: skip
        first[dof] = number
        dofs.append(dof)
    coordinates = np.array(places).reshape(-1, 3)
    placed = None if np.all(np.isnan(coordinates)) else coordinates
    return DofTable(tuple(dofs), placed, np.array(systems, dtype=np.int64) if "system" in columns else None)


def _dof_columns(table: NamedColumns, length: float) -> tuple[dict[str, int], dict[str, float]]:
    """Number of each column by its name, and the factor of each coordinate.

    Raises
    ------
    InputFileError
        If a heading is missing, unknown or there twice, or has a unit that is none of a length.
    """
    names = table.names
    missing = [name for name in ("node", "direction") if name not in names]
    if missing:
        raise InputFileError(f"has no heading {' and no heading '.join(missing)} in line {table.line}", _TABLE_LAYOUT)
    for name, heading in zip(names, table.headings, strict=True):
        if name not in ("node", "direction", "system", *_AXES):
            raise InputFileError(
                f"has an unknown heading {heading or '(an empty one)'} in line {table.line}", _TABLE_LAYOUT
            )
        if names.count(name) > 1:
            raise InputFileError(f"has two columns {name} in line {table.line}", "leave one of them out")
    columns = {name: k for k, name in enumerate(names)}
    factors = {}
    for axis in (name for name in _AXES if name in columns):
        unit = table.units[columns[axis]]
        try:
            factors[axis] = si.read_quantity(f"1 {unit}", si.LENGTH) / length if unit else 1.0
        except si.UnitError as error:
            heading = table.headings[columns[axis]]
            message = f"has the heading {heading} in line {table.line}: {unit} {error.message}"
            raise InputFileError(message, _TABLE_LAYOUT) from None
    return columns, factors


def write_dof_table(path: Path, table: DofTable) -> None:
    """Write a table that `read_dof_table` reads."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["node", "direction"] if table.coordinates is None else ["node", "direction", "x", "y", "z"])
        for i, dof in enumerate(table.dofs):
            place = [] if table.coordinates is None else table.coordinates[i].tolist()
            writer.writerow([*dof, *("" if np.isnan(x) else repr(x) for x in place)])


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


def moves_freely(stiffness: Any, motion: Floats, tolerance: float = 1e-6) -> bool:
    """Whether the forces of a motion are round-off compared with those that the entries of K would give one by one.

    Parameters
    ----------
    stiffness : (N, N) sparse K.
    motion : (N,).
    tolerance : what counts as round-off.

    Returns
    -------
    bool
    """
    return bool(np.abs(stiffness @ motion).max() <= tolerance * (abs(stiffness) @ np.abs(motion)).max())


_ROUND_OFF = 1e-9  # of forces, within which a motion of the base leaves none


def with_base_node(
    named_dofs: NamedDofs, mass: Any, stiffness: Any, damping: Any, inertia: Floats, total_mass: float
) -> NamedMatrices:
    """Matrices of a body on its supports, which move with a node of their own, the last one; none without supports.

    Parameters
    ----------
    named_dofs : names and units of the degrees of freedom.
    mass, stiffness, damping : (N, N) sparse, physical, for the degrees of freedom as the body has them; damping may be
        None, and acts on motion relative to the base.
    inertia : (N,) kg under a unit acceleration of the base.
    total_mass : kg, with what the supports hold.

    Returns
    -------
    NamedMatrices
        Absolute displacements.
    """
    physical: Any = diags_array(1 / named_dofs.scale)
    mass, stiffness = (physical @ matrix @ physical for matrix in (mass, stiffness))
    damping = None if damping is None else physical @ damping @ physical
    load = inertia / named_dofs.scale
    r = named_dofs.influence
    if moves_freely(stiffness, r, _ROUND_OFF) and np.abs(load - mass @ r).max() <= _ROUND_OFF * np.abs(load).max():
        return NamedMatrices(named_dofs.table, mass, stiffness, damping, ())
    base = int(named_dofs.table.nodes.max()) + 1
    places = named_dofs.table.coordinates
    return NamedMatrices(
        DofTable((*named_dofs.table.dofs, (base, "z")), None if places is None else np.vstack([places, np.zeros(3)])),
        _with_base(mass, load - mass @ r, float(r @ (mass @ r) - 2 * r @ load + total_mass)),
        _with_base(stiffness, -(stiffness @ r), float(r @ (stiffness @ r))),
        None if damping is None else _with_base(damping, -(damping @ r), float(r @ (damping @ r))),
        (base,),
    )


def _with_base(matrix: Any, column: Floats, corner: float) -> Any:
    """The matrix with one more row and column."""
    border = csc_array(column[:, None])
    return block_array([[matrix, border], [border.T, csc_array([[corner]])]], format="csc")


def in_si_units(matrices: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """Matrices, recovery matrix and coordinates of a file in SI units.

    The rows of a recovery matrix give what they gave, in the units of the file, now for motions in SI units.
    """
    length, mass, force, time = sizes
    if all(size == 1.0 for size in sizes):
        return matrices
    by_direction = {MODAL: length * np.sqrt(mass), **dict.fromkeys(TRANSLATIONS, length)}
    units = np.array([by_direction.get(direction, 1.0) for _, direction in matrices.table.dofs])
    diagonal: Any = diags_array(1.0 / units)

    def scaled(matrix: Any, factor: float) -> Any:
        return None if matrix is None else (factor * (diagonal @ matrix @ diagonal)).tocsc()

    places = matrices.table.coordinates
    return replace(
        matrices,
        table=replace(matrices.table, coordinates=None if places is None else places * length),
        mass=scaled(matrices.mass, mass * length**2),
        stiffness=scaled(matrices.stiffness, force * length),
        damping=scaled(matrices.damping, force * length * time),
        recovery=None if matrices.recovery is None else (matrices.recovery @ diagonal).tocsr(),
        time_unit=matrices.time_unit * time,
    )


def in_units(matrices: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """The reverse: matrices and coordinates in SI units as a file in other units has them."""
    return in_si_units(matrices, type(sizes)(*(1.0 / size for size in sizes)))


# Mass over the cube of the largest dimension, kg/m^3: a wire of 0.2 mm and 10 m has 2e-5, a block of tungsten 2e4, and
# 10 kg on interface nodes 5 mm apart 8e7.
LIGHTEST, HEAVIEST = 1e-6, 1e8


@dataclass(frozen=True)
class SizeAndMass:
    """What of a structure shows mistaken units."""

    mass: float | None  # kg, the largest of the directions; None where nothing is displaced
    extent: Floats | None  # (3,) m, of all nodes along x, y and z; None without coordinates

    @property
    def text(self) -> str:
        """Both in words."""
        mass = "mass unknown (modal coordinates alone)" if self.mass is None else f"{self.mass:.4g} kg"
        if self.extent is None:
            return f"{mass}, size unknown (no coordinates)"
        return f"{mass}, {' x '.join(f'{each:.4g}' for each in self.extent)} m"


def size_and_mass(matrices: NamedMatrices) -> SizeAndMass:
    """Mass from translations of all nodes, size from their coordinates."""
    moved = [matrices.table.of_direction(direction) for direction in TRANSLATIONS]
    masses = [float(motion @ (matrices.mass @ motion)) for motion in moved if motion.any()]
    places = matrices.table.coordinates
    if places is not None:
        places = places[np.all(np.isfinite(places), axis=1)]
    extent = None if places is None or not places.size else np.ptp(places, axis=0)
    return SizeAndMass(max(masses, default=None), extent)


def doubtful_units(matrices: NamedMatrices, units: UnitSystem | FileUnits | None) -> list[str]:
    """A warning where size and mass are those of a structure in other units than its files are taken to be in.

    Frequencies do not show it: those in mm, t and s are the same.
    """
    found = size_and_mass(matrices)
    if found.mass is None or found.extent is None or found.mass <= 0.0:
        return []
    largest = float(found.extent.max())
    density = found.mass / largest**3 if largest > 0.0 else 0.0
    if units is None and 0.0 < density < LIGHTEST:
        return [
            f"the structure has {found.text}, if its files are in SI units: are they in mm or inches? Then give "
            "units: mm-t-s, in-lbf-s or as the model has them; units: SI confirms these"
        ]
    if units not in (None, "SI") and density > HEAVIEST:
        return [
            f"the structure has {found.text}, with its files in {matrices.units}: are the coordinates of the table in "
            "metres? All files of a body have the same units"
        ]
    return []


@dataclass(frozen=True)
class FileSummary:
    """What the files of a body hold, in SI units, as they are taken."""

    body: str
    degrees_of_freedom: int
    units: str  # of the files
    units_assumed: bool  # whether the units were not stated
    size_and_mass: SizeAndMass
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """In words."""
        units = f"{self.units}, the default" if self.units_assumed else self.units
        count = f"{self.degrees_of_freedom} degrees of freedom"
        return f"{self.body}: {count}, {self.size_and_mass.text}; units of its files: {units}"

    @property
    def as_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "degrees_of_freedom": self.degrees_of_freedom,
            "units": self.units,
            "units_by_default": self.units_assumed,
            "mass_kg": self.size_and_mass.mass,
            "extent_m": None if self.size_and_mass.extent is None else self.size_and_mass.extent.tolist(),
        }
