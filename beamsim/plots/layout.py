"""Room for labels around the panels of a figure, measured once for each panel.

Matplotlib's constrained layout measures everything twice, and once more for every file that is written. A regular grid
of panels, as most figures are, needs one measurement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
            frame, whole = ax.get_window_extent(renderer), ax.get_tightbbox(renderer, for_layout_only=True)
            assert whole is not None  # it is visible
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
