"""A load at the frequency of an undamped mode: closed forms, independent integration and differences."""

import numpy as np
import pytest

from beamsim.flow.periodic_flow import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.orbits.shooting import ForcedOrbits, find_orbit

OMEGA = np.array([1.0, 2.7])
FORCE = np.array([0.3, 0.1])
NEAR = [0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 3e-4]
LAWS = {
    "spring": {},
    "dashpot": {"dashpot": 2.0},
    "face": {"dashpot": 6.0, "no_tension": True},
    "ground": {"dashpot": 2.0, "on_ground": True},
}


def flow_of(make_system, omega, law="spring", stiffness=30.0, level=1.0):
    system = make_system(OMEGA, np.zeros(2), shape=[[1.0, 0.6]], stiffness=stiffness, gap=1.0, sign=-1.0, **LAWS[law])
    base = 0.1j if law == "ground" else 0j
    forcing = PeriodicForcing(
        np.ones(1, dtype=np.int64), -1j * FORCE[None, :], np.zeros(1), np.array([[base]]), np.array([-2.0]), 1.0
    )
    return VariationalFlow(system, forcing, omega, level)


@pytest.mark.parametrize("detuning", NEAR)
def test_linear_resonance_in_closed_form(make_system, detuning):
    """q'' + q = f sin(w t) from rest: ``f (sin w t - w sin t) / (1 - w^2)``, written without cancellation."""
    flow = flow_of(make_system, 1.0 + detuning)
    t = 4.0
    end = flow.flow_map(np.zeros(4), t).end
    e = detuning
    # sin((1+e)t) - (1+e) sin t = 2 cos(t + et/2) sin(et/2) - e sin t
    difference = (np.cos(t + e * t / 2) * t * np.sinc(e * t / (2 * np.pi)) - np.sin(t)) / -(2.0 + e)
    assert end[0] == pytest.approx(FORCE[0] * difference, rel=2e-12)


def test_periodic_motion_goes_through_the_resonance(make_system):
    """An undamped structure on a stop with a dashpot: the orbit at w = 1 lies between those beside it."""
    orbits = ForcedOrbits(flow_of(make_system, 1.0, "dashpot"))
    there = find_orbit(orbits)
    assert there is not None
    assert there.residual < 1e-11
    assert there.data.event_time.size >= 2
    beside = [solve_at(orbits, there.u, Settings(), 1.0 + e).u[:-1] for e in (-2e-4, 2e-4)]
    np.testing.assert_allclose(there.u[:-1], np.mean(beside, axis=0), atol=1e-5)
    times = np.linspace(0.0, 6.0, 7)
    flow, flow_map = orbits.cycle(there)
    alone = [flow.flow_map(flow_map.start, t).end[:4] for t in times[1:]]
    np.testing.assert_allclose(flow.states_at(flow_map, times)[1:], alone, atol=1e-12)
