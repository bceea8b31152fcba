"""Functions in universal files (UFF, data set 58), and their units: of labels, else what the format says."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.measurements.headings import stated
from beamsim.measurements.signal import MeasuredSignal, MeasurementError

_AXES = {17: "s", 18: "Hz"}  # the format has no other units of time
# By how many of them an SI unit is: what data set 164 states.
_LENGTHS = {1.0: "m", 1e3: "mm", 1e2: "cm", 1 / 0.0254: "in", 1 / 0.3048: "ft"}
_FORCES = {1.0: "N", 1e3: "mN", 1e2: "cN", 1 / 4.4482216: "lbf", 1 / 9.80665: "kgf"}


def data_sets(path: Path) -> list[dict[str, Any]]:
    """All data sets of a file that pyuff knows.

    Raises
    ------
    MeasurementError
        If it cannot be read.
    """
    import pyuff

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            known = [i for i, kind in enumerate(file.get_set_types()) if int(kind) in (15, 55, 58, 82, 164)]
            return [file.read_sets(i) for i in known]
    except Exception as error:  # pyuff raises exceptions of all types on damaged files
        raise MeasurementError(f"cannot be read as a universal file ({error})", "export it again") from None


def read_uff(path: Path) -> list[MeasuredSignal]:
    """The functions of a file.

    Raises
    ------
    MeasurementError
        If it cannot be read, or has none.
    """
    sets = data_sets(path)
    units = next(({"length": _named(s.get("length"), _LENGTHS), "force": _named(s.get("force"), _FORCES)}
                  for s in sets if s["type"] == 164), {})  # fmt: skip
    signals = [_signal(each, units, path) for each in sets if each["type"] == 58]
    if not signals:
        raise MeasurementError("contains no dataset 58", "export functions at nodal degrees of freedom (dataset 58)")
    return signals


def _signal(record: Mapping[str, Any], units: Mapping[str, str], path: Path) -> MeasuredSignal:
    kind = int(record.get("abscissa_spec_data_type", 0))
    axis_unit, unit = (stated(str(record.get(f"{name}_axis_units_lab", ""))) for name in ("abscissa", "ordinate"))
    texts = [str(record.get(key, "")).strip() for key in ("id1", "rsp_ent_name")]
    name = next((text for text in texts if text.upper() not in ("", "NONE")), f"node {record.get('rsp_node', 0)}")
    y = np.asarray(record["data"])
    return MeasuredSignal(
        name, np.asarray(record["x"], dtype=float), y.astype(complex if np.iscomplexobj(y) else float), kind == 18,
        unit or _unit_of(int(record.get("ordinate_spec_data_type", 0)), units), str(path), f"of {name}",
        axis_unit or _AXES.get(kind, ""),
    )  # fmt: skip


def _unit_of(kind: int, units: Mapping[str, str]) -> str:
    """Unit of an ordinate by its specific data type; empty if unknown."""
    if kind == 13:
        return units.get("force", "")
    per_time = {8: "", 11: "/s", 12: "/s^2"}.get(kind)
    return units["length"] + per_time if per_time is not None and units.get("length") else ""


def _named(factor: Any, names: Mapping[float, str]) -> str:
    """Name of the unit of which an SI unit has so many; files state few digits."""
    value = float(factor or 0.0)
    return next((name for known, name in names.items() if abs(value / known - 1) < 1e-3), "")
