"""Excitation of the structure: motion of its base, or forces at points and along lines and areas."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario.base import BY_KIND, Path, Schema, fail, path_text
from beamsim.scenario.broadband import RandomInput, SampledInput, SweptSineInput
from beamsim.scenario.driven import Driven, spoken
from beamsim.scenario.quantities import FACTOR, INTEGRALS, Angle, Duration, Frequency, Level, LevelValue, Time


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


class Harmonic(Driven):
    """A sin(2 pi f t + phase)."""

    kind: Literal["harmonic"] = "harmonic"
    """A sine."""
    level: Level
    """Amplitude, zero to peak; a bare number is m/s^2 on the base, N at a point."""
    frequency: Frequency
    """Frequency."""
    phase: Angle = 0.0
    """Phase of the sine at t = 0."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequency, Hz."""
        return (self.frequency,)

    def at(self, frequency_hz: float, level: float | None = None) -> Harmonic:
        """The same at another frequency, Hz, and level."""
        changed = {"frequency": frequency_hz} | ({} if level is None else {"level": level})
        return self.model_copy(update=changed)


class Tone(Schema):
    """One sine of a multi-tone excitation."""

    level: Level
    """Amplitude, zero to peak."""
    frequency: Frequency
    """Frequency."""
    phase: Angle = 0.0
    """Phase of the sine at t = 0."""


class MultiTone(Driven):
    """A sum of sines."""

    kind: Literal["multi_tone"] = "multi_tone"
    """A sum of sines."""
    tones: Annotated[tuple[Tone, ...], Field(min_length=1)]
    """The sines."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the levels with their paths."""
        return [(("tones", index, "level"), tone.level) for index, tone in enumerate(self.tones)]

    def plain_levels(self) -> None:
        """Forget the units of the levels."""
        self.resolve("tones", tuple(tone.model_copy(update={"level": float(tone.level)}) for tone in self.tones))

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """The frequencies, Hz."""
        return tuple(tone.frequency for tone in self.tones)


class Shock(Driven):
    """Common part of what begins at ``time`` with one level; a pulse of duration T goes up to 1 / (2 T)."""

    shock: ClassVar[bool] = True

    if TYPE_CHECKING:
        level: float
        time: float

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]


class Step(Shock):
    """Zero before `time`, `level` after it; with a duration a rectangular pulse."""

    kind: Literal["step"] = "step"
    """A step, or a rectangular pulse."""
    level: Level
    """Value after the step; for the base only an acceleration."""
    time: Time = 0.0
    """When it steps."""
    duration: Duration | None = None
    """Duration of a rectangular pulse; by default the level stays."""

    def settle(self) -> None:
        """Reject steps that need an infinite acceleration."""
        super().settle()
        if self.quantity in INTEGRALS:
            raise fail(
                f"is a step of the base's {spoken(self.quantity)}, which needs an infinite acceleration",
                "step the acceleration (level: 2 g), or use a half_sine pulse of the base's velocity",
                ("level",),
            )

    @property
    def highest_frequency_hz(self) -> float:
        """Half the inverse of the duration, Hz; 0 of a step."""
        return 0.0 if self.duration is None else 0.5 / self.duration


class Pulse(Shock):
    """Common part of what is zero again after a duration."""

    if TYPE_CHECKING:
        duration: float

    @property
    def highest_frequency_hz(self) -> float:
        """Half the inverse of the duration, Hz: the frequency of the sine that a half-sine is half of."""
        return 0.5 / self.duration


class HalfSine(Pulse):
    """Half a sine period starting at `time`, zero before and after."""

    kind: Literal["half_sine"] = "half_sine"
    """A half-sine pulse."""
    level: Level
    """Peak of the pulse; for the base an acceleration or a velocity."""
    duration: Duration
    """Duration of the pulse."""
    time: Time = 0.0
    """Start of the pulse."""

    def settle(self) -> None:
        """Reject pulses that need an infinite acceleration."""
        super().settle()
        _refuse_displacement(self, "half-sine")


class Trapezoid(Pulse):
    """A pulse that rises and falls linearly, zero before and after."""

    kind: Literal["trapezoid"] = "trapezoid"
    """A trapezoidal pulse."""
    level: Level
    """Peak of the pulse; for the base an acceleration or a velocity."""
    duration: Duration
    """Duration of the pulse, rise and fall included."""
    rise: Duration | None = None
    """Duration of the rise; by default a tenth of that of the pulse (IEC 60068-2-27)."""
    fall: Duration | None = None
    """Duration of the fall; by default a tenth of that of the pulse."""
    time: Time = 0.0
    """Start of the pulse."""

    def settle(self) -> None:
        """Settle rise and fall; reject those longer than the pulse, and pulses that need an infinite acceleration."""
        super().settle()
        _refuse_displacement(self, "trapezoidal")
        for name in ("rise", "fall"):
            if getattr(self, name) is None:
                self.resolve(name, 0.1 * self.duration)
        assert self.rise is not None
        assert self.fall is not None
        if self.rise + self.fall > self.duration * (1 + 1e-12):
            raise fail(
                f"= {self.rise:g} s and fall = {self.fall:g} s are longer than the pulse of {self.duration:g} s",
                "shorten them, or give a longer duration",
                ("rise",),
            )


class Sawtooth(Pulse):
    """A pulse that rises linearly and drops from its peak at once (final peak, IEC 60068-2-27)."""

    kind: Literal["sawtooth"] = "sawtooth"
    """A final-peak sawtooth pulse."""
    level: Level
    """Peak of the pulse; for the base only an acceleration."""
    duration: Duration
    """Duration of the pulse."""
    time: Time = 0.0
    """Start of the pulse."""

    def settle(self) -> None:
        """Reject pulses that need an infinite acceleration."""
        super().settle()
        if self.quantity in INTEGRALS:
            raise fail(
                f"is a sawtooth of the base's {spoken(self.quantity)}, whose drop needs an infinite acceleration",
                "give the pulse as acceleration (level: 20 g)",
                ("level",),
            )


def _refuse_displacement(pulse: Shock, called: str) -> None:
    if INTEGRALS.get(str(pulse.quantity)) == 2:
        raise fail(
            f"is a {called} pulse of the base's {pulse.quantity}, whose velocity jumps: an infinite acceleration",
            "give the pulse as acceleration (level: 20 g) or velocity (level: 0.5 m/s)",
            ("level",),
        )


OneForce = Annotated[Harmonic | MultiTone | Step | HalfSine | Trapezoid | Sawtooth, BY_KIND]


class Forces(Schema):
    """Several forces, each with its own signal."""

    kind: Literal["forces"] = "forces"
    """Several forces."""
    forces: Annotated[tuple[OneForce, ...], Field(min_length=1)]
    """The forces: each a harmonic, multi_tone, step, half_sine, trapezoid or sawtooth excitation that is applied to a
    point, a line of a beam, an area of a plate, or a support that moves."""

    def settle(self) -> None:
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
    quantity: ClassVar[str] = FACTOR
    takes: ClassVar[tuple[str, ...]] = (FACTOR,)
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
    BY_KIND,
]


def level_problems(excitation: Excitation, path: Path, level: float | None) -> Iterator[Problem]:
    """A level elsewhere in the scenario in a unit of another quantity than the excitation's."""
    quantity = getattr(excitation, "quantity", None)
    if isinstance(level, LevelValue) and level.quantity not in (None, quantity):
        yield Problem(
            path_text(path),
            f"is given in a unit of {level.quantity}, and the excitation's level is of {quantity}"
            if quantity != FACTOR
            else f"is given in a unit of {level.quantity}, but multiplies the levels of all forces",
            "give it in the unit of excitation.level" if quantity != FACTOR else "give a plain number: 0.5",
        )
