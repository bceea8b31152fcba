"""The stiffness behind a frequency, for any mode, place and supports."""

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.stiffness import FittedModes, fit_stiffness, snubber_point
from beamsim.scenario import load_scenario
from beamsim.structures.modes import closed_modes
from beamsim.structures.secular import SpringPoint

BEAM = {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0, "elements": 12}
SUPPORTS = st.sampled_from(["clamped", "pinned", "free", "guided"])


def scenario_with(left, right, position, masses=(), **section):
    return load_scenario(
        {
            "beam": {
                **BEAM,
                "supports": {"left": left, "right": right},
                "point_masses": [{"position": x * 0.27, "mass": m} for x, m in masses],
            },
            "snubbers": [{"name": "stop", "position": position * 0.27, "side": "below", "stiffness": 1.0}],
            "identify_stiffness": {"snubber": "stop", "measured_with": [100.0], **section},
        }
    )


@st.composite
def points(draw):
    places = st.floats(0.0, 1.0).map(lambda x: x if x > 1e-29 else 0.0)  # times 0.27 m, above the least length
    masses = draw(st.lists(st.tuples(places, st.floats(1e-4, 0.2)), max_size=2))
    scenario = scenario_with(draw(SUPPORTS), draw(SUPPORTS), draw(st.floats(0.02, 0.98)), masses)
    return snubber_point(scenario, "stop")


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(point=points(), mode=st.integers(1, 8), decades=st.floats(-3, 9))
def test_own_frequencies_give_the_stiffness_back(point, mode, decades):
    k = 10.0**decades
    assume(not point.on_node(mode))  # refused: test_secular_closed_form.py
    omega = float(point.frequencies(k, mode)[mode - 1])
    assume(omega > 0)
    slope = float(point.slope(omega))
    assume(slope > 0)
    condition = omega / (k * slope)
    assume(condition < 1e11)  # else the mode sits on a node, or the spring is all but rigid or nothing: refused
    found = fit_stiffness(FittedModes(point, (mode,), np.array([omega]), np.zeros(1)))
    assert abs(found - k) <= 1e-12 * condition * k
    assert point.mode_number(omega) == mode  # interlacing


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(point=points(), decades=st.floats(-2, 8))
def test_roots_are_those_of_an_independent_decomposition(point, decades):
    k = 10.0**decades
    rigid = int(np.sum(point.omega == 0))
    independent = closed_modes(point.omega, point.shape[None, :], np.array([k]), rigid)[0]
    own = point.frequencies(k)
    assert own == pytest.approx(
        independent, rel=1e-9, abs=1e-12 * max(point.omega[-1], np.sqrt(k) * abs(point.shape).max())
    )


def test_the_comparison_can_fail():
    point = snubber_point(scenario_with("clamped", "free", 0.98), "stop")
    omega = float(point.frequencies(1e4, 1)[0])
    wrong = fit_stiffness(FittedModes(point, (1,), np.array([omega * (1 + 1e-9)]), np.zeros(1)))
    assert abs(wrong / 1e4 - 1) > 1e-10


def test_a_mode_raised_to_one_with_a_node_at_the_spring_stays_there():
    """Mid-span of a pinned beam with a mass there: the lowest frequency is at most that of the second mode."""
    masses = [(0.5, 8e-4), (0.5, 1.9e-3)]
    point = snubber_point(scenario_with("pinned", "pinned", 0.5, masses), "stop")
    soft, stiff = point.frequencies(1e4, 1)[0], point.frequencies(1e8, 1)[0]
    assert soft < stiff == point.omega[1]
    assert point.slope(soft) > 0 == point.slope(stiff)


def test_chains_with_repeated_and_unfelt_modes():
    # Two equal oscillators that nothing joins: one of the two equal modes can move, the other cannot.
    twins = SpringPoint([2.0, 2.0, 5.0], [0.3, 0.0, 0.4])
    assert twins.frequencies(0.0, 3) == pytest.approx([2.0, 2.0, 5.0])
    found = twins.frequencies(10.0, 3)
    assert found[0] == 2.0
    assert twins.stiffness(found[1]) == pytest.approx(10.0, rel=1e-13)
    mixed = SpringPoint([2.0, 2.0, 5.0], [0.3, 0.4, 0.4])
    independent = closed_modes(mixed.omega, mixed.shape[None, :], np.array([10.0]), 0)[0]
    assert mixed.frequencies(10.0, 3) == pytest.approx(independent, rel=1e-13)


@pytest.mark.parametrize("elements", [3, 250])
def test_small_and_large_models_through_the_whole_analysis(elements):
    # 250 elements go through the reduced model with the snubber's static vector.
    base = scenario_with("clamped", "free", 0.9)
    base = load_scenario(base, {"beam.elements": elements})
    omega = snubber_point(base, "stop", 3).frequencies(4e4, 3)
    result = identify_stiffness(load_scenario(base, {"identify_stiffness.measured_with": (omega / 2 / np.pi).tolist()}))
    assert result.summary["stiffness_n_per_m"] == pytest.approx(4e4, rel=1e-10)
    assert result.summary["frequencies_with_hz"] == pytest.approx(omega / 2 / np.pi, rel=1e-10)
