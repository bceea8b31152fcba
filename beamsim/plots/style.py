"""Numbers for people: units with a suitable prefix, or those that were chosen."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beamsim.outcomes import MOST_LISTED
from beamsim.scenario.units import STANDARD_GRAVITY
from beamsim.summaries import unit_in

ROUND_OFF = 1e-15  # in SI units; nothing that is shown can be known so small
_LONG_TIMES = (("years", 365.25 * 86400.0, 1.0), ("days", 86400.0, 2.0), ("h", 3600.0, 2.0), ("min", 60.0, 10.0))
_MOST_CHOSEN = 1e5  # of a chosen unit of time, above which a time is shown in a longer one

_FIRST_UNIT = re.compile(r"[^\W\d_]+(?:\^(\d+))?")  # with its power; 1/s has none
# Other units have a prefix already, or take none.
_WITH_PREFIX = frozenset({"m", "s", "kg", "g", "N", "Pa", "J", "W", "V", "A", "K", "rad", "B", "byte"})
_SHARES = ("share", "margin", "damping_ratio", "coverage")  # in names of numbers that are shown in percent
_PREFIXES = (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9), ("p", 1e-12))


class Scale(NamedTuple):
    """Factor by which SI values are multiplied to show them in ``unit``."""

    factor: float
    unit: str


_chosen: ContextVar[Mapping[str, tuple[float, str]]] = ContextVar("_chosen", default=MappingProxyType({}))


@contextmanager
def use_units(scales: Mapping[str, tuple[float, str]]) -> Iterator[None]:
    """Show quantities in chosen units: by SI unit the factor of SI values and the unit."""
    token = _chosen.set(scales)
    try:
        yield
    finally:
        _chosen.reset(token)


def plain_scale(unit: str) -> Scale:
    """A unit without prefix if no other is chosen, as axes of time and position have; of an acceleration g."""
    return Scale(*_chosen.get().get(unit, (1.0 / STANDARD_GRAVITY, "g") if unit == "m/s^2" else (1.0, unit)))


def scale_for(unit: str, *values: ArrayLike, digits: int = 4) -> Scale:
    """The chosen unit, else the SI prefix that brings the largest finite value, once it is rounded, to 1 to 1000.

    Accelerations are in g, their densities in g^2/Hz. Lengths are brought to 0.1 to 100, and have no prefix above
    metres; in ``m^2`` the prefix is squared. Times below a minute are not shown in minutes, and those above ten
    minutes in minutes, hours, days or years. Frequencies, which are compared, numbers without a unit (``1``), and
    units that have a prefix already or are none of SI, which outputs may be given in, are shown as they are.

    >>> scale_for("N/m", [151e3, 2e4]), scale_for("m^2", 2.5e-4), scale_for("1")
    (Scale(factor=0.001, unit='kN/m'), Scale(factor=1000000.0, unit='mm^2'), Scale(factor=1.0, unit=''))
    >>> scale_for("MPa", 0.02), scale_for("in", 0.02)
    (Scale(factor=1.0, unit='MPa'), Scale(factor=1.0, unit='in'))
    >>> scale_for("J", 0.99998).unit, scale_for("J", 0.9994).unit, scale_for("J", 0.9996, digits=3).unit
    ('J', 'mJ', 'J')

    Parameters
    ----------
    unit : SI; others are kept.
    values : in that unit, which are shown together.
    digits : significant digits in which they are shown: 0.99998 J is 1 J in four of them, not 1000 mJ.

    Returns
    -------
    Scale
        By which all of them are shown.
    """
    if unit == "m/s^2":
        return plain_scale("m/s^2")
    if unit == "m^2/s^3":
        factor, name = plain_scale("m/s^2")
        return Scale(factor**2, f"({name})^2/Hz" if "/" in name else f"{name}^2/Hz")
    if unit in ("", "1"):
        return Scale(1.0, "")
    sizes = (np.abs(np.asarray(v)) for v in values)
    largest = max((float(np.max(v, initial=0.0, where=np.isfinite(v))) for v in sizes), default=0.0)
    largest = float(f"{largest:.{digits}g}")
    if unit in _chosen.get() and (chosen := _chosen_scale(unit, largest)) is not None:
        return chosen
    first = _FIRST_UNIT.match(unit)
    if largest == 0.0 or first is None or first[0].partition("^")[0] not in _WITH_PREFIX:
        return Scale(1.0, unit)
    if (unit == "s" or unit.startswith("kg")) and (scale := _of_times_and_masses(unit, largest, digits)) is not None:
        return scale
    metres, power = unit.startswith("m"), int(first[1] or 1)
    allowed = [(prefix, size) for prefix, size in _PREFIXES if not (metres and size > 1.0)]
    smallest = 0.1 if metres else 1.0
    prefix, size = next((p for p in allowed if largest >= smallest * p[1] ** power), allowed[-1])
    return Scale(1.0 / size**power, prefix + unit)


def _chosen_scale(unit: str, largest: float) -> Scale | None:
    """The scale that a scenario chooses for a unit; None where times are shown better in another one."""
    chosen = Scale(*_chosen.get()[unit])
    shown = largest * chosen.factor
    suits = unit != "s" or ((chosen.factor >= 1.0 or shown >= 1.0) and shown < _MOST_CHOSEN)
    return chosen if suits else None


def _of_times_and_masses(unit: str, largest: float, digits: int) -> Scale | None:
    """The scale of long times and of masses below 1 kg, which are grams; None of others, whose prefix is that of SI."""
    if unit == "s":
        return next((Scale(1.0 / size, name) for name, size, least in _LONG_TIMES if largest >= least * size), None)
    if largest >= 1.0:
        return Scale(1.0, unit)
    grams = scale_for(unit[1:], 1e3 * largest, digits=digits)
    return Scale(1e3 * grams.factor, grams.unit)


def percent(share: float, digits: int = 3) -> str:
    """A share in percent.

    >>> percent(0.9969, 2), percent(0.0031, 2), percent(12.345)
    ('100 %', '0.31 %', '1230 %')
    """
    return f"{float(f'{100 * share:.{digits}g}'):g} %"


def level_text(level: float, unit: str) -> str:
    """An excitation level with its unit: accelerations in g, factors on a profile as they are.

    >>> level_text(19.6133, "m/s^2"), level_text(0.1, "N"), level_text(0.5, "")
    ('level 2 g', 'level 100 mN', 'level 0.5')
    """
    scale = scale_for(unit, level)
    return f"level {level * scale.factor:.4g} {scale.unit}".rstrip()


def is_known(value: Any) -> bool:
    """Whether an entry of a summary has a value; result files hold nan for none."""
    return value is not None and not (isinstance(value, float) and math.isnan(value))


def margin_text(margin: float | None, value: float, decibels: float | None = None) -> str:
    """A margin in percent, or dB where it has these; that of a value of 0 is infinite, which result files cannot hold.

    Parameters
    ----------
    margin : limit / value - 1.
    value : that is limited.
    decibels : of the margin of a curve.

    Returns
    -------
    str
    """
    if value == 0.0:
        return "infinite"
    if not is_known(margin) or margin is None:
        return "unknown"
    if decibels is not None:
        return f"{decibels:+.1f} dB"
    percent = 100.0 * margin
    return f"{percent:+.3g} %" if abs(percent) < 999.5 else f"{percent:+.0f} %"


def amount(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with SI prefix and unit; an acceleration in g, whole numbers and those without a unit as they are.

    A unit chosen by `use_units` comes first. What is below `ROUND_OFF` in SI units is shown as zero.

    >>> amount(2e-4, "m"), amount(151.1e3, "N/m"), amount(19.6133, "m/s^2"), amount(2e9, "B")
    ('0.2 mm', '151.1 kN/m', '2 g', '2 GB')

    Parameters
    ----------
    value : in ``unit``; None or nan is unknown.
    unit : SI, or g.
    digits : significant digits; frequencies have at least six.

    Returns
    -------
    Number and unit, ``unknown`` or ``infinity``.
    """
    if value is None or not math.isfinite(value):
        return "infinity" if value is not None and math.isinf(value) else "unknown"
    if unit == "Hz":  # frequencies are compared, so that all are in the same unit
        return f"{value:.{max(digits, 6)}g} Hz"
    if unit in ("", "1"):
        return str(value) if isinstance(value, int) else f"{value + 0.0:.{digits}g}"
    if unit in ("g", "m/s^2"):
        scale = plain_scale("m/s^2")
        return f"{value * (STANDARD_GRAVITY if unit == 'g' else 1.0) * scale.factor:.{digits}g} {scale.unit}"
    if abs(value) < ROUND_OFF:
        return f"0 {unit}"
    scale = scale_for(unit, value, digits=digits)
    return f"{value * scale.factor + 0.0:.{digits}g} {scale.unit}"  # no minus sign before zero


def value_text(name: str, value: Any, unit: str = "", digits: int = 4) -> str:
    """The text of a value that has this name, with the unit of the name if no other is given; empty where not known.

    >>> value_text("peak_force_n", 2.5), value_text("contact_share", 0.25), value_text("stable", True)
    ('2.5 N', '25 %', 'yes')
    >>> value_text("rate_hz", [1.0, 2.0]), value_text("energy_j", [0.5, 0.99998])
    ('1, 2 Hz', '0.5, 1 J')
    >>> value_text("margin", -0.4032), value_text("damping_ratios", [0.01, 0.0127])
    ('-40.3 %', '1, 1.27 %')

    Parameters
    ----------
    name : of the value, whose ending says its unit.
    value : truth, text, number, several of them, or None.
    unit : SI, or g; empty for that of the name.
    digits : of several numbers.

    Returns
    -------
    In one line.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if not is_known(value):
        return ""
    unit = unit or unit_in(name) or "1"
    is_share = unit == "1" and any(word in name for word in _SHARES) and not name.endswith("_at")
    if isinstance(value, (list, tuple)):
        if any(isinstance(item, str) for item in value):
            return ", ".join(map(str, value))
        if any(isinstance(item, (list, tuple)) for item in value):
            return "; ".join(value_text(name, item, unit, digits) for item in value[:MOST_LISTED])
        known = [item for item in value if is_known(item)]
        scale = Scale(100.0, "%") if is_share else scale_for(unit, known, digits=digits)
        shown = [f"{item * scale.factor:.{digits}g}" if is_known(item) else "-" for item in value[:MOST_LISTED]]
        return f"{', '.join(shown)}{', …' if len(value) > MOST_LISTED else ''} {scale.unit}".strip()
    return percent(value) if is_share else amount(value, unit)


def extent(low: float, high: float, unit: str) -> str:
    """A range as `amount` shows its ends, with the digits in which they differ; one number where they do not.

    >>> extent(20.0, 30.0, "Hz"), extent(20.26750001, 20.26750002, "Hz"), extent(1e-3, 1e-3, "m")
    ('20 to 30 Hz', '20.26750001 to 20.26750002 Hz', '1 mm')
    >>> extent(1.883, 2.032, "N s/m")
    '1.883 to 2.032 N s/m'

    Parameters
    ----------
    low, high : in ``unit``.
    unit : SI, or g.

    Returns
    -------
    Both ends with their unit, or one number with it.
    """
    for digits in (4, 6, 8, 10):
        first, last = amount(low, unit, digits), amount(high, unit, digits)
        if first != last:
            number, _, prefixed = first.partition(" ")
            return f"{number if prefixed and last.endswith(f' {prefixed}') else first} to {last}"
    return amount(low, unit)


def round_length(value: float) -> float:
    """1, 2 or 5 times a power of ten, not above the value."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(digit for digit in (5.0, 2.0, 1.0, 0.5) if digit * power <= value) * power)
