"""Plots of impacts and of counted cycles."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from beamsim.analyses.run.impact_result import Impacts, Rainflow
from beamsim.analyses.run.result import RunResult
from beamsim.plots.drawing import MOST_CURVES, Chart, Curve, Picture, curve_style, finish, legend, with_unit
from beamsim.plots.style import amount, plain_scale, scale_for
from beamsim.typing import Ints

_MARKS = ("o", "^", "s", "D", "v", "x")


def _strongest(impacts: Impacts) -> list[str]:
    """The snubbers that are drawn, in their order: those with the largest peak forces."""
    hit = [name for name, snubber in impacts.snubbers.items() if snubber.number]
    kept = sorted(hit, key=lambda name: -impacts.snubbers[name].peak_force_n)[:MOST_CURVES]
    return [name for name in hit if name in kept]


def _of_snubber(impacts: Impacts, name: str) -> Ints:
    return np.flatnonzero(impacts.snubber == list(impacts.snubbers).index(name))


def impact_map(impacts: Impacts, end: float) -> Chart:
    """Peak force of every impact over its time, each snubber with its mark; small marks where impacts are many.

    The axis ends with the run (s): a few impacts are seen where they are in it.
    """
    many = impacts.begin.size
    size = float(np.clip(120.0 / np.sqrt(max(many, 1)), 1.5, 5.0))
    marks = {"linestyle": "none", "markersize": size, "markerfacecolor": "none", "rasterized": many > 20_000}
    curves = [
        Curve(name, impacts.peak_time[which], impacts.peak_force[which], {**marks, "marker": _MARKS[k]})
        for k, name in enumerate(_strongest(impacts))
        for which in [_of_snubber(impacts, name)]
    ]
    across, up = ("Time", plain_scale("s")), ("Peak force of an impact", "N")
    return Chart(across, up, curves, x_ends=(-0.02 * end, 1.02 * end), y_ends=(0.0, None))


def plot_peak_forces(impacts: Impacts, ax: Axes) -> None:
    """Histogram of the impacts' peak forces."""
    names = _strongest(impacts)
    newton = scale_for("N", impacts.peak_force)
    forces = [impacts.peak_force[_of_snubber(impacts, name)] * newton.factor for name in names]
    top = max((float(x.max()) for x in forces), default=1.0)
    edges = np.linspace(0.0, top, 1 + int(np.clip(np.sqrt(impacts.begin.size), 5, 30)))
    for k, (name, x) in enumerate(zip(names, forces, strict=True)):
        ax.hist(x, edges.tolist(), label=name, histtype="stepfilled" if len(names) == 1 else "step", **curve_style(k))
    finish(ax, with_unit("Peak force of an impact", newton), "Impacts")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlim(left=0.0)
    legend(ax)


def cycles(counted: Mapping[str, Rainflow], label: str, of: str, title: str = "") -> Chart:
    """Number of counted cycles whose range is larger, over the range.

    Parameters
    ----------
    counted : cycles by name.
    label : of the axis of ranges, without the unit.
    of : what the cycles are counted of, for a legend that leaves some out.
    title : of the panel.

    Returns
    -------
    A curve for each name with cycles.
    """
    drawn = {name: rainflow for name, rainflow in counted.items() if rainflow.range.size}
    curves = []
    for name, rainflow in drawn.items():
        ranges, number = rainflow.exceedance()
        x, y = np.append(0.5 * number[:1], number), np.append(ranges, 0.0)
        curves.append(Curve(name, x, y, {"drawstyle": "steps-post"}))
    up = (label, next((rainflow.unit for rainflow in drawn.values()), ""))
    return Chart(("Cycles with a larger range", ""), up, curves, log="x", of=of, y_ends=(0.0, None), title=title)


def impact_figures(result: RunResult) -> dict[str, Picture]:
    """Those of impacts, and of the stress ranges of each body where its stress is largest, if they were asked for."""
    figures, impacts, fatigue = {}, result.impacts, result.fatigue
    if impacts is not None and impacts.begin.size:
        counted = {name: impacts.snubbers[name].rainflow for name in _strongest(impacts)}
        figures["impact_map"] = Picture(result.title, [impact_map(impacts, float(result.time[-1]))])
        ranges = cycles(counted, "Force range", "snubbers")
        figures["impact_histogram"] = Picture(result.title, [partial(plot_peak_forces, impacts), ranges])
    if fatigue:
        damage = [f"{name}: damage {of.damage:.2g} at x = {amount(of.position, 'm')}" for name, of in fatigue.items()]
        counted, title = {name: body.rainflow for name, body in fatigue.items()}, "\n".join(damage[:MOST_CURVES])
        figures["stress_cycles"] = Picture(result.title, [cycles(counted, "Stress range", "bodies", title)])
    return figures
