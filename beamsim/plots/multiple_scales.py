"""Multiple scales against exact motions: frequency and differences over the stiffness factor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.style import curve_style, finish

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from beamsim.analyses.multiple_scales import ExpansionComparison

__all__ = ["comparison_figure"]


def comparison_figure(comparison: ExpansionComparison) -> Figure:
    """Frequency over the factor, and the relative differences of frequency and initial vector with their orders."""
    from matplotlib.figure import Figure

    path, exact = comparison.path, comparison.exact
    order = np.argsort(path.factor)
    x = path.factor[order]
    figure = Figure(figsize=(7.5, 7.5), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    top.plot(x, exact.frequency_hz[order], color="black", linewidth=1.4, label="exact")
    for k, name in ((1, "first order"), (2, "second order")):
        top.plot(x, path.frequency_hz[order, k], label=name, **curve_style(k - 1))
    finish(top, "", "frequency (Hz)")
    for ax, values, orders, what in (
        (middle, comparison.frequency_difference, comparison.frequency_orders, "frequency, difference"),
        (bottom, comparison.initial_difference, comparison.initial_orders, "initial vector, difference"),
    ):
        for k in (1, 2):
            seen = np.isfinite(values[:, k]) & (values[:, k] > 0)
            slopes = orders[np.isfinite(orders[:, k]), k]
            label = f"order {k}" + (f": observed {np.median(slopes):.2f}" if slopes.size else "")
            use = order[seen[order]]
            ax.plot(path.factor[use], values[use, k], marker=".", label=label, **curve_style(k - 1))
        ax.set_yscale("log")
        finish(ax, "", what)
        ax.legend(frameon=False, fontsize="small")
    top.set_xscale("log")
    top.legend(frameon=False, fontsize="small")
    top.set_title(f"Mode {path.mode} by multiple scales", fontsize="medium")
    bottom.set_xlabel("stiffness factor")
    return figure
