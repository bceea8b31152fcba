"""Deflections along a beam: projections of polynomials, extremes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.hermite import shape_functions
from beamsim.structures.places import SLOPE, Place
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.mesh import Mesh


class PolynomialField:
    """A polynomial in x along a beam, with the quadrature of its products and norms."""

    def __init__(self, structure: BeamModel, coefficients: Sequence[float]) -> None:
        """From coefficients of x^0, x^1, ..., in SI units."""
        mesh, length, masses = structure.mesh, structure.section.length, structure.section.point_masses
        self._structure = structure
        polynomial = np.polynomial.Polynomial(
            np.asarray(coefficients, dtype=float) * length ** np.arange(len(coefficients))
        )
        points, weights = np.polynomial.legendre.leggauss(len(coefficients) // 2 + 4)
        self._xi = (points + 1) / 2
        x = mesh.nodes[:-1, None] + mesh.lengths[:, None] * self._xi
        self._weight = mesh.lengths[:, None] * weights / 2
        self._inertia = self._weight * structure.line_mass[:, None]
        self._deflection, self._curvature = polynomial(x), polynomial.deriv(2)(x)
        at = np.array([m.position / length for m in masses])
        places = [Place(structure.name, m.position) for m in masses]
        slopes = [replace(place, direction=SLOPE) for place in places]
        self._share = np.array([m.mass for m in masses] + [m.rotary_inertia for m in masses]) / structure.mass_scale
        self._rows = structure.rows([*places, *slopes])
        self._at_masses = np.concatenate([polynomial(at), polynomial.deriv()(at) / length])

    def _fields(self, vectors: Floats, derivative: int) -> Floats:
        """(elements, points, n) fields (N, n), or their derivatives, at the points of the quadrature."""
        mesh = self._structure.mesh
        shape = shape_functions(self._xi, mesh.lengths[:, None], derivative)
        return np.asarray(np.einsum("exd,edn->exn", shape, self._structure.whole_field(vectors)[mesh.dofs]))

    def products(self, vectors: Floats) -> Floats:
        """(n,) products with fields (N, n) in the scaled mass matrix."""
        along = np.einsum("exn,ex->n", self._fields(vectors, 0), self._inertia * self._deflection)
        return np.asarray(along + (self._rows @ vectors).T @ (self._share * self._at_masses))

    def error(self, vectors: Floats, q: Floats, quantity: str) -> float:
        """Relative error of ``vectors @ q``, of a displacement also in the norm of the bending energy."""
        missed = self._deflection - self._fields(vectors, 0) @ q
        at_masses = self._at_masses - (self._rows @ vectors) @ q
        kinetic = _relative(
            float(np.sum(self._inertia * missed**2) + self._share @ at_masses**2),
            float(np.sum(self._inertia * self._deflection**2) + self._share @ self._at_masses**2),
        )
        if quantity == "velocity":  # has kinetic energy only
            return kinetic
        bent = self._curvature - self._fields(vectors, 2) @ q
        stiff = self._weight * self._structure.bending[:, None]
        return max(
            kinetic,
            _relative(float(np.sum(stiff * bent**2)), float(np.sum(stiff * self._curvature**2))),
        )


def _relative(error: float, whole: float) -> float:
    return float(np.sqrt(error / whole)) if whole > 0 else 0.0


def largest_deflection(mesh: Mesh, field: Floats) -> float:
    """Largest |deflection| of a (size,) field of a cubic spline, extremes between the nodes included."""
    from scipy.interpolate import CubicHermiteSpline

    spline = CubicHermiteSpline(mesh.nodes, field[0::2], field[1::2])
    level = spline.derivative().roots(extrapolate=False)
    return float(np.abs(spline(np.append(mesh.nodes, level[np.isfinite(level)]))).max())
