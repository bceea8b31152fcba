"""Springs from a point of a body or a mass of a chain to the ground, or between two of them."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, Schema, counted, fail
from beamsim.scenario.place import AtPlace, BetweenPlaces, Named, Sited, TwoPlaces
from beamsim.scenario.quantities import CubicStiffness, Duration, MassNumber, Name, NonNegativeStiffness, Quantity

Stretch = Annotated[float, Quantity(replace(units.LENGTH, name="displacement", example="0.1 mm"))]
Pair = Annotated[tuple[MassNumber, ...], Field(json_schema_extra={"minItems": 2, "maxItems": 2})]


def check_pair(masses: tuple[int, ...], key: str) -> None:
    """Reject anything but two different masses."""
    if len(masses) != 2:
        raise fail(
            f"names {counted(len(masses), 'mass', 'masses')}",
            "give the two masses that it joins, for example [1, 2]",
            (key,),
        )
    if masses[0] == masses[1]:
        raise fail(f"= [{masses[0]}, {masses[1]}] connects a mass to itself", "give two different masses", (key,))


class Maxwell(Schema):
    """A spring in series with a dashpot, beside what it is given for."""

    stiffness: NonNegativeStiffness
    """Stiffness of its spring: what a sudden deflection adds."""
    relaxation_time: Duration
    """Time in which its force falls by the factor e at a constant deflection: dashpot over stiffness."""


class Spring(Named):
    """Common part of all springs."""

    name: Name = ""
    """Name, unique; ground_spring_1, ... or link_spring_1, ... by default."""


class OnMass(Spring):
    """A spring from a mass to the ground."""

    mass: MassNumber
    """Number of the mass, from 1."""

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """The one place."""
        return (AtPlace(mass=self.mass),)


class BetweenMasses(Spring):
    """A spring between two masses, neighbours or not."""

    masses: Pair
    """Numbers of the two masses; the stretch is positive when they separate."""

    def check(self) -> None:
        """Demand two different masses."""
        check_pair(self.masses, "masses")
        super().check()

    @property
    def places(self) -> tuple[AtPlace, ...]:
        """Both places, the mass with the lower number first."""
        return tuple(AtPlace(mass=number) for number in sorted(self.masses))


class AtPoint(Sited, Spring):
    """A spring from a point of a body to the ground."""


class BetweenPoints(BetweenPlaces, Spring):
    """A spring between points of two bodies or of one."""

    between: TwoPlaces
    """The two places; the stretch is positive when the second moves up from the first."""


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
        for index, (a, b) in enumerate(pairwise(self.breakpoints), start=1):
            if not b > a:
                raise fail(
                    f"= {b:g} m does not lie above the one before, {a:g} m",
                    "list the breakpoints from the lowest to the highest, each once",
                    ("breakpoints", index),
                )
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


class LinearGroundSpring(LinearSpring, OnMass):
    """A linear spring from a mass to the fixed ground."""


class CubicGroundSpring(CubicSpring, OnMass):
    """A cubic spring from a mass to the fixed ground."""


class PiecewiseLinearGroundSpring(PiecewiseLinearSpring, OnMass):
    """A piecewise-linear spring from a mass to the fixed ground."""


class LinearLinkSpring(LinearSpring, BetweenMasses):
    """A linear spring between two masses."""


class CubicLinkSpring(CubicSpring, BetweenMasses):
    """A cubic spring between two masses."""


class PiecewiseLinearLinkSpring(PiecewiseLinearSpring, BetweenMasses):
    """A piecewise-linear spring between two masses."""


class LinearPointSpring(LinearSpring, AtPoint):
    """A linear spring from a point to the fixed ground."""


class CubicPointSpring(CubicSpring, AtPoint):
    """A cubic spring from a point to the fixed ground."""


class PiecewiseLinearPointSpring(PiecewiseLinearSpring, AtPoint):
    """A piecewise-linear spring from a point to the fixed ground."""


class LinearSpringBetween(LinearSpring, BetweenPoints):
    """A linear spring between two points."""


class CubicSpringBetween(CubicSpring, BetweenPoints):
    """A cubic spring between two points."""


class PiecewiseLinearSpringBetween(PiecewiseLinearSpring, BetweenPoints):
    """A piecewise-linear spring between two points."""


GroundSpring = Annotated[LinearGroundSpring | CubicGroundSpring | PiecewiseLinearGroundSpring, BY_FORM]
LinkSpring = Annotated[LinearLinkSpring | CubicLinkSpring | PiecewiseLinearLinkSpring, BY_FORM]
PointGroundSpring = Annotated[LinearPointSpring | CubicPointSpring | PiecewiseLinearPointSpring, BY_FORM]
PointLinkSpring = Annotated[LinearSpringBetween | CubicSpringBetween | PiecewiseLinearSpringBetween, BY_FORM]
