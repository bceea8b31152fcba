"""One-sided elastic stops ("snubbers") on a beam, on the masses of a chain and between them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Tag

from beamsim.scenario.base import BY_KIND, Schema, by_key, fail
from beamsim.scenario.names import Named
from beamsim.scenario.quantities import (
    Dashpot,
    Gap,
    MassNumber,
    Name,
    Position,
    PositiveForce,
    Ratio,
    Stiffness,
)
from beamsim.scenario.spring import Pair, check_pair


class SnubberRatioDamping(Schema):
    """Dashpot by a damping ratio: c = 2 ratio k / Omega.

    Omega is the first natural frequency with only this snubber closed.
    """

    kind: Literal["ratio"] = "ratio"
    """Dashpot by a damping ratio."""
    ratio: Ratio
    """Damping ratio, of the first natural frequency with only this snubber closed."""


class SnubberViscousDamping(Schema):
    """Dashpot by its coefficient."""

    kind: Literal["viscous"] = "viscous"
    """Dashpot by its coefficient."""
    coefficient: Dashpot
    """Force per unit velocity while in contact."""


SnubberDamping = Annotated[
    Annotated[SnubberRatioDamping, Tag("<ratio>")] | Annotated[SnubberViscousDamping, Tag("<viscous>")],
    BY_KIND,
]


class SnubberBase(Named):
    """Common part of all snubbers; N = k delta + c delta' while in contact."""

    name: Name = ""
    """Name, unique; snubber_1, snubber_2, ... by default."""
    stiffness: Stiffness
    """Stiffness while in contact."""
    damping: SnubberDamping | None = None
    """Dashpot parallel to the spring; none by default."""
    gap: Gap | None = None
    """Clearance: positive is backlash, negative prestress; 0 by default."""
    preload: PositiveForce | None = None
    """Contact force at static equilibrium, instead of gap."""
    law: Literal["kelvin_voigt", "no_tension"] = "kelvin_voigt"
    """Kelvin_voigt: contact as long as there is penetration; no_tension: contact until the force would be tensile."""

    def settle(self) -> None:
        """Reject gap and preload together; the default gap is 0."""
        if self.preload is None:
            if self.gap is None:
                self.resolve("gap", 0.0)
        elif self.gap is not None:
            raise fail(
                "and gap exclude each other", "keep one of the two; the gap follows from the preload", ("preload",)
            )


class _Stop(SnubberBase):
    """A snubber mounted on the base or on the ground."""

    side: Literal["below", "above"]
    """Below resists negative displacements, above positive ones."""
    mounted_on: Literal["base", "ground"] = "base"
    """Base: moves with the base excitation; ground: fixed."""


class Snubber(_Stop):
    """A one-sided spring, with or without dashpot, on the beam."""

    position: Position
    """Distance from the left end of the beam."""


class MassSnubber(_Stop):
    """A one-sided spring, with or without dashpot, on a mass of a chain."""

    mass: MassNumber
    """Number of the mass, from 1."""


class LinkSnubber(SnubberBase):
    """A one-sided spring, with or without dashpot, between two masses of a chain."""

    between: Pair
    """Numbers of the two masses, neighbours or not."""
    resists: Literal["approach", "separation"] = "approach"
    """Approach: a bumper that acts when the masses approach; separation: a cable that acts when they separate."""

    def settle(self) -> None:
        """Demand two different masses."""
        check_pair(self.between, "between")
        super().settle()


def choose_place(value: Any) -> str | None:
    """Tag of the place a raw value means; none where it means no place or two."""
    if isinstance(value, MassSnubber):
        return "<mass>"
    if isinstance(value, LinkSnubber):
        return "<between>"
    if isinstance(value, dict):
        on, between = value.get("mass") is not None, value.get("between") is not None
        if on != between:
            return "<mass>" if on else "<between>"
    return None


ChainSnubber = Annotated[
    Annotated[MassSnubber, Tag("<mass>")] | Annotated[LinkSnubber, Tag("<between>")],
    by_key(
        choose_place,
        "must name one mass or the two it acts between",
        "give mass: 1 with side: below or above, or between: [1, 2] with resists: approach or separation, not both",
    ),
]
