"""Polynomials along a beam that its motion is to meet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.given_field import GivenField, WeightedValues

if TYPE_CHECKING:
    from beamsim.structures.beam_model import BeamModel


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
