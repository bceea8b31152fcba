"""No compiled call takes long: counted in work, whatever the machine. Signals are handled between the calls."""

from itertools import count
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.energy import energy_history
from beamsim.analyses.run.outputs import exact_flow
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.flow import fourier, march_kernels
from beamsim.flow.exact import ExactFlow
from beamsim.flow.march import EVALUATIONS_A_CALL
from beamsim.flow.moments import SegmentOutputs
from beamsim.flow.transient import simulate
from beamsim.outcomes import OutcomeCode
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.observed import accelerations

CONFIGS = Path(__file__).parents[2] / "configs"
STIFF = [
    "snubbers[0].stiffness=1 GN/m", "snubbers[0].damping={kind: ratio, ratio: 20 %}", "run.duration=1 s",
    "run.sample_rate=10 kHz",
]  # fmt: skip


@pytest.fixture
def calls(monkeypatch):
    """What every call of a compiled search returned."""
    returned = {}

    def counting(module, name):
        kernel = getattr(module, name)

        def called(*arguments):
            value = kernel(*arguments)
            returned.setdefault(name, []).append(value)
            return value

        monkeypatch.setattr(module, name, called)

    counting(march_kernels, "march")
    return returned


def test_energies_of_a_panel_thrown_on_a_stiff_damped_stop():
    """Decays of 1e-8 s in a second of motion: panels as short as these would be 1e7 a contact-free segment."""
    system = build_system(load_scenario(CONFIGS / "released_panel.yaml", STIFF))
    motion = simulate(exact_flow(system, 1.0), system.initial_state)
    assert max(np.abs(s.exponent).max() for s in motion.flow.states) > 9e7
    assert any(s.power.any() for s in motion.flow.states)  # the rigid rotation
    times = np.linspace(0.0, 1.0, 10_001)
    balance = energy_history(motion, times)
    assert balance.error < 1e-9
    coarse = energy_history(motion, times[::2500])  # closed form over many turns of the fastest mode
    np.testing.assert_allclose(coarse.history.dissipated, balance.history.dissipated[::2500], rtol=1e-9)


def test_a_search_that_takes_long_goes_on_in_pieces(calls):
    """A slow rigid body, with a fast mode that the guard looks through: one segment of many evaluations."""
    fast = 3e5
    contacts = Contacts(np.array([[1.0, 1.0]]), np.ones(1), np.ones(1), np.zeros(1, dtype=bool), (kelvin_voigt(10.0),))
    system = PiecewiseLinearSystem(np.array([1e-2, fast**2]), np.zeros((2, 2)), contacts, np.zeros(2))
    start = np.array([-0.999, 0.0, 0.0, 0.00099 * fast])
    whole = simulate(ExactFlow(system, Forcing(np.zeros((0, 2)), ()), 2.0), start)
    assert whole.outcome.complete
    assert whole.evaluations > 3 * EVALUATIONS_A_CALL
    used = [call[-1] for call in calls["march"]]
    assert len(used) > 3
    assert max(used) <= 2 * EVALUATIONS_A_CALL + 10
    asked = count()
    part = simulate(ExactFlow(system, Forcing(np.zeros((0, 2)), ()), 2.0), start, stop=lambda: next(asked) >= 2)
    assert part.outcome.code is OutcomeCode.INTERRUPTED
    assert 0.0 < part.end < 2.0
    at = np.linspace(0.0, 0.9 * part.end, 7)
    np.testing.assert_array_equal(part.states_at(at), whole.states_at(at))


def test_fourier_integrals_in_pieces_are_those_in_one(monkeypatch):
    system = build_system(load_scenario(CONFIGS / "one_sided_65hz.yaml"))
    motion = simulate(exact_flow(system, 0.8), system.initial_state)
    acceleration = accelerations(system, motion.flow)
    one, other = (fourier.MotionPart.of(motion, acceleration, 0.05, 0.2, np.inf) for _ in range(2))
    omega = 2 * np.pi * np.linspace(0.0, 2000.0, 700)
    whole = one.integrals(omega, 0)
    calls, summed = [], SegmentOutputs.fourier_sums
    monkeypatch.setattr(fourier, "EXPONENTIALS_AT_ONCE", 3000)
    monkeypatch.setattr(SegmentOutputs, "fourier_sums", lambda *a: calls.append(a[2].size) or summed(*a))
    pieces = other.integrals(omega, 0)
    assert max(calls) < 150
    np.testing.assert_allclose(pieces, whole, rtol=1e-12, atol=1e-13 * np.abs(whole).max())


def test_a_stopped_run_keeps_its_motion():
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml")
    whole = beamsim.run(scenario)
    part = beamsim.run(scenario, stop=lambda: True)  # after the first piece of the march
    assert part.outcome.code is OutcomeCode.INTERRUPTED
    assert 0.0 < part.time[-1] < whole.time[-1]
    assert part.summary["energy_error"] < 1e-9
    longer = whole.probes["tip"].displacement
    np.testing.assert_allclose(part.probes["tip"].displacement, longer[: part.time.size], atol=1e-13 * longer.max())
    assert part.summary["min_displacement_m"]["tip"] <= part.probes["tip"].displacement.min()
    stored = whole.energy.stored[: part.time.size]
    np.testing.assert_allclose(part.energy.stored, stored, rtol=1e-9, atol=1e-12 * stored.max())
    assert not part.spectra
    assert "convergence" not in part.summary
    asked = count()
    reference = beamsim.run(load_scenario(CONFIGS / "one_sided_65hz.yaml", ["run.method=reference"]),
                            stop=lambda: next(asked) >= 300)  # fmt: skip
    assert reference.outcome.code is OutcomeCode.INTERRUPTED
    assert 0.0 < reference.time[-1] <= reference.outcome.numbers["parameter"] < 0.8
