"""One degree of freedom with a one-sided spring: what is known in closed form."""

import numpy as np
import pytest

from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate


@pytest.mark.parametrize("stiffness", [1e-6, 0.5, 3.0, 1e4])
def test_period_is_the_mean_of_the_two_half_periods(make_system, no_forcing, stiffness):
    system = make_system([1.0], [0.0], shape=[[1.0]], stiffness=stiffness)
    flow = ExactFlow(system, no_forcing(1), 200.0)
    trajectory = simulate(flow, np.array([1.0, 0.0]))
    period = np.diff(trajectory.event_time[trajectory.touch_changes > 0])
    omega = np.sqrt(1.0 + stiffness)
    np.testing.assert_allclose(period, np.pi * (1.0 + 1.0 / omega), rtol=1e-12)


def test_energy_is_kept_over_a_thousand_periods(make_system, no_forcing):
    """Several modes, two snubbers with backlash and prestress, no damping: energy constant to 1e-10."""
    omega = np.array([1.0, 6.3, 17.5])
    system = make_system(
        omega, np.zeros(3), shape=[[1.4, -1.3, 1.1], [0.5, 1.2, 0.3]], stiffness=[40.0, 90.0], gap=[0.1, -0.05],
        sign=[1.0, -1.0],
    )  # fmt: skip
    duration = 1000 * 2 * np.pi
    flow = ExactFlow(system, no_forcing(3), duration)
    trajectory = simulate(flow, np.array([1.0, 0.02, 0.0, 0.0, 0.0, 0.1]))
    assert trajectory.event_time.size > 2000

    gap, sign = np.array([0.1, -0.05]), np.array([1.0, -1.0])

    def energy(y):
        delta = np.maximum(-gap - sign * (y[:, :3] @ system.contacts.shape.T), 0.0)
        kinetic = 0.5 * (y[:, 3:] ** 2).sum(axis=1)
        return kinetic + 0.5 * y[:, :3] ** 2 @ omega**2 + 0.5 * delta**2 @ system.contacts.stiffness

    values = energy(trajectory.states_at(np.linspace(0.0, duration, 5000)))
    np.testing.assert_allclose(values, values[0], rtol=1e-10)


def test_bouncing_mass_on_a_rigid_body_mode(make_system, no_forcing):
    """A free mass under gravity on a spring: parabola and half-sine arc, joined at known times."""
    k, g, height = 100.0, 9.81, 0.7
    system = make_system([0.0], [0.0], constant_load=[-g], shape=[[1.0]], stiffness=k)
    flow = ExactFlow(system, no_forcing(1), 20.0)
    trajectory = simulate(flow, np.array([height, 0.0]))
    fall = np.sqrt(2 * height / g)
    speed, omega = g * fall, np.sqrt(k)
    contact = (np.pi + 2 * np.arctan(g / omega / speed)) / omega
    flight = 2 * speed / g
    expected = fall + np.cumsum([0.0] + [contact, flight] * 8)
    count = min(expected.size, trajectory.event_time.size)
    assert count >= 8
    np.testing.assert_allclose(trajectory.event_time[:count], expected[:count], rtol=1e-11)


@pytest.mark.parametrize("law", [False, True])
def test_coefficient_of_restitution_of_a_dashpot(make_system, no_forcing, law):
    """A mass that hits a spring and dashpot leaves with the closed-form speed of each law."""
    k, c, speed = 50.0, 3.0, 2.0
    system = make_system([0.0], [0.0], shape=[[1.0]], stiffness=k, dashpot=c, no_tension=law)
    flow = ExactFlow(system, no_forcing(1), 5.0)
    trajectory = simulate(flow, np.array([0.0, -speed]))
    decay, omega = c / 2, np.sqrt(k - c**2 / 4)
    # without tension it leaves where the force k d + c d' vanishes, before the penetration does
    early = np.arctan2(2 * decay * omega, omega**2 - decay**2) if law else 0.0
    end = (np.pi - early) / omega
    left = speed * np.exp(-decay * end) * (np.cos(omega * end) - decay / omega * np.sin(omega * end))
    assert (trajectory.touch_changes > 0).tolist() == [True, False]
    np.testing.assert_allclose(trajectory.event_time, [0.0, end], rtol=1e-12)
    np.testing.assert_allclose(trajectory.final_y[1], -left, rtol=1e-12)
