"""What pictures of branches share: stable and unstable stretches, marks of special points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from beamsim.typing import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {"fold": "s", "period_doubling": "D", "neimark_sacker": "v", "branch_point": "P", "grazing": "x",
         "symmetry_breaking": "*"}  # fmt: skip


def stretches(x: Floats, y: Floats, stable: Bools, wanted: bool) -> tuple[Floats, Floats]:
    """The stretches of one stability, joined to their neighbours so that the curve has no holes."""
    keep = stable == wanted
    if not wanted:
        keep = keep | np.append(keep[1:], False) | np.append(False, keep[:-1])
    gap = np.where(keep, 0.0, np.nan)
    return x + gap, y + gap


def figure_of(title: str, draw: Callable[[Axes], object]) -> Figure:
    """A figure with one set of axes, drawn on."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    ax = figure.add_subplot()
    draw(ax)
    figure.suptitle(title, fontsize="medium")
    return figure
