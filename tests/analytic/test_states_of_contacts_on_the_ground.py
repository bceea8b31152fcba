"""A motion begins with the contacts' own states at rest where the base is then, not where its displacement is zero."""

import numpy as np
import pytest

import beamsim

BASE = {"kind": "harmonic", "applied_to": "base", "level": 2.0, "frequency": 3.0, "phase": -0.9}  # m/s^2, from rest
SHIFT = -2.0 / (6 * np.pi) ** 2 * np.sin(-0.9)  # m, of the base at t = 0


def first(case):
    chain = {"masses": [2.0], "springs": [900.0]}
    run = {"duration": 0.1, "sample_rate": 1000.0, "start": "rest", "convergence": "off"}
    case = {"chain": chain, "excitation": BASE, "probes": [{"name": "mass", "mass": 1}], "run": run, **case}
    return beamsim.run(beamsim.Scenario.model_validate(case))


def test_friction_begins_without_a_force():
    pad = {"name": "pad", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 50.0, "coefficient": 0.5,
           "stiffness": 4000.0}  # fmt: skip
    result = first({"friction": [pad]})
    force, stretch = (
        result["histories"]["friction_force"].sel(friction="pad").values,
        result["histories"]["friction_displacement"].sel(friction="pad").values,
    )
    assert force[0] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(force, 4000.0 * (stretch - stretch[0]), rtol=0, atol=1e-9)
    assert np.abs(force).max() > 1.0


def test_branches_begin_relaxed():
    """The penetration is the base's displacement: the branch adds nothing to the spring's force at first."""
    stop = {"name": "stop", "mass": 1, "side": "above", "mounted_on": "ground", "stiffness": 3000.0, "gap": 0.0,
            "law": "no_tension", "maxwell": [{"stiffness": 6000.0, "relaxation_time": 1.0}]}  # fmt: skip
    chain = {"masses": [2.0], "springs": [900.0], "snubbers": [stop]}
    assert SHIFT > 0.0
    assert first({"chain": chain})["histories"]["snubber_force"].sel(snubber="stop").values[0] == pytest.approx(
        3000.0 * SHIFT, rel=1e-12
    )
