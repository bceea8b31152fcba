"""Integrals of products of outputs and Fourier integrals against Gauss rules."""

import numpy as np
import pytest

import beamsim
from beamsim.flow.channels import MotionPart
from beamsim.flow.exact import exact_flow
from beamsim.flow.transient import simulate
from beamsim.responses.energies import power_factors
from beamsim.scenario import Scenario
from beamsim.scenario.run import Run
from beamsim.system.build import build_system
from tests.helpers.observed import accelerations, all_outputs


def motion_of(scenario, duration):
    system = build_system(scenario)
    return simulate(exact_flow(system, duration), system.initial_state)


def light_chain(damping):
    """Two masses with next to no damping, shaken near a resonance, above a stop."""
    chain = {
        "masses": [1.0, 0.5], "springs": [40.0, 30.0], "dashpots": [damping, damping],
        "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 300.0, "gap": 0.01}],
    }  # fmt: skip
    shaken = {"kind": "multi_tone", "tones": [{"level": 1.5, "frequency": 0.8}, {"level": 0.5, "frequency": 0.62}]}
    return Scenario.model_validate({"chain": chain, "excitation": {**shaken, "applied_to": "base"}})


def quadrature(motion, begin, times, values_of):
    """Integrals from begin to times of functions of time (nt,) -> (nt, Q), by panels short against the motion."""
    fastest = max(float(np.abs(state.exponent).max()) for state in motion.flow.states)
    even = np.linspace(begin, times[-1], int((times[-1] - begin) * fastest / 5.0) + 2)
    cuts = np.unique(np.concatenate([even, motion.time[motion.time > begin], times, [begin]]))
    cuts = cuts[(cuts >= begin) & (cuts <= times[-1])]
    node, gauss = np.polynomial.legendre.leggauss(20)
    middle, half = 0.5 * (cuts[1:] + cuts[:-1]), 0.5 * np.diff(cuts)
    values = values_of((middle[:, None] + half[:, None] * node).ravel())
    parts = np.einsum("pnq,n,p->pq", values.reshape(half.size, node.size, -1), gauss, half)
    sums = np.vstack([np.zeros((1, parts.shape[1])), np.cumsum(parts, axis=0)])
    return sums[np.searchsorted(cuts, times)]


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-3, 0.3])
def test_work_and_loss_are_those_of_a_fine_rule(damping):
    motion = motion_of(light_chain(damping), 60.0)
    assert motion.exponentials
    assert motion.time.size > 20
    left, right, weight = power_factors(motion.flow)
    times = np.sort(np.append(np.random.default_rng(2).uniform(0.0, 60.0, 3000), 60.0))
    power = lambda at: (motion.sample(at, left) * motion.sample(at, right)) @ weight  # noqa: E731
    fine = quadrature(motion, 0.0, times, power)
    largest = np.abs(fine[:, 1]).max()
    exact = motion.product_integrals(times, left, right, weight)
    np.testing.assert_allclose(exact, fine, rtol=0.0, atol=1e-12 * largest)
    whole = motion.segment_integrals(left, right, weight).sum(axis=0)
    np.testing.assert_allclose(whole, exact[-1], atol=1e-12 * largest)


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-3, 0.3])
def test_mean_squares_are_those_of_a_fine_rule(damping):
    system = build_system(light_chain(damping))
    motion = motion_of(light_chain(damping), 60.0)
    outputs = all_outputs(system, motion.flow)
    part = MotionPart(motion.extract(0.0, 60.0), outputs, 0.0)
    fine = quadrature(motion, 0.0, np.array([60.0]), lambda at: motion.sample(at, outputs) ** 2)[0] / 60.0
    np.testing.assert_allclose(part.mean_squares, fine, rtol=1e-11, atol=1e-13 * fine.max())


@pytest.mark.parametrize("stop", [False, True])
def test_a_loss_keeps_its_digits_after_one_that_is_larger_by_1e17(stop):
    """A free mass on a dashpot: what it loses between two late times is the difference of its energies then."""
    chain = {"masses": [1.0], "springs": [400.0, 0.0], "dashpots": [2.0, 0.0]}
    if stop:  # which it leaves for the last time at the beginning of its decay
        chain["snubbers"] = [{"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0, "gap": 0.01}]
    scenario = {"chain": chain, "run": {"duration": 30.0, "start": {"displacement": [1.0]}}}
    motion = motion_of(Scenario.model_validate(scenario), 30.0)
    assert (motion.event_time.size > 2) == stop
    times = np.concatenate([[20.0], np.sort(np.random.default_rng(4).uniform(20.0, 29.0, 200)), [30.0]])
    left, right, weight = power_factors(motion.flow)
    lost = motion.product_integrals(times, left, right, weight, 20.0)[:, 0]
    energy = 0.5 * (motion.states_at(times)[:, :2] ** 2) @ [400.0, 1.0]
    assert energy[0] < 1e-16 * 200.0
    np.testing.assert_allclose(lost, energy[0] - energy, rtol=0, atol=1e-12 * energy[0])


def test_the_loss_in_histories_is_that_of_the_dampers():
    """Histories follow from the work and the stored energy; here against integrals of the dissipated power."""
    scenario = light_chain(0.3)
    run = {"duration": 20.0, "sample_rate": 50.0, "convergence": "off"}
    histories = beamsim.run(scenario.model_copy(update={"run": Run.model_validate(run)}))["histories"]
    motion = motion_of(scenario, 20.0)
    lost, work = motion.product_integrals(np.arange(1001) / 50.0, *power_factors(motion.flow)).T
    np.testing.assert_allclose(histories["energy_dissipated"].values, lost, rtol=0, atol=1e-12 * lost[-1])
    np.testing.assert_allclose(histories["energy_work_in"].values, work, rtol=0, atol=1e-12 * lost[-1])


STOP = {"name": "stop", "mass": 1, "side": "below", "stiffness": 300.0, "gap": 0.01}
PSD = {"kind": "random", "seed": 3, "sample_rate": 40.0, "psd": [{"frequency": f, "density": 0.5} for f in (0.3, 4.0)]}
PULSE = {"level": 10.0, "duration": 0.3}


def pushed(springs, duration, excitation=None, **more):
    """Two masses above a stop, whose motion has powers of time."""
    chain = {"masses": [1.0, 0.5], "springs": springs, "dashpots": [0.0, 0.2], "snubbers": [STOP]}
    excitation = {"excitation": {**excitation, "applied_to": "base"}} if excitation else {}
    run = {"duration": duration, "start": "rest"}
    return Scenario.model_validate({"chain": chain, **excitation, **more, "run": run})


@pytest.mark.parametrize(
    ("scenario", "duration"),
    [
        (pushed([0.0, 30.0], 3.0, gravity=9.81), 3.0),
        (pushed([0.0, 0.0], 3.0, gravity=9.81), 3.0),  # both fall freely
        (pushed([1e-7, 30.0], 3.0, gravity=9.81), 3.0),  # as good as freely
        (pushed([40.0, 30.0], 5.0, {"kind": "sawtooth", **PULSE}), 5.0),
        (pushed([1e-4, 0.0], 5.0, {"kind": "sawtooth", **PULSE}), 5.0),
        (pushed([40.0, 30.0], 5.0, {"kind": "trapezoid", **PULSE, "rise": 0.05}), 5.0),
        (pushed([40.0, 30.0], 30.0, PSD), 30.0),  # pieces of one length, and those that contacts cut
    ],
)
def test_mean_squares_of_powers_of_time_are_those_of_a_fine_rule(scenario, duration):
    system, motion = build_system(scenario), motion_of(scenario, duration)
    outputs = all_outputs(system, motion.flow)
    part = MotionPart(motion.extract(0.2 * duration, duration), outputs, 0.0)
    squares = lambda at: motion.sample(at, outputs) ** 2  # noqa: E731
    fine = quadrature(motion, 0.2 * duration, np.array([duration]), squares)[0] / (0.8 * duration)
    assert not motion.exponentials
    np.testing.assert_allclose(part.mean_squares, fine, rtol=1e-11, atol=1e-13 * fine.max())


def test_mean_square_of_a_drop_in_closed_form():
    """A mass falls 1 m on a spring: half a sine each time it touches, else free fall."""
    k, g, height = 1e6, 9.81, 1.0
    floor = {"name": "floor", "mass": 1, "side": "below", "stiffness": k, "gap": height}
    chain = {"masses": [1.0], "springs": [0.0], "snubbers": [floor]}
    scenario = Scenario.model_validate({"chain": chain, "gravity": g, "run": {"duration": 3.0, "start": "rest"}})
    system, motion = build_system(scenario), motion_of(scenario, 3.0)
    found = MotionPart(motion.extract(0.0, 3.0), accelerations(system, motion.flow), 0.0).mean_squares[0]
    omega, phase = np.sqrt(k), np.arctan2(g, np.sqrt(k * 2 * g * height))
    touching, square = (np.pi + 2 * phase) / omega, 2 * g * height * k + g**2
    pressed = square * (0.5 * touching - 0.5 * np.sin(2 * phase) / omega)
    assert (motion.touch_changes > 0).sum() == 3
    assert found == pytest.approx((3 * pressed + g**2 * (3.0 - 3 * touching)) / 3.0, rel=1e-11)


def test_fourier_integrals_are_those_of_a_fine_rule():
    """At zero, at the load's own frequency, next to it and to one of a free motion, and far away."""
    system = build_system(light_chain(0.3))
    flow = exact_flow(system, 30.0)
    motion = simulate(flow, system.initial_state)
    assert motion.exponentials
    outputs = all_outputs(system, flow)
    part = MotionPart(motion.extract(5.0, 30.0), outputs, 50.0)
    load = float(np.abs(flow.sources.exponent).max())
    free = float(np.abs(flow.states[0].exponent.imag).max())
    omega = np.array([0.0, load, load * (1.0 + 1e-9), load * (1.0 + 1e-4), free, free * (1.0 + 1e-7), 40.0])

    def turned(at):
        factor = np.exp(-1j * np.multiply.outer(at - 5.0, omega)).view(float)
        return (motion.sample(at, outputs)[:, :, None] * factor[:, None, :]).reshape(at.size, -1)

    fine = quadrature(motion, 5.0, np.array([30.0]), turned)[0].reshape(-1, omega.size, 2) @ [1.0, 1.0j]
    largest = np.abs(fine).max(axis=1, keepdims=True)
    found = part.motion.fourier_integrals(outputs, omega)
    assert np.all(np.abs(found - fine) < 1e-11 * largest)
    for column, (some, size) in enumerate(zip(found, largest, strict=True)):
        assert np.all(np.abs(part.integrals(omega[::-1], column) - some[::-1]) < 1e-11 * size)
