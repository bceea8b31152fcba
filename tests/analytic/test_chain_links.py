"""Bumpers, cables and nonlinear springs between the masses of chains and to the ground, against closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipj, ellipk

import beamsim
from beamsim.analyses.nnm.analysis import nnm
from beamsim.errors import ScenarioError
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.scenario import Scenario
from beamsim.scenario.parameters import with_values
from beamsim.system.build import build_system


def chain(masses, springs, more=None, **rest):
    count = len(masses)
    probes = [{"name": f"m{i + 1}", "mass": i + 1} for i in range(count)]
    return Scenario.model_validate(
        {"chain": {"masses": masses, "springs": springs, **(more or {})}, "probes": probes, **rest}
    )


def run_section(duration, displacement, velocity=(), rate=50.0, **more):
    start = {"displacement": displacement, "velocity": list(velocity)}
    return {"duration": duration, "sample_rate": rate, "start": start, **more}


# -- two free masses with a bumper between them: the relative motion is a bilinear oscillator --------------------------
M1, M2, SPRING, BUMPER = 1.0, 3.0, 2.0, 30.0
REDUCED = M1 * M2 / (M1 + M2)
OPEN, CLOSED = np.sqrt(SPRING / REDUCED), np.sqrt((SPRING + BUMPER) / REDUCED)


@pytest.mark.parametrize("resists", ["approach", "separation"])
def test_free_masses_with_a_bumper_between_keep_the_bilinear_frequency(resists):
    link = {"name": "link", "between": [1, 2], "stiffness": BUMPER, "resists": resists}
    # momentum zero: the centre of mass stays at rest
    case = chain([M1, M2], [0, SPRING], {"snubbers": [link]}, run=run_section(60.0, [3.0, -1.0]))
    result = beamsim.run(case)
    period = np.pi / OPEN + np.pi / CLOSED
    closings = result["events"]["time"].values[result["events"]["closing"].values]
    np.testing.assert_allclose(np.diff(closings), period, rtol=1e-12)
    centre = (
        M1 * result["histories"]["displacement"].sel(probe="m1").values
        + M2 * result["histories"]["displacement"].sel(probe="m2").values
    )
    assert np.abs(centre).max() < 1e-12
    assert result.summary["energy_error"] < 1e-12
    stretch = result["histories"]["snubber_displacement"].sel(snubber="link").values
    pushed = result["histories"]["snubber_force"].sel(snubber="link").values > 0
    assert np.all(stretch[pushed] < 0) if resists == "approach" else np.all(stretch[pushed] > 0)
    assert result.summary["contact_share"]["link"] == pytest.approx(np.pi / CLOSED / period, abs=0.02)
    assert (
        result["histories"]["snubber_side"].sel(snubber="link").item(),
        result["histories"]["snubber_position"].sel(snubber="link").item(),
    ) == (resists, 1.5)


def test_gap_preload_and_statics_between_masses():
    """A cable of slack g between two masses pulled apart by F each way: F = k x + k_c (x - g)."""
    cable = {"name": "cable", "between": [1, 2], "resists": "separation", "stiffness": 50.0, "gap": 0.02}
    forces = [{"mass": 1, "force": -1.0}, {"mass": 2, "force": 1.0}]
    s = build_system(chain([1, 2], [5, 10, 0], {"snubbers": [cable]}, constant_forces=forces))
    # the forces balance: nothing reaches the wall
    stretch = (1.0 + 50 * 0.02) / 60
    assert s.snubbers[0].shape @ s.static_equilibrium == pytest.approx(stretch, rel=1e-12)
    assert s.snubbers[0].preload == pytest.approx(50 * (stretch - 0.02), rel=1e-12)
    press = {"name": "pad", "between": [1, 2], "stiffness": 50.0, "preload": 4.0}
    s = build_system(chain([1, 2], [5, 10, 0], {"snubbers": [press]}))
    # 4 N hold the masses 0.4 m apart; the pad is 0.08 m shorter than that by its own compression
    assert s.snubbers[0].gap == pytest.approx(-0.4 - 0.08, rel=1e-12)
    assert s.snubbers[0].preload == pytest.approx(4.0, rel=1e-12)


def test_a_link_between_masses_feels_no_common_motion():
    """Walls and two free masses on a moving base: the absolute motion stays at rest, whatever joins the masses."""
    more = {
        "snubbers": [{"between": [1, 2], "stiffness": 10.0}],
        "springs_between": [
            {"masses": [1, 2], "kind": "linear", "stiffness": 3.0},
            {"masses": [1, 2], "kind": "piecewise_linear", "breakpoints": [-0.1, 0.1], "stiffnesses": [3, 1, 2]},
            {"masses": [1, 2], "kind": "cubic", "stiffness": 3.0},
        ],
    }
    excitation = {"kind": "harmonic", "applied_to": "base", "level": 1.0, "frequency": 0.3}
    start = {"velocity": [1 / (0.6 * np.pi), 1 / (0.6 * np.pi)]}  # at rest in absolute terms: d' = -v
    run = {"duration": 5.0, "sample_rate": 20.0, "start": start}
    for several in (more["springs_between"], more["springs_between"][:2]):  # by stepping, exactly
        case = chain([1, 2], [0, 0], {**more, "springs_between": several}, excitation=excitation, run=run)
        result = beamsim.run(case)
        for name in result["histories"].labels("probe"):
            np.testing.assert_allclose(
                result["histories"]["absolute_displacement"].sel(probe=name).values, 0.0, atol=1e-10
            )
    grounded = {"springs_to_ground": [{"mass": 1, "kind": "linear", "stiffness": 3.0, "name": "foot"}]}
    held = beamsim.run(chain([1, 2], [0, 0], {**more, **grounded}, excitation=excitation, run=run))
    # the ground stands still
    np.testing.assert_allclose(held["histories"]["absolute_displacement"].sel(probe="m2").values, 0.0, atol=1e-10)


# -- piecewise-linear springs ----------------------------------------------------------------------------------------
LAWS = {
    "hardening": ([-0.5, 0.4], [9.0, 2.0, 5.0]),
    "softening": ([-0.5, 0.4], [0.5, 2.0, 0.7]),
    "softening twice, then flat": ([-0.8, -0.3, 0.2, 0.6], [0.3, 1.0, 4.0, 1.0, 0.0]),
    "hardening, softening": ([-0.3, 0.2, 0.7], [0.2, 3.0, 8.0, 1.0]),
    "dead band": ([-0.3, 0.2], [4.0, 0.0, 3.0]),
    "bent at zero, softening that way": ([0.0], [5.0, 2.0]),
    "bent at zero and beyond": ([0.0, 0.5], [2.0, 5.0, 1.0]),
}


def force(breakpoints, slopes, x):
    """Force by integrating the slope from zero, written apart from the package."""
    edges = np.concatenate([[-np.inf], breakpoints, [np.inf]])
    low, high = np.clip(0.0, edges[:-1], edges[1:]), np.clip(np.asarray(x)[..., None], edges[:-1], edges[1:])
    return np.sum(np.asarray(slopes) * (high - low), axis=-1)


def potential(breakpoints, slopes, x):
    corners = np.array(sorted([0.0, x, *(bend for bend in breakpoints if min(0.0, x) < bend < max(0.0, x))]))
    return float(np.sign(x) * np.trapezoid(force(breakpoints, slopes, corners), corners))


@pytest.mark.parametrize("law", LAWS)
def test_force_of_a_piecewise_linear_spring(law):
    breakpoints, slopes = LAWS[law]
    spring = {"mass": 1, "kind": "piecewise_linear", "breakpoints": breakpoints, "stiffnesses": slopes}
    s = build_system(chain([2.0], [1.0], {"springs_to_ground": [spring]}))
    x = np.linspace(-2, 2, 101)
    np.testing.assert_allclose(s.springs[0].force(x), force(breakpoints, slopes, x), atol=1e-14)
    c = s.dynamics.contacts
    np.testing.assert_array_less(-1e-300, c.clearances)
    assert s.contact_names == ("ground_spring_1",)
    push = c.forces(
        np.array([[int(np.searchsorted(breakpoints, v))] for v in x]), x[:, None], 0 * x[:, None], np.zeros((101, 0))
    )
    np.testing.assert_allclose(push[:, 0] + s.springs[0].linear * x, force(breakpoints, slopes, x), atol=1e-14)
    assert s.snubbers == ()


def exact_period(breakpoints, slopes, amplitude, mass):
    """T = the integral of 2 dx / v between the turning points, with x = middle + half sin(angle)."""
    from scipy.optimize import brentq

    energy = potential(breakpoints, slopes, amplitude)
    other = brentq(lambda x: potential(breakpoints, slopes, x) - energy, -50.0, -1e-9, xtol=1e-15)
    middle, half = 0.5 * (amplitude + other), 0.5 * (amplitude - other)

    def slowness(angle):
        x = middle + half * np.sin(angle)
        left = energy - potential(breakpoints, slopes, x)
        return half * np.cos(angle) / np.sqrt(2 * left / mass)

    bends = [np.arcsin((b - middle) / half) for b in breakpoints if other < b < amplitude]
    edges = [-np.pi / 2, *bends, np.pi / 2]
    return 2 * sum(quad(slowness, a, b, epsabs=1e-11, epsrel=1e-11, limit=200)[0] for a, b in pairwise(edges))


@pytest.mark.parametrize("law", LAWS)
def test_period_of_a_piecewise_linear_oscillator(law):
    """The only spring of a mass, to the ground, or of the relative motion of two free masses."""
    breakpoints, slopes = LAWS[law]
    spring = {"kind": "piecewise_linear", "breakpoints": breakpoints, "stiffnesses": slopes}
    alone = chain([2.0], [0], {"springs_to_ground": [{"mass": 1, **spring}]}, run=run_section(40.0, [1.5]))
    pair = chain(
        [M1, M2], [0, 0], {"springs_between": [{"masses": [2, 1], **spring}]},
        run=run_section(40.0, [-1.5 * REDUCED / M1, 1.5 * REDUCED / M2]),
    )  # fmt: skip
    for case, mass in ((alone, 2.0), (pair, REDUCED)):
        system = build_system(case)
        trajectory = simulate(ExactFlow(system.dynamics, system.forcing, 40.0), system.initial_state)
        again = trajectory.event_time[trajectory.event_phase == trajectory.event_phase.max()]  # once a period
        assert again.size > 3
        period = exact_period(breakpoints, slopes, 1.5, mass)
        np.testing.assert_allclose(np.diff(again), period, rtol=1e-9)
        result = beamsim.run(case)
        assert result.summary["energy_error"] < 1e-11
        ((name, stretch),) = result["histories"].by_label("spring_extension").items()
        found = result["histories"]["spring_force"].sel(spring=name).values
        np.testing.assert_allclose(found, force(breakpoints, slopes, stretch.values), atol=1e-12)
        assert stretch.values[0] == pytest.approx(1.5)
        assert result.summary["peak_extension_m"][name] >= 1.5 * (1 - 1e-12)
        assert (result.summary["events"], result.summary["linear"]) == (0, False)


def test_a_softened_spring_moves_slower_than_a_hardened_one():
    """The twin: one period computed for the law of the other."""
    soft, hard = (exact_period(*LAWS[law], 1.5, 2.0) for law in ("softening", "hardening"))
    assert soft > 1.5 * hard


def test_nonlinear_mode_of_a_piecewise_linear_oscillator_in_energy(monkeypatch):
    monkeypatch.setattr("beamsim.analyses.nnm.paths.POINTS", 20)
    breakpoints, slopes = LAWS["softening"]
    spring = {"masses": [1, 2], "kind": "piecewise_linear", "breakpoints": breakpoints, "stiffnesses": slopes}
    going = {"mode": 2, "continue_in": {"kind": "energy", "from": 0.05, "to": 1.0}}
    result = nnm(chain([M1, M2], [0, 0], {"springs_between": [spring]}, nnm=going))
    backbone = result.branches[0]
    assert backbone["status"].item().startswith("reached")
    for index in (0, backbone["energy"].values.size // 2, -1):
        energy = backbone["energy"].values[index]
        from scipy.optimize import brentq

        amplitude = brentq(lambda x, e=energy: potential(breakpoints, slopes, x) - e, 0, 20, xtol=1e-15)
        period = exact_period(breakpoints, slopes, amplitude, REDUCED)
        assert 1 / backbone["frequency_hz"].values[index] == pytest.approx(period, rel=1e-9)


# -- cubic springs between masses ------------------------------------------------------------------------------------
def test_duffing_motion_of_two_free_masses(monkeypatch):
    """mu x'' + k x + g x^3 = 0 from rest at a: x = a cn(w t | m), mu w^2 = k + g a^2, m = g a^2 / (2 (k + g a^2))."""
    monkeypatch.setattr("beamsim.analyses.nnm.paths.POINTS", 20)
    g, a = 3.0, 0.8
    more = {"springs_between": [{"masses": [1, 2], "kind": "cubic", "stiffness": g, "name": "duffing"}]}
    parts = [-a * REDUCED / M1, a * REDUCED / M2]
    result = beamsim.run(chain([M1, M2], [0, SPRING], more, run=run_section(30.0, parts)))
    w, m = np.sqrt((SPRING + g * a**2) / REDUCED), g * a**2 / (2 * (SPRING + g * a**2))
    exact = a * ellipj(w * result["histories"]["time"].values, m)[1]
    np.testing.assert_allclose(result["histories"]["spring_extension"].sel(spring="duffing").values, exact, atol=1e-7)
    np.testing.assert_allclose(
        result["histories"]["spring_force"].sel(spring="duffing").values, g * exact**3, atol=1e-6
    )
    assert any("without certificate" in warning for warning in result.warnings)
    assert result.summary["energy_error"] < 1e-8
    energy = 0.5 * SPRING * a**2 + 0.25 * g * a**4
    mode = nnm(chain([M1, M2], [0, SPRING], more, nnm={"mode": 2, "energy": energy})).branches[0]
    assert 1 / mode["frequency_hz"].values[-1] == pytest.approx(4 * ellipk(m) / w, rel=1e-10)


# -- everything at once against an independent integration -------------------------------------------------------------
# -- linear springs between any masses -------------------------------------------------------------------------------
def test_linear_springs_between_masses_join_the_stiffness_matrix():
    more = {"springs_between": [{"masses": [3, 1], "kind": "linear", "stiffness": 4.0}]}
    s = build_system(chain([1, 2, 3], [5, 0, 0, 6], more))
    shape = np.array([p.shape for p in s.probes])
    matrix = np.linalg.inv(shape).T @ np.diag(s.dynamics.stiffness) @ np.linalg.inv(shape)
    np.testing.assert_allclose(matrix, [[9, 0, -4], [0, 0, 0], [-4, 0, 10]], atol=1e-12)
    assert np.sum(s.dynamics.stiffness == 0.0) == 1  # mass 2 floats by itself, exactly


def test_what_a_spring_ties_to_a_held_mass_does_not_float():
    loose = {"masses": [1, 3], "kind": "linear", "stiffness": 1.0}
    s = build_system(chain([1, 1, 1], [2, 0, 0], {"springs_between": [loose]}))
    assert np.sum(s.dynamics.stiffness == 0.0) == 1
    s = build_system(chain([1, 1, 1], [2, 0, 0], {"springs_between": [{**loose, "stiffness": 0.0}]}))
    assert np.sum(s.dynamics.stiffness == 0.0) == 2


def test_breakpoints_moved_out_of_order_by_a_design_are_refused():
    bent = {"mass": 1, "kind": "piecewise_linear", "breakpoints": [0.1, 0.2], "stiffnesses": [3.0, 7.0, 8.0]}
    case = chain([1.0], [4], {"springs_to_ground": [bent]})
    moved = with_values(case, {("chain", "springs_to_ground", 0, "breakpoints", 0): 0.3})
    with pytest.raises(ScenarioError, match=r"springs_to_ground\[0\]\.breakpoints .* do not increase"):
        build_system(moved)
