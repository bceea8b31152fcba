"""What is computed from a motion afterwards: outputs, extremes, integrals, antiderivatives; and at what cost."""

import numpy as np
import pytest

from beamsim.flow.exact import ExactFlow
from beamsim.flow.transient import simulate
from beamsim.inputs.signal import Signal
from beamsim.system.equations import Forcing

SPACING = 0.02


@pytest.fixture(scope="module")
def motion(make_system):
    """Two modes and a stop under a signal of parabolas, each 20 ms long: basis functions with powers."""
    rng = np.random.default_rng(5)
    system = make_system([3.0, 40.0], [0.1, 1.0], shape=[[1.0, 0.5]], stiffness=50.0, gap=0.05)
    pieces = np.arange(0, 6, SPACING)
    signal = Signal.polynomial_pieces(pieces, rng.normal(size=(pieces.size, 3)) * [2.0, 3.0, 10.0])
    flow = ExactFlow(system, Forcing(np.array([[1.0, -0.7]]), (signal,)), 6.0)
    assert any(np.any(state.power) for state in flow.states) or simulate(flow, np.zeros(4)).event_time.size > 5
    return simulate(flow, np.zeros(4))


def state_rows(flow, count=None):
    output = flow.empty_output(4)
    output.row[:] = np.eye(4)
    return lambda closed: output


@pytest.mark.parametrize("spacing", [SPACING / 50, SPACING / 3, SPACING * 3])
def test_outputs_do_not_depend_on_how_many_a_segment_holds(motion, spacing):
    """Few samples a segment are summed over terms, many over basis functions: both are the logged states."""
    fine = motion.sample(motion.time, state_rows(motion.flow))
    np.testing.assert_allclose(fine, motion.y, atol=1e-13)
    times = np.arange(0, 6, spacing)
    together = motion.sample(times, state_rows(motion.flow))
    alone = np.vstack([motion.sample(times[k : k + 1], state_rows(motion.flow)) for k in range(0, times.size, 7)])
    np.testing.assert_allclose(together[::7], alone, atol=1e-13)


def test_integrals_of_products_are_those_of_a_fine_rule(motion):
    times = np.array([0.0, 0.013, 0.5, 3.0, 5.9, 6.0])
    weight = np.array([[1.0, 0.0], [0.5, 0.0], [0.0, 2.0], [0.0, 1.0]])
    exact = motion.product_integrals(times, state_rows(motion.flow), state_rows(motion.flow), weight)
    node, gauss = np.polynomial.legendre.leggauss(30)
    cuts = np.unique(np.concatenate([motion.time, times]))
    middle, half = 0.5 * (cuts[1:] + cuts[:-1]), 0.5 * np.diff(cuts)
    fine = motion.sample((middle[:, None] + half[:, None] * node).ravel(), state_rows(motion.flow)) ** 2 @ weight
    parts = (fine.reshape(-1, node.size, 2) * gauss[:, None]).sum(axis=1) * half[:, None]
    expected = np.vstack([np.zeros(2), np.cumsum(parts, axis=0)])[np.searchsorted(cuts, times)]
    np.testing.assert_allclose(exact, expected, rtol=1e-12, atol=1e-14)
    coarse = np.trapezoid(motion.sample(cuts, state_rows(motion.flow)) ** 2 @ weight, cuts, axis=0)
    assert np.abs(coarse / expected[-1] - 1).max() > 1e-6  # the comparison can fail


@pytest.mark.parametrize("exponent", [[0.0], [0.0, -0.3 + 2j], [1j]])
def test_antiderivatives_join_and_differentiate_back(exponent):
    rng = np.random.default_rng(2)
    start = np.cumsum(rng.uniform(0.1, 0.4, 40)) - 0.1
    exponent = np.array(exponent, dtype=complex)
    shape = (start.size, exponent.size, 3)
    signal = Signal(start, exponent, rng.normal(size=shape) + 1j * rng.normal(size=shape))
    whole = signal.antiderivative(0.7)
    assert whole(start[0]) == pytest.approx(0.7, abs=1e-14)
    before = np.array(
        [whole.within(np.array([k]), np.array([start[k + 1] - start[k]]))[0] for k in range(start.size - 1)]
    )
    np.testing.assert_allclose(whole(start[1:]), before, atol=1e-12)
    t = np.sort(rng.uniform(start[0], start[-1] + 0.3, 200))
    np.testing.assert_allclose(whole.derivative()(t), signal(t), atol=1e-12)


@pytest.mark.parametrize("step", [1e-4, 0.02, 0.137], ids=["many a piece", "at every breakpoint", "few"])
def test_even_steps_give_the_same_samples_as_single_times(motion, step):
    """An exponential is carried from sample to sample within a segment, and at a breakpoint begins anew."""
    output, times = motion.flow.contact_forces, np.arange(int(6.0 / step)) * step
    each = max(1, times.size // 3000)
    expected = np.concatenate([motion.sample(times[i : i + 1], output) for i in range(0, times.size, each)])
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(motion.sample(times, output)[::each], expected, atol=1e-12 * np.abs(expected).max())
