"""Curves of a sweep over frequency: sorted, thinned, and the axis they share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.sweep.result import SweepCurve, SweepResult
from beamsim.plots.style import level_text
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BINS = 700  # of frequency; the cycles in a bin are drawn as one point


def by_frequency(curve: SweepCurve, values: Floats) -> tuple[Floats, Floats]:
    """Frequencies and values in the order of increasing frequency."""
    order = np.argsort(curve.frequency_hz)
    return curve.frequency_hz[order], values[order]


def envelope(curve: SweepCurve, values: Floats, *, mean: bool = False) -> tuple[Floats, Floats]:
    """Values by increasing frequency; with many cycles, the largest (or mean) value of each frequency bin."""
    f, v = by_frequency(curve, values)
    if f.size <= 2 * BINS:
        return f, v
    edges = np.geomspace(f[0], f[-1], BINS + 1)
    first = np.unique(np.searchsorted(f, edges[:-1]))
    count = np.diff(np.append(first, f.size))
    middle = np.add.reduceat(f, first) / count
    return middle, np.add.reduceat(v, first) / count if mean else np.maximum.reduceat(v, first)


def name_level(result: SweepResult, ax: Axes, level_index: int) -> None:
    """Say of which level a panel is, where there are several."""
    levels = {c.level_index: c.level for c in result.curves.values()}
    if len(levels) > 1:
        text = level_text(levels[level_index], result.scenario.level_unit)
        ax.set_title(text, loc="left", fontsize="small")


def frequency_axis(result: SweepResult, ax: Axes) -> None:
    """The range of the sweep, logarithmic where it is wide."""
    lows = [float(c.frequency_hz.min()) for c in result.curves.values() if c.frequency_hz.size]
    highs = [float(c.frequency_hz.max()) for c in result.curves.values() if c.frequency_hz.size]
    if lows:
        ax.set_xlim(min(lows), max(highs))
        if max(highs) > 8 * min(lows):
            ax.set_xscale("log")
            from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

            ax.xaxis.set_major_locator(LogLocator(base=10, subs=(1.0, 2.0, 5.0)))
            ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.xaxis.set_minor_formatter(NullFormatter())
