"""Where something sits: a place of a body, or a link between two places."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Place:
    """A point of a body and a direction of motion there."""

    body: str
    point: float  # m along a beam; number of a mass
    direction: str = "w"
    label: str = field(default="", compare=False)  # for people

    @property
    def coordinate(self) -> float:
        """Where it is drawn along the body's axis."""
        return self.point


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
        return 0.5 * (self.first.point + self.second.point)


Site = Place | Link


def site_of(item: Any, body: str) -> Site:
    """Where something of a scenario sits; ``body`` is meant where it names none."""
    first, *second = (_resolved(place, body) for place in item.places)
    return Link(first, second[0]) if second else first


def _resolved(place: Any, body: str) -> Place:
    named_body = place.body or body
    label = f"{place.position:g} m" if place.mass is None else f"mass {place.mass}"
    return Place(named_body, float(place.point), label=f"{named_body} {label}" if place.body else label)
