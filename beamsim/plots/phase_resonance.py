"""Pictures of a damped structure held on its nonlinear mode."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.nnm.result import HeldMotion, PhaseResonanceResult
from beamsim.plots.branches import BranchLine, branch_curves
from beamsim.plots.drawing import HERTZ, RED, Chart, Curve, Picture, curve_style, marked
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale, scale_for
from beamsim.structures.places import Stations


def _level_scale(result: PhaseResonanceResult) -> Scale:
    """Levels of acceleration in g, others with an SI prefix."""
    return scale_for(result.unit, [m.level for m in result.motions])


def _level_text(value: float, level: Scale) -> str:
    return f"{value * level.factor:.4g} {level.unit}"


def resonances(result: PhaseResonanceResult) -> Chart:
    """Response curves over the backbone: frequency against amplitude, named by level, unstable stretches dashed."""
    name, level, ridge = result.probe, _level_scale(result), result.predicted
    lines = [
        BranchLine("", m.curve.frequency_hz, m.curve.peak_displacement[name], m.curve.stable,
                   {"color": curve_style(k)["color"], "linewidth": 1.2})
        for k, m in enumerate(result.motions) if m.curve is not None
    ]  # fmt: skip
    thick = {"color": "0.55", "linestyle": "-", "linewidth": 2.6, "zorder": 1}
    predicted = np.array([(m.predicted_frequency_hz, m.predicted_amplitude[name]) for m in result.motions])
    held = np.array([(m.frequency_hz, m.amplitude[name]) for m in result.motions])
    curves = [
        Curve("nonlinear mode", ridge.frequency_hz, ridge.amplitude[name], thick),
        *branch_curves(lines),
        marked("predicted", predicted, color="0.15", marker="o", markersize=7, markerfacecolor="white"),
        marked("phase resonance", held, color="0.15", marker="D", markersize=4, zorder=6),
    ]
    shown = [predicted[:, 1], held[:, 1], *(line.y for line in lines)]
    up = (f"Largest deflection of {name}", scale_for("m", *shown))
    chart = Chart(("Frequency", HERTZ), up, curves, of="")
    if not lines:
        return chart
    at = np.concatenate([line.x for line in lines])
    levels = [_level_text(m.level, level) for m in result.motions if m.curve is not None]
    tops = [(float(line.x[np.argmax(line.y)]), float(line.y.max())) for line in lines]
    top = 1.12 * max(float(np.nanmax(y)) for y in shown)
    ends = float(at.min()), float(at.max())
    return chart._replace(x_ends=ends, y_ends=(0.0, top), names=dict(zip(levels, tops, strict=True)))


def levels(result: PhaseResonanceResult) -> Chart:
    """The level predicted against the amplitude, and the exact motions."""
    name, ridge = result.probe, result.predicted
    order = np.argsort(ridge.energy)
    curves = [Curve("energy balance", ridge.amplitude[name][order], ridge.level[order])]
    for stable, face in ((True, RED), (False, "white")):
        shown = [(m.amplitude[name], m.level) for m in result.motions if m.stable == stable]
        if shown:
            label, size = f"exact, {'stable' if stable else 'unstable'}", {"marker": "D", "markersize": 6}
            curves.append(marked(label, shown, color=RED, markerfacecolor=face, **size))
    return Chart((f"Largest deflection of {name}", "m"), ("Level", _level_scale(result)), curves, log="xy")


def plot_held_shapes(held: HeldMotion, ax: Axes, stations: Stations) -> None:
    """Deflected shapes at two instants of the last period, over those of the mode (thesis, figures 4.14 and 4.17).

    Parameters
    ----------
    held : motion, with its shapes (2, nx) and those of the mode.
    ax : to draw on.
    stations : nx, where shapes are known.
    """
    shapes: list[tuple[str, Any, dict[str, Any]]] = []
    for k in (0, 1):
        colour = {"color": curve_style(k)["color"]}
        shapes.append((f"held, t = {held.instants[k]:.4g} s", held.shapes[k], {**colour, "linestyle": "-"}))
        dotted = {**colour, "linestyle": (0, (2, 2)), "linewidth": 1.8, "alpha": 0.6, "marker": ""}
        shapes.append(("nonlinear mode then", held.mode_shapes[k], dotted))
    draw_along(ax, stations, "Deflection", shapes)


def held_spectrum(held: HeldMotion) -> Chart:
    """Lines over all periods, in dB of the strongest."""
    highest = 20.5 * float(held.frequency_hz[held.departure.size])
    reach = held.frequency_hz <= highest
    top = max(float(a[1:].max()) for a in held.amplitude.values())
    curves = [
        Curve(name, held.frequency_hz[reach], 20 * np.log10(np.maximum(a[reach] / top, 1e-300)))
        for name, a in held.amplitude.items()
    ]
    across, up = ("Frequency", HERTZ), ("Amplitude (dB re largest)", "")
    return Chart(across, up, curves, of="probes", x_ends=(0.0, highest), y_ends=(-120.0, 6.0))


def departure(result: PhaseResonanceResult) -> Chart:
    """Distance from the mode in every period, for all levels."""
    level = _level_scale(result)
    curves = [
        Curve(_level_text(m.level, level), np.arange(1.0, m.held.departure.size + 1), m.held.departure)
        for m in result.motions
        if m.held is not None
    ]
    up = ("Distance from the mode\n(norm of energy)", "")
    return Chart(("Period", ""), up, curves, of="levels", y_ends=(0.0, None))


def phase_resonance_figures(result: PhaseResonanceResult, title: str, stations: Stations) -> dict[str, Picture]:
    """Every picture of a held mode, by name; shapes and spectrum are those of the last level.

    Parameters
    ----------
    result : with at least one motion.
    title : above every picture.
    stations : where shapes are known.

    Returns
    -------
    By the last part of the file name.
    """
    figures = {
        "phase_resonance": Picture(title, [resonances(result)]),
        "phase_resonance_level": Picture(title, [levels(result)]),
        "held_departure": Picture(title, [departure(result)]),
    }
    last = result.motions[-1]
    if last.held is not None:
        under = f"{title}, {_level_text(last.level, _level_scale(result))}, {last.held.departure.size} periods"
        figures["held_shapes"] = Picture(under, [partial(plot_held_shapes, last.held, stations=stations)])
        figures["held_spectrum"] = Picture(under, [held_spectrum(last.held)])
    return figures
