"""Conversion of values as written (``151.1 kN/m``, ``2 g``, ``60 rpm``) to SI numbers.

A bare number is SI. A string with a unit is read by pint, which is imported only for units that are not among the
common ones (`beamsim.scenario.common_units`). Four things differ from plain pint:

- a frequency is in Hz, so ``0.8 rad/s`` is 0.1273 Hz and ``60 rpm`` is 1 Hz (pint: 0.8 and 6.28);
- ``g`` is standard gravity in an acceleration or its power spectral density, gram in a mass;
- ``oct/min`` and ``dec/min`` are sweep rates;
- angles and percent are not interchangeable with plain numbers.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any

from beamsim.scenario.common_units import common_factor


@dataclass(frozen=True)
class Dimension:
    """What a quantity measures: its name, its SI unit as text, and an example of how to write it."""

    name: str
    unit: str
    example: str
    gravity: bool = False  # `g` means standard gravity here
    power: int = 1  # of a length, roughly: how far values may be from 1, see `LARGEST`

    @property
    def with_article(self) -> str:
        """The name after a or an."""
        return f"{'an' if self.name[0] in 'aeiou' else 'a'} {self.name}"

    def show(self, value: float) -> str:
        """Return the value with its SI unit, as messages print it."""
        return f"{value:.6g} {self.unit}".rstrip()


LARGEST = 1e30
"""Values outside 1/LARGEST to LARGEST (to its square for areas and the like) are no physical quantities."""

NUMBER = Dimension("plain number", "", "0.5")
RATIO = Dimension("ratio", "", "2 %")
LENGTH = Dimension("length", "m", "270 mm")
AREA = Dimension("area", "m^2", "250 mm^2", power=2)
SECOND_MOMENT = Dimension("second moment of area", "m^4", "520.8 mm^4", power=2)
MASS = Dimension("mass", "kg", "4.2 g")
DENSITY = Dimension("density", "kg/m^3", "2700 kg/m^3")
PRESSURE = Dimension("modulus or stress", "Pa", "69 GPa")
BENDING_STIFFNESS = Dimension("bending stiffness", "N m^2", "210 N m^2", power=2)
ROTARY_INERTIA = Dimension("moment of inertia", "kg m^2", "2 kg mm^2", power=2)
PLATE_STIFFNESS = Dimension("bending stiffness per width", "N m", "2967 N m")
MASS_PER_AREA = Dimension("mass per area", "kg/m^2", "3.1 kg/m^2")
TORSIONAL_STIFFNESS = Dimension("torsional stiffness", "N m^2", "35 N m^2", power=2)
SECTION_MODULUS_PER_LENGTH = Dimension("section modulus per width", "m^2", "4.2 mm^2", power=2)
MASS_PER_LENGTH = Dimension("mass per length", "kg/m", "3.1 kg/m")
STIFFNESS = Dimension("stiffness", "N/m", "151.1 kN/m")
CUBIC_STIFFNESS = Dimension("cubic stiffness", "N/m^3", "0.5 N/m^3", power=2)
DASHPOT = Dimension("dashpot coefficient", "N s/m", "12 N s/m")
ROTATIONAL_STIFFNESS = Dimension("rotational stiffness", "N m/rad", "200 N m/rad")
ROTATIONAL_DASHPOT = Dimension("rotational dashpot coefficient", "N m s/rad", "0.05 N m s/rad")
VISCOUS_PER_LENGTH = Dimension("viscous coefficient per unit length", "N s/m^2", "3 N s/m^2")
PER_TIME = Dimension("reciprocal time", "1/s", "2 1/s")
TIME = Dimension("time", "s", "0.4 s")
FREQUENCY = Dimension("frequency", "Hz", "65 Hz")
ANGLE = Dimension("angle", "rad", "90 deg")
FORCE = Dimension("force", "N", "1.5 N")
WEAR_RATE = Dimension("wear rate", "m^2/N", "1e-6 mm^3/(N m)")
ENERGY = Dimension("energy", "J", "1 uJ")
MEMORY = Dimension("memory", "byte", "2 GB")
VELOCITY = Dimension("velocity", "m/s", "0.2 m/s")
ACCELERATION = Dimension("acceleration", "m/s^2", "2 g", gravity=True)
ACCELERATION_PSD = Dimension("acceleration spectral density", "m^2/s^3", "0.01 g^2/Hz", gravity=True, power=2)
FORCE_PSD = Dimension("force spectral density", "N^2/Hz", "0.1 N^2/Hz", power=2)
ANGULAR_ACCELERATION = Dimension("angular acceleration", "rad/s^2", "50 rad/s^2")
ANGULAR_VELOCITY = Dimension("angular velocity", "rad/s", "2 rad/s")
ANGULAR_ACCELERATION_PSD = Dimension(
    "spectral density of an angular acceleration", "rad^2/s^3", "2 rad^2/s^4/Hz", power=2
)
FORCE_PER_LENGTH = Dimension("force per length", "N/m", "50 N/m")
FORCE_PER_LENGTH_PSD = Dimension("spectral density of a force per length", "N^2/m^2/Hz", "4 N^2/m^2/Hz", power=2)
PRESSURE_PSD = Dimension("pressure spectral density", "Pa^2/Hz", "10 Pa^2/Hz", power=2)
LEVEL_PSD = (ACCELERATION_PSD, FORCE_PSD, FORCE_PER_LENGTH_PSD, PRESSURE_PSD, ANGULAR_ACCELERATION_PSD)
"""Densities of what an excitation may be."""

_NUMBER = re.compile(r"\s*([+-]?(?:\d+(?:_\d+)*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
# Letters, exponents, products, quotients and parentheses; a numeral is an exponent or a leading 1.
_UNIT = re.compile(r"[A-Za-zµμΩ°%_][\w°%²³⁴¹⁻/*·⋅^()+\-. ]*|1\s*/[\w²³⁴¹⁻/*·⋅^()+\-. ]*")
_PLAIN_POWER = re.compile(r"(?<=[A-Za-zµμ])([2-4])(?![\w.])")  # m/s2, kg/m3: a numeral that ends the name of a unit
_TOWER = re.compile(r"\d{3,}|(\^|\*\*)[\s()+\-]*[\d.]+[\s()]*(\^|\*\*)")
_GRAVITY = re.compile(r"(?<![A-Za-z_µμ])(m?)g(?![A-Za-z_0-9])")
_OWN_NAMES = re.compile(r"(?<![A-Za-z_µμ])(rev|revs)(?![A-Za-z_0-9])")
_ANGULAR = frozenset({"radian", "degree", "turn", "revolutions_per_minute", "revolutions_per_second"})
_ANGULAR_NAMES = _ANGULAR | {"arcminute", "arcsecond", "milliarcsecond", "grade", "mil", "milliradian"}
_PER_ANGLE = "/rad"
_SPELLINGS = {
    unit.lower(): unit
    for unit in ("m", "mm", "cm", "um", "kg", "g", "s", "ms", "N", "kN", "Hz", "kHz", "Pa", "kPa", "MPa", "GPa", "J")
}
"""What is probably meant, whatever its capitals."""
_RATE = re.compile(r"(oct|octave|octaves|dec|decade|decades)\s*/\s*(s|sec|second|min|minute|h|hour)")
_SECONDS = {"s": 1, "sec": 1, "second": 1, "min": 60, "minute": 60, "h": 3600, "hour": 3600}


class UnitError(ValueError):
    """A value cannot be read as the quantity that is wanted."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.message = message
        self.remedy = remedy


_written: ContextVar[Counter[tuple[Dimension, str]] | None] = ContextVar("_written", default=None)


@contextmanager
def units_written() -> Iterator[Counter[tuple[Dimension, str]]]:
    """Count what is read in which unit, while quantities of a scenario are read; bare numbers have none."""
    counted: Counter[tuple[Dimension, str]] = Counter()
    token = _written.set(counted)
    try:
        yield counted
    finally:
        _written.reset(token)


def _note(dimension: Dimension, unit: str) -> None:
    counted = _written.get()
    if counted is not None:
        counted[dimension, unit] += 1


def read_number(value: object) -> float:
    """Return a plain number: an int, a float, or a string that reads as one (``2e5``)."""
    remedy = f"write for example {NUMBER.example}"
    number, unit = _split(value, remedy)
    if unit:
        raise UnitError("must be a plain number, without a unit", remedy)
    return _physical(_finite(number, remedy), NUMBER, remedy)


def read_quantity(value: object, dimension: Dimension) -> float:
    """Return the value in the SI unit of ``dimension``.

    Raises
    ------
    UnitError
        If it is not a finite number, its unit is unknown, or its dimension is wrong.

    Examples
    --------
    >>> read_quantity("5 mm", LENGTH), read_quantity(0.005, LENGTH), read_quantity("60 rpm", FREQUENCY)
    (0.005, 0.005, 1.0)
    """
    number, unit = _split(value, f"write for example {dimension.example}")
    remedy = f"write for example {dimension.example}"
    factor = _factor(unit, dimension) if unit else 1.0
    if unit:
        _note(dimension, unit)
    return _physical(_scaled(number, factor, remedy), dimension, remedy)


def read_level(value: object, dimensions: tuple[Dimension, ...]) -> tuple[float, Dimension | None]:
    """Return the SI value and which of the dimensions its unit has (``None`` for a bare number)."""
    remedy = "write for example " + " or ".join(dimension.example for dimension in dimensions)
    number, unit = _split(value, remedy)
    if not unit:
        return _physical(_finite(number, remedy), dimensions[0], remedy), None
    common = [dimension for dimension in dimensions if _common(unit, dimension) is not None]
    for dimension in common or dimensions:
        try:
            factor = _factor(unit, dimension)
        except UnitError:
            continue
        _note(dimension, unit)
        return _physical(_scaled(number, factor, remedy), dimension, remedy), dimension
    names = [dimension.with_article for dimension in dimensions]
    expected = ", ".join(names[:-1]) + (" or " if names[:-1] else "") + names[-1]
    try:
        given = _given(_units(unit, False))
    except UnitError as error:
        raise UnitError(error.message, _respelled(unit, dimensions) or remedy) from None
    remedy = _respelled(unit, dimensions) or remedy
    raise UnitError(f"must be {expected}, not {given}", remedy)


def is_in_gravities(unit: str) -> bool:
    """Whether a unit of an acceleration or of its density is made of standard gravity."""
    return _GRAVITY.search(unit) is not None


def read_sweep_rate(value: object) -> tuple[float, str]:
    """Return a sweep rate as octaves per second (``"oct/s"``) or Hz per second (``"Hz/s"``).

    >>> read_sweep_rate("120 oct/min")
    (2.0, 'oct/s')
    """
    remedy = "write for example 2 oct/min or 5 Hz/s"
    number, unit = _split(value, remedy)
    if not unit:
        raise UnitError("needs a unit, which decides whether the sweep is logarithmic or linear", remedy)
    if match := _RATE.fullmatch(unit):
        octaves = math.log2(10) if match[1].startswith("dec") else 1.0
        return _physical(_scaled(number, octaves / _SECONDS[match[2]], remedy), FREQUENCY, remedy), "oct/s"
    if (common := common_factor(unit, "Hz/s", gravity=False)) is not None:
        return _physical(_scaled(number, common, remedy), FREQUENCY, remedy), "Hz/s"
    try:
        units = _units(unit, False)
        hertz_per_second = _registry().parse_units("Hz/s")
        if dict(units.dimensionality) != dict(hertz_per_second.dimensionality):
            raise UnitError(f"must be a sweep rate, not {_given(units)}", remedy)
    except UnitError as error:
        raise UnitError(error.message, remedy) from None
    factor = _linear_factor(units, hertz_per_second)
    assert factor is not None
    return _physical(_scaled(number, factor / _turn(units), remedy), FREQUENCY, remedy), "Hz/s"


def _split(value: object, remedy: str) -> tuple[str | float, str]:
    """Return the number (as text if it was text) and the unit."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise UnitError("must be a number", remedy)
    unit = ""
    if isinstance(value, str):
        match = _NUMBER.fullmatch(value)
        if match is None:
            what = "is empty" if not value.strip() else "is not a number, or a number with a unit"
            raise UnitError(what, remedy)
        value, unit = match[1].replace("_", ""), match[2]
        if unit[:1] == ",":
            raise UnitError("is not a number with a unit", "write decimals with a point, as in 5.2 mm")
        unit = _PLAIN_POWER.sub(r"^\1", unit)
    return (value if isinstance(value, str) else _finite(value, remedy)), unit


def _finite(value: str | float, remedy: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError("must be finite", remedy)
    return number


def _physical(number: float, dimension: Dimension, remedy: str) -> float:
    """The number, if its size is that of a physical quantity: products of a few of them are floats."""
    largest = LARGEST**dimension.power
    if number != 0.0 and not 1.0 / largest <= abs(number) <= largest:
        limits = f"{1.0 / largest:g} to {largest:g} {dimension.unit}".rstrip()
        raise UnitError(f"is outside the range of physical quantities, {limits}", remedy)
    return number


def _scaled(given: str | float, factor: float, remedy: str) -> float:
    """Return number times factor, rounded once where the factor is a simple fraction.

    So 7 mm and 0.7 cm are the same number, and 4.2 g is the float nearest to 0.0042 kg.
    """
    number = _finite(given, remedy)
    if number == 0.0:
        return 0.0
    if factor == 1.0:
        return number
    ratio = _simple_fraction(factor)
    try:
        result = float(Fraction(given) * ratio) if ratio is not None else number * factor
    except OverflowError:
        result = math.inf
    return _finite(result, remedy)


@lru_cache(maxsize=1024)
def _simple_fraction(factor: float) -> Fraction | None:
    """Return the fraction a unit factor stands for (1/1000, 196133/20000), if there is a simple one."""
    large = factor if factor >= 1.0 else 1.0 / factor
    ratio = Fraction(large).limit_denominator(1_000_000)
    if abs(float(ratio) - large) > 4e-16 * large:
        return None
    return ratio if factor >= 1.0 else 1 / ratio


@cache
def _registry() -> Any:
    from pint import UnitRegistry

    return UnitRegistry()


@lru_cache(maxsize=1024)
def _units(text: str, gravity: bool) -> Any:
    """Parse a unit; ``gravity`` makes ``g`` standard gravity."""
    if _RATE.fullmatch(text):
        raise UnitError("is a sweep rate", "")
    if not _UNIT.fullmatch(text) or _TOWER.search(text) or len(text) > 60:
        raise UnitError("is not a number, or a number with a unit", "")
    expression = _OWN_NAMES.sub("revolution", text).replace("%", " percent ").replace("°", " degree ").strip()
    if gravity:
        expression = _GRAVITY.sub(r"\1g_0", expression)
    try:
        return _registry().parse_units(expression, as_delta=False)
    except Exception:  # pint raises a dozen types here, tokenizer errors among them
        raise UnitError(f"has the unit {text!r}, which is not known", "") from None


def _respelled(text: str, dimensions: tuple[Dimension, ...]) -> str:
    """The question whether an ill-spelt unit is another, 'hz' for Hz; empty if that has none of the dimensions."""
    meant = re.sub(r"[A-Za-zµμ]+", lambda name: _SPELLINGS.get(name[0].lower(), name[0]), text)
    if meant == text or all(_common(meant, dimension) is None for dimension in dimensions):
        return ""
    return f"did you mean {meant}?"


def _common(text: str, dimension: Dimension) -> float | None:
    """`_factor` of a common unit; None for every other."""
    if dimension in (ANGLE, NUMBER):
        return None
    if dimension.unit.endswith(_PER_ANGLE):
        text = text.removesuffix(_PER_ANGLE)
    return common_factor(text, dimension.unit.removesuffix(_PER_ANGLE), gravity=dimension.gravity)


@lru_cache(maxsize=1024)
def _factor(text: str, dimension: Dimension) -> float:
    """Return how many SI units of ``dimension`` one of the unit is."""
    if (common := _common(text, dimension)) is not None:
        return common
    remedy = f"write for example {dimension.example}"
    try:
        units = _units(text, dimension.gravity)
    except UnitError as error:
        raise UnitError(error.message, _respelled(text, (dimension,)) or remedy) from None
    registry = _registry()
    target = registry.parse_units(dimension.unit)
    if dimension is LENGTH and re.fullmatch(r"mils?", text):
        remedy = "mil is an angle here; give thousandths of an inch as 200 thou or 0.2 in"
    remedy = _respelled(text, (dimension,)) or remedy
    wrong = UnitError(f"must be {dimension.with_article}, not {_given(units)}", remedy)
    if dict(units.dimensionality) != dict(target.dimensionality):
        raise wrong
    angular = _is_angular(units)
    if dimension.unit.startswith("rad"):
        if not angular:
            raise wrong
    elif angular and dimension is not FREQUENCY and not (dimension.unit.endswith(_PER_ANGLE) and _per_angle(units)):
        raise wrong
    if dimension is NUMBER:
        raise wrong
    factor = _linear_factor(units, target)
    if factor is None:
        raise wrong
    return factor / _turn(units) if dimension is FREQUENCY else factor


def _linear_factor(units: Any, target: Any) -> float | None:
    """Return the factor of a conversion; None for units with an offset or a logarithm (degC, dB)."""
    quantity = _registry().Quantity
    try:
        none, one, two = (float(quantity(value, units).to(target).magnitude) for value in (0.0, 1.0, 2.0))
    except Exception:  # pint has its own errors for these units
        return None
    return one if none == 0.0 and math.isclose(two, 2.0 * one) else None


def _is_angular(units: Any) -> bool:
    return any(name in _ANGULAR_NAMES or name.endswith(("radian", "degree")) for name in units._units)


def _per_angle(units: Any) -> bool:
    """Whether every angle of a unit is in its denominator, once."""
    return all(power == -1 for name, power in units._units.items() if name in _ANGULAR_NAMES)


def _turn(units: Any) -> float:
    """Return the angle in a turn if the frequency is given by an angle, else 1."""
    return 2.0 * math.pi if _is_angular(units) else 1.0


def _given(units: Any) -> str:
    """Name the dimension that was given."""
    for dimension in _NAMED:
        target = _registry().parse_units(dimension.unit)
        if dict(units.dimensionality) == dict(target.dimensionality):
            if not units.dimensionality:
                return ANGLE.with_article if _is_angular(units) else RATIO.with_article
            return dimension.with_article
    return f"a quantity in {units:~}"


_NAMED = (
    LENGTH,
    AREA,
    SECOND_MOMENT,
    MASS,
    DENSITY,
    PRESSURE,
    STIFFNESS,
    CUBIC_STIFFNESS,
    DASHPOT,
    ROTATIONAL_DASHPOT,
    VISCOUS_PER_LENGTH,
    TIME,
    FREQUENCY,
    RATIO,
    FORCE,
    ENERGY,
    VELOCITY,
    ACCELERATION,
)
