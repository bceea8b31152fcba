"""Sweeps in frequency: swept sine, stepped sine, continuation."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, fail
from beamsim.scenario.quantities import Frequency, Level, SteppedCount, SweepRate

__all__ = ["Continuation", "SteppedSine", "Sweep", "SweptSine"]


class _FrequencyRange(Schema):
    """What all sweeps share."""

    from_: Frequency = Field(alias="from")
    """First frequency."""
    to: Frequency
    """Last frequency."""
    levels: tuple[Level, ...] = ()
    """Levels, each swept by itself; the level of the excitation by default."""

    def settle(self) -> None:
        """Refuse an empty range."""
        if self.from_ == self.to:
            raise fail(f"= {self.to:g} Hz is where the sweep begins", "give a range, from 20 Hz to 400 Hz", ("to",))


class _UpAndDown(_FrequencyRange):
    """What sweeps with a direction share."""

    direction: Literal["up", "down", "both"] = "up"
    """Up, down, or up and then down."""

    def settle(self) -> None:
        """Refuse a range that contradicts the direction."""
        super().settle()
        if self.from_ > self.to:
            raise fail(
                f"= {self.to:g} Hz lies below sweep.from = {self.from_:g} Hz",
                "write the lower frequency as from, and direction: down",
                ("to",),
            )


class SweptSine(_UpAndDown):
    """A continuous sweep, logarithmic or linear in time."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A continuous sweep."""
    rate: SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""


class SteppedSine(_UpAndDown):
    """Steady states at a list of frequencies, each from the one before."""

    kind: Literal["stepped"] = "stepped"
    """Steady states, frequency by frequency."""
    points: SteppedCount = 100
    """Number of frequencies."""
    spacing: Literal["logarithmic", "linear"] = "linear"
    """How the frequencies are spaced."""


class Continuation(_FrequencyRange):
    """The curve of periodic motions, stable and unstable, followed in frequency."""

    kind: Literal["continuation"] = "continuation"
    """Periodic motions followed in frequency."""


Sweep = Annotated[
    Annotated[SweptSine, Tag("<swept_sine>")]
    | Annotated[SteppedSine, Tag("<stepped>")]
    | Annotated[Continuation, Tag("<continuation>")],
    BY_KIND,
]
