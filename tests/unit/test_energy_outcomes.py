"""A motion whose energy is not in balance, or that is not finite, is not called complete."""

from dataclasses import replace

import numpy as np
import pytest
from shipped import config_path

import beamsim
from beamsim.analyses.sweep.analysis import sweep_system
from beamsim.analyses.sweep.outputs import SweepLevel
from beamsim.analyses.sweep.swept_sine import sweep_level
from beamsim.flow import transient
from beamsim.flow.exact import exact_flow
from beamsim.flow.trajectory import too_many_events
from beamsim.flow.transient import motion_of, simulate
from beamsim.outcomes import COMPLETE, exit_code
from beamsim.responses.energies import LARGEST_ERROR, EnergyBalance, EnergyHistory
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

CASE = config_path("one_sided_65hz")
SHORT = ["run.duration=0.1 s", "run.sample_rate=5 kHz", "run.spectrum.last=0.05 s"]


def tampered(share, since, solver=simulate):
    """A solver, its motion multiplied by 1 + share from a time on."""

    def changed(*arguments, **options):
        motion = solver(*arguments, **options)
        factor = np.where(motion.time >= since, 1 + share, 1.0)[:, None]
        return replace(motion, y=motion.y * factor)

    return changed


@pytest.mark.parametrize(("share", "trusted"), [(0.0, True), (1e-8, True), (1e-4, False)])
def test_lost_energy_is_an_outcome_with_its_time(monkeypatch, share, trusted):
    monkeypatch.setattr(transient, "motion_of", tampered(share, 0.05, motion_of))
    result = beamsim.run(load_scenario(CASE, SHORT))
    assert result.outcome.trusted is result.outcome.complete is trusted
    assert (result.summary["energy_error"] <= LARGEST_ERROR) is trusted
    if not trusted:
        assert result.outcome.code == "energy_not_balanced"
        assert result.outcome.numbers["error"] == result.summary["energy_error"]
        assert 0.05 <= result.outcome.numbers["time"] < 0.06
        assert result["histories"]["time"].values[-1] == pytest.approx(0.1)  # the whole motion is kept
        assert result.status.startswith("not reliable: the energy balance")
        assert exit_code(result.outcome) == 3


def test_a_start_that_is_not_finite_has_an_outcome():
    system = build_system(load_scenario(CASE, SHORT))
    start = system.initial_state.copy()
    start[0] = np.nan
    motion = simulate(exact_flow(system, 0.1), start)
    assert motion.outcome.code == "not_finite"
    assert motion.outcome.place.value == motion.end == 0.0
    assert not motion.outcome.complete


def test_a_motion_that_overflows_is_kept_up_to_there(monkeypatch):
    """The twin without the tampering is complete (above)."""

    def solver(*arguments, **options):
        motion = motion_of(*arguments, **options)
        later = motion.time[:, None] >= 0.05
        return replace(motion, y=np.where(later, np.inf, motion.y), final_y=motion.final_y * np.inf).up_to_finite()

    monkeypatch.setattr(transient, "motion_of", solver)
    result = beamsim.run(load_scenario(CASE, SHORT))
    assert result.outcome.code == "not_finite"
    end = result.outcome.place.value
    assert 0.03 < end < 0.05
    assert result["histories"]["time"].values[-1] <= end
    assert np.all(np.isfinite(result["histories"]["displacement"].sel(probe="tip").values))
    assert exit_code(result.outcome) == 3


@pytest.mark.parametrize("size", [np.inf, np.nan])
def test_energies_beyond_floating_point_are_an_outcome(size):
    times = np.linspace(0.0, 1.0, 11)
    stored = np.where(times < 0.45, 1.0, size)
    with np.errstate(invalid="ignore"):
        lost = EnergyBalance()
        lost.add(times, EnergyHistory(0 * times, 0 * times, stored), 0.0)
    assert lost.check(COMPLETE).code == "not_finite"
    limit, balance = too_many_events(1.0, 7), EnergyBalance()
    balance.add(times, EnergyHistory(0 * times, 0 * times, times), 0.0)
    kept = balance.check(limit)
    assert (kept.code, kept.sub_outcomes) == ("energy_not_balanced", (limit,))


def test_a_sweep_that_is_not_finite_has_an_outcome():
    scenario = load_scenario(
        config_path("sweep_up_down"), ["sweep.from=60 Hz", "sweep.to=70 Hz", "sweep.rate=20 oct/min"]
    )
    system = sweep_system(scenario)
    whole = sweep_level(SweepLevel(system, scenario.sweep, 1.0, 0))
    assert whole.level["outcome"].values.tolist() == ["complete"]
    lost = replace(system, initial_state=np.nan * system.initial_state)
    record = sweep_level(SweepLevel(lost, scenario.sweep, 1.0, 0))
    assert record.level["outcome"].values.tolist() == ["not_finite"]
    assert record.curves == ()


@pytest.mark.parametrize(("share", "trusted"), [(0.0, True), (1e-8, True), (1e-4, False)])
def test_a_case_of_a_study_whose_energy_is_lost_is_not_reliable(monkeypatch, share, trusted):
    monkeypatch.setattr(transient, "motion_of", tampered(share, 0.05, motion_of))
    result = beamsim.ensemble(load_scenario(CASE, SHORT), {"snubbers.tip.gap": [0.0]}, ["contacts"], workers=1)
    assert result.complete is trusted
    assert not any(result["cases"]["failure"].values)  # its values are kept, as those of the run are
    alone = beamsim.run(load_scenario(CASE, SHORT)).outcome
    assert (alone.code == "energy_not_balanced") is not trusted
    assert result["cases"]["outcome"].values.tolist() == [alone.text]
    assert exit_code(result.outcome) == exit_code(alone)
