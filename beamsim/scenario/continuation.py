"""Continuation of periodic motions: parameter, method, and overlaid sweeps."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario.base import BY_FORM, Schema, Variants, fail
from beamsim.scenario.driven import Number, Span

MOST_HARMONICS = 500
LONGEST_PERIOD = 64


class _Path(Span[Number]):
    """A parameter that periodic motions are continued in."""

    points_at: tuple[Number, ...] = ()
    """Values at which every branch gets a point."""


class FrequencyPath(_Path[q.Frequency]):
    """The excitation's frequency changes."""

    kind: Literal["frequency"] = "frequency"
    """The excitation's frequency."""


class LevelPath(_Path[q.Level]):
    """The excitation's level changes, at its own frequency."""

    kind: Literal["level"] = "level"
    """The excitation's level."""

    def check(self) -> None:
        """Reject an empty range, and levels that excite nothing."""
        for name, value in (("from", self.from_), ("to", self.to)):
            if not value > 0:
                raise fail(
                    f"= {value:g} excites nothing"
                    if value == 0
                    else f"= {value:g} is negative, which only turns the phase",
                    "give a positive level",
                    (name,),
                )
        super().check()


class SnubberPath(Schema):
    """A property of one snubber changes."""

    snubber: q.Name | None = None
    """Name of the snubber; may be omitted if there is only one."""


class GapPath(SnubberPath, _Path[q.Gap]):
    """A snubber's gap changes."""

    kind: Literal["gap"] = "gap"
    """A snubber's gap."""


class StiffnessPath(SnubberPath, _Path[q.Stiffness]):
    """A snubber's stiffness changes; a dashpot given by a ratio changes with it."""

    kind: Literal["stiffness"] = "stiffness"
    """A snubber's stiffness."""


class PositionPath(SnubberPath, _Path[q.Position]):
    """A snubber moves along the beam; a dashpot given by a ratio changes with its position."""

    kind: Literal["position"] = "position"
    """A snubber's position along the beam."""


ResponseParameter = Annotated[FrequencyPath | LevelPath | GapPath | StiffnessPath | PositionPath, BY_FORM]

SecondParameter = Annotated[LevelPath | GapPath | StiffnessPath | PositionPath, BY_FORM]


class Shooting(Schema):
    """Newton's method on the flow over one period, with exact derivatives."""

    kind: Literal["shooting"] = "shooting"
    """Shooting."""


class HarmonicBalance(Schema):
    """Truncated Fourier series with exact contact forces; the cost does not depend on the size of the model."""

    kind: Literal["harmonic_balance"] = "harmonic_balance"
    """Harmonic balance."""
    harmonics: q.Count = 21
    """Highest harmonic of the fundamental frequency of the motion."""
    largest_error: q.Ratio = 0.01
    """Largest truncation error, relative to the motion, of a result that counts as reliable."""

    def check(self) -> None:
        """Reject more harmonics than can be solved for."""
        if self.harmonics > MOST_HARMONICS:
            raise fail(f"= {self.harmonics} is too many", f"use {MOST_HARMONICS} or fewer, or shooting", ("harmonics",))


Method = Annotated[
    Literal["shooting", "harmonic_balance"] | Shooting | HarmonicBalance,
    Variants("is not a known method", "write shooting, or {kind: harmonic_balance, harmonics: 21}"),
]


class SweptOverlay(Schema):
    """A swept sine over the same frequencies and levels, overlaid on the response curve."""

    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    direction: Literal["up", "down", "both"] = "both"
    """Up, down, or up and then down."""


class Continuation(Schema):
    """Branches of periodic motions, stable and unstable, continued in frequency or another parameter."""

    kind: Literal["continuation"] = "continuation"
    """Continuation of periodic motions in a parameter."""
    from_: q.Frequency | None = Field(default=None, alias="from")
    """First frequency; short for continue_in: {kind: frequency, from: ..., to: ...}."""
    to: q.Frequency | None = None
    """Last frequency."""
    continue_in: ResponseParameter | None = None
    """The parameter that changes, instead of from and to: frequency, level, gap, stiffness or position."""
    levels: tuple[q.Level, ...] = Field(default=(), json_schema_extra={"minItems": 1})
    """Levels, with one curve each; by default the level of the excitation."""
    method_: Method = Field(default="shooting", alias="method")
    """Shooting (exact), or harmonic balance."""
    follow_folds_in: SecondParameter | None = None
    """Follow the folds of a frequency response in a second parameter: level, gap, stiffness or position."""
    overlay: SweptOverlay | None = None
    """A swept sine overlaid on a frequency response."""
    points_at: tuple[q.Frequency, ...] = ()
    """Frequencies at which every branch gets a point; with continue_in they are given there."""
    stored_harmonics: q.Count = 5
    """Highest harmonic of the motion that is stored at every point."""
    seek_at: q.NotNegativeWhole = 3
    """Number of values of the parameter at which coexisting motions are sought (shooting); 0 for none."""
    side_branches: Literal["limited", "required", "none"] = "limited"
    """Branches that leave others at bifurcations (shooting), and coexisting ones: limited (the outcome names what a
    limit cut off), required (a limit that cuts one off makes the result incomplete) or none (not followed or sought).
    """
    longest_period: q.Count = 2
    """Longest period followed after period doublings, in periods of the excitation."""
    most_points: q.Count = 4000
    """Largest number of points of the curve of a level."""
    most_branch_points: q.Count = 2000
    """Largest number of points of one branch, so that others can be followed as well."""
    most_side_points: q.Count = 300
    """Largest number of points of a branch that leaves another one: at a period doubling or a branch point."""
    most_branches: q.Count = 40
    """Largest number of branches of a level."""
    longest_time: q.Duration = 600.0
    """Longest computing time for the curve of a level."""
    convergence: Literal["on", "off"] | None = None
    """Whether values are compared with those of a finer model; by default off."""

    def check(self) -> None:
        """Demand one range, and refuse what does not go together."""
        refuse_empty_levels(self)
        self._demand_one_range()
        parameter = self.parameter
        if parameter.kind == "level" and self.levels:
            raise fail("cannot be given if the level is the parameter", "leave levels out", ("levels",))
        by_balance = isinstance(self.method, HarmonicBalance)
        if by_balance and parameter.kind not in ("frequency", "level"):
            raise fail(
                f"= harmonic_balance follows the frequency or the level, not the {parameter.kind}",
                "use method: shooting",
                ("method",),
            )
        for name in ("follow_folds_in", "overlay"):
            if getattr(self, name) is not None and parameter.kind != "frequency":
                raise fail(
                    f"applies to a curve in frequency, but this one is in {parameter.kind}",
                    "leave it out, or give from and to as frequencies",
                    (name,),
                )
        if self.follow_folds_in is not None and by_balance:
            raise fail("follows folds by shooting", "use method: shooting", ("follow_folds_in",))
        if isinstance(self.follow_folds_in, LevelPath) and len(self.levels) > 1:
            raise fail("has several values, and the folds' level changes", "give one level", ("levels",))
        if self.follow_folds_in is not None and self.follow_folds_in.points_at:
            raise fail("belong to the curve, not to its folds", "leave them out", ("follow_folds_in", "points_at"))
        low, high = sorted((parameter.from_, parameter.to))
        for k, value in enumerate(parameter.points_at):
            if not low <= value <= high:
                at = ("continue_in", "points_at", k) if self.continue_in is not None else ("points_at", k)
                raise fail(f"= {value:g} lies outside the range", f"give a value from {low:g} to {high:g}", at)
        if self.stored_harmonics > MOST_HARMONICS:
            raise fail(
                f"= {self.stored_harmonics} is too many", f"use {MOST_HARMONICS} or fewer", ("stored_harmonics",)
            )
        if self.longest_period > LONGEST_PERIOD:
            raise fail(f"= {self.longest_period} is too long", f"use {LONGEST_PERIOD} or less", ("longest_period",))

    def _demand_one_range(self) -> None:
        if self.continue_in is not None:
            if self.points_at:
                raise fail("belong in continue_in", "give points_at there", ("points_at",))
            if self.from_ is not None or self.to is not None:
                raise fail(
                    "and from, to exclude each other",
                    "give the range inside continue_in, or only from and to",
                    ("continue_in",),
                )
            return
        for name, value in (("from", self.from_), ("to", self.to)):
            if value is None:
                raise fail(
                    "is missing",
                    "give from and to as frequencies, or continue_in: {kind: level, from: 0.5 g, to: 5 g}",
                    (name,),
                )
        self.parameter.check()

    @property
    def method(self) -> Shooting | HarmonicBalance:
        """The method with its settings; a word selects the defaults."""
        if isinstance(self.method_, str):
            return HarmonicBalance() if self.method_ == "harmonic_balance" else Shooting()
        return self.method_

    @property
    def parameter(self) -> FrequencyPath | LevelPath | GapPath | StiffnessPath | PositionPath:
        """What is followed, from where to where."""
        if self.continue_in is not None:
            return self.continue_in
        return FrequencyPath.model_construct(from_=self.from_, to=self.to, points_at=self.points_at)

    @property
    def follows_side_branches(self) -> bool:
        """Whether coexisting motions are sought, and branches followed from bifurcations."""
        return self.side_branches != "none"

    @property
    def demands_side_branches(self) -> bool:
        """Whether the result is incomplete where a limit cuts such a branch."""
        return self.side_branches == "required"


def refuse_empty_levels(sweep: Any) -> None:
    """Reject a list of levels that is given and has none."""
    if "levels" in sweep.model_fields_set and not sweep.levels:
        raise fail(
            "is an empty list", "give at least one level, or leave it out (null drops an inherited list)", ("levels",)
        )
