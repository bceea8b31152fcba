"""Steps over which a function with a bounded curvature stays positive."""

import numpy as np
import pytest

from beamsim.flow import kernels

pytestmark = pytest.mark.quick

_safe_step = kernels._safe_step.py_func  # compiled code alone calls what it is compiled to


@pytest.mark.parametrize("slope", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("bound", [0.0, 1e-6, 2.0])
def test_the_parabola_below_reaches_zero_there(slope, bound):
    step = _safe_step(0.5, slope, bound)
    if np.isinf(step):
        assert (bound, slope >= 0.0) == (0.0, True)
    else:
        assert 0.5 + slope * step - bound * step**2 / 2 == pytest.approx(0.0, abs=1e-12 * (1.0 + step))


@pytest.mark.parametrize("bound", [5e-324, 5e-321, 1e-310])
def test_a_motion_that_has_decayed_below_the_smallest_number_does_not_stop_the_march(bound):
    """The product of the bound and the distance is 0: steps from it had no length."""
    assert _safe_step(7e-6, 0.0, bound) > 1e100
