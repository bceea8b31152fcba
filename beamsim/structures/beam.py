r"""A beam as a structure: mesh, supports, point masses, rigid-body modes, recovery of moments.

Bending moments follow from equilibrium instead of curvature. The nodal forces of an element are k u - f, where f is its
distributed inertia and the point loads inside it. They converge as fast as the nodal displacements (fourth order),
while second derivatives of the shape functions lose two orders. Between the nodes the moment follows from the left-hand
nodal force and moment by integrating the load, so that a station under a point load shows the peak.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array, vstack

from beamsim.errors import MethodError
from beamsim.scenario.beam import BeamBody
from beamsim.structures.mesh import (
    Mesh,
    MeshedBody,
    build_mesh,
    element_rows,
    on_supports,
    shape_functions,
)
from beamsim.structures.named_matrices import DofTable, NamedDofs
from beamsim.structures.places import ALONG_BEAM, DEFLECTION, SLOPE, BaseDirection, LoadedRegion, Place, Recovery, Site
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import (
    BodyField,
    Coupling,
    LoadPattern,
    MemberBody,
    ReducedBasis,
    Restraint,
    UnitMotion,
    WeightedValues,
)
from beamsim.typing import Floats, Ints


def _largest_at(model: BeamStructure, x: Floats, segment_values: Sequence[float | None]) -> Floats | None:
    """(nx,) a property of segments at stations, the larger value where two meet; None if a segment has none."""
    known = [value for value in segment_values if value is not None]
    if len(known) < len(segment_values):
        return None
    right, inside = model.mesh.locate(x)
    left = np.where(inside < 1e-9, np.maximum(right - 1, 0), right)
    values = np.array(known)[model.segment_of]
    return np.asarray(np.maximum(values[left], values[right]))


def moment_rows(member: MemberBody, basis: ReducedBasis, x: Floats) -> Floats:
    """(nx, n) scaled moments E I w'' at dimensionless x, for a unit of each column of the basis.

    Parameters
    ----------
    member : the beam and its expansion in the structure.
    basis : reduced coordinates of the whole structure.
    x : (nx,) nondimensional stations.

    Returns
    -------
    (nx, n) array
        In units of E I / L^2 of the beam, for one metre.

    Notes
    -----
    If all modes are kept there are no static vectors to represent the kinks under point loads. The unresolved modes
    (with numbers above the number of elements) are then corrected so that the moments of static deflections are exact.
    """
    a = basis.vectors[:, : basis.modes] @ basis.acceleration_modes
    moment = _moments(member, x, basis.vectors, a, zip(basis.patterns, basis.pattern, strict=True))
    moment[:, : basis.rigid_count] = 0.0  # rigid-body motion causes no bending
    if basis.modes == member.structure.size and basis.patterns:
        moment = moment + _static_correction(member, basis, x, moment)
    return moment


def _static_moments(member: MemberBody, x: Floats, patterns: Sequence[LoadPattern]) -> tuple[Floats, Floats]:
    """(N, m) static deflections under loads, with inertia relief, and their scaled moments (nx, m)."""
    whole, loads = member.structure, np.array([pattern.vector for pattern in patterns]).T
    u = static_deflections(whole, loads)
    relief = -whole.rigid @ (whole.rigid.T @ loads)
    return u, _moments(member, x, u, relief, zip(patterns, np.eye(len(patterns)), strict=True))


RIGHT_END_TOLERANCE = 1e-12  # relative to the length, within which a point counts as the right end


def _moments(
    member: MemberBody, x: Floats, u: Floats, a: Floats, loads: Iterable[tuple[LoadPattern, Floats]]
) -> Floats:
    """(nx, c) scaled moments of displacements u (N, c) in equilibrium with loads: K u = M a + loads.

    Joints and supports act at nodes only. An inertia pattern is the acceleration of a rigid motion, including supports;
    distributed loads become point forces between neighbouring stations x.
    """
    model, inertia = member.body, member.mass_ratio / member.stiffness_ratio
    assert isinstance(model, BeamStructure)
    mesh, length = model.mesh, model.section.length
    displacement = model.all_dofs_map @ (member.expansion @ u)
    acceleration = model.all_dofs_map @ (member.expansion @ a) * inertia
    forces = []  # dimensionless positions (k,) and magnitudes (k,), and their factors in each column (c,)
    for pattern, row in loads:
        site = pattern.site
        if isinstance(site, BaseDirection):
            moving = model.rigid_motion(member.structure.base_direction_of(model.name, site))
            acceleration += np.multiply.outer(moving, row * inertia)
        elif isinstance(site, UnitMotion):
            if model.name in site.fields:
                displacement = displacement + np.multiply.outer(site.fields[model.name], row)
        elif isinstance(site, Place | LoadedRegion) and member.structure.member(site.body).body is model and row.any():
            if isinstance(site, Place):
                places, sizes = np.array([[site.coordinate / length]]), np.ones(1)
            else:
                places, sizes = model.point_forces(site, x * length)
            forces.append((places[:, 0], sizes, row / member.stiffness_ratio))

    h = mesh.lengths
    u, a = displacement[mesh.dofs], acceleration[mesh.dofs] * model.line_mass[:, None, None]
    bent, moved = element_rows(h, 2, 2), element_rows(h, 0, 4)
    curvature = np.einsum("esd,edn->esn", bent, u) * model.bending[:, None, None]
    at_ends = np.einsum("esd,esn->edn", bent, curvature)  # forces and moments at the nodes of each element
    at_ends -= np.einsum("esd,esn->edn", moved, np.einsum("esd,edn->esn", moved, a))
    element, xi = mesh.locate(x)
    left_of_station: list[Floats] = []  # moments of point forces to the left of a station in its element
    for places, sizes, p in forces:
        e, within = mesh.locate(places)
        at_nodes = np.zeros((h.size, 4))
        np.add.at(at_nodes, e, shape_functions(within, h[e]) * sizes[:, None])
        at_ends -= at_nodes[:, :, None] * p
        lever = np.where(element[:, None] == e, np.clip(xi[:, None] - within, 0.0, None), 0.0) @ (sizes * h[e])
        left_of_station.append(lever[:, None] * p)

    moment = -at_ends[element, 1] + at_ends[element, 0] * (xi * h[element])[:, None]
    moment += np.einsum("xd,xdn->xn", shape_functions(xi, h[element], -2), a[element])
    for part in left_of_station:
        moment += part
    # at the right end use the nodal moment, without the round-off of the integration
    moment[np.isclose(x, 1.0, rtol=0, atol=RIGHT_END_TOLERANCE)] = at_ends[-1, 3]
    return np.asarray(moment)


def _resolved_count(member: MemberBody, basis: ReducedBasis) -> int:
    """Number of modes that count as resolved; at most a quarter of the energy of each further mode may be in a beam.

    Round-off must not decide between shares, or between equal modes; each beam has a share of the energy of each mode.
    """
    most = basis.size - 1 if member.structure.most_modes is None else member.structure.most_modes
    model = member.body
    assert model.most_modes is not None
    strain = (model.factor @ (member.expansion @ basis.vectors))[:, basis.rigid_count :] / basis.omega[
        basis.rigid_count :
    ]
    shares = np.cumsum(np.append(np.ones(basis.rigid_count), np.sum(strain**2, axis=0) * member.stiffness_ratio))
    last = min(int(np.searchsorted(shares, 0.75 * model.most_modes + 0.25 * shares[-1] - 1e-6)), basis.size - 1)
    return min(most, int(np.searchsorted(basis.omega, basis.omega[last] * (1 - 1e-9))))


NEGLIGIBLE_DEFLECTION = 1e-9  # relative, per load; below it the load only moves the beam as a rigid body


def _static_correction(member: MemberBody, basis: ReducedBasis, x: Floats, moment: Floats) -> Floats:
    """(nx, n) correction of unresolved modes that makes the static moments of the load patterns exact."""
    whole = member.structure
    u, exact = _static_moments(member, x, basis.patterns)
    coordinates = basis.vectors.T @ (whole.mass @ u)
    coordinates[: basis.rigid_count] = 0.0
    missing = exact - moment @ coordinates
    resolved = _resolved_count(member, basis)
    # Component of a motion along the static deflections, by projection in the energy norm. With more loads than
    # unresolved modes it is a fit, with equal weight for each load.
    strain = basis.omega[:, None] * coordinates
    size = np.linalg.norm(strain, axis=0)
    of_loads = np.linalg.norm([basis.vectors.T @ pattern.vector for pattern in basis.patterns], axis=1)
    bending = np.flatnonzero(size > NEGLIGIBLE_DEFLECTION * of_loads / basis.omega[basis.rigid_count])
    unit, lacking = strain[:, bending] / size[bending], missing[:, bending] / size[bending]
    # A repeated load counts once: its motion and moments differ at most in sign.
    largest = np.max(np.abs(exact[:, bending] / size[bending]), initial=np.finfo(float).tiny)
    gram = np.vstack([unit, lacking / largest]).T @ np.vstack([unit, lacking / largest])
    once = ~np.tril(np.add.outer(np.diag(gram), np.diag(gram)) - 2 * np.abs(gram) < 1e-12, -1).any(axis=1)
    part = unit[resolved:, once]  # columns of unit length: below 1e-9 is round-off
    fit = np.linalg.pinv(part, rcond=1e-9 / max(float(np.linalg.norm(part)), 1e-9))
    return np.pad(lacking[:, once] @ fit * basis.omega[resolved:], ((0, 0), (resolved, 0)))


_DERIVATIVE = {DEFLECTION: 0, SLOPE: 1}
FIXED_DERIVATIVES: dict[str, tuple[int, ...]] = {"clamped": (0, 1), "pinned": (0,), "guided": (1,), "free": ()}
"""Derivatives (deflection 0, slope 1) that a support fixes at the end of a beam or the edge of a plate."""


@dataclass(frozen=True)
class BeamStructure(MeshedBody):
    """A beam as a structure; positions are in metres from its left end."""

    section: BeamBody
    mesh: Mesh
    segment_of: Ints  # (elements,) segment of each element
    bending: Floats  # (elements,) bending stiffness, relative to the largest of the beam
    line_mass: Floats  # (elements,) mass per length, relative to the mean of the beam
    sides: ClassVar[tuple[str, ...]] = ("length",)

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Deflection, bending moment and stress along the beam.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            At nodes, element midpoints and the sites; for a unit of each coordinate, 1/sqrt(kg).
        """
        beam, length, scale = self.section, self.section.length, 1 / np.sqrt(member.structure.mass_scale)
        x = np.concatenate([self.mesh.nodes, self.mesh.nodes[:-1] + self.mesh.lengths / 2])
        at_sites = (place.coordinate / length for place in sites)
        x = np.unique(np.append(x, [each for each in at_sites if np.min(np.abs(x - each)) > 1e-9]))
        moment = moment_rows(member, basis, x)
        remainder, sections = np.zeros(x.size), [segment.bending for segment in beam.uniform_segments]
        if base is not None:
            inertia = member.structure.base_load(base)[0]
            _, exact = _static_moments(member, x, [LoadPattern(inertia, base)])
            remainder = basis.omitted_response(inertia, moment, exact[:, 0])
        return Recovery(
            body=self.name, axis=ALONG_BEAM, position=x * length,
            deflection=self.mesh.rows(x) @ (self.all_dofs_map @ (member.expansion @ basis.vectors)) * scale,
            bending_moment=moment * (scale * beam.bending.bending_stiffness / length**2),
            stress_per_moment=_largest_at(self, x, [bending.stress_per_moment for bending in sections]),
            strain_per_moment=_largest_at(
                self, x, [None if b.depth is None else float(b.depth / 2 / b.bending_stiffness) for b in sections]
            ),
            base_moment=-remainder * (member.structure.mass_scale * length * member.stiffness_ratio),
        )  # fmt: skip

    @property
    def most_modes(self) -> int:
        """Number of elements; the mesh does not resolve higher modes."""
        return self.mesh.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""
        # A free beam bounds every support from above (fewer restraints, more modes below); beta_n ~ (n - 3/2) pi with
        # both rigid-body modes counted. Separate segments also bound the beam, and so does a uniform beam with the
        # smallest stiffness and largest mass. An added mass or rotary inertia lowers at most one more frequency below
        # the limit.
        beam, squared = self.section, (omega * self.frequency_scale) ** 2
        mass, stiffness, length = np.array(
            [(segment.mass_per_length, segment.bending_stiffness, segment.length) for segment in beam.uniform_segments]
        ).T
        apart, alike = (
            int(np.sum(np.ceil((squared * per_length / bending) ** 0.25 / np.pi * long) + 2))
            for per_length, bending, long in (
                (mass, stiffness, length), (np.array([mass.max()]), stiffness.min(), beam.length)
            )
        )  # fmt: skip
        rotary = sum(mass.rotary_inertia > 0.0 for mass in beam.point_masses)
        return min(apart, alike) + len(beam.point_masses) + rotary

    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(all dofs,) deflection, or slope, 1/m, at a place; or load vector of a region."""
        if isinstance(place, LoadedRegion):
            return self.load_vector(place)
        if place.direction not in _DERIVATIVE:
            raise ValueError(f"a beam has no motion {place.direction}; it has {' and '.join(_DERIVATIVE)}")
        derivative, length = _DERIVATIVE[place.direction], self.section.length
        return np.asarray(self.mesh.rows(place.coordinate / length, derivative).toarray()[0] / length**derivative)

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(all dofs,) rigid displacement for a unit motion of the base."""
        if motion.direction not in ("", "z", "ry"):
            raise MethodError("direction", f"= {motion.direction} does not deflect a beam", "use z, or ry, a rotation")
        turned = motion.direction == "ry"  # z decreases with x
        shares = [motion.axis_point[0], -self.section.length] if turned else [1.0, 0.0]
        return np.asarray(self.mesh.rigid_motions @ np.array(shares))

    def unit_stiffness(self, site: Site) -> float:
        """E I / L^3, N/m, with the largest E I."""
        return self.section.bending.bending_stiffness / self.section.length**3

    def reassemble(self, section: BeamBody) -> BeamStructure:
        """A beam with other numbers on the same mesh."""
        return assemble_beam(section, self.name, mesh=self.mesh)

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes from the left end, each with z and ry, the rotation about y that lowers the beam."""
        nodes, slopes = self.free // 2, self.free % 2 == 1
        names = tuple((int(n) + 1, "ry" if slope else "z") for n, slope in zip(nodes, slopes, strict=True))
        places = np.zeros((self.free.size, 3))
        places[:, 0] = self.mesh.nodes[nodes] * self.section.length
        scale = np.where(slopes, -1.0 / self.section.length, 1.0)
        return NamedDofs(DofTable(names, places), scale, np.where(slopes, 0.0, 1.0))

    def point_of(self, place: Place) -> Floats:
        """(3,) position along the axis, m."""
        return np.array([place.coordinate, 0.0, 0.0])

    def restraints(self, base: BaseDirection) -> Sequence[Restraint]:
        """Deflection and slope of each end that is fixed or elastically supported."""
        springs = {(each.name, each.site): each for each in self.end_springs}
        restraints = []
        for name, x, first in (("left", 0.0, 0), ("right", self.section.length, self.mesh.size - 2)):
            for dof, direction, unit in ((first, DEFLECTION, 1.0), (first + 1, SLOPE, self.section.length)):
                place = Place(self.name, x, direction)
                spring = springs.get((name, place))
                motion = None if dof in self.free else np.where(np.arange(self.mesh.size) == dof, unit, 0.0)
                if motion is not None or spring is not None:
                    restraints.append(Restraint(name, direction, self.base_motion_at(place, base), motion, spring))
        return restraints

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,), also between the nodes."""
        from scipy.interpolate import CubicHermiteSpline

        whole = self.all_dofs_map @ field
        spline = CubicHermiteSpline(self.mesh.nodes, whole[0::2], whole[1::2])
        level = spline.derivative().roots(extrapolate=False)
        return float(np.abs(spline(np.append(self.mesh.nodes, level[np.isfinite(level)]))).max())

    def given_field(self, numbers: Sequence[float]) -> BodyField:
        """A polynomial in x (m) from the left end, given by its coefficients of x^0, x^1, ..., in SI units."""
        mesh, length, masses = self.mesh, self.section.length, self.section.point_masses
        polynomial = np.polynomial.Polynomial(np.asarray(numbers, dtype=float) * length ** np.arange(len(numbers)))
        points, weights = np.polynomial.legendre.leggauss(len(numbers) // 2 + 4)
        x = (mesh.nodes[:-1, None] + mesh.lengths[:, None] * (points + 1) / 2).ravel()
        weight = mesh.lengths[:, None] * weights / 2
        at = np.array(self.section.mass_points) / length
        turning = np.array([m.rotary_inertia for m in masses]) / length**2  # for slopes with respect to x / L
        lumped = np.concatenate([[m.mass for m in masses], turning]) / self.mass_scale
        rows = vstack([mesh.rows(x), mesh.rows(at), mesh.rows(at, 1)], format="csr")
        kinetic = WeightedValues(
            rows[:, self.free],
            np.concatenate([(weight * self.line_mass[:, None]).ravel(), lumped]),
            np.concatenate([polynomial(x), polynomial(at), polynomial.deriv()(at)]),
        )
        bending = (weight * self.bending[:, None]).ravel()
        curved = WeightedValues(mesh.rows(x, 2)[:, self.free], bending, polynomial.deriv(2)(x))
        return BodyField(kinetic, curved)


def _end_springs(beam: BeamBody, name: str) -> tuple[Coupling, ...]:
    """Springs and dashpots between the ends and the base."""
    springs = []
    for x, given in beam.elastic_supports:
        end, along, about = "left" if x == 0.0 else "right", Place(name, x), Place(name, x, SLOPE)
        springs.append(Coupling(end, along, given.stiffness, given.dashpot))
        springs.append(Coupling(end, about, given.rotational_stiffness, given.rotational_dashpot))
    return tuple(each for each in springs if each.stiffness or each.dashpot)


def assemble_beam(
    beam: BeamBody, name: str = "beam", nodes: Sequence[float] = (), mesh: Mesh | None = None
) -> BeamStructure:
    """Sparse matrices of a beam on its supports (equations: docs/theory.md, section 1).

    A mesh has nodes at point masses, segment ends and requested positions, and a consistent mass matrix. Units are the
    largest E I over the length cubed for stiffness, and the mass of the beam without point masses.

    Parameters
    ----------
    beam : the section of the scenario.
    name : name of the body.
    nodes : m, positions where something is joined to the beam, for a new mesh.
    mesh : an existing mesh; a new one by default.

    Returns
    -------
    BeamStructure
        Scaled, without fixed dofs.
    """
    length, segments = beam.length, beam.uniform_segments
    bounds = np.array([0.0, *(segment.start / length for segment in segments[1:]), 1.0])
    if mesh is None:
        hard = [*beam.mass_points, *map(beam.metres, beam.nodes), *nodes]
        mesh = build_mesh(beam.elements, [x / length for x in hard], bounds.tolist())
    mass_scale = beam.bending.mass_per_length * length
    stiffness_scale = beam.bending.bending_stiffness / length**3
    segment_of = np.searchsorted(bounds, mesh.nodes[:-1] + mesh.lengths / 2) - 1
    sections = [(segment.bending_stiffness, segment.mass_per_length) for segment in segments]
    largest = beam.bending.bending_stiffness, beam.bending.mass_per_length
    bending, line_mass = (np.array(sections) / largest)[segment_of].T

    factor = mesh.square_rows(2, 2) * np.repeat(np.sqrt(bending), 2)[:, None]
    deflected, drag = mesh.square_rows(0, 4), None
    inertia = [deflected * np.repeat(np.sqrt(line_mass), 4)[:, None]]
    if beam.point_masses:
        at = np.array(beam.mass_points) / length
        mass, rotary = (np.array([getattr(m, of) for m in beam.point_masses]) for of in ("mass", "rotary_inertia"))
        inertia.append(mesh.rows(at) * np.sqrt(mass / mass_scale)[:, None])
        inertia.append(mesh.rows(at, 1) * (np.sqrt(rotary / mass_scale) / length)[:, None])
    moving = vstack(inertia, format="csr")

    if beam.damping is not None and beam.damping.kind == "viscous":  # point masses are not included
        drag = beam.damping.coefficient * length * (deflected.T @ deflected)
    extension = np.zeros((0, 2))  # extension of end springs in rigid-body motions
    springs = _end_springs(beam, name) if beam.elastic_supports else ()
    if springs:
        factor, drag, extension = _with_end_springs(springs, length, mesh, (factor, drag), stiffness_scale)
    ends = zip((0, mesh.elements), beam.supports.kinds, strict=True)
    held = np.array([2 * node + dof for node, kind in ends for dof in FIXED_DERIVATIVES[kind]], dtype=np.int64)
    return BeamStructure(
        name=name, section=beam, stated_damping=beam.damping, mass_scale=mass_scale, stiffness_scale=stiffness_scale,
        segment_of=segment_of, bending=bending, line_mass=line_mass, end_springs=springs,
        **on_supports(mesh, (moving.T @ moving, factor, drag), held, extension),
    )  # fmt: skip


def _with_end_springs(
    springs: Sequence[Coupling], length: float, mesh: Mesh, matrices: tuple[Any, Any], unit: float
) -> tuple[Any, Any, Floats]:
    """Factor and damping with end springs and dashpots, and (k, 2) spring extension in rigid-body motions.

    Parameters
    ----------
    springs, length, mesh : properties of the beam.
    matrices : factor of all dofs, and their damping, N s/m, or None.
    unit : unit of stiffness, N/m.
    """
    factor, drag = matrices
    rows = np.zeros((len(springs), mesh.size))
    for row, spring in zip(rows, springs, strict=True):
        order = _DERIVATIVE[spring.ends[0].direction]
        row[:] = mesh.rows(spring.ends[0].coordinate / length, order).toarray()[0] / length**order
    pulling, dragging = np.array([(each.stiffness, each.dashpot) for each in springs], dtype=float).reshape(-1, 2).T
    pulled, dragged = (csr_array(rows * np.sqrt(of)[:, None]) for of in (pulling, dragging))
    factor = vstack([factor, pulled / np.sqrt(unit)], format="csr")
    if dragged.nnz:
        drag = dragged.T @ dragged if drag is None else drag + dragged.T @ dragged
    return factor, drag, rows[pulling > 0.0] @ mesh.rigid_motions
