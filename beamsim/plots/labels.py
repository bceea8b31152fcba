"""Labels next to points of a plot, placed clear of curves and of one another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.typing import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 6.9  # points, font size
LETTER, LINE = 0.56, 1.25  # width of a letter and height of a line, over the size
DISTANCES = (10.0, 17.0, 26.0, 37.0, 50.0, 65.0)  # points, from the labelled point to the label
DIRECTIONS = tuple(np.deg2rad(a) for a in (-40, 40, -75, 75, -10, 10, -140, 140, -105, 105, 180))
MARGIN = 1.5  # points, around a label
SPACING = 2.0  # points, between the dots that represent a curve
ON_NAME, OUTSIDE, ON_LINE = 50.0, 100.0, 1.0  # cost of overlapping another label, the frame, a dot of a curve
FAR = 0.03  # per point of distance


def put_names(
    ax: Axes, places: Iterable[tuple[str, tuple[float, float]]], curves: Iterable[tuple[Floats, Floats]]
) -> None:
    """Put every label near its point (data coordinates) where it overlaps least, with a thin leader line.

    Everything that determines the limits of the axes must be drawn before.
    """
    ax.autoscale_view()  # otherwise the limits are determined only when drawing
    points = 72.0 / ax.figure.dpi
    frame = np.array(ax.bbox.extents) * points
    dots = _dots(ax, curves, points)
    taken: list[tuple[float, float, float, float]] = []
    for text, place in places:
        at = ax.transData.transform(place) * points
        wide, high = LETTER * SIZE * len(text), LINE * SIZE
        best: tuple[float, float, float, str] | None = None
        for distance in DISTANCES:
            for angle in DIRECTIONS:
                dx, dy = distance * np.cos(angle), distance * np.sin(angle)
                side = "left" if np.cos(angle) > 0.05 else "right" if np.cos(angle) < -0.95 else "center"
                left = at[0] + dx - {"left": 0.0, "right": wide, "center": 0.5 * wide}[side]
                box = (left - MARGIN, at[1] + dy - 0.5 * high, left + wide + MARGIN, at[1] + dy + 0.5 * high)
                cost = FAR * distance + _cost(box, frame, dots, taken)
                if best is None or cost < best[0]:
                    best, best_box = (cost, dx, dy, side), box
        assert best is not None
        taken.append(best_box)
        leader: dict[str, Any] = {"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1}
        ax.annotate(
            text, place, xytext=best[1:3], textcoords="offset points", ha=best[3], va="center", fontsize=SIZE,
            color="0.25", arrowprops=leader, zorder=6,
        )  # fmt: skip


def put_beside(ax: Axes, ends: Mapping[str, tuple[float, float]]) -> None:
    """Write names beside the right ends of curves (data coordinates), by which they are found without colour.

    Names that would overlap are moved apart. Limits of the axes must be set before; ends outside have no name.
    """
    low, high = sorted(ax.get_ylim())
    points = 72.0 / ax.figure.dpi
    heights = {
        name: float(ax.transData.transform(end)[1]) * points for name, end in ends.items() if low <= end[1] <= high
    }
    free = -np.inf
    for name in sorted(heights, key=lambda name: heights[name]):
        at = max(heights[name], free)
        free = at + LINE * SIZE
        ax.annotate(
            name, ends[name], xytext=(4, at - heights[name]), textcoords="offset points", va="center", fontsize=SIZE
        )


def _cost(
    box: tuple[float, float, float, float],
    frame: Floats,
    dots: Floats,
    taken: list[tuple[float, float, float, float]],
) -> float:
    left, low, right, high = box
    cost = 0.0
    if left < frame[0] or low < frame[1] or right > frame[2] or high > frame[3]:
        cost += OUTSIDE
    for a in taken:
        if left < a[2] and right > a[0] and low < a[3] and high > a[1]:
            cost += ON_NAME
    covered = (dots[:, 0] > left) & (dots[:, 0] < right) & (dots[:, 1] > low) & (dots[:, 1] < high)
    return cost + ON_LINE * float(np.count_nonzero(covered))


def _dots(ax: Axes, curves: Iterable[tuple[Floats, Floats]], points: float) -> Floats:
    """(k, 2) points along the curves, in typographic points."""
    dots = [np.zeros((0, 2))]
    for x, y in curves:
        line = ax.transData.transform(np.stack([x, y], axis=1)) * points
        for a, b in pairwise(line):
            if np.all(np.isfinite(a)) and np.all(np.isfinite(b)):
                steps = 1 + int(min(np.hypot(*(b - a)) / SPACING, 1000.0))
                dots.append(a + np.linspace(0.0, 1.0, steps, endpoint=False)[:, None] * (b - a))
    return np.concatenate(dots)
