"""Initial states of beams."""

from functools import cache

import numpy as np
import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import Scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = {"length": 1.0, "width": 0.02, "thickness": 0.02, "youngs_modulus": 70e9, "density": 2700.0, "elements": 10}
EI = 70e9 * 0.02**4 / 12


def system(start, beam=None, **more):
    return build_system(
        Scenario.model_validate(
            {
                "beam": {**BEAM, **(beam or {})},
                "run": {"duration": 0.1, "sample_rate": 5e3, "start": start},
                **more,
            }
        )
    )


def shapes(s):
    q, v = np.split(s.initial_state, 2)
    return s.bodies[0].position, s.bodies[0].deflection @ q, s.bodies[0].deflection @ v


HINGED = {"supports": {"left": "pinned", "right": "free"}}


def test_rigid_rotation_is_exact_and_only_rigid():
    s = system({"displacement": [0], "velocity": [0, -2.0]}, HINGED)
    x, w, v = shapes(s)
    np.testing.assert_allclose(v, -2.0 * x, atol=1e-13)
    np.testing.assert_array_equal(w, 0.0)
    np.testing.assert_allclose(s.initial_state[s.dynamics.size + 1 :], 0.0, atol=1e-13)
    # Kinetic energy m L^2 omega^2 / 6.
    assert s.initial_state @ s.initial_state / 2 == pytest.approx(2700 * 0.02**2 / 3 * 4 / 2, rel=1e-12)
    assert s.warnings == ()


def test_a_cubic_that_meets_the_supports_is_exact_with_all_modes():
    s = system({"displacement": [0, 0, 3e-3, -1e-3]}, reduction={"modes": "all"})
    x, w, _ = shapes(s)
    np.testing.assert_allclose(w, 3e-3 * x**2 - 1e-3 * x**3, atol=1e-12)
    # Which is the static shape under a tip force, so its energy is known: F^2 L^3 / (6 E I), F = 6 E I 1e-3.
    q = s.initial_state[: s.dynamics.size]
    assert q @ (s.dynamics.stiffness * q) / 2 == pytest.approx(36e-6 * EI / 6, rel=1e-6)
    assert s.warnings == ()


def test_a_shape_beyond_the_kept_modes_is_reported():
    s = system({"displacement": [0, 0, 3e-3, -1e-3]}, reduction={"modes": 3})
    assert "run.start.displacement" in s.warnings[0]
    _, w, _ = shapes(s)
    assert w[-1] == pytest.approx(2e-3, rel=1e-2)


@cache
def fine_shapes(supports):
    """(2000, n) deflections along the beam for a unit of each mode."""
    probes = [{"name": f"p{i}", "position": float(x)} for i, x in enumerate(np.linspace(0, 1, 2001)[1:])]
    left, right = supports
    s = system(
        {"mode": 1, "amplitude": 1e-3}, {"supports": {"left": left, "right": right}, "elements": 7}, probes=probes
    )  # fmt: skip
    return np.array([p.shape for p in s.probes])


@pytest.mark.parametrize("amplitude", [1e-3, -2e-3])
@pytest.mark.parametrize("supports", [("clamped", "free"), ("pinned", "pinned"), ("pinned", "free")])
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_a_mode_at_an_amplitude(mode, amplitude, supports):
    left, right = supports
    s = system({"mode": mode, "amplitude": amplitude}, {"supports": {"left": left, "right": right}, "elements": 7})
    n = s.dynamics.size
    assert np.flatnonzero(s.initial_state).tolist() == [mode - 1]
    assert np.sign(s.initial_state[mode - 1]) == np.sign(amplitude)
    assert not s.initial_state[n:].any()
    # Largest deflection anywhere, between the nodes too: a fine grid may only fall short of it.
    w = fine_shapes(supports) @ s.initial_state[:n]
    assert np.abs(w).max() <= abs(amplitude) * (1 + 1e-12)
    assert np.abs(w).max() == pytest.approx(abs(amplitude), rel=1e-5)


def test_a_mode_that_the_reduction_left_out_is_refused():
    with pytest.raises(ScenarioError, match=r"run\.start\.mode = 5"):
        system({"mode": 5, "amplitude": 1e-3}, reduction={"modes": 4})
    assert system({"mode": 9, "amplitude": 1e-3}).modes["kept_modes"].item() >= 9


@pytest.mark.parametrize("modes", [1, "all"])
def test_shape_under_a_released_force(modes):
    s = system({"released_force": {"position": 1.0, "force": 20.0}}, reduction={"modes": modes})
    x, w, v = shapes(s)
    np.testing.assert_allclose(w, 20 * x**2 * (3 - x) / (6 * EI), rtol=1e-9, atol=1e-15)
    assert not v.any()
    # Gone from the equilibrium itself.
    np.testing.assert_allclose(s.static_equilibrium, 0.0, atol=1e-18)


def test_a_released_force_presses_the_contact():
    stop = {"position": 1.0, "side": "below", "stiffness": 1e4, "gap": 1e-4}
    s = system({"released_force": {"position": 1.0, "force": -20.0}}, snubbers=[stop])
    tip = s.snubbers[0].shape @ s.initial_state[: s.dynamics.size]
    beam = 3 * EI
    assert tip == pytest.approx(-(20 + 1e4 * 1e-4) / (beam + 1e4), rel=1e-10)


def test_a_released_force_that_nothing_balances_is_refused():
    stop = {"position": 1.0, "side": "below", "stiffness": 1e4, "gap": 1e-4}
    with pytest.raises(ScenarioError, match=r"run\.start\.released_force"):
        system({"released_force": {"position": 1.0, "force": 20.0}}, HINGED, snubbers=[stop])


def test_rest_and_static_equilibrium():
    gravity = {"gravity": 9.81}
    assert not system("rest", **gravity).initial_state.any()
    s = system("static_equilibrium", **gravity)
    np.testing.assert_array_equal(s.initial_state[: s.dynamics.size], s.static_equilibrium)
    assert not s.initial_state[s.dynamics.size :].any()
