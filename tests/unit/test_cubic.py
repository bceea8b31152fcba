"""Cubics from the values and slopes at their ends: largest values, and whether slopes keep their signs."""

import numpy as np

from beamsim.flow.cubic import Cubic


def test_the_cubic_is_that_of_its_ends():
    rng = np.random.default_rng(1)
    d, c, e = rng.normal(size=(3, 200))
    cubic = Cubic(np.zeros(200), d + c + e, d, d + 2.0 * c + 3.0 * e)
    u = np.linspace(0.0, 1.0, 2001)[:, None]
    fine, slope = u * (d + u * (c + u * e)), d + u * (2.0 * c + 3.0 * u * e)
    top, place = cubic.top()
    np.testing.assert_allclose(top, fine.max(axis=0), atol=1e-5)
    assert np.all(top >= fine.max(axis=0) - 1e-14)
    inside = place > 0.0
    assert inside.sum() > 20
    at_place = place * (d + place * (c + place * e))
    np.testing.assert_allclose(np.maximum(at_place, np.maximum(0.0, d + c + e)), top, atol=1e-13)
    assert np.all(np.abs(d + place * (2.0 * c + 3.0 * place * e))[inside] < 1e-12)
    assert np.all((c + 3.0 * place * e)[inside] < 0.0)
    for error in (0.0, 0.3):
        keeps = np.all(slope > error, axis=0) | np.all(slope < -error, axis=0)
        differ = cubic.climbs(np.full(200, error)) != keeps
        near = np.minimum(np.abs(slope - error).min(axis=0), np.abs(slope + error).min(axis=0)) < 1e-3
        assert not np.any(differ & ~near)
        assert keeps.any()
