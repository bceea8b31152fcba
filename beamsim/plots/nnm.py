"""Pictures of nonlinear normal modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.branch import ModeBranch
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.plots.drawing import MOST_CURVES, SMALL, Curve, curve_style, draw_curves, legend, panels
from beamsim.plots.mode_branches import BRANCH_NAMES, plot_backbone, plot_frequency_energy
from beamsim.plots.multiple_scales import comparison_figures
from beamsim.plots.phase_resonance import phase_resonance_figures
from beamsim.plots.relaxed import relaxed_figure
from beamsim.plots.stations import draw_along
from beamsim.plots.style import Scale
from beamsim.typing import Floats

FLOOR = -120.0  # dB, of a spectrum
DRIFTED = 1e-6  # over the periods of the spectrum, from which the drift is shown
MANY = 4 * 20  # lines: a motion that drifts spreads them, and they are drawn as a curve


def plot_mode_shapes(result: NormalModeResult, ax: Axes) -> Axes:
    """The motion at its extremes, over the linear mode."""
    branch, (first, second) = _shown_branch(result), result.motion.at_rest
    word = "at rest" if branch.least_kinetic[result.motion_point] == 0.0 or branch.kind == "backbone" else "slowest"
    linear: tuple[str, Floats, dict[str, Any]] = (f"linear mode {result.mode}", result.linear_shape, {})
    ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    draw_along(ax, result.stations, "Deflection", [(f"{word}, t = 0", first, {}), ("t = T/2", second, {}), linear])
    return ax


def plot_deflected_shapes(result: NormalModeResult, ax: Axes) -> Axes:
    """The deflected shape at two instants underway."""
    first, second = result.motion.underway
    ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    draw_along(ax, result.stations, "Deflection", [("t = T/8", first, {}), ("t = 3T/8", second, {})])
    return ax


def _shown_branch(result: NormalModeResult) -> ModeBranch:
    return result.branches[result.motion_branch]


def _nodes(result: NormalModeResult) -> list[tuple[int, str]]:
    """Stations to draw, evenly spread up to the last one that moves, with their names."""
    moving = np.flatnonzero(np.abs(result.motion.stations).max(axis=0) > 0)
    count = min(MOST_CURVES, moving.size)
    chosen = moving[(moving.size * np.arange(1, count + 1) / max(count, 1)).round().astype(int) - 1]
    return [(int(k), result.stations.name(int(k))) for k in chosen]


def plot_node_motion(result: NormalModeResult, ax: Axes) -> Axes:
    """Displacement of the structure's nodes over one period."""
    motion = result.motion
    curves = [Curve(name, motion.time, motion.stations[:, at]) for at, name in _nodes(result)]
    draw_curves(ax, ("Time", "s"), ("Displacement", "m"), curves)
    return ax


def plot_contact_forces(result: NormalModeResult, ax: Axes) -> Axes:
    """Contact forces over the same period."""
    curves = [Curve(name, result.motion.time, force) for name, force in result.motion.force.items()]
    draw_curves(ax, ("Time", "s"), ("Contact force", "N"), curves, of="snubbers")
    return ax


def plot_phase_portrait(result: NormalModeResult, ax: Axes) -> Axes:
    """Velocity over displacement."""
    motion = result.motion
    curves = [Curve(name, x, motion.velocity[name]) for name, x in motion.displacement.items()]
    of = f" of {curves[0].label}" if len(curves) == 1 else ""
    draw_curves(ax, (f"Displacement{of}", "m"), (f"Velocity{of}", "m/s"), curves, of="probes")
    return ax


def plot_configuration(result: NormalModeResult, ax: Axes) -> Axes:
    """Displacements over one another: a line for a linear mode, a curve for a nonlinear one, a loop for a non-brake
    orbit. The probes over the first of them; with a single probe the nodes over the one that moves most."""
    motion = result.motion
    if len(motion.displacement) > 1:
        named = dict(motion.displacement)
        across = next(iter(named))
    else:
        named = {name: motion.stations[:, at] for at, name in _nodes(result)}
        across = max(named, key=lambda name: float(np.abs(named[name]).max()))
    others = [name for name in named if name != across] or [across]
    # a brake orbit retraces its path: drawn twice, its dashes would merge into one line
    part = slice((motion.time.size + 1) // 2 if _shown_branch(result).kind != "non_brake" else None)
    curves = [Curve(name, named[across][part], named[name][part]) for name in others]
    up = f"Displacement of {others[0]}" if len(others) == 1 else "Displacement"
    draw_curves(ax, (f"Displacement of {across}", "m"), (up, "m"), curves)
    return ax


def plot_orbit_spectrum(result: NormalModeResult, ax: Axes) -> Axes:
    """Spectrum over the motion's many periods, in dB of each probe's strongest line."""
    motion, f = result.motion, result.motion.spectrum_frequency_hz
    # as far as the harmonics that are stored: beyond them every line is small
    last = int(np.searchsorted(f, 20.5 / float(motion.time[-1])))
    curves = []
    for k, (name, amplitude) in enumerate(list(motion.spectrum.items())[:MOST_CURVES]):
        level = 20 * np.log10(np.maximum(amplitude[:last], 1e-300) / amplitude[:last].max())
        visible = level > FLOOR
        if np.count_nonzero(visible) > MANY:
            curves.append(Curve(name, f[:last], np.maximum(level, FLOOR)))
            continue
        ax.vlines(f[:last][visible], FLOOR, level[visible], color=curve_style(k)["color"], linewidth=0.9, alpha=0.35)
        marks = {"linestyle": "none", "marker": "os^Dvx"[k], "markersize": 6.0 - 0.7 * k, "markerfacecolor": "none"}
        curves.append(Curve(name, f[:last][visible], level[visible], marks))
    across = (f"Frequency in steps of {f[1]:.3g} Hz", Scale(1.0, "Hz"))
    draw_curves(ax, across, ("Amplitude (dB re largest)", ""), curves, known=len(motion.spectrum), of="probes")
    ax.set_ylim(FLOOR, 5.0)
    drift = f"; unstable: {100 * motion.drift:.3g} % away at their end" if motion.drift > DRIFTED else ""
    legend(ax, f"{motion.periods} periods{drift}")
    return ax


def nnm_figures(result: NormalModeResult) -> dict[str, Figure]:
    """Every picture of a nonlinear mode, by name."""
    motion = f"{result.title}\n{_motion_name(result)}"
    figures: dict[str, Figure] = {}

    def draw(name: str, title: str, plot: Callable[[NormalModeResult, Axes], Axes]) -> None:
        figures[name], (ax,) = panels(title, size=SMALL)
        plot(result, ax)

    draw("backbone", result.title, plot_backbone)
    draw("mode_shapes", motion, plot_mode_shapes)
    draw("deflected_shapes", motion, plot_deflected_shapes)
    if result.motion.force:
        figures["motion"], (above, below) = panels(motion, 2, size=(7.2, 5.6), sharex=True, height_ratios=(2, 1))
        plot_node_motion(result, above)
        plot_contact_forces(result, below)
        above.set_xlabel("")
    else:
        draw("motion", motion, plot_node_motion)
    draw("phase_portrait", motion, plot_phase_portrait)
    draw("configuration", motion, plot_configuration)
    draw("spectrum", motion, plot_orbit_spectrum)
    if result.parameter != "stiffness_factor":
        draw("frequency_energy", result.title, plot_frequency_energy)
    if result.expansion is not None:
        figures |= comparison_figures(result.expansion, result.stations)
    if result.relaxed is not None:
        figures["relaxed_minimisation"] = relaxed_figure(result)
    if result.phase_resonance is not None:
        figures |= phase_resonance_figures(result.phase_resonance, result.title, result.stations)
    return figures


def _motion_name(result: NormalModeResult) -> str:
    """Which motion is drawn."""
    branch, k = _shown_branch(result), result.motion_point
    names = {"stiffness_factor": "ε = {:.4g}", "energy": "{:.4g} J", "frequency": "{:.6g} Hz"}
    at = names[result.parameter].format(branch.parameter[k])
    also = "" if result.parameter == "frequency" else f", {branch.frequency_hz[k]:.6g} Hz"
    return f"{BRANCH_NAMES[branch.kind]}, {at}{also}"
