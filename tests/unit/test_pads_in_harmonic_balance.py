"""Pads and springs that relax in harmonic balance: Jacobians, shooting, energies, stability, and what is refused."""

import numpy as np
import pytest

from beamsim.analyses.response.analysis import frequency_response
from beamsim.analyses.response.motion import sampled_motion, sampled_orbit
from beamsim.analyses.response.side_branches import _unlike
from beamsim.contacts.contacts import Contacts
from beamsim.contacts.force_curve import ForceCurve
from beamsim.contacts.friction import friction_law
from beamsim.contacts.hardening import hardening_law
from beamsim.contacts.laws import kelvin_voigt, no_tension, piecewise_linear
from beamsim.contacts.pads import MaxwellBranch, recovering_law, relaxing_law
from beamsim.errors import MethodError, ScenarioError
from beamsim.flow.passage import PeriodicForcing
from beamsim.flow.variational import VariationalFlow
from beamsim.orbits.balance_stability import BalancedOrbits
from beamsim.orbits.harmonic_balance import ForcedBalance
from beamsim.orbits.shooting import ForcedOrbits, find_orbit
from beamsim.scenario import load_scenario
from beamsim.system.equations import PiecewiseLinearSystem

CURVE = ForceCurve(np.array([0.0, 0.1, 0.25, 0.4]), np.array([0.0, 1.5, 6.0, 9.0]))
LINE = ForceCurve(np.array([0.0, 1.0]), np.array([0.0, 20.0]))
TWO = (MaxwellBranch(20.0, 0.15), MaxwellBranch(5.0, 1.0))
WIRE = piecewise_linear([-0.1, 0.1], [3.0, 1.0, 3.0], 1)
OMEGA = 1.3
LAWS = {
    "branches": recovering_law(LINE, 0.0, TWO),
    "table and branch": recovering_law(CURVE, 0.0, TWO[:1]),
    "dashpot": no_tension(20.0, 0.8),
    "all": recovering_law(CURVE, 0.5, TWO),
    "relaxing spring": relaxing_law(None, TWO),
    "relaxing corners": relaxing_law(WIRE, TWO[1:]),
}


def system_of(law, ground=False):
    """Two coordinates with a rubbing-free stop on the other side, so that corners of tables and gaps are met."""
    two_sided = not law.recovers
    contacts = Contacts(
        np.array([[1.0, 0.4], [0.3, 1.0]]), np.array([-1.0, 1.0]), np.array([0.0 if two_sided else 0.05, 0.2]),
        np.array([ground, False]), (law, kelvin_voigt(5.0, 0.1)),
    )  # fmt: skip
    return PiecewiseLinearSystem(np.array([1.0, 9.0]), np.array([[0.1, 0.02], [0.02, 0.2]]), contacts,
                                 np.array([0.1, 0.0]))  # fmt: skip


def forcing(ground=False):
    base = np.array([0.2 - 0.1j]) if ground else np.zeros(1, dtype=complex)
    power = np.array([-2.0]) if ground else np.zeros(1)
    return PeriodicForcing(np.array([1]), np.array([[1.4, 0.6 + 0.3j]]), np.zeros(1), base, power, OMEGA)


def shot(system, loads):
    flow = VariationalFlow(system, loads, OMEGA)
    orbits = ForcedOrbits(flow)
    point = find_orbit(orbits)
    assert point is not None
    return orbits, point


@pytest.mark.parametrize("parameter", ["frequency", "level"])
@pytest.mark.parametrize("name", ["all", "relaxing corners"])
def test_jacobian(name, parameter):
    problem = ForcedBalance(system_of(LAWS[name], True), forcing(True), 7, parameter, 1.1, 0.7, 2)
    count = problem.rows.shape[0]
    h = np.repeat(np.arange(1, 9), 2)[:15]
    x = np.random.default_rng(4).normal(size=(15, count)) * 0.3 / h[:, None] ** 2
    u = np.append(x.ravel(), 1.2)
    _, jacobian, _ = problem.residual(u)
    scale = problem.scale(u)[0]
    for i in range(u.size):
        e = np.zeros(u.size)
        e[i] = 1e-6 * scale[i]
        slope = (problem.residual(u + e)[0] - problem.residual(u - e)[0]) / 2e-6
        np.testing.assert_allclose(slope, jacobian[:, i] * scale[i], atol=1e-7 * np.abs(jacobian * scale).max())


# every law once among the fast tests, by turns on the base and on the ground
BY_TURNS = [
    pytest.param(name, ground, marks=[pytest.mark.slow] * ((turn + ground) % 2))
    for turn, name in enumerate(LAWS)
    for ground in (False, True)
]


@pytest.mark.parametrize(("name", "ground"), BY_TURNS)
def test_against_shooting(name, ground):
    """Motion, forces, shares, multipliers and the energy balance; errors fall with the harmonics."""
    system, loads = system_of(LAWS[name], ground), forcing(ground)
    orbits, point = shot(system, loads)
    expected = sampled_orbit(orbits, point)
    errors = []
    for harmonics in (15, 40):
        balance = BalancedOrbits(system, loads, harmonics, "frequency", OMEGA)
        _, basis = balance.by_shooting(OMEGA)
        np.testing.assert_array_equal(basis, np.eye(2))
        found = balance.from_passage(orbits, basis, point.data, OMEGA)
        assert found is not None
        assert balance.energy_error(found) < 1e-10
        motion = sampled_motion(found.data, loads, OMEGA, 1.0)
        errors.append(np.abs(motion.q(np.eye(2))[:512] - expected.q(np.eye(2))[:512]).max())
    jumps = name in ("dashpot", "all")  # a dashpot's force jumps where contact is made
    assert errors[1] < (5e-3 if jumps else 3e-4)
    assert errors[1] < max(0.6 * errors[0], 1e-14)
    np.testing.assert_allclose(motion.contact_share, expected.contact_share, atol=0.02 if jumps else 1e-3)
    peaks = [x.by_contact.max(axis=0) for x in (motion, expected)]
    np.testing.assert_allclose(*peaks, rtol=0.05 if jumps else 5e-3)
    np.testing.assert_allclose(balance.multipliers(found), orbits.multipliers(point), atol=1e-6)
    start = balance.states_at_start(found)
    assert start.size == point.u.size - 1
    np.testing.assert_allclose(start[4:], point.u[4:-1], atol=0.05 if jumps else 2e-3)


@pytest.mark.parametrize("law", [friction_law(30.0, 0.2, 0.1), hardening_law(20.0, 0.5, 5.0)])
def test_what_rubs_is_refused(law):
    with pytest.raises(MethodError, match="friction or hardening are beyond harmonic balance"):
        ForcedBalance(system_of(law), forcing(), 7, "frequency", 1.1)


def test_a_pad_without_a_first_slope_is_refused():
    flat = ForceCurve(np.array([0.0, 0.05, 0.3]), np.array([0.0, 0.0, 2.0]))
    with pytest.raises(MethodError, match="begins without force"):
        ForcedBalance(system_of(recovering_law(flat, 0.0, TWO)), forcing(), 7, "frequency", 1.1)


def test_halves_of_a_motion_with_internal_states():
    """The difference of the states half a period apart is one of displacements and velocities; it failed before."""
    orbits, point = shot(system_of(LAWS["dashpot"]), forcing())
    assert _unlike(orbits, point).shape == (4,)


def test_a_sweep_names_what_it_refuses():
    case = {
        "chain": {"masses": [1.0], "springs": [50.0], "damping": {"kind": "modal", "ratio": 0.02}},
        "friction": [{"name": "pad", "at": {"mass": 1}, "normal_force": 1.0, "coefficient": 0.2, "stiffness": 500.0}],
        "excitation": {"kind": "harmonic", "applied_to": {"mass": 1}, "level": 1.0, "frequency": 1.0},
        "sweep": {"kind": "continuation", "from": 0.9, "to": 1.0, "method": "harmonic_balance"},
    }
    with pytest.raises(ScenarioError, match=r"snubbers with friction or hardening are beyond harmonic balance"):
        frequency_response(load_scenario(case))
