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
