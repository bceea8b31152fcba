"""Initial states in reduced coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamsim.structures.hermite import shape_functions
from beamsim.typing import Floats

if TYPE_CHECKING:
    from beamsim.structures.full import FullModel
    from beamsim.structures.mesh import Mesh
    from beamsim.structures.reduction import ReducedBasis


def project_field(model: FullModel, basis: ReducedBasis, field: Floats) -> tuple[Floats, float]:
    """Kinetic (M-orthogonal) projection of a displacement per dof (a chain's masses).

    Returns
    -------
    (n,) coordinates, and the relative error in the kinetic norm.
    """
    q = basis.vectors.T @ (model.mass @ field)
    error = field - basis.vectors @ q
    norm = float(field @ (model.mass @ field))
    relative = np.sqrt(float(error @ (model.mass @ error)) / norm) if norm > 0 else 0.0
    return q * np.sqrt(model.mass_scale), float(relative)


def project_polynomial(
    model: FullModel,
    basis: ReducedBasis,
    coefficients: Sequence[float],
    length: float,
    point_masses: Sequence[tuple[float, float]],
) -> tuple[Floats, float, float]:
    """Kinetic (M-orthogonal) projection of a polynomial in x on the basis.

    Parameters
    ----------
    coefficients : of x^0, x^1, ..., in SI units.
    length : of the beam, m.
    point_masses : (position in m, mass in kg) pairs.

    Returns
    -------
    (n,) coordinates; relative errors in the kinetic norm and in the bending-energy norm (0 for a straight line).
    """
    mesh = model.mesh
    assert mesh is not None
    polynomial = np.polynomial.Polynomial(
        np.asarray(coefficients, dtype=float) * length ** np.arange(len(coefficients))
    )
    points, weights = np.polynomial.legendre.leggauss(len(coefficients) // 2 + 4)
    xi = (points + 1) / 2
    h = mesh.lengths
    x = mesh.nodes[:-1, None] + h[:, None] * xi
    weight = h[:, None] * weights / 2
    vectors = np.zeros((2 * mesh.nodes.size, basis.size))
    vectors[model.free] = basis.vectors

    def fields(derivative: int) -> Floats:
        shape = shape_functions(xi, h[:, None], derivative)
        return np.asarray(np.einsum("exd,edn->exn", shape, vectors[mesh.dofs]))

    at_masses = np.array([position / length for position, _ in point_masses])
    share = np.array([mass / model.mass_scale for _, mass in point_masses])
    rows = model.rows([position for position, _ in point_masses]) @ basis.vectors

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
    return q * np.sqrt(model.mass_scale), kinetic, bending


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
