"""A chain of lumped masses between two walls."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from beamsim.scenario.base import BY_KIND, Schema, fail, known
from beamsim.scenario.damping import ChainDamping
from beamsim.scenario.quantities import CubicStiffness, Dashpot, Mass, MassNumber, NonNegativeStiffness
from beamsim.scenario.snubber import ChainSnubber, named

__all__ = ["Chain", "CubicGroundSpring", "GroundSpring", "LinearGroundSpring"]


class LinearGroundSpring(Schema):
    """A linear spring from a mass to the ground, which stands still."""

    mass: MassNumber
    """Number of the mass, from 1."""
    kind: Literal["linear"] = "linear"
    """Force = stiffness times displacement."""
    stiffness: NonNegativeStiffness
    """Stiffness."""


class CubicGroundSpring(Schema):
    """A cubic spring from a mass to the ground, which stands still."""

    mass: MassNumber
    """Number of the mass, from 1."""
    kind: Literal["cubic"] = "cubic"
    """Force = stiffness times displacement cubed."""
    stiffness: CubicStiffness
    """Stiffness; negative softens."""


GroundSpring = Annotated[
    Annotated[LinearGroundSpring, Tag("<linear>")] | Annotated[CubicGroundSpring, Tag("<cubic>")],
    BY_KIND,
]


class Chain(Schema):
    """Masses in a row, springs and dashpots between neighbours and to the walls (the base)."""

    masses: Annotated[tuple[Mass, ...], Field(min_length=1)]
    """The n masses."""
    springs: tuple[NonNegativeStiffness, ...]
    """Stiffnesses: wall to 1, 1 to 2, ...; n + 1 values, or n when the last mass is free."""
    dashpots: tuple[Dashpot, ...] = ()
    """Dashpots beside the springs; none by default, else as many as springs."""
    damping: ChainDamping | None = None
    """Damping of the chain as a whole, added to the dashpots."""
    snubbers: tuple[ChainSnubber, ...] = ()
    """One-sided stops."""
    springs_to_ground: tuple[GroundSpring, ...] = ()
    """Springs from masses to the ground, linear or cubic."""

    def settle(self) -> None:
        """Check the lengths of the lists; resolve dashpots and names."""
        if known(self.snubbers):
            self.resolve("snubbers", named(self.snubbers))
        masses, springs, dashpots = len(self.masses), len(self.springs), len(self.dashpots)
        if springs not in (masses, masses + 1):
            raise fail(
                f"has {springs} {'value' if springs == 1 else 'values'} for {masses} masses",
                f"give {masses + 1} (wall to 1, 1 to 2, ... {masses} to wall), or {masses} if the last mass is free",
                ("springs",),
            )
        if dashpots not in (0, springs):
            raise fail(
                f"has {dashpots} {'value' if dashpots == 1 else 'values'} for {springs} springs",
                f"give {springs}, one beside each spring, or leave it out",
                ("dashpots",),
            )
        if not dashpots:
            self.resolve("dashpots", (0.0,) * springs)

    @property
    def count(self) -> int:
        """Number of masses."""
        return len(self.masses)
