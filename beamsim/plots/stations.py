"""Shapes along the bodies of a structure: lines along a beam or two edges of a plate, dots at masses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from beamsim.plots.style import finish, scale_for
from beamsim.structures.stations import IN_PLANE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamsim.structures.stations import StationPart, Stations
    from beamsim.typing import Floats


MOST_TICKS = 20  # of numbered masses or nodes


def plot_along(ax: Axes, stations: Stations, shape: Floats, label: str, **style: Any) -> None:
    """One shape (nx,) over the stations; of several bodies a curve each, with the body's name at its end."""
    several = len(stations.parts) > 1
    for part in stations:
        if part.axis is IN_PLANE:
            _plot_edges(ax, stations, part, shape, label, **style)
            label = "_nolegend_"
            continue
        x = stations.position[part.stations]
        if part.axis.continuous:
            x = x * scale_for(part.axis.unit, x).factor
        marker = "" if part.axis.continuous else "o"
        y = shape[part.stations]
        drawn: dict[str, Any] = {"marker": marker, "markersize": 4, **style}
        ax.plot(x, y, label=label, **drawn)
        if several:
            ax.annotate(part.body, (x[-1], y[-1]), fontsize="x-small", color="0.4")
        label = "_nolegend_"


def _plot_edges(ax: Axes, stations: Stations, part: StationPart, shape: Floats, label: str, **style: Any) -> None:
    """A shape along the bottom and the top edge of a plate."""
    assert stations.across is not None
    x, y, deflection = (values[part.stations] for values in (stations.position, stations.across, shape))
    factor = scale_for(part.axis.unit, x).factor
    for edge, at in (("bottom", y.min()), ("top", y.max())):
        on_edge = y == at
        ax.plot(x[on_edge] * factor, deflection[on_edge], label=label, **style)
        ends = f"{part.body} {edge}" if len(stations.parts) > 1 else edge
        ax.annotate(ends, (x[on_edge][-1] * factor, deflection[on_edge][-1]), fontsize="x-small", color="0.4")
        label = "_nolegend_"


def finish_along(ax: Axes, stations: Stations, ylabel: str) -> None:
    """Label the axes; masses have whole numbers."""
    names = []
    for part in stations:
        x = stations.position[part.stations]
        unit = f" ({scale_for(part.axis.unit, x).unit})" if part.axis.continuous else ""
        names.append(part.axis.label + unit)
        if not part.axis.continuous and len(stations.parts) == 1:
            ax.set_xticks(x[:: -(-x.size // MOST_TICKS)])
    finish(ax, " / ".join(dict.fromkeys(names)), ylabel)
