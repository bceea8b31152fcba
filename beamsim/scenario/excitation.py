"""Excitation of the structure: motion of its base, or forces at points and along lines and areas."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario import quantities as q
from beamsim.scenario.base import BY_FORM, Path, Schema, fail
from beamsim.scenario.driven import (
    Between,
    Driven,
    FrequencyRange,
    Notch,
    ProfilePoint,
    Quantity,
    check_profile,
    not_taken,
    spoken,
)
from beamsim.scenario.quantities import meant
from beamsim.scenario.units import UnitError


class NoExcitation(Schema):
    """Free motion."""

    shock: ClassVar[bool] = False

    kind: Literal["none"] = "none"
    """No excitation."""

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones: none."""
        return ()

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency of the excitation: 0."""
        return 0.0


class Tone(Schema):
    """One sine of a multi-tone excitation."""

    level: q.Level
    """Amplitude, zero to peak; a bare number is m/s^2 on the base, N at a point."""
    frequency: q.Frequency
    """Frequency."""
    phase: q.Angle = 0.0
    """Phase of the sine at t = 0."""


class Harmonic(Driven, Tone):
    """A sin(2 pi f t + phase)."""

    kind: Literal["harmonic"] = "harmonic"
    """A sine."""

    def levels(self) -> list[tuple[Path, float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequency, Hz."""
        return (self.frequency,)

    def at(self, frequency_hz: float, level: float | None = None) -> Harmonic:
        """The same at another frequency, Hz, and level."""
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

    shock: ClassVar[bool] = True
    most_integrals: ClassVar[int] = 0
    """How often its level may be integrated from an acceleration of the base without jumps of the velocity."""

    if TYPE_CHECKING:
        kind: Any
        duration: float | None

    level: q.Level
    """Level after a step, or peak of the pulse; of the base an acceleration, of smooth pulses also a velocity."""
    time: q.Time = 0.0
    """When it begins."""

    def levels(self) -> list[tuple[Path, float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]

    @property
    def highest_frequency_hz(self) -> float:
        """Half the inverse of the duration, Hz, the frequency of the sine that a half-sine is half of; 0 of a step."""
        return 0.0 if self.duration is None else 0.5 / self.duration

    def check(self) -> None:
        """Reject what needs an infinite acceleration."""
        super().check()
        if q.INTEGRALS.get(self.quantity, 0) > self.most_integrals:
            called = self.kind.replace("_", "-") + " pulse" * (self.kind != "step")
            smooth = (
                " or velocity (level: 0.5 m/s)" if self.most_integrals else ", or use a half_sine pulse of velocity"
            )
            raise fail(
                f"is a {called} of the base's {spoken(self.quantity)}, which needs an infinite acceleration",
                f"give it as acceleration (level: 20 g){smooth}",
                ("level",),
            )


class Step(Shock):
    """Zero before `time`, `level` after it; with a duration a rectangular pulse."""

    kind: Literal["step"] = "step"
    """A step, or a rectangular pulse."""
    duration: q.Duration | None = None
    """Duration of a rectangular pulse; by default the level stays."""


class HalfSine(Shock):
    """Half a sine period starting at `time`, zero before and after."""

    most_integrals: ClassVar[int] = 1

    kind: Literal["half_sine"] = "half_sine"
    """A half-sine pulse."""
    duration: q.Duration
    """Duration of the pulse."""


class Trapezoid(Shock):
    """A pulse that rises and falls linearly, zero before and after."""

    most_integrals: ClassVar[int] = 1

    kind: Literal["trapezoid"] = "trapezoid"
    """A trapezoidal pulse."""
    duration: q.Duration
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

    def check(self) -> None:
        """Reject rise and fall longer than the pulse."""
        super().check()
        if self.rise + self.fall > self.duration * (1 + 1e-12):
            raise fail(
                f"= {self.rise:g} s and fall = {self.fall:g} s are longer than the pulse of {self.duration:g} s",
                "shorten them, or give a longer duration",
                ("rise",),
            )


class Sawtooth(Shock):
    """A pulse that rises linearly and drops from its peak at once (final peak, IEC 60068-2-27)."""

    kind: Literal["sawtooth"] = "sawtooth"
    """A final-peak sawtooth pulse."""
    duration: q.Duration
    """Duration of the pulse."""


OneForce = Annotated[Harmonic | MultiTone | Step | HalfSine | Trapezoid | Sawtooth, BY_FORM]


class Forces(Schema):
    """Several forces, each with its own signal."""

    kind: Literal["forces"] = "forces"
    """Several forces."""
    forces: Annotated[tuple[OneForce, ...], Field(min_length=1)]
    """The forces: each a harmonic, multi_tone, step, half_sine, trapezoid or sawtooth excitation that is applied to a
    point, a line of a beam, an area of a plate, or a support that moves."""

    def check(self) -> None:
        """Reject what moves the base."""
        for index, force in enumerate(self.forces):
            if force.on_base:
                raise fail(
                    "is the base, where forces are listed",
                    "apply it to {position: 270 mm}, {mass: 2}, {line: whole} or {area: whole}; base motion is an "
                    "excitation by itself",
                    ("forces", index, "applied_to"),
                )

    @property
    def harmonics(self) -> tuple[Harmonic, ...]:
        """Those that are sines."""
        return tuple(force for force in self.forces if isinstance(force, Harmonic))

    # What a sweep asks a harmonic excitation: its levels multiply all forces, each of which keeps its own phase.
    level: ClassVar[float] = 1.0
    phase: ClassVar[float] = 0.0
    quantity: ClassVar[str] = q.FACTOR
    takes: ClassVar[tuple[str, ...]] = (q.FACTOR,)
    on_base: ClassVar[bool] = False

    @property
    def frequency(self) -> float:
        """That of the sines, Hz."""
        return self.harmonics[0].frequency

    def at(self, frequency_hz: float, level: float | None = None) -> Forces:
        """The sines at another frequency, Hz, with their levels multiplied by ``level``."""
        factor = 1.0 if level is None else level
        forces = tuple(force.at(frequency_hz, factor * force.level) for force in self.harmonics)
        return self.model_copy(update={"forces": forces})

    @property
    def shock(self) -> bool:
        """Whether all of them begin at a time and leave a free motion."""
        return all(force.shock for force in self.forces)

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of all tones, Hz, each once."""
        return tuple(dict.fromkeys(f for force in self.forces for f in force.frequencies_hz))

    @property
    def highest_frequency_hz(self) -> float:
        """The highest of all, Hz."""
        return max(force.highest_frequency_hz for force in self.forces)


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
    phase: q.Angle = 0.0
    """Phase of the sine at t = 0."""

    def levels(self) -> list[tuple[Path, float]]:
        """Return the level with its path."""
        return [] if self.level is None else [(("level",), self.level)]

    def check(self) -> None:
        """Refuse an empty range, no level or two, and levels that cannot act there."""
        if (self.level is None) == (not self.profile):
            raise fail("needs either level or profile", "give one of the two")
        super().check()
        check_profile(self.profile, self.between)
        for index, point in enumerate(self.profile):
            if point.quantity is not None and point.quantity not in self.takes:
                why, remedy = not_taken(point.quantity, self.takes)
                raise fail(f"is {why}", remedy, ("profile", index, "level"))

    @property
    def highest_frequency_hz(self) -> float:
        """The higher end of the sweep, Hz."""
        return max(self.from_, self.to)


class SampledInput(Driven):
    """A measured motion of the base, or force."""

    kind: Literal["sampled"] = "sampled"
    """Samples read from a file."""
    file: q.FileName
    """CSV, HDF5 (.h5, .hdf5) or UFF 58 (.uff, .unv) file; its path is relative to the folder of the scenario."""
    column: q.Text | None = None
    """CSV: number (from 1) or heading of the column of values; HDF5: path of the dataset; UFF: number of the set."""
    time_column: q.Text | None = None
    """CSV: number or heading of the time column, by default the first; HDF5: path of the time dataset."""
    sample_rate: q.Frequency | None = None
    """Samples per second, if the file has no time axis."""
    unit: q.Text | None = None
    """Unit of the values in the file (g, mm, N, ...), by default the one that the file states."""
    time_unit: q.Text | None = None
    """Unit of the time axis in the file (s, ms, ...), by default the one that the file states."""
    factor: q.PositiveNumber = 1.0
    """Factor by which the values are multiplied."""
    interpolation: Literal["linear", "cubic"] = "cubic"
    """Interpolation between the samples: linear, or a cubic spline."""
    resample: q.Frequency | None = None
    """Rate to which the samples are first resampled, if they are too fine for the run."""

    @property
    def quantity(self) -> Quantity:
        """What the values are: as stated, otherwise as the unit says, otherwise the default of the place."""
        return self.quantity_ or self._said_by_unit or self.takes[0]

    @property
    def _said_by_unit(self) -> Quantity | None:
        of: Any = None if self.unit is None else meant(q.LevelType().read(f"1 {self.unit}"))
        return of  # type: ignore[no-any-return]

    def check(self) -> None:
        """Refuse a unit of another quantity, what cannot act there, and corners of a motion."""
        try:
            said = self._said_by_unit
        except UnitError as error:
            raise fail(error.message, error.remedy, ("unit",)) from None
        if said is not None and self.quantity_ not in (None, said):
            raise fail(f"is a unit of {said}, where {self.quantity_} is meant", "change one of them", ("unit",))
        super().check()
        if self.quantity in q.INTEGRALS and self.interpolation == "linear":
            raise fail(
                f"= linear of the base's {spoken(self.quantity)} has corners, where the acceleration is infinite",
                "use interpolation: cubic, or give the acceleration",
                ("interpolation",),
            )


class PsdPoint(Schema):
    """A point in a table of power spectral density."""

    frequency: q.Frequency
    """Frequency."""
    density: q.SpectralDensity
    """One-sided density: g^2/Hz for an acceleration, N^2/Hz for a force."""


class RandomInput(Driven):
    """Gaussian noise with a given power spectral density."""

    kind: Literal["random"] = "random"
    """Random input."""
    psd: Annotated[tuple[PsdPoint, ...], Field(min_length=2)]
    """Density over frequency; log-log interpolation between the points, zero outside."""
    seed: q.NotNegativeWhole = 0
    """Seed of the random numbers: the same seed gives the same input."""
    amplitudes: Literal["fixed", "random"] | None = None
    """Amplitudes of the sines: fixed by the density, or random as those of a Gaussian process, whose RMS scatters
    between records. By default fixed, but random in a study over seeds."""
    period: q.Duration | None = None
    """The noise is a sum of sines that repeats after this time; the run's duration by default."""
    sample_rate: q.Frequency | None = None
    """Sample rate used for interpolation; by default 20 times the highest frequency."""
    ramp: q.Time = 0.0
    """Time over which the level rises at the beginning."""

    def check(self) -> None:
        """Check the table."""
        super().check()
        for index, (one, two) in enumerate(pairwise(self.psd)):
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
        if self.quantity != self.takes[0]:
            raise fail(f"must be {spoken(self.takes[0])}", "leave it out", ("quantity",))

    @property
    def highest_frequency_hz(self) -> float:
        """End of the table, Hz."""
        return self.psd[-1].frequency


Excitation = Annotated[
    NoExcitation
    | Harmonic
    | MultiTone
    | Step
    | HalfSine
    | Trapezoid
    | Sawtooth
    | SweptSineInput
    | SampledInput
    | RandomInput
    | Forces,
    BY_FORM,
]


Sine = Harmonic | Forces
"""What sweeps and continuations follow; see `sine_problems`."""


def sine_problems(excitation: Any, section: str) -> Iterator[Problem]:
    """Why a sweep or continuation, a section of the scenario, cannot follow an excitation."""
    if isinstance(excitation, Forces):
        frequency = excitation.harmonics[0].frequency if excitation.harmonics else 0.0
        for index, force in enumerate(excitation.forces):
            at = f"excitation.forces[{index}]"
            if not isinstance(force, Harmonic):
                yield Problem(
                    f"{at}.kind", f"= {force.kind} has no frequency that {section} could change",
                    "make it harmonic, or leave it out",
                )  # fmt: skip
            elif force.frequency != frequency:
                yield Problem(
                    f"{at}.frequency", f"= {force.frequency:g} Hz, and another force has {frequency:g} Hz",
                    f"give all forces one frequency, which {section} changes",
                )  # fmt: skip
    elif not isinstance(excitation, Harmonic):
        yield Problem(
            section,
            f"needs the frequency of a harmonic excitation, but this one is {excitation.kind}",
            "give excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}",
        )
