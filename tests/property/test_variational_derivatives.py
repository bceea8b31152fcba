"""Every derivative of the flow against finite differences, and Liouville's formula."""

from itertools import product

import numpy as np
import pytest
from sampling import first_apart

from beamsim.contacts.contacts import Contacts
from beamsim.contacts.laws import kelvin_voigt
from beamsim.contacts.sliders import pressed_friction_law, rigid_friction_law
from beamsim.flow.periodic_flow import (
    ContactDirection,
    Frequency,
    Level,
    PeriodicForcing,
    shift_system,
)
from beamsim.flow.transient import Log, March, Motion
from beamsim.flow.variational import FlowOutputs, VariationalFlow, sensitivity
from beamsim.system.equations import PiecewiseLinearSystem

OMEGA = np.array([1.0, 6.3, 17.5])
SHAPE = np.array([[1.4, -1.3, 1.1], [0.5, 1.2, 0.3]])


def forcing(base=0.0):
    """Two harmonics; the base moves with a -2 power of the frequency."""
    return PeriodicForcing(
        np.array([1, 3]),
        np.array([[0.4 - 0.2j, 0.3, 0.1j], [0.1, 0.2j, -0.3]]),
        np.array([0.0, 1.0]),
        np.array([[base * (0.05 + 0.02j)], [0.01 * base]]),
        np.array([-2.0, 0.0]),
        1.1,
    )


CASES = {
    "spring": {"stiffness": [40.0, 90.0], "gap": [0.1, -0.05], "sign": [1.0, -1.0]},
    "dashpot": {"stiffness": [40.0, 90.0], "dashpot": [3.0, 0.7], "gap": [0.05, 0.1], "sign": [1.0, -1.0]},
    "face": {
        "stiffness": [40.0, 90.0], "dashpot": [8.0, 20.0], "gap": [0.0, 0.02], "sign": [1.0, -1.0],
        "no_tension": True,
    },
    "ground": {"stiffness": [40.0, 90.0], "dashpot": [3.0, 0.7], "gap": [0.05, 0.1], "on_ground": True},
    "ground face": {
        "stiffness": [40.0, 90.0], "dashpot": [8.0, 20.0], "gap": [0.0, 0.02], "sign": [1.0, -1.0],
        "no_tension": True, "on_ground": True,
    },
}  # fmt: skip


def build(make_system, case, damping=0.05, omega=OMEGA):
    return make_system(omega, damping * np.arange(1.0, 4.0), shape=SHAPE, **CASES[case])


def central(function, h=1e-7):
    return (function(h) - function(-h)) / (2 * h)


@first_apart(("seed", "case"), len(CASES), product(range(4), CASES))
def test_derivatives_by_start_frequency_level_and_contacts(make_system, case, seed):
    rng = np.random.default_rng(seed)
    system = build(make_system, case)
    loads = forcing(1.0 if "ground" in case else 0.0)
    flow = VariationalFlow(system, loads, omega=1.3, level=2.0)
    z = np.concatenate([rng.normal(size=3) * [0.5, 0.1, 0.02], rng.normal(size=3) * 0.4, np.zeros(flow.size - 6)])
    if "face" in case:  # a snubber's face still on its way back
        z[6] = 0.1 + max(0.0, flow.penetration_of(z[None], np.zeros(1))[0][0, 0])
    duration = 5.3
    directions = [
        ContactDirection.of(system.contacts, stiffness=rng.normal(size=2)),
        ContactDirection.of(system.contacts, dashpot=rng.normal(size=2)),
        ContactDirection.of(system.contacts, gap=rng.normal(size=2)),
        ContactDirection.of(system.contacts, shape=rng.normal(size=(2, 3))),
    ]
    flow_map = flow.flow_map(z, duration, [Frequency(), Level(), *directions])
    assert flow_map.event_time.size >= 4

    def at(omega=0.0, level=0.0, start=0.0, more=0.0):
        return VariationalFlow(system, loads, 1.3 + omega, 2.0 + level).flow_map(z + start, duration + more).end

    scale = np.abs(flow_map.transition).max()
    for k in range(flow.size):
        step = np.eye(flow.size)[k]
        np.testing.assert_allclose(
            flow_map.transition[:, k], central(lambda h, step=step: at(start=h * step)), atol=1e-6 * scale
        )
    checks = [central(lambda h: at(omega=h)), central(lambda h: at(level=h))]
    moved = [lambda h, d=d: flow.with_system(shift_system(flow.system, d, h)) for d in directions]
    checks += [central(lambda h, at_step=at_step: at_step(h).flow_map(z, duration).end) for at_step in moved]
    for column, expected in zip(flow_map.parameters.T, checks, strict=True):
        np.testing.assert_allclose(column, expected, atol=3e-6 * max(1.0, scale))
    np.testing.assert_allclose(flow_map.slope, central(lambda h: at(more=h)), atol=1e-5 * np.abs(flow_map.slope).max())


@pytest.mark.parametrize("case", ["spring", "dashpot", "face"])
def test_an_event_exactly_at_the_end_of_a_motion_changes_no_derivative(make_system, case):
    flow = VariationalFlow(build(make_system, case), forcing(), omega=1.3, level=2.0)
    z, exact = np.append([0.3, 0.1, -0.02, 0.2, -0.1, 0.3], np.zeros(flow.size - 6)), flow.exact
    log = March().on(exact, Motion(z.copy(), exact.state_index(exact.begin(z).phases)), 5.3)
    follows = np.flatnonzero(np.diff(log.state))[:5] + 1  # segments that begin with the events
    for k, (m, time) in enumerate(zip(follows.tolist(), log.event_time.tolist(), strict=False)):
        with_it, without = (
            sensitivity(
                exact,
                FlowOutputs(exact),
                Log(*(x[:m] for x in log[:5]), *(x[:e] for x in log[5:])),
                [],
                np.eye(flow.size),
            )
            for e in (k + 1, k)
        )
        np.testing.assert_array_equal(with_it.derivative, without.derivative)
        before = flow.flow_map(z, (1.0 - 1e-10) * time)
        assert before.event_time.size == k
        np.testing.assert_allclose(with_it.derivative, before.transition, atol=1e-7 * np.abs(with_it.derivative).max())


@pytest.mark.parametrize("case", CASES)
def test_a_flow_under_other_loads_has_the_motions_of_a_new_one(make_system, case):
    """Contact states that were visited are reused: wholly where the level alone changes."""
    system, loads = build(make_system, case), forcing(1.0 if "ground" in case else 0.0)
    flow, z = VariationalFlow(system, loads, omega=1.3, level=2.0), np.zeros(VariationalFlow(system, loads).size)
    flow.flow_map(z, 5.3, [Frequency()])
    for omega, level in ((1.3, 1.1), (0.9, 2.0), (1.7, 0.4), (1.3, 2.0)):
        flow = flow.with_loads(omega, level)
        found = flow.flow_map(z, 5.3, [Frequency(), Level()])
        expected = VariationalFlow(system, loads, omega, level).flow_map(z, 5.3, [Frequency(), Level()])
        assert found.signature == expected.signature
        for name in ("end", "transition", "parameters"):
            one, other = getattr(found, name), getattr(expected, name)
            np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(other).max())


def test_a_parameter_of_a_direction_must_exist(make_system):
    system = build(make_system, "spring")
    with pytest.raises(TypeError, match="contacts have no friction to change"):
        ContactDirection.of(system.contacts, friction=1.0)


def test_derivative_by_contacts_where_the_motion_has_powers_of_time(make_system):
    """A rigid-body mode: the closed form is left for a difference, and agrees with one of another step."""
    system = make_system(
        [0.0, 6.3], [0.0, 0.1], shape=[[1.0, 0.5]], stiffness=30.0, gap=0.01, constant_load=[-1.0, 0.0]
    )
    flow = VariationalFlow(system)
    z = np.array([0.4, 0.1, 0.0, 0.2])
    d = ContactDirection.of(system.contacts, stiffness=2.0, gap=0.1)
    flow_map = flow.flow_map(z, 4.0, [d])
    assert flow_map.event_time.size >= 2
    expected = central(lambda h: flow.with_system(shift_system(flow.system, d, h)).flow_map(z, 4.0).end, 1e-5)
    np.testing.assert_allclose(flow_map.parameters[:, 0], expected, rtol=1e-5, atol=1e-7)


def test_liouville(make_system):
    """det of the transition = exp(-int trace C), times the rate before over after at every jump of the force.

    With a dashpot the flow's volume changes by (rate after) / (rate before) at an event: the rates are equal here
    (velocity is continuous), so that only the trace counts: its dashpot part while a contact is closed.
    """
    system = build(make_system, "dashpot")
    flow = VariationalFlow(system, forcing(), omega=1.3, level=2.0)
    z = np.array([0.3, 0.1, 0.01, -0.2, 0.3, 0.1])
    flow_map = flow.flow_map(z, 5.0)
    assert flow_map.event_time.size >= 4
    total = 0.0
    for phases, length in zip(flow_map.phases, flow_map.length, strict=True):
        total += np.trace(flow.exact.at(phases).rates[3:6, 3:6]) * length
    log_det = np.linalg.slogdet(flow_map.transition[:6, :6])[1]
    assert log_det == pytest.approx(total, rel=1e-10)


def test_undamped_flow_is_symplectic(make_system):
    """Phi^T J Phi = J across many contacts."""
    system = build(make_system, "spring", damping=0.0)
    flow_map = VariationalFlow(system).flow_map(np.array([0.5, 0.1, 0.0, 0.0, 0.0, 0.1]), 20.0)
    assert flow_map.event_time.size > 10
    J = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    P = flow_map.transition[:6, :6]
    np.testing.assert_allclose(P.T @ J @ P, J, atol=1e-11 * np.abs(P).max() ** 2)


# -- contacts that stick rigidly -------------------------------------------------------------------------------------


def sticking(seed, pressed):
    """A flow with faces that stick rigidly, a start, a duration, and a direction in which one contact moves."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 5)), 2 if pressed else int(rng.integers(1, 3))
    omega, static = np.sort(rng.uniform(0.8, 6.0, n)), rng.uniform(0.2, 1.0, m)
    laws = [rigid_friction_law(s, s * rng.choice([1.0, 0.7])) for s in static]
    if pressed:
        laws[1] = pressed_friction_law(None, 0.5, rng.choice([0.5, 0.4]))
    contacts = Contacts(
        rng.normal(size=(m + 1, n)), np.append(-np.ones(m), 1.0), np.append(np.zeros(m), -0.1 if pressed else 0.2),
        np.zeros(m + 1, dtype=bool), (*laws, kelvin_voigt(30.0, 0.3)),
        pressed_by=np.array([-1, 2, -1]) if pressed else None,
    )  # fmt: skip
    system = PiecewiseLinearSystem(omega**2, np.diag(0.1 * omega), contacts, 0.3 * rng.normal(size=n))
    loads = PeriodicForcing.harmonic(rng.normal(size=n) * rng.uniform(0.5, 3.0), 1.0)
    flow = VariationalFlow(system, loads, rng.uniform(0.8, 3.0), 1.0)
    shape = np.zeros((m + 1, n))
    shape[int(rng.integers(0, m + pressed))] = rng.normal(size=n)
    start = np.concatenate([0.3 * rng.normal(size=n), 0.5 * rng.normal(size=n)])
    return flow, start, rng.uniform(2.0, 6.0), ContactDirection.of(contacts, shape=shape)


@pytest.mark.parametrize("pressed", [False, True])
@pytest.mark.parametrize("seeds", [range(4), range(4, 40)])
def test_derivatives_by_the_position_of_a_contact_that_sticks(seeds, pressed):
    """They were wrong wherever a contact stuck: the velocity along what it holds had no part in the motion."""
    stuck = 0
    for seed in seeds:
        flow, start, duration, direction = sticking(seed, pressed)
        flow_map = flow.flow_map(start, duration, [direction])

        def moved(h, of=(flow, start, duration, direction)):
            flow, start, duration, direction = of
            return flow.with_system(shift_system(flow.system, direction, h)).flow_map(start, duration)

        (up, down), (above, below) = ((moved(h), moved(-h)) for h in (3e-6, 1e-5))
        expected, coarse = (up.end - down.end) / 6e-6, (above.end - below.end) / 2e-5
        size = np.abs(expected).max() + 1e-3
        if above.signature != below.signature or np.abs(coarse - expected).max() > 1e-3 * size:
            continue  # other events on the two sides
        np.testing.assert_allclose(flow_map.parameters[:, 0], expected, atol=2e-3 * size, err_msg=str(seed))
        stuck += bool(
            flow.system.contacts.arrays.sticks_rigidly[np.arange(len(flow.system.contacts.laws)), flow_map.phases].any()
        )
    assert stuck > 0.8 * len(seeds)
