"""Stops that unload along another way than they are loaded: areas by hand, and a clipped spring along the same path."""

import numpy as np
import pytest

import beamsim
from beamsim.scenario import Scenario

MASS, THROWN, STIFF = 2.0, -0.6, 2e5
LOADING = np.array([[0.0, 0.0], [2e-3, 100.0], [10e-3, 140.0]])
LOWER = np.array([[0.0, 0.0], [4e-3, 20.0], [10e-3, 140.0]])  # they meet


def forces(curve, x, slope=None):
    """Along a curve, which goes on with its last slope or another one."""
    last = (curve[-1, 1] - curve[-2, 1]) / (curve[-1, 0] - curve[-2, 0]) if slope is None else slope
    return np.interp(x, *curve.T) + last * np.maximum(x - curve[-1, 0], 0.0)


def case(recovers, run, snubber=None, **more):
    unloading = {"stiffness": STIFF} | ({"force_deflection": LOWER.tolist()} if recovers else {})
    stop = {"name": "foam", "mass": 1, "side": "below", "force_deflection": LOADING.tolist(), "unloading": unloading}
    chain = {"masses": [MASS], "springs": [0.0], "snubbers": [{**stop, **(snubber or {})}]}
    run = {"sample_rate": 1e5, "convergence": "off", **run}
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run} | more)


def area(curve, to):
    x = np.union1d(np.linspace(0, to, 2001), curve[curve[:, 0] < to, 0])
    return np.trapezoid(forces(curve, x), x)


@pytest.mark.parametrize("recovers", [False, True])
def test_one_impact_by_hand(recovers):
    """A mass that is thrown at a stop is turned where the area under the curve is its energy, and leaves with what is
    below the way back."""
    thrown = {"displacement": [1e-3], "velocity": [THROWN]}
    result = beamsim.run(case(recovers, {"duration": 0.06, "start": thrown, "impacts": {}}))
    energy = 0.5 * MASS * THROWN**2
    first = area(LOADING[:2], 2e-3)
    slope = 5000.0  # beyond 2 mm: 100 N x + slope x^2 / 2 = energy - first
    deepest = 2e-3 + (np.sqrt(100.0**2 + 2 * slope * (energy - first)) - 100.0) / slope
    peak = 100.0 + slope * (deepest - 2e-3)
    if recovers:  # down the line of the slope k + N_l' to the lower curve, on which it leaves it
        low = 20.0 + 20e3 * (deepest - 4e-3)
        meets = deepest - (peak - low) / STIFF
        assert meets > 4e-3
        low = 20.0 + 20e3 * (meets - 4e-3)
        returned = 0.5 * (peak + low) * (deepest - meets) + 0.5 * 4e-3 * 20.0 + 0.5 * (20.0 + low) * (meets - 4e-3)
    else:
        returned = 0.5 * peak**2 / STIFF
        assert result.summary["residual_crush_m"]["foam"] == pytest.approx(deepest - peak / STIFF, rel=1e-9)
    assert result.summary["peak_force_n"]["foam"] == pytest.approx(peak, rel=1e-9)
    velocity = result["histories"]["velocity"].sel(probe="m").values[-1]
    assert velocity == pytest.approx(np.sqrt(2 * returned / MASS), rel=1e-9)
    assert result.summary["impacts"]["foam"]["mean_energy_lost_j"] == pytest.approx(energy - returned, rel=1e-9)
    assert abs(result.summary["energy_error"]) < 1e-12
    assert ("residual_crush_m" in result.summary) == (not recovers)


@pytest.mark.parametrize(("method", "duration"), [("exact", 0.4), ("reference", 0.06)])
@pytest.mark.parametrize("recovers", [False, True])
def test_inner_loops_are_those_of_a_clipped_spring(recovers, method, duration):
    """Under noise the force is that of a spring between the curves, moved along the same path a sample at a time."""
    psd = [{"frequency": f, "density": 1.0} for f in (5.0, 60.0)]
    result = beamsim.run(case(
        recovers, {"duration": duration, "method": method}, {"gap": -2e-3}, gravity="2 g",
        excitation={"kind": "random", "applied_to": {"mass": 1}, "psd": psd, "seed": 3, "period": 2.0},
    ))  # fmt: skip
    x = result["histories"]["snubber_penetration"].sel(snubber="foam").values
    low = forces(LOWER, x, 5000.0) if recovers else 0.0 * x
    width = forces(LOADING, x) - low
    slip = x[0] - width[0] / STIFF  # the slider, loaded once
    expected = np.empty_like(x)
    for i, at in enumerate(x):
        if recovers or at > slip:
            slip = min(max(slip, at - width[i] / STIFF), at if recovers else np.inf)
        expected[i] = low[i] + STIFF * max(at - slip, 0.0) if at > 0 else 0.0
    turns = np.count_nonzero(np.diff(np.sign(np.diff(x))))
    assert turns > 20 * duration
    np.testing.assert_allclose(
        result["histories"]["snubber_force"].sel(snubber="foam").values, expected, rtol=0, atol=2e-4 * expected.max()
    )
    inside = (expected > low + 0.05 * width) & (expected < low + 0.95 * width) & (x > 0)
    assert np.count_nonzero(inside) > 300  # twin: it is between the curves, too
    assert abs(result.summary["energy_error"]) < (1e-12 if method == "exact" else 1e-6)


def test_a_preload_is_reached_by_loading_once_and_is_elastic_then():
    result = beamsim.run(case(
        False, {"duration": 0.1}, {"preload": 120.0}, gravity=[0, 0, -120.0 / MASS],
        excitation={"kind": "step", "applied_to": {"mass": 1}, "level": -1e-3},
    ))  # fmt: skip
    x = result["histories"]["displacement"].sel(probe="m").values
    w = np.sqrt(STIFF / MASS)
    assert result["histories"]["snubber_force"].sel(snubber="foam").values[0] == pytest.approx(120.0, rel=1e-9)
    # pressed further it yields at once; the first half period ends where the softer curve turns it
    soft = np.sqrt(5000.0 / MASS)
    assert x.min() - x[0] == pytest.approx(-2e-3 / 5000.0, rel=1e-6)
    turned = np.pi / soft
    after = result["histories"]["time"].values > turned
    amplitude = np.ptp(x[after])
    assert amplitude == pytest.approx(2e-3 / STIFF, rel=1e-3)  # then it swings on the stiff line, by w
    crossings = np.flatnonzero(np.diff(np.sign(x[after] - x[after].min() - 0.5 * amplitude)))
    assert np.mean(np.diff(result["histories"]["time"].values[after][crossings])) == pytest.approx(np.pi / w, rel=1e-2)


LAWS = {
    "recovering": {
        "force_deflection": LOADING.tolist(),
        "unloading": {"stiffness": STIFF, "force_deflection": LOWER.tolist()},
    },
    "hardening": {
        "stiffness": 5e4, "hardening": {"yield_force": 20.0, "stiffness": 4e3},
        "damping": {"kind": "viscous", "coefficient": 3.0},
    },
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
def test_a_sweep_loses_what_a_run_does(law):
    """Energy lost in the impacts of a cycle that has become periodic; of a stop that yields it was that of its dashpot
    alone."""
    stops = [{"name": side, "mass": 1, "side": side, "gap": 5e-3, **LAWS[law]} for side in ("below", "above")]
    given = {
        "chain": {"masses": [MASS], "springs": [2000.0], "dashpots": [4.0], "snubbers": stops},
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 60.0, "frequency": 6.0},
        "probes": [{"name": "m", "mass": 1}],
    }
    run = {"duration": 60 / 6.0, "from": 50 / 6.0, "impacts": {}, "convergence": "off", "start": "rest"}
    impacts = beamsim.run(Scenario.model_validate({**given, "run": run})).summary["impacts"]
    sweep = {"kind": "stepped", "from": 6.0, "to": 6.05, "points": 2, "impacts": True}
    (curve,) = beamsim.sweep(Scenario.model_validate({**given, "sweep": sweep})).curves.values()
    lost = sum(curve["impact_energy_lost"].sel(snubber=side).values[0] for side in ("below", "above"))
    assert lost == pytest.approx(sum(impacts[side]["energy_lost_j"] for side in ("below", "above")) / 10, rel=1e-6)
    assert lost > 1e-3


def test_events_that_begin_at_round_off_do_not_end_the_time_stepping():
    """A guard that is zero to round-off where a step begins had another sign when it was computed again."""
    stops = [
        {"name": "first", "mass": 1, "side": "below", "gap": 2.2e-3, "unloading": {"stiffness": 61.1e3},
         "force_deflection": [[0, 0], [2.19e-3, 2.76], [4.51e-3, 17.8], [4.93e-3, 31.9]],
         "damping": {"kind": "viscous", "coefficient": 7.14}},
        {"name": "second", "mass": 2, "side": "below", "gap": 1.38e-3, "unloading": {"stiffness": 81.4e3},
         "force_deflection": [[0, 0], [1.45e-3, 12.5], [1.95e-3, 24.1], [3.68e-3, 25.6]]},
    ]  # fmt: skip
    chain = {"masses": [0.688, 2.68], "springs": [2640.0, 1540.0], "dashpots": [2.13, 2.62], "snubbers": stops}
    run = {"duration": 0.06, "sample_rate": 1000.0, "start": "rest", "convergence": "off"}
    for level in (25.5, 31.75):
        ends = [
            beamsim.run(Scenario.model_validate({
                "chain": chain, "probes": [{"name": "m", "mass": 2}],
                "excitation": {"kind": "harmonic", "applied_to": "base", "level": level, "frequency": 7.8},
                "run": {**run, "method": method},
            }))["histories"]["displacement"].sel(probe="m").values
            for method in ("exact", "reference")
        ]  # fmt: skip
        np.testing.assert_allclose(*ends, rtol=0, atol=1e-8)
