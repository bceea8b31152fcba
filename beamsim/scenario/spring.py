"""Springs from a point of a body or a mass of a chain to the ground, or between two of them."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario import units
from beamsim.scenario.base import BY_FORM, Schema, counted, fail
from beamsim.scenario.place import BetweenPlaces, Sited, TwoPlaces
from beamsim.scenario.quantities import CubicStiffness, Duration, MassNumber, Name, NonNegativeStiffness, Quantity

Stretch = Annotated[float, Quantity(replace(units.LENGTH, name="displacement", example="0.1 mm"))]


class Maxwell(Schema):
    """A spring in series with a dashpot, beside what it is given for."""

    stiffness: NonNegativeStiffness
    """Stiffness of its spring: what a sudden deflection adds."""
    relaxation_time: Duration
    """Time in which its force falls by the factor e at a constant deflection: dashpot over stiffness."""


class SpringToGround(Sited):
    """A spring from a point of a body or a mass of a chain to the fixed ground."""

    name: Name = ""
    """Name, unique; ground_spring_1, ... by default."""


class SpringBetween(BetweenPlaces):
    """A spring between points of two bodies or of one, or between two masses of a chain, neighbours or not."""

    name: Name = ""
    """Name, unique; link_spring_1, ... by default."""
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
        if self.masses and self.between:
            raise fail("and between exclude each other", "keep one of the two", ("masses",))
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
