"""The finite-element model of a beam: mesh, supports, and the rows and fields on it."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import MethodError
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.mesh import Mesh
from beamsim.structures.meshed import MeshedBody
from beamsim.structures.places import DEFLECTION, SLOPE, Place
from beamsim.typing import Floats, Ints

if TYPE_CHECKING:
    from beamsim.scenario.beam import BeamBody


_DERIVATIVE = {DEFLECTION: 0, SLOPE: 1}


def place_rows(mesh: Mesh, length: float, places: Sequence[Place]) -> Floats:
    """(k, all dofs) deflections or slopes at places of a beam.

    Parameters
    ----------
    mesh, length : of the beam, m.
    places : k of its places.

    Returns
    -------
    (k, all dofs) array
        1 for deflections, 1/m for slopes.

    Raises
    ------
    ValueError
        If a place moves in another direction.
    """
    rows = np.zeros((len(places), mesh.size))
    for row, place in zip(rows, places, strict=True):
        if place.direction not in _DERIVATIVE:
            raise ValueError(f"a beam has no motion {place.direction}; it has {' and '.join(_DERIVATIVE)}")
        derivative = _DERIVATIVE[place.direction]
        row[:] = mesh.rows(place.coordinate / length, derivative).toarray()[0] / length**derivative
    return rows


@dataclass(frozen=True)
class BeamModel(MeshedBody, ABC):
    """An Euler-Bernoulli beam in cubic Hermite elements; places are metres from its left end."""

    section: BeamBody
    mesh: Mesh
    stretch_of: Ints  # (elements,) which of the beam's stretches each element belongs to
    bending: Floats  # (elements,) bending stiffness, in the largest of the beam
    line_mass: Floats  # (elements,) mass per length, in the mean of the beam

    @property
    def most_modes(self) -> int:
        """One an element: modes with higher numbers are not carried by the mesh."""
        return self.mesh.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega."""
        # Free-free bounds every support from above (less is held, more modes below); beta_n ~ (n - 3/2) pi with
        # both rigid-body modes counted. Segments cut apart bound the beam in the same way, and so does the softest and
        # heaviest all along. A mass added lowers at most one more frequency past the limit, as does a rotary inertia.
        beam, physical = self.section, omega * self.frequency_scale
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

    def point_row(self, place: Place) -> Floats:
        """(all dofs,) deflection or slope at a place."""
        return np.asarray(place_rows(self.mesh, self.section.length, [place])[0])

    def base_coefficients(self, motion: BaseDirection) -> Floats:
        """(2,) the translation and the rotation of the mesh that make up a unit motion of the base."""
        if motion.direction == "ry":  # z goes down with x
            return np.array([motion.about[0], -self.section.length])
        if motion.direction in ("", "z"):
            return np.array([1.0, 0.0])
        raise MethodError("direction", f"= {motion.direction} does not deflect a beam", "use z, or ry, a rotation")
