"""Stated errors hold the true ones, and values without a limit as the modes grow are named."""

import math
from pathlib import Path

import pytest
import yaml
from imported_chain import imported_chain
from shipped import config_path

import beamsim
from beamsim.cli.motions import run_screen, sweep_screen
from beamsim.cli.screens import significant_digits
from beamsim.scenario import load_scenario
from beamsim.trust.convergence import errors_of

ROOT = Path(__file__).parents[2]
BEAM = {"length": "270 mm", "width": "50 mm", "thickness": "5 mm", "youngs_modulus": "69 GPa", "density": "2700 kg/m^3"}
TIP_FORCE = {"kind": "step", "applied_to": {"position": "270 mm"}, "level": "10 N"}


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


@pytest.mark.parametrize(("more", "right"), [
    ({"dashpot": "5 %"}, 77.4),  # 59.7 g with 10 modes, 69.5 with 40
    ({"excitation": TIP_FORCE}, 10.0 / 0.0042 / 9.80665),  # F / M
])  # fmt: skip
def test_the_error_of_a_peak_at_a_light_mass_reaches_its_limit_after_a_jump(more, right):
    """At the contact of a dashpot the limit is the same from models of 10, 20 and 40 modes to 0.01 %."""
    case = beam(10, 20, masses=("270 mm",), dashpot=more.get("dashpot"))
    if "excitation" in more:
        case = load_scenario(yaml.safe_load(case.to_yaml()) | {"snubbers": []} | more)
    summary = beamsim.run(case).summary
    value, error = summary["peak_acceleration_g"]["tip"], summary["convergence"]["peak_acceleration_g"]["tip"]
    assert value / (1.0 - error) == pytest.approx(right, rel=1e-3)
    assert "peak_acceleration_g.tip" in summary["doubtful"]


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
    result = beamsim.run(beam(10, 20, convergence="off", duration=0.05, **more))
    keys = [key for key in result.summary.get("without_limit", ()) if key.startswith("peak_acceleration_g.")]
    assert sorted(key.partition(".")[2] for key in keys) == without
    told = [text for text in result.warnings if "has no limit" in text]
    assert [text.partition(":")[0] for text in sorted(told)] == [f"probes.{name}" for name in without]
    assert all("run.low_pass" in text and "point mass" in text for text in told)
    assert run_screen(result).text(result, ["case.h5"]).count(" g ^") == len(without)


def test_the_mass_at_the_contact_has_to_be_within_reach():
    """The sum of squared shapes has the limit 1 / m: with 4 mg a model of ten times the modes is nowhere near it."""
    case = beam(10, 20, dashpot="5 %", masses=("270 mm",), convergence="off", duration=0.05)
    light = load_scenario(case, {"beam.point_masses[0].mass": "4 mg"})
    assert "without_limit" not in beamsim.run(case).summary
    assert "peak_acceleration_g.tip" in beamsim.run(light).summary["without_limit"]


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


RUBBING = {
    "name": "pad",
    "at": {"position": "270 mm"},
    "normal_force": "3 N",
    "coefficient": {"static": 0.4, "sliding": 0.1},
}


def without_snubbers(modes, ratio="1 %", masses=(), **sections):
    """The beam without its stop, with other sections, for 0.05 s."""
    data = beam(modes, 2 * modes, ratio=ratio, masses=masses, duration=0.05, convergence="off").to_yaml()
    return load_scenario(yaml.safe_load(data) | {"snubbers": []} | sections)


@pytest.mark.parametrize(("more", "without"), [
    ({"excitation": TIP_FORCE}, ["tip"]),
    ({"excitation": TIP_FORCE, "ratio": "0.0001 %"}, ["middle", "tip"]),
    ({"excitation": TIP_FORCE, "masses": ("270 mm",)}, []),
    ({"excitation": TIP_FORCE | {"rise": "1 ms"}}, []),
    ({"excitation": {**TIP_FORCE, "kind": "harmonic", "frequency": "65 Hz", "phase": "90 deg"}}, ["tip"]),
    ({"excitation": {**TIP_FORCE, "kind": "harmonic", "frequency": "65 Hz"}}, []),
    ({"excitation": {"kind": "step", "applied_to": "base", "level": "5 g"}}, []),
    ({"friction": [RUBBING]}, ["tip"]),
    ({"friction": [RUBBING | {"stiffness": "200 kN/m"}]}, ["tip"]),
    ({"friction": [RUBBING | {"coefficient": 0.2}]}, []),
])  # fmt: skip
def test_forces_that_jump_leave_accelerations_without_a_limit(more, without):
    """With 10, 20, 40, 80 modes the tip has 394, 785, 1569, 3136 g by a step of 10 N, and 36, 70, 140, 281 g by
    friction that falls where it begins to slide; the middle by the step, without damping, 98, 175, 236, 382 g.

    With a mass of 4.2 g the tip has at most F / m = 243 g; with a rise of 1 ms 38.7 g, by a base that jumps 17.5 g,
    with one coefficient of friction 12.8 g.
    """
    result = beamsim.run(without_snubbers(10, **more))
    keys = [key for key in result.summary.get("without_limit", ()) if key.startswith("peak_acceleration_g.")]
    assert sorted(key.partition(".")[2] for key in keys) == without
    assert len([text for text in result.warnings if "has no limit" in text]) == len(without)


def test_an_output_that_is_an_acceleration_has_no_limit_where_that_of_a_probe_has_none():
    case = without_snubbers(
        10, excitation=TIP_FORCE, outputs=[{"name": "a", "kind": "acceleration", "position": "270 mm"}]
    )
    keys = {"peak_output.a", "min_output.a", "max_output.a"}
    assert keys <= set(beamsim.run(case).summary["without_limit"])
    filtered = load_scenario(case, {"run.low_pass": "2 kHz"})  # which filters probes, and no output
    assert set(beamsim.run(filtered).summary["without_limit"]) == keys


@pytest.mark.parametrize(("limits", "verdicts"), [
    ({"peak_acceleration": "500 g"}, ["not reliable"]),
    ({"peak_acceleration": "50 g"}, ["not reliable"]),
    ({"peak_acceleration": "30 g"}, ["exceeded"]),  # by the middle, which has 40 g
    ({"peak_acceleration": "500 g", "peak_displacement": "1 mm"}, ["not reliable", "ok"]),
])  # fmt: skip
@pytest.mark.parametrize("convergence", ["on", "off"])
def test_a_value_without_a_limit_neither_keeps_nor_exceeds_what_limits_it(limits, verdicts, convergence):
    """The tip has 110 g with ten modes, and more than any limit with enough of them."""
    case = beam(10, 20, dashpot="5 %", duration=0.2, **({"convergence": "off"} if convergence == "off" else {}))
    result = beamsim.run(load_scenario(case, {"limits": limits}))
    found = result.summary["margins"]
    assert [found[name]["verdict"] for name in limits] == verdicts
    assert math.isinf(found["peak_acceleration"]["highest"])
    assert f"peak acceleration {verdicts[0].upper()}" in run_screen(result).text(result, ["case.h5"])


@pytest.mark.parametrize("sweep", [
    {"kind": "swept_sine", "rate": "16 oct/min", "tolerance": 1e-8}, {"kind": "stepped", "points": 2},
])  # fmt: skip
def test_sweeps_mark_accelerations_without_a_limit(sweep):
    """At 60 to 62 Hz the tip has 98 g with ten modes and 351 g with forty."""
    data = yaml.safe_load(beam(6, 12, dashpot="5 %").to_yaml())
    del data["run"]
    sweep = {"from": "60 Hz", "to": "62 Hz", "levels": ["2 g"], "convergence": "off"} | sweep
    case = load_scenario(data | {"sweep": sweep, "limits": {"peak_acceleration": "500 g"}})
    result = beamsim.sweep(case)
    marked = [key for key in result.summary["without_limit"] if key.startswith("peak")]
    assert marked == ["peak_acceleration_g.up_0 tip"]
    assert result.summary["margins"]["peak_acceleration"]["verdict"] == "not reliable"
    assert " g ^" in sweep_screen(result).text(result, ["case.h5"])
    masses = [{"position": "270 mm", "mass": "20 g"}]
    assert "without_limit" not in beamsim.sweep(load_scenario(case, {"beam.point_masses": masses})).summary


def test_reactions_at_the_edges_of_plates_converge_with_order_1_5():
    """Twice the elements leave 2^-1.5 of their error; of other values 2^-2."""
    plate = load_scenario(ROOT / "configs/structures/plate_panel.yaml", {"outputs": [
        {"name": "edge", "kind": "reaction_force", "support": "base"},
        {"name": "inside", "kind": "acceleration", "position": [0.1, 0.1]},
    ]})  # fmt: skip
    found = errors_of({"peak_output": {"edge": 0.045, "up_0 edge": 0.045, "inside": 0.045}}, plate, complete=False)
    stated = found["peak_output"]
    assert stated["edge"] == stated["up_0 edge"] == pytest.approx(0.045 / (1.0 - 2.0**-1.5))
    assert stated["inside"] == pytest.approx(0.045 / 0.75)


def test_what_two_models_agree_in_by_chance_has_a_least_error():
    """Forces that hold inertia as accelerations do, and shares of high peaks; strains and displacements have none."""
    case = load_scenario(config_path("yoke_reactions"))
    small = {"clamp_force": 1e-6, "hinge_moment": 1e-6, "gauge": 1e-6}
    found = errors_of(
        {
            "peak_output": small,
            "peak_displacement_m": {"panel_middle": 1e-6},
            "random": {"tip displacement peaks_over_3_sigma": 0.0},
        },
        case,
        complete=False,
    )
    assert found["peak_output"] == pytest.approx(
        {"clamp_force": 1e-3, "hinge_moment": 1e-3, "gauge": 1.125e-6}, rel=0.1
    )
    assert found["peak_displacement_m"]["panel_middle"] < 2e-6
    assert found["random"]["tip displacement peaks_over_3_sigma"] == 0.01
