"""Dry friction behind a tangential spring: closed forms, integration by hand, energy, limits and scenarios."""

import numpy as np
import pytest
from balance import energy_history, energy_of_segments
from sampling import slow_after
from scipy.integrate import solve_ivp

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.friction import friction_law
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.equations import Forcing, PiecewiseLinearSystem


def system_of(laws, shape, stiffness, damping, ground=None):
    count = len(laws)
    contacts = Contacts(
        np.array(shape, dtype=float), -np.ones(count), np.zeros(count),
        np.zeros(count, dtype=bool) if ground is None else np.array(ground), tuple(laws),
    )  # fmt: skip
    n = len(stiffness)
    return PiecewiseLinearSystem(np.array(stiffness), np.diag(damping).astype(float), contacts, np.zeros(n))


def free(n):
    return Forcing(np.zeros((0, n)), ())


# -- closed forms ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stiffness", [5.0, 50.0, 5e6])
def test_decay_of_one_mass(stiffness):
    """From one turning point A to the next B: k (A^2 - B^2) / 2 = F (A + B - 2 F / kt), which is 2 F / k for a stiff
    tangential spring: the amplitude falls by 4 F / k a cycle."""
    force = 0.04
    system = system_of([friction_law(stiffness, force, force)], [[1.0]], [1.0], [0.0])
    start = 1.0
    trajectory = simulate(ExactFlow(system, free(1), 30.0), np.array([start, 0.0, start - force / stiffness]))
    stops = trajectory.event_time[trajectory.event_phase == 0]
    turns = np.abs(trajectory.states_at(stops)[:, 0])
    expected, amplitude = [], start
    while len(expected) < turns.size:
        before = amplitude
        # B^2 / 2 + F B = A^2 / 2 - F A + 2 F^2 / kt
        amplitude = -force + np.sqrt(force**2 + before**2 - 2 * force * before + 4 * force**2 / stiffness)
        expected.append(amplitude)
    assert turns.size >= 6
    np.testing.assert_allclose(turns, expected, atol=1e-12 if stiffness < 1e3 else 1e-9)
    if stiffness > 1e3:
        np.testing.assert_allclose(turns[2::2] - turns[:-2:2], -4 * force, rtol=1e-6)


def test_loss_of_a_loop():
    """In a steady cycle of amplitude X a contact loses 4 F (X - F / kt)."""
    force, tangential = 0.3, 20.0
    system = system_of([friction_law(tangential, force, force)], [[1.0]], [1.0], [0.2])
    period, cycles = 2 * np.pi / 1.7, 40
    flow = ExactFlow(system, Forcing(np.ones((1, 1)), (Signal.harmonic(2.0, 1.7),)), cycles * period)
    trajectory = simulate(flow, np.zeros(3))
    times = np.linspace((cycles - 1) * period, cycles * period, 20001)
    states = trajectory.states_at(times)
    dissipated = energy_history(trajectory, times).history.dissipated
    viscous = 0.2 * np.trapezoid(states[:, 1] ** 2, times)
    amplitude = 0.5 * (states[:, 0].max() - states[:, 0].min())
    lost = dissipated[-1] - dissipated[0] - viscous
    assert lost == pytest.approx(4 * force * (amplitude - force / tangential), rel=1e-6)


def by_hand(stiffness, damping, shape, numbers, ground, load, omega, base, duration, start):
    """Final (q, q'), times of events and work lost, in plain formulas; ``numbers`` are (kt, static, sliding)."""
    n, count = len(stiffness), len(numbers)
    k, static, sliding = np.array(numbers).T
    mode = np.zeros(count, dtype=int)  # 0 sticks, else the direction of sliding

    def along(t, y):
        moved = np.where(ground, base * np.sin(omega * t), 0.0)
        rate = np.where(ground, base * omega * np.cos(omega * t), 0.0)
        return shape @ y[:n] + moved, shape @ y[n : 2 * n] + rate

    def force(t, y):
        return np.where(mode == 0, k * (along(t, y)[0] - y[2 * n : 2 * n + count]), mode * sliding)

    def rhs(t, y):
        a = load * np.sin(omega * t) - stiffness * y[:n] - damping * y[n : 2 * n] - force(t, y) @ shape
        lost = damping @ y[n : 2 * n] ** 2 + np.sum(np.where(mode == 0, 0.0, mode * sliding) * along(t, y)[1])
        return np.concatenate([y[n : 2 * n], a, np.zeros(count), [lost]])

    def guards():
        out = []
        for j in range(count):
            if mode[j] == 0:
                out += [(j, s, lambda t, y, j=j, s=s: static[j] - s * force(t, y)[j]) for s in (1, -1)]
            else:
                out.append((j, 0, lambda t, y, j=j: mode[j] * along(t, y)[1][j]))
        for _, _, function in out:
            function.terminal, function.direction = True, -1.0
        return out

    t, y, events = 0.0, np.concatenate([start, shape @ start[:n], [0.0]]), []
    while t < duration:
        watched = guards()
        run = solve_ivp(
            rhs, (t, duration), y, "DOP853", events=[g for *_, g in watched], rtol=1e-11, atol=1e-13, max_step=0.02
        )  # short steps: a slide within one would be missed
        t, y = run.t[-1], run.y[:, -1]
        if run.status != 1:
            break
        j, after, _ = watched[next(i for i, e in enumerate(run.t_events) if e.size)]
        events.append(t)
        if after == 0:
            y[2 * n + j] = along(t, y)[0][j] - mode[j] * sliding[j] / k[j]
        else:
            y[-1] += (static[j] ** 2 - sliding[j] ** 2) / (2 * k[j])
        mode[j] = after
    return y[: 2 * n], np.array(events), y[-1]


def random_case(rng):
    n, count = int(rng.integers(2, 4)), int(rng.integers(1, 4))  # of one mass all contacts would stop at once
    static = rng.uniform(0.05, 0.4, count)
    return {
        "stiffness": np.sort(rng.uniform(0.5, 20.0, n)), "damping": rng.uniform(0.0, 0.2, n),
        "shape": rng.normal(size=(count, n)),
        "numbers": [(rng.uniform(5.0, 60.0), s, s * rng.choice([1.0, rng.uniform(0.3, 1.0)])) for s in static],
        "ground": rng.random(count) < 0.4, "load": rng.normal(size=n), "omega": rng.uniform(0.5, 3.0),
        "base": rng.uniform(0.0, 0.3), "duration": 12.0, "start": rng.normal(size=2 * n) * 0.3,
    }  # fmt: skip


def solved(case):
    laws = [friction_law(*numbers) for numbers in case["numbers"]]
    system = system_of(laws, case["shape"], case["stiffness"], case["damping"], case["ground"])
    signal = Signal.harmonic(1.0, case["omega"])
    moving = Signal.harmonic(case["base"], case["omega"])
    flow = ExactFlow(system, Forcing(case["load"][None], (signal,), moving), case["duration"])
    n = system.size
    return simulate(flow, np.concatenate([case["start"], case["shape"] @ case["start"][:n]]))


@pytest.mark.parametrize("seed", slow_after(3, range(6)))
def test_random_contacts_against_integration_by_hand(seed):
    case = random_case(np.random.default_rng(seed))
    trajectory = solved(case)
    expected, events, lost = by_hand(**case)
    assert trajectory.event_time.size == events.size
    np.testing.assert_allclose(trajectory.event_time, events, atol=1e-6)
    np.testing.assert_allclose(trajectory.final_y[: expected.size], expected, atol=1e-7)
    balance = energy_history(trajectory, np.linspace(0.0, case["duration"], 301))
    assert balance.error < 1e-10
    assert energy_of_segments(trajectory).error < 1e-10
    assert balance.history.dissipated[-1] == pytest.approx(lost, abs=1e-6)


# -- integration by hand ---------------------------------------------------------------------------------------------


# -- scenarios -------------------------------------------------------------------------------------------------------

PAD = {"name": "pad", "at": {"mass": 1}, "mounted_on": "ground", "normal_force": 300.0, "stiffness": 2e5}
BOTH = {"static": 0.3, "sliding": 0.2}


def scenario(friction, **others):
    return load_scenario(
        {
            "chain": {"masses": [2, 2], "springs": [1000, 5000]},
            "friction": friction,
            "excitation": {"kind": "step", "applied_to": {"mass": 2}, "level": 150.0, "duration": 0.2},
            "run": {"duration": 1.0, "sample_rate": 500.0, "start": "rest"},
            **others,
        }
    )


def test_figures_of_a_pad():
    pad = {**PAD, "coefficient": BOTH, "wear_rate": "1e-6 mm^3/(N m)"}
    result = beamsim.run(scenario([pad]))
    contact = result.friction["pad"]
    assert result.summary["energy_error"] < 1e-10
    assert contact.slides >= 2
    slider = contact.displacement[:] - contact.force[:] / 2e5
    snaps = contact.slides * 30.0 / 2e5
    assert contact.sliding_distance == pytest.approx(np.abs(np.diff(slider)).sum(), rel=1e-3)
    lost = 60.0 * (contact.sliding_distance - snaps) + contact.slides * (90.0**2 - 60.0**2) / (2 * 2e5)
    assert contact.dissipated_energy == pytest.approx(lost, rel=1e-9)
    assert contact.dissipated_energy == pytest.approx(result.energy.dissipated[-1], rel=1e-9)
    assert contact.wear_power == pytest.approx(300.0 * contact.sliding_distance, rel=1e-12)
    assert contact.worn_volume == pytest.approx(1e-15 * 300.0 * contact.sliding_distance, rel=1e-12)
    assert result.summary["peak_friction_force_n"]["pad"] == pytest.approx(90.0, rel=1e-9)
    assert np.abs(contact.force[~contact.stuck[:]]) == pytest.approx(60.0)
    assert "springs" not in result.summary
    assert not result.springs


@pytest.mark.parametrize(("start", "force"), [("unstressed", 0.0), (45.0, 45.0), (-45.0, -45.0)])
def test_the_start_says_which_equilibrium(start, force):
    """Under a dead load the pad rests where its force at the start leaves it, and nothing moves."""
    others = {
        "constant_forces": [{"mass": 2, "force": 20.0}], "excitation": {"kind": "none"},
        "run": {"duration": 0.2, "sample_rate": 500.0, "start": "static_equilibrium"},
    }  # fmt: skip
    result = beamsim.run(scenario([{**PAD, "coefficient": BOTH, "start": start}], **others))
    contact = result.friction["pad"]
    np.testing.assert_allclose(contact.displacement[:], (20.0 - force) / 1000.0, rtol=1e-9)
    np.testing.assert_allclose(contact.force[:], force, atol=1e-7)
    assert result.summary["friction"]["pad"]["start_force_n"] == force
