"""Multiple scales against exact motions: nonlinear modes over the stiffness factor, response curves over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.labelled import Dataset
from beamsim.plots.branches import UNSTABLE, BranchLine, branch_curves
from beamsim.plots.drawing import HERTZ, MOST_CURVES, Chart, Curve, Picture, curve_style, legend
from beamsim.plots.stations import draw_along
from beamsim.plots.style import level_text
from beamsim.results.branch import rows_by_owner
from beamsim.structures.places import Stations

ROUND_OFF = 1e-14  # differences below it are not drawn
FACTOR = ("Stiffness factor ε", "")


NARROWEST = 1e-6  # of the linear frequency: the narrowest axis of frequencies


def expanded_frequency(expansion: Dataset) -> Chart:
    """Frequency over the factor, exact and to both orders."""
    factor, frequency, exact = (expansion[of].values for of in ("factor", "frequency_hz", "exact_frequency_hz"))
    order = np.argsort(factor)
    x = factor[order]
    curves = [Curve("exact", x, exact[order], {"color": "black"})]
    curves += [Curve(f"{name} order", x, frequency[order, k]) for k, name in ((1, "first"), (2, "second"))]
    chart = Chart(FACTOR, ("Frequency", HERTZ), curves, log="x")
    known = exact[np.isfinite(exact)]
    if not known.size:
        return chart
    room = 0.5 * max(float(np.ptp(known)), NARROWEST * expansion["linear_frequency_hz"].item())
    # far out the expansion leaves the picture
    return chart._replace(y_ends=(float(known.min()) - room, float(known.max()) + room))


def differences(expansion: Dataset, name: str, orders: Sequence[float], quantity: str) -> Chart:
    """Relative differences from exact motions over the factor, with the orders observed.

    Parameters
    ----------
    expansion : with nf factors.
    name : of the variable (nf, 3): differences of the linear mode and of both orders.
    orders : at which those of both orders fall, of the summary; nan where unknown.
    quantity : differs.

    Returns
    -------
    A curve for each order.
    """
    factor, values = expansion["factor"].values, expansion[name].values
    order, curves = np.argsort(factor), []
    for k in (1, 2):
        label = f"order {k}" + (f": observed {orders[k - 1]:.2f}" if np.isfinite(orders[k - 1]) else "")
        use = order[values[order, k] > ROUND_OFF]
        curves.append(Curve(label, factor[use], values[use, k], {"marker": "."}))
    return Chart(FACTOR, (f"Difference in {quantity}", ""), curves, log="xy")


def plot_initial_vectors(expansion: Dataset, ax: Axes, stations: Stations) -> None:
    """Deflection at rest, linear, to both orders and exact, at the largest factor with an exact motion.

    Parameters
    ----------
    expansion : with at least one exact motion.
    ax : to draw on.
    stations : where deflections are known.
    """
    factor = expansion["factor"].values
    known = np.flatnonzero(np.isfinite(expansion["exact_frequency_hz"].values))
    k = int(known[np.argmax(factor[known])])
    thick = {"color": "0.7", "linewidth": 4.0, "linestyle": "-", "marker": ""}
    names = ("linear mode", "first order", "second order")
    shapes = [("exact", expansion["exact_initial_displacement"].values[k], thick)]
    shapes += zip(names, expansion["initial_displacement"].values[k], ({}, {}, {}), strict=True)
    draw_along(ax, stations, "Deflection at rest", shapes)
    legend(ax, f"Mode {expansion['mode'].item()}, stiffness factor {factor[k]:.3g}")


def expansion_figures(result: NormalModeResult) -> dict[str, Picture]:
    """Both pictures of a mode by multiple scales, by name; the second needs an exact motion."""
    expansion, orders = result["multiple_scales"], result.summary["multiple_scales"]
    charts = [
        expanded_frequency(expansion),
        differences(expansion, "frequency_difference", orders["observed_order_frequency"], "frequency"),
        differences(expansion, "initial_difference", orders["observed_order_initial"], "initial vector"),
    ]
    title = f"Mode {expansion['mode'].item()} by multiple scales"
    figures = {"multiple_scales": Picture(title, charts, sharex=True)}
    if np.any(np.isfinite(expansion["exact_frequency_hz"].values)):
        vectors = partial(plot_initial_vectors, expansion, stations=Stations.of_modes(result["modes"]))
        figures["multiple_scales_initial"] = Picture("", [vectors])
    return figures


def expanded_response(result: ContinuationResult, probe: str) -> Chart:
    """The expansion (thick, light) under the exact response (thin, dark): largest deflection against frequency."""
    lines = []
    for k, c in enumerate(rows_by_owner(result["multiple_scales"], result["multiple_scales_points"], "comparison")):
        of_level = c["level"].item()
        colour, level = {"color": curve_style(k)["color"]}, level_text(of_level, result.level_unit)
        pale = {**colour, "linewidth": 4.0, "alpha": 0.35, "solid_capstyle": "butt"}
        first, stable = c["first"].sel(probe=probe).values, c["stable"].values
        lines.append(BranchLine(f"multiple scales, {level}", c["frequency_hz"].values, first, stable, pale))
        lines += [
            BranchLine(f"exact, {level}", b["frequency_hz"].values, b["peak_displacement"].sel(probe=probe).values,
                       b["stable"].values, {**colour, "linewidth": 1.2})
            for b in result.branches if b["period_multiple"].item() == 1 and b["level"].item() == of_level
        ]  # fmt: skip
    x_axis, y_axis = ("Excitation frequency", HERTZ), (f"Largest deflection of {probe}", "m")
    return Chart(x_axis, y_axis, branch_curves(lines), curve_noun="", y_ends=(0.0, None))


def forced_orders(result: ContinuationResult) -> Chart:
    """Difference from the exact motion while springs, damping and force are made smaller together."""
    curves = []
    levels = rows_by_owner(result["multiple_scales"], result["multiple_scales_factors"], "comparison")
    for k, (c, orders) in enumerate(zip(levels, result.summary["multiple_scales"], strict=True)):
        for order, (name, dashes) in enumerate((("leading order", UNSTABLE), ("first order", "-"))):
            observed = orders["observed_orders"][order]
            label = f"{level_text(c['level'].item(), result.level_unit)}, {name}"
            label += f": observed order {observed:.2f}" if np.isfinite(observed) else ""
            style = {"color": curve_style(k)["color"], "linestyle": dashes, "marker": "."}
            curves.append(Curve(label, c["factor"].values, c["difference"].values[:, order], style))
    x_axis, y_axis = ("Factor of springs, damping and force", ""), ("Difference over the motion's size", "")
    return Chart(x_axis, y_axis, curves, log="xy")


def forced_expansion(result: ContinuationResult) -> dict[str, Chart]:
    """The response of every probe with its expansion, and the orders, by name."""
    names = result["multiple_scales_points"].labels("probe")[:MOST_CURVES]
    return {
        **{f"multiple_scales_{name}": expanded_response(result, name) for name in names},
        "multiple_scales_orders": forced_orders(result),
    }
