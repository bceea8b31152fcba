"""Excitation: motion of the base, or forces at points and along lines and areas."""

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


def point_of(coordinates: float | tuple[float, ...] | None) -> tuple[float, float, float]:
    """x, y and z, m, of a point with at most three coordinates; missing ones are 0."""
    given = () if coordinates is None else coordinates if isinstance(coordinates, tuple) else (coordinates,)
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
    """The name of a quantity, as text.

    >>> quantity_text("force_per_length")
    'force per length'
    """
    return quantity.replace("_", " ")


def _with_article(quantity: str) -> str:
    return f"{'an' if quantity[0] == 'a' else 'a'} {quantity_text(quantity)}"


_NOT_ALLOWED = {
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
"""For each quantity that is allowed somewhere: why no other is allowed there, and a remedy."""


def not_taken(quantity: str, quantities: Sequence[str]) -> tuple[str, str]:
    """Why a quantity is not allowed at a place, and a remedy; ``quantities`` lists the allowed ones."""
    no_force = " and takes no force" if quantities[0] == "acceleration" and quantity == "force" else ""
    why, remedy = _NOT_ALLOWED[quantities[0]]
    return f"{_with_article(quantity)}, {why}{no_force}", remedy


class Input(Schema):
    """Common part of all excitations; the defaults are those of free motion."""

    @property
    def shock(self) -> bool:
        """Whether it starts at a certain time and is followed by a free motion, so that statistics make no sense."""
        return False

    @property
    def stationary(self) -> bool:
        """Whether it is stationary noise, so that statistics of the response make sense."""
        return False

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """Its motions and forces, with their paths below this section."""
        return []

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the sines, Hz, each once."""
        return ()

    @property
    def tone_hz(self) -> float:
        """Frequency of the only sine, Hz; NaN if there is none or several."""
        return float(self.frequencies_hz[0]) if len(self.frequencies_hz) == 1 else math.nan

    @property
    def highest_tone_hz(self) -> float:
        """Highest frequency of the sines, Hz; 0 if there are none."""
        return max(self.frequencies_hz, default=0.0)

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the excitation, Hz; a pulse of duration T counts as 1/(2 T)."""
        return self.highest_tone_hz


class DrivenInput(Input):
    """Common part of excitations that move the base, a support or a stop, or act as a force."""

    applied_to: AppliedTo
    """base, or a place: {position: 270 mm} on a beam, {mass: 2} of a chain, with the body if there are several; {line:
    whole} for a force per length on a beam; {area: whole} for a pressure on a plate, or a part of it; {support: left}
    or {joint: hinge} for a support that moves relative to the base; {snubber: stop} for a stop that moves relative to
    what it is mounted on. """
    unit_attributes: ClassVar[Mapping[str, str]] = {"quantity": "quantity"}

    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity or displacement of the base, force at a point, force per length, or pressure; by default
    the unit of the level decides."""

    direction: NodeDirection | None = None
    """Direction in which the base moves: z by default, or that of the imported matrices; rx, ry, rz are rotations."""
    about: About | None = None
    """A point on the axis of a rotation, m: a position along a beam, [x, y] on a plate, [x, y, z] of imported matrices;
    by default the origin: the left end, or the lower left corner."""

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """Itself, with an empty path."""
        return [((), self)]

    def levels(self) -> list[tuple[Path, float]]:
        """The levels with their paths; none if a file or table contains them."""
        level: float | None = getattr(self, "level", None)
        return [] if level is None else [(("level",), level)]

    @property
    def quantity(self) -> Quantity:
        """Quantity of the levels: as given, else from their units, else the default of the place."""
        readings: Any = (self.quantity_, *(q.meant(level) for _, level in self.levels()))
        return next((of for of in readings if of is not None), self.level_quantities[0])

    def check(self) -> None:
        """Refuse contradictions between units, quantity and place, and a direction or axis without a base motion."""
        super().check()
        quantity = self.quantity
        for path, level in self.levels():
            if (of := q.meant(level)) not in (None, quantity):
                message = f"has a unit of {quantity_text(of)}, but {_with_article(quantity)} is required"
                raise InvalidValueError(message, "give the level in another unit, or set quantity", path)
        if quantity not in self.level_quantities:
            self._refuse_quantity()
        if self.direction is not None or self.about is not None:
            self._check_direction()

    def _refuse_quantity(self) -> None:
        """Refuse the quantity at the key that gives it, or at the first level with a unit of it."""
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
        """A problem if no body can move in the direction."""
        if self.direction is not None:
            yield from base_problems(scenario, (*path, "direction"), self.direction, f"= {self.direction}")

    @property
    def rotates(self) -> bool:
        """Whether the base or support rotates."""
        if isinstance(self.applied_to, MovedSupport):
            return self.applied_to.rotates
        return self.direction is not None and self.direction.startswith("r")

    @property
    def on_base(self) -> bool:
        """Whether it moves the base (otherwise a force acts)."""
        return self.applied_to == "base"

    def moves_stop(self, name: str) -> bool:
        """Whether it moves the stop with this name, or the pair to which the stop belongs."""
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
    """A range of values, from the first to the last."""

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
        """SI unit of both values; empty for plain numbers, and for levels, which have the unit of the excitation."""
        types = type(self).model_fields["to"].metadata
        return next((item.dimension.unit for item in types if isinstance(item, q.Quantity)), "")

    def demand_inside(self, values: Sequence[float], path: Path) -> None:
        """Refuse values in a list that lie outside the range."""
        low, high = sorted(map(float, self.ends))
        for k, value in enumerate(values):
            if not low <= value <= high:
                raise InvalidValueError(
                    f"= {value:g} lies outside the range", f"give a value from {low:g} to {high:g}", (*path, k)
                )

    range_noun: ClassVar[str] = "continuation"
    range_remedy: ClassVar[str] = "give a range"
    falling_range_remedy: ClassVar[str] = ""
    """Remedy if the last value is smaller than the first; empty if that is allowed."""

    def check(self) -> None:
        """Refuse an empty range, and a falling one if it must rise."""
        super().check()
        first, last = (str(end) if isinstance(end, q.Share) else f"{end:g} {self.unit}".rstrip() for end in self.ends)
        if self.from_ == self.to:
            raise InvalidValueError(f"= {last} equals the start of the {self.range_noun}", self.range_remedy, ("to",))
        if self.falling_range_remedy and self.ends[1] < self.ends[0]:
            raise InvalidValueError(f"= {last} lies below from = {first}", self.falling_range_remedy, ("to",))


class FrequencyRange(Span[q.Frequency]):
    """A range of swept frequencies."""

    from_: q.Frequency = Field(alias="from")
    """First frequency; the lower one if there is a key direction."""
    to: q.Frequency
    """Last frequency; the higher one if there is a key direction."""

    range_noun: ClassVar[str] = "sweep"
    range_remedy: ClassVar[str] = "give a range, from 20 Hz to 400 Hz"


Between = Literal["held", "log_log"]


class _LevelAt(Schema):
    level: q.Level
    """Amplitude, zero to peak."""
    unit_attributes: ClassVar[Mapping[str, str]] = {"quantity": "quantity"}

    quantity_: Quantity | None = Field(default=None, alias="quantity")
    """Acceleration, velocity, displacement or force; by default the unit of the level decides."""

    @property
    def quantity(self) -> str | None:
        """Quantity of the level; None if neither its unit nor a key gives one."""
        return self.quantity_ or q.meant(self.level)

    def check(self) -> None:
        """Refuse a negative level, and a unit that contradicts the quantity."""
        super().check()
        if self.level < 0:
            raise InvalidValueError(
                "must not be negative", "use a phase of 180 deg to reverse the sign of a sine", ("level",)
            )
        if self.quantity_ not in (None, q.meant(self.level) or self.quantity_):
            raise InvalidValueError(
                f"has a unit of {q.meant(self.level)}, but {self.quantity_} is required", "leave out quantity",
                ("level",),
            )  # fmt: skip


class ProfilePoint(_LevelAt):
    """A level, from a frequency on."""

    frequency: q.Frequency
    """Frequency of the point."""


class Notch(_LevelAt, FrequencyRange):
    """A frequency range with an upper limit of the level."""

    range_noun: ClassVar[str] = "notch"
    falling_range_remedy: ClassVar[str] = "exchange the two"


def check_profile(points: tuple[ProfilePoint, ...], between: Between) -> None:
    """Refuse a table whose frequencies do not increase; raises `InvalidValueError`."""
    if between != "held" and not points:
        raise InvalidValueError(f"= {between} needs a profile, but there is none", "leave it out", ("between",))
    demand_rising((point.frequency for point in points), "Hz", lambda k: ("profile", k, "frequency"))
    for index, point in enumerate(points):
        if between == "log_log" and point.level == 0:
            raise InvalidValueError(
                "= 0 has no logarithm",
                "give a small level, or between: held",
                ("profile", index, "level"),
            )


def has_level_steps(section: Any) -> bool:
    """Whether a section has a profile whose level changes in steps."""
    return bool(getattr(section, "profile", ())) and section.between == "held"


def level_jumps(scenario: Whole, path: Path, section: Any) -> Iterator[str]:
    """A sentence for each step of more than 1 % in the level of a profile, within the sweep.

    Parameters
    ----------
    scenario : with the excitation that has these levels.
    path : path of the section.
    section : with or without a profile.
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
    """Problems of levels of an analysis whose unit does not fit the excitation.

    Parameters
    ----------
    scenario : with the excitation.
    path : path of the section.
    section : may contain levels; tests with their own excitation or start are skipped.

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
    """Amplitude, zero to peak; without a unit m/s^2 for a base motion, N for a force."""
    frequency: q.Frequency
    """Frequency."""
    phase: q.Phase = 0.0
    """Phase of the sine at t = 0."""


class Harmonic(DrivenInput, Tone):
    """A sin(2 pi f t + phase)."""

    kind: Literal["harmonic"] = "harmonic"
    """A sine."""

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequency, Hz."""
        return (self.frequency,)

    def at(self, frequency_hz: float, level: float | None = None) -> Harmonic:
        """A copy with another frequency, Hz, and level."""
        kept = self.level if level is None else q.LevelValue(level, self.quantity)
        return self.model_copy(update={"frequency": frequency_hz, "level": kept})


class MultiTone(DrivenInput):
    """A sum of sines."""

    kind: Literal["multi_tone"] = "multi_tone"
    """A sum of sines."""
    tones: Annotated[tuple[Tone, ...], Field(min_length=1)]
    """The sines."""

    def levels(self) -> list[tuple[Path, float]]:
        """The levels with their paths."""
        return [(("tones", index, "level"), tone.level) for index, tone in enumerate(self.tones)]

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequencies, Hz."""
        return tuple(tone.frequency for tone in self.tones)


class Shock(DrivenInput):
    """Common part of pulses and steps, which begin at ``time`` and have one level."""

    if TYPE_CHECKING:
        kind: Any
        duration: float | None

    level: q.Level
    """Level after a step, or peak of a pulse: for a base motion an acceleration, for smooth pulses also a velocity, for
    steps with a rise time also a displacement."""
    time: q.Time = 0.0
    """Time at which it begins."""

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings about few samples in a pulse, and about a pulse after the end of the run."""
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
        """How often the base acceleration may be integrated to the quantity without a jump of the velocity."""
        return 0

    shock: ClassVar[bool] = True
    """True for all pulses and steps."""

    @property
    def area(self) -> float:
        """Area under the pulse, SI: velocity change for an acceleration, impulse for a force."""
        raise NotImplementedError

    @property
    def highest_frequency_hz(self) -> float:
        """1 / (2 duration), Hz, the frequency of the corresponding half sine; 0 for a step."""
        return 0.0 if self.duration is None else 0.5 / self.duration

    def check(self) -> None:
        """Refuse a quantity that would need an infinite acceleration."""
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
    """Duration of a rectangular pulse, including rise and fall; by default the level stays."""
    rise: q.Duration | None = None
    """Rise time, in the form (1 - cos) / 2, also used for the fall after a pulse; by default the level jumps. A step of
    a displacement or velocity of the base needs a rise time."""

    @property
    def most_integrals(self) -> int:
        """Two if it has a rise time, since its acceleration is then finite."""
        return 0 if self.rise is None else 2

    @property
    def highest_frequency_hz(self) -> float:
        """Frequency of the cosine of the rise, Hz."""
        return super().highest_frequency_hz if self.rise is None else 0.5 / self.rise

    @property
    def area(self) -> float:
        """A (T - r) for a pulse with rise and fall time r; infinite if the level stays."""
        return math.inf if self.duration is None else self.level * (self.duration - (self.rise or 0.0))

    def check(self) -> None:
        """Refuse rise and fall that are longer than the pulse."""
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
    """Duration of the pulse, including rise and fall."""
    rise_: q.Duration | None = Field(default=None, alias="rise")
    """Rise time; by default a tenth of the duration (IEC 60068-2-27)."""
    fall_: q.Duration | None = Field(default=None, alias="fall")
    """Fall time; by default a tenth of the duration."""

    @property
    def rise(self) -> float:
        """Rise time, s."""
        return 0.1 * self.duration if self.rise_ is None else self.rise_

    @property
    def fall(self) -> float:
        """Fall time, s."""
        return 0.1 * self.duration if self.fall_ is None else self.fall_

    @property
    def area(self) -> float:
        """A (T - (rise + fall) / 2)."""
        return self.level * (self.duration - 0.5 * (self.rise + self.fall))

    def check(self) -> None:
        """Refuse rise and fall that are longer than the pulse."""
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


class SweptSineInput(DrivenInput, FrequencyRange):
    """A sine of increasing or decreasing frequency, for `beamsim run` (`beamsim sweep` has its own section)."""

    kind: Literal["swept_sine"] = "swept_sine"
    """A swept sine."""
    level: q.Level | None = None
    """Amplitude, zero to peak, if it is the same at all frequencies."""
    profile: tuple[ProfilePoint, ...] = ()
    """A table of levels instead of level; each applies from its frequency on."""
    between: Between = "held"
    """Between the points of the profile: constant level (held), or log-log interpolation (log_log)."""
    notches: tuple[Notch, ...] = ()
    """Frequency ranges with a reduced level."""
    rate: q.SweepRate
    """Sweep rate: oct/min (logarithmic) or Hz/s (linear)."""
    phase: q.Phase = 0.0
    """Phase of the sine at t = 0."""

    def cycles_in(self, duration: float) -> float:
        """Cycles in the first ``duration`` seconds of the sweep, in general not a whole number."""
        rate = self.rate.value if self.to > self.from_ else -self.rate.value
        if self.rate.unit == "Hz/s":
            return (self.from_ + 0.5 * rate * duration) * duration
        return self.from_ * math.expm1(rate * duration * math.log(2.0)) / (rate * math.log(2.0))

    def check(self) -> None:
        """Refuse an empty range, a missing or double level, and levels that are not allowed at the place."""
        if (self.level is None) == (not self.profile):
            raise InvalidValueError("needs either level or profile", "give one of the two")
        super().check()
        check_profile(self.profile, self.between)
        for index, point in enumerate(self.profile):
            if point.quantity is not None and point.quantity not in self.level_quantities:
                why, remedy = not_taken(point.quantity, self.level_quantities)
                raise InvalidValueError(f"is {why}", remedy, ("profile", index, "level"))

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings about steps of the level."""
        yield from super().find_warnings(scenario, path)
        yield from level_jumps(scenario, path, self)

    @property
    def highest_frequency_hz(self) -> float:
        """The higher end of the sweep, Hz."""
        return max(self.from_, self.to)


class AxisColumns(Schema):
    """Columns of one record by the direction in which they move the base."""

    x: q.Text | None = None
    """Column of the motion along x: as column."""
    y: q.Text | None = None
    """Column of the motion along y."""
    z: q.Text | None = None
    """Column of the motion along z."""
    rx: q.Text | None = None
    """Column of the rotation about x."""
    ry: q.Text | None = None
    """Column of the rotation about y."""
    rz: q.Text | None = None
    """Column of the rotation about z."""

    @property
    def by_direction(self) -> dict[Any, str]:
        """The columns that are given, by direction."""
        given = {name: getattr(self, name) for name in ("x", "y", "z", "rx", "ry", "rz")}
        return {name: column for name, column in given.items() if column is not None}

    def check(self) -> None:
        """Require a column."""
        super().check()
        if not self.by_direction:
            raise InvalidValueError("names no column", "name one, for example {x: TX, rz: RZ}")


_ANGULAR: dict[Any, Quantity] = dict(zip(TRANSLATION_TAKES, ROTATION_TAKES, strict=True))
"""Quantity of a rotation, by that of a translation."""


class SampledInput(DrivenInput, RecordPreparation):
    """A measured motion of the base, or a measured force."""

    kind: Literal["sampled"] = "sampled"
    """Samples read from a file."""
    file: q.FileName
    """CSV, HDF5 (.h5, .hdf5), netCDF (.nc), MATLAB (.mat), UFF 58 (.uff, .unv), TDMS, MDF (.mf4, .mdf) or LVM file; the
    path is relative to the folder of the scenario."""
    column: q.Text | None = None
    """CSV: number (from 1) or heading of the column of values; HDF5: path of the dataset; UFF: number of the dataset.
    Required if there are several candidates."""
    columns: AxisColumns | None = None
    """Instead of column and direction, the columns of several motions of the base in one file: {x: TX, y: TY, z: TZ,
    rx: RX, ry: RY, rz: RZ}, with rotations about the point about."""
    angular_unit: q.Text | None = None
    """Unit of the columns of rotations (rad/s^2, deg, ...), as unit for the others; by default the unit in the file."""
    time_column: q.Text | None = None
    """CSV: number or heading of the time column, by default the column headed as time before the values; HDF5: path of
    the time dataset."""
    decimal: DecimalMark | None = None
    """Decimal mark in a text file, "." or ","; by default detected from the numbers."""
    sample_rate: q.Frequency | None = None
    """Samples per second, if the file has no time axis."""
    unit: q.Text | None = None
    """Unit of the values in the file (g, mm, N, ...); by default the unit in the file."""
    time_unit: q.Text | None = None
    """Unit of the time axis in the file (s, ms, ...); by default the unit in the file."""
    interpolation: Literal["linear", "cubic"] = "cubic"
    """Interpolation between the samples: linear, or a cubic spline."""
    resample: q.Frequency | None = None
    """Sample rate to which a finely sampled record is reduced; it is low-pass filtered first."""
    stationary_: bool = Field(default=False, alias="stationary")
    """Whether the record is stationary noise; the results then include RMS values, kurtosis and spectral densities of
    the response. An earthquake or shock is not stationary. False by default."""

    @property
    def stationary(self) -> bool:
        """Whether the record is declared stationary."""
        return self.stationary_

    @property
    def quantity(self) -> Quantity:
        """Quantity of the values: as given, else from the unit, else the default of the place."""
        return self.quantity_ or self._quantity_of_unit or self.level_quantities[0]

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """Itself, or one motion of the base for each of the columns."""
        if self.columns is None:
            return super().items
        return [(("columns", axis), self._one_axis(axis, column)) for axis, column in self.columns.by_direction.items()]

    def _one_axis(self, axis: Any, column: str) -> SampledInput:
        """The motion of the base along or about one axis."""
        turned: dict[str, Any] = {"about": None}
        if axis.startswith("r"):
            turned = {"unit": self.angular_unit, "quantity_": self.quantity_ and _ANGULAR[self.quantity_]}
        return self.model_copy(update={"columns": None, "column": column, "direction": axis, **turned})

    def _check_columns(self) -> None:
        """Refuse keys that contradict columns of several motions of the base."""
        turns = self.columns is not None and any(name.startswith("r") for name in self.columns.by_direction)
        if not turns and self.angular_unit is not None:
            raise InvalidValueError("is the unit of columns of rotations", "leave it out", ("angular_unit",))
        if not self.on_base:
            raise InvalidValueError("belong to motions of the base", "write applied_to: base, or column", ("columns",))
        for key in ("column", "direction"):
            if getattr(self, key) is not None:
                raise InvalidValueError("is also given by columns", "leave one of the two out", (key,))

    def _check_direction(self) -> None:
        if self.columns is None or not any(name.startswith("r") for name in self.columns.by_direction):
            super()._check_direction()

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem for each direction in which no body can move."""
        yield from super().problems(scenario, path)
        for axis in () if self.columns is None else self.columns.by_direction:
            yield from base_problems(scenario, (*path, "columns", axis), axis, f"moves the base in {axis}, which")

    @property
    def _quantity_of_unit(self) -> Quantity | None:
        of: Any = None if self.unit is None else q.meant(q.LevelType().read(f"1 {self.unit}"))
        return of  # type: ignore[no-any-return]

    def check(self) -> None:
        """Refuse contradictory units, quantities not allowed at the place, and a motion interpolated linearly."""
        try:
            stated = self._quantity_of_unit
        except UnitError as error:
            raise InvalidValueError(error.message, error.remedy, ("unit",)) from None
        if stated is not None and self.quantity_ not in (None, stated):
            raise InvalidValueError(
                f"is a unit of {stated}, but {self.quantity_} is required", "change one of them", ("unit",)
            )
        super().check()
        if self.columns is not None or self.angular_unit is not None:
            self._check_columns()
        if self.quantity in q.INTEGRALS and self.interpolation == "linear":
            raise InvalidValueError(
                f"= linear of the base's {quantity_text(self.quantity)} has corners, where the acceleration is "
                "infinite",
                "use interpolation: cubic, or give the acceleration",
                ("interpolation",),
            )


class PsdPoint(Schema):
    """A point of a power spectral density: its density, or the slope of the line before it."""

    frequency: q.Frequency
    """Frequency; two points at the same frequency make a step."""
    density: q.DensityOfTest | None = None
    """One-sided density: g^2/Hz or (m/s^2)^2/Hz for an acceleration, N^2/Hz for a force."""
    slope: q.DensitySlope | None = None
    """Instead of a density, the slope of the line from the previous point, in dB/oct: 3 dB/oct doubles the density per
    octave; at the first point it is the slope to the next point."""

    def check(self) -> None:
        """Require exactly one of the two."""
        super().check()
        if (self.density is None) == (self.slope is None):
            raise InvalidValueError(
                "needs either density or slope", "give one of the two, for example density: 0.01 g^2/Hz"
            )


def _demand_rising_or_steps(frequency: Sequence[float], path_of: Callable[[int], Path]) -> None:
    """Refuse frequencies, Hz, that fall, or that are equal except at a step inside the list.

    ``path_of`` gives the path of a frequency from its index.
    """
    remedy = "list them from the lowest to the highest; two points at one frequency within the band are a step"
    for k, (before, here) in enumerate(pairwise(frequency), 1):
        again = here == before and (k in (1, len(frequency) - 1) or frequency[k - 2] == here)
        if here < before or again:
            raise InvalidValueError(
                f"= {here:g} Hz is not larger than the one before, {before:g} Hz", remedy, path_of(k)
            )


def density_table(points: Sequence[PsdPoint]) -> tuple[tuple[float, float], ...]:
    """Frequencies, Hz, and densities, SI, of a table that may contain slopes and steps.

    Raises
    ------
    InvalidValueError
        If the frequencies fall, a slope has no neighbouring density, or a density is out of range.
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
    """Factor of the density along a line with a slope in dB/oct over a frequency ratio."""
    exponent = 0.1 * (slope or 0.0) * math.log2(ratio)
    return 10.0**exponent if abs(exponent) < 300.0 else math.inf


class RandomInput(DrivenInput):
    """Gaussian noise with a given power spectral density."""

    kind: Literal["random"] = "random"
    """Random input."""
    psd: Annotated[Annotated[tuple[PsdPoint, ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE]
    """Density over frequency: points, or a file, psd.csv or {file: psd.csv, column: level}; log-log interpolation
    between the points, zero outside."""
    clip: q.Sigmas | None = None
    """Largest magnitude of the noise in standard deviations, as a controller clips its drive signal: 3 sigma; not
    clipped by default."""
    seed: q.Seed = 0
    """Seed of the random numbers: the same seed gives the same input. 0 by default; in a list of excitations each has a
    seed of its own by default, so that all are independent. Also a weighted sum of the inputs of several seeds with
    random amplitudes, 0.8*4 + 0.6*7, as studies of reliability report it; its coherence with an input of seed 4 is
    0.64."""
    phase: q.Phase = 0.0
    """Phase of all sines: between two inputs of a list with one seed, which are fully coherent."""
    amplitudes: Literal["fixed", "random"] | None = None
    """Amplitudes of the sines: fixed by the density, or random as in a Gaussian process, so that the RMS varies between
    records. fixed by default, random in a study over seeds."""
    period: q.Duration | None = None
    """Period of the noise, which is a sum of sines; by default the duration of the run. It may be longer than the
    run."""
    sample_rate: q.Frequency | None = None
    """Sample rate for the interpolation; by default 20 times the highest frequency."""
    ramp: q.Time = 0.0
    """Time over which the level rises at the start."""

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
        """Refuse a sample rate that is too low for the highest frequency of the density, Hz.

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
        """Frequencies, Hz, and densities, SI, of the points; empty if the density is in a file."""
        return () if isinstance(self.psd, CurveFile) else density_table(self.psd)

    stationary: ClassVar[bool] = True
    """True: the noise is stationary."""

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the table, Hz; 0 for a file (see `beamsim.inputs.measured.highest_excited_hz`)."""
        return 0.0 if isinstance(self.psd, CurveFile) else self.psd[-1].frequency


ShockCurve = Annotated[
    Annotated[tuple[tuple[q.Frequency, q.PositiveAcceleration], ...], AtLeastTwo] | CurveFile, BY_FORM, SHORT_FOR_FILE
]  # fmt: skip


def check_limit_curve(points: tuple[tuple[float, float], ...] | CurveFile, path: Path) -> None:
    """Refuse points of a limit curve whose frequencies fall, except at a step; a file is not read."""
    if not isinstance(points, CurveFile):
        _demand_rising_or_steps([f for f, _ in points], lambda k: (*path, k, 0))


class MatchedInput(DrivenInput):
    """A base acceleration with a given shock response spectrum."""

    kind: Literal["matched"] = "matched"
    """A synthetic record for a shock response spectrum."""
    srs: ShockCurve
    """Maximax absolute acceleration over natural frequency: pairs, [[100 Hz, 20 g], [2 kHz, 500 g]], or a CSV file,
    curve.csv or {file: curve.csv, column: level}; log-log interpolation between the points."""
    quality: q.Quality = 10.0
    """Quality factor Q = 1 / (2 damping ratio) of the oscillators of the spectrum; above 0.5."""
    duration: q.Duration
    """Duration of the record, at least 1.5 periods of the lowest frequency; it begins and ends at rest."""
    seed: q.RandomSeed = 0
    """Seed of the times and signs of the wavelets: the same seed gives the same record. 0 by default; in a list of
    excitations each has a seed of its own by default."""

    shock: ClassVar[bool] = True
    """True: a free motion follows it."""

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the curve, Hz; 0 for a file (see `beamsim.inputs.measured.highest_excited_hz`)."""
        return 0.0 if isinstance(self.srs, CurveFile) else self.srs[-1][0]

    def check(self) -> None:
        """Refuse an invalid curve, and anything but a translational acceleration of the base."""
        super().check()
        if not isinstance(self.srs, CurveFile):  # no record has a spectrum with a step
            demand_rising((f for f, _ in self.srs), "Hz", lambda k: ("srs", k, 0))
        if not self.on_base or self.rotates or self.quantity != "acceleration":
            raise InvalidValueError("is an acceleration of the base along a direction",
                        "write applied_to: base, without quantity or rotation", ("kind",))  # fmt: skip

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """A problem if the run ends before the record."""
        yield from super().problems(scenario, path)
        run = scenario.run
        if path[0] == "excitation" and run is not None and run.duration < self.duration * (1 - 1e-9):
            message = f"= {run.duration:g} s ends before the matched record, of {self.duration:g} s"
            yield problem(("run", "duration"), message, "run longer: the motion after the record counts too")


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


def _with_own_seed(index: int, excitation: Any) -> Any:
    """An input of a list that needs a seed and has none, with one that no user can write; others stay as they are."""
    if index == 0 or not isinstance(excitation, RandomInput | MatchedInput) or "seed" in excitation.model_fields_set:
        return excitation
    return excitation.model_copy(update={"seed": q.LARGEST_SEED + index})


class Forces(Input):
    """Several forces and motions at once, each with its own signal."""

    kind: Literal["forces"] = "forces"
    """Several forces and motions."""
    forces: Annotated[tuple[Annotated[SingleExcitation, BY_FORM], ...], Field(min_length=1)]
    """The excitations: harmonic, multi_tone, step, half_sine, trapezoid, sawtooth, swept_sine, sampled, random or
    matched, each applied to the base in a direction, a point, a line of a beam, an area of a plate, a moving support or
    a moving stop; several motions of the base add up."""

    @property
    def items(self) -> list[tuple[Path, Any]]:
        """The forces and motions; random ones without a seed have one of their own."""
        forces = enumerate(_with_own_seed(index, force) for index, force in enumerate(self.forces))
        return [(("forces", index, *at), item) for index, force in forces for at, item in force.items]

    def find_warnings(self, scenario: Whole, path: Path) -> Iterator[str]:
        """Warnings about random inputs that are coherent because they have one seed."""
        yield from super().find_warnings(scenario, path)
        first: dict[int | str, int] = {}
        forces = [_with_own_seed(index, force) for index, force in enumerate(self.forces)]
        for index, each in enumerate(forces):
            if isinstance(each, RandomInput) and (known := first.setdefault(each.seed, index)) != index:
                other = forces[known]
                same = each.period == other.period and each.highest_frequency_hz == other.highest_frequency_hz
                effect = "so that both are fully coherent"
                if not same and each.amplitudes == "random":
                    effect = "but not its period and highest frequency, so that they are partly coherent"
                at = path_text((*path, "forces", index, "seed"))
                remedy = "give another seed for independent inputs"
                yield f"{at} = {each.seed} is that of forces[{known}], {effect}; {remedy}"

    @property
    def harmonics(self) -> tuple[Harmonic, ...]:
        """The excitations that are sines."""
        return tuple(force for force in self.forces if isinstance(force, Harmonic))

    # For sweeps: the level of the sweep multiplies all forces; each keeps its own phase.
    level: ClassVar[float] = 1.0
    phase: ClassVar[float] = 0.0
    quantity: ClassVar[str] = q.FACTOR
    level_quantities: ClassVar[tuple[str, ...]] = (q.FACTOR,)

    @property
    def on_base(self) -> bool:
        """Whether the only one moves the base."""
        return len(self.forces) == 1 and self.forces[0].on_base

    def problems(self, scenario: Whole, path: Path) -> Problems:
        """Problems of motions of the base that a swept sine cannot follow: it sweeps one acceleration."""
        swept = getattr(scenario.sweep, "kind", "") == "swept_sine" and any(force.on_base for force in self.forces)
        remedy = "use sweep.kind: stepped or continuation"
        for index, force in enumerate(self.forces if swept else ()):
            if not force.on_base:
                message = "is not the base, which a swept sine moves at the same time"
                yield problem((*path, "forces", index, "applied_to"), message, remedy)
            elif force.quantity not in ("acceleration", "angular_acceleration"):
                message = f"is {_with_article(force.quantity)}, but a swept sine moves the base by accelerations"
                yield problem((*path, "forces", index, "level"), message, remedy)
            elif isinstance(force, Harmonic) and abs(math.sin(force.phase)) > 1e-12:
                message = f"= {force.phase:g} rad is neither 0 nor 180 deg, which a swept sine needs"
                yield problem((*path, "forces", index, "phase"), message, remedy)

    @property
    def frequency(self) -> float:
        """Frequency of the sines, Hz."""
        return self.harmonics[0].frequency

    def at(self, frequency_hz: float, level: float | None = None) -> Forces:
        """A copy with another frequency, Hz, and with all levels multiplied by ``level``."""
        factor = 1.0 if level is None else level
        forces = tuple(force.at(frequency_hz, factor * force.level) for force in self.harmonics)
        return self.model_copy(update={"forces": forces})

    def problems_of_sines(self, section: str) -> Problems:
        """Problems of inputs that a section cannot sweep: not a sine, a second frequency."""
        frequency = self.harmonics[0].frequency if self.harmonics else 0.0
        for index, force in enumerate(self.forces):
            at = ("excitation", "forces", index)
            if not isinstance(force, Harmonic):
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
        """Whether all of them start at a certain time and are followed by a free motion."""
        return all(force.shock for force in self.forces)

    @property
    def stationary(self) -> bool:
        """Whether they contain stationary noise and otherwise at most sines."""
        noise = [force for force in self.forces if not isinstance(force, Harmonic | MultiTone)]
        return bool(noise) and all(force.stationary for force in noise)

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of all sines, Hz, each once."""
        return tuple(dict.fromkeys(f for force in self.forces for f in force.frequencies_hz))

    @property
    def highest_frequency_hz(self) -> float:
        """The highest of all frequencies, Hz."""
        return max(force.highest_frequency_hz for force in self.forces)


Excitation = Annotated[NoExcitation | SingleExcitation | Forces, BY_FORM]


Sine = Harmonic | Forces
"""Excitations that sweeps and continuations can follow; see `sine_problems`."""


def sine_problems(excitation: Any, section: str) -> Problems:
    """Problems if a section (a sweep or continuation) cannot follow an excitation."""
    if isinstance(excitation, Forces):
        yield from excitation.problems_of_sines(section)
    elif not isinstance(excitation, Harmonic):
        yield not_harmonic((section,), "the frequency of a harmonic excitation", excitation)


def not_harmonic(path: Path, needed_excitation: str, excitation: Any) -> Problem:
    """The problem of a section that needs another excitation."""
    remedy = "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}"
    return problem(path, f"needs {needed_excitation}, but this one is {excitation.kind}", remedy)
