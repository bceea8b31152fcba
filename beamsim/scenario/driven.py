"""Common part of all excitations: where they act, and the quantity of their levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Tag

from beamsim.scenario.base import Schema, Variants, fail, number_or_list
from beamsim.scenario.distributed import AreaLoad, LineLoad
from beamsim.scenario.moved_support import ROTATION_TAKES, TRANSLATION_TAKES, MovedSupport
from beamsim.scenario.place import BaseOrPlace, NodeDirection, choose_base_or_place
from beamsim.scenario.quantities import Coordinate, LevelValue

Quantity = Literal[
    "acceleration", "velocity", "displacement", "force", "force_per_length", "pressure",
    "angular_acceleration", "angular_velocity", "rotation",
]  # fmt: skip

About = Annotated[
    Annotated[Coordinate, Tag("<number>")] | Annotated[tuple[Coordinate, ...], Tag("<list>")], Variants(number_or_list)
]


def point_of(about: float | tuple[float, ...] | None) -> tuple[float, float, float]:
    """x, y and z, m, of a point of which fewer may be given."""
    given = () if about is None else about if isinstance(about, tuple) else (about,)
    x, y, z = (*given, 0.0, 0.0, 0.0)[:3]
    return x, y, z


_Load = (
    Annotated[LineLoad, Tag("<line>")] | Annotated[AreaLoad, Tag("<area>")] | Annotated[MovedSupport, Tag("<support>")]
)


def _choose(value: Any) -> str | None:
    for tag, kind in (("line", LineLoad), ("area", AreaLoad), ("support", MovedSupport), ("joint", MovedSupport)):
        if isinstance(value, kind) or (isinstance(value, dict) and tag in value):
            return "<support>" if kind is MovedSupport else f"<{tag}>"
    return choose_base_or_place(value)


AppliedTo = Annotated[
    BaseOrPlace | _Load,
    Variants(
        _choose,
        "names neither the base nor a point nor a part of a body",
        "write base, {position: 270 mm} for a force on the beam, {mass: 2} for a force on a chain, {line: whole} for a "
        "force per length of a beam, {area: whole} for a pressure on a plate, or {support: left} for one that moves",
    ),
]


def spoken(quantity: str) -> str:
    """A quantity as text says it.

    >>> spoken("force_per_length")
    'force per length'
    """
    return quantity.replace("_", " ")


def _with_article(quantity: str) -> str:
    return f"{'an' if quantity[0] == 'a' else 'a'} {spoken(quantity)}"


_TAKEN = {
    "acceleration": "but the base moves",
    "force": "but a point takes a force",
    "force_per_length": "but a line takes a force per length",
    "pressure": "but an area takes a pressure",
    "angular_acceleration": "but the base turns",
}
_REMEDY = {
    "acceleration": "give an acceleration (2 g), velocity (0.2 m/s) or displacement (0.1 mm), "
    "or apply the force to {position: ...} or {mass: ...}",
    "force": "give a force (1.5 N), or apply it to base",
    "force_per_length": "give a force per length (50 N/m), or apply it to base or a point",
    "pressure": "give a pressure (200 Pa), or apply it to base or a point",
    "angular_acceleration": "give an angular acceleration (50 rad/s^2), velocity (2 rad/s) or rotation (0.1 deg)",
}


def not_taken(quantity: str, takes: Sequence[str]) -> tuple[str, str]:
    """Why something of this quantity cannot act there, and a remedy; ``takes`` is what can."""
    no_force = " and takes no force" if takes[0] == "acceleration" and quantity == "force" else ""
    return f"{_with_article(quantity)}, {_TAKEN[takes[0]]}{no_force}", _REMEDY[takes[0]]


def agree_on_quantity(
    levels: Sequence[tuple[tuple[str | int, ...], float]], given: str | None, takes: Sequence[Quantity]
) -> Quantity:
    """Return the quantity of the levels: as given, otherwise from their units, otherwise the default of the place.

    Raises what `fail` builds when units, quantity and what the place ``takes`` contradict each other.
    """
    quantity = given
    for path, level in levels:
        meant = level.quantity if isinstance(level, LevelValue) else None
        if meant is None:
            continue
        if quantity is not None and meant != quantity:
            raise fail(
                f"is given in a unit of {spoken(meant)}, where {_with_article(quantity)} is meant",
                "give the level in another unit, or set quantity",
                path,
            )
        quantity = meant
    quantity = quantity or takes[0]
    if quantity not in takes:
        why, remedy = not_taken(quantity, takes)
        raise fail(f"is {why}", remedy, ("quantity",) if given is not None else levels[0][0])
    return quantity  # type: ignore[return-value]


class Driven(Schema):
    """Common part of all excitations."""

    applied_to: AppliedTo
    """Base, or a place: {position: 270 mm} of a beam, {mass: 2} of a chain, with the body where there are several; or
    {line: whole} for a force per length of a beam, {area: whole} for a pressure on a plate, or a part of it; or
    {support: left} or {joint: hinge} for a support that moves relative to the base."""
    quantity: Quantity | None = None
    """Acceleration, velocity or displacement of the base, force at a point, force per length, or pressure; by default
    as the unit of the level."""

    direction: NodeDirection | None = None
    """Direction in which the base moves: z by default, or as imported matrices say; rx, ry, rz turn it."""
    about: About | None = None
    """A point on the axis of a rotation, m: a position along a beam, [x, y] of a plate, [x, y, z] of imported matrices;
    by default their origin, the left end or lower left corner."""

    shock: ClassVar[bool] = False
    """Whether it begins at a time and leaves a free motion: the beginning counts, and there are no statistics."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the levels with their paths."""
        raise NotImplementedError

    def plain_levels(self) -> None:
        """Forget the units of the levels once `quantity` holds what they said."""
        self.resolve("level", float(self.levels()[0][1]))

    def settle(self) -> None:
        """Settle what the level is."""
        self.check_direction()
        self.resolve("quantity", agree_on_quantity(self.levels(), self.quantity, self.takes))
        self.plain_levels()

    def check_direction(self) -> None:
        """Refuse a direction of anything but the base, and a point of no axis."""
        if self.direction is not None and not self.on_base:
            raise fail("is the direction in which a base moves", "leave it out, or write applied_to: base",
                       ("direction",))  # fmt: skip
        if self.about is not None and not self.rotates:
            raise fail("belongs to a rotation of the base", "give direction: ry, or leave it out", ("about",))
        if isinstance(self.about, tuple) and not 1 <= len(self.about) <= 3:
            raise fail("is no point", "give a position, [x, y] or [x, y, z]", ("about",))

    @property
    def rotates(self) -> bool:
        """Whether the base, or the support that moves, turns."""
        if isinstance(self.applied_to, MovedSupport):
            return self.applied_to.rotates
        return self.direction is not None and self.direction.startswith("r")

    @property
    def axis_point(self) -> tuple[float, float, float]:
        """A point on the axis of a rotation, m."""
        return point_of(self.about)

    @property
    def on_base(self) -> bool:
        """Whether the base moves (otherwise a force acts)."""
        return self.applied_to == "base"

    @property
    def takes(self) -> tuple[Quantity, ...]:
        """Quantities that its levels may have, the default first."""
        if self.applied_to != "base":
            return self.applied_to.takes
        return ROTATION_TAKES if self.rotates else TRANSLATION_TAKES

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones, Hz."""
        return ()

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the excitation, Hz; a pulse of duration T counts as 1/(2 T)."""
        return max(self.frequencies_hz, default=0.0)
