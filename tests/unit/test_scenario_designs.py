"""`vary:` and `limits:` read, resolved and refused."""

import pytest

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario
from beamsim.scenario.studies import varied_parameters

pytestmark = pytest.mark.quick

BASE = """\
title: Small study
beam: {length: 270 mm, width: 50 mm, thickness: 5 mm, youngs_modulus: 69 GPa, density: 2700, elements: 4,
  point_masses: [{position: 100 mm, mass: 4 g}, {position: 200 mm, mass: 5 g}]}
snubbers: [{name: tip, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0 mm}]
excitation: {kind: harmonic, applied_to: base, level: 2 g, frequency: 65 Hz}
run: {duration: 0.05 s}
"""
STIFFNESS = "{path: snubbers.tip.stiffness, values: [50 kN/m, 100 kN/m]}"


def study(*parameters, kind="grid", extra="", base=BASE):
    lines = "".join(f"    - {parameter}\n" for parameter in parameters)
    return f"{base}vary:\n  kind: {kind}\n{extra}  parameters:\n{lines}"


def resolved(*parameters, **options):
    return varied_parameters(load_scenario(study(*parameters, **options)))


def refused(text):
    with pytest.raises(ScenarioError) as caught:
        load_scenario(text)
    problems = caught.value.problems
    assert all(problem.remedy and problem.line for problem in problems), problems
    return "\n".join(str(problem) for problem in problems)


def test_values_are_read_by_the_field_they_are_meant_for():
    stiffness, support, level, mass = resolved(
        STIFFNESS,
        "{path: beam.supports.right, values: [free, pinned]}",
        "{path: excitation.level, from: 1 g, to: 20, points: 3}",
        "{path: 'beam.point_masses[*].mass', values: [1 g, 0.002]}",
    )
    assert stiffness.values == (50e3, 100e3)
    assert stiffness.unit == "N/m"
    assert support.values == ("free", "pinned")
    assert (level.low, level.high, level.unit) == (9.80665, 20.0, "m/s^2")
    assert mass.values == (0.001, 0.002)  # g is gram here
    assert mass.places == (("beam", "point_masses", 0, "mass"), ("beam", "point_masses", 1, "mass"))


PSD = "{kind: random, applied_to: %s, psd: [{frequency: 20 Hz, density: %s}, {frequency: 200 Hz, density: 1}]}"
BASE_PSD, FORCE_PSD = PSD % ("base", "0.02 g^2/Hz"), PSD % ("{position: 50 %}", "5")
PROFILE = (
    "{kind: swept_sine, applied_to: base, from: 5 Hz, to: 90 Hz, rate: 2 oct/min, "
    "profile: [{frequency: 5 Hz, level: 3 mm}, {frequency: 20 Hz, level: 2 g}]}"
)
FALLS = "{duration: 0.05 s, start: {displacement: [0 mm, 0, 3 1/m], velocity: [0, 0, 2 1/m/s]}}"
LEVELS = [
    ("excitation", BASE_PSD, "psd[0].density", "0.01 g^2/Hz", "m^2/s^3", "0.1 N^2/Hz"),
    ("excitation", BASE_PSD, "psd[1].density", "0.01 g^2/Hz", "m^2/s^3", "0.1 N^2/Hz"),  # written without a unit
    ("excitation", FORCE_PSD, "psd[0].density", "2 N^2/Hz", "N^2/Hz", "0.1 g^2/Hz"),
    ("excitation", PROFILE, "profile[0].level", "2 mm", "m", "4 g"),
    ("run", FALLS, "start.displacement[2]", "4 1/m", "1/m", "4 mm"),
    ("run", FALLS, "start.velocity[2]", "3 1/m/s", "1/m/s", "3 m/s"),
]


@pytest.mark.parametrize(("section", "text", "key", "value", "unit", "wrong"), LEVELS)
def test_a_level_is_varied_in_the_unit_of_what_it_is(section, text, key, value, unit, wrong):
    """Densities, points of a profile and starts were taken for accelerations, and their units refused."""
    path, others = f"{section}.{key}", [line for line in BASE.splitlines() if not line.startswith(section)]
    base = "\n".join([*others, f"{section}: {text}\n"])
    (number,) = resolved(f"{{path: '{path}', values: [{value}, 7]}}", base=base)
    assert number.unit == unit
    said = refused(study(f"{{path: '{path}', values: [{wrong}, 7]}}", base=base))
    assert f"and {path} is a" in said
    assert "write for example" in said
    sample = {"kind": "latin_hypercube", "extra": "  samples: 4\n"}
    (about,) = resolved(f"{{path: '{path}', tolerance: {value}}}", base=base, **sample)
    assert about.high - about.low == pytest.approx(2.0 * number.values[0])


def test_each_mass_of_a_chain_starts_with_a_displacement():
    base = "chain: {masses: [1, 1], springs: [1000, 1000]}\nexcitation: {kind: none}\n"
    base += "run: {duration: 1 s, start: {displacement: [1 mm, 0]}}\n"
    (number,) = resolved("{path: 'run.start.displacement[1]', values: [1 mm, 2 mm]}", base=base)
    assert (number.unit, number.values) == ("m", (1e-3, 2e-3))


def test_one_parameter_may_drive_several_numbers():
    (axis,) = resolved("{path: 'beam.point_masses[0].mass', also: ['beam.point_masses[1].mass'], values: [1 g, 2 g]}")
    assert len(axis.places) == 2


def test_sweep_rates_keep_their_unit():
    base = BASE + "sweep: {kind: swept_sine, from: 20 Hz, to: 90 Hz, rate: 2 oct/min}\n"
    (axis,) = resolved("{path: sweep.rate, values: [1.5 oct/min, 3 Hz/s]}", base=base)
    assert axis.values == ("0.025 oct/s", "3.0 Hz/s")
    text = study("{path: sweep.rate, from: 1 oct/min, to: 2 oct/min, points: 2}", base=base)
    assert "is a choice, which has no range" in refused(text)


@pytest.mark.parametrize(
    ("path", "tolerance", "half"),
    [
        ("beam.thickness", "2 %", 1e-4),
        ("beam.thickness", "0.1 mm", 1e-4),
        ("excitation.level", "0.1 g", 0.980665),
        ("snubbers.tip.gap", "0.05 mm", 5e-5),
    ],
)
def test_tolerances_are_relative_in_percent_and_absolute_in_units(path, tolerance, half):
    (axis,) = resolved(f"{{path: {path}, tolerance: {tolerance}}}")
    assert 0.5 * (axis.high - axis.low) == pytest.approx(half, rel=1e-12)
    assert 0.5 * (axis.high + axis.low) == pytest.approx(axis.nominal, abs=1e-15)


@pytest.mark.parametrize("kind", ["grid", "zip", "latin_hypercube"])
def test_the_resolved_text_loads_to_the_same_study(kind):
    extra = "  samples: 5\n  seed: 3\n" if kind == "latin_hypercube" else ""
    points = "" if kind == "latin_hypercube" else ", points: 2"
    text = study(
        f"{{path: beam.thickness, from: 4 mm, to: 6 mm{points}, spacing: logarithmic}}",
        f"{{path: beam.density, tolerance: 1 %{points}}}",
        kind=kind,
        extra=extra,
    )
    scenario = load_scenario(text + "limits: {peak_force: 50 N, bending_stress: 80 MPa, gap: 1 mm}\n")
    again = load_scenario(scenario.to_yaml())
    assert again == scenario
    assert varied_parameters(again) == varied_parameters(scenario)
    assert scenario.limits.values_by_name == {"peak_force": 50.0, "bending_stress": 80e6, "gap": 1e-3}


def test_a_grid_of_ten_million_cases_is_refused_without_being_built():
    text = refused(
        study(
            "{path: beam.thickness, from: 4 mm, to: 6 mm, points: 10000}",
            "{path: snubbers.tip.gap, from: 0, to: 1 mm, points: 1000}",
        )
    )
    assert "vary asks for 1e+07 cases (at most 200 000 are computed)" in text
    assert "latin_hypercube" in text


def test_limits_of_what_the_structure_does_not_have():
    chain = (
        "chain: {masses: [1, 1], springs: [1, 1, 1]}\n"
        "excitation: {kind: harmonic, applied_to: {mass: 1}, level: 1 N, frequency: 1 Hz}\n"
        "limits: {bending_stress: 1 MPa, gap: 1 mm}\n"
    )
    text = refused(chain)
    assert "limits.bending_stress needs a body whose stress is known" in text
    assert "limits.gap limits the snubbers, and there are none" in text
