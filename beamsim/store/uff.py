"""Universal files: header, nodes, lines, modes and functions at degrees of freedom (data sets 151, 15, 82, 55, 58)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamsim.files import replacing
from beamsim.matrix_files.formats import DIRECTIONS
from beamsim.typing import Floats, Ints

# Codes of the universal file format: (specific data type, length exponent, force exponent).
ORDINATES = {
    "displacement": (8, 1, 0),
    "absolute_displacement": (8, 1, 0),
    "penetration": (8, 1, 0),
    "velocity": (11, 1, 0),
    "absolute_acceleration": (12, 1, 0),
    "acceleration": (12, 1, 0),
    "force": (9, 0, 1),
}
GENERAL, TIME_RESPONSE, FREQUENCY_RESPONSE = 0, 1, 4
_TIME, _FREQUENCY = 17, 18
LOAD_CODES = {"force": (13, 0, 1), "force_per_length": (0, -1, 1), "pressure": (15, -2, 1)}
"""Data type and exponents of length and force of the loads that a response may refer to."""
UP = 3  # +z: deflections are positive upwards


class Source(NamedTuple):
    """Origin of the records of one file."""

    title: str
    created: str  # ISO 8601
    maker: str


class Function(NamedTuple):
    """A quantity at one place over time or frequency."""

    quantity: str  # one of `ORDINATES`
    unit: str
    label: str  # first line of the record
    x: Floats  # s of a time response, otherwise Hz
    y: NDArray[Any]  # may be complex
    kind: int = TIME_RESPONSE
    over: str = ""  # of a frequency response the input: "acceleration" of the base, or one of `LOAD_CODES`


def record_58(source: Source, function: Function, name: str, node: int, direction: int = UP) -> dict[str, Any]:
    """One function at one place, for :mod:`pyuff`.

    An equally spaced abscissa is stored as start and increment with 6 digits; if that is not exact, the record is
    stored in binary (58b) with all abscissae.

    Parameters
    ----------
    source : of the file.
    function : what is recorded.
    name : of the probe or snubber.
    node, direction : where, and along which axis.

    Returns
    -------
    dict
        The data set.
    """
    specific, length_exponent, force_exponent = ORDINATES[function.quantity]
    of_frequency, x, y = function.kind != TIME_RESPONSE, function.x, function.y
    quantity = function.quantity.replace("_", " ")
    exact = False
    if x.size > 1:
        increment = (x[-1] - x[0]) / (x.size - 1)
        even = np.allclose(np.diff(x), increment, rtol=1e-9, atol=0.0) and increment > 0
        exact = bool(even) and all(abs(float(f"{v:.5e}") - v) <= 1e-12 * increment for v in (x[0], increment))
    below = {"": (0, 0, 0), "acceleration": (12, 1, 0), **LOAD_CODES}[function.over]
    return {
        "type": 58,
        "binary": 0 if exact else 1,
        "func_type": function.kind,
        "rsp_ent_name": _ascii(name, 10),
        "rsp_node": node,
        "rsp_dir": direction,
        "ref_ent_name": "NONE",
        "ref_node": 0,
        "ref_dir": 0,
        "id1": _ascii(function.label, 80),
        "id2": _ascii(source.title, 80),
        "id3": _date(source.created),
        "id4": _ascii(source.maker, 80),
        "abscissa_spacing": int(exact),
        "abscissa_spec_data_type": _FREQUENCY if of_frequency else _TIME,
        "abscissa_axis_lab": "Frequency" if of_frequency else "Time",
        "abscissa_axis_units_lab": "Hz" if of_frequency else "s",
        "ordinate_spec_data_type": specific,
        "ordinate_len_unit_exp": length_exponent,
        "ordinate_force_unit_exp": force_exponent,
        "ordinate_axis_lab": _ascii(quantity.capitalize(), 20),
        "ordinate_axis_units_lab": function.unit,
        "orddenom_spec_data_type": below[0],
        "orddenom_len_unit_exp": below[1],
        "orddenom_force_unit_exp": below[2],
        "x": np.array(x, dtype=float),
        "data": np.array(y, dtype=complex if np.iscomplexobj(y) else float),
    }


def header_151(source: Source, description: str = "") -> dict[str, Any]:
    """The header of a file: what it is of, and what wrote it."""
    import pyuff

    day, _, clock = _date(source.created).partition(" ")
    return dict(
        pyuff.prepare_151(
            model_name=_ascii(source.title, 80), description=_ascii(description, 80), db_app=_ascii(source.maker, 80),
            program=_ascii(source.maker, 80), date_db_created=day, time_db_created=clock, version_db1=0, version_db2=0,
            file_type=0, date_db_saved=day, time_db_saved=clock, date_db_written=day, time_db_written=clock,
        )
    )  # fmt: skip


def trace_lines(number: int, name: str, lines: Sequence[Ints]) -> dict[str, Any]:
    """The lines through the nodes of a body (data set 82): between two of them, as node 0, the pen is lifted."""
    lifted = [part for line in lines for part in (np.zeros(1, dtype=np.int64), line)][1:]
    nodes = np.concatenate(lifted)
    return {"type": 82, "trace_num": number, "color": 0, "id": _ascii(name, 80), "n_nodes": nodes.size, "nodes": nodes}


def record_55(
    source: Source, mode: int, frequency_hz: float, damping_ratio: float, nodes: Ints, deflection: Floats,
    direction: str | Sequence[str] = "z",
) -> dict[str, Any]:  # fmt: skip
    """A normal mode of unit modal mass: its deflection at nodes, in one direction or one for each (data set 55)."""
    along = np.broadcast_to(np.asarray(direction), nodes.shape)
    turning = not set(direction if not isinstance(direction, str) else (direction,)) <= set(DIRECTIONS[:3])
    components = DIRECTIONS if turning else DIRECTIONS[:3]
    moved = np.asarray(deflection, dtype=float)
    return {
        "type": 55, "id1": _ascii(source.title, 80), "id2": "NONE", "id3": _date(source.created),
        "id4": _ascii(source.maker, 80), "id5": f"mode {mode}", "model_type": 1, "analysis_type": 2,
        "data_ch": 3 if turning else 2, "spec_data_type": 8, "data_type": 2, "n_data_per_node": len(components),
        "load_case": 1, "mode_n": mode,
        "freq": frequency_hz, "modal_m": 1.0, "modal_damp_vis": damping_ratio, "modal_damp_his": 0.0,
        "node_nums": nodes.astype(float),
        **{f"r{k}": np.where(along == each, moved, 0.0) for k, each in enumerate(components, 1)},
    }  # fmt: skip


def write_uff(sets: Sequence[dict[str, Any]], path: Path) -> None:
    """Write data sets to a universal file, after the data set of the units (SI).

    Raises
    ------
    ResultFileError
        If the file cannot be written.
    """
    import pyuff

    units = pyuff.prepare_164(
        units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0
    )
    with replacing(path) as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the closing of binary sets to Python
        pyuff.UFF(str(temporary)).write_sets([units, *sets], mode="overwrite")


def _ascii(text: str, width: int) -> str:
    return " ".join(text.encode("ascii", "replace").decode().split())[:width] or "NONE"


def _date(created: str) -> str:
    try:
        return datetime.fromisoformat(created).strftime("%d-%b-%y %H:%M:%S").upper()
    except ValueError:
        return "NONE"
