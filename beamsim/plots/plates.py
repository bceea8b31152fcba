"""Contour plots of plates: mode shapes and deflections seen from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.style import put_title, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.run.result import BodyResult, RunResult
    from beamsim.system.structural import ModeTable
    from beamsim.typing import Floats

MOST_MODES = 6
_SLENDER = 2.5  # length over width of a plate above which its pictures stand one above the other
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
    if unit and ax.figure is not None:
        ax.figure.colorbar(drawn, ax=ax, label=f"Relative deflection ({unit})").add_lines(lines_beside, erase=False)
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
        ax.set_title(f"mode {k + 1}, {modes.open_frequencies_hz[k]:.4g} Hz", fontsize="medium", loc="left")


def plot_plate_deflections(result: RunResult, plate: BodyResult, panels: list[Axes]) -> None:
    """The shapes of `_shapes`, one a panel, with the snubbers on the plate."""
    metres = scale_for("m", plate.position, plate.across if plate.across is not None else plate.position)
    for ax, (shape, title) in zip(panels, _shapes(result, plate), strict=False):
        ax.set_title(title, fontsize="medium", loc="left")
        scale = scale_for("m", shape)
        assert plate.across is not None
        plot_contours(ax, plate.position, plate.across, shape * scale.factor, scale.unit)
        for snubber in result.snubbers.values():
            if snubber.across is None or not np.isfinite(snubber.across):
                continue
            ax.plot(
                snubber.position * metres.factor, snubber.across * metres.factor, linestyle="none", color="black",
                marker=6 if snubber.side == "below" else 7, markersize=9, clip_on=False,
                label=f"snubber {snubber.side}",
            )  # fmt: skip


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
    """The shapes in a grid that fits their aspect; a legend of the snubbers where there are any."""
    from matplotlib.figure import Figure

    assert plate.across is not None
    count = len(_shapes(result, plate))
    slender = float(np.ptp(plate.position)) > _SLENDER * float(np.ptp(plate.across))
    columns = 1 if slender or count == 1 else 2
    rows = -(-count // columns)
    ratio = float(np.ptp(plate.across) / np.ptp(plate.position))
    height = min(max(0.4 + rows * (0.75 + ratio * (6.0 if columns == 1 else 2.45)), 2.4), 10.0)
    figure = Figure(figsize=(8.0, height), layout="compressed")
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    plot_plate_deflections(result, plate, panels)
    marks = {str(line.get_label()): line for line in panels[0].lines if str(line.get_label()).startswith("snubber")}
    for ax in panels[count:]:
        ax.set_axis_off()
    handles, labels = list(marks.values()), list(marks)
    if marks and len(panels) > count:
        panels[count].legend(handles, labels, loc="center", frameon=False, fontsize="small", labelspacing=1.2)
    elif marks:
        figure.legend(handles, labels, loc="outside lower center", frameon=False, fontsize="small", ncols=2)
    return figure


def plate_figures(result: RunResult) -> dict[str, Figure]:
    """Deflections and mode shapes of every plate of a run; the key is the last part of the file name."""
    from matplotlib.figure import Figure

    figures: dict[str, Figure] = {}
    for name, plate in result.bodies.items():
        if plate.across is None:
            continue
        suffix = "" if len(result.bodies) == 1 else f"_{name}"
        figures[f"plate_deflections{suffix}"] = _deflections(result, plate)
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
            put_title(figure, result.title)
    return figures
