"""Conversion of values as written (``151.1 kN/m``, ``2 g``, ``60 rpm``) to SI numbers.

A number without unit is in SI units. In addition to the usual meaning of SI and imperial units:

- a frequency is in Hz, so ``0.8 rad/s`` is 0.1273 Hz and ``60 rpm`` is 1 Hz;
- ``g`` is standard gravity in an acceleration or its power spectral density, gram in a mass;
- ``oct/min`` and ``dec/min`` are sweep rates;
- angles and percent are not interchangeable with plain numbers.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from beamsim.scenario.base import InvalidValueError


@dataclass(frozen=True)
class Dimension:
    """A physical quantity: its name, SI unit as text, an example, and its range.

    The range limits the magnitude; zero is allowed. It includes nanometre resonators, bridges, and dimensionless models
    with masses and stiffnesses around 1. A value outside is a typing error, or would overflow in computations.
    """

    name: str
    unit: str
    example: str
    smallest: float = 1e-30  # SI, except zero
    largest: float = 1e30
    gravity: bool = False  # `g` means standard gravity here
    plain: bool = False  # a number without any unit, not even % or mm/m

    @property
    def with_article(self) -> str:
        """The name with its article, a or an."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"


STANDARD_GRAVITY = 9.80665  # m/s^2

NUMBER = Dimension("plain number", "", "0.5", 1e-20, 1e20, plain=True)
RATIO = Dimension("ratio", "", "2 %", 1e-20, 1e6)
LENGTH = Dimension("length", "m", "270 mm", 1e-20, 1e6)
AREA = Dimension("area", "m^2", "250 mm^2", 1e-24, 1e12)
SECOND_MOMENT = Dimension("second moment of area", "m^4", "520.8 mm^4", 1e-44, 1e16)
MASS = Dimension("mass", "kg", "4.2 g", 1e-27, 1e12)
DENSITY = Dimension("density", "kg/m^3", "2700 kg/m^3", 1e-12, 1e12)
PRESSURE = Dimension("modulus or stress", "Pa", "69 GPa", 1e-12, 1e20)
BENDING_STIFFNESS = Dimension("bending stiffness", "N m^2", "210 N m^2", 1e-32, 1e24)
ROTARY_INERTIA = Dimension("moment of inertia", "kg m^2", "2 kg mm^2", 1e-44, 1e18)
PLATE_STIFFNESS = Dimension("bending stiffness per width", "N m", "2967 N m", 1e-24, 1e20)
MASS_PER_AREA = Dimension("mass per area", "kg/m^2", "3.1 kg/m^2", 1e-15, 1e12)
TORSIONAL_STIFFNESS = Dimension("torsional stiffness", "N m^2", "35 N m^2", 1e-32, 1e24)
SECTION_MODULUS_PER_LENGTH = Dimension("section modulus per width", "m^2", "4.2 mm^2", 1e-24, 1e12)
MASS_PER_LENGTH = Dimension("mass per length", "kg/m", "3.1 kg/m", 1e-24, 1e12)
STIFFNESS = Dimension("stiffness", "N/m", "151.1 kN/m", 1e-18, 1e20)
CUBIC_STIFFNESS = Dimension("cubic stiffness", "N/m^3", "0.5 N/m^3", 1e-24, 1e27)
DASHPOT = Dimension("dashpot coefficient", "N s/m", "12 N s/m", 1e-24, 1e15)
ROTATIONAL_STIFFNESS = Dimension("rotational stiffness", "N m/rad", "200 N m/rad", 1e-24, 1e20)
ROTATIONAL_DASHPOT = Dimension("rotational dashpot coefficient", "N m s/rad", "0.05 N m s/rad", 1e-30, 1e15)
VISCOUS_PER_LENGTH = Dimension("viscous coefficient per unit length", "N s/m^2", "3 N s/m^2", 1e-24, 1e15)
PER_TIME = Dimension("reciprocal time", "1/s", "2 1/s", 1e-15, 1e15)
TIME = Dimension("time", "s", "0.4 s", 1e-15, 1e10)
FREQUENCY = Dimension("frequency", "Hz", "65 Hz", 1e-10, 1e15)
ANGLE = Dimension("angle", "rad", "90 deg", 1e-15, 1e6)
FORCE = Dimension("force", "N", "1.5 N", 1e-24, 1e15)
IMPULSE = Dimension("impulse", "N s", "50 mN s", 1e-27, 1e15)
MOMENT = Dimension("moment", "N m", "12 N m", 1e-30, 1e18)
WEAR_RATE = Dimension("wear rate", "m^2/N", "1e-6 mm^3/(N m)", 1e-30, 1.0)
OCTAVES_PER_TIME = Dimension("sweep rate", "oct/s", "2 oct/min", 1e-12, 1e9)
FREQUENCY_PER_TIME = Dimension("sweep rate in Hz", "Hz/s", "5 Hz/s", 1e-12, 1e18)
ENERGY = Dimension("energy", "J", "1 uJ", 1e-36, 1e21)
MEMORY = Dimension("memory", "byte", "2 GB", 1.0, 1e15)
VELOCITY = Dimension("velocity", "m/s", "0.2 m/s", 1e-20, 1e9)
ACCELERATION = Dimension("acceleration", "m/s^2", "2 g", 1e-18, 1e18, gravity=True)
ACCELERATION_PSD = Dimension("acceleration spectral density", "m^2/s^3", "0.01 g^2/Hz", 1e-36, 1e36, gravity=True)
FORCE_PSD = Dimension("force spectral density", "N^2/Hz", "0.1 N^2/Hz", 1e-48, 1e30)
MOMENT_PSD = Dimension("moment spectral density", "N^2 m^2/Hz", "0.1 N^2 m^2/Hz", 1e-60, 1e36)
ANGULAR_ACCELERATION = Dimension("angular acceleration", "rad/s^2", "50 rad/s^2", 1e-18, 1e18)
ANGULAR_VELOCITY = Dimension("angular velocity", "rad/s", "2 rad/s", 1e-18, 1e12)
ANGULAR_ACCELERATION_PSD = Dimension(
    "spectral density of an angular acceleration", "rad^2/s^3", "2 rad^2/s^4/Hz", 1e-36, 1e36
)
FORCE_PER_LENGTH = Dimension("force per length", "N/m", "50 N/m", 1e-24, 1e15)
FORCE_PER_LENGTH_PSD = Dimension("spectral density of a force per length", "N^2/m^2/Hz", "4 N^2/m^2/Hz", 1e-48, 1e30)
PRESSURE_PSD = Dimension("pressure spectral density", "Pa^2/Hz", "10 Pa^2/Hz", 1e-36, 1e36)
DENSITY_SLOPE = Dimension("slope of a density", "dB/oct", "3 dB/oct", 1e-6, 1e3)
ANY = Dimension("number", "", "150 kN/m", 1e-60, 1e60)
"""A number whose field, and so whose dimension, is known later."""
LEVEL_PSD = (ACCELERATION_PSD, FORCE_PSD, FORCE_PER_LENGTH_PSD, PRESSURE_PSD, ANGULAR_ACCELERATION_PSD)
"""Spectral densities of all quantities of an excitation."""

_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
# Letters, exponents, products, quotients and parentheses; a numeral is an exponent or a leading 1.
_UNIT = re.compile(r"[A-Za-zµμΩ°%_(][\w°%²³⁴¹⁻/*·⋅^()+\-. ]*|1\s*/[\w²³⁴¹⁻/*·⋅^()+\-. ]*")
_PLAIN_POWER = re.compile(r"(?<=[A-Za-zµμ)\]])([2-4])(?![\w.])")  # m/s2, (m/s2)2: a numeral that ends a unit or bracket
_POWER = r"(\^|\*\*)\s*"
_TOWER = re.compile(rf"\d{{3,}}|{_POWER}(?:[+\-]?[\d.]+|\(\s*[+\-]?[\d.]+\s*\))\s*{_POWER}")  # m^2^3 has two readings
_GRAVITY = re.compile(r"(?<![A-Za-z_µμ])(m?)g(?![A-Za-z_0-9])")
_SPELLINGS = {
    unit.lower(): unit
    for unit in ("m", "mm", "cm", "um", "kg", "g", "s", "ms", "N", "kN", "Hz", "kHz", "Pa", "kPa", "MPa", "GPa", "J")
}
"""Probable meaning of a misspelled unit, in any capitalisation."""


class UnitError(InvalidValueError):
    """A value that cannot be read as a certain quantity; the message shows it as written."""


UNITS_WRITTEN: ContextVar[Counter[tuple[Dimension, str]] | None] = ContextVar("units_written", default=None)
"""While a scenario is read: how often each unit is used; numbers without unit are not counted."""


# --- the table of units -----------------------------------------------------------------------------------------------

Powers = tuple[tuple[str, int], ...]
"""Base units and their powers, in alphabetical order."""


@dataclass(frozen=True)
class Unit:
    """A unit: its SI size ``factor`` times pi to the power ``pi``, its base units, and the power of the radian."""

    factor: Fraction = Fraction(1)
    pi: int = 0
    powers: Powers = ()
    radians: int = 0

    def times(self, other: Unit, power: int = 1) -> Unit:
        """The product with a power of another unit."""
        powers = Counter(dict(self.powers))
        for base, of in other.powers:
            powers[base] += power * of
        left = tuple(sorted((base, of) for base, of in powers.items() if of))
        radians = self.radians + power * other.radians
        return Unit(self.factor * other.factor**power, self.pi + power * other.pi, left, radians)


PREFIXES = {
    "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "d": -1, "c": -2, "m": -3, "u": -6, "µ": -6, "μ": -6, "n": -9, "p": -12,
    "giga": 9, "mega": 6, "kilo": 3, "centi": -2, "milli": -3, "micro": -6, "nano": -9,
}  # fmt: skip
"""Prefixes of units, by their power of ten."""
TAKE_PREFIX = (
    "m", "g", "s", "N", "Pa", "J", "W", "Hz", "rad", "bar", "l", "L", "B", "C", "byte", "V", "A", "K", "mol", "cd",
)  # fmt: skip
"""Units that take a prefix."""
DEFINED_UNITS = {
    "g": ("0.001", "kg"), "N": ("1", "kg m/s^2"), "Pa": ("1", "N/m^2"), "J": ("1", "N m"), "W": ("1", "J/s"),
    "Hz": ("1", "1/s"), "bar": ("100000", "Pa"), "l": ("0.001", "m^3"), "L": ("1", "l"), "B": ("1", "byte"),
    "C": ("1", "A s"), "%": ("0.01", ""), "percent": ("0.01", ""), "ppm": ("0.000001", ""),
    "min": ("60", "s"), "h": ("3600", "s"), "hr": ("1", "h"), "hour": ("1", "h"), "day": ("24", "h"),
    "t": ("1000", "kg"), "tonne": ("1", "t"),
    "in": ("0.0254", "m"), "ft": ("0.3048", "m"), "yd": ("3", "ft"), "mile": ("5280", "ft"), "thou": ("0.001", "in"),
    "lb": ("0.45359237", "kg"), "lbm": ("1", "lb"), "oz": ("0.028349523125", "kg"),
    "lbf": ("4.4482216152605", "N"), "slug": ("1", "lbf s^2/ft"), "kgf": ("1", "kg gravity"), "kp": ("1", "kgf"),
    "dyn": ("0.00001", "N"), "kip": ("1000", "lbf"), "psi": ("1", "lbf/in^2"), "ksi": ("1000", "psi"),
    "atm": ("101325", "Pa"), "Wh": ("3600", "J"),
    "gravity": ("9.80665", "m/s^2"), "g_0": ("1", "gravity"), "g_n": ("1", "gravity"), "gn": ("1", "gravity"),
    "dec": ("3.3219280948873623479", "oct"), "rpm": ("1", "turn/min"), "rps": ("1", "turn/s"),
}  # fmt: skip
"""Units defined by others: a factor, as exact as its source, and a unit."""
UNITS_PER_TURN = {
    **dict.fromkeys(("turn", "rev", "revolution", "cycle"), 1), **dict.fromkeys(("deg", "degree"), 360),
    "arcmin": 21600, "arcsec": 1296000, "grade": 400, "gon": 400, "mil": 6400,
}  # fmt: skip
"""Angles, by their number in a full turn."""
SIMPLE_UNITS = {
    "rad": Unit(radians=1),
    **{name: Unit(Fraction(2, count), pi=1, radians=1) for name, count in UNITS_PER_TURN.items()},
    **{name: Unit(powers=((name, 1),)) for name in
       ("m", "kg", "s", "byte", "V", "A", "K", "mol", "cd", "degC", "degF", "dB", "oct")},
}  # fmt: skip
"""Angles and base units."""
SPELLED_OUT = {
    "meter": "m", "metre": "m", "gram": "g", "second": "s", "sec": "s", "newton": "N", "pascal": "Pa", "joule": "J",
    "watt": "W", "hertz": "Hz", "radian": "rad", "minute": "min", "inch": "in", "inches": "in", "foot": "ft",
    "feet": "ft", "pound": "lb", "liter": "l", "litre": "l", "volt": "V", "ampere": "A", "cps": "Hz", "bytes": "byte",
    "octave": "oct", "decade": "dec",
}  # fmt: skip
"""Other names of units; a plural s is allowed for all of them."""


def _find_unit(symbol: str, gravity: bool) -> Unit | None:
    """The unit of a symbol or name, with optional prefix or plural s; None if unknown."""
    if gravity and symbol in ("g", "mg"):
        return Unit(Fraction("0.001" if symbol == "mg" else 1)).times(_unit("gravity", False))
    for name in (symbol, symbol.removesuffix("s")):
        known = SPELLED_OUT.get(name, name)
        if known in SIMPLE_UNITS:
            return SIMPLE_UNITS[known]
        if known in DEFINED_UNITS:
            number, of = DEFINED_UNITS[known]
            return Unit(Fraction(number)).times(_unit(of, False) if of else Unit())
        for prefix, power in PREFIXES.items():
            rest = name.removeprefix(prefix)
            rest = SPELLED_OUT.get(rest, rest) if len(prefix) > 1 else rest
            if rest != name and rest in TAKE_PREFIX:
                return Unit(Fraction(10) ** power).times(_unit(rest, False))
    return None


_SUPERSCRIPTS = str.maketrans("²³⁴¹⁻", "2341-")
_EXPONENT = r"(?:\s*\^\s*(-?\d|\(-?\d\)))?"
_FACTOR = re.compile(rf"\s*([*/]?)\s*(?:(\()|(1)(?=\s*/)|([A-Za-zµμ_]+|%){_EXPONENT})")
_CLOSING = re.compile(rf"\){_EXPONENT}")
_BRACKETS = str.maketrans("[]", "()")
_MOST_DIGITS = 200  # digits of the size of a unit in brackets with an exponent; larger ones are not physical


@lru_cache(maxsize=1024)
def _unit(text: str, gravity: bool) -> Unit:
    """Parse a unit; ``gravity`` makes ``g`` standard gravity.

    Raises
    ------
    UnitError
        If it is not a product or quotient of known units.
    """
    text = text.translate(_BRACKETS)
    if not _UNIT.fullmatch(text) or _TOWER.search(text) or len(text) > 60:
        raise UnitError("is not a number, or a number with a unit", "")
    plain = re.sub("[²³⁴¹⁻]+", lambda power: "^" + power[0].translate(_SUPERSCRIPTS), text)
    for spelling, meaning in (("°", " deg "), ("·", "*"), ("⋅", "*"), ("**", "^")):
        plain = plain.replace(spelling, meaning)
    unit, rest = _product(plain.strip(), gravity)
    if unit is None or rest:
        raise UnitError(f"has the unit {text!r}, which is not known", "")
    return unit


def _product(rest: str, gravity: bool) -> tuple[Unit | None, str]:
    """The product of the units at the beginning of a text, up to a closing bracket, and the rest; None if not valid."""
    unit: Unit | None = None
    while rest and not (rest.startswith(")") and unit is not None):
        factor = _FACTOR.match(rest)
        if factor is None or (factor[1] and unit is None):
            return None, rest
        power, rest = -1 if factor[1] == "/" else 1, rest[factor.end() :].lstrip()
        if factor[2]:
            inner, rest = _in_brackets(rest, gravity)
        else:
            inner = _find_unit(factor[4], gravity) if factor[4] else Unit()
            power *= int((factor[5] or "1").strip("()"))
        if inner is None:
            return None, rest
        unit = (unit or Unit()).times(inner, power)
    return unit, rest


def _in_brackets(rest: str, gravity: bool) -> tuple[Unit | None, str]:
    """The unit in brackets with its exponent, for a text after the opening bracket, and the rest."""
    unit, rest = _product(rest, gravity)
    closing = _CLOSING.match(rest)
    if unit is None or closing is None:
        return None, rest
    return _to_power(unit, int((closing[1] or "1").strip("()"))), rest[closing.end() :].lstrip()


def _to_power(unit: Unit, power: int) -> Unit | None:
    """A power of a unit; None if the result is too large to be physical."""
    digits = max(math.log10(unit.factor.numerator), math.log10(unit.factor.denominator))
    powers = (unit.radians, *(of for _, of in unit.powers))
    large = abs(power) * digits > _MOST_DIGITS or any(abs(power * of) > _MOST_DIGITS for of in powers)
    return None if large else Unit().times(unit, power)


# --- reading ----------------------------------------------------------------------------------------------------------


def read_quantity(value: object, dimension: Dimension) -> float:
    """Convert a value to the SI unit of a dimension.

    Parameters
    ----------
    value : number, or text with or without a unit.
    dimension : of the quantity.

    Raises
    ------
    UnitError
        If it is not a finite number, is out of the range, its unit is unknown, or its dimension is wrong.

    Examples
    --------
    >>> read_quantity("5 mm", LENGTH), read_quantity(0.005, LENGTH), read_quantity("60 rpm", FREQUENCY)
    (0.005, 0.005, 1.0)
    """
    return read_level(value, (dimension,))[0]


def size_of(unit: str, dimension: Dimension) -> float:
    """SI value of one unit.

    Raises
    ------
    UnitError
        If it is not a unit of the dimension.
    """
    if not unit.strip():
        raise UnitError("it is empty", "")
    return _scaled(1.0, _size(unit.strip(), dimension)[0], "")


def read_level(
    value: object, dimensions: tuple[Dimension, ...], *, any_size: bool = False
) -> tuple[float, Dimension | None]:
    """Convert a value to SI, and return the dimension of its unit (``None`` for a number without unit).

    Parameters
    ----------
    value : as for `read_quantity`.
    dimensions : the allowed dimensions.
    any_size : whether values out of range are accepted; the caller then checks them.
    """
    remedy = "write for example " + " or ".join(each.example for each in dimensions)
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise UnitError("must be a number", remedy)
    unit, dimension, size = "", None, Unit()
    if isinstance(value, str):
        match = _NUMBER.fullmatch(value)
        if match is None:
            raise UnitError("is not a number, or a number with a unit" if value.strip() else "is empty", remedy)
        value, unit = match[1].replace("_", ""), match[2]
    if unit.startswith(","):
        raise UnitError("is not a number with a unit", "write decimals with a point, as in 5.2 mm")
    if unit:
        unit = _PLAIN_POWER.sub(r"^\1", unit)
        size, dimension = _size(unit, *dimensions)
    number = _scaled(value, size, remedy)
    if dimension is not None and (units_counted := UNITS_WRITTEN.get()) is not None:
        units_counted[dimension, unit] += 1
    if not any_size:
        in_range(number, dimensions if dimension is None else (dimension,), remedy)
    return number, dimension


def number_and_unit(quantity: float | str) -> tuple[float, str]:
    """The number and unit of a valid quantity as written; the unit is empty if there is none.

    >>> number_and_unit("2.7 g/cm^3"), number_and_unit(65)
    ((2.7, 'g/cm^3'), (65.0, ''))
    """
    match = _NUMBER.fullmatch(quantity) if isinstance(quantity, str) else None
    return (float(quantity), "") if match is None else (float(match[1]), match[2])


def is_in_gravities(unit: str) -> bool:
    """Whether a unit of acceleration or acceleration density contains standard gravity."""
    return _GRAVITY.search(unit) is not None


def demand_in_range(value: float, dimension: Dimension, remedy: str) -> None:
    """Refuse a computed value outside the range of its dimension; raises `InvalidValueError`."""
    if not dimension.smallest <= value <= dimension.largest:
        allowed = f"{dimension.smallest:g} to {dimension.largest:g}"
        message = f"comes to {dimension.with_article} of {value:g} {dimension.unit}, outside {allowed}"
        raise InvalidValueError(message, remedy)


def in_range(number: float, dimensions: tuple[Dimension, ...], remedy: str) -> float:
    """Return a number if its magnitude is in the range of one of the dimensions; otherwise raise `UnitError`."""
    smallest, largest = min(each.smallest for each in dimensions), max(each.largest for each in dimensions)
    if number != 0.0 and not smallest <= abs(number) <= largest:
        raise UnitError(_outside_the_range(dimensions[0], smallest, largest), remedy)
    return number


def _outside_the_range(dimension: Dimension, smallest: float, largest: float) -> str:
    """The message for a number outside its range, in the unit of its dimension."""
    return f"is outside the range of {dimension.with_article}, {smallest:g} to {largest:g} {dimension.unit}".rstrip()


def _scaled(factor: str | float, size: Unit, remedy: str) -> float:
    """Convert a number of units to SI, rounded once.

    So 7 mm and 0.7 cm are equal, and 4.2 g is the float nearest to 0.0042 kg.
    """
    try:
        number = float(factor)
        if number != 0.0 and math.isfinite(number) and (size.factor != 1 or size.pi != 0):
            number = float(Fraction(factor) * size.factor) * math.pi**size.pi
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError("must be finite", remedy)
    return number


def _spelling_question(text: str, dimensions: tuple[Dimension, ...]) -> str:
    """A question about a misspelled unit, 'hz' for Hz; empty if no unit of these dimensions is similar."""
    meant = re.sub(r"[A-Za-zµμ]+", lambda name: _SPELLINGS.get(name[0].lower(), name[0]), text)
    return f"did you mean {meant}?" if meant != text and any(_fits(meant, each) for each in dimensions) else ""


def _fits(text: str, dimension: Dimension) -> bool:
    try:
        return bool(_size(text, dimension))
    except UnitError:
        return False


@lru_cache(maxsize=1024)
def _size(text: str, *dimensions: Dimension) -> tuple[Unit, Dimension]:
    """Size of a unit in SI units, and its dimension among the allowed ones.

    Units per radian also fit quantities per 1. A frequency given as an angle per time is converted to turns.
    """
    try:
        for dimension in dimensions:
            unit, own = _unit(text, dimension.gravity), _unit(dimension.unit, False) if dimension.unit else Unit()
            if unit.powers != own.powers or dimension.plain:
                continue
            if unit.radians == own.radians or (unit.radians == 0 and own.radians == -1):
                return unit.times(own, -1), dimension
            if dimension.unit in ("Hz", "Hz/s") and unit.radians == 1:
                return unit.times(own, -1).times(Unit(Fraction(2), 1), -1), dimension
        message = _another_dimension(text, dimensions)
    except UnitError as error:
        message = error.message
    raise UnitError(message, _unit_remedy(text, dimensions))


def _another_dimension(text: str, dimensions: tuple[Dimension, ...]) -> str:
    """The message for a unit that has none of the dimensions."""
    names = [dimension.with_article for dimension in dimensions]
    expected = ", ".join(names[:-1]) + (" or " if names[:-1] else "") + names[-1]
    return f"must be {expected}, not {_dimension_text(_unit(text, all(each.gravity for each in dimensions)), text)}"


def _unit_remedy(text: str, dimensions: tuple[Dimension, ...]) -> str:
    """The remedy for an unknown or unsuitable unit."""
    if dimensions == (LENGTH,) and re.fullmatch(r"mils?", text):
        return "mil is an angle here; give thousandths of an inch as 200 thou or 0.2 in"
    return _spelling_question(text, dimensions) or "write for example " + " or ".join(
        each.example for each in dimensions
    )


def _dimension_text(unit: Unit, text: str) -> str:
    """Name of the dimension of a unit."""
    if not unit.powers:
        return (ANGLE if unit.radians else RATIO).with_article
    for dimension in _NAMED:
        if unit.powers == _unit(dimension.unit, False).powers:
            return dimension.with_article
    return f"a quantity in {text}"


_NAMED = (
    LENGTH, AREA, SECOND_MOMENT, MASS, DENSITY, PRESSURE, STIFFNESS, CUBIC_STIFFNESS, DASHPOT, ROTATIONAL_DASHPOT,
    VISCOUS_PER_LENGTH, TIME, FREQUENCY, FORCE, ENERGY, VELOCITY, ACCELERATION, OCTAVES_PER_TIME,
)  # fmt: skip
