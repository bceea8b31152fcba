"""A motion that visits more contact states than are kept: the least recently used are dropped and built again."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.pads import no_tension
from beamsim.flow.channels import MotionPart
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem

N, M, END = 5, 6, 5.0
CASE = Path(__file__).parents[2] / "configs/stops/chain_bumpers.yaml"


def flow_of(most=None, law=kelvin_voigt) -> ExactFlow:
    rng = np.random.default_rng(3)
    omega = np.array([2.0, 7.0, 15.0, 27.0, 44.0])
    contacts = Contacts(rng.normal(size=(M, N)), np.where(np.arange(M) % 2, -1.0, 1.0), np.full(M, 0.02),
                        np.zeros(M, dtype=bool), tuple(law(300.0 * (j + 1), 0.5) for j in range(M)))  # fmt: skip
    system = PiecewiseLinearSystem(omega**2, np.diag(0.04 * omega), contacts, np.zeros(N))
    return ExactFlow(system, Forcing(np.ones((1, N)), (Signal.harmonic(4.0, 6.0),)), END, most_states=most)


def outputs(flow):
    return lambda phases: flow.equations.penetration


@cache
def unbounded(law):
    """The motion that keeps all its states, computed once for all that do not."""
    return simulate(flow_of(None, law), np.zeros(2 * N))


@pytest.mark.parametrize(("law", "most"), [(kelvin_voigt, 2), (no_tension, 5)])
def test_everything_is_that_of_a_motion_that_keeps_all(law, most):
    whole, bounded = unbounded(law), simulate(flow_of(most, law), np.zeros(2 * N))
    assert len(whole.flow.states) > 12
    assert len(bounded.flow.states) == most
    assert bounded.flow.tables().horizon.size <= most
    np.testing.assert_array_equal(bounded.flow.visited_phases, whole.flow.visited_phases)
    np.testing.assert_array_equal(bounded.state, whole.state)
    np.testing.assert_array_equal(bounded.event_time, whole.event_time)
    times = np.linspace(0.0, END, 700)
    one, other = outputs(whole.flow), outputs(bounded.flow)
    np.testing.assert_allclose(bounded.sample(times, other), whole.sample(times, one), atol=1e-13)
    np.testing.assert_array_equal(bounded.phases[bounded.segments_at(times)], whole.phases[whole.segments_at(times)])
    np.testing.assert_allclose(bounded.contact_share(), whole.contact_share(), rtol=1e-14)
    first, second = bounded.extrema(other), whole.extrema(one)
    # a peak is flat: its height is known to round-off, its time to no more than the root of that
    np.testing.assert_allclose(first.high, second.high, rtol=1e-12)
    np.testing.assert_allclose(first.when_high, second.when_high, rtol=1e-9)
    weight = np.eye(M)
    np.testing.assert_allclose(
        bounded.product_integrals(times, other, other, weight), whole.product_integrals(times, one, one, weight),
        rtol=1e-12, atol=1e-15,
    )  # fmt: skip
    parts = [MotionPart(m.extract(3.0, END), of, 100.0) for m, of in ((whole, one), (bounded, other))]
    lines = [part.integrals(np.array([1.0, 6.0, 9.0]), 0) for part in parts]
    np.testing.assert_allclose(*lines, atol=1e-13)


def test_the_summary_says_how_many_states_are_kept_where_some_were_dropped():
    for most in (2, 100):
        settings = {
            "run.spectrum.periods": 3,
            "run.duration": "0.4 s",
            "run.most_contact_states": most,
            "run.convergence": "off",
        }
        summary = beamsim.run(beamsim.load_scenario(CASE, settings)).summary
        assert summary.get("contact_states_kept") == (2 if most == 2 else None)
