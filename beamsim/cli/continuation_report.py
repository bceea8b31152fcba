"""Texts of the table of a continuation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.cli.report import SHARED, Row, Texts, pair, percent
from beamsim.orbits.branch import special_name
from beamsim.plots.style import amount, level_text, scale_for

SHOWN = 12  # special points of a branch
MOST_BRANCHES = 12


def _branches(result: ContinuationResult, count: int) -> Iterator[Row]:
    for b in result.branches[:MOST_BRANCHES]:
        points = f"{b.parameter.size} points, {int(b.stable.sum())} of them stable"
        off = result.off_centre(b)
        broken = (
            "" if off is None else f"; its symmetry is broken, the mean of {off[0]} reaches {amount(off[1], 'm', 3)}"
        )
        status = b.outcome.displayed(scale_for)
        yield "", f"{_branch(b.level, result.level_unit, b.period_multiple)}: {points}; {status}{broken}"
    if count > MOST_BRANCHES:
        yield "", f"and {count - MOST_BRANCHES} more in the file"


def _branch(level: float, unit: str, period_multiple: int) -> str:
    known = "" if np.isnan(level) else f"{level_text(level, unit)}, "
    return f"{known}period {period_multiple}"


def _special_points(result: ContinuationResult, points: Sequence[dict[str, Any]]) -> Iterator[Row]:
    """Those of motions of the excitation's own period."""
    own_period = [point for point in points if point["period_multiple"] == 1]
    for event in own_period[:SHOWN]:
        place = _parameter(event["parameter"], result.unit, 8)
        yield "", f"{_special_point(event)} at {place}{_at_level(event, result.level_unit)}"
    if len(own_period) > SHOWN:
        yield "", f"and {len(own_period) - SHOWN} more in the file"


def _at_level(item: dict[str, Any], unit: str) -> str:
    return "" if np.isnan(item["level"]) else f", {level_text(item['level'], unit)}"


def _special_point(event: dict[str, Any]) -> str:
    snubber = f" of {event['snubber']}" if event["snubber"] else ""
    return f"{special_name(event['kind'])}{snubber}"


def _parameter(value: float, unit: str, digits: int = 6) -> str:
    """A value of what is varied: frequencies, which are compared, to all digits asked for."""
    return f"{value:.{digits}g} Hz" if unit == "Hz" else amount(value, unit, digits)


def _peaks(result: ContinuationResult, peaks: Sequence[dict[str, Any]]) -> Iterator[Row]:
    for peak in peaks:
        at = f"{_parameter(peak['parameter'], result.unit)}{_at_level(peak, result.level_unit)}"
        multiple = peak.get("period_multiple", 1)  # files of earlier versions have only motions of period 1
        kind = peak["kind"] if multiple == 1 else f"{peak['kind']}, period {multiple}"
        yield "", f"{peak['probe']}  {amount(peak['value_m'], 'm', 5)} at {at} ({kind})"
    for curve in result.overlay.values():
        how = "swept" if curve.steady is None else "stepped"
        yield (
            "overlay",
            f"{how} {curve.direction}, {level_text(curve.level, result.level_unit)} {curve.source}".rstrip(),
        )


def _folds(result: ContinuationResult, curves: Sequence[dict[str, Any]]) -> Iterator[Row]:
    for curve in curves:
        reach = curve["status"]
        if curve["points"]:
            ends = curve["smallest_parameter"], curve["largest_parameter"]
            extent = " to ".join(_parameter(end, result.second_unit, 5) for end in ends)
            grazing = f", {curve['touching']} grazing" if curve["touching"] else ""
            reach = (
                f"{result.second_parameter} {extent}, {curve['smallest_hz']:.5g} to {curve['largest_hz']:.5g} Hz, "
                f"{curve['points']} points{grazing}"
            )
        yield "", f"from {curve['start_hz']:.6g} Hz: {reach}"


def _expansion(result: ContinuationResult, levels: Sequence[dict[str, Any]]) -> Iterator[Row]:
    for s in levels:
        points = f"{s['points']} points, {s['stable_points']} of them stable"
        yield "", f"{level_text(s['level'], result.level_unit)}: mode {s['mode']}, {points}"
        if not s["factor"]:
            yield "", "no exact motion was found near the expansion for any factor on springs, damping and force"
            continue
        factor, (leading, first) = s["factor"][0], s["difference"][0]
        at = "at factor 1" if factor == 1.0 else f"at a factor of {factor:.2g}, the largest sufficiently small one"
        yield "", f"differs by {leading:.2g} (leading) and {first:.2g} (first order) {at}"
        orders = s["observed_orders"]
        agrees = "agrees" if s["stability_agrees"] else "differs somewhere"
        yield "", f"observed orders {pair(orders)} (expected 1 and 2); stability {agrees}"


def _solver(result: ContinuationResult, time: float) -> str:
    return f"{result.method.replace('_', ' ')}, processor time {amount(time, 's')}"


def _outputs(result: ContinuationResult, peaks: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """By output its largest magnitude in the stable motions, where, and what it is."""
    texts = {}
    for name, peak in peaks.items():
        output = result.branches[0].outputs[name]
        what = f"{output.quantity.replace('_', ' ')}, {output.at}"
        at = _parameter(peak["parameter"], result.unit)
        texts[name] = f"{amount(peak['value'], output.unit)} at {at} (stable), {what}"
    return texts


TEXTS: Texts = {
    **SHARED,
    "peak_output": _outputs,
    "branches": _branches,
    "special_points": _special_points,
    "peaks": _peaks,
    "fold_curves": _folds,
    "multiple_scales": _expansion,
    "neglected_harmonics": lambda _, share: f"at most {percent(share, 2)} of the motion",
    "processor_time_s": _solver,
}
