"""Bending moments do not depend on how often a load is listed, nor on what of it is level and what is shape."""

import numpy as np
import pytest

import beamsim
from beamsim.system.build import build_system

ELEMENTS = 3  # with all modes three are not resolved, fewer than there are loads
PLACES = (0.12, 0.2, 0.29, 0.41)


def stress_rows(places, line=None, modes="all", elements=ELEMENTS):
    """(nx, n) stresses of a beam with stops at places, and a constant force along a line."""
    case = {
        "beam": {"length": 0.5, "width": 0.03, "thickness": 0.003, "youngs_modulus": 7e10, "density": 2700.0,
                 "elements": elements},
        "snubbers": [{"name": f"stop {k}", "position": x, "side": "below", "stiffness": 1e4, "gap": 1e-3}
                     for k, x in enumerate(places)],
        "constant_forces": [] if line is None else [{"line": [0.1, 0.35]} | line],
        "gravity": 9.81,
        "reduction": {"modes": modes},
    }  # fmt: skip
    system = build_system(beamsim.load_scenario(case))
    return system.stress.stations.position, system.stress.row


def apart(one, other):
    """Largest difference of the rows at the stations that both have."""
    (x, row), (y, again) = one, other
    nearest = np.abs(y - x[:, None]).argmin(axis=1)
    assert np.abs(y[nearest] - x).max() < 1e-12
    return np.abs(again[nearest] - row).max() / np.abs(row).max()


@pytest.mark.parametrize("elements", [3, 5])
@pytest.mark.parametrize("again", PLACES)
def test_a_place_counts_once_however_often_it_is_listed(elements, again):
    """At the same number, or at one that differs by round-off."""
    first = stress_rows(PLACES, elements=elements)
    for listed in (again, again * (1 + 2e-16), again * (1 - 3e-16)):
        assert apart(first, stress_rows((*PLACES, listed), elements=elements)) < 1e-9
    assert apart(first, stress_rows(PLACES[::-1], elements=elements)) < 1e-9


def test_a_load_weighs_the_same_whatever_its_level():
    """A shape of 1 and one of 20, of which the level is a twentieth."""
    one = stress_rows(PLACES, {"force_per_length": 1.0, "shape": {"kind": "polynomial", "coefficients": [1.0, 2.0]}})
    other = stress_rows(
        PLACES, {"force_per_length": 0.05, "shape": {"kind": "polynomial", "coefficients": [20.0, 40.0]}}
    )
    assert apart(one, other) < 1e-9


def test_another_place_is_another_load():
    """Twin: a stop a tenth of a millimetre away is another one where the fit is not exact."""
    assert apart(stress_rows(PLACES), stress_rows((*PLACES, PLACES[1] + 1e-4))) > 1e-4
