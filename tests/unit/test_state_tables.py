"""The contact states' tables: which state follows which, and what a new state costs among many."""

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt, no_tension
from beamsim.flow import contact_state, state_tables
from beamsim.flow.exact import ExactFlow
from beamsim.system.equations import PiecewiseLinearSystem

LAWS = (kelvin_voigt(2.0), no_tension(3.0, 0.1), kelvin_voigt(5.0, 0.2), no_tension(1.0, 0.3))


@pytest.fixture
def flow(no_forcing):
    rng = np.random.default_rng(5)
    contacts = Contacts(rng.normal(size=(4, 3)), np.ones(4), np.full(4, 0.1), np.zeros(4, dtype=bool), LAWS)
    return ExactFlow(PiecewiseLinearSystem(np.array([1.0, 8.0, 30.0]), 0.1 * np.eye(3), contacts, np.zeros(3)),
                     no_forcing(3), 1.0)  # fmt: skip


@pytest.mark.parametrize("most", [None, 40])
def test_followers_are_the_states_after_each_guards_event(flow, most, monkeypatch):
    """Large states, which are not kept beside the tables, and others."""
    monkeypatch.setattr(state_tables, "LARGE", 0 if most else state_tables.LARGE)
    flow.most_states = flow._tables.most = most
    rng = np.random.default_rng(2)
    numbers = [len(law.phases) for law in LAWS]
    every = np.array(np.meshgrid(*map(range, numbers))).reshape(4, -1).T
    for phases in rng.permutation(every)[:20]:
        flow.state_index(phases)
    follower, known = flow.tables().follower, {s.phases.tobytes(): i for i, s in enumerate(flow.states)}
    seen = 0
    for i in range(len(flow.states)):
        for guard in range(flow.tables().n_guards[i]):
            expected = known.get(flow.following(i, guard).tobytes(), -1)
            assert follower[i, guard] == expected
            seen += expected >= 0
    assert seen > 10
    shared = [np.shares_memory(s.term_vector, flow.tables().term_vector) for s in flow.states]
    assert sum(shared) == (len(flow.states) - state_tables.FEWEST if most else 0)  # those before the tables grew


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


def test_a_new_state_is_compared_with_its_neighbours_alone(flow, monkeypatch):
    tables, looked_up = flow._tables, []
    index = tables.index
    monkeypatch.setattr(tables, "index", lambda phases: looked_up.append(1) or index(phases))
    most = []
    for i in range(20):
        before = len(looked_up)
        flow.state_index(np.array([i % 2, i // 2 % 2, i // 4 % 2, i // 8 % 2]))
        most.append(len(looked_up) - before)
    assert len(flow.states) == 16
    assert max(most) <= 1 + sum(len(law.phases) for law in LAWS)  # whatever the number of states
