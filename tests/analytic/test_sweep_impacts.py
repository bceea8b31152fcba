"""Impacts per cycle of swept and stepped sines against the impacts of a run in time."""

import numpy as np
import pytest

import beamsim
from beamsim.analyses.sweep.analysis import sweep as sweep_alone
from beamsim.scenario import Scenario, load_scenario

LAWS = ["kelvin_voigt", "no_tension"]


def case(law, **sections):
    stop = {
        "name": "stop", "mass": 1, "side": "below", "stiffness": 9e4, "gap": 1e-4, "law": law,
        "damping": {"kind": "viscous", "coefficient": 25.0},
    }  # fmt: skip
    chain = {"masses": [1.0], "springs": [1e4], "snubbers": [stop], "damping": {"kind": "modal", "ratio": 0.02}}
    base = {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 20.0}
    return Scenario.model_validate({"chain": chain, "excitation": base, **sections})


@pytest.mark.parametrize("law", LAWS)
def test_a_stepped_sine_against_the_end_of_a_run(law):
    sweep = {"kind": "stepped", "from": 18.0, "to": 22.0, "points": 3, "impacts": True, "steady_to": 1e-10}
    (curve,) = swept(case(law, sweep=sweep))
    run = {"duration": 4.0, "sample_rate": 500.0, "convergence": "off", "impacts": {}}
    impacts = beamsim.run(case(law, run=run))["impacts"]
    cycles, last = 20, impacts["begin"].values > 3.0 - 1e-3
    stop = curve.cycles.sel(snubber="stop")
    k = int(np.argmin(np.abs(curve.frequency_hz - 20.0)))
    assert curve.tables["steady_states"]["period_cycles"].values[k] == 1
    whole = last & (impacts["begin"].values < 4.0 - 1e-3)
    assert stop["impact_number"].values[k] == pytest.approx(whole.sum() / cycles, rel=1e-12)
    assert stop["impact_contact_time"].values[k] == pytest.approx(
        impacts["contact_time"].values[whole].mean(), rel=1e-6
    )
    assert stop["impact_impulse"].values[k] == pytest.approx(impacts["impulse"].values[whole].sum() / cycles, rel=1e-6)
    assert stop["impact_energy_lost"].values[k] == pytest.approx(
        impacts["energy_lost"].values[whole].sum() / cycles, rel=1e-6
    )
    assert stop["impact_penetration_rate"].values[k] == pytest.approx(
        impacts["approach_speed"].values[whole].max(), rel=1e-6
    )


def swept(scenario):
    return sweep_alone(scenario).curves.values()


@pytest.mark.parametrize("law", LAWS)
def test_a_swept_sine_against_the_same_run(law):
    """The sums over all cycles are those of a run with the same swept sine."""
    sweep = {"kind": "swept_sine", "from": 15.0, "to": 25.0, "rate": "30 oct/min", "impacts": True}
    (curve,) = swept(case(law, sweep=sweep))
    end = float(curve.time[-1])
    sine = {"kind": "swept_sine", "applied_to": "base", "level": 5.0, "from": 15.0, "to": 25.0, "rate": "30 oct/min"}
    run = {"duration": end, "sample_rate": 500.0, "convergence": "off", "impacts": {}}
    stop = beamsim.run(case(law, excitation=sine, run=run)).summary["impacts"]["stop"]
    cycles = curve.cycles.sel(snubber="stop")
    before = curve.time < end - 1e-9
    assert cycles["impact_number"].values[before].sum() == stop["number"] > 20
    assert cycles["impact_impulse"].values[before].sum() == pytest.approx(stop["impulse_n_s"], rel=1e-8)
    assert cycles["impact_energy_lost"].values[before].sum() == pytest.approx(stop["energy_lost_j"], rel=1e-8)
    assert cycles["impact_penetration_rate"].values[before].max() == pytest.approx(
        stop["highest_approach_speed_m_s"], rel=1e-6
    )


def rubbing(stiffness, **sections):
    chain = {"masses": [1.0], "springs": [1e4], "damping": {"kind": "modal", "ratio": 0.02}}
    pad = {"name": "pad", "at": {"mass": 1}, "normal_force": 10.0, "stiffness": stiffness,
           "coefficient": {"static": 0.3, "sliding": 0.2}}  # fmt: skip
    base = {"kind": "harmonic", "applied_to": "base", "level": 5.0, "frequency": 20.0}
    return load_scenario({"chain": chain, "friction": [pad], "excitation": base, **sections})


@pytest.mark.parametrize("stiffness", [None, 4e4])
def test_sliding_per_cycle_of_a_stepped_sine_against_the_end_of_a_run(stiffness):
    sweep = {"kind": "stepped", "from": 18.0, "to": 22.0, "points": 3, "impacts": True, "steady_to": 1e-10}
    (curve,) = swept(rubbing(stiffness, sweep=sweep))
    k = int(np.argmin(np.abs(curve.frequency_hz - 20.0)))
    pads = []
    for duration in (3.0, 4.0):
        run = {"duration": duration, "sample_rate": 500.0, "convergence": "off"}
        pads.append(beamsim.run(rubbing(stiffness, run=run))["histories"].sel(friction="pad"))
    sliding, cycles = curve.cycles.sel(friction="pad"), 20

    def per_cycle(name):
        return (pads[1][f"friction_{name}"].item() - pads[0][f"friction_{name}"].item()) / cycles

    assert "impact_number" not in curve.cycles
    assert sliding["friction_slides"].values[k] == pytest.approx(2.0) == per_cycle("slides")
    assert sliding["friction_distance"].values[k] == pytest.approx(per_cycle("sliding_distance"), rel=1e-6)
    assert sliding["friction_energy_lost"].values[k] == pytest.approx(per_cycle("dissipated_energy"), rel=1e-6)
    assert sliding["friction_wear_power"].values[k] == pytest.approx(
        10.0 * per_cycle("sliding_distance") * 20.0, rel=1e-6
    )


def test_sliding_per_cycle_of_a_swept_sine_adds_up_to_that_of_a_run():
    sine = {"kind": "swept_sine", "from": 15.0, "to": 25.0, "rate": "30 oct/min"}
    (curve,) = swept(rubbing(4e4, sweep={**sine, "impacts": True}))
    end = float(curve.time[-1])
    of_run = {**sine, "applied_to": "base", "level": 5.0}
    run = {"duration": end, "sample_rate": 500.0, "convergence": "off"}
    pad = beamsim.run(rubbing(4e4, excitation=of_run, run=run))
    before, cycles = curve.time < end - 1e-9, curve.cycles.sel(friction="pad")
    assert pad["histories"]["friction_slides"].sel(friction="pad").item() > 50
    assert cycles["friction_slides"].values[before].sum() == pytest.approx(
        pad["histories"]["friction_slides"].sel(friction="pad").item(), abs=1.0
    )
    assert cycles["friction_distance"].values[before].sum() == pytest.approx(
        pad["histories"]["friction_sliding_distance"].sel(friction="pad").item(), rel=1e-2
    )
    assert cycles["friction_energy_lost"].values[before].sum() == pytest.approx(
        pad["histories"]["friction_dissipated_energy"].sel(friction="pad").item(), rel=1e-2
    )
