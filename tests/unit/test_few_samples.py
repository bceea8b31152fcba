"""Samples of a motion at few and many, even and uneven times."""

from __future__ import annotations

import numpy as np

from beamsim.contacts.contacts import Contacts
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def test_rest_on_an_unstable_equilibrium_is_sampled_as_rest():
    """Its motions grow by more than a floating-point number holds, of an amplitude of zero: even and uneven times."""
    contacts = Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([-2500.0]), np.array([[0.1]]), contacts, np.zeros(1))
    rest = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 20.0), np.zeros(2))
    for times in (np.linspace(0.0, 20.0, 4097), np.linspace(0.0, 20.0, 100), np.linspace(0.0, 4.4, 50) ** 2):
        np.testing.assert_array_equal(rest.states_at(times), 0.0)
