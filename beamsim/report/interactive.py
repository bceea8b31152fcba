"""Plots of a page that can be zoomed and read, made from the numbers of a result: descriptions for plotly.

What is not here is shown as the picture that the command draws. Curves of many points are thinned to what a screen
shows: the lowest and highest value of every few samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from beamsim.analyses.compare.result import Comparison
from beamsim.analyses.compare_modes.result import ModeComparison
from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.designs.result import DesignsResult
from beamsim.analyses.identify.result import IdentificationResult
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.analyses.result import Result
from beamsim.analyses.run.result import RunResult
from beamsim.analyses.sweep.result import SweepResult
from beamsim.orbits.branch import special_name
from beamsim.plots.branches import UNSTABLE
from beamsim.plots.drawing import MOST_CURVES, Curve, curve_style, thinned, with_unit
from beamsim.plots.style import Scale, level_text, plain_scale, scale_for
from beamsim.typing import Floats

MOST_POINTS = 3000  # of a curve
Plots = dict[str, dict[str, Any]]
_FREQUENCY = ("Excitation frequency", Scale(1.0, "Hz"))


@singledispatch
def interactive_plots(result: Result) -> Plots:
    """The plots by the names of the pictures whose place they take."""
    return {}


@interactive_plots.register
def _(result: RunResult) -> Plots:
    time, clock = result.time, ("Time", plain_scale("s"))

    def history(words: str, unit: str, places: Any, field: str) -> dict[str, Any]:
        shown = list(places.items())[:MOST_CURVES]
        curves = [Curve(name, *thinned(time, getattr(of, field), MOST_POINTS)) for name, of in shown]
        return plot(clock, (words, unit), curves)

    kind = "absolute" if result.low_pass_hz is None else "low_passed"
    plots = {
        "displacement": history("Relative displacement", "m", result.probes, "displacement"),
        "acceleration": history("Acceleration", "m/s^2", result.probes, f"{kind}_acceleration"),
    }
    if result.snubbers:
        plots["contact_force"] = history("Contact force", "N", result.snubbers, "force")
    spectra = [s for s in result.spectra.values() if s.quantity == "absolute_acceleration"]
    curves = [Curve(s.probe, *thinned(s.frequency_hz, s.amplitude_db, MOST_POINTS)) for s in spectra]
    plots["spectrum"] = plot(("Frequency", Scale(1.0, "Hz")), ("Acceleration (dB re peak)", ""), curves)
    return plots


@interactive_plots.register
def _(result: SweepResult) -> Plots:
    curves = list(result.curves.values())

    def peaks(words: str, unit: str, of: Callable[[Any], Any], log: str) -> dict[str, Any]:
        drawn = []
        for curve in curves:
            order, level = np.argsort(curve.frequency_hz), level_text(curve.level, result.scenario.level_unit)
            for name, envelope in of(curve).items():
                values = thinned(curve.frequency_hz[order], envelope.peak[order], MOST_POINTS)
                drawn.append(Curve(f"{name}, {curve.direction}, {level}", *values))
        return plot(_FREQUENCY, (words, unit), drawn, log=log)

    plots = {"response_0": peaks("Peak displacement", "m", lambda curve: curve.displacement, "y")}
    if curves and curves[0].acceleration:
        plots["acceleration"] = peaks("Peak acceleration", "m/s^2", lambda curve: curve.acceleration, "y")
    if curves and curves[0].force:
        plots["contact"] = peaks("Peak contact force", "N", lambda curve: curve.force, "")
    return plots


@interactive_plots.register
def _(result: ContinuationResult) -> Plots:
    words = "Excitation frequency" if result.parameter == "frequency" else result.parameter.capitalize()
    first = result.branches[0]
    plots = {}
    for kind, up, unit, names in (
        ("response", "Peak displacement", "m", first.peak_displacement),
        ("force", "Peak contact force", "N", first.peak_force),
    ):
        field = "peak_displacement" if kind == "response" else "peak_force"
        for name in list(names)[:MOST_CURVES]:
            curves = [
                curve
                for b in result.branches
                for curve in _branch(level_text(b.level, result.level_unit), b, b.parameter, getattr(b, field)[name])
            ]
            plots[f"{kind}_{name}"] = plot((words, result.unit), (f"{up} of {name}", unit), curves)
    return plots


def _branch(label: str, branch: Any, x: Floats, y: Floats) -> list[Curve]:
    """Stable and unstable stretches, and the special points."""
    curves = [Curve(label, x, np.where(branch.stable, y, np.nan), {"linestyle": "-"})]
    if not branch.stable.all():
        unstable = np.where(branch.stable, np.nan, y)
        curves.append(Curve(f"{label}, unstable", x, unstable, {"linestyle": UNSTABLE}))
    for kind in dict.fromkeys(event.kind for event in branch.special):
        at = [int(np.argmin(np.abs(branch.parameter - e.parameter))) for e in branch.special if e.kind == kind]
        curves.append(Curve(special_name(kind), x[at], y[at], {"marker": "o"}))
    return curves


@interactive_plots.register
def _(result: DesignsResult) -> Plots:
    plots, coordinates = {}, result.coordinates
    for response in list(result.responses.values())[:MOST_CURVES]:
        if not all(c.numeric for c in coordinates[:2]) or not np.isfinite(response.values).any():
            continue
        words, across = f"{response.quantity.replace('_', ' ')} {response.place}".strip(), _coordinate(coordinates[0])
        values = response.values
        if values.shape == result.shape and len(coordinates) == 2 and result.kind == "grid":
            x, y = (c.values.astype(float) for c in coordinates)
            up = _coordinate(coordinates[1])
            plots[f"map of {words}"] = heat_map(across, up, (words, response.unit), x, y, values.T)
        elif values.shape == result.shape and values.ndim == 1:
            x = coordinates[0].values.astype(float)
            plots[words] = plot(across, (words, response.unit), [Curve("", x, values, {"marker": "o"})])
    return plots


def _coordinate(coordinate: Any) -> tuple[str, str]:
    return coordinate.label, coordinate.unit


@interactive_plots.register
def _(result: IdentificationResult) -> Plots:
    plots, up = {}, ("Natural frequency", Scale(1.0, "Hz"))
    if result.curves:
        curves = [Curve(f"mode {curve.mode}", curve.stiffness, curve.frequency_hz) for curve in result.curves]
        plots["frequencies"] = plot(("Stiffness of the snubber", "N/m"), up, curves, log="xy")
    tables = [("without the snubber", result.without_snubber), ("with permanent contact", result.with_snubber)]
    if result.update is not None:
        tables += [("before updating", result.update.before), ("after", result.update.after)]
    drawn = [
        Curve(label, table.mode.astype(float), table.difference_percent, {"marker": "o"})
        for label, table in tables
        if table is not None and np.isfinite(table.measured_hz).any()
    ]
    if drawn:
        plots["residuals"] = plot(("Mode", ""), ("Predicted − measured (%)", ""), drawn)
    return plots


@interactive_plots.register
def _(result: NormalModeResult) -> Plots:
    hertz = ("Frequency", Scale(1.0, "Hz"))
    if result.parameter == "stiffness_factor":
        curves = [c for b in result.branches for c in _branch(b.kind, b, b.parameter, b.frequency_hz)]
        return {"backbone": plot(("Stiffness factor ε", ""), hertz, curves)}
    largest = [np.abs(b.initial_displacement).max(axis=1) for b in result.branches]
    branches = zip(result.branches, largest, strict=True)
    curves = [c for b, y in branches for c in _branch(b.kind, b, b.frequency_hz, y)]
    return {"backbone": plot(hertz, ("Largest deflection at the extreme", "m"), curves)}


@interactive_plots.register
def _(result: Comparison) -> Plots:
    plots = {}
    for c in result.channels:
        curves = [
            Curve("predicted", *thinned(c.predicted_time, c.predicted_history, MOST_POINTS)),
            Curve("measured", *thinned(c.measured_time, c.measured_history, MOST_POINTS)),
        ]
        words = f"{c.quantity.replace('_', ' ')} of {c.place}"
        plots[f"history of {c.place}"] = plot(("Time", plain_scale("s")), (words, c.unit), curves)
    for swept in result.sweeps:
        curves = [Curve(of, swept.frequency_hz, np.abs(getattr(swept, of))) for of in ("predicted", "measured")]
        up = (swept.quantity.replace("_", " "), swept.unit)
        plots[f"{swept.place}_{swept.quantity}"] = plot(_FREQUENCY, up, curves, log="y")
    return plots


@interactive_plots.register
def _(result: ModeComparison) -> Plots:
    rows, columns = (np.arange(1.0, 1 + size) for size in result.mac.shape)
    return {"mac": heat_map(("Computed mode", ""), ("Measured mode", ""), ("MAC", ""), columns, rows, result.mac)}


def plot(
    across: tuple[str, str | Scale], up: tuple[str, str | Scale], curves: Sequence[Curve], *, log: str = ""
) -> dict[str, Any]:
    """Curves in SI units as data and layout for plotly.

    Parameters
    ----------
    across, up : words and SI unit, or scale, of an axis.
    log : the letters of logarithmic axes.
    """
    x, y = (
        unit if isinstance(unit, Scale) else scale_for(unit, *(getattr(curve, name) for curve in curves))
        for (_, unit), name in ((across, "x"), (up, "y"))
    )
    data, named = [], set[str]()
    for k, curve in enumerate(curves):
        style = {**curve_style(k), **curve.style}
        dashes = style["linestyle"]
        line = {"color": style["color"], "width": 1.5}
        if not isinstance(dashes, str):
            line["dash"] = ",".join(f"{2 * each:g}px" for each in dashes[1])
        data.append(
            {"type": "scatter", "mode": "markers" if "marker" in style else "lines", "name": plain(curve.label),
             "x": numbers(curve.x * x.factor, 8), "y": numbers(curve.y * y.factor), "line": line,
             "marker": {"color": style["color"], "size": 7}, "legendgroup": plain(curve.label),
             "showlegend": bool(curve.label) and curve.label not in named, "hovertemplate": "%{x:.6~g}, %{y:.5~g}"}
        )  # fmt: skip
        named.add(curve.label)
    return {"data": data, "layout": _layout(with_unit(across[0], x), with_unit(up[0], y), log)}


def heat_map(
    across: tuple[str, str], up: tuple[str, str], of: tuple[str, str], x: Floats, y: Floats, values: Floats
) -> dict[str, Any]:
    """Values (ny, nx) over two axes, in SI units, as data and layout for plotly."""
    scales = [scale_for(unit, known) for (_, unit), known in ((across, x), (up, y), (of, values))]
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
