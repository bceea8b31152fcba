"""Natural frequencies and shapes of beams against the roots of their characteristic equations."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from beamsim.scenario.beam import Beam
from beamsim.structures.beam import assemble_beam
from beamsim.structures.modes import natural_modes
from beamsim.structures.places import Place

pytestmark = pytest.mark.quick

# f(beta) whose roots are the adimensional wave numbers, and the number of rigid-body modes.
CHARACTERISTIC = {
    ("clamped", "free"): (lambda b: np.cos(b) + 1 / np.cosh(b), 0),
    ("clamped", "clamped"): (lambda b: np.cos(b) - 1 / np.cosh(b), 0),
    ("free", "free"): (lambda b: np.cos(b) - 1 / np.cosh(b), 2),
    ("pinned", "pinned"): (np.sin, 0),
    ("clamped", "pinned"): (lambda b: np.sin(b) - np.cos(b) * np.tanh(b), 0),
    ("pinned", "free"): (lambda b: np.sin(b) - np.cos(b) * np.tanh(b), 1),
    ("clamped", "guided"): (lambda b: np.sin(b) + np.cos(b) * np.tanh(b), 0),
    ("guided", "free"): (lambda b: np.sin(b) + np.cos(b) * np.tanh(b), 1),
    ("guided", "guided"): (np.sin, 1),
    ("guided", "pinned"): (np.cos, 0),
}
CASES = [(*ends, *value) for ends, value in CHARACTERISTIC.items()]
CASES += [(right, left, *value) for (left, right), value in CHARACTERISTIC.items() if left != right]


def make(left="clamped", right="free", elements=50, **more):
    return Beam(
        length=2.0,
        width=0.05,
        thickness=0.01,
        youngs_modulus=70e9,
        density=2700.0,
        elements=elements,
        supports={"left": left, "right": right},
        **more,
    )


def roots(f, count):
    # The trivial root at zero belongs to the rigid-body modes, which are counted apart.
    grid = np.linspace(0.5, 4 * (count + 2), 4001)
    values = f(grid)
    brackets = [(a, b) for a, b, x, y in zip(grid, grid[1:], values, values[1:], strict=False) if x * y < 0]
    return np.array([brentq(f, a, b, xtol=1e-14) for a, b in brackets[:count]])


@pytest.mark.parametrize(("left", "right", "f", "rigid"), CASES)
def test_first_three_frequencies_of_every_pair_of_supports(left, right, f, rigid):
    beam = make(left, right)
    modes = natural_modes(assemble_beam(beam))
    assert np.all(modes.omega[:rigid] == 0.0)  # exactly: round-off there would be a slow oscillation
    # The elements' own error is (beta h)^4 / 1440: below 1e-6 for a cantilever, a little above for the higher
    # wave numbers of beams held at both ends.
    beta = roots(f, 3)
    error = modes.omega[rigid : rigid + 3] / beta**2 - 1
    np.testing.assert_allclose(error, (beta / 50) ** 4 / 1440, rtol=0.02, atol=1e-10)
    assert np.all(np.abs(error) < (1e-6 if "clamped" in (left, right) and "free" in (left, right) else 2e-6))


@pytest.mark.parametrize("ratio", [0.05, 1.0, 10.0])
def test_cantilever_with_a_tip_mass(ratio):
    beam = make()
    mass = ratio * beam.bending.mass_per_length * beam.length
    model = assemble_beam(make(point_masses=[{"position": 2.0, "mass": mass}]))

    def f(b):
        cos, sin, tanh, sech = np.cos(b), np.sin(b), np.tanh(b), 1 / np.cosh(b)
        return sech + cos + ratio * b * (cos * tanh - sin)

    np.testing.assert_allclose(natural_modes(model).omega[:3], roots(f, 3) ** 2, rtol=1e-6)


def test_pinned_beam_with_a_mass_off_every_node():
    # Rayleigh quotient in the sine basis, independent of the elements: M_ij = delta/2 + mu sin sin.
    place, ratio, terms = 0.3137, 0.4, 400
    beam = make("pinned", "pinned", 40)
    mass = ratio * beam.bending.mass_per_length * beam.length
    model = assemble_beam(make("pinned", "pinned", 40, point_masses=[{"position": 2.0 * place, "mass": mass}]))
    n = np.arange(1, terms + 1)
    s = np.sin(n * np.pi * place)
    # Eigenvalues of diag(l)/2 - w2 (I/2 + mu s s^T): secular equation 1 = 2 mu w2 sum s^2 / (l - w2).
    level = (n * np.pi) ** 4.0

    def secular(w2):
        return 1 - 2 * ratio * w2 * np.sum(s**2 / (level - w2))

    edges = [1e-6, *level[:3]]
    expected = [brentq(secular, a * (1 + 1e-9), b * (1 - 1e-9)) for a, b in pairwise(edges)]
    np.testing.assert_allclose(natural_modes(model).omega[:3] ** 2, expected, rtol=1e-5)


def test_shape_of_the_first_cantilever_mode():
    model = assemble_beam(make())
    v = natural_modes(model).vectors[:, 0]
    b = 1.8751040687119611
    sigma = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
    for x in (0.2, 0.55, 1.0):
        phi = np.cosh(b * x) - np.cos(b * x) - sigma * (np.sinh(b * x) - np.sin(b * x))
        assert model.row(Place("beam", 2.0 * x)) @ v == pytest.approx(phi, rel=1e-6)  # also normalised: int phi^2 = 1


def test_thousands_of_elements_keep_their_digits():
    # K's own eigenvalues lose them here: its conditioning grows as the fourth power of the elements.
    model = assemble_beam(make(elements=2000))
    modes = natural_modes(model, count=3)
    np.testing.assert_allclose(modes.omega[0], 1.8751040687119611**2, rtol=1e-9)
