"""Outputs behind a low-pass filter that are known at the ends of panels."""

import numpy as np
import pytest

from beamsim.signals.filters import FilteredPanels

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("ends", [[0.0], [0.0, 0.0]])
def test_a_motion_that_ends_where_it_begins_has_its_value(ends):
    value = np.full((len(ends), 2), 3.0)
    panels = FilteredPanels(np.array(ends), value, np.zeros_like(value))
    np.testing.assert_array_equal(panels.at(np.zeros(1)), [[3.0, 3.0]])
    low, _, high, _ = panels.extremes(0.0, 0.0)
    np.testing.assert_array_equal([low, high], np.full((2, 2), 3.0))


def test_between_the_ends_it_is_a_cubic():
    """``t^3 - t`` on uneven panels: its values, and its lowest one at ``1 / sqrt 3``."""
    ends = np.array([0.0, 0.3, 0.4, 1.5])[:, None]
    panels = FilteredPanels(ends[:, 0], ends**3 - ends, 3 * ends**2 - 1)
    times = np.linspace(0.0, 1.5, 31)
    np.testing.assert_allclose(panels.at(times)[:, 0], times**3 - times, atol=1e-14)
    low, when, _, _ = panels.extremes(0.1, 1.4)
    assert low[0] == pytest.approx(-2 / 27**0.5, rel=1e-12)
    assert when[0] == pytest.approx(3**-0.5, rel=1e-6)
