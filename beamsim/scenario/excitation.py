"""Excitation of the structure: motion of its base, or forces at points and along lines and areas."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Generic, Literal, TypeVar

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario.base import (
    BY_FORM,
    InvalidValueError,
    Path,
    Problems,
    Schema,
    Variants,
    Whole,
    demand_rising,
    path_text,
    problem,
    walk,
)
from beamsim.scenario.body import (
    ROTATION_TAKES,
    TRANSLATION_TAKES,
    BaseOrPlace,
    MovedStop,
    MovedSupport,
    NodeDirection,
)
from beamsim.scenario.connections import base_problems
from beamsim.scenario.distributed import AreaLoad, LineLoad
from beamsim.scenario.files import SHORT_FOR_FILE, CurveFile, DecimalMark, RecordPreparation
from beamsim.scenario.units import LEVEL_PSD, STANDARD_GRAVITY, UnitError, read_level

AtLeastTwo = Field(min_length=2)
Quantity = Literal[
    "acceleration", "velocity", "displacement", "force", "force_per_length", "pressure",
    "angular_acceleration", "angular_velocity", "rotation",
]  # fmt: skip

About = Annotated[q.Coordinate | Annotated[tuple[q.Coordinate, ...], Field(min_length=1, max_length=3)], BY_FORM]


def point_of(about: float | tuple[float, ...] | None) -> tuple[float, float, float]:
    """x, y and z, m, of a point of which fewer may be given."""
    given = () if about is None else about if isinstance(about, tuple) else (about,)
    x, y, z = (*given, 0.0, 0.0, 0.0)[:3]
    return x, y, z


AppliedTo = Annotated[
    LineLoad | AreaLoad | MovedSupport | MovedStop | BaseOrPlace,
    Variants(
        "names neither the base nor a point nor a part of a body",
        "write base, {position: 270 mm} for a force on the beam, {mass: 2} for a force on a chain, {line: whole} for a "
        "force per length of a beam, {area: whole} for a pressure on a plate, or {support: left} or {snubber: stop} "
        "for one that moves",
    ),
]


def quantity_text(quantity: str) -> str:
    """A quantity as text says it.

    >>> quantity_text("force_per_length")
    'force per length'
    """
    return quantity.replace("_", " ")


def _with_article(quantity: str) -> str:
    return f"{'an' if quantity[0] == 'a' else 'a'} {quantity_text(quantity)}"


_TAKEN = {
    "acceleration": (
        "but the base moves", "give an acceleration (2 g), velocity (0.2 m/s) or displacement (0.1 mm), or apply the "
        "force to {position: ...} or {mass: ...}",
    ),
    "force": ("but a point takes a force", "give a force (1.5 N), or apply it to base"),
    "force_per_length": (
        "but a line takes a force per length", "give a force per length (50 N/m), or apply it to base or a point"
    ),
    "pressure": ("but an area takes a pressure", "give a pressure (200 Pa), or apply it to base or a point"),
    "angular_acceleration": (
        "but the base turns", "give an angular acceleration (50 rad/s^2), velocity (2 rad/s) or rotation (0.1 deg)"
    ),
}  # fmt: skip
"""By the first quantity that can act somewhere why no other can, and a remedy."""


def not_taken(quantity: str, takes: Sequence[str]) -> tuple[str, str]:
    """Why something of this quantity cannot act there, and a remedy; ``takes`` is what can."""
    no_force = " and takes no force" if takes[0] == "acceleration" and quantity == "force" else ""
    why, remedy = _TAKEN[takes[0]]
    return f"{_with_article(quantity)}, {why}{no_force}", remedy


class Input(Schema):
    """Common part of all excitations; by itself it is free motion."""

    @property
    def shock(self) -> bool:
        """Whether it begins at a time and leaves a free motion: the beginning counts, and there are no statistics."""
        return False

    @property
    def stationary(self) -> bool:
        """Whether it is noise whose statistics do not change in time, so that those of the response mean something."""
        return False

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """The motions and forces that it consists of, with their paths in it."""
        return []

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones, Hz, each once."""
        return ()

    @property
    def tone_hz(self) -> float:
        """Frequency of the only tone, Hz; NaN where there is none, or several."""
        return float(self.frequencies_hz[0]) if len(self.frequencies_hz) == 1 else math.nan

    @property
    def highest_tone_hz(self) -> float:
        """Highest frequency of the tones, Hz; 0 without any."""
        return max(self.frequencies_hz, default=0.0)

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the excitation, Hz; a pulse of duration T counts as 1/(2 T)."""
        return self.highest_tone_hz


class Driven(Input):
    """Common part of what moves the base or acts as a force."""

    applied_to: AppliedTo
    """Base, or a place: {position: 270 mm} of a beam, {mass: 2} of a chain, with the body where there are several; or
    {line: whole} for a force per length of a beam, {area: whole} for a pressure on a plate, or a part of it; or
    {support: left} or {joint: hinge} for a support that moves relative to the base; {snubber: stop} for a stop that
    moves against what it is mounted on."""
    stated: ClassVar[Mapping[str, str]] = {"quantity": "quantity"}

    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity or displacement of the base, force at a point, force per length, or pressure; by default
    as the unit of the level."""

    direction: NodeDirection | None = None
    """Direction in which the base moves: z by default, or as imported matrices say; rx, ry, rz turn it."""
    about: About | None = None
    """A point on the axis of a rotation, m: a position along a beam, [x, y] of a plate, [x, y, z] of imported matrices;
    by default their origin, the left end or lower left corner."""

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """Itself."""
        return [((), self)]

    def levels(self) -> list[tuple[Path, float]]:
        """Return the levels with their paths; none where a file or a table holds them."""
        level: float | None = getattr(self, "level", None)
        return [] if level is None else [(("level",), level)]

    @property
    def quantity(self) -> Quantity:
        """Quantity of the levels: as stated, else by their units, else the default of the place."""
        readings: Any = (self.quantity_, *(q.meant(level) for _, level in self.levels()))
        return next((of for of in readings if of is not None), self.level_quantities[0])

    def check(self) -> None:
        """Refuse units, a quantity and a place that contradict each other, and a direction or axis of no base."""
        super().check()
        quantity = self.quantity
        for path, level in self.levels():
            if (of := q.meant(level)) not in (None, quantity):
                message = f"is given in a unit of {quantity_text(of)}, where {_with_article(quantity)} is meant"
                raise InvalidValueError(message, "give the level in another unit, or set quantity", path)
        if quantity not in self.level_quantities:
            self._refuse_quantity()
        if self.direction is not None or self.about is not None:
            self._check_direction()

    def _refuse_quantity(self) -> None:
        """Refuse the quantity where it is given, or the first level that has it."""
        why, remedy = not_taken(self.quantity, self.level_quantities)
        of_levels = [path for path, _ in self.levels() if self.quantity_ is None]
        raise InvalidValueError(f"is {why}", remedy, next(iter(of_levels), ("quantity",)))

    def _check_direction(self) -> None:
        if self.direction is not None and not self.on_base:
            raise InvalidValueError("is the direction in which a base moves", "leave it out, or write applied_to: base",
                       ("direction",))  # fmt: skip
        if self.about is not None and not self.rotates:
            raise InvalidValueError(
                "belongs to a rotation of the base", "give direction: ry, or leave it out", ("about",)
            )

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A direction in which no body moves."""
        if self.direction is not None:
            yield from base_problems(scenario, (*path, "direction"), self.direction, f"= {self.direction}")

    @property
    def rotates(self) -> bool:
        """Whether the base, or the support that moves, turns."""
        if isinstance(self.applied_to, MovedSupport):
            return self.applied_to.rotates
        return self.direction is not None and self.direction.startswith("r")

    @property
    def on_base(self) -> bool:
        """Whether the base moves (otherwise a force acts)."""
        return self.applied_to == "base"

    def moves_stop(self, name: str) -> bool:
        """Whether it moves the stop with a name, or the pair to which that belongs."""
        at = self.applied_to
        return isinstance(at, MovedStop) and name in (at.snubber, f"{at.snubber}.above", f"{at.snubber}.below")

    @property
    def level_quantities(self) -> tuple[Quantity, ...]:
        """Quantities that its levels may have, the default first."""
        if self.applied_to != "base":
            return self.applied_to.level_quantities
        return ROTATION_TAKES if self.rotates else TRANSLATION_TAKES


Number = TypeVar("Number")


class Span(Schema, Generic[Number]):
    """A quantity changes from one value to another."""

    from_: Number = Field(alias="from")
    """First value."""
    to: Number
    """Last value."""

    @property
    def ends(self) -> tuple[Any, Any]:
        """First and last value."""
        return self.from_, self.to

    @property
    def unit(self) -> str:
        """SI unit of both; empty for plain numbers, and for levels, which have that of the excitation."""
        types = type(self).model_fields["to"].metadata
        return next((item.dimension.unit for item in types if isinstance(item, q.Quantity)), "")

    def demand_inside(self, values: Sequence[float], path: Path) -> None:
        """Refuse values of a list at a path that lie outside the range."""
        low, high = sorted(map(float, self.ends))
        for k, value in enumerate(values):
            if not low <= value <= high:
                raise InvalidValueError(
                    f"= {value:g} lies outside the range", f"give a value from {low:g} to {high:g}", (*path, k)
                )

    changing: ClassVar[str] = "continuation"
    suitable: ClassVar[str] = "give a range"
    where_it_falls: ClassVar[str] = ""
    """Remedy where the last value lies below the first; empty where it may."""

    def check(self) -> None:
        """Reject an empty range, and one that falls where it must not."""
        super().check()
        first, last = (str(end) if isinstance(end, q.Share) else f"{end:g} {self.unit}".rstrip() for end in self.ends)
        if self.from_ == self.to:
            raise InvalidValueError(f"= {last} equals the start of the {self.changing}", self.suitable, ("to",))
        if self.where_it_falls and self.ends[1] < self.ends[0]:
            raise InvalidValueError(f"= {last} lies below from = {first}", self.where_it_falls, ("to",))


class FrequencyRange(Span[q.Frequency]):
    """A frequency that is swept."""

    from_: q.Frequency = Field(alias="from")
    """First frequency; the lowest where a direction may be given."""
    to: q.Frequency
    """Last frequency; the highest where a direction may be given."""

    changing: ClassVar[str] = "sweep"
    suitable: ClassVar[str] = "give a range, from 20 Hz to 400 Hz"


Between = Literal["held", "log_log"]


class _LevelAt(Schema):
    level: q.Level
    """Amplitude, zero to peak."""
    stated: ClassVar[Mapping[str, str]] = {"quantity": "quantity"}

    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity, displacement or force; as the unit of the level says."""

    @property
    def quantity(self) -> str | None:
        """Quantity of the level; None if neither unit nor key states it."""
        return self.quantity_ or q.meant(self.level)

    def check(self) -> None:
        """Refuse a negative level, and one in a unit of another quantity."""
        super().check()
        if self.level < 0:
            raise InvalidValueError(
                "must not be negative", "use a phase of 180 deg to reverse the sign of a sine", ("level",)
            )
        if self.quantity_ not in (None, q.meant(self.level) or self.quantity_):
            raise InvalidValueError(
                f"is given in a unit of {q.meant(self.level)}, where {self.quantity_} is meant", "leave out quantity",
                ("level",),
            )  # fmt: skip


class ProfilePoint(_LevelAt):
    """A level that applies from a frequency on."""

    frequency: q.Frequency
    """Frequency of the point."""


class Notch(_LevelAt, FrequencyRange):
    """A range of frequencies in which the level is not exceeded."""

    changing: ClassVar[str] = "notch"
    where_it_falls: ClassVar[str] = "exchange the two"


def check_profile(points: tuple[ProfilePoint, ...], between: Between) -> None:
    """Reject a table that does not increase in frequency; raises `InvalidValueError`."""
    if between != "held" and not points:
        raise InvalidValueError(
            f"= {between} lies between points of a profile, and there is none", "leave it out", ("between",)
        )
    demand_rising((point.frequency for point in points), "Hz", lambda k: ("profile", k, "frequency"))
    for index, point in enumerate(points):
        if between == "log_log" and point.level == 0:
            raise InvalidValueError(
                "= 0 has no logarithm",
                "give a small level, or between: held",
                ("profile", index, "level"),
            )


def has_level_steps(section: Any) -> bool:
    """Whether a section has a profile whose levels are held, so that they change in steps."""
    return bool(getattr(section, "profile", ())) and section.between == "held"


def level_jumps(scenario: Whole, path: Path, section: Any) -> Iterator[str]:
    """A sentence for each step of more than 1 % in the level of a profile that is held, within the sweep.

    Parameters
    ----------
    scenario : what has the excitation, whose levels these are.
    path : path of the section.
    section : with a profile or without one.
    """
    quantity = getattr(scenario.excitation, "level_quantities", (q.FACTOR,))[0]
    unit = "g" if quantity == "acceleration" else "" if quantity == q.FACTOR else q.amplitude_unit(quantity)
    for before, point in pairwise(section.profile if has_level_steps(section) else ()):
        f = point.frequency
        levels = [q.acceleration_amplitude(each.level, each.quantity, f) for each in (before, point)]
        inside = min(section.from_, section.to) < f < max(section.from_, section.to)
        if not inside or abs(levels[1] - levels[0]) <= 0.01 * max(levels):
            continue
        below, above = (f"{x / STANDARD_GRAVITY if unit == 'g' else x:.4g} {unit}".rstrip() for x in levels)
        size, meet = "", ""
        if min(levels) > 0.0:
            size = f" ({20.0 * math.log10(levels[1] / levels[0]):+.1f} dB)"
            if powers := q.power_of(before.quantity) - q.power_of(point.quantity):
                meet = f" (they meet at {f * (levels[1] / levels[0]) ** (1.0 / powers):.4g} Hz)"
        jump = f"jumps at {f:.4g} Hz from {below} to {above}{size}; let the levels meet{meet}"
        yield f"{path_text(path)}: the level of the profile {jump}"


def level_problems(scenario: Whole, path: Path, section: Schema) -> Problems:
    """Levels of an analysis in a unit of another quantity than the excitation's.

    Parameters
    ----------
    scenario : what has the excitation.
    path : path of the section.
    section : what may have levels; tests with an excitation or a start of their own are left out.

    Yields
    ------
    Problem
    """
    excitation = scenario.excitation
    if not isinstance(excitation, Harmonic | Forces):
        return
    factors = isinstance(excitation, Forces)
    but = "but multiplies the levels of all forces" if factors else f"and the excitation is of {excitation.quantity}"
    for item_path, part in walk(section, path):
        if "start" in item_path or "excitation" in item_path:
            continue
        stated = part.quantity if isinstance(part, ProfilePoint | Notch) else None
        fits = (excitation.quantity,) if stated is None else excitation.level_quantities
        for key, name in type(part).keys().items():
            held = part.__dict__.get(name)
            for k, level in enumerate(held if isinstance(held, tuple) else (held,)):
                of_level = (stated or level.quantity) if isinstance(level, q.LevelValue) else None
                if of_level is not None and of_level not in fits:
                    place = (*item_path, key, k) if isinstance(held, tuple) else (*item_path, key)
                    remedy = "give a plain number: 0.5" if factors else "give it in the unit of excitation.level"
                    yield problem(place, f"is a level of {of_level}, {but}", remedy)


class NoExcitation(Input):
    """Free motion."""

    kind: Literal["none"] = "none"
    """No excitation."""


class Tone(Schema):
    """One sine of a multi-tone excitation."""

    level: q.Level
    """Amplitude, zero to peak; a bare number is m/s^2 on the base, N at a point."""
    frequency: q.Frequency
    """Frequency."""
    phase: q.Phase = 0.0
    """Phase of the sine at t = 0."""


class Harmonic(Driven, Tone):
    """A sin(2 pi f t + phase)."""

    kind: Literal["harmonic"] = "harmonic"
    """A sine."""

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequency, Hz."""
        return (self.frequency,)

    def at(self, frequency_hz: float, level: float | None = None) -> Harmonic:
        """A copy at another frequency, Hz, and level."""
        kept = self.level if level is None else q.LevelValue(level, self.quantity)
        return self.model_copy(update={"frequency": frequency_hz, "level": kept})


class MultiTone(Driven):
    """A sum of sines."""

    kind: Literal["multi_tone"] = "multi_tone"
    """A sum of sines."""
    tones: Annotated[tuple[Tone, ...], Field(min_length=1)]
    """The sines."""

    def levels(self) -> list[tuple[Path, float]]:
        """Return the levels with their paths."""
        return [(("tones", index, "level"), tone.level) for index, tone in enumerate(self.tones)]

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequencies, Hz."""
        return tuple(tone.frequency for tone in self.tones)


class Shock(Driven):
    """Common part of what begins at ``time`` with one level; a pulse of duration T goes up to 1 / (2 T)."""

    if TYPE_CHECKING:
        kind: Any
        duration: float | None

    level: q.Level
    """Level after a step, or peak of the pulse; of the base an acceleration, of smooth pulses also a velocity, of
    steps with a rise also a displacement."""
    time: q.Time = 0.0
    """When it begins."""

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Few samples in a pulse, and one after the end."""
        yield from super().find_warnings(scenario, path)
        if scenario.run is None or path[0] != "excitation":
            return
        if scenario.sample_rate < 20.0 * self.highest_frequency_hz:
            yield (
                f"run.sample_rate = {scenario.sample_rate:g} Hz puts fewer than 10 samples into the pulse of "
                f"{0.5 / self.highest_frequency_hz:g} s"
            )
        if self.time >= scenario.run.duration:
            end = scenario.run.duration
            yield f"{path_text((*path, 'time'))} = {self.time:g} s lies after the end of the run, {end:g} s"

    @property
    def most_integrals(self) -> int:
        """Largest number of integrations from base acceleration to level without a jump of the velocity."""
        return 0

    shock: ClassVar[bool] = True
    """It is one."""

    @property
    def area(self) -> float:
        """Area under the pulse, SI: of an acceleration the change of the velocity, of a force the impulse."""
        raise NotImplementedError

    @property
    def highest_frequency_hz(self) -> float:
        """Half the inverse of the duration, Hz, the frequency of the sine that a half-sine is half of; 0 of a step."""
        return 0.0 if self.duration is None else 0.5 / self.duration

    def check(self) -> None:
        """Reject what needs an infinite acceleration."""
        super().check()
        if q.power_of(self.quantity) > self.most_integrals:
            called = self.kind.replace("_", "-") + " pulse" * (self.kind != "step")
            smooth = " or velocity (level: 0.5 m/s)" * self.most_integrals or ", or use a half_sine pulse of velocity"
            remedy = f"give it as acceleration (level: 20 g){smooth}"
            if self.kind == "step":
                remedy = "give the time in which it is reached (rise: 5 ms), or an acceleration (level: 20 g)"
            raise InvalidValueError(
                f"is a {called} of the base's {quantity_text(self.quantity)}, which needs an infinite acceleration",
                remedy, ("level",),
            )  # fmt: skip


class Step(Shock):
    """Zero before `time`, `level` after it; with a duration a rectangular pulse."""

    kind: Literal["step"] = "step"
    """A step, or a rectangular pulse."""
    duration: q.Duration | None = None
    """Duration of a rectangular pulse, rise and fall included; by default the level stays."""
    rise: q.Duration | None = None
    """Time in which the level is reached, as (1 - cos) / 2, and left after a pulse; by default it jumps. A step of the
    displacement or velocity of what moves needs it."""

    @property
    def most_integrals(self) -> int:
        """Two where it rises: its acceleration is finite."""
        return 0 if self.rise is None else 2

    @property
    def highest_frequency_hz(self) -> float:
        """Frequency of the cosine with which it rises, Hz."""
        return super().highest_frequency_hz if self.rise is None else 0.5 / self.rise

    @property
    def area(self) -> float:
        """A (T - r) of a pulse with rise and fall r; infinite if the level stays."""
        return math.inf if self.duration is None else self.level * (self.duration - (self.rise or 0.0))

    def check(self) -> None:
        """Reject rise and fall longer than the pulse."""
        super().check()
        if self.rise is not None and self.duration is not None and 2.0 * self.rise > self.duration * (1 + 1e-12):
            raise InvalidValueError(f"= {self.rise:g} s, up and down, is longer than the pulse of {self.duration:g} s",
                       "shorten it, or give a longer duration", ("rise",))  # fmt: skip


class HalfSine(Shock):
    """Half a sine period starting at `time`, zero before and after."""

    most_integrals: ClassVar[int] = 1

    kind: Literal["half_sine"] = "half_sine"
    """A half-sine pulse."""
    duration: q.PulseDuration
    """Duration of the pulse."""

    @property
    def area(self) -> float:
        """2 A T / pi."""
        return 2.0 * self.level * self.duration / math.pi


class Trapezoid(Shock):
    """A pulse that rises and falls linearly, zero before and after."""

    most_integrals: ClassVar[int] = 1

    kind: Literal["trapezoid"] = "trapezoid"
    """A trapezoidal pulse."""
    duration: q.PulseDuration
    """Duration of the pulse, rise and fall included."""
    rise_: q.Duration | None = Field(default=None, alias="rise")
    """Duration of the rise; by default a tenth of that of the pulse (IEC 60068-2-27)."""
    fall_: q.Duration | None = Field(default=None, alias="fall")
    """Duration of the fall; by default a tenth of that of the pulse."""

    @property
    def rise(self) -> float:
        """Duration of the rise, s."""
        return 0.1 * self.duration if self.rise_ is None else self.rise_

    @property
    def fall(self) -> float:
        """Duration of the fall, s."""
        return 0.1 * self.duration if self.fall_ is None else self.fall_

    @property
    def area(self) -> float:
        """A (T - (rise + fall) / 2)."""
        return self.level * (self.duration - 0.5 * (self.rise + self.fall))

    def check(self) -> None:
        """Reject rise and fall longer than the pulse."""
        super().check()
        if self.rise + self.fall > self.duration * (1 + 1e-12):
            raise InvalidValueError(
                f"= {self.rise:g} s and fall = {self.fall:g} s are longer than the pulse of {self.duration:g} s",
                "shorten them, or give a longer duration",
                ("rise",),
            )


class Sawtooth(Shock):
    """A pulse that rises linearly and drops from its peak at once (final peak, IEC 60068-2-27)."""

    kind: Literal["sawtooth"] = "sawtooth"
    """A final-peak sawtooth pulse."""
    duration: q.PulseDuration
    """Duration of the pulse."""

    @property
    def area(self) -> float:
        """A T / 2."""
        return 0.5 * self.level * self.duration


class SweptSineInput(Driven, FrequencyRange):
    """A sine of increasing or decreasing frequency; use it with `beamsim run` (`beamsim sweep` has its own section)."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A swept sine."""
    level: q.Level | None = None
    """Amplitude, zero to peak, if it is the same at all frequencies."""
    profile: tuple[ProfilePoint, ...] = ()
    """Instead of level: a table of levels, each from a frequency on."""
    between: Between = "held"
    """Between the points of the profile: each level held, or log-log interpolation."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges with a reduced level."""
    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    phase: q.Phase = 0.0
    """Phase of the sine at t = 0."""

    def cycles_in(self, duration: float) -> float:
        """Cycles in the first seconds of the sweep; in general not whole."""
        rate = self.rate.value if self.to > self.from_ else -self.rate.value
        if self.rate.unit == "Hz/s":
            return (self.from_ + 0.5 * rate * duration) * duration
        return self.from_ * math.expm1(rate * duration * math.log(2.0)) / (rate * math.log(2.0))

    def check(self) -> None:
        """Refuse an empty range, no level or two, and levels that cannot act there."""
        if (self.level is None) == (not self.profile):
            raise InvalidValueError("needs either level or profile", "give one of the two")
        super().check()
        check_profile(self.profile, self.between)
        for index, point in enumerate(self.profile):
            if point.quantity is not None and point.quantity not in self.level_quantities:
                why, remedy = not_taken(point.quantity, self.level_quantities)
                raise InvalidValueError(f"is {why}", remedy, ("profile", index, "level"))

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Steps of the level."""
        yield from super().find_warnings(scenario, path)
        yield from level_jumps(scenario, path, self)

    @property
    def highest_frequency_hz(self) -> float:
        """The higher end of the sweep, Hz."""
        return max(self.from_, self.to)


class SampledInput(Driven, RecordPreparation):
    """A measured motion of the base, or force."""

    kind: Literal["sampled"] = "sampled"
    """Samples read from a file."""
    file: q.FileName
    """CSV, HDF5 (.h5, .hdf5), netCDF-4 (.nc), MATLAB (.mat) or UFF 58 (.uff, .unv) file; its path is relative to the
    folder of the scenario."""
    column: q.Text | None = None
    """CSV: number (from 1) or heading of the column of values; HDF5: path of the dataset; UFF: number of the set. It is
    needed where several could be meant."""
    time_column: q.Text | None = None
    """CSV: number or heading of the time column, by default the one headed as a time before the values; HDF5: path of
    the time dataset."""
    decimal: DecimalMark | None = None
    """Decimal mark of the numbers of a text file, "." or ","; by default what the numbers themselves show."""
    sample_rate: q.Frequency | None = None
    """Samples per second, if the file has no time axis."""
    unit: q.Text | None = None
    """Unit of the values in the file (g, mm, N, ...), by default the one that the file states."""
    time_unit: q.Text | None = None
    """Unit of the time axis in the file (s, ms, ...), by default the one that the file states."""
    interpolation: Literal["linear", "cubic"] = "cubic"
    """Interpolation between the samples: linear, or a cubic spline."""
    resample: q.Frequency | None = None
    """Sampling rate to which the record is brought, if it is too fine for the run; it is low-pass filtered before."""
    stationary_: bool = Field(default=False, alias="stationary")
    """Whether the record is noise whose statistics do not change in time: root mean squares, kurtosis and densities of
    the response are then stated. An earthquake or a shock is not; the default."""

    @property
    def stationary(self) -> bool:
        """Whether the record is declared to be stationary."""
        return self.stationary_

    @property
    def quantity(self) -> Quantity:
        """Quantity of the values: as stated, else by the unit, else the default of the place."""
        return self.quantity_ or self._quantity_of_unit or self.level_quantities[0]

    @property
    def _quantity_of_unit(self) -> Quantity | None:
        of: Any = None if self.unit is None else q.meant(q.LevelType().read(f"1 {self.unit}"))
        return of  # type: ignore[no-any-return]

    def check(self) -> None:
        """Refuse a unit of another quantity, what cannot act there, and corners of a motion."""
        try:
            stated = self._quantity_of_unit
        except UnitError as error:
            raise InvalidValueError(error.message, error.remedy, ("unit",)) from None
        if stated is not None and self.quantity_ not in (None, stated):
            raise InvalidValueError(
                f"is a unit of {stated}, where {self.quantity_} is meant", "change one of them", ("unit",)
            )
        super().check()
        if self.quantity in q.INTEGRALS and self.interpolation == "linear":
            raise InvalidValueError(
                f"= linear of the base's {quantity_text(self.quantity)} has corners, where the acceleration is "
                "infinite",
                "use interpolation: cubic, or give the acceleration",
                ("interpolation",),
            )


class PsdPoint(Schema):
    """A point in a table of power spectral density: its density, or the slope of the line that leads to it."""

    frequency: q.Frequency
    """Frequency; two points at one frequency are a step of the density."""
    density: q.DensityOfTest | None = None
    """One-sided density: g^2/Hz or (m/s^2)^2/Hz for an acceleration, N^2/Hz for a force."""
    slope: q.DensitySlope | None = None
    """Instead of a density the slope of the line from the point before, in dB/oct: 3 dB/oct doubles the density in an
    octave; at the first point, of the line to the point behind it."""

    def check(self) -> None:
        """Demand one of the two."""
        super().check()
        if (self.density is None) == (self.slope is None):
            raise InvalidValueError(
                "needs either density or slope", "give one of the two, for example density: 0.01 g^2/Hz"
            )


def _demand_rising_or_steps(frequency: Sequence[float], path_of: Callable[[int], Path]) -> None:
    """Refuse frequencies, Hz, that fall, or stay other than at a step: two equal ones, not at an end of the list.

    ``path_of`` is the path of a frequency, by its index.
    """
    remedy = "list them from the lowest to the highest; two points at one frequency within the band are a step"
    for k, (before, here) in enumerate(pairwise(frequency), 1):
        again = here == before and (k in (1, len(frequency) - 1) or frequency[k - 2] == here)
        if here < before or again:
            raise InvalidValueError(
                f"= {here:g} Hz does not lie above the one before, {before:g} Hz", remedy, path_of(k)
            )


def density_table(points: Sequence[PsdPoint]) -> tuple[tuple[float, float], ...]:
    """Frequencies, Hz, and densities, SI, of a table with slopes and steps.

    Raises
    ------
    InvalidValueError
        If the frequencies fall, or are those of a point that follows from nothing, or a density is out of range.
    """
    frequency = [point.frequency for point in points]
    _demand_rising_or_steps(frequency, lambda k: (k, "frequency"))
    for k, (before, here) in enumerate(pairwise(frequency), 1):
        if here == before and points[k].slope is not None:
            raise InvalidValueError(
                "is that of a line between two points at one frequency", "give the density", (k, "slope")
            )
    first = points[0].density
    if first is None:
        known = points[1].density
        if known is None:
            raise InvalidValueError(
                "is missing: the first two points have slopes alone", "give the density of one", (1, "density")
            )
        first = known * _growth(points[0].slope, frequency[0] / frequency[1])
    densities = [first]
    for k, point in enumerate(points[1:], 1):
        growth = 1.0 if point.slope is None else _growth(point.slope, frequency[k] / frequency[k - 1])
        densities.append(densities[-1] * growth if point.density is None else float(point.density))
    for k, density in enumerate(densities):
        if not 1e-60 < density < 1e60:
            raise InvalidValueError(f"leads to a density of {density:g}", "give a flatter one", (k, "slope"))
    return tuple(zip(frequency, densities, strict=True))


def _growth(slope: float | None, ratio: float) -> float:
    """Factor of the density along a line of a slope in dB/oct over a ratio of frequencies."""
    exponent = 0.1 * (slope or 0.0) * math.log2(ratio)
    return 10.0**exponent if abs(exponent) < 300.0 else math.inf


class RandomInput(Driven):
    """Gaussian noise with a given power spectral density."""

    kind: Literal["random"] = "random"
    """Random input."""
    psd: Annotated[Annotated[tuple[PsdPoint, ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE]
    """Density over frequency: points, or a file, psd.csv or {file: psd.csv, column: level}; log-log interpolation
    between them, zero outside."""
    clip: q.Sigmas | None = None
    """Largest magnitude of the noise in standard deviations, as a controller clips its drive signal: 3 sigma; by
    default it is not clipped."""
    seed: q.Seed = 0
    """Seed of the random numbers: the same seed gives the same input. Or a blend of the inputs of several seeds with
    random amplitudes, 0.8*4 + 0.6*7, as studies of reliability find it."""
    amplitudes: Literal["fixed", "random"] | None = None
    """Amplitudes of the sines: fixed by the density, or random as those of a Gaussian process, whose RMS scatters
    between records. By default fixed, but random in a study over seeds."""
    period: q.Duration | None = None
    """The noise is a sum of sines that repeats after this time; the run's duration by default. It may be longer than
    the run."""
    sample_rate: q.Frequency | None = None
    """Sample rate used for interpolation; by default 20 times the highest frequency."""
    ramp: q.Time = 0.0
    """Time over which the level rises at the beginning."""

    def check(self) -> None:
        """Check the table."""
        super().check()
        if self.quantity != self.level_quantities[0]:
            raise InvalidValueError(f"must be {quantity_text(self.level_quantities[0])}", "leave it out", ("quantity",))
        if isinstance(self.seed, str) and self.amplitudes != "random":
            raise InvalidValueError("blends inputs of random amplitudes", "write amplitudes: random", ("seed",))
        if isinstance(self.psd, CurveFile):
            density = self.psd.file
            with suppress(UnitError):
                read_level(density, LEVEL_PSD)
                raise InvalidValueError(
                    f"= {density} is one density, without its band",
                    f"give its ends, as [{{frequency: 20 Hz, density: {density}}}, {{frequency: 2 kHz, density: "
                    f"{density}}}], or the name of a file",
                    ("psd",),
                )
            return
        try:
            highest = density_table(self.psd)[-1][0]
        except InvalidValueError as fault:
            raise InvalidValueError(fault.message, fault.remedy, ("psd", *fault.at)) from None
        for k, point in enumerate(self.psd):
            of = q.meant(point.density)
            if of not in (None, self.quantity):
                why, _ = not_taken(str(of), self.level_quantities)
                remedy = f"give a density such as {q.DENSITY_DIMENSIONS[self.quantity].example}, or change applied_to"
                raise InvalidValueError(f"is of {why}", remedy, ("psd", k, "density"))
        self.check_sample_rate(highest)

    def check_sample_rate(self, highest: float) -> None:
        """Refuse a sample rate that does not resolve the highest frequency of the density, Hz.

        Raises
        ------
        InvalidValueError
        """
        if self.sample_rate is not None and self.sample_rate < 4 * highest:
            raise InvalidValueError(
                f"= {self.sample_rate:g} Hz is too low for noise up to {highest:g} Hz",
                f"use {20 * highest:g} Hz, or leave it out",
                ("sample_rate",),
            )

    @property
    def table(self) -> tuple[tuple[float, float], ...]:
        """Frequencies, Hz, and densities, SI, of points; none of a density in a file."""
        return () if isinstance(self.psd, CurveFile) else density_table(self.psd)

    stationary: ClassVar[bool] = True
    """It is."""

    @property
    def highest_frequency_hz(self) -> float:
        """End of the table, Hz; 0 of one in a file (see `beamsim.inputs.measured.highest_excited_hz`)."""
        return 0.0 if isinstance(self.psd, CurveFile) else self.psd[-1].frequency


ShockCurve = Annotated[
    Annotated[tuple[tuple[q.Frequency, q.PositiveAcceleration], ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE
]  # fmt: skip


def check_limit_curve(points: tuple[tuple[float, float], ...] | CurveFile, path: Path) -> None:
    """Refuse points of a limit at a path that fall in frequency, other than a step; a file is not read."""
    if not isinstance(points, CurveFile):
        _demand_rising_or_steps([f for f, _ in points], lambda k: (*path, k, 0))


class MatchedInput(Driven):
    """An acceleration of the base whose shock response spectrum is a given curve."""

    kind: Literal["matched"] = "matched"
    """A record made for a shock response spectrum."""
    srs: ShockCurve
    """Maximax absolute acceleration over natural frequency: pairs, [[100 Hz, 20 g], [2 kHz, 500 g]], or a CSV file,
    curve.csv or {file: curve.csv, column: level}; log-log interpolation between them."""
    quality: q.Quality = 10.0
    """Quality factor Q = 1 / (2 damping ratio) of the oscillators of the curve, above that of critical damping."""
    duration: q.Duration
    """Duration of the record, at least 1.5 cycles of the lowest frequency; it begins and ends at rest."""
    seed: q.RandomSeed = 0
    """Seed of the times and signs of its wavelets: the same seed gives the same record."""

    shock: ClassVar[bool] = True
    """It leaves a free motion."""

    @property
    def highest_frequency_hz(self) -> float:
        """End of the curve, Hz; 0 of one in a file (see `beamsim.inputs.measured.highest_excited_hz`)."""
        return 0.0 if isinstance(self.srs, CurveFile) else self.srs[-1][0]

    def check(self) -> None:
        """Refuse an invalid curve, and anything but an acceleration of the base along a line."""
        super().check()
        if not isinstance(self.srs, CurveFile):  # no record has a spectrum with a step
            demand_rising((f for f, _ in self.srs), "Hz", lambda k: ("srs", k, 0))
        if not self.on_base or self.rotates or self.quantity != "acceleration":
            raise InvalidValueError("is an acceleration of the base along a direction",
                        "write applied_to: base, without quantity or rotation", ("kind",))  # fmt: skip

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A run that ends before it."""
        yield from super().problems(scenario, path)
        run = scenario.run
        if path[0] == "excitation" and run is not None and run.duration < self.duration * (1 - 1e-9):
            message = f"= {run.duration:g} s ends before the matched record, of {self.duration:g} s"
            yield problem(("run", "duration"), message, "run longer: what follows the record counts, too")


SingleExcitation = (
    Harmonic
    | MultiTone
    | Step
    | HalfSine
    | Trapezoid
    | Sawtooth
    | SweptSineInput
    | SampledInput
    | RandomInput
    | MatchedInput
)


class Forces(Input):
    """Several forces and motions at once, each with its own signal."""

    kind: Literal["forces"] = "forces"
    """Several forces and motions."""
    forces: Annotated[tuple[Annotated[SingleExcitation, BY_FORM], ...], Field(min_length=1)]
    """Each a harmonic, multi_tone, step, half_sine, trapezoid, sawtooth, swept_sine, sampled, random or matched
    excitation that is applied to a point, a line of a beam, an area of a plate, a support that moves, or (one of them)
    the base."""

    def check(self) -> None:
        """Reject two motions of the base."""
        first, *more = [index for index, force in enumerate(self.forces) if force.on_base] or [0]
        if more:
            one, other = (self.forces[index].direction or "z" for index in (first, more[0]))
            raise InvalidValueError(
                f"is the base, which forces[{first}] moves already{f' along {one}' if one != other else ''}",
                "list one motion of the base; several sines are one multi_tone" if one == other else
                f"list one motion of the base, and the one along {other} as motions of the supports: "
                f"{{support: ..., direction: ...}}",
                ("forces", more[0], "applied_to"),
            )  # fmt: skip

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """The forces and motions."""
        return [(("forces", index), force) for index, force in enumerate(self.forces)]

    @property
    def harmonics(self) -> tuple[Harmonic, ...]:
        """The inputs that are sines."""
        return tuple(force for force in self.forces if isinstance(force, Harmonic))

    # What a sweep asks a harmonic excitation: its levels multiply all forces, each of which keeps its own phase.
    level: ClassVar[float] = 1.0
    phase: ClassVar[float] = 0.0
    quantity: ClassVar[str] = q.FACTOR
    level_quantities: ClassVar[tuple[str, ...]] = (q.FACTOR,)
    on_base: ClassVar[bool] = False

    @property
    def frequency(self) -> float:
        """Frequency of the sines, Hz."""
        return self.harmonics[0].frequency

    def at(self, frequency_hz: float, level: float | None = None) -> Forces:
        """The sines at another frequency, Hz, with their levels multiplied by ``level``."""
        factor = 1.0 if level is None else level
        forces = tuple(force.at(frequency_hz, factor * force.level) for force in self.harmonics)
        return self.model_copy(update={"forces": forces})

    def problems_of_sines(self, section: str) -> Problems:
        """Problems of forces that a section cannot sweep: at the base, not a sine, a second frequency."""
        frequency = self.harmonics[0].frequency if self.harmonics else 0.0
        for index, force in enumerate(self.forces):
            at = ("excitation", "forces", index)
            if force.on_base:
                yield problem(
                    (*at, "applied_to"), f"is the base, which {section} moves alone",
                    "leave out the other forces, or move its supports instead",
                )  # fmt: skip
            elif not isinstance(force, Harmonic):
                yield problem(
                    (*at, "kind"), f"= {force.kind} has no frequency that {section} could change",
                    "make it harmonic, or leave it out",
                )  # fmt: skip
            elif force.frequency != frequency:
                yield problem(
                    (*at, "frequency"), f"= {force.frequency:g} Hz, and another force has {frequency:g} Hz",
                    f"give all forces one frequency, which {section} changes",
                )  # fmt: skip

    @property
    def shock(self) -> bool:
        """Whether all of them begin at a time and leave a free motion."""
        return all(force.shock for force in self.forces)

    @property
    def stationary(self) -> bool:
        """Whether there is noise among them, and at most tones in addition."""
        noise = [force for force in self.forces if not isinstance(force, Harmonic | MultiTone)]
        return bool(noise) and all(force.stationary for force in noise)

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of all tones, Hz, each once."""
        return tuple(dict.fromkeys(f for force in self.forces for f in force.frequencies_hz))

    @property
    def highest_frequency_hz(self) -> float:
        """The highest of all, Hz."""
        return max(force.highest_frequency_hz for force in self.forces)


Excitation = Annotated[NoExcitation | SingleExcitation | Forces, BY_FORM]


Sine = Harmonic | Forces
"""What sweeps and continuations follow; see `sine_problems`."""


def sine_problems(excitation: Any, section: str) -> Problems:
    """Why a sweep or continuation, a section of the scenario, cannot follow an excitation."""
    if isinstance(excitation, Forces):
        yield from excitation.problems_of_sines(section)
    elif not isinstance(excitation, Harmonic):
        yield not_harmonic((section,), "the frequency of a harmonic excitation", excitation)


def not_harmonic(path: Path, needed: str, excitation: Any) -> Problem:
    """A problem: a section at a path needs another excitation."""
    remedy = "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}"
    return problem(path, f"needs {needed}, but this one is {excitation.kind}", remedy)
