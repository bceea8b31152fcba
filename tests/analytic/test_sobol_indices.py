"""Sobol' indices of functions whose variances are known in closed form."""

import math

import numpy as np
import pytest

from beamsim.analyses.studies.plan import latin_hypercube, sobol
from beamsim.analyses.studies.statistics import sensitivities
from beamsim.scenario.studies import VariedParameter

pytestmark = pytest.mark.quick

SAMPLES = 1024


def parameter(low, high, **more):
    return VariedParameter("x", (("x",),), "1", 0.5 * (low + high), (), low, high, **more)


def indices(function, varied):
    x = np.array(sobol(varied, SAMPLES, 1))
    assert x.shape == (len(varied), SAMPLES * (len(varied) + 2))
    result, gaps = sensitivities({"y": function(*x)}, len(varied))
    assert gaps == []
    return result["y"]


def test_ishigami():
    """T. Ishigami and T. Homma, 1990: sin x + a sin^2 y + b z^4 sin x on (-pi, pi), a = 7, b = 0.1."""
    a, b, pi = 7.0, 0.1, math.pi
    of_x = 0.5 * (1.0 + b * pi**4 / 5.0) ** 2
    of_y = a**2 / 8.0
    of_xz = b**2 * pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    total = of_x + of_y + of_xz
    result = indices(lambda x, y, z: np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x), (parameter(-pi, pi),) * 3)
    np.testing.assert_allclose(result["first_order"], np.array([of_x, of_y, 0.0]) / total, atol=0.03)
    np.testing.assert_allclose(result["total_order"], np.array([of_x + of_xz, of_y, of_xz]) / total, atol=0.03)
    for k, exact in enumerate(np.array([of_x + of_xz, of_y, of_xz]) / total):
        assert result["total_order_low"][k] < exact < result["total_order_high"][k]


def test_tolerances_have_their_own_spread():
    """A sum: each part's share is its variance; a normal tolerance's deviation is a third of it, cut at three."""
    density = math.exp(-4.5) / math.sqrt(2.0 * math.pi)
    normal = (1.0 - 2.0 * 3.0 * density / math.erf(3.0 / math.sqrt(2.0))) / 9.0
    uniform = 1.0 / 3.0
    result = indices(lambda x, y: x + y, (parameter(-1.0, 1.0), parameter(-1.0, 1.0, distribution="normal")))
    np.testing.assert_allclose(result["first_order"], np.array([uniform, normal]) / (uniform + normal), atol=0.02)
    np.testing.assert_allclose(result["total_order"], np.array([uniform, normal]) / (uniform + normal), atol=0.02)


def test_the_same_seed_gives_the_same_intervals():
    one, other = (indices(lambda x, y: x * y, (parameter(1.0, 2.0),) * 2) for _ in range(2))
    np.testing.assert_array_equal(one["total_order_low"], other["total_order_low"])


def test_what_does_not_vary_or_is_not_known_has_no_shares():
    varied = (parameter(0.0, 1.0),) * 2
    x, _ = np.array(sobol(varied, 8, 1))
    gap = np.where(np.arange(x.size) == 3, np.nan, x)
    responses = {
        "constant": np.full(x.size, 3.0),
        "gap": gap,
    }
    assert sensitivities(responses, 2) == ({}, ["gap"])


@pytest.mark.parametrize("sample", [latin_hypercube, sobol])
def test_whole_numbers_and_logarithms(sample):
    columns = sample((parameter(1, 4, integers_only=True), parameter(1.0, 1e4, spacing="logarithmic")), 256, 0)
    assert set(columns[0]) == {1, 2, 3, 4}
    assert np.mean(np.log10(columns[1])) == pytest.approx(2.0, abs=0.02)
