"""The model at rest, seen from the side: bodies, supports, masses, springs and stops with their sides and gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from beamsim.plots.drawing import finish_positions, panels
from beamsim.plots.sketch import BODY, STOP, Sketch, scale_bar
from beamsim.plots.style import amount, level_text, round_length
from beamsim.scenario import Scenario
from beamsim.scenario.place import MovedSupport
from beamsim.scenario.quantities import LEVEL_DIMENSIONS
from beamsim.structures.assembly import load_site_in, site_in, snubber_site
from beamsim.structures.distributed import Distributed
from beamsim.structures.places import Link, LoadSite, Place, Site, ends_of
from beamsim.structures.stations import Stations
from beamsim.system.parts import exciting_forces
from beamsim.system.structural import SnubberNumbers

MOST_NAMES = 14  # of stops, masses, springs and probes together; more are not readable
MOST_SQUARES = 12  # masses or nodes of a body; more are dots
DEEPEST = 0.07  # of a body, over the distance of rows
_LARGEST_GAP = 0.16
_SPRING = 0.22
_WALL, FACE = "0.3", "#d7e3ec"
_SHEAR, _RISE = 0.25, 0.3  # of an oblique view of a plate: to the right by its y, up over the distance of rows


def plot_model(scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers], ax: Axes) -> Axes:
    """Draw the model at rest: lengths to scale, gaps and depths to a scale of their own.

    Parameters
    ----------
    stations, stops : those of the scenario's system.
    """
    sketch = Sketch(scenario, stations, stops)
    _bodies(sketch, ax)
    drawn = (_supports_and_masses, _springs, _stops, _forces, _probes)
    names = [name for draw in drawn for name in draw(sketch, ax)]
    ax.set_ylim(-0.72, sketch.count - 0.28)
    ax.set_xmargin(0.07)
    ax.set_yticks([])
    if any(part.axis.continuous for part in stations):
        finish_positions(ax)
    else:
        ax.set_xticks([])
    ax.spines[["top", "right", "left"]].set_visible(False)
    if len(names) <= MOST_NAMES:
        _number(ax, names, 0.06 * sketch.span)
    return ax


def _number(ax: Axes, names: Sequence[tuple[str, tuple[float, float]]], near: float) -> None:
    """A number at every named place, and what it is in a list below; places that coincide have one label.

    Parameters
    ----------
    near : distance (m in the sketch) within which something to the right of a place has its number to the left.
    """
    numbers: dict[tuple[float, float], list[str]] = {}
    for k, (_, (x, y)) in enumerate(names, 1):
        numbers.setdefault((float(f"{x:.3g}"), round(y, 1)), []).append(str(k))
    for (x, y), those in numbers.items():
        beside = -20 if any(0.0 < other - x < near for other, _ in numbers) else 12
        ax.annotate(
            ", ".join(those), (x, y), xytext=(beside, 7 if y - round(y) > 0.01 else -9), textcoords="offset points",
            va="center", fontsize="small", color="0.25", zorder=9, annotation_clip=False,
            bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "0.6", "linewidth": 0.6},
            arrowprops={"arrowstyle": "-", "color": "0.6", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 1},
        )  # fmt: skip
    listed = [ax.plot([], [], linestyle="none", label=f"{k}  {text}")[0] for k, (text, _) in enumerate(names, 1)]
    figure: Any = ax.get_figure(root=True)
    if listed:
        figure.legend(
            handles=listed, loc="outside lower left", ncols=2, frameon=False, fontsize="small", handlelength=0.0,
            handletextpad=0.0,
        )  # fmt: skip


def model_figure(scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers]) -> Figure:
    """The sketch with its title, what excites the model, and the scale of the gaps."""
    rows = Sketch(scenario, stations, stops).count
    figure, (ax,) = panels(scenario.title, size=(8.0, 2.2 + 1.6 * rows))
    ax.set_title(excitation_text(scenario), fontsize="medium", loc="left")
    plot_model(scenario, stations, stops, ax)
    return figure


def excitation_text(scenario: Scenario) -> str:
    """What excites the model, in a line."""
    excitation: Any = scenario.excitation
    parts = excitation.forces if excitation.kind == "forces" else (excitation,)
    return "; ".join(dict.fromkeys(_excitation_text(scenario, part) for part in parts))


def _excitation_text(scenario: Scenario, part: Any) -> str:
    if part.kind == "none":
        return "no excitation"
    words = [part.kind.replace("_", " ")]
    levels = [level for _, level in part.levels()]
    if levels:
        words.append(_level_text(part, max(levels, key=abs)))
    if getattr(part, "psd", ()):
        words.append(f"{part.psd[0].frequency:.6g} to {part.psd[-1].frequency:.6g} Hz")
    tones = part.frequencies_hz
    if 0 < len(tones) <= 3:
        words.append(" and ".join(f"{tone:.6g} Hz" for tone in tones))
    elif getattr(part, "duration", None):
        words.append(amount(part.duration, "s"))
    if part.on_base:
        at = "the base" + (f" in {part.direction}" if part.direction else "")
    elif isinstance(part.applied_to, MovedSupport):
        at = f"support {part.applied_to.support}" if part.applied_to.support else f"joint {part.applied_to.joint}"
    else:
        at = load_site_in(scenario, part.applied_to).label
    return f"{', '.join(words)}, at {at}"


def _level_text(part: Any, level: float) -> str:
    unit = LEVEL_DIMENSIONS[part.quantity].unit if part.quantity else ""
    return level_text(level, unit).removeprefix("level ")


def _bodies(sketch: Sketch, ax: Axes) -> None:
    """Outlines with their depths; masses and nodes as squares and dots."""
    bodies = sketch.scenario.all_bodies
    deepest = max((depth for body in bodies.values() for _, _, depth in body.depths), default=0.0)
    for name, body in bodies.items():
        lines = sketch.lines_of(name)
        for line in lines[:1]:
            if not line.continuous:
                marker, size = ("s", 13) if line.x.size <= MOST_SQUARES else ("o", 4)
                ax.plot(line.x, np.full(line.x.size, line.row), color=BODY, linestyle="none", marker=marker,
                        markersize=size, markerfacecolor=FACE, zorder=3)  # fmt: skip
            elif len(lines) > 1:
                width = _width(sketch, name)
                corners = [(x, y) for y in (0.0, width) for x in line.x[[0, -1]] - line.origin]
                outline = [oblique(sketch, Place(name, corners[k])) for k in (0, 1, 3, 2)]
                ax.add_patch(Polygon(outline, facecolor=FACE, edgecolor=BODY, linewidth=1.2, zorder=3))
            else:
                ax.plot(line.x[[0, -1]], [line.row, line.row], color=BODY, linewidth=1.4, zorder=3)
        for start, end, depth in body.depths if len(lines) == 1 else ():
            (left, row), (right, _) = (oblique(sketch, Place(name, x)) for x in (start, end))
            half = 0.5 * DEEPEST * depth / deepest
            ax.add_patch(
                Rectangle((left, row - half), right - left, 2 * half, facecolor=FACE, edgecolor=BODY, linewidth=1.0,
                          zorder=3)
            )  # fmt: skip
        if len(bodies) > 1:
            ax.annotate(
                name, (float(lines[0].x.mean()), lines[0].row), xytext=(0, 8), textcoords="offset points",
                fontsize="small", color=BODY, ha="center", va="bottom", zorder=7,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            )  # fmt: skip


def _width(sketch: Sketch, body: str) -> float:
    """That of a plate, m."""
    across = sketch.stations.across
    lines = sketch.lines_of(body)
    return float(across[lines[-1].stations].max()) if len(lines) > 1 and across is not None else 0.0


def oblique(sketch: Sketch, place: Place) -> tuple[float, float]:
    """Where a place at rest is drawn; a plate is seen obliquely."""
    line = sketch.lines_of(place.body)[0]
    x, y = line.at(place.coordinate, np.zeros(sketch.stations.position.size))
    if place.across is None:
        return x, y
    return x + _SHEAR * place.across, y + _RISE * place.across / _width(sketch, place.body)


Names = Iterator[tuple[str, tuple[float, float]]]


def _supports_and_masses(sketch: Sketch, ax: Axes) -> Names:
    for name, body in sketch.scenario.all_bodies.items():
        width = _width(sketch, name)
        left, right = (float(sketch.lines_of(name)[0].x[k]) for k in (0, -1))
        for coordinate, kind in body.marks:
            x, y = oblique(sketch, Place(name, coordinate if not width else (coordinate, 0.0)))
            outwards = -1.0 if x < 0.5 * (left + right) else 1.0
            if kind == "mass":
                continue
            if width:
                ax.plot(*zip((x, y), oblique(sketch, Place(name, (coordinate, width))), strict=True), color=_WALL,
                        linewidth=4.0 if kind == "clamped" else 1.5, linestyle="-" if kind == "clamped" else "--",
                        zorder=4)  # fmt: skip
            elif kind == "clamped":
                _wall(ax, (x, y - 0.17), (x, y + 0.17), outwards * 0.012 * sketch.span)
            elif kind == "pinned":
                ax.plot(x, y - 0.5 * DEEPEST, marker=6, markersize=13, color=_WALL, clip_on=False, zorder=2)
                _ground(ax, sketch, x, y - 0.16, -1.0)
            elif kind == "guided":
                ax.plot([x, x], [y - 0.08, y + 0.08], marker="o", markersize=6, markerfacecolor="white",
                        color=_WALL, linestyle="none", zorder=4, clip_on=False)  # fmt: skip
                beyond = outwards * 0.012 * sketch.span
                _wall(ax, (x + beyond, y - 0.17), (x + beyond, y + 0.17), beyond)
            elif kind == "springs" and (coordinate, "pinned") not in body.marks:
                _spring(ax, sketch, x, y, y - _SPRING, BODY)
                _ground(ax, sketch, x, y - _SPRING, -1.0)
        masses = getattr(body, "point_masses", ())
        for mass, at in zip(masses, getattr(body, "mass_points", getattr(body, "mass_positions", ())), strict=True):
            x, y = oblique(sketch, Place(name, at))
            ax.plot(x, y + 0.09, marker="o", markersize=11, color=BODY, markerfacecolor="#8fb1c9", zorder=5)
            yield amount(mass.mass, "kg"), (x, y + 0.09)


def _springs(sketch: Sketch, ax: Axes) -> Names:
    """Springs of joints, of a chain, between points and to the ground."""
    scenario = sketch.scenario
    for joint in scenario.joints:
        ends = [oblique(sketch, place) for place in ends_of(site_in(scenario, joint))]
        face = {"rigid": BODY, "hinge": "white", "spring": "#e6a117"}[joint.kind]
        if len(ends) == 2 and math.dist(*ends) > 1e-6:
            ax.plot(*zip(*ends, strict=True), color=BODY, linestyle=":", linewidth=1.0, zorder=2)
        ax.plot(*ends[0], marker="o", markersize=8, color=BODY, markerfacecolor=face, linestyle="none", zorder=6)
        yield f"{joint.name} ({joint.kind} joint)", ends[0]
    for name, body in scenario.all_bodies.items():
        line, rest = sketch.lines_of(name)[0], np.zeros(sketch.stations.position.size)
        step = sketch.span / max(line.x.size - 1, 1)
        for first, second in body.spring_links:
            ends = [line.at(x, rest) for x in (first, second) if x is not None]
            (x, y), end = ends[0], ends[-1]
            if len(ends) == 1:  # to the wall beyond the first or last mass
                end = (x - 0.6 * step, y) if first is None else (x + 0.6 * step, y)
                _wall(ax, (end[0], y - 0.12), (end[0], y + 0.12), math.copysign(0.012 * sketch.span, end[0] - x))
            _along(ax, (x, y), end)
    for located in sketch.scenario.nonlinear_springs:
        yield from _point_spring(sketch, ax, located.item.name, snubber_site(located), located.item.kind)
    for spring in (*scenario.springs_to_ground, *scenario.springs_between):
        if spring.kind == "linear" and not spring.maxwell:
            yield from _point_spring(sketch, ax, spring.name, site_in(scenario, spring), "linear")


def _point_spring(sketch: Sketch, ax: Axes, name: str, site: Site, kind: str) -> Names:
    (x, y), *others = (oblique(sketch, place) for place in ends_of(site))
    text = f"{name} ({kind.replace('_', ' ')} spring)"
    if others:
        _along(ax, (x, y), others[0])
        yield text, (0.5 * (x + others[0][0]), 0.5 * (y + others[0][1]))
        return
    _spring(ax, sketch, x, y, y - _SPRING, BODY)
    _ground(ax, sketch, x, y - _SPRING, -1.0)
    yield text, (x, y - _SPRING)


def _stops(sketch: Sketch, ax: Axes) -> Names:
    """Faces at their gaps on the side that they are; where a stop presses at rest its face is at the body."""
    largest = max((stop.gap for stop in sketch.stops.values() if math.isfinite(stop.gap)), default=0.0)
    factor = _LARGEST_GAP / largest if largest > 0.0 else 0.0
    level, to_scale = 0, False  # of those between masses of one row
    for name, site in sketch.stop_sites.items():
        stop = sketch.stops[name]
        gap = max(stop.gap, 0.0) * factor if math.isfinite(stop.gap) else 0.0
        if isinstance(site, Link):
            (x, low), (over, high) = (oblique(sketch, place) for place in ends_of(site))
            if low == high:  # masses of one chain
                half, level = 0.2 + 0.12 * level, level + 1
                ax.plot([x, x, over, over], [low, low + half, high + half, high], color=STOP, linewidth=0.9, zorder=2,
                        linestyle="-" if stop.side == "approach" else "--")  # fmt: skip
                yield stop_text(name, stop), (0.5 * (x + over), low + half)
                continue
            to_scale = to_scale or gap > 0.0
            ax.plot([over, x], [high, low + gap], color=STOP, linewidth=1.4, zorder=2,
                    linestyle="-" if stop.side == "approach" else "--")  # fmt: skip
            if stop.side == "approach":
                _face(ax, sketch, x, low + gap)
            yield stop_text(name, stop), (0.5 * (x + over), 0.5 * (low + gap + high))
            continue
        (x, y), side = oblique(sketch, site), -1.0 if stop.side == "below" else 1.0
        to_scale = to_scale or gap > 0.0
        face = y + side * (gap + 0.5 * DEEPEST)
        _face(ax, sketch, x, face)
        _spring(ax, sketch, x, face, face + side * _SPRING, STOP)
        _ground(ax, sketch, x, face + side * _SPRING, side)
        yield stop_text(name, stop), (x, face + side * _SPRING)
    if to_scale:
        bar = round_length(largest)
        right = max(
            float(line.x.max()) + _SHEAR * _width(sketch, name)
            for name, lines in sketch.lines.items()
            for line in lines
        )
        end = right + 0.1 * sketch.span
        scale_bar(ax, end, bar * factor, f"gaps:\n{amount(bar, 'm')}")


def stop_text(name: str, stop: SnubberNumbers) -> str:
    """Name, stiffness, and gap or force at rest of a stop."""
    rest = f"gap {amount(stop.gap, 'm')}" if stop.gap > 0.0 else "just touching"
    if stop.gap < 0.0:
        rest = f"preload {amount(stop.preload, 'N')}" if stop.preload > 0.0 else f"prestress {amount(-stop.gap, 'm')}"
    return f"{name}: {amount(stop.stiffness, 'N/m')}, {rest}"


def _forces(sketch: Sketch, ax: Axes) -> Names:
    """Arrows where the base moves and where forces act."""
    excitation: Any = sketch.scenario.excitation
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": "#3a7d44", "linewidth": 1.8}
    parts = excitation.forces if excitation.kind == "forces" else (excitation,)
    for part in parts:
        if part.kind != "none" and part.on_base:
            ax.annotate("", (0.03, 0.04), xytext=(0.03, 0.2), xycoords="axes fraction",
                        arrowprops={**arrow, "arrowstyle": "<|-|>"})  # fmt: skip
            ax.annotate("base", (0.045, 0.12), xycoords="axes fraction", va="center", color="#3a7d44", fontsize="small")
    above = [
        oblique(sketch, site)[0]
        for name, site in sketch.stop_sites.items()
        if isinstance(site, Place) and sketch.stops[name].side == "above"
    ]
    for _, part in exciting_forces(sketch.scenario):
        levels = [_level_text(part, level) for _, level in part.levels()]
        for place in _loaded(load_site_in(sketch.scenario, part.applied_to), sketch):
            x, y = oblique(sketch, place)
            x -= 0.03 * sketch.span if any(abs(x - other) < 0.02 * sketch.span for other in above) else 0.0
            ax.annotate("", (x, y + 0.04), xytext=(x, y + 0.34), arrowprops=arrow)
        yield levels[0] if len(levels) == 1 else part.kind.replace("_", " "), (x, y + 0.34)


def _loaded(site: LoadSite, sketch: Sketch) -> Sequence[Place]:
    """Points at which a load is drawn."""
    if not isinstance(site, Distributed):
        return ends_of(site)
    line, width = sketch.lines_of(site.body)[0], _width(sketch, site.body)
    first, last = site.bounds[0] if site.bounds else line.x[[0, -1]] - line.origin
    if not width:
        return [Place(site.body, float(x)) for x in np.linspace(first, last, 9)]
    low, high = site.bounds[1] if site.bounds else (0.0, width)
    return [Place(site.body, (float(x), y)) for y in (low, high) for x in np.linspace(first, last, 6)]


def _probes(sketch: Sketch, ax: Axes) -> Names:
    for probe in sketch.scenario.effective_probes:
        site = site_in(sketch.scenario, probe)
        if isinstance(site, Place):
            x, y = oblique(sketch, site)
            ax.plot(x, y, marker="D", markersize=4, color="#7b5ea7", zorder=8)
            yield f"probe {probe.name}", (x, y)


def _face(ax: Axes, sketch: Sketch, x: float, y: float) -> None:
    half = 0.014 * sketch.span
    ax.plot([x - half, x + half], [y, y], color=STOP, linewidth=2.6, zorder=4, solid_capstyle="butt")


def _spring(ax: Axes, sketch: Sketch, x: float, start: float, end: float, colour: str) -> None:
    """A zigzag upright."""
    width = 0.008 * sketch.span
    across = x + width * np.array([0, 0, 1, -1, 1, -1, 1, -1, 0, 0])
    ax.plot(
        across, start + (end - start) * np.r_[0, np.linspace(0.12, 0.88, 8), 1], color=colour, linewidth=1.1, zorder=2
    )


def _along(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A zigzag between two points."""
    along = np.r_[0, np.linspace(0.25, 0.75, 8), 1]
    first, last = np.array(start), np.array(end)
    xy = first + along[:, None] * (last - first)
    horizontal = abs(last[1] - first[1]) < 1e-9
    zigzag = np.array([0, 0, 1, -1, 1, -1, 1, -1, 0, 0])
    xy[:, 1 if horizontal else 0] += zigzag * (0.045 if horizontal else 0.006)
    ax.plot(xy[:, 0], xy[:, 1], color=BODY, linewidth=1.0, zorder=2)


def _ground(ax: Axes, sketch: Sketch, x: float, y: float, side: float) -> None:
    """A hatched line that does not move relative to the base; ``side`` -1 has the hatching below."""
    half = 0.022 * sketch.span
    ax.plot([x - half, x + half], [y, y], color=_WALL, linewidth=1.2, zorder=2)
    for at in np.linspace(x - half, x + half, 5):
        ax.plot([at, at - 0.35 * half], [y, y + side * 0.045], color=_WALL, linewidth=0.7, zorder=2)


def _wall(ax: Axes, low: tuple[float, float], high: tuple[float, float], depth: float) -> None:
    """A hatched upright line."""
    ax.plot([low[0], high[0]], [low[1], high[1]], color=_WALL, linewidth=2.0, zorder=4)
    for y in np.linspace(low[1] + 0.04, high[1], 6):
        ax.plot([low[0], low[0] + depth], [y, y - 0.04], color=_WALL, linewidth=0.8, zorder=4)
