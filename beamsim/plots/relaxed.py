"""Relaxed minimisation (Hazim 2010) compared with exact shooting, step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.nnm.result import NormalModeResult, RelaxedComparison
from beamsim.plots.branches import stretches
from beamsim.plots.style import curve_style, finish, put_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_FATES = {
    "same": ("o", "beside the backbone's motion"),
    "between": ("s", "where a tongue cuts the backbone"),
    "other": ("D", "beside another motion"),
    "none": ("x", "beside no periodic motion"),
}


def plot_relaxed_frequency(result: NormalModeResult, ax: Axes) -> Axes:
    """Frequency over the factor: shooting's backbone and tongues, its steps by what they are beside."""
    relaxed = result.relaxed
    assert relaxed is not None
    for k, branch in enumerate(b for b in result.branches if b.kind != "non_brake"):
        colour = curve_style(0)["color"] if branch.kind == "backbone" else "0.6"
        label = {0: "shooting", 1: "shooting, tongues"}.get(k, "_nolegend_")
        every = np.ones(branch.stable.size, dtype=bool)
        ax.plot(
            *stretches(branch.parameter, branch.frequency_hz, every, True), color=colour, linewidth=1.1, label=label
        )
    for fate, (mark, text) in _FATES.items():
        here = np.array([f == fate for f in relaxed.fate], dtype=bool)
        if here.any():
            ax.plot(
                relaxed.factor[here], relaxed.frequency_hz[here], linestyle="none", marker=mark, markersize=3.5,
                color=curve_style(1)["color"], markerfacecolor="white", label=f"relaxed minimisation, {text}",
            )  # fmt: skip
    finish(ax, "Stiffness factor ε", "Frequency (Hz)")
    ax.legend(loc="best", frameon=False, fontsize="x-small")
    return ax


def plot_relaxed_difference(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """Relative differences from the exact motion at the same factor."""
    for k, (values, text) in enumerate(
        ((relaxed.frequency_difference, "frequency"), (relaxed.shape_difference, "shape at rest"))
    ):
        ax.plot(relaxed.factor, np.where(values > 0, values, np.nan), marker=".", label=text, **curve_style(k))
    ax.set_yscale("log")
    finish(ax, "Stiffness factor ε", "Difference from shooting")
    ax.legend(loc="best", frameon=False, fontsize="x-small")
    return ax


def plot_relaxed_functional(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """The functional at the end of every step, under its tolerance where the step was reached."""
    ax.axhline(relaxed.tolerance, color="0.4", linewidth=0.9, linestyle="--", label="tolerance")
    ax.plot(relaxed.factor, relaxed.functional, marker=".", label="at the end of a step", **curve_style(0))
    missed = ~relaxed.reached
    if missed.any():
        ax.plot(
            relaxed.factor[missed], relaxed.functional[missed], linestyle="none", marker="x", markersize=7,
            color=curve_style(1)["color"], label="not reached",
        )  # fmt: skip
    ax.set_yscale("log")
    finish(ax, "Stiffness factor ε", "Functional")
    ax.legend(loc="best", frameon=False, fontsize="x-small")
    return ax


def plot_relaxed_cost(relaxed: RelaxedComparison, ax: Axes) -> Axes:
    """Motions computed in every step."""
    ax.step(relaxed.factor, relaxed.passages, where="mid", **curve_style(0))
    spent = relaxed.processor_time_s.sum()
    ax.set_title(
        f"{relaxed.passages.sum()} motions, {spent:.2g} s; shooting {relaxed.shooting_passages}, "
        f"{relaxed.shooting_processor_time_s:.2g} s",
        loc="left", fontsize="x-small", color="0.3",
    )  # fmt: skip
    ax.set_ylim(bottom=0)
    finish(ax, "Stiffness factor ε", "Motions computed in a step")
    return ax


def relaxed_figure(result: NormalModeResult) -> Figure:
    """Frequency, differences, functional and cost over the stiffness factor."""
    from matplotlib.figure import Figure

    assert result.relaxed is not None
    figure = Figure(figsize=(9.0, 6.4), layout="constrained")
    (a, b), (c, d) = figure.subplots(2, 2, sharex=True)
    plot_relaxed_frequency(result, a)
    plot_relaxed_difference(result.relaxed, b)
    plot_relaxed_functional(result.relaxed, c)
    plot_relaxed_cost(result.relaxed, d)
    for above in (a, b):
        above.set_xlabel("")
    put_title(figure, f"{result.title}\nrelaxed minimisation (Hazim 2010) and shooting")
    return figure
