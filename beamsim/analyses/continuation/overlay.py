"""Curves of sweeps that are drawn over branches of periodic motions, with the peaks of every cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamsim.analyses.sweep.layouts import CURVES, CYCLES, FOLLOWED, UNITS
from beamsim.analyses.sweep.result import SweepCurve
from beamsim.errors import ScenarioError
from beamsim.labelled import Dataset, Layout, Variable
from beamsim.typing import Floats

_CURVE, _CYCLE = ("curve",), ("cycle",)
_FOLLOWED, _UNITS = {**FOLLOWED, "output": "output"}, {**UNITS, "output": "{unit}"}
_COLUMNS = ("kind", "direction", "level_index", "level")
OVERLAY = Layout(
    "overlay",
    "The curves of sweeps that are drawn over the branches.",
    {
        **{name: CURVES.variables[name] for name in ("curve", *_COLUMNS)},
        "source": Variable(_CURVE, "", "file that it was read from; empty if it was computed with the branches", str),
        "title": Variable(_CURVE, "", "title of its scenario", str),
    },
    optional=True,
)
OVERLAY_CYCLES = Layout(
    "overlay_cycles",
    "Peaks of every cycle of these curves; NaN at places that a sweep does not have.",
    {
        "cycle": CYCLES.variables["cycle"],
        "curve": CYCLES.variables["curve"]._replace(names="overlay/curve"),
        **{name: CYCLES.variables[name] for name in ("frequency_hz", "probe", "snubber", "output")},
        **{
            f"peak_{quantity}": Variable(
                (dim, *_CYCLE), _UNITS[quantity],
                f"largest magnitude of the {quantity.replace('_', ' ')} in a cycle", optional=True,
            )
            for quantity, dim in _FOLLOWED.items()
        },
    },
    optional=True,
)  # fmt: skip


class OverlayCurve(NamedTuple):
    """Curve of a swept or stepped sine that is drawn over branches."""

    curve: str  # its name
    kind: str  # swept_sine or stepped
    direction: str
    level_index: int
    level: float
    source: str  # source file; empty if it was computed with the branches
    title: str  # of its scenario
    frequency_hz: Floats  # (C,) Hz, of its cycles
    peaks: Mapping[tuple[str, str], tuple[str, Floats]]  # by quantity and place: unit and (C,) peaks


def overlay_curve(curve: SweepCurve, name: str, source: str, title: str) -> OverlayCurve:
    """Convert a curve of a sweep to an overlay curve.

    Parameters
    ----------
    curve : curve of the sweep.
    name : unique name of the curve.
    source, title : source file and title of the sweep.
    """
    peaks = {}
    for quantity in _FOLLOWED:
        for place in curve.places(quantity):
            values = curve.channel(quantity, place)
            peaks[quantity, place] = values.unit, values.peak
    of = (curve.kind, curve.direction, curve.level_index, curve.level)
    return OverlayCurve(name, *of, source, title, curve.frequency_hz, peaks)


def overlay_datasets(curves: Sequence[OverlayCurve], level_unit: str) -> dict[str, Dataset]:
    """Datasets of overlay curves; empty without curves.

    Raises
    ------
    ScenarioError
        If a snubber or an output has different units in two sweeps.
    """
    if not curves:
        return {}
    sizes = [curve.frequency_hz.size for curve in curves]
    values: dict[str, Any] = {
        "cycle": 1 + np.arange(sum(sizes)), "curve": np.repeat(np.arange(len(curves)), sizes),
        "frequency_hz": np.concatenate([curve.frequency_hz for curve in curves]),
    }  # fmt: skip
    units: dict[tuple[str, str], str] = {}
    for key, (unit, _) in (each for curve in curves for each in curve.peaks.items()):
        if units.setdefault(key, unit) != unit:
            raise ScenarioError.at(
                "--overlay", f"{key[1]} is in {units[key]} in one sweep and in {unit} in another", "leave one out"
            )
    for quantity, dim in _FOLLOWED.items():
        places = [place for of, place in units if of == quantity]
        if places:
            unknown = ("", np.nan)
            rows = [
                np.concatenate([
                    np.full(curve.frequency_hz.size, curve.peaks.get((quantity, place), unknown)[1]) for curve in curves
                ])
                for place in places
            ]  # fmt: skip
            values |= {dim: places, f"peak_{quantity}": np.array(rows)}
    words = {
        "snubber": [{"force_unit": unit} for (quantity, _), unit in units.items() if quantity == "force"],
        "output": [{"unit": unit} for (quantity, _), unit in units.items() if quantity == "output"],
    }
    of_curves = OVERLAY.table(curves, [{"level_unit": level_unit}], curve=[curve.curve for curve in curves])
    return {"overlay": of_curves, "overlay_cycles": OVERLAY_CYCLES.dataset(values, words)}


def overlay_curves(datasets: Mapping[str, Dataset]) -> dict[str, OverlayCurve]:
    """Overlay curves of a result, by name."""
    if "overlay" not in datasets:
        return {}
    described, cycles = datasets["overlay"], datasets["overlay_cycles"]
    columns = {name: described[name].values.tolist() for name in OVERLAY.variables}
    ends = np.searchsorted(cycles["curve"].values, np.arange(len(described.labels("curve")) + 1)).tolist()
    curves = []
    for k, (first, end) in enumerate(pairwise(ends)):
        rows = cycles.isel(cycle=slice(first, end))
        peaks = {
            (quantity, place): (of.unit, of.values)
            for quantity in _FOLLOWED
            for place, of in rows.by_label(f"peak_{quantity}").items()
            if not np.isnan(of.values).all()
        }
        about = {name: values[k] for name, values in columns.items()}
        curves.append(OverlayCurve(**about, frequency_hz=rows["frequency_hz"].values, peaks=peaks))
    return {curve.curve: curve for curve in curves}
