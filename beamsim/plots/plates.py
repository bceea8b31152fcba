"""Contour plots of plates: mode shapes and deflections seen from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.style import scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.run.result import BodyResult, RunResult
    from beamsim.system.structural import ModeTable
    from beamsim.typing import Floats

MOST_MODES = 6
_LEVELS = 13
_REFINED = 4  # points an element, in between by a cubic spline
_ROUND_OFF = 1e-9  # of the largest deflection
_ZERO = 1e-3  # of the same: less is that of a supported edge


def plot_contours(ax: Axes, x: Floats, y: Floats, shape: Floats, unit: str = "") -> None:
    """A deflection (nx,) at points (nx,) of a plate; zero is in the middle of the colours, and a thick line."""
    from scipy.interpolate import RectBivariateSpline

    metres = scale_for("m", x, y)
    largest = float(np.abs(shape).max()) or 1.0
    levels = np.linspace(-largest, largest, _LEVELS)
    lines = np.unique(x), np.unique(y)  # of nodes
    nodes = shape[np.lexsort((y, x))].reshape(lines[0].size, lines[1].size)
    across, up = (np.interp(np.arange(0, n.size - 0.9, 1 / _REFINED), np.arange(n.size), n) for n in lines)
    degree_x, degree_y = (min(3, n.size - 1) for n in lines)
    smooth = RectBivariateSpline(lines[0], lines[1], nodes, kx=degree_x, ky=degree_y)(across, up).T
    smooth[np.abs(smooth) < _ROUND_OFF * largest] = 0.0
    seen = across * metres.factor, up * metres.factor, smooth
    drawn = ax.contourf(*seen, levels=levels, cmap="RdBu_r", extend="both")
    ax.contour(*seen, levels=levels[levels != 0], colors="0.45", linewidths=0.4, linestyles="solid")
    if shape.min() < -_ZERO * largest and shape.max() > _ZERO * largest:
        ax.contour(*seen, levels=[0.0], colors="black", linewidths=1.4)
    if unit and ax.figure is not None:
        ax.figure.colorbar(drawn, ax=ax, label=f"Relative deflection ({unit})")
    ax.set_aspect("equal")
    ax.set_xlabel(f"x ({metres.unit})")
    ax.set_ylabel(f"y ({metres.unit})")


def plot_plate_modes(modes: ModeTable, body: str, panels: list[Axes]) -> None:
    """The first mode shapes of the open structure on a plate, one a panel; a line of no deflection is thick."""
    stations = modes.stations
    part = next(part for part in stations if part.body == body or len(stations.parts) == 1)
    assert stations.across is not None
    x, y = stations.position[part.stations], stations.across[part.stations]
    for k, ax in enumerate(panels):
        shape = modes.shapes[k, part.stations]
        plot_contours(ax, x, y, shape / (float(np.abs(shape).max()) or 1.0))
        ax.set_title(f"mode {k + 1}, {modes.open_frequencies_hz[k]:.4g} Hz", fontsize="medium")


def plot_plate_deflections(result: RunResult, plate: BodyResult, panels: list[Axes]) -> None:
    """The shapes when the first probe is highest and lowest, and at static equilibrium; snubbers on the plate."""
    assert plate.across is not None
    first = next(iter(result.probes), "")
    shapes = [
        (plate.extreme_shapes[1], f"{first} highest, t = {plate.extreme_times[1]:.4g} s"),
        (plate.extreme_shapes[0], f"{first} lowest, t = {plate.extreme_times[0]:.4g} s"),
        (plate.static_shape, "static equilibrium"),
    ]
    metres = scale_for("m", plate.position, plate.across)
    for ax, (shape, title) in zip(panels, shapes, strict=True):
        ax.set_title(title, fontsize="medium")
        if not np.all(np.isfinite(shape)):
            ax.set_visible(False)
            continue
        scale = scale_for("m", shape)
        plot_contours(ax, plate.position, plate.across, shape * scale.factor, scale.unit)
        for snubber in result.snubbers.values():
            if snubber.across is None or not np.isfinite(snubber.across):
                continue
            ax.plot(
                snubber.position * metres.factor, snubber.across * metres.factor, linestyle="none", color="black",
                marker=6 if snubber.side == "below" else 7, markersize=9, clip_on=False,
            )  # fmt: skip


def plate_figures(result: RunResult) -> dict[str, Figure]:
    """Deflections and mode shapes of every plate of a run; the key is the last part of the file name."""
    from matplotlib.figure import Figure

    figures: dict[str, Figure] = {}
    for name, plate in result.bodies.items():
        if plate.across is None:
            continue
        suffix = "" if len(result.bodies) == 1 else f"_{name}"
        figure = Figure(figsize=(8.0, 8.4), layout="constrained")
        plot_plate_deflections(result, plate, list(figure.subplots(3, 1)))
        figures[f"plate_deflections{suffix}"] = figure
        count = min(MOST_MODES, result.modes.shapes.shape[0])
        rows = -(-count // 2)
        figure = Figure(figsize=(8.0, 2.6 * rows), layout="constrained")
        panels = list(figure.subplots(rows, 2, squeeze=False).ravel())
        plot_plate_modes(result.modes, name, panels[:count])
        for ax in panels[count:]:
            ax.set_visible(False)
        figures[f"plate_modes{suffix}"] = figure
    for figure in figures.values():
        if result.title:
            figure.suptitle(result.title, x=0.012, ha="left", fontsize="medium", color="0.3")
    return figures
