"""The modal assurance criterion of measured and computed modes as a matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.compare_modes.result import ModeComparison
from beamsim.plots.style import put_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_NUMBERS = 150  # written into the cells of a matrix


def plot_mac(result: ModeComparison, ax: Axes) -> Axes:
    """MAC by measured (down) and computed modes (across) with their frequencies; pairs are framed."""
    drawn = ax.imshow(result.mac, vmin=0.0, vmax=1.0, cmap="Greys", aspect="auto")
    rows, columns = result.mac.shape
    if rows * columns <= MOST_NUMBERS:
        for i, j in np.ndindex(rows, columns):
            value = float(result.mac[i, j])
            ax.text(
                j,
                i,
                f"{value:.2f}",
                ha="center",
                va="center",
                fontsize="small",
                color="white" if value > 0.55 else "0.2",
            )
    paired = [(i, int(j) - 1) for i, j in enumerate(result.paired) if j > 0]
    for i, j in paired:
        ax.plot(
            [j - 0.5, j + 0.5, j + 0.5, j - 0.5, j - 0.5], [i - 0.5, i - 0.5, i + 0.5, i + 0.5, i - 0.5],
            color="#d1495b", linewidth=1.8, clip_on=False, zorder=3,
        )  # fmt: skip
    ax.set_xticks(range(columns), [f"{k + 1}\n{f:.4g}" for k, f in enumerate(result.predicted_hz)], fontsize="small")
    ax.set_yticks(range(rows), [f"{k + 1}   {f:.4g}" for k, f in enumerate(result.measured_hz)], fontsize="small")
    ax.set_xlabel(f"Computed mode, contacts {result.contacts} (Hz)")
    ax.set_ylabel("Measured mode (Hz)")
    if ax.figure is not None:
        ax.figure.colorbar(drawn, ax=ax, label="MAC")
    return ax


def mode_comparison_figures(result: ModeComparison) -> dict[str, Figure]:
    """The matrix alone, as ``mac``."""
    from matplotlib.figure import Figure

    rows, columns = result.mac.shape
    figure = Figure(figsize=(min(2.6 + 0.62 * columns, 14.0), min(1.8 + 0.5 * rows, 10.0)), layout="constrained")
    plot_mac(result, figure.subplots())
    if result.title:
        put_title(figure, result.title)
    return {"mac": figure}
