"""Multiple scales against exact motions: nonlinear modes over the stiffness factor, response curves over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.continuation.result import ContinuationResult
from beamsim.analyses.nnm.result import ExpansionComparison, NormalModeResult
from beamsim.plots.branches import UNSTABLE, BranchLine, branch_curves
from beamsim.plots.drawing import HERTZ, MOST_CURVES, Chart, Curve, Picture, curve_style, legend
from beamsim.plots.stations import draw_along
from beamsim.plots.style import level_text
from beamsim.structures.places import Stations
from beamsim.typing import Floats

ROUND_OFF = 1e-14  # differences below it are not drawn
FACTOR = ("Stiffness factor ε", "")


def expanded_frequency(comparison: ExpansionComparison) -> Chart:
    """Frequency over the factor, exact and to both orders."""
    path, exact = comparison.path, comparison.exact
    order = np.argsort(path.factor)
    x = path.factor[order]
    curves = [Curve("exact", x, exact.frequency_hz[order], {"color": "black"})]
    curves += [Curve(f"{name} order", x, path.frequency_hz[order, k]) for k, name in ((1, "first"), (2, "second"))]
    chart = Chart(FACTOR, ("Frequency", HERTZ), curves, log="x")
    known = exact.frequency_hz[np.isfinite(exact.frequency_hz)]
    if not known.size:
        return chart
    room = 0.5 * max(float(np.ptp(known)), 1e-6 * path.linear_frequency_hz)
    # far out the expansion leaves the picture
    return chart._replace(y_ends=(float(known.min()) - room, float(known.max()) + room))


def differences(comparison: ExpansionComparison, values: Floats, orders: Sequence[float], what: str) -> Chart:
    """Relative differences from exact motions over the factor, with the orders observed.

    Parameters
    ----------
    comparison : with nf factors.
    values : (nf, 3) differences of the linear mode and of both orders.
    orders : at which those of both orders fall, of the summary; nan where unknown.
    what : differs.

    Returns
    -------
    A curve for each order.
    """
    order, curves = np.argsort(comparison.path.factor), []
    for k in (1, 2):
        label = f"order {k}" + (f": observed {orders[k - 1]:.2f}" if np.isfinite(orders[k - 1]) else "")
        use = order[values[order, k] > ROUND_OFF]
        curves.append(Curve(label, comparison.path.factor[use], values[use, k], {"marker": "."}))
    return Chart(FACTOR, (f"Difference in {what}", ""), curves, log="xy")


def plot_initial_vectors(comparison: ExpansionComparison, ax: Axes, stations: Stations) -> None:
    """Deflection at rest, linear, to both orders and exact, at the largest factor with an exact motion.

    Parameters
    ----------
    comparison : with at least one exact motion.
    ax : to draw on.
    stations : where deflections are known.
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


def expansion_figures(result: NormalModeResult) -> dict[str, Picture]:
    """Both pictures of a mode by multiple scales, by name; the second needs an exact motion."""
    c, said = result.expansion, result.summary["multiple_scales"]
    assert c is not None
    charts = [
        expanded_frequency(c),
        differences(c, c.frequency_difference, said["observed_order_frequency"], "frequency"),
        differences(c, c.initial_difference, said["observed_order_initial"], "initial vector"),
    ]
    figures = {"multiple_scales": Picture(f"Mode {c.path.mode} by multiple scales", charts, sharex=True)}
    if np.any(np.isfinite(c.exact.frequency_hz)):
        vectors = partial(plot_initial_vectors, c, stations=Stations.of_modes(result["modes"]))
        figures["multiple_scales_initial"] = Picture("", [vectors])
    return figures


def expanded_response(result: ContinuationResult, probe: str) -> Chart:
    """The expansion (thick, light) under the exact response (thin, dark): largest deflection against frequency."""
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
    across, up = ("Excitation frequency", HERTZ), (f"Largest deflection of {probe}", "m")
    return Chart(across, up, branch_curves(lines), of="", y_ends=(0.0, None))


def forced_orders(result: ContinuationResult) -> Chart:
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
    return Chart(across, up, curves, log="xy")


def forced_expansion(result: ContinuationResult) -> dict[str, Chart]:
    """The response of every probe with its expansion, and the orders, by name."""
    names = list(result.expansion[0].first)[:MOST_CURVES]
    return {
        **{f"multiple_scales_{name}": expanded_response(result, name) for name in names},
        "multiple_scales_orders": forced_orders(result),
    }
