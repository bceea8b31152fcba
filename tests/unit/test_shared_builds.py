"""What several systems have in common: built once, and a bounded number of each kept."""

import pytest

from beamsim.system.reduced_model import MOST_BUILDS, SharedBuilds

pytestmark = pytest.mark.quick


def test_what_is_asked_for_again_is_built_once():
    shared, built = SharedBuilds(), []
    found = [shared.once("structure", "beam", lambda: built.append(None) or object()) for _ in range(3)]
    assert len(built) == 1
    assert all(each is found[0] for each in found)


def test_a_bounded_number_of_each_sort_is_kept():
    shared = SharedBuilds()
    found = [
        [shared.once(sort, number % 37, lambda value=number % 37: value) for sort in ("structure", "signal")]
        for number in range(2000)
    ]
    assert found == [[number % 37] * 2 for number in range(2000)]
    assert {sort: len(kept) for sort, kept in shared._kept.items()} == {"structure": MOST_BUILDS, "signal": MOST_BUILDS}
