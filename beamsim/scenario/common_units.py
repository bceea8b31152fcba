"""Factors of the units that most cases are written in, so that these cases do without importing pint.

Products and quotients of metres, grams, seconds, newtons, pascals, joules and hertz with their prefixes, of minutes,
inches, percent and standard gravity. Everything else, angles and errors included, is left to pint.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import lru_cache

Exponents = tuple[int, int, int]  # of metre, kilogram and second

_PREFIXES = {"G": 9, "M": 6, "k": 3, "c": -2, "m": -3, "u": -6, "µ": -6, "μ": -6, "n": -9}
_WITH_PREFIX: dict[str, tuple[Fraction, Exponents]] = {
    "m": (Fraction(1), (1, 0, 0)),
    "g": (Fraction(1, 1000), (0, 1, 0)),
    "s": (Fraction(1), (0, 0, 1)),
    "N": (Fraction(1), (1, 1, -2)),
    "Pa": (Fraction(1), (-1, 1, -2)),
    "J": (Fraction(1), (2, 1, -2)),
    "Hz": (Fraction(1), (0, 0, -1)),
}
_ALONE: dict[str, tuple[Fraction, Exponents]] = {
    "min": (Fraction(60), (0, 0, 1)),
    "in": (Fraction(254, 10000), (1, 0, 0)),
}
_GRAVITY = Fraction(980665, 100000)
_FACTOR = re.compile(r"\s*([*·/]?)\s*(1(?=\s*/)|[A-Za-zµμ]+)(?:(?:\^|\*\*)([1-4]))?")


def common_factor(text: str, target: str, *, gravity: bool) -> float | None:
    """How many of a unit one of another unit is; None where one of them is not a common one or they do not fit.

    Parameters
    ----------
    text, target : the unit given, and the SI unit of the quantity.
    gravity : whether ``g`` is standard gravity.
    """
    given, expected = _parse(text, gravity), _parse(target, False)
    if given is None or expected is None or given[1] != expected[1]:
        return None
    return float(given[0] / expected[0])


@lru_cache(maxsize=1024)
def _parse(text: str, gravity: bool) -> tuple[Fraction, Exponents] | None:
    """SI factor and exponents of a unit."""
    if text == "%":
        return Fraction(1, 100), (0, 0, 0)
    factor, exponents, position = Fraction(1), (0, 0, 0), 0
    while position < len(text.rstrip()):
        match = _FACTOR.match(text, position)
        if match is None or (match[1] and not position):
            return None
        unit = _unit(match[2], gravity) if match[2] != "1" or not position else None
        if unit is None:
            return None
        power = int(match[3] or 1) * (-1 if match[1] == "/" else 1)
        factor *= unit[0] ** power
        m, kg, s = (e + power * u for e, u in zip(exponents, unit[1], strict=True))
        exponents, position = (m, kg, s), match.end()
    return factor, exponents


def _unit(symbol: str, gravity: bool) -> tuple[Fraction, Exponents] | None:
    if symbol == "1":
        return Fraction(1), (0, 0, 0)
    if gravity and symbol in ("g", "mg"):
        return _GRAVITY / (1000 if symbol == "mg" else 1), (1, 0, -2)
    if symbol in _ALONE or symbol in _WITH_PREFIX:
        return _ALONE.get(symbol) or _WITH_PREFIX[symbol]
    prefix, base = symbol[:1], _WITH_PREFIX.get(symbol[1:])
    if base is None or prefix not in _PREFIXES:
        return None
    return base[0] * Fraction(10) ** _PREFIXES[prefix], base[1]
