"""Values of runs are those of their histories, and of each channel alone."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.outputs import exact_flow
from beamsim.flow.channels import Observed, outputs_of
from beamsim.flow.transient import simulate
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

CONFIGS = Path(__file__).parents[2] / "configs"


def test_extremes_that_are_searched_for_together_are_those_of_each_alone():
    """Stresses of many stations, and all else."""
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml")
    system = build_system(scenario)
    flow = exact_flow(system, 0.4)
    motion = simulate(flow, system.initial_state)
    together = Observed(flow, system.channels).extrema(motion)
    assert together.low.size > 40
    rows = system.channels.linear
    for k, (low, high) in enumerate(zip(together.low, together.high, strict=True)):
        alone = motion.extrema(outputs_of(flow, rows.some(np.array([k]))))
        np.testing.assert_allclose([low, high], [alone.low[0], alone.high[0]], atol=1e-9 * max(abs(low), abs(high)))


def test_figures_are_those_of_the_histories():
    result = beamsim.run(load_scenario(CONFIGS / "one_sided_65hz.yaml"))
    tip, summary = result.probes["tip"], result.summary
    assert summary["max_displacement_m"]["tip"] >= tip.displacement.max()
    assert summary["max_displacement_m"]["tip"] == pytest.approx(tip.displacement.max(), rel=1e-3)
    stress = result.bodies["beam"].peak_bending_stress
    assert summary["largest_bending_stress_pa"] == pytest.approx(stress.max(), rel=1e-9)
    assert result.bodies["beam"].position[stress.argmax()] == summary["largest_bending_stress_position_m"]
    energies = result.energy
    imbalance = energies.work_in - energies.dissipated - (energies.stored - energies.stored[0])
    assert np.abs(imbalance).max() < 1e-9 * energies.stored.max()
    assert summary["energy_error"] < 1e-9
