"""Nodes and shape functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamsim.structures.mesh import build_mesh

pytestmark = pytest.mark.quick


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
