"""Contour plots of plates: mode shapes and deflections seen from above."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.run.result import BodyResult, RunResult
from beamsim.plots.drawing import colour_bar, legend_below, panels
from beamsim.plots.style import scale_for
from beamsim.system.structural import ModeTable
from beamsim.typing import Floats

MOST_MODES = 6
_SLENDER = 0.4  # width over length of a plate below which its pictures stand one above the other
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
    beside = levels[levels != 0]
    lines_beside = ax.contour(  # dashed where it is negative, which is not seen in grey otherwise
        *seen, levels=beside, colors="0.3", linewidths=0.5, linestyles=["--" if z < 0 else "-" for z in beside]
    )
    if shape.min() < -_ZERO * largest and shape.max() > _ZERO * largest:
        ax.contour(*seen, levels=[0.0], colors="black", linewidths=1.4)
    if unit:
        colour_bar(ax, drawn, f"Relative deflection ({unit})").add_lines(lines_beside, erase=False)
    ax.set_aspect("equal")
    ax.set_xlabel(f"x ({metres.unit})")
    ax.set_ylabel(f"y ({metres.unit})")


def plot_plate_modes(modes: ModeTable, body: str, axes: list[Axes]) -> None:
    """The first mode shapes of the open structure on a plate, one a panel; a line of no deflection is thick."""
    stations = modes.stations
    part = next(part for part in stations if part.body == body or len(stations.parts) == 1)
    assert stations.across is not None
    x, y = stations.position[part.stations], stations.across[part.stations]
    for k, ax in enumerate(axes):
        shape = modes.shapes[k, part.stations]
        plot_contours(ax, x, y, shape / (float(np.abs(shape).max()) or 1.0))
        ax.set_title(f"mode {k + 1}, {modes.open_frequencies_hz[k]:.4g} Hz", fontsize="medium", loc="left")


def _shapes(result: RunResult, plate: BodyResult) -> list[tuple[Floats, str]]:
    """When the first probe is highest and lowest, and at a static equilibrium that deflects the plate; with titles."""
    first = next(iter(result.probes), "")
    shapes = [
        (plate.extreme_shapes[1], f"{first} highest, t = {plate.extreme_times[1]:.4g} s"),
        (plate.extreme_shapes[0], f"{first} lowest, t = {plate.extreme_times[0]:.4g} s"),
        (plate.static_shape, "static equilibrium"),
    ]
    largest = max(float(np.abs(shape).max(initial=0.0)) for shape, _ in shapes if np.all(np.isfinite(shape)))
    return [
        (shape, title)
        for shape, title in shapes
        if np.all(np.isfinite(shape)) and (largest == 0.0 or np.abs(shape).max() > _ROUND_OFF * largest)
    ]


def _deflections(result: RunResult, plate: BodyResult) -> Figure:
    """The shapes one above the other with the snubbers on the plate, to the scale of the plate."""
    assert plate.across is not None
    shapes = _shapes(result, plate)
    ratio = float(np.ptp(plate.across) / np.ptp(plate.position))
    columns = 1 if ratio < _SLENDER or len(shapes) == 1 else 2
    rows = -(-len(shapes) // columns)
    height = min(max(0.8 + rows * (0.75 + ratio * (6.0 if columns == 1 else 2.45)), 2.4), 10.0)
    figure, axes = panels(result.title, len(shapes), columns, (8.0, height))
    metres = scale_for("m", plate.position, plate.across)
    for ax, (shape, title) in zip(axes, shapes, strict=True):
        ax.set_title(title, fontsize="medium", loc="left")
        scale = scale_for("m", shape)
        plot_contours(ax, plate.position, plate.across, shape * scale.factor, scale.unit)
        for snubber in result.snubbers.values():
            if snubber.across is not None and np.isfinite(snubber.across):
                ax.plot(
                    snubber.position * metres.factor, snubber.across * metres.factor, linestyle="none", color="black",
                    marker=6 if snubber.side == "below" else 7, markersize=9, clip_on=False,
                    label=f"snubber {snubber.side}",
                )  # fmt: skip
    legend_below(figure, axes)
    return figure


def plate_figures(result: RunResult) -> dict[str, Figure]:
    """Deflections and mode shapes of every plate of a run; the key is the last part of the file name."""
    figures: dict[str, Figure] = {}
    for name, plate in result.bodies.items():
        if plate.across is None:
            continue
        suffix = "" if len(result.bodies) == 1 else f"_{name}"
        figures[f"plate_deflections{suffix}"] = _deflections(result, plate)
        count = min(MOST_MODES, result.modes.shapes.shape[0])
        figure, axes = panels(result.title, count, 2, (8.0, 2.6 * -(-count // 2)))
        plot_plate_modes(result.modes, name, axes)
        figures[f"plate_modes{suffix}"] = figure
    return figures
