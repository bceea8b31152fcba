"""Pictures of response curves by continuation: amplitude, force, harmonics, special points in two parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.continuation.overlay import OverlayCurve
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.labelled import Dataset
from beamsim.orbits.branch import curve_event_name, special_name
from beamsim.plots.branches import CURVE_MARKS, BranchLine, branch_curves
from beamsim.plots.drawing import (
    HERTZ,
    MOST_CURVES,
    Axis,
    Chart,
    Curve,
    Guide,
    Picture,
    curve_style,
    highest_in_bins,
    limit_levels,
    logarithmic,
    marks_curve,
    over_frequencies,
)
from beamsim.plots.style import amount, level_text, scale_for
from beamsim.results.branch import harmonics_of
from beamsim.results.values import DISPLACEMENT, OUTPUT, Value, peaks_in
from beamsim.typing import Floats

_OVERLAID = ("#8a8f98", "#b08968", "#7d9a83", "#9a86ad")  # lighter than the curves above them
_WORDS = {"level": "Level", "gap": "Gap", "stiffness": "Stiffness", "position": "Position"}
Values = Callable[[Dataset], Floats]


def peaks(result: ContinuationResult, value: Value, name: str) -> Chart:
    """Largest values of one channel, with their limit, over sweeps.

    Parameters
    ----------
    result : with branches.
    value : which value.
    name : of the probe, snubber or output that has it.

    Returns
    -------
    Values of all branches over what is continued, above those of the sweeps.
    """
    what, unit = f"{value.label.capitalize()} of {name}", value.unit
    if value is OUTPUT:
        what, unit = f"Peak of {name}", result["points"]["output_maximum"].sel(output=name).unit
    limits = limit_levels(result.scenario.limits, value.limit, name)
    key = ("output" if value is OUTPUT else value.quantity, name)
    known = [(curve, *curve.peaks[key]) for curve in result.overlay.values() if key in curve.peaks]
    overlaid = [(curve, peak) for curve, of, peak in known if value is OUTPUT or of == value.unit]
    return _chart(result, (what, unit), lambda branch: dict(peaks_in(branch))[value][name], overlaid, limits)


def _chart(
    result: ContinuationResult,
    y_axis: Axis,
    values: Values,
    overlaid: Sequence[tuple[OverlayCurve, Floats]],
    limits: Sequence[Guide],
) -> Chart:
    """Sweeps as lines and stepped sines as dots, under all branches."""
    drawn = []
    for k, (curve, peak) in enumerate(overlaid):
        label = f"{'stepped' if curve.kind == 'stepped' else 'swept'} {curve.direction}"
        if _several_levels(result) or len(overlaid) > 2:
            label += f", {level_text(curve.level, result.level_unit)}"
        style: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 4}
        if curve.kind == "swept_sine":  # distinct without colour, too
            style = {"linewidth": 2.2, "linestyle": (0, (4, 1)) if k % 2 else "-"}
        style |= {"color": _OVERLAID[k % len(_OVERLAID)], "zorder": 1}
        drawn.append(Curve(label, *highest_in_bins(curve.frequency_hz, peak), style))
    curves = [*drawn, *branch_curves(_lines(result, values))]
    at = result["points"]["parameter"].values
    known = np.concatenate([curve.y[np.isfinite(curve.y)] for curve in curves])
    log = logarithmic("y", known)
    chart = Chart(_parameter(result), y_axis, curves, limits, log, curve_noun="", y_ends=(None if log else 0.0, None))
    return over_frequencies(chart, at) if result.parameter == "frequency" else chart


def _lines(result: ContinuationResult, values: Values) -> list[BranchLine]:
    """All branches, a colour a level; those of longer periods in the next colour, thinner, without special points."""
    levels = list(dict.fromkeys(map(repr, _levels(result))))
    periods, special = result["branches"]["period_multiple"].values.tolist(), result["special_points"]
    columns = (special[name].values.tolist() for name in ("branch", "kind", "parameter"))
    events, doubled, lines = list(zip(*columns, strict=True)), max(periods) > 1, []
    for number, (branch, level) in enumerate(zip(result.branches, _levels(result), strict=True)):
        x, y = branch["parameter"].values, values(branch)
        aside, k = periods[number] > 1, levels.index(repr(level))
        words = [level_text(level, result.level_unit)] if len(levels) > 1 else []
        if aside or (doubled and len(levels) == 1):
            words.append(f"period {periods[number]}")
        style = {"color": curve_style(len(levels) + k if aside else k)["color"], "linewidth": 1.0 if aside else 1.4}
        marks = [
            (kind, at, float(y[np.argmin(np.abs(x - at))]))
            for whose, kind, at in events
            if whose == number and not aside
        ]
        label = ", ".join(words) or ("continuation" if result.overlay else "")
        lines.append(BranchLine(label, x, y, branch["stable"].values, {**style, "zorder": 3}, marks))
    return lines


def harmonics(result: ContinuationResult, probe: str) -> Chart:
    """Amplitudes of the harmonics of the first level's motions, stable full, unstable dashed; with the mean."""
    first = _levels(result)[0]
    alike = [b for b in result.branches if b["period_multiple"].item() == 1 and repr(b["level"].item()) == repr(first)]
    of_branches = [(b["parameter"].values, harmonics_of(b)[probe], b["stable"].values) for b in alike]
    orders = len(result["points"].labels("harmonic"))
    lines = [
        BranchLine(
            f"order {order}" if order else "mean", x, np.abs(amplitude[:, order]), stable,
            {"color": curve_style(order)["color"], "linewidth": 1.3, "marker": "os^Dvx"[order], "markersize": 3.5,
             "markerfacecolor": "white", "markevery": max(1, x.size // 8)},
        )
        for order in range(min(orders, MOST_CURVES))
        for x, amplitude, stable in of_branches
    ]  # fmt: skip
    level = f", {level_text(first, result.level_unit)}" if _several_levels(result) else ""
    top = max(float(line.y.max()) for line in lines)
    ends = (1e-4 * top, 2.0 * top) if top > 0.0 else (None, None)
    y_axis = (f"Amplitude of {probe}{level}", "m")
    return Chart(_parameter(result), y_axis, branch_curves(lines), log="y", curve_noun="", y_ends=ends)


def special_curves(result: ContinuationResult) -> Chart:
    """Curves of special points in the plane of frequency and second parameter, with their own special points."""
    curves, drawn, begun = [c for c in result.special_curves if c["parameter"].values.size], list[Curve](), []
    kinds = list(dict.fromkeys(curve["kind"].item() for curve in curves))
    for curve in curves:
        x, y, kind = curve["frequency_hz"].values, curve["parameter"].values, curve["kind"].item()
        name = special_name(kind)
        known = any(other.label == name for other in drawn)
        drawn.append(Curve("" if known else name, x, y, {**curve_style(kinds.index(kind)), "linewidth": 1.4}))
        if kind != "isola":
            begin = int(np.argmin(np.abs(x - curve["start_hz"].item())))
            begun.append((x[begin], y[begin]))
    marks = [marks_curve("found on a branch", begun, marker="s", markersize=4, color="0.2", markerfacecolor="white")]
    events = list(result["special_curve_events"].rows("event"))
    for kind, mark in CURVE_MARKS.items():
        places = [(event["frequency_hz"], event["parameter"]) for event in events if event["kind"] == kind]
        if places:
            marks.append(marks_curve(curve_event_name(kind), places, marker=mark, markersize=6, color="0.2"))
    snubber = curves[0]["followed_snubber"].item()
    y_axis = (f"{_WORDS[result.summary['second_parameter']]}{f' of {snubber}' if snubber else ''}", result.second_unit)
    return Chart(("Excitation frequency", HERTZ), y_axis, [*drawn, *marks], curve_noun="")


def isolas(result: ContinuationResult, probe: str) -> Chart:
    """Largest displacements of a probe along isolas, each at its own value of the second parameter."""
    followed, unit = result.summary["second_parameter"], result.second_unit
    drawn = [
        Curve(
            f"{followed} {amount(curve['parameter'].values[0], unit)}",
            curve["frequency_hz"].values,
            curve["peak_displacement"].sel(probe=probe).values,
        )
        for curve in result.special_curves
        if curve["kind"].item() == "isola" and curve["parameter"].values.size
    ]
    return Chart(("Excitation frequency", HERTZ), (f"Displacement of {probe}", "m"), drawn[:MOST_CURVES], curve_noun="")


def continuation_figures(result: ContinuationResult) -> dict[str, Picture]:
    """Responses of probes, other values of sweeps, outputs, harmonics of the first probe, special curves; by name."""
    names = {DISPLACEMENT: "response", OUTPUT.key: "output"}
    followed = [(value, of) for value, of in peaks_in(result["points"]) if value.in_sweeps or value is OUTPUT]
    charts = {
        f"{names.get(value.key, value.name.removeprefix('peak_'))}_{name}": peaks(result, value, name)
        for value, of in sorted(followed, key=lambda each: each[0].key != DISPLACEMENT)
        for name in list(of)[:MOST_CURVES]
    }
    charts = {name: chart for name, chart in charts.items() if any(np.any(curve.y) for curve in chart.curves)}
    for name in result["points"].labels("probe")[:1]:
        charts[f"harmonics_{name}"] = harmonics(result, name)
    if any(c["parameter"].values.size for c in result.special_curves):
        charts["special_curves"] = special_curves(result)
    if "isola" in [c["kind"].item() for c in result.special_curves]:
        charts |= {f"isolas_{name}": isolas(result, name) for name in result["points"].labels("probe")[:1]}
    if "multiple_scales" in result.datasets:
        from beamsim.plots.multiple_scales import forced_expansion

        charts |= forced_expansion(result)
    return {name: Picture(result.title, [chart]) for name, chart in charts.items()}


def _levels(result: ContinuationResult) -> list[float]:
    """That of each branch."""
    levels: list[float] = result["branches"]["level"].values.tolist()
    return levels


def _several_levels(result: ContinuationResult) -> bool:
    return len(set(map(repr, _levels(result)))) > 1


def _parameter(result: ContinuationResult) -> Axis:
    """Words and scale of what is continued."""
    scale = scale_for(result.unit, result["points"]["parameter"].values)
    if result.parameter == "frequency":
        return "Excitation frequency", scale
    snubber = result["branches"]["followed_snubber"].item()
    return f"{_WORDS[result.parameter]}{f' of {snubber}' if snubber else ''}", scale
