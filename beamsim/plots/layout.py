"""Room for labels around the panels of a figure, measured once for each panel.

Matplotlib's constrained layout measures everything twice, and once more for every file that is written. A regular grid
of panels, as most figures are, needs one measurement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox, BboxBase

PAD = 0.04  # in, at the edges of a figure and between its panels
FIRST_GUESS = {"left": 0.1, "right": 0.98, "bottom": 0.1, "top": 0.9, "hspace": 0.3, "wspace": 0.3}


def lay_out(figure: Figure, renderer: Any) -> None:
    """Give the panels of a figure their places, which no later drawing changes."""
    if (engine := figure.get_layout_engine()) is None:
        return
    if _is_regular(figure):
        figure.set_layout_engine(None)  # "none" would keep the places that constrained layout gives
        _fit(figure, renderer)
    else:
        engine.execute(figure)
        figure.set_layout_engine("none")


def _is_regular(figure: Figure) -> bool:
    """Whether every panel fills one cell of the same grid and nothing else takes room."""
    cells: list[Any] = [ax.get_subplotspec() for ax in figure.axes]
    return (
        bool(cells)
        and not figure.legends
        and all(
            cell is not None
            and cell.num1 == cell.num2
            and cell.get_gridspec() is cells[0].get_gridspec()
            and ax.name == "rectilinear"
            for cell, ax in zip(cells, figure.axes, strict=True)
        )
    )


def _fit(figure: Figure, renderer: Any) -> None:
    """Panels of one size between the margins that the labels of each row and column need.

    Where a panel gets other ticks in its new size, whose labels may be wider, the margins are measured once more.
    """
    figure.subplots_adjust(**FIRST_GUESS)
    ticks = _ticks(figure)
    _place(figure, renderer)
    if _ticks(figure) != ticks:
        _place(figure, renderer)


def _ticks(figure: Figure) -> list[list[float]]:
    return [axis.get_majorticklocs().tolist() for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]


def _place(figure: Figure, renderer: Any) -> None:
    cells: list[Any] = [ax.get_subplotspec() for ax in figure.axes]
    rows, columns = cells[0].get_gridspec().get_geometry()
    left, right, bottom, top = np.zeros(columns), np.zeros(columns), np.zeros(rows), np.zeros(rows)
    for ax, cell in zip(figure.axes, cells, strict=True):
        if ax.get_visible():
            frame, whole = ax.get_window_extent(renderer), _extent(ax, renderer)
            row, column = cell.rowspan.start, cell.colspan.start
            left[column] = max(left[column], frame.x0 - whole.x0)
            right[column] = max(right[column], whole.x1 - frame.x1)
            bottom[row] = max(bottom[row], frame.y0 - whole.y0)
            top[row] = max(top[row], whole.y1 - frame.y1)
    size, pad = figure.bbox.size, PAD * figure.dpi
    ceiling = min((text.get_window_extent(renderer).y0 for text in figure.texts), default=size[1])
    width = (size[0] - pad - np.sum(left + right + pad)) / columns
    height = (ceiling - pad - np.sum(bottom + top + pad)) / rows
    if min(width, height) <= 0.0:  # labels larger than the figure
        return
    x = np.cumsum(left + right + width + pad) - right - width
    y = ceiling - np.cumsum(bottom + top + height + pad) + bottom
    for ax, cell in zip(figure.axes, cells, strict=True):
        ax.set_position(tuple(np.array([x[cell.colspan.start], y[cell.rowspan.start], width, height]) / [*size, *size]))


def _extent(ax: Axes, renderer: Any) -> Bbox:
    """Extent of a visible panel with all that belongs to it, in pixels."""
    from matplotlib.transforms import Bbox

    shown = ax.axison
    boxes = [_axis_extent(ax, side, renderer) for side in ("bottom", "left")] if shown else []
    ax.set_axis_off()  # the axes are measured
    try:
        boxes.append(ax.get_tightbbox(renderer, for_layout_only=True))
    finally:
        if shown:
            ax.set_axis_on()
    return Bbox.union([box for box in boxes if box is not None])


def _axis_extent(ax: Axes, side: str, renderer: Any) -> BboxBase | None:
    """Extent of the labels of an axis, of which its own is put where Matplotlib would put it.

    Left to Matplotlib, the place of that label takes two more measurements of all others, now and when it is drawn.
    """
    from matplotlib.transforms import Bbox, ScaledTranslation

    axis, across = (ax.xaxis, 1) if side == "bottom" else (ax.yaxis, 0)
    label, offset, figure = axis.label, axis.get_offset_text(), ax.get_figure(root=True)
    if not axis.get_visible() or figure is None:
        return None
    if axis.get_label_position() != side:
        return axis.get_tightbbox(renderer, for_layout_only=True)
    place, shift = list(label.get_position()), [0.0, 0.0]
    axis.set_label_coords(0.0, 0.0)  # anywhere: it is not measured
    if not label.get_text():
        return axis.get_tightbbox(renderer) or ax.spines[side].get_window_extent(renderer)
    label.set_visible(False)
    offset.set_visible(False)
    ticks = axis.get_tightbbox(renderer)
    label.set_visible(True)
    offset.set_visible(True)
    frame = ax.get_window_extent(renderer)
    edge = frame.min[across] if ticks is None else ticks.min[across]
    if edge >= frame.min[across]:  # no labels of ticks there
        edge = ax.spines[side].get_window_extent(renderer).min[across]
    place[across], shift[across] = 0.0, (edge - frame.min[across]) / figure.dpi - axis.labelpad / 72.0
    beside = ax.transAxes + ScaledTranslation(shift[0], shift[1], figure.dpi_scale_trans)
    axis.set_label_coords(place[0], place[1], transform=beside)
    corners = label.get_window_extent(renderer).get_points()
    corners[:, 1 - across] = np.mean(corners[:, 1 - across])  # however long it is
    boxes = [Bbox(corners), *([] if ticks is None else [ticks])]
    if offset.get_text():
        boxes.append(offset.get_window_extent(renderer))
    return Bbox.union(boxes)
