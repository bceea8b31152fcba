"""Samples at few times, from the states there, against those from tables of outputs."""

from __future__ import annotations

import numpy as np

from beamsim import load_scenario
from beamsim.analyses.run.outputs import exact_flow, output_groups
from beamsim.contacts.contacts import Contacts
from beamsim.flow import march_kernels, trajectory
from beamsim.flow.exact import ExactFlow
from beamsim.flow.trajectory import FEW_EVEN, FEW_TIMES, Trajectory
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def motion(path: str, **changes: object) -> tuple[Trajectory, object]:
    """A short motion of a config and all of its outputs."""
    system = build_system(load_scenario(path, changes))
    flow = exact_flow(system, 0.05)
    return simulate(flow, system.initial_state), output_groups(system, flow)


def tables(flow: object, monkeypatch: object) -> list[int]:
    """Numbers of outputs of the tables that are made from now on."""
    made: list[int] = []
    original = type(flow).output_table

    def counted(self, output_of):  # type: ignore[no-untyped-def]
        table = original(self, output_of)
        made.append(table.shape[2])
        return table

    monkeypatch.setattr(type(flow), "output_table", counted)  # type: ignore[attr-defined]
    return made


def test_few_samples_are_those_of_tables(monkeypatch):  # type: ignore[no-untyped-def]
    """A sine, a pulse that is a polynomial, and a snubber on the ground, which feels the motion of the base."""
    pulse = {"kind": "half_sine", "applied_to": "base", "level": "5 g", "duration": "11 ms"}
    saw = {"kind": "sawtooth", "applied_to": "base", "level": "5 g", "duration": "11 ms"}
    for changes in ({}, {"excitation": pulse}, {"excitation": saw}, {"snubbers.tip.mounted_on": "ground"}):
        whole, outputs = motion("configs/one_sided_65hz.yaml", **changes)
        made = tables(whole.flow, monkeypatch)
        count = FEW_TIMES * len(whole.flow.states)
        times = np.linspace(0.0, whole.end, 4 * count)
        many = whole.sample(times, outputs)
        assert len(made) == 1, changes
        few = np.concatenate([whole.sample(part, outputs) for part in np.split(times, 8)])
        assert len(made) == 1, changes
        scale = np.abs(many).max(axis=0)
        assert np.all(np.abs(few - many).max(axis=0) <= 1e-11 * scale), changes


def test_even_samples_of_a_short_run_need_no_kernel(monkeypatch):  # type: ignore[no-untyped-def]
    """Up to `MOST_EVEN` of them products of matrices give what the kernel does, which a first run would compile."""
    whole, outputs = motion("configs/one_sided_65hz.yaml")
    kernel, calls = march_kernels.sample_evenly, []
    monkeypatch.setattr(march_kernels, "sample_evenly", lambda *arguments: calls.append(1) or kernel(*arguments))
    # from the first segment, within others, and of so many outputs that the samples of a contact state go together
    for begin, end, copies in ((0.0, whole.end, 1), (0.011, 0.043, 1), (0.011, 0.043, 200)):
        times = np.linspace(begin, end, FEW_EVEN + 1)

        def together(phases, copies=copies):  # type: ignore[no-untyped-def]
            one = outputs(phases)
            return one.some(np.tile(np.arange(one.row.shape[0]), copies))

        inside = (whole.time > begin) & (whole.time < end)
        assert (inside.sum() * together(whole.flow.visited[0]).row.shape[0] > times.size) == (copies > 1)
        products = whole.sample(times, together)
        assert not calls
        with monkeypatch.context() as patch:
            patch.setattr(trajectory, "MOST_EVEN", 0)
            by_kernel = whole.sample(times, together)
        assert calls
        calls.clear()
        assert np.all(np.abs(products - by_kernel).max(axis=0) <= 1e-11 * np.abs(by_kernel).max(axis=0))


def test_rest_on_an_unstable_equilibrium_is_sampled_as_rest():
    """Its motions grow by more than a floating-point number holds, of an amplitude of zero: even and uneven times."""
    contacts = Contacts(np.zeros((0, 1)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool), ())
    system = PiecewiseLinearSystem(np.array([-2500.0]), np.array([[0.1]]), contacts, np.zeros(1))
    rest = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 20.0), np.zeros(2))
    for times in (np.linspace(0.0, 20.0, FEW_EVEN + 1), np.linspace(0.0, 20.0, 100), np.linspace(0.0, 4.4, 50) ** 2):
        np.testing.assert_array_equal(rest.states_at(times), 0.0)
