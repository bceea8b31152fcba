"""Predicted (solid) and measured (dashed) histories and spectra, as in H. Hazim's thesis (2010), figures 1.5 to 1.8."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from beamsim.analyses.compare.result import (
    Assurance,
    ChannelComparison,
    Comparison,
    RecordComparison,
    RecordPair,
    SweptComparison,
)
from beamsim.analyses.compare_modes.analysis import ModeComparison
from beamsim.measurements.signal import split_heading
from beamsim.plots.drawing import (
    DARK,
    HERTZ,
    RED,
    Chart,
    Curve,
    HeatMap,
    Picture,
    dashed_line,
    finish,
    marks_curve,
)
from beamsim.plots.style import Scale, plain_scale
from beamsim.typing import Floats

HIGHEST_ORDER, DEEPEST_DB = 12.5, 100.0  # of spectra
_PREDICTED: dict[str, Any] = {"color": DARK, "linestyle": "-", "linewidth": 1.2}
_MEASURED: dict[str, Any] = {"color": RED, "linestyle": (0, (4, 2)), "linewidth": 1.2}


def _curve_pair(predicted: tuple[Floats, Floats], measured: tuple[Floats, Floats]) -> list[Curve]:
    """The curves of both; that of a measurement that has no values is left out."""
    measured_too = [Curve("measured", *measured, _MEASURED)] if measured[0].size else []
    return [Curve("predicted", *predicted, _PREDICTED), *measured_too]


def histories(c: ChannelComparison) -> Chart:
    """Both time histories, aligned in phase, over the time of the prediction."""
    curves = _curve_pair((c.predicted_time, c.predicted_history), (c.measured_time, c.measured_history))
    return Chart(("Time", plain_scale("s")), (c.quantity.replace("_", " ").capitalize(), c.unit), curves)


def spectra(c: ChannelComparison) -> Chart:
    """Both spectra in dB re their own maximum, over frequency divided by excitation frequency."""
    forced = bool(np.isfinite(c.excitation_hz))
    unit = c.excitation_hz if forced else 1.0
    drawn = c.predicted_spectrum, c.measured_spectrum
    curves = _curve_pair(*((s.frequency_hz / unit, s.amplitude_db) for s in drawn))
    x_axis = ("Frequency / excitation frequency", "") if forced else ("Frequency", HERTZ)
    last = min(HIGHEST_ORDER, float(c.predicted_spectrum.frequency_hz[-1]) / unit)
    top = max(0.0, *(float(s.amplitude_db.max()) for s in drawn))
    x_ends = (0.0, last) if forced else (None, None)
    return Chart(x_axis, ("Level (dB re max)", ""), curves, x_ends=x_ends, y_ends=(top - DEEPEST_DB, top + 6))


def response_spectra(c: ChannelComparison, record: RecordComparison) -> Chart:
    """Response spectra of both records."""
    curves = _curve_pair(
        (record.frequency_hz, record.predicted_response), (record.frequency_hz, record.measured_response)
    )
    x_axis, y_axis = (
        ("Natural frequency of the oscillator", HERTZ),
        (f"Response spectrum, Q = {record.quality:g}", c.unit),
    )
    return Chart(x_axis, y_axis, curves, log="xy")


def swept_responses(c: SweptComparison) -> Chart:
    """Response over frequency, with the peaks that are compared."""
    curves = _curve_pair((c.frequency_hz, np.abs(c.predicted)), (c.frequency_hz, np.abs(c.measured)))
    for marker, whose, style in (("o", "predicted", _PREDICTED), ("s", "measured", _MEASURED)):
        at = [(getattr(peak, f"{whose}_hz"), getattr(peak, f"{whose}_level")) for peak in c.peaks]
        if at:
            colour = style["color"]
            curves.append(marks_curve(f"{whose} peaks", at, color=colour, marker=marker, markerfacecolor="none"))
    detected = {"peak": "peak", "fundamental": "fundamental of", "rms": "rms"}[c.detector]
    response = f"{detected} {c.quantity.replace('_', ' ')}".capitalize()
    return Chart((f"{c.curve}, FRAC {c.frac:.3f}, excitation frequency", HERTZ), (response, c.unit), curves, log="y")


def resonance_shifts(pair: RecordPair) -> Chart:
    """Responses of two tests over frequency, with their resonances and the changes of their frequencies."""
    curves = [
        Curve("before", *pair.before, {"color": DARK, "linestyle": "-", "linewidth": 1.0}),
        Curve("after", *pair.after, {"color": RED, "linestyle": "-", "linewidth": 1.0}),
    ]
    marks = []
    for side, colour, marker in (("before", DARK, "o"), ("after", RED, "s")):
        at = [(getattr(each, f"{side}_hz"), getattr(each, f"{side}_level")) for each in pair.resonances]
        known = [place for place in at if place[0] == place[0]]
        if known:
            marks.append(marks_curve(f"peaks {side}", known, color=colour, marker=marker, markerfacecolor="none"))
    highest = max(float(np.max(y)) for _, y in (pair.before, pair.after))
    return Chart(
        ("Frequency", HERTZ), ("Amplitude", pair.unit), curves, log="y", marks=marks, y_ends=(None, 4.0 * highest),
        draw_extra=partial(_write_shifts, pair),
    )  # fmt: skip


def _write_shifts(pair: RecordPair, ax: Axes, x_scale: Scale, y_scale: Scale) -> None:
    """Write the change of every frequency above its peaks."""
    for each in pair.resonances:
        level = np.nanmax([each.before_level, each.after_level])
        f = np.nanmean([each.before_hz, each.after_hz])
        text = f"{100 * each.frequency.change:+.2g} %"
        if not each.is_paired:
            text = "appeared" if np.isnan(each.before_hz) else "vanished"
        elif not each.frequency.significant:
            text = f"({text})"
        place = (f * x_scale.factor, level * y_scale.factor)
        ax.annotate(text, place, (0, 9), textcoords="offset points", ha="center", fontsize="small")


def plot_fdac(assurance: Assurance, ax: Axes) -> None:
    """FDAC over both frequencies, with the line of equal frequencies."""
    mesh = ax.pcolormesh(assurance.measured_hz, assurance.predicted_hz, assurance.fdac, cmap="cividis", vmin=0, vmax=1,
                         shading="nearest")  # fmt: skip
    ends = [float(assurance.measured_hz[0]), float(assurance.measured_hz[-1])]
    dashed_line(ax, ends, ends, "equal frequencies")
    ax.figure.colorbar(mesh, ax=ax, label="FDAC")
    finish(ax, "Measured frequency (Hz)", "Predicted frequency (Hz)")


def comparison_figures(comparison: Comparison) -> dict[str, Picture]:
    """One picture for each channel, named after place and quantity, and the FDAC."""
    figures = {}
    for c in comparison.channels:
        panels = [histories(c), spectra(c), *([] if c.record is None else [response_spectra(c, c.record)])]
        figures[f"{c.place}_{c.quantity}"] = Picture(f"{comparison.title}: {c.place}", panels)
    for swept in comparison.sweeps:
        title = f"{comparison.title}: {swept.place}"
        figures[f"{swept.place}_{swept.quantity}"] = Picture(title, [swept_responses(swept)])
    for pair in comparison.pairs:
        name = split_heading(pair.channel)[0]
        picture = Picture(f"{comparison.title}: {name}", [resonance_shifts(pair)], size=(8.0, 4.8))
        figures[f"{name}_shifts"] = picture
    if (found := comparison.assurance) is not None:
        axes = ("Measured frequency", HERTZ), ("Predicted frequency", HERTZ), ("FDAC", "")
        panel = HeatMap(*axes, found.measured_hz, found.predicted_hz, found.fdac, partial(plot_fdac, found))
        figures["fdac"] = Picture(comparison.title, [panel], size=(6.4, 5.2))
    return figures


def plot_mac(result: ModeComparison, ax: Axes) -> None:
    """MAC by measured (down) and computed modes (across) with their frequencies; pairs are framed."""
    modes = result["compared_modes"]
    mac = modes["mac"].values
    drawn = ax.imshow(mac, vmin=0.0, vmax=1.0, cmap="Greys", aspect="auto")
    rows, columns = mac.shape
    for i, j in np.ndindex(rows, columns) if rows * columns <= 150 else ():
        value = float(mac[i, j])
        colour = "white" if value > 0.55 else "0.2"
        ax.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize="small", color=colour)
    for i, j in enumerate(modes["paired"].values):
        if j > 0:
            frame = Rectangle((j - 1.5, i - 0.5), 1, 1, edgecolor=RED, facecolor="none", linewidth=1.8, clip_on=False)
            ax.add_patch(frame).set_zorder(3)
    ax.set_xticks(
        range(columns), [f"{k + 1}\n{f:.4g}" for k, f in enumerate(modes["predicted_hz"].values)], fontsize="small"
    )
    ax.set_yticks(
        range(rows), [f"{k + 1}   {f:.4g}" for k, f in enumerate(modes["measured_hz"].values)], fontsize="small"
    )
    ax.set_xlabel(f"Computed mode, contacts {modes['contacts'].item()} (Hz)")
    ax.set_ylabel("Measured mode (Hz)")
    ax.figure.colorbar(drawn, ax=ax, label="MAC")


def mode_comparison_figures(result: ModeComparison) -> dict[str, Picture]:
    """The matrix alone, as ``mac``."""
    mac = result["compared_modes"]["mac"].values
    rows, columns = mac.shape
    size = (min(2.6 + 0.62 * columns, 14.0), min(1.8 + 0.5 * rows, 10.0))
    measured, computed = (np.arange(1.0, 1 + count) for count in mac.shape)
    axes = ("Computed mode", ""), ("Measured mode", ""), ("MAC", "")
    panel = HeatMap(*axes, computed, measured, mac, partial(plot_mac, result))
    return {"mac": Picture(result.title, [panel], size=size)}
