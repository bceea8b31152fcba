"""The level of a sweep over frequency: a table of points, and notches."""

from __future__ import annotations

import itertools
from typing import Literal

from pydantic import Field

from beamsim.scenario.base import Schema, fail
from beamsim.scenario.driven import Quantity
from beamsim.scenario.quantities import Frequency, Level, LevelValue

Between = Literal["held", "log_log"]


class _LevelAt(Schema):
    level: Level
    """Amplitude, zero to peak."""
    quantity: Quantity | None = None
    """Acceleration, velocity, displacement or force; as the unit of the level says."""

    def settle(self) -> None:
        """Keep what the unit of the level said."""
        if self.level < 0:
            raise fail("must not be negative", "use a phase of 180 deg to reverse the sign of a sine", ("level",))
        meant = self.level.quantity if isinstance(self.level, LevelValue) else None
        if meant is not None and self.quantity not in (None, meant):
            raise fail(
                f"is given in a unit of {meant}, where {self.quantity} is meant", "leave out quantity", ("level",)
            )
        self.resolve("quantity", self.quantity or meant)
        self.resolve("level", float(self.level))


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

    def settle(self) -> None:
        """Reject an empty range."""
        super().settle()
        if self.to <= self.from_:
            raise fail(f"= {self.to:g} Hz does not lie above from = {self.from_:g} Hz", "give a range", ("to",))


def check_profile(points: tuple[ProfilePoint, ...], between: Between) -> None:
    """Reject a table that does not increase in frequency; raises what `fail` builds."""
    for index, (one, two) in enumerate(itertools.pairwise(points)):
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
