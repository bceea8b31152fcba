"""What the result files of periodic motions share: stability, special points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from beamsim.store.datasets import put, texts
from beamsim.store.schema import Field

if TYPE_CHECKING:
    from beamsim.analyses.orbit_events import OrbitEvent

NUMBER = Field("point", "1", "number of the point along the branch")
_EVENT = Field("event", "1", "number of the special point")


def write_stability(group: h5py.Group, stable: Any, multipliers: Any, number: h5py.Dataset) -> None:
    """Write stability and Floquet multipliers along a branch."""
    flags = put(group, Field("stable", "1", "whether the motion is stable"), stable.astype(np.uint8), number)
    flags.attrs["flag_values"] = np.array([0, 1], dtype=np.uint8)
    flags.attrs["flag_meanings"] = "unstable stable"
    count = np.arange(1, multipliers.shape[1] + 1)
    which = put(group, Field("multiplier", "1", "number of the Floquet multiplier"), count, scale=True)
    for part, values in (("real", multipliers.real), ("imag", multipliers.imag)):
        text = f"Floquet multipliers, {'real' if part == 'real' else 'imaginary'} part"
        put(group, Field(f"floquet_multipliers_{part}", "1", text), values, number, which)


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


def read_stability(group: h5py.Group) -> dict[str, Any]:
    """Inverse of `write_stability`, as fields of a branch."""
    real, imag = (group[f"floquet_multipliers_{part}"][()] for part in ("real", "imag"))
    return {"stable": group["stable"][()].astype(bool), "floquet_multipliers": real + 1j * imag}


def read_special(group: h5py.Group) -> tuple[OrbitEvent, ...]:
    """Inverse of `write_special`."""
    from beamsim.analyses.orbit_events import OrbitEvent

    own = group["special_points"]
    columns = (own["kind"], own["snubber"])
    numbers = (own[name][()].tolist() for name in ("parameter", "frequency_hz", "time_s"))
    return tuple(
        OrbitEvent(kind, parameter, frequency, snubber, time)
        for kind, snubber, parameter, frequency, time in zip(*map(texts, columns), *numbers, strict=True)
    )
