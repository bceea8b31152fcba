"""Peaks and contact shares of time-stepped runs are those of the continuous motion, whatever the sample rate."""

import numpy as np
import pytest
from independent import Stop, Structure, integrate

import beamsim
from beamsim.analyses.continuation.analysis import continuation
from beamsim.flow.extrema import NODES, polynomials, search_extrema
from beamsim.scenario import Scenario
from tests.helpers.branches import peaks_of

MASS, SPRING, CUBIC, DASHPOT = 1.0, 40.0, 300.0, 0.3
STOP, STOP_DASHPOT, GAP = 60_000.0, 5.0, 0.07
LEVEL, HZ, DURATION = 2.0, 1.3, 6.0


def case(rate, cubic=CUBIC, run=(), dashpots=(DASHPOT,), snubber=(), snubbers=None, **rest):
    springs = {"springs_to_ground": [{"mass": 1, "kind": "cubic", "stiffness": cubic}]} if cubic else {}
    stop = {
        "name": "stop", "mass": 1, "side": "below", "stiffness": STOP, "gap": GAP,
        "damping": {"kind": "viscous", "coefficient": STOP_DASHPOT},
    }  # fmt: skip
    stop |= dict(snubber)
    snubbers = [stop] if snubbers is None else snubbers
    chain = {"masses": [MASS], "springs": [SPRING], "dashpots": list(dashpots), "snubbers": snubbers, **springs}
    document = {
        "chain": chain,
        "probes": [{"name": "m", "mass": 1}],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": LEVEL, "frequency": HZ},
    }
    if run is not None:
        whole = {"duration": DURATION, "sample_rate": rate, "start": "rest", "convergence": "off", **dict(run)}
        document["run"] = whole
    return Scenario.model_validate({**document, **rest})


def independent(start, hz):
    """Peaks and contact of one mass over a period, from fine samples of the common independent integration."""
    structure = Structure(*(np.array([[number]]) for number in (MASS, DASHPOT, SPRING)), np.zeros(1))
    stop = Stop(np.ones(1), STOP, STOP_DASHPOT, GAP)
    motion = integrate(
        structure, [stop], lambda t: np.array([LEVEL * np.sin(2 * np.pi * hz * t)]),
        np.array(start), np.linspace(0.0, 1 / hz, 40_001), most_step=2e-3, cubic=(np.ones((1, 1)), np.array([CUBIC])),
    )  # fmt: skip
    x, v = motion.state.T
    push = (x < -GAP) * (STOP * (-GAP - x) - STOP_DASHPOT * v)
    load = LEVEL * np.sin(2 * np.pi * np.linspace(0.0, 1.0, x.size))
    acceleration = (load - SPRING * x - CUBIC * x**3 - DASHPOT * v + push) / MASS
    lengths = np.diff([0.0, *motion.event_time, 1 / hz])
    return x.min(), x.max(), push.max(), np.abs(acceleration).max(), lengths[int(start[0] >= -GAP) :: 2].sum() * hz


def test_highest_of_polynomials_is_exact():
    """A polynomial of degree 8 on steps whose peak is between the Chebyshev points, and the twin that shows it."""
    rng = np.random.default_rng(5)
    start, length = np.arange(40.0), np.ones(40)
    nodes = 0.5 * (1 - np.cos(np.pi * np.arange(NODES + 1) / NODES))
    coefficients = rng.normal(size=(40, 9))
    values = np.array([np.polynomial.chebyshev.chebval(2 * nodes - 1, c) for c in coefficients])[:, :, None]
    highest = search_extrema(polynomials(values, start, length), 1)
    tops = []
    for begin, c in zip(start, coefficients, strict=True):
        roots = np.polynomial.chebyshev.chebroots(np.polynomial.chebyshev.chebder(c))
        inner = roots[(np.abs(roots.imag) < 1e-12) & (np.abs(roots.real) < 1)].real
        at = np.concatenate([inner, [-1.0, 1.0]])
        tops += zip(np.polynomial.chebyshev.chebval(at, c), begin + 0.5 * (1 + at), strict=True)
    top, when = max(tops)
    assert highest.high[0, 0] == pytest.approx(top, rel=1e-13)
    assert highest.when_high[0, 0] == pytest.approx(when, abs=1e-6)
    assert values.max() < top * (1 - 1e-6)


def test_continuation_with_a_cubic_spring_and_a_stop():
    """The peaks of its motions are those of an integration over a period. It has no warning: no contact is missed."""
    sweep = {"kind": "continuation", "from": "1.3 Hz", "to": "1.31 Hz", "seek_at": 0, "side_branches": "none"}
    result = continuation(case(45.0, run=None, sweep=sweep))
    assert not any("without certificate" in warning for warning in result.warnings)
    branch = result.branches[0]
    point = int(np.argmax(branch["contact_share"].sel(snubber="stop").values > 0))
    start = tuple(
        x[point, 0] / np.sqrt(MASS) for x in (branch["coordinates"].values, branch["coordinate_velocities"].values)
    )
    hz = branch["frequency_hz"].values[point]
    low, high, force, acceleration, share = independent(start, hz)
    assert peaks_of(branch, "m", end="min")[point] == pytest.approx(low, rel=1e-6)
    assert peaks_of(branch, "m", end="max")[point] == pytest.approx(high, rel=1e-6)
    assert peaks_of(branch, "stop", "force")[point] == pytest.approx(force, rel=1e-3)
    assert peaks_of(branch, "m", "absolute_acceleration")[point] == pytest.approx(acceleration, rel=1e-3)
    assert branch["contact_share"].sel(snubber="stop").values[point] == pytest.approx(share, rel=1e-6)


def test_low_passed_acceleration_of_a_time_stepped_run_is_that_of_the_exact_one():
    runs = ({"low_pass": "12 Hz"}, {"low_pass": "12 Hz", "method": "reference", "rtol": 1e-8})
    exact, stepped = (beamsim.run(case(45.0, 0.0, run)) for run in runs)
    a, b = (r.summary["peak_acceleration_g"]["m"] for r in (exact, stepped))
    assert b == pytest.approx(a, rel=1e-5)
