"""A body whose mass and stiffness matrices another program wrote."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import InvalidValueError, Path, Schema, Variants
from beamsim.scenario.body import Body, ChainDamping, NodeDirection
from beamsim.scenario.files import AnyTableFile
from beamsim.scenario.quantities import Coefficient, Count, FileName, Frequency, Name, Text, UnitType

_INCH, _FOOT, _POUND_FORCE = 0.0254, 0.3048, 4.4482216152605


class UnitSizes(NamedTuple):
    """SI sizes of the units of a file."""

    length: float  # m
    mass: float  # kg
    force: float  # N
    time: float  # s


UnitSystem = Literal["SI", "mm-t-s", "mm-kg-ms", "mm-g-ms", "mm-kg-s", "cm-g-s", "in-lbf-s", "ft-lbf-s"]
SYSTEMS: dict[str, UnitSizes] = {
    "SI": UnitSizes(1.0, 1.0, 1.0, 1.0),
    "mm-t-s": UnitSizes(1e-3, 1e3, 1.0, 1.0),
    "mm-kg-ms": UnitSizes(1e-3, 1.0, 1e3, 1e-3),
    "mm-g-ms": UnitSizes(1e-3, 1e-3, 1.0, 1e-3),
    "mm-kg-s": UnitSizes(1e-3, 1.0, 1e-3, 1.0),
    "cm-g-s": UnitSizes(1e-2, 1e-3, 1e-5, 1.0),
    "in-lbf-s": UnitSizes(_INCH, _POUND_FORCE / _INCH, _POUND_FORCE, 1.0),
    "ft-lbf-s": UnitSizes(_FOOT, _POUND_FORCE / _FOOT, _POUND_FORCE, 1.0),
}
"""Consistent systems, whose force gives a unit of mass a unit of acceleration: length, mass and time in their names; of
the last two length, force and time."""
assert set(SYSTEMS) == set(get_args(UnitSystem))


class FileUnits(Schema):
    """Units of a file one by one: of lengths, masses, forces and times."""

    length: Annotated[str, UnitType(of=units.LENGTH, example="mm")]
    """Unit of displacements and coordinates: mm, in."""
    mass: Annotated[str, UnitType(of=units.MASS, example="kg")]
    """Unit of the mass matrix: kg, t, lb where weights were given and WTMASS was left out."""
    force: Annotated[str, UnitType(of=units.FORCE, example="N")]
    """Unit of forces; those of the stiffness matrix are this over the length: N, lbf."""
    time: Annotated[str, UnitType(of=units.TIME, example="s")] = "s"
    """Unit of times, of velocities in the viscous matrix: s, ms."""


AnyFileUnits = Annotated[
    UnitSystem | FileUnits,
    Variants("is not a system of units", f"write {', '.join(SYSTEMS)}, or {{length: mm, mass: kg, force: N, time: s}}"),
]
"""A system by its name, or units one by one."""


def sizes_of(file_units: UnitSystem | FileUnits | None) -> UnitSizes:
    """SI sizes of the units; SI units where none are given."""
    if isinstance(file_units, FileUnits):
        return UnitSizes(
            units.size_of(file_units.length, units.LENGTH), units.size_of(file_units.mass, units.MASS),
            units.size_of(file_units.force, units.FORCE), units.size_of(file_units.time, units.TIME),
        )  # fmt: skip
    return SYSTEMS[file_units or "SI"]


def name_of(file_units: UnitSystem | FileUnits | None) -> str:
    """The units in words."""
    if isinstance(file_units, FileUnits):
        return ", ".join(getattr(file_units, name) for name in UnitSizes._fields)
    return file_units or "SI"


class MatrixSource(Schema):
    """A matrix in a file."""

    file: FileName
    """OP2, OP4, DMIG, MatrixMarket, Abaqus, Harwell-Boeing, MATLAB or NumPy; relative to the scenario's folder."""
    name: Text | None = None
    """Name of the matrix in the file, upper or lower case; not needed where the file holds one."""


class RecoverySource(MatrixSource):
    """A matrix that gives other quantities from the degrees of freedom: stress, strain, or motion elsewhere."""

    rows: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of its rows, in their order; its columns are the degrees of freedom, in the order of the other matrices."""

    def check(self) -> None:
        """Names are unique."""
        for k, name in enumerate(self.rows):
            if name in self.rows[:k]:
                raise InvalidValueError(f"names {name} twice", "give each row a name of its own", ("rows", k))


class StructuralDamping(Schema):
    """Structural damping (K4, or the imaginary part of K), taken as viscous damping: exact at one frequency alone."""

    file: FileName | None = None
    """File of the matrix K4; by default the imaginary part of the stiffness matrix is meant."""
    name: Text | None = None
    """Name of the matrix in the file."""
    frequency: Frequency
    """Frequency at which the viscous damping has the same effect: C = K4 / (2 pi frequency)."""


class HeldNodes(Schema):
    """Nodes that move with the base."""

    nodes: Annotated[tuple[Count, ...], Field(min_length=1)]
    """Numbers of the nodes; all of their degrees of freedom move with the base."""
    direction: NodeDirection = "z"
    """Direction in which the base moves, and in which gravity acts."""


class DisplacementSystem(Schema):
    """A coordinate system of nodes in the files, as the field CD of Nastran and *TRANSFORM of Abaqus name one."""

    number: Count
    """Number by which the column ``system`` of the table ``dofs`` names it."""
    kind: Literal["rectangular", "cylindrical"] = "rectangular"
    """Directions x, y, z of the table are its axes; of a cylinder the radial, the tangential and the axial one."""
    points: tuple[tuple[Coefficient, Coefficient, Coefficient], ...] = Field(min_length=3, max_length=3)
    """Its origin, a point on its z axis, and one in the half plane of its x axis, as CORD2R and CORD2C have them;
    [x, y, z] in the axes of the model and the units of the files."""

    def check(self) -> None:
        """Points on a line make no system."""
        _, b, c = (tuple(x - o for x, o in zip(point, self.points[0], strict=True)) for point in self.points)
        sizes = [sum(x * x for x in each) for each in (b, c)]
        if sizes[0] * sizes[1] - sum(x * y for x, y in zip(b, c, strict=True)) ** 2 <= 1e-12 * sizes[0] * sizes[1]:
            raise InvalidValueError("has three points on a line", "give a point off the z axis last", ("points",))


class MatricesBody(Body):
    """A structure by its matrices, its degrees of freedom named by a table or by the file."""

    body_kind: ClassVar[str] = "matrices"
    has_default_probe: ClassVar[bool] = False
    is_read_from_files: ClassVar[bool] = True
    how_to_place: ClassVar[str] = "name a node: {node: 24, direction: z}"
    base_directions: ClassVar[tuple[str, ...]] = ("", "x", "y", "z", "rx", "ry", "rz")

    kind: Literal["matrices"] = "matrices"
    """Imported matrices."""
    mass: MatrixSource
    """Mass matrix."""
    stiffness: MatrixSource
    """Stiffness matrix."""
    viscous: MatrixSource | None = None
    """Viscous damping matrix, in addition to the damping below; none by default."""
    structural_damping: StructuralDamping | None = None
    """Structural damping as viscous damping at one frequency; without it such matrices are refused."""
    recovery: RecoverySource | None = None
    """Matrix that gives other quantities, which ``run.outputs`` of the kind ``recovered`` report."""
    dofs: AnyTableFile | None = None
    """CSV table with the headings node, direction and, if wanted, x, y, z and system, in any order; a line a row of the
    matrices. Coordinates are in the units of their headings, x (mm), else in those of the files. DMIG and Abaqus files
    need no table.

    Directions are x, y, z, rx, ry, rz and modal.
    """
    systems: tuple[DisplacementSystem, ...] = ()
    """Systems of nodes whose directions are not along the axes of the model; the column ``system`` of the table names
    them."""
    units: AnyFileUnits | None = None
    """Units of all its files: SI (the default), mm-t-s, mm-kg-ms, mm-g-ms, mm-kg-s, cm-g-s, in-lbf-s, ft-lbf-s, or one
    by one, {length: mm, mass: kg, force: N, time: s}. Rotations are in rad."""
    base: Annotated[
        Literal["free"] | HeldNodes,
        Variants("is neither free nor a list of nodes", "write free, or {nodes: [3], direction: z}"),
    ]
    """Nodes that move with the base, {nodes: [3], direction: z}; or free, where nothing does."""
    damping: ChainDamping | None = None
    """Damping of the body as a whole: modal ratios or Rayleigh."""

    @property
    def sources(self) -> dict[str, MatrixSource | StructuralDamping]:
        """Keys that name files of matrices."""
        named = {key: getattr(self, key) for key in ("mass", "stiffness", "viscous", "structural_damping")}
        return {key: source for key, source in named.items() if source is not None and source.file is not None}

    @property
    def recovered_rows(self) -> tuple[str, ...]:
        """Names of the rows of the recovery matrix."""
        return () if self.recovery is None else self.recovery.rows

    def node_problems(self, body_path: Path, path: Path) -> Iterator[Problem]:
        """No problems: only the files know the nodes."""
        yield from ()
