"""How natural frequencies depend on a closed snubber (thesis, proposition 1.3.1, with its derivative corrected)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beamsim.scenario import Scenario
from beamsim.structures.modes import closed_modes
from beamsim.system.build import build_system

pytestmark = pytest.mark.quick

BEAM = {
    "length": 0.27,
    "width": 0.05,
    "thickness": 0.005,
    "youngs_modulus": 69e9,
    "density": 2700.0,
    "damping": {"kind": "modal", "ratio": 0.01},
}


def build(position=0.27, stiffness=1.5e5, supports=("clamped", "free"), modes="all", **more):
    left, right = supports
    return build_system(
        Scenario.model_validate(
            {
                "beam": {**BEAM, "supports": {"left": left, "right": right}},
                "snubbers": [{"position": position, "side": "below", "stiffness": stiffness, "gap": 1e-3, **more}],
                "run": {"duration": 1.0, "sample_rate": 2e4, "start": "rest"},
                "reduction": {"modes": modes},
            }
        )
    )


def omega_closed(s, stiffness):
    rigid = int(np.sum(s.dynamics.stiffness == 0))
    return closed_modes(np.sqrt(s.dynamics.stiffness), s.dynamics.contacts.shape, np.array([stiffness]), rigid)[0]


SUPPORTS = st.sampled_from([("clamped", "free"), ("pinned", "free"), ("free", "free"), ("pinned", "pinned")])


@given(place=st.floats(0.01, 0.26), supports=SUPPORTS, low=st.floats(1.0, 8.0), more=st.floats(0.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_frequencies_never_fall_with_stiffness_and_interlace(place, supports, low, more):
    s = build(place, supports=supports)
    opened = np.sqrt(s.dynamics.stiffness)
    soft, stiff = omega_closed(s, 10**low), omega_closed(s, 10 ** (low + more))
    slack = 1e-12 * opened[-1]
    assert np.all(soft >= opened - slack)
    assert np.all(stiff >= soft - slack)
    assert np.all(stiff[:-1] <= opened[1:] + slack)  # one spring lifts no frequency past the next one


@given(place=st.floats(0.05, 0.27), k=st.floats(1e3, 1e6))
@settings(max_examples=15, deadline=None)
def test_derivative_with_respect_to_the_spring_is_the_square_of_the_deflection_there(place, k):
    s = build(place)
    lam, vectors = np.linalg.eigh(
        np.diag(s.dynamics.stiffness) + k * s.dynamics.contacts.shape.T @ s.dynamics.contacts.shape
    )
    slope = (s.dynamics.contacts.shape[0] @ vectors) ** 2
    h = 1e-4 * k
    difference = (omega_closed(s, k + h) ** 2 - omega_closed(s, k - h) ** 2) / (2 * h)
    np.testing.assert_allclose(difference[:4], slope[:4], rtol=1e-5, atol=1e-9 * lam[3] / k)


def test_bounded_by_the_pinned_point():
    s = build(0.27)
    limit = omega_closed(s, 1e14)
    assert np.all(omega_closed(s, 1e6)[:5] < limit[:5])
    unit = np.sqrt(69e9 * 0.005**2 / (12 * 2700)) / 0.27**2
    assert limit[0] == pytest.approx(3.9266023120479**2 * unit, rel=1e-5)


def test_a_spring_on_a_node_does_nothing():
    s = build(0.135, supports=("pinned", "pinned"))  # the middle is a node of every even mode
    np.testing.assert_allclose(omega_closed(s, 1e6)[1], np.sqrt(s.dynamics.stiffness[1]), rtol=1e-12)


def test_rigid_body_modes_that_no_snubber_holds_stay_at_zero():
    s = build(supports=("free", "free"))
    assert s.modes["open_frequencies_hz"].values[:2].tolist() == [0.0, 0.0]
    assert s.modes["closed_frequencies_hz"].values[0] == 0.0
    assert s.modes["closed_frequencies_hz"].values[1] > 1.0
    pinned = build(supports=("pinned", "free"))
    assert pinned.modes["open_frequencies_hz"].values[0] == 0.0
    assert pinned.modes["closed_frequencies_hz"].values[0] > 1.0
