"""Pictures of response curves by continuation: amplitude, force, harmonics, folds in two parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.branch import ResponseBranch
from beamsim.analyses.continuation.result import ContinuationResult, OverlayCurve
from beamsim.plots.bounds import limit_levels
from beamsim.plots.branches import MARKS, explain_dashes, mark_special, plot_branch
from beamsim.plots.drawing import (
    MOST_CURVES,
    SMALL,
    Curve,
    Guide,
    curve_style,
    draw_curves,
    draw_levels,
    frequency_axis,
    highest_in_bins,
    legend,
    panels,
    plain_logarithmic,
)
from beamsim.plots.style import Scale, level_text, scale_for
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.typing import Floats

MANY = 80  # special points, from which their marks are small
DECADES = 0.6  # largest over smallest amplitude, as a power of ten, from which the axis is logarithmic
_OVERLAID = ("#8a8f98", "#b08968", "#7d9a83", "#9a86ad")  # lighter than the curves above them
_WORDS = {"level": "Level", "gap": "Gap", "stiffness": "Stiffness", "position": "Position"}
Values = Callable[[ResponseBranch], Floats]


def plot_response_curve(result: ContinuationResult, ax: Axes, probe: str) -> Axes:
    """Peak displacement: stable full, unstable dashed, special points marked, sweeps drawn under the curve."""
    overlaid = [(o, o.displacement[probe].peak) for o in result.overlay.values() if probe in o.displacement]
    limits = limit_levels(result.scenario.limits, "peak_displacement")
    up = (f"Peak displacement of {probe}", "m")
    return _draw(result, ax, up, lambda b: b.peak_displacement[probe], overlaid, limits, logarithmic=True)


def plot_force_curve(result: ContinuationResult, ax: Axes, snubber: str) -> Axes:
    """Peak contact force, as :func:`plot_response_curve`."""
    overlaid = [(o, o.force[snubber].peak) for o in result.overlay.values() if snubber in o.force]
    limits = limit_levels(result.scenario.limits, "peak_force")
    up = (f"Peak contact force of {snubber}", "N")
    return _draw(result, ax, up, lambda b: b.peak_force[snubber], overlaid, limits)


def plot_output_curve(result: ContinuationResult, ax: Axes, output: str) -> Axes:
    """Largest magnitude of an output, as :func:`plot_response_curve`, with its limit."""
    limits = limit_levels(result.scenario.limits, OF_OUTPUTS + output)
    up = (f"Peak of {output}", result.branches[0].outputs[output].unit)
    return _draw(result, ax, up, lambda b: b.outputs[output].peak, (), limits, logarithmic=True)


def _draw(
    result: ContinuationResult,
    ax: Axes,
    up: tuple[str, str],
    values: Values,
    overlaid: Sequence[tuple[OverlayCurve, Floats]] = (),
    limits: Sequence[Guide] = (),
    *,
    logarithmic: bool = False,
) -> Axes:
    """Sweeps as lines and stepped sines as dots, under all branches, a colour a level."""
    scale = scale_for(up[1], *map(values, result.branches), *(peak for _, peak in overlaid))
    x = _parameter(result)
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
    _branches(result, ax, values, x[1], scale)
    draw_curves(ax, x, (up[0], scale), drawn)
    largest = max(float(np.max(values(b), initial=0.0)) for b in result.branches)
    draw_levels(ax, limits, largest, scale)
    _special(result, ax, values, x[1], scale)
    legend(ax)
    at = np.concatenate([b.parameter for b in result.branches])
    if result.parameter == "frequency":
        frequency_axis(ax, float(at.min()), float(at.max()))
    low = min(float(np.min(values(b), initial=np.inf)) for b in result.branches)
    if logarithmic and low > 0 and np.log10(largest / low) > DECADES:
        plain_logarithmic(ax.yaxis)
    else:
        ax.set_ylim(bottom=0.0)
    return ax


def _branches(result: ContinuationResult, ax: Axes, values: Values, x: Scale, y: Scale) -> None:
    """All branches, a colour a level; branches of longer periods in the next colour, thinner."""
    levels = list(dict.fromkeys(repr(b.level) for b in result.branches))
    many, named = len(levels) > 1, set()
    doubled = any(b.period_multiple > 1 for b in result.branches)
    for branch in result.branches:
        aside, k = branch.period_multiple > 1, levels.index(repr(branch.level))
        words = [level_text(branch.level, result.level_unit)] if many else []
        if aside or (doubled and not many):
            words.append(f"period {branch.period_multiple}")
        label = ", ".join(words) or ("continuation" if result.overlay else "_nolegend_")
        colour = curve_style(len(levels) + k if aside else k)["color"]
        plot_branch(
            ax, branch.parameter * x.factor, values(branch) * y.factor, branch.stable, color=colour,
            width=1.0 if aside else 1.4, label="_nolegend_" if label in named else label, zorder=3,
        )  # fmt: skip
        named.add(label)


def _special(result: ContinuationResult, ax: Axes, values: Values, x: Scale, y: Scale) -> None:
    """What is unstable, and the special points of each kind, each on its branch."""
    if not all(branch.stable.all() for branch in result.branches):
        explain_dashes(ax)
    main = [b for b in result.branches if b.period_multiple == 1]
    size = 4.5 if sum(len(b.special) for b in main) <= MANY else 2.0
    for kind in MARKS:
        places = [
            (event.parameter * x.factor, float(values(b)[np.argmin(np.abs(b.parameter - event.parameter))]) * y.factor)
            for b in main
            for event in b.special
            if event.kind == kind
        ]
        mark_special(ax, kind, places, size)


def plot_harmonics(result: ContinuationResult, ax: Axes, probe: str) -> Axes:
    """Amplitudes of the harmonics of the first level's motions, stable full, unstable dashed; with the mean."""
    first = result.branches[0]
    alike = [b for b in result.branches if b.period_multiple == 1 and repr(b.level) == repr(first.level)]
    values = [np.abs(b.harmonics[probe]) for b in alike]
    scale, x = scale_for("m", *values), _parameter(result)
    for order in range(min(first.harmonics[probe].shape[1], MOST_CURVES)):
        for k, (branch, amplitude) in enumerate(zip(alike, values, strict=True)):
            marks = {"marker": "os^Dvx"[order], "markersize": 3.5, "markerfacecolor": "white"}
            plot_branch(
                ax, branch.parameter * x[1].factor, amplitude[:, order] * scale.factor, branch.stable, width=1.3,
                color=curve_style(order)["color"], label="_nolegend_" if k else f"order {order}" if order else "mean",
                markevery=max(1, branch.parameter.size // 8), **marks,
            )  # fmt: skip
    if not all(branch.stable.all() for branch in alike):
        explain_dashes(ax)
    level = f", {level_text(first.level, result.level_unit)}" if _levels(result) else ""
    draw_curves(ax, x, (f"Amplitude of {probe}{level}", scale), ())
    top = max(float(v.max(initial=0.0)) for v in values) * scale.factor
    if top > 0:
        ax.set(yscale="log", ylim=(1e-4 * top, 2.0 * top))
    return ax


def plot_fold_curves(result: ContinuationResult, ax: Axes) -> Axes:
    """Folds in the plane of frequency and second parameter: between two of them there are several motions."""
    folds = [c for c in result.fold_curves if c.parameter.size]
    drawn = [Curve(f"fold at {c.start_hz:.5g} Hz", c.frequency_hz, c.parameter, {"linewidth": 1.4}) for c in folds]
    of = f" of {result.second_snubber}" if result.second_snubber else ""
    up = (f"{_WORDS[result.second_parameter]}{of}", result.second_unit)
    _, scale = draw_curves(ax, ("Excitation frequency", Scale(1.0, "Hz")), up, drawn)
    for curve in folds:
        start = int(np.argmin(np.abs(curve.frequency_hz - curve.start_hz)))
        ax.plot(curve.frequency_hz[start], curve.parameter[start] * scale.factor, "s", markersize=5, color="0.2",
                markerfacecolor="white")  # fmt: skip
    return ax


def continuation_figures(result: ContinuationResult) -> dict[str, Figure]:
    """The response of every probe, the forces, the harmonics of the first probe, and the folds, by name."""
    first, figures = result.branches[0], {}
    for kind, names, plot in (
        ("response", first.peak_displacement, plot_response_curve),
        ("force", first.peak_force, plot_force_curve),
        ("output", first.outputs, plot_output_curve),
        ("harmonics", list(first.harmonics)[:1], plot_harmonics),
    ):
        for name in list(names)[:MOST_CURVES]:
            figures[f"{kind}_{name}"], (ax,) = panels(result.title, size=SMALL)
            plot(result, ax, name)
    if any(c.parameter.size for c in result.fold_curves):
        figures["folds"], (ax,) = panels(result.title, size=SMALL)
        plot_fold_curves(result, ax)
    if result.expansion:
        from beamsim.plots.multiple_scales import forced_expansion_figures

        figures |= forced_expansion_figures(result)
    return figures


def _levels(result: ContinuationResult) -> bool:
    return len({repr(b.level) for b in result.branches}) > 1


def _parameter(result: ContinuationResult) -> tuple[str, Scale]:
    """Words and scale of what is continued."""
    scale = scale_for(result.unit, *(b.parameter for b in result.branches))
    if result.parameter == "frequency":
        return "Excitation frequency", scale
    return f"{_WORDS[result.parameter]}{f' of {result.snubber}' if result.snubber else ''}", scale
