"""The contact states' tables: which state follows which, and what a new state costs among many."""

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import no_tension
from beamsim.flow import contact_state
from beamsim.flow.exact import ExactFlow
from beamsim.system.equations import PiecewiseLinearSystem

LAWS = (kelvin_voigt(2.0), no_tension(3.0, 0.1), kelvin_voigt(5.0, 0.2), no_tension(1.0, 0.3))


@pytest.fixture
def flow(no_forcing):
    rng = np.random.default_rng(5)
    contacts = Contacts(rng.normal(size=(4, 3)), np.ones(4), np.full(4, 0.1), np.zeros(4, dtype=bool), LAWS)
    return ExactFlow(PiecewiseLinearSystem(np.array([1.0, 8.0, 30.0]), 0.1 * np.eye(3), contacts, np.zeros(3)),
                     no_forcing(3), 1.0)  # fmt: skip


def test_followers_are_the_states_after_each_guards_event(flow):
    """Known from the first motion that asks for them on, whether they were built before or not."""
    rng = np.random.default_rng(2)
    numbers = [len(law.phases) for law in LAWS]
    every = np.array(np.meshgrid(*map(range, numbers))).reshape(4, -1).T
    for phases in rng.permutation(every)[:8]:
        flow.state_index(phases)
    assert np.all(flow.tables().follower == -1)
    for state in range(8):
        for guard in range(flow.tables().n_guards[state]):
            expected = flow.following(state, guard)
            following = flow.follow(state, guard)
            assert flow.tables().follower[state, guard] == following
            np.testing.assert_array_equal(flow.states[following].phases, expected)
    assert len(flow.states) > 8


def test_a_state_is_built_in_one_pass(flow, monkeypatch):
    """Every case of a study builds its states anew: what they need of the contacts is looked up once."""
    count = {"force_rows": 0, "_residual": 0}

    def counting(owner, name):
        original = getattr(owner, name)

        def call(*arguments):
            count[name] += 1
            return original(*arguments)

        monkeypatch.setattr(owner, name, call)

    counting(Contacts, "force_rows")
    counting(contact_state, "_residual")
    flow.state_index(np.ones(4, dtype=np.int64))
    assert count["force_rows"] == 2  # modes, loads
    assert count["_residual"] <= flow.sources.count
