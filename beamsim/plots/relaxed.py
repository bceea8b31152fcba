"""Relaxed minimisation (Hazim 2010) compared with exact shooting, step by step."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.nnm.result import NormalModeResult, RelaxedComparison
from beamsim.plots.drawing import DARK, RED, Curve, draw_curves, legend, panels

_FACTOR = ("Stiffness factor ε", "")
_FATES = {
    "same": ("o", "near the backbone's motion"),
    "between": ("s", "where a tongue cuts the backbone"),
    "other": ("D", "near another motion"),
    "none": ("x", "near no periodic motion"),
}


def plot_relaxed_frequency(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency over the factor: shooting's backbone and tongues, its steps by what they are beside."""
    relaxed = result.relaxed
    assert relaxed is not None
    for k, branch in enumerate(b for b in result.branches if b.kind != "non_brake"):
        colour, label = DARK if branch.kind == "backbone" else "0.6", ("shooting", "shooting, tongues", "_nolegend_")
        ax.plot(branch.parameter, branch.frequency_hz, color=colour, linewidth=1.1, label=label[min(k, 2)])
    marks = {"linestyle": "none", "markersize": 3.5, "color": RED, "markerfacecolor": "white"}
    steps = [
        Curve(f"relaxed, {text}", relaxed.factor[here], relaxed.frequency_hz[here], {**marks, "marker": mark})
        for fate, (mark, text) in _FATES.items()
        for here in [np.array([f == fate for f in relaxed.fate], dtype=bool)]
        if here.any()
    ]
    draw_curves(ax, _FACTOR, ("Frequency (Hz)", ""), steps)
    return ax


def plot_relaxed_difference(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """Relative differences from the exact motion at the same factor."""
    named = (("frequency", relaxed.frequency_difference), ("shape at rest", relaxed.shape_difference))
    curves = [Curve(text, relaxed.factor, np.where(y > 0, y, np.nan), {"marker": "."}) for text, y in named]
    draw_curves(ax, _FACTOR, ("Difference from shooting", ""), curves)
    ax.set_yscale("log")
    return ax


def plot_relaxed_functional(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """The functional at the end of every step, under its tolerance where the step was reached."""
    missed = ~relaxed.reached
    marks = {"linestyle": "none", "marker": "x", "markersize": 7}
    curves = [
        Curve("at the end of a step", relaxed.factor, relaxed.functional, {"marker": "."}),
        *([Curve("not reached", relaxed.factor[missed], relaxed.functional[missed], marks)] if missed.any() else []),
    ]
    draw_curves(ax, _FACTOR, ("Functional", ""), curves)
    ax.axhline(relaxed.tolerance, color="0.4", linewidth=0.9, linestyle="--", label="tolerance")
    legend(ax)
    ax.set_yscale("log")
    return ax


def plot_relaxed_cost(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """Motions computed in every step."""
    steps = [Curve("", relaxed.factor, relaxed.passages.astype(float), {"drawstyle": "steps-mid"})]
    draw_curves(ax, _FACTOR, ("Motions computed in a step", ""), steps)
    ax.set_title(
        f"{relaxed.passages.sum()} motions, {relaxed.processor_time_s.sum():.2g} s; "
        f"shooting {relaxed.shooting_passages}, {relaxed.shooting_processor_time_s:.2g} s",
        loc="left", fontsize="x-small", color="0.3",
    )  # fmt: skip
    ax.set_ylim(bottom=0)
    return ax


def relaxed_figure(result: NormalModeResult) -> Figure:
    """Frequency, differences, functional and cost over the stiffness factor."""
    assert result.relaxed is not None
    title = f"{result.title}\nrelaxed minimisation (Hazim 2010) and shooting"
    figure, (a, b, c, d) = panels(title, 4, 2, (9.0, 6.4), sharex=True)
    plot_relaxed_frequency(result, a)
    plot_relaxed_difference(result.relaxed, b)
    plot_relaxed_functional(result.relaxed, c)
    plot_relaxed_cost(result.relaxed, d)
    for above in (a, b):
        above.set_xlabel("")
    return figure
