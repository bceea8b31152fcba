"""Static equilibria in which a stiff stop carries a load that others hardly feel, against exact fractions."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import eigh

from beamsim.contacts.equilibrium import CubicSprings, Springs, find_equilibrium

pytestmark = pytest.mark.quick


def in_fractions(stiffness, springs, closed, load):
    """Coordinates under the closed springs alone, by Gaussian elimination without rounding."""
    n = stiffness.size
    rows = [[Fraction(0)] * n + [Fraction(float(load[i]))] for i in range(n)]
    for i in range(n):
        rows[i][i] += Fraction(float(stiffness[i]))
    for j in np.flatnonzero(closed):
        normal = [Fraction(float(springs.sign[j] * x)) for x in springs.shape[j]]
        k, gap = Fraction(float(springs.stiffness[j])), Fraction(float(springs.gap[j]))
        for a in range(n):
            rows[a][n] -= k * gap * normal[a]
            for b in range(n):
                rows[a][b] += k * normal[a] * normal[b]
    for i in range(n):
        for j in range(n):
            if j != i:
                factor = rows[j][i] / rows[i][i]
                rows[j] = [x - factor * y for x, y in zip(rows[j], rows[i], strict=True)]
    return np.array([float(rows[i][n] / rows[i][i]) for i in range(n)])


@pytest.mark.parametrize("softening", [True, False])
@pytest.mark.parametrize("stop", [8.4e9, 1e12])
def test_soft_coordinates_beside_a_stiff_stop(stop, softening):
    """A mass is pushed on a stop; the others feel only by how little the stop yields."""
    masses, springs = np.array([0.64, 0.22, 1.82]), np.array([900.0, 3200.0, 840.0, 220.0])
    stretch = np.eye(4, 3) - np.eye(4, 3, -1)
    squares, shapes = eigh(stretch.T @ np.diag(springs) @ stretch, np.diag(masses))
    between = shapes[2] - shapes[1]
    rows, sign, stiffness, gap = [shapes[1]], [1.0], [stop], [0.0]
    if softening:  # a spring that loses 12 kN/m of 12.4 kN/m from the start
        squares, turned = np.linalg.eigh(np.diag(squares) + 12_400.0 * np.outer(between, between))
        shapes, between = shapes @ turned, between @ turned
        rows, sign, stiffness, gap = [shapes[1], between], [1.0, -1.0], [stop, -12_000.0], [0.0, 0.0]
    contacts = Springs(np.array(rows), np.array(sign), np.array(stiffness), np.array(gap))
    load = -0.105 * shapes[1]
    found = find_equilibrium(squares, 0, contacts, load[None])
    exact = in_fractions(squares, contacts, found.force != 0, load)
    assert found.force[0] == pytest.approx(0.105, rel=0.01)
    np.testing.assert_allclose(found.q, exact, rtol=1e-14, atol=0.0)  # whatever the ratio of stiffnesses


def test_soft_coordinates_beside_a_stiff_cubic_spring():
    """The same, where a cubic spring carries the load: its stretch solves one cubic equation, here in 60 digits."""
    stiffness, shape, load = np.array([220.0, 900.0, 4.1e4]), np.array([0.31, -0.72, 0.55]), np.array([1.2, -2.9, 2.1])
    cubic = CubicSprings(shape[None], np.array([1e22]))
    none = Springs(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
    found = find_equilibrium(stiffness, 0, none, load[None], cubic)
    with localcontext() as context:
        context.prec = 60
        k, b, f, c = ([Decimal(x) for x in each.tolist()] for each in (stiffness, shape, load, cubic.stiffness))
        free = sum(x * y / z for x, y, z in zip(b, f, k, strict=True))
        yields = c[0] * sum(x * x / z for x, z in zip(b, k, strict=True))
        stretch = (free / yields) ** (Decimal(1) / 3)
        for _ in range(20):
            stretch -= (stretch + yields * stretch**3 - free) / (1 + 3 * yields * stretch**2)
        exact = [float((y - x * c[0] * stretch**3) / z) for x, y, z in zip(b, f, k, strict=True)]
    np.testing.assert_allclose(found.q, exact, rtol=1e-14, atol=0.0)
