"""Loads and signals of the excitation against closed forms."""

import numpy as np
import pytest

from beamsim.scenario import Scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = {"length": 0.5, "width": 0.02, "thickness": 0.005, "youngs_modulus": 70e9, "density": 2700.0}
LINE = 2700.0 * 0.02 * 0.005
EI = 70e9 * 0.02 * 0.005**3 / 12
RUN = {"duration": 1.0, "sample_rate": 5000.0, "start": "rest"}


def system(excitation, beam=None, **more):
    return build_system(
        Scenario.model_validate({"beam": {**BEAM, **(beam or {})}, "excitation": excitation, "run": RUN, **more})
    )


def harmonic(quantity="acceleration", level=3.0, **more):
    return {"kind": "harmonic", "applied_to": "base", "quantity": quantity, "level": level, "frequency": 7.0, **more}


T = np.linspace(0, 0.6, 1201)


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_harmonic_base_motion_has_no_drift(quantity):
    s = system(harmonic(quantity, phase=0.4))
    w = 2 * np.pi * 7.0
    chain = {"acceleration": 0, "velocity": 1, "displacement": 2}
    for name, order in chain.items():
        # Each integration divides by omega and turns the phase back by a right angle.
        by = order - chain[quantity]
        expected = 3.0 * w**-by * np.sin(w * T + 0.4 - by * np.pi / 2)
        np.testing.assert_allclose(getattr(s.base[0], name)(T), expected, rtol=0, atol=1e-12 * 3.0 * w**-by)
    assert s.excitation_frequency_hz == 7.0


def test_multi_tone_is_the_sum_of_its_tones():
    tones = [{"level": 1.0, "frequency": 5.0}, {"level": 2.0, "frequency": 11.0, "phase": 1.0}]
    s = system({"kind": "multi_tone", "applied_to": "base", "quantity": "acceleration", "tones": tones})
    w = 2 * np.pi * np.array([5.0, 11.0])
    expected = -np.sin(w[0] * T) / w[0] ** 2 - 2 * np.sin(w[1] * T + 1.0) / w[1] ** 2
    np.testing.assert_allclose(s.base[0].displacement(T), expected, atol=1e-15)
    assert np.isnan(s.excitation_frequency_hz)


@pytest.mark.parametrize("time", [0.0, 0.1])
def test_step_of_base_acceleration_starts_from_rest(time):
    s = system({"kind": "step", "applied_to": "base", "level": 4.0, "time": time})
    after = np.maximum(T - time, 0)
    np.testing.assert_array_equal(s.base[0].acceleration(T), np.where(time <= T, 4.0, 0.0))
    np.testing.assert_allclose(s.base[0].velocity(T), 4.0 * after, atol=1e-14)
    np.testing.assert_allclose(s.base[0].displacement(T), 2.0 * after**2, atol=1e-14)
    assert np.isnan(s.excitation_frequency_hz)


@pytest.mark.parametrize("time", [0.0, 0.1])
def test_half_sine_of_base_acceleration_leaves_a_velocity(time):
    s = system({"kind": "half_sine", "applied_to": "base", "level": 4.0, "duration": 0.02, "time": time})
    w = np.pi / 0.02
    tau = np.clip(T - time, 0, 0.02)
    velocity = 4.0 / w * (1 - np.cos(w * tau))
    displacement = 4.0 / w * (tau - np.sin(w * tau) / w) + velocity * np.maximum(T - time - 0.02, 0)
    np.testing.assert_allclose(s.base[0].acceleration(T), 4.0 * np.sin(w * tau) * (tau < 0.02), atol=1e-13)
    np.testing.assert_allclose(s.base[0].velocity(T), velocity, atol=1e-14)
    np.testing.assert_allclose(s.base[0].displacement(T), displacement, atol=1e-14)


def test_half_sine_of_base_velocity():
    pulse = {"kind": "half_sine", "applied_to": "base", "level": 0.5, "duration": 0.04, "quantity": "velocity"}
    s = system({**pulse, "time": 0.01})
    w, inside = np.pi / 0.04, (T >= 0.01) & (T < 0.05)
    np.testing.assert_allclose(s.base[0].acceleration(T), 0.5 * w * np.cos(w * (T - 0.01)) * inside, atol=1e-12)
    assert s.base[0].displacement(T)[-1] == pytest.approx(2 * 0.5 / w)


PULSES = {  # share of the duration, where the pulse has which share of its level; the velocity it leaves
    "step": (([0.0, 1.0], [1.0, 1.0]), {}, 1.0),
    "sawtooth": (([0.0, 1.0], [0.0, 1.0]), {}, 0.5),
    "trapezoid": (([0.0, 0.1, 0.9, 1.0], [0.0, 1.0, 1.0, 0.0]), {}, 0.9),
    "trapezoid, given": (([0.0, 0.25, 0.5, 1.0], [0.0, 1.0, 1.0, 0.0]), {"rise": 0.005, "fall": 0.01}, 0.625),
    "trapezoid, triangle": (([0.0, 0.5, 1.0], [0.0, 1.0, 0.0]), {"rise": 0.01, "fall": 0.01}, 0.5),
}


@pytest.mark.parametrize("time", [0.0, 0.1])
@pytest.mark.parametrize("name", PULSES)
def test_pulses_of_straight_pieces(name, time):
    (share, height), more, area = PULSES[name]
    kind = name.split(",")[0]
    s = system({"kind": kind, "applied_to": "base", "level": 4.0, "duration": 0.02, "time": time, **more})
    t = time + 0.02 * np.linspace(-0.4, 1.4, 1201)
    t = t[t >= 0]
    inside = (t >= time) & (t < time + 0.02)
    expected = 4.0 * np.interp((t - time) / 0.02, share, height) * inside
    away = np.abs((t - time) / 0.02 - 1.0) > 1e-9  # where a pulse may jump
    np.testing.assert_allclose(s.base[0].acceleration(t)[away], expected[away], atol=1e-12)
    assert s.base[0].velocity(np.array([time + 0.05]))[0] == pytest.approx(4.0 * area * 0.02)


def test_steady_base_acceleration_bends_like_gravity():
    s = system({"kind": "step", "applied_to": "base", "level": 9.81}, reduction={"modes": "all"})
    q = s.forcing.load[0] * 9.81 / s.dynamics.stiffness
    tip = s.probes[0].shape @ q
    assert tip == pytest.approx(-LINE * 9.81 * 0.5**4 / (8 * EI), rel=1e-9)


@pytest.mark.parametrize("modes", [2, 6, "all"])
def test_root_moment_under_harmonic_base_motion(modes):
    """Exact forced response of the undamped continuous cantilever, whose inertia load is uniform."""
    frequency = 30.0
    s = system({**harmonic(), "frequency": frequency}, beam={"elements": 20}, reduction={"modes": modes})
    omega = 2 * np.pi * frequency
    q = 3.0 * s.forcing.load[0] / (s.dynamics.stiffness - omega**2)
    moment = s.bodies[0].bending_moment @ q + 3.0 * s.bodies[0].base_moment

    b, length = (LINE * omega**2 / EI) ** 0.25, 0.5
    # w = a / omega^2 + A cos + B sin + C cosh + D sinh, held at the clamp and free at the tip.
    c, si, ch, sh = np.cos(b * length), np.sin(b * length), np.cosh(b * length), np.sinh(b * length)
    matrix = np.array([[1, 0, 1, 0], [0, 1, 0, 1], [-c, -si, ch, sh], [si, -c, sh, ch]])
    a, bb, cc, d = np.linalg.solve(matrix, [-3.0 / omega**2, 0, 0, 0])
    x = b * s.bodies[0].position
    exact = EI * b**2 * (-a * np.cos(x) - bb * np.sin(x) + cc * np.cosh(x) + d * np.sinh(x))
    size = np.abs(exact).max()
    np.testing.assert_allclose(moment, exact, atol=(2e-3 if modes == 2 else 2e-5) * size)
    if modes != "all":
        without = s.bodies[0].bending_moment @ q
        assert np.abs(without - exact).max() > 10 * np.abs(moment - exact).max()


def test_effective_mass_of_the_first_cantilever_mode():
    s = system(harmonic(), beam={"elements": 40})
    assert s.forcing.load[0, 0] ** 2 / (LINE * 0.5) == pytest.approx(0.61308, rel=1e-4)


def test_a_free_body_stays_where_it_is_when_the_base_moves():
    free = {"left": "free", "right": "free"}
    s = system(harmonic(), beam={"supports": free, "point_masses": [{"position": 0.2, "mass": 0.05}]})
    acceleration = s.bodies[0].deflection @ s.forcing.load[0]
    np.testing.assert_allclose(acceleration, -1.0, rtol=1e-9)  # relative to the base: minus the base's own
