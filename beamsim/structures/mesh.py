r"""Nodes and elements of a beam: cubic Hermite Euler–Bernoulli elements in nondimensional form.

Lengths are divided by the beam length L. An element of nondimensional length *h* has the degrees of freedom
(w1, L w1', w2, L w2'); all four are in metres, which keeps the matrices well scaled
(H. Hazim, thesis, 2010, section 1.2.2). The unit of stiffness is E I / L^3, that of mass rho S L.

The stiffness is stored as a factor B with K = B^T B. The curvature is linear along an element, so that its values at
two Gauss points give the energy exactly, and B has two rows per element. Frequencies computed from the singular values
of B keep their accuracy, while those from the eigenvalues of K lose accuracy with the fourth power of the number of
elements.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

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


def _per_dof(h: ArrayLike) -> Floats:
    """(..., 4) factors 1, h, 1, h of the four degrees of freedom."""
    h = np.asarray(h, dtype=float)
    one = np.ones_like(h)
    return np.stack([one, h, one, h], axis=-1)


def shape_functions(xi: ArrayLike, h: ArrayLike, derivative: int = 0) -> Floats:
    """Values of the four shape functions, or of their derivative with respect to x / L.

    Parameters
    ----------
    xi : (...,) position within the element, 0 to 1.
    h : (...,) nondimensional element length, broadcast against xi.
    derivative : order of the derivative; zero is returned above 3.

    Returns
    -------
    (..., 4) array.
    """
    xi, h = np.broadcast_arrays(np.asarray(xi, dtype=float), np.asarray(h, dtype=float))
    powers = np.zeros((*xi.shape, 4))
    for p in range(derivative, 4):
        factor = float(math.prod(range(p - derivative + 1, p + 1)))
        powers[..., p] = factor * xi ** (p - derivative)
    return np.asarray(powers @ _CUBIC * _per_dof(h) / h[..., None] ** derivative)


def double_integral(xi: ArrayLike, h: ArrayLike) -> Floats:
    """(..., 4) values of h^2 * int_0^xi (xi - s) N_i(s) ds: moments at xi of the loads N_i to its left."""
    xi, h = np.broadcast_arrays(np.asarray(xi, dtype=float), np.asarray(h, dtype=float))
    powers = np.stack([xi ** (p + 2) / ((p + 1) * (p + 2)) for p in range(4)], axis=-1)
    return np.asarray(powers @ _CUBIC * _per_dof(h) * h[..., None] ** 2)


def element_rows(h: ArrayLike, derivative: int, points: int) -> Floats:
    """Rows B of an element with B^T B the integral of the square of a derivative, by Gauss quadrature.

    Parameters
    ----------
    h : (...,) nondimensional element lengths.
    derivative : order of the derivative with respect to x / L: 0 for the mass, 2 for the stiffness.
    points : of the quadrature; 4 are exact for deflections, 2 for curvatures.

    Returns
    -------
    (..., points, 4) array.
    """
    place, weight = np.polynomial.legendre.leggauss(points)
    h = np.asarray(h, dtype=float)[..., None]
    return np.asarray(shape_functions((place + 1) / 2, h, derivative) * np.sqrt(h * weight / 2)[..., None])


@dataclass(frozen=True)
class Mesh:
    """Nodes of a beam on the nondimensional axis x / L, from 0 to 1; node i has dofs 2 i and 2 i + 1."""

    nodes: Floats  # (elements + 1,) increasing

    @property
    def elements(self) -> int:
        """Number of elements."""
        return int(self.nodes.size) - 1

    @cached_property
    def lengths(self) -> Floats:
        """(elements,) nondimensional element lengths."""
        return np.diff(self.nodes)

    @cached_property
    def dofs(self) -> Ints:
        """(elements, 4) degrees of freedom of each element."""
        return 2 * np.arange(self.elements)[:, None] + np.arange(4)

    @property
    def size(self) -> int:
        """Number of degrees of freedom without supports."""
        return 2 * int(self.nodes.size)

    @property
    def lines(self) -> tuple[Floats]:
        """(elements + 1,) nodes along the one direction."""
        return (self.nodes,)

    @property
    def deflections(self) -> Ints:
        """(elements + 1,) degrees of freedom that are deflections of the nodes."""
        return 2 * np.arange(self.nodes.size)

    @property
    def rigid_motions(self) -> Floats:
        """(size, 2) translation, and rotation about the left end, w = x / L."""
        return np.column_stack(self.linear_functions)

    @property
    def linear_functions(self) -> tuple[Floats, Floats]:
        """(size,) degrees of freedom of the functions 1 and x / L."""
        ones = np.ones(self.nodes.size)
        return np.column_stack([ones, 0 * ones]).ravel(), np.column_stack([self.nodes, ones]).ravel()

    def locate(self, x: ArrayLike) -> tuple[Ints, Floats]:
        """Element that contains x / L and the position within it, 0 to 1 (a node belongs to its right-hand element)."""
        x = np.asarray(x, dtype=float)
        element = np.clip(np.searchsorted(self.nodes, x, side="right") - 1, 0, self.elements - 1)
        return element.astype(np.int64), (x - self.nodes[element]) / self.lengths[element]

    def rows(self, x: ArrayLike, derivative: int = 0) -> Any:
        """(k, size) sparse rows that give a derivative by x / L of the deflection at k positions x / L."""
        x = np.asarray(x, dtype=float).ravel()
        element, xi = self.locate(x)
        values = shape_functions(xi, self.lengths[element], derivative)
        rows = np.repeat(np.arange(x.size), 4)
        return csr_array((values.ravel(), (rows, self.dofs[element].ravel())), shape=(x.size, self.size))

    def square_rows(self, derivative: int, points: int) -> Any:
        """(points elements, size) sparse rows B with B^T B the integral of the square of a derivative by x / L."""
        rows = element_rows(self.lengths, derivative, points)
        i, j = np.repeat(np.arange(points * self.elements), 4), np.repeat(self.dofs, points, axis=0).ravel()
        return csr_array((rows.ravel(), (i, j)), shape=(points * self.elements, self.size))


def build_mesh(elements: int, hard_points: Iterable[float] = (), bounds: Iterable[float] = (0.0, 1.0)) -> Mesh:
    """A mesh with a node at every hard point, uniform in between, with no element longer than 1 / elements.

    Parameters
    ----------
    elements : number of elements of the beam without hard points.
    hard_points : nondimensional positions that need a node (point masses, nodes that are asked for). A point within a
        thousandth of an element from another node gets none, because a sliver element would make the matrices
        ill-conditioned.
    bounds : the ends, and positions that get a node in any case: where segments meet.

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
    pieces = [
        # The margin keeps round-off in 0.5 / 0.05 from adding an element.
        np.linspace(a, b, int(np.ceil((b - a) / size * (1 - 1e-9))) + 1)[:-1]
        for a, b in pairwise(ends)
    ]
    return Mesh(np.concatenate([*pieces, [1.0]]))
