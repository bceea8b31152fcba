"""Accelerations and transmissibility of every probe over the frequency of a sweep, and spectra along it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.compare.sweeps import peaks_of
from beamsim.analyses.sweep.result import SweepResult
from beamsim.plots.bounds import draw_limit
from beamsim.plots.style import MOST_CURVES, acceleration_scale, curve_style, dashed_line, finish, legend
from beamsim.plots.sweep_axes import by_frequency, envelope, frequency_axis, name_level
from beamsim.scenario.quantities import amplitude_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEEPEST_DB = 80.0
LINES = 240  # of frequency in a spectrogram, up to twice the highest tracked order
COLUMNS = 300  # of time
WINDOWS = 8  # in a time history at least
FEWEST_SAMPLES = 16  # in a window
RESOLVED = 24  # cycles of the lowest frequency in a window of the spectrogram


def plot_acceleration(result: SweepResult, ax: Axes, level_index: int) -> Axes:
    """Largest magnitude of every probe's absolute acceleration in each cycle."""
    curves = [c for c in result.curves.values() if c.level_index == level_index]
    scale = acceleration_scale()
    drawn = [(c, name) for c in curves for name in c.acceleration]
    for k, (curve, name) in enumerate(drawn[:MOST_CURVES]):
        f, peak = envelope(curve, curve.acceleration[name].peak)
        ax.plot(f, peak * scale.factor, label=f"{name}, {curve.direction}", **curve_style(k))
    draw_limit(ax, result.scenario.limits, "peak_acceleration", scale)
    frequency_axis(result, ax)
    ax.set_yscale("log")
    name_level(result, ax, level_index)
    finish(ax, "Excitation frequency (Hz)", f"Peak absolute acceleration ({scale.unit})")
    legend(ax, min(len(drawn), MOST_CURVES), len(drawn), "curves")
    return ax


def has_transmissibility(result: SweepResult) -> bool:
    """Whether the base moves, and accelerations and the fundamental were kept."""
    return any(
        c.acceleration and np.any(c.orders == 1.0) and amplitude_unit(c.quantity) == "m/s^2"
        for c in result.curves.values()
    )


def plot_transmissibility(result: SweepResult, ax: Axes, level_index: int) -> Axes:
    """Fundamental of every probe's absolute acceleration over that of the base, with Q of its highest peak."""
    curves = [c for c in result.curves.values() if c.level_index == level_index]
    drawn = [(c, name) for c in curves for name in c.acceleration]
    for k, (curve, name) in enumerate(drawn[:MOST_CURVES]):
        first = int(np.flatnonzero(curve.orders == 1.0)[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(curve.acceleration[name].harmonics[first]) / np.abs(curve.excitation_amplitude)
        highest = max(peaks_of(*by_frequency(curve, ratio)), key=lambda peak: peak[1], default=None)
        quality = ""
        if highest is not None and np.isfinite(highest[2]):
            quality = f": Q {highest[2]:.3g} at {highest[0]:.4g} Hz"
        ax.plot(*envelope(curve, ratio), label=f"{name}, {curve.direction}{quality}", **curve_style(k))
    frequency_axis(result, ax)
    ax.set_yscale("log")
    name_level(result, ax, level_index)
    finish(ax, "Excitation frequency (Hz)", "Transmissibility (g per g)")
    legend(ax, min(len(drawn), MOST_CURVES), len(drawn), "curves")
    return ax


def has_spectrogram(result: SweepResult, probe: str, level_index: int) -> bool:
    """Whether a time history is stored that moves and is long enough for some windows."""
    history = result.histories[level_index]
    return history.time.size >= WINDOWS * FEWEST_SAMPLES and bool(np.any(history.displacement[probe]))


def plot_spectrogram(result: SweepResult, ax: Axes, probe: str, level_index: int) -> Axes:
    """Spectrum of the displacement over time, in dB re its largest line; the frequency of the sweep is dashed.

    Hann windows of 24 cycles of the lowest frequency, at most an eighth of the stored time history.
    """
    from scipy.signal import spectrogram

    history = result.histories[level_index]
    curves = [c for c in result.curves.values() if c.level_index == level_index]
    rate = (history.time.size - 1) / float(history.time[-1] - history.time[0])
    lowest, highest = (pick([pick(c.frequency_hz) for c in curves]) for pick in (np.min, np.max))
    length = int(min(history.time.size // WINDOWS, max(RESOLVED * rate / lowest, FEWEST_SAMPLES)))
    step = max(1, (history.time.size - length) // COLUMNS)
    x = history.displacement[probe]
    f, t, power = spectrogram(x, rate, "hann", length, length - step, scaling="spectrum", mode="magnitude")
    top = max(float(np.max(curves[0].orders)), 1.0) * float(highest)
    shown = f <= min(2.0 * top, 0.5 * rate)
    thin = max(1, int(np.count_nonzero(shown) // LINES))
    whole = np.count_nonzero(shown) // thin * thin
    lines = power[shown][:whole].reshape(-1, thin, power.shape[1]).max(axis=1)
    level = 20 * np.log10(np.maximum(lines / lines.max(), 1e-12))
    mesh = ax.pcolormesh(history.time[0] + t, f[shown][:whole:thin], level, cmap="cividis", vmin=-DEEPEST_DB, vmax=0.0,
                         shading="nearest", rasterized=True)  # fmt: skip
    for k, curve in enumerate(curves):
        dashed_line(ax, curve.time, curve.frequency_hz, "" if k else "frequency of the sweep")
    if ax.figure is not None:
        ax.figure.colorbar(mesh, ax=ax, label="Level (dB re largest)")
    finish(ax, "Time (s)", f"Frequency in the displacement of {probe} (Hz)")
    ax.set_xlim(history.time[0] + t[0], history.time[0] + t[-1])
    return ax
