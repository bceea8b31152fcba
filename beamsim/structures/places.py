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
    masses = getattr(item, "between", None) or getattr(item, "masses", None)
    if masses is not None:
        # Displacements count from the wall at mass 1, as in the chain's own springs: the higher mass less the lower.
        low, high = sorted(masses)
        return Link(_on_mass(body, low), _on_mass(body, high))
    position = getattr(item, "position", None)
    return _on_mass(body, item.mass) if position is None else Place(body, float(position), label=f"{position:g} m")


def _on_mass(body: str, number: int) -> Place:
    return Place(body, float(number), label=f"mass {number}")
