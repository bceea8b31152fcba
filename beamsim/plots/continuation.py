"""Pictures of response curves by continuation."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.response_results import FrequencyResponse
from beamsim.plots.branches import MARKS, figure_of, stretches
from beamsim.plots.style import MOST_CURVES, curve_style, finish, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["frequency_response_figures", "plot_response_curve"]

Floats = NDArray[np.float64]


def plot_response_curve(result: FrequencyResponse, ax: Axes, probe: str) -> Axes:
    """Peak displacement against frequency: stable full, unstable dashed, special points marked."""
    scale = scale_for("m", *(b.peak_displacement[probe] for b in result.branches))
    colours = {level: k for k, level in enumerate(dict.fromkeys(b.level for b in result.branches))}
    for branch in result.branches:
        style = curve_style(colours[branch.level] if branch.period_multiple == 1 else colours[branch.level] + 1)
        y = branch.peak_displacement[probe] * scale.factor
        label = f"level {branch.level:.4g}" + (
            f", period {branch.period_multiple}" if branch.period_multiple > 1 else ""
        )
        ax.plot(
            *stretches(branch.frequency_hz, y, branch.stable, True), color=style["color"], linewidth=1.2, label=label
        )
        unstable = stretches(branch.frequency_hz, y, branch.stable, False)
        ax.plot(*unstable, color=style["color"], linewidth=0.9, linestyle=(0, (3, 1.5)))
    for kind, mark in MARKS.items():
        own = [(e, b) for b in result.branches if b.period_multiple == 1 for e in b.special if e.kind == kind]
        if own:
            at = [e.frequency_hz for e, _ in own]
            height = [
                _height(b.frequency_hz, b.peak_displacement[probe], e.frequency_hz) * scale.factor for e, b in own
            ]
            ax.plot(
                at, height, linestyle="none", marker=mark, markersize=5, color="0.2", markerfacecolor="white",
                label=kind.replace("_", " "),
            )  # fmt: skip
    ax.set_yscale("log")
    finish(ax, "Excitation frequency (Hz)", f"Peak displacement of {probe} ({scale.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def _height(x: Floats, y: Floats, at: float) -> float:
    return float(y[int(np.argmin(np.abs(x - at)))])


def frequency_response_figures(result: FrequencyResponse) -> dict[str, Figure]:
    """The response curve of every probe, by name."""
    return {
        f"response_{name}".replace("/", "_").replace(" ", "_"): figure_of(
            result.title, partial(plot_response_curve, result, probe=name)
        )
        for name in list(result.branches[0].peak_displacement)[:MOST_CURVES]
    }
