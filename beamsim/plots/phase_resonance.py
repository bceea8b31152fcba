"""Pictures of a damped structure held on its nonlinear mode."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.nnm.result import HeldMotion, PhaseResonanceResult
from beamsim.plots.branches import explain_dashes, plot_branch
from beamsim.plots.drawing import (
    MOST_CURVES,
    RED,
    SMALL,
    Curve,
    curve_style,
    draw_curves,
    finish,
    legend,
    name_beside,
    panels,
    thinned,
    with_unit,
)
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale, scale_for
from beamsim.structures.stations import Stations

_HIGHEST_ORDER = 20.5


def _level_scale(result: PhaseResonanceResult) -> Scale:
    """Levels of acceleration in g, others with an SI prefix."""
    return scale_for(result.unit, [m.level for m in result.motions])


def _level_text(value: float, level: Scale) -> str:
    return f"{value * level.factor:.4g} {level.unit}"


def plot_resonances(result: PhaseResonanceResult, ax: Axes) -> Axes:
    """Response curves over the backbone: frequency against amplitude, named by level, unstable stretches dashed."""
    name, level, ridge = result.probe, _level_scale(result), result.predicted
    curves = [(k, m, m.curve) for k, m in enumerate(result.motions) if m.curve is not None]
    amplitudes = np.array([[m.predicted_amplitude[name], m.amplitude[name]] for m in result.motions])
    scale = scale_for("m", amplitudes, *(curve.peak_displacement[name] for _, _, curve in curves))
    ax.plot(ridge.frequency_hz, ridge.amplitude[name] * scale.factor, label="nonlinear mode", color="0.55",
            linewidth=2.6, solid_capstyle="round", zorder=1)  # fmt: skip
    places = {}
    for k, m, curve in curves:
        x, y = curve.frequency_hz, curve.peak_displacement[name] * scale.factor
        plot_branch(ax, x, y, curve.stable, color=curve_style(k)["color"], width=1.2)
        places[_level_text(m.level, level)] = (float(x[np.argmax(y)]), float(y.max()))
    if not all(curve.stable.all() for _, _, curve in curves):
        explain_dashes(ax)
    marks: dict[str, Any] = {"linestyle": "none", "color": "0.15"}
    at = [m.predicted_frequency_hz for m in result.motions]
    ax.plot(at, amplitudes[:, 0] * scale.factor, marker="o", markersize=7, markerfacecolor="white", label="predicted",
            zorder=5, **marks)  # fmt: skip
    at = [m.frequency_hz for m in result.motions]
    ax.plot(at, amplitudes[:, 1] * scale.factor, marker="D", markersize=4, label="phase resonance", zorder=6, **marks)
    if curves:
        shown = np.concatenate([curve.frequency_hz for _, _, curve in curves])
        ax.set_xlim(float(shown.min()), float(shown.max()))
        ax.set_ylim(0.0, 1.12 * max(scale.factor * float(np.nanmax(amplitudes)), *(y for _, y in places.values())))
    finish(ax, "Frequency (Hz)", with_unit(f"Largest deflection of {name}", scale))
    name_beside(ax, places)
    legend(ax)
    return ax


def plot_levels(result: PhaseResonanceResult, ax: Axes) -> Axes:
    """The level predicted against the amplitude, and the exact motions."""
    name, ridge = result.probe, result.predicted
    order = np.argsort(ridge.energy)
    curves = [Curve("energy balance", ridge.amplitude[name][order], ridge.level[order])]
    for stable, face in ((True, RED), (False, "white")):
        shown = np.array([(m.amplitude[name], m.level) for m in result.motions if m.stable == stable]).reshape(-1, 2)
        shown = shown[np.isfinite(shown[:, 0])]
        if shown.size:
            label = f"exact, {'stable' if stable else 'unstable'}"
            marks = {"linestyle": "none", "marker": "D", "markersize": 6, "color": RED, "markerfacecolor": face}
            curves.append(Curve(label, shown[:, 0], shown[:, 1], marks))
    draw_curves(ax, (f"Largest deflection of {name}", "m"), ("Level", _level_scale(result)), curves)
    ax.set(xscale="log", yscale="log")
    return ax


def plot_held_shapes(held: HeldMotion, ax: Axes, stations: Stations) -> Axes:
    """Deflected shapes at two instants of the last period, over those of the mode (thesis, figures 4.14 and 4.17)."""
    shapes: list[tuple[str, Any, dict[str, Any]]] = []
    for k in (0, 1):
        colour = {"color": curve_style(k)["color"]}
        shapes.append((f"held, t = {held.instants[k]:.4g} s", held.shapes[k], {**colour, "linestyle": "-"}))
        dotted = {**colour, "linestyle": (0, (2, 2)), "linewidth": 1.8, "alpha": 0.6, "marker": ""}
        shapes.append(("nonlinear mode then", held.mode_shapes[k], dotted))
    draw_along(ax, stations, "Deflection", shapes)
    return ax


def plot_held_spectrum(held: HeldMotion, ax: Axes) -> Axes:
    """Lines over all periods, in dB of the strongest."""
    highest = _HIGHEST_ORDER * float(held.frequency_hz[held.departure.size])
    reach = held.frequency_hz <= highest
    top = max(float(a[1:].max()) for a in held.amplitude.values())
    curves = [
        Curve(name, *thinned(held.frequency_hz[reach], 20 * np.log10(np.maximum(a[reach] / top, 1e-300))))
        for name, a in held.amplitude.items()
    ]
    draw_curves(ax, ("Frequency", "Hz"), ("Amplitude (dB re largest)", ""), curves, of="probes")
    ax.set(xlim=(0.0, highest), ylim=(-120.0, 6.0))
    return ax


def plot_departure(result: PhaseResonanceResult, ax: Axes) -> Axes:
    """Distance from the mode in every period, for all levels; those that make no difference (z = 0) as one curve."""
    level = _level_scale(result)
    groups: list[tuple[np.ndarray, list[str]]] = []
    for m in result.motions:
        if m.held is not None:
            known = next((texts for d, texts in groups if np.allclose(d, m.held.departure, rtol=1e-3)), None)
            if known is None:
                groups.append((m.held.departure, [_level_text(m.level, level)]))
            else:
                known.append(_level_text(m.level, level))
    curves = [Curve(", ".join(texts), np.arange(1.0, d.size + 1), d) for d, texts in groups]
    draw_curves(ax, ("Period", ""), ("Distance from the mode\n(norm of energy)", ""), curves[:MOST_CURVES], of="levels")
    ax.set_ylim(bottom=0.0)
    return ax


def phase_resonance_figures(result: PhaseResonanceResult, title: str, stations: Stations) -> dict[str, Figure]:
    """Every picture of a held mode, by name; shapes and spectrum are those of the last level."""
    figures: dict[str, Figure] = {}
    for name, plot in (
        ("phase_resonance", plot_resonances),
        ("phase_resonance_level", plot_levels),
        ("held_departure", plot_departure),
    ):
        figures[name], (ax,) = panels(title, size=SMALL)
        plot(result, ax)
    last = result.motions[-1]
    if last.held is not None:
        under = f"{title}, {_level_text(last.level, _level_scale(result))}, {last.held.departure.size} periods"
        figures["held_shapes"], (ax,) = panels(under, size=SMALL)
        plot_held_shapes(last.held, ax, stations)
        figures["held_spectrum"], (ax,) = panels(under, size=SMALL)
        plot_held_spectrum(last.held, ax)
    return figures
