"""Names and units in the headings of measured columns: ``time (ms)``, ``acceleration [g]``, ``tip_mm``."""

from __future__ import annotations

import re

TIME_NAMES = ("time", "t", "zeit", "temps")
_FREQUENCY_NAMES = ("frequency", "f", "freq", "frequenz", "fréquence")

_BRACKETS = re.compile(r"(.*?)\s*[(\[]([^)\]]*)[)\]]\s*")
_ENDING = re.compile(r"(.+?)_(m_per_s2|m_per_s|m/s\^2|m/s2|m/s|mm|m|n|g|s|ms|us|hz|khz)", re.IGNORECASE)
_SPELLED = {"m_per_s2": "m/s^2", "m_per_s": "m/s", "m/s2": "m/s^2", "n": "N", "hz": "Hz", "khz": "kHz"}


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is empty where the heading has none.

    >>> split_heading("time (ms)"), split_heading("tip_m_per_s2"), split_heading("channel 3")
    (('time', 'ms'), ('tip', 'm/s^2'), ('channel 3', ''))
    """
    if match := _BRACKETS.fullmatch(heading):
        unit = match[2].strip()
        return match[1], "" if unit.isdigit() else unit
    if match := _ENDING.fullmatch(heading.strip()):
        ending = match[2].lower()
        return match[1], _SPELLED.get(ending, ending)
    return heading.strip(), ""


def stated(unit: str) -> str:
    """The unit of a label in a file; empty where it says none."""
    return "" if unit.strip().upper() in ("", "NONE", "1", "-") else unit.strip()


def is_time(heading: str) -> bool:
    """Whether a heading is that of a time axis."""
    return split_heading(heading)[0].lower() in TIME_NAMES


def is_frequency(heading: str) -> bool:
    """Whether a heading is that of a frequency axis."""
    return split_heading(heading)[0].lower() in _FREQUENCY_NAMES


def label_of(name: str) -> str:
    """Name of the channel of a data set.

    >>> label_of("probes/tip/velocity")
    'tip velocity'
    """
    return re.sub(r"^(probes|snubbers|spectra)/", "", name.strip("/")).replace("/", " ")
