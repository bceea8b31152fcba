"""What was understood of a case, with sizes in closed form, and questions about numbers far from plausible."""

import math

import numpy as np
import pytest

import beamsim
from beamsim.plots.style import use_units
from beamsim.plots.understood import interpretation
from beamsim.scenario import load_scenario
from beamsim.system.build import build_system

G = 9.80665
CASE = """
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700 kg/m^3,
  damping: {kind: modal, ratio: 1 %}}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151 kN/m, gap: 0.1 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.2 s}
"""  # fmt: skip
PULSE = "excitation={{kind: {}, applied_to: base, level: 20 g, duration: 11 ms}}"
FLAT = (
    "excitation={{kind: random, applied_to: base, "
    "psd: [{{frequency: 20, density: {0}}}, {{frequency: 400, density: {0}}}]}}"
)


def questions(*overrides):
    scenario = load_scenario(CASE, overrides)
    return [text for text in (*scenario.warnings, *build_system(scenario).warnings) if "meant?" in text]


def line(*overrides):
    scenario = load_scenario(CASE, overrides)
    return interpretation(scenario, None, {})


@pytest.mark.parametrize(
    ("kind", "area"), [("half_sine", 2.0 / math.pi), ("sawtooth", 0.5), ("trapezoid", 0.9), ("step", 1.0)]
)
def test_the_velocity_change_of_a_pulse_is_the_area_under_it(kind, area):
    change = 20.0 * G * 0.011 * area
    assert line(PULSE.format(kind)).endswith(f"20 g, 11 ms, velocity change {change:.4g} m/s, at the base")


def test_a_pulse_with_a_rise_has_the_area_of_its_cosines():
    """A numerical integral of the level, and the impulse of a force."""
    rise, duration = 3e-3, 11e-3
    t = np.linspace(0.0, duration, 200_001)
    shape = np.where(t < rise, 0.5 - 0.5 * np.cos(np.pi * t / rise), 1.0)
    shape = np.where(t > duration - rise, 0.5 - 0.5 * np.cos(np.pi * (duration - t) / rise), shape)
    area = 7.0 * np.trapezoid(shape, t)
    force = "{kind: step, applied_to: {position: 0.27}, level: 7 N, duration: 11 ms, rise: 3 ms}"
    assert f"impulse {1e3 * area:.4g} mN s" in line(f"excitation={force}")


def test_the_rms_of_a_density_is_the_root_of_its_area_on_logarithmic_axes():
    levels = {20: 0.01, 80: 0.04, 350: 0.04, 2000: 0.007}
    psd = ", ".join(f"{{frequency: {f}, density: {level} g^2/Hz}}" for f, level in levels.items())
    slope = math.log(0.04 / 0.01) / math.log(80 / 20) + 1.0
    area = 0.01 * 20 * ((80 / 20) ** slope - 1) / slope + 0.04 * 270
    area += 0.04 * 350 * math.log(2000 / 350)  # a slope of -1: 0.007 / 0.04 = 350 / 2000
    said = line(f"excitation={{kind: random, applied_to: base, psd: [{psd}]}}")
    assert f"rms {math.sqrt(area):.4g} g, 20 to 2000 Hz" in said


def test_a_record_is_told_with_its_peak_and_rms(tmp_path):
    t = np.linspace(0.0, 0.3, 1201)
    a = 3.0 * np.sin(2 * np.pi * 50.0 * t)
    np.savetxt(tmp_path / "record.csv", np.c_[t, a], delimiter=",", header="time (s),a (g)", comments="")
    case = tmp_path / "case.yaml"
    case.write_text(CASE.replace("kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz",
                                 "kind: sampled, applied_to: base, file: record.csv"))  # fmt: skip
    result = beamsim.run(load_scenario(case))
    said = f"peak 3 g, rms {np.sqrt(np.mean(a**2)):.4g} g, record.csv"
    assert said in str(result)
    path = beamsim.write_result(result, tmp_path / "case.h5")
    assert said in str(beamsim.load(path or tmp_path / "case.h5"))


def test_the_line_has_the_filter_against_the_excitation_and_the_modes():
    result = beamsim.run(load_scenario(CASE, ["run.low_pass=2 kHz"]))
    frequency = result["modes"]["open_frequencies_hz"].values[0]
    assert "harmonic, 2 g, 65 Hz, at the base; low-pass filter 2000 Hz, 30.8 times the excitation's 65 Hz" in str(
        result
    )
    assert f"first mode {frequency:.3g} Hz open" in str(result)


DOUBTFUL = {
    "filter": ("run.low_pass=2", "run.low_pass = 2 Hz lies below the excitation, 65 Hz; was 2 kHz meant?"),
    "filter in hertz": ("run.low_pass=2 Hz", "was 2 kHz meant?"),
    "stop": ("snubbers.tip.stiffness=151", "snubbers[0].stiffness = 151 N/m is 0.028 of the static stiffness of the"),
    "gas": ("beam.density=2.7 kg/m^3", "= 2.7 kg/m^3 is outside the range of solids; was 2.7 g/cm^3 meant?"),
    "rubber": ("beam.youngs_modulus=69 MPa", "is outside the range of structural materials; was 69 GPa meant?"),
    "pulse": (PULSE.format("half_sine").replace(" ms", ""), "11 s is 616 periods of the first mode"),
    "sawtooth": (PULSE.format("sawtooth").replace(" ms", " s"), "was 11 ms meant?"),
    "density": (FLAT.format("0.01"), "excitation.psd[0].density = 0.01 (m/s^2)^2/Hz is low for the highest density"),
    "length": ("beam.length=270", "beam.length = 270 m is long for a structure; was 270 mm meant?"),
    "degrees": ("excitation.phase=90", "excitation.phase = 90 rad is more than a turn, 6.283 rad; was 90 deg meant?"),
    "gravity": ("gravity=9810", "was 9810 mm/s^2 meant?"),
    "gap": ("snubbers.tip.gap=0.1", "structure of this size (more than 0.05 m); was 0.1 mm meant?"),
    "ratio": ("beam.damping.ratio=2", "beam.damping.ratio = 2 is critical damping or more; was 2 % meant?"),
    "stop without effect": ("snubbers.tip.stiffness=0.151", "5477 N/m; was another unit meant?"),
    "slow sine": ("excitation.frequency=0.065", "times the highest frequency of the excitation, 0.065 Hz"),
}  # fmt: skip


@pytest.mark.parametrize(("override", "said"), DOUBTFUL.values(), ids=DOUBTFUL)
def test_a_number_far_from_plausible_is_asked_for_with_both_readings(override, said):
    asked = questions(override)
    assert len(asked) == 1
    assert said in asked[0]


@pytest.mark.parametrize(
    "override",
    [
        "run.low_pass=0.002 kHz", "run.low_pass=120 rpm", "run.low_pass=2000", "snubbers.tip.stiffness=0.151 kN/m",
        "snubbers.tip.stiffness=200", "beam.density=0.0027 g/cm^3", "beam.density=27", "beam.youngs_modulus=0.069 GPa",
        "beam.youngs_modulus=1 GPa", PULSE.format("half_sine").replace("11 ms", "11000 ms"), PULSE.format("sawtooth"),
        PULSE.format("half_sine").replace("11 ms", "1"), FLAT.format("0.01 m^2/s^3"), FLAT.format("0.04"),
        "excitation.frequency=1", "excitation.phase=90 deg", "excitation.phase=6.28", "excitation.phase=90.0 rad",
        "gravity=9810 mm/s^2", "gravity=50", "gravity=[0, 0, 9810]",
        "snubbers.tip.gap=10 cm", "snubbers.tip.gap=100 mm",
        "beam.damping.ratio=200 %",
    ],
)  # fmt: skip
def test_another_unit_or_a_plausible_number_is_taken_as_it_is(override):
    assert questions(override) == []


def test_a_case_of_a_study_is_asked_for_and_an_array_of_python_is_not():
    changed = load_scenario(CASE, ["beam.density=2.7"]).beam
    study = "vary: {{kind: grid, parameters: [{{path: beam.density, values: [2700, {}]}}]}}\n"
    case = load_scenario(CASE + study.format("2.7 kg/m^3")).model_copy(update={"beam": changed})
    assert any("beam.density = 2.7 kg/m^3 is outside" in each for each in case.warnings)
    case = load_scenario(CASE + study.format("0.0027 g/cm^3")).model_copy(update={"beam": changed})
    assert not any("meant?" in each for each in case.warnings)
    values = {"path": "beam.density", "values": np.array([2700.0, 2.7])}
    study_of_python = load_scenario(CASE, {"vary": {"kind": "grid", "parameters": [values]}})
    case = study_of_python.model_copy(update={"beam": changed})
    assert not any("meant?" in each for each in case.warnings)


@pytest.mark.parametrize(
    ("stiffness", "meant"),
    [("151 kN/m", ""), ("151", "another unit"), ("0.151", "another unit"), ("151 N/m", "another unit")],
)
def test_a_stop_without_effect_is_asked_for_once_and_not_in_the_unit_in_which_it_is_written(stiffness, meant):
    """A beam 0.5 m thick, at whose tip a deflection of 1 m takes 5 GN."""
    scenario = load_scenario(CASE, ["beam.thickness=0.5", f"snubbers.tip.stiffness={stiffness}"])
    said = [text for text in build_system(scenario).warnings if text.startswith("snubbers")]
    assert sum("the stiffness has no effect" in text for text in said) == 1
    asked = [text for text in said if "meant?" in text]
    assert [text.split("; was ")[1] for text in asked] == ([f"{meant} meant?"] if meant else [])


def test_angles_and_damping_written_in_degrees_and_per_cent_are_not_asked_for_in_them():
    boom = """
bodies: {arm: {kind: beam, length: 1 m, width: 20 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700}}
joints: [{kind: hinge, name: root, between: [{body: arm, position: 0}, base], rotational_stiffness: 10,
  stops: [{angle: %s, side: above, stiffness: 100}]}]
"""
    for angle, asked in (("40 deg", False), ("0.7", True), ("0.7 rad", True)):
        (text,) = (each for each in load_scenario(boom % angle).warnings if "small rotations" in each)
        assert text.endswith("meant?") is asked


def test_accelerations_are_shown_in_g_where_tests_are_written_in_it_beside_a_gravity():
    for level, shown in (("2 g", "2 g"), ("20 m/s^2", "20 m/s^2")):
        overrides = ["gravity=9.81 m/s^2", f"excitation.level={level}"]
        with use_units(load_scenario(CASE, overrides).display_scales):
            assert line(*overrides).startswith(f"harmonic, {shown}, 65 Hz")


@pytest.mark.parametrize(
    ("rate", "said"),
    [("2 Hz/s", "2 Hz/s, 527 cycles"), ("3 Hz/min", "3 Hz/min, 21090 cycles"), ("90 Hz/s", "12 cycles")],
)
def test_a_linear_sweep_is_told_in_the_unit_that_suits_its_rate(rate, said):
    """(f2^2 - f1^2) / (2 rate) cycles."""
    sweep = f"sweep={{kind: swept_sine, from: 10 Hz, to: 47 Hz, rate: {rate}}}"
    assert said in interpretation(load_scenario(CASE, [sweep]), None, {}, "sweep")


def test_a_run_that_ends_within_the_first_cycle_of_a_sweep_says_so():
    swept = "excitation={kind: swept_sine, applied_to: base, level: 1 g, from: 3 Hz, to: 100 Hz, rate: 4 oct/min}"
    scenario = load_scenario(CASE, [swept])
    assert "4 oct/min, less than 1 cycle, at the base" in interpretation(scenario, None, {})
    assert any("ends within the first cycle of excitation, which begins at 3 Hz" in each for each in scenario.warnings)
    assert not any("first cycle" in each for each in load_scenario(CASE, [swept, "run.duration=0.4"]).warnings)


def test_a_limit_far_above_its_value_is_asked_for():
    result = beamsim.run(load_scenario(CASE, ["limits={peak_displacement: 100}"]))
    assert any(
        text.startswith("limits.peak_displacement = 100 m is") and text.endswith("meant?") for text in result.warnings
    )
    assert result.outcome.trusted
    result = beamsim.run(load_scenario(CASE, ["limits={peak_displacement: 10 mm}"]))
    assert not any("meant?" in text for text in result.warnings)


@pytest.mark.parametrize(("begin", "end"), [(10, 40), (40, 10)])
def test_a_swept_sine_tells_its_cycles(begin, end):
    """The integral of the frequency: (f2 - f1) / ln 2 over the rate in octaves, as many upwards as downwards.

    A run that ends before the sweep has the cycles up to its end.
    """
    per_factor_e = 60.0 / 4.0 / math.log(2.0)  # s of a sweep by a factor of e
    swept = f"{{kind: swept_sine, applied_to: base, level: 1 g, from: {begin} Hz, to: {end} Hz, rate: 4 oct/min}}"
    at_end = begin * math.exp(math.copysign(10.0 / per_factor_e, end - begin))
    for duration, cycles in ((30.0, 30.0 * per_factor_e), (10.0, abs(at_end - begin) * per_factor_e)):
        expected = f"{begin} to {end} Hz, 4 oct/min, {cycles:.0f} cycles, at the base"
        assert line(f"excitation={swept}", f"run.duration={duration}").endswith(expected)
