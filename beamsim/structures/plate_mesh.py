"""Bicubic Hermite elements of a rectangle: tensor products of the beam's cubic ones.

The space of the Bogner-Fox-Schmit element is the product of two spaces of cubic Hermite splines, so that matrices and
rows of the plate are Kronecker products of those along x and y (F. K. Bogner, R. L. Fox, L. A. Schmit, 1965). Lengths
are divided by the plate's length and width; the degrees of freedom at a node are (w, L w_x, W w_y, L W w_xy), in m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from beamsim.structures.mesh import Mesh, build_mesh, shape_functions
from beamsim.typing import Floats, Ints


def graded_mesh(elements: int, grading: float, hard_points: Sequence[float]) -> Mesh:
    """A mesh of 0 to 1 with nodes at the hard points, whose elements become smaller towards both ends.

    Nodes are x(t) of a mesh that is uniform in t, with x = (2 t)^grading / 2 up to the middle, and its mirror image.

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
    """Lines of a mesh along both directions, on x / L and y / W; dofs of a product are numbered along y first."""

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
        (one_x, x), (one_y, y) = self.x.linear_functions, self.y.linear_functions
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
        """(k, size) sparse rows that give a derivative (by x / L, by y / W) at nondimensional points (k, 2)."""
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
        """(c,) shares of a line from start to end, both (2,), at which it enters another element, 0 and 1 included."""
        shares = [np.array([0.0, 1.0])]
        for mesh, a, b in zip((self.x, self.y), start, end, strict=True):
            if a != b:
                shares.append((mesh.nodes - a) / (b - a))
        s = np.unique(np.concatenate(shares))
        s = s[(s >= 0) & (s <= 1)]
        return np.asarray(s[np.concatenate([[True], np.diff(s) > 1e-12])])
