"""Units in universal files (UFF): what the format says where a data set has no labels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from beamsim.inputs.headings import stated

_DATA = {8: "m", 11: "m/s", 12: "m/s^2", 13: "N"}  # SI unit of the ordinate by its specific data type
_AXES = {17: "s", 18: "Hz"}  # the format has no other units of time


def units_of_uff(record: Mapping[str, Any], in_si_units: Callable[[], bool]) -> tuple[str, str]:
    """Units of abscissa and ordinate of a data set 58: of its labels, else by its data types; empty if unknown.

    ``in_si_units`` is asked whether the file is in SI units, where the ordinate has no label.
    """
    axis, unit = (stated(str(record.get(f"{name}_axis_units_lab", ""))) for name in ("abscissa", "ordinate"))
    if not unit and in_si_units():
        unit = _DATA.get(int(record.get("ordinate_spec_data_type", 0)), "")
    return axis or _AXES.get(int(record.get("abscissa_spec_data_type", 0)), ""), unit


def is_in_si_units(file: Any) -> bool:
    """Whether a data set 164 of a file (``pyuff.UFF``) says that lengths are in metres and forces in newtons."""
    of_units = (file.read_sets(i) for i, kind in enumerate(file.get_set_types()) if int(kind) == 164)
    return any(float(s.get("length", 0.0)) == float(s.get("force", 0.0)) == 1.0 for s in of_units)
