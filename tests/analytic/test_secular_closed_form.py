"""The secular function against closed forms and against direct differences."""

import numpy as np
import pytest
from scipy.optimize import brentq

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.stiffness import snubber_point
from beamsim.cli.tables import table_rows
from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.parameters import value_at, with_values
from beamsim.structures.secular import SpringPoint, stiffness_sensitivities
from tests.helpers.tables import modes, variables


def beam(position=1.0, left="clamped", right="free", elements=40, **section):
    return load_scenario(
        {
            "beam": {
                "length": 1.0, "section": {"kind": "tube", "outer_diameter": 0.04, "wall_thickness": 0.004},
                "youngs_modulus": 70e9, "density": 2700.0, "elements": elements,
                "supports": {"left": left, "right": right},
            },
            "snubbers": [{"name": "stop", "position": position, "side": "below", "stiffness": 1.0}],
            "identify_stiffness": {"snubber": "stop", "measured_with": [100.0], **section},
        }
    )  # fmt: skip


def test_one_degree_of_freedom():
    point = SpringPoint([3.0], [0.5])
    assert point.frequencies(7.0) == pytest.approx([np.sqrt(9 + 7 * 0.25)], rel=1e-15)
    assert point.stiffness(np.sqrt(9 + 7 * 0.25)) == pytest.approx(7.0, rel=1e-14)
    assert np.isinf(point.frequencies(np.inf))
    assert point.reach(1) == (3.0, np.inf)


def test_the_highest_mode_of_a_chain_has_no_upper_limit():
    """k = m w^2 - k0 of a single mass, whose frequency grows with the snubber's stiffness without bound."""
    case = {
        "chain": {"masses": [2.0], "springs": [800.0]},
        "snubbers": [{"name": "stop", "at": {"mass": 1}, "side": "below", "stiffness": 1e3}],
        "identify_stiffness": {"snubber": "stop", "measured_with": [5.0], "uncertainty": 0.003},
    }
    result = identify_stiffness(load_scenario(case))
    stiffness = 2.0 * (10 * np.pi) ** 2 - 800.0
    assert result.summary["stiffness_n_per_m"] == pytest.approx(stiffness, rel=1e-12)
    deviation = 2 * 0.003 * 2.0 * (10 * np.pi) ** 2
    assert result.summary["standard_deviation_n_per_m"] == pytest.approx(deviation, rel=1e-9)
    rows = [text for _, text in table_rows(result)]
    assert any(text.split() == ["reachable", "3.1831,", "inf", "Hz"] for text in rows)  # upwards without bound


def test_cantilever_with_a_spring_at_its_tip():
    """beta^3 (1 + cosh cos) = -(k L^3 / E I) (cosh sin - sinh cos), the textbook's frequency equation."""
    scenario = beam()
    flexural = scenario.beam.bending.bending_stiffness
    ratio = 12.0
    point = snubber_point(scenario, "stop")

    def equation(b):
        return b**3 * (1 + np.cosh(b) * np.cos(b)) + ratio * (np.cosh(b) * np.sin(b) - np.sinh(b) * np.cos(b))

    betas = [brentq(equation, 1.9, 3.8), brentq(equation, 4.0, 6.5)]
    omega = np.square(betas) * np.sqrt(flexural / scenario.beam.bending.mass_per_length)
    assert point.frequencies(ratio * flexural, 2) == pytest.approx(omega, rel=1e-6)
    assert point.stiffness(omega) == pytest.approx(ratio * flexural, rel=1e-5)
    pinned = np.square([3.9266023, 7.0685827]) * np.sqrt(flexural / scenario.beam.bending.mass_per_length)
    assert point.frequencies(np.inf, 2) == pytest.approx(pinned, rel=1e-5)


def test_slope_is_the_squared_deflection_and_not_its_norm():
    point = snubber_point(beam(0.7), "stop")
    for k in (1e2, 1e4, 1e6):
        step = 1e-4 * k
        difference = (point.frequencies(k + step, 4) - point.frequencies(k - step, 4)) / (2 * step)
        assert point.slope(point.frequencies(k, 4)) == pytest.approx(difference, rel=1e-5)


def test_a_spring_on_a_node_is_refused_and_why():
    with pytest.raises(ScenarioError, match="it is at a node of mode 2") as caught:
        identify_stiffness(beam(0.5, "pinned", "pinned", fit_to=[2], measured_with=[50.0, 260.0]))
    assert caught.value.problems[0].path == "identify_stiffness.measured_with[1]"
    assert "leave mode 2 out" in str(caught.value)


@pytest.mark.parametrize(
    ("measured", "says"),
    [
        ([20.0], "is not above the frequency without the snubber"),
        ([3000.0], "is not below the frequency with the point pinned"),
    ],
)
def test_out_of_reach_is_explained_with_the_interval(measured, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        identify_stiffness(beam(measured_with=measured))
    point = snubber_point(beam(), "stop")
    low, high = np.array(point.reach(1)) / (2 * np.pi)
    assert f"{low:.6g} Hz" in str(caught.value)
    assert f"{high:.6g} Hz" in str(caught.value)


def test_forgotten_units_and_swapped_lists_are_guessed():
    point = snubber_point(beam(), "stop")
    middle = float(np.mean(np.array(point.reach(1)))) / (2 * np.pi)
    with pytest.raises(ScenarioError, match="rad/s"):
        identify_stiffness(beam(measured_with=[2 * np.pi * middle]))
    with pytest.raises(ScenarioError, match="kHz"):
        identify_stiffness(beam(measured_with=[middle / 1000]))
    free = float(point.omega[0]) / (2 * np.pi)
    with pytest.raises(ScenarioError, match="swapped"):
        identify_stiffness(beam(measured_with=[free * 0.999], measured_without=[middle]))
    second = float(np.mean(np.array(point.reach(2)))) / (2 * np.pi)
    with pytest.raises(ScenarioError, match="it fits mode 2"):
        identify_stiffness(beam(measured_with=[second]))


CHAIN = {
    "chain": {
        "masses": [1.0, 2.0, 1.5], "springs": [100.0, 150.0, 120.0, 80.0],
        "springs_to_ground": [{"mass": 2, "kind": "linear", "stiffness": 30.0}],
        "snubbers": [{"name": "stop", "mass": 2, "side": "above", "stiffness": 1.0}],
    },
    "identify_stiffness": {"snubber": "stop", "measured_with": [2.2]},
}  # fmt: skip


def with_masses():
    return load_scenario(
        beam(0.8),
        {"beam.point_masses": [{"position": 0.35, "mass": 0.2}, {"position": 0.9, "mass": 0.1}]},
    )


@pytest.mark.parametrize("scenario", [with_masses(), load_scenario(CHAIN)], ids=["beam", "chain"])
def test_sensitivities_are_those_of_direct_differences(scenario):
    omega = float(snubber_point(scenario, "stop").frequencies(900.0 if scenario.beam is None else 3e4, 1)[0])
    found = stiffness_sensitivities(scenario, "stop", omega)
    step = 1e-4
    for place, relative in found.items():
        values = []
        for sign in (1, -1):
            changed = {place: value_at(scenario, place) * (1 + sign * step)}
            values.append(float(snubber_point(with_values(scenario, changed), "stop").stiffness(omega)))
        difference = np.log(values[0] / values[1]) / (2 * step)
        # Moving a point mass moves nodes, which changes the discretisation's own small error.
        moved = place[-1] in ("position", "length")
        assert relative == pytest.approx(difference, rel=5e-3 if moved else 1e-6, abs=1e-3 if moved else 1e-9), place


def test_first_order_monte_carlo_and_carried_over_intervals_agree():
    scenario = load_scenario(
        beam(0.9), {"identify_stiffness.measured_with": [60.0], "identify_stiffness.uncertainty": 1e-3}
    )
    estimate = variables(identify_stiffness(scenario)["stiffness"])
    assert estimate.monte_carlo_standard_deviation == pytest.approx(estimate.standard_deviation, rel=0.03)
    assert estimate.interval == pytest.approx(estimate.interval_first_order, rel=1e-2)
    assert estimate.monte_carlo_interval == pytest.approx(estimate.interval, rel=2e-3)
    again = variables(identify_stiffness(scenario)["stiffness"])
    assert again.monte_carlo_standard_deviation == estimate.monte_carlo_standard_deviation  # seeded


def test_several_modes_share_the_information():
    scenario = beam(0.9, elements=8)
    f = snubber_point(scenario, "stop").frequencies(2e4, 3) / (2 * np.pi)
    changes = {"identify_stiffness.measured_with": f.tolist(), "identify_stiffness.uncertainty": 2e-3}
    fitted = {**changes, "identify_stiffness.fit_to": [1, 2, 3]}
    one, three = (
        variables(identify_stiffness(load_scenario(scenario, each))["stiffness"]) for each in (changes, fitted)
    )
    assert three.standard_deviation < one.standard_deviation
    assert three.monte_carlo_standard_deviation == pytest.approx(three.standard_deviation, rel=0.03)
    assert three.interval == pytest.approx(three.monte_carlo_interval, rel=5e-3)
    cases = [load_scenario(scenario, {**changes, "identify_stiffness.fit_to": [j]}) for j in (1, 2, 3)]
    information = sum(identify_stiffness(c).summary["standard_deviation_n_per_m"] ** -2 for c in cases)
    assert three.standard_deviation == pytest.approx(information**-0.5, rel=1e-6)
    # modes 1 and 2 wrong by 5 and -5 times the uncertainty: that it is small was believed without a word
    wrong = (f * (1 + 2e-3 * np.array([5.0, -5.0, 0.0]))).tolist()
    changes |= {"identify_stiffness.measured_with": wrong, "identify_stiffness.fit_to": [1, 2, 3]}
    contradicted = identify_stiffness(load_scenario(scenario, changes))
    assert any("contradict each other" in warning for warning in contradicted.warnings)
    assert contradicted.summary["standard_deviation_n_per_m"] > 3.0 * three.standard_deviation
    low, high = contradicted.summary["interval_n_per_m"]
    assert low < 2e4 < high


def test_an_uncertainty_that_reaches_the_pinned_point_leaves_k_unbounded():
    scenario = beam(measured_with=[1.0])
    pinned = snubber_point(scenario, "stop").reach(1)[1] / (2 * np.pi)
    result = identify_stiffness(beam(measured_with=[0.9999 * pinned], uncertainty=1e-2))
    estimate = variables(result["stiffness"])
    assert np.isinf(estimate.interval[1])
    assert estimate.monte_carlo_unreachable > 0.2
    assert any("no upper bound" in warning for warning in result.warnings)


def test_parameter_uncertainties_add_in_quadrature():
    known = [{"parameter": "beam.youngs_modulus", "uncertainty": 0.02}]
    result = identify_stiffness(beam(measured_with=[60.0], uncertainty=1e-3, parameter_uncertainty=known))
    row = variables(result["sensitivities"].sel(parameter="beam.youngs_modulus"))
    assert (row.value, row.uncertainty, row.contribution) == (70e9, 0.02, 0.02 * abs(row.relative))
    assert result["sensitivities"]["value"].sel(parameter="beam.youngs_modulus").unit == "Pa"
    e = variables(result["stiffness"])
    assert e.total_standard_deviation == pytest.approx(
        np.hypot(e.standard_deviation, row.contribution * e.stiffness), rel=1e-12
    )


@pytest.mark.parametrize(("left", "right", "position"), [("pinned", "free", 0.8), ("free", "free", 0.6)])
def test_rigid_body_modes_are_not_counted_in_what_was_measured(left, right, position):
    scenario = beam(position, left, right, elements=12)
    point = snubber_point(scenario, "stop")
    rigid = 1 if left == "pinned" else 2
    closed = point.frequencies(3e4, 5) / (2 * np.pi)
    closed = closed[closed > 1e-3]
    changes = {
        "identify_stiffness.measured_with": closed[:2].tolist(),
        "identify_stiffness.measured_without": (point.omega[rigid : rigid + 2] / (2 * np.pi)).tolist(),
    }
    for listed in (1, 2):
        result = identify_stiffness(load_scenario(scenario, {**changes, "identify_stiffness.fit_to": [listed]}))
        assert result.summary["stiffness_n_per_m"] == pytest.approx(3e4, rel=1e-9)
        for table in (modes(result, "with_snubber"), modes(result, "without_snubber")):
            known = np.isfinite(table.measured_hz)
            assert table.difference_percent[known] == pytest.approx(np.zeros(2), abs=1e-8)
        assert np.isnan(modes(result, "without_snubber").measured_hz[:rigid]).all()


def test_of_several_modes_one_beyond_reach_is_a_warning():
    scenario = beam(0.9, elements=20)
    point = snubber_point(scenario, "stop")
    f = point.frequencies(2e4, 3) / (2 * np.pi)
    f[2] = 0.9999 * point.omega[2] / (2 * np.pi)
    changes = {"identify_stiffness.measured_with": f.tolist(), "identify_stiffness.fit_to": [1, 2, 3]}
    result = identify_stiffness(load_scenario(scenario, changes))
    assert any("measured_with[2]" in warning for warning in result.warnings)
    assert result.summary["stiffness_n_per_m"] == pytest.approx(2e4, rel=0.05)
    assert np.isnan(result["stiffness"]["individual"].sel(mode=3).item())
    assert result.summary["uncertainty_from"] == "scatter"
