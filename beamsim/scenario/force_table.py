"""Measured force-deflection curves of stops."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

from pydantic import Tag

from beamsim.scenario.base import Path, Schema, Variants, counted, fail
from beamsim.scenario.quantities import FileName, Force, Gap, PositiveNumber, Whole

ForcePoint = tuple[Gap, Force]
"""Deflection and force."""
ForcePoints = tuple[ForcePoint, ...]

_START = "subtract the gap or the preload from the measured curve, and give it with gap or preload"


class SegmentFit(Schema):
    """A piecewise-linear curve through measured points."""

    segments: Annotated[int, Whole(1, 50)]
    """Number of straight lines."""


class MeasuredForces(Schema):
    """A force-deflection curve from a file, or one that is to be fitted."""

    file: FileName | None = None
    """CSV file, relative to the scenario's folder; headings state units: deflection (mm), force (N), time (s)."""
    points: ForcePoints | None = None
    """Pairs of deflection and force, instead of a file."""
    fit: SegmentFit | None = None
    """Fit the rising piecewise-linear curve through zero with so many segments; by default the points are the curve."""
    scale: PositiveNumber = 1.0
    """Factor of all forces; studies vary it, and identify_stiffness.nonlinear finds it from measured vibrations."""
    segment_factors: tuple[PositiveNumber, ...] = ()
    """Factor of the stiffness of each segment, from the first; 1 by default. Studies vary them, and
    identify_stiffness.nonlinear finds them from vibrations at several levels."""

    def settle(self) -> None:
        """Demand a file or points, and of points that are not fitted that they are a curve."""
        if (self.file is None) == (self.points is None):
            raise fail("needs file or points, one of them", "give file: pad.csv, or points: [[0 mm, 0 N], [1 mm, 9 N]]")
        if self.points is not None and self.fit is None:
            check_points(self.points, ("points",))
        elif self.points is not None and len(self.points) < 2:
            raise fail("has too few points to fit", "measure more points", ("points",))


def check_points(points: ForcePoints, at: Path = ()) -> None:
    """Reject points that are no rising curve from zero."""
    if len(points) < 2:
        raise fail(
            f"has {counted(len(points), 'point')}", "give zero and at least one more: [[0 mm, 0 N], [1 mm, 9 N]]", at
        )
    if points[0] != (0.0, 0.0):
        raise fail(f"starts at {points[0][0]:g} m, {points[0][1]:g} N instead of zero", _START, (*at, 0))
    for index, ((x, force), (next_x, next_force)) in enumerate(pairwise(points), start=1):
        if not next_x > x:
            remedy = "list the points by increasing deflection, each once; give measured loops with fit: {segments: 5}"
            raise fail(f"= {next_x:g} m does not lie above the one before, {x:g} m", remedy, (*at, index, 0))
        if next_force < force:
            remedy = "a stop whose force falls is not modelled; where it is noise, add fit: {segments: 5}"
            raise fail(f"= {next_force:g} N falls below the one before, {force:g} N", remedy, (*at, index, 1))
    if points[-1][1] == 0.0:
        raise fail("has no force at all", "give the force at the largest deflection", (*at, len(points) - 1, 1))


def _form(value: Any) -> str:
    """Tag of a table as it is written."""
    return "<list>" if isinstance(value, (list, tuple)) else "<text>" if isinstance(value, str) else "<table>"


ForceDeflection = Annotated[
    Annotated[ForcePoints, Tag("<list>")]
    | Annotated[FileName, Tag("<text>")]
    | Annotated[MeasuredForces, Tag("<table>")],
    Variants(_form),
]
"""Pairs, the name of a file, or either with a fit."""


def as_measured(value: Any) -> MeasuredForces:
    """The curve in its long form."""
    if isinstance(value, MeasuredForces):
        return value
    return MeasuredForces(file=value) if isinstance(value, str) else MeasuredForces(points=value)
