"""Computations that stop early say why by a code with its numbers, and keep what they have."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario

CONFIGS = Path(__file__).parents[2] / "configs"
CHAIN = CONFIGS / "chain_bumpers.yaml"


def test_a_run_with_too_many_events():
    result = beamsim.run(load_scenario(CHAIN, ["run.max_events=3"]))
    assert result.outcome.code == "event_limit"
    assert result.outcome.place.value == pytest.approx(result.time[-1], abs=2.0 / result.scenario.sample_rate)
    assert "more than 3 contact events" in result.status
    assert result.outcome.remedy.startswith("raise run.max_events")
    assert result.summary["status"] == result.status


def test_a_hopeless_motion_is_refused(monkeypatch):
    """A mass of 1e-24 kg has 1e12 periods in a second, and the gap of its closed stop is evaluated in each."""
    monkeypatch.setattr("beamsim.flow.transient.SPENT", 2000)
    stiff = {
        "chain": {"masses": [1e-24], "springs": [100.0]},
        "snubbers": [{"mass": 1, "side": "above", "stiffness": 100.0, "gap": 0.0}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 65.0},
        "run": {"duration": 1.0, "sample_rate": 1000.0},
    }
    with pytest.raises(ScenarioError, match=r"run\.duration = 1 s would take about .* evaluations") as refused:
        beamsim.run(load_scenario(stiff))
    assert refused.value.problems[0].remedy.startswith("check stiffnesses")


def test_a_search_for_extremes_can_be_interrupted(monkeypatch):
    """The motion that was marched when the request came is kept, unless that takes too long."""
    scenario = load_scenario(CHAIN)
    assert beamsim.run(scenario, stop=lambda: True).outcome.interrupted
    monkeypatch.setattr("beamsim.analyses.run.exact_motion.GRACE_S", -1.0)
    with pytest.raises(KeyboardInterrupt):
        beamsim.run(scenario, stop=lambda: True)


def test_an_integrator_that_fails(monkeypatch):
    import scipy.integrate

    real = scipy.integrate.BDF.step

    def failing(self):
        return "the step became too small" if self.t > 0.1 else real(self)

    monkeypatch.setattr(scipy.integrate.BDF, "step", failing)
    result = beamsim.run(load_scenario(CHAIN, ["run.method=reference"]))
    assert result.outcome.code == "integrator_failed"
    assert "the step became too small" in result.status
    assert result.time[-1] == pytest.approx(0.1, rel=0.2)


def test_a_stepped_sweep_that_costs_too_much(monkeypatch):
    from beamsim.orbits.steady import CycleStepper

    def carry(self, motion, cycles, *_, go_on=CycleStepper.carry, **options):
        if self.cycles > 300:
            raise ArithmeticError("too many evaluations")
        return go_on(self, motion, cycles, *_, **options)

    monkeypatch.setattr(CycleStepper, "carry", carry)
    step = "sweep={kind: stepped, from: 78 Hz, to: 84 Hz, points: 4}"
    result = sweep(load_scenario(CONFIGS / "sweep_up_down.yaml", [step]))
    assert result.outcome.code == "no_steady_state"
    (curve,) = result.curves.values()
    assert result.outcome.place.value > curve.frequency_hz[-1]
    assert not next(iter(result.levels.values())).outcome.complete


@pytest.mark.slow
def test_a_fit_with_too_few_evaluations(monkeypatch):
    monkeypatch.setattr("beamsim.analyses.identify.fit.MOST_EVALUATIONS", 1)
    path = CONFIGS / "identify_nonlinear.yaml"
    scenario = load_scenario(path, {"identify_stiffness.nonlinear.starts": 1})
    result = beamsim.identify_stiffness(scenario, beamsim.read_tests(scenario, path.parent))
    assert result.outcome.code == "fit_limit"
    assert not result.complete
    assert np.isfinite([p.value for p in result.nonlinear.parameters]).all()
