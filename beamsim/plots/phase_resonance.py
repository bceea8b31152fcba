"""Pictures of a damped structure held on its nonlinear mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.plots.branches import explain_dashes, figure_of, plot_branch
from beamsim.plots.labels import put_names
from beamsim.plots.stations import finish_along, plot_along
from beamsim.plots.style import MOST_CURVES, Scale, curve_style, finish, scale_for, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.nnm.result import HeldMotion, PhaseResonanceResult
    from beamsim.structures.stations import Stations

_DEEPEST_DB = 120.0
_HIGHEST_ORDER = 20.5
_RIDGE: dict[str, Any] = {"color": "0.55", "linewidth": 2.6, "solid_capstyle": "round", "zorder": 1}


def _level_scale(result: PhaseResonanceResult) -> Scale:
    """Levels of acceleration in g, others with an SI prefix."""
    return scale_for(result.unit, [m.level for m in result.motions])


def plot_resonances(result: PhaseResonanceResult, ax: Axes) -> Axes:
    """Response curves over the backbone: frequency against amplitude, named by level, unstable stretches dashed."""
    name, level = result.probe, _level_scale(result)
    curves = [m.curve.peak_displacement[name] for m in result.motions if m.curve is not None]
    amplitudes = np.array([[m.predicted_amplitude[name], m.amplitude[name]] for m in result.motions])
    scale = scale_for("m", amplitudes, *curves)
    ridge = result.predicted
    ax.plot(ridge.frequency_hz, ridge.amplitude[name] * scale.factor, label="nonlinear mode", **_RIDGE)
    drawn = [(ridge.frequency_hz, ridge.amplitude[name] * scale.factor)]
    places = {}
    for k, m in enumerate(result.motions):
        colour = curve_style(k)["color"]
        if m.curve is not None:
            x, y = m.curve.frequency_hz, m.curve.peak_displacement[name] * scale.factor
            plot_branch(ax, x, y, m.curve.stable, color=colour, width=1.2)
            top = int(np.argmax(y))
            drawn.append((x, y))
            places[_level_text(m.level, level)] = (float(x[top]), float(y[top]))
    if any(m.curve is not None and not m.curve.stable.all() for m in result.motions):
        explain_dashes(ax)
    for which, marker, face, label in ((0, "o", "white", "predicted"), (1, "D", "0.15", "phase resonance")):
        at = [m.predicted_frequency_hz if which == 0 else m.frequency_hz for m in result.motions]
        ax.plot(
            at, amplitudes[:, which] * scale.factor, linestyle="none", marker=marker, markersize=7 - 3 * which,
            color="0.15", markerfacecolor=face, label=label, zorder=5 + which,
        )  # fmt: skip
    shown = np.concatenate([*(m.curve.frequency_hz for m in result.motions if m.curve is not None), np.zeros(0)])
    if shown.size:
        ax.set_xlim(float(shown.min()), float(shown.max()))
        ax.set_ylim(0.0, 1.12 * scale.factor * max(float(np.nanmax(amplitudes)), *(float(c.max()) for c in curves)))
    finish(ax, "Frequency (Hz)", f"Largest deflection of {name} ({scale.unit})")
    put_names(ax, places.items(), drawn)
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def _level_text(value: float, level: Scale) -> str:
    return f"{value * level.factor:.4g} {level.unit}"


def plot_levels(result: PhaseResonanceResult, ax: Axes) -> Axes:
    """The level predicted against the amplitude, and the exact motions."""
    name, level = result.probe, _level_scale(result)
    amplitude = np.array([m.amplitude[name] for m in result.motions])
    scale = scale_for("m", amplitude, np.array([m.predicted_amplitude[name] for m in result.motions]))
    ridge = result.predicted
    order = np.argsort(ridge.energy)
    ax.plot(
        ridge.amplitude[name][order] * scale.factor, ridge.level[order] * level.factor, label="energy balance",
        **curve_style(0),
    )  # fmt: skip
    stable = np.array([m.stable for m in result.motions])
    levels = np.array([m.level for m in result.motions]) * level.factor
    for is_stable, face, label in ((True, "#d1495b", "exact, stable"), (False, "white", "exact, unstable")):
        shown = (stable == is_stable) & np.isfinite(amplitude)
        if np.any(shown):
            ax.plot(
                amplitude[shown] * scale.factor, levels[shown], linestyle="none", marker="D", markersize=6,
                color="#d1495b", markerfacecolor=face, label=label,
            )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    finish(ax, f"Largest deflection of {name} ({scale.unit})", f"Level ({level.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def plot_held_shapes(held: HeldMotion, ax: Axes, stations: Stations) -> Axes:
    """Deflected shapes at two instants of the last period, over those of the mode (thesis, figures 4.14 and 4.17)."""
    scale = scale_for("m", held.shapes, held.mode_shapes)
    for k in (0, 1):
        style = curve_style(k) | {"linestyle": "-"}
        label = f"held, t = {held.instants[k]:.4g} s"
        plot_along(ax, stations, held.shapes[k] * scale.factor, label, **style)
        style = {"color": style["color"], "linestyle": (0, (2, 2)), "linewidth": 1.8, "alpha": 0.6, "marker": ""}
        plot_along(ax, stations, held.mode_shapes[k] * scale.factor, "nonlinear mode then", **style)
    finish_along(ax, stations, f"Deflection ({scale.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def plot_held_spectrum(held: HeldMotion, ax: Axes) -> Axes:
    """Lines over all periods, in dB of the strongest."""
    fundamental = held.frequency_hz[held.departure.size]
    reach = held.frequency_hz <= _HIGHEST_ORDER * fundamental
    top = max(float(a[1:].max()) for a in held.amplitude.values())
    for k, (name, a) in enumerate(list(held.amplitude.items())[:MOST_CURVES]):
        level = 20 * np.log10(np.maximum(a / top, 1e-300))
        ax.plot(*thinned(held.frequency_hz[reach], level[reach]), label=name, **curve_style(k))
    ax.set_ylim(-_DEEPEST_DB, 6.0)
    ax.set_xlim(0.0, _HIGHEST_ORDER * float(fundamental))
    finish(ax, "Frequency (Hz)", "Amplitude (dB re largest)")
    ax.legend(loc="upper right", frameon=False, fontsize="small")
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
    for k, (departure, texts) in enumerate(groups[:MOST_CURVES]):
        ax.plot(np.arange(1, departure.size + 1), departure, label=", ".join(texts), **curve_style(k))
    ax.set_ylim(bottom=0.0)
    finish(ax, "Period", "Distance from the mode\n(norm of energy)")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def phase_resonance_figures(result: PhaseResonanceResult, title: str, stations: Stations) -> dict[str, Figure]:
    """Every picture of a held mode, by name; shapes and spectrum are those of the last level."""
    figures = {
        "phase_resonance": figure_of(title, lambda ax: plot_resonances(result, ax)),
        "phase_resonance_level": figure_of(title, lambda ax: plot_levels(result, ax)),
        "held_departure": figure_of(title, lambda ax: plot_departure(result, ax)),
    }
    last, level = result.motions[-1], _level_scale(result)
    held = last.held
    if held is not None:
        under = f"{title}, {last.level * level.factor:.4g} {level.unit}, {held.departure.size} periods"
        figures["held_shapes"] = figure_of(under, lambda ax: plot_held_shapes(held, ax, stations))
        figures["held_spectrum"] = figure_of(under, lambda ax: plot_held_spectrum(held, ax))
    return figures
