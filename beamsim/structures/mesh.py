"""Nodes and elements of a beam."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from beamsim.dataclass import dataclass
from beamsim.structures.hermite import element_rows, shape_functions
from beamsim.typing import Floats, Ints


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
        from scipy.sparse import csr_array

        x = np.asarray(x, dtype=float).ravel()
        element, xi = self.locate(x)
        values = shape_functions(xi, self.lengths[element], derivative)
        rows = np.repeat(np.arange(x.size), 4)
        return csr_array((values.ravel(), (rows, self.dofs[element].ravel())), shape=(x.size, self.size))

    def assembled(self, rows: Floats) -> Any:
        """(elements k, size) sparse of rows (elements, k, 4) of the elements."""
        from scipy.sparse import csr_array

        count = rows.shape[1]
        i, j = np.repeat(np.arange(count * self.elements), 4), np.repeat(self.dofs, count, axis=0).ravel()
        return csr_array((rows.ravel(), (i, j)), shape=(count * self.elements, self.size))

    def square_rows(self, derivative: int, points: int) -> Any:
        """(points elements, size) sparse rows B with B^T B the integral of the square of a derivative by x / L."""
        return self.assembled(element_rows(self.lengths, derivative, points))


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
