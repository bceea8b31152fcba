"""Shock arrestors: free below a locking speed, a spring that bleeds above it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamsim
from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario

K, C, LIMIT, SPRING = 50.0, 30.0, 0.5, 20.0  # N/m, N s/m, m/s, N/m
ARRESTOR = {
    "name": "a", "kind": "shock_arrestor", "locking_speed": LIMIT, "stiffness": K,
    "bleed": {"force": 2.0 * C, "speed": 2.0},
}  # fmt: skip
HARMONIC = {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 8.0, "frequency": 0.6}


def case(spring=SPRING, arrestor=None, run=None, **rest):
    """A unit mass on a spring, with an arrestor to the ground."""
    chain = {"masses": [1.0], "springs": [spring], "springs_to_ground": [ARRESTOR | {"mass": 1} | (arrestor or {})]}
    run = {"duration": 1.0, "sample_rate": 1000.0, "convergence": "off"} | (run or {})
    return Scenario.model_validate({"chain": chain, "probes": [{"name": "m", "mass": 1}], "run": run} | rest)


def histories(scenario):
    result = beamsim.run(scenario)
    found = result["histories"].sel(probe="m")
    return [found[name].values for name in ("time", "displacement", "velocity")] + [
        result["histories"]["spring_force"].values[0], result.summary["energy_error"]
    ]  # fmt: skip


def until_the_next_change(locked, state, begin, end, load):
    """Integral of displacement, velocity and extension of the bleed while the arrestor is free or locked."""

    def rates(t, y):
        force = abs(locked) * K * (y[0] - y[2])
        return [y[1], load(t) - SPRING * y[0] - force, force / C]

    def change(t, y):
        return locked * (y[0] - y[2]) if locked else LIMIT - abs(y[1])

    change.terminal, change.direction = True, -1.0
    accuracy = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.1}
    return solve_ivp(rates, (begin, end), state, "DOP853", events=change, dense_output=True, **accuracy)


def independent(times, start, load):
    """Displacement and velocity by integration from event to event."""
    found, state, t = np.zeros((2, times.size)), np.array([*start, 0.0]), 0.0
    locked, reversals = 0.0, 0
    while t < times[-1]:
        if locked == 0.0 and abs(state[1]) >= LIMIT * (1.0 - 1e-12):
            locked, state[2] = np.sign(state[1]), state[0]
        part = until_the_next_change(locked, state, t, times[-1], load)
        inside = (times >= t) & (times <= part.t[-1])
        found[:, inside] = part.sol(times[inside])[:2]
        t, state = part.t[-1], part.y[:, -1]
        reversals += bool(locked) and abs(state[1]) > LIMIT
        locked = 0.0
    return found, reversals


def test_a_thrown_mass_locks_the_arrestor_at_once():
    """A free mass on a spring and a dashpot in series: F'' + (k/c) F' + (k/m) F = 0, F(0) = 0, F'(0) = k v."""
    time, _, velocity, force, energy_error = histories(case(0.0, run={"start": {"velocity": [2.0]}, "duration": 0.4}))
    decay = K / (2.0 * C)
    omega = np.sqrt(K - decay**2)
    expected = K * 2.0 / omega * np.exp(-decay * time) * np.sin(omega * time)
    np.testing.assert_allclose(force, expected, atol=1e-10)
    slope = 2.0 * K * np.exp(-decay * time) * (np.cos(omega * time) - decay / omega * np.sin(omega * time))
    np.testing.assert_allclose(velocity, slope / K + expected / C, atol=1e-10)
    assert abs(energy_error) < 1e-12


def test_slow_motion_meets_no_force():
    time, displacement, _, force, _ = histories(case(run={"start": {"velocity": [0.99 * LIMIT]}, "duration": 3.0}))
    assert np.all(force == 0.0)
    omega = np.sqrt(SPRING)
    np.testing.assert_allclose(displacement, 0.99 * LIMIT / omega * np.sin(omega * time), atol=1e-12)


def test_a_constant_force_makes_it_creep_with_the_bleed_rate():
    """A step of 60 N on a damped mass: locked it creeps with 2 m/s, above its locking speed or not."""
    load = {"kind": "step", "applied_to": {"mass": 1}, "level": 60.0}
    run = {"duration": 60.0, "sample_rate": 20.0, "start": {"velocity": [0.0]}}
    _, _, velocity, force, _ = histories(case(0.0, run=run, excitation=load))
    assert velocity[-1] == pytest.approx(2.0, rel=1e-8)
    assert force[-1] == pytest.approx(60.0, rel=1e-8)


@pytest.mark.parametrize("start", [(0.0, 3.0), (0.0, 0.0), (0.3, -2.0)])
def test_runs_agree_with_an_independent_integration(start):
    times = np.arange(0.0, 5.0005, 1e-3)
    run = {"duration": 5.0, "start": {"displacement": [start[0]], "velocity": [start[1]]}}
    _, displacement, velocity, _, energy_error = histories(case(run=run, excitation=HARMONIC))
    expected, reversals = independent(times, start, lambda t: 8.0 * np.sin(1.2 * np.pi * t))
    np.testing.assert_allclose([displacement, velocity], expected, atol=1e-7)
    assert abs(energy_error) < 1e-12
    if start[1] == 3.0:
        assert reversals >= 2  # it locks in the other direction at once


def test_stepping_in_time_gives_the_same_motion():
    run = {"duration": 3.0, "start": {"velocity": [3.0]}}
    exact, stepped = (
        histories(case(run=run | {"method": method}, excitation=HARMONIC))[1] for method in ("exact", "reference")
    )
    np.testing.assert_allclose(stepped, exact, atol=1e-6)


def test_between_two_masses_it_acts_on_their_relative_motion():
    """Two equal masses thrown apart move as one mass of half the mass on the arrestor."""
    chain = {"masses": [1.0, 1.0], "springs": [0.0, 0.0], "springs_between": [ARRESTOR | {"masses": [1, 2]}]}
    run = {"duration": 0.3, "sample_rate": 1000.0, "convergence": "off", "start": {"velocity": [-1.0, 1.0]}}
    result = beamsim.run(Scenario.model_validate({"chain": chain, "run": run}))
    time, decay = result["histories"]["time"].values, K / (2.0 * C)
    omega = np.sqrt(2.0 * K - decay**2)
    expected = K * 2.0 / omega * np.exp(-decay * time) * np.sin(omega * time)
    np.testing.assert_allclose(result["histories"]["spring_force"].values[0], expected, atol=1e-10)


def test_weight_is_not_carried():
    """At rest it is free: the static deflection is that of the spring."""
    _, displacement, _, force, _ = histories(case(gravity=10.0, run={"start": "static_equilibrium", "duration": 0.1}))
    assert np.all(force == 0.0)
    np.testing.assert_allclose(displacement, displacement[0], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bleed": None}, "bleed is missing"),
        ({"locking_speed": None}, "locking_speed is missing"),
        ({"locking_speed": 0.0}, "locking_speed"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"bleed": {"force": 1.0, "speed": 0.0}}, "bleed.speed"),
        ({"maxwell": []}, "maxwell"),
    ],
)
def test_wrong_keys_are_refused(changes, message):
    given = {key: value for key, value in (ARRESTOR | {"mass": 1} | changes).items() if value is not None}
    chain = {"masses": [1.0], "springs": [1.0], "springs_to_ground": [given]}
    with pytest.raises(ScenarioError, match=message):
        beamsim.load_scenario({"chain": chain, "run": {"duration": 1.0}})


def test_cubic_springs_are_refused():
    springs = [ARRESTOR | {"mass": 1}, {"mass": 1, "kind": "cubic", "stiffness": 1.0}]
    chain = {"masses": [1.0], "springs": [1.0], "springs_to_ground": springs}
    with pytest.raises(ScenarioError, match="cannot be combined with cubic springs"):
        beamsim.run({"chain": chain, "run": {"duration": 1.0, "start": {"velocity": [1.0]}}})


def test_periodic_motions_are_those_of_settled_runs():
    """The motion at 1.22 Hz, found by continuation, has the amplitude of a run of 60 periods."""
    chain = {"masses": [1.0], "springs": [SPRING], "dashpots": [0.3]}
    chain |= {"springs_to_ground": [ARRESTOR | {"mass": 1, "locking_speed": 0.05}]}
    force = HARMONIC | {"frequency": 1.22}
    sweep = {"kind": "continuation", "from": 1.2, "to": 1.22}
    branch = beamsim.continuation({"chain": chain, "excitation": force, "sweep": sweep})
    run = {"duration": 60 / 1.22, "sample_rate": 2440.0, "convergence": "off", "start": {"velocity": [0.0]}}
    settled = beamsim.run({"chain": chain, "excitation": force, "run": run})
    largest = np.abs(settled["histories"]["displacement"].values[0, -4000:]).max()
    assert branch.summary["energy_error"] < 1e-12
    assert branch.summary["peaks"][0]["value_m"] == pytest.approx(largest, rel=1e-5)


def test_nonlinear_modes_are_refused():
    chain = {"masses": [1.0], "springs": [1.0], "springs_to_ground": [ARRESTOR | {"mass": 1}]}
    with pytest.raises(ScenarioError, match="leave out the shock arrestor a"):
        beamsim.nnm({"chain": chain, "nnm": {"mode": 1}})
