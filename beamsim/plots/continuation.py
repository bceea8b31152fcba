"""Pictures of response curves by continuation: amplitude, force, harmonics, folds in two parameters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.branch import ResponseBranch
from beamsim.analyses.response.result import FrequencyResponse, OverlayCurve
from beamsim.plots.bounds import draw_limit
from beamsim.plots.branches import MARKS, explain_dashes, figure_of, mark_special, plot_branch
from beamsim.plots.labels import put_beside
from beamsim.plots.outputs import output_label
from beamsim.plots.style import (
    MOST_CURVES,
    Scale,
    curve_style,
    finish,
    legend_columns,
    level_text,
    scale_for,
)
from beamsim.scenario.limits import OF_OUTPUTS
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MANY = 80  # special points, from which their marks are small
DECADES = 0.6  # largest over smallest amplitude, as a power of ten, from which the axis is logarithmic
STRETCHES = 400  # of frequency, over which a sweep's cycles are drawn as one point
_OVERLAID = ("#8a8f98", "#b08968", "#7d9a83", "#9a86ad")  # lighter than the curves above them
_WORDS = {"level": "Level", "gap": "Gap", "stiffness": "Stiffness", "position": "Position"}


def plot_response_curve(result: FrequencyResponse, ax: Axes, probe: str) -> Axes:
    """Peak displacement: stable full, unstable dashed, special points marked, sweeps drawn under the curve."""
    overlaid = [(o, o.displacement[probe].peak) for o in result.overlay.values() if probe in o.displacement]
    scale = scale_for("m", *(b.peak_displacement[probe] for b in result.branches), *(peak for _, peak in overlaid))
    _overlay(result, ax, overlaid, scale)
    _curves(result, ax, lambda b: b.peak_displacement[probe], scale)
    draw_limit(ax, result.scenario.limits, "peak_displacement", scale)
    finish(ax, _axis(result), f"Peak displacement of {probe} ({scale.unit})")
    _legend(ax)
    return ax


def plot_force_curve(result: FrequencyResponse, ax: Axes, snubber: str) -> Axes:
    """Peak contact force, as :func:`plot_response_curve`."""
    scale = scale_for("N", *(b.peak_force[snubber] for b in result.branches))
    _overlay(result, ax, [(o, o.force[snubber].peak) for o in result.overlay.values() if snubber in o.force], scale)
    _curves(result, ax, lambda b: b.peak_force[snubber], scale, logarithmic=False)
    draw_limit(ax, result.scenario.limits, "peak_force", scale)
    finish(ax, _axis(result), f"Peak contact force of {snubber} ({scale.unit})")
    _legend(ax)
    return ax


def plot_output_curve(result: FrequencyResponse, ax: Axes, output: str) -> Axes:
    """Largest magnitude of an output, as :func:`plot_response_curve`, with its limit."""
    peaks = [b.outputs[output].peak for b in result.branches]
    scale = scale_for(result.branches[0].outputs[output].unit, *peaks)
    _curves(result, ax, lambda b: b.outputs[output].peak, scale)
    draw_limit(ax, result.scenario.limits, OF_OUTPUTS + output, scale)
    finish(ax, _axis(result), output_label("Peak of", output, scale))
    _legend(ax)
    return ax


def _overlay(result: FrequencyResponse, ax: Axes, curves: Sequence[tuple[OverlayCurve, Floats]], scale: Scale) -> None:
    """Swept sines as lines, stepped ones as dots, under the curves."""
    for k, (curve, values) in enumerate(curves):
        f, peak = _envelope(curve.frequency_hz, values)
        label = f"{'swept' if curve.steady is None else 'stepped'} {curve.direction}"
        if _levels(result) or len(curves) > 2:
            label += f", {_level(result, curve.level)}"
        line: dict[str, Any] = {"linestyle": "none", "marker": "."}
        if curve.steady is None:  # told apart without colour, too
            line = {"linewidth": 2.2, "linestyle": (0, (4, 1)) if k % 2 else "-"}
        ax.plot(
            f, peak * scale.factor, color=_OVERLAID[k % len(_OVERLAID)], label=label, markersize=4, zorder=1, **line
        )


def plot_harmonics(result: FrequencyResponse, ax: Axes, probe: str) -> Axes:
    """Amplitudes of the harmonics of the first level's motions, stable full, unstable dashed; with the mean."""
    first = result.branches[0]
    alike = [b for b in result.branches if b.period_multiple == 1 and _same(b.level, first.level)]
    values = [np.abs(b.harmonics[probe]) for b in alike]
    scale = scale_for("m", *values)
    x = _parameter_scale(result)
    top = max(float(v.max(initial=0.0)) for v in values)
    ends: dict[str, tuple[float, float]] = {}
    for order in range(min(first.harmonics[probe].shape[1], MOST_CURVES)):
        style = curve_style(order)
        for k, (branch, amplitude) in enumerate(zip(alike, values, strict=True)):
            y = amplitude[:, order] * scale.factor
            at = branch.parameter * x.factor
            label = None if k else f"order {order}" if order else "mean"
            plot_branch(ax, at, y, branch.stable, color=style["color"], width=1.3, label=label)
        ends |= _end(
            str(order),
            [(b.parameter * x.factor, v[:, order] * scale.factor) for b, v in zip(alike, values, strict=True)],
        )
    _explain_dashes(ax, alike)
    if top > 0:
        ax.set_yscale("log")
        ax.set_ylim(1e-4 * top * scale.factor, 2.0 * top * scale.factor)
    put_beside(ax, ends)
    finish(ax, _axis(result), f"Amplitude of {probe} ({scale.unit})")
    if _levels(result):
        ax.set_title(_level(result, first.level), loc="left", fontsize="small")
    _legend(ax)
    return ax


def _end(name: str, curves: Sequence[tuple[Floats, Floats]]) -> dict[str, tuple[float, float]]:
    """The right end of a curve, by its name."""
    ends = [(float(at[k]), float(y[k])) for at, y in curves if at.size for k in [int(np.argmax(at))] if y[k] > 0.0]
    return {name: max(ends)} if ends else {}


def plot_fold_curves(result: FrequencyResponse, ax: Axes) -> Axes:
    """Folds in the plane of frequency and second parameter: between two of them there are several motions."""
    curves = [c for c in result.fold_curves if c.parameter.size]
    y = scale_for(result.second_unit, *(c.parameter for c in curves))
    for k, curve in enumerate(curves):
        style = {**curve_style(k), "linewidth": 1.4}
        ax.plot(curve.frequency_hz, curve.parameter * y.factor, label=f"fold at {curve.start_hz:.5g} Hz", **style)
        start = int(np.argmin(np.abs(curve.frequency_hz - curve.start_hz)))
        ax.plot(curve.frequency_hz[start], curve.parameter[start] * y.factor, "s", markersize=5, color="0.2",
                markerfacecolor="white")  # fmt: skip
    what = f"{_WORDS[result.second_parameter]} {f'of {result.second_snubber} ' if result.second_snubber else ''}"
    finish(ax, "Excitation frequency (Hz)", f"{what}({y.unit})" if y.unit else what.strip())
    _legend(ax)
    return ax


def frequency_response_figures(result: FrequencyResponse) -> dict[str, Figure]:
    """The response of every probe, the forces, the harmonics of the first probe, and the folds, by name."""
    first = result.branches[0]
    drawn: dict[str, Any] = {
        f"response_{name}": partial(plot_response_curve, result, probe=name)
        for name in list(first.peak_displacement)[:MOST_CURVES]
    }
    drawn |= {
        f"force_{name}": partial(plot_force_curve, result, snubber=name)
        for name in list(first.peak_force)[:MOST_CURVES]
    }
    drawn |= {
        f"output_{name}": partial(plot_output_curve, result, output=name) for name in list(first.outputs)[:MOST_CURVES]
    }
    probe = next(iter(first.harmonics), None)
    if probe is not None:
        drawn[f"harmonics_{probe}"] = partial(plot_harmonics, result, probe=probe)
    if any(c.parameter.size for c in result.fold_curves):
        drawn["folds"] = partial(plot_fold_curves, result)
    figures = {name.replace("/", "_").replace(" ", "_"): figure_of(result.title, draw) for name, draw in drawn.items()}
    if result.expansion:
        from beamsim.plots.multiple_scales import forced_expansion_figures

        figures |= forced_expansion_figures(result)
    return figures


def _curves(result: FrequencyResponse, ax: Axes, values: Any, scale: Scale, *, logarithmic: bool = True) -> None:
    """All branches, a colour a level; branches of longer periods in the next colour, thinner."""
    x = _parameter_scale(result)
    levels = list(dict.fromkeys(repr(b.level) for b in result.branches))
    many, named = _levels(result), set()
    doubled = any(b.period_multiple > 1 for b in result.branches)
    for branch in result.branches:
        k = levels.index(repr(branch.level))
        aside = branch.period_multiple > 1
        style = curve_style(k if not aside else len(levels) + k)
        y, at = values(branch) * scale.factor, branch.parameter * x.factor
        words = [_level(result, branch.level)] if many else []
        if aside or (doubled and not many):
            words.append(f"period {branch.period_multiple}")
        label = ", ".join(words) or ("continuation" if result.overlay else None)
        width = 1.0 if aside else 1.4
        shown = None if label in named else label
        named.add(label)
        plot_branch(ax, at, y, branch.stable, color=style["color"], width=width, label=shown, zorder=3)
    _explain_dashes(ax, result.branches)
    count = sum(len(b.special) for b in result.branches if b.period_multiple == 1)
    for kind in MARKS:
        places = [(a * x.factor, y * scale.factor) for a, y in _marked(result, kind, values)]
        mark_special(ax, kind, places, 4.5 if count <= MANY else 2.0)
    at = np.concatenate([b.parameter for b in result.branches])
    if result.parameter == "frequency" and at.max() > 8.0 * at.min():
        ax.set_xscale("log")
        _plain_numbers(ax.xaxis)
    top = max(float(np.max(values(b), initial=0.0)) for b in result.branches)
    low = min(float(np.min(values(b), initial=np.inf)) for b in result.branches)
    if logarithmic and low > 0 and np.log10(top / low) > DECADES:
        ax.set_yscale("log")
        _plain_numbers(ax.yaxis)
    else:
        ax.set_ylim(bottom=0.0)


def _explain_dashes(ax: Axes, branches: Iterable[ResponseBranch]) -> None:
    if not all(branch.stable.all() for branch in branches):
        explain_dashes(ax)


def _marked(result: FrequencyResponse, kind: str, values: Any) -> Iterator[tuple[float, float]]:
    """Where the special points of a kind are on the curves."""
    for branch in result.branches:
        for event in branch.special:
            if event.kind == kind and branch.period_multiple == 1:
                yield event.parameter, _height(branch, values(branch), event.parameter)


def _height(branch: ResponseBranch, y: Floats, at: float) -> float:
    """On the curve at a special point, which is one of its points."""
    return float(y[int(np.argmin(np.abs(branch.parameter - at)))])


def _level(result: FrequencyResponse, level: float) -> str:
    return level_text(level, result.level_unit)


def _levels(result: FrequencyResponse) -> bool:
    return len({repr(b.level) for b in result.branches}) > 1


def _same(a: float, b: float) -> bool:
    return a == b or (np.isnan(a) and np.isnan(b))


def _parameter_scale(result: FrequencyResponse) -> Scale:
    return scale_for(result.unit, *(b.parameter for b in result.branches))


def _axis(result: FrequencyResponse) -> str:
    if result.parameter == "frequency":
        return "Excitation frequency (Hz)"
    unit = _parameter_scale(result).unit
    of = f" of {result.snubber}" if result.snubber else ""
    return f"{_WORDS[result.parameter]}{of} ({unit})"


def _envelope(f: Floats, peak: Floats) -> tuple[Floats, Floats]:
    """By increasing frequency; where there are many cycles the largest value of each stretch."""
    order = np.argsort(f, kind="stable")
    f, peak = f[order], peak[order]
    if f.size <= 2 * STRETCHES:
        return f, peak
    first = np.unique(np.searchsorted(f, np.linspace(f[0], f[-1], STRETCHES + 1)[:-1]))
    count = np.diff(np.append(first, f.size))
    return np.add.reduceat(f, first) / count, np.maximum.reduceat(peak, first)


def _plain_numbers(axis: Any) -> None:
    """1, 2, 5 a decade on a logarithmic axis, written out."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(base=10, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _legend(ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    if labels:
        columns = legend_columns(ax, min(len(labels), 4))
        ax.legend(
            handles, labels, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, frameon=False,
            fontsize="small", borderaxespad=0.1, handlelength=2.2, columnspacing=1.2,
        )  # fmt: skip
