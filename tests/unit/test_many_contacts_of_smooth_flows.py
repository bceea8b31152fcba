"""Structures with cubic springs and more contacts than an integer of 64 bits has places."""

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import CubicSprings
from beamsim.contacts.laws import kelvin_voigt
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.system.equations import PiecewiseLinearSystem


def motion(place, count):
    """A mass with a cubic spring that meets one stop, which is at a place among stops that are far away."""
    gap = np.full(count, 1e3)
    gap[place] = 0.1
    contacts = Contacts(
        np.ones((count, 1)), -np.ones(count), gap, np.zeros(count, dtype=bool),
        tuple(kelvin_voigt(10.0 + 10.0 * (j == place)) for j in range(count)),
    )  # fmt: skip
    system = PiecewiseLinearSystem(np.ones(1), np.zeros((1, 1)), contacts, np.zeros(1))
    flow = SmoothFlow(system, springs=CubicSprings(np.ones((1, 1)), np.array([0.5])))
    flow_map = flow.flow_map(np.array([0.0, 1.0]), 8.0)
    return flow_map.phases, flow.states_at(flow_map, np.linspace(0.0, 8.0, 50)), flow.end(flow_map.start, 8.0)


@pytest.mark.parametrize(("place", "count"), [(63, 65), (64, 65), (69, 70)])
def test_contacts_beyond_the_64th_are_kept(place, count):
    alone, expected, end = motion(0, 1)
    phases, states, _ = motion(place, count)
    assert alone.any()
    np.testing.assert_array_equal(np.delete(phases, place, axis=1), 0)
    assert phases[:, place].any()
    np.testing.assert_allclose(states, expected, atol=1e-12)
    np.testing.assert_allclose(end, expected[-1], atol=1e-12)  # without derivatives
