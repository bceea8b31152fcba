"""The exact flow against time stepping written apart from the package (DOP853), and its own laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from independent import Stop, integrate, modal

from beamsim.flow import reference
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def agreement(flow, structure, contacts, load, start, duration, base=None, breaks=()):
    """The exact motion, the independent one, and the largest difference between them against the largest value."""
    names = ("dashpot", "gap", "sign", "on_ground", "no_tension")
    count = len(contacts["stiffness"])
    law = {name: np.broadcast_to(contacts[name], count) for name in names if name in contacts}
    law["side"] = law.pop("sign", np.ones(count))
    stops = [
        Stop(row, k, **{name: values[i] for name, values in law.items()})
        for i, (row, k) in enumerate(zip(contacts["shape"], contacts["stiffness"], strict=True))
    ]
    trajectory = simulate(flow, start)
    times = np.linspace(0.0, duration, 501)
    expected = integrate(structure, stops, load, start, times, base=base, breaks=breaks, most_step=0.05, atol=1e-13)
    error = (
        np.abs(trajectory.states_at(times)[:, : expected.state.shape[1]] - expected.state).max()
        / np.abs(expected.state).max()
    )
    return trajectory, expected, error


TONES = ((1.0, 1.3, 0.3), (0.5, 4.1, 0.2))  # amplitude, rad/s, phase of the fixture two_tones


def acceleration_at(t):
    return sum(a * np.sin(w * t + p) for a, w, p in TONES)


def base_at(t):
    """Displacement without drift and velocity."""
    return -sum(a / w**2 * np.sin(w * t + p) for a, w, p in TONES), -sum(a / w * np.cos(w * t + p) for a, w, p in TONES)


CASES = {
    "no dashpot": {"stiffness": [20.0], "gap": [0.1]},
    "dashpot": {"stiffness": [20.0], "dashpot": [0.5], "gap": [0.1]},
    "strong dashpot, prestress": {"stiffness": [20.0], "dashpot": [2.5], "gap": [-0.1], "sign": [-1.0]},
    "two snubbers": {"stiffness": [20.0, 50.0], "dashpot": [0.5, 0.1], "gap": [0.1, -0.1], "sign": [1.0, -1.0]},
    "on the ground": {
        "stiffness": [20.0, 50.0], "dashpot": [0.5, 0.1], "gap": [0.1, -0.1], "sign": [1.0, -1.0],
        "on_ground": [True, False],
    },
    "no tension": {"stiffness": [20.0], "dashpot": [0.8], "gap": [0.1], "no_tension": [True]},
    "no tension, on the ground": {
        "stiffness": [20.0, 50.0, 9.0], "dashpot": [0.5, 0.8, 0.3], "gap": [0.1, -0.1, 0.0], "sign": [1.0, -1.0, 1.0],
        "on_ground": True, "no_tension": [True, False, True],
    },
}  # fmt: skip


def random_structure(make_system, two_tones, case, rigid):
    """The flow and the start of a random structure, and the same for the independent integrator."""
    rng = np.random.default_rng(len(case) + rigid)
    n, duration = 4, 8.0
    omega = np.sort(rng.uniform(0.5, 6.0, n))
    omega[:rigid] = 0.0
    m = len(CASES[case]["stiffness"])
    constant, contacts = 0.2 * rng.normal(size=n), {"shape": rng.normal(size=(m, n)), **CASES[case]}
    system = make_system(omega, 0.02 * omega, constant, **contacts)
    acceleration, displacement = two_tones
    load = rng.normal(size=n)
    flow = ExactFlow(system, Forcing(np.vstack([load, 0.0 * load]), (acceleration, displacement), (1,)), duration)
    start = 0.5 * rng.normal(size=2 * n)
    structure = modal(omega, 0.02 * omega)
    return flow, structure, contacts, lambda t: constant + load * acceleration_at(t), start, duration, base_at


@pytest.mark.parametrize("rigid", [0, 1])
@pytest.mark.parametrize("case", CASES)
def test_random_structure(make_system, two_tones, case, rigid):
    trajectory, expected, error = agreement(*random_structure(make_system, two_tones, case, rigid))
    assert expected.event_time.size > 0
    np.testing.assert_array_equal(trajectory.event_contact, expected.event_stop)
    np.testing.assert_allclose(trajectory.event_time, expected.event_time, atol=1e-9)
    assert error < 1e-9


@pytest.mark.parametrize("kind", ["coupled damping", "near-critical", "overdamped", "coincident"])
def test_awkward_damping(make_system, two_tones, kind):
    rng = np.random.default_rng(5)
    omega = np.array([1.0, 1.7, 2.9, 5.0])
    damping = {
        "coupled damping": (lambda B: B @ B.T)(0.3 * rng.normal(size=(4, 4))),
        "near-critical": np.diag(2 * omega * np.array([1.0, 1 - 1e-9, 1 + 1e-6, 0.99])),
        "overdamped": np.diag(2 * omega * np.array([1.5, 3.0, 0.1, 8.0])),
        "coincident": np.diag(0.02 * omega),
    }[kind]
    if kind == "coincident":
        omega[:] = 2.0
    contacts = {"shape": rng.normal(size=(1, 4)), "stiffness": [15.0], "dashpot": [0.4], "gap": [0.02]}
    load = rng.normal(size=4)
    flow = ExactFlow(make_system(omega, damping, **contacts), Forcing(load[None], (two_tones[0],)), 10.0)
    structure, start = modal(omega, damping), rng.normal(size=8)
    assert agreement(flow, structure, contacts, lambda t: load * acceleration_at(t), start, 10.0)[2] < 1e-9


def test_the_stepping_of_the_package_agrees_too(make_system, two_tones):
    """`run.method: reference` with DOP853, which shares sources and start with the exact flow."""
    setting = random_structure(make_system, two_tones, "no tension, on the ground", 0)
    _, expected, _ = agreement(*setting)
    flow, start, duration = setting[0], setting[4], setting[5]
    times = np.linspace(0.0, duration, 501)
    stepping = reference.TimeStepping(flow, "DOP853", rtol=1e-12, atol=1e-13)
    stepped = reference.integrate(stepping, start, times)
    np.testing.assert_array_equal(stepped.event_contact, expected.event_stop)
    np.testing.assert_array_equal(stepped.touch_changes > 0, expected.event_closing)
    assert np.abs(stepped.y[:, : expected.state.shape[1]] - expected.state).max() < 1e-9 * np.abs(expected.state).max()


def test_the_comparison_can_fail(make_system, two_tones):
    """Twin of the tests above: one part in a million of the stiffness is far above the tolerance."""

    def flow(stiffness):
        system = make_system([1.0, 2.5], [0.02, 0.05], shape=[[1.0, 0.7]], stiffness=[stiffness], gap=[0.1])
        return ExactFlow(system, Forcing(np.array([[1.0, 0.5]]), (two_tones[0],)), 8.0)

    start, times = np.array([0.3, -0.2, 0.1, 0.4]), np.linspace(0, 8, 200)
    a = simulate(flow(20.0), start).states_at(times)
    b = simulate(flow(20.0 * (1 + 1e-6)), start).states_at(times)
    assert np.abs(a - b).max() / np.abs(a).max() > 1e-8


def test_grazing_contact_is_found(make_system, no_forcing):
    """A cosine that overshoots the gap by one part in 1e10 touches; one that falls short does not."""
    for excess, touches in ((1e-10, True), (-1e-10, False)):
        system = make_system([1.0], [0.0], shape=[[1.0]], stiffness=[5.0], gap=[1.0])
        flow = ExactFlow(system, no_forcing(1), 4.0)
        trajectory = simulate(flow, np.array([1.0 + excess, 0.0]))
        assert bool(trajectory.event_time.size) is touches
        assert trajectory.evaluations < 200
        if touches:
            half = np.arccos(1.0 / (1.0 + excess))
            np.testing.assert_allclose(trajectory.event_time[0], np.pi - half, atol=1e-8)


@pytest.mark.parametrize(("excess", "touches"), [(1e-9, True), (-1e-9, False)])
def test_fast_ripple_on_a_slow_motion_is_not_missed(make_system, no_forcing, excess, touches):
    """A contact that lasts a hundredth of the fastest period, seen by no coarse sampling; the twin just misses.

    The gap is 1 + q1 + q2 with q1 = -a sin t and q2 = -b cos 400 t. Both are lowest where t = pi / 2 = 100 periods of
    the ripple, and nowhere else in the three seconds: 1 - a - b = -excess decides.
    """
    system = make_system([1.0, 400.0], [0.0, 0.0], shape=[[1.0, 1.0]], stiffness=[3.0], gap=[1.0])
    slow, ripple = 0.9995, 0.0005 + excess
    trajectory = simulate(ExactFlow(system, no_forcing(2), 3.0), np.array([0.0, -ripple, -slow, 0.0]))
    if not touches:
        assert trajectory.event_time.size == 0
        return
    # near its lowest point the gap is -excess + (1 + 80) (t - pi / 2)^2 / 2, almost a parabola
    curvature = slow + ripple * 400.0**2
    half = np.sqrt(2 * excess / curvature)
    assert half < 0.01 * 2 * np.pi / 400
    assert (trajectory.touch_changes > 0).tolist() == [True, False]
    np.testing.assert_allclose(trajectory.event_time, np.pi / 2 + half * np.array([-1, 1]), rtol=0, atol=1e-3 * half)


def test_at_rest_with_zero_gap_nothing_flutters(make_system):
    """g = g' = g'' = 0 at the start: one contact at once or none, not thousands at round-off size."""
    for phase, closes in ((0.0, False), (np.pi, True)):
        system = make_system([1.0, 50.0], [0.02, 1.0], shape=[[1.0, 1.0]], stiffness=[30.0])
        forcing = Forcing(np.array([[1.0, 1.0]]), (Signal.harmonic(1.0, 0.8, phase),))
        flow = ExactFlow(system, forcing, 3.0)
        assert flow.begin(np.zeros(4)).phases.tolist() == [int(closes)]
        trajectory = simulate(flow, np.zeros(4))
        assert (trajectory.event_time[:1] == 0.0).tolist() == (
            [True] if closes else [False] * trajectory.event_time[:1].size
        )
        later = trajectory.event_time[trajectory.event_time > 0]
        assert later.size <= 3
        assert np.all(later > 0.5)


def test_a_structure_at_rest_stays_at_rest(make_system, no_forcing):
    system = make_system([1.0, 2.0], [0.0, 0.0], shape=[[1.0, 1.0]], stiffness=[3.0])
    trajectory = simulate(ExactFlow(system, no_forcing(2), 100.0), np.zeros(4))
    assert trajectory.event_time.size == 0
    assert not np.any(trajectory.final_y)


def test_long_grazing_ends(make_system):
    """Pressed against the stop by a load that balances to round-off: bounded work, no flutter."""
    system = make_system([1.0], [0.5], constant_load=[-1.0], shape=[[1.0]], stiffness=[10.0], gap=[1.0])
    flow = ExactFlow(system, Forcing(np.ones((1, 1)), (Signal.harmonic(1e-14, 3.0),)), 100.0)
    trajectory = simulate(flow, np.array([-1.0, 0.0]))
    assert trajectory.outcome.complete
    assert trajectory.event_time.size < 200
    assert trajectory.evaluations < 20_000


@settings(max_examples=12, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    factor=st.sampled_from([3.0, np.pi, 1e-6, 1e5]),
)
def test_zero_gap_is_homogeneous_of_degree_one(make_contacts, seed, factor):
    """Level and initial state times a factor: the whole motion times the factor."""
    rng = np.random.default_rng(seed)
    n, m = 3, 2
    omega = np.sort(rng.uniform(0.5, 8.0, n))
    contacts = make_contacts(
        rng.normal(size=(m, n)), rng.uniform(5, 60, m), rng.uniform(0, 1, m), sign=[1.0, -1.0],
        no_tension=[False, bool(seed % 2)],
    )  # fmt: skip
    system = PiecewiseLinearSystem(omega**2, np.diag(0.02 * omega), contacts, np.zeros(n))
    load, start = rng.normal(size=(1, n)), rng.normal(size=2 * n)
    times = np.linspace(0, 6, 300)

    def motion(level):
        forcing = Forcing(load, (Signal.harmonic(level, 1.7, 0.4),))
        return simulate(ExactFlow(system, forcing, 6.0), level * start).states_at(times)

    one = motion(1.0)
    assert np.abs(motion(factor) / factor - one).max() < 1e-10 * np.abs(one).max()


def test_a_snubber_on_a_node_is_left_alone(make_system, no_forcing):
    """Only modes move that have a node at the contact, up to round-off of their shapes: no contact, no flutter."""
    shape = [[1.2e-16, 1.4, -8e-17, 1.3]]
    system = make_system([1.0, 2.0, 3.0, 4.0], np.zeros(4), shape=shape, stiffness=[50.0])
    flow = ExactFlow(system, no_forcing(4), 200.0)
    trajectory = simulate(flow, np.array([1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.2, 0.0]))
    assert trajectory.event_time.size == 0
