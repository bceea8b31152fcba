"""What the plots of outputs that a scenario asks for share, and their time histories."""

from __future__ import annotations

from typing import TYPE_CHECKING

from beamsim.fields import rows_of
from beamsim.plots.style import (
    Scale,
    acceleration_scale,
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
    from beamsim.scenario.limits import Limits
    from beamsim.typing import Floats

_LIMIT = "0.35"


def output_scale(unit: str, *values: Floats) -> Scale:
    """Accelerations in g, numbers without a unit as they are, everything else with a prefix."""
    if unit == "m/s^2":
        return acceleration_scale()
    return Scale(1.0, "") if unit in ("", "1") else scale_for(unit, *values)


def output_label(words: str, name: str, scale: Scale) -> str:
    """Label of an axis."""
    return f"{words} {name}".strip() + (f" ({scale.unit})" if scale.unit else "")


def draw_limit(ax: Axes, limits: Limits | None, name: str, scale: Scale) -> None:
    """A line at the limit on an output, where there is one."""
    limit = None if limits is None else limits.given.get(OF_OUTPUTS + name)
    if limit is not None:
        ax.axhline(limit * scale.factor, color=_LIMIT, linestyle=":", linewidth=1.6, label="limit")


def plot_output(result: RunResult, ax: Axes, name: str) -> Axes:
    """Time history of an output."""
    output, clock = result.outputs[name], time_scale()
    time, values = thinned(rows_of(result, "time"), rows_of(output, "value"))
    scale = output_scale(output.unit, values)
    ax.plot(time * clock.factor, values * scale.factor, **curve_style(0))
    finish(ax, f"Time ({clock.unit})", output_label("", name, scale))
    return ax
