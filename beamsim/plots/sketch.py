"""The view of a structure from the side, at rest or deflected, with all that sits on it; plates are seen obliquely."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.path import Path as MarkerPath

from beamsim.plots.drawing import DARK, RED
from beamsim.plots.style import plain_scale
from beamsim.scenario import Scenario
from beamsim.scenario.connections import place_bodies
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.structures.places import BodyStations, Link, Place, Site, Stations, ends_of
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Floats, Ints

HEIGHT = 0.35  # of the largest deflection or gap, over the distance of rows
MANY_NODES = 40  # of a body; beyond that they are drawn smaller
BODY, REST, STOP = DARK, "0.75", RED
TURNING = "rotational spring"
SHUT = "stop in contact"
SUPPORTS = {"clamped": "s", "pinned": 6, "guided": "D"}
_TURNS = np.linspace(0.0, 4.5 * np.pi, 60)
_SPIRAL = MarkerPath((0.1 + 0.9 * _TURNS / _TURNS[-1])[:, None] * np.column_stack([np.cos(_TURNS), np.sin(_TURNS)]))
_MARKERS = {**SUPPORTS, "springs": "v", "mass": "o", TURNING: _SPIRAL}
_JOINTS = {"rigid": ("s", BODY), "hinge": ("o", "white"), "spring": ("d", "white")}
_SHEAR, _RISE = 0.25, 0.3  # of a plate: to the right by its y, up over the distance of rows


@dataclass(frozen=True)
class Line:
    """One line of a body: a beam, a row of masses, the lower or upper edge of a plate, or nodes in space."""

    x: Floats  # (k,) m in the sketch
    row: float  # at rest, counted upwards
    coordinate: Floats  # (k,) of the body
    stations: Ints  # (k,) their numbers
    continuous: bool
    rows_above: Floats | float = 0.0  # (k,) rows above ``row`` at rest, of nodes in space
    pairs: Ints | None = None  # (m, 2) of its points that are joined; all in their order where None

    def at(self, coordinate: float, heights: Floats) -> Floats:
        """(2,) where a point is drawn; ``heights`` (nx,) are those of the stations."""
        x, height = (
            np.interp(coordinate, self.coordinate, y) for y in (self.x, self.rows_above + heights[self.stations])
        )
        return np.array([x, self.row + height])


class Sketch:
    """The bodies side by side where joints connect them, else one above the other.

    Parameters
    ----------
    stations : of the bodies, where shapes are known.
    stops : the snubbers by name, with resolved gaps.
    """

    def __init__(self, scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers]) -> None:
        self.scenario, self.stations, self.stops = scenario, stations, stops
        at = place_bodies(scenario.joints, scenario.all_bodies, scenario.default_body)
        self.sites: dict[str, Site] = {each.item.name: snubber_site(each) for each in scenario.located_snubbers}
        rows = list(dict.fromkeys(at.groups.get(part.body, part.body) for part in stations.bodies))
        for site in self.sites.values():  # the first of two places lies below the second
            low, high = ([at.groups.get(place.body, place.body) for place in ends_of(site)] * 2)[:2]
            if low in rows and high in rows and rows.index(low) > rows.index(high):
                rows.remove(low)
                rows.insert(rows.index(high), low)
        lengths = [float(np.ptp(self._right_offsets(part))) for part in stations.bodies if self._in_metres(part)]
        self.span = max(lengths, default=1.0) or 1.0
        self.count = len(rows)
        self.rest = np.zeros(stations.position.size)
        self.lines = {
            part.body: self._lines_of(
                part, rows.index(at.groups.get(part.body, part.body)), at.origins.get(part.body, 0.0)
            )
            for part in stations.bodies
        }

    def _in_metres(self, part: BodyStations) -> bool:
        points = self.stations.points
        return part.axis.continuous or (points is not None and bool(np.all(np.isfinite(points[part.stations]))))

    def _right_offsets(self, part: BodyStations) -> Floats:
        """(k,) m to the right; nodes in space are seen obliquely."""
        if part.axis.continuous or self.stations.points is None:
            return self.stations.position[part.stations]
        x, y, _ = self.stations.points[part.stations].T
        return np.asarray(x + _SHEAR * y)

    def _in_space(self, part: BodyStations, row: int, origin: float, numbers: Ints) -> Line:
        """Nodes in space; rows are a quarter of the span apart, and a high structure is pressed between them."""
        assert self.stations.points is not None
        _, y, z = self.stations.points[part.stations].T
        upward = z - z.min() + _RISE * (y - y.min())
        pairs = np.zeros((0, 2), dtype=np.int64) if self.stations.lines is None else self.stations.lines
        pairs = pairs[(pairs[:, 0] >= part.stations.start) & (pairs[:, 0] < part.stations.stop)] - part.stations.start
        scale = min(4.0 / self.span, 0.5 / (float(upward.max()) or 1.0))
        x = origin + self._right_offsets(part)
        return Line(x, row, self.stations.position[part.stations], numbers, False, scale * upward, pairs)

    def _lines_of(self, part: BodyStations, row: int, origin: float) -> list[Line]:
        position, numbers = self.stations.position[part.stations], np.arange(part.stations.start, part.stations.stop)
        if not part.axis.continuous and self._in_metres(part):
            return [self._in_space(part, row, origin, numbers)]
        x = origin + position
        if not part.axis.continuous:
            x = origin + (position - position.min()) * self.span / (float(np.ptp(position)) or 1.0)
        y_of_stations = None if self.stations.position_y is None else self.stations.position_y[part.stations]
        if y_of_stations is None or not np.all(np.isfinite(y_of_stations)):
            return [Line(x, row, position, numbers, part.axis.continuous)]
        edges = (
            (y_of_stations == y, _SHEAR * y, rise)
            for y, rise in ((y_of_stations.min(), 0.0), (y_of_stations.max(), _RISE))
        )
        return [
            Line(x[on] + right, row + deflection, position[on], numbers[on], True) for on, right, deflection in edges
        ]

    def lines_of(self, body: str) -> list[Line]:
        """The lines of a body; one alone is called after its axis."""
        return self.lines[body if body in self.lines else next(iter(self.lines))]

    def width(self, body: str) -> float:
        """That of a plate, m; else 0."""
        lines, y_of_stations = self.lines_of(body), self.stations.position_y
        return float(y_of_stations[lines[-1].stations[0]]) if len(lines) > 1 and y_of_stations is not None else 0.0

    def point(self, place: Place, heights: Floats | None = None) -> tuple[float, float]:
        """Where a place is drawn, at rest or with heights (nx,) of the stations; on a plate linear across it."""
        lines, width = self.lines_of(place.body), self.width(place.body)
        moved = self.rest if heights is None else heights
        share = 0.0 if place.position_y is None or not width else place.position_y / width
        x, y = (1.0 - share) * lines[0].at(place.coordinate, moved) + share * lines[-1].at(place.coordinate, moved)
        return float(x), float(y)

    def draw(
        self,
        ax: Axes,
        heights: Floats,
        gaps: float = 0.0,
        clearance: float = 0.0,
        openings: Mapping[str, float] | None = None,
    ) -> dict[str, tuple[float, float]]:
        """Draw bodies, supports, masses, joints and stops.

        Parameters
        ----------
        ax : to draw on.
        heights : (nx,) of the stations, rows.
        gaps : rows for a metre of gap; 0 where gaps have no scale, and stops are at the bodies at rest.
        clearance : rows, of the faces of stops from the middle of a body that they touch.
        openings : m, by stop, distance to its face as it is; of those not named it follows from gap and heights.

        Returns
        -------
        Where each stop is drawn, by name.
        """
        for name, lines in self.lines.items():
            for line in lines:
                size = 0.0 if line.continuous else 6.0 if line.x.size <= MANY_NODES else 2.0
                style: dict[str, Any] = {"color": BODY, "linewidth": 0.7 if size else 1.6, "zorder": 3}
                y = line.row + line.rows_above + heights[line.stations]
                if line.pairs is None:
                    ax.plot(line.x[[0, -1]], [line.row, line.row], color=REST, linewidth=0.8, zorder=1)
                else:
                    ax.plot(line.x[line.pairs].T, y[line.pairs].T, **style)
                joined = "-" if line.pairs is None else "none"
                ax.plot(line.x, y, marker="s", markersize=size, linestyle=joined, **style)
            if len(lines) > 1:
                for end in (0, -1):
                    corners = [(line.x[end], line.row + heights[line.stations[end]]) for line in lines]
                    ax.plot(*zip(*corners, strict=True), color=BODY, linewidth=0.8, zorder=2)
            if len(self.lines) > 1:
                ax.annotate(
                    name, (float(lines[0].x[0]), lines[0].row), xytext=(0, -9), textcoords="offset points",
                    fontsize="x-small", color="0.35", va="top",
                )  # fmt: skip
        self._marks(ax, heights)
        self._joints(ax, heights)
        ax.set_ylim(-0.62, self.count - 0.38)
        ax.set_yticks([])
        ax.spines[["top", "right", "left"]].set_visible(False)
        if any(line.continuous or line.pairs is not None for lines in self.lines.values() for line in lines):
            finish_positions(ax)
        else:
            ax.set_xticks([])
        of_stops = {name: opening * gaps for name, opening in (openings or {}).items() if math.isfinite(opening)}
        return self._stops(ax, heights, gaps, clearance, of_stops)

    def masses(self, heights: Floats | None = None) -> list[tuple[float, tuple[float, float]]]:
        """Point masses, kg, and where they are drawn."""
        return [
            (mass.mass, self.point(Place(name, at), heights))
            for name, body in self.scenario.all_bodies.items()
            for mass, at in zip(
                getattr(body, "point_masses", ()),
                body.mass_points,
                strict=True,
            )
        ]

    def _marks(self, ax: Axes, heights: Floats) -> None:
        """Supports, along an edge of a plate, and masses, where the body is."""
        for name, body in self.scenario.all_bodies.items():
            for coordinate, kind in body.marks:
                if kind != "mass":
                    holds, size = kind in SUPPORTS, 12 if kind == TURNING else 7
                    at = [line.at(coordinate, heights) for line in self.lines_of(name)]
                    ax.plot(*np.transpose(at), marker=_MARKERS[kind], markersize=size, clip_on=False, zorder=5,
                            linestyle="-" if len(at) > 1 else "none", linewidth=2.5, color="0.25" if holds else BODY,
                            markerfacecolor="0.25" if holds else "none" if kind == TURNING else "white",
                            label=kind)  # fmt: skip
        for _, mass in self.masses(heights):
            ax.plot(*mass, marker="o", markersize=9, color=BODY, markerfacecolor="#8fb1c9", linestyle="none", zorder=5,
                    label="mass")  # fmt: skip

    def _joints(self, ax: Axes, heights: Floats) -> None:
        for joint in self.scenario.joints:
            ends = [self.point(place, heights) for place in ends_of(site_in(self.scenario, joint))]
            marker, face = _JOINTS[joint.kind]
            if getattr(joint, "rotational_stiffness", 0.0):
                ax.plot(*ends[0], marker=_SPIRAL, markersize=14, color=BODY, markerfacecolor="none", linestyle="none",
                        zorder=6, label=TURNING)  # fmt: skip
            if len(ends) == 2 and math.dist(*ends) > 1e-6:
                ax.plot(*zip(*ends, strict=True), color=BODY, linestyle=":", linewidth=1.0, zorder=2)
            ax.plot(
                *ends[0], marker=marker, markersize=6, color=BODY, markerfacecolor=face, linestyle="none", zorder=6,
                label=f"{joint.kind} joint",
            )  # fmt: skip

    def _stops(
        self, ax: Axes, heights: Floats, gaps: float, clearance: float, openings: Mapping[str, float]
    ) -> dict[str, tuple[float, float]]:
        """Faces at their openings, rows, else at their gaps, or where a body presses them.

        Between two bodies there is a rod on the second one.
        """
        places, top = {}, 0.2
        for name, stop in self.stops.items():
            site, side = self.sites[name], -1.0 if stop.side == "below" else 1.0
            (x, row), *rest = (self.point(place) for place in ends_of(site))
            (_, y), *other = (self.point(place, heights) for place in ends_of(site))
            gap = stop.gap * gaps if math.isfinite(stop.gap) else 0.0
            if stop.gap_unit == "rad":  # next to its hinge, where the body that turns meets it
                way = 1.0 if self.lines_of(ends_of(site)[0].body)[0].x.mean() >= x else -1.0
                side, x, rod, apart = side * way, x + 0.04 * way * self.span, [], stop.gap
                face = y + 0.06 * side
                places[name] = (x, face + 0.06 * side)
            elif isinstance(site, Link):
                (over, high), approach = other[0], stop.side == "approach"
                extension = (high - y) - (rest[0][1] - row)
                apart = openings.get(name, gap + (extension if approach else -extension))
                face = y + (max(apart, 0.0) if approach else 0.0)
                rod, places[name] = [(over, high), (x, face)], (0.5 * (x + over), 0.5 * (face + high))
                if row == rest[0][1]:  # masses of one row
                    rod, places[name] = (
                        [(x, y), (x, row + top), (over, row + top), (over, high)],
                        (0.5 * (x + over), row + top),
                    )
                    top += 0.12
            else:
                rod, apart = [], openings.get(name, side * (row - y) + gap)
                face = y + side * (max(apart, 0.0) + clearance) if gaps else row
                places[name] = (x, face + 0.06 * side)
            shut = gaps > 0.0 and (apart < 0.0 or openings.get(name) == 0.0)
            style: dict[str, Any] = {"color": STOP if shut else "0.4", "label": SHUT if shut else "stop", "zorder": 4}
            if rod:
                dashes = "-" if stop.side == "approach" else "--"
                ax.plot(*zip(*rod, strict=True), linestyle=dashes, linewidth=1.6, **style)
            if len(rod) < 4:
                ax.plot(x, face, marker=6 if side < 0.0 else 7, markersize=9, linestyle="none", clip_on=False, **style)
        return places


def scale_bar(ax: Axes, x: float, height: float, text: str) -> None:
    """An upright bar next to the bodies that shows the scale of deflections and gaps.

    Parameters
    ----------
    ax : to draw on.
    x : where, in its unit.
    height : rows, of the bar.
    text : next to the bar.
    """
    ax.plot([x, x], [-0.5 * height, 0.5 * height], color="black", linewidth=2.0, clip_on=False)
    ax.annotate(
        text, (x, 0.0), xytext=(5, 0), textcoords="offset points", va="center", fontsize="small", annotation_clip=False
    )


def finish_positions(ax: Axes) -> None:
    """Label an axis of positions that are drawn in metres: in the unit chosen for lengths, if there is one."""
    scale = plain_scale("m")
    ax.set_xlabel(f"x ({scale.unit})")
    if scale.unit != "m":
        ax.xaxis.set_major_formatter(lambda x, _: f"{x * scale.factor:.4g}")
