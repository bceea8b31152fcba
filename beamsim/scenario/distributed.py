"""Distributed loads: force per length on a beam, pressure on a plate, and their shapes."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, Tag

from beamsim.scenario import quantities as q
from beamsim.scenario.base import (
    BY_FORM,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    Whole,
    path_text,
    problem,
)
from beamsim.scenario.body import AtPlace, Body, PlacedForce, WrittenPosition, body_problems

Row = Annotated[tuple[q.Coefficient, ...], Field(min_length=1)]
Grid = Annotated[tuple[Row, ...], Field(min_length=1)]


def _row_or_grid(value: Any) -> str | None:
    if not isinstance(value, (list, tuple)):
        return None
    return "<grid>" if value and isinstance(value[0], (list, tuple)) else "<row>"


Numbers = Annotated[
    Annotated[Row, Tag("<row>")] | Annotated[Grid, Tag("<grid>")],
    Variants("is not a list of numbers", "write [0, 1] along a beam, [[0, 0], [1, 1]] on a plate", _row_or_grid),
]
"""Numbers along a beam; on a plate a list for each step in x, of the numbers along y."""


def _is_grid(numbers: Any) -> bool:
    return isinstance(numbers[0], tuple)


def _rows(numbers: Any) -> tuple[tuple[float, ...], ...]:
    return numbers if _is_grid(numbers) else (numbers,)


class Shape(Schema):
    """Common part of all shapes: the factor of the level at every point of the loaded part."""

    @property
    def two_dimensional(self) -> bool | None:
        """True for the shape of a plate, with a list for each step in x; None if it also suits beams."""
        numbers = getattr(self, "values", getattr(self, "coefficients", None))
        return None if numbers is None else _is_grid(numbers)


class UniformShape(Shape):
    """The same level everywhere."""

    kind: Literal["uniform"] = "uniform"
    """The same everywhere."""


class LinearShape(Shape):
    """Linear between the ends, bilinear between the corners."""

    kind: Literal["linear"] = "linear"
    """Linear from end to end."""
    values: Numbers
    """Factors at both ends, [0, 1]; on a plate at the corners, [[bottom left, top left], [bottom right, top right]]."""

    def check(self) -> None:
        """Require two values in each direction."""
        rows = _rows(self.values)
        if any(len(row) != 2 for row in rows) or (_is_grid(self.values) and len(rows) != 2):
            raise InvalidValueError(
                "must be two numbers, or two lists of two", "write [0, 1] or [[0, 0], [1, 1]]", ("values",)
            )


class PolynomialShape(Shape):
    """A polynomial in the share s of the loaded part, 0 at its left end and 1 at its right end."""

    kind: Literal["polynomial"] = "polynomial"
    """A polynomial."""
    coefficients: Numbers
    """Coefficients of 1, s, s^2, ... On a plate a list for each power of the share s along x, of the coefficients of 1,
    t, t^2, ..., where t is the share along y."""


HalfWaves = Annotated[tuple[q.Count, ...], Field(min_length=1, max_length=2)]


class SineShape(Shape):
    """Half waves of a sine, zero at the ends of the loaded part."""

    kind: Literal["sine"] = "sine"
    """Half waves of a sine."""
    half_waves: HalfWaves = (1,)
    """Number of half waves, [1]; on a plate along x and y, [1, 1]."""

    @property
    def two_dimensional(self) -> bool:
        """Whether there are half waves in two directions."""
        return len(self.half_waves) == 2


class ModeShape(Shape):
    """A natural mode shape of the body alone on its supports, scaled to a largest nodal deflection of 1."""

    kind: Literal["mode"] = "mode"
    """A natural mode of the body."""
    mode: q.Count
    """Number of the mode, from 1, rigid-body modes included."""


Positions = Annotated[tuple[q.PositionOrShare, ...], Field(min_length=2)]


class TableShape(Shape):
    """Values at positions of the body, linear in between, zero outside."""

    kind: Literal["table"] = "table"
    """Values at positions."""
    x: Positions
    """Positions along the beam, or x on a plate; increasing."""
    y: Positions | None = None
    """Positions y on a plate; increasing."""
    values: Numbers
    """Factors at the positions; on a plate a list for each x of the factors along y."""

    def check(self) -> None:
        """Require one value for each position."""
        if _is_grid(self.values) is (self.y is None):
            remedy = "give y and a list for each x on a plate, x alone along a beam"
            raise InvalidValueError("do not fit the positions", remedy, ("values",))
        rows = _rows(self.values)
        expected = len(self.x) if self.y is None else len(self.y)
        if any(len(row) != expected for row in rows) or (self.y is not None and len(rows) != len(self.x)):
            raise InvalidValueError("are not as many as the positions", "give a value at each position", ("values",))

    def on_the_body(self, body: Body) -> Self:
        """A copy with positions in m."""
        return self.model_copy(update={
            key: tuple(body.metres(each, axis) for each in positions)
            for axis, (key, positions) in enumerate((("x", self.x), ("y", self.y))) if positions is not None
        })  # fmt: skip

    def problems_on(self, body: Body, body_path: Path, path: Path) -> Problems:
        """Problems: positions that are not on a body, or do not increase."""
        shape = self.on_the_body(body)
        for axis, key in enumerate(("x", "y")):
            positions = getattr(shape, key) or ()
            for index, position in enumerate(positions):
                yield from body.position_problems_of_side(body_path, (*path, key, index), position, axis)
            for index, (one, two) in enumerate(pairwise(positions), start=1):
                if two <= one:
                    message = "does not lie beyond the one before it"
                    yield problem((*path, key, index), message, "list increasing positions")


AnyShape = Annotated[
    UniformShape | LinearShape | PolynomialShape | SineShape | ModeShape | TableShape, BY_FORM
]  # fmt: skip

_Pair = tuple[q.PositionOrShare, q.PositionOrShare]


class DistributedLoad(Schema):
    """Common part of distributed loads."""

    body: q.Name | None = None
    """Name of the body; may be omitted if there is only one."""
    shape: AnyShape = UniformShape.model_construct()
    """Factor of the level over the loaded part: uniform (the default), linear, polynomial, sine, mode or table."""

    acts_on: ClassVar[str] = ""
    """Kind of body that it acts on."""
    region_key: ClassVar[str] = ""
    """Key of the loaded part."""

    places: ClassVar[tuple[AtPlace, ...]] = ()
    """None: it does not act at a point."""

    @property
    def ends(self) -> tuple[WrittenPosition, WrittenPosition] | None:
        """The ends, or opposite corners, of the loaded part; None for the whole body."""
        given: Any = getattr(self, self.region_key)
        return None if given == "whole" else given

    def check(self) -> None:
        """Require a shape with as many directions as the body has."""
        two = self.shape.two_dimensional
        if two is not None and two is not (self.acts_on == "plate"):
            raise InvalidValueError(
                f"is one for a {'plate' if two else 'beam'}",
                "along a beam give one list or number, on a plate one for each direction",
                ("shape",),
            )

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown body or one of another kind, and a part that is not on it."""
        yield from body_problems(scenario, path, self.body, "name one: {body: BODY, line: whole}")
        name = self.body or scenario.default_body
        if name not in scenario.all_bodies:
            return
        body, where, key = scenario.all_bodies[name], scenario.body_path(name), self.region_key
        if body.body_kind != self.acts_on:
            message = f"belongs to a {self.acts_on}, but {path_text(where)} is {body.called}"
            yield problem((*path, key), message, body.load_remedy)
            return
        if self.ends is not None:
            for index, end in enumerate(self.ends):
                yield from body.position_problems(where, (*path, key, index), end, "")
            ends: Any = [body.point(end) for end in self.ends]
            pairs = [ends] if key == "line" else list(zip(*ends, strict=True))
            if any(last <= first for first, last in pairs):
                yield problem((*path, key), "does not end beyond where it begins", "give the lower end first")
        if isinstance(self.shape, TableShape):
            yield from self.shape.problems_on(body, where, (*path, "shape"))


class LineLoad(DistributedLoad):
    """Force per length along a beam, positive upwards."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("line",)
    level_quantities: ClassVar[tuple[Literal["force_per_length"]]] = ("force_per_length",)
    acts_on: ClassVar[str] = "beam"
    region_key: ClassVar[str] = "line"

    line: Annotated[Literal["whole"] | _Pair, Variants(
        "is not a part of a beam", "write whole, or both ends: [100 mm, 60 %]"
    )]  # fmt: skip
    """The loaded part of the beam: whole, or its ends, [100 mm, 60 %]."""


class AreaLoad(DistributedLoad):
    """Pressure on a plate, positive upwards."""

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("area",)
    level_quantities: ClassVar[tuple[Literal["pressure"]]] = ("pressure",)
    acts_on: ClassVar[str] = "plate"
    region_key: ClassVar[str] = "area"

    area: Annotated[Literal["whole"] | tuple[_Pair, _Pair], Variants(
        "is not a part of a plate", "write whole, or opposite corners: [[0, 0], [100 mm, 50 %]]"
    )]  # fmt: skip
    """The loaded part of the plate: whole, or its lower left and upper right corners, [[0, 0], [100 mm, 50 %]]."""


class DeadLineLoad(LineLoad):
    """A dead load per length on a beam."""

    force: q.ForcePerLength = Field(alias="force_per_length")
    """Force per length, positive upwards; a shape multiplies it."""


class DeadPressure(AreaLoad):
    """A dead load on a plate."""

    force: q.Pressure = Field(alias="pressure")
    """Pressure, positive upwards; a shape multiplies it."""


AnyDeadLoad = Annotated[PlacedForce | DeadLineLoad | DeadPressure, BY_FORM]
