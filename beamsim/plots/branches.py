"""What pictures of branches share: stable and unstable stretches, marks of special points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from beamsim.orbits.branch import special_name
from beamsim.plots.drawing import beside
from beamsim.typing import Bools, Floats

MARKS = {"fold": "s", "nonsmooth_fold": "X", "period_doubling": "D", "neimark_sacker": "v", "branch_point": "P",
         "grazing": "x", "symmetry_breaking": "*"}  # fmt: skip
UNSTABLE = (0, (3, 1.5))  # dashes of what is unstable


def plot_branch(
    ax: Axes, x: Floats, y: Floats, stable: Bools, *, color: Any, width: float, label: str | None = None, **style: Any
) -> None:
    """A branch as a line: stable stretches full, unstable ones thinner and dashed.

    Parameters
    ----------
    x, y, stable : (n,) of its points.
    """
    given = {"color": color, **style}
    gap = np.where(stable, 0.0, np.nan)
    ax.plot(x + gap, y + gap, **{"linewidth": width, "label": label, **given})
    gap = np.where(beside(~stable), 0.0, np.nan)
    ax.plot(x + gap, y + gap, **{"linewidth": 0.8 * width, "linestyle": UNSTABLE, **given})


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
    ax.plot([], [], color="0.3", linewidth=1.2, linestyle=UNSTABLE, label="unstable")
