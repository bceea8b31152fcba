"""Rings: stops with a clearance all around, in the plane of two directions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario.base import (
    BY_FORM,
    TWO_ITEMS,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Whole,
    path_text,
    problem,
)
from beamsim.scenario.body import AtPlace, Named, PlacedItem
from beamsim.scenario.connections import (
    FrictionCoefficients,
    LinkSnubber,
    Snubber,
    SnubberViscousDamping,
    WearRate,
)

RING, TANGENT, AXIAL = "ring", "ring_tangent", "ring_axial"
"""Kinds of the contacts of a ring: its sides, and the friction at them along the wall and along the axis."""
PLANES: dict[str, tuple[Any, Any]] = {
    "x": ("y", "z"), "y": ("z", "x"), "z": ("x", "y"),
    "local_x": ("local_y", "local_z"), "local_y": ("local_z", "local_x"), "local_z": ("local_x", "local_y"),
}  # fmt: skip
"""By axis of a ring the directions of its plane."""
DEEPEST = 5.0  # largest penetration over the clearance that the tables are checked for
DEFAULT_PENETRATION = 0.05  # largest penetration over the clearance
SIDES_BY_DEPTH = 10.7  # default number of sides times the square root of penetration over clearance

MOST_SIDES = 2000

SemiAxes = tuple[q.Length, q.Length]
TwoOffsets = tuple[q.Gap, q.Gap]


class RingFriction(Schema):
    """Dry friction between the structure and the wall of a ring."""

    coefficient: Annotated[q.PositiveNumber | FrictionCoefficients, BY_FORM]
    """Coefficient of friction: one number, or {static: 0.3, sliding: 0.2}."""
    stiffness: q.Stiffness
    """Tangential stiffness while the structure sticks to the wall."""
    along_axis: bool = False
    """If true, friction also acts along the axis of the ring, at a node that moves there. It has a limit of its own:
    both together may be larger than one friction circle, by up to a factor of 1.41."""

    @property
    def coefficients(self) -> FrictionCoefficients:
        """The coefficients in their long form."""
        given = self.coefficient
        return given if isinstance(given, FrictionCoefficients) else FrictionCoefficients(static=given, sliding=given)


class RingStop(PlacedItem, Named):
    """A stop with a clearance all around: a tube in a support, a shaft in a retainer bearing.

    Its force points to the centre; it is the stiffness times the distance beyond the clearance.
    """

    distinguishing_keys: ClassVar[tuple[str, ...]] = ("kind",)

    kind: Literal["ring"]
    """ring: a clearance in the plane of two directions."""
    axis: Literal["x", "y", "z", "local_x", "local_y", "local_z"] = "x"
    """Axis of the ring at a node or member: it acts in the plane of the other two directions, y and z for x. local_x is
    the axis of a member of a frame."""
    along: Annotated[tuple[AtPlace, ...], TWO_ITEMS] | None = None
    """Two places with perpendicular directions of motion, instead of a node and an axis: [{row: tip_y}, {row:
    tip_z}]."""
    gap: Annotated[q.Length | SemiAxes, BY_FORM]
    """Radius of the clearance; or the two semi-axes of an elliptical one, along both directions: [0.5 mm, 0.3 mm]."""
    stiffness: q.StopStiffness
    """Radial stiffness in contact."""
    damping: SnubberViscousDamping | None = None
    """Dashpot in the direction of the radial force; none by default."""
    friction: RingFriction | None = None
    """Dry friction along the wall; none by default."""
    wear_rate: WearRate | None = None
    """Worn volume per normal force and sliding distance (Archard); no wear is computed by default."""
    offset: TwoOffsets = (0.0, 0.0)
    """Centre of the ring, along both directions, relative to the point of the undeformed structure: [0 mm, 0.4 mm]
    for a tube that rests on its support. Zero by default."""
    mounted_on: Literal["base", "ground"] = "base"
    """base: moves with the base excitation; ground: fixed."""
    largest_penetration_: q.Length | None = Field(default=None, alias="largest_penetration")
    """Largest penetration for which the force is accurate; 5 % of the clearance by default. A motion with a larger one
    has a warning."""
    sides_: Annotated[int, q.WholeNumber(12, MOST_SIDES)] | None = Field(default=None, alias="sides")
    """Number of flat sides whose forces add up to that of the ring, a multiple of 4; by default so many that the
    impulse of an impact is accurate to about 1 %."""

    def check(self) -> None:
        """Require one point with two directions, and a number of sides that is divisible by 4."""
        if self.along is None:
            super().check()
            self._check_point()
        else:
            for key in ("at", "node", "member", "position", "mass", "row", "direction"):
                self.exclude(key, "along", remedy="keep along: it names both places")
            if self.along[0] == self.along[1]:
                raise InvalidValueError("names one place twice", "name two directions of motion", ("along",))
            for index, place in enumerate(self.along):
                if (place.direction or "").removeprefix("local_").startswith("r"):
                    raise InvalidValueError(
                        f"= {place.direction} is a rotation", "name displacements", ("along", index, "direction")
                    )
        if self.friction is not None:
            self._check_friction(self.friction)
        if self.sides_ is not None and self.sides_ % 4:
            near = 4 * round(self.sides_ / 4)
            raise InvalidValueError(f"= {self.sides_} is no multiple of 4", f"give sides: {near}", ("sides",))
        if self.sides_ is None and self._sides_by_depth > MOST_SIDES:
            raise InvalidValueError(
                f"= {self.largest_penetration:g} m asks for {self._sides_by_depth:.3g} sides, more than {MOST_SIDES}",
                "give a penetration nearer to that of the motion, or sides", ("largest_penetration",),
            )  # fmt: skip
        if self.largest_penetration > DEEPEST * min(self.semi_axes):
            raise InvalidValueError(
                f"= {self.largest_penetration:g} m is more than {DEEPEST:g} times the gap, {min(self.semi_axes):g} m",
                "check the units", ("largest_penetration",),
            )  # fmt: skip

    def _check_friction(self, friction: RingFriction) -> None:
        if self.dashpot:
            raise InvalidValueError(
                "does not go with damping: where sliding ends depends on the rate of the normal force, and that of a "
                "dashpot on accelerations",
                "leave one of the two out", ("friction",),
            )  # fmt: skip
        if friction.along_axis and self.along is not None:
            raise InvalidValueError(
                "needs a node that moves along the axis", "give node: 5 and axis: x", ("friction", "along_axis")
            )
        if friction.coefficients.stribeck_speed is not None:
            remedy = "leave it out: the coefficient then falls at once"
            raise InvalidValueError("does not go with a ring", remedy, ("friction", "coefficient", "stribeck_speed"))

    def _check_point(self) -> None:
        place = self.place
        if place.node is None and place.member is None:
            raise InvalidValueError(
                "needs a point that moves in two directions", "give node: 5 and axis: x, or along: [place, place]"
            )
        if place.direction is not None:
            where = ("direction",) if self.at is None else ("at", "direction")
            raise InvalidValueError("does not go with a ring", "give the axis of the ring: axis: x", where)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The two places, one for each direction of the plane."""
        if self.along is not None:
            return self.along
        return tuple(self.place.model_copy(update={"direction": direction}) for direction in PLANES[self.axis])

    @property
    def probed_places(self) -> tuple[AtPlace, ...]:
        """Places of the default probes."""
        return self.places

    @property
    def dashpot(self) -> float:
        """N s/m, zero without damping."""
        return 0.0 if self.damping is None else self.damping.coefficient

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Clearance along both directions, m."""
        return self.gap if isinstance(self.gap, tuple) else (self.gap, self.gap)

    @property
    def largest_penetration(self) -> float:
        """Penetration up to which the table of the sides is fitted, m."""
        return self.largest_penetration_ or DEFAULT_PENETRATION * min(self.semi_axes)

    @property
    def sides(self) -> int:
        """Number of sides; a property of the curvature and the largest penetration by default."""
        if self.sides_ is not None:
            return self.sides_
        return 4 * math.ceil(max(self._sides_by_depth, 24.0) / 4.0)

    @property
    def _sides_by_depth(self) -> float:
        """Number of sides with which the impulse of an impact is accurate to about 1 %."""
        flattest = max(self.semi_axes) ** 2 / min(self.semi_axes)  # m, largest radius of curvature
        return SIDES_BY_DEPTH * math.sqrt(flattest / self.largest_penetration)

    def refine(self) -> RingStop:
        """The ring with twice as many sides."""
        return self.model_copy(update={"sides_": 2 * self.sides})

    stops: ClassVar[tuple[Any, ...]] = ()
    """None: a ring is not a one-sided stop."""

    @property
    def parts(self) -> tuple[RingPart, ...]:
        """Its sides, then the friction along the wall at each of them, then that along the axis."""
        kinds = [RING]
        if self.friction is not None:
            kinds += [TANGENT, AXIAL] if self.friction.along_axis else [TANGENT]
        return tuple(RingPart(self, kind, number) for kind in kinds for number in range(self.sides))

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: cubic springs, whose motion is not computed with rings."""
        if self.along is None:
            yield from super().problems(scenario, path)
        if scenario.has_cubic_springs:
            yield problem((*path, "kind"), "= ring does not go with cubic springs", "make them piecewise_linear")
        for section, remedy in (("nnm", "use a sweep with kind: continuation"), ("identify_stiffness", "use a run")):
            if getattr(scenario, section) is not None:
                yield problem((*path, "kind"), f"= ring does not go with {section}", remedy)

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """A warning about a structure that begins outside of the clearance by more than the largest penetration."""
        a, b = self.semi_axes
        distance = math.hypot(self.offset[0] / a, self.offset[1] / b)
        if distance > 1.0 + self.largest_penetration / min(a, b):
            yield f"{path_text((*path, 'offset'))} = {list(self.offset)} m puts the structure beyond the clearance"


AnyStop = Annotated[Snubber | LinkSnubber | RingStop, BY_FORM]


@dataclass(frozen=True)
class RingPart:
    """A side of a ring, or the friction at it."""

    ring: RingStop
    kind: str  # RING, TANGENT or AXIAL
    number: int  # of the side

    @property
    def name(self) -> str:
        """Name of the ring."""
        return self.ring.name

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The two places of the ring; of friction along the axis the place in that direction."""
        if self.kind == AXIAL:
            return (self.ring.place.model_copy(update={"direction": self.ring.axis}),)
        return self.ring.places

    @property
    def sides_before(self) -> int:
        """How many contacts before it is the side that presses it; 0 of a side."""
        return {RING: 0, TANGENT: 1, AXIAL: 2}[self.kind] * self.ring.sides

    @property
    def mounted_on(self) -> str:
        """What the ring is mounted on."""
        return self.ring.mounted_on

    @property
    def angle(self) -> float:
        """Angle of the normal of the side, rad."""
        return 2.0 * math.pi * self.number / self.ring.sides

    @property
    def factors(self) -> tuple[float, float]:
        """Direction cosines of the motion along the normal of the side, or of the friction along the wall."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return (c, s) if self.kind == RING else (-s, c)

    @property
    def distance(self) -> float:
        """Distance of the side from the undeformed structure, m; 0 of friction."""
        if self.kind != RING:
            return 0.0
        (a, b), (c, s), (x, y) = self.ring.semi_axes, self.factors, self.ring.offset
        return math.hypot(a * c, b * s) + c * x + s * y

    @property
    def curvature_radius(self) -> float:
        """Radius of curvature of the clearance at the side, m."""
        (a, b), (c, s) = self.ring.semi_axes, self.factors
        if a == b:
            return a
        return (a * b) ** 2 / math.hypot(a * c, b * s) ** 3
