"""What several systems have in common: built once whatever the threads, and a bounded number of each kept."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np

from beamsim.scenario import load_scenario
from beamsim.structures.places import Place
from beamsim.system.parts import reduced_parts
from beamsim.system.shared import MOST_KEPT, SharedBuilds

BEAM = """\
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  supports: {left: clamped, right: free}}
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.1 s}
"""


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


def test_the_one_used_longest_ago_is_built_anew():
    shared, built = SharedBuilds(), []
    for number in [*range(MOST_KEPT), 0, MOST_KEPT, 0, 1]:
        shared.once("structure", number, lambda number=number: built.append(number))
    assert built == [*range(MOST_KEPT), MOST_KEPT, 1]


def test_a_build_may_need_another_one():
    shared = SharedBuilds()
    assert shared.once("reduced", 1, lambda: shared.once("structure", 1, lambda: 2) + 1) == 3


def test_what_has_no_hash_is_not_kept():
    shared = SharedBuilds()
    assert shared.once("structure", [1], object) is not shared.once("structure", [1], object)


def test_a_point_that_moves_does_not_let_the_memory_of_a_structure_grow():
    """A study over a position asked one reduced structure for the shapes of each, and all were kept."""
    reduced = reduced_parts(load_scenario(BEAM)).reduced
    row = reduced.shapes([Place("beam", 0.27)])
    for x in np.linspace(0.1, 0.27, 5 * MOST_KEPT):
        reduced.shapes([Place("beam", float(x))])
        reduced.recoveries([Place("beam", float(x))], None)
    assert reduced._kept_shapes.cache_info().currsize == MOST_KEPT
    assert reduced._kept_recoveries.cache_info().currsize == MOST_KEPT
    np.testing.assert_array_equal(reduced.shapes([Place("beam", 0.27)]), row)
