"""Advice fits the case: nothing that the file has already or cannot have, and by name the value that is doubted."""

import re
from dataclasses import replace
from itertools import product

import pytest

from beamsim.scenario import load_scenario
from beamsim.trust.convergence import Convergence, DivergenceTimes, with_convergence

pytestmark = pytest.mark.quick

TIP = {"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": "0.1 mm"}
REDUCTIONS = {"none": None, "modes": {"modes": 8}, "highest": {"highest_frequency": "2 kHz"}, "all": {"modes": "all"}}


def case(*, low_pass=None, dashpot=False, mass=False, reduction=None, excitation="harmonic", **run):
    beam = {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25}
    masses = {"point_masses": [{"position": "100 %", "mass": "20 g"}]} if mass else {}
    damping = {"damping": {"kind": "ratio", "ratio": "5 %"}} if dashpot else {}
    shaken = {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "60 Hz"}
    pulse = {"kind": "half_sine", "applied_to": "base", "level": "20 g", "duration": "11 ms"}
    return load_scenario(
        {
            "beam": beam | masses,
            "snubbers": [TIP | damping],
            "excitation": shaken if excitation == "harmonic" else pulse,
            "run": {"duration": 1.0, **({"low_pass": low_pass} if low_pass else {}), **run},
            **({"reduction": reduction} if reduction else {}),
        }
    )


def doubted(fabricated_run, scenario, *keys, **more):
    """The outcome of a run of 8 modes whose values are off by a tenth, seen with 24."""
    result = replace(fabricated_run(), scenario=scenario)
    changes = {}
    for key in keys:
        entry, _, place = key.partition(".")
        changes.setdefault(entry, {})[place] = 0.1
    return with_convergence(result, Convergence(changes, keys, 24, 8, **more)).outcome


@pytest.mark.parametrize(("low_pass", "dashpot", "mass", "reduction"), [
    *product(("2 kHz", None), (True, False), (True, False), REDUCTIONS)
])  # fmt: skip
def test_an_acceleration_that_does_not_converge(low_pass, dashpot, mass, reduction, fabricated_run):
    """`run.low_pass` was advised with and without it, in sweeps never; a point mass where there is one."""
    scenario = case(low_pass=low_pass, dashpot=dashpot, mass=mass, reduction=REDUCTIONS[reduction])
    outcome = doubted(fabricated_run, scenario, "peak_acceleration_g.tip")
    assert "peak acceleration of tip by 10 %" in outcome.message
    assert ("run.low_pass" in outcome.remedy) == (low_pass is None)
    assert ("point mass at tip" in outcome.remedy) == (dashpot and not mass)
    special = low_pass is None or (dashpot and not mass)
    assert ("for the peak acceleration of tip" in outcome.remedy) == special
    assert ("elements" in outcome.remedy) == (not special)
    assert ("reduction" in outcome.remedy) == (not special and reduction != "all")


@pytest.mark.parametrize("share", [0.2, 0.0, {"up_0": {"tip": 0.1}}, {"up_0": {"tip": 0.0}}], ids=str)
def test_a_stop_that_is_never_met_is_no_reason(share, fabricated_run):
    """Its dashpot does nothing: a load that begins at once was advised to leave it out."""
    result = replace(fabricated_run(), scenario=case(dashpot=True, low_pass="2 kHz"))
    result = result.with_summary(
        **result.summary | {"contact_share": share if isinstance(share, dict) else {"tip": share}}
    )
    doubt = Convergence({"peak_acceleration_g": {"tip": 0.1}}, ("peak_acceleration_g.tip",), 12, 8)
    remedy = with_convergence(result, doubt).outcome.remedy
    assert ("point mass at tip" in remedy) == (str(share) in ("0.2", "{'up_0': {'tip': 0.1}}"))


@pytest.mark.parametrize("reduction", REDUCTIONS)
def test_a_force_that_does_not_converge(reduction, fabricated_run):
    """More modes in the way in which the file says how many, and never "raise reduction.modes" where it has none."""
    outcome = doubted(fabricated_run, case(reduction=REDUCTIONS[reduction]), "peak_force_n.tip")
    advised = {
        "none": "give reduction: {modes: 24} and ", "modes": "raise reduction.modes to 24 and ",
        "highest": "raise reduction.highest_frequency (2000 Hz) and ", "all": "",
    }  # fmt: skip
    assert outcome.remedy == f"{advised[reduction]}raise the number of elements"


def test_both(fabricated_run):
    scenario = case(dashpot=True, reduction={"modes": 8})
    outcome = doubted(fabricated_run, scenario, "peak_acceleration_g.tip", "peak_force_n.tip")
    assert outcome.remedy == (
        "raise reduction.modes to 24 and raise the number of elements; for the peak acceleration of tip give the band "
        "of the accelerometers (run.low_pass: 2 kHz), or give the structure a point mass at tip, or leave out the "
        "dashpot there"
    )


@pytest.mark.parametrize(("excitation", "impacts"), [*product(("harmonic", "half_sine"), ({}, None))], ids=str)
def test_a_sensitive_motion(excitation, impacts, fabricated_run):
    """Means only where the excitation goes on; statistics of impacts only where they are not asked for."""
    scenario = case(excitation=excitation, **({} if impacts is None else {"impacts": impacts}))
    times = DivergenceTimes(0.2, 0.4)
    outcome = doubted(
        fabricated_run, scenario, diverged_s=0.1, after_divergence=("peak_force_n.tip",), sensitivity=times
    )
    assert "peak force depend on what follows" in outcome.message
    assert ("means of a longer run" in outcome.remedy) == (excitation == "harmonic")
    assert ("run.impacts" in outcome.remedy) == (excitation == "harmonic" and impacts is None)
    assert "spread of peaks over several cases (vary)" in outcome.remedy


@pytest.mark.parametrize(("rtol", "method"), [(1e-6, "reference"), (1e-8, "exact")])
def test_a_time_stepped_motion_is_told_the_tolerance_that_it_has(rtol, method, fabricated_run):
    """Of cubic springs it is 1e-10, whatever run.rtol says above that."""
    scenario = case(**({"method": method, "rtol": rtol} if method == "reference" else {}))
    outcome = doubted(fabricated_run, scenario, diverged_s=0.1, after_divergence=("peak_force_n.tip",))
    below = float(re.search(r"lower run\.rtol below (\S+),", outcome.remedy).group(1))
    assert below == (rtol if method == "reference" else 1e-10)


def test_segments_are_told_what_they_lack():
    """Both keys were advised where one was given."""
    plain = {"bending_stiffness": 2.0, "mass_per_length": 0.25}
    full = plain | {"extreme_fibre": "2 mm", "youngs_modulus": "70 GPa"}
    for more, missing in (({"youngs_modulus": "70 GPa"}, "extreme_fibre"), ({}, "extreme_fibre and youngs_modulus")):
        segments = [{"from": 0.0, "to": 0.1, **full}, {"from": 0.1, "to": 0.27, **plain, **more}]
        warnings = load_scenario({"beam": {"length": 0.27, "segments": segments}}).warnings
        (text,) = (text for text in warnings if text.startswith("beam.segments[1] gives no bending stress"))
        assert text.endswith(f"add {missing}")
