"""The shipped cases against DOP853 restarted at every event, rtol 1e-12, to 1e-9 of the peak."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.analysis import exact_flow
from beamsim.flow.reference import integrate
from beamsim.flow.transient import simulate
from beamsim.system.build import build_system

CONFIGS = Path(__file__).parents[2] / "configs"
TWO_SNUBBERS = [
    {"name": "below", "position": "200 mm", "side": "below", "stiffness": 2e4, "gap": "0.05 mm",
     "damping": {"kind": "ratio", "ratio": 0.02}, "mounted_on": "ground"},
    {"name": "above", "position": "270 mm", "side": "above", "stiffness": 5e4, "gap": "-0.02 mm",
     "damping": {"kind": "viscous", "coefficient": 5.0}, "law": "no_tension"},
]  # fmt: skip
CASES = {
    "one-sided": ("one_sided_65hz", {"reduction.modes": 4}, 0.05),
    "prestressed": ("prestressed_90hz_3g", {"reduction.modes": 4}, 0.03),
    "backlash": ("backlash_65hz_3g", {"reduction.modes": 4}, 0.05),
    "two snubbers": ("one_sided_65hz", {"reduction.modes": 3, "snubbers": TWO_SNUBBERS}, 0.03),
    "rigid body": ("released_panel", {"reduction.modes": 4}, 0.05),
    "chain": ("chain_two_dof", {"excitation.level": 0.5}, 60.0),
}


@pytest.mark.parametrize("case", CASES)
def test_transient(case):
    name, overrides, duration = CASES[case]
    scenario = beamsim.load_scenario(
        CONFIGS / f"{name}.yaml", {**overrides, "run.start": "rest"} if case == "chain" else overrides
    )
    system = build_system(scenario)
    flow = exact_flow(system, duration)
    trajectory = simulate(flow, system.initial_state)
    times = np.linspace(0.0, duration, 301)
    reference = integrate(
        flow, system.initial_state, times, integrator="DOP853", rtol=1e-12, atol=1e-16, max_step=duration / 100
    )
    n = flow.system.size
    shape = np.array([p.shape for p in system.probes])
    exact = trajectory.states_at(times)
    assert trajectory.event_time.size > 0
    np.testing.assert_array_equal(trajectory.event_closing, reference.event_closing)
    for part in (slice(0, n), slice(n, 2 * n)):
        found, expected = exact[:, part] @ shape.T, reference.y[:, part] @ shape.T
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_reference_method_of_a_run_agrees_with_the_exact_one():
    """`run.method: reference`, the thesis's BDF at a moderate tolerance: same motion to that tolerance, not better."""
    overrides = {"reduction.modes": 2, "run.duration": 0.05, "run.spectrum": None}
    path = CONFIGS / "one_sided_65hz.yaml"
    exact = beamsim.run(beamsim.load_scenario(path, overrides))
    stepped = beamsim.run(beamsim.load_scenario(path, {**overrides, "run.method": "reference", "run.rtol": 1e-7}))
    assert stepped.method.startswith("reference (BDF")
    difference = stepped.probes["tip"].displacement - exact.probes["tip"].displacement
    peak = exact.summary["peak_displacement_m"]["tip"]
    assert 1e-12 * peak < np.abs(difference).max() < 1e-3 * peak
    assert stepped.summary["events"] == exact.summary["events"]
    assert stepped.summary["energy_error"] < 1e-3
    assert stepped.summary["peak_force_n"]["tip"] == pytest.approx(exact.summary["peak_force_n"]["tip"], rel=1e-2)
