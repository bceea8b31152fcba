"""What the plots of outputs that a scenario asks for share, and their time histories."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamsim.plots.bounds import draw_limit
from beamsim.plots.style import (
    Scale,
    curve_style,
    finish,
    scale_for,
    thinned,
    time_scale,
)
from beamsim.scenario.limits import OF_OUTPUTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamsim.analyses.run.result import RunResult


def output_label(words: str, name: str, scale: Scale) -> str:
    """Label of an axis."""
    return f"{words} {name}".strip() + (f" ({scale.unit})" if scale.unit else "")


def plot_output(result: RunResult, ax: Axes, name: str) -> Axes:
    """Time history of an output."""
    output, clock = result.outputs[name], time_scale()
    time, values = thinned(result.time, output.value)
    scale = scale_for(output.unit, values)
    ax.plot(time * clock.factor, values * scale.factor, **curve_style(0))
    draw_limit(ax, result.scenario.limits, OF_OUTPUTS + name, scale, both_signs=True)
    ax.set_xlim(time[0] * clock.factor, time[-1] * clock.factor)
    finish(ax, f"Time ({clock.unit})", output_label("", name, scale))
    return ax
