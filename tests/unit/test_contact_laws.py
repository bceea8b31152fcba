"""Contact laws as phases: laws agree with their parts, and phases that do not exist are refused."""

import numpy as np
import pytest

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import (
    PENETRATION_ROW,
    ContactLaw,
    Guard,
    LawRow,
    Phase,
    piecewise_linear,
)
from beamsim.contacts.sliders import hardening_law

pytestmark = pytest.mark.quick


def test_a_piecewise_linear_law_is_the_sum_of_its_parts():
    law = piecewise_linear([-0.5, 0.2, 0.9], [4.0, 1.0, 3.0, 2.5], 1)
    one = Contacts(np.ones((1, 1)), np.array([-1.0]), np.zeros(1), np.array([False]), (law,))
    parts = one.one_sided_springs()
    assert one.one_sided
    assert parts.count == 3
    x = np.linspace(-1.5, 1.5, 301)[:, None]
    nothing = np.zeros((301, 0))
    phases = np.searchsorted([-0.5, 0.2, 0.9], x)
    delta = -parts.gap - parts.sign * x
    for scaled in (1.0, 0.3):
        own = one.scaled(scaled)
        pushes = parts.scaled(scaled).forces((delta > 0).astype(int), delta, 0 * delta, nothing)
        together = -pushes @ parts.sign
        np.testing.assert_allclose(own.forces(phases, x, 0 * x, nothing)[:, 0], together, atol=1e-13)
        energy = own.stored_energy(phases, x, nothing)
        slope = np.diff(energy) / np.diff(x[:, 0])
        np.testing.assert_allclose(slope, 0.5 * (together[1:] + together[:-1]), atol=0.02)


def test_phases_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="names a phase"):
        ContactLaw((Phase("alone", (Guard(1, PENETRATION_ROW),), closed=True),))
    twice = (Guard(1, PENETRATION_ROW), Guard(1, LawRow(rate=1.0)))
    with pytest.raises(ValueError, match="name the same phase"):
        ContactLaw((Phase("a", twice, closed=True), Phase("b", (), closed=False)))
    with pytest.raises(ValueError, match="not a sum"):
        Contacts(
            np.ones((1, 1)), np.ones(1), np.zeros(1), np.array([False]), (hardening_law(9.0, 1.0, 2.0),)
        ).one_sided_springs()
