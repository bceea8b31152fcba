"""A body with mass and stiffness matrices from another program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import units
from beamsim.scenario.base import InvalidValueError, Path, Schema, Variants, count_text, problem, unknown
from beamsim.scenario.body import AtPlace, Body, ChainDamping, NodeDirection, Point
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
"""Consistent unit systems, named by their units of length, mass and time; the last two by length, force and time."""
assert set(SYSTEMS) == set(get_args(UnitSystem))


class FileUnits(Schema):
    """Units of a file, one by one."""

    length: Annotated[str, UnitType(dimension=units.LENGTH, example="mm")]
    """Unit of displacements and coordinates: mm, in."""
    mass: Annotated[str, UnitType(dimension=units.MASS, example="kg")]
    """Unit of the mass matrix: kg, t; lb if the masses are weights and WTMASS was not applied."""
    force: Annotated[str, UnitType(dimension=units.FORCE, example="N")]
    """Unit of forces: N, lbf. The stiffness matrix is in this unit per unit of length."""
    time: Annotated[str, UnitType(dimension=units.TIME, example="s")] = "s"
    """Unit of time, used in the viscous damping matrix: s, ms."""


AnyFileUnits = Annotated[
    UnitSystem | FileUnits,
    Variants("is not a system of units", f"write {', '.join(SYSTEMS)}, or {{length: mm, mass: kg, force: N, time: s}}"),
]
"""The name of a system, or the units one by one."""


def sizes_of(file_units: UnitSystem | FileUnits | None) -> UnitSizes:
    """SI sizes of the units of a file; SI by default."""
    if isinstance(file_units, FileUnits):
        return UnitSizes(
            units.size_of(file_units.length, units.LENGTH), units.size_of(file_units.mass, units.MASS),
            units.size_of(file_units.force, units.FORCE), units.size_of(file_units.time, units.TIME),
        )  # fmt: skip
    return SYSTEMS[file_units or "SI"]


def name_of(file_units: UnitSystem | FileUnits | None) -> str:
    """The units of a file, as text."""
    if isinstance(file_units, FileUnits):
        return ", ".join(getattr(file_units, name) for name in UnitSizes._fields)
    return file_units or "SI"


class MatrixSource(Schema):
    """A matrix in a file."""

    file: FileName
    """OP2, OP4, DMIG, MatrixMarket, Abaqus, Harwell-Boeing, MATLAB or NumPy; relative to the scenario's folder."""
    name: Text | None = None
    """Name of the matrix in the file, in upper or lower case; may be omitted if the file contains only one."""


MOST_ROWS = 300
"""Largest number of rows of a matrix that is written in the case; the case is stored with each result."""

WrittenMatrix = tuple[tuple[Coefficient, ...], ...]
"""The rows of a matrix, as they are written in the case."""

AnyMatrix = Annotated[
    MatrixSource | WrittenMatrix,
    Variants("is not a matrix", "give {file: panel.op4, name: kxx}, or its rows, [[2e4, -1e4], [-1e4, 1e4]]"),
]
"""A matrix in a file, or its rows."""


class RecoverySource(MatrixSource):
    """A matrix that gives other quantities from the degrees of freedom: stress, strain, or motion at other points."""

    rows: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of its rows, in order; its columns are the degrees of freedom, in the order of the other matrices."""

    def check(self) -> None:
        """Require unique names."""
        for k, name in enumerate(self.rows):
            if name in self.rows[:k]:
                raise InvalidValueError(f"names {name} twice", "give each row its own name", ("rows", k))


class StructuralDamping(Schema):
    """Structural damping (K4, or the imaginary part of K) as viscous damping; exact at one frequency only."""

    file: FileName | None = None
    """File with the matrix K4; by default the imaginary part of the stiffness matrix is used."""
    name: Text | None = None
    """Name of the matrix in the file."""
    frequency: Frequency
    """Frequency of the conversion to viscous damping: C = K4 / (2 pi frequency)."""


class HeldNodes(Schema):
    """Nodes that move with the base."""

    nodes: Annotated[tuple[Count, ...], Field(min_length=1)]
    """Numbers of the nodes; all of their degrees of freedom move with the base."""
    direction: NodeDirection = "z"
    """Direction in which the base moves, and in which gravity acts."""


class DisplacementSystem(Schema):
    """A coordinate system of nodes in the files, as in the field CD of Nastran or *TRANSFORM of Abaqus."""

    number: Count
    """Its number in the column ``system`` of the table ``dofs``."""
    kind: Literal["rectangular", "cylindrical"] = "rectangular"
    """rectangular: x, y, z are its axes; cylindrical: they are the radial, tangential and axial directions."""
    points: tuple[tuple[Coefficient, Coefficient, Coefficient], ...] = Field(min_length=3, max_length=3)
    """Its origin, a point on its z axis, and a point in the half plane of its x axis, as in CORD2R and CORD2C: [x, y,
    z] in the axes of the model and the units of the files."""

    def check(self) -> None:
        """Refuse points on one line."""
        _, b, c = (tuple(x - o for x, o in zip(point, self.points[0], strict=True)) for point in self.points)
        sizes = [sum(x * x for x in each) for each in (b, c)]
        if sizes[0] * sizes[1] - sum(x * y for x, y in zip(b, c, strict=True)) ** 2 <= 1e-12 * sizes[0] * sizes[1]:
            raise InvalidValueError("has three points on a line", "give a point off the z axis last", ("points",))


def _demand_square(key: str, matrix: WrittenMatrix) -> None:
    """Refuse a matrix that is not square, or too large to be written in a case."""
    if len(matrix) > MOST_ROWS:
        remedy = "save it, numpy.savez('matrices.npz', K=K), and give {file: matrices.npz, name: K}"
        raise InvalidValueError(f"has {len(matrix)} rows, and takes up to {MOST_ROWS}", remedy, (key,))
    for k, row in enumerate(matrix):
        if len(row) != len(matrix):
            numbers, rows = count_text(len(row), "number"), count_text(len(matrix), "row")
            raise InvalidValueError(f"has {numbers}, and the matrix has {rows}", "give a square matrix", (key, k))


class MatricesBody(Body):
    """A body given by its matrices; a table or the file itself names the degrees of freedom."""

    body_kind: ClassVar[str] = "matrices"
    has_default_probe: ClassVar[bool] = False
    is_read_from_files: ClassVar[bool] = True
    place_remedy: ClassVar[str] = "name a node: {node: 24, direction: z}"
    base_directions: ClassVar[tuple[str, ...]] = ("", "x", "y", "z", "rx", "ry", "rz")

    kind: Literal["matrices"] = "matrices"
    """Imported matrices."""
    mass: AnyMatrix
    """Mass matrix: {file: panel.op4, name: mxx}, or its rows, [[1, 0], [0, 2]]."""
    stiffness: AnyMatrix
    """Stiffness matrix, in the same form."""
    viscous: AnyMatrix | None = None
    """Viscous damping matrix, in addition to the damping below; none by default."""
    structural_damping: StructuralDamping | None = None
    """Structural damping as viscous damping at one frequency; without this key a file with structural damping is
    refused."""
    recovery: RecoverySource | None = None
    """Matrix that gives other quantities, for ``run.outputs`` of the kind ``recovered``."""
    dofs: AnyTableFile | None = None
    """CSV table with one row for each row of the matrices. Its headings, in any order, are node, direction and
    optionally x, y, z and system. Coordinates have the unit in their heading, x (mm), else the unit of the files. DMIG
    and Abaqus files need no table. Without a table, row i of a matrix that is written in the case is direction z of
    node i.

    Directions are x, y, z, rx, ry, rz and modal.
    """
    systems: tuple[DisplacementSystem, ...] = ()
    """Coordinate systems of nodes whose directions are not along the axes of the model; the column ``system`` of the
    table refers to them."""
    rows: Mapping[Name, tuple[Coefficient, ...]] = {}
    """Further places, by name: the motion of each is a sum of factors times the degrees of freedom, in the order of the
    matrices, such as {gap: [0, 1, -1]}. A stop, force or probe there has the place {row: gap}."""
    units: AnyFileUnits | None = None
    """Units of all files: SI (the default), mm-t-s, mm-kg-ms, mm-g-ms, mm-kg-s, cm-g-s, in-lbf-s, ft-lbf-s, or one by
    one, {length: mm, mass: kg, force: N, time: s}. Rotations are in rad."""
    base: Annotated[
        Literal["free"] | HeldNodes,
        Variants("is neither free nor a list of nodes", "write free, or {nodes: [3], direction: z}"),
    ]
    """Nodes that move with the base, {nodes: [3], direction: z}; or free, if there are none."""
    damping: ChainDamping | None = None
    """Damping of the body as a whole: modal ratios or Rayleigh."""

    @property
    def sources(self) -> dict[str, MatrixSource | WrittenMatrix | StructuralDamping]:
        """The keys with matrices."""
        named = {key: getattr(self, key) for key in ("mass", "stiffness", "viscous", "structural_damping")}
        return {key: source for key, source in named.items() if getattr(source, "file", source) is not None}

    def check(self) -> None:
        """Refuse matrices that are not square, of different sizes, or too large to be written in a case."""
        super().check()
        for key, source in self.sources.items():
            if isinstance(source, tuple):
                _demand_square(key, source)

    def point_of(self, place: AtPlace) -> Point:
        """Number of the node, or of the row, from 0."""
        return super().point_of(place) if place.row is None else float(list(self.rows).index(place.row))

    @property
    def recovered_rows(self) -> tuple[str, ...]:
        """Names of the rows of the recovery matrix."""
        return () if self.recovery is None else self.recovery.rows

    def power_of_start(self, index: int) -> int:
        """0: each degree of freedom has its own number."""
        return 0

    def start_problems(self, path: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """A problem unless the matrices are written in the case and there is one number for each row.

        Parameters
        ----------
        path, numbers : see `beamsim.scenario.body.Body.start_problems`.

        Yields
        ------
        Problem
        """
        if not numbers:
            return
        if not isinstance(self.mass, tuple):
            remedy = "start in a mode, {mode: 1, amplitude: 1 mm}, or with a released force"
            yield problem(path, "needs matrices that are written in the case", remedy)
        elif len(numbers) != len(self.mass):
            given = f"has {count_text(len(numbers), 'number')} for {count_text(len(self.mass), 'row')} of the matrices"
            yield problem(path, given, "give one number for each row, or leave it out")

    def row_problems(self, body_path: Path, path: Path, name: str) -> Iterator[Problem]:
        """A problem if no row has this name."""
        yield from unknown(path, name, "row", self.rows)

    def node_of_number(self, number: int) -> int:
        """The number itself."""
        return number

    def node_problems(self, body_path: Path, path: Path, node: int | str) -> Iterator[Problem]:
        """A problem of a name: nodes have numbers, which are known only from the files.

        Parameters
        ----------
        body_path, path, node : see `beamsim.scenario.body.Body.node_problems`.

        Yields
        ------
        Problem
        """
        if isinstance(node, str):
            yield problem(path, f"= {node} is not a number", self.place_remedy)
