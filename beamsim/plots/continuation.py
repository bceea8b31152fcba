"""Pictures of response curves by continuation: amplitude, force, harmonics, folds in two parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from beamsim.analyses.continuation.result import ContinuationResult, OverlayCurve
from beamsim.plots.branches import BranchLine, branch_curves
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
    marked,
    over_frequencies,
)
from beamsim.plots.style import level_text, scale_for
from beamsim.results.branch import ResponseBranch
from beamsim.results.values import DISPLACEMENT, OUTPUT, Value
from beamsim.typing import Floats

_OVERLAID = ("#8a8f98", "#b08968", "#7d9a83", "#9a86ad")  # lighter than the curves above them
_WORDS = {"level": "Level", "gap": "Gap", "stiffness": "Stiffness", "position": "Position"}
Values = Callable[[ResponseBranch], Floats]


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
    swept = [(curve, dict(curve.peaks()).get(value, {})) for curve in result.overlay.values()]
    what, unit = f"{value.label.capitalize()} of {name}", value.unit
    if value is OUTPUT:
        what, unit = f"Peak of {name}", result.branches[0].outputs[name].unit
    limits = limit_levels(result.scenario.limits, value.limit, name)
    overlaid = [(curve, of[name]) for curve, of in swept if name in of]
    return _chart(result, (what, unit), lambda branch: dict(branch.peaks())[value][name], overlaid, limits)


def _chart(
    result: ContinuationResult,
    up: Axis,
    values: Values,
    overlaid: Sequence[tuple[OverlayCurve, Floats]],
    limits: Sequence[Guide],
) -> Chart:
    """Sweeps as lines and stepped sines as dots, under all branches."""
    drawn = []
    for k, (curve, peak) in enumerate(overlaid):
        label = f"{'swept' if curve.steady is None else 'stepped'} {curve.direction}"
        if _levels(result) or len(overlaid) > 2:
            label += f", {level_text(curve.level, result.level_unit)}"
        style: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 4}
        if curve.steady is None:  # told apart without colour, too
            style = {"linewidth": 2.2, "linestyle": (0, (4, 1)) if k % 2 else "-"}
        style |= {"color": _OVERLAID[k % len(_OVERLAID)], "zorder": 1}
        drawn.append(Curve(label, *highest_in_bins(curve.frequency_hz, peak), style))
    curves = [*drawn, *branch_curves(_lines(result, values))]
    at = np.concatenate([b.parameter for b in result.branches])
    known = np.concatenate([curve.y[np.isfinite(curve.y)] for curve in curves])
    log = logarithmic("y", known)
    chart = Chart(_parameter(result), up, curves, limits, log, of="", y_ends=(None if log else 0.0, None))
    return over_frequencies(chart, at) if result.parameter == "frequency" else chart


def _lines(result: ContinuationResult, values: Values) -> list[BranchLine]:
    """All branches, a colour a level; those of longer periods in the next colour, thinner, without special points."""
    levels = list(dict.fromkeys(repr(b.level) for b in result.branches))
    doubled, lines = any(b.period_multiple > 1 for b in result.branches), []
    for branch in result.branches:
        aside, k, y = branch.period_multiple > 1, levels.index(repr(branch.level)), values(branch)
        words = [level_text(branch.level, result.level_unit)] if len(levels) > 1 else []
        if aside or (doubled and len(levels) == 1):
            words.append(f"period {branch.period_multiple}")
        style = {"color": curve_style(len(levels) + k if aside else k)["color"], "linewidth": 1.0 if aside else 1.4}
        special = [
            (event.kind, event.parameter, float(y[np.argmin(np.abs(branch.parameter - event.parameter))]))
            for event in branch.special
            if not aside
        ]
        label = ", ".join(words) or ("continuation" if result.overlay else "")
        lines.append(BranchLine(label, branch.parameter, y, branch.stable, {**style, "zorder": 3}, special))
    return lines


def harmonics(result: ContinuationResult, probe: str) -> Chart:
    """Amplitudes of the harmonics of the first level's motions, stable full, unstable dashed; with the mean."""
    first = result.branches[0]
    alike = [b for b in result.branches if b.period_multiple == 1 and repr(b.level) == repr(first.level)]
    lines = [
        BranchLine(
            f"order {order}" if order else "mean", b.parameter, np.abs(b.harmonics[probe][:, order]), b.stable,
            {"color": curve_style(order)["color"], "linewidth": 1.3, "marker": "os^Dvx"[order], "markersize": 3.5,
             "markerfacecolor": "white", "markevery": max(1, b.parameter.size // 8)},
        )
        for order in range(min(first.harmonics[probe].shape[1], MOST_CURVES))
        for b in alike
    ]  # fmt: skip
    level = f", {level_text(first.level, result.level_unit)}" if _levels(result) else ""
    top = max(float(line.y.max()) for line in lines)
    ends = (1e-4 * top, 2.0 * top) if top > 0.0 else (None, None)
    up = (f"Amplitude of {probe}{level}", "m")
    return Chart(_parameter(result), up, branch_curves(lines), log="y", of="", y_ends=ends)


def fold_curves(result: ContinuationResult) -> Chart:
    """Folds in the plane of frequency and second parameter: between two of them there are several motions."""
    folds = [c for c in result.fold_curves if c.parameter.size]
    drawn = [Curve(f"fold at {c.start_hz:.5g} Hz", c.frequency_hz, c.parameter, {"linewidth": 1.4}) for c in folds]
    starts = [int(np.argmin(np.abs(c.frequency_hz - c.start_hz))) for c in folds]
    places = [(c.frequency_hz[k], c.parameter[k]) for c, k in zip(folds, starts, strict=True)]
    begun = marked("", places, marker="s", markersize=5, color="0.2", markerfacecolor="white")
    of = f" of {result.second_snubber}" if result.second_snubber else ""
    up = (f"{_WORDS[result.second_parameter]}{of}", result.second_unit)
    return Chart(("Excitation frequency", HERTZ), up, [*drawn, begun], of="")


def continuation_figures(result: ContinuationResult) -> dict[str, Picture]:
    """The response of every probe, what else sweeps follow, outputs, harmonics of the first probe, folds, by name."""
    names = {DISPLACEMENT: "response", OUTPUT.key: "output"}
    followed = [(value, of) for value, of in result.branches[0].peaks() if value.followed or value is OUTPUT]
    charts = {
        f"{names.get(value.key, value.name.removeprefix('peak_'))}_{name}": peaks(result, value, name)
        for value, of in sorted(followed, key=lambda each: each[0].key != DISPLACEMENT)
        for name in list(of)[:MOST_CURVES]
    }
    charts = {name: chart for name, chart in charts.items() if any(np.any(curve.y) for curve in chart.curves)}
    for name in list(result.branches[0].harmonics)[:1]:
        charts[f"harmonics_{name}"] = harmonics(result, name)
    if any(c.parameter.size for c in result.fold_curves):
        charts["folds"] = fold_curves(result)
    if result.expansion:
        from beamsim.plots.multiple_scales import forced_expansion

        charts |= forced_expansion(result)
    return {name: Picture(result.title, [chart]) for name, chart in charts.items()}


def _levels(result: ContinuationResult) -> bool:
    return len({repr(b.level) for b in result.branches}) > 1


def _parameter(result: ContinuationResult) -> Axis:
    """Words and scale of what is continued."""
    scale = scale_for(result.unit, *(b.parameter for b in result.branches))
    if result.parameter == "frequency":
        return "Excitation frequency", scale
    return f"{_WORDS[result.parameter]}{f' of {result.snubber}' if result.snubber else ''}", scale
