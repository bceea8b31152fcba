"""Pads of tables, dashpots and Maxwell branches: closed forms and limits; random pads are in the attack."""

import numpy as np
import pytest
from balance import energy_history

import beamsim
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.pads import ForceCurve, MaxwellBranch, recovering_law, table_law
from beamsim.errors import ScenarioError
from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system
from beamsim.system.equations import Forcing, PiecewiseLinearSystem
from tests.helpers.observed import velocities

CURVE = ForceCurve(np.array([0.0, 0.1, 0.25, 0.4]), np.array([0.0, 1.5, 6.0, 9.0]))
LINE = ForceCurve(np.array([0.0, 1.0]), np.array([0.0, 20.0]))
TWO = (MaxwellBranch(20.0, 0.15), MaxwellBranch(5.0, 1.0))
START = np.array([0.03, 0.0, 0.3, -0.1])
LOAD, OMEGA, GAP = np.array([2.0, 1.2]), 1.3, 0.05
SHAPE = np.array([1.0, 0.4])
PADS = [
    (CURVE, 0.8, ()),
    (LINE, 0.0, TWO[:1]),
    (CURVE, 0.0, TWO),
    (CURVE, 0.5, TWO),
    (ForceCurve(np.array([0.0, 0.05, 0.3, 0.5]), np.array([0.0, 2.0, 2.0, 9.0])), 0.3, TWO[1:]),
]


def system_of(law, gap=GAP, stiffness=(1.0, 9.0), damping=(0.05, 0.1)):
    contacts = Contacts(SHAPE[None], np.array([-1.0]), np.array([gap]), np.array([False]), (law,))
    return PiecewiseLinearSystem(np.array(stiffness), np.diag(damping), contacts, np.zeros(2))


def moved(law, duration=20.0, load=LOAD, start=START, **others):
    forcing = Forcing(load[None], (Signal.harmonic(1.0, OMEGA),))
    return simulate(ExactFlow(system_of(law, **others), forcing, duration), start)


@pytest.mark.parametrize(("curve", "dashpot", "branches"), [PADS[0], PADS[3]])
def test_a_pad_that_is_left_too_fast_at_the_start_is_released_there(curve, dashpot, branches):
    """Its face lies where the structure is: it has not been touched at t = 0 once more, and its energy is counted."""
    pressed = np.append([0.35, 0.0, -40.0, 0.0, 0.3], np.full(len(branches), 0.3))  # by 0.3, the face given as well
    settled = pressed.copy()
    settled[4] = 0.0
    trajectory = moved(recovering_law(curve, dashpot, branches), duration=1.0, start=settled)
    np.testing.assert_array_equal(trajectory.y[0], pressed)
    assert trajectory.event_time.min() > 1e-3
    assert energy_history(trajectory, np.linspace(0.0, 1.0, 30)).error < 1e-12


def test_a_pad_never_pulls():
    for curve, dashpot, branches in PADS:
        trajectory = moved(recovering_law(curve, dashpot, branches))
        times = np.linspace(0.0, 20.0, 2001)
        force = trajectory.sample(times, lambda phases, flow=trajectory.flow: flow.at(phases).force)
        assert force.min() > -1e-12
        assert force.max() > 1.0


def test_step_response_of_a_zener_element():
    """A mass on a spring, pressed into the pad all the time: roots of the cubic characteristic polynomial."""
    k, km, tau = 20.0, 20.0, 0.15
    contacts = Contacts(
        np.ones((1, 1)), np.array([-1.0]), np.zeros(1), np.array([False]), (recovering_law(LINE, 0.0, TWO[:1]),)
    )
    system = PiecewiseLinearSystem(np.array([1.0]), np.zeros((1, 1)), contacts, np.array([3.0]))
    trajectory = simulate(ExactFlow(system, Forcing(np.zeros((0, 1)), ()), 6.0), np.zeros(2))
    # x'' + x + k x + km (x - p) = 3, tau p' = x - p
    roots = np.roots([tau, 1.0, tau * (1.0 + k + km), 1.0 + k])
    end = 3.0 / (1.0 + k)
    amplitudes = np.linalg.solve(np.vander(roots, 3, increasing=True).T, np.array([-end, 0.0, 3.0]))
    times = np.linspace(0.0, 6.0, 200)
    expected = end + (np.exp(np.multiply.outer(times, roots)) @ amplitudes).real
    assert expected[1:].min() > 0.0
    np.testing.assert_allclose(trajectory.states_at(times)[:, 0], expected, atol=1e-13)


@pytest.mark.parametrize("omega", [0.4, 3.0, 30.0])
def test_work_lost_in_a_branch_in_a_cycle(omega):
    """pi k w tau / (1 + (w tau)^2) X^2, from the motion of a pad that stays pressed."""
    k, tau = TWO[0].stiffness, TWO[0].relaxation_time
    system = system_of(recovering_law(LINE, 0.0, TWO[:1]), gap=-1.0)
    flow = ExactFlow(system, Forcing(0.05 * LOAD[None], (Signal.harmonic(1.0, omega),)), 1e4)
    period = 2 * np.pi / omega
    last = np.floor(600.0 / period) * period
    trajectory = simulate(flow, np.concatenate([np.zeros(4), [1.0]]))
    times = last + np.linspace(0.0, period, 401)
    history = energy_history(trajectory, np.concatenate([[0.0], times])).history
    x = trajectory.sample(times, lambda phases: flow.equations.penetration)[:, 0]
    v = trajectory.sample(times, velocities(flow))
    amplitude = 2.0 * abs(np.mean(x[:-1] * np.exp(-1j * omega * times[:-1])))
    assert x.min() > 0.0
    in_structure = period * np.mean(v[:-1] ** 2, axis=0) @ system.damping.diagonal()
    lost = history.dissipated[-1] - history.dissipated[1] - in_structure
    expected = np.pi * k * omega * tau / (1.0 + (omega * tau) ** 2) * amplitude**2
    assert lost == pytest.approx(expected, rel=1e-8)


def test_after_a_long_rest():
    law = recovering_law(CURVE, 0.5, TWO)
    assert law.relaxed_states(0.3) == (0.0, 0.3, 0.3)
    assert law.phases[law.resting_phase(0.3)].name == "segment 3"
    assert law.phases[law.resting_phase(-0.1)].name == "released 1"
    assert law.static_force(0.3) == pytest.approx(7.0)
    assert law.undamped_law is None
    assert recovering_law(CURVE, 0.5).undamped() == table_law(CURVE)
    omega = np.array([0.7, 5.0])
    modulus = law.dynamic_stiffness(law.resting_phase(0.3), omega)
    expected = (
        20.0
        + 0.5j * omega
        + sum(b.stiffness * 1j * omega * b.relaxation_time / (1 + 1j * omega * b.relaxation_time) for b in TWO)
    )
    np.testing.assert_allclose(modulus, expected, rtol=1e-13)


CHAIN = {
    "chain": {"masses": [1.0, 1.0], "springs": [400.0, 400.0], "damping": {"kind": "modal", "ratio": 0.02}},
    "excitation": {"kind": "harmonic", "applied_to": {"mass": 2}, "level": 1.0, "frequency": 2.0},
    "run": {"duration": 3.0, "sample_rate": 200, "convergence": "off"},
}


def chain(maxwell, **others):
    stop = {"name": "pad", "mass": 1, "side": "above", "stiffness": 300.0, "maxwell": maxwell}
    return {**CHAIN, "chain": {**CHAIN["chain"], "snubbers": [{**stop, **others}]}}


BRANCH = {"stiffness": 500.0, "relaxation_time": 0.05}


def test_a_branch_in_a_scenario():
    run = beamsim.run(load_scenario(chain([BRANCH])))
    assert run.summary["contacts"]["pad"] >= 3
    assert run.summary["energy_error"] < 1e-10
    assert run["histories"]["snubber_force"].sel(snubber="pad").values.min() >= -1e-12
    stepped = beamsim.run(load_scenario({**chain([BRANCH]), "run": {**CHAIN["run"], "method": "reference"}}))
    apart = (
        run["histories"]["displacement"].sel(probe="pad").values
        - stepped["histories"]["displacement"].sel(probe="pad").values
    )
    assert np.abs(apart).max() < 1e-5 * np.abs(run["histories"]["displacement"].sel(probe="pad").values).max()
    nothing = beamsim.run(load_scenario(chain([{**BRANCH, "stiffness": 0.0}])))
    bare = beamsim.run(load_scenario(chain([])))
    np.testing.assert_array_equal(
        nothing["histories"]["displacement"].sel(probe="pad").values,
        bare["histories"]["displacement"].sel(probe="pad").values,
    )


def test_a_pad_rests_at_the_start():
    """At static equilibrium a prestressed pad has relaxed, and nothing moves."""
    case = {**chain([BRANCH], gap=-0.1), "excitation": {"kind": "none"}}
    run = beamsim.run(load_scenario(case))
    assert run["histories"]["snubber_preload"].sel(snubber="pad").item() == pytest.approx(
        run["histories"]["snubber_force"].sel(snubber="pad").values[0], rel=1e-12
    )
    assert (
        np.ptp(run["histories"]["snubber_force"].sel(snubber="pad").values)
        < 1e-12 * run["histories"]["snubber_preload"].sel(snubber="pad").item()
    )


def test_what_needs_contacts_without_losses_says_so():
    case = {**chain([BRANCH]), "run": None, "nnm": {"mode": 1}}
    with pytest.raises(ScenarioError, match=r"nnm needs contacts without losses.*leave out maxwell of pad"):
        beamsim.nnm(load_scenario(case))
    springs = [{"kind": "cubic", "mass": 2, "stiffness": 5.0}]
    case = chain([BRANCH])
    case["chain"]["springs_to_ground"] = springs
    with pytest.raises(ScenarioError, match=r"maxwell cannot be combined with cubic springs"):
        build_system(load_scenario(case))


def driven(**sections):
    """Two masses; the second is shaken."""
    return load_scenario({**CHAIN, "chain": {**CHAIN["chain"], **sections}})


def by_matrices(links, stiffness, damping_ratio=0.02):
    """Displacements of CHAIN with branches on stretches, as one linear system: exact by its exponential."""
    from scipy.linalg import expm

    n, m = 2, len(links)
    own = np.array([[800.0, -400.0], [-400.0, 400.0]]) + stiffness
    omega2, modes = np.linalg.eigh(own)
    damping = modes @ np.diag(2 * damping_ratio * np.sqrt(omega2)) @ modes.T
    a = np.zeros((2 * n + m + 2, 2 * n + m + 2))  # and sine and cosine of the load
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n, :n], a[n : 2 * n, n : 2 * n] = -own, -damping
    for j, (row, k, tau) in enumerate(links):
        row = np.array(row, dtype=float)
        a[n : 2 * n, :n] -= k * np.outer(row, row)
        a[n : 2 * n, 2 * n + j] += k * row
        a[2 * n + j, :n], a[2 * n + j, 2 * n + j] = row / tau, -1.0 / tau
    omega = 2 * np.pi * CHAIN["excitation"]["frequency"]
    a[n + 1, -2] = 1.0
    a[-2, -1], a[-1, -2] = omega, -omega
    start = np.zeros(a.shape[0])
    start[-1] = 1.0
    step = expm(a / 200.0)
    states = [start]
    for _ in range(600):
        states.append(step @ states[-1])
    return np.array(states)


def test_springs_with_branches_are_a_linear_system():
    branch = {"stiffness": 500.0, "relaxation_time": 0.05}
    other = {"stiffness": 200.0, "relaxation_time": 0.4}
    run = beamsim.run(
        driven(
            springs_to_ground=[{"kind": "linear", "mass": 1, "stiffness": 100.0, "maxwell": [branch, other]}],
            springs_between=[{"kind": "linear", "masses": [1, 2], "stiffness": 50.0, "maxwell": [other]}],
        )
    )
    links = [([1, 0], 500.0, 0.05), ([1, 0], 200.0, 0.4), ([-1, 1], 200.0, 0.4)]
    stiffness = np.diag([100.0, 0.0]) + 50.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    states = by_matrices(links, stiffness)
    scale = np.abs(states[:, 1]).max()
    (displacement,) = run["histories"]["displacement"].values
    np.testing.assert_allclose(displacement, states[:, 1], atol=1e-11 * scale)
    assert run.summary["energy_error"] < 1e-10
    forces = run["histories"]["spring_force"]
    ground, link = (forces.sel(spring=f"{name}_spring_1").values for name in ("ground", "link"))
    x, p = states[:, 0], states[:, 4:7]
    np.testing.assert_allclose(ground, 100.0 * x + 500.0 * (x - p[:, 0]) + 200.0 * (x - p[:, 1]), atol=1e-9 * scale)
    stretch = states[:, 1] - x
    np.testing.assert_allclose(link, 50.0 * stretch + 200.0 * (stretch - p[:, 2]), atol=1e-9 * scale)
    assert run.summary["peak_spring_force_n"]["link_spring_1"] >= np.abs(link).max() * (1 - 1e-12)
    assert run.summary["peak_spring_force_n"]["link_spring_1"] < np.abs(link).max() * 1.05


def test_a_piecewise_linear_spring_with_a_branch_against_time_stepping():
    bent = {"kind": "piecewise_linear", "mass": 2, "breakpoints": [-1e-3, 2e-3], "stiffnesses": [900.0, 100.0, 600.0],
            "maxwell": [{"stiffness": 300.0, "relaxation_time": 0.1}]}  # fmt: skip
    run = {**CHAIN["run"], "duration": 1.0}
    chain = {**CHAIN, "run": run, "chain": {**CHAIN["chain"], "springs_to_ground": [bent]}}
    exact = beamsim.run(load_scenario(chain))
    stepped = beamsim.run(load_scenario({**chain, "run": {**run, "method": "reference"}}))
    (one,), (other,) = (each["histories"]["displacement"].values for each in (exact, stepped))
    assert np.abs(one - other).max() < 1e-5 * np.abs(one).max()
    assert np.abs(one).max() > 2.2e-3
    assert exact.summary["energy_error"] < 1e-10


def test_a_joint_with_a_branch():
    """A beam on a joint to the base with a branch, and on a spring to ground with the same; nothing moves the base."""
    beam = {
        "length": 0.3, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700, "elements": 4,
        "supports": {"left": "clamped", "right": "free"}, "damping": {"kind": "modal", "ratio": 0.01},
    }  # fmt: skip
    common = {
        "beam": beam, "probes": [{"name": "tip", "position": 0.3}],
        "excitation": {"kind": "step", "applied_to": {"position": 0.3}, "level": 5.0},
        "run": {"duration": 0.05, "sample_rate": 5000, "convergence": "off"},
    }  # fmt: skip
    branch = {"stiffness": 3000.0, "relaxation_time": 0.01}
    joint = {"kind": "spring", "between": ["base", {"position": 0.3}], "stiffness": 2000.0, "maxwell": [branch]}
    spring = {"kind": "linear", "position": 0.3, "stiffness": 2000.0, "maxwell": [branch]}
    joined = beamsim.run(load_scenario({**common, "joints": [joint]}))
    sprung = beamsim.run(load_scenario({**common, "springs_to_ground": [spring]}))
    scale = np.abs(sprung["histories"]["displacement"].sel(probe="tip").values).max()
    np.testing.assert_allclose(
        joined["histories"]["displacement"].sel(probe="tip").values,
        sprung["histories"]["displacement"].sel(probe="tip").values,
        atol=1e-10 * scale,
    )
    stiffer = beamsim.run(load_scenario({**common, "springs_to_ground": [{**spring, "maxwell": []}]}))
    assert (
        np.abs(
            stiffer["histories"]["displacement"].sel(probe="tip").values
            - sprung["histories"]["displacement"].sel(probe="tip").values
        ).max()
        > 0.05 * scale
    )
    assert joined.summary["energy_error"] < 1e-10
