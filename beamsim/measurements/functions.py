"""Function types: what the values of a measured channel are functions of, and how they were made from a signal.

The numbers are those of data set 58 of universal files (https://www.ceas3.uc.edu/sdrluff, "Function at Nodal DOF").
Files that state no number state a unit: ``g^2/Hz`` is a density, ``g/N`` a frequency response.
"""

from __future__ import annotations

import re
from enum import StrEnum

from beamsim.scenario import units
from beamsim.scenario.units import Dimension


class FunctionType(StrEnum):
    """Function types by their names in text."""

    TIME_HISTORY = "time history"
    SPECTRUM = "amplitude spectrum"
    FREQUENCY_RESPONSE = "frequency response function"
    TRANSMISSIBILITY = "transmissibility"
    POWER_DENSITY = "power spectral density"
    ENERGY_DENSITY = "energy spectral density"
    AMPLITUDE_DENSITY = "amplitude spectral density"
    AUTO_SPECTRUM = "auto spectrum"
    CROSS_SPECTRUM = "cross spectrum"
    COHERENCE = "coherence"
    MULTIPLE_COHERENCE = "multiple coherence"
    PARTIAL_COHERENCE = "partial coherence"
    SHOCK_SPECTRUM = "shock response spectrum"
    AUTO_CORRELATION = "auto correlation"
    CROSS_CORRELATION = "cross correlation"
    IMPULSE_RESPONSE = "impulse response"
    PROBABILITY_DENSITY = "probability density"
    CUMULATIVE_DISTRIBUTION = "cumulative distribution"
    PEAKS_AND_VALLEYS = "count of peaks and valleys"
    STRESS_CYCLES = "stress-cycle curve"
    STRAIN_CYCLES = "strain-cycle curve"
    ORBIT = "orbit"
    MODE_INDICATOR = "mode indicator function"
    FORCE_PATTERN = "force pattern"
    PARTIAL_POWER = "partial power"
    EIGENVALUE = "eigenvalue"
    EIGENVECTOR = "eigenvector"
    FILTER = "finite impulse response filter"
    ORDER_FUNCTION = "order function"
    OTHER = "function of an unknown type"

    @property
    def with_article(self) -> str:
        """The name after a or an."""
        return f"{'an' if self[0] in 'aeiou' else 'a'} {self}"


RATIOS = (FunctionType.FREQUENCY_RESPONSE, FunctionType.TRANSMISSIBILITY)
"""Functions that give an amplitude when they are multiplied by the level at which they were measured."""

BY_NUMBER = {
    1: FunctionType.TIME_HISTORY, 2: FunctionType.AUTO_SPECTRUM, 3: FunctionType.CROSS_SPECTRUM,
    4: FunctionType.FREQUENCY_RESPONSE, 5: FunctionType.TRANSMISSIBILITY, 6: FunctionType.COHERENCE,
    7: FunctionType.AUTO_CORRELATION, 8: FunctionType.CROSS_CORRELATION, 9: FunctionType.POWER_DENSITY,
    10: FunctionType.ENERGY_DENSITY, 11: FunctionType.PROBABILITY_DENSITY, 12: FunctionType.SPECTRUM,
    13: FunctionType.CUMULATIVE_DISTRIBUTION, 14: FunctionType.PEAKS_AND_VALLEYS, 15: FunctionType.STRESS_CYCLES,
    16: FunctionType.STRAIN_CYCLES, 17: FunctionType.ORBIT, 18: FunctionType.MODE_INDICATOR,
    19: FunctionType.FORCE_PATTERN, 20: FunctionType.PARTIAL_POWER, 21: FunctionType.PARTIAL_COHERENCE,
    22: FunctionType.EIGENVALUE, 23: FunctionType.EIGENVECTOR, 24: FunctionType.SHOCK_SPECTRUM,
    25: FunctionType.FILTER, 26: FunctionType.MULTIPLE_COHERENCE, 27: FunctionType.ORDER_FUNCTION,
}  # fmt: skip
"""Function types by their number in data set 58; 0 is general or unknown."""

MEASURED = (
    units.ACCELERATION, units.VELOCITY, units.LENGTH, units.FORCE, units.MOMENT, units.PRESSURE, units.ANGLE,
    units.ANGULAR_VELOCITY, units.ANGULAR_ACCELERATION,
)  # fmt: skip
"""Dimensions of motions and loads."""

_DENSITIES = (
    *units.LEVEL_PSD,
    units.MOMENT_PSD,
    Dimension("velocity spectral density", "m^2/s", "1 (m/s)^2/Hz"),
    Dimension("displacement spectral density", "m^2 s", "1 mm^2/Hz"),
)
_SQUARES = tuple(
    Dimension(f"squared {each.name}", unit, "", gravity=each.gravity)
    for each, unit in (
        (units.ACCELERATION, "m^2/s^4"), (units.VELOCITY, "m^2/s^2"), (units.LENGTH, "m^2"), (units.FORCE, "N^2"),
    )
)  # fmt: skip

_RATIOS = tuple(Dimension(name, unit, "") for name, unit in (
    ("accelerance", "1/kg"), ("mobility", "s/kg"), ("receptance", "s^2/kg"),
))  # fmt: skip

_PER_HZ = re.compile(r"(/|per)\s*\(?\s*[mk]?Hz\b|[mk]?Hz\s*(\^|\*\*)?\s*\(?[-⁻][1¹]", re.IGNORECASE)
_PER_ROOT_HZ = re.compile(r"(√|sqrt|rt|root)\W*\(?\s*[mk]?Hz|Hz\)?\s*(\^|\*\*)\s*\(?-?(0?\.5|1/2)", re.IGNORECASE)
_SECONDS_PER_HZ = re.compile(r"\bs(ec)?\s*/\s*[mk]?Hz", re.IGNORECASE)
_SQUARED = re.compile(r"\(.+\)\s*(\^2|\*\*2|²)")

_WORDS = [
    (re.compile(pattern), function)
    for pattern, function in (
        (r"partial coherence", FunctionType.PARTIAL_COHERENCE),
        (r"multiple coherence", FunctionType.MULTIPLE_COHERENCE),
        (r"coherence|koh[äa]renz|coh[ée]rence", FunctionType.COHERENCE),
        (r"energy spectral density|esd", FunctionType.ENERGY_DENSITY),
        (r"csd|cpsd|cross (power )?spectr(um|al density)", FunctionType.CROSS_SPECTRUM),
        (r"auto ?(power ?)?spectrum|power ?spectrum", FunctionType.AUTO_SPECTRUM),
        (r"a?psd|asd|(power|acceleration) spectral density|spectral density", FunctionType.POWER_DENSITY),
        (r"srs|shock response spectrum|shock spectrum", FunctionType.SHOCK_SPECTRUM),
        (r"transmissibility", FunctionType.TRANSMISSIBILITY),
        (r"frf|frequency response function|transfer function|accelerance|inertance|mobility|receptance",
         FunctionType.FREQUENCY_RESPONSE),
    )
    for pattern in [rf"(?<![a-zäé0-9])({pattern})(?![a-zäé0-9])"]
]  # fmt: skip


def is_unit_of(unit: str, *dimensions: Dimension) -> bool:
    """Whether a text is a unit of one of the dimensions."""
    try:
        units.read_level(f"1 {unit}", dimensions)
    except units.UnitError:
        return False
    return bool(unit.strip())


def ratio_of(unit: str) -> tuple[str, str] | None:
    """Numerator and denominator of a unit in which one measured quantity is divided by another.

    >>> ratio_of("m/s^2/N"), ratio_of("g/g"), ratio_of("m/s^2")
    (('m/s^2', 'N'), ('g', 'g'), None)
    """
    for at in (match.start() for match in re.finditer("/", unit)):
        parts = unit[:at].strip(), unit[at + 1 :].strip()
        for numerator, denominator in (parts, tuple(part.strip("()[] ") for part in parts)):
            if all(is_unit_of(part, *MEASURED) for part in (numerator, denominator)):
                return numerator, denominator
    return None


def si_unit(unit: str, denominator: str = "") -> tuple[float, str]:
    """Size of a unit in SI units, and the SI unit, of any measured quantity, ratio or density.

    >>> si_unit("g"), si_unit("mm/N"), si_unit("g", "N")
    ((9.80665, 'm/s^2'), (0.001, 'm/N'), (9.80665, 'm/s^2/N'))

    Parameters
    ----------
    unit : of the values, or of the numerator of a ratio; may be empty.
    denominator : unit of the denominator, where it is stated apart.

    Returns
    -------
    float and str
        1 and the text itself if it is no unit of a measured quantity.
    """
    parts = (unit, denominator) if denominator else ratio_of(unit)
    if parts is not None:
        (above, numerator), (below, divisor) = (si_unit(part) for part in parts)
        return above / below, "1" if numerator == divisor else f"{numerator}/{divisor}"
    try:
        size, dimension = units.read_level(f"1 {unit}", (*MEASURED, *_DENSITIES, *_SQUARES, *_RATIOS))
    except units.UnitError:
        return 1.0, unit
    return (size, dimension.unit) if dimension is not None else (1.0, unit)


def function_over_frequency(name: str, unit: str) -> FunctionType:
    """Function type of values over frequency, by the words of their name and by their unit.

    >>> str(function_over_frequency("tip", "g^2/Hz")), str(function_over_frequency("tip", "g/N"))
    ('power spectral density', 'frequency response function')

    Parameters
    ----------
    name : of the channel; ``PSD tip`` is a density, whatever its unit.
    unit : of the values; empty where none is stated.

    Returns
    -------
    FunctionType
        An amplitude spectrum where neither says anything else.
    """
    words = name.lower().replace("_", " ")
    stated = next((function for pattern, function in _WORDS if pattern.search(words)), None)
    if stated is not None:
        return stated
    if _PER_ROOT_HZ.search(unit):
        return FunctionType.AMPLITUDE_DENSITY
    if _SECONDS_PER_HZ.search(unit):
        return FunctionType.ENERGY_DENSITY
    if _PER_HZ.search(unit) or is_unit_of(unit, *_DENSITIES):
        return FunctionType.POWER_DENSITY
    if ratio_of(unit) is not None or is_unit_of(unit, *_RATIOS):
        return FunctionType.FREQUENCY_RESPONSE
    if _SQUARED.fullmatch(unit.strip()) or is_unit_of(unit, *_SQUARES):
        return FunctionType.AUTO_SPECTRUM
    return FunctionType.SPECTRUM
