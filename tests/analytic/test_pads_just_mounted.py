"""Pads and mounts that have not relaxed at the start: creep and relaxation in closed form."""

import numpy as np
import pytest
from scipy.linalg import expm

import beamsim
from beamsim.scenario import Scenario

K, BRANCH, TAU, FAST, MASS, G = 50e3, 30e3, 0.05, 10e3, 2.0, 9.81
MOUNTED = {"stiffness": BRANCH, "relaxation_time": TAU, "start": "just_mounted"}
RELAXED = {"stiffness": FAST, "relaxation_time": 1e-3}
RUN = {"duration": 0.2, "sample_rate": 5000.0}


def run(method="exact", springs=800.0, **case):
    chain = {"masses": [MASS], "springs": [springs], "snubbers": case.pop("snubbers", [])}
    chain |= {"springs_to_ground": case.pop("to_ground")} if "to_ground" in case else {}
    return beamsim.run(Scenario.model_validate({
        "chain": chain, "probes": [{"name": "mass", "mass": 1}], "run": {**RUN, "method": method}, **case,
    }))  # fmt: skip


@pytest.mark.parametrize("table", [False, True])
@pytest.mark.parametrize("damping", [None, {"kind": "viscous", "coefficient": 30.0}])
def test_a_held_pad_relaxes(table, damping):
    """A mass between two equal pads stays where it is: branch forces fall by e in their relaxation times."""
    force = {"force_deflection": [[0, 0], [4e-4, 10.0], [2e-3, 90.0]]} if table else {"stiffness": K}
    pad = {"mass": 1, "gap": -1e-3, "damping": damping, "maxwell": [MOUNTED, RELAXED], **force}
    result = run(snubbers=[{"name": side, "side": side, **pad} for side in ("below", "above")])
    slow = 40.0 if table else K * 1e-3
    for side in ("below", "above"):
        expected = slow + 1e-3 * BRANCH * np.exp(-result["histories"]["time"].values / TAU)
        np.testing.assert_allclose(result["histories"]["snubber_force"].sel(snubber=side).values, expected, rtol=1e-12)
        assert result.summary["peak_force_n"][side] == pytest.approx(slow + 1e-3 * BRANCH, rel=1e-12)
    assert np.abs(result["histories"]["displacement"].sel(probe="mass").values).max() < 1e-15
    assert abs(result.summary["energy_error"]) < 1e-12


def creeping(t, wall):
    """Mass on wall, pad and branches that was put down at once: x from the equilibrium of the fast springs."""
    a = np.zeros((4, 4))  # x, x', p of the slow and of the fast branch
    a[0, 1] = 1.0
    a[1] = [-(wall + K + BRANCH + FAST) / MASS, 0.0, BRANCH / MASS, FAST / MASS]
    a[2, [0, 2]] = 1 / TAU, -1 / TAU
    a[3, [0, 3]] = 1e3, -1e3
    first = -MASS * G / (wall + K + BRANCH)  # the fast branch has relaxed
    rest = -MASS * G / (wall + K)
    start = np.array([first, 0.0, 0.0, first]) - np.array([rest, 0.0, rest, rest])
    return rest + np.array([(expm(a * s) @ start)[0] for s in t])


@pytest.mark.parametrize("method", ["exact", "reference"])
@pytest.mark.parametrize("kind", ["pad", "mount"])
def test_a_weight_creeps(kind, method):
    branches = [MOUNTED, RELAXED]
    if kind == "pad":
        case = {"snubbers": [{"name": "pad", "mass": 1, "side": "below", "stiffness": K, "maxwell": branches}]}
    else:
        case = {"to_ground": [{"name": "mount", "mass": 1, "kind": "linear", "stiffness": K, "maxwell": branches}]}
    result = run(method, gravity="9.81 m/s^2", **case)
    exact = method == "exact"
    expected = creeping(result["histories"]["time"].values, 800.0)
    np.testing.assert_allclose(
        result["histories"]["displacement"].sel(probe="mass").values, expected, rtol=0, atol=1e-15 if exact else 1e-10
    )
    assert result["histories"]["displacement"].sel(probe="mass").values[0] == pytest.approx(
        -MASS * G / (800.0 + K + BRANCH), rel=1e-13
    )


def test_twin_relaxed_pads_do_not_move():
    pad = {"name": "pad", "mass": 1, "side": "below", "stiffness": K, "maxwell": [{**MOUNTED, "start": "relaxed"}]}
    result = run(snubbers=[pad], gravity="9.81 m/s^2")
    assert np.ptp(result["histories"]["displacement"].sel(probe="mass").values) < 1e-15
