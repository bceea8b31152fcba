"""Analyses of periodic motions: frequency sweeps, continuations, and nonlinear normal modes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from math import log, log2, tau
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field

from beamsim.scenario import quantities as q
from beamsim.scenario import units
from beamsim.scenario.base import (
    BY_FORM,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    ShortFor,
    Variants,
    Whole,
    path_text,
    problem,
    unknown,
)
from beamsim.scenario.body import Body, LocatedItem
from beamsim.scenario.connections import HingeStop, PiecewiseLinearSpring, SpringToGround
from beamsim.scenario.excitation import (
    Between,
    FrequencyRange,
    Harmonic,
    Notch,
    Number,
    ProfilePoint,
    Span,
    check_profile,
    level_jumps,
    level_problems,
    not_harmonic,
    sine_problems,
)
from beamsim.scenario.files import SHORT_FOR_FILE, CurveFile
from beamsim.scenario.reporting import (
    BASE_FORCE,
    QUANTITIES_OF,
    OutputLimit,
    limited_quantity,
    output_dimension,
    unit_problems,
)
from beamsim.scenario.run import MOST_SAMPLES, mode_problems

Harmonics = Annotated[int, q.WholeNumber(1, 500)]


class _Path(Span[Number]):
    """A continuation parameter of periodic motions."""

    points_at: tuple[Number, ...] = ()
    """Values at which every branch gets a point."""

    def in_metres(self, scenario: Whole) -> Self:
        """A copy with positions in m on the body of the scenario."""
        return self

    def value_in(self, scenario: Whole, levels: tuple[float, ...]) -> float | None:
        """The value of the parameter in the scenario, for a curve with these levels; None if there is none."""
        return None

    def problems_of_parameter(self, scenario: Whole, path: Path) -> Problems:
        """Problems if the parameter at a path cannot be varied in this scenario."""
        yield from ()


class FrequencyPath(_Path[q.Frequency]):
    """The frequency of the excitation as parameter."""

    kind: Literal["frequency"] = "frequency"
    """The frequency of the excitation."""


class LevelPath(_Path[q.PositiveLevel]):
    """The level of the excitation as parameter, at fixed frequency."""

    kind: Literal["level"] = "level"
    """The level of the excitation."""

    def value_in(self, scenario: Whole, levels: tuple[float, ...]) -> float | None:
        """The first level of the curve, else that of the excitation."""
        return float(levels[0]) if levels else getattr(scenario.excitation, "level", None)


def no_stop_of_hinge(path: Path, name: str) -> Problems:
    """A problem if the stop of a hinge is named where a snubber is required."""
    yield problem(path, f"= {name} is a stop of a hinge", "vary joints[0].stops[0].stiffness or angle in a study")


def stops_of_hinges(scenario: Whole) -> set[str]:
    """Names of the stops of hinges."""
    return {stop.name for stop in scenario.all_snubbers if isinstance(stop, HingeStop)}


class SnubberPath(Schema):
    """A property of one snubber as parameter."""

    snubber: q.Name | None = None
    """Name of the snubber; may be omitted if there is only one."""

    if TYPE_CHECKING:
        kind: Any

    def changed(self, scenario: Whole) -> LocatedItem | None:
        """The snubber, or pair of stops, that is varied; None if it is not found."""
        written: tuple[LocatedItem, ...] = tuple(scenario.listed("snubbers"))
        if self.snubber is None:
            return written[0] if len(written) == 1 else None
        return next((located for located in written if located.item.name == self.snubber), None)

    def value_in(self, scenario: Whole, levels: tuple[float, ...]) -> float | None:
        """The value of the snubber."""
        located = self.changed(scenario)
        assert located is not None
        value: float | None = getattr(located.item, self.kind)
        return value

    def problems_of_parameter(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown snubber, or a gap that follows from a preload."""
        located, where = self.changed(scenario), (*path, "snubber")
        if located is None:
            yield from self._problems_of_name(scenario, where)
            return
        if located.item.name in stops_of_hinges(scenario):
            yield from no_stop_of_hinge(where, located.item.name)
            return
        preloaded = [snubber.name for snubber in scenario.all_snubbers if snubber.preload is not None]
        if preloaded:
            yield problem(
                (*path, "kind"),
                f"= {self.kind} would change the gap that the preload of {preloaded[0]} asks for at every step",
                "give its gap instead of its preload",
            )

    def _problems_of_name(self, scenario: Whole, body_path: Path) -> Problems:
        """Problems of the snubber's name: missing, unknown, or that of one stop of a pair."""
        written = tuple(scenario.listed("snubbers"))
        names = [each.item.name for each in written]
        pairs = [each.item.name for each in written for stop in each.item.stops if stop.name == self.snubber]
        if self.snubber is None:
            remedy = f"there are several: choose one of {', '.join(names)}" if names else "add one to snubbers"
            yield problem(body_path, "is missing", remedy)
        elif pairs:
            message = f"= {self.snubber} is one stop of a pair, and both have the same {self.kind}"
            yield problem(
                body_path, message, f"name the pair: {pairs[0]}, or write two snubbers, side: above and below"
            )
        else:
            yield from unknown(body_path, self.snubber, "snubber", names, "add one to snubbers")


class GapPath(SnubberPath, _Path[q.Gap]):
    """The gap of a snubber as parameter."""

    kind: Literal["gap"] = "gap"
    """The gap of a snubber."""


class StiffnessPath(SnubberPath, _Path[q.Stiffness]):
    """The stiffness of a snubber as parameter; a dashpot given by a ratio changes with it."""

    kind: Literal["stiffness"] = "stiffness"
    """The stiffness of a snubber."""


class PositionPath(SnubberPath, _Path[q.PositionOrShare]):
    """The position of a snubber along a beam as parameter; a dashpot given by a ratio changes with it."""

    kind: Literal["position"] = "position"
    """The position of a snubber along the beam, or its share of the length: 60 %."""

    def _body(self, scenario: Whole) -> tuple[Any, Body]:
        """The snubber and its body."""
        located = self.changed(scenario)
        assert located is not None
        if (name := located.bodies[0]) not in scenario.all_bodies:
            raise InvalidValueError(f"is on {name}, an unknown body", "name another body there", ("snubber",))
        return located.item, scenario.all_bodies[name]

    def in_metres(self, scenario: Whole) -> Self:
        """A copy with positions in m on the body of the snubber."""
        _, body = self._body(scenario)
        points_at = tuple(map(body.metres, self.points_at))
        ends = {"from": body.metres(self.from_), "to": body.metres(self.to)}
        return self.model_copy(update={**ends, "points_at": points_at})

    def value_in(self, scenario: Whole, levels: tuple[float, ...]) -> float | None:
        """The position of the snubber, m."""
        snubber, body = self._body(scenario)
        return body.metres(snubber.places[0].position)

    def problems_of_parameter(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a snubber that cannot move along a beam, and positions that are not on it."""
        yield from super().problems_of_parameter(scenario, path)
        located = self.changed(scenario)
        if located is None or isinstance(located.item, HingeStop):
            return
        place = (*path, "kind")
        if len(located.item.places) > 1:
            yield problem(place, "= position moves a snubber between two places", "follow gap or stiffness")
            return
        if scenario.has_cubic_springs:
            yield problem(
                place, "= position moves a snubber, which is not followed with cubic springs",
                "follow gap or stiffness, or make the springs piecewise_linear",
            )  # fmt: skip
        name = located.item.places[0].body or located.body
        body = scenario.all_bodies.get(name)
        if body is None:
            return
        if len(body.sides) != 1:
            message = f"= position moves along a beam, but the structure is {body.called}"
            yield problem(place, message, "follow gap or stiffness, or vary the place in a study")
            return
        for key, value in (("from", self.from_), ("to", self.to)):
            yield from body.position_problems(scenario.body_path(name), (*path, key), value, "a snubber")


ResponseParameter = Annotated[FrequencyPath | LevelPath | GapPath | StiffnessPath | PositionPath, BY_FORM]

FollowedPoint = Literal["fold", "period_doubling", "neimark_sacker", "grazing", "branch_point"]

SecondParameter = Annotated[LevelPath | GapPath | StiffnessPath | PositionPath, BY_FORM]


class Shooting(Schema):
    """Newton's method for the state after one period, with exact derivatives."""

    kind: Literal["shooting"] = "shooting"
    """Shooting."""


class HarmonicBalance(Schema):
    """Truncated Fourier series with exact contact forces; the cost does not depend on the size of the model."""

    kind: Literal["harmonic_balance"] = "harmonic_balance"
    """Harmonic balance."""
    harmonics: Harmonics = 21
    """Highest harmonic of the fundamental frequency."""
    largest_error: q.Ratio = 0.01
    """Largest truncation error, relative to the motion, up to which a result is reliable."""


Method = Annotated[
    Shooting | HarmonicBalance,
    Variants("is not a known method", "write shooting, or {kind: harmonic_balance, harmonics: 21}"),
    ShortFor("kind", ("shooting", "harmonic_balance")),
]


MOST_CYCLES = 5_000_000
"""Largest number of cycles of a swept sine at one level."""


def swept_cycles(low: float, high: float, rate: q.Rate, direction: str) -> float:
    """Number of cycles of a swept sine, up and down for ``both``; in general not an integer.

    Parameters
    ----------
    low, high : Hz, ends of the range.
    rate : in octaves or Hz per second.
    direction : up, down or both.
    """
    once = (high - low) * ((high + low) / 2.0 if rate.unit == "Hz/s" else 1.0 / log(2.0)) / rate.value
    return 2.0 * once if direction == "both" else once


def demand_cycles(cycles: float, rate: q.Rate, path: Path) -> None:
    """Refuse a sweep with too many or too few cycles; ``path`` is the path of its rate."""
    if cycles > MOST_CYCLES:
        message = f"= {rate} makes a sweep of {cycles:.3g} cycles (at most {MOST_CYCLES:.0e})"
        raise InvalidValueError(message, "sweep faster or over fewer frequencies", path)
    if cycles < 2.0:
        raise InvalidValueError(f"= {rate} covers the range in {cycles:.2g} cycles", "sweep more slowly", path)


class SweptOverlay(Schema):
    """A swept sine over the same frequencies and levels, drawn over the response curve."""

    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    direction: Literal["up", "down", "both"] = "both"
    """up, down, or both: up and then down."""


class SineAnalysis(Schema):
    """Common part of analyses of motions under sines."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an excitation that is not a sine, and levels in a wrong unit."""
        unfit, run = list(sine_problems(scenario.excitation, "sweep")), scenario.run
        yield from unfit
        if run is not None and run.low_pass is not None and getattr(self, "accelerations", True):
            message = (
                f"reports accelerations that run.low_pass = {run.low_pass:g} Hz, the band of runs, does not filter"
            )
            yield problem(path, message, "remove the run (run: null), or its low_pass, or the sweep")
        yield from level_problems(scenario, path, self)
        if not unfit:
            yield from self.problems_with_sine(scenario, path)

    def problems_with_sine(self, scenario: Whole, path: Path) -> Problems:
        """Further problems if the excitation is a sine."""
        yield from ()


class Continuation(SineAnalysis):
    """Branches of periodic motions, stable and unstable, continued in frequency or another parameter."""

    kind: Literal["continuation"] = "continuation"
    """Continuation of periodic motions."""
    from_: q.Frequency | None = Field(default=None, alias="from")
    """First frequency; short for continue_in: {kind: frequency, from: ..., to: ...}."""
    to: q.Frequency | None = None
    """Last frequency."""
    continue_in: ResponseParameter | None = None
    """The continuation parameter, instead of from and to: frequency, level, gap, stiffness or position."""
    levels: Annotated[tuple[q.Level, ...], Field(min_length=1)] = ()
    """Levels, with one curve for each; by default the level of the excitation."""
    method: Method = Shooting.model_construct()
    """shooting (exact), or harmonic_balance."""
    follow_points_in: SecondParameter | None = None
    """Follow special points of a frequency response in a second parameter: level, gap, stiffness or position."""
    follow_points: Annotated[tuple[FollowedPoint, ...], Field(min_length=1)] = ("fold",)
    """Kinds of special points that are followed: fold, period_doubling, neimark_sacker, grazing, branch_point."""
    follow_isolas: bool = False
    """Follow the isola, a closed curve of motions, next to every extreme of a curve of folds at which one begins."""
    overlay: SweptOverlay | None = None
    """A swept sine drawn over a frequency response."""
    points_at: tuple[q.Frequency, ...] = ()
    """Frequencies at which every branch gets a point; with continue_in use the key there."""
    stored_harmonics: Harmonics = 5
    """Highest harmonic of the motion that is stored at every point."""
    seek_at: q.NotNegativeWhole = 3
    """Number of parameter values at which coexisting motions are searched for (shooting); 0 for none."""
    side_branches: Literal["limited", "required", "none"] = "limited"
    """Branches that start at bifurcations (shooting), and coexisting ones. limited: followed within the limits below,
    and the outcome names those that are cut off; required: a cut-off branch makes the result incomplete; none: not
    followed. """
    longest_period: Annotated[int, q.WholeNumber(1, 64)] = 2
    """Longest period after period doublings, in periods of the excitation."""
    most_points: q.Count = 4000
    """Largest number of points on the curve of a level."""
    most_branch_points: q.Count = 2000
    """Largest number of points on one branch, so that others can be followed too."""
    most_side_points: q.Count = 300
    """Largest number of points on a branch that starts at a period doubling or a branch point."""
    most_branches: q.Count = 40
    """Largest number of branches for a level."""
    longest_time: q.Duration = 600.0
    """Longest computing time for the curve of a level."""
    convergence: Literal["on", "off"] | None = None
    """Whether results are compared with those of a finer model; off by default."""

    def check(self) -> None:
        """Require one range, and refuse combinations that are not supported."""
        self._demand_one_range()
        parameter = self.parameter
        if parameter.kind == "level" and self.levels:
            raise InvalidValueError("cannot be given if the level is the parameter", "leave levels out", ("levels",))
        by_balance = isinstance(self.method, HarmonicBalance)
        if by_balance and parameter.kind not in ("frequency", "level"):
            raise InvalidValueError(
                f"= harmonic_balance follows the frequency or the level, not the {parameter.kind}",
                "use method: shooting",
                ("method",),
            )
        for name in ("follow_points_in", "overlay"):
            if getattr(self, name) is not None and parameter.kind != "frequency":
                raise InvalidValueError(
                    f"applies to a curve in frequency, but this one is in {parameter.kind}",
                    "leave it out, or give from and to as frequencies",
                    (name,),
                )
        if self.follow_points_in is not None and by_balance:
            raise InvalidValueError("follows special points by shooting", "use method: shooting", ("follow_points_in",))
        if isinstance(self.follow_points_in, LevelPath) and len(self.levels) > 1:
            raise InvalidValueError(
                "has several values, and the level of the special points changes", "give one level", ("levels",)
            )
        if self.follow_points_in is not None and self.follow_points_in.points_at:
            raise InvalidValueError(
                "belong to the curve, not to its special points", "leave them out", ("follow_points_in", "points_at")
            )
        if self.follow_points_in is None:
            for name in ("follow_points", "follow_isolas"):
                if name in self.model_fields_set:
                    message = "needs a second parameter"
                    raise InvalidValueError(message, "add follow_points_in: {kind: level, from: …, to: …}", (name,))
        if self.follow_isolas and "fold" not in self.follow_points:
            raise InvalidValueError("begins at curves of folds", "add fold to follow_points", ("follow_isolas",))
        if self.overlay is not None and isinstance(parameter, FrequencyPath):
            low, high = sorted((parameter.from_, parameter.to))
            cycles = swept_cycles(low, high, self.overlay.rate, self.overlay.direction)
            demand_cycles(cycles, self.overlay.rate, ("overlay", "rate"))

    def problems_with_sine(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a parameter that cannot be varied, incomplete ranges, a method that needs nonlinear contacts."""
        given = {"follow_points_in": self.follow_points_in, "continue_in": self.continue_in}
        unfit = [
            found
            for key, place in given.items()
            if place is not None
            for found in place.problems_of_parameter(scenario, (*path, key))
        ]
        yield from unfit or self._problems_of_ranges(scenario, path)
        nonlinear = scenario.all_snubbers or scenario.nonlinear_springs
        if isinstance(self.method, HarmonicBalance) and not nonlinear:
            message = "= harmonic_balance needs a snubber or a nonlinear spring"
            yield problem((*path, "method"), message, "use shooting, or add a snubber")

    def _problems_of_ranges(self, scenario: Whole, path: Path) -> Problems:
        """Problems: points outside the range, and a second range without the scenario's own value."""
        section = path if self.continue_in is None else (*path, "continue_in")
        second: Any = self.follow_points_in
        try:
            parameter: Any = self.parameter.in_metres(scenario)
            parameter.check()
            parameter.demand_inside(parameter.points_at, ("points_at",))
            if second is None:
                return
            section = (*path, "follow_points_in")
            second = second.in_metres(scenario)
            second.check()
            present = second.value_in(scenario, self.levels)
        except InvalidValueError as error:
            yield error.problem(section)
            return
        low, high = sorted((float(second.from_), float(second.to)))
        if present is not None and not low <= present <= high:
            yield problem(
                section,
                f"runs from {low:g} to {high:g}, which leaves out the scenario's own {second.kind} of {present:g}, "
                "where the special points are found",
                "widen the range to include it",
            )

    def _demand_one_range(self) -> None:
        self.exclude("points_at", "continue_in", remedy="give points_at there")
        self.exclude("continue_in", "from", "to", remedy="give the range inside continue_in, or only from and to")
        if self.continue_in is not None:
            return
        for name, value in (("from", self.from_), ("to", self.to)):
            if value is None:
                raise InvalidValueError(
                    "is missing",
                    "give from and to as frequencies, or continue_in: {kind: level, from: 0.5 g, to: 5 g}",
                    (name,),
                )
        self.parameter.check()

    @property
    def parameter(self) -> FrequencyPath | LevelPath | GapPath | StiffnessPath | PositionPath:
        """The continuation parameter with its range."""
        if self.continue_in is not None:
            return self.continue_in
        return FrequencyPath.model_construct(from_=self.from_, to=self.to, points_at=self.points_at)


HIGHEST_ORDER = 64
_NOTCHES: dict[str, Any] = {"examples": [{"probes.tip.acceleration": "20 g", "base.force": "2 kN"}]}


class _DirectedSweep(SineAnalysis, FrequencyRange):
    """Common part of sweeps with a direction."""

    falling_range_remedy: ClassVar[str] = "write the lower frequency as from, and direction: down"

    levels: Annotated[tuple[q.Level, ...], Field(min_length=1)] = ()
    """Levels, with one sweep for each; by default the level of the excitation."""

    direction: Literal["up", "down", "both"] = "up"
    """up, down, or both: up and then down."""
    orders: tuple[q.PositiveNumber, ...] = (0.5, 1.0, 2.0, 3.0, 4.0)
    """Harmonics to track, as multiples of the excitation frequency; 0.5 is the first subharmonic."""
    accelerations: bool = True
    """Whether to store absolute accelerations of the probes in addition to relative displacements."""
    impacts: bool = False
    """Whether to compute impacts per cycle, their impulse, contact time, energy loss and highest speed, and for
    friction slides, distance, energy loss and wear power."""
    convergence: Literal["on", "off"] | None = None
    """Whether results are compared with those of a finer model; by default on, in a study for the deciding cases."""

    def check(self) -> None:
        """Refuse a range that contradicts the direction, and harmonics that cannot be tracked."""
        super().check()
        for index, order in enumerate(self.orders):
            if order > HIGHEST_ORDER or abs(Fraction(order).limit_denominator(12) - Fraction(order)) > 1e-3:
                raise InvalidValueError(
                    f"= {order:g} is not an order that repeats within 12 cycles",
                    f"give whole numbers or simple fractions up to {HIGHEST_ORDER}: 0.5, 1, 1.5, 2",
                    ("orders", index),
                )

    def problems_with_sine(self, scenario: Whole, path: Path) -> Problems:
        """A problem if impacts are requested without contacts."""
        if self.impacts and not scenario.all_snubbers and not any(scenario.listed("friction")):
            message = "needs a snubber or friction, but there is none"
            yield problem((*path, "impacts"), message, "leave it out, or add a snubber")

    @property
    def tracked_orders(self) -> tuple[float, ...]:
        """The harmonics as fractions with a period of at most 12 cycles, increasing."""
        return tuple(sorted({float(Fraction(order).limit_denominator(12)) for order in self.orders}))


class SweptSine(_DirectedSweep):
    """A continuous sweep, logarithmic or linear in time."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A continuous sweep."""
    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    profile: tuple[ProfilePoint, ...] = ()
    """A table of levels, each from its frequency on, instead of one level (`levels` are then factors)."""
    between: Between = "held"
    """Between the points of the profile: constant level (held), or log-log interpolation (log_log)."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges with a reduced level."""
    profile_file: Annotated[CurveFile, SHORT_FOR_FILE] | None = None
    """A CSV file with the table of levels: a frequency and a level in each row, with log-log interpolation (`levels`
    are then factors). Its name, relative to the folder of the scenario, or {file: level.csv, column: qualification}."""
    notch_to: dict[str, OutputLimit] | None = Field(default=None, json_schema_extra=_NOTCHES)
    """Response limits at which the level is reduced: {probes.tip.acceleration: 20 g, base.force: 2 kN}. Names are
    probes.<name>.acceleration or .displacement, snubbers.<name>.force, base.force and outputs.<name>."""
    tolerance: Annotated[float, q.Quantity(replace(units.NUMBER, example="1e-12"), minimum=1e-13, maximum=1e-3)] = 1e-12
    """Bound on the truncation error of the sine, relative to its amplitude."""
    history_rate: q.Frequency | None = None
    """Sample rate of the time history; without it only values for each cycle are stored."""

    @property
    def cycles(self) -> float:
        """Number of cycles of the sweep, up and down; in general not an integer."""
        return swept_cycles(self.from_, self.to, self.rate, self.direction)

    @property
    def duration(self) -> float:
        """Duration of the sweep, up and down, s."""
        once = log2(self.to / self.from_) if self.rate.unit == "oct/s" else self.to - self.from_
        return (2.0 if self.direction == "both" else 1.0) * once / self.rate.value

    @property
    def has_varying_level(self) -> bool:
        """Whether the level depends on frequency: by a profile, notches or response limits."""
        return bool(self.profile or self.profile_file or self.notches or self.notch_to)

    def check(self) -> None:
        """Refuse a table that does not increase, unusable tolerances, and a sweep with too many or too few cycles."""
        super().check()
        demand_cycles(self.cycles, self.rate, ("rate",))
        if self.profile_file is None:
            check_profile(self.profile, self.between)
        self.exclude("profile_file", "profile")
        if self.notch_to is not None:
            self._check_notches(self.notch_to)
        for index, level in enumerate(self.levels if self.profile or self.profile_file is not None else ()):
            if (stated := q.meant(level)) is not None:
                raise InvalidValueError(
                    f"is given in a unit of {stated}, but multiplies the levels of the profile",
                    "give plain numbers: levels: [0.5, 1, 2]",
                    ("levels", index),
                )

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings about steps of the level."""
        yield from level_jumps(scenario, path, self)

    def problems_with_sine(self, scenario: Whole, path: Path) -> Problems:
        """Problems: too many samples, and response limits on unknown quantities."""
        yield from super().problems_with_sine(scenario, path)
        samples = self.duration * (self.history_rate or 0.0)
        if samples > MOST_SAMPLES:
            yield problem(
                (*path, "history_rate"),
                f"= {self.history_rate:g} Hz over {self.duration:g} s gives {samples:.3g} samples, over the limit of "
                f"{MOST_SAMPLES:.0e}",
                "lower it, or leave it out: envelopes and harmonics are exact without it",
            )
        if self.notch_to is not None:
            for name, limit in self.notch_to.items():
                yield from _problems_of_notch(scenario, (*path, "notch_to", name), name, limit)
            if not self.levels and not self.profile and not scenario.excitation.level > 0:
                message = "cannot be lowered to sweep.notch_to"
                yield problem(("excitation", "level"), message, "give a positive level")

    def _check_notches(self, limits: Mapping[str, float]) -> None:
        """Refuse response limits with two directions, negative levels, or accelerations that are not stored."""
        if not limits:
            raise InvalidValueError(
                "limits nothing", "give for example notch_to: {probes.tip.acceleration: 20 g}", ("notch_to",)
            )
        if self.direction == "both":
            raise InvalidValueError(
                "needs one direction: the level that keeps the limits differs on the way down",
                "make two sweeps, direction: up and direction: down",
                ("notch_to",),
            )
        if not self.accelerations and any(
            of is not None and of.quantity == "acceleration" for of in map(limited_quantity, limits)
        ):
            raise InvalidValueError(
                "limits an acceleration, and accelerations = false", "leave that out", ("notch_to",)
            )
        for at, points in (("profile", self.profile), ("notches", self.notches)):
            for index, point in enumerate(points):
                if point.level == 0:
                    raise InvalidValueError("= 0 leaves nothing to lower", "give a small level", (at, index, "level"))
        for index, level in enumerate(self.levels):
            if level <= 0:
                raise InvalidValueError(
                    f"= {level:g} cannot be lowered to limits", "give a positive level", ("levels", index)
                )


def _problems_of_notch(scenario: Whole, path: Path, name: str, limit: float) -> Problems:
    """Problems of a response limit: an unknown quantity, or a wrong unit.

    Parameters
    ----------
    scenario : with the places.
    path : path of the limit.
    name : name of the limited quantity.
    limit : its value, which stores its unit.

    Yields
    ------
    Problem
    """
    outputs = {output.name: output for output in scenario.outputs}  # outputs of run alone are not in sweeps
    names = {
        "probes": [probe.name for probe in scenario.effective_probes],
        "snubbers": [snubber.name for snubber in scenario.all_snubbers],
        "outputs": list(outputs),
    }
    of = limited_quantity(name, scenario.base_force or BASE_FORCE.name)
    if of is None:
        example = "write for example probes.tip.acceleration, snubbers.tip.force, base.force or outputs.gauge"
        yield problem(path, "names nothing that can be limited", example)
    elif name == "base.force" and scenario.base_force is None and BASE_FORCE.name in outputs:
        yield problem(path, f"needs the name {BASE_FORCE.name}, which another output has", "rename that output")
    elif name != "base.force" and of.item not in names[of.section]:
        yield from unknown(path, of.item, of.section.removesuffix("s"), names[of.section])
    else:
        output = outputs.get(of.item, BASE_FORCE)
        if of.section == "outputs":
            dimension = output_dimension(output, scenario.all_bodies, scenario.default_body)
        else:
            dimension = QUANTITIES_OF[of.section][of.quantity]
        if of.section == "snubbers" and of.item in stops_of_hinges(scenario):
            dimension = units.MOMENT
        if of.section == "outputs" and output.kind in ("kinetic_energy", "strain_energy"):
            yield problem(path, "is an energy, which sweeps do not follow", "limit another quantity")
        yield from unit_problems(path, limit, dimension, f"which is not a unit of {getattr(dimension, 'name', '')}")


class SteppedSine(_DirectedSweep):
    """Steady states at a list of frequencies; each starts from the one before."""

    kind: Literal["stepped"] = "stepped"
    """Steady states, frequency by frequency."""
    points: q.SteppedCount = 100
    """Number of frequencies."""
    spacing: Literal["logarithmic", "linear"] = "linear"
    """Spacing of the frequencies."""
    steady_to: q.PositiveNumber = 1e-6
    """A motion is steady if it repeats up to this fraction of its size."""
    most_cycles: q.Count = 2000
    """Largest number of cycles at one frequency."""
    longest_period: q.SmallCount = 16
    """Longest period considered, in cycles of the excitation."""
    measured_cycles: q.SmallCount = 8
    """Smallest number of cycles measured after the motion is steady."""


def _problems_of_probe(scenario: Whole, path: Path, name: str) -> Problems:
    """A problem if the probe does not exist; ``path`` is the path of the key that names it."""
    yield from unknown((*path, "probe"), name, "probe", (probe.name for probe in scenario.effective_probes))


Velocity = Annotated[float, q.Quantity(units.VELOCITY)]
StartRange = tuple[str, str, float, float]  # name and unit of a coordinate of a start, lowest and highest value


class BoxCoordinate(Schema):
    """Range of initial displacements and velocities of a probe, added to static equilibrium."""

    probe: q.Name
    """Name of the probe."""
    mode: q.Count | None = None
    """Natural mode in which the structure is displaced; without it, the static deflection by a force at the probe."""
    displacement: tuple[q.Amplitude, q.Amplitude] = (0.0, 0.0)
    """Smallest and largest displacement."""
    velocity: tuple[Velocity, Velocity] = (0.0, 0.0)
    """Smallest and largest velocity."""

    def check(self) -> None:
        """Require a range."""
        if not any(high - low for low, high in (self.displacement, self.velocity)):
            raise InvalidValueError("has no range", "give displacement: [-5 mm, 5 mm] or velocity: [-1 m/s, 1 m/s]")

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the probe does not exist."""
        yield from _problems_of_probe(scenario, path, self.probe)

    @property
    def ranges(self) -> tuple[StartRange, StartRange]:
        """The ranges of displacement and velocity."""
        of = f" of {self.probe}{f' in mode {self.mode}' if self.mode else ''}"
        return (f"displacement{of}", "m", *self.displacement), (f"velocity{of}", "m/s", *self.velocity)


class _RandomStarts(Schema):
    number: q.SteppedCount = 100
    """Number of starts at each frequency."""
    seed: q.RandomSeed = 0
    """Seed of the random numbers."""


class PhaseStarts(_RandomStarts):
    """The excitation is switched on at a random phase, at static equilibrium."""

    kind: Literal["phases"] = "phases"
    """Random phase at switch-on."""

    ranges: ClassVar[tuple[StartRange, ...]] = (("phase", "rad", 0.0, tau),)


class StateStarts(_RandomStarts):
    """Random displacements and velocities at phase zero, uniform in a box."""

    kind: Literal["states"] = "states"
    """Random states in a box."""
    box: Annotated[tuple[BoxCoordinate, ...], Field(min_length=1)]
    """Coordinates of the box."""

    @property
    def ranges(self) -> tuple[StartRange, ...]:
        """Ranges of all coordinates."""
        return tuple(each for coordinate in self.box for each in coordinate.ranges)


class HistoryStarts(_RandomStarts, FrequencyRange):
    """The frequency is swept up or down from a random value to the frequency, and then stays."""

    kind: Literal["history"] = "history"
    """Sweeps up and down to the frequency, from static equilibrium."""
    falling_range_remedy: ClassVar[str] = "write the lower frequency as from"
    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""

    @property
    def ranges(self) -> tuple[StartRange, ...]:
        """Range of the initial frequency."""
        return (("first frequency", "Hz", self.from_, self.to),)


class ImpulseAt(Schema):
    """An impulse of a force at a probe."""

    kind: Literal["impulse"] = "impulse"
    """Impulse of a force at a probe."""
    probe: q.Name
    """Name of the probe."""
    to: Annotated[float, q.Quantity(units.IMPULSE, above=0.0)]
    """Largest impulse to try, in both directions."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the probe does not exist."""
        yield from _problems_of_probe(scenario, path, self.probe)


class BasePulse(Schema):
    """A base acceleration pulse much shorter than all periods: a sudden change of the base's velocity."""

    kind: Literal["base_pulse"] = "base_pulse"
    """Sudden change of the base's velocity."""
    to: q.Speed
    """Largest velocity change to try, in both directions."""

    probe: ClassVar[str] = ""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the base does not move, or in several directions."""
        if not getattr(scenario.excitation, "on_base", False):
            message = "is a pulse of the base, which rests or moves in several directions"
            yield problem(path, message, "use kind: impulse, or excite the base in one direction")


MOST_STARTS = 200_000
"""Largest number of starts of coexisting motions, at all frequencies together."""

Disturbance = Annotated[ImpulseAt | BasePulse, BY_FORM]


class Coexisting(SineAnalysis):
    """Coexisting motions at a frequency, their probabilities, and the disturbances that leave them."""

    kind: Literal["coexisting"] = "coexisting"
    """Coexisting motions."""
    at: tuple[q.Frequency, ...] = ()
    """Frequencies; instead of a range with points."""
    from_: q.Frequency | None = Field(default=None, alias="from")
    """First frequency."""
    to: q.Frequency | None = None
    """Last frequency."""
    points: q.SteppedCount | None = None
    """Number of frequencies of the range."""
    starts: Annotated[PhaseStarts | StateStarts | HistoryStarts, BY_FORM] = PhaseStarts.model_construct()
    """Initial states of the motions."""
    disturbances: tuple[Disturbance, ...] = ()
    """Disturbances; the smallest one that leaves each stable motion is searched for: {kind: impulse, probe: tip, to:
    0.1 N s} or {kind: base_pulse, to: 0.5 m/s}."""
    unstable: bool = True
    """Whether to follow branches from the stable motions, to find unstable motions at the same frequencies."""
    steady_to: q.PositiveNumber = 1e-5
    """A motion is settled if it repeats up to this fraction of its size; shooting starts from there."""
    most_cycles: q.Count = 1000
    """Largest number of cycles for a motion to settle."""
    longest_period: q.SmallCount = 16
    """Longest period considered, in cycles of the excitation."""
    convergence: Literal["on", "off"] | None = None
    """Whether the largest values of stable motions are compared with those of a finer model; off by default, in a study
    on for the deciding cases."""

    levels: ClassVar[tuple[float, ...]] = ()

    def check(self) -> None:
        """Require frequencies in one form, and refuse too many starts."""
        self.exclude("at", "from", "to", "points", remedy="give a list, or a range with points")
        if not (self.at or (self.from_ and self.to and self.points)):
            raise InvalidValueError("has no frequencies", "give at: [65 Hz, 78 Hz], or from, to and points")
        frequencies = self.points or len(self.at)
        if (starts := self.starts.number * frequencies) > MOST_STARTS:
            at, number = ("starts", "number"), self.starts.number
            message = f"= {number} at {frequencies} frequencies makes {starts:.3g} starts (at most {MOST_STARTS})"
            raise InvalidValueError(message, "take fewer starts, or fewer frequencies", at)

    @property
    def frequencies(self) -> tuple[float, ...]:
        """The frequencies, Hz, increasing."""
        low, high, last = self.from_ or 0.0, self.to or 0.0, (self.points or 2) - 1
        of_range = [low + k / last * (high - low) for k in range(last + 1)]
        return tuple(sorted(set(map(float, self.at or of_range))))

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz."""
        return self.frequencies[0], self.frequencies[-1]


Sweep = Annotated[SweptSine | SteppedSine | Continuation | Coexisting, BY_FORM]


Tolerance = Annotated[float, q.Quantity(replace(units.NUMBER, example="1e-5"), minimum=1e-20, maximum=0.1)]
"""Tolerance of the functional, the square of a relative deviation: limited by round-off and by motions far from
periodic."""
ShareOfFrequency = Annotated[float, q.Quantity(replace(units.RATIO, example="10 %"), above=0.0, maximum=0.5)]


class ShootingMethod(Schema):
    """Brake orbits (at rest twice per period), computed exactly by shooting over half a period."""

    kind: Literal["shooting"] = "shooting"
    """Half-period shooting."""


class FullPeriodMethod(Schema):
    """Exact motions, including orbits that are never at rest, by shooting over the whole period."""

    kind: Literal["full_period"] = "full_period"
    """Full-period shooting with a phase condition."""
    branches: q.NotNegativeWhole = 3
    """Largest number of branches of non-brake orbits to follow from their bifurcations; 0 for none."""
    points: q.SmallCount = 120
    """Largest number of points on each of these branches."""


class ExpansionMethod(Schema):
    """The asymptotic expansion for weak springs, compared with exact motions."""

    kind: Literal["multiple_scales"] = "multiple_scales"
    """Method of multiple scales."""


class RelaxedMinimisationMethod(Schema):
    """Relaxed minimisation of the deviation from periodicity (Hazim 2010), compared with exact motions."""

    kind: Literal["relaxed_minimisation"] = "relaxed_minimisation"
    """Relaxed minimisation."""
    steps: Annotated[int, q.WholeNumber(1, 10_000)] = 75
    """Number of equal steps in the stiffness factor."""
    tolerance: Tolerance = 1e-5
    """Largest accepted value of the functional, divided by twice the energy of the motion (dimensionless)."""
    iterations: q.Count = 200
    """Largest number of iterations of the optimiser in each step."""


ModeMethod = Annotated[
    ShootingMethod | FullPeriodMethod | ExpansionMethod | RelaxedMinimisationMethod,
    Variants(
        "is not a known method",
        "write shooting, full_period, multiple_scales or relaxed_minimisation, or a mapping such as "
        "{kind: relaxed_minimisation, steps: 75, tolerance: 1e-5}",
    ),
    ShortFor("kind", ("shooting", "full_period", "multiple_scales", "relaxed_minimisation")),
]


class PhaseResonance(Schema):
    """The damped structure under an excitation in phase resonance with the mode, at a computed frequency."""

    levels: tuple[q.PositiveLevel, ...] = ()
    """Levels of the excitation, each at its own resonance; by default the level of the excitation."""
    periods: Annotated[int, q.WholeNumber(1, 10_000)] = 50
    """Number of periods of the damped motion, starting from the prediction."""
    span: ShareOfFrequency = 0.1
    """Range of the response curve on both sides, as a fraction of the frequency."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: a scenario whose mode cannot be kept in resonance by one force."""
        excitation = scenario.excitation
        if scenario.nnm.method.kind == "multiple_scales":
            yield problem(path, "needs the exact mode, not its expansion", "use method: shooting")
        if not isinstance(excitation, Harmonic):
            yield not_harmonic(path, "a harmonic excitation, whose frequency is computed", excitation)
            return
        if not self.levels and not excitation.level > 0:
            message = "is zero and sustains no motion"
            yield problem(("excitation", "level"), message, "give nnm.phase_resonance.levels")
        if excitation.on_base:
            yield from _driven_through_contacts(scenario)


def _driven_through_contacts(scenario: Whole) -> Problems:
    """Problems of springs to the ground under base motion, which excite the structure too."""
    for path, _, snubber, _ in scenario.located_snubbers:
        if getattr(snubber, "mounted_on", "base") == "ground":
            yield problem(
                (*path, "mounted_on"),
                "= ground lets the moving base push through the contact too, which phase resonance does not account "
                "for",
                "mount it on the base, or apply a point force",
            )
    for path, _, spring, _ in scenario.nonlinear_springs:
        if isinstance(spring, SpringToGround):
            yield problem(
                (*path, "kind"),
                f"= {getattr(spring, 'kind', '')} lets the moving base push through a nonlinear spring, which phase "
                "resonance does not account for",
                "apply a force to a mass instead",
            )


class StiffnessFactorContinuation(Span[q.Factor]):
    """The stiffness of the nonlinear springs as parameter, from zero to its full value."""

    kind: Literal["stiffness_factor"] = "stiffness_factor"
    """Factor of the stiffness of snubbers and nonlinear springs."""
    from_: q.Factor = Field(default=0.0, alias="from")
    """First factor; 0 is the linear mode."""
    to: q.Factor = 1.0
    """Last factor; 1 is the full stiffness."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if a factor would give a softening spring a negative slope."""
        key, largest = max(("from", self.from_), ("to", self.to), key=lambda end: end[1])
        for place, _, spring, _ in scenario.nonlinear_springs:
            if not isinstance(spring, PiecewiseLinearSpring):
                continue
            slope, softest = spring.linear_stiffness, min(spring.stiffnesses)
            least = slope + largest * (softest - slope)
            if least < 0:
                yield problem(
                    (*path, key),
                    f"= {largest:g} gives {path_text(place)} the slope {least:g} N/m: the factor multiplies its "
                    f"changes of slope from the {slope:g} N/m at rest",
                    f"go up to {slope / (slope - softest):.6g} at most",
                )


class EnergyContinuation(Span[q.Energy]):
    """The energy as parameter."""

    kind: Literal["energy"] = "energy"
    """Energy relative to static equilibrium."""


class FrequencyContinuation(Span[q.Frequency]):
    """The frequency as parameter."""

    kind: Literal["frequency"] = "frequency"
    """Frequency of the motion."""


ContinueIn = Annotated[StiffnessFactorContinuation | EnergyContinuation | FrequencyContinuation, BY_FORM]


_IN_FACTOR = {"multiple_scales": "expands in", "relaxed_minimisation": "takes its steps in"}


class NonlinearMode(Schema):
    """The nonlinear normal mode and its continuation parameter."""

    mode: q.Count
    """Number of the linear mode at which the branch starts, from 1."""
    energy: q.Energy | None = None
    """Energy of the motion if the stiffness factor is the parameter."""
    continue_in: ContinueIn = StiffnessFactorContinuation.model_construct()
    """The continuation parameter: stiffness_factor, energy or frequency."""
    method: ModeMethod = ShootingMethod.model_construct()
    """shooting (over half a period, exact), full_period (exact, also non-brake orbits), multiple_scales (asymptotic
    expansion for weak springs) or relaxed_minimisation (Hazim 2010, for comparison)."""
    energies: tuple[q.Energy, ...] = ()
    """Energies at which the backbone and its tongues get a point; not allowed if the stiffness factor is the
    parameter."""
    frequencies: tuple[q.Frequency, ...] = ()
    """Frequencies at which they get a point, for any parameter."""
    phase_resonance: PhaseResonance | None = None
    """Excite the damped structure at phase resonance with the mode."""
    convergence: Literal["on", "off"] | None = None
    """Whether results are compared with those of a finer model; off by default."""

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems: an unknown mode, and levels in a wrong unit."""
        yield from mode_problems(scenario, (*path, "mode"), self.mode)
        yield from level_problems(scenario, path, self)

    def check(self) -> None:
        """Refuse an energy if it is the parameter, and methods that need the stiffness factor."""
        going, kind = self.continue_in, self.method.kind
        if kind in _IN_FACTOR and not isinstance(going, StiffnessFactorContinuation):
            raise InvalidValueError(
                f"= {kind} {_IN_FACTOR[kind]} the stiffness factor, not in the {going.kind}",
                "use continue_in: {kind: stiffness_factor}, or method: shooting",
                ("method",),
            )
        if kind == "full_period" and isinstance(going, FrequencyContinuation):
            raise InvalidValueError(
                "= full_period continues in the stiffness factor or the energy, not in the frequency",
                "use continue_in: {kind: energy, ...}, or method: shooting",
                ("method",),
            )
        if self.energies and isinstance(going, StiffnessFactorContinuation):
            raise InvalidValueError(
                "differ from the energy that the path in the stiffness factor holds constant",
                "use continue_in: {kind: energy, ...}, or leave them out",
                ("energies",),
            )
        if (self.energies or self.frequencies) and kind in _IN_FACTOR:
            raise InvalidValueError(f"= {kind} computes no points on request", "use method: shooting", ("method",))
        if isinstance(going, EnergyContinuation):
            going.demand_inside(self.energies, ("energies",))
        if isinstance(going, FrequencyContinuation):
            going.demand_inside(self.frequencies, ("frequencies",))
        if self.energy is not None and not isinstance(going, StiffnessFactorContinuation):
            raise InvalidValueError(
                f"cannot be held constant if the parameter is the {going.kind}", "leave it out", ("energy",)
            )
