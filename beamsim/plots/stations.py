"""Shapes along the bodies of a structure: lines along a beam or two edges of a plate, dots at masses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from matplotlib.axes import Axes

from beamsim.plots.drawing import curve_style, finish, legend, with_unit
from beamsim.plots.style import scale_for
from beamsim.structures.places import ON_PLATE, BodyStations, Stations
from beamsim.typing import Floats


def draw_along(ax: Axes, stations: Stations, label: str, shapes: Sequence[tuple[str, Floats, dict[str, Any]]]) -> None:
    """Shapes over the stations of all bodies, with labelled axes; of several bodies the name is at the end of each.

    Parameters
    ----------
    shapes : label, (nx,) deflection in m, and style of each.
    """
    scale = scale_for("m", *(shape for _, shape, _ in shapes))
    for k, (label, shape, style) in enumerate(shapes):
        drawn = {**curve_style(k), "markersize": 4, **style}
        for part in stations.bodies:
            for name, x, y in _lines(stations, part, shape * scale.factor):
                ax.plot(x, y, label=label, **({"marker": "" if part.axis.continuous else "o"} | drawn))
                ax.annotate(name, (x[-1], y[-1]), fontsize="x-small", color="0.4")
                label = "_nolegend_"
    names = []
    for part in stations.bodies:
        x = stations.position[part.stations]
        unit = f" ({scale_for(part.axis.unit, x).unit})" if part.axis.continuous else ""
        names.append(part.axis.label + unit)
        if not part.axis.continuous and len(stations.bodies) == 1:  # masses have whole numbers
            ax.set_xticks(x[:: -(-x.size // 20)])  # at most 20
    finish(ax, " / ".join(dict.fromkeys(names)), with_unit(label, scale))
    legend(ax)


def _lines(stations: Stations, part: BodyStations, shape: Floats) -> Iterator[tuple[str, Floats, Floats]]:
    """A beam or a row of masses as one line, the bottom and the top edge of a plate as two, with their names."""
    x, y = stations.position[part.stations], shape[part.stations]
    if part.axis.continuous or part.axis is ON_PLATE:
        x = x * scale_for(part.axis.unit, x).factor
    several = len(stations.bodies) > 1
    if part.axis is not ON_PLATE:
        yield part.body if several else "", x, y
        return
    assert stations.position_y is not None
    y_of_stations = stations.position_y[part.stations]
    for edge, at in (("bottom", y_of_stations.min()), ("top", y_of_stations.max())):
        yield f"{part.body} {edge}" if several else edge, x[y_of_stations == at], y[y_of_stations == at]
