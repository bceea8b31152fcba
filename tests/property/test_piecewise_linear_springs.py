"""Piecewise-linear springs, softening ones among them: equivalence, statics, energy, steady motions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sampling import first_apart
from scipy.integrate import solve_ivp

import beamsim
from beamsim.analyses.nnm.analysis import nnm
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.equilibrium import FLOATING_MESSAGE, UNBALANCED_MESSAGE, CubicSprings, Springs, find_equilibrium
from beamsim.contacts.laws import kelvin_voigt
from beamsim.flow.periodic_flow import Frequency, Level, PeriodicForcing
from beamsim.flow.smooth_flow import SmoothFlow
from beamsim.scenario import Scenario
from beamsim.system.build import build_system
from beamsim.system.equations import PiecewiseLinearSystem


def random_chain(rng, count, springs, between):
    """A supported chain with a random start and piecewise-linear springs of every kind."""
    run = {
        "duration": 15.0, "sample_rate": 20.0,
        "start": {"displacement": rng.normal(size=count).tolist(), "velocity": rng.normal(size=count).tolist()},
    }  # fmt: skip
    excitation = {"kind": "harmonic", "applied_to": "base", "level": 0.3, "frequency": float(rng.uniform(0.05, 0.5))}
    return Scenario.model_validate(
        {
            "chain": {
                "masses": rng.uniform(0.5, 2, count).tolist(),
                "springs": rng.uniform(0.2, 2, count + 1).tolist(),
                "dashpots": (rng.uniform(0, 0.1, count + 1) * rng.integers(0, 2)).tolist(),
                "springs_to_ground": springs,
                "springs_between": between,
            },
            "excitation": excitation,
            "run": run,
        }
    )


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 1_000_000))
def test_one_breakpoint_is_a_linear_spring_and_a_snubber(seed):
    """... where it hardens; where it softens, a stiffer linear spring less that snubber turned round."""
    rng = np.random.default_rng(seed)
    bend, inner, change = float(rng.uniform(0.01, 0.5)), float(rng.uniform(0.1, 2)), float(rng.uniform(0.1, 5))
    above = bool(rng.integers(2))
    slopes = [inner, inner + change] if above else [inner + change, inner]
    law = {"kind": "piecewise_linear", "breakpoints": [bend if above else -bend], "stiffnesses": slopes}
    linear = {"kind": "linear", "stiffness": inner}
    stop = {"stiffness": change, "gap": bend}
    between = bool(rng.integers(2))
    place = {"masses": [1, 2]} if between else {"mass": 2}
    if between:
        stop |= {"between": [2, 1], "resists": "separation" if above else "approach"}
    else:
        stop |= {"mass": 2, "side": "above" if above else "below", "mounted_on": "ground"}
    lists = ([], [{**place, **law}]) if between else ([{**place, **law}], [])
    state = rng.bit_generator.state
    bent = beamsim.run(random_chain(rng, 3, *lists))
    rng.bit_generator.state = state
    lists = ([], [{**place, **linear}]) if between else ([{**place, **linear}], [])
    case = random_chain(rng, 3, *lists)
    stops = [Scenario.model_validate({"chain": {"masses": [1, 1], "springs": [1, 1], "snubbers": [stop]}})]
    case = case.model_copy(update={"chain": case.chain.model_copy(update={"snubbers": stops[0].chain.snubbers})})
    case = case.model_copy(update={"probes": bent.scenario.effective_probes})
    same = beamsim.run(case)
    for name in bent["histories"].labels("probe"):
        np.testing.assert_allclose(
            same["histories"]["displacement"].sel(probe=name).values,
            bent["histories"]["displacement"].sel(probe=name).values,
            atol=1e-10,
        )
    assert bent.summary["solver_events"] == same.summary["events"]
    (force,), (stretch,) = (bent["histories"][f"spring_{name}"].values for name in ("force", "extension"))
    sign = 1.0 if above else -1.0
    np.testing.assert_allclose(force, inner * stretch + sign * same["histories"]["snubber_force"].values[0], atol=1e-9)


# -- statics ---------------------------------------------------------------------------------------------------------
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1_000_000))
def test_static_equilibrium_with_softening_springs(seed):
    """The gradient of the energy vanishes there, and no other point has less energy."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 5))
    phi = rng.normal(size=(m, n))
    k = rng.uniform(0.1, 10, m)  # linear parts, which soften to something that is not negative
    values, vectors = np.linalg.eigh(np.diag(rng.uniform(0.01, 3, n)) + phi.T @ (k[:, None] * phi))
    shape = phi @ vectors
    springs = Springs(shape, rng.choice([-1.0, 1.0], m), -k * rng.uniform(0.2, 1, m), rng.uniform(0, 1, m))
    load = rng.normal(size=n) * 10 ** rng.uniform(-2, 2)
    found = find_equilibrium(values, 0, springs, load[None, :])
    assert found.reason == ""

    def energy(q):
        delta = np.maximum(-springs.gap - springs.sign * (shape @ q), 0)
        return q @ (values * q) / 2 + springs.stiffness @ delta**2 / 2 - load @ q

    delta = np.maximum(-springs.gap - springs.sign * (shape @ found.q), 0)
    gradient = values * found.q - shape.T @ (springs.sign * springs.stiffness * delta) - load
    assert np.abs(gradient).max() < 1e-8 * np.abs(load).max()
    np.testing.assert_allclose(found.force, springs.stiffness * delta)
    least = energy(found.q)
    for _ in range(20):
        assert energy(found.q + rng.normal(size=n) * np.abs(found.q).max()) >= least - 1e-9 * abs(least)


def one_mass(slopes, load, bends=(-1.0, 1.0)):
    law = {"kind": "piecewise_linear", "breakpoints": list(bends), "stiffnesses": slopes}
    chain = {"masses": [1], "springs": [0], "springs_to_ground": [{"mass": 1, **law}]}
    forces = [{"mass": 1, "force": load}] if load else []
    return build_system(Scenario.model_validate({"chain": chain, "constant_forces": forces}))


def test_statics_of_one_mass_on_a_softening_spring():
    s = one_mass([0.5, 2.0, 0.5], 3.0)
    assert s.probes[0].shape @ s.static_equilibrium == pytest.approx(3.0, rel=1e-12)  # 2 + 0.5 (x - 1) = 3
    assert one_mass([0.5, 2.0, 0.5], 0.0).static_equilibrium == pytest.approx([0.0])
    assert one_mass([0.0, 2.0, 0.0], 3.0).static_reason == UNBALANCED_MESSAGE
    assert one_mass([0.0, 2.0, 0.0], 2.0).static_reason == FLOATING_MESSAGE  # anywhere beyond the breakpoint
    assert one_mass([0.0, 2.0, 0.0], 1.0).static_reason == ""
    assert one_mass([2.0, 0.0, 2.0], 0.0).static_reason == FLOATING_MESSAGE  # a dead band
    assert one_mass([2.0, 1.0, 0.0, 4.0], 3.0, (-1.0, 1.0, 2.0)).static_reason == ""
    assert one_mass([2.0, 1.0, 0.0, 4.0], 1.0, (-1.0, 1.0, 2.0)).static_reason == FLOATING_MESSAGE


@pytest.mark.parametrize("load", [0.0, 1e-3])
def test_statics_of_a_softening_spring_beside_a_very_stiff_stop(load):
    """Soft parts of the energy are the round-off of the stop's, and its force cancels in its gap."""
    stiffness = np.array([490.0, 8470.0, 15100.0])
    springs = Springs(
        shape=np.array([[0.51, 1.32, -2.21], [0.2, -1.09, 0.77]]),
        sign=np.array([1.0, -1.0]),
        stiffness=np.array([1.6e11, -3.36e3]),
        gap=np.array([-1.2e-10, 1.3e-5]),
    )
    equilibrium = find_equilibrium(stiffness, 0, springs, load * np.ones((1, 3)))
    row = springs.shape[0]
    force = (1.2e-10 - row @ (load / stiffness)) / (1 / 1.6e11 + row @ (row / stiffness))  # its stretch stays small
    np.testing.assert_allclose(equilibrium.q, (load + max(force, 0.0) * row) / stiffness, rtol=1e-9)


STOP = 1e12  # N/m, beside modes whose squares are 3 to 6e10 (rad/s)^2
HELD = {  # slopes, directions and gaps of the parts of two contacts, and whether they leave a motion free
    "a stiff stop that gives way stays open": ([STOP, -0.6 * STOP, -1.0], [1, 1, 1], [1e-3, 2e-3, 1.0], False),
    "a stiff stop that gives way is pressed": ([STOP, -0.6 * STOP, -1.0], [1, 1, 1], [-2e-3, -1e-3, 1.0], False),
    "pressed, and no stiffer from there on": ([STOP, -STOP, -1.0], [1, 1, 1], [-2e-3, -1e-3, 1.0], False),
    "a spring softens beside a stop that is pressed": ([STOP, 0.5 * STOP, -2.0], [1, 1, -1], [-1e-9, 1.0, -1.0], False),
    "a spring takes all stiffness": ([STOP, 0.5 * STOP, -3.0], [1, 1, 1], [1e-3, 1.0, 0.0], True),
    "it takes all, and presses on a stiff stop": ([STOP, 0.5 * STOP, -3.0], [1, 1, 1], [1e-3, 1.0, -1.0], False),
}


@pytest.mark.parametrize("case", HELD)
def test_softening_parts_beside_very_stiff_stops_and_soft_modes(case):
    """Whether a motion is held does not depend on how stiff other things are, found by the attack (10,002,568)."""
    slopes, sign, gap, floats = HELD[case]
    shape = np.array([[1.0, -0.7, 0.4], [1.0, -0.7, 0.4], [1.0, 0.0, 0.0]])
    springs = Springs(shape, np.array(sign, float), np.array(slopes), np.array(gap), np.array([0, 0, 1]))
    found = find_equilibrium(np.array([3.0, 2e4, 6e10]), 0, springs, np.zeros((1, 3)))
    assert found.reason == (FLOATING_MESSAGE if floats else "")


def test_a_cubic_spring_holds_what_a_softened_spring_lets_go():
    springs = Springs(np.ones((1, 1)), np.array([-1.0]), np.array([-2.0]), np.array([1.0]))
    alone = find_equilibrium(np.array([2.0]), 0, springs, np.array([[5.0]]))
    assert alone.reason == UNBALANCED_MESSAGE
    held = find_equilibrium(
        np.array([2.0]), 0, springs, np.array([[5.0]]), CubicSprings(np.ones((1, 1)), np.array([0.1]))
    )
    assert held.q[0] == pytest.approx(np.cbrt(30.0), rel=1e-10)  # 2 + 0.1 x^3 = 5


def random_smooth_system(rng, n=3, m=2):
    """Cubic springs and contacts, some of them on the ground, under base motion."""
    stiffness = np.sort(rng.uniform(0.5, 9, n))
    damping = np.diag(0.05 * np.sqrt(stiffness))
    laws = (kelvin_voigt(6.0, 0.2), kelvin_voigt(-0.3, 0.0))
    contacts = Contacts(rng.normal(size=(m, n)), np.array([1.0, -1.0]), np.array([0.1, 0.15]), np.ones(m, bool), laws)
    system = PiecewiseLinearSystem(stiffness, damping, contacts, np.zeros(n))
    loads = PeriodicForcing(
        np.array([1, 2]), 0.3 * (rng.normal(size=(2, n)) + 1j * rng.normal(size=(2, n))), np.array([0.0, 1.0]),
        np.array([[0.2 - 0.1j], [0.05j]]), np.array([-2.0, 0.0]), 1.3,
    )  # fmt: skip
    return system, rng.normal(size=(2, n)), np.array([0.8, 0.3]), loads


@pytest.mark.parametrize("seed", range(1))
def test_cubic_springs_and_contacts_on_the_ground_under_base_motion(seed):
    """Flow by power series against an independent integration, its derivatives against differences."""
    rng = np.random.default_rng(seed)
    system, shape, cubic, loads = random_smooth_system(rng)
    c, n, omega, on_ground = system.contacts, system.size, 1.1, np.array([True, False])
    start = 0.3 * rng.normal(size=2 * n)

    def flow(w=omega, level=1.4):
        return SmoothFlow(system, loads, w, level, springs=CubicSprings(shape, cubic, on_ground.astype(float)[:, None]))

    def rhs(t, y, felt=on_ground):
        q, v = y[:n], y[n:]
        force, base, _, _ = loads.at(omega, 1.4)
        wave = np.exp(1j * loads.multiple * omega * t)
        d, rate = (base[:, 0] @ wave).real, (base[:, 0] @ (1j * loads.multiple * omega * wave)).real
        delta, speed = -c.gap - c.sign * (c.shape @ q + d), -c.sign * (c.shape @ v + rate)
        push = np.where(delta > 0, c.stiffness * delta + c.dashpot * speed, 0.0)
        a = (force * wave[:, None]).sum(axis=0).real - system.stiffness * q - system.damping @ v
        return np.concatenate([v, a + (c.sign * push) @ c.shape - (cubic * (shape @ q + felt * d) ** 3) @ shape])

    flow_map = flow().flow_map(start, 6.0, (Frequency(), Level()), 0.7)
    found = solve_ivp(rhs, (0.7, 6.7), start[: 2 * n], "DOP853", rtol=1e-11, atol=1e-12, max_step=0.02).y[:, -1]
    np.testing.assert_allclose(flow_map.end[: 2 * n], found, atol=2e-6)  # the dashpot's jumps cost the other digits
    everything = solve_ivp(lambda t, y: rhs(t, y, np.ones(2)), (0.7, 6.7), start[: 2 * n], rtol=1e-6).y[:, -1]
    assert np.abs(everything - found).max() > 1e-3  # the twin: both cubic springs on the ground
    assert flow_map.event_time.size >= 2
    step = 1e-6
    for column, moved in enumerate((lambda h: flow(w=omega + h), lambda h: flow(level=1.4 + h))):
        ends = [moved(h).flow_map(start, 6.0, (), 0.7).end for h in (-step, step)]
        slope = (ends[1] - ends[0]) / (2 * step)
        np.testing.assert_allclose(
            flow_map.parameters[: 2 * n, column], slope[: 2 * n], atol=2e-7 * (1 + abs(slope).max())
        )
    times = np.array([1.0, 1.0 + 1e-6])
    delta, rate = flow().penetration_of(flow().states_at(flow_map, times), times)
    np.testing.assert_allclose(np.diff(delta, axis=0)[0] / 1e-6, rate[0], atol=1e-5)


# -- nonlinear modes -------------------------------------------------------------------------------------------------
LAWS = {"hardening": [4.0, 1.0, 3.0], "softening": [0.3, 1.0, 0.5]}


@first_apart("law", 1, LAWS)
def test_modes_of_a_chain_with_a_piecewise_linear_spring_in_the_stiffness_factor(law, monkeypatch):
    """At the last factor the motion is that of the spring as given: a run from it returns after a period."""
    monkeypatch.setattr("beamsim.analyses.nnm.paths.POINTS", 20)
    spring = {"masses": [1, 3], "kind": "piecewise_linear", "breakpoints": [-0.2, 0.3], "stiffnesses": LAWS[law]}
    chain = {"masses": [1, 1.5, 0.8], "springs": [1, 1, 1, 1], "springs_between": [spring]}
    probes = [{"name": f"m{i}", "mass": i} for i in (1, 2, 3)]
    case = Scenario.model_validate({"chain": chain, "nnm": {"mode": 3, "energy": 0.5}, "probes": probes})
    backbone = nnm(case).branches[0]
    assert backbone["status"].item().startswith("reached the end of the range")
    assert backbone["residual"].values.max() < 1e-10
    period = 1 / backbone["frequency_hz"].values[-1]
    start = {"displacement": backbone["initial_displacement"].values[-1].tolist()}
    run = {"duration": period * 1.0001, "sample_rate": 1 / period, "start": start}
    motion = beamsim.run(Scenario.model_validate({"chain": chain, "run": run, "probes": probes}))
    for name in motion["histories"].labels("probe"):
        assert motion["histories"]["displacement"].sel(probe=name).values[1] == pytest.approx(
            motion["histories"]["displacement"].sel(probe=name).values[0], abs=1e-8
        )
    assert motion.summary["solver_events"] >= 4
    assert (period < 1 / backbone["frequency_hz"].values[0]) == (law == "hardening")
