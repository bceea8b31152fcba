r"""Forces of supports, joints and springs, from equilibrium with the inertia of the motion.

For a unit motion of a restrained place s, with no other load, the structure takes the static shape :math:`\psi`. By
virtual work along it, the force on the structure at s is

.. math:: R = \psi^T (M \ddot u_a + D \dot u - f) + d_s^T \dot u,

with :math:`u_a` the absolute motion, D the dashpots and viscous damping, f the other forces, and :math:`d_s` the
dashpot of the support itself. The share of a force that s carries is the value of :math:`\psi` at the force. Elastic
forces cancel, so that R converges as fast as the accelerations, and all reactions together balance loads and inertia
exactly for any number of modes. Modal and Rayleigh damping act on the deformation relative to :math:`\psi` and cancel
with the elastic forces. Moving supports contribute by their own displacement, velocity and acceleration: the force on s
with all other degrees of freedom at rest, and their work along :math:`\psi`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from beamsim.structures.places import (
    DEFLECTION,
    SLOPE,
    UPWARDS,
    BaseDirection,
    Link,
    LoadedRegion,
    LoadSite,
    Place,
    PlaneDirection,
    Site,
    signed_ends,
)
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import Coupling, MemberBody, Structure, UnitMotion
from beamsim.typing import Floats


@dataclass(frozen=True)
class Support:
    """A restrained place of a structure, with its reaction as a linear function of motion and loads.

    It is defined by its own unit motion with all degrees of freedom of the structure at zero.
    """

    structure: Structure
    name: str  # name of the support of a body, or of the joint or spring
    direction: str  # of the motion: a force of a displacement, a moment of a rotation
    base_motion: float  # its motion for a unit motion of the base
    body: str = ""  # its body; empty for joints and springs
    site: Site | None = None  # of a joint or spring
    # motion of the fixed dofs, for each body (all its dofs,)
    fixed_motion: Mapping[str, Floats] = field(default_factory=dict)
    # motion of the free dofs of each body (N,), of a rigid joint
    free_motion: Mapping[str, Floats] = field(default_factory=dict)
    extensions: Mapping[Coupling, float] = field(default_factory=dict)  # extension of springs
    determined: bool = True  # whether its force is statically determined by the motion

    @property
    def is_constraint(self) -> bool:
        """Whether it is a joint without a spring."""
        return bool(self.free_motion)

    @property
    def on_base(self) -> bool:
        """Whether it connects the structure to the base, not to the ground or another body."""
        to_ground = not self.is_constraint and any(spring.to_ground for spring in self.extensions)
        return not to_ground and not isinstance(self.site, Link)

    @cached_property
    def motion(self) -> UnitMotion:
        """The unit motion on all degrees of freedom of the bodies."""
        moved = {name: self._member(name).body.all_dofs_map @ u for name, u in self.free_motion.items()}
        return UnitMotion({**self.fixed_motion, **moved})

    @cached_property
    def _whole_forces(self) -> dict[str, Floats]:
        """For each body (3, all dofs) force per displacement, acceleration and velocity of the unit motion, SI."""
        forces = {name: self._member(name).body.forces_of(u) for name, u in self.motion.fields.items()}
        if self.body:
            body = self._member(self.body).body
            rows = [of * body.unsupported_row(spring.ends[0]) for spring, of in self.extensions.items()]
            for row, factors in zip(rows, map(_of_spring, self.extensions), strict=True):
                forces[self.body] = forces.get(self.body, 0.0) + np.outer(factors, row)
        return forces

    @cached_property
    def forces(self) -> dict[str, Floats]:
        """For each body (3, N of the body): forces on its free degrees of freedom."""
        return {name: of @ self._member(name).body.all_dofs_map for name, of in self._whole_forces.items()}

    @cached_property
    def on_dofs(self) -> Floats:
        """(3, N) forces on the structure's degrees of freedom, per displacement, acceleration and velocity."""
        total = np.zeros((3, self.structure.size))
        for name, of_body in self.forces.items():
            total += of_body @ self._member(name).expansion
        if not self.body:
            for spring, extension in self.extensions.items():
                total += np.outer(_of_spring(spring), extension * self.structure.row(spring.site))
        return total

    @cached_property
    def shape(self) -> Floats:
        """(N,) static shape for a unit motion of the support."""
        load = self.on_dofs[0] / self.structure.stiffness_scale
        return -static_deflections(self.structure, load[:, None])[:, 0]

    def _member(self, name: str) -> MemberBody:
        return self.structure.member(name)

    def on_body(self, body: str, other: Support) -> Floats:
        """(3,) force per displacement (N/m), acceleration and velocity of another support, transmitted by one body.

        All degrees of freedom stay at zero.
        """
        for moved, holds in sorted(((other, self), (self, other)), key=lambda pair: not pair[0].is_constraint):
            if body in moved.motion.fields and body in holds._whole_forces:
                return self._member(body).body.work(moved.motion.fields[body], holds._whole_forces[body])
        return self._by_springs(other) if self.body == other.body == body else np.zeros(3)

    def _by_springs(self, other: Support) -> Floats:
        both = self.extensions.keys() & other.extensions.keys()
        return sum((_of_spring(s) * self.extensions[s] * other.extensions[s] for s in both), np.zeros(3))

    def force_per_motion(self, other: Support) -> Floats:
        """(3,) force per displacement, N/m, acceleration, kg, and velocity, N s/m, of another support, or of itself."""
        between = sum((self.on_body(body, other) for body in self.forces), np.zeros(3))
        if not self.body:
            between += self._by_springs(other)
        return np.asarray(between + other.on_dofs @ self.shape)

    @property
    def acceleration(self) -> Floats:
        """(N,) force per acceleration of each degree of freedom relative to the base, kg."""
        return np.asarray(self.on_dofs[1] + self.structure.mass_scale * (self.structure.mass @ self.shape))

    @property
    def velocity(self) -> Floats:
        """(N,) force per velocity of each degree of freedom relative to the base, N s/m."""
        damping = self.structure.damping
        return np.asarray(self.on_dofs[2] if damping is None else self.on_dofs[2] + damping @ self.shape)

    def base_forces(self, motion: BaseDirection) -> Floats:
        """(2,) force per acceleration of the base, kg, and per displacement, N/m (springs to the ground)."""
        structure = self.structure
        inertia, ground = structure.base_load(motion)
        total = np.array([structure.mass_scale * inertia @ self.shape, -ground @ self.shape])
        for name, u in self.motion.fields.items():
            body, seen = self._member(name).body, structure.base_direction_of(name, motion)
            total[0] += body.forces_of(u)[1] @ body.rigid_motion(seen)
            if name in self.free_motion:
                total[1] -= body.base_load(seen)[1] @ self.free_motion[name]
        for spring, extension in self.extensions.items():
            if spring.to_ground:
                total[1] += _of_spring(spring)[0] * extension * structure.base_motion_at(spring.ends[0], motion)
        return total

    def direct(self, place: Place | LoadedRegion) -> float:
        """Share of a unit load that acts directly on it, with all degrees of freedom at zero."""
        body = self._member(place.body).body
        moved = self.motion.fields.get(body.name)
        return 0.0 if moved is None else float(body.unsupported_row(place) @ moved)

    def share(self, site: LoadSite) -> float:
        """Share of a unit load that the support carries; its reaction is the opposite."""
        if isinstance(site, (Link, PlaneDirection)):
            return sum(factor * self.share(end) for factor, end in signed_ends(site))
        return self.direct(site) + float(self.structure.row(site) @ self.shape)


def _of_spring(spring: Coupling) -> Floats:
    """(3,) stiffness, mass and dashpot of a spring."""
    return np.array([spring.stiffness or 0.0, 0.0, spring.dashpot])


def supports_of(structure: Structure, base: BaseDirection = UPWARDS) -> tuple[Support, ...]:
    """All supports of the bodies, then joints and springs, one for each direction.

    ``base`` is the motion of the base for `Support.base_motion`.
    """
    held = []
    for name, body in ((member.body.name, member.body) for member in structure.members):
        for restraint in body.restraints(structure.base_direction_of(name, base)):
            moved = {} if restraint.motion is None else {name: restraint.motion}
            extensions = {} if restraint.spring is None else {restraint.spring: -1.0}
            given = (structure, restraint.name, restraint.direction, restraint.base_motion)
            held.append(Support(*given, body=name, fixed_motion=moved, extensions=extensions))
    return (*held, *_of_couplings(structure, base))


def _of_couplings(structure: Structure, base: BaseDirection) -> Iterator[Support]:
    """Supports of springs and joints; for each rigid joint the unit motion with the others fixed."""
    held = [coupling for coupling in structure.couplings if coupling.stiffness is None]
    springs = [coupling for coupling in structure.couplings if coupling.stiffness is not None]
    motions = iter(_unit_motions(structure, held))
    for coupling in structure.couplings:
        end = coupling.ends[0]
        direction = SLOPE if end.direction == SLOPE else DEFLECTION
        moves_with_base = len(coupling.ends) == 1 and not coupling.to_ground
        base_motion = structure.base_motion_at(end, base) if moves_with_base else 0.0
        free, determined, extensions = {}, True, {coupling: -1.0}
        if coupling.stiffness is None:
            moved, determined = next(motions)
            free = {member.body.name: u for member, u in zip(structure.members, moved, strict=True)}
            extensions = {
                s: sum(float(m.body.own_row(s.site) @ free[m.body.name]) for m in structure.members) for s in springs
            }
        yield Support(
            structure, coupling.name, direction, base_motion, site=coupling.site, free_motion=free,
            extensions=extensions, determined=determined,
        )  # fmt: skip


def _unit_motions(structure: Structure, constraints: Sequence[Coupling]) -> list[tuple[list[Floats], bool]]:
    """For each constraint the smallest motion of each body that moves only this constraint by one unit.

    The second value tells whether such a motion exists.
    """
    if not constraints:
        return []
    sizes = [member.body.size for member in structure.members]
    rows = np.hstack([np.array([m.body.own_row(coupling.site) for coupling in constraints]) for m in structure.members])
    inverse = np.linalg.pinv(rows, rcond=1e-10)
    missed = np.abs(rows @ inverse - np.eye(len(constraints))).max(axis=0)
    parts = np.cumsum(sizes)[:-1]
    return [(np.split(column, parts), bool(error < 1e-6)) for column, error in zip(inverse.T, missed, strict=True)]
