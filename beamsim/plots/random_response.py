"""Plots of the response to a random or measured input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.result import RandomResponse
from beamsim.plots.style import MOST_CURVES, curve_style, finish, legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STANDARD_GRAVITY = 9.80665  # m/s^2
POWER_SHOWN = 1e-3  # of the input's largest density, below which a transmissibility is that of leakage and round-off


def plot_density(response: RandomResponse, ax: Axes) -> Axes:
    """Spectral densities of the input and of the absolute accelerations of the probes (displacements under a force)."""
    on_base = response.input.unit == "m/s^2"
    quantity = "absolute_acceleration" if on_base else "displacement"
    drawn = [response.input, *(s for s in response.signals if s.quantity == quantity)] if on_base else [
        s for s in response.signals if s.quantity == quantity
    ]  # fmt: skip
    factor = STANDARD_GRAVITY**-2 if on_base else 1.0
    for k, signal in enumerate(drawn[:MOST_CURVES]):
        ax.plot(response.frequency_hz[1:], signal.density[1:] * factor, label=signal.name, **curve_style(k))
    ax.set_xscale("log")
    ax.set_yscale("log")
    top = max((float(np.max(s.density[1:])) for s in drawn), default=0.0) * factor
    if top > 0:
        ax.set_ylim(top * 1e-8, top * 3)
    finish(ax, "Frequency (Hz)", "Acceleration density (g²/Hz)" if on_base else "Displacement density (m²/Hz)")
    legend(ax, min(len(drawn), MOST_CURVES), len(drawn), "signals")
    return ax


def plot_transmissibility(response: RandomResponse, ax: Axes) -> Axes:
    """Magnitude of response over input, shown where the input has power."""
    power = response.input.density
    shown = (power > POWER_SHOWN * power.max()) & (response.frequency_hz > 0.0)
    for k, (name, value) in enumerate(list(response.transmissibility.items())[:MOST_CURVES]):
        ax.plot(response.frequency_hz[shown], np.abs(value[shown]), label=name, **curve_style(k))
    ax.set_xscale("log")
    ax.set_yscale("log")
    finish(ax, "Frequency (Hz)", "Transmissibility" if response.input.unit == "m/s^2" else "Displacement / force (m/N)")
    count = len(response.transmissibility)
    legend(ax, min(count, MOST_CURVES), count, "probes")
    return ax
