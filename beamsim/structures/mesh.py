r"""Beams and plates in cubic Hermite elements: dimensionless meshes, and bodies with fixed degrees of freedom.

Lengths are divided by the beam length L. An element of nondimensional length *h* has the degrees of freedom
(w1, L w1', w2, L w2'); all four are in metres, which keeps the matrices well scaled
(H. Hazim, thesis, 2010, section 1.2.2). The unit of stiffness is E I / L^3, that of mass rho S L.

The stiffness is stored as a factor B with K = B^T B. The curvature is linear along an element, so that its values at
two Gauss points give the energy exactly, and B has two rows per element. Frequencies computed from the singular values
of B keep their accuracy, while those from the eigenvalues of K lose accuracy with the fourth power of the number of
elements.

A plate has tensor products of such elements. The space of the Bogner-Fox-Schmit element is the product of two spaces of
cubic Hermite splines, so that matrices and rows of the plate are Kronecker products of those along x and y (F. K.
Bogner, R. L. Fox, L. A. Schmit, 1965). Lengths are divided by the plate's length and width; the degrees of freedom at a
node are (w, L w_x, W w_y, L W w_xy), in m.
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array

from beamsim.structures.modes import allowed_rigid_motions, mode_of_unit_deflection, orthonormal_in_mass
from beamsim.structures.places import LoadedRegion
from beamsim.structures.structure import BodyStructure
from beamsim.typing import Floats, Ints

# Coefficients of xi^0 .. xi^3; columns 2 and 4 are multiplied by h later.
_CUBIC = np.array(
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [-3.0, -2.0, 3.0, -1.0],
        [2.0, 1.0, -2.0, 1.0],
    ]
)
_PER_DOF = np.array([0, 1, 0, 1])  # powers of h that multiply the four degrees of freedom


def shape_functions(xi: ArrayLike, h: ArrayLike, derivative: int = 0) -> Floats:
    """The four shape functions, or a derivative of them with respect to x / L.

    Parameters
    ----------
    xi : (...,) position within the element, 0 to 1.
    h : (...,) nondimensional element length, broadcast against xi.
    derivative : order of the derivative; zero above 3. The order -2 is the double integral from the left end,
        h^2 * int_0^xi (xi - s) N_i(s) ds: the moment at xi of the loads N_i to its left.

    Returns
    -------
    (..., 4) array.
    """
    xi, h = np.broadcast_arrays(np.asarray(xi, dtype=float), np.asarray(h, dtype=float))
    powers = np.zeros((*xi.shape, 4))
    for p in range(max(derivative, 0), 4):
        lower, upper = sorted((p, p - derivative))
        factor, power = float(math.prod(range(lower + 1, upper + 1))), xi ** (p - derivative)
        powers[..., p] = factor * power if derivative > 0 else power / factor
    values, scale = powers @ _CUBIC * h[..., None] ** _PER_DOF, h[..., None] ** abs(derivative)
    return np.asarray(values / scale if derivative > 0 else values * scale)


def element_rows(h: ArrayLike, derivative: int, points: int) -> Floats:
    """Rows B of an element, where B^T B is the integral of a squared derivative, by Gauss quadrature.

    Parameters
    ----------
    h : (...,) nondimensional element lengths.
    derivative : order of the derivative with respect to x / L: 0 for the mass, 2 for the stiffness.
    points : number of quadrature points; 4 are exact for deflections, 2 for curvatures.

    Returns
    -------
    (..., points, 4) array.
    """
    place, weight = np.polynomial.legendre.leggauss(points)
    h = np.asarray(h, dtype=float)[..., None]
    return np.asarray(shape_functions((place + 1) / 2, h, derivative) * np.sqrt(h * weight / 2)[..., None])


class Mesh:
    """Nodes of a beam on the dimensionless axis x / L, from 0 to 1; node i has dofs 2 i and 2 i + 1.

    Parameters
    ----------
    nodes : (elements + 1,) increasing.
    """

    def __init__(self, nodes: Floats) -> None:
        self.nodes = nodes
        self.elements = int(nodes.size) - 1
        self.size = 2 * int(nodes.size)  # degrees of freedom without supports
        self.lengths: Floats = np.diff(nodes)  # (elements,) nondimensional
        self.dofs: Ints = 2 * np.arange(self.elements)[:, None] + np.arange(4)  # (elements, 4)
        self.deflections: Ints = 2 * np.arange(nodes.size)  # (elements + 1,) dofs that are nodal deflections
        # (size, 2) translation, and rotation about the left end, w = x / L
        self.rigid_motions: Floats = np.zeros((self.size, 2))
        self.rigid_motions[::2, 0] = self.rigid_motions[1::2, 1] = 1.0
        self.rigid_motions[::2, 1] = nodes

    @property
    def lines(self) -> tuple[Floats]:
        """(elements + 1,) nodes along the axis."""
        return (self.nodes,)

    def locate(self, x: ArrayLike) -> tuple[Ints, Floats]:
        """Element that contains x / L (a node belongs to the element to its right), and position in it, 0 to 1."""
        x = np.asarray(x, dtype=float)
        element = np.clip(np.searchsorted(self.nodes, x, side="right") - 1, 0, self.elements - 1)
        return element.astype(np.int64), (x - self.nodes[element]) / self.lengths[element]

    def rows(self, x: ArrayLike, derivative: int = 0) -> Any:
        """(k, size) sparse rows of a derivative of the deflection with respect to x / L, at k positions x / L."""
        x = np.asarray(x, dtype=float).ravel()
        element, xi = self.locate(x)
        values = shape_functions(xi, self.lengths[element], derivative)
        rows = np.repeat(np.arange(x.size), 4)
        return csr_array((values.ravel(), (rows, self.dofs[element].ravel())), shape=(x.size, self.size))

    def square_rows(self, derivative: int, points: int) -> Any:
        """(points elements, size) sparse rows B, where B^T B is the integral of a squared derivative."""
        rows = element_rows(self.lengths, derivative, points)
        i, j = np.repeat(np.arange(points * self.elements), 4), np.repeat(self.dofs, points, axis=0).ravel()
        return csr_array((rows.ravel(), (i, j)), shape=(points * self.elements, self.size))


ROUND_OFF = 1e-9  # relative, so that 0.5 / 0.05 elements are not rounded up


def build_mesh(elements: int, hard_points: Iterable[float] = (), bounds: Iterable[float] = (0.0, 1.0)) -> Mesh:
    """Build a mesh with a node at every hard point, uniform in between, with no element longer than 1 / elements.

    Parameters
    ----------
    elements : number of elements of the beam without hard points.
    hard_points : dimensionless positions that need a node (point masses, requested nodes). A point within a thousandth
        of an element from another node gets none, since a very short element would make the matrices ill-conditioned.
    bounds : ends, and positions that always get a node, where segments meet.

    Returns
    -------
    Mesh
        From 0 to 1.
    """
    size = 1.0 / elements
    ends = list(bounds)
    for x in sorted(hard_points):
        if all(abs(x - end) > 1e-3 * size for end in ends):
            ends.append(x)
    ends.sort()
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / size * (1 - ROUND_OFF))) + 1)[:-1] for a, b in pairwise(ends)]
    return Mesh(np.concatenate([*pieces, [1.0]]))


def graded_mesh(elements: int, grading: float, hard_points: Sequence[float]) -> Mesh:
    """A mesh from 0 to 1 with nodes at the hard points, and with smaller elements towards both ends.

    Nodes are x(t) of a uniform mesh in t, with x = (2 t)^grading / 2 in the first half, and its mirror image.

    Parameters
    ----------
    elements : number of elements without hard points.
    grading : exponent; 1 for a uniform mesh.
    hard_points : nondimensional positions that need a node.

    Returns
    -------
    Mesh
        From 0 to 1.
    """
    if grading == 1.0:
        return build_mesh(elements, hard_points)

    def mapped(t: Floats, power: float) -> Floats:
        return np.asarray(np.where(t <= 0.5, (2 * t) ** power / 2, 1 - (2 - 2 * np.clip(t, 0.5, 1)) ** power / 2))

    uniform = build_mesh(elements, mapped(np.array(hard_points, dtype=float), 1 / grading).tolist())
    return Mesh(mapped(uniform.nodes, grading))


@dataclass(frozen=True)
class PlateMesh:
    """Mesh lines in both directions, on x / L and y / W; dofs of the product are numbered along y first."""

    x: Mesh
    y: Mesh

    @property
    def size(self) -> int:
        """Number of degrees of freedom without supports."""
        return self.x.size * self.y.size

    @property
    def lines(self) -> tuple[Floats, Floats]:
        """Nodes along x and along y."""
        return self.x.nodes, self.y.nodes

    @property
    def rigid_motions(self) -> Floats:
        """(size, 3) translation, and rotations about the left and the bottom edge, w = x / L and w = y / W."""
        (one_x, x), (one_y, y) = self.x.rigid_motions.T, self.y.rigid_motions.T
        return np.column_stack([np.kron(one_x, one_y), np.kron(x, one_y), np.kron(one_x, y)])

    @property
    def node_points(self) -> Floats:
        """(nodes, 2) nondimensional positions of the nodes, along y first."""
        x, y = np.meshgrid(self.x.nodes, self.y.nodes, indexing="ij")
        return np.column_stack([x.ravel(), y.ravel()])

    @property
    def deflections(self) -> Ints:
        """(nodes,) degrees of freedom that are deflections of the nodes."""
        return (self.x.deflections[:, None] * self.y.size + self.y.deflections).ravel()

    def rows(self, points: Floats, derivative: tuple[int, int] = (0, 0)) -> Any:
        """(k, size) sparse rows of a derivative (with respect to x / L, y / W) at dimensionless points (k, 2)."""
        elements, values = [], []
        for mesh, at, order in zip((self.x, self.y), points.T, derivative, strict=True):
            element, xi = mesh.locate(at)
            elements.append(mesh.dofs[element])
            values.append(shape_functions(xi, mesh.lengths[element], order))
        products = values[0][:, :, None] * values[1][:, None, :]
        columns = elements[0][:, :, None] * self.y.size + elements[1][:, None, :]
        rows = np.repeat(np.arange(points.shape[0]), 16)
        return csr_array((products.ravel(), (rows, columns.ravel())), shape=(points.shape[0], self.size))

    def crossings(self, start: Floats, end: Floats) -> Floats:
        """(c,) fractions of a line from start to end, both (2,), at which it enters another element, with 0 and 1."""
        shares = [np.array([0.0, 1.0])]
        for mesh, a, b in zip((self.x, self.y), start, end, strict=True):
            if a != b:
                shares.append((mesh.nodes - a) / (b - a))
        s = np.unique(np.concatenate(shares))
        s = s[(s >= 0) & (s <= 1)]
        return np.asarray(s[np.concatenate([[True], np.diff(s) > 1e-12])])


def on_supports(
    mesh: Mesh | PlateMesh, matrices: tuple[Any, Any, Any], supported_dofs: Ints, extension: Floats
) -> dict[str, Any]:
    """Fields of a `MeshedBody` from the matrices of all dofs and the fixed dofs.

    Parameters
    ----------
    mesh : mesh of the body.
    matrices : scaled mass and factor of all dofs, and their damping, N s/m, or None.
    supported_dofs : dofs that the supports hold.
    extension : (c, k) extension of other restraints for each rigid motion of the mesh.

    Returns
    -------
    dict
        By name.
    """
    mass, factor, drag = matrices
    free, motions = np.setdiff1d(np.arange(mesh.size), supported_dofs), mesh.rigid_motions
    allowed = allowed_rigid_motions(motions, np.vstack([motions[supported_dofs], extension]))
    return {
        "mesh": mesh, "free": free, "all_dofs_map": eye_array(mesh.size, format="csr")[:, free],
        "unsupported": matrices, "mass": mass[free][:, free].tocsc(), "factor": factor[:, free].tocsr(),
        "damping": None if drag is None else drag[free][:, free].tocsc(),
        "rigid": orthonormal_in_mass(motions @ allowed, mass)[free],
    }  # fmt: skip


@dataclass(frozen=True)
class MeshedBody(BodyStructure, ABC):
    """A body on a mesh; positions are in metres from its left end, or from its left and bottom edges."""

    mesh: Mesh | PlateMesh
    free: Ints  # (N,) dofs of the unsupported body that are free
    recovers_moments: ClassVar[bool] = True

    def deflections(self, vectors: Floats) -> Floats:
        """The nodal deflections of fields (N,) or (N, k)."""
        return vectors[np.isin(self.free, self.mesh.deflections)]

    @property
    def extent(self) -> Floats:
        """(d,) lengths of the sides, m."""
        return np.array([getattr(self.section, side) for side in self.sides], dtype=float)

    def load_vector(self, load: LoadedRegion) -> Floats:
        """(all dofs,) load vector of a distributed load of unit level, including fixed dofs."""
        points, force = self.point_forces(load, np.zeros(0))
        return np.asarray(self.mesh.rows(points).T @ force)

    def point_forces(self, load: LoadedRegion, cuts: Floats) -> tuple[Floats, Floats]:
        """Dimensionless positions (k, d) and magnitudes (k,) of point forces that represent a distributed load.

        Between nodes, neighbouring ``cuts`` (m, along x) and corners of the shape they have the same force, moment and
        products with the shape functions as the load.
        """
        lines = [nodes * side for nodes, side in zip(self.mesh.lines, self.extent, strict=True)]
        points, weights = load.quadrature(self.extent, (np.concatenate([lines[0], cuts]), *lines[1:]))
        return points / self.extent, np.asarray(weights * load.intensity(points, self.extent, self._mode_at))

    def _mode_at(self, mode: int, points: Floats) -> Floats:
        field = self.all_dofs_map @ mode_of_unit_deflection(self, mode)
        return np.asarray(self.mesh.rows(points / self.extent) @ field)
