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


def close(computed, mesh, bounds):
    """Values of beamsim and of CalculiX agree within bounds by the begin of their names, over the value itself."""
    kept = finite_elements.numbers()[computed.__name__][mesh]
    found = computed()
    assert found.keys() == kept.keys()
    for quantity, value in kept.items():
        bound = next(bounds[begin] for begin in bounds if quantity.startswith(begin))
        assert found[quantity] == pytest.approx(value, rel=bound), quantity
