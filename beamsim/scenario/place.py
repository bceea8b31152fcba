"""Places on the bodies of a scenario, and what sits there: probes and constant forces."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import Path, Schema, Variants, counted, fail, number_or_list
from beamsim.scenario.quantities import Force, MassNumber, Name, PositionOrShare, Whole

_REMEDY = (
    "give position: 270 mm on a beam, position: [270 mm, 100 mm] on a plate, mass: 2 on a chain, "
    "or node: 24 of imported matrices"
)


Point = float | tuple[float, float]
"""Metres along a beam, or [x, y] on a plate."""

PlatePoint = Annotated[tuple[PositionOrShare, PositionOrShare], Tag("<list>")]
"""x and y on a plate."""

PointPosition = Annotated[Annotated[PositionOrShare, Tag("<number>")] | PlatePoint, Variants(number_or_list)]
NodeNumber = Annotated[int, Whole(1)]
NodeDirection = Literal["x", "y", "z", "rx", "ry", "rz"]


class PointOfBody(Schema):
    """A point of a body, by its position or the number of a mass."""

    position: PointPosition | None = None
    """Distance from the left end of a beam, or the share of its length: 60 %; [x, y] on a plate."""
    mass: MassNumber | None = None
    """Number of the mass of the chain, from 1."""
    node: NodeNumber | None = None
    """Number of a node of imported matrices."""
    direction: NodeDirection | None = None
    """Direction at the node, z by default; x, y, z are displacements, rx, ry, rz rotations."""

    def settle(self) -> None:
        """Demand exactly one point."""
        given = [key for key in ("position", "mass", "node") if getattr(self, key) is not None]
        if not given:
            raise fail("names no place", _REMEDY)
        if len(given) > 1:
            raise fail(
                f"and {given[0]} exclude each other",
                "position belongs to a beam, mass to a chain, node to imported matrices",
                (given[1],),
            )
        if self.direction is not None and self.node is None:
            raise fail("belongs to a node", "leave it out, or give node: 24", ("direction",))


class AtPlace(PointOfBody):
    """A point of a body."""

    takes: ClassVar[tuple[Literal["force"]]] = ("force",)

    body: Name | None = None
    """Name of the body; may be left out where there is only one."""

    @property
    def point(self) -> Point:
        """The position in m, on a plate both of its coordinates, or the number of the mass or node."""
        if self.position is not None:
            return self.position
        number = self.mass if self.node is None else self.node
        assert number is not None
        return float(number)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Itself: what sits somewhere names one place or two."""
        return (self,)


@lru_cache(maxsize=1024)
def _at(position: Point | None, mass: int | None, node: int | None, direction: NodeDirection | None) -> AtPlace:
    return AtPlace(position=position, mass=mass, node=node, direction=direction)


def names_a_place(value: Any) -> bool:
    """Whether a raw value is meant as a place."""
    return isinstance(value, AtPlace) or (isinstance(value, dict) and any(key in value for key in AtPlace.keys()))  # noqa: SIM118


BaseOrPlace = Annotated[Literal["base"], Tag("<base>")] | Annotated[AtPlace, Tag("<place>")]
"""The base or a point of a body; `Variants` with `choose_base_or_place` says which."""


def choose_base_or_place(value: Any) -> str | None:
    """Tag of what a value in a scenario names."""
    return "<base>" if value == "base" else "<place>" if names_a_place(value) else None


class Sited(PointOfBody):
    """Something at a place: ``at``, or its short form ``position`` or ``mass`` where there is one body."""

    at: AtPlace | None = None
    """The place: {body: panel, position: 270 mm} or {mass: 2}; the body may be left out where there is only one."""

    def settle(self) -> None:
        """Demand exactly one place."""
        if self.at is None:
            super().settle()
            return
        for key in ("position", "mass", "node", "direction"):
            if getattr(self, key) is not None:
                raise fail("and at exclude each other", "keep at: it names the place", (key,))

    @property
    def place(self) -> AtPlace:
        """Where it is."""
        return self.at if self.at is not None else _at(self.position, self.mass, self.node, self.direction)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The one place."""
        return (self.place,)

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Where it is written, below what sits there."""
        return (() if self.at is None else ("at",),)


def refuse_unlike_directions(places: tuple[AtPlace, ...]) -> None:
    """Refuse a displacement and a rotation at the two places of one thing."""
    turns = [(place.direction or "z").startswith("r") for place in places]
    if any(turns) and not all(turns):
        directions = " and ".join(place.direction or "z" for place in places)
        raise fail(
            f"acts between {directions}, a displacement and a rotation",
            "name displacements (x, y, z) or rotations (rx, ry, rz) at both places", ("between",),
        )  # fmt: skip


TwoPlaces = Annotated[tuple[AtPlace, ...], Field(json_schema_extra={"minItems": 2, "maxItems": 2})]


class BetweenPlaces(Schema):
    """Something between two places of two bodies or of one."""

    between: TwoPlaces
    """The two places."""

    def settle(self) -> None:
        """Demand two different places."""
        if len(self.between) != 2:
            remedy = "name the two that it acts between: [{body: inner, position: 1 m}, {body: outer, position: 1 m}]"
            raise fail(f"names {counted(len(self.between), 'place')}", remedy, ("between",))
        if self.between[0] == self.between[1]:
            raise fail("joins a place to itself", "name two different places", ("between",))
        refuse_unlike_directions(self.between)
        super().settle()

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Both places, in the order in which they are written."""
        return self.between

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Where both are written, below what is between them."""
        return ("between", 0), ("between", 1)


class Probe(Sited):
    """A point whose motion is recorded."""

    name: Name
    """Name, unique; it names the datasets of the result file."""


class PlacedForce(Sited):
    """A force at a point, upwards."""

    force: Force
    """The force, positive upwards (towards positive displacement)."""


class ConstantForce(PlacedForce):
    """A dead load at a point."""
