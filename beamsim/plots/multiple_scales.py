"""Multiple scales against exact motions: nonlinear modes over the stiffness factor, response curves over frequency."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import ExpansionComparison
from beamsim.plots.branches import UNSTABLE, plot_branch
from beamsim.plots.drawing import (
    MOST_CURVES,
    SMALL,
    Curve,
    curve_style,
    draw_curves,
    finish,
    legend,
    panels,
    with_unit,
)
from beamsim.plots.stations import draw_along
from beamsim.plots.style import level_text, scale_for
from beamsim.structures.stations import Stations

ROUND_OFF = 1e-14  # differences below it are not drawn


def comparison_figure(comparison: ExpansionComparison) -> Figure:
    """Frequency over the factor, and the relative differences of frequency and initial vector with their orders."""
    path, exact = comparison.path, comparison.exact
    order = np.argsort(path.factor)
    x, factor = path.factor[order], ("Stiffness factor ε", "")
    title = f"Mode {path.mode} by multiple scales"
    figure, (top, *below) = panels(title, 3, size=(7.5, 7.5), sharex=True)
    curves = [Curve("exact", x, exact.frequency_hz[order], {"color": "black"})]
    curves += [Curve(f"{name} order", x, path.frequency_hz[order, k]) for k, name in ((1, "first"), (2, "second"))]
    draw_curves(top, ("", ""), ("Frequency (Hz)", ""), curves)
    known = exact.frequency_hz[np.isfinite(exact.frequency_hz)]
    if known.size:  # far out the expansion leaves the picture
        room = 0.5 * max(float(np.ptp(known)), 1e-6 * path.linear_frequency_hz)
        top.set_ylim(float(known.min()) - room, float(known.max()) + room)
    top.set_xscale("log")
    for ax, values, orders, what in zip(
        below,
        (comparison.frequency_difference, comparison.initial_difference),
        (comparison.frequency_orders, comparison.initial_orders),
        ("Difference in frequency", "Difference in initial vector"),
        strict=True,
    ):
        curves = []
        for k in (1, 2):
            slopes = orders[np.isfinite(orders[:, k]), k]
            label = f"order {k}" + (f": observed {np.median(slopes):.2f}" if slopes.size else "")
            use = order[values[order, k] > ROUND_OFF]
            curves.append(Curve(label, path.factor[use], values[use, k], {"marker": "."}))
        draw_curves(ax, factor if ax is below[-1] else ("", ""), (what, ""), curves)
        ax.set_yscale("log")
    return figure


def plot_initial_vectors(comparison: ExpansionComparison, stations: Stations, ax: Axes) -> Axes:
    """Deflection at rest, linear, to both orders and exact, at the largest factor with an exact motion."""
    path, exact = comparison.path, comparison.exact
    known = np.flatnonzero(np.isfinite(exact.frequency_hz))
    k = int(known[np.argmax(path.factor[known])])
    thick = {"color": "0.7", "linewidth": 4.0, "linestyle": "-", "marker": ""}
    names = ("linear mode", "first order", "second order")
    shapes = [("exact", exact.initial_displacement[k], thick)]
    shapes += [(name, path.initial_displacement[k][order], {}) for order, name in enumerate(names)]
    draw_along(ax, stations, "Deflection at rest", shapes)
    legend(ax, f"Mode {path.mode}, stiffness factor {path.factor[k]:.3g}")
    return ax


def comparison_figures(comparison: ExpansionComparison, stations: Stations) -> dict[str, Figure]:
    """Both pictures of a mode by multiple scales, by name; the second needs an exact motion."""
    figures = {"multiple_scales": comparison_figure(comparison)}
    if np.any(np.isfinite(comparison.exact.frequency_hz)):
        figures["multiple_scales_initial"], (ax,) = panels("", size=SMALL)
        plot_initial_vectors(comparison, stations, ax)
    return figures


def plot_expanded_response(result: ContinuationResult, ax: Axes, probe: str) -> Axes:
    """The expansion (thick, light) under the exact response (thin, dark): largest deflection against frequency."""
    main = [b for b in result.branches if b.period_multiple == 1]
    scale = scale_for("m", *(b.peak_displacement[probe] for b in main), *(c.first[probe] for c in result.expansion))
    for k, c in enumerate(result.expansion):
        colour, level = curve_style(k)["color"], level_text(c.level, result.level_unit)
        plot_branch(ax, c.frequency_hz, c.first[probe] * scale.factor, c.stable, color=colour, width=4.0, alpha=0.35,
                    label=f"multiple scales, {level}", solid_capstyle="butt")  # fmt: skip
        for n, b in enumerate(b for b in main if b.level == c.level):
            label = "_nolegend_" if n else f"exact, {level}"
            y = b.peak_displacement[probe] * scale.factor
            plot_branch(ax, b.frequency_hz, y, b.stable, color=colour, width=1.2, label=label)
    ax.set_ylim(bottom=0.0)
    finish(ax, "Excitation frequency (Hz)", with_unit(f"Largest deflection of {probe}", scale))
    legend(ax)
    return ax


def plot_forced_orders(result: ContinuationResult, ax: Axes) -> Axes:
    """Difference from the exact motion while springs, damping and force are made smaller together."""
    curves = []
    for k, c in enumerate(result.expansion):
        for order, (name, dashes) in enumerate((("leading order", UNSTABLE), ("first order", "-"))):
            slopes = c.orders[np.isfinite(c.orders[:, order]), order]
            label = f"{level_text(c.level, result.level_unit)}, {name}"
            label += f": observed order {slopes[-1]:.2f}" if slopes.size else ""
            style = {"color": curve_style(k)["color"], "linestyle": dashes, "marker": "."}
            curves.append(Curve(label, c.factor, c.difference[:, order], style))
    across, up = ("Factor of springs, damping and force", ""), ("Difference over the motion's size", "")
    draw_curves(ax, across, up, curves)
    ax.set(xscale="log", yscale="log")
    return ax


def forced_expansion_figures(result: ContinuationResult) -> dict[str, Figure]:
    """The response of every probe with its expansion, and the orders, by name."""
    figures = {}
    for name in list(result.expansion[0].first)[:MOST_CURVES]:
        figures[f"multiple_scales_{name}"], (ax,) = panels(result.title, size=SMALL)
        plot_expanded_response(result, ax, name)
    figures["multiple_scales_orders"], (ax,) = panels(result.title, size=SMALL)
    plot_forced_orders(result, ax)
    return figures
