"""Plots of the response to a random or measured input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.result import RandomResponse
from beamsim.plots.style import MOST_CURVES, ROUND_OFF, acceleration_scale, curve_style, finish, legend, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamsim.typing import Bools

MOST_LINEAR = 1  # signals whose linear densities are drawn
DENSITY_SHOWN = 1e-7  # of the largest density, below which nothing is shown
POWER_SHOWN = 1e-3  # of the input's largest density, below which a transmissibility is that of leakage and round-off


def plot_density(response: RandomResponse, ax: Axes) -> Axes:
    """Spectral densities of the input and of the absolute accelerations of the probes (displacements under a force).

    Thick grey lines are those of the linear structures with every snubber always open and always closed.
    """
    on_base = response.input.unit == "m/s^2"
    quantity = "absolute_acceleration" if on_base else "displacement"
    drawn = [response.input, *(s for s in response.signals if s.quantity == quantity)] if on_base else [
        s for s in response.signals if s.quantity == quantity
    ]  # fmt: skip
    scale = acceleration_scale() if on_base else scale_for("m", *(np.sqrt(s.density[1:]) for s in drawn))
    factor = scale.factor**2
    top = max((float(np.max(s.density[1:])) for s in drawn), default=0.0) * factor
    for k, signal in enumerate(drawn[:MOST_CURVES]):
        density = signal.density[1:] * factor
        label = signal.name if np.any(density > DENSITY_SHOWN * top) else f"{signal.name} (over before)"
        ax.plot(response.frequency_hz[1:], density, label=label, **curve_style(k))
    linear = [k for k, s in enumerate(drawn[:MOST_CURVES]) if s.density_open is not None][:MOST_LINEAR]
    for k in linear:
        for name, dashes in (("open", "-"), ("closed", "-.")):
            value = np.asarray(getattr(drawn[k], f"density_{name}"))[1:] * factor
            label = f"{drawn[k].name}, linear, always {name}"
            shown = np.where(value > 0.0, value, np.nan)
            ax.plot(
                response.frequency_hz[1:], shown, color="0.65", linewidth=2.2, linestyle=dashes, zorder=1, label=label
            )
    if top > 0:
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(top * DENSITY_SHOWN, top * 3)
        content = np.max([s.density[1:] for s in drawn], axis=0) * factor >= top * DENSITY_SHOWN
        shown = response.frequency_hz[1:][content]
        ax.set_xlim(shown[0] / 1.1, shown[-1] * 1.1)
    squared = f"({scale.unit})²" if "/" in scale.unit else f"{scale.unit}²"
    finish(ax, "Frequency (Hz)", f"{'Acceleration' if on_base else 'Displacement'} density ({squared}/Hz)")
    legend(ax, min(len(drawn), MOST_CURVES) + 2 * len(linear), len(drawn) + 2 * len(linear), "signals")
    return ax


def has_transmissibility(response: RandomResponse) -> bool:
    """Whether the input has power: a shock may be over before the part of the run that the densities are of."""
    return bool(response.transmissibility) and bool(np.any(_driven(response)))


def _driven(response: RandomResponse) -> Bools:
    """(nf,) where a transmissibility is not one of leakage and round-off."""
    power = response.input.density
    return np.asarray((power > max(POWER_SHOWN * power.max(), ROUND_OFF**2)) & (response.frequency_hz > 0.0))


def plot_transmissibility(response: RandomResponse, ax: Axes) -> Axes:
    """Magnitude of response over input, with gaps where the input has no power; lines are those of the densities."""
    driven = _driven(response)
    first = int(response.input.unit == "m/s^2")  # of the densities is the input's
    for k, (name, value) in enumerate(list(response.transmissibility.items())[: MOST_CURVES - first], first):
        shown = np.where(driven, np.abs(value), np.nan)
        ax.plot(response.frequency_hz[1:], shown[1:], label=name, **curve_style(k))
    ax.set_xscale("log")
    ax.set_yscale("log")
    finish(ax, "Frequency (Hz)", "Transmissibility" if response.input.unit == "m/s^2" else "Displacement / force (m/N)")
    count = len(response.transmissibility)
    legend(ax, min(count, MOST_CURVES - first), count, "probes")
    return ax


def plot_crossings(response: RandomResponse, ax: Axes) -> Axes:
    """Rates at which the signals cross levels upwards, over those of their means, and that of a Gaussian signal."""
    assert response.level is not None
    shown = [s for s in response.signals if s.crossings_hz is not None and s.crossing_rate_hz > 0]
    least, ends = 1.0, [-3.0, 3.0]
    for k, signal in enumerate(shown[:MOST_CURVES]):
        assert signal.crossings_hz is not None
        rate = signal.crossings_hz / signal.crossing_rate_hz
        crossed = rate > 0
        ends += [float(response.level[crossed].min()), float(response.level[crossed].max())]
        least = min(least, float(rate[crossed].min()))
        label = f"{signal.name} {signal.quantity.replace('_', ' ')}"
        ax.plot(response.level[crossed], rate[crossed], label=label, **curve_style(k))
    low, high = min(ends) - 0.25, max(ends) + 0.25
    level = np.linspace(low, high, 201)
    ax.plot(level, np.exp(-0.5 * level**2), color="0.6", linewidth=2.2, zorder=0, label="Gaussian")
    ax.set_yscale("log")
    ax.set_xlim(low, high)
    ax.set_ylim(0.5 * least, 3.0)
    finish(ax, "Level above the mean (standard deviations)", "Upward crossings, those of the mean = 1")
    title = f"{MOST_CURVES} of {len(shown)} signals" if len(shown) > MOST_CURVES else None
    ax.legend(title=title, loc="best", frameon=False, fontsize="small", title_fontsize="small", handlelength=2.6)
    return ax
