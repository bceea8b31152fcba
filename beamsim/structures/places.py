"""Places: a point of a body, a link of two places, a distributed load; and the direction of base motion.

Stations are the points along the bodies where shapes are known; this module also defines their axes in plots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from beamsim.labelled import Dataset
from beamsim.scenario.body import Body
from beamsim.typing import Floats, Ints

TRANSLATIONS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


@dataclass(frozen=True)
class BaseDirection:
    """A unit displacement along an axis, m, or a unit rotation about an axis, rad (right-hand rule).

    Also the direction of gravity, which is equivalent to an opposite acceleration of the base.
    """

    direction: str = ""  # x, y, z, rx, ry or rz; empty: the natural direction of each body, z by default
    axis_point: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, point on the axis of a rotation

    def displacements(self, points: Floats) -> Floats:
        """(k, 3) displacements x, y, z of points (k, 3), m."""
        if self.direction in ROTATIONS:
            return np.cross(np.eye(3)[ROTATIONS.index(self.direction)], points - np.array(self.axis_point))
        return np.tile(np.eye(3)[TRANSLATIONS.index(self.direction or "z")], (points.shape[0], 1))


UPWARDS = BaseDirection()
"""The deflection of beams, plates and masses, and the base direction of imported matrices."""


_HERMITE = 3  # degree of the shape functions


@dataclass(frozen=True)
class LoadedRegion:
    """A distributed load of unit level on a region of a body; its row is its work for a unit of each dof."""

    body: str
    shape: Any  # section of the scenario: see `beamsim.scenario.distributed`
    bounds: tuple[tuple[float, float], ...] | None  # m, along x, and along y on a plate; None for the whole body
    label: str = field(default="", compare=False)  # text for messages

    @property
    def mode(self) -> int | None:
        """Number of the mode that gives the shape; None for other shapes."""
        return self.shape.mode if self.shape.kind == "mode" else None

    def quadrature(self, sizes: Sequence[float] | Floats, cuts: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Points (k, d), m, and weights (k,), m or m^2, of a quadrature over the loaded region.

        Parameters
        ----------
        sizes : length of the body in each direction, m.
        cuts : positions in each direction, m, between which the integrand is smooth.
        """
        bounds = self.bounds or tuple((0.0, size) for size in sizes)
        lines = []
        for along, ((first, last), cut) in enumerate(zip(bounds, cuts, strict=True)):
            corners = (self.shape.x, self.shape.y)[along] if self.shape.kind == "table" else ()
            inner = np.concatenate([cut, np.asarray(corners, dtype=float)])
            ends = np.unique(np.concatenate([[first, last], inner[(inner > first) & (inner < last)]]))
            ends = ends[np.concatenate([[True], np.diff(ends) > 1e-12 * (last - first)])]
            place, weight = np.polynomial.legendre.leggauss(self._points(along))
            half = np.diff(ends)[:, None] / 2
            lines.append(((ends[:-1, None] + half * (place + 1)).ravel(), (half * weight).ravel()))
        grids = np.meshgrid(*(x for x, _ in lines), indexing="ij")
        weights = lines[0][1] if len(lines) == 1 else np.outer(lines[0][1], lines[1][1]).ravel()
        return np.column_stack([grid.ravel() for grid in grids]), weights

    def intensity(
        self, points: Floats, sizes: Sequence[float] | Floats, mode_at: Callable[[int, Floats], Floats]
    ) -> Floats:
        """(k,) factor of the level at points (k, d) of the loaded region, m.

        Parameters
        ----------
        points : (k, d) points of the loaded region, m.
        sizes : (d,) sides of the body, m.
        mode_at : function that gives the deflection of a mode number at points (k, d).

        Returns
        -------
        (k,) array
            Local level relative to that of the load.
        """
        if self.mode is not None:
            return mode_at(self.mode, points)
        bounds = self.bounds or tuple((0.0, size) for size in sizes)
        share = np.array([(points[:, i] - a) / (b - a) for i, (a, b) in enumerate(bounds)])
        shape = self.shape
        if shape.kind == "uniform":
            return np.ones(points.shape[0])
        if shape.kind == "sine":
            return np.asarray(np.prod(np.sin(np.pi * np.array(shape.half_waves)[:, None] * share), axis=0))
        if shape.kind == "table":
            return _interpolate(shape, points)
        table = np.array(shape.coefficients if shape.kind == "polynomial" else shape.values, dtype=float)
        if shape.kind == "linear":  # values at the ends to coefficients of 1 and the fraction
            change = np.array([[1.0, 0.0], [-1.0, 1.0]])
            table = change @ table if table.ndim == 1 else change @ table @ change.T
        if table.ndim == 1:
            return np.asarray(np.polynomial.polynomial.polyval(share[0], table))
        return np.asarray(np.polynomial.polynomial.polyval2d(share[0], share[1], table))

    def _points(self, axis: int) -> int:
        """Number of Gauss points per interval that integrate the shape times a shape function exactly."""
        shape = self.shape
        if shape.kind == "sine":
            # exact to round-off for less than one half wave per interval
            return 12
        degree = {"uniform": 0, "linear": 1, "table": 1, "mode": _HERMITE}.get(shape.kind)
        if degree is None:
            degree = np.array(shape.coefficients).shape[axis] - 1
        return (degree + _HERMITE) // 2 + 1


def _interpolate(table: Any, points: Floats) -> Floats:
    """(k,) values of a table at points (k, d), linear in each direction, zero outside."""
    from scipy.interpolate import RegularGridInterpolator

    axes = [np.array(table.x)] if table.y is None else [np.array(table.x), np.array(table.y)]
    values = RegularGridInterpolator(axes, np.array(table.values, dtype=float), bounds_error=False, fill_value=0.0)
    return np.asarray(values(points), dtype=float)


Point = float | tuple[float, float]

DEFLECTION, SLOPE = "z", "slope"
"""Directions of motion at a place: deflection, m, and its derivative along the body's axis, rad."""
NAMED_ROW = "row"
"""Direction of a place that is one of the ``rows`` of imported matrices; its point is the number of the row, from 0."""


@dataclass(frozen=True)
class Place:
    """A point of a body, and a direction of motion there."""

    body: str
    point: Point  # m along a beam; [x, y] on a plate, m; number of a mass, a node or a member
    direction: str = DEFLECTION
    along: float | None = None  # m, distance along a member of a frame
    label: str = field(default="", compare=False)  # text for messages

    @property
    def coordinate(self) -> float:
        """Coordinate along the body's axis in plots, or x on a plate."""
        return self.point[0] if isinstance(self.point, tuple) else self.point

    @property
    def position_y(self) -> float | None:
        """y on a plate."""
        return self.point[1] if isinstance(self.point, tuple) else None


@dataclass(frozen=True)
class Link:
    """Two places connected by an item; the extension is positive when the second moves up relative to the first."""

    first: Place
    second: Place

    @property
    def label(self) -> str:
        """Text for messages."""
        return f"{self.first.label} – {self.second.label}"

    @property
    def coordinate(self) -> float:
        """Coordinate of the midpoint."""
        return 0.5 * (self.first.coordinate + self.second.coordinate)

    @property
    def position_y(self) -> float | None:
        """y of the midpoint, between points of plates."""
        y = [place.position_y for place in (self.first, self.second) if place.position_y is not None]
        return sum(y) / 2 if len(y) == 2 else None


@dataclass(frozen=True)
class PlaneDirection:
    """A direction in the plane of two places: the motion of each along its own direction, with a factor."""

    first: Place
    second: Place
    factors: tuple[float, float]  # direction cosines, where both directions are perpendicular

    @property
    def label(self) -> str:
        """Text for messages."""
        return f"{self.first.label} and {self.second.label}"

    @property
    def coordinate(self) -> float:
        """Coordinate of the first place."""
        return self.first.coordinate

    @property
    def position_y(self) -> float | None:
        """y of the first place."""
        return self.first.position_y


Site = Place | Link | PlaneDirection

LoadSite = Site | LoadedRegion
"""Place of a load."""


def ends_of(site: LoadSite) -> tuple[Place, ...]:
    """The place, or both places of a link or a plane; empty for a distributed load."""
    if isinstance(site, LoadedRegion):
        return ()
    return (site,) if isinstance(site, Place) else (site.first, site.second)


def signed_ends(site: Site) -> list[tuple[float, Place]]:
    """The places of a site, with the extension for a unit motion of each."""
    if isinstance(site, Place):
        return [(1.0, site)]
    first, second = (-1.0, 1.0) if isinstance(site, Link) else site.factors
    return [(first, site.first), (second, site.second)]


def _of_nodes(name: str, body: Body, place: Any) -> Place:
    """A place of an imported body or a frame: a direction of a node or a point of a member, or a named row."""
    direction, text = place.direction or DEFLECTION, f"node {place.node} {place.direction or DEFLECTION}"
    if place.member is not None:
        number, along = cast("tuple[float, float]", body.point_of(place))
        return Place(name, number, direction, along, f"{name} {place.member} {along:g} m {direction}")
    if place.row is not None:
        direction, text = NAMED_ROW, f"row {place.row}"
    return Place(name, body.point_of(place), direction, label=f"{name} {text}")


def site_of(item: Any, body: str, sections: Mapping[str, Body]) -> Site:
    """Place or link of an item of a scenario.

    Parameters
    ----------
    item : item of the scenario, with one place or two.
    body : default body of a place.
    sections : the bodies by name, for shares of their lengths.

    Returns
    -------
    Place | Link
        In metres.
    """
    sites = []
    for place in item.places:
        name = place.body or body
        if place.node is not None or place.row is not None or place.member is not None:
            sites.append(_of_nodes(name, sections[name], place))
            continue
        point: Any = sections[name].point_of(place)
        if isinstance(point, tuple):
            label = f"({point[0]:g}, {point[1]:g}) m"
        else:
            label, point = f"{point:g} m" if place.mass is None else f"mass {place.mass}", float(point)
        sites.append(Place(name, point, label=f"{name} {label}" if place.body else label))
    if len(sites) == 1:
        return sites[0]
    factors = getattr(item, "factors", None)
    first, second = sites
    return Link(first, second) if factors is None else PlaneDirection(first, second, factors)


def load_site_of(item: Any, body: str, sections: Mapping[str, Body]) -> LoadSite:
    """Place of a load of a scenario, at points or distributed.

    Parameters
    ----------
    item : item of the scenario, with one place, two, or a distributed load.
    body : default body of the load.
    sections : the bodies by name, for shares of their lengths.

    Returns
    -------
    Place | Link | LoadedRegion
        In metres; a distributed load without ends covers the whole body.
    """
    if item.places:
        return site_of(item, body, sections)
    body, ends = item.body or body, item.ends
    shape = item.shape.on_the_body(sections[body]) if item.shape.kind == "table" else item.shape
    if ends is None:
        return LoadedRegion(body, shape, None, f"{body} as a whole")
    first, last = (sections[body].point(end) for end in ends)
    bounds = (first, last) if isinstance(first, tuple) else ((first,), (last,))
    return LoadedRegion(body, shape, tuple(zip(*bounds, strict=True)), f"{body} from {first} to {last} m")


@dataclass(frozen=True)
class StationAxis:
    """Meaning of the coordinate of a body's stations, for files and plots."""

    long_name: str
    unit: str
    label: str
    continuous: bool  # drawn as a line through the stations, else as points


ALONG_BEAM = StationAxis("position along the beam", "m", "Position", continuous=True)
ON_PLATE = StationAxis("position on the plate from its left edge", "m", "x", continuous=True)
MASSES = StationAxis("mass number", "1", "Mass", continuous=False)
NODES = StationAxis("node number", "1", "Node", continuous=False)
AXES = {axis.long_name: axis for axis in (ALONG_BEAM, ON_PLATE, MASSES, NODES)}


@dataclass(frozen=True)
class BodyStations:
    """The stations of one body."""

    body: str
    axis: StationAxis
    stations: slice


@dataclass(frozen=True)
class Stations:
    """The stations of all bodies, in order."""

    bodies: tuple[BodyStations, ...]  # the bodies
    position: Floats  # (nx,) on the axis of each body
    position_y: Floats | None = None  # (nx,) m, y on a plate, NaN on other bodies; None without plates
    points: Floats | None = None  # (nx, 3) m, of nodes of imported bodies, NaN if unknown; None without
    lines: Ints | None = None  # (k, 2) stations to be connected by lines: nodes of the same element
    in_space: Floats | None = None  # (nx, 3, n) x, y, z for a unit of each coordinate, 1/sqrt(kg); NaN if unknown

    @classmethod
    def of_recoveries(cls, bodies: Sequence[Recovery]) -> Stations:
        """The stations of recovered bodies."""
        ends = np.cumsum([0, *(each.position.size for each in bodies)]).tolist()
        parts = zip(bodies, ends[:-1], ends[1:], strict=True)
        known = [start + each.lines for each, start in zip(bodies, ends, strict=False) if each.lines is not None]
        return cls(
            tuple(BodyStations(each.body, each.axis, slice(start, end)) for each, start, end in parts),
            np.concatenate([np.zeros(0), *(each.position for each in bodies)]),
            _join_values([each.position_y for each in bodies], bodies, ()),
            _join_values([each.points for each in bodies], bodies, (3,)),
            np.concatenate(known) if known else None,
            _join_values(
                [each.in_space for each in bodies], bodies, (3, bodies[0].deflection.shape[1] if bodies else 0)
            ),
        )

    @classmethod
    def of_modes(cls, modes: Dataset) -> Stations:
        """The stations of the mode shapes of a result; see `beamsim.system.structural.MODES`."""
        bodies = modes.labels("body")
        sizes = np.bincount(modes["station_body"].values, minlength=len(bodies)) if bodies else np.zeros(0, dtype=int)
        ends = np.cumsum([0, *sizes]).tolist()
        named = zip(bodies, modes["body_axis"].values if bodies else (), ends[:-1], ends[1:], strict=True)
        names = ("position_y", "points", "lines", "shapes_in_space")
        across, points, lines, shapes = (modes[of].values if of in modes else None for of in names)
        return cls(
            tuple(BodyStations(body, AXES[axis], slice(start, end)) for body, axis, start, end in named),
            modes["position"].values, across, points, lines, None if shapes is None else np.moveaxis(shapes, 0, 2),
        )  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Variables for the dataset of modes."""
        sizes = [part.stations.stop - part.stations.start for part in self.bodies]
        columns: dict[str, Any] = {
            "body": [part.body for part in self.bodies],
            "body_axis": [part.axis.long_name for part in self.bodies],
            "station": 1 + np.arange(self.position.size),
            "station_body": np.repeat(np.arange(len(self.bodies)), sizes),
            "position": self.position,
            "position_y": self.position_y,
        }
        if self.points is not None:
            columns |= {"direction": TRANSLATIONS, "points": self.points}
        if self.lines is not None:
            columns |= {"drawn_line": 1 + np.arange(len(self.lines)), "end": np.array([1, 2]), "lines": self.lines}
        if self.in_space is not None:
            columns["shapes_in_space"] = np.moveaxis(self.in_space, 2, 0)
        return columns

    @property
    def position_words(self) -> dict[str, str]:
        """Unit and meaning of the positions of all bodies."""
        axes = {part.axis for part in self.bodies} or {ALONG_BEAM}
        if len(axes) > 1:
            return {"position_unit": "1", "position": "position on the axis of each body"}
        (axis,) = axes
        return {"position_unit": axis.unit, "position": axis.long_name}

    def name(self, station: int) -> str:
        """Text for messages: 135 mm, (135, 60) mm, mass 2; with several bodies inner 135 mm."""
        part = next(part for part in self.bodies if part.stations.start <= station < part.stations.stop)
        x, y = self.position[station], np.nan if self.position_y is None else self.position_y[station]
        if np.isfinite(y):
            name = f"({1e3 * x:.3g}, {1e3 * y:.3g}) mm"
        else:
            name = f"{1e3 * x:.3g} mm" if part.axis.continuous else f"{part.axis.label.lower()} {x:g}"
        return f"{part.body} {name}" if len(self.bodies) > 1 else name


def _join_values(values: Sequence[Floats | None], bodies: Sequence[Recovery], shape: tuple[int, ...]) -> Floats | None:
    """The values of all bodies, NaN for bodies without; None if no body has any."""
    if all(each is None for each in values):
        return None
    nowhere = (np.full((body.position.size, *shape), np.nan) for body in bodies)
    return np.concatenate([none if each is None else each for each, none in zip(values, nowhere, strict=True)])


COMPONENTS = ("x", "y", "xy")
"""Components of the moments, stresses and strains of a plate."""


@dataclass(frozen=True)
class Recovery:
    """Deflection along a body, and its bending moment, for a unit of each coordinate.

    A plate has three moments per width, Mx, My and Mxy: first all stations of Mx, then of My, then of Mxy.
    """

    body: str
    axis: StationAxis
    position: Floats  # (nx,) on the axis
    deflection: Floats  # (nx, n) 1/sqrt(kg)
    # (moments nx, n) N m, of a plate N; E I w'', positive where the top is in compression
    bending_moment: Floats | None = None
    stress_per_moment: Floats | None = None  # (moments nx,) extreme_fibre / I, Pa per N m; None if the fibre is unknown
    strain_per_moment: Floats | None = None  # (nx,) extreme_fibre / (E I), 1/(N m), of a beam
    # for a plate (3, 3) strains x, y, xy of the lower surface for Mx, My, Mxy, 1/N
    strains_per_moments: Floats | None = None
    # (moments nx,) base_moment per m/s^2 of base acceleration: static contribution of the omitted modes; (moments nx,
    # K) of several motions of the base
    base_moment: Floats | None = None
    position_y: Floats | None = None  # (nx,) m, y on a plate
    points: Floats | None = None  # (nx, 3) m, of nodes with coordinates; NaN if unknown
    lines: Ints | None = None  # (k, 2) stations whose nodes belong to the same element
    in_space: Floats | None = None  # (nx, 3, n) x, y and z of a body in space, 1/sqrt(kg)
    moments: int = 1  # moments per station
    direction: str = DEFLECTION

    @property
    def places(self) -> list[Place]:
        """The stations as places."""
        if self.position_y is None:
            return [Place(self.body, float(x), self.direction) for x in self.position]
        return [Place(self.body, (float(x), float(y))) for x, y in zip(self.position, self.position_y, strict=True)]

    def moment_weights(self, x: float, y: float | None, component: str) -> Floats:
        """(moments nx,) weights of moments at a point: 1 at a beam's station, linear between the nodes of a plate.

        Parameters
        ----------
        x, y : m, the point; y is None except on a plate.
        component : for a plate x, y or xy.

        Returns
        -------
        (moments nx,) array
            The moment at the point is the sum of the moments times these weights.
        """
        if self.position_y is None or y is None:
            return np.asarray(np.arange(self.position.size) == np.abs(self.position - x).argmin(), dtype=float)
        along = _linear(self.position, x) * _linear(self.position_y, y)
        return np.concatenate([along if each == component else np.zeros(along.size) for each in COMPONENTS])

    def strain_weights(self, x: float, y: float | None, component: str) -> Floats:
        """(moments nx,) strain of the lower surface at a point for a unit of each moment.

        Parameters
        ----------
        x, y, component : see `moment_weights`.

        Returns
        -------
        (moments nx,) array
            1/(N m), on a plate 1/N.
        """
        if self.strains_per_moments is None:
            assert self.strain_per_moment is not None
            return self.moment_weights(x, y, component) * self.strain_per_moment
        row = self.strains_per_moments[COMPONENTS.index(component)]
        return np.asarray(sum(s * self.moment_weights(x, y, each) for s, each in zip(row, COMPONENTS, strict=True)))


def _linear(nodes: Floats, position: float) -> Floats:
    """(nx,) weights of linear interpolation between nodes, in one direction of a grid."""
    lines = np.unique(nodes)
    i = int(np.clip(np.searchsorted(lines, position), 1, lines.size - 1))
    share = float(np.clip((position - lines[i - 1]) / (lines[i] - lines[i - 1]), 0.0, 1.0))
    return np.where(nodes == lines[i - 1], 1.0 - share, np.where(nodes == lines[i], share, 0.0))


@dataclass(frozen=True)
class StressRows:
    """Bending stress at the extreme fibre of every body with a known section, station by station.

    On a plate first sigma_x at all stations, then sigma_y, then tau_xy.
    """

    stations: Stations
    row: Floats  # (nx, n) Pa for a unit of each coordinate
    base: Floats  # (nx,) Pa per m/s^2 of base acceleration; (nx, K) of several motions of the base
    bodies: tuple[str, ...]  # (nx,) name of each station's body


def stress_rows(recoveries: Sequence[Recovery]) -> StressRows | None:
    """The stresses of all bodies; None if no body has any."""
    rows, base, bodies = [], [], []
    for recovery in recoveries:
        if recovery.bending_moment is not None and recovery.stress_per_moment is not None:
            assert recovery.base_moment is not None
            rows.append(recovery.stress_per_moment[:, None] * recovery.bending_moment)
            base.append((recovery.stress_per_moment * recovery.base_moment.T).T)
            bodies.append(recovery if recovery.moments == 1 else _station_of_each_moment(recovery))
    if not rows:
        return None
    names = tuple(each.body for each in bodies for _ in each.position)
    return StressRows(Stations.of_recoveries(bodies), np.vstack(rows), np.concatenate(base), names)


def _station_of_each_moment(plate: Recovery) -> Recovery:
    """A copy in which each station is repeated for each of its moments."""
    assert plate.position_y is not None
    position, across = np.tile(plate.position, plate.moments), np.tile(plate.position_y, plate.moments)
    return replace(plate, position=position, position_y=across, moments=1)
