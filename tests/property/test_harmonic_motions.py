"""Motions that are evaluated together are those that are evaluated alone."""

import numpy as np
import pytest

from beamsim.flow.harmonic_motions import HarmonicMotions
from beamsim.flow.variational import VariationalFlow
from beamsim.responses.energies import power_factors
from beamsim.responses.orbit_energies import energy_errors
from tests.property.test_variational_derivatives import CASES, build, forcing

OMEGA = (0.7, 1.0, 1.3, 1.0 + 1e-5, 2.1)  # rad/s; without damping the second one is a resonance


@pytest.mark.parametrize(("case", "damping"), [*((case, 0.05) for case in CASES), ("spring", 0.0)])
def test_motions_under_loads_of_their_own(make_system, case, damping):
    loads = forcing(1.0 if "ground" in case else 0.0)
    flow = VariationalFlow(build(make_system, case, damping), loads, OMEGA[0], 2.0)
    flows, start = [flow.with_loads(omega, 1.0 + omega) for omega in OMEGA], np.zeros(flow.size)
    start[:3] = 0.3, 0.1, -0.2
    maps = [each.flow_map(start, 7.0 / each.omega) for each in flows]
    assert sum(each.event_time.size for each in maps) > 4
    together = HarmonicMotions(flow.exact, maps, [each.exact.sources for each in flows])
    alone = [each.motion(flow_map) for each, flow_map in zip(flows, maps, strict=True)]

    def outputs(phases):
        at = flow.exact.at(phases)
        return np.vstack([flow.exact.equations.state, at.force, at.rates])

    high, low = together.extrema(outputs)
    energies = np.array([0, flow.system.size])
    most, _ = together.extrema(lambda phases: outputs(phases)[: 2 * flow.system.size], energies)
    omega = np.multiply.outer(OMEGA, np.arange(4.0))
    lines, factors = together.fourier_integrals(outputs, omega), power_factors(flow.exact)
    integrals, losses, share = together.product_integrals(*factors), together.event_losses(), together.contact_share()
    for k, motion in enumerate(alone):
        found = motion.extrema(outputs)
        size = 1e-9 * max(np.abs(found.low).max(), np.abs(found.high).max())
        np.testing.assert_allclose(high[k], found.high, rtol=1e-9, atol=size)
        np.testing.assert_allclose(low[k], found.low, rtol=1e-9, atol=size)
        largest = motion.extrema(lambda phases: outputs(phases)[: 2 * flow.system.size], squares=energies).high
        np.testing.assert_allclose(most[k], largest, rtol=1e-9)
        expected = motion.fourier_integrals(outputs, omega[k])
        np.testing.assert_allclose(lines[k], expected, atol=1e-10 * np.abs(expected).max())
        expected = motion.segment_integrals(*factors).sum(axis=0)
        np.testing.assert_allclose(integrals[k], expected, atol=1e-10 * np.abs(expected).max())
        np.testing.assert_allclose(losses[k], motion.event_losses().sum(), atol=1e-12)
        np.testing.assert_allclose(share[k], motion.contact_share(), atol=1e-12)
    assert energy_errors(together).max() < 1e-10


def test_no_load_at_all(make_system):
    """Free motions keep their energy: nothing comes in, and nothing is lost."""
    flow = VariationalFlow(build(make_system, "spring"))
    start = np.zeros(flow.size)
    start[0] = 2.0
    together = HarmonicMotions(flow.exact, [flow.flow_map(start, t) for t in (3.0, 4.5)], [flow.exact.sources] * 2)
    assert energy_errors(together).max() < 1e-10
