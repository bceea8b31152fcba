"""Changes of stability on a step of a branch whose multipliers are written down."""

import numpy as np
import pytest

from beamsim.orbits.continuation import BranchStep, Settings, solve_at
from beamsim.orbits.special_points import special_points

# where a complex pair is on the unit circle, and a real pair has the product 1
TURNING, REAL = 0.3, 0.4


class Multipliers:
    """The branch ``x = 0``, and multipliers that change with its parameter: a complex pair and two real ones."""

    bifurcates = True

    def residual(self, u):
        return u[:1].copy(), np.array([[1.0, 0.0]]), None

    def scale(self, u):
        return np.ones(2), np.ones(1)

    def same_events(self, a, b):
        return True

    def multipliers(self, point):
        value = point.parameter
        pair = (1.0 + 0.01 * (value - TURNING)) * np.exp(1.3j * np.array([1.0, -1.0]))
        return np.array([1.5, *pair, (1.0 + 0.1 * (value - REAL)) / 1.5])


@pytest.mark.parametrize("ends", [(0.0, 1.0), (1.0, 0.0), (0.0, 0.5), (0.25, 0.45)])
def test_a_neimark_sacker_point_next_to_real_multipliers_of_product_one(ends):
    problem = Multipliers()
    a, b = (solve_at(problem, np.array([0.0, end]), Settings(), end, ends[1] - ends[0]) for end in ends)
    (event,) = special_points(BranchStep(problem, a, b))
    assert event.kind == "neimark_sacker"
    assert event.parameter == pytest.approx(TURNING, rel=1e-9)
