"""The finite-element model of a beam: mesh, supports, and the rows and fields on it."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import MethodError
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.distributed import Distributed
from beamsim.structures.hermite import shape_functions
from beamsim.structures.mesh import Mesh, line_rows
from beamsim.structures.modes import mode_of_unit_deflection
from beamsim.structures.places import DEFLECTION, SLOPE, LoadSite, Place, separated
from beamsim.structures.structure import BodyStructure
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario.beam import BeamBody


_DERIVATIVE = {DEFLECTION: 0, SLOPE: 1}


def deflection_row(mesh: Mesh, x: float, derivative: int = 0) -> Floats:
    """(2 nodes,) row that gives the deflection at nondimensional x, or its derivative by that."""
    row = np.zeros(2 * mesh.nodes.size)
    element, xi = mesh.locate(x)
    row[mesh.dofs[element]] = shape_functions(xi, mesh.lengths[element], derivative)
    return row


def rigid_motions(mesh: Mesh) -> Floats:
    """(2 nodes, 2) translation, and rotation about the left end."""
    motions = np.zeros((2 * mesh.nodes.size, 2))
    motions[0::2, 0] = 1.0
    motions[0::2, 1] = mesh.nodes
    motions[1::2, 1] = 1.0
    return motions


@dataclass(frozen=True)
class BeamModel(BodyStructure, ABC):
    """An Euler-Bernoulli beam in cubic Hermite elements; places are metres from its left end."""

    beam: BeamBody
    mesh: Mesh
    free: Ints  # (N,) which of the unsupported beam's dofs are left
    stretch_of: Ints  # (elements,) which of the beam's stretches each element belongs to
    bending: Floats  # (elements,) bending stiffness, in the largest of the beam
    line_mass: Floats  # (elements,) mass per length, in the mean of the beam
    unsupported: tuple[Any, Any, Any]  # mass and factor of all dofs, scaled, and their damping, N s/m, or None
    rigid_inertia: Floats  # (N, 2) `inertia` of a translation, and of a rotation by w' = 1 / length about the left end

    @property
    def most_modes(self) -> int:
        """One an element: modes with higher numbers are not carried by the mesh."""
        return self.mesh.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""
        # Free-free bounds every support from above (less is held, more modes below); beta_n ~ (n - 3/2) pi with
        # both rigid-body modes counted. Segments cut apart bound the beam in the same way, and so does the softest and
        # heaviest all along. A mass added lowers at most one more frequency past the limit, as does a rotary inertia.
        beam, physical = self.beam, omega * self.frequency_scale
        stretches = beam.stretches
        per_length = [
            (physical**2 * stretch.mass_per_length / stretch.bending_stiffness) ** 0.25 / np.pi for stretch in stretches
        ]
        apart = sum(int(np.ceil(n * s.length)) + 2 for n, s in zip(per_length, stretches, strict=True))
        heaviest = max(stretch.mass_per_length for stretch in stretches)
        softest = min(stretch.bending_stiffness for stretch in stretches)
        alike = int(np.ceil((physical**2 * heaviest / softest) ** 0.25 * beam.length / np.pi)) + 2
        rotary = sum(mass.rotary_inertia > 0.0 for mass in beam.point_masses)
        return min(apart, alike) + len(beam.point_masses) + rotary

    def loaded_sites(self, sites: Sequence[LoadSite]) -> list[LoadSite]:
        """Single places: moments are recovered from one point force at a time."""
        return separated(sites)

    def place_row(self, place: Place) -> Floats:
        """(N,) deflection or slope at a place for a unit of each degree of freedom."""
        return self.unsupported_row(place)[self.free]

    def unsupported_row(self, place: Place | Distributed) -> Floats:
        """(all dofs,) row of a place or load vector, those that the supports hold included."""
        if isinstance(place, Distributed):
            return self._distributed_on_all(place)
        if place.direction not in _DERIVATIVE:
            raise ValueError(f"a beam has no motion {place.direction}; it has {' and '.join(_DERIVATIVE)}")
        derivative = _DERIVATIVE[place.direction]
        row = deflection_row(self.mesh, place.coordinate / self.beam.length, derivative)
        return row / self.beam.length if derivative else row

    def point_forces(self, load: Distributed, cuts: Floats) -> tuple[Floats, Floats]:
        """Nondimensional positions (k,) and forces (k,) that stand for a distributed load of unit level.

        Between neighbouring ``cuts`` (m), nodes and corners of the shape, they have the force and the moment of the
        load, and those of its products with the shape functions.
        """
        length = self.beam.length
        points, weights = load.quadrature((length,), (np.concatenate([self.mesh.nodes * length, cuts]),))
        return points[:, 0] / length, weights * load.intensity(points, (length,), self._mode_at)

    def distributed_row(self, load: Distributed) -> Floats:
        """(N,) consistent load vector of a distributed load of unit level."""
        return self.unsupported_row(load)[self.free]

    def _distributed_on_all(self, load: Distributed) -> Floats:
        x, force = self.point_forces(load, np.zeros(0))
        return np.asarray(line_rows(self.mesh, x).T @ force)

    def _mode_at(self, mode: int, points: Floats) -> Floats:
        return np.asarray(
            line_rows(self.mesh, points[:, 0] / self.beam.length)
            @ self.whole_field(mode_of_unit_deflection(self, mode))
        )

    def base_coefficients(self, motion: BaseDirection) -> Floats:
        """(2,) the translation and the rotation of `rigid_motions` that make up a unit motion of the base."""
        if motion.direction == "ry":  # z goes down with x
            return np.array([motion.about[0], -self.beam.length])
        if motion.direction in ("", "z"):
            return np.array([1.0, 0.0])
        raise MethodError("direction", f"= {motion.direction} does not deflect a beam", "use z, or ry, a rotation")

    def base_load(self, motion: BaseDirection) -> tuple[Floats, Floats]:
        """(N,) inertia and (N,) force of springs to the ground under a unit motion of the base."""
        return self.rigid_inertia @ self.base_coefficients(motion), self.ground

    def base_motion_of(self, place: Place, motion: BaseDirection) -> float:
        """Deflection or slope of a place when the base moves by one unit and nothing deforms."""
        up, turned = self.base_coefficients(motion) / (1.0, self.beam.length)
        return float(turned if place.direction == SLOPE else up + turned * place.coordinate)

    def whole_field(self, vectors: Floats) -> Floats:
        """Fields (N,) or (N, k) on all dofs, those that the supports hold included."""
        field = np.zeros((2 * self.mesh.nodes.size, *vectors.shape[1:]))
        field[self.free] = vectors
        return field
