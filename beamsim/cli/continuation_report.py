"""What the table of a continuation tells beyond the entries of the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.cli.report import Labelled, Views, in_units
from beamsim.orbits.branch import special_name
from beamsim.plots.style import amount, level_text, scale_for

SHOWN = 12  # special points, branches


def _branches(result: ContinuationResult, count: int) -> list[dict[str, Any]]:
    rows = []
    for branch in result.branches[:SHOWN]:
        off = result.off_centre(branch)
        mean = "" if off is None else f"the mean of {off[0]} reaches {amount(off[1], 'm', 3)}"
        rows.append({
            **_level(result, branch.level), "period": branch.period_multiple, "points": branch.parameter.size,
            "stable": int(branch.stable.sum()), "broken symmetry": mean,
            "ended": str(branch.outcome.displayed(scale_for)),
        })  # fmt: skip
    return [*rows, *_more(count)]


def _more(count: int) -> list[dict[str, Any]]:
    return [{"": f"and {count - SHOWN} more in the file"}] if count > SHOWN else []


def _level(result: ContinuationResult, level: float) -> dict[str, str]:
    return {"level": "" if np.isnan(level) else level_text(level, result.level_unit).removeprefix("level ")}


def _parameter(value: float, unit: str, digits: int = 6) -> str:
    """A value of what is varied: frequencies, which are compared, to all digits asked for."""
    return f"{value:.{digits}g} Hz" if unit == "Hz" else amount(value, unit, digits)


def _special_points(result: ContinuationResult, points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those of motions of the excitation's own period."""
    own_period = [point for point in points if point["period_multiple"] == 1]
    return [
        {
            "kind": special_name(point["kind"]), "of": point["snubber"],
            "at": _parameter(point["parameter"], result.unit, 8), **_level(result, point["level"]),
        }
        for point in own_period[:SHOWN]
    ] + _more(len(own_period))  # fmt: skip


def _peaks(result: ContinuationResult, peaks: Sequence[dict[str, Any]]) -> Labelled:
    rows = [
        {
            "probe": peak["probe"], "displacement": amount(peak["value_m"], "m", 5),
            "at": _parameter(peak["parameter"], result.unit), **_level(result, peak["level"]), "kind": peak["kind"],
            "period": peak.get("period_multiple", 1),  # files of earlier versions have only motions of period 1
        }
        for peak in peaks
    ]  # fmt: skip
    curves = [
        {"": "stepped" if curve.steady else "swept", "direction": curve.direction, **_level(result, curve.level),
         "source": curve.source}
        for curve in result.overlay.values()
    ]  # fmt: skip
    return Labelled({"": rows, "overlay": curves})


def _folds(result: ContinuationResult, curves: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    units = dict.fromkeys(("smallest_parameter", "largest_parameter"), result.second_unit)
    return [in_units(curve, units, 5) for curve in curves]


def _solver(result: ContinuationResult, time: float) -> str:
    return f"{result.method.replace('_', ' ')}, processor time {amount(time, 's')}"


def _outputs(result: ContinuationResult, peaks: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, str]]:
    """By output its largest magnitude in the stable motions, where, and what it is."""
    outputs = result.branches[0].outputs if result.branches else {}
    return {
        name: {
            "peak": amount(peak["value"], outputs[name].unit), "at": _parameter(peak["parameter"], result.unit),
            "of": outputs[name].quantity.replace("_", " "), "on": outputs[name].at,
        }
        for name, peak in peaks.items()
    }  # fmt: skip


VIEWS: Views = {
    "peak_output": _outputs,
    "branches": _branches,
    "special_points": _special_points,
    "peaks": _peaks,
    "fold_curves": _folds,
    "multiple_scales": lambda result, levels: [{**s, **_level(result, s["level"])} for s in levels],
    "processor_time_s": _solver,
}
