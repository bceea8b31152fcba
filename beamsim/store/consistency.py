"""Result files whose curves contradict their own figures, which no reading notices: they are damaged.

A motion that leaves the range of numbers is cut before that and has an outcome, so that no stored curve holds NaN; and
none goes beyond the peak in the summary. Both are looked at before a result is drawn, animated or exported.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamsim.errors import ResultFileError
from beamsim.store.flat import Items, last, parent
from beamsim.store.results import open_with_items

FAR = 2.0  # times the peak: those of stepped and of stopped motions are peaks of some of the samples
_OF_CURVES = ("peak_displacement", "max_displacement", "min_displacement")
BEYOND = 1e100  # in its unit: no input within the range of physical quantities (1e30, 1e-30 Hz) leads there


def open_consistent(path: Path | str, kind: str = "") -> Any:
    """Read a result file as `open_result` does, and look at its curves.

    Raises
    ------
    ResultFileError
        Also where a curve holds NaN or infinity, goes far beyond its peak, or beyond all that inputs lead to.
    """
    result, items = open_with_items(path, kind)
    times = items["/time"].values if "/time" in items else np.zeros(1)
    if not 0.0 <= times[0] <= times[-1] < np.inf:
        raise ResultFileError(f"{path}: damaged (its times are not those of a run); run the case again")
    for place, item in items.items():
        if not _is_curve(items, place, result.complete):
            continue
        largest, peak = float(np.max(np.abs(item.values), initial=0.0)), _peak(items, result.summary, place)
        name = f"{last(place).replace('_', ' ')} in {parent(place)}"
        if not np.isfinite(largest):
            reason = f"the {name} holds values that are not finite"
        elif peak is not None and largest > FAR * peak:
            reason = f"the {name} reaches {largest:.4g} {item.unit}, and its peak is {peak:.4g} {item.unit}"
        elif largest > BEYOND:
            reason = f"the {name} reaches {largest:.4g} {item.unit}"
        else:
            continue
        raise ResultFileError(f"{path}: damaged ({reason}); run the case again")
    return result


def _is_curve(items: Items, place: str, complete: bool) -> bool:
    """Whether an array is a quantity over the time of a run, or the displacement of a probe along a complete curve.

    Energies are left out: where they are not finite, the outcome says so.
    """
    item = items[place]
    if item.values is None or item.values.dtype.kind != "f" or parent(place) == "/energy":
        return False
    return item.axes == ("/time",) or (complete and last(place) in _OF_CURVES and bool(item.axes))


def _peak(items: Items, summary: Mapping[str, Any], place: str) -> float | None:
    """The largest displacement of a probe in the summary; None where it has none."""
    probe, folder = items[parent(place)].attributes.get("name"), parent(parent(place))
    if last(folder) != "probes" or last(place) not in ("displacement", *_OF_CURVES):
        return None
    curve, peaks = parent(folder), summary.get("peak_displacement_m")
    if peaks is not None:
        return (peaks if curve == "/" else peaks.get(last(curve), {})).get(probe)  # type: ignore[no-any-return]
    return max((peak["value_m"] for peak in summary.get("peaks", ()) if peak["probe"] == probe), default=None)
