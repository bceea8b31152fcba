"""Broadband inputs: swept sine, sampled, random."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from beamsim.scenario.base import Schema, fail
from beamsim.scenario.driven import Driven, not_taken, spoken
from beamsim.scenario.level_profile import Between, Notch, ProfilePoint, check_profile
from beamsim.scenario.quantities import (
    INTEGRALS,
    Angle,
    Duration,
    FileName,
    Frequency,
    Level,
    NotNegativeWhole,
    PositiveNumber,
    SpectralDensity,
    SweepRate,
    Text,
    Time,
)
from beamsim.scenario.ranges import FrequencyRange


class SweptSineInput(Driven, FrequencyRange):
    """A sine of increasing or decreasing frequency; use it with `beamsim run` (`beamsim sweep` has its own section)."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A swept sine."""
    level: Level | None = None
    """Amplitude, zero to peak, if it is the same at all frequencies."""
    profile: tuple[ProfilePoint, ...] = ()
    """Instead of level: a table of levels, each from a frequency on."""
    between: Between = "held"
    """Between the points of the profile: each level held, or log-log interpolation."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges with a reduced level."""
    rate: SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    phase: Angle = 0.0
    """Phase of the sine at t = 0."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the level with its path."""
        return [] if self.level is None else [(("level",), self.level)]

    def settle(self) -> None:
        """Settle what the level is, and refuse an empty range."""
        if (self.level is None) == (not self.profile):
            raise fail("needs either level or profile", "give one of the two")
        FrequencyRange.settle(self)
        self.check_direction()
        check_profile(self.profile, self.between)
        if self.level is not None:
            Driven.settle(self)
            return
        for index, point in enumerate(self.profile):
            if point.quantity is not None and point.quantity not in self.takes:
                why, remedy = not_taken(point.quantity, self.takes)
                raise fail(f"is {why}", remedy, ("profile", index, "level"))
        self.resolve("quantity", self.quantity or self.takes[0])

    def plain_levels(self) -> None:
        """Forget the unit of the level."""
        if self.level is not None:
            self.resolve("level", float(self.level))

    @property
    def highest_frequency_hz(self) -> float:
        """The higher end of the sweep, Hz."""
        return max(self.from_, self.to)


class SampledInput(Driven):
    """A measured motion of the base, or force."""

    kind: Literal["sampled"] = "sampled"
    """Samples read from a file."""
    file: FileName
    """CSV, HDF5 (.h5, .hdf5) or UFF 58 (.uff, .unv) file; its path is relative to the folder of the scenario."""
    column: Text | None = None
    """CSV: number (from 1) or heading of the column of values; HDF5: path of the dataset; UFF: number of the set."""
    time_column: Text | None = None
    """CSV: number or heading of the time column, by default the first; HDF5: path of the time dataset."""
    sample_rate: Frequency | None = None
    """Samples per second, if the file has no time axis."""
    unit: Text | None = None
    """Unit of the values in the file (g, mm, N, ...), by default the one that the file states."""
    time_unit: Text | None = None
    """Unit of the time axis in the file (s, ms, ...), by default the one that the file states."""
    factor: PositiveNumber = 1.0
    """Factor by which the values are multiplied."""
    interpolation: Literal["linear", "cubic"] = "cubic"
    """Interpolation between the samples: linear, or a cubic spline."""
    resample: Frequency | None = None
    """Rate to which the samples are first resampled, if they are too fine for the run."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return nothing: the levels are in the file."""
        return []

    def settle(self) -> None:
        """Settle what is given."""
        self.check_direction()
        if self.unit is not None:
            from beamsim.scenario.quantities import LEVEL_DIMENSIONS
            from beamsim.scenario.units import UnitError, read_level

            try:
                _, dimension = read_level(f"1 {self.unit}", tuple(LEVEL_DIMENSIONS.values()))
            except UnitError as error:
                raise fail(error.message, error.remedy, ("unit",)) from None
            meant = next(name for name, known in LEVEL_DIMENSIONS.items() if known is dimension)
            if self.quantity not in (None, meant):
                raise fail(f"is a unit of {meant}, where {self.quantity} is meant", "change one of them", ("unit",))
            self.resolve("quantity", meant)
        quantity = self.quantity or self.takes[0]
        if quantity not in self.takes:
            raise fail(f"is {quantity}, which cannot act there", not_taken(quantity, self.takes)[1], ("quantity",))
        if quantity in INTEGRALS and self.interpolation == "linear":
            raise fail(
                f"= linear of the base's {spoken(quantity)} has corners, where the acceleration is infinite",
                "use interpolation: cubic, or give the acceleration",
                ("interpolation",),
            )
        self.resolve("quantity", quantity)


class PsdPoint(Schema):
    """A point in a table of power spectral density."""

    frequency: Frequency
    """Frequency."""
    density: SpectralDensity
    """One-sided density: g^2/Hz for an acceleration, N^2/Hz for a force."""


class RandomInput(Driven):
    """Gaussian noise with a given power spectral density."""

    kind: Literal["random"] = "random"
    """Random input."""
    psd: Annotated[tuple[PsdPoint, ...], Field(min_length=2)]
    """Density over frequency; log-log interpolation between the points, zero outside."""
    seed: NotNegativeWhole = 0
    """Seed of the random numbers: the same seed gives the same input."""
    amplitudes: Literal["fixed", "random"] | None = None
    """Amplitudes of the sines: fixed by the density, or random as those of a Gaussian process, whose RMS scatters
    between records. By default fixed, but random in a study over seeds."""
    period: Duration | None = None
    """The noise is a sum of sines that repeats after this time; the run's duration by default."""
    sample_rate: Frequency | None = None
    """Sample rate used for interpolation; by default 20 times the highest frequency."""
    ramp: Time = 0.0
    """Time over which the level rises at the beginning."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return nothing: the levels are densities."""
        return []

    def settle(self) -> None:
        """Check the table."""
        self.check_direction()
        for index, (one, two) in enumerate(zip(self.psd, self.psd[1:], strict=False)):
            if two.frequency <= one.frequency:
                raise fail(
                    f"= {two.frequency:g} Hz does not lie above the point before it ({one.frequency:g} Hz)",
                    "list the points by increasing frequency",
                    ("psd", index + 1, "frequency"),
                )
        highest = self.psd[-1].frequency
        if self.sample_rate is not None and self.sample_rate < 4 * highest:
            raise fail(
                f"= {self.sample_rate:g} Hz is too low for noise up to {highest:g} Hz",
                f"use {20 * highest:g} Hz, or leave it out",
                ("sample_rate",),
            )
        self.resolve("quantity", self.quantity or self.takes[0])
        if self.quantity != self.takes[0]:
            raise fail(f"must be {spoken(self.takes[0])}", "leave it out", ("quantity",))

    @property
    def highest_frequency_hz(self) -> float:
        """End of the table, Hz."""
        return self.psd[-1].frequency
