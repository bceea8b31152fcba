"""What drives the structure: the motion of its base or a force at a point."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, by_key, fail
from beamsim.scenario.place import AtMass, AtPosition, choose_place
from beamsim.scenario.quantities import Angle, Duration, Frequency, Level, LevelValue, Time

__all__ = [
    "AppliedTo",
    "Excitation",
    "HalfSine",
    "Harmonic",
    "MultiTone",
    "NoExcitation",
    "Quantity",
    "Step",
    "Tone",
    "agree_on_quantity",
]

Quantity = Literal["acceleration", "velocity", "displacement", "force"]


def _choose_target(value: Any) -> str | None:
    return "<base>" if value == "base" else choose_place(value)


AppliedTo = Annotated[
    Annotated[Literal["base"], Tag("<base>")]
    | Annotated[AtPosition, Tag("<position>")]
    | Annotated[AtMass, Tag("<mass>")],
    by_key(
        _choose_target,
        "names neither the base nor a point",
        "write base, {position: 270 mm} for a force on the beam, or {mass: 2} for a force on a chain",
    ),
]


def agree_on_quantity(
    levels: Sequence[tuple[tuple[str | int, ...], float]], given: str | None, on_base: bool
) -> Quantity:
    """Return what the levels are: as said, else as their units say, else the default of the place.

    Raises what `fail` builds when units, quantity and place contradict each other.
    """
    quantity = given
    for path, level in levels:
        meant = level.quantity if isinstance(level, LevelValue) else None
        if meant is None:
            continue
        if quantity is not None and meant != quantity:
            article = "an" if quantity[0] == "a" else "a"
            raise fail(
                f"is given in a unit of {meant}, where {article} {quantity} is meant",
                "give the level in another unit, or set quantity",
                path,
            )
        quantity = meant
    quantity = quantity or ("acceleration" if on_base else "force")
    at = ("quantity",) if given is not None else levels[0][0]
    if on_base and quantity == "force":
        raise fail(
            "is a force, but the base is moved, not pushed",
            "give an acceleration (2 g), velocity (0.2 m/s) or displacement (0.1 mm), "
            "or apply the force to {position: ...} or {mass: ...}",
            at,
        )
    if not on_base and quantity != "force":
        raise fail(
            f"is {'an' if quantity[0] == 'a' else 'a'} {quantity}, but a point is pushed by a force",
            "give a force (1.5 N), or apply it to base",
            at,
        )
    return quantity  # type: ignore[return-value]


class NoExcitation(Schema):
    """Free motion."""

    kind: Literal["none"] = "none"
    """No excitation."""

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones: none."""
        return ()

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency the excitation has to say something at: 0."""
        return 0.0


class _Driven(Schema):
    """What all excitations share."""

    applied_to: AppliedTo
    """Base, a position of the beam, or a mass of the chain."""
    quantity: Quantity | None = None
    """Acceleration, velocity or displacement of the base, force at a point; as the unit of the level says."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the levels with their paths."""
        raise NotImplementedError

    def plain_levels(self) -> None:
        """Forget the units of the levels once `quantity` holds what they said."""
        self.resolve("level", float(self.levels()[0][1]))

    def settle(self) -> None:
        """Settle what the level is."""
        self.resolve("quantity", agree_on_quantity(self.levels(), self.quantity, self.on_base))
        self.plain_levels()

    @property
    def on_base(self) -> bool:
        """Whether the base moves (else a point is pushed)."""
        return self.applied_to == "base"

    @property
    def frequencies_hz(self) -> tuple[float, ...]:
        """Frequencies of the tones, Hz."""
        return ()

    @property
    def highest_frequency_hz(self) -> float:
        """Highest frequency the excitation has to say something at, Hz; a pulse of duration T counts as 1/(2 T)."""
        return max(self.frequencies_hz, default=0.0)


class Harmonic(_Driven):
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


class Tone(Schema):
    """One sine of a multi-tone excitation."""

    level: Level
    """Amplitude, zero to peak."""
    frequency: Frequency
    """Frequency."""
    phase: Angle = 0.0
    """Phase of the sine at t = 0."""


class MultiTone(_Driven):
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


class Step(_Driven):
    """Zero before `time`, `level` after it."""

    kind: Literal["step"] = "step"
    """A step."""
    level: Level
    """Value after the step; of the base only an acceleration."""
    time: Time = 0.0
    """When it steps."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]

    def settle(self) -> None:
        """Refuse steps that need an infinite acceleration."""
        super().settle()
        if self.quantity in ("velocity", "displacement"):
            raise fail(
                f"is a step of the base's {self.quantity}, which needs an infinite acceleration",
                "step the acceleration (level: 2 g), or use a half_sine pulse of the base's velocity",
                ("level",),
            )


class HalfSine(_Driven):
    """Half a period of a sine from `time` on, zero before and after."""

    kind: Literal["half_sine"] = "half_sine"
    """A half-sine pulse."""
    level: Level
    """Peak of the pulse; of the base an acceleration or a velocity."""
    duration: Duration
    """Length of the pulse."""
    time: Time = 0.0
    """When it begins."""

    def levels(self) -> list[tuple[tuple[str | int, ...], float]]:
        """Return the level with its path."""
        return [(("level",), self.level)]

    def settle(self) -> None:
        """Refuse pulses that need an infinite acceleration."""
        super().settle()
        if self.quantity == "displacement":
            raise fail(
                "is a half-sine pulse of the base's displacement, whose velocity jumps: an infinite acceleration",
                "give the pulse as acceleration (level: 20 g) or velocity (level: 0.5 m/s)",
                ("level",),
            )

    @property
    def highest_frequency_hz(self) -> float:
        """Frequency of the sine the pulse is half of, Hz."""
        return 0.5 / self.duration


Excitation = Annotated[
    Annotated[NoExcitation, Tag("<none>")]
    | Annotated[Harmonic, Tag("<harmonic>")]
    | Annotated[MultiTone, Tag("<multi_tone>")]
    | Annotated[Step, Tag("<step>")]
    | Annotated[HalfSine, Tag("<half_sine>")],
    BY_KIND,
]
