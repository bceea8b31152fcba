"""Relaxed minimisation (Hazim 2010) compared with exact shooting, step by step."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.nnm.result import NormalModeResult, RelaxedComparison
from beamsim.plots.drawing import DARK, HERTZ, RED, Curve, Guide, draw_curves, picture

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
    curves = []
    for k, branch in enumerate(b for b in result.branches if b.kind != "non_brake"):
        style = {"color": DARK if branch.kind == "backbone" else "0.6", "linestyle": "-"}
        label = ("shooting", "shooting, tongues", "")[min(k, 2)]
        curves.append(Curve(label, branch.parameter, branch.frequency_hz, style))
    marks: dict[str, Any] = {"linestyle": "none", "markersize": 3.5, "color": RED, "markerfacecolor": "white"}
    for fate, (mark, text) in _FATES.items():
        here = np.array([f == fate for f in relaxed.fate], dtype=bool)
        if here.any():
            style = {**marks, "marker": mark}
            curves.append(Curve(f"relaxed, {text}", relaxed.factor[here], relaxed.frequency_hz[here], style))
    draw_curves(ax, _FACTOR, ("Frequency", HERTZ), curves, of="")
    return ax


def plot_relaxed_difference(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """Relative differences from the exact motion at the same factor."""
    named = (("frequency", relaxed.frequency_difference), ("shape at rest", relaxed.shape_difference))
    curves = [Curve(text, relaxed.factor, np.where(y > 0, y, np.nan), {"marker": "."}) for text, y in named]
    draw_curves(ax, _FACTOR, ("Difference from shooting", ""), curves, log="y")
    return ax


def plot_relaxed_functional(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """The functional at the end of every step, under its tolerance where the step was reached."""
    missed = ~relaxed.reached
    curves = [Curve("at the end of a step", relaxed.factor, relaxed.functional, {"marker": "."})]
    if missed.any():
        marks: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 7}
        curves.append(Curve("not reached", relaxed.factor[missed], relaxed.functional[missed], marks))
    tolerance = Guide("tolerance", relaxed.tolerance, {"linewidth": 0.9, "linestyle": "--"})
    draw_curves(ax, _FACTOR, ("Functional", ""), curves, [tolerance], log="y")
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
    relaxed = result.relaxed
    below = [partial(plot, relaxed) for plot in (plot_relaxed_difference, plot_relaxed_functional, plot_relaxed_cost)]
    return picture(title, partial(plot_relaxed_frequency, result), *below, columns=2, size=(9.0, 6.4), sharex=True)
