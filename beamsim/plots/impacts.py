"""Plots of impacts and of counted cycles."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from beamsim.analyses.run.impact_result import Fatigue, Impacts, Rainflow
from beamsim.analyses.run.result import RunResult
from beamsim.plots.drawing import MOST_CURVES, Curve, curve_style, draw_curves, finish, legend, picture, with_unit
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


def plot_impact_map(impacts: Impacts, ax: Axes, end: float) -> Axes:
    """Peak force of every impact over its time, each snubber with its mark; small marks where impacts are many.

    Parameters
    ----------
    impacts : of all snubbers.
    ax : to draw on.
    end : end of the run (s), and of the axis: a few impacts are seen where they are in it.

    Returns
    -------
    The axes.
    """
    many, clock = impacts.begin.size, plain_scale("s")
    size = float(np.clip(120.0 / np.sqrt(max(many, 1)), 1.5, 5.0))
    marks = {"linestyle": "none", "markersize": size, "markerfacecolor": "none", "rasterized": many > 20_000}
    curves = [
        Curve(name, impacts.peak_time[which], impacts.peak_force[which], {**marks, "marker": _MARKS[k]})
        for k, name in enumerate(_strongest(impacts))
        for which in [_of_snubber(impacts, name)]
    ]
    up = ("Peak force of an impact", "N")
    draw_curves(ax, ("Time", clock), up, curves)
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(-0.02 * end * clock.factor, 1.02 * end * clock.factor)
    return ax


def plot_peak_forces(impacts: Impacts, ax: Axes) -> Axes:
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
    return ax


def plot_cycles(counted: Mapping[str, Rainflow], ax: Axes, label: str, of: str) -> Axes:
    """Number of counted cycles whose range is larger, over the range.

    Parameters
    ----------
    counted : cycles by name.
    ax : to draw on.
    label : of the axis of ranges, without the unit.
    of : what the cycles are counted of, for a legend that leaves some out.

    Returns
    -------
    The axes.
    """
    drawn = {name: cycles for name, cycles in counted.items() if cycles.range.size}
    curves = []
    for name, cycles in drawn.items():
        ranges, number = cycles.exceedance()
        x, y = np.append(0.5 * number[:1], number), np.append(ranges, 0.0)
        curves.append(Curve(name, x, y, {"drawstyle": "steps-post"}))
    unit = next((cycles.unit for cycles in drawn.values()), "")
    draw_curves(ax, ("Cycles with a larger range", ""), (label, unit), curves, of=of)
    ax.set_xscale("log")
    ax.set_ylim(bottom=0.0)
    return ax


def plot_fatigue(fatigue: Mapping[str, Fatigue], ax: Axes) -> Axes:
    """Stress ranges of each body where its stress is largest, with the damage of the run."""
    plot_cycles({name: body.rainflow for name, body in fatigue.items()}, ax, "Stress range", "bodies")
    texts = [f"{name}: damage {body.damage:.2g} at x = {amount(body.position, 'm')}" for name, body in fatigue.items()]
    ax.text(0.99, 0.97, "\n".join(texts[:MOST_CURVES]), transform=ax.transAxes, ha="right", va="top", fontsize="small")
    return ax


def impact_figures(result: RunResult) -> dict[str, Figure]:
    """Those of impacts and fatigue, where they were asked for."""
    figures, impacts, fatigue = {}, result.impacts, result.fatigue
    if impacts is not None and impacts.begin.size:
        end, title = float(result.time[-1]), result.title
        cycles = {name: impacts.snubbers[name].rainflow for name in _strongest(impacts)}
        figures["impact_map"] = picture(title, partial(plot_impact_map, impacts, end=end))
        figures["impact_histogram"] = picture(
            title, partial(plot_peak_forces, impacts), partial(plot_cycles, cycles, label="Force range", of="snubbers")
        )
    if fatigue:
        figures["stress_cycles"] = picture(result.title, partial(plot_fatigue, fatigue))
    return figures
