"""What supports, joints and springs hold, as forces on the degrees of freedom of a structure.

What they exert in a motion follows in `beamsim.structures.support_forces`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from typing import Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.base_motion import UPWARDS, BaseDirection
from beamsim.structures.distributed import Distributed
from beamsim.structures.places import DEFLECTION, Link, Place, Site
from beamsim.typing import Floats, Ints

Share = Callable[[Place | Distributed], float]


def _none(place: Place | Distributed) -> float:
    return 0.0


def _no_force(other: Support) -> Floats:
    return np.zeros(3)


@dataclass(frozen=True)
class Support:
    """What a unit motion of the place that holds a structure does to its degrees of freedom while they stay at zero."""

    name: str  # left, right, bottom, top, point 1, node 3, wall; of a joint or spring its own
    direction: str  # of the motion: a force of a displacement, a moment of a rotation
    stiffness: Floats  # (N,) N/m, force that holds the degrees of freedom
    mass: Floats  # (N,) kg
    damping: Floats  # (N,) N s/m
    inertia: float = 0.0  # kg, force on the support itself under a unit acceleration of the base
    direct: Share = field(default=_none)  # share of a unit load that goes to it with all dofs at zero
    base_motion: float = 1.0  # how far it moves with a unit displacement of the base
    body: str = ""  # that it holds; empty for joints and springs
    at: Site | None = None  # of a joint or spring
    determined: bool = True  # whether nothing else holds the same
    to_ground: bool = False  # whether it is the ground that holds, not the base or another body
    base_displacement: float = 0.0  # N/m, force on the support itself for a unit displacement of the base
    # by body the motion itself: (A,) of all dofs before supports hold some, or (N,) of those that they leave
    motions: Mapping[str, Floats] = field(default_factory=dict)
    # kg and N/m, `inertia` and `base_displacement` for another motion of the base; None where both are zero
    under: Callable[[BaseDirection], tuple[float, float]] | None = None
    # by body (3, N of the body): N/m, kg and N s/m, what holds the dofs of the body alone
    forces: Mapping[str, Floats] = field(default_factory=dict)
    # (3,) force on it per displacement, acceleration and velocity of another support of the body, or of itself
    beside: Callable[[Support], Floats] = field(default=_no_force)
    # by name of a joint's spring its stiffness, N/m, dashpot, N s/m, and stretch for a unit motion
    stretches: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)

    def on_body(self, body: str, other: Support) -> Floats:
        """(3,) force on it per displacement (N/m), acceleration and velocity of another one, by what one body resists.

        All degrees of freedom stay at zero.
        """
        for moved, held in ((other, self), (self, other)):
            if moved.is_constraint and body in moved.motions:
                return np.asarray(held.forces[body] @ moved.motions[body]) if body in held.forces else np.zeros(3)
        return self.beside(other) if self.body == other.body == body else np.zeros(3)

    def between(self, other: Support) -> Floats:
        """(3,) the same by all bodies and the springs between them."""
        total = sum((self.on_body(body, other) for body in self.forces), np.zeros(3))
        for name, (stiffness, dashpot, stretch) in self.stretches.items():
            if name in other.stretches:
                total += np.array([stiffness, 0.0, dashpot]) * stretch * other.stretches[name][2]
        return total

    @property
    def is_constraint(self) -> bool:
        """Whether it is a joint that holds without a spring."""
        return self.at is not None and bool(self.motions)

    def base_forces(self, motion: BaseDirection) -> tuple[float, float]:
        """Forces on the support itself for a unit acceleration, kg, and a unit displacement of the base, N/m."""
        if motion == UPWARDS:
            return self.inertia, self.base_displacement
        return (0.0, 0.0) if self.under is None else self.under(motion)

    @property
    def on_base(self) -> bool:
        """Whether it is the base that holds the structure there."""
        return not self.to_ground and not isinstance(self.at, Link)

    def mapped(self, expansion: Callable[[Floats], Floats]) -> Support:
        """The same on the degrees of freedom of a larger structure."""
        return replace(
            self,
            stiffness=expansion(self.stiffness),
            mass=expansion(self.mass),
            damping=expansion(self.damping),
        )


@dataclass(frozen=True)
class HeldMatrices:
    """Matrices of a body before its supports hold degrees of freedom of it."""

    mass: Any  # (A, A) sparse, scaled as that of the body
    factor: Any  # (p, A) sparse B with K = B^T B, likewise
    damping: Any  # (A, A) sparse, N s/m; None without
    scales: tuple[float, float]  # kg, N/m
    free: Ints  # (N,) which of the A are left
    rigid: Callable[[BaseDirection], Floats]  # (A,) displacement for a unit motion of the base
    row: Callable[[Place | Distributed], Floats]  # (A,) deflection at a place, or load vector

    def support(self, name: str, direction: str, motion: Floats, body: str) -> Support:
        """The support that moves all held degrees of freedom by ``motion`` (A,), which is zero on the free ones."""
        moved = self.scales[0] * (self.mass @ motion)
        force = self.scales[1] * (self.factor.T @ (self.factor @ motion))
        damping = np.zeros(motion.size) if self.damping is None else self.damping @ motion

        def direct(place: Place | Distributed) -> float:
            return float(self.row(place) @ motion)

        def beside(other: Support) -> Floats:
            return whole @ other.motions[body] if body in other.motions else np.zeros(3)

        whole = np.array([force, moved, damping])
        return Support(
            name, direction, force[self.free], moved[self.free], damping[self.free],
            inertia=float(moved @ self.rigid(UPWARDS)), direct=direct,
            base_motion=1.0 if direction == DEFLECTION else 0.0, body=body, motions={body: motion},
            under=lambda base: (float(moved @ self.rigid(base)), 0.0), forces={body: whole[:, self.free]},
            beside=beside,
        )  # fmt: skip


def spring_support(
    name: str, direction: str, motion: Floats, stiffness: float, dashpot: float, body: str, *, to_ground: bool = False
) -> Support:
    """A spring and dashpot (N/m, N s/m) that stretch by the motion (N,) for a unit of each degree of freedom."""

    def beside(other: Support) -> Floats:
        same = (other.name, other.direction, other.body) == (name, direction, body)
        return np.array([stiffness, 0.0, dashpot]) if same else np.zeros(3)

    held, none, dragged = rows = np.array([-stiffness * motion, np.zeros(motion.size), -dashpot * motion])
    return Support(
        name, direction, held, none, dragged,
        base_motion=1.0 if direction == DEFLECTION and not to_ground else 0.0, body=body,
        to_ground=to_ground, base_displacement=-stiffness if to_ground else 0.0,
        forces={body: rows} if body else {}, beside=beside,
    )  # fmt: skip
