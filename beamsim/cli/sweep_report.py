"""Texts of the table of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.cli.report import SHARED, Row, Texts, base_correction, gapping, percent
from beamsim.plots.style import amount, level_text

PEAKS_SHOWN = 6


def _curves(result: SweepResult, peaks: list[dict[str, Any]]) -> Iterator[Row]:
    """Every curve, with the peaks of its first probe."""
    for curve in result.curves.values():
        first = next(iter(curve.displacement), "")
        steady = ""
        if curve.steady is not None:
            kinds = curve.steady.kind
            steady = "; " + ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        points = f"{curve.frequency_hz.size} points{steady}"
        level = level_text(curve.level, result.scenario.level_unit)
        shown = [p for p in peaks if p["curve"] == curve.name and p["probe"] == first][:PEAKS_SHOWN]
        told = f"peaks of {first}:" if shown else f"no peak of {first} within the range"
        yield "", f"{curve.name}: {curve.direction}, {level}, {points}; {told}"
        yield from (("", f"  {_peak(peak)}") for peak in shown)


def _peak(peak: Mapping[str, Any]) -> str:
    order = (
        ""
        if peak["order"] == 1.0 or peak["kind"] in ("beat", "level step")
        else f" of order {Fraction(peak['order']).limit_denominator(12)}"
    )
    return f"{peak['frequency_hz']:8.2f} Hz  {amount(peak['value_m'], 'm'):>10}  {peak['kind']}{order}"


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


def _contact(_: SweepResult, shares: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    return {f"{curve} {name}": percent(share) for curve, of in shares.items() for name, share in of.items()}


def _solver(result: SweepResult, time: float) -> str:
    s = result.summary
    return f"{s['cycles']} cycles, {s['events']} contact events, processor time {amount(time, 's')}"


def _sliding(_: SweepResult, curves: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, str]:
    return {
        f"{curve} {name}": f"at most {s['most_slides_per_cycle']:.3g} slides, {amount(s['largest_distance_m'], 'm')}, "
        f"loss {amount(s['largest_energy_lost_j'], 'J')}, wear power {amount(s['largest_wear_power_w'], 'W')}"
        for curve, contacts in curves.items()
        for name, s in contacts.items()
    }


def _impacts(_: SweepResult, curves: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, str]:
    return {
        f"{curve} {name}": f"at most {s['most_per_cycle']:.3g}, {amount(s['longest_mean_contact_time_s'], 's')}, "
        f"impulse {amount(s['largest_impulse_n_s'], 'N s')}, loss {amount(s['largest_energy_lost_j'], 'J')}, "
        f"{amount(s['highest_penetration_rate_m_s'], 'm/s')}"
        for curve, snubbers in curves.items()
        for name, s in snubbers.items()
    }


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


TEXTS: Texts = {
    "notches": notch_texts,
    "peak_output": _outputs,
    "impacts": _impacts,
    "sliding": _sliding,
    "peak_displacement_m": _largest("displacement", "m"),
    "peak_acceleration_g": _largest("acceleration", "g"),
    "peak_force_n": _largest("force", "N"),
    **SHARED,
    "base_correction_share": base_correction,
    "gapping": gapping,
    "peaks": _curves,
    "contact_share": _contact,
    "processor_time_s": _solver,
}
