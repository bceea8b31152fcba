"""Multiple scales against exact motions: nonlinear modes over the stiffness factor, response curves over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import ExpansionComparison, NormalModeResult
from beamsim.plots.branches import UNSTABLE, BranchLine, branch_curves
from beamsim.plots.drawing import HERTZ, MOST_CURVES, Curve, curve_style, draw_curves, legend, picture
from beamsim.plots.stations import draw_along
from beamsim.plots.style import level_text
from beamsim.structures.stations import Stations
from beamsim.typing import Floats

ROUND_OFF = 1e-14  # differences below it are not drawn
_FACTOR = ("Stiffness factor ε", "")


def plot_expanded_frequency(comparison: ExpansionComparison, ax: Axes) -> Axes:
    """Frequency over the factor, exact and to both orders."""
    path, exact = comparison.path, comparison.exact
    order = np.argsort(path.factor)
    x = path.factor[order]
    curves = [Curve("exact", x, exact.frequency_hz[order], {"color": "black"})]
    curves += [Curve(f"{name} order", x, path.frequency_hz[order, k]) for k, name in ((1, "first"), (2, "second"))]
    draw_curves(ax, _FACTOR, ("Frequency", HERTZ), curves, log="x")
    known = exact.frequency_hz[np.isfinite(exact.frequency_hz)]
    if known.size:  # far out the expansion leaves the picture
        room = 0.5 * max(float(np.ptp(known)), 1e-6 * path.linear_frequency_hz)
        ax.set_ylim(float(known.min()) - room, float(known.max()) + room)
    return ax


def plot_differences(
    comparison: ExpansionComparison, ax: Axes, values: Floats, orders: Sequence[float], what: str
) -> Axes:
    """Relative differences from exact motions over the factor, with the orders observed.

    Parameters
    ----------
    comparison : with nf factors.
    ax : to draw on.
    values : (nf, 3) differences of the linear mode and of both orders.
    orders : at which those of both orders fall, of the summary; nan where unknown.
    what : differs.

    Returns
    -------
    The axes.
    """
    order, curves = np.argsort(comparison.path.factor), []
    for k in (1, 2):
        label = f"order {k}" + (f": observed {orders[k - 1]:.2f}" if np.isfinite(orders[k - 1]) else "")
        use = order[values[order, k] > ROUND_OFF]
        curves.append(Curve(label, comparison.path.factor[use], values[use, k], {"marker": "."}))
    draw_curves(ax, _FACTOR, (f"Difference in {what}", ""), curves, log="xy")
    return ax


def plot_initial_vectors(comparison: ExpansionComparison, ax: Axes, stations: Stations) -> Axes:
    """Deflection at rest, linear, to both orders and exact, at the largest factor with an exact motion.

    Parameters
    ----------
    comparison : with at least one exact motion.
    ax : to draw on.
    stations : where deflections are known.

    Returns
    -------
    The axes.
    """
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


def expansion_figures(result: NormalModeResult) -> dict[str, Figure]:
    """Both pictures of a mode by multiple scales, by name; the second needs an exact motion."""
    c, said = result.expansion, result.summary["multiple_scales"]
    assert c is not None
    frequency, initial = said["observed_order_frequency"], said["observed_order_initial"]
    figures = {
        "multiple_scales": picture(
            f"Mode {c.path.mode} by multiple scales",
            partial(plot_expanded_frequency, c),
            partial(plot_differences, c, values=c.frequency_difference, orders=frequency, what="frequency"),
            partial(plot_differences, c, values=c.initial_difference, orders=initial, what="initial vector"),
            sharex=True,
        )
    }
    if np.any(np.isfinite(c.exact.frequency_hz)):
        figures["multiple_scales_initial"] = picture("", partial(plot_initial_vectors, c, stations=result.stations))
    return figures


def plot_expanded_response(result: ContinuationResult, ax: Axes, probe: str) -> Axes:
    """The expansion (thick, light) under the exact response (thin, dark): largest deflection against frequency.

    Parameters
    ----------
    result : with expansions.
    ax : to draw on.
    probe : name.

    Returns
    -------
    The axes.
    """
    lines = []
    for k, c in enumerate(result.expansion):
        colour, level = {"color": curve_style(k)["color"]}, level_text(c.level, result.level_unit)
        pale = {**colour, "linewidth": 4.0, "alpha": 0.35, "solid_capstyle": "butt"}
        lines.append(BranchLine(f"multiple scales, {level}", c.frequency_hz, c.first[probe], c.stable, pale))
        lines += [
            BranchLine(f"exact, {level}", b.frequency_hz, b.displacement[probe].peak, b.stable,
                       {**colour, "linewidth": 1.2})
            for b in result.branches if b.period_multiple == 1 and b.level == c.level
        ]  # fmt: skip
    up = (f"Largest deflection of {probe}", "m")
    draw_curves(ax, ("Excitation frequency", HERTZ), up, branch_curves(lines), of="")
    ax.set_ylim(bottom=0.0)
    return ax


def plot_forced_orders(result: ContinuationResult, ax: Axes) -> Axes:
    """Difference from the exact motion while springs, damping and force are made smaller together."""
    curves = []
    for k, (c, said) in enumerate(zip(result.expansion, result.summary["multiple_scales"], strict=True)):
        for order, (name, dashes) in enumerate((("leading order", UNSTABLE), ("first order", "-"))):
            observed = said["observed_orders"][order]
            label = f"{level_text(c.level, result.level_unit)}, {name}"
            label += f": observed order {observed:.2f}" if np.isfinite(observed) else ""
            style = {"color": curve_style(k)["color"], "linestyle": dashes, "marker": "."}
            curves.append(Curve(label, c.factor, c.difference[:, order], style))
    across, up = ("Factor of springs, damping and force", ""), ("Difference over the motion's size", "")
    draw_curves(ax, across, up, curves, log="xy")
    return ax


def forced_expansion_figures(result: ContinuationResult) -> dict[str, Figure]:
    """The response of every probe with its expansion, and the orders, by name."""
    figures = {
        f"multiple_scales_{name}": picture(result.title, partial(plot_expanded_response, result, probe=name))
        for name in list(result.expansion[0].first)[:MOST_CURVES]
    }
    return {**figures, "multiple_scales_orders": picture(result.title, partial(plot_forced_orders, result))}
