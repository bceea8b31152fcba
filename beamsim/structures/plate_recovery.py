"""Moments and stresses of a plate at the nodes of its mesh.

Second derivatives of cubic splines are most accurate at the two Gauss points of each element (J. Barlow, 1976), where
their error is two orders smaller than elsewhere. They are interpolated from there to the nodes, by cubic polynomials
through the next four.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, kron, vstack

from beamsim.errors import Problem, ScenarioError
from beamsim.scenario.plate import PlateBody
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.basis import ReducedBasis
from beamsim.structures.mesh import Mesh
from beamsim.structures.meshed import MeshedBody
from beamsim.structures.places import Place
from beamsim.structures.plate_mesh import PlateMesh
from beamsim.structures.reduction import static_deflections
from beamsim.structures.stations import IN_PLANE, Recovery
from beamsim.structures.structure import MemberBody
from beamsim.structures.supports import UnitMotion
from beamsim.typing import Floats


@dataclass(frozen=True)
class PlateModel(MeshedBody, ABC):
    """A plate in bicubic Hermite elements, as far as its moments need it."""

    section: PlateBody
    mesh: PlateMesh

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Deflection, moments Mx, My, Mxy per width and stresses at the nodes.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            Three moments at each node of the mesh.
        """
        plate, whole = self.section, member.whole
        scale = 1 / np.sqrt(whole.mass_scale)
        operator = moment_operator(self)

        def moments(vectors: Floats) -> Floats:
            return np.asarray(operator @ self.whole_field(member.field(vectors)))

        moment = moments(basis.vectors) + operator @ _moved(self, basis)
        moment[:, : basis.rigid] = 0.0  # rigid-body motion causes no bending, except by round-off
        remainder = np.zeros(moment.shape[0])
        if base is not None:
            inertia = whole.base_load(base)[0]
            remainder = basis.left_out(inertia, moment, moments(static_deflections(whole, inertia[:, None]))[:, 0])
        per_moment = plate.bending.stress_per_moment
        points = self.mesh.node_points * (plate.length, plate.width)
        return Recovery(
            body=self.name,
            axis=IN_PLANE,
            position=points[:, 0],
            across=points[:, 1],
            deflection=self.whole_field(member.field(basis.vectors))[self.mesh.deflections] * scale,
            bending_moment=moment * scale,
            stress_per_moment=None if per_moment is None else np.full(moment.shape[0], per_moment),
            strains_per_moments=_strains_per_moments(plate),
            base_moment=-remainder * (whole.mass_scale / whole.stiffness_scale),
            moments=3,
        )


def _strains_per_moments(plate: PlateBody) -> Floats | None:
    """(3, 3) strains h/2 w_xx, h/2 w_yy and h w_xy of the lower surface for a unit of Mx, My, Mxy, 1/N."""
    if plate.bending.depth is None:
        return None
    d = plate.bending.rigidity
    stiffness = np.array([[d.dx, d.d1, 0.0], [d.d1, d.dy, 0.0], [0.0, 0.0, d.dxy]])
    return np.asarray(plate.bending.depth / 2 * np.linalg.inv(stiffness))


def _moved(structure: PlateModel, basis: ReducedBasis) -> Floats:
    """(size, n) what supports that move displace themselves, for a unit of each coordinate."""
    field = np.zeros((structure.mesh.size, basis.size))
    if not basis.static_vectors and any(isinstance(pattern.site, UnitMotion) for pattern in basis.patterns):
        raise ScenarioError(
            Problem(
                "reduction", "keeps all modes, and with them no static vector that the moments of a plate need where a "
                "support moves", "keep fewer modes (reduction: {modes: 40}), or leave reduction out",
            )
        )  # fmt: skip
    for pattern, row in zip(basis.patterns, basis.pattern, strict=True):
        if isinstance(pattern.site, UnitMotion) and structure.name in pattern.site.fields:
            field += np.multiply.outer(pattern.site.fields[structure.name], row)
    return field


def moment_operator(structure: PlateModel) -> Any:
    """(3 nodes, size) rows of Mx, then My, then Mxy per width at the nodes, N for a metre of each dof."""
    plate, (x, y) = structure.section, (structure.mesh.x, structure.mesh.y)
    d, length, width = plate.bending.rigidity, plate.length, plate.width
    xx = kron(_second_derivatives(x), y.rows(y.nodes), format="csr") / length**2
    yy = kron(x.rows(x.nodes), _second_derivatives(y), format="csr") / width**2
    xy = kron(x.rows(x.nodes, 1), y.rows(y.nodes, 1), format="csr") / (length * width)
    return vstack([d.dx * xx + d.d1 * yy, d.d1 * xx + d.dy * yy, 2 * d.dxy * xy], format="csr")


def _second_derivatives(mesh: Mesh) -> Any:
    """(nodes, 2 nodes) rows of the second derivative at the nodes, interpolated from the Gauss points."""
    gauss = (mesh.nodes[:-1, None] + mesh.lengths[:, None] * (1 + np.array([-1.0, 1.0]) / np.sqrt(3)) / 2).ravel()
    count = min(4, gauss.size)
    first = np.clip(np.searchsorted(gauss, mesh.nodes) - count // 2, 0, gauss.size - count)
    near = first[:, None] + np.arange(count)
    weights = np.ones((mesh.nodes.size, count))
    for j in range(count):
        for k in range(count):
            if k != j:
                weights[:, j] *= (mesh.nodes - gauss[near[:, k]]) / (gauss[near[:, j]] - gauss[near[:, k]])
    rows = np.repeat(np.arange(mesh.nodes.size), count)
    interpolation = csr_array((weights.ravel(), (rows, near.ravel())), shape=(mesh.nodes.size, gauss.size))
    return interpolation @ mesh.rows(gauss, 2)
