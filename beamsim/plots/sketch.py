"""The view of a structure from the side: where each body is drawn, and deflected shapes with all that sits on them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from beamsim.scenario import Scenario
from beamsim.scenario.joint import placed
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.structures.places import Link, Place, Site, ends_of
from beamsim.structures.stations import StationPart, Stations
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Floats, Ints

MANY_NODES = 40  # of a body; beyond that they are drawn smaller
_REFINED = 4  # points between stations, by a cubic spline through them
BODY, REST, STOP = "#0b3c5d", "0.75", "#d1495b"
SHUT = "stop in contact"
_MARKERS = {"clamped": "s", "pinned": "^", "guided": "D", "springs": "v", "mass": "o"}
_JOINTS = {"rigid": ("s", BODY), "hinge": ("o", "white"), "spring": ("d", "white")}


@dataclass(frozen=True)
class Line:
    """One line of a body: a beam, a row of masses or nodes, or an edge of a plate."""

    x: Floats  # m in the sketch
    stations: Ints  # their numbers
    row: int  # counted upwards
    continuous: bool
    first: float  # in the coordinate of the body
    scale: float  # m of the sketch for one of that coordinate
    origin: float

    def at(self, coordinate: float, heights: Floats) -> tuple[float, float]:
        """Where a point of the body is drawn; ``heights`` (nx,) are those of its stations."""
        x = self.origin + (coordinate - self.first) * self.scale
        return x, self.row + float(np.interp(x, self.x, heights[self.stations]))


class Sketch:
    """The bodies side by side where joints connect them, else one above the other.

    Parameters
    ----------
    stations : of the bodies, where shapes are known.
    stops : the snubbers by name, with resolved gaps.
    """

    def __init__(self, scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers]) -> None:
        self.scenario, self.stations, self.stops = scenario, stations, stops
        at = placed(scenario.joints, scenario.all_bodies, scenario.default_body)
        names = [part.body for part in stations]
        rows = list(dict.fromkeys(at.group.get(name, name) for name in names))
        lengths = [float(np.ptp(stations.position[p.stations])) for p in stations if p.axis.continuous]
        self.span = max(lengths, default=1.0) or 1.0
        self.count = len(rows)
        self.lines: dict[str, list[Line]] = {}
        for part in stations:
            row = rows.index(at.group.get(part.body, part.body))
            self.lines[part.body] = self._lines_of(part, row, at.origin.get(part.body, 0.0))

    def _lines_of(self, part: StationPart, row: int, origin: float) -> list[Line]:
        stations = self.stations
        position, numbers = stations.position[part.stations], np.arange(part.stations.start, part.stations.stop)
        continuous = part.axis.continuous
        first = 0.0 if continuous else float(position.min())
        scale = 1.0 if continuous else self.span / (float(np.ptp(position)) or 1.0)
        across = None if stations.across is None else stations.across[part.stations]
        edges = [np.ones(position.size, dtype=bool)]
        if across is not None and np.all(np.isfinite(across)):
            edges = [across == across.min(), across == across.max()]
        x = origin + (position - first) * scale
        return [Line(x[on], numbers[on], row, continuous, first, scale, origin) for on in edges]

    def draw(self, ax: Axes, shape: Floats, factor: float, *, to_scale: bool) -> None:
        """The deflection (nx,) times a factor; ``to_scale`` says whether gaps have that scale too."""
        from scipy.interpolate import make_interp_spline

        heights = shape * factor
        for name, lines in self.lines.items():
            for line in lines:
                y = heights[line.stations]
                ax.plot(line.x[[0, -1]], [line.row, line.row], color=REST, linewidth=0.8, zorder=1)
                if line.continuous and line.x.size > 3:
                    fine = np.interp(np.arange(0, line.x.size - 0.9, 1 / _REFINED), np.arange(line.x.size), line.x)
                    spline = make_interp_spline(line.x, y, 3)
                    ax.plot(fine, line.row + spline(fine), color=BODY, linewidth=1.6, zorder=3)
                else:
                    size = 5.0 if line.x.size <= MANY_NODES else 2.0
                    ax.plot(line.x, line.row + y, color=BODY, linewidth=0.7, marker="s", markersize=size, zorder=3)
            ax.annotate(
                name, (float(lines[0].x[0]), lines[0].row), xytext=(0, -9), textcoords="offset points",
                fontsize="x-small", color="0.35", va="top",
            )  # fmt: skip
        self._marks(ax, heights)
        self._joints(ax, heights)
        self._stops(ax, heights, factor if to_scale else 0.0)
        ax.set_ylim(-0.62, self.count - 0.38)
        ax.set_yticks([])
        ax.spines[["top", "right", "left"]].set_visible(False)

    def lines_of(self, body: str) -> list[Line]:
        """The lines of a body; one alone is called after its axis."""
        return self.lines[body if body in self.lines else next(iter(self.lines))]

    @property
    def stop_sites(self) -> dict[str, Site]:
        """Where each stop is."""
        return {located.item.name: snubber_site(located) for located in self.scenario.located_snubbers}

    def point(self, place: Place, heights: Floats) -> tuple[float, float]:
        """Where a place is drawn; ``heights`` (nx,) are those of the stations."""
        lines = self.lines_of(place.body)
        x, low = lines[0].at(place.coordinate, heights)
        if place.across is None or self.stations.across is None or len(lines) == 1:
            return x, low
        width = float(self.stations.across[lines[-1].stations[0]])
        _, high = lines[-1].at(place.coordinate, heights)  # of the other edge; between them on the straight line
        return x, low + (high - low) * place.across / width

    def _marks(self, ax: Axes, heights: Floats) -> None:
        """Supports stay where they are; masses move."""
        for name, body in self.scenario.all_bodies.items():
            for coordinate, kind in body.marks:
                x, y = self.point(Place(name, coordinate), heights)
                still = kind in ("clamped", "pinned", "guided")
                ax.plot(
                    x, self.lines_of(name)[0].row if still else y, marker=_MARKERS[kind], markersize=7,
                    linestyle="none",
                    color="0.25" if still else BODY, markerfacecolor="0.25" if still else "white", clip_on=False,
                    zorder=5, label=kind,
                )  # fmt: skip

    def _joints(self, ax: Axes, heights: Floats) -> None:
        for joint in self.scenario.joints:
            site = site_in(self.scenario, joint)
            ends = [self.point(place, heights) for place in ends_of(site)]
            marker, face = _JOINTS[joint.kind]
            if len(ends) == 2 and math.dist(*ends) > 1e-6:
                ax.plot(*zip(*ends, strict=True), color=BODY, linestyle=":", linewidth=1.0, zorder=2)
            ax.plot(
                *ends[0], marker=marker, markersize=6, color=BODY, markerfacecolor=face, linestyle="none", zorder=6,
                label=f"{joint.kind} joint",
            )  # fmt: skip

    def _stops(self, ax: Axes, heights: Floats, factor: float) -> None:
        """Faces at their gaps; a stop between two bodies is a rod on the second that ends at its clearance."""
        sites = self.stop_sites
        for name, snubber in self.stops.items():
            site, up = sites[name], snubber.side == "below"
            ends = [self.point(place, heights) for place in ends_of(site)]
            row, *other = (self.point(place, np.zeros_like(heights))[1] for place in ends_of(site))
            x, y = ends[0]
            if isinstance(site, Link):
                over, high = ends[1]
                apart = snubber.gap * factor + (high - y) - (other[0] - row)
                shut = factor > 0 and apart < 0
                face = y + (max(apart, 0.0) if snubber.side == "approach" else 0.0)
            else:
                face = row + (-1.0 if up else 1.0) * snubber.gap * factor
                shut = factor > 0 and (y < face if up else y > face)
            colour = STOP if shut else "0.4"
            if isinstance(site, Link):
                dashes = "-" if snubber.side == "approach" else "--"
                ax.plot([over, x], [high, face], linestyle=dashes, linewidth=1.6, color=colour)
            ax.plot(
                x, face, marker=6 if up else 7, markersize=9, linestyle="none", clip_on=False,
                label=SHUT if shut else "stop", color=colour, zorder=4,
            )  # fmt: skip


def scale_bar(ax: Axes, x: float, height: float, text: str) -> None:
    """An upright bar beside the bodies that shows the scale of deflections and gaps."""
    ax.plot([x, x], [-0.5 * height, 0.5 * height], color="black", linewidth=2.0, clip_on=False)
    ax.annotate(
        text, (x, 0.0), xytext=(5, 0), textcoords="offset points", va="center", fontsize="small", annotation_clip=False
    )
