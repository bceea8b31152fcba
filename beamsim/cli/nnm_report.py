"""What the table of ``beamsim nnm`` tells beyond the entries of the summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.cli.report import Views, in_units
from beamsim.cli.tables import percent
from beamsim.orbits.branch import special_name
from beamsim.plots.style import amount, scale_for

UNITS = {"stiffness_factor": "1", "energy": "J", "frequency": "Hz"}  # of what the path is followed in


def _backbone(result: NormalModeResult, mode: int) -> str:
    s, path = result.summary, result.parameter.replace("_", " ")
    return f"mode {mode}, {s['points']} points in {path}, {s['stable_points']} of them stable"


def _along(result: NormalModeResult, record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with the values of what the path is followed in under its name; kinds and causes in words."""
    path, unit = result.parameter, UNITS[result.parameter]
    told = {key.replace("parameter", path): value for key, value in record.items()}
    told |= {key: special_name(value) for key, value in record.items() if key == "kind"}
    if "ratio" in told:
        ratio, mode = told.pop("ratio"), told.pop("mode")
        told["cause"] = f"{ratio}:1 with mode {mode}" if ratio and mode else "of high order, not traced"
    if any(key.startswith(path) for key in told if key != path):  # its value stands there, with its unit
        told.pop(path, None)
    return in_units(told, dict.fromkeys((path, "start", "end"), unit), 6)


def _each_along(result: NormalModeResult, records: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [_along(result, record) for record in records]


def _full_period(result: NormalModeResult, s: Mapping[str, Any]) -> dict[str, Any]:
    branches = [
        {**branch, "start": _along(result, branch["start"]), "end": _along(result, branch["end"])}
        for branch in s["never_at_rest"]
    ]
    return {**s, "symmetry_breakings": _each_along(result, s["symmetry_breakings"]), "never_at_rest": branches}


def _expansion(_: NormalModeResult, s: Mapping[str, Any]) -> dict[str, Any]:
    """The expansion, and how exact motions differ at the largest factors: at first and at second order."""
    columns = ("factor", "frequency_hz", "exact_frequency_hz", "frequency_difference", "initial_difference")
    factors = range(min(len(s["factor"]), 4))
    by_factor = [{name: s[name][k] for name in columns} for k in factors]
    return {name: value for name, value in s.items() if name not in columns} | {"by factor": by_factor}


def _phase_resonance(result: NormalModeResult, summary: Mapping[str, Any]) -> dict[str, Any]:
    unit, found = summary["unit"], result.phase_resonance
    levels = []
    for k, level in enumerate(summary["levels"]):
        curve = None if found is None else found.motions[k].curve
        told = "" if curve is None or curve.outcome.complete else str(curve.outcome.displayed(scale_for))
        levels.append(in_units(level, dict.fromkeys(("level", "level_for_amplitude"), unit), 5) | {"curve": told})
    return {**summary, "levels": levels}


def _spectrum(result: NormalModeResult, drift: float) -> str:
    if drift <= 1e-6:  # over the periods of the spectrum
        return ""
    return (
        f"after {result.summary['motion_periods']} periods the state differs by {percent(drift)}: "
        "the motion is unstable, and the spectral lines are broadened"
    )


def _share(result: NormalModeResult, smallest: float) -> str:
    if smallest >= 0.5:  # of the energy in the mode
        return ""
    at = float(result.backbone.parameter[int(np.argmin(result.backbone.share))])
    path = result.parameter.replace("_", " ")
    return f"mode {result.mode} holds {percent(smallest)} of it at {path} {amount(at, UNITS[result.parameter])}"


def _solver(result: NormalModeResult, time: float) -> str:
    over = "full-period" if "full_period" in result.summary else "half-period"
    return f"{over} shooting, processor time {amount(time, 's')}"


VIEWS: Views = {
    "mode": _backbone,
    "start": _along,
    "end": _along,
    "internal_resonances": _each_along,
    "jumps": _each_along,
    "special_points": _each_along,
    "requested_points": _each_along,
    "full_period": _full_period,
    "multiple_scales": _expansion,
    "phase_resonance": _phase_resonance,
    "motion_drift": _spectrum,
    "largest_residual": lambda _, residual: f"{residual:.2g}",
    "smallest_share": _share,
    "processor_time_s": _solver,
}
