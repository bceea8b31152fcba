"""What all excitations share: where they act, the quantity of their levels, ranges and tables of levels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeVar

from pydantic import Field

from beamsim.scenario import quantities
from beamsim.scenario.base import BY_FORM, Path, Schema, Variants, fail
from beamsim.scenario.distributed import AreaLoad, LineLoad
from beamsim.scenario.place import ROTATION_TAKES, TRANSLATION_TAKES, BaseOrPlace, MovedSupport, NodeDirection
from beamsim.scenario.quantities import Coordinate, Frequency, Level, meant

Quantity = Literal[
    "acceleration", "velocity", "displacement", "force", "force_per_length", "pressure",
    "angular_acceleration", "angular_velocity", "rotation",
]  # fmt: skip

About = Annotated[Coordinate | tuple[Coordinate, ...], BY_FORM]


def point_of(about: float | tuple[float, ...] | None) -> tuple[float, float, float]:
    """x, y and z, m, of a point of which fewer may be given."""
    given = () if about is None else about if isinstance(about, tuple) else (about,)
    x, y, z = (*given, 0.0, 0.0, 0.0)[:3]
    return x, y, z


AppliedTo = Annotated[
    LineLoad | AreaLoad | MovedSupport | BaseOrPlace,
    Variants(
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


def check_quantity(
    levels: Sequence[tuple[Path, float]], stated: str | None, takes: Sequence[Quantity], quantity: Quantity
) -> None:
    """Refuse units, a stated quantity and a place that contradict each other.

    Parameters
    ----------
    levels : with their paths, for what `fail` builds.
    stated : the quantity beside them.
    takes : what can act at the place.
    quantity : what the levels are taken for.
    """
    said = stated
    for path, level in levels:
        of = meant(level)
        if of is not None and said is not None and of != said:
            raise fail(
                f"is given in a unit of {spoken(of)}, where {_with_article(said)} is meant",
                "give the level in another unit, or set quantity",
                path,
            )
        said = said or of
    if quantity not in takes:
        why, remedy = not_taken(quantity, takes)
        raise fail(f"is {why}", remedy, ("quantity",) if stated is not None or not levels else levels[0][0])


class Driven(Schema):
    """Common part of all excitations."""

    applied_to: AppliedTo
    """Base, or a place: {position: 270 mm} of a beam, {mass: 2} of a chain, with the body where there are several; or
    {line: whole} for a force per length of a beam, {area: whole} for a pressure on a plate, or a part of it; or
    {support: left} or {joint: hinge} for a support that moves relative to the base."""
    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity or displacement of the base, force at a point, force per length, or pressure; by default
    as the unit of the level."""

    direction: NodeDirection | None = None
    """Direction in which the base moves: z by default, or as imported matrices say; rx, ry, rz turn it."""
    about: About | None = None
    """A point on the axis of a rotation, m: a position along a beam, [x, y] of a plate, [x, y, z] of imported matrices;
    by default their origin, the left end or lower left corner."""

    shock: ClassVar[bool] = False
    """Whether it begins at a time and leaves a free motion: the beginning counts, and there are no statistics."""

    def levels(self) -> list[tuple[Path, float]]:
        """Return the levels with their paths; none where a file or a table holds them."""
        return []

    @property
    def quantity(self) -> Quantity:
        """What the levels are: as stated, otherwise as their units say, otherwise the default of the place."""
        said: Any = (self.quantity_, *(meant(level) for _, level in self.levels()))
        return next((of for of in said if of is not None), self.takes[0])

    def named_in_addition(self) -> dict[str, object]:
        """The quantity."""
        return {"quantity": self.quantity}

    def check(self) -> None:
        """Refuse a level that cannot act there, a direction of anything but the base, and a point of no axis."""
        super().check()
        check_quantity(self.levels(), self.quantity_, self.takes, self.quantity)
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


Number = TypeVar("Number")


class Span(Schema, Generic[Number]):
    """A quantity changes from one value to another."""

    from_: Number = Field(alias="from")
    """First value."""
    to: Number
    """Last value."""

    changing: ClassVar[str] = "continuation"
    suitable: ClassVar[str] = "give a range"

    def check(self) -> None:
        """Reject an empty range."""
        super().check()
        if self.from_ == self.to:
            types = type(self).model_fields["to"].metadata
            unit = next((item.dimension.unit for item in types if isinstance(item, quantities.Quantity)), "")
            shown = f"{self.to:g} {unit}".rstrip()
            raise fail(f"= {shown} equals the start of the {self.changing}", self.suitable, ("to",))


class FrequencyRange(Span[Frequency]):
    """A frequency that is swept."""

    changing: ClassVar[str] = "sweep"
    suitable: ClassVar[str] = "give a range, from 20 Hz to 400 Hz"


Between = Literal["held", "log_log"]


class _LevelAt(Schema):
    level: Level
    """Amplitude, zero to peak."""
    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity, displacement or force; as the unit of the level says."""

    @property
    def quantity(self) -> str | None:
        """What the level is; None where nothing says it."""
        return self.quantity_ or meant(self.level)

    def named_in_addition(self) -> dict[str, object]:
        """The quantity."""
        return {} if self.quantity is None else {"quantity": self.quantity}

    def check(self) -> None:
        """Refuse a negative level, and one in a unit of another quantity."""
        if self.level < 0:
            raise fail("must not be negative", "use a phase of 180 deg to reverse the sign of a sine", ("level",))
        if self.quantity_ not in (None, meant(self.level) or self.quantity_):
            raise fail(
                f"is given in a unit of {meant(self.level)}, where {self.quantity_} is meant", "leave out quantity",
                ("level",),
            )  # fmt: skip


class ProfilePoint(_LevelAt):
    """A level that applies from a frequency on."""

    frequency: Frequency
    """Frequency of the point."""


class Notch(_LevelAt):
    """A range of frequencies in which the level is not exceeded."""

    from_: Frequency = Field(alias="from")
    """Lower frequency."""
    to: Frequency
    """Upper frequency."""

    def check(self) -> None:
        """Reject an empty range."""
        super().check()
        if self.to <= self.from_:
            raise fail(f"= {self.to:g} Hz does not lie above from = {self.from_:g} Hz", "give a range", ("to",))


def check_profile(points: tuple[ProfilePoint, ...], between: Between) -> None:
    """Reject a table that does not increase in frequency; raises what `fail` builds."""
    for index, (one, two) in enumerate(pairwise(points)):
        if two.frequency <= one.frequency:
            raise fail(
                f"= {two.frequency:g} Hz does not lie above the point before it ({one.frequency:g} Hz)",
                "list the points by increasing frequency",
                ("profile", index + 1, "frequency"),
            )
    for index, point in enumerate(points):
        if between == "log_log" and point.level == 0:
            raise fail(
                "= 0 has no logarithm",
                "give a small level, or between: held",
                ("profile", index, "level"),
            )
