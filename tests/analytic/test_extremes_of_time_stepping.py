"""Peaks and contact shares of time-stepped runs are those of the continuous motion, whatever the sample rate."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamsim
from beamsim.analyses.continuation.analysis import continuation
from beamsim.flow.dense_extremes import NODES, polynomials
from beamsim.flow.extrema import Search
from beamsim.scenario import Scenario

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


@cache
def independent(cubic, start=(0.0, 0.0), hz=HZ, duration=DURATION):
    """Peaks and contact by hand-written equations, restarted at contact, with 400 points on each short step."""
    y, t, closed, shared, closings = np.array(start), 0.0, start[0] < -GAP, 0.0, 0
    low, high, force, acceleration = 0.0, 0.0, 0.0, 0.0

    def pull(t, x, v, closed):
        push = closed * (STOP * (-GAP - x) - STOP_DASHPOT * v)
        return push, LEVEL * np.sin(2 * np.pi * hz * t) - SPRING * x - cubic * x**3 - DASHPOT * v + push

    def edge(t, y):
        return y[0] + GAP

    edge.terminal = True
    while t < duration:
        edge.direction = 1.0 if closed else -1.0

        def rate(t, y, closed=closed):
            return [y[1], pull(t, y[0], y[1], closed)[1] / MASS]

        piece = solve_ivp(
            rate, (t, duration), y, method="DOP853", rtol=1e-11, atol=1e-13, events=edge, dense_output=True,
            max_step=2e-2 if not closed else 5e-4,
        )  # fmt: skip
        for a, b in zip(piece.t[:-1], piece.t[1:], strict=True):
            fine = np.linspace(a, b, 400)
            x, v = piece.sol(fine)
            push, total = pull(fine, x, v, closed)
            low, high, force = min(low, x.min()), max(high, x.max()), max(force, push.max())
            acceleration = max(acceleration, np.abs(total).max() / MASS)
        shared += closed * (piece.t[-1] - t)
        y, t = piece.y[:, -1], piece.t[-1]
        if piece.status == 1:
            closed = not closed
            closings += closed
    return low, high, force, acceleration, shared / duration, closings


def test_highest_of_polynomials_is_exact():
    """A polynomial of degree 8 on steps whose peak is between the Chebyshev points, and the twin that shows it."""
    rng = np.random.default_rng(5)
    start, length = np.arange(40.0), np.ones(40)
    nodes = 0.5 * (1 - np.cos(np.pi * np.arange(NODES + 1) / NODES))
    coefficients = rng.normal(size=(40, 9))
    values = np.array([np.polynomial.chebyshev.chebval(2 * nodes - 1, c) for c in coefficients])[:, :, None]
    search = Search.of(1)
    search.add([polynomials(values, start, length)])
    highest = search.extrema()
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
    sweep = {"kind": "continuation", "from": "1.3 Hz", "to": "1.31 Hz", "seek_at": 0}
    result = continuation(case(45.0, run=None, sweep=sweep))
    assert not any("without certificate" in warning for warning in result.warnings)
    branch = result.branches[0]
    point = int(np.argmax(branch.contact_share["stop"] > 0))
    start = tuple(x[point, 0] / np.sqrt(MASS) for x in (branch.coordinates, branch.coordinate_velocities))
    hz = branch.frequency_hz[point]
    low, high, force, acceleration, share, _ = independent(CUBIC, start, hz, 1 / hz)
    assert branch.min_displacement["m"][point] == pytest.approx(low, rel=1e-6)
    assert branch.max_displacement["m"][point] == pytest.approx(high, rel=1e-6)
    assert branch.peak_force["stop"][point] == pytest.approx(force, rel=1e-3)
    assert branch.peak_acceleration["m"][point] == pytest.approx(acceleration, rel=1e-3)
    assert branch.contact_share["stop"][point] == pytest.approx(share, rel=1e-6)


def test_low_passed_acceleration_of_a_time_stepped_run_is_that_of_the_exact_one():
    runs = ({"low_pass": "12 Hz"}, {"low_pass": "12 Hz", "method": "reference", "rtol": 1e-8})
    exact, stepped = (beamsim.run(case(45.0, 0.0, run)) for run in runs)
    a, b = (r.summary["peak_acceleration_g"]["m"] for r in (exact, stepped))
    assert b == pytest.approx(a, rel=1e-5)
