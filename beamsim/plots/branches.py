"""What pictures of branches share: stable and unstable stretches, marks of special points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.orbits.branch import special_name
from beamsim.plots.style import put_title
from beamsim.typing import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {"fold": "s", "nonsmooth_fold": "X", "period_doubling": "D", "neimark_sacker": "v", "branch_point": "P",
         "grazing": "x", "symmetry_breaking": "*"}  # fmt: skip
DASHES = (0, (3, 1.5))  # of what is unstable
THINNER = 0.8


def stretches(x: Floats, y: Floats, stable: Bools, chosen: bool) -> tuple[Floats, Floats]:
    """The stretches of one stability, joined to their neighbours so that the curve has no holes."""
    keep = stable == chosen
    if not chosen:
        keep = keep | np.append(keep[1:], False) | np.append(False, keep[:-1])
    gap = np.where(keep, 0.0, np.nan)
    return x + gap, y + gap


def plot_branch(
    ax: Axes, x: Floats, y: Floats, stable: Bools, *, color: Any, width: float, label: str | None = None,
    zorder: float = 2.0,
) -> None:  # fmt: skip
    """A branch as a line: stable stretches full, unstable ones thinner and dashed."""
    ax.plot(*stretches(x, y, stable, True), color=color, linewidth=width, label=label, zorder=zorder)
    unstable = stretches(x, y, stable, False)
    ax.plot(*unstable, color=color, linewidth=THINNER * width, linestyle=DASHES, zorder=zorder)


def mark_special(ax: Axes, kind: str, places: Sequence[tuple[float, float]], size: float = 5.0) -> None:
    """Special points of one kind, named in the legend; nothing where there are none."""
    if not places:
        return
    ax.plot(
        *np.transpose(places), linestyle="none", marker=MARKS[kind], markersize=size, color="0.2",
        markerfacecolor="white", markeredgewidth=0.18 * size, label=special_name(kind), zorder=4,
    )  # fmt: skip


def explain_dashes(ax: Axes) -> None:
    """An entry of the legend for what is unstable."""
    ax.plot([], [], color="0.3", linewidth=1.2, linestyle=DASHES, label="unstable")


def figure_of(title: str, draw: Callable[[Axes], object]) -> Figure:
    """A figure with one set of axes, drawn on."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    ax = figure.add_subplot()
    draw(ax)
    put_title(figure, title)
    return figure
