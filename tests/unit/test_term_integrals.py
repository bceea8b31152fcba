"""Integrals of products of outputs by products of matrices, against Gauss rules and the compiled closed form."""

from pathlib import Path

import numpy as np
import pytest

import beamsim
from beamsim.analyses.run.energy import power_factors
from beamsim.analyses.run.outputs import exact_flow, output_groups
from beamsim.flow import fourier_kernels, integral_kernels, march_kernels
from beamsim.flow.fourier import MotionPart
from beamsim.flow.quadratic_forms import forms
from beamsim.flow.term_integrals import IntegratedForm
from beamsim.flow.transient import simulate
from beamsim.scenario import Scenario
from beamsim.system.build import build_system

CASE = Path(__file__).parents[2] / "configs" / "one_sided_65hz.yaml"


def motion_of(scenario, duration):
    system = build_system(scenario)
    return simulate(exact_flow(system, duration), system.initial_state)


def works(motion):
    """Table of the factors of powers, and their weights."""
    left, right, weight = power_factors(motion.flow)
    return np.concatenate([motion.flow.output_table(left), motion.flow.output_table(right)], axis=2), weight


def light_chain(damping):
    """Two masses with next to no damping, shaken near a resonance, above a stop."""
    chain = {
        "masses": [1.0, 0.5], "springs": [40.0, 30.0], "dashpots": [damping, damping],
        "snubbers": [{"name": "stop", "mass": 2, "side": "below", "stiffness": 300.0, "gap": 0.01}],
    }  # fmt: skip
    shaken = {"kind": "multi_tone", "tones": [{"level": 1.5, "frequency": 0.8}, {"level": 0.5, "frequency": 0.62}]}
    return Scenario.model_validate({"chain": chain, "excitation": {**shaken, "applied_to": "base"}})


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 1.0])
def test_a_form_is_integrated_however_slow_a_pair_is(size):
    rng = np.random.default_rng(5)
    exponent = np.array([0.0, 30.0j, 30.0j * (1.0 + size) - 2.0 * size, -40.0 + 7.0j, -3.0, -size])
    left, right = rng.normal(size=(2, 6, 3, 2)) @ [1.0, 1.0j]
    amplitude = rng.normal(size=(4, 6, 2)) @ [1.0, 1.0j]
    segment, tau = np.array([0, 3, 1, 2, 2]), np.array([0.3, 1e-7, 0.0, 0.2, 0.7])
    of_product = forms([(left, right)])[:, None]
    integrals = IntegratedForm.of(exponent, of_product, 0.7)(amplitude, segment, tau)
    point, gauss = np.polynomial.legendre.leggauss(200)
    for g, t, integral in zip(segment, tau, integrals[:, 0], strict=True):
        at = 0.5 * t * (1.0 + point)
        terms = amplitude[g] * np.exp(exponent * at[:, None])
        product = ((terms @ left).real * (terms @ right).real).sum(axis=1)
        assert abs(integral - 0.5 * t * (gauss @ product)) < 1e-12 * np.abs(amplitude[g]).max() ** 2


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-3, 0.3])
def test_work_and_loss_are_those_of_the_compiled_closed_form(damping):
    motion = motion_of(light_chain(damping), 60.0)
    assert motion.exponentials
    assert motion.time.size > 20
    table, weight = works(motion)
    times = np.sort(np.random.default_rng(2).uniform(0.0, 60.0, 3000))
    compiled = motion._integrals(times, table, weight)
    largest = np.abs(compiled[:, 1]).max()
    np.testing.assert_allclose(motion.integrals(times, table, weight), compiled, rtol=0.0, atol=1e-12 * largest)
    segments = motion.segment_integrals(table, weight)
    np.testing.assert_allclose(motion.work_of_segments(*power_factors(motion.flow)), segments, atol=1e-12 * largest)
    whole = segments.sum(axis=0)
    np.testing.assert_allclose(whole, motion._integrals(np.array([60.0]), table, weight)[0], atol=1e-12 * largest)


def test_integrals_count_from_a_later_time_on():
    motion = motion_of(light_chain(0.3), 30.0)
    table, weight = works(motion)
    times = np.linspace(3.0, 30.0, 200)
    late = motion.integrals(times, table, weight, 2.0)
    since = motion.integrals(np.append(2.0, times), table, weight)
    np.testing.assert_allclose(late, since[1:] - since[0], rtol=1e-12)
    assert np.abs(late - motion.integrals(times, table, weight)).max() > 1e-6


def test_energies_of_motions_without_powers_of_time_call_no_kernel(monkeypatch):
    def refuse(*arguments):
        raise AssertionError("a compiled integral was asked for")

    monkeypatch.setattr(integral_kernels, "product_integrals", refuse)
    monkeypatch.setattr(integral_kernels, "form_integrals", refuse)
    result = beamsim.run(beamsim.load_scenario(CASE, {"run.duration": "0.5 s"}))
    assert np.all(np.isfinite(result.energy.dissipated))
    assert result.summary["energy_error"] < 1e-12


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-3, 0.3])
def test_mean_squares_are_those_of_the_compiled_closed_form(damping):
    motion = motion_of(light_chain(damping), 60.0)
    table, _ = works(motion)
    count = table.shape[2]
    both = np.concatenate([table, table], axis=2)
    compiled = motion._integrals(np.array([60.0]), both, np.eye(count))[0]
    np.testing.assert_allclose(motion.square_integrals(table), compiled, rtol=1e-11, atol=1e-13 * compiled.max())


def test_what_outputs_ask_for_alike_is_worked_out_once_for_all(monkeypatch):
    system = build_system(light_chain(0.3))
    flow = exact_flow(system, 30.0)
    motion = simulate(flow, system.initial_state)
    whole = MotionPart.of(motion, output_groups(system, flow), 5.0, 30.0, 1e9)
    outputs, omega = whole.table.shape[2], np.array([0.0, 3.0, 5.1])
    alone = [whole.between(5.0, 30.0).one(j).integrals(omega) for j in range(outputs)]
    squares = [whole.between(5.0, 30.0).one(j).mean_squares() for j in range(outputs)]
    calls, transformed, summed = [], MotionPart._integrals, type(motion).square_integrals

    def counted(name, function):
        def call(*arguments):
            calls.append(name)
            return function(*arguments)

        return call

    monkeypatch.setattr(MotionPart, "_integrals", counted("fourier", transformed))
    monkeypatch.setattr(type(motion), "square_integrals", counted("squares", summed))
    assert outputs > 3
    for j in range(outputs):
        one = whole.one(j)
        np.testing.assert_allclose(one.integrals(omega), alone[j], rtol=1e-12, atol=1e-14 * np.abs(alone[j]).max())
        np.testing.assert_array_equal(one.integrals(omega[1:]), one.integrals(omega)[:, 1:])
        np.testing.assert_allclose(one.mean_squares(), squares[j], rtol=1e-13)
    assert calls.count("fourier") == 1
    assert calls.count("squares") == 1


def test_fourier_integrals_are_those_of_the_kernel():
    """At zero, at the load's own frequency, next to it and to one of a free motion, and far away."""
    system = build_system(light_chain(0.3))
    flow = exact_flow(system, 30.0)
    motion = simulate(flow, system.initial_state)
    assert motion.exponentials
    part = MotionPart.of(motion, output_groups(system, flow), 5.0, 30.0, 1e9)
    m, load = part.motion, float(np.abs(flow.sources.exponent).max())
    free = float(np.abs(flow.states[0].exponent.imag).max())
    omega = np.array([0.0, load, load * (1.0 + 1e-9), load * (1.0 + 1e-4), free, free * (1.0 + 1e-7), 400.0])
    compiled = np.zeros((part.table.shape[2], omega.size), dtype=complex)
    logged = (m.flow.tables(), m.flow.inputs(), part.table, m.time, m.length, m.state, m.piece, m.y)
    fourier_kernels.fourier_integrals(*logged, omega, 0, m.time.size, compiled)
    largest = np.abs(compiled).max(axis=1, keepdims=True)
    assert np.all(np.abs(part.integrals(omega) - compiled) < 1e-11 * largest)


def test_samples_at_uneven_times_are_those_of_the_kernel():
    system = build_system(light_chain(0.3))
    flow = exact_flow(system, 30.0)
    motion = simulate(flow, system.initial_state)
    table = flow.output_table(output_groups(system, flow))
    times = np.sort(np.append(np.random.default_rng(4).uniform(0.0, 30.0, 500), motion.event_time))
    compiled = np.empty((times.size, table.shape[2]))
    logged = (motion.time, motion.state, motion.piece, motion.y, times)
    march_kernels.sample(*flow.kernel_arguments(), table, *logged, compiled)
    scale = np.abs(compiled).max(axis=0)
    assert np.all(np.abs(motion.sample_table(times, table) - compiled) < 1e-12 * scale)
