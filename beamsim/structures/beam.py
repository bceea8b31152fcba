r"""A beam: mesh, supports, point masses, rigid-body modes, and what it answers as a structure.

Bending moments follow from equilibrium instead of curvature. The nodal forces of an element are k u - f, where f is its
distributed inertia and the point loads inside it. They converge as fast as the nodal displacements (fourth order),
while second derivatives of the shape functions lose two orders. Between the nodes the moment follows from the left-hand
nodal force and moment by integrating the load, so that a station under a point load shows the peak.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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
    double_integral,
    element_rows,
    on_supports,
    shape_functions,
)
from beamsim.structures.named_matrices import DofTable, NamedDofs
from beamsim.structures.places import DEFLECTION, SLOPE, BaseDirection, Distributed, Place, Site
from beamsim.structures.reduction import static_deflections
from beamsim.structures.stations import ALONG, Recovery
from beamsim.structures.structure import (
    Coupling,
    GivenField,
    Hold,
    LoadPattern,
    MemberBody,
    ReducedBasis,
    UnitMotion,
    WeightedValues,
)
from beamsim.typing import Floats, Ints


def stations(mesh: Mesh, extra: list[float]) -> Floats:
    """(nx,) nondimensional positions: nodes, element midpoints and the extra points (snubbers, forces)."""
    x = np.concatenate([mesh.nodes, mesh.nodes[:-1] + mesh.lengths / 2])
    distinct = [p for p in extra if np.min(np.abs(x - p)) > 1e-9]
    return np.unique(np.concatenate([x, distinct]))


def _strain_per_moment(bending: Any) -> float | None:
    """Strain of the outermost fibre, 1/(N m); None where that is unknown."""
    return None if bending.depth is None else float(bending.depth / 2 / bending.bending_stiffness)


def _per_moment(model: BeamStructure, x: Floats, of: Callable[[Any], float | None]) -> Floats | None:
    """(nx,) stress or strain per moment at stations, where segments meet the larger one; None where unknown."""
    by_stretch = [of(stretch.bending) for stretch in model.section.stretches]
    known = [value for value in by_stretch if value is not None]
    if len(known) < len(by_stretch):
        return None
    right, inside = model.mesh.locate(x)
    left = np.where(inside < 1e-9, np.maximum(right - 1, 0), right)
    values = np.array(known)[model.stretch_of]
    return np.asarray(np.maximum(values[left], values[right]))


@dataclass(frozen=True)
class _Fields:
    """Columns of displacement of a beam with the loads in equilibrium with them, K u = M a + point forces.

    What joints and supports hold acts on nodes, and so on no element.
    """

    displacement: Floats  # (all dofs, c)
    acceleration: Floats  # (all dofs, c)
    # nondimensional places (k,) and sizes (k,) of point forces, and how many times they act on each column (c,)
    forces: list[tuple[Floats, Floats, Floats]]


def moment_rows(model: BeamStructure, member: MemberBody, basis: ReducedBasis, x: Floats) -> Floats:
    """(nx, n) scaled moments E I w'' at nondimensional x, for a unit of each column of the basis.

    Parameters
    ----------
    model, member : the beam, and how it lies in its structure.
    basis : reduced coordinates of the whole structure.
    x : (nx,) nondimensional stations.

    Returns
    -------
    (nx, n) array
        In E I / L^2 of the beam, for a metre.

    Notes
    -----
    If all modes are kept, there are no static vectors to represent the kinks under point loads. The modes that the
    mesh does not resolve (with numbers above the number of elements) are then corrected so that the moments of the
    static deflections are exact in this case as well.
    """
    a = basis.vectors[:, : basis.modes] @ basis.acceleration_modes
    moment = _moments(
        model, x, _fields(model, member, x, basis.vectors, a, zip(basis.patterns, basis.pattern, strict=True))
    )
    moment[:, : basis.rigid] = 0.0  # rigid-body motion causes no bending, except by round-off
    if basis.modes == member.whole.size and basis.patterns:
        moment = moment + _static_correction(model, member, basis, x, moment)
    return moment


def _static_moments(
    model: BeamStructure, member: MemberBody, x: Floats, patterns: Sequence[LoadPattern]
) -> tuple[Floats, Floats]:
    """(N, m) static deflections under loads, with inertia relief, and (nx, m) their scaled moments."""
    whole, loads = member.whole, np.array([pattern.vector for pattern in patterns]).T
    u = static_deflections(whole, loads)
    relief = -whole.rigid @ (whole.rigid.T @ loads)
    return u, _moments(
        model, x, _fields(model, member, x, u, relief, zip(patterns, np.eye(len(patterns)), strict=True))
    )


def _fields(
    model: BeamStructure,
    member: MemberBody,
    x: Floats,
    u: Floats,
    a: Floats,
    loads: Iterable[tuple[LoadPattern, Floats]],
) -> _Fields:
    """Fields on all dofs of the beam; an inertia pattern becomes the acceleration of a rigid motion, supports included.

    Distributed loads become point forces that stand for them between neighbouring stations x.
    """
    inertia = member.mass_ratio / member.stiffness_ratio
    displacement = model.whole_field(member.field(u))
    acceleration = model.whole_field(member.field(a)) * inertia
    forces = []
    for pattern, row in loads:
        site = pattern.site
        if isinstance(site, BaseDirection):
            moving = model.rigid_motion(member.whole.seen_from(model.name, site))
            acceleration += np.multiply.outer(moving, row * inertia)
        elif isinstance(site, UnitMotion):
            if model.name in site.fields:
                displacement = displacement + np.multiply.outer(site.fields[model.name], row)
        elif isinstance(site, Place | Distributed) and member.whole.member(site.body).body is model and row.any():
            if isinstance(site, Place):
                places, sizes = np.array([site.coordinate / model.section.length]), np.ones(1)
            else:
                points, sizes = model.point_forces(site, x * model.section.length)
                places = points[:, 0]
            forces.append((places, sizes, row / member.stiffness_ratio))
    return _Fields(displacement, acceleration, forces)


def _moments(model: BeamStructure, x: Floats, fields: _Fields) -> Floats:
    """(nx, c) scaled moments of the fields."""
    mesh = model.mesh
    h, dofs = mesh.lengths, mesh.dofs
    u, a = fields.displacement[dofs], fields.acceleration[dofs]
    a = a * model.line_mass[:, None, None]
    bent, moved = element_rows(h, 2, 2), element_rows(h, 0, 4)
    curvature = np.einsum("esd,edn->esn", bent, u) * model.bending[:, None, None]
    force = np.einsum("esd,esn->edn", bent, curvature)
    force -= np.einsum("esd,esn->edn", moved, np.einsum("esd,edn->esn", moved, a))
    element, xi = mesh.locate(x)
    levers: list[tuple[Floats, Floats]] = []
    for places, sizes, p in fields.forces:
        e, within = mesh.locate(places)
        at_nodes = np.zeros((h.size, 4))
        np.add.at(at_nodes, e, shape_functions(within, h[e]) * sizes[:, None])
        force -= at_nodes[:, :, None] * p
        beyond = np.where(element[:, None] == e, np.clip(xi[:, None] - within, 0.0, None), 0.0)
        levers.append((beyond @ (sizes * h[e]), p))

    moment = -force[element, 1] + force[element, 0] * (xi * h[element])[:, None]
    moment += np.einsum("xd,xdn->xn", double_integral(xi, h[element]), a[element])
    for lever, p in levers:
        moment += lever[:, None] * p
    # At the right-hand end use the nodal moment itself, without the round-off of the integration.
    moment[np.isclose(x, 1.0, rtol=0, atol=1e-12)] = force[-1, 3]
    return np.asarray(moment)


def _resolved(model: BeamStructure, member: MemberBody, basis: ReducedBasis) -> int:
    """Number of modes that count as resolved by the meshes, so few that a beam has three quarters of the others left.

    A beam has of each mode its share of the energy. Round-off decides neither between shares nor between modes alike.
    """
    most = basis.size - 1 if member.whole.most_modes is None else member.whole.most_modes
    strain = (model.factor @ member.field(basis.vectors))[:, basis.rigid :] / basis.omega[basis.rigid :]
    shares = np.cumsum(np.append(np.ones(basis.rigid), np.sum(strain**2, axis=0) * member.stiffness_ratio))
    last = min(int(np.searchsorted(shares, 0.75 * model.most_modes + 0.25 * shares[-1] - 1e-6)), basis.size - 1)
    return min(most, int(np.searchsorted(basis.omega, basis.omega[last] * (1 - 1e-9))))


def _static_correction(
    model: BeamStructure, member: MemberBody, basis: ReducedBasis, x: Floats, moment: Floats
) -> Floats:
    """(nx, n) correction of the unresolved modes that makes the static moments of the load patterns exact."""
    whole = member.whole
    u, exact = _static_moments(model, member, x, basis.patterns)
    coordinates = basis.vectors.T @ (whole.mass @ u)
    coordinates[: basis.rigid] = 0.0
    missing = exact - moment @ coordinates
    resolved = _resolved(model, member, basis)
    # The part of a motion along the static deflections, by projection in the energy norm. Of more loads than such modes
    # it is a fit, in which each weighs the same, whatever its level and however often it is listed.
    strain = basis.omega[:, None] * coordinates
    size = np.linalg.norm(strain, axis=0)
    of_loads = np.linalg.norm([basis.vectors.T @ pattern.vector for pattern in basis.patterns], axis=1)
    bending = np.flatnonzero(size > 1e-9 * of_loads / basis.omega[basis.rigid])  # others move it as a whole
    unit, lacking = strain[:, bending] / size[bending], missing[:, bending] / size[bending]
    # What is listed twice counts once: neither its motion nor its moments differ, but in sign.
    largest = np.max(np.abs(exact[:, bending] / size[bending]), initial=np.finfo(float).tiny)
    gram = np.vstack([unit, lacking / largest]).T @ np.vstack([unit, lacking / largest])
    once = ~np.tril(np.add.outer(np.diag(gram), np.diag(gram)) - 2 * np.abs(gram) < 1e-12, -1).any(axis=1)
    part = unit[resolved:, once]  # of columns of length one: below 1e-9 is round-off, also where nothing else is left
    fit = np.linalg.pinv(part, rcond=1e-9 / max(float(np.linalg.norm(part)), 1e-9))
    return np.pad(lacking[:, once] @ fit * basis.omega[resolved:], ((0, 0), (resolved, 0)))


_DERIVATIVE = {DEFLECTION: 0, SLOPE: 1}
# What an end holds: deflection, 0, and slope, 1.
_HELD: dict[str, tuple[int, ...]] = {"clamped": (0, 1), "pinned": (0,), "guided": (1,), "free": ()}


def _place_row(mesh: Mesh, length: float, place: Place) -> Floats:
    """(all dofs,) deflection at a place of a beam, or slope, 1/m."""
    if place.direction not in _DERIVATIVE:
        raise ValueError(f"a beam has no motion {place.direction}; it has {' and '.join(_DERIVATIVE)}")
    derivative = _DERIVATIVE[place.direction]
    return np.asarray(mesh.rows(place.coordinate / length, derivative).toarray()[0] / length**derivative)


def supported_dofs(left: str, right: str, nodes: int) -> Ints:
    """Degrees of freedom that the supports hold at zero (relative to the base).

    Parameters
    ----------
    left, right : kinds of the supports: clamped, pinned, guided or free.
    nodes : number of nodes of the mesh.

    Returns
    -------
    (h,) array
        Two dofs a node, deflection and slope.
    """
    return np.array([*_HELD[left], *(2 * (nodes - 1) + i for i in _HELD[right])], dtype=np.int64)


@dataclass(frozen=True)
class BeamStructure(MeshedBody):
    """A beam as a structure; places are metres from its left end."""

    section: BeamBody
    mesh: Mesh
    stretch_of: Ints  # (elements,) which of the beam's stretches each element belongs to
    bending: Floats  # (elements,) bending stiffness, in the largest of the beam
    line_mass: Floats  # (elements,) mass per length, in the mean of the beam
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
        beam, scale = self.section, 1 / np.sqrt(member.whole.mass_scale)
        length = beam.length
        x = stations(self.mesh, [place.coordinate / length for place in sites])
        moment = moment_rows(self, member, basis, x)
        remainder = np.zeros(x.size)
        if base is not None:
            inertia = member.whole.base_load(base)[0]
            _, exact = _static_moments(self, member, x, [LoadPattern(inertia, base)])
            remainder = basis.left_out(inertia, moment, exact[:, 0])
        return Recovery(
            body=self.name,
            axis=ALONG,
            position=x * length,
            deflection=self.mesh.rows(x) @ self.whole_field(member.field(basis.vectors)) * scale,
            bending_moment=moment * (scale * beam.bending.bending_stiffness / length**2),
            stress_per_moment=_per_moment(self, x, lambda bending: bending.stress_per_moment),
            strain_per_moment=_per_moment(self, x, _strain_per_moment),
            base_moment=-remainder * (member.whole.mass_scale * length * member.stiffness_ratio),
        )

    @property
    def most_modes(self) -> int:
        """One an element: the mesh has no modes with higher numbers."""
        return self.mesh.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""
        # Free-free bounds every support from above (less is held, more modes below); beta_n ~ (n - 3/2) pi with
        # both rigid-body modes counted. Segments cut apart bound the beam in the same way, and so does the softest and
        # heaviest all along. A mass added lowers at most one more frequency past the limit, as does a rotary inertia.
        beam, squared = self.section, (omega * self.frequency_scale) ** 2

        def count(line_mass: float, stiffness: float, length: float) -> int:
            return int(np.ceil((squared * line_mass / stiffness) ** 0.25 / np.pi * length)) + 2

        of_stretches = [(s.mass_per_length, s.bending_stiffness, s.length) for s in beam.stretches]
        mass, stiffness, _ = zip(*of_stretches, strict=True)
        apart, alike = sum(count(*each) for each in of_stretches), count(max(mass), min(stiffness), beam.length)
        rotary = sum(mass.rotary_inertia > 0.0 for mass in beam.point_masses)
        return min(apart, alike) + len(beam.point_masses) + rotary

    def point_row(self, place: Place) -> Floats:
        """(all dofs,) deflection or slope at a place."""
        return _place_row(self.mesh, self.section.length, place)

    def base_coefficients(self, motion: BaseDirection) -> Floats:
        """(2,) the translation and the rotation of the mesh that make up a unit motion of the base."""
        if motion.direction == "ry":  # z goes down with x
            return np.array([motion.about[0], -self.section.length])
        if motion.direction in ("", "z"):
            return np.array([1.0, 0.0])
        raise MethodError("direction", f"= {motion.direction} does not deflect a beam", "use z, or ry, a rotation")

    def unit_stiffness(self, site: Site) -> float:
        """E I / L^3, N/m, with the largest E I."""
        return self.section.bending.bending_stiffness / self.section.length**3

    def reassembled(self, section: BeamBody) -> BeamStructure:
        """The beam with other numbers on the same mesh."""
        return assemble_beam(section, self.name, mesh=self.mesh)

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

    @property
    def springs_at_ends(self) -> Sequence[Coupling]:
        """Springs and dashpots between the ends and the base."""
        return end_springs(self.section, self.name) if self.section.elastic_supports else []

    def holds(self, base: BaseDirection) -> Sequence[Hold]:
        """Deflection and slope of each end that is held, or on springs."""
        springs = {(each.name, each.site): each for each in self.springs_at_ends}
        holds = []
        for name, x, first in (("left", 0.0, 0), ("right", self.section.length, self.mesh.size - 2)):
            for dof, direction, unit in ((first, DEFLECTION, 1.0), (first + 1, SLOPE, self.section.length)):
                place = Place(self.name, x, direction)
                spring = springs.get((name, place))
                motion = None if dof in self.free else np.where(np.arange(self.mesh.size) == dof, unit, 0.0)
                if motion is not None or spring is not None:
                    holds.append(Hold(name, direction, self.base_motion_of(place, base), motion, spring))
        return holds

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,), also between the nodes."""
        from scipy.interpolate import CubicHermiteSpline

        whole = self.whole_field(field)
        spline = CubicHermiteSpline(self.mesh.nodes, whole[0::2], whole[1::2])
        level = spline.derivative().roots(extrapolate=False)
        return float(np.abs(spline(np.append(self.mesh.nodes, level[np.isfinite(level)]))).max())

    def given_field(self, numbers: Sequence[float]) -> GivenField:
        """A polynomial in x (m) from the left end, by its coefficients of x^0, x^1, ..., in SI units."""
        mesh, length, masses = self.mesh, self.section.length, self.section.point_masses
        polynomial = np.polynomial.Polynomial(np.asarray(numbers, dtype=float) * length ** np.arange(len(numbers)))
        points, weights = np.polynomial.legendre.leggauss(len(numbers) // 2 + 4)
        x = (mesh.nodes[:-1, None] + mesh.lengths[:, None] * (points + 1) / 2).ravel()
        weight = mesh.lengths[:, None] * weights / 2
        at = np.array(self.section.mass_points) / length
        turning = np.array([m.rotary_inertia for m in masses]) / length**2  # of slopes by x / L
        lumped = np.concatenate([[m.mass for m in masses], turning]) / self.mass_scale
        rows = vstack([mesh.rows(x), mesh.rows(at), mesh.rows(at, 1)], format="csr")
        kinetic = WeightedValues(
            rows[:, self.free],
            np.concatenate([(weight * self.line_mass[:, None]).ravel(), lumped]),
            np.concatenate([polynomial(x), polynomial(at), polynomial.deriv()(at)]),
        )
        bending = (weight * self.bending[:, None]).ravel()
        curved = WeightedValues(mesh.rows(x, 2)[:, self.free], bending, polynomial.deriv(2)(x))
        return GivenField(kinetic, curved)


def end_springs(beam: BeamBody, name: str) -> list[Coupling]:
    """Springs and dashpots between the ends and the base."""
    springs = []
    for end, x, given in zip(("left", "right"), (0.0, beam.length), beam.supports.springs, strict=True):
        if given is not None:
            along, about = Place(name, x), Place(name, x, SLOPE)
            springs.append(Coupling(end, along, given.stiffness, given.dashpot))
            springs.append(Coupling(end, about, given.rotational_stiffness, given.rotational_dashpot))
    return [each for each in springs if each.stiffness or each.dashpot]


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

    Returns
    -------
    BeamStructure
        Scaled, without the dofs that supports hold.
    """
    length, stretches = beam.length, beam.stretches
    bounds = np.array([0.0, *(stretch.start / length for stretch in stretches[1:]), 1.0])
    if mesh is None:
        hard = [*beam.mass_points, *beam.node_positions, *nodes]
        mesh = build_mesh(beam.elements, [x / length for x in hard], bounds.tolist())
    mass_scale = beam.bending.mass_per_length * length
    stiffness_scale = beam.bending.bending_stiffness / length**3
    stretch_of = np.searchsorted(bounds, mesh.nodes[:-1] + mesh.lengths / 2) - 1
    bending = np.array([stretch.bending_stiffness / beam.bending.bending_stiffness for stretch in stretches])[
        stretch_of
    ]
    line_mass = np.array([stretch.mass_per_length / beam.bending.mass_per_length for stretch in stretches])[stretch_of]

    factor = mesh.square_rows(2, 2) * np.repeat(np.sqrt(bending), 2)[:, None]
    deflected, drag = mesh.square_rows(0, 4), None
    inertia = [deflected * np.repeat(np.sqrt(line_mass), 4)[:, None]]
    if beam.point_masses:
        inertia.append(point_mass_rows(mesh, beam))
    moving = vstack(inertia, format="csr")
    mass = moving.T @ moving

    if beam.damping is not None and beam.damping.kind == "viscous":  # of which point masses are left out
        drag = beam.damping.coefficient * length * (deflected.T @ deflected)
    stretch = np.zeros((0, 2))  # of springs at the ends in rigid-body motions
    if beam.elastic_supports:
        springs, dashpots, stretch = _at_elastic_supports(beam, mesh)
        factor = vstack([factor, springs / np.sqrt(stiffness_scale)], format="csr")
        if dashpots.nnz:
            drag = dashpots.T @ dashpots if drag is None else drag + dashpots.T @ dashpots
    held = supported_dofs(*beam.supports.kinds, mesh.nodes.size)
    return BeamStructure(
        name=name,
        section=beam,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        stretch_of=stretch_of,
        bending=bending,
        line_mass=line_mass,
        **on_supports(mesh, (mass, factor, drag), held, stretch),
    )


def _at_elastic_supports(beam: BeamBody, mesh: Mesh) -> tuple[Any, Any, Floats]:
    """Rows (s, all dofs) whose products are springs and dashpots at the ends; (k, 2) stretch in rigid-body motions."""
    ends = end_springs(beam, "")
    rows = np.array([_place_row(mesh, beam.length, each.ends[0]) for each in ends]).reshape(-1, mesh.size)
    pulling, dragging = np.array([(each.stiffness, each.dashpot) for each in ends], dtype=float).reshape(-1, 2).T
    springs, dashpots = (csr_array(rows * np.sqrt(of)[:, None]) for of in (pulling, dragging))
    return springs, dashpots, rows[pulling > 0.0] @ mesh.rigid_motions


def point_mass_rows(mesh: Mesh, beam: BeamBody) -> Any:
    """(c, all dofs) sparse rows whose products are the scaled point masses and their rotary inertias."""
    mass_scale = beam.bending.mass_per_length * beam.length
    at = np.array(beam.mass_points) / beam.length
    mass, rotary = (np.array([getattr(m, of) for m in beam.point_masses]) for of in ("mass", "rotary_inertia"))
    turning = mesh.rows(at, 1) * (np.sqrt(rotary / mass_scale) / beam.length)[:, None]
    return vstack([mesh.rows(at) * np.sqrt(mass / mass_scale)[:, None], turning], format="csr")
