"""The default number of modes at stiff contacts: twice as many as move with the contact (theory, section 7)."""

from typing import Any

import numpy as np
import pytest

import beamsim

LENGTH, BENDING = 0.27, 69e9 * 0.05 * 0.005**3 / 12  # m, N m^2


def struck_beam(stiffness: float, **more: Any) -> dict[str, Any]:
    """A cantilever in 120 elements that hits a stop at its tip."""
    return {
        "beam": {
            "length": LENGTH, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
            "elements": 120, "supports": {"left": "clamped", "right": "free"},
            "damping": {"kind": "modal", "ratio": 0.01},
        },
        "snubbers": [{"name": "tip", "position": LENGTH, "side": "below", "stiffness": stiffness, "gap": 0.0}],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": 65.0},
        "probes": [{"name": "tip", "position": LENGTH}],
        "run": {"duration": 0.03, "sample_rate": 20000.0, "convergence": "off"},
        **more,
    }  # fmt: skip


def modes_with_contact(stiffness: float) -> float:
    """Of a long beam with its end on a spring: E I beta^3 = sqrt(2) k at beta = n pi / L."""
    return float(LENGTH / np.pi * np.cbrt(np.sqrt(2) * stiffness / BENDING))


@pytest.mark.parametrize("stiffness", [1e7, 1e8])
def test_twice_the_modes_that_move_with_the_contact_are_kept(stiffness: float) -> None:
    kept = beamsim.run(struck_beam(stiffness)).summary["kept_modes"]
    assert 1.9 < kept / modes_with_contact(stiffness) < 2.6  # the frequency is doubled at a time: 1.4 times the modes


def test_forces_at_a_stiff_stop_are_those_of_a_model_of_many_modes() -> None:
    default, of_ten, right = (
        beamsim.run(struck_beam(1e8, **more)).summary["peak_force_n"]["tip"]
        for more in ({}, {"reduction": {"modes": 10}}, {"reduction": {"modes": 80}})
    )
    assert abs(default / right - 1) < 0.01
    assert abs(of_ten / right - 1) > 0.03  # what a number that looks at frequencies alone gave


def test_soft_stops_and_stated_numbers_of_modes_need_no_more() -> None:
    assert beamsim.run(struck_beam(151.1e3)).summary["kept_modes"] == 10
    assert beamsim.run(struck_beam(1e8, reduction={"modes": 10})).summary["kept_modes"] == 10


def test_a_mesh_sets_the_limit() -> None:
    case = struck_beam(1e9)
    case["beam"]["elements"] = 20
    assert 18 < beamsim.run(case).summary["kept_modes"] <= 20
