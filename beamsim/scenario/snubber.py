"""One-sided elastic stops ("snubbers") on a beam or on the masses of a chain."""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import Tag

from beamsim.scenario.base import BY_KIND, Schema, fail, known
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

__all__ = ["ChainSnubber", "Snubber", "SnubberDamping", "SnubberRatioDamping", "SnubberViscousDamping", "named"]


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


class _SnubberBase(Schema):
    """What the snubbers of beams and chains share; N = k delta + c delta' while in contact."""

    name: Name = ""
    """Name, unique; snubber_1, snubber_2, ... by default."""
    side: Literal["below", "above"]
    """Below resists negative displacements, above positive ones."""
    mounted_on: Literal["base", "ground"] = "base"
    """Base moves with the excitation of the base; ground doesn't move."""
    stiffness: Stiffness
    """Stiffness while in contact."""
    damping: SnubberDamping | None = None
    """Dashpot beside the spring; none by default."""
    gap: Gap | None = None
    """Clearance: positive is backlash, negative prestress; 0 by default."""
    preload: PositiveForce | None = None
    """Contact force at static equilibrium, instead of gap."""
    law: Literal["kelvin_voigt", "no_tension"] = "kelvin_voigt"
    """Kelvin_voigt: contact as long as there is penetration; no_tension: the snubber leaves when it would pull."""

    def settle(self) -> None:
        """Refuse gap and preload together; give a gap where neither is."""
        if self.preload is None:
            if self.gap is None:
                self.resolve("gap", 0.0)
        elif self.gap is not None:
            raise fail("and gap exclude each other", "keep one of the two; preload finds the gap", ("preload",))


class Snubber(_SnubberBase):
    """A one-sided spring, with or without dashpot, on the beam."""

    position: Position
    """Distance from the left end of the beam."""


class ChainSnubber(_SnubberBase):
    """A one-sided spring, with or without dashpot, on a mass of a chain."""

    mass: MassNumber
    """Number of the mass, from 1."""


AnySnubber = TypeVar("AnySnubber", bound=_SnubberBase)


def named(snubbers: tuple[AnySnubber, ...]) -> tuple[AnySnubber, ...]:
    """Give snubbers without a name their default one, snubber_1, snubber_2, ..."""
    return tuple(
        snubber if not known(snubber.name) or snubber.name else snubber.model_copy(update={"name": f"snubber_{number}"})
        for number, snubber in enumerate(snubbers, start=1)
    )
