"""Sketches of several bodies seen from the side: deflected shapes with supports, masses, joints and stops in place."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from beamsim.analyses.run.result import RunResult
from beamsim.plots.drawing import finish_positions, legend_below, panels
from beamsim.plots.sketch import Sketch, scale_bar
from beamsim.plots.style import amount, round_length

MOST_MODES = 6
_HEIGHT = 0.36  # of the largest deflection or gap, over the distance of rows


def _sketch(result: RunResult) -> Sketch:
    return Sketch(result.scenario, result.modes.stations, result.snubbers)


def plot_assembly_modes(result: RunResult, axes: list[Axes]) -> None:
    """The first modes of the open structure, one a panel; stops are at the bodies at rest, as modes have no size."""
    sketch, modes = _sketch(result), result.modes
    for k, ax in enumerate(axes):
        shape = modes.shapes[k]
        sketch.draw(ax, shape, _HEIGHT / (float(np.abs(shape).max()) or 1.0), to_scale=False)
        ax.set_title(f"mode {k + 1}, {modes.open_frequencies_hz[k]:.4g} Hz", fontsize="medium", loc="left")
        finish_positions(ax)


def plot_assembly_contact(result: RunResult, ax: Axes) -> Axes:
    """The deflection relative to the base when the contact force is largest; gaps to the same scale."""
    contact = result.contact
    if contact is None:
        raise ValueError("no snubber was in contact")
    sketch, shape = _sketch(result), contact.deflection(result.modes)
    gaps = [abs(snubber.gap) for snubber in result.snubbers.values()]
    largest = max(float(np.abs(shape).max()), *(gap for gap in gaps if math.isfinite(gap)), 0.0) or 1.0
    factor = _HEIGHT / largest
    sketch.draw(ax, shape, factor, to_scale=True)
    ax.set_title(
        f"largest contact force, {amount(contact.force, 'N')} at {contact.snubber}, t = {contact.time:.4g} s",
        fontsize="medium", loc="left",
    )  # fmt: skip
    bar = round_length(largest)
    scale_bar(ax, ax.get_xlim()[1], bar * factor, amount(bar, "m"))
    finish_positions(ax)
    return ax


def assembly_figures(result: RunResult) -> dict[str, Figure]:
    """Modes, and the instant of the largest contact force, of a structure of several bodies."""
    if len(result.modes.stations.parts) < 2:
        return {}
    figures: dict[str, Figure] = {}
    bodies, count = _sketch(result).count, min(MOST_MODES, result.modes.shapes.shape[0])
    rows = -(-count // 2)
    figures["assembly_modes"], axes = panels(result.title, count, 2, (8.0, 0.8 + rows * (1.0 + 0.7 * bodies)))
    plot_assembly_modes(result, axes)
    legend_below(figures["assembly_modes"], axes)
    if result.contact is not None:
        figures["assembly_contact"], axes = panels(result.title, size=(8.0, 1.6 + 1.4 * bodies))
        plot_assembly_contact(result, axes[0])
        legend_below(figures["assembly_contact"], axes)
    return figures
