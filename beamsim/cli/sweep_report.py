"""What the table of a sweep tells beyond the entries of the summary."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.cli.report import Labelled, Views
from beamsim.cli.tables import percent
from beamsim.plots.style import amount, scale_for


def _curves(result: SweepResult, peaks: Sequence[Mapping[str, Any]]) -> Labelled:
    """Every curve, and the peaks of its first probe."""
    curves, shown = [], []
    for curve in result.curves.values():
        first = next(iter(curve.displacement), "")
        kinds = () if curve.steady is None else curve.steady.kind
        steady = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        level = scale_for(result.scenario.level_unit, curve.level)
        of = f"{curve.level * level.factor:.4g} {level.unit}".rstrip()
        about = {"direction": curve.direction, "level": of, "points": curve.frequency_hz.size, "steady": steady}
        curves.append({"": curve.name, **about})
        own = [p for p in peaks if p["curve"] == curve.name and p["probe"] == first]
        shown += [{"": curve.name, **_peak(peak)} for peak in own[:6]]
    return Labelled({"": curves, f"peaks of {first}": shown or "none within the range"})


def _peak(peak: Mapping[str, Any]) -> dict[str, Any]:
    plain = peak["order"] == 1.0 or peak["kind"] in ("beat", "level step")
    order = "" if plain else str(Fraction(peak["order"]).limit_denominator(12))
    return {key: peak[key] for key in ("probe", "frequency_hz", "value_m", "kind")} | {"order": order}


def _largest(quantity: str, unit: str) -> Callable[[SweepResult, Mapping[str, Mapping[str, float]]], dict[str, str]]:
    """By curve and place the largest value and the frequency of the cycle that has it."""

    def texts(result: SweepResult, curves: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
        return {
            f"{curve} {name}": f"{amount(value, unit)}{at_frequency(result.curves[curve], quantity, name)}"
            for curve, values in curves.items()
            for name, value in values.items()
        }

    return texts


def at_frequency(curve: SweepCurve, quantity: str, name: str) -> str:
    """Where a curve has its largest value, for the text behind it.

    Parameters
    ----------
    curve : of the sweep.
    quantity : displacement, acceleration or force.
    name : of the probe or snubber.
    """
    envelope = getattr(curve, quantity).get(name)
    if envelope is None or not np.any(np.isfinite(envelope.peak)) or not np.nanmax(envelope.peak) > 0.0:
        return ""
    return f" at {curve.frequency_hz[np.nanargmax(envelope.peak)]:.4g} Hz"


def _solver(result: SweepResult, time: float) -> str:
    s = result.summary
    return f"{s['cycles']} cycles, {s['events']} contact events, processor time {amount(time, 's')}"


def _outputs(result: SweepResult, curves: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """By curve and output its peak, what it is and where."""
    return {
        f"{curve} {name}": f"{amount(peak, output.unit)}, {output.quantity.replace('_', ' ')}, {output.at}"
        for curve, peaks in curves.items()
        for name, peak in peaks.items()
        for output in [result.curves[curve].outputs[name]]
    }


def notch_texts(result: SweepResult, _: object = None) -> dict[str, str]:
    """By curve and limit the largest value, then the ranges in which the level is lowered."""
    rows = {}
    for curve in result.curves.values():
        if curve.notching is None:
            continue
        for limit in curve.notching.limits:
            largest = f"{amount(limit.largest, limit.unit)} at {limit.frequency_hz:.4g} Hz"
            ratio = f"{percent(limit.share)} of {amount(limit.limit, limit.unit)}"
            rows[f"{curve.name} {limit.name}"] = f"at most {largest}, {ratio}"
        for number, part in enumerate(curve.notching.ranges, 1):
            lowest = f"{amount(part.level, curve.notching.unit)} ({part.reduction_db:.1f} dB) at {part.at_hz:.4g} Hz"
            rows[f"{curve.name} range {number}"] = (
                f"{part.from_hz:.4g} to {part.to_hz:.4g} Hz by {part.limit}, lowest level {lowest}"
            )
    return rows


VIEWS: Views = {
    "notches": notch_texts,
    "peak_output": _outputs,
    "peak_displacement_m": _largest("displacement", "m"),
    "peak_acceleration_g": _largest("acceleration", "g"),
    "peak_force_n": _largest("force", "N"),
    "peaks": _curves,
    "processor_time_s": _solver,
}
