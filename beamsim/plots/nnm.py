"""Pictures of nonlinear normal modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.branch import ModeBranch
from beamsim.analyses.nnm.result import NormalModeResult
from beamsim.plots.branches import figure_of
from beamsim.plots.mode_branches import BRANCH_NAMES, plot_backbone, plot_frequency_energy
from beamsim.plots.multiple_scales import comparison_figures
from beamsim.plots.phase_resonance import phase_resonance_figures
from beamsim.plots.relaxed import relaxed_figure
from beamsim.plots.stations import finish_along, plot_along
from beamsim.plots.style import MOST_CURVES, curve_style, finish, legend, put_title, scale_for
from beamsim.structures.stations import MASSES
from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOOR = -120.0  # dB, of a spectrum
DRIFTED = 1e-6  # over the periods of the spectrum, from which the drift is shown
MANY = 4 * 20  # lines: a motion that drifts spreads them, and they are drawn as a curve


def plot_mode_shapes(result: NormalModeResult, ax: Axes) -> Axes:
    """The motion at its extremes, over the linear mode."""
    at_rest = _shown_branch(result).least_kinetic[result.motion_point] == 0.0
    word = "at rest" if at_rest or _shown_branch(result).kind == "backbone" else "slowest"
    first, second = result.motion.at_rest
    _shapes(
        result,
        ax,
        ((first, f"{word}, t = 0"), (second, "t = T/2"), (result.linear_shape, f"linear mode {result.mode}")),
    )
    return ax


def plot_deflected_shapes(result: NormalModeResult, ax: Axes) -> Axes:
    """The deflected shape at two instants underway."""
    first, second = result.motion.underway
    _shapes(result, ax, ((first, "t = T/8"), (second, "t = 3T/8")))
    return ax


def _shapes(result: NormalModeResult, ax: Axes, curves: tuple[tuple[Floats, str], ...]) -> None:
    scale = scale_for("m", *(shape for shape, _ in curves))
    ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0)
    for k, (shape, name) in enumerate(curves):
        plot_along(ax, result.stations, shape * scale.factor, name, **curve_style(k))
    finish_along(ax, result.stations, f"Deflection ({scale.unit})")
    legend(ax, len(curves), len(curves), "shapes")


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
    motion, nodes = result.motion, _nodes(result)
    scale, time = scale_for("m", motion.stations), scale_for("s", motion.time)
    for k, (at, name) in enumerate(nodes):
        ax.plot(motion.time * time.factor, motion.stations[:, at] * scale.factor, label=name, **curve_style(k))
    finish(ax, f"Time ({time.unit})", f"Displacement ({scale.unit})")
    _beside(ax, f"{len(nodes)} {'masses' if result.stations.axis is MASSES else 'nodes'}")
    return ax


def _beside(ax: Axes, title: str | None) -> None:
    """A legend right of the axes: room for long names."""
    ax.legend(
        title=title, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small",
        title_fontsize="small", handlelength=2.6,
    )  # fmt: skip


def plot_contact_forces(result: NormalModeResult, ax: Axes) -> Axes:
    """Contact forces over the same period."""
    motion = result.motion
    scale, time = scale_for("N", *motion.force.values()), scale_for("s", motion.time)
    for k, (name, force) in enumerate(list(motion.force.items())[:MOST_CURVES]):
        ax.plot(motion.time * time.factor, force * scale.factor, label=name, **curve_style(k))
    finish(ax, f"Time ({time.unit})", f"Contact force ({scale.unit})")
    known = len(motion.force)
    _beside(ax, f"{MOST_CURVES} of {known} snubbers" if known > MOST_CURVES else None)
    return ax


def plot_phase_portrait(result: NormalModeResult, ax: Axes) -> Axes:
    """Velocity over displacement."""
    motion = result.motion
    scale, speed = scale_for("m", *motion.displacement.values()), scale_for("m/s", *motion.velocity.values())
    for k, name in enumerate(list(motion.displacement)[:MOST_CURVES]):
        ax.plot(
            motion.displacement[name] * scale.factor, motion.velocity[name] * speed.factor, label=name, **curve_style(k)
        )
    of = f" of {next(iter(motion.displacement))}" if len(motion.displacement) == 1 else ""
    finish(ax, f"Displacement{of} ({scale.unit})", f"Velocity{of} ({speed.unit})")
    legend(ax, min(len(motion.displacement), MOST_CURVES), len(motion.displacement), "probes")
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
    scale = scale_for("m", *named.values())
    others = [name for name in named if name != across] or [across]
    # a brake orbit retraces its path: drawn twice, its dashes would merge into one line
    brake = _shown_branch(result).kind != "non_brake"
    part = slice((motion.time.size + 1) // 2 if brake else None)
    for k, name in enumerate(others[:MOST_CURVES]):
        ax.plot(named[across][part] * scale.factor, named[name][part] * scale.factor, label=name, **curve_style(k))
    up = others[0] if len(others) == 1 else ""
    finish(ax, f"Displacement of {across} ({scale.unit})", f"Displacement {f'of {up} ' if up else ''}({scale.unit})")
    legend(ax, min(len(others), MOST_CURVES), len(others), "curves")
    return ax


def plot_orbit_spectrum(result: NormalModeResult, ax: Axes) -> Axes:
    """Spectrum over the motion's many periods, in dB of each probe's strongest line."""
    motion = result.motion
    f = motion.spectrum_frequency_hz
    # as far as the harmonics that are stored: beyond them every line is small
    last = int(np.searchsorted(f, 20.5 / float(motion.time[-1])))
    scale = scale_for("Hz", f[:last])
    for k, (name, amplitude) in enumerate(list(motion.spectrum.items())[:MOST_CURVES]):
        level = 20 * np.log10(np.maximum(amplitude[:last], 1e-300) / amplitude[:last].max())
        visible = level > FLOOR
        colour = curve_style(k)["color"]
        if np.count_nonzero(visible) > MANY:
            ax.plot(f[:last] * scale.factor, np.maximum(level, FLOOR), label=name, **curve_style(k))
            continue
        ax.vlines(f[:last][visible] * scale.factor, FLOOR, level[visible], color=colour, linewidth=0.9, alpha=0.35)
        ax.plot(
            f[:last][visible] * scale.factor, level[visible], linestyle="none", marker="os^Dvx"[k],
            markersize=max(6.0 - 1.2 * k, 2.5), color=colour, label=name, markerfacecolor="none",
        )  # fmt: skip
    ax.set_ylim(FLOOR, 5.0)
    drift = f"; unstable: {100 * motion.drift:.3g} % away at their end" if motion.drift > DRIFTED else ""
    ax.set_title(f"{motion.periods} periods{drift}", loc="left", fontsize="small", color="0.3")
    finish(ax, f"Frequency ({scale.unit}), in steps of {_plain(f[1])} Hz", "Amplitude (dB re largest)")
    legend(ax, min(len(motion.spectrum), MOST_CURVES), len(motion.spectrum), "probes")
    return ax


def _plain(value: float) -> str:
    return f"{value:.3g}"


def _motion_figure(result: NormalModeResult) -> Figure:
    """Nodes above, contact forces below."""
    from matplotlib.figure import Figure

    if not result.motion.force:
        return figure_of(f"{result.title}\n{_motion_name(result)}", lambda ax: plot_node_motion(result, ax))
    figure = Figure(figsize=(7.2, 5.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    plot_node_motion(result, above)
    plot_contact_forces(result, below)
    above.set_xlabel("")
    put_title(figure, f"{result.title}\n{_motion_name(result)}")
    return figure


def nnm_figures(result: NormalModeResult) -> dict[str, Figure]:
    """Every picture of a nonlinear mode, by name."""
    motion = f"{result.title}\n{_motion_name(result)}"
    figures = {
        "backbone": figure_of(result.title, lambda ax: plot_backbone(result, ax)),
        "mode_shapes": figure_of(motion, lambda ax: plot_mode_shapes(result, ax)),
        "deflected_shapes": figure_of(motion, lambda ax: plot_deflected_shapes(result, ax)),
        "motion": _motion_figure(result),
        "phase_portrait": figure_of(motion, lambda ax: plot_phase_portrait(result, ax)),
        "configuration": figure_of(motion, lambda ax: plot_configuration(result, ax)),
        "spectrum": figure_of(motion, lambda ax: plot_orbit_spectrum(result, ax)),
    }
    if result.parameter != "stiffness_factor":
        figures["frequency_energy"] = figure_of(result.title, lambda ax: plot_frequency_energy(result, ax))
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
