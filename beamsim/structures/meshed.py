"""Beams and plates: bodies in cubic Hermite elements, of which supports hold some degrees of freedom."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.distributed import Distributed
from beamsim.structures.mesh import Mesh
from beamsim.structures.modes import mode_of_unit_deflection, orthonormal_in_mass, unstretched
from beamsim.structures.places import LoadSite, Place, separated
from beamsim.structures.plate_mesh import PlateMesh
from beamsim.structures.structure import BodyStructure
from beamsim.typing import Floats, Ints


def on_supports(mesh: Mesh | PlateMesh, matrices: tuple[Any, Any, Any], held: Ints, stretch: Floats) -> dict[str, Any]:
    """Fields of a `MeshedBody` that follow from the matrices of all dofs and what holds them.

    Parameters
    ----------
    mesh : of the body.
    matrices : scaled mass and factor of all dofs, and their damping, N s/m, or None.
    held : dofs that the supports hold.
    stretch : (c, k) how far each of the mesh's rigid motions stretches what else holds the body.

    Returns
    -------
    dict
        By name.
    """
    mass, factor, drag = matrices
    free, motions = np.setdiff1d(np.arange(mesh.size), held), mesh.rigid_motions
    allowed = unstretched(motions, np.vstack([motions[held], stretch]))
    return {
        "mesh": mesh,
        "free": free,
        "unsupported": matrices,
        "mass": mass[free][:, free].tocsc(),
        "factor": factor[:, free].tocsr(),
        "damping": None if drag is None else drag[free][:, free].tocsc(),
        "rigid": orthonormal_in_mass(motions @ allowed, mass)[free],
    }


@dataclass(frozen=True)
class MeshedBody(BodyStructure, ABC):
    """A body whose places are metres from its left end, or from its left and bottom edges."""

    mesh: Mesh | PlateMesh
    free: Ints  # (N,) which of the unsupported body's dofs are left
    unsupported: tuple[Any, Any, Any]  # mass and factor of all dofs, scaled, and their damping, N s/m, or None

    @property
    def whole_matrices(self) -> tuple[Any, Any, Any]:
        """Scaled mass and factor of all dofs, and their damping, N s/m, or None."""
        return self.unsupported

    def on_free(self, rows: Floats) -> Floats:
        """(k, N) of rows (k, all dofs)."""
        return rows[:, self.free]

    def deflections(self, vectors: Floats) -> Floats:
        """Those of the values (N,) or (N, k) that are deflections of nodes."""
        return vectors[np.isin(self.free, self.mesh.deflections)]

    @property
    def extent(self) -> Floats:
        """(d,) sides of the body, m."""
        return np.array([getattr(self.section, side) for side in self.sides], dtype=float)

    @abstractmethod
    def point_row(self, place: Place) -> Floats:
        """(all dofs,) motion at a place in its direction."""

    @abstractmethod
    def base_coefficients(self, motion: BaseDirection) -> Floats:
        """(1 + d,) shares of the mesh's rigid motions in a unit motion of the base."""

    def loaded_sites(self, sites: Sequence[LoadSite]) -> list[LoadSite]:
        """Single places: moments are recovered from one point force at a time."""
        return separated(sites)

    def unsupported_row(self, place: Place | Distributed) -> Floats:
        """(all dofs,) row of a place or load vector, those that the supports hold included."""
        if not isinstance(place, Distributed):
            return self.point_row(place)
        points, force = self.point_forces(place, np.zeros(0))
        return np.asarray(self.mesh.rows(points).T @ force)

    def point_forces(self, load: Distributed, cuts: Floats) -> tuple[Floats, Floats]:
        """Nondimensional positions (k, d) and forces (k,) that stand for a distributed load of unit level.

        Between nodes, neighbouring ``cuts`` (m, along x) and corners of the shape they have the force and the moment of
        the load, and those of its products with the shape functions.
        """
        lines = [nodes * side for nodes, side in zip(self.mesh.lines, self.extent, strict=True)]
        points, weights = load.quadrature(self.extent, (np.concatenate([lines[0], cuts]), *lines[1:]))
        return points / self.extent, np.asarray(weights * load.intensity(points, self.extent, self._mode_at))

    def _mode_at(self, mode: int, points: Floats) -> Floats:
        field = self.whole_field(mode_of_unit_deflection(self, mode))
        return np.asarray(self.mesh.rows(points / self.extent) @ field)

    def whole_field(self, vectors: Floats) -> Floats:
        """Fields (N,) or (N, k) on all dofs, those that the supports hold included."""
        field = np.zeros((self.mesh.size, *vectors.shape[1:]))
        field[self.free] = vectors
        return field

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(all dofs,) displacement when the base moves by one unit and nothing deforms."""
        return self.mesh.rigid_motions @ self.base_coefficients(motion)
