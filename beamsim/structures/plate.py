r"""A thin rectangular plate in conforming bicubic Hermite elements, as a structure.

The strain energy of an orthotropic Kirchhoff plate is

.. math:: \tfrac12 \int D_x w_{xx}^2 + 2 D_1 w_{xx} w_{yy} + D_y w_{yy}^2 + 4 D_{xy} w_{xy}^2 \, dx\, dy

(S. P. Timoshenko, S. Woinowsky-Krieger, Theory of Plates and Shells, 1959, chapter 11). It is a sum of squares at the
points of a Gauss quadrature that is exact for the elements, which gives the factor B of K = B^T B. Stiffeners add such
rows along their lines. An edge support fixes all degrees of freedom at the end of one of the two spline families.

Moments and stresses are computed at the nodes. Second derivatives of cubic splines are most accurate at the two Gauss
points of each element (J. Barlow, 1976), with an error two orders smaller than elsewhere; they are extrapolated from
there to the nodes by cubic polynomials through the nearest four.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array, kron, vstack

from beamsim.dofs import MODAL
from beamsim.errors import MethodError, ScenarioError
from beamsim.scenario.plate import PlateBody, Stiffener
from beamsim.structures.beam import FIXED_DERIVATIVES
from beamsim.structures.mesh import Mesh, MeshedBody, PlateMesh, graded_mesh, on_supports
from beamsim.structures.named_matrices import DofTable, NamedDofs
from beamsim.structures.places import (
    DEFLECTION,
    ON_PLATE,
    SLOPE,
    UPWARDS,
    BaseDirection,
    LoadedRegion,
    Place,
    Recovery,
    Site,
)
from beamsim.structures.reduction import static_deflections
from beamsim.structures.structure import MemberBody, ReducedBasis, Restraint, UnitMotion
from beamsim.typing import Bools, Floats


def _strains_per_moments(plate: PlateBody) -> Floats | None:
    """(3, 3) strains h/2 w_xx, h/2 w_yy and h w_xy of the lower surface for a unit of Mx, My, Mxy, 1/N."""
    if plate.bending.depth is None:
        return None
    d = plate.bending.rigidity
    stiffness = np.array([[d.dx, d.d1, 0.0], [d.d1, d.dy, 0.0], [0.0, 0.0, d.dxy]])
    return np.asarray(plate.bending.depth / 2 * np.linalg.inv(stiffness))


def _motion_of_supports(structure: PlateStructure, basis: ReducedBasis) -> Floats:
    """(size, n) contribution of moving supports to all dofs, for a unit of each coordinate."""
    field = np.zeros((structure.mesh.size, basis.size))
    if basis.size == basis.modes and any(isinstance(pattern.site, UnitMotion) for pattern in basis.patterns):
        raise ScenarioError.at(
                "reduction", "keeps all modes, and with them no static vector that the moments of a plate need where a "
                "support moves", "keep fewer modes (reduction: {modes: 40}), or leave reduction out",
            )  # fmt: skip
    for pattern, row in zip(basis.patterns, basis.pattern, strict=True):
        if isinstance(pattern.site, UnitMotion) and structure.name in pattern.site.fields:
            field += np.multiply.outer(pattern.site.fields[structure.name], row)
    return field


def moment_operator(structure: PlateStructure) -> Any:
    """(3 nodes, size) rows of Mx, then My, then Mxy per width at the nodes, N for a metre of each dof."""
    plate, (x, y) = structure.section, (structure.mesh.x, structure.mesh.y)
    d, length, width = plate.bending.rigidity, plate.length, plate.width
    xx = kron(_second_derivatives(x), y.rows(y.nodes), format="csr") / length**2
    yy = kron(x.rows(x.nodes), _second_derivatives(y), format="csr") / width**2
    xy = kron(x.rows(x.nodes, 1), y.rows(y.nodes, 1), format="csr") / (length * width)
    return vstack([d.dx * xx + d.d1 * yy, d.d1 * xx + d.dy * yy, 2 * d.dxy * xy], format="csr")


def _second_derivatives(mesh: Mesh) -> Any:
    """(nodes, 2 nodes) rows of the second derivative at the nodes, from the values at Gauss points."""
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


_FREE_BEAM = np.array([0.0, 0.0, 4.730040744862704, 7.853204624095838])  # beta L; higher ones (n + 1/2) pi


@dataclass(frozen=True)
class PlateStructure(MeshedBody):
    """A plate as a structure; positions are in metres from its left and bottom edges."""

    section: PlateBody
    mesh: PlateMesh
    sides: ClassVar[tuple[str, ...]] = ("length", "width")

    def recovery(
        self, member: MemberBody, basis: ReducedBasis, sites: Sequence[Place], base: BaseDirection | None
    ) -> Recovery:
        """Deflection, moments Mx, My, Mxy per width, and stresses at the nodes.

        Parameters
        ----------
        member, basis, sites, base : see `BodyStructure.recovery`.

        Returns
        -------
        Recovery
            Three moments at each node of the mesh.
        """
        plate, whole = self.section, member.structure
        scale = 1 / np.sqrt(whole.mass_scale)
        operator = moment_operator(self)

        def moments(vectors: Floats) -> Floats:
            return np.asarray(operator @ (self.all_dofs_map @ (member.expansion @ vectors)))

        moment = moments(basis.vectors) + operator @ _motion_of_supports(self, basis)
        moment[:, : basis.rigid_count] = 0.0  # rigid-body motion causes no bending
        remainder = np.zeros(moment.shape[0])
        if base is not None:
            inertia = whole.base_load(base)[0]
            remainder = basis.omitted_response(
                inertia, moment, moments(static_deflections(whole, inertia[:, None]))[:, 0]
            )
        per_moment = plate.bending.stress_per_moment
        points = self.mesh.node_points * (plate.length, plate.width)
        return Recovery(
            body=self.name,
            axis=ON_PLATE,
            position=points[:, 0],
            position_y=points[:, 1],
            deflection=(self.all_dofs_map @ (member.expansion @ basis.vectors))[self.mesh.deflections] * scale,
            bending_moment=moment * scale,
            stress_per_moment=None if per_moment is None else np.full(moment.shape[0], per_moment),
            strains_per_moments=_strains_per_moments(plate),
            base_moment=-remainder * (whole.mass_scale / whole.stiffness_scale),
            moments=3,
        )

    @property
    def most_modes(self) -> int:
        """Number of elements; the mesh does not resolve higher modes."""
        return self.mesh.x.elements * self.mesh.y.elements

    def frequency_count(self, omega: float) -> int:
        """A bound on the number of modes below the scaled angular frequency omega.

        Without twisting stiffness, and with the coupling of the curvatures subtracted from both, a free plate has modes
        that are products of those of free beams, with lower frequencies. Stiffeners and masses add beams and masses;
        constraints raise frequencies.
        """
        cx, cy, c1, _ = _energy_coefficients(self.section, self.stiffness_scale)
        share = 1 - abs(c1) / np.sqrt(cx * cy)
        squared = omega**2 / share

        def count(stiffness: float) -> Floats:
            highest = int((squared / stiffness) ** 0.25 / np.pi) + 3
            return np.concatenate([_FREE_BEAM, (np.arange(4, highest + 1) - 0.5) * np.pi])[: highest + 1] ** 4

        along_x, along_y = cx * count(cx), cy * count(cy)
        modes = int(np.searchsorted(along_y, squared - along_x[along_x <= squared], side="right").sum())
        physical = omega * self.frequency_scale
        for beam in self.section.stiffeners:
            length = math.dist(*self.section.line_of(beam))
            beta = (beam.mass_per_length * physical**2 / beam.bending_stiffness) ** 0.25 * length
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
        return None if place.position_y is None else np.array([place.coordinate, place.position_y, 0.0])

    def unsupported_row(self, place: Place | LoadedRegion) -> Floats:
        """(all dofs,) deflection at a place, or load vector."""
        if isinstance(place, LoadedRegion):
            return self.load_vector(place)
        if place.direction != DEFLECTION or place.position_y is None:
            raise ValueError(f"the points [x, y] of a plate have no motion {place.direction}; it has {DEFLECTION}")
        point = np.array([[place.coordinate, place.position_y]]) / self.extent
        return np.asarray(self.mesh.rows(point).toarray()[0])

    def rigid_motion(self, motion: BaseDirection) -> Floats:
        """(all dofs,) rigid displacement for a unit motion of the base."""
        x, y, _ = motion.axis_point
        shares = {  # of the translation, and of the rotations w = x / length and w = y / width
            "rx": (-y, 0.0, self.section.width),
            "ry": (x, -self.section.length, 0.0),  # z decreases with x
            "z": (1.0, 0.0, 0.0),
        }.get(motion.direction or "z")
        if shares is None:
            message = f"= {motion.direction} does not deflect a plate"
            raise MethodError("direction", message, "use z, or a rotation, rx or ry")
        return np.asarray(self.mesh.rigid_motions @ np.array(shares))

    def unit_stiffness(self, site: Site) -> float:
        """Reference stiffness sqrt(Dx Dy) / (L W), N/m."""
        rigidity = self.section.bending.rigidity
        return float(np.sqrt(rigidity.dx * rigidity.dy) / (self.section.length * self.section.width))

    def largest_deflection(self, field: Floats) -> float:
        """Largest absolute deflection of a field (N,), at four points along each side of every element."""
        lines = [
            np.append((mesh.nodes[:-1, None] + mesh.lengths[:, None] * np.arange(4) / 4).ravel(), 1.0)
            for mesh in (self.mesh.x, self.mesh.y)
        ]
        x, y = np.meshgrid(*lines, indexing="ij")
        rows = self.mesh.rows(np.column_stack([x.ravel(), y.ravel()]))
        return float(np.abs(rows @ (self.all_dofs_map @ field)).max())

    def reassemble(self, section: PlateBody) -> PlateStructure:
        """A plate with other numbers on the same mesh."""
        return assemble_plate(section, self.name, mesh=self.mesh)

    def restraints(self, base: BaseDirection) -> Sequence[Restraint]:
        """Every held edge and point, and the rotation of edges about themselves.

        A corner between two held edges belongs to the first of left, right, bottom and top. If the base does not move
        upwards, all restraints form a single one: a rotation of the base moves the points of an edge by different
        amounts.
        """
        if base != UPWARDS:
            moved = self.rigid_motion(base)
            moved[self.free] = 0.0
            return [Restraint("base", DEFLECTION, 1.0, moved)] if moved.any() else []
        plate = self.section
        translation, along_x, along_y = self.mesh.rigid_motions.T
        about = {
            "left": along_x * plate.length,
            "right": (along_x - translation) * plate.length,
            "bottom": along_y * plate.width,
            "top": (along_y - translation) * plate.width,
        }
        taken = np.zeros(self.mesh.size, dtype=bool)
        restraints = []
        for name, held in _supported_dofs(plate, self.mesh).items():
            for direction, motion, with_base in ((DEFLECTION, translation, 1.0), (SLOPE, about.get(name), 0.0)):
                moved = np.zeros(0) if motion is None else np.where(held & ~taken, motion, 0.0)
                if np.any(np.abs(moved) > 1e-12):
                    restraints.append(Restraint(name, direction, with_base, moved))
            taken |= held
        return restraints


def assemble_plate(
    plate: PlateBody, name: str = "plate", nodes: Sequence[Any] = (), mesh: PlateMesh | None = None
) -> PlateStructure:
    """Sparse matrices of a plate on its supports.

    Mesh lines run through point masses, point supports, stiffeners parallel to an edge, and ``nodes`` ([x, y] in m).

    Parameters
    ----------
    plate : the section of the scenario.
    name : name of the body.
    nodes : [x, y] in m, positions where something is joined to the plate.
    mesh : an existing mesh; a new one by default.

    Returns
    -------
    PlateStructure
        Scaled, without fixed dofs.
    """
    size = np.array([plate.length, plate.width])
    mesh = _mesh(plate, nodes) if mesh is None else mesh
    d = plate.bending.rigidity
    stiffness_scale = max(d.dx * plate.width / plate.length**3, d.dy * plate.length / plate.width**3)
    mass_scale = plate.bending.mass_per_area * plate.length * plate.width

    def rows(x: tuple[int, int], y: tuple[int, int]) -> Any:
        return kron(mesh.x.square_rows(*x), mesh.y.square_rows(*y), format="csr")

    cx, cy, c1, cxy = _energy_coefficients(plate, stiffness_scale)
    factor = [
        np.sqrt(cx) * rows((2, 4), (0, 4)) + c1 / np.sqrt(cx) * rows((0, 4), (2, 4)),
        np.sqrt(cy - c1**2 / cx) * rows((0, 4), (2, 2)),
        np.sqrt(cxy) * rows((1, 3), (1, 3)),
    ]
    inertia = [rows((0, 4), (0, 4))]
    if plate.point_masses:
        points = np.array(plate.mass_points) / size
        root = np.sqrt(np.array([m.mass for m in plate.point_masses]) / mass_scale)
        inertia.append(mesh.rows(points) * root[:, None])
    for stiffener in plate.stiffeners:
        bending, moving = _stiffener_rows(stiffener, plate.line_of(stiffener), mesh, size)
        factor += [row / np.sqrt(stiffness_scale) for row in bending]
        inertia.append(moving / np.sqrt(mass_scale))
    moving = vstack(inertia, format="csr")
    mass = (moving.T @ moving).tocsr()

    held = np.flatnonzero(np.any(list(_supported_dofs(plate, mesh).values()), axis=0))
    return PlateStructure(
        name=name,
        section=plate,
        stated_damping=plate.damping,
        mass_scale=mass_scale,
        stiffness_scale=stiffness_scale,
        **on_supports(mesh, (mass, vstack(factor, format="csr"), None), held, np.zeros((0, 3))),
    )


def _energy_coefficients(plate: PlateBody, stiffness_scale: float) -> tuple[float, float, float, float]:
    """Factors of w_xx^2, w_yy^2, 2 w_xx w_yy and w_xy^2 in the scaled energy; derivatives by x / L and y / W."""
    d, length, width = plate.bending.rigidity, plate.length, plate.width
    physical = (
        d.dx * width / length**3,
        d.dy * length / width**3,
        d.d1 / (length * width),
        4 * d.dxy / (length * width),
    )
    cx, cy, c1, cxy = (value / stiffness_scale for value in physical)
    return cx, cy, c1, cxy


def _mesh(plate: PlateBody, nodes: Sequence[Any]) -> PlateMesh:
    """A mesh with lines through all points where something acts, and along stiffeners parallel to an edge."""
    points = [*plate.mass_points, *plate.supported_points]
    points += [tuple(node) for node in nodes]
    ends = [plate.line_of(beam) for beam in plate.stiffeners]
    lines = [graded_mesh(count, plate.grading, sorted({at / size for at in hard})) for count, size, hard in (
        (plate.elements[axis], (plate.length, plate.width)[axis],
         [p[axis] for p in points] + [a[axis] for a, b in ends if a[axis] == b[axis]])
        for axis in (0, 1)
    )]  # fmt: skip
    return PlateMesh(*lines)


def _supported_dofs(plate: PlateBody, mesh: PlateMesh) -> dict[str, Bools]:
    """(size,) dofs that each edge or point support fixes; a point support acts on the nearest node."""
    supports = plate.supports
    along_y = 2 * mesh.y.nodes.size
    dofs = np.arange(mesh.size)
    held = {}
    for edges, along, nodes in (
        (("left", "right"), dofs // along_y, mesh.x.nodes.size),
        (("bottom", "top"), dofs % along_y, mesh.y.nodes.size),
    ):
        for edge, first in zip(edges, (0, 2 * (nodes - 1)), strict=True):
            held[edge] = np.isin(along, [first + each for each in FIXED_DERIVATIVES[getattr(supports, edge)]])
    for number, (x, y) in enumerate(plate.supported_points, start=1):
        i = int(np.abs(mesh.x.nodes - x / plate.length).argmin())
        j = int(np.abs(mesh.y.nodes - y / plate.width).argmin())
        held[f"point {number}"] = dofs == 2 * i * along_y + 2 * j
    return held


def _stiffener_rows(beam: Stiffener, line: Any, mesh: PlateMesh, size: Floats) -> tuple[list[Any], Any]:
    """Rows for the strain energy (twice the sum of squares) and the mass of a beam along a line, in N/m and kg.

    The deflection along a line across an element has degree 6, so that 7 Gauss points integrate its square exactly.
    """
    start, end = np.array(line)
    length = math.dist(start, end)
    shares = mesh.crossings(start / size, end / size)
    place, weight = np.polynomial.legendre.leggauss(7)
    lengths = np.diff(shares)
    s = (shares[:-1, None] + lengths[:, None] * (place + 1) / 2).ravel()
    root = np.sqrt(lengths[:, None] * weight / 2 * length).ravel()
    points = (start + s[:, None] * (end - start)) / size
    cos, sin = (end - start) / length

    def derivative(x: int, y: int) -> Any:
        return mesh.rows(points, (x, y)) / (size[0] ** x * size[1] ** y)

    xx, xy, yy = derivative(2, 0), derivative(1, 1), derivative(0, 2)
    curvature = cos**2 * xx + 2 * cos * sin * xy + sin**2 * yy
    rows = [curvature * (np.sqrt(beam.bending_stiffness) * root)[:, None]]
    if beam.torsional_stiffness:
        twist = (cos**2 - sin**2) * xy + cos * sin * (yy - xx)
        rows.append(twist * (np.sqrt(beam.torsional_stiffness) * root)[:, None])
    return rows, derivative(0, 0) * (np.sqrt(beam.mass_per_length) * root)[:, None]
