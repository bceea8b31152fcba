"""Friction that falls with speed: a block on a belt in closed form, and two against an integration of its own."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import beamsim
from beamsim.scenario import Scenario

MASS, SPRING, BELT, STATIC, SLIDING, RISE = 2.0, 800.0, 0.1, 30.0, 20.0, 0.05


def block(speed, duration, method="exact"):
    """Held by a spring to the ground, on a belt that takes RISE to reach its speed."""
    friction = {"static": STATIC / 100, "sliding": SLIDING / 100, "stribeck_speed": speed}
    return beamsim.run(Scenario.model_validate({
        "chain": {
            "masses": [MASS], "springs": [0.0],
            "springs_to_ground": [{"mass": 1, "kind": "linear", "stiffness": SPRING}],
        },
        "friction": [{"name": "belt", "at": {"mass": 1}, "normal_force": 100.0, "coefficient": friction}],
        "excitation": {"kind": "step", "applied_to": "base", "level": f"{BELT} m/s", "rise": RISE},
        "probes": [{"name": "block", "mass": 1}],
        "run": {"duration": duration, "sample_rate": 20000.0, "method": method, "convergence": "off"},
    }))  # fmt: skip


def cycle(speed):
    """Largest and smallest displacement of the limit cycle and its period, the slide being slower than ``speed``.

    Sliding from x = STATIC / SPRING with the belt's speed on: m x'' - c x' + k x = STATIC - c BELT.
    """
    c = (STATIC - SLIDING) / speed
    growth, rest = 0.5 * c / MASS, (STATIC - c * BELT) / SPRING
    w = np.sqrt(SPRING / MASS - growth**2)
    a = STATIC / SPRING - rest
    b = (BELT - growth * a) / w
    p, q = growth * a + w * b, growth * b - w * a  # of the velocity

    def x(t):
        return rest + np.exp(growth * t) * (a * np.cos(w * t) + b * np.sin(w * t))

    def v(t):
        return np.exp(growth * t) * (p * np.cos(w * t) + q * np.sin(w * t))

    highest, lowest = (np.arctan2(p, -q) / w + k * np.pi / w for k in (0, 1))
    fastest = lowest - np.pi / w + np.arctan2(w, growth) / w
    assert BELT - v(fastest) < speed  # it does slide in the falling part alone
    end = brentq(lambda t: v(t) - BELT, lowest, lowest + 0.5 * np.pi / w)
    dissipated = quad(lambda t: (STATIC - c * (BELT - v(t))) * (BELT - v(t)), 0, end, epsabs=1e-13)[0]
    return x(highest), x(lowest), end + (STATIC / SPRING - x(end)) / BELT, dissipated


def test_a_limit_cycle_by_hand():
    high, low, period, dissipated = cycle(3.0)
    begin = (STATIC / SPRING) / BELT + 0.5 * RISE  # of the first slide: the belt has moved by STATIC / SPRING
    result = block(3.0, begin + 3 * period)
    later = result["histories"]["time"].values > begin
    x = result["histories"]["absolute_displacement"].sel(probe="block").values
    assert x[later].max() == pytest.approx(high, rel=1e-6)
    assert x[later].min() == pytest.approx(low, abs=1e-6 * high)
    assert x[-1] == pytest.approx(
        STATIC / SPRING - BELT * (begin + 3 * period - result["histories"]["time"].values[-1]), rel=1e-9
    )
    assert result["histories"]["friction_slides"].sel(friction="belt").item() == 3
    assert result["histories"]["friction_dissipated_energy"].sel(friction="belt").item() == pytest.approx(
        3 * dissipated, rel=1e-9
    )
    loss = (
        result["histories"]["friction_dissipated_power"].sel(friction="belt").item()
        / result["histories"]["friction_dissipated_energy"].sel(friction="belt").item()
    )
    assert result["histories"]["friction_wear_power"].sel(friction="belt").item() == pytest.approx(
        100 * result["histories"]["friction_sliding_distance"].sel(friction="belt").item() * loss, rel=1e-12
    )
    assert abs(result.summary["energy_error"]) < 1e-12


@pytest.mark.parametrize("speed", [1e-4, 1e-7])
def test_a_steep_fall_is_two_coefficients(speed):
    """Sliding under a constant force goes along a circle about SLIDING / k."""
    result = block(speed, 3.0)
    x = result["histories"]["absolute_displacement"].sel(probe="block").values[result["histories"]["time"].values > 0.5]
    radius = np.hypot((STATIC - SLIDING) / SPRING, BELT / np.sqrt(SPRING / MASS))
    assert np.ptp(x) == pytest.approx(2 * radius, rel=25 * speed)
    assert result["histories"]["friction_slides"].sel(friction="belt").item() in (5, 6)
    assert abs(result.summary["energy_error"]) < 1e-12


M, K = np.diag([MASS, 1.0]), np.array([[1400.0, -600.0], [-600.0, 600.0]])
DAMPED, PUSH, HZ, SPEED = 4.0, 25.0, 2.3, 0.2


def by_events(duration, times):
    """Two masses, the first of which rubs on the ground, the second driven; DOP853 from event to event."""
    c = (STATIC - SLIDING) / SPEED

    def pull(t, y):
        loads = np.array([0.0, PUSH * np.sin(2 * np.pi * HZ * t)])
        return loads - K @ y[:2] - DAMPED * np.array([[1.0, -1.0], [-1.0, 1.0]]) @ y[2:4]

    def rhs(t, y, way, fast):
        force, lost = pull(t, y), 0.0
        if way:
            lost = way * SLIDING if fast else way * STATIC - c * y[2]
            force = force - np.array([lost, 0.0])
        else:
            force[0] = 0.0
        return np.concatenate([y[2:4], force / np.diag(M), [lost * y[2]]])

    t, y, way, fast, slides = 0.0, np.zeros(5), 0, False, 0
    out = np.empty((times.size, 5))
    while t < duration:
        watched = [lambda t, y, *_: STATIC - abs(pull(t, y)[0])]
        if way:
            watched = [
                lambda t, y, way, fast: (SPEED - way * y[2]) * (-1 if fast else 1),
                lambda t, y, way, fast: way * y[2] + fast,
            ]
        for each in watched:
            each.terminal, each.direction = True, -1.0
        part = solve_ivp(rhs, (t, duration), y, "DOP853", events=watched, args=(way, fast), rtol=1e-12, atol=1e-13,
                         dense_output=True, max_step=0.01)  # fmt: skip
        inside = (times >= t) & (times <= part.t[-1])
        out[inside] = part.sol(times[inside]).T
        t, y = part.t[-1], part.y[:, -1].copy()
        if part.status == 0:
            break
        if not way:
            way, fast, slides = int(np.sign(pull(t, y)[0])), False, slides + 1
        elif part.t_events[0].size:
            fast = not fast
        else:
            y[2] = 0.0
            stays = abs(pull(t, y)[0]) < STATIC
            way, slides = (0, slides) if stays else (-way, slides + 1)
    return out, slides


@pytest.mark.parametrize(("method", "duration", "within"), [("exact", 3.0, 1e-6), ("reference", 1.0, 1e-5)])
def test_two_masses_against_an_integration_of_their_own(method, duration, within):
    friction = {"static": STATIC / 100, "sliding": SLIDING / 100, "stribeck_speed": SPEED}
    result = beamsim.run(Scenario.model_validate({
        "chain": {"masses": [MASS, 1.0], "springs": [800.0, 600.0], "dashpots": [0.0, DAMPED]},
        "friction": [
            {"name": "pad", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 100.0, "coefficient": friction}
        ],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 2}, "level": PUSH, "frequency": HZ},
        "probes": [{"name": "first", "mass": 1}, {"name": "second", "mass": 2}],
        "run": {"duration": duration, "sample_rate": 1000.0, "method": method, "start": "rest", "convergence": "off"},
    }))  # fmt: skip
    expected, slides = by_events(duration, result["histories"]["time"].values)
    size = np.abs(expected[:, :2]).max(axis=0)
    for k, displacement in enumerate(result["histories"]["displacement"].values):
        np.testing.assert_allclose(displacement, expected[:, k], rtol=0, atol=within * size[k])
    if method == "exact":
        assert result["histories"]["friction_slides"].sel(friction="pad").item() == slides > 3
        assert result["histories"]["friction_dissipated_energy"].sel(friction="pad").item() == pytest.approx(
            expected[-1, 4], rel=1e-7
        )


def test_a_sweep_loses_what_a_run_does():
    """The last ten of sixty cycles of a run, and a cycle of a stepped sine that has become periodic."""
    friction = {"static": STATIC / 100, "sliding": SLIDING / 100, "stribeck_speed": 1.5}
    case = {
        "chain": {"masses": [MASS, 1.0], "springs": [800.0, 600.0], "dashpots": [0.0, DAMPED]},
        "friction": [
            {"name": "pad", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 100.0, "coefficient": friction}
        ],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 2}, "level": PUSH, "frequency": 2.2},
        "probes": [{"name": "first", "mass": 1}],
    }
    run = {"duration": 60 / 2.2, "from": 50 / 2.2, "start": "rest", "convergence": "off"}
    pad = beamsim.run(Scenario.model_validate({**case, "run": run}))
    sweep = {"kind": "stepped", "from": 2.2, "to": 2.25, "points": 2, "impacts": True}
    (curve,) = beamsim.sweep(Scenario.model_validate({**case, "sweep": sweep})).curves.values()
    cycle = curve.cycles.sel(friction="pad")
    assert cycle["friction_slides"].values[0] == 2
    assert cycle["friction_distance"].values[0] == pytest.approx(
        pad["histories"]["friction_sliding_distance"].sel(friction="pad").item() / 10, rel=1e-6
    )
    assert cycle["friction_energy_lost"].values[0] == pytest.approx(
        pad["histories"]["friction_dissipated_energy"].sel(friction="pad").item() / 10, rel=1e-6
    )
    # twin: the falling part counts
    assert cycle["friction_energy_lost"].values[0] > 1.02 * SLIDING * cycle["friction_distance"].values[0]
    assert cycle["friction_wear_power"].values[0] == pytest.approx(
        100 * cycle["friction_distance"].values[0] * 2.2, rel=1e-9
    )
