"""Plots of a page that can be zoomed and read, made from the numbers of a result: descriptions for plotly.

What is not here is shown as the picture that the command draws. Curves of many points are thinned to what a screen
shows: the lowest and highest value of every few samples.
"""

from __future__ import annotations

import math
from functools import singledispatch
from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from beamsim.analyses.compare.result import Comparison
from beamsim.analyses.compare_modes import ModeComparison
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.designs.result import DesignsResult
from beamsim.analyses.identify.result import IdentificationResult
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.analyses.result import Result
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.plots import comparison, continuation, designs, identification, nnm, run, sweep
from beamsim.plots.drawing import Axis, Chart, Curve, curve_style, scales_of, with_unit
from beamsim.plots.style import scale_for
from beamsim.typing import Floats

MOST_POINTS = 3000  # of a curve
Plots = dict[str, dict[str, Any]]


@singledispatch
def interactive_plots(result: Result) -> Plots:
    """The plots by the names of the pictures whose place they take."""
    return {}


@interactive_plots.register
def _(result: RunResult) -> Plots:
    charts = {"displacement": run.displacements(result), "acceleration": run.accelerations(result)}
    charts |= {"contact_force": run.contact_forces(result), "spectrum": run.spectra(result)}
    return {name: plot(chart) for name, chart in charts.items() if chart.curves}


@interactive_plots.register
def _(result: SweepResult) -> Plots:
    return {name: plot(chart) for name, chart in sweep.charts(result).items()}


@interactive_plots.register
def _(result: ContinuationResult) -> Plots:
    return {name: plot(chart) for name, chart in continuation.charts(result).items()}


@interactive_plots.register
def _(result: NormalModeResult) -> Plots:
    return {"backbone": plot(nnm.backbone(result))}


@interactive_plots.register
def _(result: Comparison) -> Plots:
    plots = {f"history of {c.place}": plot(comparison.histories(c)) for c in result.channels}
    return plots | {f"{c.place}_{c.quantity}": plot(comparison.swept_responses(c)) for c in result.sweeps}


@interactive_plots.register
def _(result: DesignsResult) -> Plots:
    quantities = designs.shown_quantities(result)
    if len(result.coordinates) == 1 or result.kind != "grid":
        charts = {quantity: designs.response_chart(result, quantity) for quantity in quantities}
        return {quantity.replace("_", " "): plot(chart) for quantity, chart in charts.items()}
    if len(result.coordinates) != 2 or not all(c.numeric for c in result.coordinates):
        return {}
    across, up = ((c.label, c.unit) for c in result.coordinates)
    x, y = (c.values.astype(float) for c in result.coordinates)
    plots = {}
    for response in result.responses.values():
        words = f"{response.quantity.replace('_', ' ')} {response.place}".strip()
        if response.quantity in quantities and response.values.shape == result.shape:
            plots[f"map of {words}"] = heat_map(across, up, (words, response.unit), x, y, response.values.T)
    return plots


@interactive_plots.register
def _(result: IdentificationResult) -> Plots:
    return {"frequencies": plot(identification.frequencies(result))} if result.curves else {}


@interactive_plots.register
def _(result: ModeComparison) -> Plots:
    rows, columns = (np.arange(1.0, 1 + size) for size in result.mac.shape)
    return {"mac": heat_map(("Computed mode", ""), ("Measured mode", ""), ("MAC", ""), columns, rows, result.mac)}


def plot(chart: Chart) -> dict[str, Any]:
    """A chart as data and layout for plotly; levels that curves are compared with are lines across it."""
    x, y = scales_of(chart.across, chart.up, chart.curves)
    drawn = list(chart.curves)
    ends = [float(pick(c.x)) for pick in (np.min, np.max) for c in drawn if c.x.size]
    for level in chart.levels:
        style = {"color": "0.35", **level.style}
        drawn.append(Curve(level.label, np.array([min(ends), max(ends)]), np.full(2, level.value), style))
    data: list[dict[str, Any]] = []
    for k, curve in enumerate(drawn):
        style = {**curve_style(k), **curve.style}
        colour, dashes = to_hex(style["color"]), style["linestyle"]
        line = {"color": colour, "width": 1.5}
        if not isinstance(dashes, str):
            line["dash"] = ",".join(f"{2 * each:g}px" for each in dashes[1])
        group = plain(curve.label) or (data[-1]["legendgroup"] if data else "")  # parts of one curve follow it
        mode = "lines" if not style.get("marker") else "markers" if dashes == "none" else "lines+markers"
        thin = thinned(curve.x, curve.y)
        data.append(
            {"type": "scatter", "mode": mode, "name": plain(curve.label), "line": line,
             "x": numbers(thin[0] * x.factor, 8), "y": numbers(thin[1] * y.factor),
             "marker": {"color": colour, "size": 7}, "legendgroup": group, "showlegend": bool(curve.label),
             "hovertemplate": "%{x:.6~g}, %{y:.5~g}"}
        )  # fmt: skip
    return {"data": data, "layout": _layout(with_unit(chart.across[0], x), with_unit(chart.up[0], y), chart.log)}


def thinned(x: Floats, y: Floats, most: int = MOST_POINTS) -> tuple[Floats, Floats]:
    """The same curve with at most about so many points: the lowest and highest value of every few.

    Parameters
    ----------
    x, y : (n,) arrays.
    most : number of points; a curve of fewer is kept as it is.

    Returns
    -------
    Arrays of equal length, in the order of the curve.
    """
    length = -(-2 * y.size // most)
    if y.size <= most or length < 3:
        return x, y
    whole = y.size // length * length
    blocks = y[:whole].reshape(-1, length)
    first = np.arange(blocks.shape[0]) * length
    pick = np.sort(np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)], axis=1), axis=1).ravel()
    pick = np.append(pick, np.arange(whole, y.size))
    return x[pick], y[pick]


def heat_map(across: Axis, up: Axis, of: Axis, x: Floats, y: Floats, values: Floats) -> dict[str, Any]:
    """Values over two axes for plotly.

    Parameters
    ----------
    across, up, of : words and SI unit of the axes and of the values.
    x, y, values : (nx,), (ny,) and (ny, nx) in SI units.

    Returns
    -------
    Data and layout, which JSON can hold.
    """
    scales = [scale_for(str(unit), known) for (_, unit), known in ((across, x), (up, y), (of, values))]
    labels = [with_unit(words, scale) for (words, _), scale in zip((across, up, of), scales, strict=True)]
    data = {
        "type": "heatmap", "x": numbers(x * scales[0].factor), "y": numbers(y * scales[1].factor),
        "z": [numbers(row * scales[2].factor) for row in values], "colorscale": "Cividis",
        "colorbar": {"title": {"text": plain(labels[2]), "side": "right"}},
        "hovertemplate": "%{x:.6~g}, %{y:.6~g}: %{z:.5~g}<extra></extra>",
    }  # fmt: skip
    return {"data": [data], "layout": _layout(labels[0], labels[1], "")}


def _layout(xlabel: str, ylabel: str, log: str) -> dict[str, Any]:
    axis = {"showline": True, "linecolor": "#444", "gridcolor": "#e4e4e4", "zeroline": False, "ticks": "outside"}
    axes = {
        f"{letter}axis": {**axis, "title": {"text": plain(label)}, "type": "log" if letter in log else "linear"}
        for letter, label in (("x", xlabel), ("y", ylabel))
    }
    return {
        "height": 380, "margin": {"l": 70, "r": 20, "t": 40, "b": 55}, "hovermode": "closest", "plot_bgcolor": "white",
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#222"},
        "legend": {"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom", "font": {"size": 11}}, **axes,
    }  # fmt: skip


def numbers(values: Floats, digits: int = 6) -> list[float | None]:
    """Plain numbers with so many digits; None where there is none."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in np.asarray(values, float)]


def plain(text: str) -> str:
    """A text for plotly, which reads a little HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("\n", "<br>")
