"""The model at rest, seen from the side: bodies, supports, masses, springs and stops with their sides and gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from beamsim.plots.drawing import GREEN, Picture
from beamsim.plots.sketch import BODY, Sketch, scale_bar
from beamsim.plots.space import SpaceView
from beamsim.plots.style import amount, round_length
from beamsim.plots.understood import excitation_text, level_or_kind, stop_text
from beamsim.scenario.body import SupportMounting
from beamsim.scenario.rings import RING, RingPart
from beamsim.structures.assembly import load_site_in, site_in, snubber_site
from beamsim.structures.places import SLOPE, LoadedRegion, LoadSite, Place, ends_of
from beamsim.system.reduced_model import ActingLoads

MOST_NAMES = 14  # of stops, masses, springs and probes together; more are not readable
DEEPEST = 0.07  # of a body, over the distance of rows
Named = tuple[str, tuple[float, float]]  # what is drawn, and where


def plot_model(sketch: Sketch, ax: Axes) -> None:
    """Draw the model at rest: lengths to scale, gaps and depths to a scale of their own."""
    stops = sketch.stops
    gaps = [stop.gap for stop in stops.values() if np.isfinite(stop.gap) and stop.gap_unit == "m"]
    largest = max(gaps, default=0.0)
    factor = 0.16 / largest if largest > 0.0 else 1.0
    places = sketch.draw(ax, sketch.rest, factor, 0.5 * DEEPEST)
    _depths(sketch, ax)
    names: list[Named] = [
        *((f"mass {amount(mass, 'kg')}", at) for mass, at in sketch.masses()),
        *_springs(sketch, ax),
        *((f"{stop_text(name, stops[name])}{_mounting(sketch, name)}", at) for name, at in places.items()),
        *_forces(sketch, ax, places),
        *_probes(sketch, ax),
    ]
    if largest > 0.0:
        bar, right = round_length(largest), ax.dataLim.x1  # beyond the springs to walls, too
        scale_bar(ax, float(right) + 0.1 * sketch.span, bar * factor, f"gaps:\n{amount(bar, 'm')}")
    ax.set_xmargin(0.07)
    if len(names) <= MOST_NAMES:
        _number(ax, names, 0.06 * sketch.span)
    ax.set_title(excitation_text(sketch.scenario), fontsize="medium", loc="left", wrap=True)


def _number(ax: Axes, names: Sequence[Named], margin: float, row_height: float = 1.0) -> None:
    """A number at every named place, whose meaning the legend lists; places that coincide have one label.

    Parameters
    ----------
    margin : distance (m in the sketch) within which something to the right of a place has its number to the left.
    row_height : distance of rows.
    """
    numbers: dict[tuple[float, float], list[str]] = {}
    for k, (text, (x, y)) in enumerate(names, 1):
        numbers.setdefault(
            (float(f"{x:.3g}"), row_height * round(y / row_height, 1 if row_height == 1.0 else 2)), []
        ).append(str(k))
        ax.plot([], [], linestyle="none", label=f"{k}  {text}")
    for (x, y), those in numbers.items():
        x_offset = -20 if any(0.0 < other - x < margin for other, _ in numbers) else 12
        y_offset = 9 if row_height != 1.0 or y - round(y) > -0.01 else -9
        ax.annotate(
            ", ".join(those), (x, y), xytext=(x_offset, y_offset), textcoords="offset points",
            va="center", fontsize="small", color="0.25", zorder=9, annotation_clip=False,
            bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "0.6", "linewidth": 0.6},
        )  # fmt: skip


def model_figure(sketch: Sketch) -> Picture:
    """The sketch with its title, what excites the model, and the scale of the gaps."""
    if (
        sketch.stations.points is not None
        and (view := SpaceView.of(sketch.scenario, sketch.stations, sketch.stops)) is not None
    ):
        width, height = view.figure_size
        return Picture(sketch.scenario.title, [partial(_plot_in_space, view)], size=(width, height + 1.2),
                       legend_below=True)  # fmt: skip
    size = (8.0, 2.4 + 1.6 * sketch.count)
    return Picture(sketch.scenario.title, [partial(plot_model, sketch)], size=size, legend_below=True)


def _plot_in_space(view: Any, ax: Axes) -> None:
    """Draw the model at rest in space, with numbers at what the legend lists."""
    view.draw(ax)
    names = list(view.named_places(ax, view.draw_stops(ax)))
    if len(names) <= MOST_NAMES:
        _number(ax, names, 0.06 * view.size, view.size)
    ax.set_title(excitation_text(view.scenario), fontsize="medium", loc="left", wrap=True)


def _depths(sketch: Sketch, ax: Axes) -> None:
    """Outlines of beams."""
    bodies = sketch.scenario.all_bodies
    deepest = max((depth for body in bodies.values() for _, _, depth in body.depths), default=0.0)
    for name, body in bodies.items():
        for start, end, depth in body.depths if not sketch.width(name) else ():
            (left, row), (right, _) = (sketch.point(Place(name, x)) for x in (start, end))
            half = 0.5 * DEEPEST * depth / deepest
            ax.add_patch(
                Rectangle((left, row - half), right - left, 2 * half, facecolor="#d7e3ec", edgecolor=BODY,
                          linewidth=1.0, zorder=3)
            )  # fmt: skip


def _springs(sketch: Sketch, ax: Axes) -> Iterator[Named]:
    """Springs of joints, of a chain, between points and to the ground."""
    scenario = sketch.scenario
    for joint in scenario.joints:
        turning = getattr(joint, "rotational_stiffness", 0.0)
        spring = f", {amount(turning, 'N m/rad')}" if turning else ""
        yield f"{joint.name} ({joint.kind} joint{spring})", sketch.point(ends_of(site_in(scenario, joint))[0])
    for name, body in scenario.all_bodies.items():
        for x, spring in body.elastic_supports:
            given = (spring.stiffness, "N/m"), (spring.rotational_stiffness, "N m/rad")
            if text := " and ".join(amount(value, unit) for value, unit in given if value):
                yield f"support on {text}", sketch.point(Place(name, x))
        step = sketch.span / max(sketch.lines_of(name)[0].x.size - 1, 1)
        for first, second in body.spring_links:
            (x, y), *others = (sketch.point(Place(name, at)) for at in (first, second) if at is not None)
            beyond = x + 0.6 * step * (-1.0 if first is None else 1.0), y
            _spring(sketch, ax, (x, y), others, beyond)
    springs = [
        (located.item, snubber_site(located))
        for located in scenario.nonlinear_springs
        if not (isinstance(located.item, RingPart) and located.item.sides_before + located.item.number)
    ]
    springs += [
        (spring, site_in(scenario, spring))
        for spring in (*scenario.springs_to_ground, *scenario.springs_between)
        if spring.kind == "linear" and not spring.maxwell
    ]
    for spring, site in springs:
        (x, y), *others = (sketch.point(place) for place in ends_of(site))
        within = ends_of(site)[0].direction == SLOPE  # a hinge
        middle = (x, y) if within else _spring(sketch, ax, (x, y), others, (x, y - 0.25))
        kind = spring.kind.replace("_", " ") + " spring" * (spring.kind not in ("friction", RING))
        yield f"{spring.name} ({kind})", middle


def _mounting(sketch: Sketch, name: str) -> str:
    """What a stop stands on, where it is not the base."""
    on = getattr(sketch.scenario.located_snubber(name).item, "mounted_on", "base")
    if isinstance(on, SupportMounting):
        return f", on support {on.support}{f' of {on.body}' if on.body else ''}"
    return ", on the ground" if on == "ground" else ""


def _forces(sketch: Sketch, ax: Axes, stops: Mapping[str, tuple[float, float]]) -> Iterator[Named]:
    """Arrows where the base, supports and stops (by name where these are) move, and where forces act."""
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": GREEN, "linewidth": 1.8}
    if any(part.on_base for _, part in sketch.scenario.excitation.items):
        ax.annotate("", (0.03, 0.04), xytext=(0.03, 0.2), xycoords="axes fraction",
                    arrowprops={**arrow, "arrowstyle": "<|-|>"})  # fmt: skip
        ax.annotate("base", (0.045, 0.12), xycoords="axes fraction", va="center", color=GREEN, fontsize="small")
    acting = ActingLoads.of(sketch.scenario)
    for _, part in acting.forces:
        for place in _loaded(load_site_in(sketch.scenario, part.applied_to), sketch):
            x, y = sketch.point(place)
            ax.annotate("", (x, y + 0.04), xytext=(x, y + 0.34), arrowprops=arrow)
        yield level_or_kind(part), (x, y + 0.34)
    moved = [(part, at) for _, part in acting.supports for at in _places_moved(sketch, part.applied_to)]
    moved += [(part, at) for _, part in acting.stops for name, at in stops.items() if part.moves_stop(name)]
    with_support = [
        (None, at) for name, at in stops.items() if any(_carries(sketch, part, name) for _, part in acting.supports)
    ]
    drawn: list[tuple[Any, tuple[float, float]]] = [*moved, *with_support]
    for part, (x, y) in drawn:
        ax.annotate("", (x, y - 0.08), xytext=(x, y - 0.3), arrowprops={**arrow, "arrowstyle": "<|-|>"})
        if part is not None:
            yield f"{part.applied_to.label}: {level_or_kind(part)}", (x, y - 0.3)


def _carries(sketch: Sketch, excitation: Any, name: str) -> bool:
    """Whether a stop is mounted on a moving support."""
    on, default = getattr(sketch.scenario.located_snubber(name).item, "mounted_on", None), sketch.scenario.default_body
    support = excitation.applied_to
    if not isinstance(on, SupportMounting) or support.joint:
        return False
    return (on.support, on.body or default) == (support.support, support.body or default)


def _places_moved(sketch: Sketch, excitation: Any) -> list[tuple[float, float]]:
    """Where a support that moves is drawn, or a joint."""
    scenario = sketch.scenario
    if excitation.joint:
        joined = next(each for each in (*scenario.joints, *scenario.springs_between) if each.name == excitation.joint)
        return [sketch.point(place) for place in ends_of(site_in(scenario, joined))[-1:]]
    line = sketch.lines_of(excitation.body or scenario.default_body)[0]
    ends = dict(zip(("left", "right"), line.coordinate[[0, -1]], strict=True))
    return [tuple(line.at(ends[excitation.support], sketch.rest))] if excitation.support in ends else []


def _loaded(site: LoadSite, sketch: Sketch) -> Sequence[Place]:
    """Points at which a load is drawn."""
    if not isinstance(site, LoadedRegion):
        return ends_of(site)
    width = sketch.width(site.body)
    first, last = site.bounds[0] if site.bounds else sketch.lines_of(site.body)[0].coordinate[[0, -1]]
    along = np.linspace(first, last, 7)
    if not width:
        return [Place(site.body, float(x)) for x in along]
    y_range = site.bounds[1] if site.bounds else (0.0, width)
    return [Place(site.body, (float(x), y)) for y in y_range for x in along]


def _probes(sketch: Sketch, ax: Axes) -> Iterator[Named]:
    for probe in sketch.scenario.effective_probes:
        site = site_in(sketch.scenario, probe)
        if isinstance(site, Place):
            x, y = sketch.point(site)
            ax.plot(x, y, marker="D", markersize=4, color="#7b5ea7", zorder=8)
            yield f"probe {probe.name}", (x, y)


def _spring(
    sketch: Sketch,
    ax: Axes,
    start: tuple[float, float],
    end_points: Sequence[tuple[float, float]],
    ground: tuple[float, float],
) -> tuple[float, float]:
    """A zigzag to the other point, or to the ground where there is none; returns its middle."""
    first, last = np.array(start), np.array(end_points[0] if end_points else ground)
    xy = first + np.r_[0, np.linspace(0.25, 0.75, 8), 1][:, None] * (last - first)
    level = abs(last[1] - first[1]) < 1e-9
    xy[:, 1 if level else 0] += np.array([0, 0, 1, -1, 1, -1, 1, -1, 0, 0]) * (0.045 if level else 0.008 * sketch.span)
    ax.plot(xy[:, 0], xy[:, 1], color=BODY, linewidth=1.0, zorder=2)
    if not end_points:
        ax.plot(*last, marker="s", markersize=7, color="0.25", clip_on=False)
    x, y = 0.5 * (first + last)
    return float(x), float(y)
