"""A beam, a plate, a frame and stops against CalculiX, by its numbers that are kept (`benchmarks/calculix.py`)."""

import pytest

from benchmarks import calculix
from docs.site_pages import finite_elements

pytestmark = pytest.mark.portable


@pytest.mark.parametrize("name", calculix.DECKS)
def test_kept_decks_are_those_of_the_scenarios(name):
    """The numbers belong to the structures that beamsim computes."""
    kept = (finite_elements.FOLDER / f"{name}.inp").read_text(encoding="utf-8")
    assert calculix.DECKS[name]() == kept


def assert_close(computed, mesh, bound):
    """Values of which each is within its bound, by name, of that of CalculiX with a mesh and step, over that itself."""
    kept = finite_elements.numbers()[computed.__name__][mesh]
    found = computed()
    assert found.keys() == kept.keys()
    for quantity, value in kept.items():
        assert found[quantity] == pytest.approx(value, rel=bound(quantity)), quantity
    return found


def assert_converges(name, coarse, fine, bound):
    """The numbers of CalculiX with two meshes or steps are within a bound of each other, over the finer ones."""
    kept = finite_elements.numbers()[name]
    for quantity, value in kept[fine].items():
        assert kept[coarse][quantity] == pytest.approx(value, rel=bound), quantity


def test_frequencies_of_a_beam():
    """Bricks have shear and rotary inertia, which lower mode n by about n^2 times a constant."""
    bounds = {1: 0.0025, 2: 0.0025, 3: 0.004, 4: 0.007, 5: 0.012}
    assert_close(finite_elements.beam, "20 elements", lambda quantity: bounds[int(quantity.split()[-2].strip(","))])
    assert_converges("beam", "10 elements", "20 elements", 0.009)


def test_a_beam_with_shear_has_the_frequencies_of_bricks():
    found = finite_elements.timoshenko_beam()
    kept = finite_elements.numbers()["beam"]["20 elements"]
    for mode in range(1, 6):
        frequency = kept[f"open, mode {mode}, Hz"]
        assert min(abs(value / frequency - 1.0) for value in found) < 0.0015


def test_frequencies_of_a_plate():
    assert_close(finite_elements.plate, "28 x 16 elements", lambda _: 0.005)
    assert_converges("plate", "14 x 8 elements", "28 x 16 elements", 0.006)


def test_frequencies_of_a_frame():
    """Timoshenko members are bricks but for torsion, which moves modes 3, 4 and 9."""
    twisted = {"frequency, mode 3, Hz", "frequency, mode 4, Hz", "frequency, mode 9, Hz"}
    assert_close(finite_elements.frame, "16 elements", lambda quantity: 0.005 if quantity in twisted else 4e-4)
    assert_converges("frame", "8 elements", "16 elements", 0.003)


def test_a_beam_that_meets_a_stop():
    """CalculiX converges with its step to 0.05 %, and its mesh changes less."""
    assert_close(finite_elements.beam_on_a_stop, "20 elements, 20 µs", lambda _: 0.004)
    assert_converges("beam_on_a_stop", "10 elements, 40 µs", "10 elements, 10 µs", 0.003)
    assert_converges("beam_on_a_stop", "10 elements, 20 µs", "10 elements, 10 µs", 0.0005)
    assert_converges("beam_on_a_stop", "10 elements, 20 µs", "20 elements, 20 µs", 0.0005)


def test_a_plate_that_meets_two_stops():
    """What its mesh leaves: a finer one of CalculiX is nearer to beamsim in every value."""
    found = assert_close(finite_elements.plate_on_two_stops, "14 x 8 elements, 250 µs", lambda _: 0.012)
    assert_converges("plate_on_two_stops", "14 x 8 elements, 500 µs", "14 x 8 elements, 250 µs", 0.01)
    kept = finite_elements.numbers()["plate_on_two_stops"]
    coarse, fine = kept["8 x 5 elements, 500 µs"], kept["14 x 8 elements, 500 µs"]
    assert all(abs(value - fine[name]) < abs(value - coarse[name]) for name, value in found.items())
