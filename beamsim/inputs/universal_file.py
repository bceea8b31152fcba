"""Units in universal files (UFF): what the format says where a data set has no labels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

UNITS_OF_DATA = {8: "m", 11: "m/s", 12: "m/s^2", 13: "N"}
"""SI unit of the ordinate by its specific data type."""
_AXES = {17: "s", 18: "Hz"}  # the format has no other units of time


def axis_unit_of_uff(record: Mapping[str, Any]) -> str:
    """Unit of the abscissa of a data set 58 by its specific data type; empty where that is unknown."""
    return _AXES.get(int(record.get("abscissa_spec_data_type", 0)), "")


def units_are_si(record: Mapping[str, Any]) -> bool:
    """Whether a data set 164 says that lengths are in metres and forces in newtons."""
    return float(record.get("length", 0.0)) == float(record.get("force", 0.0)) == 1.0
