"""Shapes along the bodies of a structure: lines along a continuous axis, dots at masses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from beamsim.plots.style import finish, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamsim.structures.stations import Stations
    from beamsim.typing import Floats


def plot_along(ax: Axes, stations: Stations, shape: Floats, label: str, **style: Any) -> None:
    """One shape (nx,) over the stations; of several bodies a curve each, with the body's name at its end."""
    several = len(stations.parts) > 1
    for part in stations:
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


def finish_along(ax: Axes, stations: Stations, ylabel: str) -> None:
    """Label the axes; masses have whole numbers."""
    names = []
    for part in stations:
        x = stations.position[part.stations]
        unit = f" ({scale_for(part.axis.unit, x).unit})" if part.axis.continuous else ""
        names.append(part.axis.label + unit)
        if not part.axis.continuous and len(stations.parts) == 1:
            ax.set_xticks(x)
    finish(ax, " / ".join(dict.fromkeys(names)), ylabel)
