"""Prominent maxima of curves are those of `scipy.signal.find_peaks`, which takes too long to import."""

import numpy as np
import pytest

from beamsim.analyses.sweep.peaks import prominent_maxima

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("steps", [0, 6, 3], ids=["distinct", "flat maxima", "mostly flat"])
def test_the_same_as_a_library_finds(steps):
    from scipy.signal import find_peaks

    rng = np.random.default_rng(steps)
    found = 0
    for size in range(1, 60):
        values = rng.normal(size=size).cumsum()
        values = np.round(values * steps / 4) if steps else values
        for least in (0.3, 1.0, 3.0):
            expected, _ = find_peaks(values, prominence=least)
            np.testing.assert_array_equal(prominent_maxima(values, least), expected)
            found += expected.size
    assert found > 100
