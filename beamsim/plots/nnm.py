"""Pictures of nonlinear normal modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beamsim.analyses.nnm_results import ModeBranch, NormalModeResult
from beamsim.analyses.orbit_events import OrbitEvent
from beamsim.plots.branches import MARKS, figure_of, stretches
from beamsim.plots.style import MOST_CURVES, curve_style, finish, legend, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "nnm_figures",
    "plot_backbone",
    "plot_configuration",
    "plot_frequency_energy",
    "plot_mode_shapes",
    "plot_node_motion",
    "plot_orbit_spectrum",
    "plot_phase_portrait",
]

Floats = NDArray[np.float64]

_AXES = {
    "stiffness_factor": "Stiffness factor ε",
    "energy": "Energy (J)",
    "frequency": "Frequency (Hz)",
}


def plot_backbone(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency against the parameter; unstable stretches dashed, tongues thin, jumps marked."""
    for k, branch in enumerate(result.branches):
        _curve(ax, branch, branch.parameter, branch.frequency_hz, k)
    backbone = result.branches[0]
    for jump in result.jumps:
        f = np.interp([jump.start, jump.end], *_sorted(backbone.parameter, backbone.frequency_hz))
        ax.plot([jump.start, jump.end], f, color="0.6", linewidth=0.8, linestyle=":", zorder=0)
        if jump.ratio:
            ax.annotate(
                f"{jump.ratio}:1", (jump.start, f[0]), fontsize="x-small", xytext=(2, -8), textcoords="offset points"
            )
    _marks(ax, backbone.special, backbone.parameter, backbone.frequency_hz)
    if result.parameter == "energy":
        ax.set_xscale("log")
    finish(ax, _AXES[result.parameter], "Frequency (Hz)")
    return ax


def plot_frequency_energy(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency–energy plot."""
    for k, branch in enumerate(result.branches):
        _curve(ax, branch, branch.energy, branch.frequency_hz, k)
    ax.set_xscale("log")
    finish(ax, "Energy (J)", "Frequency (Hz)")
    return ax


def _curve(ax: Axes, branch: ModeBranch, x: Floats, y: Floats, index: int) -> None:
    colour = curve_style(min(index, 1))["color"]
    width = 1.3 if branch.kind == "backbone" else 0.8
    ax.plot(*stretches(x, y, branch.stable, True), color=colour, linewidth=width)
    ax.plot(*stretches(x, y, branch.stable, False), color=colour, linewidth=width, linestyle=(0, (3, 1.5)))


def _sorted(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    order = np.argsort(x)
    return x[order], y[order]


def _marks(ax: Axes, special: tuple[OrbitEvent, ...], x: Floats, y: Floats) -> None:
    for kind in dict.fromkeys(e.kind for e in special):
        own = [e for e in special if e.kind == kind]
        at = [e.parameter for e in own]
        height = [y[int(np.argmin(np.abs(x - p)))] for p in at]
        ax.plot(
            at, height, linestyle="none", marker=MARKS[kind], markersize=5, color="0.2", markerfacecolor="white",
            label=kind.replace("_", " "),
        )  # fmt: skip
    if special:
        ax.legend(loc="best", frameon=False, fontsize="small")


def plot_mode_shapes(result: NormalModeResult, ax: Axes) -> Axes:
    """The motion at both instants of rest, over the linear mode."""
    scale = scale_for("m", result.extreme_shapes, result.linear_shape)
    curves = (
        (result.extreme_shapes[0], "at rest, t = 0"),
        (result.extreme_shapes[1], "at rest, t = T/2"),
        (result.linear_shape, "linear mode"),
    )
    marker = "" if result.scenario.beam is not None else "o"
    for k, (shape, name) in enumerate(curves):
        ax.plot(result.position, shape * scale.factor, label=name, marker=marker, markersize=4, **curve_style(k))
    finish(ax, "Position (m)" if result.scenario.beam is not None else "Mass", f"Deflection ({scale.unit})")
    ax.legend(loc="best", frameon=False, fontsize="small")
    return ax


def plot_node_motion(result: NormalModeResult, ax: Axes) -> Axes:
    """Displacements over one period."""
    motion = result.motion
    scale, time = scale_for("m", *motion.displacement.values()), scale_for("s", motion.time)
    for k, (name, x) in enumerate(list(motion.displacement.items())[:MOST_CURVES]):
        ax.plot(motion.time * time.factor, x * scale.factor, label=name, **curve_style(k))
    finish(ax, f"Time ({time.unit})", f"Displacement ({scale.unit})")
    legend(ax, min(len(motion.displacement), MOST_CURVES), len(motion.displacement), "probes")
    return ax


def plot_phase_portrait(result: NormalModeResult, ax: Axes) -> Axes:
    """Velocity over displacement."""
    motion = result.motion
    scale, speed = scale_for("m", *motion.displacement.values()), scale_for("m/s", *motion.velocity.values())
    for k, name in enumerate(list(motion.displacement)[:MOST_CURVES]):
        ax.plot(
            motion.displacement[name] * scale.factor, motion.velocity[name] * speed.factor, label=name, **curve_style(k)
        )
    finish(ax, f"Displacement ({scale.unit})", f"Velocity ({speed.unit})")
    legend(ax, min(len(motion.displacement), MOST_CURVES), len(motion.displacement), "probes")
    return ax


def plot_configuration(result: NormalModeResult, ax: Axes) -> Axes:
    """Every probe's displacement over the first one's: a line for a linear mode, a curve for a nonlinear one."""
    motion = result.motion
    names = list(motion.displacement)
    scale = scale_for("m", *motion.displacement.values())
    first = motion.displacement[names[0]] * scale.factor
    others = names[1:] or names
    for k, name in enumerate(others[:MOST_CURVES]):
        ax.plot(first, motion.displacement[name] * scale.factor, label=name, **curve_style(k))
    finish(ax, f"Displacement of {names[0]} ({scale.unit})", f"Displacement ({scale.unit})")
    legend(ax, min(len(others), MOST_CURVES), len(others), "probes")
    return ax


def plot_orbit_spectrum(result: NormalModeResult, ax: Axes) -> Axes:
    """Lines of the periodic motion, in dB of the strongest."""
    frequency = result.branches[0].frequency_hz[-1]
    for k, (name, c) in enumerate(list(result.motion.harmonics.items())[:MOST_CURVES]):
        level = 20 * np.log10(np.maximum(np.abs(c), 1e-300) / np.abs(c).max())
        shown = level > -120
        style = curve_style(k)
        ax.vlines(np.arange(c.size)[shown] * frequency, -120, level[shown], color=style["color"], linewidth=1.1)
        ax.plot(
            np.arange(c.size)[shown] * frequency, level[shown], linestyle="none", marker="o", markersize=3,
            color=style["color"], label=name,
        )  # fmt: skip
    finish(ax, "Frequency (Hz)", "Amplitude (dB re largest)")
    legend(ax, min(len(result.motion.harmonics), MOST_CURVES), len(result.motion.harmonics), "probes")
    return ax


def nnm_figures(result: NormalModeResult) -> dict[str, Figure]:
    """Every picture of a nonlinear mode, by name."""
    figures = {
        "backbone": figure_of(result.title, lambda ax: plot_backbone(result, ax)),
        "mode_shapes": figure_of(result.title, lambda ax: plot_mode_shapes(result, ax)),
        "motion": figure_of(result.title, lambda ax: plot_node_motion(result, ax)),
        "phase_portrait": figure_of(result.title, lambda ax: plot_phase_portrait(result, ax)),
        "configuration": figure_of(result.title, lambda ax: plot_configuration(result, ax)),
        "spectrum": figure_of(result.title, lambda ax: plot_orbit_spectrum(result, ax)),
    }
    if result.parameter == "energy":
        figures["frequency_energy"] = figure_of(result.title, lambda ax: plot_frequency_energy(result, ax))
    return figures
