r"""Forces that supports, joints and springs exert, from equilibrium with the inertia of the motion.

Where the place s that holds a structure moves by one unit and nothing else acts, the structure takes the static shape
:math:`\psi`. By virtual work along it, the force on the structure at s is

.. math:: R = \psi^T (M \ddot u_a + D \dot u - f) + d_s^T \dot u,

with :math:`u_a` the absolute motion, D the dashpots and viscous damping, f the other forces, and :math:`d_s` the
dashpot of the support itself. The share of a force that s carries is the value of :math:`\psi` where it acts. Elastic
forces drop out, so that R converges as the accelerations do, and all of them together balance loads and inertia
exactly whatever modes are kept. Modal and Rayleigh damping act on the deformation relative to :math:`\psi` and drop out
with the elastic forces that they accompany. Supports that move add to it by their own displacement, velocity and
acceleration: the force on s while they move and the degrees of freedom do not, and what they do along :math:`\psi`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.base_motion import UPWARDS, BaseDirection
from beamsim.structures.distributed import Distributed
from beamsim.structures.places import DEFLECTION, SLOPE, Link, LoadSite, Place
from beamsim.structures.reduction import static_deflections
from beamsim.structures.supports import Share, Support, spring_support
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.structure import Coupling, MemberBody, Structure


@dataclass(frozen=True)
class SupportForce:
    """The force of a support as a linear function of the motion of a structure and of what acts on it."""

    support: Support
    whole: Structure
    shape: Floats  # (N,) static shape for a unit motion of the support

    @classmethod
    def of(cls, whole: Structure, support: Support) -> SupportForce:
        """Solve for the static shape."""
        load = support.stiffness / whole.stiffness_scale
        return cls(support, whole, -static_deflections(whole, load[:, None])[:, 0])

    @property
    def acceleration(self) -> Floats:
        """(N,) force per acceleration of each degree of freedom relative to the base, kg."""
        return np.asarray(self.support.mass + self.whole.mass_scale * (self.whole.mass @ self.shape))

    @property
    def velocity(self) -> Floats:
        """(N,) force per velocity of each degree of freedom relative to the base, N s/m."""
        damping = self.whole.damping
        return self.support.damping if damping is None else np.asarray(self.support.damping + damping @ self.shape)

    def base_forces(self, motion: BaseDirection) -> tuple[float, float]:
        """Force per acceleration of the base, kg, and per displacement, N/m: that of springs to the ground."""
        inertia, ground = self.whole.base_load(motion)
        own_inertia, own_ground = self.support.base_forces(motion)
        return (
            own_inertia + self.whole.mass_scale * float(inertia @ self.shape),
            own_ground - float(ground @ self.shape),
        )

    def moved(self, other: Support) -> Floats:
        """(3,) force per displacement, N/m, acceleration, kg, and velocity, N s/m, of another support, or of itself."""
        by_shape = np.array([other.stiffness, other.mass, other.damping]) @ self.shape
        return np.asarray(self.support.between(other) + by_shape)

    def share(self, site: LoadSite) -> float:
        """Share of a unit load that the support carries; its force is minus that."""
        if isinstance(site, Link):
            return self.share(site.second) - self.share(site.first)
        return self.support.direct(site) + float(self.whole.row(site) @ self.shape)


def supports_of(structure: Structure, base: BaseDirection = UPWARDS) -> tuple[Support, ...]:
    """All supports of the bodies, then joints and springs, direction by direction.

    ``base`` is the motion of the base that `Support.base_motion` belongs to.
    """
    if structure.parts:
        supports: list[Support] = []
        for part in structure.parts:
            supports += [
                each.mapped(partial(_widened, part.dofs, structure.size)) for each in supports_of(part.structure, base)
            ]
        return tuple(supports)
    held = [
        replace(
            support.mapped(member.on_whole),
            direct=partial(_on_body, support.direct, member.body.name),
            under=partial(_seen, support, structure, member.body.name),
        )
        for member in structure.members
        for support in (
            member.body.supports
            if base == UPWARDS
            else member.body.base_supports(structure.seen_from(member.body.name, base))
        )
    ]
    return (*held, *_coupling_supports(structure, base))


def _seen(support: Support, structure: Structure, body: str, base: BaseDirection) -> tuple[float, float]:
    return support.base_forces(structure.seen_from(body, base))


def _widened(dofs: slice, size: int, row: Floats) -> Floats:
    wide = np.zeros(size)
    wide[dofs] = row
    return wide


def _on_body(direct: Share, body: str, place: Place | Distributed) -> float:
    return direct(place) if place.body == body else 0.0


def _coupling_supports(structure: Structure, base: BaseDirection) -> list[Support]:
    """Springs pull along their row; of constraints each is moved by one unit while the others hold."""
    held = [coupling for coupling in structure.couplings if coupling.stiffness is None]
    motions = iter(_unit_motions(structure, held))
    supports = []
    for coupling in structure.couplings:
        if coupling.stiffness is None:
            supports.append(_constraint(structure, coupling, base, *next(motions)))
            continue
        spring = spring_support(
            coupling.name, _direction(coupling), structure.row(coupling.site), coupling.stiffness, coupling.dashpot, "",
            to_ground=coupling.to_ground,
        )  # fmt: skip
        pulled = partial(_ground_pull, structure, coupling) if coupling.to_ground else None
        moved = _base_motion(structure, coupling, base)
        itself = {_spring_key(coupling): (coupling.stiffness, coupling.dashpot, -1.0)}
        supports.append(replace(spring, at=coupling.site, base_motion=moved, under=pulled, stretches=itself))
    return supports


def _spring_key(spring: Coupling) -> str:
    return f"{spring.name} {_direction(spring)}"


def _direction(coupling: Coupling) -> str:
    return SLOPE if coupling.ends[0].direction == SLOPE else DEFLECTION


def _base_motion(structure: Structure, coupling: Coupling, base: BaseDirection) -> float:
    if len(coupling.ends) == 2 or coupling.to_ground:
        return 0.0
    return structure.base_motion_at(coupling.ends[0], base)


def _ground_pull(structure: Structure, spring: Coupling, base: BaseDirection) -> tuple[float, float]:
    return 0.0, -(spring.stiffness or 0.0) * structure.base_motion_at(spring.ends[0], base)


def _unit_motions(structure: Structure, held: Sequence[Coupling]) -> list[tuple[list[Floats], bool]]:
    """By constraint the least motion of each body apart that moves it by one unit and no other one.

    With whether there is such a motion.
    """
    if not held:
        return []
    sizes = [member.body.size for member in structure.members]
    rows = np.hstack([np.array([_apart(member, coupling) for coupling in held]) for member in structure.members])
    inverse = np.linalg.pinv(rows, rcond=1e-10)
    missed = np.abs(rows @ inverse - np.eye(len(held))).max(axis=0)
    parts = np.cumsum(sizes)[:-1]
    return [(np.split(column, parts), bool(error < 1e-6)) for column, error in zip(inverse.T, missed, strict=True)]


def _apart(member: MemberBody, coupling: Coupling) -> Floats:
    """(N of the body,) how far the ends of a coupling draw apart for a unit of each degree of freedom of one body."""
    row = np.zeros(member.body.size)
    for sign, end in zip((-1.0, 1.0)[-len(coupling.ends) :], coupling.ends, strict=True):
        if end.body == member.body.name:
            row += sign * member.body.place_row(end)
    return row


def _constraint(
    structure: Structure, coupling: Coupling, base: BaseDirection, motion: Sequence[Floats], determined: bool
) -> Support:
    moved = list(zip(structure.members, motion, strict=True))
    by_name = {member.body.name: u for member, u in moved}
    forces = {
        member.body.name: np.array(
            [
                (body := member.body).factor.T @ (body.factor @ u) * body.stiffness_scale,
                body.mass @ u * body.mass_scale,
                np.zeros(u.size) if body.damping is None else body.damping @ u,
            ]
        )
        for member, u in moved
    }
    stiffness, mass, damping = (
        sum((member.on_whole(forces[member.body.name][k]) for member, _ in moved), np.zeros(structure.size))
        for k in range(3)
    )
    stretches = {}
    grounded: list[tuple[Coupling, float]] = []
    for other in structure.couplings:
        if other.stiffness is None:
            continue
        stretch = sum(float(_apart(member, other) @ u) for member, u in moved)
        stretches[_spring_key(other)] = (other.stiffness, other.dashpot, stretch)
        row = structure.row(other.site)
        stiffness += other.stiffness * stretch * row
        damping += other.dashpot * stretch * row
        if other.to_ground:
            grounded.append((other, other.stiffness * stretch))

    def under(motion: BaseDirection) -> tuple[float, float]:
        loads = [member.body.base_load(structure.seen_from(member.body.name, motion)) for member in structure.members]
        inertia = sum(float(load[0] @ u) * m.body.mass_scale for load, (m, u) in zip(loads, moved, strict=True))
        ground = -sum(float(load[1] @ u) for load, (_, u) in zip(loads, moved, strict=True))
        pulled = sum(force * structure.base_motion_at(other.ends[0], motion) for other, force in grounded)
        return inertia, ground + pulled

    inertia, ground = under(UPWARDS)

    def direct(place: Place | Distributed) -> float:
        body = structure.member(place.body).body
        return float(body.row(place) @ by_name[body.name])

    return Support(
        coupling.name, _direction(coupling), stiffness, mass, damping, inertia=inertia, direct=direct,
        base_motion=_base_motion(structure, coupling, base), at=coupling.site, base_displacement=ground,
        determined=determined, motions=by_name, under=under, forces=forces, stretches=stretches,
    )  # fmt: skip
