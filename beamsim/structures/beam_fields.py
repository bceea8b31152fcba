"""Deflections along a beam: projections of polynomials, extremes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.hermite import shape_functions
from beamsim.structures.places import Place
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.basis import ReducedBasis
    from beamsim.structures.beam_model import BeamModel
    from beamsim.structures.mesh import Mesh


def project_polynomial(
    structure: BeamModel, basis: ReducedBasis, coefficients: Sequence[float]
) -> tuple[Floats, float, float]:
    """Kinetic (M-orthogonal) projection of a polynomial in x on the basis.

    Parameters
    ----------
    coefficients : of x^0, x^1, ..., in SI units.

    Returns
    -------
    (n,) coordinates; relative errors in the kinetic norm and in the bending-energy norm (0 for a straight line).
    """
    mesh, length, masses = structure.mesh, structure.beam.length, structure.beam.point_masses
    polynomial = np.polynomial.Polynomial(
        np.asarray(coefficients, dtype=float) * length ** np.arange(len(coefficients))
    )
    points, weights = np.polynomial.legendre.leggauss(len(coefficients) // 2 + 4)
    xi = (points + 1) / 2
    h = mesh.lengths
    x = mesh.nodes[:-1, None] + h[:, None] * xi
    weight = h[:, None] * weights / 2
    vectors = structure.whole_field(basis.vectors)

    def fields(derivative: int) -> Floats:
        shape = shape_functions(xi, h[:, None], derivative)
        return np.asarray(np.einsum("exd,edn->exn", shape, vectors[mesh.dofs]))

    at_masses = np.array([m.position / length for m in masses])
    share = np.array([m.mass / structure.mass_scale for m in masses])
    rows = structure.rows([Place(structure.name, m.position) for m in masses]) @ basis.vectors

    shape, target = fields(0), polynomial(x)
    q = np.einsum("exn,ex->n", shape, weight * target) + rows.T @ (share * polynomial(at_masses))
    left = target - shape @ q
    left_masses = polynomial(at_masses) - rows @ q
    kinetic = _relative(
        float(np.sum(weight * left**2) + share @ left_masses**2),
        float(np.sum(weight * target**2) + share @ polynomial(at_masses) ** 2),
    )
    curvature = polynomial.deriv(2)(x)
    bending = _relative(float(np.sum(weight * (curvature - fields(2) @ q) ** 2)), float(np.sum(weight * curvature**2)))
    return q * np.sqrt(structure.mass_scale), kinetic, bending


def _relative(error: float, whole: float) -> float:
    return float(np.sqrt(error / whole)) if whole > 0 else 0.0


def largest_deflection(mesh: Mesh, field: Floats) -> float:
    """Largest |deflection| of a (all dofs,) field of cubic elements, extremes between the nodes included."""
    u = field[mesh.dofs]
    h = mesh.lengths
    # w'(xi) is a quadratic a xi^2 + b xi + c on each element.
    c, end, middle = (np.sum(shape_functions(xi, h, 1) * u, axis=1) for xi in (0.0, 1.0, 0.5))
    a = 2 * (c + end - 2 * middle)
    b = end - c - a
    largest = float(np.abs(field[0::2]).max())
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        half = -(b + np.copysign(root, b)) / 2
        candidates = (half / a, c / half)
    for xi in candidates:
        inside = np.isfinite(xi) & (xi > 0) & (xi < 1)
        if inside.any():
            w = np.sum(shape_functions(xi[inside], h[inside]) * u[inside], axis=1)
            largest = max(largest, float(np.abs(w).max()))
    return largest
