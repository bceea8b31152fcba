"""The layout of a result file: names, units and long names, in one place.

``/`` carries the attributes `ROOT_ATTRIBUTES`. Groups of one probe or snubber have its name (a slash
in it becomes ``∕``) and carry the true name and its ``index`` in the scenario as attributes; a
spectrum is in ``/spectra/<probe>`` when it is of the absolute acceleration and in
``/spectra/<probe>/<quantity>`` otherwise. Truth values are stored as unsigned bytes with CF
``flag_values`` and ``flag_meanings``.

``/summary`` has no datasets, only attributes under the names of the summary. Numbers and texts are
native attributes; everything else (per-probe values, lists, truth values, nothing) is a JSON text, and the
attribute ``json_encoded`` lists the names of those, separated by spaces. A NaN is ``null`` in JSON: inside a
list or an object read it back as NaN.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

SCHEMA_VERSION = 1
COMMAND = "run"
MAIN_QUANTITY = "absolute_acceleration"  # the one whose spectrum needs no subgroup
JSON_ENCODED = "json_encoded"

ROOT_ATTRIBUTES = (
    "schema_version",
    "beamsim_version",
    "command",
    "scenario",  # resolved YAML: the file alone can be run again
    "title",
    "method",
    "status",
    "outcome",  # code of the status
    "outcome_numbers",  # JSON object, the numbers that belong to it
    "created",
    "wall_time_s",
    "warnings",  # JSON list
    "provenance",  # JSON object, package -> version
)


class Field(NamedTuple):
    """One dataset; ``flags`` names the values of a stored truth value."""

    name: str
    units: str
    long_name: str
    flags: tuple[str, str] | None = None


TIME = Field("time", "s", "time")

PROBE = (
    Field("displacement", "m", "displacement relative to the base"),
    Field("absolute_displacement", "m", "absolute displacement"),
    Field("velocity", "m/s", "velocity relative to the base"),
    Field("absolute_acceleration", "m/s^2", "absolute acceleration"),
)

SNUBBER = (
    Field("force", "N", "contact force on the structure, positive when it pushes"),
    Field("penetration", "m", "penetration of the structure into the snubber"),
    Field("closed", "1", "whether the contact is closed", ("open", "closed")),
    Field("displacement", "m", "displacement of the structure at the snubber, relative to the base"),
    Field("velocity", "m/s", "velocity of the structure at the snubber, relative to the base"),
)

SPRING = (
    Field("stretch", "m", "stretch of the spring; to the ground the absolute displacement of the mass"),
    Field("force", "N", "force of the spring, positive where it pulls back a positive stretch"),
)

BASE = (
    Field("acceleration", "m/s^2", "acceleration of the base"),
    Field("displacement", "m", "displacement of the base"),
)

EVENT_NUMBER = Field("event", "1", "number of the contact event")
EVENTS = (
    Field("time", "s", "time of the contact event"),
    Field("snubber", "1", "index of the snubber, from 0"),
    Field("closing", "1", "whether the contact closes", ("opening", "closing")),
)

ENERGY = (
    Field("work_in", "J", "work done on the structure by the excitation, in the relative frame"),
    Field("dissipated", "J", "energy dissipated"),
    Field("stored", "J", "energy stored, kinetic and elastic, snubbers included"),
)

BEAM_SCALES = (
    Field("position", "m", "position along the beam"),
    Field("extreme_times", "s", "times at which the first probe is lowest and highest"),
)
BEAM = (
    Field("peak_bending_stress", "Pa", "largest absolute bending stress at any time"),
    Field("extreme_shapes", "m", "deflection when the first probe is lowest and highest"),
    Field("static_shape", "m", "deflection at static equilibrium"),
)

MODE_NUMBER = Field("mode", "1", "mode number")
MODES = (
    Field("open_frequencies_hz", "Hz", "natural frequencies with every contact open"),
    Field("closed_frequencies_hz", "Hz", "natural frequencies with every contact closed"),
    Field("damping_ratios", "1", "modal damping ratios of the open structure"),
    Field("shapes", "kg^-0.5", "mode shapes of the open structure, unit modal mass"),
)

LINE_NUMBER = Field("line", "1", "number of the line")
LINES = (
    Field("frequency_hz", "Hz", "frequency of the line"),
    Field("order", "1", "frequency over excitation frequency"),
    Field("amplitude", "", "amplitude of the line, zero to peak"),
    Field("amplitude_db", "dB", "20 log10(amplitude / max |x|)"),
    Field("phase_deg", "degree", "phase of the line as a sine of the run's time"),
    Field("kind", "1", "mean, fundamental, superharmonic, subharmonic or other"),
)


def spectrum_fields(quantity: str, unit: str) -> tuple[Field, Field, Field]:
    """Frequency axis, amplitude and level of a spectrum of ``quantity``."""
    named = quantity.replace("_", " ")
    return (
        Field("frequency_hz", "Hz", "frequency"),
        Field("amplitude", unit, f"single-sided peak amplitude of the {named}"),
        Field("amplitude_db", "dB", f"20 log10(amplitude / max |x|) of the {named}"),
    )


def group_name(name: str) -> str:
    """A probe's or snubber's name as an HDF5 link: no slash, not ``.``."""
    link = name.replace("/", "∕")
    return f"_{link}" if link.strip(".") == "" else link


def spectrum_group(probe: str, quantity: str) -> str:
    """Where the spectrum of a probe's quantity is."""
    base = f"spectra/{group_name(probe)}"
    return base if quantity == MAIN_QUANTITY else f"{base}/{quantity}"


def plain(value: Any) -> Any:
    """Nothing but Python's own types; numbers that are not finite become None, ready for strict JSON."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def encode_summary(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Summary as attributes, see the module's docstring."""
    attributes: dict[str, Any] = {}
    encoded = []
    for name, value in summary.items():
        if isinstance(value, (str, int, float, np.integer, np.floating)) and not isinstance(value, bool):
            attributes[name] = value
        else:
            attributes[name] = json.dumps(plain(value), ensure_ascii=False)
            encoded.append(name)
    attributes[JSON_ENCODED] = " ".join(encoded)
    return attributes


def decode_summary(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Inverse of `encode_summary`."""
    encoded = set(str(attributes[JSON_ENCODED]).split())
    summary: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in encoded:
            decoded = json.loads(value)
            summary[name] = _nan_for_null(decoded) if isinstance(decoded, (dict, list)) else decoded
        elif name != JSON_ENCODED:
            summary[name] = value.item() if isinstance(value, np.generic) else value
    return summary


def _nan_for_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _nan_for_null(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_nan_for_null(item) for item in value]
    return math.nan if value is None else value
