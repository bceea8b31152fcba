"""What the table of ``beamsim identify-stiffness`` tells beyond the entries of the summary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from beamsim.analyses.identify.result import FrequencyTable, IdentificationResult, ParameterEstimate
from beamsim.cli.report import Labelled, Views
from beamsim.cli.tables import percent, told
from beamsim.plots.style import amount


def _newtons(value: float) -> str:
    return amount(value, "N/m", 5)


def _updated(result: IdentificationResult, _: Any) -> Labelled | str:
    update = result.update
    if update is None:
        return ""
    supports = {text: f"misfit {misfit:.4g}" for text, misfit in update.alternatives[:4]}
    return Labelled({
        "": _parameters(update.parameters),
        "supports chosen": update.choices,
        "supports tried": supports,
        "without, before": _frequencies(update.before),
    })  # fmt: skip


def _parameters(parameters: Sequence[ParameterEstimate]) -> list[dict[str, str]]:
    known = [math.isfinite(p.standard_deviation) for p in parameters]
    return [
        {
            "": p.parameter, "before": f"{p.before:.5g}", "found": f"{p.value:.5g}",
            "standard deviation": f"{p.standard_deviation:.2g}" if scatters else "",
            "from": f"{p.interval[0]:.5g}" if scatters else "", "to": f"{p.interval[1]:.5g}" if scatters else "",
            "bound": "at its bound" if p.at_bound else "",
        }
        for p, scatters in zip(parameters, known, strict=True)
    ]  # fmt: skip


def _frequencies(table: FrequencyTable | None) -> list[dict[str, Any]]:
    columns = ("mode", "predicted_hz", "measured_hz", "difference_percent")
    values = () if table is None else zip(*(getattr(table, name).tolist() for name in columns), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in values]


def _stiffness(result: IdentificationResult, stiffness: float) -> str:
    s = result.summary
    modes = ", ".join(map(str, s["fit_to"]))
    return f"{_newtons(stiffness)} of {s['snubber']} (mode {modes}, {s['method']})"


def _interval(result: IdentificationResult, interval: Sequence[float]) -> str:
    if not math.isfinite(result.summary["standard_deviation_n_per_m"]):
        return ""
    return f"{_newtons(interval[0])} to {_newtons(interval[1])} ({percent(result.summary['coverage'])})"


def _monte_carlo(result: IdentificationResult, deviation: float) -> dict[str, Any] | str:
    if result.estimate is None or not math.isfinite(deviation):
        return ""
    low, high = result.summary["monte_carlo_interval_n_per_m"]
    of = {"standard_deviation_n_per_m": deviation, "from_n_per_m": low, "to_n_per_m": high}
    return of | {"samples": result.estimate.monte_carlo_samples}


def _each_mode(result: IdentificationResult, stiffness: Sequence[float]) -> str:
    modes = result.summary["fit_to"]
    texts = (
        f"mode {mode}: {_newtons(k) if math.isfinite(k) else 'out of reach'}"
        for mode, k in zip(modes, stiffness, strict=True)
    )
    return ", ".join(texts) if len(modes) > 1 else ""


def _reach(result: IdentificationResult, ranges: Sequence[Sequence[float]]) -> dict[str, str]:
    texts = {}
    for mode, (low, high) in zip(result.summary["fit_to"], ranges, strict=True):
        upwards = f"to {high:.5g} Hz (pinned)" if math.isfinite(high) else "upwards without bound"
        texts[f"mode {mode}"] = f"{low:.5g} Hz (free) {upwards}"
    return texts


def _table_slope(result: IdentificationResult, slope: float) -> list[str]:
    at = result.table_slope
    assert at is not None
    return [
        f"{_newtons(slope)} on segment {at.segment} of {at.segments}, under {amount(at.force, 'N', 4)}",
        f"identified: {at.factor:.4g} of it; all forces so with force_deflection.scale times {at.factor:.4g}",
    ]


def _sensitivities(result: IdentificationResult, _: Any) -> list[dict[str, str]]:
    return [
        {
            "1 % of": s.parameter,
            "changes the stiffness by": f"{s.relative:+.3g} %",
            "its uncertainty": percent(s.contribution, 2) if math.isfinite(s.contribution) else "",
        }
        for s in result.sensitivities[:6]
    ]


def _pad_branches(result: IdentificationResult, stiffness: Sequence[float]) -> list[dict[str, float]]:
    times = result.summary["pad_relaxation_time_s"]
    return [{"stiffness_n_per_m": k, "relaxation_time_s": tau} for k, tau in zip(stiffness, times, strict=True)]


def _misfit(_: IdentificationResult, misfit: Sequence[float]) -> str:
    return f"{misfit[0]:.4g} before, {misfit[1]:.4g} after"


VIEWS: Views = {
    "updated": _updated,
    "update_misfit": _misfit,
    "frequencies_without_hz": lambda result, _: _frequencies(result.without_snubber),
    "mac": lambda _, mac: {f"shape {i}": told("", row) for i, row in enumerate(mac, 1)},
    "stiffness_n_per_m": _stiffness,
    "interval_n_per_m": _interval,
    "monte_carlo_standard_deviation_n_per_m": _monte_carlo,
    "stiffness_by_mode_n_per_m": _each_mode,
    "reachable_hz": _reach,
    "table_slope_n_per_m": _table_slope,
    "pad_branch_stiffness_n_per_m": _pad_branches,
    "pad_misfit": lambda _, misfit: f"{percent(misfit)} of the measured stiffness, root mean square",
    "frequencies_with_hz": lambda result, _: _frequencies(result.with_snubber),
    "sensitivities": _sensitivities,
    "estimated": lambda result, _: _parameters(() if result.nonlinear is None else result.nonlinear.parameters),
    "nonlinear_misfit": _misfit,
    "starts_agreeing": lambda _, counts: f"{counts[0]} of {counts[1]} reached the same minimum",
    "processor_time_s": lambda _, time: f"processor time {amount(time, 's')}",
}
