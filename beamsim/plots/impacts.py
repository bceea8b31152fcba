"""Plots of impacts and of counted cycles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.impact_result import Fatigue, Impacts, Rainflow
from beamsim.plots.style import MOST_CURVES, amount, curve_style, finish, legend, scale_for, time_scale
from beamsim.typing import Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.run.result import RunResult

BINS = 30  # at most, of a histogram
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
    end : end of the run (s), and of the axis: a few impacts are seen where they are in it.
    """
    names = _strongest(impacts)
    newton, clock = scale_for("N", impacts.peak_force), time_scale()
    size = float(np.clip(120.0 / np.sqrt(max(impacts.begin.size, 1)), 1.5, 5.0))
    for k, name in enumerate(names):
        which = _of_snubber(impacts, name)
        ax.plot(
            impacts.peak_time[which] * clock.factor, impacts.peak_force[which] * newton.factor, linestyle="none",
            marker=_MARKS[k % len(_MARKS)], markersize=size, markerfacecolor="none", color=curve_style(k)["color"],
            label=name, rasterized=impacts.begin.size > 20_000,
        )  # fmt: skip
    ax.set_ylim(bottom=0.0)
    ax.set_xlim(-0.02 * end * clock.factor, 1.02 * end * clock.factor)
    finish(ax, f"Time ({clock.unit})", f"Peak force of an impact ({newton.unit})")
    legend(ax, len(names), len(impacts.snubbers), "snubbers")
    return ax


def plot_peak_forces(impacts: Impacts, ax: Axes) -> Axes:
    """Histogram of the impacts' peak forces."""
    from matplotlib.ticker import MaxNLocator

    names = _strongest(impacts)
    newton = scale_for("N", impacts.peak_force)
    forces = [impacts.peak_force[_of_snubber(impacts, name)] * newton.factor for name in names]
    top = max((float(x.max()) for x in forces), default=1.0)
    edges = np.linspace(0.0, top, 1 + int(np.clip(np.sqrt(impacts.begin.size), 5, BINS)))
    for k, (name, x) in enumerate(zip(names, forces, strict=True)):
        number, style = np.histogram(x, edges)[0], curve_style(k)
        if len(names) == 1:
            ax.bar(
                edges[:-1], number, np.diff(edges), align="edge", color=style["color"], edgecolor="white", label=name
            )
        else:
            ax.stairs(number, edges, label=name, **style)
    finish(ax, f"Peak force of an impact ({newton.unit})", "Impacts")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlim(left=0.0)
    legend(ax, len(names), len(impacts.snubbers), "snubbers")
    return ax


def plot_cycles(counted: Mapping[str, Rainflow], ax: Axes, label: str, of: str) -> Axes:
    """Number of counted cycles whose range is larger, over the range."""
    drawn = {name: cycles for name, cycles in counted.items() if cycles.range.size}
    unit = next((cycles.unit for cycles in drawn.values()), "")
    scale = scale_for(unit, *(cycles.range for cycles in drawn.values()))
    for k, (name, cycles) in enumerate(list(drawn.items())[:MOST_CURVES]):
        order = np.argsort(-cycles.range, kind="stable")
        number = np.cumsum(cycles.count[order])
        ax.step(np.append(0.5 * number[:1], number), np.append(cycles.range[order], 0.0) * scale.factor, where="post",
                label=name, **curve_style(k))  # fmt: skip
    ax.set_xscale("log")
    ax.set_ylim(bottom=0.0)
    finish(ax, "Cycles with a larger range", f"{label} ({scale.unit})")
    legend(ax, min(len(drawn), MOST_CURVES), len(drawn), of)
    return ax


def plot_fatigue(fatigue: Mapping[str, Fatigue], ax: Axes) -> Axes:
    """Stress ranges of each body where its stress is largest, with the damage of the run."""
    plot_cycles({name: body.rainflow for name, body in fatigue.items()}, ax, "Stress range", "bodies")
    texts = [f"{name}: damage {body.damage:.2g} at x = {amount(body.position, 'm')}" for name, body in fatigue.items()]
    ax.text(0.99, 0.97, "\n".join(texts[:MOST_CURVES]), transform=ax.transAxes, ha="right", va="top", fontsize="small")
    return ax


def impact_figures(
    result: RunResult, panels: Callable[[int, int, float], tuple[Figure, list[Axes]]]
) -> dict[str, Figure]:
    """Those of impacts and fatigue, where they were asked for; ``panels`` makes a figure of rows, columns, height."""
    figures = {}
    if result.impacts is not None and result.impacts.begin.size:
        figures["impact_map"], (ax,) = panels(1, 1, 4.4)
        plot_impact_map(result.impacts, ax, float(result.time[-1]))
        figures["impact_histogram"], (above, below) = panels(2, 1, 5.6)
        plot_peak_forces(result.impacts, above)
        names = _strongest(result.impacts)
        cycles = {name: result.impacts.snubbers[name].rainflow for name in names}
        plot_cycles(cycles, below, "Force range", "snubbers")
        if (drawn := below.get_legend()) is not None:
            drawn.remove()
    if result.fatigue:
        figures["stress_cycles"], (ax,) = panels(1, 1, 4.4)
        plot_fatigue(result.fatigue, ax)
    return figures
