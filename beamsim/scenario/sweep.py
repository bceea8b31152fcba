"""Sweeps in frequency: swept sine, stepped sine, continuation."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field

from beamsim.scenario.base import BY_KIND, fail
from beamsim.scenario.continuation import Continuation, refuse_empty_levels
from beamsim.scenario.level_profile import Between, Notch, ProfilePoint, check_profile
from beamsim.scenario.quantities import Count, Frequency, Level, LevelValue, PositiveNumber, SteppedCount, SweepRate
from beamsim.scenario.ranges import FrequencyRange

HIGHEST_ORDER = 64


class _UpAndDown(FrequencyRange):
    """Common part of sweeps with a direction."""

    levels: tuple[Level, ...] = Field(default=(), json_schema_extra={"minItems": 1})
    """Levels, with one sweep for each; by default the level of the excitation."""

    direction: Literal["up", "down", "both"] = "up"
    """Up, down, or up and then down."""
    orders: tuple[PositiveNumber, ...] = (0.5, 1.0, 2.0, 3.0, 4.0)
    """Harmonics that are tracked: multiples of the excitation frequency, 0.5 for the first subharmonic."""
    accelerations: bool = True
    """Whether absolute accelerations of the probes are stored in addition to relative displacements."""
    impacts: bool = False
    """Whether impacts per cycle, their impulse, time in contact, energy lost and highest speed are computed."""

    def settle(self) -> None:
        """Reject a range that contradicts the direction, and orders that cannot be tracked."""
        refuse_empty_levels(self)
        super().settle()
        if self.from_ > self.to:
            raise fail(
                f"= {self.to:g} Hz lies below sweep.from = {self.from_:g} Hz",
                "write the lower frequency as from, and direction: down",
                ("to",),
            )
        from fractions import Fraction

        for index, order in enumerate(self.orders):
            if order > HIGHEST_ORDER or abs(Fraction(order).limit_denominator(12) - Fraction(order)) > 1e-3:
                raise fail(
                    f"= {order:g} is not an order that repeats within 12 cycles",
                    f"give whole numbers or simple fractions up to {HIGHEST_ORDER}: 0.5, 1, 1.5, 2",
                    ("orders", index),
                )
        self.resolve("orders", tuple(sorted({float(Fraction(o).limit_denominator(12)) for o in self.orders})))

    def plain_levels(self) -> Self:
        """The same without what the units of the levels said."""
        return self.model_copy(update={"levels": tuple(float(level) for level in self.levels)})


class SweptSine(_UpAndDown):
    """A continuous sweep, logarithmic or linear in time."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A continuous sweep."""
    rate: SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    profile: tuple[ProfilePoint, ...] = ()
    """A table of levels, each from a frequency on, instead of one level (`levels` are then factors on it)."""
    between: Between = "held"
    """Between the points of the profile: each level held, or log-log interpolation."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges in which a level is not exceeded."""
    tolerance: PositiveNumber = 1e-12
    """Bound on the truncation error of the sine, relative to its amplitude."""
    history_rate: Frequency | None = None
    """Sample rate of the time history; without it only values per cycle are stored."""

    def settle(self) -> None:
        """Reject a table that does not increase, and unusable tolerances."""
        super().settle()
        check_profile(self.profile, self.between)
        for index, level in enumerate(self.levels if self.profile else ()):
            if isinstance(level, LevelValue) and level.quantity is not None:
                raise fail(
                    f"is given in a unit of {level.quantity}, but multiplies the levels of the profile",
                    "give plain numbers: levels: [0.5, 1, 2]",
                    ("levels", index),
                )
        if not 1e-13 <= self.tolerance <= 1e-3:
            raise fail(f"= {self.tolerance:g} cannot be guaranteed", "use 1e-13 to 1e-3", ("tolerance",))


class SteppedSine(_UpAndDown):
    """Steady states at a list of frequencies, each started from the previous one."""

    kind: Literal["stepped"] = "stepped"
    """Steady states, frequency by frequency."""
    points: SteppedCount = 100
    """Number of frequencies."""
    spacing: Literal["logarithmic", "linear"] = "linear"
    """How the frequencies are spaced."""
    steady_to: PositiveNumber = 1e-6
    """A motion is steady if it repeats to this fraction of its size."""
    most_cycles: Count = 2000
    """Largest number of cycles at one frequency."""
    longest_period: Count = 8
    """Longest period considered, in cycles of the excitation."""
    measured_cycles: Count = 8
    """Smallest number of cycles measured after the motion is steady."""


Sweep = Annotated[SweptSine | SteppedSine | Continuation, BY_KIND]
