"""Numbers of a shape to start from, with the units of masses and of coefficients."""

import pytest

from beamsim.scenario import load_scenario

pytestmark = pytest.mark.quick

CHAIN = {"chain": {"masses": [1, 2, 1], "springs": [100, 100, 100]}}
BEAM = {"beam": {"length": 0.5, "width": 0.02, "thickness": 0.005, "youngs_modulus": 70e9, "density": 2700,
                 "supports": {"left": "free", "right": "free"}}}  # fmt: skip


def start(structure, **given):
    return load_scenario({**structure, "run": {"duration": 0.1, "start": given}}).run.start


def test_masses_have_displacements_and_velocities():
    given = start(CHAIN, displacement=["1 mm", "-0.5 in", 0.002], velocity=["20 cm/s", 0, "1 m/s"])
    assert given.displacement == pytest.approx((0.001, -0.0127, 0.002), rel=1e-12)
    assert given.velocity == (0.2, 0.0, 1.0)


def test_coefficients_have_the_units_of_their_powers():
    given = start(BEAM, displacement=["1 mm", "2 mm/m", "3 1/m", "4 1/m^2", 5], velocity=["3 mm/s", "2 1/s", "1 1/m/s"])
    assert given.displacement == pytest.approx((0.001, 0.002, 3.0, 4.0, 5.0), rel=1e-12)
    assert given.velocity == (0.003, 2.0, 1.0)
