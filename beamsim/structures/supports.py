"""What holds a body, and what couples bodies; the forces of both follow in `beamsim.structures.support_forces`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from beamsim.structures.places import Place, Site, ends_of
from beamsim.typing import Floats


@dataclass(frozen=True)
class Coupling:
    """What acts between two places, or a place and the base or the ground, in one direction of motion."""

    name: str  # of the joint or spring
    site: Site  # a place alone is coupled to the base, or to the ground
    stiffness: float | None  # N/m or N m/rad; None where nothing moves apart
    dashpot: float = 0.0  # N s/m or N m s/rad
    to_ground: bool = False  # which stays where it is when the base moves

    @property
    def ends(self) -> tuple[Place, ...]:
        """One place or two."""
        return ends_of(self.site)


@dataclass(frozen=True)
class Hold:
    """What holds one direction of motion of a body: degrees of freedom that it fixes, or a spring."""

    name: str  # left, right, bottom, top, point 1, node 3, base
    direction: str  # of the motion: a force of a displacement, a moment of a rotation
    base_motion: float  # how far it moves with a unit motion of the base
    motion: Floats | None = None  # (all dofs of the body,) when it moves by one unit and the free ones stay at zero
    spring: Coupling | None = None  # between the body and what moves


@dataclass(frozen=True)
class UnitMotion:
    """Fields of the bodies when a support moves by one unit and the structure's degrees of freedom stay at zero."""

    fields: Mapping[str, Floats]  # by body (all dofs,), those that supports hold included
