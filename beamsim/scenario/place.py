"""Places on the bodies of a scenario, supports that move, names, and what sits at places."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field

from beamsim.scenario.base import BY_FORM, Path, Schema, counted, fail
from beamsim.scenario.quantities import Force, MassNumber, Name, PositionOrShare, Share, Whole

_REMEDY = (
    "give position: 270 mm on a beam, position: [270 mm, 100 mm] on a plate, mass: 2 on a chain, "
    "or node: 24 of imported matrices"
)


Point = float | tuple[float, float]
"""Metres along a beam, [x, y] on a plate, or the number of a mass or node."""
Where = float | Share | tuple[float | Share, float | Share]
"""A position as it is written, shares of lengths among it; `beamsim.scenario.body.Body.point` gives it in metres."""

PlatePoint = tuple[PositionOrShare, PositionOrShare]
"""x and y on a plate."""

PointPosition = Annotated[PositionOrShare | PlatePoint, BY_FORM]
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

    def check(self) -> None:
        """Demand exactly one point."""
        super().check()
        self._demand_a_point()

    def _demand_a_point(self) -> None:
        if self.position is None and self.mass is None and self.node is None:
            raise fail("names no place", _REMEDY)
        remedy = "position belongs to a beam, mass to a chain, node to imported matrices"
        self.exclude("mass", "position", remedy=remedy)
        self.exclude("node", "position", "mass", remedy=remedy)
        if self.direction is not None and self.node is None:
            raise fail("belongs to a node", "leave it out, or give node: 24", ("direction",))


class AtPlace(PointOfBody):
    """A point of a body."""

    known_by: ClassVar[tuple[str, ...]] = ("position", "mass", "node", "direction", "body")
    takes: ClassVar[tuple[Literal["force"]]] = ("force",)

    body: Name | None = None
    """Name of the body; may be left out where there is only one."""

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Itself: what sits somewhere names one place or two."""
        return (self,)


@lru_cache(maxsize=1024)
def _at(position: Where | None, mass: int | None, node: int | None, direction: NodeDirection | None) -> AtPlace:
    return AtPlace(position=position, mass=mass, node=node, direction=direction)


BaseOrPlace = Literal["base"] | AtPlace
"""The base or a point of a body."""


class Sited(PointOfBody):
    """Something at a place: ``at``, or its short form ``position`` or ``mass`` where there is one body."""

    at: AtPlace | None = None
    """The place: {body: panel, position: 270 mm} or {mass: 2}; the body may be left out where there is only one."""

    def _demand_a_point(self) -> None:
        if self.at is None:
            super()._demand_a_point()
            return
        for key in ("position", "mass", "node", "direction"):
            self.exclude(key, "at", remedy="keep at: it names the place")

    @property
    def place(self) -> AtPlace:
        """Where it is."""
        return self.at if self.at is not None else _at(self.position, self.mass, self.node, self.direction)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The one place."""
        return (self.place,)

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """Where a probe is by default."""
        return self.places

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


TwoPlaces = Annotated[
    tuple[Annotated[AtPlace | MassNumber, BY_FORM], ...], Field(json_schema_extra={"minItems": 2, "maxItems": 2})
]
"""Two places; a number is that of a mass of the chain."""


def _placed(ends: Iterable[AtPlace | int]) -> tuple[AtPlace, ...]:
    return tuple(_at(None, end, None, None) if isinstance(end, int) else end for end in ends)


class BetweenPlaces(Schema):
    """Something between two places of two bodies or of one."""

    known_by: ClassVar[tuple[str, ...]] = ("between",)

    between: TwoPlaces
    """The two places; of a chain the numbers of two masses are enough: [1, 2]."""

    @property
    def ends(self) -> tuple[str, TwoPlaces]:
        """The key that names both places, and what it names."""
        return "between", self.between

    def check(self) -> None:
        """Demand two different places."""
        super().check()
        key, ends = self.ends
        if len(ends) != 2:
            remedy = "name the two that it acts between: [{body: inner, position: 1 m}, {body: outer, position: 1 m}]"
            raise fail(f"names {counted(len(ends), 'place')}", f"{remedy}, or [1, 2] on a chain", (key,))
        if ends[0] == ends[1]:
            raise fail("joins a place to itself", "name two different places", (key,))
        refuse_unlike_directions(self.places)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Both places, in the order in which they are written; of numbers of masses the lower one first."""
        _, ends = self.ends
        numbers = [end for end in ends if isinstance(end, int)]
        return _placed(sorted(numbers) if len(numbers) == len(ends) else ends)

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """Both places in the order in which they are written, where probes are by default."""
        return _placed(self.ends[1])

    @property
    def place_paths(self) -> tuple[Path, ...]:
        """Where both are written, below what is between them."""
        return ("between", 0), ("between", 1)


class Named(Schema):
    """Something with a name."""

    name: Name = ""
    """Name, unique; by default made of what it is and its number, such as snubber_1, ground_spring_1 or joint_1."""


DEFAULT_NAMES = {
    "snubbers": "snubber",
    "springs_to_ground": "ground_spring",
    "springs_between": "link_spring",
    "joints": "joint",
    "friction": "friction",
}
"""Lists whose items have a name by default: this and their number."""


def numbered(key: str) -> BeforeValidator:
    """Read a list of `DEFAULT_NAMES` with names for the items that have none."""

    def name(items: Any) -> Any:
        if not isinstance(items, (list, tuple)):
            return items
        return [_named(item, f"{DEFAULT_NAMES[key]}_{number}") for number, item in enumerate(items, start=1)]

    return BeforeValidator(name)


def _named(item: Any, name: str) -> Any:
    if isinstance(item, Named):
        return item if item.name else item.model_copy(update={"name": name})
    return {**item, "name": name} if isinstance(item, dict) and item.get("name") is None else item


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


Translation = Literal["acceleration", "velocity", "displacement"]
Rotation = Literal["angular_acceleration", "angular_velocity", "rotation"]

TRANSLATION_TAKES: tuple[Translation, ...] = ("acceleration", "velocity", "displacement")
"""What a motion along an axis is given by; the first is the default."""
ROTATION_TAKES: tuple[Rotation, ...] = ("angular_acceleration", "angular_velocity", "rotation")
"""What a rotation is given by; the first is the default."""


class MovedSupport(Schema):
    """A support, or a joint, that moves relative to the base."""

    known_by: ClassVar[tuple[str, ...]] = ("support", "joint")

    support: Name | None = None
    """The support: left or right end of a beam or wall of a chain; left, right, bottom, top or point 1 of a plate;
    node 15 of imported matrices."""
    joint: Name | None = None
    """Instead of a support a joint, or a linear spring between points: its second point moves against the first."""
    body: Name | None = None
    """The body that the support holds; may be left out where there is only one."""
    direction: Literal["x", "y", "z", "rx", "ry", "rz", "slope"] | None = None
    """z, the deflection, by default; slope is a rotation dw/dx; at a node of imported matrices any of x to rz."""

    def check(self) -> None:
        """Demand a support or a joint."""
        if (self.support is None) == (self.joint is None):
            raise fail("names neither a support nor a joint, or both", "give one of them: {support: left}")
        if self.joint is not None and self.body is not None:
            raise fail("belongs to a support", "leave it out: a joint has a name of its own", ("body",))

    @property
    def rotates(self) -> bool:
        """Whether it turns."""
        return self.direction is not None and self.direction not in ("x", "y", "z")

    @property
    def takes(self) -> tuple[Translation, ...] | tuple[Rotation, ...]:
        """Quantities that its levels may have, the default first."""
        return ROTATION_TAKES if self.rotates else TRANSLATION_TAKES

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """None: it acts on no free point."""
        return ()
