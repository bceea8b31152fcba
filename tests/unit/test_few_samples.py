"""Samples of a motion at few and many, even and uneven times."""

from __future__ import annotations

import numpy as np

from beamsim import load_scenario
from beamsim.analyses.run.outputs import exact_flow
from beamsim.contacts.contacts import Contacts
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.observed import all_outputs


def motion(path: str, **changes: object) -> tuple[Trajectory, object]:
    """A short motion of a config and all of its outputs."""
    system = build_system(load_scenario(path, changes))
    flow = exact_flow(system, 0.05)
    return simulate(flow, system.initial_state), all_outputs(system, flow)


def test_samples_do_not_depend_on_what_is_sampled_with_them():
    """A sine, a pulse that is a polynomial, and a snubber on the ground, which feels the motion of the base."""
    pulse = {"kind": "half_sine", "applied_to": "base", "level": "5 g", "duration": "11 ms"}
    saw = {"kind": "sawtooth", "applied_to": "base", "level": "5 g", "duration": "11 ms"}
    for changes in ({}, {"excitation": pulse}, {"excitation": saw}, {"snubbers.tip.mounted_on": "ground"}):
        whole, outputs = motion("configs/one_sided_65hz.yaml", **changes)
        times = np.linspace(0.0, whole.end, 96)
        many = whole.sample(times, outputs)
        scale = np.abs(many).max(axis=0)
        few = np.concatenate([whole.sample(part, outputs) for part in np.split(times, 8)])
        assert np.all(np.abs(few - many).max(axis=0) <= 1e-11 * scale), changes
        by_table = whole.sample_table(times, whole.flow.output_table(outputs))
        assert np.all(np.abs(by_table - many).max(axis=0) <= 1e-11 * scale), changes
        again = [simulate(whole.flow, whole.y[0], duration=float(t)).final_y for t in times[1::19]]
        states = whole.states_at(times)
        assert np.all(np.abs(again - states[1::19]).max(axis=0) <= 1e-9 * np.abs(states).max(axis=0)), changes


def test_rest_on_an_unstable_equilibrium_is_sampled_as_rest():
    """Its motions grow by more than a floating-point number holds, of an amplitude of zero: even and uneven times."""
    contacts = Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([-2500.0]), np.array([[0.1]]), contacts, np.zeros(1))
    rest = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 20.0), np.zeros(2))
    for times in (np.linspace(0.0, 20.0, 4097), np.linspace(0.0, 20.0, 100), np.linspace(0.0, 4.4, 50) ** 2):
        np.testing.assert_array_equal(rest.states_at(times), 0.0)
