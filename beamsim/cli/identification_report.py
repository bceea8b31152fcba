"""Texts of the table of ``beamsim identify-stiffness``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from beamsim.analyses.identify.result import FrequencyTable, IdentificationResult, ParameterEstimate
from beamsim.cli.report import Row, Texts, counted, percent
from beamsim.plots.style import amount

SENSITIVITIES_SHOWN = 6
SUPPORTS_SHOWN = 4


def _newtons(value: float) -> str:
    return amount(value, "N/m", 5)


def _updated(result: IdentificationResult, _: Any) -> Iterator[Row]:
    if result.update is None:
        return
    for parameter in result.update.parameters:
        yield "", _parameter(parameter)
    for path, choice in result.update.choices.items():
        yield "", f"{path}: {choice}"
    for text, misfit in result.update.alternatives[:SUPPORTS_SHOWN]:
        yield "supports tried", f"{text}: misfit {misfit:.4g}"
    for k, text in enumerate(_frequencies(result.update.before)):
        yield "" if k else "without, before", text


def _parameter(p: ParameterEstimate) -> str:
    text = f"{p.parameter}: {p.before:.5g} -> {p.value:.5g}"
    if math.isfinite(p.standard_deviation):
        text += f" +- {p.standard_deviation:.2g} ({p.interval[0]:.5g} to {p.interval[1]:.5g})"
    return text + (" at its bound" if p.at_bound else "")


def _frequencies(table: FrequencyTable | None) -> Iterator[str]:
    if table is None:
        return
    for mode, measured, predicted, difference in zip(
        table.mode, table.measured_hz, table.predicted_hz, table.difference_percent, strict=True
    ):
        known = f", measured {measured:.5g} Hz, difference {difference:+.2f} %" if math.isfinite(measured) else ""
        yield f"mode {mode}: predicted {predicted:.5g} Hz{known}"


def _table(name: str) -> Any:
    return lambda result, _: [("", text) for text in _frequencies(getattr(result, name))]


def _mac(_: IdentificationResult, mac: Sequence[Sequence[float]]) -> Iterator[Row]:
    for i, row in enumerate(mac, 1):
        yield "", f"shape {i}: " + ", ".join(f"{value:.3f}" for value in row)


def _stiffness(result: IdentificationResult, stiffness: float) -> str:
    s = result.summary
    modes = ", ".join(map(str, s["fit_to"]))
    return f"{_newtons(stiffness)} of {s['snubber']} (mode {modes}, {s['method']})"


def _standard_deviation(result: IdentificationResult, deviation: float) -> str:
    if not math.isfinite(deviation):
        return ""
    scatter = result.estimate is not None and result.estimate.uncertainty_from != "given"
    source = ", from the scatter of the modes" if scatter else ""
    return f"{_newtons(deviation)}{source}"


def _interval(result: IdentificationResult, interval: Sequence[float]) -> str:
    if not math.isfinite(result.summary["standard_deviation_n_per_m"]):
        return ""
    return f"{_range(interval)} ({percent(result.summary['coverage'])})"


def _monte_carlo(result: IdentificationResult, deviation: float) -> str:
    s = result.summary
    if not math.isfinite(s["standard_deviation_n_per_m"]):
        return ""
    samples = "" if result.estimate is None else f" ({counted(result.estimate.monte_carlo_samples, 'sample')})"
    return f"{_newtons(deviation)}, {_range(s['monte_carlo_interval_n_per_m'])}{samples}"


def _range(interval: Sequence[float]) -> str:
    return f"{_newtons(interval[0])} to {_newtons(interval[1])}"


def _total(result: IdentificationResult, deviation: float) -> str:
    of_test = result.summary["standard_deviation_n_per_m"]
    added = deviation > of_test or (math.isnan(of_test) and math.isfinite(deviation))
    return f"{_newtons(deviation)} standard deviation" if added else ""


def _each_mode(result: IdentificationResult, stiffness: Sequence[float]) -> str:
    modes = result.summary["fit_to"]
    texts = (
        f"mode {mode}: {_newtons(k) if math.isfinite(k) else 'out of reach'}"
        for mode, k in zip(modes, stiffness, strict=True)
    )
    return ", ".join(texts) if len(modes) > 1 else ""


def _reach(result: IdentificationResult, ranges: Sequence[Sequence[float]]) -> Iterator[Row]:
    for mode, (low, high) in zip(result.summary["fit_to"], ranges, strict=True):
        upwards = f"to {high:.5g} Hz (pinned)" if math.isfinite(high) else "upwards without bound"
        yield "", f"mode {mode}: {low:.5g} Hz (free) {upwards}"


def _table_slope(result: IdentificationResult, slope: float) -> Iterator[Row]:
    at = result.table_slope
    assert at is not None
    yield "", f"{_newtons(slope)} on segment {at.segment} of {at.segments}, under {amount(at.force, 'N', 4)}"
    yield "", f"identified: {at.factor:.4g} of it; all forces so with force_deflection.scale times {at.factor:.4g}"


def _sensitivities(result: IdentificationResult, _: Any) -> Iterator[Row]:
    for s in result.sensitivities[:SENSITIVITIES_SHOWN]:
        part = f", uncertainty of k {percent(s.contribution, 2)}" if math.isfinite(s.contribution) else ""
        yield "", f"1 % of {s.parameter} gives {s.relative:+.3g} % of k{part}"


def _estimated(result: IdentificationResult, _: Mapping[str, Any]) -> Iterator[Row]:
    for parameter in () if result.nonlinear is None else result.nonlinear.parameters:
        yield "", _parameter(parameter)


def _pad_branches(result: IdentificationResult, stiffness: Sequence[float]) -> Iterator[Row]:
    for k, tau in zip(stiffness, result.summary["pad_relaxation_time_s"], strict=True):
        yield "", f"{_newtons(k)}, relaxation time {amount(tau, 's', 4)}"


def _misfit(_: IdentificationResult, misfit: Sequence[float]) -> str:
    return f"{misfit[0]:.4g} before, {misfit[1]:.4g} after"


TEXTS: Texts = {
    "updated": _updated,
    "update_misfit": _misfit,
    "frequencies_without_hz": _table("without_snubber"),
    "mac": _mac,
    "stiffness_n_per_m": _stiffness,
    "standard_deviation_n_per_m": _standard_deviation,
    "interval_n_per_m": _interval,
    "monte_carlo_standard_deviation_n_per_m": _monte_carlo,
    "total_standard_deviation_n_per_m": _total,
    "stiffness_by_mode_n_per_m": _each_mode,
    "reachable_hz": _reach,
    "table_slope_n_per_m": _table_slope,
    "pad_youngs_modulus_pa": lambda _, modulus: "" if math.isnan(modulus) else amount(modulus, "Pa", 5),
    "pad_stiffness_n_per_m": lambda _, stiffness: _newtons(stiffness),
    "pad_branch_stiffness_n_per_m": _pad_branches,
    "pad_misfit": lambda _, misfit: f"{percent(misfit)} of the measured stiffness, root mean square",
    "pad_yaml": lambda _, text: text,
    "frequencies_with_hz": _table("with_snubber"),
    "sensitivities": _sensitivities,
    "estimated": _estimated,
    "nonlinear_misfit": _misfit,
    "starts_agreeing": lambda _, counts: f"{counts[0]} of {counts[1]} reached the same minimum",
    "processor_time_s": lambda _, time: f"processor time {amount(time, 's')}",
}
