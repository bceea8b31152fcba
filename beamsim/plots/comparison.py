"""Predicted (solid) and measured (dashed) histories and spectra, as in H. Hazim's thesis (2010), figures 1.5 to 1.8."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.analyses.compare.result import Assurance, ChannelComparison, Comparison, SweptComparison
from beamsim.plots.style import dashed_line, finish, put_title, scale_for, thinned, time_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PREDICTED: dict[str, Any] = {"color": "#0b3c5d", "linestyle": "-", "linewidth": 1.2}
_MEASURED: dict[str, Any] = {"color": "#d1495b", "linestyle": (0, (4, 2)), "linewidth": 1.2}
_HIGHEST_ORDER = 12.5
_DEEPEST_DB = 100.0


def plot_histories(c: ChannelComparison, ax: Axes) -> Axes:
    """Both time histories, aligned in phase, over the time of the prediction."""
    factor, unit = scale_for(c.unit, c.predicted_history, c.measured_history)
    clock = time_scale()
    ax.plot(*thinned(c.predicted_time * clock.factor, c.predicted_history * factor), label="predicted", **_PREDICTED)
    if c.measured_time.size:
        ax.plot(*thinned(c.measured_time * clock.factor, c.measured_history * factor), label="measured", **_MEASURED)
    finish(ax, f"Time ({clock.unit})", f"{c.quantity.replace('_', ' ').capitalize()} ({unit})")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, fontsize="small")
    return ax


def plot_spectra(c: ChannelComparison, ax: Axes) -> Axes:
    """Both spectra in dB re their own maximum, over frequency divided by excitation frequency."""
    forced = bool(np.isfinite(c.excitation_hz))
    unit = c.excitation_hz if forced else 1.0
    top = 0.0
    for spectrum, style, label in (
        (c.predicted_spectrum, _PREDICTED, "predicted"),
        (c.measured_spectrum, _MEASURED, "measured"),
    ):
        ax.plot(*thinned(spectrum.frequency_hz / unit, spectrum.amplitude_db), label=label, **style)
        top = max(top, float(spectrum.amplitude_db.max()))
    if forced:
        ax.set_xlim(0.0, min(_HIGHEST_ORDER, float(c.predicted_spectrum.frequency_hz[-1]) / unit))
    ax.set_ylim(top - _DEEPEST_DB, top + 6)
    finish(ax, "Frequency / excitation frequency" if forced else "Frequency (Hz)", "Level (dB re max)")
    return ax


def plot_swept(c: SweptComparison, ax: Axes) -> Axes:
    """Response over frequency, with the peaks that are compared."""
    factor, unit = scale_for(c.unit, c.predicted, c.measured)
    ax.plot(c.frequency_hz, np.abs(c.predicted) * factor, label="predicted", **_PREDICTED)
    ax.plot(c.frequency_hz, np.abs(c.measured) * factor, label="measured", **_MEASURED)
    for marker, whose, style in (("o", "predicted", _PREDICTED), ("s", "measured", _MEASURED)):
        at = [(getattr(peak, f"{whose}_hz"), getattr(peak, f"{whose}_level") * factor) for peak in c.peaks]
        ax.plot(*np.array(at).reshape(-1, 2).T, marker, markersize=5, markerfacecolor="none", color=style["color"],
                label=f"{whose} peaks" if at else None)  # fmt: skip
    ax.set_yscale("log")
    detected = {"peak": "peak", "fundamental": "fundamental of", "rms": "rms"}[c.detector]
    response = f"{detected} {c.quantity.replace('_', ' ')}".capitalize()
    finish(ax, f"Excitation frequency (Hz), {c.curve}", f"{response} ({unit})")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, frameon=False, fontsize="small")
    ax.set_title(f"FRAC {c.frac:.3f}", loc="left", fontsize="small", color="0.3")
    return ax


def plot_fdac(assurance: Assurance, ax: Axes) -> Axes:
    """FDAC over both frequencies, with the line of equal frequencies."""
    mesh = ax.pcolormesh(assurance.measured_hz, assurance.predicted_hz, assurance.fdac, cmap="cividis", vmin=0, vmax=1,
                         shading="nearest")  # fmt: skip
    ends = [float(assurance.measured_hz[0]), float(assurance.measured_hz[-1])]
    dashed_line(ax, ends, ends, "equal frequencies")
    if ax.figure is not None:
        ax.figure.colorbar(mesh, ax=ax, label="FDAC")
    finish(ax, "Measured frequency (Hz)", "Predicted frequency (Hz)")
    return ax


def comparison_figures(comparison: Comparison) -> dict[str, Figure]:
    """One figure per channel, named after place and quantity."""
    from matplotlib.figure import Figure

    figures = {}
    for c in comparison.channels:
        figure = Figure(figsize=(8.0, 6.0), layout="constrained")
        put_title(figure, f"{comparison.title}: {c.place}")
        above, below = figure.subplots(2)
        plot_histories(c, above)
        plot_spectra(c, below)
        figures[f"{c.place}_{c.quantity}".replace(" ", "_")] = figure
    for swept in comparison.sweeps:
        figure = Figure(figsize=(8.0, 4.8), layout="constrained")
        put_title(figure, f"{comparison.title}: {swept.place}")
        plot_swept(swept, figure.subplots())
        figures[f"{swept.place}_{swept.quantity}".replace(" ", "_")] = figure
    if comparison.assurance is not None:
        figure = Figure(figsize=(6.4, 5.2), layout="constrained")
        put_title(figure, comparison.title)
        plot_fdac(comparison.assurance, figure.subplots())
        figures["fdac"] = figure
    return figures
