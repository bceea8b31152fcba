"""Where something sits or acts: a place of a body, a link of two places, a distributed load; how the base moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beamsim.scenario.body import Body
from beamsim.typing import Floats

TRANSLATIONS = ("x", "y", "z")
ROTATIONS = ("rx", "ry", "rz")


@dataclass(frozen=True)
class BaseDirection:
    """One unit of displacement along an axis, m, or of rotation about one, rad; the right-hand rule gives its sense.

    Also the direction of gravity, which acts as an acceleration of the base the other way.
    """

    direction: str = ""  # x, y, z, rx, ry or rz; empty: that of each body, z where it has none
    about: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, a point on the axis of a rotation

    def displacements(self, points: Floats) -> Floats:
        """(k, 3) displacements x, y, z of points (k, 3), m."""
        if self.direction in ROTATIONS:
            return np.cross(np.eye(3)[ROTATIONS.index(self.direction)], points - np.array(self.about))
        return np.tile(np.eye(3)[TRANSLATIONS.index(self.direction or "z")], (points.shape[0], 1))


UPWARDS = BaseDirection()
"""The deflection of beams, plates and masses, and the direction that imported matrices name."""


_HERMITE = 3  # degree of the shape functions


@dataclass(frozen=True)
class Distributed:
    """A load of unit level on a part of a body; its row is the work of that load on a unit of each dof."""

    body: str
    shape: Any  # section of the scenario: see `beamsim.scenario.distributed`
    bounds: tuple[tuple[float, float], ...] | None  # m, along x, and along y on a plate; None for the whole body
    label: str = field(default="", compare=False)  # for people

    @property
    def mode(self) -> int | None:
        """Number of the body's mode that gives the shape; None for other shapes."""
        return self.shape.mode if self.shape.kind == "mode" else None

    def quadrature(self, sizes: Sequence[float] | Floats, cuts: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Points (k, d) in m and weights (k,) in m or m^2 of an integral over the loaded part.

        Parameters
        ----------
        sizes : length of the body in each direction, m.
        cuts : in each direction positions, m, between which the integrand is smooth.
        """
        bounds = self.bounds or tuple((0.0, size) for size in sizes)
        lines = []
        for axis, ((first, last), cut) in enumerate(zip(bounds, cuts, strict=True)):
            corners = (self.shape.x, self.shape.y)[axis] if self.shape.kind == "table" else ()
            inner = np.concatenate([cut, np.asarray(corners, dtype=float)])
            ends = np.unique(np.concatenate([[first, last], inner[(inner > first) & (inner < last)]]))
            ends = ends[np.concatenate([[True], np.diff(ends) > 1e-12 * (last - first)])]
            place, weight = np.polynomial.legendre.leggauss(self._points(axis))
            half = np.diff(ends)[:, None] / 2
            lines.append(((ends[:-1, None] + half * (place + 1)).ravel(), (half * weight).ravel()))
        grids = np.meshgrid(*(x for x, _ in lines), indexing="ij")
        weights = lines[0][1] if len(lines) == 1 else np.outer(lines[0][1], lines[1][1]).ravel()
        return np.column_stack([grid.ravel() for grid in grids]), weights

    def intensity(
        self, points: Floats, sizes: Sequence[float] | Floats, mode_at: Callable[[int, Floats], Floats]
    ) -> Floats:
        """(k,) factor of the level at points (k, d) of the loaded part, m; ``mode_at`` gives the body's mode there.

        Parameters
        ----------
        points : (k, d) of the loaded part, m.
        sizes : (d,) sides of the body, m.
        mode_at : the deflection of a mode, by its number, at points (k, d).

        Returns
        -------
        (k,) array
            Level there over that of the load.
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
            return _interpolated(shape, points)
        table = np.array(shape.coefficients if shape.kind == "polynomial" else shape.values, dtype=float)
        if shape.kind == "linear":  # values at the ends to coefficients of 1 and the share
            change = np.array([[1.0, 0.0], [-1.0, 1.0]])
            table = change @ table if table.ndim == 1 else change @ table @ change.T
        if table.ndim == 1:
            return np.asarray(np.polynomial.polynomial.polyval(share[0], table))
        return np.asarray(np.polynomial.polynomial.polyval2d(share[0], share[1], table))

    def _points(self, axis: int) -> int:
        """Gauss points a piece that integrate the shape times a shape function exactly."""
        shape = self.shape
        if shape.kind == "sine":
            # exact to round-off below one half wave a piece
            return 12
        degree = {"uniform": 0, "linear": 1, "table": 1, "mode": _HERMITE}.get(shape.kind)
        if degree is None:
            degree = np.array(shape.coefficients).shape[axis] - 1
        return (degree + _HERMITE) // 2 + 1


def _interpolated(table: Any, points: Floats) -> Floats:
    """(k,) values of a table at points (k, d), linear in each direction, zero outside."""
    from scipy.interpolate import RegularGridInterpolator

    axes = [np.array(table.x)] if table.y is None else [np.array(table.x), np.array(table.y)]
    values = RegularGridInterpolator(axes, np.array(table.values, dtype=float), bounds_error=False, fill_value=0.0)
    return np.asarray(values(points), dtype=float)


Point = float | tuple[float, float]

DEFLECTION, SLOPE = "z", "slope"
"""Directions of motion at a place: the deflection, m, and its derivative along the body's axis, rad."""


@dataclass(frozen=True)
class Place:
    """A point of a body and a direction of motion there."""

    body: str
    point: Point  # m along a beam; [x, y] on a plate, m; number of a mass
    direction: str = DEFLECTION
    label: str = field(default="", compare=False)  # for people

    @property
    def coordinate(self) -> float:
        """Where it is drawn along the body's axis, or its x on a plate."""
        return self.point[0] if isinstance(self.point, tuple) else self.point

    @property
    def across(self) -> float | None:
        """Its y on a plate."""
        return self.point[1] if isinstance(self.point, tuple) else None


@dataclass(frozen=True)
class Link:
    """Two places that something acts between; it stretches when the second moves away from the first, upwards."""

    first: Place
    second: Place

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.first.label} – {self.second.label}"

    @property
    def coordinate(self) -> float:
        """Halfway."""
        return 0.5 * (self.first.coordinate + self.second.coordinate)

    @property
    def across(self) -> float | None:
        """The same of y, between points of plates."""
        y = [place.across for place in (self.first, self.second) if place.across is not None]
        return sum(y) / 2 if len(y) == 2 else None


Site = Place | Link

LoadSite = Site | Distributed
"""Where a load acts."""


def ends_of(site: LoadSite) -> tuple[Place, ...]:
    """The place, or both places of a link; none of a distributed load."""
    if isinstance(site, Distributed):
        return ()
    return (site.first, site.second) if isinstance(site, Link) else (site,)


def signed_ends(site: Site) -> list[tuple[float, Place]]:
    """The places of a site, each with the sign of the stretch there for a unit motion of it."""
    return [(-1.0, site.first), (1.0, site.second)] if isinstance(site, Link) else [(1.0, site)]


def site_of(item: Any, body: str, sections: Mapping[str, Body]) -> Site:
    """Where something of a scenario sits.

    Parameters
    ----------
    item : of the scenario; it has one place or two.
    body : meant where a place names none.
    sections : the bodies by name, which tell where shares of their lengths are.

    Returns
    -------
    Place | Link
        In metres.
    """
    first, *second = (_resolved(place, body, sections) for place in item.places)
    return Link(first, second[0]) if second else first


def load_site_of(item: Any, body: str, sections: Mapping[str, Body]) -> LoadSite:
    """Where a load of a scenario acts, at points or distributed.

    Parameters
    ----------
    item : of the scenario; it has one place, two, or none where it is distributed.
    body : meant where the load names none.
    sections : the bodies by name, which tell where shares of their lengths are.

    Returns
    -------
    Place | Link | Distributed
        In metres; a distributed load without ends acts on the whole body.
    """
    if item.places:
        return site_of(item, body, sections)
    body, ends = item.body or body, item.ends
    shape = item.shape.on_the_body(sections[body]) if item.shape.kind == "table" else item.shape
    if ends is None:
        return Distributed(body, shape, None, f"{body} as a whole")
    first, last = (sections[body].point(end) for end in ends)
    bounds = (first, last) if isinstance(first, tuple) else ((first,), (last,))
    return Distributed(body, shape, tuple(zip(*bounds, strict=True)), f"{body} from {first} to {last} m")


def _resolved(place: Any, body: str, sections: Mapping[str, Body]) -> Place:
    named_body = place.body or body
    point = sections[named_body].point_of(place)
    if place.node is not None:
        direction = place.direction or DEFLECTION
        label = f"{named_body} node {place.node} {direction}"
        return Place(named_body, float(place.node), direction, label=label)
    if isinstance(point, tuple):
        label = f"({point[0]:g}, {point[1]:g}) m"
    else:
        label, point = f"{point:g} m" if place.mass is None else f"mass {place.mass}", float(point)
    return Place(named_body, point, label=f"{named_body} {label}" if place.body else label)
