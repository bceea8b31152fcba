"""Pictures of static equilibria: the deflected bodies with the stops that they rest on."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from beamsim.analyses.statics.result import StaticResult
from beamsim.plots.bodies import deflection_scale, plot_contours, stop_mark
from beamsim.plots.drawing import DARK, Chart, Curve, Guide, Picture
from beamsim.plots.sketch import HEIGHT, Sketch, scale_bar
from beamsim.plots.style import amount, round_length, scale_for
from beamsim.structures.assembly import snubber_site
from beamsim.structures.places import Place, Stations
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Floats


def stops_at_rest(result: StaticResult) -> dict[str, SnubberNumbers]:
    """By name the numbers of the snubbers that a picture needs."""
    turning = result.summary.get("gap_rad", {})
    return {
        row["snubber"]: SnubberNumbers(
            name=row["snubber"], position=row["snubber_position"], side=row["side"], gap=row["gap"],
            preload=row["force"], stiffness=math.nan, dashpot=math.nan, blocked_force=math.nan,
            stiffness_ratio=math.nan, gap_unit="rad" if row["snubber"] in turning else "m",
        )
        for row in result["equilibrium"].rows("snubber")
    }  # fmt: skip


def static_figures(result: StaticResult) -> dict[str, Picture]:
    """The deflection of every body with the stops, by the last part of the file name."""
    stations = Stations.of_modes(result["modes"])
    deflection = result["equilibrium"]["deflection"].values if "deflection" in result["equilibrium"] else np.zeros(0)
    figures: dict[str, Picture] = {}
    beams = []
    for part in stations.bodies:
        y = None if stations.position_y is None else stations.position_y[part.stations]
        if y is not None and np.isfinite(y).all():
            drawn = partial(_plot_plate, result, part.body, stations.position[part.stations], y,
                            deflection[part.stations])  # fmt: skip
            figures[f"deflection_{part.body}"] = Picture(result.title, [drawn], legend_below=True)
        elif part.axis.continuous:
            x = stations.position[part.stations]
            beams.append(_deflected_beam(result, part.body, x, deflection[part.stations]))
    if beams:
        figures["deflection"] = Picture(result.title, beams)
    if "deflection_in_space" in result["equilibrium"] and (in_space := _in_space(result, stations)):
        return figures | in_space
    if len(stations.bodies) > 1 or not figures:
        sketch = Sketch(result.scenario, stations, stops_at_rest(result))
        size = (8.0, 1.6 + 1.4 * sketch.count)
        drawn = partial(_plot_assembly, result, sketch, deflection)
        figures["equilibrium"] = Picture(result.title, [drawn], size=size, legend_below=True)
    return figures


def _in_space(result: StaticResult, stations: Stations) -> dict[str, Picture]:
    """The deflection in space; empty if a body has no coordinates."""
    from beamsim.plots.space import SpaceView, deflected_picture

    view, equilibrium = SpaceView.of(result.scenario, stations, stops_at_rest(result)), result["equilibrium"]
    if view is None:
        return {}
    touching = [row["snubber"] for row in equilibrium.rows("snubber") if row["touches"]]
    words = result.title, "static equilibrium"
    return {"equilibrium": deflected_picture(view, equilibrium["deflection_in_space"].values, touching, words)}


def _on_body(result: StaticResult, body: str) -> list[SnubberNumbers]:
    """The stops at a body that stand on the base or the ground, without those of hinges."""
    sites = {located.item.name: snubber_site(located) for located in result.scenario.located_snubbers}
    stops = [stop for stop in stops_at_rest(result).values() if stop.gap_unit == "m"]
    return [stop for stop in stops if isinstance(site := sites[stop.name], Place) and site.body == body]


def _deflected_beam(result: StaticResult, name: str, x: Floats, deflection: Floats) -> Chart:
    """Deflection of a beam over its length, with faces of stops and deflected probes."""
    marks: list[Curve] = []
    for stop in _on_body(result, name):
        marks.append(stop_mark(stop, float(np.interp(stop.position, x, deflection)), 0.0, "", marks))
    scale = deflection_scale(deflection, marks)
    rest = Guide("", 0.0, {"color": "0.6", "linewidth": 0.7, "zorder": 1})
    of = name if len(result["modes"].labels("body")) > 1 else "the beam"
    curve = Curve("static equilibrium", x, deflection, {"color": DARK})
    return Chart((f"Position along {of}", "m"), ("Deflection", scale), [curve], [rest], marks=marks)


def _plot_plate(result: StaticResult, name: str, x: Floats, y: Floats, deflection: Floats, ax: Axes) -> None:
    """Contours of the deflection of a plate, with the stops on it."""
    scale, metres = scale_for("m", deflection), scale_for("m", x, y)
    plot_contours(ax, x, y, deflection * scale.factor, "static equilibrium", scale.unit)
    equilibrium = result["equilibrium"]
    touches, of_y = equilibrium.by_label("touches"), equilibrium.by_label("snubber_position_y")
    for stop in _on_body(result, name):
        shut = bool(touches[stop.name].item())
        ax.plot(
            stop.position * metres.factor, of_y[stop.name].item() * metres.factor, linestyle="none", color="black",
            marker=6 if stop.side == "below" else 7, markersize=9, clip_on=False,
            markerfacecolor="black" if shut else "white", label=f"stop, {'touches' if shut else 'open'}",
        )  # fmt: skip


def _plot_assembly(result: StaticResult, sketch: Sketch, deflection: Floats, ax: Axes) -> None:
    """All bodies deflected, with supports, masses and stops; gaps have the scale of the deflections."""
    equilibrium = result["equilibrium"]
    openings = {name: float(gap.item()) for name, gap in equilibrium.by_label("gap_left").items()}
    known = {name: gap for name, gap in openings.items() if sketch.stops[name].gap_unit == "m"}
    largest = max([float(np.abs(deflection).max(initial=0.0)), *(x for x in known.values() if math.isfinite(x))])
    factor = HEIGHT / largest if largest else 0.0
    sketch.draw(ax, deflection * factor, factor, openings=openings)
    ax.set_title("static equilibrium", fontsize="medium", loc="left")
    if largest:
        bar = round_length(largest)
        scale_bar(ax, ax.get_xlim()[1], bar * factor, amount(bar, "m"))
