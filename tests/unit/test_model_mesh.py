"""Nodes and shape functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamsim.structures.mesh import build_mesh, double_integral, element_rows, shape_functions

pytestmark = pytest.mark.quick


def test_uniform_without_hard_points():
    np.testing.assert_allclose(build_mesh(4).nodes, [0, 0.25, 0.5, 0.75, 1])


def test_hard_points_that_are_nodes_already_change_nothing():
    assert build_mesh(20, [0.5, 0.75, 1.0, 0.05]).elements == 20
    assert build_mesh(10, [0.1 * 3, 0.7]).elements == 10  # round-off in 0.1 * 3 adds no element


@given(
    elements=st.integers(1, 60),
    points=st.lists(st.floats(0, 1), max_size=6),
)
def test_every_hard_point_has_a_node_and_no_element_is_too_long_or_a_sliver(elements, points):
    mesh = build_mesh(elements, points)
    sliver = 1e-3 / elements
    for x in points:
        assert np.abs(mesh.nodes - x).min() <= sliver * (1 + 1e-9)
    assert mesh.lengths.max() <= (1 / elements) * (1 + 1e-8)
    assert mesh.lengths.min() > 0.99 * sliver
    assert mesh.nodes[0] == 0.0
    assert mesh.nodes[-1] == 1.0


def test_a_mass_next_to_a_support_gets_no_sliver():
    assert build_mesh(10, [1e-9, 1 - 1e-9]).elements == 10


def test_locate():
    mesh = build_mesh(4)
    element, xi = mesh.locate([0.0, 0.25, 0.3, 1.0])
    np.testing.assert_array_equal(element, [0, 1, 1, 3])
    np.testing.assert_allclose(xi, [0, 0, 0.2, 1])


@pytest.mark.parametrize("derivative", [0, 1, 2])
@given(xi=st.floats(0.01, 0.99), h=st.floats(0.1, 3))
def test_derivatives_of_shape_functions_by_differences(derivative, xi, h):
    step = 1e-6
    low, high = (shape_functions(xi + s * step, h, derivative) for s in (-1, 1))
    exact = shape_functions(xi, h, derivative + 1)
    np.testing.assert_allclose((high - low) / (2 * step * h), exact, atol=1e-6 * np.abs(exact).max() + 1e-7)


def test_fourth_derivative_is_zero():
    np.testing.assert_array_equal(shape_functions([0.1, 0.9], 0.5, 4), 0.0)


def test_shape_functions_interpolate_cubics():
    h, x = 0.7, np.linspace(0, 0.7, 9)
    p = np.polynomial.Polynomial([1.0, -2.0, 3.0, 0.5])
    u = np.array([p(0), p.deriv()(0), p(h), p.deriv()(h)])
    for d in range(4):
        np.testing.assert_allclose(shape_functions(x / h, h, d) @ u, p.deriv(d)(x) if d else p(x), rtol=1e-12)


@given(h=st.floats(0.05, 2))
def test_matrices_are_the_integrals_of_the_shape_functions(h):
    points, weights = np.polynomial.legendre.leggauss(6)
    xi, w = (points + 1) / 2, weights * h / 2
    n, curvature = shape_functions(xi, h), shape_functions(xi, h, 2)
    moved = element_rows(h, 0, 4)
    np.testing.assert_allclose(moved.T @ moved, (n.T * w) @ n, rtol=1e-10, atol=1e-13)
    b = element_rows(h, 2, 2)
    expected = (curvature.T * w) @ curvature
    np.testing.assert_allclose(b.T @ b, expected, rtol=1e-10, atol=1e-11 * np.abs(expected).max())


def test_textbook_stiffness():
    h = 0.5
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]) / h**3
    b = element_rows(h, 2, 2)
    np.testing.assert_allclose((b.T @ b)[:2], k, rtol=1e-13)


def test_double_integral_by_quadrature():
    h, xi = 0.6, 0.45
    points, weights = np.polynomial.legendre.leggauss(8)
    s, w = (points + 1) / 2 * xi, weights * xi / 2
    expected = h**2 * ((xi - s) * w) @ shape_functions(s, h)
    np.testing.assert_allclose(double_integral(xi, h), expected, rtol=1e-12)
