"""What the result files of periodic motions share: the root's attributes, stability, special points."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.store import schema
from beamsim.store.identification import put
from beamsim.store.schema import Field

if TYPE_CHECKING:
    from beamsim.analyses.nnm_results import NormalModeResult
    from beamsim.analyses.orbit_events import OrbitEvent
    from beamsim.analyses.response_results import FrequencyResponse

__all__ = ["NUMBER", "write_root", "write_special", "write_stability"]

NUMBER = Field("point", "1", "number of the point along the branch")
_EVENT = Field("event", "1", "number of the special point")


def write_root(file: h5py.File, result: NormalModeResult | FrequencyResponse, command: str) -> None:
    """Write what every result file carries."""
    from beamsim import __version__

    file.attrs.update(
        {
            "schema_version": schema.SCHEMA_VERSION,
            "beamsim_version": result.provenance.get("beamsim", __version__),
            "command": command,
            "scenario": result.scenario.to_yaml(),
            "title": result.title,
            "status": result.status,
            "created": result.created,
            "wall_time_s": result.wall_time_s,
            "warnings": json.dumps(list(result.warnings), ensure_ascii=False),
            "provenance": json.dumps(dict(result.provenance), ensure_ascii=False),
        }
    )


def write_stability(group: h5py.Group, stable: Any, multipliers: Any, number: h5py.Dataset) -> None:
    """Write stability and Floquet multipliers along a branch."""
    flags = put(group, Field("stable", "1", "whether the motion is stable"), stable.astype(np.uint8), number)
    flags.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
    flags.attrs["flag_meanings"] = "unstable stable"
    put(group, Field("floquet_multipliers_real", "1", "Floquet multipliers, real part"), multipliers.real, number)
    put(group, Field("floquet_multipliers_imag", "1", "Floquet multipliers, imaginary part"), multipliers.imag, number)


def write_special(group: h5py.Group, special: Sequence[OrbitEvent], unit: str) -> None:
    """Write the special points of a branch."""
    own = group.create_group("special_points")
    number = put(own, _EVENT, np.arange(1, len(special) + 1), scale=True)
    text = h5py.string_dtype("utf-8")
    put(own, Field("kind", "1", "kind of special point"), np.array([e.kind for e in special], dtype=text), number)
    put(own, Field("snubber", "1", "snubber that grazes"), np.array([e.snubber for e in special], dtype=text), number)
    for field in (
        Field("parameter", unit, "parameter of the branch"), Field("frequency_hz", "Hz", "frequency"),
        Field("time_s", "s", "time in the period of a grazing"),
    ):  # fmt: skip
        put(own, field, np.array([getattr(e, field.name) for e in special], dtype=float), number)
