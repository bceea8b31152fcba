"""The first change of contact of random chains: on the linear steady motion just below its level nothing changes, just
above it the contact that was named does."""

import numpy as np
import pytest

from beamsim.analyses.sweep.analysis import sweep_system
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.responses.gapping import contact_levels, static_penetration, transfer
from beamsim.scenario import load_scenario
from beamsim.system.equations import Forcing


def random_chain(rng):
    """One to three masses with stops, some with tables or dashpots, and perhaps a spring with breakpoints."""
    masses = int(rng.integers(1, 4))
    stops = []
    for k in range(int(rng.integers(1, 4))):
        gap = float(rng.choice([-1, 1]) * rng.uniform(0.1, 3)) * 1e-3
        stop = {"name": f"s{k}", "mass": int(rng.integers(1, masses + 1)), "gap": gap,
                "side": str(rng.choice(["above", "below"]))}  # fmt: skip
        if rng.random() < 0.35:
            points = np.cumsum([rng.uniform(0.3, 3, 3) * 1e-3, rng.uniform(0.1, 2, 3)], axis=1)
            stop["force_deflection"] = [[0, 0], *points.T.tolist()]
        else:
            stop["stiffness"] = float(rng.uniform(100, 2000))
        if rng.random() < 0.5:
            stop["damping"] = {"kind": "viscous", "coefficient": float(rng.uniform(0, 8))}
        stops.append(stop)
    low, high = (rng.uniform(0.2, 4, 2) * 1e-3).tolist()
    spring = {"name": "spring", "kind": "piecewise_linear", "mass": int(rng.integers(1, masses + 1)),
              "breakpoints": [-low, high], "stiffnesses": rng.uniform(10, 300, 3).tolist()}  # fmt: skip
    return {
        "chain": {"masses": rng.uniform(0.5, 2, masses).tolist(), "springs": rng.uniform(100, 900, masses + 1).tolist(),
                  "dashpots": rng.uniform(0.2, 3, masses + 1).tolist(), "snubbers": stops},
        "springs_to_ground": [spring] if rng.random() < 0.5 else [],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": "1 N",
                       "frequency": float(rng.uniform(0.8, 6))},
        "probes": [{"name": "mass", "mass": 1}],
        "sweep": {"kind": "stepped", "from": 0.5, "to": 4.0},
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(30))
def test_the_contact_that_is_predicted_changes_first_and_at_the_level(seed):
    case = random_chain(np.random.default_rng([20, seed]))
    system, hz = sweep_system(load_scenario(case)), case["excitation"]["frequency"]
    levels = contact_levels(system, np.array([hz]))
    if not levels:  # every stop has a table
        assert all("force_deflection" in stop for stop in case["chain"]["snubbers"])
        return
    first = min(min(of.levels_of_change[0], of.level_of_other[0]) for of in levels.values())
    named = {name for name, of in levels.items() if np.isfinite(of.predicted_levels[0])}
    w, phases = 2 * np.pi * hz, system.dynamics.contacts.resting_phases(static_penetration(system))
    amplitude = transfer(system, np.array([hz]), phases)[0]
    for factor, changes in ((0.9999, False), (1.0001, True)):
        q = factor * first * amplitude
        start = np.concatenate([q.imag + system.static_equilibrium, (1j * w * q).imag])
        signal = Signal.harmonic(factor * first, w)
        flow = ExactFlow(system.dynamics, Forcing(system.forcing.load, (signal,)), 1.5 / hz)
        motion = simulate(flow, start)
        assert (motion.event_time.size > 0) is changes
    changed = system.contact_names[motion.event_contact[0]]
    assert changed in named if named else changed not in levels
