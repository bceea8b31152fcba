"""The finite-element model of a plate: mesh, supports, and the rows and fields on it."""

from __future__ import annotations

from abc import ABC
from typing import TYPE_CHECKING

import numpy as np

from beamsim.dataclass import dataclass
from beamsim.errors import MethodError
from beamsim.matrix_files.matrix import MODAL
from beamsim.structures.base_motion import BaseDirection
from beamsim.structures.dof_table import DofTable, NamedDofs
from beamsim.structures.meshed import MeshedBody
from beamsim.structures.places import DEFLECTION, Place, Site
from beamsim.structures.plate_mesh import PlateMesh
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.scenario.plate import PlateBody

_FREE_BEAM = np.array([0.0, 0.0, 4.730040744862704, 7.853204624095838])  # beta L; higher ones (n + 1/2) pi


@dataclass(frozen=True)
class PlateModel(MeshedBody, ABC):
    """A plate in bicubic Hermite elements; places are metres from its left and bottom edges."""

    section: PlateBody
    mesh: PlateMesh

    @property
    def most_modes(self) -> int:
        """One an element: modes with higher numbers are not carried by the mesh."""
        return self.mesh.x.elements * self.mesh.y.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega.

        Without twisting stiffness, and with the coupling of the curvatures taken off both of them, a free plate has
        modes that are products of those of free beams, all of them lower. What is joined to it is a beam or a mass
        more, and constraints, which raise frequencies.
        """
        cx, cy, c1, _ = energy_coefficients(self.section, self.stiffness_scale)
        share = 1 - abs(c1) / np.sqrt(cx * cy)
        squared = omega**2 / share

        def count(stiffness: float) -> Floats:
            highest = int((squared / stiffness) ** 0.25 / np.pi) + 3
            return np.concatenate([_FREE_BEAM, (np.arange(4, highest + 1) - 0.5) * np.pi])[: highest + 1] ** 4

        along_x, along_y = cx * count(cx), cy * count(cy)
        modes = int(np.searchsorted(along_y, squared - along_x[along_x <= squared], side="right").sum())
        physical = omega * self.frequency_scale
        for beam in self.section.stiffeners:
            beta = (beam.mass_per_length * physical**2 / beam.bending_stiffness) ** 0.25 * beam.length
            modes += int(np.ceil(beta / np.pi)) + 2
        return modes + len(self.section.point_masses)

    @property
    def named_dofs(self) -> NamedDofs:
        """Nodes along y first, from the left and bottom edges, each with z, ry = -dw/dx, rx = dw/dy and the twist."""
        along_y, length, width = 2 * self.mesh.y.nodes.size, self.section.length, self.section.width
        i, j = self.free // along_y, self.free % along_y
        nodes = (i // 2) * self.mesh.y.nodes.size + j // 2
        kinds = 2 * (i % 2) + j % 2  # w, W w_y, L w_x, L W w_xy
        directions, scales = ("z", "rx", "ry", MODAL), np.array([1.0, 1 / width, -1 / length, 1 / (length * width)])
        names = tuple((int(n) + 1, directions[kind]) for n, kind in zip(nodes, kinds, strict=True))
        places = np.column_stack([self.mesh.node_points[nodes] * (length, width), np.zeros(nodes.size)])
        return NamedDofs(DofTable(names, places), scales[kinds], np.where(kinds == 0, 1.0, 0.0))

    def point_of(self, place: Place) -> Floats | None:
        """(3,) x and y from the left and bottom edges, m."""
        return None if place.across is None else np.array([place.coordinate, place.across, 0.0])

    def point_row(self, place: Place) -> Floats:
        """(all dofs,) deflection at a place."""
        if place.direction != DEFLECTION or place.across is None:
            raise ValueError(f"the points [x, y] of a plate have no motion {place.direction}; it has {DEFLECTION}")
        point = np.array([[place.coordinate, place.across]]) / self.extent
        return np.asarray(self.mesh.rows(point).toarray()[0])

    def base_coefficients(self, motion: BaseDirection) -> Floats:
        """(3,) the translation and the rotations w = x / length, w = y / width of a unit motion of the base."""
        x, y, _ = motion.about
        if motion.direction == "rx":
            return np.array([-y, 0.0, self.section.width])
        if motion.direction == "ry":  # z goes down with x
            return np.array([x, -self.section.length, 0.0])
        if motion.direction in ("", "z"):
            return np.array([1.0, 0.0, 0.0])
        raise MethodError(
            "direction", f"= {motion.direction} does not deflect a plate", "use z, or a rotation, rx or ry"
        )

    def unit_stiffness(self, site: Site) -> float:
        """sqrt(Dx Dy) / (L W), N/m."""
        rigidity = self.section.rigidity
        return float(np.sqrt(rigidity.dx * rigidity.dy) / (self.section.length * self.section.width))

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,), at four points a side of every element."""
        lines = [
            np.append((mesh.nodes[:-1, None] + mesh.lengths[:, None] * np.arange(4) / 4).ravel(), 1.0)
            for mesh in (self.mesh.x, self.mesh.y)
        ]
        x, y = np.meshgrid(*lines, indexing="ij")
        rows = self.mesh.rows(np.column_stack([x.ravel(), y.ravel()]))
        return float(np.abs(rows @ self.whole_field(field)).max())


def energy_coefficients(plate: PlateBody, stiffness_scale: float) -> tuple[float, float, float, float]:
    """Factors of w_xx^2, w_yy^2, 2 w_xx w_yy and w_xy^2 in the scaled energy, derivatives by x / L and y / W."""
    d, length, width = plate.rigidity, plate.length, plate.width
    physical = (
        d.dx * width / length**3,
        d.dy * length / width**3,
        d.d1 / (length * width),
        4 * d.twisting / (length * width),
    )
    cx, cy, c1, cxy = (value / stiffness_scale for value in physical)
    return cx, cy, c1, cxy
