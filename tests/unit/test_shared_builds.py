"""What several systems have in common: built once whatever the threads, and a bounded number of each kept."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest

from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.parts import reduced_parts
from beamsim.system.shared import MOST_KEPT, SharedBuilds

CASE = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"


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


@pytest.mark.parametrize(
    "change", [{"beam.damping.ratio": 0.03}, {"beam.damping": {"kind": "rayleigh", "mass": 1.0, "stiffness": 1e-5}}]
)
def test_another_damping_shares_the_reduced_coordinates(change):
    """The system is that of a build of its own, without that anything is reduced again."""
    shared = SharedBuilds()
    before, after = load_scenario(CASE), load_scenario(CASE, change)
    one, other = reduced_parts(before, shared=shared), reduced_parts(after, shared=shared)
    assert other.basis is one.basis
    assert not np.array_equal(one.damping, other.damping)
    np.testing.assert_array_equal(other.damping, reduced_parts(after).damping)


@pytest.mark.parametrize(
    "change", [{"snubbers[0].stiffness": 1e5}, {"snubbers[0].damping.ratio": 0.05}, {"snubbers[0].gap": -1e-4}]
)
def test_other_contacts_share_the_reduced_structure(change):
    """... and are those of a build of their own."""
    shared = SharedBuilds()
    build_system(load_scenario(CASE), shared)
    built, anew = build_system(load_scenario(CASE, change), shared), build_system(load_scenario(CASE, change))
    assert (
        reduced_parts(load_scenario(CASE), shared=shared).basis
        is reduced_parts(load_scenario(CASE, change), shared=shared).basis
    )
    for name in ("stiffness", "dashpot", "gap"):
        np.testing.assert_array_equal(getattr(built.dynamics.contacts, name), getattr(anew.dynamics.contacts, name))
    np.testing.assert_array_equal(built.dynamics.damping, anew.dynamics.damping)
