"""Springs at points of bodies and masses of chains, and joints between two points or a point and the base."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, Schema, Variants, counted, demand_rising, fail
from beamsim.scenario.body import Body
from beamsim.scenario.place import (
    AtPlace,
    BaseOrPlace,
    BetweenPlaces,
    Named,
    Sited,
    TwoPlaces,
    refuse_unlike_directions,
)
from beamsim.scenario.quantities import CubicStiffness, Duration, MassNumber, NonNegativeStiffness, Quantity

Stretch = Annotated[float, Quantity(replace(units.LENGTH, name="displacement", example="0.1 mm"))]


class Maxwell(Schema):
    """A spring in series with a dashpot, beside what it is given for."""

    stiffness: NonNegativeStiffness
    """Stiffness of its spring: what a sudden deflection adds."""
    relaxation_time: Duration
    """Time in which its force falls by the factor e at a constant deflection: dashpot over stiffness."""


class SpringToGround(Sited, Named):
    """A spring from a point of a body or a mass of a chain to the fixed ground."""


class SpringBetween(BetweenPlaces, Named):
    """A spring between points of two bodies or of one, or between two masses of a chain, neighbours or not."""

    between: TwoPlaces = ()
    """The two places; the stretch is positive when the second moves up from the first."""
    masses: tuple[MassNumber, ...] = ()
    """Instead of between the numbers of two masses of a chain; the stretch is positive when they separate."""

    @property
    def ends(self) -> tuple[str, TwoPlaces]:
        """The key that names both places, and what it names."""
        return ("masses", self.masses) if self.masses else super().ends

    def check(self) -> None:
        """Refuse places that are named twice."""
        self.exclude("masses", "between")
        super().check()


def has_own_law(item: Schema) -> bool:
    """Whether a spring or joint is more than a linear spring: nonlinear, or with Maxwell branches that act."""
    kind = getattr(item, "kind", "")
    branches = getattr(item, "maxwell", ())
    return kind in ("cubic", "piecewise_linear") or any(branch.stiffness > 0.0 for branch in branches)


class LinearSpring(Schema):
    """Force = stiffness times stretch."""

    kind: Literal["linear"] = "linear"
    """Force = stiffness times stretch."""
    stiffness: NonNegativeStiffness
    """Stiffness."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches parallel to it, any number of them."""


class CubicSpring(Schema):
    """Force = stiffness times stretch cubed."""

    kind: Literal["cubic"] = "cubic"
    """Force = stiffness times stretch cubed."""
    stiffness: CubicStiffness
    """Stiffness; negative softens."""


class PiecewiseLinearSpring(Schema):
    """A continuous piecewise-linear force through the origin."""

    kind: Literal["piecewise_linear"] = "piecewise_linear"
    """Piecewise-linear force, continuous, zero at zero stretch."""
    breakpoints: Annotated[tuple[Stretch, ...], Field(json_schema_extra={"minItems": 1})]
    """Stretches at which the slope changes, increasing."""
    stiffnesses: tuple[NonNegativeStiffness, ...]
    """Slopes below the first breakpoint, between the first two, ... above the last: one more than breakpoints."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches parallel to it, any number of them."""

    def check(self) -> None:
        """Check the lengths and the order."""
        bends, slopes = len(self.breakpoints), len(self.stiffnesses)
        if not bends:
            raise fail("is an empty list", "give at least one value, or use kind: linear", ("breakpoints",))
        if slopes != bends + 1:
            raise fail(
                f"has {counted(slopes, 'value')} for {counted(bends, 'breakpoint')}",
                f"give {bends + 1} slopes: below the first breakpoint, between neighbours, above the last",
                ("stiffnesses",),
            )
        demand_rising(self.breakpoints, "m", lambda k: ("breakpoints", k))
        super().check()

    @property
    def number_at_rest(self) -> int:
        """Index of the slope at zero stretch; of the smaller one if zero is a breakpoint."""
        at = bisect_left(self.breakpoints, 0.0)
        on_it = at < len(self.breakpoints) and self.breakpoints[at] == 0.0
        return at + 1 if on_it and self.stiffnesses[at + 1] < self.stiffnesses[at] else at

    @property
    def slope_at_rest(self) -> float:
        """Slope at zero stretch, N/m."""
        return self.stiffnesses[self.number_at_rest]


class LinearGroundSpring(LinearSpring, SpringToGround):
    """A linear spring to the fixed ground."""


class CubicGroundSpring(CubicSpring, SpringToGround):
    """A cubic spring to the fixed ground."""


class PiecewiseLinearGroundSpring(PiecewiseLinearSpring, SpringToGround):
    """A piecewise-linear spring to the fixed ground."""


class LinearLinkSpring(LinearSpring, SpringBetween):
    """A linear spring between two points or masses."""


class CubicLinkSpring(CubicSpring, SpringBetween):
    """A cubic spring between two points or masses."""


class PiecewiseLinearLinkSpring(PiecewiseLinearSpring, SpringBetween):
    """A piecewise-linear spring between two points or masses."""


GroundSpring = Annotated[LinearGroundSpring | CubicGroundSpring | PiecewiseLinearGroundSpring, BY_FORM]
LinkSpring = Annotated[LinearLinkSpring | CubicLinkSpring | PiecewiseLinearLinkSpring, BY_FORM]


JointEnd = Annotated[
    BaseOrPlace,
    Variants(
        "names neither a point of a body nor the base",
        "write {body: panel, position: 0 mm}, {body: chain, mass: 2} or base",
    ),
]


class Joint(Named):
    """Common part of all joints."""

    between: Annotated[tuple[JointEnd, ...], Field(json_schema_extra={"minItems": 2, "maxItems": 2})]
    """Two points of bodies, or a point and base."""

    def check(self) -> None:
        """Demand two different ends, at least one of them on a body."""
        if len(self.between) != 2:
            remedy = "name the two that it joins: [{body: yoke, position: 300 mm}, {body: panel, position: 0 mm}]"
            raise fail(f"names {counted(len(self.between), 'end')}", remedy, ("between",))
        if self.between[0] == self.between[1]:
            raise fail("joins a point to itself", "name two different points", ("between",))
        refuse_unlike_directions(self.places)

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The points of bodies, one or two."""
        return tuple(end for end in self.between if isinstance(end, AtPlace))

    @property
    def turns_against(self) -> bool:
        """Whether a rotation of one end acts on the other."""
        return False


class RigidJoint(Joint):
    """Deflection and slope are the same on both sides."""

    kind: Literal["rigid"] = "rigid"
    """Holds deflection and slope."""

    @property
    def turns_against(self) -> bool:
        """Always."""
        return True


class _Turning(Joint):
    rotational_stiffness: q.RotationalStiffness = 0.0
    """Moment per difference of the slopes; none by default."""
    rotational_dashpot: q.RotationalDashpot = 0.0
    """Moment per difference of their rates; none by default."""

    @property
    def turns_against(self) -> bool:
        """Where it has a rotational spring or dashpot."""
        return self.rotational_stiffness > 0.0 or self.rotational_dashpot > 0.0


class HingeJoint(_Turning):
    """The deflection is the same on both sides; the slopes differ."""

    kind: Literal["hinge"] = "hinge"
    """Holds the deflection."""


class SpringJoint(_Turning):
    """Springs and dashpots between deflections and between slopes."""

    kind: Literal["spring"] = "spring"
    """Holds nothing; springs act."""
    stiffness: q.NonNegativeStiffness = 0.0
    """Force per difference of the deflections; none by default."""
    dashpot: q.Dashpot = 0.0
    """Force per difference of the velocities; none by default."""
    maxwell: tuple[Maxwell, ...] = ()
    """Maxwell branches between the deflections, any number of them."""

    def check(self) -> None:
        """Demand something that acts."""
        super().check()
        if not (self.stiffness or self.dashpot or self.turns_against or self.maxwell):
            raise fail("has neither a stiffness nor a dashpot", "give stiffness: 10 kN/m, or leave the joint out")


AnyJoint = Annotated[RigidJoint | HingeJoint | SpringJoint, BY_FORM]


@dataclass(frozen=True)
class Apart:
    """A joint whose points do not lie together, as the joints before it place the bodies."""

    index: int  # of the joint
    distance: float  # m along the bodies' common axis
    through: str  # body of the second point


@dataclass(frozen=True)
class Placed:
    """Where joints put the bodies along one axis: these have no place of their own, a joint puts its points together.

    The first joint between two bodies tells; one that closes a loop may not fit.
    """

    origin: dict[str, float]  # by body where it begins, m
    group: dict[str, str]  # by body the first one of those that joints connect to it
    apart: tuple[Apart, ...]

    @property
    def of_first_group(self) -> dict[str, float]:
        """Where the bodies begin, m, that joints link to the first one of them; that one begins at 0."""
        leading = next(iter(self.origin), "")
        together = (name for name in self.origin if self.group[name] == self.group[leading])
        return {name: self.origin[name] - self.origin[leading] for name in together}


def placed(joints: Sequence[Joint], bodies: Mapping[str, Body], default_body: str) -> Placed:
    """Where joints put bodies; of places without a body it is the default one."""
    origin: dict[str, float] = {}
    group: dict[str, str] = {}
    apart: list[Apart] = []
    for index, joint in enumerate(joints):
        named = [(place.body or default_body, place.position) for place in joint.places]
        ends = [
            (name, bodies[name].metres(position))
            for name, position in named
            if name in bodies and position is not None and not isinstance(position, tuple)
        ]
        if len(ends) != 2:
            continue
        (first, x), (second, y) = ends
        for name in (first, second):
            origin.setdefault(name, 0.0)
            group.setdefault(name, name)
        gap, merged = origin[first] + x - origin[second] - y, group[second]
        if group[first] != merged:
            for name in [name for name, label in group.items() if label == merged]:
                origin[name] += gap
                group[name] = group[first]
        elif first != second and abs(gap) > 1e-6 * max(x, y):
            apart.append(Apart(index, abs(gap), second))
    return Placed(origin, group, tuple(apart))
