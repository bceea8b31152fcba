"""Deflections along a beam: polynomials, extremes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.given_field import GivenField, WeightedValues
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.mesh import Mesh


def polynomial_field(structure: BeamModel, coefficients: Sequence[float]) -> GivenField:
    """A polynomial in x along a beam, from coefficients of x^0, x^1, ..., in SI units, by Gauss quadrature."""
    from scipy.sparse import vstack

    mesh, length, masses = structure.mesh, structure.section.length, structure.section.point_masses
    polynomial = np.polynomial.Polynomial(
        np.asarray(coefficients, dtype=float) * length ** np.arange(len(coefficients))
    )
    points, weights = np.polynomial.legendre.leggauss(len(coefficients) // 2 + 4)
    x = (mesh.nodes[:-1, None] + mesh.lengths[:, None] * (points + 1) / 2).ravel()
    weight = mesh.lengths[:, None] * weights / 2
    at = np.array([m.position for m in masses]) / length
    turning = np.array([m.rotary_inertia for m in masses]) / length**2  # of slopes by x / L
    lumped = np.concatenate([[m.mass for m in masses], turning]) / structure.mass_scale
    rows = vstack([mesh.rows(x), mesh.rows(at), mesh.rows(at, 1)], format="csr")
    kinetic = WeightedValues(
        rows[:, structure.free],
        np.concatenate([(weight * structure.line_mass[:, None]).ravel(), lumped]),
        np.concatenate([polynomial(x), polynomial(at), polynomial.deriv()(at)]),
    )
    bending = (weight * structure.bending[:, None]).ravel()
    curved = WeightedValues(mesh.rows(x, 2)[:, structure.free], bending, polynomial.deriv(2)(x))
    return GivenField(kinetic, curved)


def largest_deflection(mesh: Mesh, field: Floats) -> float:
    """Largest |deflection| of a (size,) field of a cubic spline, extremes between the nodes included."""
    from scipy.interpolate import CubicHermiteSpline

    spline = CubicHermiteSpline(mesh.nodes, field[0::2], field[1::2])
    level = spline.derivative().roots(extrapolate=False)
    return float(np.abs(spline(np.append(mesh.nodes, level[np.isfinite(level)]))).max())
