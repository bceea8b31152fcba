"""Where something sits: a place of a body, or a link between two places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from beamsim.scenario.body import Body
from beamsim.structures.distributed import Distributed

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


def bodies_at(site: LoadSite) -> tuple[str, ...]:
    """Names of the bodies that something there acts on, one or two."""
    if isinstance(site, Distributed):
        return (site.body,)
    return tuple(dict.fromkeys(end.body for end in ends_of(site)))


def separated(sites: Sequence[LoadSite]) -> list[LoadSite]:
    """The same with the places of a link apart, each once."""
    apart: dict[LoadSite, None] = {}
    for site in sites:
        apart |= dict.fromkeys(ends_of(site) if isinstance(site, Link) else (site,))
    return list(apart)


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
    """Where a load of a scenario acts, at points or distributed; parameters as those of `site_of`."""
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
