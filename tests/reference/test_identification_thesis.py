"""Section 1.3.3 of the thesis: what its frequencies say of the snubber and of the beam."""

import numpy as np
import pytest
from shipped import config_path

from beamsim.analyses.identify.analysis import identify_stiffness
from beamsim.analyses.identify.stiffness import snubber_point
from beamsim.scenario import load_scenario

CASE = config_path("identify_snubber")


def case(**changes):
    return load_scenario(CASE, {f"identify_stiffness.{key}": value for key, value in changes.items()})


@pytest.mark.parametrize(("measured", "stiffness"), [(196.0, 151.43e3), (196.5, 153.59e3)])
def test_stiffness_from_the_first_frequency(measured, stiffness):
    result = identify_stiffness(case(measured_with=[measured]))
    assert result.summary["stiffness_n_per_m"] == pytest.approx(stiffness, rel=1e-3)
    assert result.summary["frequencies_with_hz"][0] == pytest.approx(measured, rel=1e-13)


def test_tables_1_2_and_1_3():
    result = identify_stiffness(case(measured_with=[196.0]))
    assert result.summary["frequencies_without_hz"] == pytest.approx([52.7, 328.5, 931.3], rel=0.01)
    assert result.summary["frequencies_with_hz"] == pytest.approx([196.0, 447.1, 966.0], rel=0.01)


def test_pad_modulus_is_k_h_over_b():
    result = identify_stiffness(case(measured_with=[196.0]))
    assert result.summary["pad_youngs_modulus_pa"] == pytest.approx(result.summary["stiffness_n_per_m"] * 0.02 / 250e-6)


def test_a_step_of_the_loop_can_jump_over_a_narrow_tolerance():
    result = identify_stiffness(case(method="thesis", tolerance=1e-6))
    assert not result.complete
    assert result.outcome.code == "stepped_over"
    assert result.summary["stiffness_n_per_m"] > 0
    capped = identify_stiffness(case(method="thesis", most_solutions=50))
    assert capped.outcome.code == "solution_limit"
    assert "after 50 eigenvalue solutions" in capped.outcome.text


def test_the_printed_stiffness_lacks_a_factor_of_the_length():
    # 559.625 kN/m gives none of table 1.3; times L it gives all of it.
    point = snubber_point(case(), "tip")
    printed = point.frequencies(559.625e3, 3) / (2 * np.pi)
    corrected = point.frequencies(559.625e3 * 0.27, 3) / (2 * np.pi)
    assert np.all(np.abs(printed / [196, 447.1, 966] - 1) > 0.1)
    assert corrected == pytest.approx([196, 447.1, 966], rel=0.005)


def test_the_printed_accelerometers_are_ten_times_too_heavy():
    heavy = [{"position": x, "mass": 0.045} for x in (0.135, 0.2025, 0.27)]
    scenario = load_scenario(
        CASE,
        {
            "beam.point_masses": heavy,
            "identify_stiffness.measured_without": [52.7, 328.5, 931.3],  # table 1.2, predicted
            "identify_stiffness.measured_with": [196.0],
            "identify_stiffness.update": ["beam.point_masses[*].mass"],
        },
    )
    result = identify_stiffness(scenario)
    assert result.summary["frequencies_before_hz"][0] < 40
    assert result["update"]["value"].values == pytest.approx([4.2e-3], rel=0.1)
    assert np.abs(result.summary["difference_without_percent"]).max() < 1.0
    assert result.summary["stiffness_n_per_m"] == pytest.approx(151.1e3, rel=0.01)
