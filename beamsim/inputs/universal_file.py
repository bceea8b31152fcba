"""Units in universal files (UFF): what the format says where a data set has no labels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from beamsim.inputs.headings import stated

_AXES = {17: "s", 18: "Hz"}  # the format has no other units of time
# By how many of them an SI unit is: what data set 164 states.
_LENGTHS = {1.0: "m", 1e3: "mm", 1e2: "cm", 1 / 0.0254: "in", 1 / 0.3048: "ft"}
_FORCES = {1.0: "N", 1e3: "mN", 1e2: "cN", 1 / 4.4482216: "lbf", 1 / 9.80665: "kgf"}
_CLOSE = 1e-3  # relative; files state few digits


class UnitsOfFile(NamedTuple):
    """Units of lengths and forces of a file; empty where they are none that is known."""

    length: str
    force: str

    def of_data(self, kind: int) -> str:
        """Unit of an ordinate by its specific data type; empty if unknown."""
        if kind == 13:
            return self.force
        per_time = {8: "", 11: "/s", 12: "/s^2"}.get(kind)
        return "" if per_time is None or not self.length else self.length + per_time


def units_of_uff(record: Mapping[str, Any], of_file: Callable[[], UnitsOfFile | None]) -> tuple[str, str]:
    """Units of abscissa and ordinate of a data set 58: of its labels, else by its data types; empty if unknown.

    ``of_file`` is asked for the units of the file, where the ordinate has no label.
    """
    axis, unit = (stated(str(record.get(f"{name}_axis_units_lab", ""))) for name in ("abscissa", "ordinate"))
    if not unit and (units := of_file()) is not None:
        unit = units.of_data(int(record.get("ordinate_spec_data_type", 0)))
    return axis or _AXES.get(int(record.get("abscissa_spec_data_type", 0)), ""), unit


def units_of_file(file: Any) -> UnitsOfFile | None:
    """Units that data set 164 of a file (``pyuff.UFF``) states; None where it has none."""
    sets = (file.read_sets(i) for i, kind in enumerate(file.get_set_types()) if int(kind) == 164)
    return next((UnitsOfFile(_named(s.get("length"), _LENGTHS), _named(s.get("force"), _FORCES)) for s in sets), None)


def _named(factor: Any, names: Mapping[float, str]) -> str:
    value = float(factor or 0.0)
    return next((name for known, name in names.items() if abs(value / known - 1) < _CLOSE), "")
