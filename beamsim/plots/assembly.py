"""Sketches of several bodies seen from the side: deflected shapes with supports, masses, joints and stops in place."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from beamsim.plots.sketch import Sketch
from beamsim.plots.style import finish_positions, put_title, round_length, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beamsim.analyses.run.result import RunResult

MOST_MODES = 6
_HEIGHT = 0.36  # of the largest deflection or gap, over the distance of rows


def _sketch(result: RunResult) -> Sketch:
    return Sketch(result.scenario, result.modes.stations, result.snubbers)


def _legend(figure: Figure, panels: list[Axes]) -> None:
    """One of each mark that any panel shows."""
    marks = {line.get_label(): line for ax in panels for line in ax.lines if not str(line.get_label()).startswith("_")}
    if marks:
        figure.legend(
            marks.values(), [str(label) for label in marks], loc="outside lower center", ncols=min(len(marks), 6),
            frameon=False, fontsize="small",
        )  # fmt: skip


def plot_assembly_modes(result: RunResult, panels: list[Axes]) -> None:
    """The first modes of the open structure, one a panel; stops are at the bodies at rest, as modes have no size."""
    sketch, modes = _sketch(result), result.modes
    for k, ax in enumerate(panels):
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
    force, length = (scale_for(unit, np.array([value])) for unit, value in (("N", contact.force), ("m", largest)))
    ax.set_title(
        f"largest contact force, {contact.force * force.factor:.4g} {force.unit} at {contact.snubber}, "
        f"t = {contact.time:.4g} s", fontsize="medium", loc="left",
    )  # fmt: skip
    bar = round_length(largest * length.factor) / length.factor
    end = ax.get_xlim()[1]
    ax.plot([end, end], [-0.5 * bar * factor, 0.5 * bar * factor], color="black", linewidth=2.0, clip_on=False)
    ax.annotate(
        f"{bar * length.factor:g} {length.unit}", (end, 0.0), xytext=(5, 0), textcoords="offset points", va="center",
        fontsize="small", annotation_clip=False,
    )  # fmt: skip
    finish_positions(ax)
    return ax


def assembly_figures(result: RunResult) -> dict[str, Figure]:
    """Modes, and the instant of the largest contact force, of a structure of several bodies."""
    from matplotlib.figure import Figure

    if len(result.modes.stations.parts) < 2:
        return {}
    figures: dict[str, Figure] = {}
    rows_of_bodies = _sketch(result).count
    count = min(MOST_MODES, result.modes.shapes.shape[0])
    rows = -(-count // 2)
    figure = Figure(figsize=(8.0, 0.8 + rows * (1.0 + 0.7 * rows_of_bodies)), layout="constrained")
    panels = list(figure.subplots(rows, 2, squeeze=False).ravel())
    plot_assembly_modes(result, panels[:count])
    for ax in panels[count:]:
        ax.set_visible(False)
    _legend(figure, panels[:count])
    figures["assembly_modes"] = figure
    if result.contact is not None:
        figure = Figure(figsize=(8.0, 1.6 + 1.4 * rows_of_bodies), layout="constrained")
        ax = figure.subplots()
        plot_assembly_contact(result, ax)
        _legend(figure, [ax])
        figures["assembly_contact"] = figure
    for figure in figures.values():
        if result.title:
            put_title(figure, result.title)
    return figures
