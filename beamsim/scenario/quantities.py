"""Field types: numbers that accept a unit, with their bounds and their JSON Schema."""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from beamsim.scenario import units
from beamsim.scenario.base import Schema, nested_annotations
from beamsim.scenario.units import Dimension, UnitError

LARGEST_COUNT = 10**9
"""Largest allowed number of anything without another limit."""
LARGEST_SEED = 10**15


class FieldType:
    """A field type with its own reading function and messages."""

    form: ClassVar[str] = "<number>"
    """Form by which `beamsim.scenario.base.Variants` recognises it."""

    @property
    def example(self) -> str:
        """An example of a value; empty if any text is valid."""
        return ""

    def read(self, value: Any) -> Any:
        """Convert to the stored value; raises `UnitError`."""
        raise NotImplementedError

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema of the accepted values."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return self.json_schema()


_EXAMPLES = {
    "m": {
        "width": "50 mm", "thickness": "5 mm", "diameter": "20 mm", "outer_diameter": "20 mm", "wall_thickness": "2 mm",
        "web_thickness": "3 mm", "flange_thickness": "4 mm", "extreme_fibre": "6 mm", "height": "20 mm",
        "gap": "0.1 mm", "peak_displacement": "1 mm", "rms_displacement": "1 mm", "side": "30 mm", "y": "100 mm",
        "displacement": "1 mm",
    },
    "s": {
        "rise": "0.5 ms", "fall": "0.5 ms", "minimum_rest": "1 ms", "longest_time": "1 s", "period": "0.1 s",
        "relaxation_time": "40 ms", "time": "5 ms", "test_duration": "2 min",
    },
    "Hz": {
        "sample_rate": "20 kHz", "history_rate": "1 kHz", "resample": "2 kHz", "low_pass": "2 kHz",
        "highest_frequency": "2 kHz",
    },
    "N": {"preload": "5 N", "peak_force": "50 N", "force_threshold": "1 N"},
}  # fmt: skip
"""Examples for certain keys, by SI unit, where the general example would mislead."""


def example_of(key: str, unit: str) -> str | None:
    """An example for a key, by its SI unit; None if the general example of its dimension is suitable.

    >>> example_of("wall_thickness", "m")
    '2 mm'
    """
    return _EXAMPLES.get(unit, {}).get(key)


NUMBER_WITH_UNIT: JsonSchemaValue = {"type": "string", "pattern": r"^\s*[+-]?(\d|\.\d)"}


@dataclass(frozen=True, kw_only=True)
class Bounded(FieldType):
    """A number with bounds."""

    minimum: float | None = None
    above: float | None = None
    maximum: float | None = None
    below: float | None = None

    def check_bounds(self, number: float) -> float:
        """Return a number if it is within the bounds."""
        low = self.above if self.minimum is None else self.minimum
        high = self.below if self.maximum is None else self.maximum
        inside = (low is None or number > low or number == self.minimum) and (
            high is None or number < high or number == self.maximum
        )
        if not inside:
            raise UnitError(f"must {self._bounds_text(low, high)}", f"write for example {self.example}")
        return number + 0.0  # -0.0 becomes 0.0

    def _bounds_text(self, low: float | None, high: float | None) -> str:
        """The condition on a number between two bounds, as text; one bound may be missing."""
        if high is None:
            bound = f"{low:g} or more" if self.above is None else f"above {low:g}"
            return {"0 or more": "not be negative", "above 0": "be positive"}.get(bound, f"be {bound}")
        if self.above is None:
            return f"be from {low:g} to {high:g}"
        return f"be above {low:g} and {'at most' if self.below is None else 'below'} {high:g}"

    @property
    def range(self) -> tuple[float, float]:
        """Smallest (except zero) and largest magnitude of a number."""
        raise NotImplementedError

    @property
    def bounds_schema(self) -> JsonSchemaValue:
        """JSON Schema of the bounds, those of the field and of the dimension combined."""
        smallest, largest = self.range
        bounds = {"minimum": -largest, "maximum": largest}
        if self.above is not None and self.above >= 0.0:
            bounds["minimum"] = smallest
        if self.minimum is not None:
            bounds["minimum"] = self.minimum
        elif self.above is not None and self.above != 0.0:
            bounds["exclusiveMinimum"] = self.above
            del bounds["minimum"]
        if self.maximum is not None:
            bounds["maximum"] = min(self.maximum, largest)
        elif self.below is not None:
            bounds["exclusiveMaximum"] = self.below
            del bounds["maximum"]
        return {"type": "number"} | bounds


@dataclass(frozen=True)
class Quantity(Bounded):
    """A number in SI units, or a text with a unit."""

    dimension: Dimension

    @property
    def example(self) -> str:
        """An example of a value."""
        return self.dimension.example

    @property
    def range(self) -> tuple[float, float]:
        """Range of magnitudes of the dimension."""
        return self.dimension.smallest, self.dimension.largest

    def read(self, value: Any) -> float:
        """Convert to the SI number."""
        number, _ = units.read_level(value, (self.dimension,), any_size=True)
        return units.in_range(
            self.check_bounds(number), (self.dimension,), f"write for example {self.dimension.example}"
        )

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a number or text, with the SI unit under ``x-unit``."""
        schema: JsonSchemaValue = {
            "anyOf": [self.bounds_schema, NUMBER_WITH_UNIT], "examples": [self.dimension.example]
        }  # fmt: skip
        if self.dimension.unit:
            schema["x-unit"] = self.dimension.unit
        return schema


@dataclass(frozen=True)
class UsualRange:
    """Usual range of a field's number, and units that a user may have confused.

    A number is questionable if it lies outside its range but would lie inside in another usual unit: a filter of 2 Hz
    for a sine of 65 Hz, where 2 kHz would be usual. It is accepted silently if its written unit makes it clear: 0.002
    kHz, 120 rpm. Ranges extend about thirty times beyond plausible values. A question refuses no case, changes no exit
    code and stops no study.
    """

    dimension: Dimension
    units: tuple[str, ...]  # units that may be confused, SI first
    smallest: float  # SI, or relative to the reference size
    largest: float
    text: str  # what is unusual; may contain the ratio to the reference size, and its name
    reference: str = ""  # name of the reference size
    bare_only: bool = False  # whether only a number without a unit is questionable

    def contains(self, value: float, size: float) -> bool:
        """Whether a value lies in the range, which is multiplied by a reference size (both SI)."""
        return self.smallest * size <= value <= self.largest * size

    def question(self, value: float, size: float, written_value: float | str) -> str:
        """A question about a questionable value, with the probable meaning; empty if the value is plausible.

        Parameters
        ----------
        value : SI.
        size : reference size that multiplies the range, SI.
        written_value : the value as the user wrote it.
        """
        number, unit = units.number_and_unit(written_value)
        sizes = [units.size_of(name, self.dimension) for name in self.units]
        if unit and (self.bare_only or not any(math.isclose(number * of, value, rel_tol=1e-12) for of in sizes)):
            return ""
        readings = (
            f"{number:g} {name}" for name, of in zip(self.units, sizes, strict=True) if self.contains(number * of, size)
        )
        meant = next(readings, "" if value != number else "another unit")
        why = self.text.format(ratio=value / size, size=size)
        return meant and f"= {number:g} {unit or self.units[0]} {why}; was {meant} meant?"


QUESTION_END = "meant?"
"""Marks warnings that ask about the unit; they are printed on the first screen."""
METRES = ("m", "mm")


@cache
def usual_of(schema: type[Schema]) -> dict[str, UsualRange]:
    """The fields of a section that have a usual range, by name."""
    metadata = {name: (*of.metadata, *nested_annotations(of.annotation)) for name, of in schema.model_fields.items()}
    return {name: each for name, of in metadata.items() for each in of if isinstance(each, UsualRange)}


@dataclass(frozen=True)
class NonzeroType(Quantity):
    """A number that may have either sign but is not zero."""

    def read(self, value: Any) -> float:
        """Convert to the number."""
        number = super().read(value)
        if number == 0.0:
            raise UnitError("must not be zero", f"write for example {self.example}")
        return number

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a number or text, without zero."""
        return super().json_schema() | {"not": {"const": 0}}


@dataclass(frozen=True)
class SigmasType(Quantity):
    """A number of standard deviations, optionally with the word sigma."""

    def read(self, value: Any) -> float:
        """Convert to the number."""
        if isinstance(value, str):
            value = re.sub(r"\s*(sigmas?|σ)\s*$", "", value)
        return super().read(value)


@dataclass(frozen=True)
class Share:
    """A share of a length of a body, see `beamsim.scenario.body.Body.metres`."""

    value: float

    def __str__(self) -> str:
        percent = (Decimal(repr(self.value)) * 100).normalize()
        return f"{percent:f} %"

    def __format__(self, spec: str) -> str:
        return str(self)


@dataclass(frozen=True)
class PositionType(Quantity):
    """A length, or a percentage of the body's length."""

    def read(self, value: Any) -> Any:
        """Convert to the SI number, or to the share."""
        if isinstance(value, Share):
            return value
        if isinstance(value, str) and value.rstrip().endswith("%"):
            return Share(self.check_bounds(units.read_quantity(value, units.RATIO)))
        return super().read(value)


class LevelValue(float):
    """A number that stores the quantity of its unit (None if it had no unit), if several quantities are allowed."""

    quantity: str | None

    def __new__(cls, value: float, quantity: str | None = None) -> LevelValue:
        """Make a float with its quantity."""
        level = super().__new__(cls, value)
        level.quantity = quantity
        return level


def meant(level: float | None) -> str | None:
    """The quantity that the unit of a level implies; None if it had no unit."""
    return getattr(level, "quantity", None)


LEVEL_DIMENSIONS = {
    "acceleration": units.ACCELERATION,
    "velocity": units.VELOCITY,
    "displacement": replace(units.LENGTH, name="displacement", example="0.1 mm"),
    "force": units.FORCE,
    "force_per_length": units.FORCE_PER_LENGTH,
    "pressure": replace(units.PRESSURE, name="pressure", example="200 Pa"),
    "angular_acceleration": units.ANGULAR_ACCELERATION,
    "angular_velocity": units.ANGULAR_VELOCITY,
    "rotation": replace(units.ANGLE, name="rotation", example="0.1 deg"),
}


def motion_dimension(quantity: str) -> units.Dimension:
    """Dimension of a level, or of a probe's motion such as absolute_acceleration."""
    return LEVEL_DIMENSIONS[quantity.removeprefix("absolute_")]


INTEGRALS = {"velocity": 1, "displacement": 2, "angular_velocity": 1, "rotation": 2}
"""How many times the acceleration is integrated to give a quantity; 0 for accelerations and loads."""


def power_of(quantity: str | None) -> int:
    """Power of frequency by which the acceleration (or force) grows at constant amplitude of ``quantity``."""
    return INTEGRALS.get(quantity or "", 0)


def acceleration_amplitude(level: float, quantity: str | None, frequency_hz: float) -> float:
    """Amplitude of the acceleration (or force) of a sine, from that of a related quantity.

    Parameters
    ----------
    level : amplitude of ``quantity``, in SI units.
    quantity : displacement, velocity, acceleration or force.
    frequency_hz : frequency of the sine, Hz.

    Returns
    -------
    float
        m/s^2, or N.
    """
    return float(level * (2.0 * math.pi * frequency_hz) ** power_of(quantity))


FACTOR = "factor"
"""Quantity of the level in a sweep of several forces: a factor of all of them."""


def level_unit(quantity: str) -> str:
    """SI unit of levels of a quantity.

    >>> level_unit("force"), level_unit("factor")
    ('N', '1')
    """
    return "1" if quantity == FACTOR else LEVEL_DIMENSIONS[quantity].unit


def amplitude_unit(quantity: str) -> str:
    """SI unit of the driving term in the equations: the acceleration of a base motion, else the load."""
    motion = {"velocity": "acceleration", "displacement": "acceleration"}
    rotation = {"angular_velocity": "angular_acceleration", "rotation": "angular_acceleration"}
    return level_unit((motion | rotation).get(quantity, quantity))


@dataclass(frozen=True)
class LevelType(Bounded):
    """A number with a unit of one of several quantities, by default those of an excitation."""

    quantities: tuple[tuple[str, Dimension], ...] = tuple(LEVEL_DIMENSIONS.items())
    example: str = "2 g"
    examples: tuple[str, ...] = ("2 g", "0.1 N", "0.1 mm")

    @property
    def range(self) -> tuple[float, float]:
        """Range of magnitudes of all quantities together: a bare number may be any of them."""
        dimensions = [dimension for _, dimension in self.quantities]
        return min(each.smallest for each in dimensions), max(each.largest for each in dimensions)

    def read(self, value: Any) -> LevelValue:
        """Convert to the SI number with its quantity."""
        if isinstance(value, LevelValue):
            return value
        number, dimension = units.read_level(value, tuple(dict.fromkeys(each for _, each in self.quantities)))
        of = next((name for name, known in self.quantities if known is dimension), None)
        return LevelValue(self.check_bounds(number), of)

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a number or text."""
        return {"anyOf": [self.bounds_schema, NUMBER_WITH_UNIT], "examples": list(self.examples)}


@dataclass(frozen=True)
class Rate:
    """A sweep rate: octaves per second (logarithmic sweep) or Hz per second (linear)."""

    value: float
    unit: str  # "oct/s" or "Hz/s"

    def __str__(self) -> str:
        return f"{self.value!r} {self.unit}"


@dataclass(frozen=True)
class RateType(FieldType):
    """A sweep rate, which always needs a unit."""

    example = "2 oct/min"

    def read(self, value: Any) -> Rate:
        """Convert to a rate per second, in octaves or Hz.

        >>> RateType().read("120 oct/min")
        Rate(value=2.0, unit='oct/s')
        """
        if isinstance(value, Rate):
            return value
        number, dimension = units.read_level(value, (units.OCTAVES_PER_TIME, units.FREQUENCY_PER_TIME))
        if dimension is None:
            needed = "needs a unit, which decides whether the sweep is logarithmic or linear"
            raise UnitError(needed, "write for example 2 oct/min or 5 Hz/s")
        if not number > 0:
            raise UnitError(
                "must be positive", "write for example 2 oct/min, and set direction for the sense of the sweep"
            )
        return Rate(number, dimension.unit)

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a text with a pattern."""
        return {"type": "string", "pattern": r"^\s*(\d|\.\d).*/", "examples": ["2 oct/min", "5 Hz/s"]}


@dataclass(frozen=True)
class NumberOrText(FieldType):
    """A number, or text that another field will read.

    ``words`` allows words in addition to numbers with a unit.
    """

    example: str = "150 kN/m"
    words: bool = False

    def read(self, value: Any) -> float | str:
        """Return the value unchanged."""
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            remedy = f"write for example {self.example}"
            raise UnitError(f"must be a number, with or without unit{', or a word' * self.words}", remedy)
        if isinstance(value, str):
            return printable(value, LONGEST_TEXT)
        units.read_quantity(value, replace(units.ANY, example=self.example))
        return value

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a number or text."""
        number = {"type": "number", "minimum": -units.ANY.largest, "maximum": units.ANY.largest}
        return {"anyOf": [number, {"type": "string", "maxLength": LONGEST_TEXT}]}


@dataclass(frozen=True)
class WholeNumber(FieldType):
    """A whole number in a range."""

    minimum: int
    maximum: int = LARGEST_COUNT
    word: str = ""  # allowed in addition to numbers
    noun: str = "whole number"

    @property
    def example(self) -> str:
        """An example of a value."""
        return str(self.minimum)

    def read(self, value: Any) -> Any:
        """Convert to the integer, or the word; ``1e6`` is accepted, ``true`` is not."""
        if self.word and value == self.word:
            return value
        try:
            number = value if type(value) is int else units.read_quantity(value, units.NUMBER)
        except UnitError:
            number = math.nan
        if number != number // 1:
            raise UnitError("must be a whole number", self._remedy)
        if not self.minimum <= number <= self.maximum:
            raise UnitError("is out of range", self._remedy)
        return int(number)

    @property
    def _remedy(self) -> str:
        """The remedy: how to write it."""
        if self.maximum < LARGEST_COUNT:
            return f"write a whole number from {self.minimum} to {self.maximum}"
        return f"write a {self.noun}, {self.minimum} or more{f', or {self.word}' * bool(self.word)}"

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a bounded integer."""
        schema: JsonSchemaValue = {"type": "integer", "minimum": self.minimum, "maximum": self.maximum}
        return {"anyOf": [schema, {"const": self.word}]} if self.word else schema


@dataclass(frozen=True)
class SeedType(WholeNumber):
    """A seed, or a weighted sum of the inputs of several: 0.8*4 + 0.6*7."""

    minimum: int = 0
    maximum: int = LARGEST_SEED

    def read(self, value: Any) -> int | str:
        """Convert to the integer, or the text of the weighted sum."""
        if isinstance(value, str) and "*" in value:
            shares_of_seeds(value)
            return value
        seed: int = super().read(value)
        return seed

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for an integer or text."""
        return {"anyOf": [super().json_schema(), {"type": "string", "pattern": "\\*"}]}


def shares_of_seeds(seed: int | str) -> list[tuple[int, float]]:
    """Seeds of a weighted sum, with normalised weights, whose squares add up to one.

    >>> shares_of_seeds("4*7 + 3*8")
    [(7, 0.8), (8, 0.6)]
    """
    if not isinstance(seed, str):
        return [(seed, 1.0)]
    try:
        terms = [
            (WholeNumber(0, LARGEST_SEED).read(of), float(share))
            for share, of in (term.split("*") for term in seed.split("+"))
        ]
        size = math.hypot(*(share for _, share in terms))
        return [(of, share / size) for of, share in terms]
    except (ValueError, ZeroDivisionError):
        raise UnitError("is not a seed", "write a whole number, or shares of several: 0.8*4 + 0.6*7") from None


LONGEST_TEXT = 1000
"""Longest text, in characters; a longer one fits on no plot and on no line of a screen."""
LONGEST_NAME = 100
"""Longest name, in characters; legends and table rows contain several."""
_HOW_TO_NAME = "use letters, digits, spaces and - _ + . (it names responses and columns)"


def printable(text: str, most_characters: int) -> str:
    """Text on one line that can be printed, drawn and stored; line breaks and tabs become spaces.

    Raises
    ------
    UnitError
        If it is too long or contains a control character, a lone surrogate or an invalid character.
    """
    if len(text) > most_characters:
        raise UnitError(f"has {len(text)} characters", f"write at most {most_characters}")
    return text if text.isprintable() else _in_one_line(text)


def _in_one_line(text: str) -> str:
    """Replace line breaks and tabs, see `printable`."""
    line = re.sub(r"[\t\n\r\x0b\x0c\x85\u2028\u2029]+", " ", text).strip()
    for character in line:
        if unicodedata.category(character) in ("Cc", "Cs") or ord(character) & 0xFFFE == 0xFFFE:
            raise UnitError(f"contains U+{ord(character):04X}, which cannot be printed or stored", "remove it")
    return line


@dataclass(frozen=True)
class TextType(FieldType):
    """Text; ``name`` restricts it to valid names of datasets and columns."""

    form: ClassVar[str] = "<text>"
    name: bool = False

    @property
    def example(self) -> str:
        """An example of a value."""
        return "tip" if self.name else ""

    def read(self, value: Any) -> str:
        """Convert to text; a number is taken as written."""
        if isinstance(value, bool) or not isinstance(value, (str, int, float)):
            raise UnitError("must be text", "put the value in quotes")
        if isinstance(value, int) and value.bit_length() > 4 * LONGEST_NAME:
            raise UnitError("has too many digits", "put the value in quotes, and shorten it")
        text = printable(str(value), LONGEST_NAME if self.name else LONGEST_TEXT)
        if self.name and not re.fullmatch(r"\w(?:[\w .+-]*[\w+-])?", text):
            raise UnitError("is not a usable name", _HOW_TO_NAME)
        return text

    def json_schema(self) -> JsonSchemaValue:
        """JSON Schema for a text."""
        if self.name:
            return {"type": "string", "minLength": 1, "maxLength": LONGEST_NAME}
        return {"type": "string", "maxLength": LONGEST_TEXT}


@dataclass(frozen=True)
class UnitType(TextType):
    """A unit of a quantity."""

    dimension: Dimension = units.NUMBER
    example: str = ""

    def read(self, value: Any) -> str:
        """Check the unit and return its text."""
        unit = super().read(value)
        try:
            units.size_of(unit, self.dimension)
        except UnitError as error:
            raise UnitError(f"is not a valid unit: {error.message}", f"write for example {self.example}") from None
        return unit


class FileType(TextType):
    """Name of a file, relative to the folder of the scenario."""


Text = Annotated[str, TextType()]
FileName = Annotated[str, FileType()]
Name = Annotated[str, TextType(name=True)]
Count = Annotated[int, WholeNumber(1)]
SmallCount = Annotated[int, WholeNumber(1, 10_000)]
"""Number of items that are computed or stored one by one."""

Modes = Annotated[int | Literal["all"], WholeNumber(1, word="all", noun="number of modes")]
Elements = Annotated[int, WholeNumber(1, 5000)]
PlateElements = tuple[Annotated[int, WholeNumber(1, 500)], Annotated[int, WholeNumber(1, 500)]]
SteppedCount = Annotated[int, WholeNumber(2, 100_000)]

Coefficient = Annotated[float, Quantity(units.NUMBER)]
PositiveNumber = Annotated[float, Quantity(units.NUMBER, above=0.0)]
Factor = Annotated[float, Quantity(replace(units.NUMBER, name="factor"), minimum=0.0)]
Ratio = Annotated[float, Quantity(units.RATIO, minimum=0.0)]
Length = Annotated[float, Quantity(units.LENGTH, above=0.0)]
BodyLength = Annotated[Length, UsualRange(units.LENGTH, METRES, 0.0, 100.0, "is long for a structure")]
BodyWidth = Annotated[Length, UsualRange(units.LENGTH, METRES, 0.0, 100.0, "is wide for a structure")]
BodyThickness = Annotated[Length, UsualRange(units.LENGTH, METRES, 0.0, 3.0, "is thick for a structure")]
Amplitude = Annotated[float, Quantity(replace(units.LENGTH, example="1 mm"))]
PositionOrShare = Annotated[float | Share, PositionType(replace(units.LENGTH, name="position"), minimum=0.0)]
Gap = Annotated[float, Quantity(replace(units.LENGTH, example="0.1 mm"))]
Area = Annotated[float, Quantity(units.AREA, above=0.0)]
SecondMoment = Annotated[float, Quantity(units.SECOND_MOMENT, above=0.0)]
Mass = Annotated[float, Quantity(units.MASS, above=0.0)]
PointMassValue = Annotated[float, Quantity(units.MASS, minimum=0.0)]
Density = Annotated[float, Quantity(units.DENSITY, above=0.0)]
SolidDensity = Annotated[
    Density, UsualRange(units.DENSITY, ("kg/m^3", "g/cm^3"), 25.0, 7e5, "is outside the range of solids")
]
NonNegativeDensity = Annotated[float, Quantity(units.DENSITY, minimum=0.0)]
Modulus = Annotated[float, Quantity(units.PRESSURE, above=0.0)]
SolidModulus = Annotated[
    Modulus,
    UsualRange(units.PRESSURE, ("Pa", "kPa", "MPa", "GPa"), 1e8, 3e13, "is outside the range of structural materials"),
]
NonNegativeModulus = Annotated[float, Quantity(units.PRESSURE, minimum=0.0)]
BendingStiffness = Annotated[float, Quantity(units.BENDING_STIFFNESS, above=0.0)]
PlateStiffness = Annotated[float, Quantity(units.PLATE_STIFFNESS, above=0.0)]
TorsionalStiffness = Annotated[float, Quantity(units.TORSIONAL_STIFFNESS, minimum=0.0)]
MassPerArea = Annotated[float, Quantity(units.MASS_PER_AREA, above=0.0)]
SectionModulusPerLength = Annotated[float, Quantity(units.SECTION_MODULUS_PER_LENGTH, above=0.0)]
PoissonsRatio = Annotated[
    float, Quantity(replace(units.NUMBER, name="Poisson's ratio", example="0.33"), above=-1.0, below=1.0)
]
Quantile = Annotated[float, Quantity(replace(units.RATIO, example="95 %"), minimum=0.5, maximum=1.0)]
Grading = Annotated[float, Quantity(replace(units.NUMBER, name="grading", example="2"), minimum=1.0, maximum=4.0)]
MassPerLength = Annotated[float, Quantity(units.MASS_PER_LENGTH, above=0.0)]
NonNegativeMassPerLength = Annotated[float, Quantity(units.MASS_PER_LENGTH, minimum=0.0)]
RotaryInertia = Annotated[float, Quantity(units.ROTARY_INERTIA, minimum=0.0)]
Stiffness = Annotated[float, Quantity(units.STIFFNESS, above=0.0)]
StopStiffness = Annotated[
    Stiffness,
    UsualRange(
        units.STIFFNESS, ("N/m", "kN/m"), 1.0 / 30.0, math.inf,
        "is {ratio:.2g} of the static stiffness of the structure there, {size:.4g} N/m", "structure",
    ),
]  # fmt: skip
NonNegativeStiffness = Annotated[float, Quantity(units.STIFFNESS, minimum=0.0)]
CubicStiffness = Annotated[float, Quantity(units.CUBIC_STIFFNESS)]
Dashpot = Annotated[float, Quantity(units.DASHPOT, minimum=0.0)]
RotationalStiffness = Annotated[float, Quantity(units.ROTATIONAL_STIFFNESS, minimum=0.0)]
RotationalDashpot = Annotated[float, Quantity(units.ROTATIONAL_DASHPOT, minimum=0.0)]
ViscousPerLength = Annotated[float, Quantity(units.VISCOUS_PER_LENGTH, minimum=0.0)]
PerTime = Annotated[float, Quantity(units.PER_TIME, minimum=0.0)]
Duration = Annotated[float, Quantity(units.TIME, above=0.0)]
PulseDuration = Annotated[
    Duration, UsualRange(units.TIME, ("s", "ms"), 0.0, 100.0, "is {ratio:.3g} periods of the first mode", "period")
]
Time = Annotated[float, Quantity(units.TIME, minimum=0.0)]
Frequency = Annotated[float, Quantity(units.FREQUENCY, above=0.0)]
LowPass = Annotated[
    Frequency,
    UsualRange(
        units.FREQUENCY, ("Hz", "kHz"), 1.0, math.inf, "lies below the excitation, {size:.4g} Hz", "excitation"
    ),
]  # fmt: skip
Angle = Annotated[float, Quantity(units.ANGLE)]
Phase = Annotated[
    Angle, UsualRange(units.ANGLE, ("rad", "deg"), -6.3, 6.3, "is more than a turn, 6.283 rad", bare_only=True)
]  # fmt: skip
FreePlay = Annotated[float, Quantity(units.ANGLE, minimum=0.0)]
Coordinate = Annotated[float, Quantity(replace(units.LENGTH, name="coordinate"))]
Force = Annotated[float, Quantity(units.FORCE)]
ForcePerLength = Annotated[float, Quantity(units.FORCE_PER_LENGTH)]
Pressure = Annotated[float, Quantity(replace(units.PRESSURE, name="pressure", example="200 Pa"))]
PositiveForce = Annotated[float, Quantity(units.FORCE, above=0.0)]
Moment = Annotated[float, Quantity(units.MOMENT)]
PositiveMoment = Annotated[float, Quantity(units.MOMENT, above=0.0)]
Memory = Annotated[float, Quantity(units.MEMORY, minimum=64e6)]
Energy = Annotated[float, Quantity(units.ENERGY, above=0.0)]
Gravity = Annotated[
    float,
    Quantity(replace(units.ACCELERATION, example="1 g")),
    UsualRange(
        units.ACCELERATION,
        ("m/s^2", "mm/s^2"),
        -300.0,
        300.0,
        "is more than 30 times that of the Earth",
        bare_only=True,
    ),
]
PositiveAcceleration = Annotated[float, Quantity(replace(units.ACCELERATION, example="20 g"), above=0.0)]
Quality = Annotated[float, Quantity(replace(units.NUMBER, example="10"), above=0.5)]
Speed = Annotated[float, Quantity(units.VELOCITY, above=0.0)]
AnyValue = Annotated[float | str, NumberOrText(words=True)]
GravityVector = tuple[Gravity, Gravity, Gravity]
Level = Annotated[float, LevelType()]
PositiveLevel = Annotated[float, LevelType(above=0.0)]
SweepRate = Annotated[Rate, RateType()]
NotNegativeWhole = Annotated[int, WholeNumber(0)]
RandomSeed = Annotated[int, WholeNumber(0, LARGEST_SEED)]
"""A seed of random numbers that are drawn once; `Seed` also accepts weighted sums."""
Seed = Annotated[int | str, SeedType()]
DENSITY_DIMENSIONS = dict(
    zip(("acceleration", "force", "force_per_length", "pressure", "angular_acceleration"), units.LEVEL_PSD, strict=True)
)
"""Dimension of the spectral density of a quantity."""
SpectralDensity = Annotated[
    float,
    LevelType(tuple(DENSITY_DIMENSIONS.items()), "0.01 g^2/Hz", ("0.01 g^2/Hz", "0.1 N^2/Hz"), above=0.0),
]
DensityOfTest = Annotated[
    SpectralDensity,
    UsualRange(
        units.ACCELERATION_PSD, ("(m/s^2)^2/Hz", "g^2/Hz"), 1.0 / 30.0, math.inf,
        "is low for the highest density of a test", "highest density", bare_only=True,
    ),
]  # fmt: skip
"""One-sided spectral density of an acceleration, force, pressure and the like."""
DensitySlope = Annotated[float, Quantity(units.DENSITY_SLOPE)]
Sigmas = Annotated[float, SigmasType(replace(units.NUMBER, name="number of standard deviations", example="3 sigma"),
                                     minimum=1.0, maximum=10.0)]  # fmt: skip
NonzeroNumber = Annotated[float, NonzeroType(replace(units.NUMBER, name="factor", example="-1"))]

SHAPE_DISPLACEMENTS = (
    replace(units.LENGTH, name="displacement", example="1 mm"),
    Dimension("slope", "", "1 mm/m"),
    Dimension("coefficient of x^2", "1/m", "3 1/m"),
    Dimension("coefficient of x^3", "1/m^2", "3 1/m^2"),
)
SHAPE_VELOCITIES = (
    units.VELOCITY,
    replace(units.PER_TIME, name="rate of a slope"),
    Dimension("coefficient of x^2", "1/m/s", "3 1/m/s"),
    Dimension("coefficient of x^3", "1/m^2/s", "3 1/m^2/s"),
)


# Numbers of an initial shape: the quantity is the power of x whose coefficient has the unit.
ShapeDisplacement = Annotated[
    float, LevelType(tuple((str(power), each) for power, each in enumerate(SHAPE_DISPLACEMENTS)), "1 mm", ("1 mm",))
]
ShapeVelocity = Annotated[
    float, LevelType(tuple((str(power), each) for power, each in enumerate(SHAPE_VELOCITIES)), "0.2 m/s", ("0.2 m/s",))
]
"""Numbers of an initial shape: one for each mass of a chain, or coefficients of a polynomial in x along a beam."""
