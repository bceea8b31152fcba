"""Places on a structure, with probes and constant forces."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Tag

from beamsim.scenario.base import Schema, by_key, fail
from beamsim.scenario.quantities import Force, MassNumber, Name, Position


class AtPosition(Schema):
    """A point of the beam."""

    position: Position
    """Distance from the left end."""


class AtMass(Schema):
    """A mass of the chain."""

    mass: MassNumber
    """Number of the mass, from 1."""


def choose_place(value: Any) -> str | None:
    """Tag of the place a raw value means."""
    if isinstance(value, AtPosition):
        return "<position>"
    if isinstance(value, AtMass):
        return "<mass>"
    if isinstance(value, dict):
        if "position" in value:
            return "<position>"
        if "mass" in value:
            return "<mass>"
    return None


Point = Annotated[
    Annotated[AtPosition, Tag("<position>")] | Annotated[AtMass, Tag("<mass>")],
    by_key(choose_place, "names no place", "write {position: 270 mm} on a beam or {mass: 2} on a chain"),
]


class OneOfTwoPlaces(Schema):
    """An item at a position of the beam or on a mass of the chain."""

    position: Position | None = None
    """Distance from the left end of the beam."""
    mass: MassNumber | None = None
    """Number of the mass of the chain, from 1."""

    def settle(self) -> None:
        """Demand exactly one place."""
        if self.position is None and self.mass is None:
            raise fail("names no place", "give position: 270 mm on a beam, or mass: 2 on a chain")
        if self.position is not None and self.mass is not None:
            raise fail("and position exclude each other", "position belongs to a beam, mass to a chain", ("mass",))

    @property
    def place(self) -> AtPosition | AtMass:
        """Where it is."""
        if self.position is not None:
            return AtPosition(position=self.position)
        assert self.mass is not None
        return AtMass(mass=self.mass)


class Probe(OneOfTwoPlaces):
    """A point whose motion is recorded."""

    name: Name
    """Name, unique; it names the datasets of the result file."""


class PlacedForce(OneOfTwoPlaces):
    """A force at a point, upwards."""

    force: Force
    """The force, positive upwards (towards positive displacement)."""


class ConstantForce(PlacedForce):
    """A dead load at a point."""
