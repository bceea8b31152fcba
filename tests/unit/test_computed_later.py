"""A run computes its summary; curves and histories follow when they are read or written."""

import json
import pickle
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run import energy, histories
from beamsim.analyses.run.outputs import exact_flow
from beamsim.cli.report import table_rows
from beamsim.fields import RowBlocks, _Later, attribute, changed, dataset, declared, later
from beamsim.flow.channels import Observed, outputs_of
from beamsim.flow.trajectory import Trajectory
from beamsim.flow.transient import simulate
from beamsim.scenario import load_scenario
from beamsim.store.results import open_run, write_result
from beamsim.system.build import build_system
from beamsim.typing import Floats

CONFIGS = Path(__file__).parents[2] / "configs"

ARRAYS = ("displacement", "absolute_displacement", "velocity", "absolute_acceleration")


@declared
class Curve:
    name: str = attribute("", "name")
    values: Floats = dataset("m", "values", along=("n",))
    more: Floats | None = dataset("m", "more", along=("n",), default=None)
    size: float | None = attribute("m", "size", default=None)


@dataclass
class Computations:
    count: int = 0

    def __call__(self) -> Floats:
        self.count += 1
        return np.arange(3.0)


def is_computed(owner, name):
    value = vars(owner)[name]
    return not isinstance(value, (_Later, RowBlocks)) or "value" in vars(value)


def test_a_field_is_computed_once_for_all_copies():
    compute = Computations()
    first = Curve("a", later(compute))
    second = changed(first, name="b")
    assert compute.count == 0
    assert not is_computed(first, "values")
    assert (second.name, second.more, second.size) == ("b", None, None)
    np.testing.assert_array_equal(second.values, np.arange(3.0))
    assert is_computed(first, "values")
    assert first.values is second.values
    assert compute.count == 1
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(Curve("a", later(compute)))).values, np.arange(3.0))
    with pytest.raises(AttributeError):
        first.values = np.zeros(3)


@pytest.fixture
def calls(monkeypatch):
    """How often searches for extremes were begun, and energies sampled."""
    counted = Counter()

    def counting(owner, name):
        function = getattr(owner, name)

        def call(*arguments, **keywords):
            counted[name] += 1
            return function(*arguments, **keywords)

        monkeypatch.setattr(owner, name, call)

    counting(Trajectory, "extrema")
    counting(histories, "energies")
    counting(energy, "energy_history")
    return counted


def test_a_summary_costs_one_search_a_model_and_no_history(calls, tmp_path):
    scenario = load_scenario(CONFIGS / "one_sided_65hz.yaml", ["run.duration=0.4 s"])
    result = beamsim.run(scenario)
    assert calls == {"extrema": 2}  # of this model and of the finer one
    json.dumps(result.summary)
    list(table_rows("run", result))
    tip, snubber = result.probes["tip"], result.snubbers["tip"]
    assert not any(is_computed(tip, name) for name in ARRAYS)
    assert not any(is_computed(snubber, name) for name in ("force", "penetration", "closed"))
    assert not is_computed(result.energy, "work_in")
    curves = result.spectra.values()
    assert not any(is_computed(s, name) for s in curves for name in ("amplitude", "amplitude_db"))
    write_result(result, tmp_path / "run.h5")
    written = {"extrema": 2, "energies": 1}
    assert calls == written
    assert is_computed(tip, "displacement")
    stored = open_run(tmp_path / "run.h5")
    np.testing.assert_array_equal(stored.probes["tip"].absolute_acceleration, tip.absolute_acceleration)
    assert calls == written


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
