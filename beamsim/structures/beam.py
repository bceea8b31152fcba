"""A beam: mesh, supports, point masses, rigid-body modes, and what it answers as a structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.beam_fields import PolynomialField, largest_deflection
from beamsim.structures.beam_model import BeamModel
from beamsim.structures.dof_table import DofTable, NamedDofs
from beamsim.structures.hermite import curvature_factor, mass_matrix
from beamsim.structures.mesh import Mesh, build_mesh
from beamsim.structures.places import DEFLECTION, SLOPE, Place, Site
from beamsim.structures.recovery import beam_recovery
from beamsim.structures.rigid_motion import allowed_rigid_modes
from beamsim.structures.stations import Recovery
from beamsim.structures.structure import MemberBody
from beamsim.structures.supports import HeldMatrices, Support, spring_support
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario.beam import BeamBody
    from beamsim.structures.basis import ReducedBasis

# What an end holds: (deflection, slope).
_HELD = {
    "clamped": (True, True),
    "pinned": (True, False),
    "guided": (False, True),
    "free": (False, False),
}


def supported_dofs(left: str, right: str, nodes: int) -> Ints:
    """Degrees of freedom that the supports hold at zero (relative to the base)."""
    first = [i for i, held in enumerate(_HELD[left]) if held]
    last = [2 * (nodes - 1) + i for i, held in enumerate(_HELD[right]) if held]
    return np.array(first + last, dtype=np.int64)


def _scatter(blocks: Floats, rows: Ints, columns: Ints, shape: tuple[int, int]) -> Any:
    """Sum (e, a, b) element blocks into a sparse matrix."""
    from scipy.sparse import csr_array

    i = np.broadcast_to(rows[:, :, None], blocks.shape).ravel()
    j = np.broadcast_to(columns[:, None, :], blocks.shape).ravel()
    matrix = csr_array((blocks.ravel(), (i, j)), shape=shape)
    matrix.sum_duplicates()
    return matrix


class BeamStructure(BeamModel):
    """A beam as a structure."""

    sides: ClassVar[tuple[str, ...]] = ("length",)

    def unit_stiffness(self, site: Site) -> float:
        """E I / L^3, N/m, with the largest E I."""
        return self.section.bending_stiffness / self.section.length**3

    def reassembled(self, section: BeamBody) -> BeamStructure:
        """The beam with other numbers on the same mesh."""
        return assemble_beam(section, self.name, mesh=self.mesh)

    @property
    def total_mass(self) -> float:
        """Mass of the beam and of what is on it, kg."""
        return self.section.mass_per_length * self.section.length + sum(m.mass for m in self.section.point_masses)

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes from the left end, each with z and ry, the rotation about y that tilts the beam down."""
        nodes, slopes = self.free // 2, self.free % 2 == 1
        names = tuple((int(n) + 1, "ry" if slope else "z") for n, slope in zip(nodes, slopes, strict=True))
        places = np.zeros((self.free.size, 3))
        places[:, 0] = self.mesh.nodes[nodes] * self.section.length
        scale = np.where(slopes, -1.0 / self.section.length, 1.0)
        return NamedDofs(DofTable(names, places), scale, np.where(slopes, 0.0, 1.0))

    def point_of(self, place: Place) -> Floats:
        """(3,) position along the axis, m."""
        return np.array([place.coordinate, 0.0, 0.0])

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Deflection, bending moment and stress along the beam."""
        return beam_recovery(self, member, basis, sites, base)

    @property
    def supports(self) -> tuple[Support, ...]:
        """Force and moment of each end that is held, or on springs."""
        mass, factor, damping = self.unsupported
        size, scales = mass.shape[0], (self.mass_scale, self.stiffness_scale)
        matrices = HeldMatrices(
            mass, factor, damping, scales, self.free, self.rigid_motion,
            self.unsupported_row,
        )  # fmt: skip
        springs = _EndSprings.of(self.section, self.mesh.nodes.size)
        number = {int(dof): i for i, dof in enumerate(self.free)}
        supports = []
        for name, first in (("left", 0), ("right", size - 2)):
            for dof, direction, unit in ((first, DEFLECTION, 1.0), (first + 1, SLOPE, self.section.length)):
                motion = np.zeros(size)
                motion[dof] = unit
                acting = springs.dofs == dof
                if dof not in number:
                    supports.append(matrices.support(name, direction, motion, self.name))
                elif np.any(acting & ((springs.stiffness > 0) | (springs.dashpot > 0))):
                    force, rate = springs.stiffness[acting].sum(), springs.dashpot[acting].sum()
                    unit_motion = motion[self.free]
                    supports.append(spring_support(name, direction, unit_motion, force, rate, self.name))
        return tuple(supports)

    def base_supports(self, motion: BaseDirection) -> tuple[Support, ...]:
        """Each end as far as it moves with the base."""
        ends = {"left": 0.0, "right": self.section.length}
        return tuple(
            replace(each, base_motion=self.base_motion_of(Place(self.name, ends[each.name], each.direction), motion))
            for each in self.supports
        )

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,), also between the nodes."""
        return largest_deflection(self.mesh, self.whole_field(field))

    def given_field(self, numbers: Sequence[float]) -> PolynomialField:
        """A polynomial in x (m) from the left end, by its coefficients."""
        return PolynomialField(self, numbers)


@dataclass(frozen=True)
class _EndSprings:
    """Springs and dashpots between the ends and the base, on dofs of the whole mesh."""

    dofs: Ints  # (s,)
    stiffness: Floats  # (s,) N/m; those of rotations divided by the length squared, as their dofs are L w'
    dashpot: Floats  # (s,) N s/m

    @classmethod
    def of(cls, beam: BeamBody, nodes: int) -> _EndSprings:
        """Those of both ends."""
        dofs, stiffness, dashpot = [], [], []
        for first, springs in zip((0, 2 * (nodes - 1)), beam.supports.springs, strict=True):
            if springs is not None:
                dofs += [first, first + 1]
                stiffness += [springs.stiffness, springs.rotational_stiffness / beam.length**2]
                dashpot += [springs.dashpot, springs.rotational_dashpot / beam.length**2]
        return cls(np.array(dofs, dtype=np.int64), np.array(stiffness), np.array(dashpot))

    def rows(self, factors: Floats, size: int) -> Any:
        """(a, size) sparse rows of the springs or dashpots with a factor above zero, times its root."""
        from scipy.sparse import csr_array

        acting = np.flatnonzero(factors > 0)
        entries = (np.sqrt(factors[acting]), (np.arange(acting.size), self.dofs[acting]))
        return csr_array(entries, shape=(acting.size, size))


def assemble_beam(
    beam: BeamBody, name: str = "beam", nodes: Sequence[float] = (), mesh: Mesh | None = None
) -> BeamStructure:
    """Sparse matrices of a beam on its supports (equations: docs/theory.md, section 1).

    Without a mesh, one is made with nodes at point masses, bounds of segments and what the beam asks for; consistent
    mass everywhere else. The units of stiffness and mass are the largest E I over the length cubed, and the mass of the
    beam itself.

    Parameters
    ----------
    beam : the section of the scenario.
    name : of the body.
    nodes : m, where something joins the beam: nodes of a mesh that is made.
    mesh : one that is there.
    """
    from scipy.sparse import vstack

    length, stretches = beam.length, beam.stretches
    bounds = np.array([0.0, *(stretch.start / length for stretch in stretches[1:]), 1.0])
    if mesh is None:
        hard = [*(mass.position for mass in beam.point_masses), *beam.nodes, *nodes]
        mesh = build_mesh(beam.elements, [x / length for x in hard], bounds.tolist())
    size = 2 * mesh.nodes.size
    dofs = mesh.dofs
    mass_scale = beam.mass_per_length * length
    stiffness_scale = beam.bending_stiffness / length**3
    stretch_of = np.searchsorted(bounds, mesh.nodes[:-1] + mesh.lengths / 2) - 1
    bending = np.array([stretch.bending_stiffness / beam.bending_stiffness for stretch in stretches])[stretch_of]
    line_mass = np.array([stretch.mass_per_length / beam.mass_per_length for stretch in stretches])[stretch_of]

    distributed = _scatter(line_mass[:, None, None] * mass_matrix(mesh.lengths), dofs, dofs, (size, size))
    strips = np.arange(2 * mesh.elements).reshape(-1, 2)
    bent = np.sqrt(bending)[:, None, None] * curvature_factor(mesh.lengths)
    factor = _scatter(bent, strips, dofs, (2 * mesh.elements, size))
    mass = distributed
    if beam.point_masses:
        lumped = point_mass_rows(mesh, beam)
        mass = distributed + lumped.T @ lumped

    motions = mesh.rigid_motions
    held = supported_dofs(*beam.supports.kinds, mesh.nodes.size)
    free = np.setdiff1d(np.arange(size), held)
    springs = _EndSprings.of(beam, mesh.nodes.size)
    if springs.stiffness.any():
        factor = vstack([factor, springs.rows(springs.stiffness / stiffness_scale, size)], format="csr")
    damping = drag = None
    if springs.dashpot.any():
        dashpots = springs.rows(springs.dashpot, size)[:, free]
        damping = (dashpots.T @ dashpots).tocsc()
    if beam.damping is not None and beam.damping.kind == "viscous":
        # xi * integral of N N^T dx: the mass matrix of a uniform beam over its mass per length, point masses left out.
        uniform = _scatter(mass_matrix(mesh.lengths), dofs, dofs, (size, size))
        drag = uniform * (beam.damping.coefficient * length)
        viscous = drag[free][:, free].tocsc()
        damping = viscous if damping is None else damping + viscous

    return BeamStructure(
        name=name,
        mass=mass[free][:, free].tocsc(),
        factor=factor[:, free].tocsr(),
        damping=damping,
        inertia=(mass @ motions[:, 0])[free],
        ground=np.zeros(free.size),
        rigid=allowed_rigid_modes(motions, mass, np.concatenate([held, springs.dofs[springs.stiffness > 0]]))[free],
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        deflection_dofs=np.flatnonzero(free % 2 == 0),
        section=beam,
        mesh=mesh,
        free=free,
        stretch_of=stretch_of,
        bending=bending,
        line_mass=line_mass,
        unsupported=(mass, factor, drag),
    )


def point_mass_rows(mesh: Mesh, beam: BeamBody) -> Any:
    """(c, all dofs) sparse rows whose products are the scaled point masses and their rotary inertias."""
    from scipy.sparse import vstack

    mass_scale = beam.mass_per_length * beam.length
    at = np.array([m.position for m in beam.point_masses]) / beam.length
    mass, rotary = (np.array([getattr(m, of) for m in beam.point_masses]) for of in ("mass", "rotary_inertia"))
    turning = mesh.rows(at, 1) * (np.sqrt(rotary / mass_scale) / beam.length)[:, None]
    return vstack([mesh.rows(at) * np.sqrt(mass / mass_scale)[:, None], turning], format="csr")
