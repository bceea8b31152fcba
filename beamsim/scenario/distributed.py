"""Loads spread over a part of a body: force per length along a beam, pressure on a plate, and their shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, Protocol

from pydantic import Field, Tag

from beamsim.errors import Problem
from beamsim.scenario.base import BY_KIND, Path, Schema, Variants, fail, path_text, suggestion
from beamsim.scenario.body import Body
from beamsim.scenario.place import AtPlace, ConstantForce, Point
from beamsim.scenario.quantities import Coefficient, Count, ForcePerLength, Name, PositionOrShare, Pressure

Row = Annotated[tuple[Coefficient, ...], Field(min_length=1)]
Grid = Annotated[tuple[Row, ...], Field(min_length=1)]


def _row_or_grid(value: Any) -> str | None:
    if not isinstance(value, (list, tuple)):
        return None
    return "<grid>" if value and isinstance(value[0], (list, tuple)) else "<row>"


Numbers = Annotated[
    Annotated[Row, Tag("<row>")] | Annotated[Grid, Tag("<grid>")],
    Variants(_row_or_grid, "is not a list of numbers", "write [0, 1] along a beam, [[0, 0], [1, 1]] on a plate"),
]
"""Numbers along a beam, or on a plate a list for each step in x of the numbers along y."""


def _is_grid(numbers: Any) -> bool:
    return isinstance(numbers[0], tuple)


def _rows(numbers: Any) -> tuple[tuple[float, ...], ...]:
    return numbers if _is_grid(numbers) else (numbers,)


class Shape(Schema):
    """Common part of all shapes: the factor of the level at every point of the part that is loaded."""

    @property
    def two_dimensional(self) -> bool | None:
        """Whether it is a shape for a plate; None where it is one for both beams and plates."""
        return None


class UniformShape(Shape):
    """The level everywhere."""

    kind: Literal["uniform"] = "uniform"
    """The same everywhere."""


class LinearShape(Shape):
    """Linear between the ends, bilinear between the corners."""

    kind: Literal["linear"] = "linear"
    """Linear from end to end."""
    values: Numbers
    """Factors at both ends, [0, 1]; on a plate at the corners, [[bottom left, top left], [bottom right, top right]]."""

    def settle(self) -> None:
        """Demand two values in each direction."""
        rows = _rows(self.values)
        if any(len(row) != 2 for row in rows) or (_is_grid(self.values) and len(rows) != 2):
            raise fail("must be two numbers, or two lists of two", "write [0, 1] or [[0, 0], [1, 1]]", ("values",))

    @property
    def two_dimensional(self) -> bool:
        """With values at four corners."""
        return _is_grid(self.values)


class PolynomialShape(Shape):
    """A polynomial in the share s of the loaded part, 0 at its left end and 1 at its right end."""

    kind: Literal["polynomial"] = "polynomial"
    """A polynomial."""
    coefficients: Numbers
    """Of 1, s, s^2, ...; on a plate a list for each power of s = x share, of the coefficients of 1, t, t^2, ...,
    where t is the y share."""

    @property
    def two_dimensional(self) -> bool:
        """With powers of both shares."""
        return _is_grid(self.coefficients)


HalfWaves = Annotated[tuple[Count, ...], Field(min_length=1, max_length=2)]


class SineShape(Shape):
    """Half waves of a sine, zero at the ends of the loaded part."""

    kind: Literal["sine"] = "sine"
    """Half waves of a sine."""
    half_waves: HalfWaves = (1,)
    """Number of half waves, [1]; on a plate along x and y, [1, 1]."""

    @property
    def two_dimensional(self) -> bool:
        """With half waves in two directions."""
        return len(self.half_waves) == 2


class ModeShape(Shape):
    """The shape of a natural mode of the body by itself on its supports, its largest nodal deflection 1."""

    kind: Literal["mode"] = "mode"
    """A natural mode of the body."""
    mode: Count
    """Number of the mode, from 1, rigid-body modes included."""


Positions = Annotated[tuple[PositionOrShare, ...], Field(min_length=2)]


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

    def settle(self) -> None:
        """Demand increasing positions, and a value at each."""
        for key in ("x", "y"):
            positions = getattr(self, key)
            for index, (one, two) in enumerate(zip(positions or (), positions[1:] if positions else (), strict=False)):
                if two <= one:
                    raise fail("does not lie beyond the one before it", "list increasing positions", (key, index + 1))
        if _is_grid(self.values) is (self.y is None):
            raise fail("do not fit the positions", "give y and a list for each x on a plate, x alone along a beam",
                       ("values",))  # fmt: skip
        rows = _rows(self.values)
        expected = len(self.x) if self.y is None else len(self.y)
        if any(len(row) != expected for row in rows) or (self.y is not None and len(rows) != len(self.x)):
            raise fail("are not as many as the positions", "give a value at each position", ("values",))

    def on_the_body(self, body: Body) -> dict[str, object]:
        """The positions in m, by key, where they are given as shares."""
        if self.y is None:
            return {"x": tuple(body.on_the_body(x) for x in self.x)}
        corners = [body.on_the_body((x, 0.0)) for x in self.x], [body.on_the_body((0.0, y)) for y in self.y]
        return {key: tuple(corner[k] for corner in corners[k]) for k, key in enumerate("xy")}  # type: ignore[index]

    @property
    def two_dimensional(self) -> bool:
        """With positions in two directions."""
        return self.y is not None


AnyShape = Annotated[
    UniformShape | LinearShape | PolynomialShape | SineShape | ModeShape | TableShape, BY_KIND
]  # fmt: skip

_WHOLE = Annotated[Literal["whole"], Tag("<whole>")]


def _whole_or_list(value: Any) -> str | None:
    return "<whole>" if value == "whole" else "<list>" if isinstance(value, (list, tuple)) else None


_Span = tuple[PositionOrShare, PositionOrShare]
_Corner = tuple[PositionOrShare, PositionOrShare]


class DistributedLoad(Schema):
    """Common part of loads spread over a part of a body."""

    body: Name | None = None
    """Name of the body; may be left out where there is only one."""
    shape: AnyShape | None = None
    """Factor of the level over the loaded part: uniform (the default), linear, polynomial, sine, mode or table."""

    acts_on: ClassVar[str] = ""

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """None: it acts at no point."""
        return ()

    @property
    def ends(self) -> tuple[Point, Point] | None:
        """The loaded part, m: its ends, or opposite corners; None for the whole body."""
        raise NotImplementedError

    def settle(self) -> None:
        """Demand a shape of as many directions as the body has."""
        if self.shape is None:
            self.resolve("shape", UniformShape())
            return
        two = self.shape.two_dimensional
        if two is not None and two is not (self.acts_on == "plate"):
            raise fail(
                f"is one for a {'plate' if two else 'beam'}",
                "along a beam give one list or number, on a plate one for each direction",
                ("shape",),
            )


class LineLoad(DistributedLoad):
    """Force per length along a beam, positive upwards."""

    takes: ClassVar[tuple[Literal["force_per_length"]]] = ("force_per_length",)
    acts_on: ClassVar[str] = "beam"

    line: Annotated[_WHOLE | Annotated[_Span, Tag("<list>")], Variants(
        _whole_or_list, "is not a part of a beam", "write whole, or both ends: [100 mm, 60 %]"
    )]  # fmt: skip
    """The loaded part of the beam: whole, or where it begins and ends, [100 mm, 60 %]."""

    @property
    def ends(self) -> tuple[Point, Point] | None:
        """Both ends, m."""
        return None if self.line == "whole" else self.line


class AreaLoad(DistributedLoad):
    """Pressure on a plate, positive upwards."""

    takes: ClassVar[tuple[Literal["pressure"]]] = ("pressure",)
    acts_on: ClassVar[str] = "plate"

    area: Annotated[_WHOLE | Annotated[tuple[_Corner, _Corner], Tag("<list>")], Variants(
        _whole_or_list, "is not a part of a plate", "write whole, or opposite corners: [[0, 0], [100 mm, 50 %]]"
    )]  # fmt: skip
    """The loaded part of the plate: whole, or its lower left and upper right corner, [[0, 0], [100 mm, 50 %]]."""

    @property
    def ends(self) -> tuple[Point, Point] | None:
        """Both corners, m."""
        return None if self.area == "whole" else self.area


class DeadLineLoad(LineLoad):
    """A dead load along a beam."""

    force_per_length: ForcePerLength
    """Force per length, positive upwards; with a shape its factor."""

    @property
    def force(self) -> float:
        """The level, N/m."""
        return self.force_per_length


class DeadPressure(AreaLoad):
    """A dead load on a plate."""

    pressure: Pressure
    """Pressure, positive upwards; with a shape its factor."""

    @property
    def force(self) -> float:
        """The level, Pa."""
        return self.pressure


def _dead_load(value: Any) -> str:
    for key, kind in (("line", DeadLineLoad), ("area", DeadPressure)):
        if isinstance(value, kind) or (isinstance(value, dict) and key in value):
            return f"<{key}>"
    return "<point>"


AnyDeadLoad = Annotated[
    Annotated[ConstantForce, Tag("<point>")]
    | Annotated[DeadLineLoad, Tag("<line>")]
    | Annotated[DeadPressure, Tag("<area>")],
    Variants(_dead_load),
]


class _WithBodies(Protocol):
    @property
    def all_bodies(self) -> dict[str, Body]: ...
    @property
    def default_body(self) -> str: ...
    def body_path(self, name: str) -> Path: ...


def distributed_problems(scenario: _WithBodies, path: Path, load: DistributedLoad) -> Iterator[Problem]:
    """A body that is unknown or of another kind, and a part that is not on it."""
    name = load.body or scenario.default_body
    bodies = scenario.all_bodies
    if name not in bodies:
        if load.body is not None:
            known = suggestion(load.body, bodies, "the bodies are")
            yield Problem(path_text((*path, "body")), f"= {load.body} is an unknown body", known)
        elif len(bodies) > 1:
            yield Problem(
                path_text(path), f"names no body, and there are several: {', '.join(bodies)}",
                f"name one: {{body: {next(iter(bodies))}, line: whole}}",
            )  # fmt: skip
        return
    body, where = bodies[name], scenario.body_path(name)
    key = "line" if isinstance(load, LineLoad) else "area"
    if body.body_kind != load.acts_on:
        remedy = {
            "beam": "give line: whole, with a level in N/m",
            "plate": "give area: whole, with a level in Pa",
            "chain": "list forces on its masses: excitation: {kind: forces, forces: [...]}",
            "matrices": "list forces at its nodes: excitation: {kind: forces, forces: [...]}",
        }[body.body_kind]
        what = "imported matrices" if body.body_kind == "matrices" else f"a {body.body_kind}"
        yield Problem(path_text((*path, key)), f"belongs to a {load.acts_on}, but {path_text(where)} is {what}", remedy)
        return
    ends: Any = load.ends
    if ends is not None:
        for index, end in enumerate(ends):
            yield from body.position_problems(where, (*path, key, index), end, "")
        pairs = [ends] if key == "line" else list(zip(*ends, strict=True))
        if any(last <= first for first, last in pairs):
            yield Problem(path_text((*path, key)), "does not end beyond where it begins", "give the lower end first")
    if isinstance(load.shape, TableShape) and body.body_kind == "beam":
        for index, position in enumerate(load.shape.x):
            yield from body.position_problems(where, (*path, "shape", "x", index), position, "")
