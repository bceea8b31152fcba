"""Bodies in space: an axonometric view with one scale for all axes, at rest, deflected and in modes.

Frames and imported bodies whose nodes have coordinates are drawn alike: from points, the lines between them and the
displacements of the points along x, y and z.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from beamsim.labelled import Dataset
from beamsim.plots.drawing import DARK, GREEN, MOST_PANELS, RED, Picture
from beamsim.plots.style import amount, round_length
from beamsim.plots.understood import level_or_kind, stop_text
from beamsim.scenario import Scenario
from beamsim.scenario.frame import FrameBody, point_at
from beamsim.structures.assembly import site_in, snubber_site
from beamsim.structures.places import TRANSLATIONS, Place, Site, Stations, ends_of
from beamsim.system.reduced_model import ActingLoads
from beamsim.system.structural import SnubberNumbers
from beamsim.typing import Floats

AZIMUTH, ELEVATION = math.radians(-60.0), math.radians(25.0)  # of the eye: from the right, in front and above
LARGEST = 0.12  # of a drawn displacement, over the size of the structure
OUTWARDS = 0.05  # length of what holds a stop, over that size
MANY_POINTS = 40  # beyond that points are not marked
REST = "0.72"
_SUPPORTS = {"clamped": "s", "pinned": "^", "springs": "v"}
_RIGHT = np.array([-math.sin(AZIMUTH), math.cos(AZIMUTH), 0.0])
_UP = np.array(
    [-math.sin(ELEVATION) * math.cos(AZIMUTH), -math.sin(ELEVATION) * math.sin(AZIMUTH), math.cos(ELEVATION)]
)
_SCREEN = np.stack([_RIGHT, _UP], axis=1)


def flat(points: Floats) -> Floats:
    """(..., 2) where points (..., 3) are seen, m: to the right and upwards."""
    return np.asarray(points @ _SCREEN)


@dataclass(frozen=True, eq=False)
class SpaceView:
    """The bodies of a case in space, all of whose stations have coordinates."""

    scenario: Scenario
    stations: Stations
    points: Floats  # (nx, 3) m, of the stations
    stops: Mapping[str, SnubberNumbers]

    @classmethod
    def of(cls, scenario: Scenario, stations: Stations, stops: Mapping[str, SnubberNumbers]) -> SpaceView | None:
        """The view of a case; None if a station has no coordinates."""
        points = stations.points
        if points is None or not len(points) or not np.isfinite(points).all():
            return None
        return cls(scenario, stations, points, stops)

    @cached_property
    def size(self) -> float:
        """Largest extent, m."""
        return float(np.ptp(self.points, axis=0).max()) or 1.0

    @cached_property
    def lines(self) -> Any:
        """(m, 2) stations that are joined."""
        return np.zeros((0, 2), dtype=int) if self.stations.lines is None else self.stations.lines

    @cached_property
    def figure_size(self) -> tuple[float, float]:
        """Width and height of a picture with one panel, inches."""
        width, height = np.ptp(flat(self.points), axis=0) + 0.3 * self.size
        return 8.0, float(np.clip(7.5 * height / width, 3.0, 8.0)) + 0.8

    def point(self, place: Place) -> Floats | None:
        """(3,) m, of a place at rest; None if it has no coordinates."""
        name = place.body or self.scenario.default_body
        body, number = self.scenario.all_bodies[name], round(place.coordinate)
        if isinstance(body, FrameBody):
            if place.along is None:
                return np.array(list(body.nodes.values())[number - 1])
            return np.array(point_at(list(body.members.values())[number - 1].curve(body.nodes), place.along))
        part = next((each for each in self.stations.bodies if each.body == name), self.stations.bodies[0])
        found = np.flatnonzero(self.stations.position[part.stations] == number)
        return self.points[part.stations][found[0]] if found.size else None

    def points_of(self, site: Site) -> list[Floats]:
        """Points of one or two places, as far as they are known."""
        return [at for place in ends_of(site) if (at := self.point(place)) is not None]

    def moved(self, point: Floats, displacement: Floats | None) -> Floats:
        """A point with the displacement of the station next to it."""
        if displacement is None:
            return point
        nearest = int(np.linalg.norm(self.points - point, axis=1).argmin())
        return np.asarray(point + displacement[nearest])

    def draw(self, ax: Axes, displacement: Floats | None = None) -> None:
        """Draw members, supports, masses and joints, deflected by displacements (nx, 3) that are drawn as they are."""
        shown = self.points if displacement is None else self.points + displacement
        if displacement is not None:
            self._lines(ax, self.points, color=REST, linewidth=1.0, zorder=1)
        self._lines(ax, shown, color=DARK, linewidth=1.8, zorder=3)
        marked = np.arange(len(shown)) if len(shown) <= MANY_POINTS else np.setdiff1d(np.arange(len(shown)), self.lines)
        ax.plot(*flat(shown[marked]).T, linestyle="none", marker=".", markersize=4, color=DARK, zorder=3)
        for name, body in self.scenario.all_bodies.items():
            for coordinate, kind in body.marks:
                at = self.point(Place(name, coordinate))
                if at is not None and kind in _SUPPORTS:
                    ax.plot(*flat(self.moved(at, displacement)), marker=_SUPPORTS[kind], markersize=8, color="0.25",
                            linestyle="none", zorder=5, label=kind)  # fmt: skip
        for _, at in self.masses():
            ax.plot(*flat(self.moved(at, displacement)), marker="o", markersize=7, color=DARK, linestyle="none",
                    markerfacecolor="#8fb1c9", zorder=4, label="mass")  # fmt: skip
        for joint in self.scenario.joints:
            ends = [flat(self.moved(at, displacement)) for at in self.points_of(site_in(self.scenario, joint))]
            if ends:
                ax.plot(*np.transpose(ends), marker="d", color=DARK, linestyle=":", markerfacecolor="white", zorder=5,
                        label=f"{joint.kind} joint")  # fmt: skip
        self._finish(ax, shown)

    def _lines(self, ax: Axes, points: Floats, **style: Any) -> None:
        """Draw the lines between points (nx, 3)."""
        ax.add_collection(LineCollection(list(flat(points[self.lines])), capstyle="round", **style))

    def masses(self) -> list[tuple[float, Floats]]:
        """Point masses, kg, and where they are."""
        return [
            (mass.mass, at)
            for name, body in self.scenario.all_bodies.items()
            for mass, point in zip(getattr(body, "point_masses", ()), body.mass_points, strict=True)
            if (at := self._of_mass(name, point)) is not None
        ]

    def _of_mass(self, name: str, point: Any) -> Floats | None:
        if isinstance(point, tuple):  # on a member: its number, and the distance along it
            return self.point(Place(name, point[0], along=point[1]))
        return self.point(Place(name, point))

    def _finish(self, ax: Axes, shown: Floats) -> None:
        """Equal scales, no frame, and the axes with their length in the lower left corner."""
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_axis_off()
        seen = np.vstack([flat(self.points), flat(shown)])
        length = round_length(0.15 * self.size)
        corner = seen.min(axis=0) - np.array([0.1, 0.12]) * self.size
        for name, axis in zip(TRANSLATIONS, np.eye(3), strict=True):
            tip = corner + flat(length * axis)
            arrow = {"arrowstyle": "-|>", "color": "0.35", "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0}
            ax.annotate("", _pair(tip), xytext=_pair(corner), arrowprops=arrow)
            ax.annotate(
                name, _pair(corner + 1.25 * (tip - corner)), ha="center", va="center", fontsize="small", color="0.35"
            )
        ax.annotate(f"axes {amount(length, 'm')}", _pair(corner), xytext=(0, -20), textcoords="offset points", va="top",
                    fontsize="small", color="0.35")  # fmt: skip
        low, high = np.vstack([seen, corner]).min(axis=0), seen.max(axis=0)
        ax.update_datalim(np.array([low - 0.1 * self.size, high + 0.1 * self.size]))
        ax.autoscale_view()

    def draw_stops(
        self, ax: Axes, displacement: Floats | None = None, factor: float = 0.0, touching: Sequence[str] = ()
    ) -> dict[str, Floats]:
        """Draw the stops: a bar as their face, and what holds it; a rod between two points.

        Parameters
        ----------
        ax : to draw on.
        displacement : (nx, 3) m as drawn; None at rest.
        factor : drawn over true displacements, for gaps; 0 where gaps have no scale.
        touching : names of the stops that are pressed.

        Returns
        -------
        By name the point of each stop as it is seen, (2,).
        """
        places = {}
        sites = {each.item.name: snubber_site(each) for each in self.scenario.located_snubbers}
        for name, site in sites.items():
            ends, pressed = self.points_of(site), name in touching
            if not ends:
                continue
            style: dict[str, Any] = {"color": RED if pressed else "0.4", "linewidth": 2.2, "zorder": 6}
            style |= {"label": "stop in contact" if pressed else "stop"}
            if len(ends) == 2:
                rod = flat(np.array([self.moved(at, displacement) for at in ends]))
                ax.plot(*rod.T, linestyle="-" if pressed else "--", **style)
                places[name] = rod.mean(axis=0)
                continue
            places[name] = self._face(ax, ends[0], site, name, (displacement, factor, pressed), style)
        return places

    def faces(self, factor: float) -> dict[str, tuple[Floats, Floats]]:
        """By stop at one place where its face is at rest and what holds it, m; gaps are enlarged by a factor."""
        found = {}
        for located in self.scenario.located_snubbers:
            stop, ends = self.stops[located.item.name], ends_of(snubber_site(located))
            point = self.point(ends[0])
            if len(ends) == 1 and point is not None and ends[0].direction in TRANSLATIONS:
                sign = -1.0 if stop.side == "below" else 1.0
                way = sign * np.eye(3)[TRANSLATIONS.index(ends[0].direction)]
                face = point + max(stop.gap * factor if math.isfinite(stop.gap) else 0.0, 0.0) * way
                found[stop.name] = face, face + OUTWARDS * self.size * way
        return found

    def _face(
        self, ax: Axes, point: Floats, site: Site, name: str, state: tuple[Floats | None, float, bool],
        style: dict[str, Any],
    ) -> Floats:  # fmt: skip
        """Draw the face of a stop at one place; returns where it is seen."""
        (place,), (displacement, factor, pressed), stop = ends_of(site), state, self.stops[name]
        if place.direction not in TRANSLATIONS:
            at = flat(self.moved(point, displacement))
            ax.plot(*at, marker="x", linestyle="none", markersize=9, **style)
            return at
        sign = -1.0 if stop.side == "below" else 1.0
        way = sign * np.eye(3)[TRANSLATIONS.index(place.direction)]
        gap = stop.gap * factor if factor and math.isfinite(stop.gap) else 0.03 * self.size
        face = self.moved(point, displacement) if pressed else point + max(gap, 0.0) * way
        at, holder = flat(face), flat(face + OUTWARDS * self.size * way)
        along = (holder - at) / (np.linalg.norm(holder - at) or 1.0)
        half = 0.03 * self.size * np.array([-along[1], along[0]])
        ax.plot(*np.transpose([at - half, at + half]), **style)
        ax.plot(*np.transpose([at, holder]), **(style | {"label": "_nolegend_", "linewidth": 1.2}))
        return np.asarray(holder)

    def named_places(self, ax: Axes, stops: Mapping[str, Floats]) -> Iterator[tuple[str, tuple[float, float]]]:
        """Names of stops, springs, friction, forces and probes, and where they are; draws the arrows of forces."""
        for mass, at in self.masses():
            yield f"mass {amount(mass, 'kg')}", _pair(flat(at))
        for name, seen in stops.items():
            yield stop_text(name, self.stops[name]), _pair(seen)
        for located in self.scenario.nonlinear_springs:
            ends = self.points_of(snubber_site(located))
            if ends:
                seen = flat(np.array(ends)).mean(axis=0)
                ax.plot(
                    *seen, marker="o", markersize=11, linestyle="none", color="0.4", markerfacecolor="none", zorder=6
                )
                yield f"{located.item.name} ({located.item.kind.replace('_', ' ')})", _pair(seen)
        for _, force in ActingLoads.of(self.scenario).forces:
            place = site_in(self.scenario, force.applied_to) if getattr(force.applied_to, "places", ()) else None
            for end in ends_of(place) if place is not None else ():
                acts_at = self.point(end)
                if acts_at is not None and end.direction in TRANSLATIONS:
                    tail = acts_at - 0.15 * self.size * np.eye(3)[TRANSLATIONS.index(end.direction)]
                    ax.annotate("", _pair(flat(acts_at)), xytext=_pair(flat(tail)),
                                arrowprops={"arrowstyle": "-|>", "color": GREEN, "linewidth": 1.8})  # fmt: skip
                    yield level_or_kind(force), _pair(flat(tail))
        for probe in self.scenario.effective_probes:
            for at in self.points_of(site_in(self.scenario, probe)):
                ax.plot(*flat(at), marker="D", markersize=4, color="#7b5ea7", zorder=8)
                yield f"probe {probe.name}", _pair(flat(at))


def _pair(at: Floats) -> tuple[float, float]:
    return float(at[0]), float(at[1])


def plot_space_mode(view: SpaceView, modes: Dataset, ax: Axes, number: int) -> None:
    """A mode of the open structure in space, by its number from 1, over the structure at rest."""
    shape = modes["shapes_in_space"].sel(mode=number).values
    largest = float(np.linalg.norm(shape, axis=1).max()) or 1.0
    view.draw(ax, shape * LARGEST * view.size / largest)
    view.draw_stops(ax)
    frequency = modes["open_frequencies_hz"].sel(mode=number).item()
    ax.set_title(f"mode {number}, {frequency:.4g} Hz", fontsize="medium", loc="left")


def space_modes(view: SpaceView, modes: Dataset, title: str) -> Picture:
    """The first modes in space."""
    count = min(MOST_PANELS, len(modes["mode"].values))
    panels = [partial(plot_space_mode, view, modes, number=k + 1) for k in range(count)]
    width, height = view.figure_size
    rows = -(-count // 2)
    return Picture(title, panels, columns=2, size=(width, 0.8 + rows * 0.55 * height), legend_below=True)


def plot_deflected(view: SpaceView, displacement: Floats, touching: Sequence[str], title: str, ax: Axes) -> None:
    """Displacements (nx, 3), m, enlarged, with the gaps of stops to the same scale."""
    largest = float(np.linalg.norm(displacement, axis=1).max(initial=0.0))
    factor = LARGEST * view.size / largest if largest else 0.0
    view.draw(ax, displacement * factor)
    view.draw_stops(ax, displacement * factor, factor, touching)
    enlarged = f"{float(f'{factor:.2g}'):,g}".replace(",", " ")
    text = f"; displacements {enlarged} times, at most {amount(largest, 'm')}" if largest else ""
    ax.set_title(f"{title}{text}", fontsize="medium", loc="left")


def deflected_picture(
    view: SpaceView, displacement: Floats, touching: Sequence[str], words: tuple[str, str]
) -> Picture:
    """The deflected structure; ``words`` are the title of the picture and of its panel."""
    panel = partial(plot_deflected, view, displacement, touching, words[1])
    return Picture(words[0], [panel], size=view.figure_size, legend_below=True)
