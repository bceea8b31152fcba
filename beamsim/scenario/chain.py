"""A chain of lumped masses between two walls."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from beamsim.scenario.base import Path, fail, known
from beamsim.scenario.body import Body
from beamsim.scenario.damping import ChainDamping
from beamsim.scenario.names import named
from beamsim.scenario.quantities import Dashpot, Mass, NonNegativeStiffness
from beamsim.scenario.snubber import ChainSnubber
from beamsim.scenario.spring import GroundSpring, LinkSpring


class Chain(Body):
    """Masses in a row, springs and dashpots between neighbours and to the walls (the base)."""

    body_kind: ClassVar[str] = "chain"
    reduced_by_default: ClassVar[bool] = False

    masses: Annotated[tuple[Mass, ...], Field(min_length=1)]
    """The n masses."""
    springs: tuple[NonNegativeStiffness, ...]
    """Stiffnesses: wall to 1, 1 to 2, ...; n + 1 values, or n if the last mass is free."""
    dashpots: tuple[Dashpot, ...] = ()
    """Dashpots parallel to the springs; none by default, otherwise as many as springs."""
    damping: ChainDamping | None = None
    """Damping of the chain as a whole, added to the dashpots."""
    snubbers: tuple[ChainSnubber, ...] = ()
    """One-sided stops on masses, and bumpers and cables between masses."""
    springs_to_ground: tuple[GroundSpring, ...] = ()
    """Springs from masses to the ground, linear, cubic or piecewise linear."""
    springs_between: tuple[LinkSpring, ...] = ()
    """Additional springs between any two masses, linear, cubic or piecewise linear."""

    def settle(self) -> None:
        """Check the lengths of the lists; resolve dashpots and names."""
        for name, prefix in (
            ("snubbers", "snubber"), ("springs_to_ground", "ground_spring"), ("springs_between", "link_spring"),
        ):  # fmt: skip
            if known(items := self.__dict__[name]):
                self.resolve(name, named(items, prefix))
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

    @property
    def own_snubbers(self) -> tuple[Any, ...]:
        """Snubbers listed in the body itself, under ``snubbers``."""
        return self.snubbers

    def nonlinear_springs(self) -> list[tuple[Path, Any]]:
        """Springs of the body that are not linear, with their paths below the body."""
        return [
            ((name, index), spring)
            for name in ("springs_to_ground", "springs_between")
            for index, spring in enumerate(getattr(self, name))
            if spring.kind != "linear"
        ]

    @property
    def stiffest_spring(self) -> float:
        """Largest slope of a linear or piecewise-linear spring, N/m."""
        slopes = list(self.springs)
        for spring in (*self.springs_to_ground, *self.springs_between):
            if spring.kind == "linear":
                slopes.append(spring.stiffness)
            elif spring.kind == "piecewise_linear":
                slopes.extend(spring.stiffnesses)
        return max(slopes)
