"""Pictures that can be zoomed and read, from the same charts and maps as those that matplotlib draws: descriptions for
plotly. Curves of many points are thinned to what a screen shows: the lowest and highest value of every few samples.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from beamsim.plots.drawing import Axis, Chart, Curve, HeatMap, Picture, curve_style, thin_out, with_unit
from beamsim.plots.style import Scale, scale_for
from beamsim.typing import Floats

MOST_POINTS = 3000  # points of a curve
MOST_TICKS = 8  # ticks of an axis of counts


def interactive(picture: Picture) -> list[dict[str, Any]]:
    """Panels of a picture; empty if a panel is neither chart nor map, or a long curve cannot be thinned."""
    described: list[dict[str, Any]] = []
    for panel in picture.panels:
        if isinstance(panel, HeatMap):
            described.append(heat_map(panel))
        elif isinstance(panel, Chart) and all(_readable(curve) for curve in (*panel.drawn, *panel.marks)):
            described.append(plot(panel))
        else:
            return []
    return described


def _readable(curve: Curve) -> bool:
    """True if few points represent the curve; loops cannot be thinned by their extremes."""
    return curve.x.size <= MOST_POINTS or thin_out(curve.x, curve.y, MOST_POINTS)[0].size < curve.x.size


def plot(chart: Chart) -> dict[str, Any]:
    """Data and layout of a chart for plotly; limits are drawn as horizontal lines."""
    x, y = chart.scales
    drawn = [*chart.drawn, *chart.marks]
    ends = [float(pick(c.x)) for pick in (np.min, np.max) for c in drawn if c.x.size]
    for level in chart.levels if ends else ():
        style = {"color": "0.35", **level.style}
        drawn.append(Curve(level.label, np.array([min(ends), max(ends)]), np.full(2, level.value), style))
    data: list[dict[str, Any]] = []
    for k, curve in enumerate(drawn):
        style = {**curve_style(k), **curve.style}
        colour, dashes = to_hex(style["color"]), style["linestyle"]
        line = {"color": colour, "width": 1.5}
        if not isinstance(dashes, str):
            line["dash"] = ",".join(f"{2 * each:g}px" for each in dashes[1])
        group = without_html(curve.label) or (data[-1]["legendgroup"] if data else "")  # of one curve
        mode = "lines" if not style.get("marker") else "markers" if dashes == "none" else "lines+markers"
        thin = thin_out(curve.x, curve.y, MOST_POINTS)
        data.append(
            {"type": "scatter", "mode": mode, "name": without_html(curve.label), "line": line,
             "x": numbers(thin[0] * x.factor, 8), "y": numbers(thin[1] * y.factor),
             "marker": {"color": colour, "size": 7}, "legendgroup": group, "showlegend": bool(curve.label),
             "hovertemplate": "%{x:.6~g}, %{y:.5~g}"}
        )  # fmt: skip
    layout = _layout(with_unit(chart.x_axis[0], x), with_unit(chart.y_axis[0], y), chart.log)
    for letter, scale, shown in (("x", x, chart.x_ends), ("y", y, chart.y_ends)):
        known = [end * scale.factor for end in shown if end is not None]
        if len(known) == 2 and all(math.isfinite(end) for end in known):
            layout[f"{letter}axis"]["range"] = [math.log10(end) for end in known] if letter in chart.log else known
    for letter in chart.integer_axes:
        most = max((float(np.max(getattr(c, letter))) for c in drawn if c.x.size), default=0.0)
        layout[f"{letter}axis"] |= {"tickmode": "linear", "tick0": 0, "dtick": max(1, math.ceil(most / MOST_TICKS))}
    if chart.note:
        at = {"xref": "paper", "yref": "paper", "x": 1, "y": 1, "align": "right", "showarrow": False}
        layout["annotations"] = [{"text": without_html(chart.note), **at}]
    return {"data": data, "layout": layout}


def heat_map(panel: HeatMap) -> dict[str, Any]:
    """Data and layout of a map for plotly, in a form that JSON can hold."""
    axes = ((panel.x_axis, panel.x), (panel.y_axis, panel.y), (panel.z_axis, panel.values))
    x, y, of = (_scale(axis, known) for axis, known in axes)
    labels = [with_unit(words, scale) for ((words, _), _), scale in zip(axes, (x, y, of), strict=True)]
    data = {
        "type": "heatmap", "x": numbers(panel.x * x.factor), "y": numbers(panel.y * y.factor),
        "z": [numbers(row * of.factor) for row in panel.values], "colorscale": "Cividis",
        "colorbar": {"title": {"text": without_html(labels[2]), "side": "right"}},
        "hovertemplate": "%{x:.6~g}, %{y:.6~g}: %{z:.5~g}<extra></extra>",
    }  # fmt: skip
    return {"data": [data], "layout": _layout(labels[0], labels[1], "")}


def _scale(axis: Axis, values: Floats) -> Scale:
    return axis[1] if isinstance(axis[1], Scale) else scale_for(axis[1], values)


def _layout(xlabel: str, ylabel: str, log: str) -> dict[str, Any]:
    axis = {"showline": True, "linecolor": "#444", "gridcolor": "#e4e4e4", "zeroline": False, "ticks": "outside"}
    axes = {
        f"{letter}axis": {**axis, "title": {"text": without_html(label)}, "type": "log" if letter in log else "linear"}
        for letter, label in (("x", xlabel), ("y", ylabel))
    }
    return {
        "height": 380, "margin": {"l": 70, "r": 20, "t": 40, "b": 55}, "hovermode": "closest", "plot_bgcolor": "white",
        "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#222"},
        "legend": {"orientation": "h", "x": 0, "y": 1.01, "yanchor": "bottom", "font": {"size": 11}}, **axes,
    }  # fmt: skip


def numbers(values: Floats, digits: int = 6) -> list[float | None]:
    """Plain numbers with a number of digits; None for missing ones."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in np.asarray(values, float)]


def without_html(text: str) -> str:
    """Text with HTML escaped, since plotly interprets some of it."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("\n", "<br>")
