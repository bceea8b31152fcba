"""A chain of lumped masses between two walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from beamsim.errors import Problem
from beamsim.scenario.base import InvalidValueError, Path, count_text, problem
from beamsim.scenario.body import NUMBERED, AtPlace, Body, ChainDamping
from beamsim.scenario.connections import AnySnubber, GroundSpring, LinkSpring
from beamsim.scenario.quantities import Dashpot, Mass, NonNegativeStiffness, Share


class Chain(Body):
    """Masses in a row, springs and dashpots between neighbours and to the walls (the base)."""

    body_kind: ClassVar[str] = "chain"
    load_remedy: ClassVar[str] = "list forces on its masses: excitation: {kind: forces, forces: [...]}"
    reduced_by_default: ClassVar[bool] = False
    place_remedy: ClassVar[str] = "give a mass by its number, mass: 1"

    masses: Annotated[tuple[Mass, ...], Field(min_length=1)]
    """The n masses."""
    springs: tuple[NonNegativeStiffness, ...]
    """Stiffnesses: wall to 1, 1 to 2, ...; n + 1 values, or n if the last mass is free."""
    dashpots_: tuple[Dashpot, ...] = Field(default=(), alias="dashpots")
    """Dashpots parallel to the springs, one for each; none by default."""
    damping: ChainDamping | None = None
    """Damping of the chain as a whole, added to the dashpots."""
    snubbers: Annotated[tuple[AnySnubber, ...], NUMBERED] = ()
    """One-sided stops on masses, and bumpers and cables between masses."""
    springs_to_ground: Annotated[tuple[GroundSpring, ...], NUMBERED] = ()
    """Springs from masses to the ground, linear, cubic or piecewise linear."""
    springs_between: Annotated[tuple[LinkSpring, ...], NUMBERED] = ()
    """Additional springs between any two masses, linear, cubic or piecewise linear."""
    kind: Literal["chain"] = "chain"
    """A chain of masses."""

    def check(self) -> None:
        """Check the lengths of the lists."""
        masses, springs, dashpots = len(self.masses), len(self.springs), len(self.dashpots_)
        if springs not in (masses, masses + 1):
            raise InvalidValueError(
                f"has {count_text(springs, 'value')} for {count_text(masses, 'mass', 'masses')}",
                f"give {masses + 1} (wall to 1, 1 to 2, ... {masses} to wall), or {masses} if the last mass is free",
                ("springs",),
            )
        if dashpots not in (0, springs):
            raise InvalidValueError(
                f"has {count_text(dashpots, 'value')} for {count_text(springs, 'spring')}",
                f"give {springs}, one in parallel with each spring, or leave it out",
                ("dashpots",),
            )

    @property
    def dashpots(self) -> tuple[float, ...]:
        """Coefficient of the dashpot parallel to each spring, N s/m."""
        return self.dashpots_ or (0.0,) * len(self.springs)

    @property
    def count(self) -> int:
        """Number of masses."""
        return len(self.masses)

    @property
    def mode_count(self) -> int:
        """Number of modes: one for each mass."""
        return self.count

    @property
    def rough_frequency_hz(self) -> float:
        """Frequency of the lightest mass on the stiffest spring that is not cubic, Hz."""
        slopes = list(self.springs)
        for spring in (*self.springs_to_ground, *self.springs_between):
            if spring.kind == "piecewise_linear":
                slopes.extend(spring.stiffnesses)
            elif spring.kind != "cubic":
                slopes.append(spring.stiffness)
        return math.sqrt(max(slopes) / min(self.masses)) / (2.0 * math.pi)

    @property
    def spring_links(self) -> tuple[tuple[float | None, float | None], ...]:
        """Neighbouring masses, and walls, that a spring connects."""
        ends = [None, *map(float, range(1, self.count + 1)), None]
        return tuple(pair for pair, stiffness in zip(pairwise(ends), self.springs, strict=False) if stiffness > 0.0)

    def default_probe(self) -> tuple[str, AtPlace]:
        """The last mass."""
        return f"mass_{self.count}", AtPlace(mass=self.count)

    def mass_problems(self, body_path: Path, path: Path, mass: int) -> Iterator[Problem]:
        """A problem if the number of a mass is too large.

        Parameters
        ----------
        body_path, path, mass : see `beamsim.scenario.body.Body.mass_problems`.

        Yields
        ------
        Problem
        """
        if mass > self.count:
            yield problem(
                path,
                f"= {mass}, but the chain has {count_text(self.count, 'mass', 'masses')}",
                f"masses are numbered from 1 to {self.count}" if self.count > 1 else "its number is 1",
            )

    def shape_problems(self, body_path: Path, path: Path, position: float | Share) -> Iterator[Problem]:
        """Problems of the mass at which a mode shape was measured.

        Parameters
        ----------
        body_path, path, position : see `beamsim.scenario.body.Body.shape_problems`.

        Yields
        ------
        Problem
        """
        if position not in range(1, self.count + 1):
            remedy = f"masses are numbered from 1 to {self.count}"
            yield problem(path, f"= {position:g} is not the number of a mass", remedy)

    def power_of_start(self, index: int) -> int:
        """0: each mass has its own number."""
        return 0

    def start_problems(self, path: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """A problem unless there is one number for each mass.

        Parameters
        ----------
        path, numbers : see `beamsim.scenario.body.Body.start_problems`.

        Yields
        ------
        Problem
        """
        if numbers and len(numbers) != self.count:
            given = f"has {count_text(len(numbers), 'number')} for {count_text(self.count, 'mass', 'masses')}"
            yield problem(path, given, "give one number per mass, or leave it out")
