r"""Matrices of a body with named degrees of freedom (node and direction), as in other programs.

The coordinates q of a body are relative to its base. With the absolute displacements :math:`u = q + r d` the base's
displacement d becomes a degree of freedom of its own,

.. math:: M = \begin{pmatrix} M_{qq} & L - M_{qq} r \\ \cdot & r^T M_{qq} r - 2 r^T L + m \end{pmatrix}, \quad
    K = \begin{pmatrix} K_{qq} & -K_{qq} r \\ \cdot & r^T K_{qq} r \end{pmatrix},

with L the inertia under a motion of the base and m the mass of the body.

Unit conversion: with L, M, F and T the SI sizes of the units of length, mass, force and time, energies in a file are in
F L (strain energy) and in :math:`M L^2 / T^2` (kinetic energy), and the unit s of a degree of freedom is L for a
displacement and 1 (rad) for a rotation. With D the diagonal matrix of 1 / s,

.. math:: K_{SI} = F L\, D K D, \quad M_{SI} = M L^2\, D M D, \quad C_{SI} = F L T\, D C D.

A modal coordinate has :math:`s = L \sqrt{M}`, so that modes with unit modal mass keep it, as if the model were in SI
units; for other scalings the motion of the nodes is the same.
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
    """Names of the rows of matrices: row i belongs to ``dofs[i]``."""

    dofs: tuple[Dof, ...]
    # (N, 3) coordinates of each row's node, m outside the file reader; NaN if unknown
    coordinates: Floats | None = None
    systems: Ints | None = None  # (N,) system of each row in the file; 0 for the axes of the model
    to_file_systems: Any = None  # (N, N) sparse map to the original rows in those systems; None without

    @cached_property
    def number(self) -> dict[Dof, int]:
        """Row of each node and direction; modal coordinates of a node differ only by their order."""
        return {dof: i for i, dof in enumerate(self.dofs) if dof[1] != MODAL}

    @cached_property
    def nodes(self) -> Ints:
        """(N,) node of each row."""
        return np.array([node for node, _ in self.dofs], dtype=np.int64)

    def of_direction(self, direction: str) -> Floats:
        """(N,) 1 for rows with this direction, else 0."""
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
        """(N,) factors for a direction of a node, along an axis of the model or of its own system (``local_x``)."""
        number = self.number.get((node, direction.removeprefix("local_")))
        turned = self.to_file_systems is not None and direction.startswith("local_")
        units = self.to_file_systems if turned else eye_array(len(self.dofs), format="csr")
        return None if number is None else np.asarray(units[[number]].toarray()[0])

    def remedy(self, node: int) -> str:
        """Remedy for an unknown node, or an unknown direction of a node."""
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
    """Degrees of freedom of a body with names for other programs."""

    table: DofTable
    scale: Floats  # (N,) named quantity, in m and rad, for a unit of each degree of freedom
    influence: Floats  # (N,) motion of each, in the table's units, when the base moves by 1 m


_TABLE_LAYOUT = "head its columns node, direction and, if wanted, x (mm), y (mm), z (mm) and system, in any order"
_AXES = ("x", "y", "z")


def read_dof_table(path: Path, length: float = 1.0, decimal: DecimalMark | None = None) -> DofTable:
    """Read a text table with columns headed node, direction and optionally x, y, z and system, in any order.

    Parameters
    ----------
    path : path of the file.
    length : m, unit of the returned coordinates, and of coordinates without a unit in their heading.
    decimal : decimal mark of the numbers, if the user gives it.

    Returns
    -------
    DofTable

    Raises
    ------
    MethodError
        About ``dofs``: the file cannot be read, headings are missing or unknown, a line is invalid, or two lines
        have the same name.
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
    """Index of each column by its name, and the unit factor of each coordinate.

    Raises
    ------
    InputFileError
        If a heading is missing, unknown or repeated, or its unit is not a length.
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
    """Write a table that `read_dof_table` can read."""
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["node", "direction"] if table.coordinates is None else ["node", "direction", "x", "y", "z"])
        for i, dof in enumerate(table.dofs):
            place = [] if table.coordinates is None else table.coordinates[i].tolist()
            writer.writerow([*dof, *("" if np.isnan(x) else repr(x) for x in place)])


@dataclass(frozen=True)
class NamedMatrices:
    """Matrices in SI units, with the names of their rows."""

    table: DofTable
    mass: Any  # (N, N) sparse, kg
    stiffness: Any  # (N, N) sparse, N/m
    damping: Any  # (N, N) sparse, N s/m: dashpots and viscous damping; None without
    base: tuple[int, ...]  # nodes that move with the base; empty without base
    direction: str = "z"  # direction of the base motion
    remarks: tuple[str, ...] = ()  # changes made to the matrices of files
    recovery: Any = None  # (k, N) sparse recovery matrix of other quantities; None without
    rows: Floats | None = None  # (k, N) further places: factors of the degrees of freedom; None without
    time_unit: float = 1.0  # s, unit of time in velocities and accelerations for recovery
    units: str = ""  # units of the files


def moves_freely(stiffness: Any, motion: Floats, tolerance: float = 1e-6) -> bool:
    """Whether the forces of a motion are only round-off, compared with the absolute contributions of the entries of K.

    Parameters
    ----------
    stiffness : (N, N) sparse K.
    motion : (N,).
    tolerance : largest relative force that counts as round-off.

    Returns
    -------
    bool
    """
    return bool(np.abs(stiffness @ motion).max() <= tolerance * (abs(stiffness) @ np.abs(motion)).max())


_ROUND_OFF = 1e-9  # relative force of a motion of the base that counts as zero


def with_base_node(
    named_dofs: NamedDofs, mass: Any, stiffness: Any, damping: Any, inertia: Floats, total_mass: float
) -> NamedMatrices:
    """Matrices of a body with an additional last node for its supports; unchanged without supports.

    Parameters
    ----------
    named_dofs : names and units of the degrees of freedom.
    mass, stiffness, damping : (N, N) sparse, physical, for the degrees of freedom of the body; damping may be None, and
        acts on motion relative to the base.
    inertia : (N,) inertia load of a unit base acceleration, kg.
    total_mass : kg, including the fixed degrees of freedom.

    Returns
    -------
    NamedMatrices
        For absolute displacements.
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
    """The matrix with an additional row and column."""
    border = csc_array(column[:, None])
    return block_array([[matrix, border], [border.T, csc_array([[corner]])]], format="csc")


def in_si_units(matrices: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """Convert matrices, recovery matrix and coordinates of a file to SI units.

    The quantities of the recovery matrix keep their unit; they are now computed from motions in SI units.
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
        rows=None if matrices.rows is None else length * (matrices.rows @ diagonal),
        time_unit=matrices.time_unit * time,
    )


def in_units(matrices: NamedMatrices, sizes: UnitSizes) -> NamedMatrices:
    """Convert matrices and coordinates from SI units to other units."""
    return in_si_units(matrices, type(sizes)(*(1.0 / size for size in sizes)))


# Mass over the cube of the largest dimension, kg/m^3: a wire of 0.2 mm and 10 m has 2e-5, a block of tungsten 2e4,
# and 10 kg on interface nodes 5 mm apart 8e7.
LIGHTEST, HEAVIEST = 1e-6, 1e8


@dataclass(frozen=True)
class SizeAndMass:
    """Size and mass of a structure, which reveal wrong units."""

    mass: float | None  # kg, largest value over the directions; None without displacements
    extent: Floats | None  # (3,) m, extent of the nodes along x, y and z; None without coordinates

    @property
    def text(self) -> str:
        """Size and mass as text."""
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
    """A warning if size and mass suggest other units than those assumed for the files.

    Frequencies alone do not reveal this: those in mm, t and s are the same.
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
    """Contents of the files of a body, in SI units, as used."""

    body: str
    degrees_of_freedom: int
    units: str  # units of the files
    units_assumed: bool  # whether the units are the default
    size_and_mass: SizeAndMass
    remarks: tuple[str, ...]

    @property
    def text(self) -> str:
        """The summary as text."""
        units = f"{self.units}, the default" if self.units_assumed else self.units
        count = f"{self.degrees_of_freedom} degrees of freedom"
        return f"{self.body}: {count}, {self.size_and_mass.text}; units: {units}"

    @property
    def as_json(self) -> dict[str, Any]:
        """The summary for ``--json``."""
        return {
            "degrees_of_freedom": self.degrees_of_freedom,
            "units": self.units,
            "units_by_default": self.units_assumed,
            "mass_kg": self.size_and_mass.mass,
            "extent_m": None if self.size_and_mass.extent is None else self.size_and_mass.extent.tolist(),
        }
