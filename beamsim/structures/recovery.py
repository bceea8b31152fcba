"""Bending moments along a beam, from equilibrium instead of curvature.

The nodal forces of an element are k u - f, where f is its distributed inertia and the point loads inside it. They
converge as fast as the nodal displacements (fourth order), while second derivatives of the shape functions lose
two orders. Between the nodes the moment follows from the left-hand nodal force and moment by integrating the load,
so that a station under a point load shows the peak.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.scenario.beam import BeamBody
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.basis import LoadPattern, ReducedBasis
from beamsim.structures.distributed import Distributed
from beamsim.structures.mesh import Mesh, double_integral, element_rows, shape_functions
from beamsim.structures.meshed import MeshedBody
from beamsim.structures.places import Place
from beamsim.structures.reduction import static_deflections
from beamsim.structures.stations import ALONG, Recovery
from beamsim.structures.structure import MemberBody
from beamsim.structures.supports import UnitMotion
from beamsim.typing import Floats, Ints


def stations(mesh: Mesh, extra: list[float]) -> Floats:
    """(nx,) nondimensional positions: nodes, element midpoints and the extra points (snubbers, forces)."""
    x = np.concatenate([mesh.nodes, mesh.nodes[:-1] + mesh.lengths / 2])
    distinct = [p for p in extra if np.min(np.abs(x - p)) > 1e-9]
    return np.unique(np.concatenate([x, distinct]))


@dataclass(frozen=True)
class BeamModel(MeshedBody, ABC):
    """An Euler-Bernoulli beam in cubic Hermite elements, as far as its moments need it."""

    section: BeamBody
    mesh: Mesh
    stretch_of: Ints  # (elements,) which of the beam's stretches each element belongs to
    bending: Floats  # (elements,) bending stiffness, in the largest of the beam
    line_mass: Floats  # (elements,) mass per length, in the mean of the beam

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


def _strain_per_moment(bending: Any) -> float | None:
    """Strain of the outermost fibre, 1/(N m); None where that is unknown."""
    return None if bending.depth is None else float(bending.depth / 2 / bending.bending_stiffness)


def _per_moment(model: BeamModel, x: Floats, of: Callable[[Any], float | None]) -> Floats | None:
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


def moment_rows(model: BeamModel, member: MemberBody, basis: ReducedBasis, x: Floats) -> Floats:
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
    moment = _moments(model, x, _fields(model, member, x, basis.patterns, basis.vectors, a, basis.pattern))
    moment[:, : basis.rigid] = 0.0  # rigid-body motion causes no bending, except by round-off
    if basis.modes == member.whole.size and basis.patterns:
        moment = moment + _static_correction(model, member, basis, x, moment)
    return moment


def _static_moments(
    model: BeamModel, member: MemberBody, x: Floats, patterns: Sequence[LoadPattern]
) -> tuple[Floats, Floats]:
    """(N, m) static deflections under loads, with inertia relief, and (nx, m) their scaled moments."""
    whole, loads = member.whole, np.array([pattern.vector for pattern in patterns]).T
    u = static_deflections(whole, loads)
    relief = -whole.rigid @ (whole.rigid.T @ loads)
    return u, _moments(model, x, _fields(model, member, x, patterns, u, relief, np.eye(len(patterns))))


def _fields(
    model: BeamModel, member: MemberBody, x: Floats, patterns: Sequence[LoadPattern], u: Floats, a: Floats, p: Floats
) -> _Fields:
    """Fields on all dofs of the beam; an inertia pattern becomes the acceleration of a rigid motion, supports included.

    Distributed loads become point forces that stand for them between neighbouring stations x.
    """
    inertia = member.mass_ratio / member.stiffness_ratio
    displacement = model.whole_field(member.field(u))
    acceleration = model.whole_field(member.field(a)) * inertia
    forces = []
    for pattern, row in zip(patterns, p, strict=True):
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


def _moments(model: BeamModel, x: Floats, fields: _Fields) -> Floats:
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


def _static_correction(model: BeamModel, member: MemberBody, basis: ReducedBasis, x: Floats, moment: Floats) -> Floats:
    """(nx, n) correction of the unresolved modes that makes the static moments of the load patterns exact."""
    whole = member.whole
    u, exact = _static_moments(model, member, x, basis.patterns)
    coordinates = basis.vectors.T @ (whole.mass @ u)
    coordinates[: basis.rigid] = 0.0
    missing = exact - moment @ coordinates
    resolved = basis.size if whole.most_modes is None else whole.most_modes
    high = slice(min(resolved, basis.size - 1), None)
    # The part of a motion along the static deflections, by projection in the energy norm.
    static = basis.omega[high, None] * coordinates[high]
    correction = np.zeros_like(moment)
    correction[:, high] = (missing @ np.linalg.pinv(static, rcond=1e-9)) * basis.omega[high]
    return correction
