"""Stated errors hold the true ones, and values without a limit as the modes grow are named."""

import pytest
import yaml
from imported_chain import imported_chain

import beamsim
from beamsim.cli.motions import run_screen
from beamsim.cli.screens import significant_digits
from beamsim.scenario import load_scenario

BEAM = {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa", "density": "2700 kg/m^3"}


def beam(modes, elements, *, ratio="1 %", dashpot=None, masses=(), **run):
    """The README's beam with other damping, dashpot and masses."""
    stop = {"name": "tip", "position": "270 mm", "side": "below", "stiffness": "151.1 kN/m", "gap": 0}
    return load_scenario({
        "beam": BEAM | {
            "elements": elements, "damping": {"kind": "modal", "ratio": ratio},
            "point_masses": [{"position": x, "mass": "4.2 g"} for x in masses],
        },
        "snubbers": [stop | ({"damping": {"kind": "ratio", "ratio": dashpot}} if dashpot else {})],
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "65 Hz"},
        "probes": [{"name": "tip", "position": "270 mm"}, {"name": "middle", "position": "135 mm"}],
        "run": {"duration": 0.8, "spectrum": None} | run, "reduction": {"modes": modes},
    })  # fmt: skip


@pytest.mark.parametrize(("more", "modes"), [
    ({"dashpot": "2 %", "masses": ("135 mm", "202.5 mm", "270 mm")}, 10),
    ({"dashpot": "2 %", "masses": ("135 mm", "202.5 mm", "270 mm")}, 15),
    ({}, 10),
    ({}, 15),
])  # fmt: skip
def test_the_true_error_of_peak_accelerations_is_not_above_the_stated_one(more, modes):
    """1.5 times the modes change them by a third of what is missing; the truth has 80 modes and 160 elements."""
    found = beamsim.run(beam(modes, 2 * modes, **more)).summary
    truth = beamsim.run(beam(80, 160, convergence="off", **more)).summary["peak_acceleration_g"]
    for place, value in found["peak_acceleration_g"].items():
        true = abs(value - truth[place]) / max(value, truth[place])
        assert true <= found["convergence"]["peak_acceleration_g"][place] < max(2.0 * true, 2e-3)


@pytest.mark.parametrize(("more", "without"), [
    ({"dashpot": "5 %"}, ["tip"]),
    ({"dashpot": "5 %", "ratio": "0.0001 %"}, ["middle", "tip"]),
    ({"dashpot": "5 %", "ratio": "0.0001 %", "low_pass": "2 kHz"}, []),
    ({"dashpot": "2 %", "masses": ("270 mm",)}, []),
    ({"ratio": "0.0001 %"}, []),
])  # fmt: skip
def test_accelerations_without_a_limit_are_named(more, without):
    """By a jump of the force at a point without mass: there, and without damping of the body at the middle, too.

    With 10, 20, 40 and 80 modes the tip has 110, 229, 466 and 941 g; the middle, where the body has next to no damping,
    52, 75, 98 and 128 g, and where it has 1 %, 39.7, 40.5, 40.5 and 40.5 g.
    """
    result = beamsim.run(beam(10, 20, convergence="off", **more))
    assert sorted(result.summary.get("acceleration_jump_g", {})) == without
    told = [text for text in result.warnings if "has no limit" in text]
    assert [text.partition(":")[0] for text in sorted(told)] == [f"probes.{name}" for name in without]
    assert all("run.low_pass" in text and "point mass" in text for text in told)
    assert run_screen(result).text(result, ["case.h5"]).count(" g ^") == len(without)


def test_the_mass_at_the_contact_has_to_be_within_reach():
    """The sum of squared shapes has the limit 1 / m: with 4 mg a model of ten times the modes is nowhere near it."""
    case = beam(10, 20, dashpot="5 %", masses=("270 mm",), convergence="off")
    light = load_scenario(case, {"beam.point_masses[0].mass": "4 mg"})
    assert "acceleration_jump_g" not in beamsim.run(case).summary
    assert list(beamsim.run(light).summary["acceleration_jump_g"]) == ["tip"]


def test_imported_matrices_with_all_of_their_modes_are_not_solved_again(tmp_path):
    case = imported_chain(tmp_path, 8) | {"reduction": {"modes": "all"}}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case))
    summary = beamsim.run(load_scenario(tmp_path / "case.yaml")).summary
    assert summary["convergence_model"]["modes"] == 0
    assert set(summary["convergence"]["peak_displacement_m"].values()) == {0.0}


@pytest.mark.parametrize(("value", "error", "digits"), [
    (197.66, 0.0105, 3), (197.66, 0.033, 3), (197.66, 0.4, 3), (197.66, 0.6, 2), (0.0, 0.1, 3), (5.0, 0.0, 3),
    (-9.4, 0.15, 2),
])  # fmt: skip
def test_a_value_is_printed_to_the_second_digit_of_its_error(value, error, digits):
    assert significant_digits(value, error) == digits
