"""Rows about a damped structure at phase resonance on its nonlinear mode."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamsim.analyses.nnm.result import PhaseResonanceResult

STANDARD_GRAVITY = 9.80665  # m/s^2


def phase_resonance_rows(summary: dict[str, Any], result: PhaseResonanceResult) -> Iterator[tuple[str, str]]:
    """Label and text of every row, from ``phase_resonance`` of the summary and of the result."""
    unit = summary["unit"]
    for k, s in enumerate(summary["levels"]):
        head = f"{_level(s['level'], unit)}: "
        predicted = f"predicted {s['predicted_frequency_hz']:.6g} Hz, {s['predicted_amplitude_m']:.4g} m"
        if not s["found"]:
            yield "" if k else "phase resonance", f"{head}{predicted}; no exact motion found"
            continue
        kind = "stable" if s["stable"] else "unstable"
        yield (
            "" if k else "phase resonance",
            f"{head}{predicted}; found {s['frequency_hz']:.6g} Hz, {s['amplitude_m']:.4g} m at {summary['probe']} "
            f"({kind})",
        )
        if math.isfinite(s["level_for_amplitude"]):
            off = s["level_for_amplitude"] / s["level"] - 1.0
            yield (
                "",
                f"level predicted for the computed amplitude {_level(s['level_for_amplitude'], unit)} ({off:+.2%})",
            )
        yield "", f"peak of the response {s['peak_amplitude_m']:.4g} m at {s['peak_frequency_hz']:.6g} Hz"
        curve = result.motions[k].curve
        if curve is not None and not curve.outcome.complete:
            yield "", f"response curve {curve.outcome}"
    for k, s in enumerate(summary["levels"]):
        if s["periods"]:
            yield (
                "" if k else "in time",
                f"{_level(s['level'], unit)}: distance from the mode {s['departure_first_period']:.2g} in the first "
                f"period, {s['departure_last_period']:.2g} in the last of {s['periods']}",
            )
        else:
            yield "" if k else "in time", f"{_level(s['level'], unit)}: contacts chatter; not integrated in time"


def _level(value: float, unit: str) -> str:
    """A level of acceleration in g, others in SI."""
    return f"{value / STANDARD_GRAVITY:.5g} g" if unit == "m/s^2" else f"{value:.5g} {unit}"
