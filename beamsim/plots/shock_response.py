"""Plot of shock response spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from beamsim.analyses.run.result import ShockResponse
from beamsim.plots.style import MOST_CURVES, acceleration_scale, curve_style, finish, legend, where_other

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_shock_response(response: ShockResponse, ax: Axes) -> Axes:
    """Maximax spectra of the input and of the probes; thin, the residual of the input where it is another.

    The residual is what the input leaves after its end; that of a sawtooth is nearly its maximax spectrum.
    """
    drawn, scale = response.signals[:MOST_CURVES], acceleration_scale()
    for k, signal in enumerate(drawn):
        style = curve_style(k)
        ax.plot(response.frequency_hz, signal.maximax * scale.factor, label=signal.name, **style)
        if signal.name == "input":
            thin = {**style, "linewidth": 0.5 * style["linewidth"]}
            residual = where_other(signal.maximax, signal.residual)
            known = np.isfinite(residual)
            same = "" if known.all() else " (where it is lower)" if known.any() else " (the same)"
            ax.plot(response.frequency_hz, residual * scale.factor, label=f"input, residual{same}", **thin)
    ax.set_xscale("log")
    ax.set_yscale("log")
    top = max((float(s.maximax.max()) for s in drawn), default=0.0) * scale.factor
    if top > 0:
        bottom = min(float(s.maximax.min()) for s in drawn) * scale.factor
        ax.set_ylim(max(0.5 * bottom, 1e-6 * top), 2.0 * top)
    ax.set_xlim(response.frequency_hz[0], response.frequency_hz[-1])
    finish(
        ax, "Natural frequency of the oscillator (Hz)", f"Peak acceleration ({scale.unit}), Q = {response.quality:g}"
    )
    curves = len(drawn) + any(s.name == "input" for s in drawn)
    legend(ax, curves, len(response.signals) + curves - len(drawn), "signals")
    return ax
