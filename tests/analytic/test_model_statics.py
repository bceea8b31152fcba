"""Static deflections, bending moments and stresses against closed forms, through the reduced model."""

import numpy as np
import pytest

from beamsim.scenario import Scenario
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

L, B, H, E, RHO = 0.8, 0.03, 0.008, 70e9, 2700.0
EI = E * B * H**3 / 12
LINE = RHO * B * H
G = 9.81


def scenario(left="clamped", right="free", modes=4, elements=10, beam=None, **more):
    return Scenario.model_validate(
        {
            "beam": {
                "length": L,
                "width": B,
                "thickness": H,
                "youngs_modulus": E,
                "density": RHO,
                "elements": elements,
                "supports": {"left": left, "right": right},
                **(beam or {}),
            },
            "run": {"duration": 1.0, "sample_rate": 1000.0, "start": "static_equilibrium"},
            **({"reduction": {"modes": modes}} if modes else {}),
            **more,
        }
    )


def recovered(system):
    q = system.static_equilibrium
    return system.bodies[0].position, system.bodies[0].deflection @ q, system.bodies[0].bending_moment @ q


@pytest.mark.parametrize("modes", [1, 4, None, "all"])
def test_tip_force_on_a_cantilever(modes):
    force = -3.0
    system = build_system(scenario(modes=modes, constant_forces=[{"position": L, "force": force}]))
    x, w, moment = recovered(system)
    np.testing.assert_allclose(w, force * x**2 * (3 * L - x) / (6 * EI), rtol=1e-10, atol=1e-16)
    np.testing.assert_allclose(moment, force * (L - x), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(system.bodies[0].stress_per_moment * moment[0], 6 * force * L / (B * H**2), rtol=1e-9)


@pytest.mark.parametrize("modes", [1, 4, None, "all"])
@pytest.mark.parametrize("mass", [0.0, 0.1])
def test_cantilever_under_gravity_with_and_without_a_tip_mass(modes, mass):
    more = {"point_masses": [{"position": L, "mass": mass}]} if mass else {}
    system = build_system(scenario(modes=modes, gravity=G, beam=more))
    x, w, moment = recovered(system)
    load = LINE * G
    expected = -load * x**2 * (6 * L**2 - 4 * L * x + x**2) / (24 * EI) - mass * G * x**2 * (3 * L - x) / (6 * EI)
    # Between the nodes the cubic elements miss the quartic by h^4 / 384; at the nodes they are exact.
    nodes = slice(None, None, 2)
    np.testing.assert_allclose(w[nodes], expected[nodes], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(w, expected, rtol=2e-3, atol=1e-15)
    np.testing.assert_allclose(moment, -load * (L - x) ** 2 / 2 - mass * G * (L - x), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("place", [0.25, 0.3, 0.31])  # a node of ten elements is at 0.24 and 0.32
def test_force_between_the_nodes_of_a_pinned_beam_peaks_where_it_acts(place):
    force = 5.0
    system = build_system(scenario("pinned", "pinned", constant_forces=[{"position": place, "force": force}]))
    x, w, moment = recovered(system)
    a, b = place, L - place
    assert place in x
    expected = np.where(x < a, -force * b * x / L, -force * a * (L - x) / L)
    np.testing.assert_allclose(moment, expected, atol=1e-8 * force * L)
    at = int(np.flatnonzero(x == place)[0])
    # Inside its element the force sees the cubic interpolation's compliance.
    assert w[at] == pytest.approx(force * a**2 * b**2 / (3 * EI * L), rel=2e-3)


def test_propped_cantilever_limit_of_a_stiff_preloaded_stop():
    # A huge stop that just touches under gravity's push: the reaction is 3/8 of the weight.
    system = build_system(
        scenario(gravity=G, snubbers=[{"name": "tip", "position": L, "side": "below", "stiffness": 1e12, "gap": 0.0}])
    )
    assert system.snubbers[0].preload == pytest.approx(3 / 8 * LINE * G * L, rel=1e-6)
    x, _, moment = recovered(system)
    assert moment[0] == pytest.approx(-LINE * G * L**2 / 8, rel=1e-6)
    assert x[0] == 0.0


@pytest.mark.parametrize(
    ("left", "right", "place", "compliance"),
    [
        ("clamped", "free", L, L**3 / (3 * EI)),
        ("clamped", "free", L / 2, (L / 2) ** 3 / (3 * EI)),
        ("pinned", "pinned", L / 2, L**3 / (48 * EI)),
        ("clamped", "clamped", L / 2, L**3 / (192 * EI)),
        ("clamped", "guided", L, L**3 / (12 * EI)),
        ("guided", "pinned", 0.0, L**3 / (3 * EI)),
    ],
)
@pytest.mark.parametrize("modes", [1, 2, 6, None])
def test_reduction_keeps_the_static_compliance_at_a_contact(left, right, place, compliance, modes):
    system = build_system(
        scenario(left, right, modes, snubbers=[{"position": place, "side": "below", "stiffness": 1e4, "gap": 0.0}])
    )
    row = system.snubbers[0].shape
    assert row @ (row / system.dynamics.stiffness) == pytest.approx(compliance, rel=1e-10)


def test_without_the_static_vector_the_compliance_would_be_off():
    # The twin that shows the comparison above can fail.
    system = build_system(scenario(modes=2, snubbers=[{"position": L, "side": "below", "stiffness": 1e4, "gap": 0.0}]))
    row = system.snubbers[0].shape[:2]
    off = (row @ (row / system.dynamics.stiffness[:2])) / (L**3 / (3 * EI)) - 1
    assert off < -1e-3


def test_two_contacts_know_each_other():
    places = [0.3 * L, L]
    system = build_system(
        scenario(
            modes=2,
            elements=20,
            snubbers=[{"position": x, "side": "below", "stiffness": 1e4, "gap": 0.0} for x in places],
        )
    )
    shape = system.dynamics.contacts.shape
    flexibility = (shape / system.dynamics.stiffness) @ shape.T
    x, y = places
    expected = np.array([[x**3 / 3, x**2 * (3 * y - x) / 6], [x**2 * (3 * y - x) / 6, y**3 / 3]]) / EI
    np.testing.assert_allclose(flexibility, expected, rtol=1e-10)
    assert system.modes["static_vectors"].item() == 2


def test_inertia_relief_of_a_free_beam():
    """The flexible compliance of a free-free beam at its end, in steady acceleration: L^3 / (105 E I)."""
    system = build_system(
        scenario(
            "free",
            "free",
            modes=2,
            elements=40,
            run={"duration": 1.0, "sample_rate": 1e3, "start": "rest"},
            snubbers=[{"position": L, "side": "below", "stiffness": 1e4, "gap": 1e-3}],
        )
    )
    assert np.all(system.dynamics.stiffness[:2] == 0)
    row, stiffness = system.snubbers[0].shape[2:], system.dynamics.stiffness[2:]
    assert row @ (row / stiffness) == pytest.approx(L**3 / (105 * EI), rel=1e-6)
    # Its bending moment under a unit end force: M = x (x / L)(1 - x / L) in magnitude, which vanishes at both ends.
    moment = system.bodies[0].bending_moment[:, 2:] @ (row / stiffness)
    x = system.bodies[0].position
    np.testing.assert_allclose(moment, -((x / L) ** 2) * (x - L), atol=2e-6)
    np.testing.assert_array_equal(system.bodies[0].bending_moment[:, :2], 0.0)


def test_moment_rows_reproduce_the_strain_energy():
    """q^T K q = int M^2 / (E I) dx for every coordinate (independent of how moments are recovered)."""
    system = build_system(
        scenario(modes=3, elements=40, snubbers=[{"position": 0.61, "side": "below", "stiffness": 1e4, "gap": 0.0}])
    )
    x, moment = system.bodies[0].position, system.bodies[0].bending_moment
    from scipy.interpolate import CubicSpline

    for j in range(3):
        square = CubicSpline(x, moment[:, j] ** 2)
        assert square.integrate(0, L) / EI == pytest.approx(system.dynamics.stiffness[j], rel=2e-4)


def test_stiffness_ratio_and_blocked_force():
    system = build_system(scenario(snubbers=[{"position": L, "side": "below", "stiffness": 2e4, "gap": -1e-4}]))
    info = system.snubbers[0]
    assert info.stiffness_ratio == pytest.approx(2e4 * L**3 / EI)
    assert info.blocked_force == pytest.approx(2.0)
    # Prestress z against the tip's compliance: N = k z / (1 + k L^3 / 3 E I).
    assert info.preload == pytest.approx(2.0 / (1 + 2e4 * L**3 / (3 * EI)), rel=1e-10)
