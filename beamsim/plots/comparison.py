"""Predicted (solid) and measured (dashed) histories and spectra, as in H. Hazim's thesis (2010), figures 1.5 to 1.8."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from beamsim.analyses.compare.result import Assurance, ChannelComparison, Comparison, SweptComparison
from beamsim.analyses.compare_modes import ModeComparison
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    RED,
    Chart,
    Curve,
    colour_bar,
    dashed_line,
    draw_curves,
    finish,
    marked,
    picture,
)
from beamsim.plots.style import plain_scale

HIGHEST_ORDER, DEEPEST_DB = 12.5, 100.0  # of spectra
_PREDICTED: dict[str, Any] = {"color": DARK, "linestyle": "-", "linewidth": 1.2}
_MEASURED: dict[str, Any] = {"color": RED, "linestyle": (0, (4, 2)), "linewidth": 1.2}


def histories(c: ChannelComparison) -> Chart:
    """Both time histories, aligned in phase, over the time of the prediction."""
    curves = [Curve("predicted", c.predicted_time, c.predicted_history, _PREDICTED)]
    if c.measured_time.size:
        curves.append(Curve("measured", c.measured_time, c.measured_history, _MEASURED))
    return Chart(("Time", plain_scale("s")), (c.quantity.replace("_", " ").capitalize(), c.unit), curves)


def plot_spectra(c: ChannelComparison, ax: Axes) -> Axes:
    """Both spectra in dB re their own maximum, over frequency divided by excitation frequency."""
    forced = bool(np.isfinite(c.excitation_hz))
    unit = c.excitation_hz if forced else 1.0
    spectra = (("predicted", c.predicted_spectrum, _PREDICTED), ("measured", c.measured_spectrum, _MEASURED))
    curves = [Curve(label, s.frequency_hz / unit, s.amplitude_db, style) for label, s, style in spectra]
    across = ("Frequency / excitation frequency", "") if forced else ("Frequency", HERTZ)
    draw_curves(ax, across, ("Level (dB re max)", ""), curves)
    if forced:
        ax.set_xlim(0.0, min(HIGHEST_ORDER, float(c.predicted_spectrum.frequency_hz[-1]) / unit))
    top = max(0.0, *(float(s.amplitude_db.max()) for _, s, _ in spectra))
    ax.set_ylim(top - DEEPEST_DB, top + 6)
    return ax


def swept_responses(c: SweptComparison) -> Chart:
    """Response over frequency, with the peaks that are compared."""
    curves = [
        Curve("predicted", c.frequency_hz, np.abs(c.predicted), _PREDICTED),
        Curve("measured", c.frequency_hz, np.abs(c.measured), _MEASURED),
    ]
    for marker, whose, style in (("o", "predicted", _PREDICTED), ("s", "measured", _MEASURED)):
        at = [(getattr(peak, f"{whose}_hz"), getattr(peak, f"{whose}_level")) for peak in c.peaks]
        if at:
            colour = style["color"]
            curves.append(marked(f"{whose} peaks", at, color=colour, marker=marker, markerfacecolor="none"))
    detected = {"peak": "peak", "fundamental": "fundamental of", "rms": "rms"}[c.detector]
    response = f"{detected} {c.quantity.replace('_', ' ')}".capitalize()
    return Chart((f"{c.curve}, FRAC {c.frac:.3f}, excitation frequency", HERTZ), (response, c.unit), curves, log="y")


def plot_fdac(assurance: Assurance, ax: Axes) -> Axes:
    """FDAC over both frequencies, with the line of equal frequencies."""
    mesh = ax.pcolormesh(assurance.measured_hz, assurance.predicted_hz, assurance.fdac, cmap="cividis", vmin=0, vmax=1,
                         shading="nearest")  # fmt: skip
    ends = [float(assurance.measured_hz[0]), float(assurance.measured_hz[-1])]
    dashed_line(ax, ends, ends, "equal frequencies")
    colour_bar(ax, mesh, "FDAC")
    finish(ax, "Measured frequency (Hz)", "Predicted frequency (Hz)")
    return ax


def comparison_figures(comparison: Comparison) -> dict[str, Figure]:
    """One figure per channel, named after place and quantity."""
    figures = {}
    for c in comparison.channels:
        title = f"{comparison.title}: {c.place}"
        figures[f"{c.place}_{c.quantity}"] = picture(title, histories(c), partial(plot_spectra, c))
    for swept in comparison.sweeps:
        title = f"{comparison.title}: {swept.place}"
        figures[f"{swept.place}_{swept.quantity}"] = picture(title, swept_responses(swept))
    if comparison.assurance is not None:
        figures["fdac"] = picture(comparison.title, partial(plot_fdac, comparison.assurance), size=(6.4, 5.2))
    return figures


def plot_mac(result: ModeComparison, ax: Axes) -> Axes:
    """MAC by measured (down) and computed modes (across) with their frequencies; pairs are framed."""
    drawn = ax.imshow(result.mac, vmin=0.0, vmax=1.0, cmap="Greys", aspect="auto")
    rows, columns = result.mac.shape
    for i, j in np.ndindex(rows, columns) if rows * columns <= 150 else ():
        value = float(result.mac[i, j])
        colour = "white" if value > 0.55 else "0.2"
        ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize="small", color=colour)
    for i, j in enumerate(result.paired):
        if j > 0:
            frame = Rectangle((j - 1.5, i - 0.5), 1, 1, edgecolor=RED, facecolor="none", linewidth=1.8, clip_on=False)
            ax.add_patch(frame).set_zorder(3)
    ax.set_xticks(range(columns), [f"{k + 1}\n{f:.4g}" for k, f in enumerate(result.predicted_hz)], fontsize="small")
    ax.set_yticks(range(rows), [f"{k + 1}   {f:.4g}" for k, f in enumerate(result.measured_hz)], fontsize="small")
    ax.set_xlabel(f"Computed mode, contacts {result.contacts} (Hz)")
    ax.set_ylabel("Measured mode (Hz)")
    colour_bar(ax, drawn, "MAC")
    return ax


def mode_comparison_figures(result: ModeComparison) -> dict[str, Figure]:
    """The matrix alone, as ``mac``."""
    rows, columns = result.mac.shape
    size = (min(2.6 + 0.62 * columns, 14.0), min(1.8 + 0.5 * rows, 10.0))
    return {"mac": picture(result.title, partial(plot_mac, result), size=size)}
