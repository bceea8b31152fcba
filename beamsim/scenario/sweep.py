"""Sweeps in frequency: swept sine, stepped sine, continuation."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import log2
from typing import Annotated, Any, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario.base import BY_FORM, fail
from beamsim.scenario.continuation import Continuation, refuse_empty_levels
from beamsim.scenario.driven import Between, FrequencyRange, Notch, ProfilePoint, check_profile
from beamsim.scenario.limits import OutputLimit
from beamsim.scenario.quantities import meant

HIGHEST_ORDER = 64
_NOTCHES: dict[str, Any] = {"examples": [{"probes.tip.acceleration": "20 g", "base.force": "2 kN"}]}


class _UpAndDown(FrequencyRange):
    """Common part of sweeps with a direction."""

    levels: tuple[q.Level, ...] = Field(default=(), json_schema_extra={"minItems": 1})
    """Levels, with one sweep for each; by default the level of the excitation."""

    direction: Literal["up", "down", "both"] = "up"
    """Up, down, or up and then down."""
    orders: tuple[q.PositiveNumber, ...] = (0.5, 1.0, 2.0, 3.0, 4.0)
    """Harmonics that are tracked: multiples of the excitation frequency, 0.5 for the first subharmonic."""
    accelerations: bool = True
    """Whether absolute accelerations of the probes are stored in addition to relative displacements."""
    impacts: bool = False
    """Whether impacts per cycle, their impulse, time in contact, energy lost and highest speed are computed, and of
    friction slides, distance, energy lost and wear power."""
    convergence: Literal["on", "off"] | None = None
    """Whether values are compared with those of a finer model; by default on, off in the cases of a study."""

    def check(self) -> None:
        """Reject a range that contradicts the direction, and orders that cannot be tracked."""
        refuse_empty_levels(self)
        super().check()
        if self.from_ > self.to:
            raise fail(
                f"= {self.to:g} Hz lies below sweep.from = {self.from_:g} Hz",
                "write the lower frequency as from, and direction: down",
                ("to",),
            )
        for index, order in enumerate(self.orders):
            if order > HIGHEST_ORDER or abs(Fraction(order).limit_denominator(12) - Fraction(order)) > 1e-3:
                raise fail(
                    f"= {order:g} is not an order that repeats within 12 cycles",
                    f"give whole numbers or simple fractions up to {HIGHEST_ORDER}: 0.5, 1, 1.5, 2",
                    ("orders", index),
                )

    @property
    def tracked_orders(self) -> tuple[float, ...]:
        """The orders as fractions that repeat within 12 cycles, each once, increasing."""
        return tuple(sorted({float(Fraction(order).limit_denominator(12)) for order in self.orders}))


class SweptSine(_UpAndDown):
    """A continuous sweep, logarithmic or linear in time."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A continuous sweep."""
    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    profile: tuple[ProfilePoint, ...] = ()
    """A table of levels, each from a frequency on, instead of one level (`levels` are then factors on it)."""
    between: Between = "held"
    """Between the points of the profile: each level held, or log-log interpolation."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges in which a level is not exceeded."""
    profile_file: q.FileName | None = None
    """A CSV file with the table of levels: a frequency and a level in each row, interpolated log-log (`levels` are then
    factors on it). Its path is relative to the folder of the scenario."""
    notch_to: dict[str, OutputLimit] | None = Field(default=None, json_schema_extra=_NOTCHES)
    """Limits to which the level is lowered: {probes.tip.acceleration: 20 g, base.force: 2 kN}. Names are
    probes.<name>.acceleration or .displacement, snubbers.<name>.force, base.force and outputs.<name>."""
    tolerance: q.PositiveNumber = 1e-12
    """Bound on the truncation error of the sine, relative to its amplitude."""
    history_rate: q.Frequency | None = None
    """Sample rate of the time history; without it only values per cycle are stored."""

    @property
    def duration(self) -> float:
        """Time of the sweep, up and down, s."""
        once = log2(self.to / self.from_) if self.rate.unit == "oct/s" else self.to - self.from_
        return (2.0 if self.direction == "both" else 1.0) * once / self.rate.value

    def check(self) -> None:
        """Reject a table that does not increase, and unusable tolerances."""
        super().check()
        check_profile(self.profile, self.between)
        if self.profile and self.profile_file is not None:
            raise fail("is given beside profile", "leave one of them out", ("profile_file",))
        if self.notch_to is not None:
            self._check_notches(self.notch_to)
        for index, level in enumerate(self.levels if self.profile or self.profile_file is not None else ()):
            if (said := meant(level)) is not None:
                raise fail(
                    f"is given in a unit of {said}, but multiplies the levels of the profile",
                    "give plain numbers: levels: [0.5, 1, 2]",
                    ("levels", index),
                )
        if not 1e-13 <= self.tolerance <= 1e-3:
            raise fail(f"= {self.tolerance:g} cannot be guaranteed", "use 1e-13 to 1e-3", ("tolerance",))

    def _check_notches(self, limits: Mapping[str, float]) -> None:
        """Automatic notches need one direction and positive levels, and accelerations where these are limited."""
        if not limits:
            raise fail("limits nothing", "give for example notch_to: {probes.tip.acceleration: 20 g}", ("notch_to",))
        if self.direction == "both":
            raise fail(
                "needs one direction: the level that keeps the limits is another one on the way down",
                "make two sweeps, direction: up and direction: down",
                ("notch_to",),
            )
        if not self.accelerations and any(name.endswith(".acceleration") for name in limits):
            raise fail("limits an acceleration, and accelerations = false", "leave that out", ("notch_to",))
        for at, points in (("profile", self.profile), ("notches", self.notches)):
            for index, point in enumerate(points):
                if point.level == 0:
                    raise fail("= 0 leaves nothing to lower", "give a small level", (at, index, "level"))
        for index, level in enumerate(self.levels):
            if level <= 0:
                raise fail(f"= {level:g} cannot be lowered to limits", "give a positive level", ("levels", index))


class SteppedSine(_UpAndDown):
    """Steady states at a list of frequencies, each started from the previous one."""

    kind: Literal["stepped"] = "stepped"
    """Steady states, frequency by frequency."""
    points: q.SteppedCount = 100
    """Number of frequencies."""
    spacing: Literal["logarithmic", "linear"] = "linear"
    """How the frequencies are spaced."""
    steady_to: q.PositiveNumber = 1e-6
    """A motion is steady if it repeats to this fraction of its size."""
    most_cycles: q.Count = 2000
    """Largest number of cycles at one frequency."""
    longest_period: q.Count = 8
    """Longest period considered, in cycles of the excitation."""
    measured_cycles: q.Count = 8
    """Smallest number of cycles measured after the motion is steady."""


Sweep = Annotated[SweptSine | SteppedSine | Continuation, BY_FORM]
