"""Multiple scales against exact motions: nonlinear modes over the stiffness factor, response curves over frequency."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.branches import figure_of, stretches
from beamsim.plots.stations import finish_along, plot_along
from beamsim.plots.style import MOST_CURVES, curve_style, finish, level_text, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.nnm.result import ExpansionComparison
    from beamsim.analyses.response.result import FrequencyResponse
    from beamsim.structures.stations import Stations

ROUND_OFF = 1e-14  # differences below it are not drawn


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
    known = exact.frequency_hz[np.isfinite(exact.frequency_hz)]
    if known.size:  # far out the expansion leaves the picture
        room = 0.5 * max(float(np.ptp(known)), 1e-6 * path.linear_frequency_hz)
        top.set_ylim(float(known.min()) - room, float(known.max()) + room)
    finish(top, "", "Frequency (Hz)")
    for ax, values, orders, what in (
        (middle, comparison.frequency_difference, comparison.frequency_orders, "Difference in frequency"),
        (bottom, comparison.initial_difference, comparison.initial_orders, "Difference in initial vector"),
    ):
        for k in (1, 2):
            seen = np.isfinite(values[:, k]) & (values[:, k] > 0)
            slopes = orders[np.isfinite(orders[:, k]), k]
            label = f"order {k}" + (f": observed {np.median(slopes):.2f}" if slopes.size else "")
            seen &= values[:, k] > ROUND_OFF
            use = order[seen[order]]
            ax.plot(path.factor[use], values[use, k], marker=".", label=label, **curve_style(k - 1))
        ax.set_yscale("log")
        finish(ax, "", what)
        ax.legend(frameon=False, fontsize="small")
    top.set_xscale("log")
    top.legend(frameon=False, fontsize="small")
    top.set_title(f"Mode {path.mode} by multiple scales", fontsize="medium", loc="left")
    bottom.set_xlabel("Stiffness factor ε")
    return figure


def plot_initial_vectors(comparison: ExpansionComparison, stations: Stations, ax: Axes) -> Axes:
    """Deflection at rest, linear, to both orders and exact, at the largest factor with an exact motion."""
    path, exact = comparison.path, comparison.exact
    known = np.flatnonzero(np.isfinite(exact.frequency_hz))
    k = int(known[np.argmax(path.factor[known])])
    shapes = path.initial_displacement[k]
    scale = scale_for("m", shapes, exact.initial_displacement[k])
    measured = exact.initial_displacement[k] * scale.factor
    plot_along(ax, stations, measured, "exact", color="0.7", linewidth=4.0, marker="")
    for order, name in enumerate(("linear mode", "first order", "second order")):
        plot_along(ax, stations, shapes[order] * scale.factor, name, **curve_style((2, 0, 1)[order]))
    finish_along(ax, stations, f"Deflection at rest ({scale.unit})")
    ax.set_title(f"Mode {path.mode}, stiffness factor {path.factor[k]:.3g}", fontsize="medium", loc="left")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def comparison_figures(comparison: ExpansionComparison, stations: Stations) -> dict[str, Figure]:
    """Both pictures of a mode by multiple scales, by name; the second needs an exact motion."""
    figures = {"multiple_scales": comparison_figure(comparison)}
    if np.any(np.isfinite(comparison.exact.frequency_hz)):
        figures["multiple_scales_initial"] = figure_of("", lambda ax: plot_initial_vectors(comparison, stations, ax))
    return figures


def plot_expanded_response(result: FrequencyResponse, ax: Axes, probe: str) -> Axes:
    """The expansion (thick, light) under the exact response (thin, dark): largest deflection against frequency."""
    main = [b for b in result.branches if b.period_multiple == 1]
    scale = scale_for("m", *(b.peak_displacement[probe] for b in main), *(c.first[probe] for c in result.expansion))
    seen: set[float] = set()
    for k, c in enumerate(result.expansion):
        colour = curve_style(k)["color"]
        y = c.first[probe] * scale.factor
        ax.plot(
            *stretches(c.frequency_hz, y, c.stable, True), color=colour, alpha=0.35, linewidth=4.0,
            solid_capstyle="butt", label=f"multiple scales, {level_text(c.level, result.level_unit)}",
        )  # fmt: skip
        dashes = (0, (1.2, 0.8))
        ax.plot(
            *stretches(c.frequency_hz, y, c.stable, False), color=colour, alpha=0.35, linewidth=4.0, linestyle=dashes
        )
        for b in (b for b in main if b.level == c.level):
            y = b.peak_displacement[probe] * scale.factor
            label = None if c.level in seen else f"exact, {level_text(c.level, result.level_unit)}"
            seen.add(c.level)
            ax.plot(*stretches(b.frequency_hz, y, b.stable, True), color=colour, linewidth=1.2, label=label)
            unstable = stretches(b.frequency_hz, y, b.stable, False)
            ax.plot(*unstable, color=colour, linewidth=1.0, linestyle=(0, (3, 1.5)))
    ax.set_ylim(bottom=0.0)
    finish(ax, "Excitation frequency (Hz)", f"Largest deflection of {probe} ({scale.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def plot_forced_orders(result: FrequencyResponse, ax: Axes) -> Axes:
    """Difference from the exact motion while springs, damping and force are made smaller together."""
    for k, c in enumerate(result.expansion):
        level = level_text(c.level, result.level_unit)
        for order, (name, dashes) in enumerate((("leading order", (0, (4, 2))), ("first order", "-"))):
            slopes = c.orders[np.isfinite(c.orders[:, order]), order]
            label = f"{level}, {name}" + (f": observed order {slopes[-1]:.2f}" if slopes.size else "")
            style = {"color": curve_style(k)["color"], "linestyle": dashes, "linewidth": 1.1}
            ax.plot(c.factor, c.difference[:, order], marker=".", label=label, **style)
    ax.set_xscale("log")
    ax.set_yscale("log")
    finish(ax, "Factor of springs, damping and force", "Difference over the motion's size")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def forced_expansion_figures(result: FrequencyResponse) -> dict[str, Figure]:
    """The response of every probe with its expansion, and the orders, by name."""
    figures = {
        f"multiple_scales_{name}".replace("/", "_").replace(" ", "_"): figure_of(
            result.title, partial(plot_expanded_response, result, probe=name)
        )
        for name in list(result.expansion[0].first)[:MOST_CURVES]
    }
    figures["multiple_scales_orders"] = figure_of(result.title, lambda ax: plot_forced_orders(result, ax))
    return figures
