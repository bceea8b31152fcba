"""The search for the highest point of a curve: to a ten-thousandth of a step, in few evaluations."""

import numpy as np
import pytest

from beamsim.analyses.continuation.refinement import SHARE, search_maximum

pytestmark = pytest.mark.quick

CURVES = {
    "smooth": (lambda x: 1.0 / (1.0 + (x - 0.3) ** 2) + 0.02 * x**3, 7),
    "narrow": (lambda x: 1.0 / (1.0 + 400.0 * (x + 0.02) ** 2), 14),
    "corner": (lambda x: 1.0 - abs(x - 0.1) * (2.0 if x < 0.1 else 0.3), 30),
    "beside a jump": (lambda x: 0.5 if x > 0.25 else 1.0 + 0.3 * x, 34),
}


@pytest.mark.parametrize("name", CURVES)
def test_the_highest_place_is_found(name):
    curve, most = CURVES[name]
    places = []

    def of(x):
        places.append(x)
        return curve(x)

    search_maximum(of, [(x, curve(x)) for x in (-1.0, 0.0, 1.0)])
    fine = np.linspace(-1.0, 1.0, 40_001)
    best = fine[int(np.argmax([curve(x) for x in fine]))]
    assert abs(max([0.0, *places], key=curve) - best) < 2 * SHARE
    assert len(places) <= most
    assert len(set(places)) == len(places)
