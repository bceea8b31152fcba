"""What several systems have in common: built once whatever the threads, and a bounded number of each kept."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from beamsim.system.parts import MOST_KEPT, SharedBuilds

pytestmark = pytest.mark.quick


def test_threads_that_need_the_same_wait_for_the_one_that_builds_it():
    shared, built, together = SharedBuilds(), [], Barrier(8)

    def ask(_):
        together.wait()
        return shared.once("structure", "beam", lambda: built.append(None) or object())

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(ask, range(8)))
    assert len(built) == 1
    assert all(each is found[0] for each in found)


def test_many_threads_keep_a_bounded_number_of_each_sort():
    shared = SharedBuilds()

    def ask(number):
        return [shared.once(sort, number % 37, lambda: number % 37) for sort in ("structure", "signal")]

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(ask, range(2000)))
    assert found == [[number % 37] * 2 for number in range(2000)]
    assert {sort: len(kept) for sort, kept in shared._kept.items()} == {"structure": MOST_KEPT, "signal": MOST_KEPT}
